#!/bin/bash
# farm.sh - many frames on machines that stop: whole files, files that are there already, commands that
# are killed and run again, embedded and through a daemon. Uses HELIO_BUILD_DIR.
. "$(dirname "$0")/../support/shell.sh"

told() { grep -q -- "$1" "$temp/out" || fail "'$1' is not told: $(tail -n 3 "$temp/out")"; }
stat_is() { # key value
    grep -q "\"$1\": $2,\?\$" "$temp/stats.json" || fail "$1 is not $2: $(grep "\"$1\"" "$temp/stats.json")"
}

worm=$models/worm.glb
knot=$models/knot/knot.gltf
for file in "$helio" "$heliod" "$worm" "$knot"; do need "$file"; done

render() { # folder options...: twelve frames of the worm
    local folder=$1
    shift
    ${run:-} "$helio" render "$worm" -o "$temp/$folder/f-##.png" --size 64x48 --samples 2 --exposure 0 --gi none --frames "${frames:-0-22:2}" --fps 20 \
        --stats "$temp/stats.json" "$@"
}
start_daemon "$models" "$temp"
mkdir "$temp/once" "$temp/again"
expect 0 render once --progress json
told '"index":1,"of":12'
told '"left_s"'

# What is there and whole is left alone; what is cut short, damaged, of another frame or of another
# program is made again, and then all is as it was.
cp "$temp"/once/*.png "$temp/again"
expect 0 render again --skip-existing
stat_is skipped_frames 12
truncate -s -20 "$temp/again/f-02.png"
printf 'x' | dd of="$temp/again/f-04.png" bs=1 seek=200 conv=notrunc 2>/dev/null
cp "$temp/once/f-00.png" "$temp/again/f-06.png"
echo "not a picture" >"$temp/again/f-08.png"
: >"$temp/again/f-10.png"
rm "$temp/again/f-12.png"
expect 0 render again --skip-existing
stat_is skipped_frames 6
told 'f-06.png: was made from something else; it is made again'
told 'f-02.png: .*; it is made again'
for f in "$temp"/once/*.png; do same "$f" "$temp/again/${f##*/}"; done
frames=0-0 expect 0 render again --skip-existing --seed 1 --connect "$url"
stat_is skipped_frames 0

# Other kinds of files.
for kind in exr jpg; do
    one=("$helio" render "$knot" -o "$temp/one.$kind" --size 64x48 --samples 2 --exposure 0 --gi none --skip-existing
        --stats "$temp/stats.json" --connect "$url")
    expect 0 "${one[@]}"
    stat_is skipped_frames 0
    cp "$temp/one.$kind" "$temp/kept.$kind"
    expect 0 "${one[@]}"
    stat_is skipped_frames 1
    truncate -s -9 "$temp/one.$kind"
    expect 0 "${one[@]}"
    stat_is skipped_frames 0
    same "$temp/one.$kind" "$temp/kept.$kind"
    expect 0 "${one[@]}" --exposure 1
    stat_is skipped_frames 0
done

# A file larger than a part of 16 MiB, on its way from the worker and to it.
large=("$helio" render "$knot" -o "$temp/large.exr" --size 2560x1600 --samples 1 --exposure 0 --gi none --exr float
    --env "$models/room.hdr" --eye 0,1,8 --target 0,5,0 --skip-existing --stats "$temp/stats.json")
expect 0 "${large[@]}"
[ "$(stat -c %s "$temp/large.exr")" -gt $((20 << 20)) ] || fail "the large file is not large"
stat_is bytes "$(stat -c %s "$temp/large.exr")"
expect 0 "${large[@]}"
stat_is skipped_frames 1
cp "$temp/large.exr" "$temp/large-kept.exr"

# The same scene elsewhere, through a daemon, is the same job.
expect 0 render once --skip-existing --connect "$url"
stat_is skipped_frames 12
expect 0 render once --skip-existing --connect "$url" --upload
stat_is skipped_frames 12
expect 0 "${large[@]}" --connect "$url"
stat_is skipped_frames 1
truncate -s -9 "$temp/large.exr"
expect 0 "${large[@]}" --connect "$url"
told 'it is made again'
same "$temp/large.exr" "$temp/large-kept.exr"
mkdir "$temp/moved"
cp "$worm" "$temp/moved/renamed.glb"
worm=$temp/moved/renamed.glb expect 0 render once --skip-existing
stat_is skipped_frames 12

# A seed of its own for each frame, whichever command renders it.
mkdir "$temp/seeds"
seeds() { expect 0 "$helio" render "$knot" -o "$temp/seeds/$1" --size 24x16 --mode path --spp 2 --connect "$url" "${@:2}"; }
expect 2 "$helio" render "$knot" -o "$temp/seeds/a.exr" --animate-seed
told 'needs --frames or --turntable'
seeds 'a#.exr' --frames 3-4 --animate-seed --seed 10
seeds 'b#.exr' --frames 4 --animate-seed --seed 10
seeds 'c#.exr' --frames 4 --seed 14
seeds 'd#.exr' --frames 3-4 --seed 10
same "$temp/seeds/a4.exr" "$temp/seeds/b4.exr"
same "$temp/seeds/a4.exr" "$temp/seeds/c4.exr"
expect 1 "$helio" compare "$temp/seeds/a3.exr" "$temp/seeds/a4.exr" --metric max --fail-above 0
expect 0 "$helio" compare "$temp/seeds/d3.exr" "$temp/seeds/d4.exr" --metric max --fail-above 0

# Killed in the middle: whole files only; the same command finishes the rest.
begins() { # file: it is there, or its maker has ended; watched without a rest
    while [ ! -e "$1" ] && kill -0 $client 2>/dev/null; do :; done
}
for round in 1 2 3; do # quick machines get another chance to be too quick
    rm -rf "$temp/killed"
    mkdir "$temp/killed"
    : >"$temp/out"
    run=exec render killed --progress none >"$temp/out" 2>&1 & # in place of the shell: it gets the signal
    client=$!
    begins "$temp/killed/f-00.png"
    kill -TERM $client 2>/dev/null
    wait $client
    code=$?
    [ $code = 8 ] && break
done
[ $code = 8 ] || fail "exit $code instead of 8 when stopped"
ls "$temp/killed" | grep -v '^f-[0-9][0-9]\.png$' && fail "a stopped command left something else"
[ -e "$temp/killed/f-22.png" ] && fail "the command was not stopped"
expect 0 render killed --skip-existing
for f in "$temp"/once/*.png; do same "$f" "$temp/killed/${f##*/}"; done

# Commands of the same line share the frames, and one of them is killed: whole files, no claims.
mkdir "$temp/shared"
run=exec render shared --claim --progress none >"$temp/out" 2>&1 &
client=$!
begins "$temp/shared/f-00.png"
kill -KILL $client 2>/dev/null
wait $client
run=exec render shared --claim --progress none >"$temp/other.out" 2>&1 &
client=$!
expect 0 render shared --claim --connect "$url"
wait $client || fail "exit $? of the other command: $(tail -n 2 "$temp/other.out")"
for f in "$temp"/once/*.png; do same "$f" "$temp/shared/${f##*/}"; done
ls -A "$temp/shared" | grep -v '^f-[0-9][0-9]\.png$' && fail "shared: something else is left"

# Path tracing: a film that is taken up gives the same file as one that was never stopped, planes and
# all; intervals; other jobs' checkpoints.
trace() { # out options...
    local out=$1
    shift
    ${run:-} "$helio" render "$knot" -o "$out" --size 96x64 --mode path --env sky --exposure 0 --exr float --spp 256 \
        --aov depth,cryptomatte,variance --stats "$temp/stats.json" "$@"
}
expect 0 trace "$temp/whole.exr" --connect "$url"
stat_is samples 256
grep -q '"rays": [1-9]' "$temp/stats.json" || fail "no rays were counted"
for round in 1 2 3; do
    : >"$temp/out"
    run=exec trace "$temp/part.exr" --progress json >"$temp/out" 2>&1 &
    client=$!
    begun() { grep -q '"samples","done":[1-9]' "$temp/out" || ! kill -0 $client 2>/dev/null; }
    until_true begun
    kill -TERM $(pgrep -P $client) $client 2>/dev/null # all of a service at once, as systemd does
    wait $client
    code=$?
    [ $code = 8 ] && break
    rm -f "$temp/part.exr"
done
[ $code = 8 ] || fail "exit $code instead of 8 when stopped in path mode"
[ -e "$temp/part.exr" ] && fail "half a picture was written"
[ -s "$temp/part.exr.checkpoint" ] || fail "no checkpoint was left"
expect 0 trace "$temp/other.exr" --spp 8 --resume --seed 3 --connect "$url"
cp "$temp/part.exr.checkpoint" "$temp/other.exr.checkpoint"
expect 0 trace "$temp/other.exr" --spp 8 --resume --seed 3 --connect "$url"
told 'is of another picture'
cp "$temp/part.exr.checkpoint" "$temp/more.exr.checkpoint" # the number of samples determines their pattern
expect 2 trace "$temp/more.exr" --spp 512 --resume --connect "$url"
told 'more.exr.checkpoint holds [0-9]* of the 256 samples .*continue with --samples 256'
same "$temp/part.exr.checkpoint" "$temp/more.exr.checkpoint"
[ -e "$temp/more.exr" ] && fail "a refused film left a picture"
expect 0 trace "$temp/part.exr" --resume --connect "$url"
told 'goes on from [1-9][0-9]* samples'
same "$temp/whole.exr" "$temp/part.exr"
[ -e "$temp/part.exr.checkpoint" ] && fail "the checkpoint is still there"
expect 0 trace "$temp/part.exr" --skip-existing
stat_is skipped_frames 1
# A disk that takes neither film nor picture: nothing is left, and nothing is promised.
for samples in 256 1024 4096 16384; do
    run='prlimit --fsize=8192' expect 6 trace "$temp/full.exr" --spp $samples --checkpoint 1 --connect "$url"
    grep -q 'full.exr.checkpoint: .*the rendering goes on' "$temp/out" && break
done
told 'the rendering goes on'
told 'nothing of the film was kept'
grep -q 'goes on from there' "$temp/out" && fail "a film that was not kept is promised to go on"
ls "$temp"/full.exr* 2>/dev/null && fail "a full disk has a stub"
expect 0 trace "$temp/limit.exr" --spp 60000 --time 1 --connect "$url"

# A worker that dies in the middle: the next one goes on from the newest film that was kept.
for round in 1 2 3; do
    rm -f "$temp/dies.exr" "$temp/dies.exr.checkpoint"
    run=exec trace "$temp/dies.exr" --checkpoint 1 --connect "$url" >"$temp/out" 2>&1 &
    client=$!
    begun() { # the first film kept may be one without samples
        [ -n "$(find "$temp" -name dies.exr.checkpoint -size +8k)" ] || ! kill -0 $client 2>/dev/null
    }
    until_true begun
    kill -KILL $(pgrep -P $daemon helio-worker)
    wait $client || fail "exit $? when the worker died"
    grep -q 'goes on from' "$temp/out" && break
done
told 'it ended and is replaced'
told 'goes on from [1-9][0-9]* samples'
same "$temp/whole.exr" "$temp/dies.exr"

# A daemon that is stopped gives its clients the time to keep their films.
"$heliod" --listen "unix:$temp/brief" --asset-root "$models" --isolation shared --sandbox best-effort \
    --log warn --drain-timeout 3600 &
brief=$!
answers() { "$helio" ping --count 1 --connect "unix:$temp/brief" >/dev/null 2>&1; }
until_true answers
: >"$temp/out"
run=exec trace "$temp/drained.exr" --spp 65536 --progress json --connect "unix:$temp/brief" >"$temp/out" 2>&1 &
client=$!
begun() { grep -q '"samples","done":[1-9]' "$temp/out" || ! kill -0 $client 2>/dev/null; }
until_true begun
kill -TERM $(pgrep -P $brief) $brief
kept() { [ -s "$temp/drained.exr.checkpoint" ] || ! kill -0 $client 2>/dev/null; }
until_true kept
kill -TERM $brief # the second one ends it at once
wait $client
code=$?
[ $code = 4 ] || fail "exit $code instead of 4 when the daemon was stopped"
told 'the same command with --resume goes on from there'
[ -s "$temp/drained.exr.checkpoint" ] || fail "no checkpoint was left when the daemon was stopped"

# A daemon that is killed and started again with its state: the session goes on, and the frame that was
# under way is requested again, from its film where that was kept.
lasting() {
    "$heliod" --listen "unix:$temp/lasting" --asset-root "$models" --isolation shared --sandbox best-effort --log warn \
        --state-dir "$temp/state" --cache-dir "$temp/lasting-cache" &
    brief=$!
    answers() { "$helio" ping --count 1 --connect "unix:$temp/lasting" >/dev/null 2>&1; }
    until_true answers
}
lasting
for kept in 3600 1; do
    for round in 1 2 3; do
        rm -f "$temp"/lasts.exr*
        : >"$temp/out"
        run=exec trace "$temp/lasts.exr" --checkpoint $kept --reconnect 60 --progress json --connect "unix:$temp/lasting" \
            >"$temp/out" 2>&1 &
        client=$!
        if [ $kept = 1 ]; then # the first film kept may be one without samples
            begun() { [ -n "$(find "$temp" -name lasts.exr.checkpoint -size +8k)" ] || ! kill -0 $client 2>/dev/null; }
        else
            begun() { grep -q '"samples","done":[1-9]' "$temp/out" || ! kill -0 $client 2>/dev/null; }
        fi
        until_true begun
        kill -KILL $brief
        wait $brief 2>/dev/null
        lasting
        done_or_gone() { ! kill -0 $client 2>/dev/null; }
        until_true done_or_gone
        kill $client 2>/dev/null
        wait $client || fail "exit $? when the daemon was killed"
        grep -q 'requested again' "$temp/out" && break
    done
    told 'requested again on a new connection'
    [ $kept = 3600 ] || told 'goes on from [1-9][0-9]* samples'
    same "$temp/whole.exr" "$temp/lasts.exr"
done
kill $brief

# Frames that are denoised with those before: killed at any time and taken up again, with and without
# what was kept for it, they are those of a command that was never stopped.
series() { # folder options...
    local folder=$1
    shift
    ${run:-} "$helio" render "$worm" -o "$temp/$folder/s-##.exr" --size 48x36 --mode path --spp 4 --env sky --exposure 0 \
        --exr float --aov motion --frames "${frames:-2-10:2}" --fps 20 --denoise --stats "$temp/stats.json" "$@"
}
same_series() { # folder
    for f in "$temp"/series/*.exr; do same "$f" "$temp/$1/${f##*/}"; done
    ls "$temp/$1" | grep -v '^s-[0-9][0-9]\.exr$' && fail "$1: something else is left"
}
mkdir "$temp/series" "$temp/halted" "$temp/holes"
expect 0 series series
same_series series
: >"$temp/out"
run=exec series halted --progress none >"$temp/out" 2>&1 &
client=$!
begun() { [ -e "$temp/halted/s-06.exr" ] || ! kill -0 $client 2>/dev/null; }
until_true begun
kill -KILL $client 2>/dev/null
wait $client 2>/dev/null
ls "$temp"/halted/*.history >/dev/null 2>&1 || [ -e "$temp/halted/s-10.exr" ] || fail "no history was left"
expect 0 series halted --skip-existing
grep -q 'made again, unwritten' "$temp/out" && fail "the history that was kept was not used"
same_series halted
# The worker dies over them: the next one gets the history again.
mkdir "$temp/deaths"
for round in 1 2 3; do
    rm -f "$temp"/deaths/*
    run=exec series deaths --connect "$url" >"$temp/out" 2>&1 &
    client=$!
    begun() { [ -e "$temp/deaths/s-04.exr" ] || ! kill -0 $client 2>/dev/null; }
    until_true begun
    [ -e "$temp/deaths/s-10.exr" ] && wait $client && continue
    kill -KILL $(pgrep -P $daemon helio-worker)
    wait $client || fail "exit $? when the worker died in a series"
    grep -q 'it ended and is replaced' "$temp/out" && break
done
told 'it ended and is replaced'
same_series deaths
cp "$temp"/series/s-0[246].exr "$temp/holes"
rm "$temp/holes/s-04.exr"
expect 0 series holes --skip-existing --connect "$url"
told 'frames 2 to 2 are made again, unwritten'
told 'frames 6 to 6 are made again, unwritten'
stat_is skipped_frames 2
same_series holes
frames=4-10:2 expect 0 series holes --skip-existing --connect "$url" # no part of the series from 2 on
stat_is skipped_frames 0

[ $failures = 0 ] || exit 1
echo "farm: good"
