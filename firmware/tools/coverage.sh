#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Branch coverage of firmware/core by tests/unit/test_fw_*.c and tests/property/test_fw_*.c. usage: coverage.sh FOLDER
set -eu
folder=$1
rm -rf "$folder"
mkdir -p "$folder"
for source in firmware/core/*.c firmware/board/posix/machine.c; do
    gcc -std=c17 -O0 -g --coverage -I. -c "$source" -o "$folder/$(basename "$source" .c).o"
done
for test in tests/unit/test_fw_*.c tests/property/test_fw_*.c; do
    gcc -std=c17 -O0 -g -D_GNU_SOURCE -I. "$test" "$folder"/*.o --coverage -lcmocka -lm -o "$folder/test"
    GONIO_FW_SEQUENCES=300 GONIO_FW_BYTES=20000 "$folder/test" >/dev/null 2>&1 || echo "failed: $test"
done
cd "$folder"
for source in ../../firmware/core/*.c; do
    printf '%s: ' "$(basename "$source")"
    gcov -b -o . "$(basename "$source" .c).o" 2>/dev/null | awk -v f="$(basename "$source")" '
        $0 ~ "^File .*core/" f {on = 1} on && /^Taken at least once|^Branches executed|^No branches/ {print; if (/Taken|No/) exit}' | tail -1
done | awk -F '[:% ]+' '{print; for (i = 1; i < NF; i++) if ($i == "once") {taken += $(i + 1) * $NF / 100; total += $NF}}
    END {printf "branches taken: %.1f %% of %d\n", 100 * taken / total, total; exit taken < 0.95 * total}'
