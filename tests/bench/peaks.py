#!/usr/bin/env python3
"""Peak memory of `helio render` under small budgets, scene by scene.

    peaks.py --helio build/bin/helio --budget 64 [--most MIB] SCENE...

Each scene is rendered with a cache of its own, so everything is baked. Prints what the pools took
at most and the peak of the worker's resident memory, and fails where that is more than the three
budgets (textures, geometry, host) and --most MiB.
"""
import argparse
import json
import os
import subprocess
import sys
import tempfile


def render(helio, scene, budget, folder):
    """Peak resident MiB of the run and the statistics it wrote."""
    stats = os.path.join(folder, "stats.json")
    command = [helio, "render", scene, "--asset-root", os.path.dirname(os.path.abspath(scene)),
               "--cache-dir", os.path.join(folder, "cache"), "--texture-budget", str(budget),
               "--geometry-budget", str(budget), "--host-budget", str(budget), "--samples", "2",
               "--progress", "none", "--stats", stats, "-o", os.path.join(folder, "out.png")]
    child = os.fork()
    if child == 0:  # in a process of its own: peaks of children never fall
        done = subprocess.run(command, stdout=subprocess.DEVNULL)
        os._exit(0 if done.returncode == 0 else 1)
    _, status, usage = os.wait4(child, 0)
    if status != 0:
        raise RuntimeError("%s could not be rendered" % scene)
    with open(stats, encoding="utf-8") as file:
        return usage.ru_maxrss / 1024, json.load(file)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--helio", required=True)
    parser.add_argument("--budget", type=int, default=64, help="MiB of each kind")
    parser.add_argument("--most", type=float, help="MiB beside the budgets; default: say, do not judge")
    parser.add_argument("scenes", nargs="+")
    options = parser.parse_args()
    failed = 0
    for scene in options.scenes:
        with tempfile.TemporaryDirectory(prefix="helio-peaks-") as folder:
            peak, stats = render(options.helio, scene, options.budget, folder)
        beside = peak - 3 * options.budget
        bad = options.most is not None and beside > options.most
        failed += bad
        print("%-50s peak %6.0f MiB, device %6.0f MiB%s" % (
            os.path.basename(scene), peak, find(stats, "peak_bytes") / 2**20,
            "  TOO MUCH" if bad else ""), flush=True)
    return 1 if failed else 0


def find(value, key):
    """Largest number under `key` anywhere in the statistics."""
    if isinstance(value, dict):
        own = value.get(key, 0) if isinstance(value.get(key, 0), (int, float)) else 0
        return max([own] + [find(v, key) for v in value.values()])
    if isinstance(value, list):
        return max([0] + [find(v, key) for v in value])
    return 0


if __name__ == "__main__":
    sys.exit(main())
