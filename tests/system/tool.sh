#!/bin/bash
# tool.sh - what the command line does beside pictures: threads, devices that cannot, missing files.
. "$(dirname "$0")/../support/shell.sh"
worm=$models/worm.glb
knot=$models/knot/knot.gltf
need "$worm"

# --threads: the worker's pools and Mesa's rasteriser have so many, and the pixels are the same.
small=("$worm" --size 48x32 --exposure 0 --env none)
expect 0 "$helio" render "${small[@]}" --samples 2 -o "$temp/all.png"
for threads in 1 3; do
    expect 0 "$helio" render "${small[@]}" --samples 2 -o "$temp/t.png" --threads $threads
    same "$temp/all.png" "$temp/t.png"
    : >"$temp/out"
    "$helio" render "${small[@]}" --samples 65536 -o "$temp/endless.png" --threads $threads --progress json 2>"$temp/out" &
    client=$!
    at_work() { grep -q '"samples"' "$temp/out" || ! kill -0 "$client" 2>/dev/null; }
    until_true at_work
    worker=$(pgrep -P "$client")
    count[threads]=$(ls "/proc/$worker/task" | wc -l)
    raster[threads]=$(cat "/proc/$worker"/task/*/comm | grep -c '^llvmpipe-')
    kill -INT "$client"
    wait "$client"
    [ $? = 8 ] || fail "--threads $threads: not stopped"
    client=
done
[ "${count[1]}" -lt "${count[3]}" ] || fail "--threads 1 has ${count[1]} threads, 3 has ${count[3]}"
if [ "${raster[3]}" != 0 ]; then # a software rasteriser
    [ "${raster[1]}" = 1 ] && [ "${raster[3]}" = 3 ] || fail "rasteriser: ${raster[1]} and ${raster[3]} threads"
fi
expect 2 "$helio" render "${small[@]}" -o "$temp/t.png" --threads 0
expect 2 "$helio" render "${small[@]}" -o "$temp/t.png" --threads 1 --connect unix:nobody
grep -q -- "--threads: is for the private worker" "$temp/out" || fail "--threads with a daemon is not refused"

# A texture that is not where its file says: looked for beside the file and in textures/, else the names that
# were tried are listed.
mkdir -p "$temp/obj/textures"
printf 'mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl a\nf 1/1 2/2 3/3\n' >"$temp/obj/a.obj"
printf 'newmtl a\nmap_Kd C:\\art\\knot.png\n' >"$temp/obj/a.mtl"
flat=(--size 24x24 --samples 1 --exposure 0 --env sky --gi none)
expect 0 "$helio" render "$temp/obj/a.obj" -o "$temp/white.png" "${flat[@]}"
grep -q "warning: a.obj: .*searched: C:/art/knot.png, knot.png, textures/knot.png; white is shown" "$temp/out" ||
    fail "what was searched is not listed: $(cat "$temp/out")"
cp "$models/knot/knot.png" "$temp/obj/textures"
expect 0 "$helio" render "$temp/obj/a.obj" -o "$temp/found.png" "${flat[@]}" --strict
cmp -s "$temp/white.png" "$temp/found.png" && fail "the texture beside the file is not used"
mkdir "$temp/torn"
cp "$models"/knot/knot.gltf "$models"/knot/knot.bin "$temp/torn"
expect 0 "$helio" info "$temp/torn/knot.gltf" --json
grep -q "searched: knot.png; white" "$temp/out" || fail "glTF: what was searched is not listed"

# Names of a daemon count from its asset roots, which are named by their last names only.
start_daemon "$models"
refused() { # code name text
    (cd "$temp/torn" && "$helio" render "$2" -o "$temp/none.png" --connect "$url") >"$temp/out" 2>&1
    [ $? = "$1" ] || fail "$2: not exit code $1: $(cat "$temp/out")"
    grep -q -- "$3" "$temp/out" || fail "$2: '$3' is not said: $(cat "$temp/out")"
    ! grep -q -- "$models" "$temp/out" || fail "$2: says where the roots lie"
}
refused 3 gone.gltf "gone.gltf: no such file; names count from the asset roots 'models'"
refused 3 no/such/folder.gltf "names count from the asset roots 'models'"
refused 5 /etc/hostname "does not lie under an asset root; names count from 'models'"
refused 5 ../../x.gltf "does not lie under an asset root"
refused 3 knot.gltf "knot.gltf is a file of this machine; --upload sends it to the daemon"
expect 0 "$helio" render "$temp/obj/a.obj" -o "$temp/sent.png" "${flat[@]}" --connect "$url" --upload
same "$temp/found.png" "$temp/sent.png"

# No device of that name: trying again is of no use.
expect 9 "$helio" render demo: -o "$temp/none.png" --device no-such-device

[ "$failures" = 0 ] && echo "all good"
exit $((failures > 0))
