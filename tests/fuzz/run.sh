#!/bin/sh
# SPDX-License-Identifier: BSD-3-Clause
# Run fuzz targets of a build folder for some seconds each, as many at a time as there are processors; a crash is a
# failure, and its input stays in the build folder. Each begins with the committed inputs (tests/fuzz/corpus/NAME) and
# with what was found before.
# usage: tests/fuzz/run.sh BUILD_FOLDER SECONDS NAME ...
set -eu
folder=$1/tests/fuzz seconds=$2
one() {
    name=$1 found=$folder/corpus/$1 committed=tests/fuzz/corpus/$1 log=$folder/$1.log
    mkdir -p "$found" "$committed"
    echo "# fuzzing $name for $seconds s"
    case $name in read | model | spec | plan) "$folder/make_seeds" "$name" "$found" ;; esac
    if "$folder/fuzz_$name" -max_total_time="$seconds" -max_len=8192 -timeout=10 -rss_limit_mb=2048 \
        -print_final_stats=1 -artifact_prefix="$folder/$name-" "$found" "$committed" 2>"$log"; then
        inputs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log")
        echo "ok - fuzzing $name for $seconds s: $inputs inputs, $(grep -o 'cov: [0-9]*' "$log" | tail -n 1)"
    else
        echo "not ok - fuzzing $name"
        tail -n 40 "$log" | sed 's/^/# /'
        return 1
    fi
}
if [ "$3" = --one ]; then
    one "$4"
    exit
fi
shift 2
printf '%s\n' "$@" | xargs -P "$(nproc)" -I NAME "$0" "${folder%/tests/fuzz}" "$seconds" --one NAME
