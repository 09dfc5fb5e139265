#!/usr/bin/env python3
"""flow.py --helio PROGRAM --scene FILE: short runs of `helio bench latency` and `many`: every key is
there, each pose is counted once, no frame is older than one before it, what is waited for in vain or beyond its limit is
named, a daemon ends with its benchmark. Times are printed, not judged."""
import argparse
import json
import os
import signal
import subprocess
import tempfile
import time

STAGES = ["uplink", "input", "wait", "render", "read", "encode", "output", "downlink"]
WAIT_S = 120 # for one thing, as the benchmark is told
ALL_S = 250  # for a benchmark

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--helio", required=True)
parser.add_argument("--scene", required=True)
args = parser.parse_args()


def start(name, wait_s, **options):
    options = {"width": 64, "height": 36, "scene": args.scene, "plain": True, **options}
    return subprocess.Popen([args.helio, "bench", name, "--timeout", str(wait_s), "--progress", "json",
                             "--options", json.dumps(options)],
                            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True)


def bench(name, wait_s=WAIT_S, **options):
    program = start(name, wait_s, **options)
    try:
        out, err = program.communicate(timeout=ALL_S)
    except subprocess.TimeoutExpired:
        os.killpg(program.pid, signal.SIGKILL)
        raise SystemExit(f"bench {name} did not end within {ALL_S} s: {program.communicate()[1]}")
    return program.returncode, out, err


def report(name, **options):
    code, out, err = bench(name, **options)
    assert code == 0, (name, code, err)
    return json.loads(out)


latency = report("latency", poses=20)
assert latency["stale_frames"] == 0 and latency["frames"] >= 20, latency
assert list(latency["stages"]) == STAGES, latency["stages"]
for times in (latency["overhead_ms"], latency["total_ms"], *latency["stages"].values()):
    assert times["count"] == 20 and times["p50"] <= times["p95"] <= times["p99"] <= times["max"], times
assert 0 < latency["overhead_ms"]["p50"] <= latency["total_ms"]["p50"], latency
cpu = latency["cpu_ms"]
assert abs(cpu["daemon"] + cpu["workers"] + cpu["client"] - cpu["total"]) < 1e-2 and cpu["client"] > 0, cpu
assert min(cpu.values()) >= 0, cpu
print(json.dumps(latency, indent=1))

many = report("many", seconds=0.3, frames=3, viewers=[1, 2], phases=["viewers", "stuck", "tenants"], tenants=2)
assert [v["count"] for v in many["viewers"]] == [1, 2] and many["unfinished"] is None, many
for part in (*many["viewers"], many["stuck"]["alone"], many["stuck"]["beside"], many["tenants"]):
    assert 0 < part["fairness"] <= 1 and 0 < part["fairness_of_equal"] <= 1, part
    assert (part["fairness_error"] > 0) == (len(part["fps"]) > 1), part
    assert 64 * 36 * 12 * len(part["fps"]) < part["target_bytes"] < part["workers_rss_bytes"], part
    assert part["seconds"] >= 0.3 and part["seconds"] * part["total_fps"] > 2.9 * len(part["fps"]), part
    assert abs(sum(part["fps"]) - part["total_fps"]) < 1e-3, part
second = many["viewers"][1]
assert abs(second["target_bytes_per_viewer"] + second["other_bytes_per_viewer"] - second["bytes_per_viewer"]) <= 1, many
assert second["target_bytes_per_viewer"] == second["target_bytes"] - many["viewers"][0]["target_bytes"] > 0, many
tenants = many["tenants"]
assert sum(tenants["worker_rss_bytes_each"]) == tenants["workers_rss_bytes"] and len(tenants["target_bytes_each"]) == 2, tenants
assert "film" not in many, many
print(json.dumps(many, indent=1))

# It ends in time, whatever it waits for then, with what was measured so far; where that was is said.
counts = list(range(1, 17))
code, out, err = bench("many", seconds=0.3, frames=1e9, window_s=1, limit_s=6, viewers=counts, phases=["viewers"])
if code == 0:
    cut = json.loads(out)
    assert 0 < len(cut["viewers"]) < len(counts) and cut["unfinished"].startswith("viewers, "), cut
else:
    assert "limit_s" in err, err
stages = {json.loads(line)["stage"] for line in err.splitlines() if '"progress"' in line}
assert "viewers, viewer 1: opens the scene" in stages, stages
code, _, err = bench("many", seconds=0.3, frames=1e9, window_s=1e6, limit_s=3, viewers=[1], phases=["viewers"])
assert code != 0 and "limit_s" in err, (code, err)

for name in ("latency", "many"):
    code, _, err = bench(name, width=-1)
    assert code != 0 and name in err, (code, err)
code, _, err = bench("many", phases=["viewer"])
assert code != 0 and "phases" in err, (code, err)
code, _, err = bench("latency", scene=args.scene + ".none")
assert code != 0 and ".none" in err, (code, err)
code, _, err = bench("latency", wait_s=0.001)  # the picture does not settle within that
assert code != 0 and "within" in err, (code, err)

# Killed, it leaves no daemon behind: that would hold the pipes of standard error open.
with tempfile.TemporaryDirectory() as folder:
    os.environ["TMPDIR"] = folder
    program = start("latency", WAIT_S, poses=4000)
    until = time.monotonic() + WAIT_S
    while not any(f.startswith("helio-bench") and os.path.exists(os.path.join(folder, f, "sock"))
                  for f in os.listdir(folder)):
        assert time.monotonic() < until and program.poll() is None, "no daemon was started"
        time.sleep(0.02)
    program.kill()
    program.communicate(timeout=WAIT_S)
