#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# The slow suites in a bounded form, as CI runs them after `make test`: a minute of fuzzing a target and of the
# durability campaign, 500 disturbed measures, the virtual machine, the packages, independent readers. Prints TAP; the last line sums up, and so does BUILD/test-logs/summary-slow.
# usage: tests/slow.sh BUILD_FOLDER
set -u
build=$1
logs=$build/test-logs
mkdir -p "$logs"
seconds=${FUZZ_SECONDS:-60}
# What is worth a line while it runs: what is built, what runs, how it ended. libFuzzer's own lines stay in the log.
telling='^(ok|not ok) |^# |^  [A-Z]+ +[^ ]'
# One suite of TAP lines; a suite that ends badly without telling of a failure is one.
suite() {
    log=$logs/slow-$1.tap
    echo "$1: $2"
    shift 2
    { "$@" 2>&1; echo $? >"$log.status"; } | tee "$log" | grep --line-buffered -E "$telling"
    status=$(cat "$log.status")
    rm -f "$log.status"
    [ "$status" -eq 0 ] || grep -q '^not ok ' "$log" || echo "not ok - $*: status $status" | tee -a "$log"
    grep -q '^not ok ' "$log" && tail -n 30 "$log" | grep -vE "$telling"
}
make="make --no-print-directory B=$build"
suite fuzz "clang builds the targets, then $seconds s each" $make fuzz FUZZ_SECONDS="$seconds"
suite firmware "clang builds the Modbus slave, then $seconds s" $make fuzz-firmware FUZZ_SECONDS="$seconds"
suite durability "sessions killed, cut off from power and damaged, 60 s" $make durability SECONDS=60 FIRST=100000
suite faults "500 measures disturbed by seeded faults" $make faults FAULTS=500
# A machine without KVM that others load as well may take minutes.
suite vm "the device tests in a virtual machine" env LIMIT=900 $make test-vm
# Building, unpacking and installing takes some minutes; a mirror that hangs must not take hours.
suite packages "the Debian packages in a fresh system" timeout -k 60 2400 $make test-packages
# Renderers and validators, as far as mirrors have them: minutes to fetch, then eight at most.
timeout -k 30 600 env LIMIT=280 $make deps-peers
suite peers "independent programs read our files" timeout -k 30 1200 $make test-peers
skipped=$(cat "$logs"/slow-*.tap | grep -c '^ok .*# SKIP')
passed=$(cat "$logs"/slow-*.tap | grep '^ok ' | grep -vc '# SKIP')
failed=$(cat "$logs"/slow-*.tap | grep -c '^not ok ')
echo "$passed passed, $failed failed, $skipped skipped" | tee "$logs/summary-slow"
[ "$failed" -eq 0 ]
