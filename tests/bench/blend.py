#!/usr/bin/env python3
"""What blended surfaces cost beside the same surfaces opaque: a street with 200 leaf cards.

    blend.py --helio build/bin/helio --models build/tests/models [--size 960x540] [--samples 32] [--rounds 3]
             [--only motion|settled]

Alternates between leaves.glb and leaves_opaque.glb. Prints one JSON object: motion {blended_ms,
opaque_ms, ratio; cpu_ms of both and their ratio} of frames in motion (helio bench realtime) and
settled {the same in seconds: user and system time of all threads, without what starting costs, which
is taken from a picture of one sample}. Medians over the rounds; on a shared machine only the ratios of
processor time mean much.
"""
import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time

SCENES = {"blended": "leaves.glb", "opaque": "leaves_opaque.glb"}
PATH = [{"eye": [0.2 * (k % 3 - 1), 1.7, 9 - 0.7 * k], "target": [0, 2, -0.7 * k]} for k in range(6)]


def run(command, folder):
    """Wall and processor seconds."""
    start, before = time.monotonic(), os.times()
    done = subprocess.run(command + ["--cache-dir", os.path.join(folder, "cache")],
                          stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    if done.returncode != 0:
        raise SystemExit("%s: exit code %d\n%s" % (" ".join(command), done.returncode, done.stderr))
    after = os.times()
    return (time.monotonic() - start, after.children_user + after.children_system -
            before.children_user - before.children_system)


def motion(options, scene, folder):
    width, height = (int(n) for n in options.size.split("x"))
    report = os.path.join(folder, "report.json")
    run([options.helio, "bench", "realtime", "--asset-root", options.models, "--json", report, "--options",
         json.dumps({"scene": scene, "width": width, "height": height, "rounds": 1, "vfov_deg": 51,
                     "path": PATH})], folder)
    with open(report, encoding="utf-8") as file:
        found = json.load(file)
    return found["frame_ms"], found["cpu_ms"]


def settled(options, scene, folder):
    def picture(samples):
        return run([options.helio, "render", scene, "--asset-root", options.models, "--size", options.size,
                    "--samples", str(samples), "--progress", "none",
                    "-o", os.path.join(folder, "out.png")], folder)
    one, all_of_them = picture(1), picture(options.samples)
    return tuple(max(b - a, 1e-6) for a, b in zip(one, all_of_them))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--helio", required=True)
    parser.add_argument("--models", required=True)
    parser.add_argument("--size", default="960x540")
    parser.add_argument("--samples", type=int, default=32)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", choices=("motion", "settled"), help="one of the two")
    options = parser.parse_args()
    measures = {"motion": (motion, "ms"), "settled": (settled, "s")}
    kinds = [options.only] if options.only else list(measures)
    times = {kind: {name: [] for name in SCENES} for kind in kinds}
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(options.rounds):
            for name, file in SCENES.items():
                scene = os.path.abspath(os.path.join(options.models, file))
                for kind in kinds:
                    times[kind][name].append(measures[kind][0](options, scene, folder))
    report = {"size": options.size, "samples": options.samples, "rounds": options.rounds}
    for kind in kinds:
        row, unit = {}, measures[kind][1]
        for index, prefix in ((0, ""), (1, "cpu_")):
            found = {name: statistics.median(t[index] for t in times[kind][name]) for name in SCENES}
            for name, value in found.items():
                row["%s_%s%s" % (name, prefix, unit)] = round(value, 3)
            row[prefix + "ratio"] = round(found["blended"] / found["opaque"], 3)
        report[kind] = row
    json.dump(report, sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    main()
