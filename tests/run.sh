#!/bin/sh
# Run every test program of a build folder and sum up. Each prints TAP ("ok", "not ok", "ok ... # SKIP").
# usage: tests/run.sh BUILD_FOLDER [NAME ...]     only the tests whose path holds one of the names
# Exit status 1 when anything failed; last line "N passed, N failed, N skipped".
set -u
build=$1
shift
export GONIO_BUILD=$build GONIO="$PWD/$build/gonio" GONIO_DATA="${GONIO_DATA:-../shared/data}"
export CMOCKA_MESSAGE_OUTPUT=TAP ASAN_OPTIONS="${ASAN_OPTIONS:-detect_leaks=1}" OMP_WAIT_POLICY=passive
logs=$build/test-logs
mkdir -p "$logs"
passed=0 failed=0 skipped=0
wanted() {
    [ $# -eq 1 ] && return 0
    path=$1
    shift
    for name; do case $path in *"$name"*) return 0 ;; esac; done
    return 1
}
for test in $(find "$build/asan/tests" -type f -perm -u+x 2>/dev/null | sort) $(find tests/system -name '*.sh' ! -name 'lib.sh' | sort); do
    wanted "$test" "$@" || continue
    log=$logs/$(echo "$test" | tr '/' '_').tap
    start=$(date +%s)
    timeout 600 "$test" >"$log" 2>&1
    status=$?
    # cmocka 1.1.5 prints a skipped test as "not ok N # SKIP name".
    s=$(grep -ciE '^(not )?ok .*# *skip' "$log")
    p=$(grep '^ok ' "$log" | grep -vciE '# *skip')
    f=$(grep '^not ok ' "$log" | grep -vciE '# *skip')
    # A program that dies prints no "not ok" of its own.
    [ $status -ne 0 ] && [ "$f" -eq 0 ] && f=1
    [ $status -eq 0 ] && [ $((p + s + f)) -eq 0 ] && f=1
    passed=$((passed + p)) failed=$((failed + f)) skipped=$((skipped + s))
    printf '%-60s %4d passed %3d failed %3d skipped  %4d s\n' "$test" "$p" "$f" "$s" $(($(date +%s) - start))
    if [ "$f" -gt 0 ]; then
        grep -vE '^ok ' "$log" | tail -n 60
    fi
    grep -iE '^(not )?ok .*# *skip' "$log"
done
echo "$passed passed, $failed failed, $skipped skipped" | tee "$logs/summary"
[ $failed -eq 0 ] && [ $((passed + skipped)) -gt 0 ]
