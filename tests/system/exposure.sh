#!/bin/bash
# exposure.sh - the light of an ordinary file at the first try: automatic exposure, the sky as a fill,
# and warnings where nothing helps. Uses HELIO_BUILD_DIR.
. "$(dirname "$0")/../support/shell.sh"

startup=$models/startup.glb
knot=$models/knot/knot.gltf
morph=$models/morph.glb
for file in "$helio" "$startup" "$knot" "$morph"; do need "$file"; done

stat() { # key [file]: of the statistics, as a path
    python3 -c 'import json, sys
value = json.load(open(sys.argv[1]))
for key in sys.argv[2].split("."):
    value = value[int(key) if key.isdigit() else key]
print(json.dumps(value).strip("\""))' "${2:-$temp/stats.json}" "$1"
}
is() { # key value
    [ "$(stat "$1")" = "$2" ] || fail "$1 is $(stat "$1"), not $2"
}
told() { grep -q -- "$1" "$temp/out" || fail "'$1' is not said: $(tail -n 3 "$temp/out")"; }
untold() { ! grep -q -- "$1" "$temp/out" || fail "'$1' is said: $(tail -n 3 "$temp/out")"; }
start_daemon "$models"
# Global illumination is not what is looked at here, and takes most of a picture's time.
embedded() { # file options...: of the startup scene
    local file=$1
    shift
    expect 0 "$helio" render "$startup" -o "$temp/$file" --samples 2 --gi none --stats "$temp/stats.json" "$@"
}
picture() { embedded "$@" --connect "$url"; }
between() { # low high value
    python3 -c 'import sys; low, high, v = map(float, sys.argv[1:]); sys.exit(not low <= v <= high)' "$@" ||
        fail "$3 is not in $1 to $2"
}

# The lamp of 54351 cd is 8 to 9 stops too bright; the sky fills in.
picture a.png --size 160x90
ev=$(stat exposure.ev)
between -10 -7 "$ev"
is exposure.mode auto
is environment.fill true
told "the built-in sky fills in"
between 0 0.01 "$(stat frame.clipped)"
between 0 0.01 "$(stat frame.black)"
untold warning

# One value for both modes and every size of that shape, which states the same picture.
picture b.png --size 64x36 --mode path
is exposure.ev "$ev"
picture c.png --size 160x90 --exposure="$ev"
is exposure.mode fixed
same "$temp/a.png" "$temp/c.png" # but for their jobs, which neither has
picture d.png --size 160x90 --exposure=auto+1
between -0.001 0.001 "$(python3 -c "print($(stat exposure.ev) - 1 - $ev)")"

# A budget changes no picture: where light cannot be followed in it, there is none.
expect 6 "$helio" render demo: -o "$temp/budget.png" --size 32x32 --samples 1 --gi none --geometry-budget 16
told "a fixed exposure needs none"
[ ! -e "$temp/budget.png" ] || fail "a picture that was not metered is written"
expect 6 "$helio" render demo: -o "$temp/budget.png" --size 32x32 --samples 1 --exposure 0 --geometry-budget 16
told "gi none needs less memory"

# Chosen environments are what they are.
picture e.png --size 64x36 --env none
is environment.kind none
untold "fills in"
between 0.5 0.95 "$(stat frame.black)"
picture f.png --size 64x36 --env sky
is environment.fill false

# Files for compositing.
picture g.exr --size 64x36
is exposure.mode fixed
is exposure.ev 0
picture h.exr --size 64x36 --exposure auto --samples 32
is exposure.ev "$ev"
grep -aq heliograph:exposure "$temp/h.exr" || fail "the file does not say its exposure"

# What cannot be seen is said, and is no failure.
picture i.png --size 64x36 --exposure 0
told "i.png: .* clipped to white: try --exposure auto"
picture j.png --size 64x36 --env none --exposure -20
told "j.png: .* is black: .*--env sky"
picture k.png --size 64x36 --eye 0,0,9 --target 0,0,18 --env none
told "k.png: 100 % of the picture is black"
expect 0 "$helio" render "$knot" -o "$temp/l.png" --size 64x36 --samples 1 --gi none --debug-view overdraw --connect "$url"
untold warning

# A series has the exposure of its first picture, whatever is there already, and so has each part of it
# that is given the value.
series() { # folder options...
    local folder=$1
    shift
    expect 0 "$helio" render "$startup" -o "$temp/$folder/s-#.png" --size 64x36 --samples 1 --gi none --fps 4 \
        --stats "$temp/stats.json" --connect "$url" "$@"
}
mkdir "$temp/once" "$temp/again" "$temp/part"
series once --frames 0-3
ev=$(stat exposure.ev)
is exposure.mode auto
jobs=$(stat frames.2.job)
cp "$temp/once/s-0.png" "$temp/once/s-3.png" "$temp/again"
series again --frames 0-3 --skip-existing
is client.skipped_frames 2
is frames.1.job "$jobs"
series part --frames 2-3 --exposure="$ev"
for f in "$temp"/part/*.png; do same "$temp/once/${f##*/}" "$f"; done
for f in "$temp"/again/*.png; do same "$temp/once/${f##*/}" "$f"; done

# Scripts.
{
    echo "load $startup"
    echo "set size 64x36"
    echo "set gi none"
    echo "set samples 1"
    echo "frame $temp/m.png"
    echo "set exposure -3"
    echo "frame $temp/n.png"
    echo "set exposure auto-1"
    echo "frame $temp/o.png"
    echo "set env none"
    echo "frame $temp/p.png"
} >"$temp/script"
expect 0 "$helio" run "$temp/script" --connect "$url"
expect 1 "$helio" compare "$temp/m.png" "$temp/n.png" --metric rmse --fail-above 0.1
expect 1 "$helio" compare "$temp/m.png" "$temp/o.png" --metric rmse --fail-above 0.02
expect 1 "$helio" compare "$temp/o.png" "$temp/p.png" --metric rmse --fail-above 0.1

# Files for compositing in scripts: exposure 0 unless one was chosen, between others that are metered.
{
    echo "load $startup"
    echo "set size 64x36"
    echo "set gi none"
    echo "set samples 32"
    echo "frame $temp/q1.png"
    echo "frame $temp/q.exr"
    echo "expect stat exposure.ev == 0"
    echo "frame $temp/q2.png"
    echo "expect stat exposure.mode == auto"
    echo "set exposure auto"
    echo "frame $temp/r.exr"
} >"$temp/script"
expect 0 "$helio" run "$temp/script" --connect "$url"
expect 0 "$helio" render "$startup" -o "$temp/s.exr" --size 64x36 --gi none --connect "$url"
same "$temp/q1.png" "$temp/q2.png"
for pair in q.exr:s.exr r.exr:h.exr; do
    expect 0 "$helio" compare "$temp/${pair%:*}" "$temp/${pair#*:}" --metric max --fail-above 0
done

# A series that ends early says how its rest gets the same exposure; scripts tell what they have written.
mkdir -p "$temp/series" "$temp/blocked"
ln -s "$temp/missing/f2.png" "$temp/blocked/f2.png"
series() { # code folder options...
    expect "$1" "$helio" render "$startup" -o "$temp/$2/f#.png" --size 64x36 --samples 2 --gi none --connect "$url" "${@:3}"
}
series 0 series --frames 0-4
told 'metered at frame 0; other commands of the same series need --exposure=-'
series 7 blocked --frames 0-4
told '2 frames are written; --frames 2-4 --exposure=-[0-9.]* renders the rest'
rest=$(sed -n 's/.* written; \(.*\) renders the rest$/\1/p' "$temp/out")
rm "$temp/blocked/f2.png"
series 0 blocked $rest
for i in 0 1 2 3 4; do same "$temp/series/f$i.png" "$temp/blocked/f$i.png"; done
printf 'load %s\nset size 8x8\nset gi none\nframe %s\nframe %s\n' "$startup" "$temp/t1.png" "$temp/t2.exr" >"$temp/script"
expect 0 "$helio" run "$temp/script" --progress json --connect "$url"
told '"event":"written".*t1.png","share":0.5'
told '"event":"end".*"written":2'

# A lens is told as radius and distance, whichever options it came from.
lens() { # name of an attribute
    python3 -c 'import struct, sys
data = open(sys.argv[1], "rb").read()
at = data.index(b"heliograph:" + sys.argv[2].encode() + b"\0float\0")
print("%.5f" % struct.unpack_from("<f", data, data.index(b"float\0", at) + 10))' "$temp/lens.exr" "$1"
}
for options in "--f-number 0.5 --sensor-height 24" "--lens-radius 0.0289706"; do
    expect 0 "$helio" render "$startup" -o "$temp/lens.exr" --size 16x16 --mode path --spp 1 --exposure 0 --fov 45 $options \
        --focus 3 --connect "$url"
    [ "$(lens lensRadius) $(lens focusDistance)" = "0.02897 3.00000" ] || fail "lens of $options: $(lens lensRadius) $(lens focusDistance)"
done

# By a private worker.
embedded q.png --size 160x90
same "$temp/a.png" "$temp/q.png"

[ $failures = 0 ] || { echo "$failures failures"; exit 1; }
echo ok
