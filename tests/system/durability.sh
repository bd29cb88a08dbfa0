#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Some seeds of every durability campaign (`make durability` runs them in full; docs/reliability.md). Prints TAP.
set -u
. "$(dirname "$0")/lib.sh"
folder=${GONIO%/*}/tests/durability
# some NAME COUNT ...: so many cases of these campaigns; a line of theirs is a test of ours.
some() {
    "$folder/durability" --program "$GONIO" --library "$folder/shim.so" --jobs 2 "$@" >"$work/log" 2>"$work/err"
    status=$?
    grep -E '^(not )?ok ' "$work/log" >"$work/lines"
    if [ $status -eq 77 ]; then
        skip "durability" "no seccomp filters here"
    elif [ ! -s "$work/lines" ]; then
        fail "durability" "$(tail -n 3 "$work/err")"
    fi
    while read -r line; do
        case $line in
        ok*) pass "${line#ok * - }" ;;
        *) fail "${line#not ok * - }" "$(grep '^# FAILED' "$work/log" | cut -c1-400)" ;;
        esac
    done <"$work/lines"
}
if [ ! -x "$folder/durability" ]; then
    skip "durability" "$folder/durability is not built"
else
    some --count 7 --only situations,kill,strict,ordered,enospc,eio,eintr,emfile,eacces,short
    some --count 25 --only damage
fi
finish
