#!/bin/sh
# Run fuzz targets of a build folder for some seconds each; a crash is a failure, and its input stays beside it.
# The committed inputs (tests/fuzz/corpus/NAME) and freshly made seeds are where each begins; what it finds stays in the
# build folder.
# usage: tests/fuzz/run.sh BUILD_FOLDER SECONDS NAME ...
set -eu
folder=$1/tests/fuzz seconds=$2
shift 2
failed=0
for name; do
    found=$folder/corpus/$name committed=tests/fuzz/corpus/$name log=$folder/$name.log
    mkdir -p "$found" "$committed"
    case $name in read | model | spec | plan) "$folder/make_seeds" "$name" "$found" ;; esac
    echo "== $name, $seconds s"
    if "$folder/fuzz_$name" -max_total_time="$seconds" -max_len=8192 -timeout=10 -rss_limit_mb=2048 \
        -print_final_stats=1 -artifact_prefix="$folder/$name-" "$found" "$committed" 2>"$log"; then
        echo "ok - fuzzing $name: $(sed -n 's/^stat::number_of_executed_units: *//p' "$log") inputs, $(grep -o 'cov: [0-9]*' "$log" | tail -n 1)"
    else
        tail -n 40 "$log"
        echo "not ok - fuzzing $name"
        failed=1
    fi
done
exit $failed
