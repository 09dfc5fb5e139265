#!/usr/bin/env python3
"""Peak memory of `helio render` under small budgets, scene by scene.

    peaks.py --helio build/bin/helio --budget 64 [--most MIB] SCENE...
    peaks.py --helio build/bin/helio --budget 16 [--most MIB] --all DATA

Each scene is rendered with a cache of its own, so everything is baked. data:NAME is a scene of the test data,
left out where it is missing and need not be there (test_data.py). --all takes every scene,
height map and environment under DATA; what the loaders refuse (exit code 3) is named and counted.
Prints what the pools took at most and the peak of the worker's resident memory, and fails where
that is more than the three budgets (textures, geometry, host) and --most MiB, or where a render
fails otherwise.
"""
import argparse
import json
import os
import subprocess
import sys
import tempfile

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../support"))
import test_data

FOLDERS = ("khronos", "scenes", "extra-gltf", "asset-generator", "big-geometry")
SCENES = (".gltf", ".glb", ".ply", ".ply.gz", ".obj", ".fbx", ".stl", ".dae")
REFUSED = 3  # exit code: bad input file


def render(options, scene, environment, folder):
    """Exit code, peak resident MiB of the run and the statistics it wrote."""
    stats = os.path.join(folder, "stats.json")
    budget = str(options.budget)
    command = [options.helio, "render", scene,
               "--asset-root", os.path.dirname(os.path.abspath(scene)),
               "--cache-dir", os.path.join(folder, "cache"), "--texture-budget", budget,
               "--geometry-budget", budget, "--host-budget", budget, "--samples", "2",
               "--size", options.size, "--exposure", "0", "--progress", "none", "--stats", stats,
               "-o", os.path.join(folder, "out.png")]
    if environment:
        command += ["--env", environment]
    child = os.fork()
    if child == 0:  # in a process of its own: peaks of children never fall
        quiet = subprocess.DEVNULL
        os._exit(subprocess.run(command, stdout=quiet, stderr=quiet).returncode & 255)
    _, status, usage = os.wait4(child, 0)
    code = os.waitstatus_to_exitcode(status)
    if code != 0:
        return code, 0, {}
    with open(stats, encoding="utf-8") as file:
        return 0, usage.ru_maxrss / 1024, json.load(file)


def find_scenes(data):
    """All there is to render: (scene, environment or None), in a fixed order."""
    found = []
    for folder in FOLDERS:
        top = os.path.join(data, folder)
        if not os.path.isdir(top):
            raise SystemExit("test data is missing: %s" % top)
        for place, folders, names in os.walk(top):
            folders.sort()
            found += [(os.path.join(place, name), None) for name in sorted(names)
                      if name.lower().endswith(SCENES) or name.endswith("_height16.png")]
    box = os.path.join(data, "khronos/BoxTextured/glTF/BoxTextured.gltf")
    hdr = os.path.join(data, "hdr")
    found += [(box, os.path.join(hdr, name)) for name in sorted(os.listdir(hdr))
              if name.endswith((".hdr", ".exr"))]
    return found


def measure(options, scene, environment):
    """Prints a line; (budget kept, not refused, MiB beside the budgets)."""
    with tempfile.TemporaryDirectory(prefix="helio-peaks-") as folder:
        code, peak, stats = render(options, scene, environment, folder)
    name = os.path.relpath(scene, options.all) if options.all else os.path.basename(scene)
    name += " + " + os.path.basename(environment) if environment else ""
    if code != 0:
        print("%-72s %s" % (name, "refused" if code == REFUSED else "FAILED: exit code %d" % code),
              flush=True)
        return code == REFUSED, False, 0
    beside = peak - 3 * options.budget
    over = options.most is not None and beside > options.most
    for kind in ("texture", "geometry"):
        over |= find(stats.get(kind), "peak_bytes") > options.budget * 2**20
    print("%-72s peak %6.0f MiB, beside budgets %6.0f, device %6.0f MiB%s" % (
        name, peak, beside, find(stats, "peak_bytes") / 2**20, "  TOO MUCH" if over else ""),
        flush=True)
    return not over, True, beside


def find(value, key):
    """Largest number under `key` anywhere in the statistics."""
    if isinstance(value, dict):
        own = value.get(key, 0) if isinstance(value.get(key, 0), (int, float)) else 0
        return max([own] + [find(v, key) for v in value.values()])
    if isinstance(value, list):
        return max([0] + [find(v, key) for v in value])
    return 0


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--helio", required=True)
    parser.add_argument("--budget", type=int, default=64, help="MiB of each kind")
    parser.add_argument("--most", type=float, help="MiB beside the budgets; default: say, do not judge")
    parser.add_argument("--size", default="1280x720", help="of the picture")
    parser.add_argument("--all", metavar="DATA", help="every scene of this folder of test data")
    parser.add_argument("scenes", nargs="*")
    options = parser.parse_args()
    names = [s[5:] for s in options.scenes if s.startswith("data:")]
    found = [test_data.find(name) for name in names]
    if None in found and test_data.REQUIRED:
        return 1
    scenes = [(s, None) for s in options.scenes if not s.startswith("data:")]
    scenes += [(s, None) for s in found if s]
    if options.all:
        scenes += find_scenes(options.all)
    if not scenes:
        parser.error("no scenes")
    results = [measure(options, *scene) for scene in scenes]
    print("%d scenes, %d refused, %d too large or failed, most beside the budgets %.0f MiB" % (
        len(results), sum(kept and not shown for kept, shown, _ in results),
        sum(not kept for kept, _, _ in results), max(beside for _, _, beside in results)))
    return 0 if all(kept for kept, _, _ in results) else 1


if __name__ == "__main__":
    sys.exit(main())
