#!/usr/bin/env python3
"""flow.py --helio PROGRAM: short runs of `helio bench latency` and `many`: every key is there, no
frame is older than one before it, stages add up. Times are printed, not judged."""
import argparse
import json
import subprocess

STAGES = ["uplink", "input", "wait", "render", "read", "encode", "output", "downlink"]

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--helio", required=True)
args = parser.parse_args()


def bench(name, **options):
    text = subprocess.run([args.helio, "bench", name, "--options", json.dumps(options)], check=True,
                          stdout=subprocess.PIPE, timeout=280).stdout
    return json.loads(text)


latency = bench("latency", scene="demo:", width=96, height=54, poses=20)
assert latency["stale_frames"] == 0 and latency["frames"] >= 20, latency
assert list(latency["stages"]) == STAGES, latency["stages"]
for times in (latency["overhead_ms"], latency["total_ms"], *latency["stages"].values()):
    assert times["count"] == 20 and times["p50"] <= times["p95"] <= times["p99"] <= times["max"], times
assert 0 < latency["overhead_ms"]["p50"] <= latency["total_ms"]["p50"], latency
print(json.dumps(latency, indent=1))

many = bench("many", seconds=0.5, viewers=[1, 2], tenants=2, width=96, height=54)
assert [v["count"] for v in many["viewers"]] == [1, 2], many
for part in (*many["viewers"], many["tenants"], *(many[k]["beside"] for k in ("stuck", "hidden", "film"))):
    assert 0 <= part["fairness"] <= 1 and part["total_fps"] > 0 and part["workers_rss_bytes"] > 0, part
assert "bytes_per_viewer" in many["viewers"][1], many
print(json.dumps(many, indent=1))
for name in ("latency", "many"):
    bad = subprocess.run([args.helio, "bench", name, "--options", '{"width": -1}'], stderr=subprocess.PIPE)
    assert bad.returncode != 0 and name.encode() in bad.stderr, bad
