#!/bin/bash
# cli.sh - the command line end to end: scenes, embedded and through a daemon, byte for byte.
# Uses HELIO_BUILD_DIR; sets up and removes its own daemon and folder.
. "$(dirname "$0")/../support/shell.sh"

knot=$models/knot/knot.gltf
worm=$models/worm.glb
env=$models/room.hdr
for file in "$helio" "$heliod" "$knot" "$worm" "$env"; do need "$file"; done

mkdir "$temp/torn" # a scene that lacks an image: below
cp "$models"/knot/knot.gltf "$models"/knot/knot.bin "$temp/torn"
start_daemon "$models" "$temp/torn"
expect 0 "$helio" ping --connect "$url"

# Embedded, through the daemon, and uploaded: the same bytes.
picture() { # name scene options...
    local name=$1 scene=$2
    shift 2
    expect 0 "$helio" render "$scene" -o "$temp/$name" --stats "$temp/stats.json" --exposure 0 --gi none "$@"
}
compare_ways() { # ending scene options...
    local ending=$1 scene=$2
    shift 2
    picture "a.$ending" "$scene" "$@"
    picture "c.$ending" "$scene" "$@" --connect "$url"
    same "$temp/a.$ending" "$temp/c.$ending"
    [ "$scene" = demo: ] && return
    picture "d.$ending" "$scene" "$@" --connect "$url" --upload
    same "$temp/a.$ending" "$temp/d.$ending"
}
compare_ways png "$knot" --size 160x120 --samples 8
compare_ways png "$knot" --size 96x72 --samples 4 --gi auto
compare_ways png "$knot" --size 160x120 --samples 8 --orbit 30,60,3 --target 0,0.8,0 --env "$env" \
    --background none --tonemap agx --exposure 0.5 --bit-depth 16
compare_ways exr "$worm" --size 96x96 --samples 4 --at 0.4 --exr float --env "$env" --aov all
lens=(--mode path --size 48x32 --spp 4 --lens-radius 0.3 --filter tent --clamp-indirect 1)
compare_ways exr "$knot" "${lens[@]}" --focus 2
grep -aq heliograph:lensRadius "$temp/a.exr" || fail "the file does not tell its lens"
picture e.exr "$knot" "${lens[@]}" --focus 2.5 --connect "$url"
expect 1 "$helio" compare "$temp/a.exr" "$temp/e.exr" --metric max --fail-above 0
expect 2 "$helio" render "$knot" -o "$temp/none.png" "${lens[@]}" --connect "$url" # the scene's camera has no target
# Noise: no more samples than it takes, no more noise than is asked for.
noisy() { # limit: leaves the samples that it took in $took
    picture n.exr "$knot" --mode path --size 48x32 --spp 2048 --noise "$1" --connect "$url"
    took=$(python3 -c 'import json, sys; f = json.load(open(sys.argv[1]))["frame"]
print(f["samples"] if 0 < f["noise"] <= float(sys.argv[2]) else "too noisy")' "$temp/stats.json" "$1")
}
noisy 0.05 && rough=$took
noisy 0.02 && fine=$took
[ "$rough" -lt "$fine" ] && [ "$fine" -lt 2048 ] || fail "--noise: $rough and $fine samples"
compare_ways jpg demo: --size 160x90 --samples 4 --jpeg-quality 85

# Regions: files of their size; EXR files know where they belong. The pixels: render_region.
windows() { # file: sizes of PNG, data and display window of EXR
    python3 - "$1" <<'PY'
import struct, sys
data = open(sys.argv[1], "rb").read()
if data[1:4] == b"PNG":
    print(*struct.unpack(">II", data[16:24]))
else:
    for name in b"dataWindow\0box2i\0", b"displayWindow\0box2i\0":
        at = data.index(name) + len(name) + 4
        print(*struct.unpack("<4i", data[at:at + 16]), end=" ")
    print()
PY
}
region=(--size 96x64 --samples 2 --region 31,17,40,33)
picture r.png "$knot" "${region[@]}" --connect "$url"
[ "$(windows "$temp/r.png")" = "40 33" ] || fail "the region's picture is $(windows "$temp/r.png")"
compare_ways exr "$knot" "${region[@]}" --mode path --aov depth
[ "$(windows "$temp/a.exr")" = "31 17 70 49 0 0 95 63 " ] || fail "windows of $(windows "$temp/a.exr")"
expect 0 "$helio" compare "$temp/a.exr" "$temp/c.exr" --metric max --fail-above 0

# Scripts ask for planes as well.
{
    echo "load $knot"
    echo "set size 48x32"
    echo "set samples 2"
    echo "set gi none"
    echo "set exposure 0"
    echo "set aov depth,crypto-asset"
    echo "frame $temp/planes.exr"
    echo "frame $temp/planes.png"
    echo "set aov none"
    echo "frame $temp/none.exr"
} >"$temp/planes.hs"
expect 0 "$helio" run "$temp/planes.hs" --connect "$url"
for part in depth.Z CryptoAsset00.R; do
    grep -aq $part "$temp/planes.exr" || fail "the script's file has no $part"
    ! grep -aq $part "$temp/none.exr" || fail "the script's file has $part, which was not asked for"
done

# Frames of an animation differ from each other and are the same both ways.
picture "e-####.png" "$worm" --size 64x64 --samples 2 --frames 0-4:2 --fps 10
picture "f-%02d.png" "$worm" --size 64x64 --samples 2 --frames 0-4:2 --fps 10 --connect "$url"
for frame in 0 2 4; do same "$temp/e-000$frame.png" "$temp/f-0$frame.png"; done
cmp -s "$temp/e-0000.png" "$temp/e-0004.png" && fail "the animation stands still"

# The cache: listed with what it was made from, checked, cleared.
expect 0 "$helio" bake "$knot" -o "$temp/baked"
expect 0 "$helio" cache --cache-dir "$temp/baked"
grep -q "texture knot.png: 512 x 512" "$temp/out" || fail "the texture is not listed"
grep -q "mesh .*: 4224 triangles" "$temp/out" || fail "the mesh is not listed"
expect 0 "$helio" render "$knot" -o "$temp/sky.png" --size 16x16 --samples 1 --exposure 0 --gi none --env sky --cache-dir "$temp/skies"
expect 0 "$helio" cache --cache-dir "$temp/skies" --json
grep -q '"made_from": "sky: ' "$temp/out" || fail "the sky is not listed"
grep -q '"made_from": ""' "$temp/out" && fail "an entry does not tell what it was made from"

# A folder that does not hold what the scene takes is said.
expect 0 "$helio" bake "$knot" -o "$temp/tight" --cache-limit 1
expect 6 "$helio" bake demo: -o "$temp/tight" --cache-limit 1 --textures-only
grep -q -e '--cache-limit: the scene takes .* MiB and the folder may hold 1.0' "$temp/out" || fail "what is evicted again is not said"
expect 3 "$helio" bake "$temp/gone.gltf" -o "$temp/gone"
[ -e "$temp/gone" ] && fail "a folder was made for a scene that is not there"
small=$temp/small # a disk of its own, where one may be made: its texture makes room for the mesh
mkdir "$small"
if mount -t tmpfs -o size=840k tmpfs "$small" 2>/dev/null; then
    expect 6 "$helio" bake "$knot" -o "$small"
    umount "$small"
    grep -q -e '--output: [0-9]* of the scene.s packs and files are not there: its disk is full' "$temp/out" || fail "a full disk is not said"
fi

# One that may only be read has its entries all the same; one that is none is said, once.
reader() { # the owner writes where root does not look at permissions
    if [ "$(id -u)" = 0 ]; then setpriv --reuid=65534 --regid=65534 --clear-groups env HOME=/ "$@"; else "$@"; fi
}
chmod 711 "$temp"
chmod -R a-w,a+rX "$temp/baked"
if reader test -x "$helio" -a -r "$knot" -a ! -w "$temp/baked"; then
    reader "$helio" render "$knot" -o - --size 16x16 --samples 1 --exposure 0 --gi none --cache-dir "$temp/baked" \
        >"$temp/read.png" 2>"$temp/out" || fail "a cache that may only be read: $(tail -n 2 "$temp/out")"
    grep -q 'no cache folder' "$temp/out" && fail "a cache that may only be read is not used"
    reader "$helio" render "$knot" -o exr:- --size 16x16 --samples 1 --gi none --cache-dir "$temp/baked" \
        --stats /dev/stderr >/dev/null 2>"$temp/out"
    grep -q '"found": [1-9]' "$temp/out" || fail "nothing is found in a cache that may only be read"
fi
chmod -R u+w "$temp/baked"
for progress in none json; do
    expect 0 "$helio" render "$knot" -o "$temp/read.png" --size 16x16 --samples 1 --exposure 0 --gi none \
        --cache-dir "$knot/cache" --progress $progress
    [ "$(grep -c 'no cache folder: .*knot.gltf/cache: Not a directory' "$temp/out")" = 1 ] ||
        fail "a cache folder that cannot be is not said"
done
expect 0 "$helio" cache --cache-dir "$temp/baked" --verify --json
grep -q '"damaged": 0' "$temp/out" || fail "no count of damaged entries"
victim=$(find "$temp/baked/store" -name '*.hgs' | head -n 1)
printf 'x' | dd of="$victim" bs=1 seek=100 conv=notrunc 2>/dev/null
expect 1 "$helio" cache --cache-dir "$temp/baked" --verify
[ -e "$victim" ] && fail "a damaged entry is still there"
expect 0 "$helio" cache --cache-dir "$temp/baked" --clear
expect 0 "$helio" cache --cache-dir "$temp/baked"
grep -q "^0 entries" "$temp/out" || fail "the cache is not clear"
expect 2 "$helio" cache --cache-dir "$temp/nothing"
mkdir "$temp/nothing"
expect 0 "$helio" cache --cache-dir "$temp/nothing"
expect 2 "$helio" cache --verify --clear

# Comparisons and expectations.
expect 0 "$helio" compare "$temp/a.png" "$temp/a.png" --fail-below 100
expect 1 "$helio" compare "$temp/e-0000.png" "$temp/e-0004.png" --fail-below 100 --diff "$temp/x.png"
[ -s "$temp/x.png" ] || fail "no picture of the differences"
cat >"$temp/script" <<SCRIPT
load ${knot}
set size 160x120
set samples 8
set gi none
set exposure 0
wait settled
frame $temp/script.png
camera orbit 30,60,3 target 0,0.8,0
expect psnr $temp/script.png < 60
camera node 0
expect max $temp/script.png <= 0
expect pick 80 80 node 1:2
expect stat frame.samples == 8
SCRIPT
expect 0 "$helio" run "$temp/script" --junit "$temp/junit.xml"
expect 0 "$helio" run "$temp/script" --connect "$url"
grep -q 'tests="4" failures="0" errors="0"' "$temp/junit.xml" || fail "the JUnit report is wrong"
# Documented keys, masks, reports, references.
cat >"$temp/keys" <<SCRIPT
expect stat frame.missing_pages == 0
expect stat frame.settled == true
expect stat device.name != nothing
expect stat client.embedded != nothing
SCRIPT
{
    echo "load $knot"
    echo "set size 160x120"
    echo "set samples 2"
    echo "set gi none"
    echo "set exposure 0"
    echo "include $temp/keys"
    echo "expect psnr $temp/reference.png >= 60"
} >"$temp/suite"
expect 1 "$helio" run "$temp/suite" --connect "$url"
expect 0 "$helio" run "$temp/suite" --update-references --connect "$url"
expect 0 "$helio" run "$temp/suite"
expect 0 "$helio" run - --connect "$url" <"$temp/suite"
expect 0 "$helio" compare "$temp/reference.png" "$temp/reference.png" --metric all --mask "$temp/script.png" \
    --fail-below psnr=100 --fail-above flip=0
cp "$temp/x.png" "$temp/small.png"
expect 3 "$helio" compare "$temp/reference.png" "$temp/reference.png" --mask "$temp/small.png"
cp "$temp/script.png" "$temp/reference.png"
expect 1 "$helio" run "$temp/suite" --report "$temp/pages" --junit "$temp/junit.xml" --connect "$url"
for part in picture reference difference; do
    [ -s "$temp/pages/0005-$part.png" ] || fail "the report has no $part"
    grep -q "0005-$part.png" "$temp/pages/index.html" || fail "the page does not show the $part"
    grep -q "ATTACHMENT|$temp/pages/0005-$part.png" "$temp/junit.xml" || fail "JUnit does not name the $part"
done

# A scene that another session holds is joined by its name, and looks as one's own.
{
    echo "scene show"
    echo "load $knot"
    echo "set size 256x256"
    echo "set samples 65536"
    echo "set gi none"
    echo "set exposure 0"
    echo "wait settled"
} >"$temp/holder"
"$helio" run "$temp/holder" --connect "$url" >/dev/null 2>&1 &
holder=$!
small() { printf '%s\n' "set size 96x64" "set samples 2" "set gi none" "set exposure 0"; }
{ echo "load $knot" && small && echo "frame $temp/own.png"; } >"$temp/own"
# Not before it is loaded: a camera is fitted to what the scene holds at that moment. Statistics are those of
# a settled picture, so the view is small before.
{
    echo "scene show"
    small
    echo "expect stat geometry.triangles_total > 0"
    echo "frame $temp/joined.png"
} >"$temp/join"
joins() { "$helio" run "$temp/join" --connect "$url" >/dev/null 2>&1; }
until_true joins
kill "$holder"
wait "$holder"
expect 0 "$helio" run "$temp/own" --connect "$url"
same "$temp/own.png" "$temp/joined.png"
expect 0 "$helio" info "$knot" --json --connect "$url"
cp "$temp/out" "$temp/info"
expect 0 "$helio" info "$knot" --json
python3 -c 'import json, sys; json.load(open(sys.argv[1]))' "$temp/out" || fail "info is not JSON"
same "$temp/info" "$temp/out"

# Refusals.
echo '{"asset": {"version": "2.0"}, }' >"$temp/syntax.gltf"
expect 3 "$helio" info "$temp/syntax.gltf"
expect 5 "$helio" render /etc/hostname -o "$temp/g.png" --connect "$url"
expect 3 "$helio" render "$models/gone.gltf" -o "$temp/g.png" --connect "$url"
expect 4 "$helio" render "$knot" -o "$temp/g.png" --connect "unix:$temp/nobody"
[ -e "$temp/g.png" ] && fail "a refused scene left a file"

# A scene without one of its images: white and a warning, or nothing at all.
torn=("$helio" render "$temp/torn/knot.gltf" -o "$temp/torn.png" --size 32x32 --samples 1 --exposure 0 --gi none --connect "$url")
expect 3 "${torn[@]}" --strict
[ -e "$temp/torn.png" ] && fail "--strict left a file"
expect 0 "${torn[@]}"
grep -q "warning: .*knot.png" "$temp/out" || fail "a missing image is not told"

# Path mode leaves lines out: a warning, or nothing at all.
printf 'v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nl 1 2\n' >"$temp/torn/wire.obj"
wire=("$helio" render "$temp/torn/wire.obj" -o "$temp/wire.png" --size 32x32 --samples 4 --exposure 0 --gi none --connect "$url")
expect 3 "${wire[@]}" --mode path --strict
grep -q 'leave out 1 primitive of lines' "$temp/out" || fail "lines that path mode leaves out are not told"
[ -e "$temp/wire.png" ] && fail "--strict left a picture without its lines"
expect 0 "${wire[@]}" --mode path
grep -q 'warning: .*leave out 1 primitive of lines' "$temp/out" || fail "lines are left out without a warning"
expect 0 "${wire[@]}" --strict

# A size that the device has no images for is named.
expect 6 "$helio" render "$knot" -o "$temp/g.png" --size 16384x16384 --samples 1 --exposure 0 --gi none
grep -q '16384x16384 px are too many' "$temp/out" || fail "a size that is too large is not named"

# A daemon's worker that dies in the middle of a frame costs a pause and nothing else.
# Quick machines get more to do, until the kill strikes a frame.
at_work() { grep -q '"samples"' "$temp/out" || ! kill -0 "$client" 2>/dev/null; }
for samples in 400 4000 40000; do
    slow=(--size 96x96 --samples "$samples" --exposure 0 --gi none --progress json)
    : >"$temp/out"
    "$helio" render "$knot" -o "$temp/j.png" --connect "$url" "${slow[@]}" 2>"$temp/out" &
    client=$!
    until_true at_work
    kill -9 $(pgrep -P "$daemon" helio-worker)
    kill -0 "$client" 2>/dev/null && struck=1 || struck=
    wait "$client"
    [ $? = 0 ] || fail "a worker that died was not replaced: $(tail -n 2 "$temp/out")"
    [ -n "$struck" ] && break
done
[ -n "$struck" ] || fail "the frame was always done before the worker was killed"
expect 0 "$helio" render "$knot" -o "$temp/i.png" --connect "$url" "${slow[@]}"
same "$temp/i.png" "$temp/j.png"

# A private worker that dies, and one that is stopped by Ctrl-C, both in a frame without an end.
endless() {
    : >"$temp/out"
    "$helio" render "$knot" -o "$temp/h.png" --size 256x256 --samples 65536 --exposure 0 --gi none --progress json \
        2>"$temp/out" &
    client=$!
    until_true at_work
}
endless
kill -9 $(pgrep -P "$client")
wait "$client"
[ $? = 7 ] || fail "a dead worker is not exit code 7: $(tail -n 2 "$temp/out")"
endless
kill -INT "$client"
wait "$client"
[ $? = 8 ] || fail "Ctrl-C is not exit code 8: $(tail -n 2 "$temp/out")"
[ -e "$temp/h.png" ] && fail "an unfinished picture was written"

[ "$failures" = 0 ] && echo "all good"
exit $((failures > 0))
