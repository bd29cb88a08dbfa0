#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# 100 seeds of the fault campaign (`make faults` runs 10,000; docs/reliability.md). Prints TAP.
set -u
. "$(dirname "$0")/lib.sh"
faults=${GONIO%/*}/tests/faults/faults
if [ ! -x "$faults" ]; then
    skip "100 measures with seeded faults" "$faults is not built"
elif "$faults" --count 100 --jobs 2 >"$work/log" 2>&1; then
    pass "100 measures with seeded faults: $(sed -n 's/.*measures were hit: //p' "$work/log")"
else
    fail "100 measures with seeded faults" "$(grep FAILED "$work/log" | cut -c1-400)" "$(tail -n 3 "$work/log")" "make faults SEED=n repeats one"
fi
finish
