#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Run every test program of a build folder and sum up. Each prints TAP ("ok", "not ok", "ok ... # SKIP"). Programs run as
# many at a time as there are processors; the scripts that drive the program, which itself takes all of them, one by one;
# beside both, two at a time, those that wait.
# usage: tests/run.sh BUILD_FOLDER [NAME ...]     only the tests whose path holds one of the names
# Exit status 1 when anything failed; last line "N passed, N failed, N skipped".
set -u
build=$1
shift
export GONIO_BUILD=$build GONIO="$PWD/$build/gonio" GONIO_DATA="${GONIO_DATA:-../shared/data}"
export CMOCKA_MESSAGE_OUTPUT=TAP ASAN_OPTIONS="${ASAN_OPTIONS:-detect_leaks=1}"
logs=$build/test-logs
# Run one test: its output to a log, its counts beside it, and a line about it.
one() {
    test=$1
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
    echo "$p $f $s" >"${log%.tap}.count"
    {
        printf '%-60s %4d passed %3d failed %3d skipped  %4d s\n' "$test" "$p" "$f" "$s" $(($(date +%s) - start))
        [ "$f" -gt 0 ] && grep -vE '^ok ' "$log" | tail -n 60
        grep -iE '^(not )?ok .*# *skip' "$log"
    } >"${log%.tap}.told"
    cat "${log%.tap}.told" # at once, so that two tests' lines do not mix
}
if [ "${1:-}" = --one ]; then
    one "$2"
    exit 0
fi
wanted() {
    while read -r test; do
        [ $# -eq 0 ] && echo "$test"
        for name; do case $test in *"$name"*) echo "$test" && break ;; esac; done
    done
}
mkdir -p "$logs"
rm -f "$logs"/*.count "$logs"/*.told
programs() { find "$build/asan/tests" -type f -perm -u+x 2>/dev/null | sort; }
scripts() { find tests/system -name '*.sh' ! -name 'lib.sh' | sort; }
# What mostly waits for a machine's clock, or uses one processor for minutes, goes beside all the others from the
# beginning.
waiting='/(board|calibrate_rig|control|faults|firmware)\.sh$|/test_(camera_aravis|control|controller|stage_lines|stage_modbus|usbtmc)$'
# The longest first, so that no processor waits for one at the end.
long='firmware\.sh|board|faults|lobe_spline|extrapolation|smooth|calib_budget|sigma|conformance|intrinsics'
longest_first() { awk -v long="$long" '$0 ~ long { print; next } { rest = rest $0 "\n" } END { printf "%s", rest }'; }
{ scripts; programs; } | grep -E "$waiting" | longest_first | wanted "$@" | xargs -r -P 2 -n 1 "$0" "$build" --one &
programs | grep -vE "$waiting" | longest_first | wanted "$@" | xargs -r -P "$(nproc)" -n 1 "$0" "$build" --one
scripts | grep -vE "$waiting" | wanted "$@" | xargs -r -n 1 "$0" "$build" --one
wait
cat "$logs"/*.count 2>/dev/null | awk '{ p += $1; f += $2; s += $3 }
    END { printf "%d passed, %d failed, %d skipped\n", p, f, s; exit f > 0 || p + s == 0 }' >"$logs/summary"
failed=$?
cat "$logs/summary"
exit $failed
