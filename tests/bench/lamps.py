"""Frames in motion under 1, 10, 100 and 1,000 lamps (helio bench realtime), and their growth:
lamps.py --helio HELIO [--scene FILE] [--size WxH] [--lamps N,N..] [--assert-bounded]

Prints JSON: by the number of lamps cpu_ms and frame_ms of a picture, and lights (count, listed,
shadowed). --assert-bounded: more than 32 lamps are listed in cuts, and all are counted."""
import argparse
import json
import subprocess
import sys

parser = argparse.ArgumentParser()
parser.add_argument("--helio", required=True)
parser.add_argument("--scene", required=True)
parser.add_argument("--size", default="640x360")
parser.add_argument("--lamps", default="1,10,100,1000")
parser.add_argument("--assert-bounded", action="store_true")
options = parser.parse_args()

width, height = (int(side) for side in options.size.split("x"))
report = {}
for count in (int(n) for n in options.lamps.split(",")):
    settings = {"scene": options.scene, "width": width, "height": height, "rounds": 1, "gi": 0, "lamps": count}
    done = subprocess.run(
        [options.helio, "bench", "realtime", "--asset-root", options.scene.rpartition("/")[0] or ".",
         "--options", json.dumps(settings)], check=True, stdout=subprocess.PIPE)
    measured = json.loads(done.stdout)
    report[count] = {key: measured[key] for key in ("cpu_ms", "frame_ms", "lights")}
    lights = measured["lights"]
    if options.assert_bounded and lights["count"] < count:
        sys.exit(f"{count} lamps: {lights['count']} lights in the picture")
    # Nodes of a cut come beside lamps: their number shows that there is one.
    if options.assert_bounded and (lights["listed"] == lights["count"]) != (count <= 32):
        sys.exit(f"{count} lamps: {lights['listed']} of {lights['count']} lights in lists")
print(json.dumps(report, indent=1))
