#!/bin/bash
# view.sh - helio view under Xvfb: opens a scene, moves by synthetic events, writes a screenshot that
# is the frame that `helio render` makes from the same camera; selects, hides, cuts and measures as `helio run` does;
# refusals and exit codes.
set -eu
build=${HELIO_BUILD_DIR:?}
helio=$build/bin/helio
model=$build/tests/models/leaves_opaque.glb
worm=$build/tests/models/worm.glb
for tool in Xvfb xdotool; do
    command -v $tool >/dev/null || { echo "$tool is not installed"; exit 77; }
done
temp=$(mktemp -d)
export XDG_CACHE_HOME=$temp/cache SDL_VIDEODRIVER=x11 SDL_AUDIODRIVER=dummy HOME=$temp LP_NUM_THREADS=1
fail() { echo "view.sh: $1"; cat "$temp"/*.log; exit 1; }
end() {
    local pid
    for pid in ${view:-} ${guest:-} ${daemon:-}; do kill "$pid" 2>/dev/null || true; done
    [ -z "${server:-}" ] || kill "$server" 2>/dev/null || true
    rm -rf "$temp"
}
trap end EXIT

# Refused before a window opens.
code=0; env -u SDL_VIDEODRIVER -u DISPLAY -u WAYLAND_DISPLAY "$helio" view "$model" 2>"$temp/a.log" || code=$?
[ $code = 9 ] || fail "without a display: $code"
code=0; "$helio" view "$temp/none.glb" 2>"$temp/a.log" || code=$?
[ $code = 3 ] || fail "a file that is not there: $code"
for wrong in "" "$model --join x" "$model --fov 0" "$model --orbit 1,2,3 --eye 1,2,3" "$model --screenshots $temp/none"; do
    code=0; "$helio" view $wrong 2>"$temp/a.log" || code=$?
    [ $code = 2 ] || fail "helio view $wrong: $code"
done
code=0; HELIO_VIEW=$temp/none "$helio" view "$model" 2>"$temp/a.log" || code=$?
[ $code = 9 ] && grep -q SDL2 "$temp/a.log" || fail "without the program: $code"

# A display of its own, at a number that is free. It is not reset when a window closes: while it is,
# the next one cannot connect.
exec 3<>"$temp/number"
Xvfb -displayfd 3 -screen 0 400x300x24 -nolisten tcp -noreset -fbdir "$temp" >"$temp/xvfb.log" 2>&1 &
server=$!
wait_for() { # WHAT COMMAND...: until it succeeds
    local what=$1 i; shift
    for ((i = 0; i < 1200; i++)); do
        "$@" >/dev/null 2>&1 && return
        kill -0 "$server" || fail "Xvfb ended"
        [ -z "${view:-}" ] || kill -0 "$view" 2>/dev/null || fail "helio view ended before: $what"
        sleep 0.2
    done
    fail "not in time: $what"
}
wait_for "a display" test -s "$temp/number"
DISPLAY=:$(cat "$temp/number")
export DISPLAY
title() { xdotool search --onlyvisible --name "Heliograph|helio view" getwindowname; }
shows() { title | grep -q "$1"; }
key() { xdotool windowfocus --sync "$window" 2>/dev/null || true; xdotool key "$1"; }
shot() { # NAME: one screenshot, renamed
    key x
    wait_for "a screenshot" sh -c "ls '$temp'/shots/helio-*.png"
    mv "$temp"/shots/helio-*.png "$temp/$1"
}

other_shot() { # NAME BEFORE: screenshots until one differs from BEFORE
    local i
    for ((i = 0; i < 300; i++)); do
        shot "$1"
        cmp -s "$temp/$1" "$temp/$2" || return 0
        sleep 0.2
    done
    fail "$1 shows what $2 did"
}

mkdir "$temp/shots"
"$helio" view "$model" --size 96x64 --gi none --samples 2 --screenshots "$temp/shots" --record "$temp/view.rec" \
    >"$temp/view.log" 2>&1 &
view=$!
wait_for "a settled picture" shows "leaves_opaque.glb - real time, settled - orbit"
window=$(xdotool search --onlyvisible --name Heliograph)
shot first.png
# The same pixels as helio render's, whose camera is the same.
"$helio" render "$model" -o "$temp/reference.png" --size 96x64 --gi none --samples 2 -q
"$helio" compare "$temp/first.png" "$temp/reference.png" --metric max --fail-above 0 >"$temp/compare.log" 2>&1 ||
    fail "the screenshot is another picture"
# Keys and pointer change what is seen, with reprojection between frames.
key r
key 3
other_shot back.png first.png
xdotool mousemove --window "$window" 40 30 mousedown 1 mousemove --window "$window" 50 30 \
    mousemove --window "$window" 70 34 mouseup 1
other_shot dragged.png back.png
key g
wait_for "the title says fly" shows " fly "
key h
key t
key Escape
key Escape
code=0; wait "$view" || code=$?
view=
[ $code = 0 ] || fail "closed by Esc: $code"
[ -s "$temp/view.rec" ] || fail "nothing was recorded"

# Nodes, clipping planes and measuring, in a shared scene. What `helio run` makes is what has to be seen.
cat >"$temp/wanted.txt" <<END
load $build/tests/models/bearing.glb
set size 320x240
set gi none
set samples 2
camera orbit 35,65,5 target 0,0,0 fov 45
expect distance 100 100 160 180 >= 1.4275
expect distance 100 100 160 180 <= 1.4285
set override shaft selected yes
frame $temp/selected.png
set override none
set node housing visible no
set override housing selected yes
frame $temp/hidden.png
set override none
set clip 0,0,-1 0 caps hatch 0.8,0.25,0.1
frame $temp/cut.png
set clip none
set override shaft selected yes
frame $temp/guest.png
set override shaft hidden yes
frame $temp/hides.png
END
"$helio" run "$temp/wanted.txt" >"$temp/run.log" 2>&1 || fail "helio run: $?"
printf 'host-token edit host\nguest-token view guest\n' >"$temp/tokens"
chmod 600 "$temp/tokens"
"$build/bin/heliod" --listen "unix:$temp/sock" --tokens "$temp/tokens" --require-token --asset-root "$build/tests/models" \
    --isolation shared --sandbox best-effort --cache-dir "$temp" >"$temp/daemon.log" 2>&1 &
daemon=$!
wait_for "the daemon" test -S "$temp/sock"
join() { # TOKEN [SCENE]: a window of the shared scene
    HELIO_TOKEN=$1 exec "$helio" view ${2:-} --connect "unix:$temp/sock" --join room --orbit 35,65,5 --size 320x240 --gi none --samples 2 \
        --screenshots "$temp/shots"
}
same() { # NAME: a screenshot is the picture of helio run, but for the history of its edges
    shot "$1.seen.png"
    "$helio" compare "$temp/$1.seen.png" "$temp/$1.png" --fail-below 36 >"$temp/compare.log" 2>&1 ||
        fail "$1: another picture"
}
says() { xdotool getwindowname "$window" | grep -q -- "$1"; }
says_not() { ! says "$1"; }
click() { xdotool mousemove --window "$window" "$1" "$2" click 1; }
marked() { # OP N: pixels of the display that have the colour of a measure
    python3 - "$temp/Xvfb_screen0" "$@" <<'END'
import struct, sys
data = open(sys.argv[1], "rb").read()
header, = struct.unpack(">I", data[:4])
colours, = struct.unpack(">I", data[76:80])
pixels = memoryview(data[header + 12 * colours:][:400 * 300 * 4]).cast("I")
count = sum(1 for p in pixels if p & 0xffffff == 0xffeb3c)
sys.exit(not (count > int(sys.argv[3]) if sys.argv[2] == "above" else count <= int(sys.argv[3])))
END
}

join host-token bearing.glb >"$temp/view.log" 2>&1 &
view=$!
wait_for "a settled picture" shows "room - real time, settled - orbit"
window=$(xdotool search --onlyvisible --name Heliograph)
# Measuring: what is drawn lies on the display until Esc.
marked atmost 0 || fail "something is marked before it is measured"
key m
wait_for "measuring" says " - measuring - "
click 100 100
wait_for "a point is drawn" marked above 40
click 160 180
wait_for "the length" says " - 1.428 m - "
wait_for "a line is drawn" marked above 120
key Escape
wait_for "the line is gone" marked atmost 0
# A click selects, the panel hides.
click 115 150
wait_for "the shaft is selected" says " - shaft - "
same selected
key Tab
key Up
wait_for "the housing is selected" says " - housing - "
key space
same hidden
key Escape
key Escape
wait_for "nothing is selected" says_not " - housing - "
# Clipping: a plane across z is moved to and fro; its solids are hatched.
key z
key Down
key Down
key Right
wait_for "a plane" says " - cut z - "
key Left
key Down
key Right
same cut
key Up
key space
wait_for "no plane" says_not " - cut z - "
# Another session that may look sees what was hidden, and may not show it again; it selects and hides for itself.
join guest-token >"$temp/guest.log" 2>&1 &
guest=$!
both() { [ "$(xdotool search --onlyvisible --name "settled - orbit" | wc -l)" = 2 ]; }
wait_for "the guest's picture" both
host=$window
window=$(xdotool search --onlyvisible --name Heliograph | grep -vx "$host")
click 115 150
wait_for "the guest has selected the shaft" says " - shaft - "
key Tab
key Up
key space
key Down
key space
wait_for "the shaft is selected again" says " - shaft - "
same hides
key space
same guest
key ctrl+q
code=0; wait "$guest" || code=$?
guest=
[ $code = 0 ] || fail "the guest: $code"
window=$host
key ctrl+q
code=0; wait "$view" || code=$?
view=
[ $code = 0 ] || fail "the host: $code"

# A scene that cannot be opened is said in the window; its code is that of the command.
printf 'glTF not at all' >"$temp/bad.glb"
"$helio" view "$temp/bad.glb" --size 96x64 >"$temp/view.log" 2>&1 &
view=$!
wait_for "the error" shows failed
window=$(xdotool search --onlyvisible --name Heliograph)
key Escape
code=0; wait "$view" || code=$?
view=
[ $code = 3 ] || fail "a bad file: $code"
"$helio" view "$worm" --animation none --size 96x64 >"$temp/view.log" 2>&1 &
view=$!
wait_for "the error" shows failed
window=$(xdotool search --onlyvisible --name Heliograph)
key Escape
code=0; wait "$view" || code=$?
view=
[ $code = 2 ] || fail "an animation that is not there: $code"

# The pose is that of the animation that is named.
"$helio" view "$worm" --animation wave --size 96x64 --gi none --samples 2 --screenshots "$temp/shots" >"$temp/view.log" 2>&1 &
view=$!
wait_for "a settled picture" shows "worm.glb - real time, settled - orbit"
window=$(xdotool search --onlyvisible --name Heliograph)
shot waves.png
key ctrl+q
code=0; wait "$view" || code=$?
view=
[ $code = 0 ] || fail "an animation: $code"
"$helio" render "$worm" --animation wave -o "$temp/waves_reference.png" --size 96x64 --gi none --samples 2 -q
"$helio" compare "$temp/waves.png" "$temp/waves_reference.png" --metric max --fail-above 0 >"$temp/compare.log" 2>&1 ||
    fail "the screenshot is not the pose that is named"
"$helio" render "$worm" -o "$temp/rest.png" --size 96x64 --gi none --samples 2 -q
! cmp -s "$temp/rest.png" "$temp/waves_reference.png" || fail "the named pose is that of rest"
echo "view.sh: window, screenshot, keys, pointer, nodes, clipping, measuring, errors"
