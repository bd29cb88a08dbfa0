#!/bin/sh
# The slow suites in a bounded form, as CI runs them after `make test`: a minute of fuzzing a target, and the virtual
# machine. Prints TAP; the last line sums up, and so does BUILD/test-logs/summary-slow.
# usage: tests/slow.sh BUILD_FOLDER
set -u
build=$1
logs=$build/test-logs
mkdir -p "$logs"
seconds=${FUZZ_SECONDS:-60}
# One suite of TAP lines; a suite that ends badly without telling of a failure is one.
suite() {
    log=$logs/slow-$1.tap
    shift
    "$@" >"$log" 2>&1
    status=$?
    [ $status -eq 0 ] || grep -q '^not ok ' "$log" || echo "not ok - $*: status $status" >>"$log"
    grep -E '^(ok|not ok) |^# ' "$log"
    grep -q '^not ok ' "$log" && tail -n 30 "$log" | grep -vE '^(ok|not ok) '
}
make="make --no-print-directory B=$build"
suite fuzz $make fuzz FUZZ_SECONDS="$seconds"
suite firmware $make fuzz-firmware FUZZ_SECONDS="$seconds"
# A machine without KVM that others load as well may take minutes.
suite vm env LIMIT=900 $make test-vm
skipped=$(cat "$logs"/slow-*.tap | grep -c '^ok .*# SKIP')
passed=$(cat "$logs"/slow-*.tap | grep '^ok ' | grep -vc '# SKIP')
failed=$(cat "$logs"/slow-*.tap | grep -c '^not ok ')
echo "$passed passed, $failed failed, $skipped skipped" | tee "$logs/summary-slow"
[ "$failed" -eq 0 ]
