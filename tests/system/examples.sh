#!/bin/bash
# examples.sh - the clients of docs/guide-client.md against a real daemon: the picture
# that helio render makes; a refusal ends with a message.
# Uses HELIO_BUILD_DIR, HELIO_SOURCE_DIR, PYTHON3, NODE (empty: without JavaScript).
. "$(dirname "$0")/../support/shell.sh"

knot=$models/knot/knot.gltf
for file in "$helio" "$heliod" "$knot"; do need "$file"; done
cp -r "$models/knot" "$temp/models"
cat >"$temp/models/box.obj" <<'END'
v -1 0 -1
v 1 0 -1
v 1 0 1
v -1 0 1
v 0 2 0
f 1 5 2
f 2 5 3
f 3 5 4
f 4 5 1
END
start_daemon "$temp/models"
python=("$PYTHON3" "$HELIO_SOURCE_DIR/docs/examples/client.py")
node=("${NODE:-}" "$HELIO_SOURCE_DIR/docs/examples/client.mjs")
for scene in knot.gltf box.obj; do
    expect 0 "$helio" render "$scene" -o "$temp/right.png" --size 320x180 --connect "$url"
    expect 0 "${python[@]}" "$url" "$scene" "$temp/python.png"
    same "$temp/right.png" "$temp/python.png"
    [ -n "${NODE:-}" ] && [ "$scene" = knot.gltf ] || continue # of the same messages
    expect 0 "${node[@]}" "$url" "$scene" "$temp/node.png"
    same "$temp/right.png" "$temp/node.png"
done
expect 1 "${python[@]}" "$url" gone.gltf "$temp/none.png"
grep -q "refused" "$temp/out" || fail "python: $(cat "$temp/out")"
[ -z "${NODE:-}" ] || expect 1 "${node[@]}" "$url" gone.gltf "$temp/none.png"
expect 2 "${python[@]}"
grep -q "client.py unix:" "$temp/out" || fail "python: $(cat "$temp/out")"
[ -z "${NODE:-}" ] || expect 2 "${node[@]}"
[ ! -e "$temp/none.png" ] || fail "a file was written for nothing"

exit $((failures > 0))
