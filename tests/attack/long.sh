#!/bin/sh
# long.sh BUILD FOLDER RUN: the long runs of docs/security.md, one command each. FOLDER keeps logs and how far
# a run is; readers, foreign and kills go on where they were stopped, whenever that was.
#
#   readers   HELIO_MUTANTS (1000000) mutants, in process, for each reader of our own
#   foreign   HELIO_FOREIGN (20000) mutants of each file of a foreign format, each in a loader
#   kills     HELIO_ALL_KILLS (1000) kills of the daemon, every fourth with one of its worker, in rounds of 50; a
#             tenth as many of loaders, in rounds of 5, whose worker and daemon are to go on
#   soak      HELIO_SOAK_SESSIONS (10000) hostile sessions beside 10 honest ones for HELIO_SOAK_SECONDS (900, after
#             as many of warming up) of the daemon's processor time, HELIO_SOAK_HELD (12000) connections held; with a
#             BUILD of the preset asan under its sanitizers
#   siege     times of an honest client beside attacks
set -eu
build=$(cd "$1" && pwd)
mkdir -p "$2"
folder=$(cd "$2" && pwd)
source=$(cd "$(dirname "$0")/../.." && pwd)
corpus=$source/tests/fuzz/corpus
export HELIO_SOURCE_DIR="$source" HELIO_BUILD_DIR="$build" LP_NUM_THREADS="${LP_NUM_THREADS:-1}"
export UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1
export MESA_SHADER_CACHE_DIR="${MESA_SHADER_CACHE_DIR:-$build/tests/compiled_shaders}"

number_in() { # file
    cat "$1" 2>/dev/null || echo 0
}

readers() {
    failed=0
    for name in asset_pack gltf heightmap ies image lod obj off page ply stl; do
        total=$(number_in "$folder/$name.total")
        round=$(number_in "$folder/$name.round")
        while [ "$total" -lt "${HELIO_MUTANTS:-1000000}" ]; do
            round=$((round + 1))
            log=$folder/$name.log
            if ! (cd "$folder" && HELIO_FUZZ_SEED=$round "$build/tests/fuzz_$name" "$corpus/$name" 60) >"$log" 2>&1; then
                echo "$name: failed in round $round: $log"
                failed=1
                break
            fi
            total=$((total + $(sed -n 's/^[0-9]* inputs, \([0-9]*\) mutations$/\1/p' "$log")))
            echo "$total" >"$folder/$name.total"
            echo "$round" >"$folder/$name.round"
        done
        echo "$name: $total mutants"
    done
    return $failed
}

# All files come as far before one goes on.
foreign() {
    most=${HELIO_FOREIGN:-20000}
    count=0
    while [ $count -lt "$most" ]; do
        count=$((count + 1000))
        [ $count -le "$most" ] || count=$most
        HELIO_LOADER=$build/libexec/helio-loader "$build/tests/fuzz_foreign" "$corpus/foreign" $count \
            "$folder/foreign.state" >>"$folder/foreign.log"
        echo "foreign: $count mutants of each file"
    done
    for outcome in "read" "refused" "crashed" "out of processor time" "out of time" "out of memory"; do
        grep -o "[0-9]* $outcome" "$folder/foreign.log" | awk -v what="$outcome" '{ sum += $1 } END { print "  " sum, what }'
    done
}

kills() {
    total=$(number_in "$folder/kills.total")
    while [ "$total" -lt "${HELIO_ALL_KILLS:-1000}" ]; do
        HELIO_KILLS=50 "$build/tests/test_restarts" >"$folder/kills.round.log" 2>&1 ||
            { cat "$folder/kills.round.log"; return 1; }
        grep ' kills: ' "$folder/kills.round.log" | tee -a "$folder/kills.log"
        HELIO_KILLS=5 "$build/tests/test_real_restarts" 'killed_loaders*' >"$folder/kills.round.log" 2>&1 ||
            { cat "$folder/kills.round.log"; return 1; }
        grep ' kills of loaders: ' "$folder/kills.round.log" | tee -a "$folder/kills.log"
        total=$((total + 50))
        echo "$total" >"$folder/kills.total"
    done
    echo "kills: $total, and of loaders $((total / 10))"
}

soak() {
    HELIO_SOAK_SESSIONS=${HELIO_SOAK_SESSIONS:-10000} HELIO_SOAK_SECONDS=${HELIO_SOAK_SECONDS:-900} \
        HELIO_SOAK_HELD=${HELIO_SOAK_HELD:-12000} "$build/tests/test_attack_soak" 2>&1 | tee "$folder/soak.log"
    grep -q '  PASSED  ' "$folder/soak.log"
}

siege() {
    "$build/bin/helio" bench siege | tee "$folder/siege.json"
}

case ${3-} in
readers | foreign | kills | soak | siege) "$3" ;;
*)
    sed -n '2,/^set/p' "$0" | sed '$d' >&2
    exit 2
    ;;
esac
