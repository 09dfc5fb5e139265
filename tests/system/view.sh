#!/bin/bash
# view.sh - helio view under Xvfb: opens a scene, moves by synthetic events, writes a screenshot that
# is the frame that `helio render` makes from the same camera; refusals and exit codes.
set -eu
build=${HELIO_BUILD_DIR:?}
helio=$build/bin/helio
model=$build/tests/models/leaves_opaque.glb
for tool in Xvfb xdotool; do
    command -v $tool >/dev/null || { echo "$tool is not installed"; exit 77; }
done
temp=$(mktemp -d)
export XDG_CACHE_HOME=$temp/cache SDL_VIDEODRIVER=x11 SDL_AUDIODRIVER=dummy HOME=$temp LP_NUM_THREADS=1
fail() { echo "view.sh: $1"; cat "$temp"/*.log; exit 1; }
end() {
    [ -z "${view:-}" ] || kill "$view" 2>/dev/null || true
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
Xvfb -displayfd 3 -screen 0 400x300x24 -nolisten tcp -noreset >"$temp/xvfb.log" 2>&1 &
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
# Keys and pointer change what is seen.
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
echo "view.sh: window, screenshot, keys, pointer, errors"
