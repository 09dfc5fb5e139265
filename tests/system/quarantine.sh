#!/bin/bash
# quarantine.sh - helio quarantine: a file at which the worker died twice is refused and listed, with how often
# and for how long; once it is cleared it is served again.
. "$(dirname "$0")/../support/shell.sh"
need "$helio"
mkdir "$temp/root"
cp "$models/worm.glb" "$temp/root"

# A file whose loader looks for each of its lamps among all nodes: slow enough to be caught at it.
python3 - "$temp/root/slow.dae" <<'PY'
import sys
lamps = range(16000)
head = """<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="1"/></asset><library_geometries><geometry id="G"><mesh><source id="P">
<float_array id="A" count="9">0 0 0 1 0 0 0 1 0</float_array><technique_common><accessor source="#A" count="3"
stride="3"><param name="X" type="float"/><param name="Y" type="float"/><param name="Z" type="float"/></accessor>
</technique_common></source><vertices id="V"><input semantic="POSITION" source="#P"/></vertices>
<triangles count="1"><input semantic="VERTEX" source="#V" offset="0"/><p>0 1 2</p></triangles></mesh></geometry>
</library_geometries><library_lights>"""
light = '<light id="l%d"><technique_common><point><color>1 1 1</color></point></technique_common></light>'
node = '<node id="a node with a long name %d" name="a node with a long name %d"><instance_light url="#l%d"/></node>'
with open(sys.argv[1], "w") as file:
    file.write(head + "".join(light % i for i in lamps) + "</library_lights>")
    file.write('<library_visual_scenes><visual_scene id="S"><node id="n"><instance_geometry url="#G"/></node>')
    file.write("".join(node % (i, i, i) for i in lamps) + "</visual_scene></library_visual_scenes>")
    file.write('<scene><instance_visual_scene url="#S"/></scene></COLLADA>')
PY

start_daemon "$temp/root"
ask() { expect "$1" "$helio" quarantine "${@:2}" --connect "$url"; }
render() { # code file
    expect "$1" "$helio" render "$2" -o "$temp/picture.png" --size 24x24 --samples 1 --env sky --gi none --connect "$url"
}
ask 0 list
grep -qx "no file is in quarantine" "$temp/out" || fail "nothing has happened: $(cat "$temp/out")"
ask 0 clear # nothing to clear is no error
ask 2 forget
ask 2 clear 0123

# Twice the worker is killed while it loads the file: beside others, then alone.
is_loading() { # worker that may not be it: leaves its number in $worker
    local spawner
    worker=$(pgrep -P "$daemon" helio-worker | head -n 1)
    [ -n "$worker" ] && [ "$worker" != "$1" ] && spawner=$(pgrep -P "$worker" | head -n 1) && [ -n "$spawner" ] &&
        pgrep -P "$spawner" >/dev/null
}
"$helio" render slow.dae -o "$temp/none.png" --size 24x24 --samples 1 --connect "$url" >"$temp/client" 2>&1 &
client=$!
last=0
for i in 1 2; do
    until_true is_loading "$last"
    [ $i = 2 ] || sleep 1 # the second one counts when it ends within twice as long
    kill -9 "$worker"
    last=$worker
done
wait "$client"
[ $? = 7 ] || fail "the worker's death is not exit code 7: $(cat "$temp/client")"
client=
grep -q "died 2 times" "$temp/client" || fail "the client is not told why: $(cat "$temp/client")"

ask 0 list
grep -Eq '^key +tenant +file +deaths +refused_s' "$temp/out" || fail "no head of the list: $(cat "$temp/out")"
grep -Eq ' local +slow.dae +2 +5[0-9][0-9]' "$temp/out" || fail "slow.dae is not listed: $(cat "$temp/out")"
ask 0 list --json
key=$(python3 -c 'import json, sys
entry, = json.load(open(sys.argv[1]))["quarantine"]
print(entry["key"] if entry["file"] == "slow.dae" and 0 < entry["refused_s"] <= 600 else "")' "$temp/out")
[ ${#key} = 64 ] || fail "slow.dae is not listed as JSON: $(cat "$temp/out")"

# It is refused before a worker sees it, other files are not.
render 7 slow.dae
grep -Eq "slow.dae.* it is in quarantine for (5[0-9]{2}|600) s more" "$temp/out" ||
    fail "not refused as one in quarantine: $(cat "$temp/out")"
[ "$(pgrep -P "$daemon" helio-worker | head -n 1)" != "$last" ] || fail "the worker is still the killed one"
render 0 worm.glb
ask 0 list
grep -q slow.dae "$temp/out" || fail "a refused file is no longer listed"

# By the first digits of its key.
ask 0 clear "${key:0:12}"
ask 0 list
grep -qx "no file is in quarantine" "$temp/out" || fail "still listed: $(cat "$temp/out")"
render 0 slow.dae
ask 2 clear "$key"

[ "$failures" = 0 ] && echo "all good"
exit $((failures > 0))
