#!/bin/sh
# long.sh BUILD FOLDER RUN [PARTS]: the long runs of docs/security.md, one command each. FOLDER keeps logs and
# how far a run is; readers, foreign and kills go on where they were stopped, whenever that was.
#
#   readers   HELIO_MUTANTS (1000000) mutants, in process, for each reader of our own, or for those of
#             HELIO_READERS; what FOLDER/NAME.total says was done before counts
#   foreign   HELIO_FOREIGN (20000) mutants of each file of a foreign format, each in a loader
#   kills     HELIO_ALL_KILLS (1000) kills of the daemon, every fourth with one of its worker, in rounds of 50; a
#             tenth as many of real workers, and of loaders, in rounds of 5, whose daemon is to go on
#   soak      HELIO_SOAK_SESSIONS (10000) hostile sessions beside 10 honest ones for HELIO_SOAK_SECONDS (900, after
#             as many of warming up) of the daemon's processor time, HELIO_SOAK_HELD (12000) connections held; with a
#             BUILD of the preset asan under its sanitizers
#   siege     times of an honest client beside attacks
#   sum       what readers and foreign have come to in FOLDER and its parts
#
# PARTS processes share a run of readers or foreign: each has other mutants and its own folder below FOLDER, and
# may be continued with the same number of parts only. HELIO_LONG_SECONDS: after so many seconds they stop.
set -eu
build=$(cd "$1" && pwd)
mkdir -p "$2"
folder=$(cd "$2" && pwd)
source=$(cd "$(dirname "$0")/../.." && pwd)
corpus=$source/tests/fuzz/corpus
export HELIO_SOURCE_DIR="$source" HELIO_BUILD_DIR="$build" LP_NUM_THREADS="${LP_NUM_THREADS:-1}"
export UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1
export MESA_SHADER_CACHE_DIR="${MESA_SHADER_CACHE_DIR:-$build/tests/compiled_shaders}"

part=${HELIO_PART:-0} parts=${HELIO_PARTS:-1}
begun=$(date +%s)

number_in() { # file
    cat "$1" 2>/dev/null || echo 0
}

time_left() {
    [ $(($(date +%s) - begun)) -lt "${HELIO_LONG_SECONDS:-999999999}" ]
}

# Seeds of a part follow from its number: 10^5 rounds each.
readers() {
    failed=0
    for name in ${HELIO_READERS:-asset_pack gltf heightmap ies image lod obj off page ply stl}; do
        before=0
        [ "$parts" -eq 1 ] || before=$(number_in "$folder/../$name.total")
        most=$(((${HELIO_MUTANTS:-1000000} - before + parts - 1) / parts))
        total=$(number_in "$folder/$name.total")
        round=$(number_in "$folder/$name.round")
        while [ "$total" -lt $most ] && time_left; do
            round=$((round + 1))
            log=$folder/$name.log
            if ! (cd "$folder" && HELIO_FUZZ_SEED=$((round + (parts > 1 ? part + 1 : 0) * 100000)) \
                "$build/tests/fuzz_$name" "$corpus/$name" "${HELIO_ROUND_SECONDS:-60}") >"$log" 2>&1; then
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

# All files come as far before one goes on. A part has the mutants of an equal range of numbers.
foreign() {
    all=${HELIO_FOREIGN:-20000}
    count=$((all * part / parts))
    most=$((all * (part + 1) / parts))
    first=$count
    while [ $count -lt $most ] && time_left; do
        count=$((count + ${HELIO_FOREIGN_STEP:-250}))
        [ $count -le $most ] || count=$most
        HELIO_LOADER=$build/libexec/helio-loader "$build/tests/fuzz_foreign" "$corpus/foreign" $count \
            "$folder/foreign.state" $first >>"$folder/foreign.log"
    done
    echo "foreign: up to mutant $count of each file"
}

sum() {
    cat "$folder"/foreign.log "$folder"/part.*/foreign.log 2>/dev/null | awk '
        / mutants: / { file[$1] += $2; for (i = 4; i <= NF; i++) if ($i ~ /^[0-9]+$/) n = $i; else {
            word = word == "" ? $i : word " " $i; if (i == NF || $i ~ /,$/) { sub(/,/, "", word); of[word] += n; word = "" } } }
        / s of processor time/ { seconds += $1 }
        END { for (f in file) print "foreign " f ": " file[f] " mutants"; for (w in of) print "foreign: " of[w] " " w
              if (seconds) print "foreign: " seconds " s of processor time" }' | sort
    for file in "$folder"/*.total "$folder"/part.*/*.total; do
        [ -e "$file" ] && echo "$(basename "$file" .total) $(cat "$file")"
    done | awk '{ of[$1] += $2 } END { for (name in of) print name ": " of[name] }' | sort
}

in_parts() { # run
    pids=
    for i in $(seq 0 $((parts - 1))); do
        HELIO_PART=$i HELIO_PARTS=$parts "$0" "$build" "$folder/part.$i" "$1" >"$folder/part.$i.log" 2>&1 &
        pids="$pids $!"
    done
    failed=0
    for pid in $pids; do
        wait "$pid" || failed=1
    done
    [ $failed -eq 0 ] || cat "$folder"/part.*.log
    sum
    return $failed
}

kills() {
    total=$(number_in "$folder/kills.total")
    while [ "$total" -lt "${HELIO_ALL_KILLS:-1000}" ]; do
        HELIO_KILLS=50 "$build/tests/test_restarts" >"$folder/kills.round.log" 2>&1 ||
            { cat "$folder/kills.round.log"; return 1; }
        grep ' kills: ' "$folder/kills.round.log" | tee -a "$folder/kills.log"
        for what in workers loaders; do
            HELIO_KILLS=5 "$build/tests/test_real_restarts" "killed_$what*" >"$folder/kills.round.log" 2>&1 ||
                { cat "$folder/kills.round.log"; return 1; }
            grep " kills of $what: " "$folder/kills.round.log" | tee -a "$folder/kills.log"
        done
        total=$((total + 50))
        echo "$total" >"$folder/kills.total"
    done
    echo "kills: $total, and of workers and loaders $((total / 10)) each"
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
readers | foreign)
    if [ "${4:-1}" -gt 1 ]; then
        parts=$4
        in_parts "$3"
    else
        "$3"
    fi
    ;;
kills | soak | siege | sum) "$3" ;;
*)
    sed -n '2,/^set/p' "$0" | sed '$d' >&2
    exit 2
    ;;
esac
