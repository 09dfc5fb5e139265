#!/bin/bash
# camera.sh - which camera a picture was made with, in statistics and scripts. Uses HELIO_BUILD_DIR.
. "$(dirname "$0")/../support/shell.sh"

startup=$models/startup.glb
for file in "$helio" "$startup"; do need "$file"; done

start_daemon "$models"
picture() { # options...
    expect 0 "$helio" render "$startup" -o "$temp/a.png" --size 32x18 --samples 1 --exposure 0 --gi none \
        --stats "$temp/stats.json" --connect "$url" "$@"
}
camera() { # key
    python3 -c 'import json, sys
print(json.dumps(json.load(open(sys.argv[1]))["camera"].get(sys.argv[2])).strip("\""))' "$temp/stats.json" "$1"
}
is() { # key value
    [ "$(camera "$1")" = "$2" ] || fail "camera.$1 is $(camera "$1"), not $2"
}

picture # the file's
is source node
is node Camera
is kind perspective
angle=$(camera vfov_deg)
eye=$(camera eye)
case $angle in 22.89*) ;; *) fail "the angle is $angle" ;; esac

picture --camera fit
is source fit
is node null
case $(camera vfov_deg) in 45.0*) ;; *) fail "the fitted angle is $(camera vfov_deg)" ;; esac
[ "$(camera eye)" != "$eye" ] || fail "the fitted camera stands where the file's does"
picture --view top
is source fit
picture --eye 1,2,3 --target 0,0.5,0 --fov 30
is source given
is eye "[1.0, 2.0, 3.0]"
is target "[0.0, 0.5, 0.0]"

# A camera that sees nothing is obeyed where it was asked for, and said.
python3 - "$startup" "$temp/blind.glb" <<'END'
import json, struct, sys
data = open(sys.argv[1], "rb").read()
(size,) = struct.unpack_from("<I", data, 12)
gltf = json.loads(data[20:20 + size])
node = dict(next(n for n in gltf["nodes"] if "camera" in n), name="Blind")
node.pop("matrix", None)
node.update(translation=[0, 0, 100], rotation=[0, 1, 0, 0])
gltf["nodes"].append(node)
gltf["scenes"][0]["nodes"].append(len(gltf["nodes"]) - 1)
text = json.dumps(gltf).encode()
text += b" " * (-len(text) % 4)
body = struct.pack("<I4s", len(text), b"JSON") + text + data[20 + size:]
open(sys.argv[2], "wb").write(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)
END
expect 0 "$helio" render "$temp/blind.glb" -o "$temp/a.png" --size 32x18 --samples 1 --exposure 0 --gi none --camera Blind
grep -q "Blind: camera: no geometry is in its view" "$temp/out" || fail "nothing is said of a blind camera: $(cat "$temp/out")"
# With --at the camera is fitted to the pose that is rendered: all of it has moved by 10 m along x.
python3 - "$startup" "$temp/moves.glb" <<'END'
import base64, json, struct, sys
data = open(sys.argv[1], "rb").read()
(size,) = struct.unpack_from("<I", data, 12)
gltf = json.loads(data[20:20 + size])
keys = struct.pack("<14f", 0, 1, 0, 0, 0, 10, 0, 0, 0, 0, 0, 30, 0, 0)
gltf["buffers"].append({"byteLength": len(keys), "uri": "data:application/octet-stream;base64," +
                        base64.b64encode(keys).decode()})
buffer, views = len(gltf["buffers"]) - 1, len(gltf["bufferViews"])
gltf["bufferViews"] += [{"buffer": buffer, "byteOffset": 0, "byteLength": 8},
                        {"buffer": buffer, "byteOffset": 8, "byteLength": 24},
                        {"buffer": buffer, "byteOffset": 32, "byteLength": 24}]
accessors = len(gltf["accessors"])
gltf["accessors"] += [{"bufferView": views, "componentType": 5126, "count": 2, "type": "SCALAR", "min": [0], "max": [1]},
                      {"bufferView": views + 1, "componentType": 5126, "count": 2, "type": "VEC3"},
                      {"bufferView": views + 2, "componentType": 5126, "count": 2, "type": "VEC3"}]
top = len(gltf["nodes"])
gltf["nodes"].append({"name": "moves", "children": gltf["scenes"][0]["nodes"]})
gltf["scenes"][0]["nodes"] = [top]
gltf["animations"] = [{"name": name, "samplers": [{"input": accessors, "output": accessors + output}],
                       "channels": [{"sampler": 0, "target": {"node": top, "path": "translation"}}]}
                      for name, output in (("walk", 1), ("run", 2))]
text = json.dumps(gltf).encode()
text += b" " * (-len(text) % 4)
body = struct.pack("<I4s", len(text), b"JSON") + text + data[20 + size:]
open(sys.argv[2], "wb").write(struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body)
END
moved() { # options...: x of the target of a fitted camera
    expect 0 "$helio" render "$temp/moves.glb" -o "$temp/a.png" --size 32x18 --samples 1 --exposure 0 --gi none \
        --camera fit --stats "$temp/stats.json" "$@"
    camera target | python3 -c 'import json, sys; print(round(json.load(sys.stdin)[0], 2))'
}
before=$(moved)
after=$(moved --at 1)
python3 -c 'import sys; sys.exit(abs(float(sys.argv[2]) - float(sys.argv[1]) - 10) > 0.01)' "$before" "$after" ||
    fail "the target of the pose at 1 s is $after, not 10 m from $before"

# Of two animations that move the same thing the first one is posed, or the one that is named.
grep -q "not shown: run (--animation NAME)" "$temp/out" || fail "$(cat "$temp/out")"
for name in run 1; do
    far=$(moved --at 1 --animation "$name")
    python3 -c 'import sys; sys.exit(abs(float(sys.argv[2]) - float(sys.argv[1]) - 30) > 0.01)' "$before" "$far" ||
        fail "the target of the pose of $name at 1 s is $far, not 30 m from $before"
done
[ "$(moved --animation run)" = "$before" ] || fail "--animation without a time is not the pose at 0 s"
expect 2 "$helio" render "$temp/moves.glb" -o "$temp/a.png" --animation crawl
grep -q "no animation 'crawl'; the file has walk, run" "$temp/out" || fail "$(cat "$temp/out")"
{
    echo "set size 32x18"
    echo "set samples 1"
    echo "set exposure 0"
    echo "load $temp/moves.glb"
    echo "camera eye 1000,0,0 target 1030,0,0"
    echo "at 1 animation run"
    echo "camera fit"
    echo "expect stat camera.target.0 >= 29"
    echo "at 1 animation walk"
    echo "camera fit"
    echo "expect stat camera.target.0 < 20"
} >"$temp/animation.helio"
expect 0 "$helio" run "$temp/animation.helio"

picture --camera Camera
! grep -q "no geometry" "$temp/out" || fail "$(cat "$temp/out")"

# What the worker refuses is an error with a daemon, too.
expect 2 "$helio" render "$startup" -o "$temp/b.png" --size 32x18 --mode path --samples 1 \
    --lens-radius 0.1 --connect "$url"
grep -q "focus_distance: a camera of the scene looks at no point" "$temp/out" ||
    fail "$(cat "$temp/out")"
[ ! -e "$temp/b.png" ] || fail "a refused camera gave a picture"

{
    echo "set size 32x18"
    echo "set samples 1"
    echo "set exposure 0"
    echo "load $startup"
    echo "expect stat camera.source == node"
    echo "expect stat frame.mode == realtime"
    echo "expect stat camera.node == Camera"
    echo "expect stat camera.vfov_deg < 23"
    echo "camera fit view front"
    echo "expect stat camera.source == fit"
    echo "expect stat camera.eye.2 > 1"
    echo "camera eye 1,2,3 target 0,0,0"
    echo "expect stat camera.source == given"
    echo "expect stat camera.eye.1 == 2"
    echo "camera node Camera"
    echo "expect stat camera.source == node"
} >"$temp/script"
expect 0 "$helio" run "$temp/script"
echo "expect stat camera.source == fit" >>"$temp/script"
expect 1 "$helio" run "$temp/script" --connect "$url"

[ $failures = 0 ] || { echo "$failures failures"; exit 1; }
echo ok
