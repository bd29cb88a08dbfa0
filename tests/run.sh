#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Run every test of a build folder and sum up: programs, and the scripts that drive the program. Each prints TAP ("ok",
# "not ok", "ok ... # SKIP"). As many run at a time as there are processors; beside them, two at a time, those that wait.
# usage: tests/run.sh BUILD_FOLDER [NAME ...]     only the tests whose path holds one of the names
# Exit status 1 when anything failed; last line "N passed, N failed, N skipped".
set -u
build=$1
shift
export GONIO_BUILD=$build GONIO="$PWD/$build/gonio" GONIO_DATA="${GONIO_DATA:-../shared/data}"
export CMOCKA_MESSAGE_OUTPUT=TAP ASAN_OPTIONS="${ASAN_OPTIONS:-detect_leaks=1}"
logs=$build/test-logs
# Seconds of a processor that this shell's children took, both kinds. (The second line of times: "1m2.3s 0m4.5s".)
processor() {
    awk 'NR == 2 { for (i = 1; i <= 2; i++) { split($i, part, "m"); sum += 60 * part[1] + part[2] } printf "%.0f", sum }' "$1"
    rm -f "$1"
}
# Run one test: its output to a log, its counts beside it, and a line about it.
one() {
    test=$1
    log=$logs/$(echo "$test" | tr '/' '_').tap
    start=$(date +%s)
    timeout 600 "$test" >"$log" 2>&1
    status=$?
    times >"${log%.tap}.times"
    # cmocka 1.1.5 prints a skipped test as "not ok N # SKIP name".
    s=$(grep -ciE '^(not )?ok .*# *skip' "$log")
    p=$(grep '^ok ' "$log" | grep -vciE '# *skip')
    f=$(grep '^not ok ' "$log" | grep -vciE '# *skip')
    # A program that dies prints no "not ok" of its own.
    [ $status -ne 0 ] && [ "$f" -eq 0 ] && f=1
    [ $status -eq 0 ] && [ $((p + s + f)) -eq 0 ] && f=1
    echo "$p $f $s" >"${log%.tap}.count"
    {
        printf '%-60s %4d passed %3d failed %3d skipped  %4d s, of a processor %4d s\n' "$test" "$p" "$f" "$s" $(($(date +%s) - start)) "$(processor "${log%.tap}.times")"
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
long='firmware\.sh|board|faults|lobe_spline|extrapolation|smooth|calib_budget|sigma|conformance|intrinsics|durability|calibrate\.sh|session\.sh|rig\.sh'
longest_first() { awk -v long="$long" '$0 ~ long { print; next } { rest = rest $0 "\n" } END { printf "%s", rest }'; }
{ scripts; programs; } | grep -E "$waiting" | longest_first | wanted "$@" | xargs -r -P 2 -n 1 "$0" "$build" --one &
{ programs; scripts; } | grep -vE "$waiting" | longest_first | wanted "$@" | xargs -r -P "$(nproc)" -n 1 "$0" "$build" --one
wait
cat "$logs"/*.count 2>/dev/null | awk '{ p += $1; f += $2; s += $3 }
    END { printf "%d passed, %d failed, %d skipped\n", p, f, s; exit f > 0 || p + s == 0 }' >"$logs/summary"
failed=$?
cat "$logs/summary"
exit $failed
