#!/usr/bin/env python3
"""siege.py --helio PROGRAM: a short `helio bench siege`: every class is there, the honest client was
served beside each, all viewers were. Times are printed, not judged."""
import argparse
import json
import subprocess

CLASSES = ["pings that are not read", "frames that are not read", "eight pictures at once", "picks", "edits",
           "uploads", "connections"]
EQUAL = ["picks", "edits", "connections"]  # compared at equal rates; unpaced apart

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--helio", required=True)
args = parser.parse_args()
options = {"seconds": 0.4, "clients": 1, "viewers": 3, "side": 64, "isolation": "shared"}
text = subprocess.run([args.helio, "bench", "siege", "--options", json.dumps(options)], check=True,
                      stdout=subprocess.PIPE, timeout=280).stdout
report = json.loads(text)
assert [c["name"] for c in report["classes"]] == CLASSES, report
for c in report["classes"]:
    for side in ("behaved", "attacked"):
        for what in ("frame_ms", "ping_ms"):
            times = c[side][what]
            assert times["count"] > 0 and 0 < times["p50"] <= times["p99"] <= times["max"], (c["name"], times)
        assert c[side]["rounds"] > 0 and c[side]["rounds_per_s"] > 0, c
    assert set(c["ratio"]) == {"frame_p50", "frame_p99", "ping_p50", "ping_p99"}, c
    assert c["noise"]["ping_p99"] >= 1 and c["noise"]["frame_p99"] >= 1, c
    assert ("unpaced" in c) == ("unpaced_ratio" in c) == (c["name"] in EQUAL), c
    print(c["name"], c["ratio"], c["noise"])
    if "unpaced" in c:
        print(c["unpaced_ratio"], *(c[side]["rounds_per_s"] for side in ("behaved", "attacked", "unpaced")))
        assert c["unpaced"]["rounds"] > 0 and c["unpaced"]["ping_ms"]["count"] > 0, c
viewers = report["viewers"]
assert len(viewers["frames"]) == 3 and min(viewers["frames"]) > 0 and 0 < viewers["least_to_most"] <= 1, viewers
print(viewers)
bad = subprocess.run([args.helio, "bench", "siege", "--options", '{"clients": 1000}'], stderr=subprocess.PIPE)
assert bad.returncode != 0 and b"clients" in bad.stderr, bad
