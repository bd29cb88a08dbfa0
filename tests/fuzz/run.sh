#!/bin/sh
# Run every fuzz target of a build folder for some seconds; a crash is a failure, and its input stays beside it.
# usage: tests/fuzz/run.sh BUILD_FOLDER SECONDS
set -eu
folder=$1/tests/fuzz seconds=$2
for target in "$folder"/fuzz_read "$folder"/fuzz_model "$folder"/fuzz_spec "$folder"/fuzz_plan; do
    name=${target##*/fuzz_}
    mkdir -p "$folder/corpus/$name"
    "$folder/make_seeds" "$name" "$folder/corpus/$name"
    echo "== $name, $seconds s"
    "$target" -max_total_time="$seconds" -max_len=8192 -timeout=10 -rss_limit_mb=2048 -print_final_stats=1 \
        -artifact_prefix="$folder/$name-" "$folder/corpus/$name" 2>"$folder/$name.log" || {
        tail -n 40 "$folder/$name.log"
        exit 1
    }
    grep -E 'stat::number_of_executed_units|cov:' "$folder/$name.log" | tail -n 2
done
