#!/bin/sh
# accumulate.sh BUILD FOLDER [SECONDS]: runs every fuzz target of BUILD for SECONDS (60) more, and prints how often each
# has run in all. Can be stopped and started again at any time: FOLDER keeps the totals, and each run
# has other mutations. Without libFuzzer (preset fuzz) the corpus is that of the source tree, with it
# what is found new is kept in FOLDER, too.
set -eu
mkdir -p "$2"
build=$(cd "$1" && pwd)
folder=$(cd "$2" && pwd)
seconds=${3:-60}
corpus=$(cd "$(dirname "$0")" && pwd)/corpus
failed=0
for program in "$build"/tests/fuzz_*; do
    [ -x "$program" ] || continue
    name=${program##*/fuzz_}
    [ "$name" != foreign ] || continue # tests/attack/long.sh
    case $name in client) inputs=$corpus/hgp_s2c ;; *) inputs=$corpus/$name ;; esac
    total=$(cat "$folder/$name.total" 2>/dev/null || echo 0)
    round=$(cat "$folder/$name.round" 2>/dev/null || echo 0)
    round=$((round + 1))
    if "$program" -help=1 2>/dev/null | grep -q max_total_time; then
        mkdir -p "$folder/$name"
        "$program" -max_total_time="$seconds" -timeout=60 -rss_limit_mb=2048 -print_final_stats=1 \
            -artifact_prefix="$folder/$name-" "$folder/$name" "$inputs" >"$folder/$name.log" 2>&1 || failed=1
        runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$folder/$name.log")
    else
        (cd "$folder" && HELIO_FUZZ_SEED=$round "$program" "$inputs" "$seconds") >"$folder/$name.log" 2>&1 || failed=1
        runs=$(sed -n 's/^[0-9]* inputs, \([0-9]*\) mutations$/\1/p' "$folder/$name.log")
    fi
    if [ -z "$runs" ]; then
        echo "$name: failed in round $round: $folder/$name.log"
        failed=1
        runs=0
    fi
    total=$((total + runs))
    echo "$total" >"$folder/$name.total"
    echo "$round" >"$folder/$name.round"
    printf '%-12s %12d runs in all, %d in round %d\n' "$name" "$total" "$runs" "$round"
done
exit $failed
