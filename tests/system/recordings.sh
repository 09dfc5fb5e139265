#!/bin/bash
# recordings.sh - helio run --record and --replay: the same hashes from a private worker and from a
# daemon; a recording that was changed is noticed, a damaged one refused.
set -eu
build=${HELIO_BUILD_DIR:?}
helio=$build/bin/helio
model=$build/tests/models/leaves_opaque.glb
temp=$(mktemp -d)
export XDG_CACHE_HOME=$temp/cache HOME=$temp LP_NUM_THREADS=1
fail() { echo "recordings.sh: $1"; cat "$temp"/*.log; exit 1; }
end() { # what the daemon still removes itself must not be removed beside it
    [ -z "${daemon:-}" ] || { kill "$daemon" && wait "$daemon"; } 2>/dev/null || true
    rm -rf "$temp"
}
trap end EXIT

cat >"$temp/two.txt" <<END
load $model
set size 48x32
set gi none
set samples 1
camera orbit 30,70,4
frame $temp/one.png
view 2
set size 32x48
set gi none
set samples 1
camera orbit 120,70,4
frame $temp/other.png
expect stat frame.samples == 1
view 1
frame $temp/again.png
view 2 close
set node 1:0 visible no
frame $temp/hidden.png
END
"$helio" run "$temp/two.txt" --record "$temp/two.rec" >"$temp/run.log" 2>&1 || fail "the script: $?"
cmp "$temp/one.png" "$temp/again.png" || fail "view 2 changed view 1"
! cmp -s "$temp/one.png" "$temp/hidden.png" || fail "the edit changed nothing"
"$helio" run --replay "$temp/two.rec" >"$temp/replay.log" 2>&1 || fail "replayed: $?"
grep -q "4 settled frames, 0 differ" "$temp/replay.log" || fail "not all frames were compared"
"$helio" run --replay "$temp/two.rec" --pace recorded >"$temp/replay.log" 2>&1 || fail "at its pace: $?"

"$build/bin/heliod" --listen "unix:$temp/sock" --asset-root "$build/tests/models" --isolation shared --sandbox best-effort \
    --cache-dir "$temp" >"$temp/daemon.log" 2>&1 &
daemon=$!
for ((i = 0; i < 600; i++)); do [ -S "$temp/sock" ] && break; sleep 0.1; done
"$helio" run --replay "$temp/two.rec" --connect "unix:$temp/sock" >"$temp/replay.log" 2>&1 ||
    fail "on a daemon: $?"

# The last byte is one of the last frame's hash.
size=$(stat -c %s "$temp/two.rec")
head -c $((size - 1)) "$temp/two.rec" >"$temp/changed.rec"
printf '\x5a' >>"$temp/changed.rec"
code=0; "$helio" run --replay "$temp/changed.rec" --connect "unix:$temp/sock" >"$temp/replay.log" 2>&1 || code=$?
[ $code = 1 ] && grep -q "1 differ" "$temp/replay.log" || fail "another hash: $code"
head -c $((size - 7)) "$temp/two.rec" >"$temp/cut.rec"
code=0; "$helio" run --replay "$temp/cut.rec" >"$temp/replay.log" 2>&1 || code=$?
[ $code = 3 ] && grep -q "cut short" "$temp/replay.log" || fail "cut short: $code"
code=0; "$helio" run --replay "$temp/two.txt" >"$temp/replay.log" 2>&1 || code=$?
[ $code = 3 ] || fail "not a recording: $code"
code=0; "$helio" run "$temp/two.txt" --replay "$temp/two.rec" >"$temp/replay.log" 2>&1 || code=$?
[ $code = 2 ] || fail "with a script: $code"
code=0; "$helio" run >"$temp/replay.log" 2>&1 || code=$?
[ $code = 2 ] || fail "without anything: $code"
echo "recordings.sh: recorded, replayed, changed, cut"
