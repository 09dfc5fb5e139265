#!/usr/bin/env python3
"""Host memory of scenes with many triangles: source arrays lie in files without names, so a scene
with sixteen times the triangles takes hardly more memory, whatever is done with it; and what
happens where there can be no such files.

  host_memory.py --bin BUILD/bin [--keep FOLDER] [CASE ...]
      cases: peak place nospace lost kill
"""
import argparse
import json
import os
import random
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time

CELLS = 256  # per side of a part: 131,072 triangles
SMALL_CELLS = 184  # where nothing is measured: the smallest arrays are still spilled (256 KiB)
FEW, MANY = 6, 96  # parts; 21 and 337 MiB of source arrays
PART_BYTES = (CELLS + 1) ** 2 * 32 + CELLS * CELLS * 24
BUDGET = 64  # MiB, of textures, geometry and the host each; as much as of geometry for ray structures
# MiB that MANY may take beside FEW: the window of pages in use, what is touched between two looks at
# them, tables of clusters, the coarsest level of each part, and the ray structures of the exposure
# meter up to their budget, which FEW do not fill.
MORE = 160 + BUDGET
BESIDE = 896  # MiB beside all budgets: a realtime and a path-traced view and what compiles their shaders
PATIENCE_S = 240
SCRIPT = """load {scene}
set size {width}x{height}
set env sky
set samples 2
set gi {gi}
camera fit
frame {out}/fit.png
camera eye 0.5,0.6,2 target 1,0,1
frame {out}/now.png now
camera eye 2.5,0.4,0.6 target 4,0,0.5
frame {out}/near.png
expect pick {pick_x} {pick_near} node land3
camera eye 1,0.5,0.9 target 3,0,0.4
frame {out}/still.png
expect pick {pick_x} {pick_still} node land1
set mode path
frame {out}/path.png
camera fit
wait settled
expect stat process.spill_refused_bytes {refused}
"""


def script_of(path, out, refused, gi, divisor):
    """Pictures of 320x180 px, or of a part of that where nothing is measured."""
    return SCRIPT.format(scene=path, out=out, refused=refused, gi=gi, width=320 // divisor, height=180 // divisor,
                         pick_x=160 // divisor, pick_near=120 // divisor, pick_still=150 // divisor)


def scene(folder, parts, cells=CELLS):
    """Tiles of waves side by side; all parts name the same arrays, and the loader reads them for each."""
    os.makedirs(folder, exist_ok=True)
    rng, n = random.Random(5), cells + 1
    slopes = [[rng.uniform(-1, 1) for _ in range(8)] for _ in range(2)]
    rows = [[0.02 * sum(s * ((k * i * 37 % 512) / 256 - 1) for k, s in enumerate(one)) / 8
             for i in range(n)] for one in slopes]
    data = bytearray()
    for z in range(n):
        for x in range(n):
            data += struct.pack("<3f", x / cells, rows[0][x] + rows[1][z], z / cells)
    data += struct.pack("<3f", 0, 1, 0) * (n * n)
    for z in range(n):
        for x in range(n):
            data += struct.pack("<2f", x / cells, z / cells)
    for z in range(cells):
        for x in range(cells):
            a = z * n + x
            data += struct.pack("<6I", a, a + n, a + 1, a + 1, a + n, a + n + 1)
    with open(f"{folder}/scene.bin", "wb") as f:
        f.write(data)
    spans = [n * n * 12, n * n * 12, n * n * 8, cells * cells * 24]
    starts = [sum(spans[:i]) for i in range(4)]
    heights = [h for h in (min(rows[0]) + min(rows[1]), max(rows[0]) + max(rows[1]))]
    count = n * n
    gltf = {
        "asset": {"version": "2.0"},
        "buffers": [{"uri": "scene.bin", "byteLength": len(data)}],
        "bufferViews": [{"buffer": 0, "byteOffset": o, "byteLength": s} for o, s in zip(starts, spans)],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3",
             "min": [0, heights[0], 0], "max": [1, heights[1], 1]},
            {"bufferView": 1, "componentType": 5126, "count": count, "type": "VEC3"},
            {"bufferView": 2, "componentType": 5126, "count": count, "type": "VEC2"},
            {"bufferView": 3, "componentType": 5125, "count": cells * cells * 6, "type": "SCALAR"}],
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": 0}}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2},
                                    "indices": 3, "material": 0}]} for _ in range(parts)],
        "nodes": [{"mesh": i, "name": f"land{i}", "translation": [i % 12, 0, i // 12]}
                  for i in range(parts)],
        "scenes": [{"nodes": list(range(parts))}], "scene": 0}
    with open(f"{folder}/scene.gltf", "w") as f:
        json.dump(gltf, f)
    return f"{folder}/scene.gltf"


class Failure(Exception):
    pass


def session_of(leader):
    """Processes of the session, the leader's children among them."""
    found = []
    for name in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{name}/stat") as f:
                fields = f.read().rsplit(")", 1)[1].split()
            if int(fields[3]) == leader.pid:
                found.append(int(name))
        except (FileNotFoundError, ProcessLookupError):
            pass
    return found


class Watch(threading.Thread):
    """The largest resident sizes of the worker, MiB: its own peak, and of its own memory alone."""

    def __init__(self, child):
        super().__init__()
        self.child, self.peak, self.own = child, 0.0, 0.0
        self.start()

    def run(self):
        while self.child.poll() is None:
            for pid in session_of(self.child):
                try:
                    with open(f"/proc/{pid}/status") as f:
                        lines = dict(line.split(":", 1) for line in f)
                except (FileNotFoundError, ProcessLookupError):
                    continue
                if "VmHWM" in lines and lines["Name"].strip().startswith("helio-worker"):
                    self.peak = max(self.peak, int(lines["VmHWM"].split()[0]) / 1024)
                    self.own = max(self.own, int(lines["RssAnon"].split()[0]) / 1024)
            time.sleep(0.02)


class Test:
    def __init__(self, folder, bin_folder):
        self.folder, self.bin = folder, bin_folder
        self.small = scene(f"{folder}/small", FEW, SMALL_CELLS)
        self.cache = f"{folder}/cache"

    def start(self, *words, **more):
        return subprocess.Popen([f"{self.bin}/helio", *words], stdout=subprocess.PIPE,
                                stderr=subprocess.PIPE, text=True, start_new_session=True, **more)

    def kill_session(self, child):
        for pid in session_of(child):
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                pass
        child.communicate()

    def options(self):
        return ("--cache-dir", self.cache, "--texture-budget", str(BUDGET), "--geometry-budget",
                str(BUDGET), "--host-budget", str(BUDGET), "--asset-root", self.folder,
                "--log", "warn")

    def outputs(self, child):
        try:
            out, err = child.communicate(timeout=PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.kill_session(child)
            raise Failure(f"no end after {PATIENCE_S} s") from None
        if child.returncode:
            raise Failure(f"exit code {child.returncode}\n{out}{err}")
        return err

    def walk(self, path, out, refused="== 0", gi="none", **more):
        """Everything a viewer does; pictures go to `out`. Peaks in MiB and what was said. Where nothing is measured
        paths alone follow rays: global illumination takes most of the time."""
        os.makedirs(out, exist_ok=True)
        script = f"{out}/script"
        with open(script, "w") as f:
            f.write(script_of(path, out, refused, gi, 2 if path == self.small else 1))
        begin = time.monotonic()
        child = self.start("run", script, *self.options(), **more)
        watch = Watch(child)
        try:
            err = self.outputs(child)
        finally:
            watch.join()
        if watch.peak == 0:
            raise Failure("no worker was seen")
        self.walk_s = time.monotonic() - begin
        return watch, err

    def same(self, a, b):
        for name in ("fit.png", "near.png", "still.png", "path.png"):
            with open(f"{a}/{name}", "rb") as x, open(f"{b}/{name}", "rb") as y:
                if x.read() != y.read():
                    raise Failure(f"{b}/{name} differs from {a}/{name}")

    def nothing_left(self):
        left = [n for n in os.listdir(f"{self.cache}/store") if "spill" in n]
        if left:
            raise Failure(f"files were left: {left}")

    # ---- cases ----------------------------------------------------------------------------------

    def case_peak(self):
        few, many = scene(f"{self.folder}/few", FEW), scene(f"{self.folder}/many", MANY)
        self.walk(self.small, f"{self.folder}/warm", gi="auto")  # shaders are compiled
        peaks = {}
        for cached in ("an empty store", "a full store"):
            for name, path in (("few", few), ("many", many)):
                if cached == "an empty store":
                    shutil.rmtree(f"{self.cache}/store", ignore_errors=True)
                # gi AUTO would be refused: the budget does not hold rays to all of MANY.
                watch, err = self.walk(path, f"{self.folder}/{name}-out")
                if "stay in memory" in err:
                    raise Failure(f"the folder does not do for files:\n{err}")
                peaks[name] = watch.peak
                print(f"  {cached}, {name} parts: peak {watch.peak:.0f} MiB, own memory {watch.own:.0f}")
                if watch.peak > 4 * BUDGET + BESIDE:
                    raise Failure(f"more than the budgets and {BESIDE} MiB")
            if peaks["many"] > peaks["few"] + MORE:
                raise Failure(f"{(MANY - FEW) * PART_BYTES >> 20} MiB more of source arrays take "
                              f"{peaks['many'] - peaks['few']:.0f} MiB")
        self.nothing_left()

    # Folders of the right pictures and of those without files.
    def places(self):
        good, bad = f"{self.folder}/good", f"{self.folder}/bad"
        if not os.path.exists(f"{good}/path.png"):
            _, err = self.walk(self.small, good)
            if "stay in memory" in err:
                raise Failure(f"the folder does not do for files:\n{err}")
        return good, bad

    def case_place(self):
        good, bad = self.places()
        shutil.rmtree(self.cache)
        os.makedirs(self.cache)
        with open(f"{self.cache}/store", "w") as f:
            f.write("not a folder")
        _, err = self.walk(self.small, bad, "> 0")
        if "stay in memory" not in err:
            raise Failure(f"nothing is said of a file in the folder's place:\n{err}")
        self.same(good, bad)
        os.remove(f"{self.cache}/store")

    def case_nospace(self):
        good, bad = self.places()
        asan = ":".join(filter(None, [os.environ.get("ASAN_OPTIONS"), "verify_asan_link_order=0"]))
        for room in (0, 1 << 20):
            shutil.rmtree(f"{self.cache}/store", ignore_errors=True)
            env = {**os.environ, "LD_PRELOAD": f"{self.bin}/../tests/libfull_disk.so",
                   "ASAN_OPTIONS": asan, "HELIO_FULL_DIR": f"{self.cache}/store",
                   "HELIO_FULL_BYTES": str(room)}
            _, err = self.walk(self.small, bad, "> 0", env=env)
            if "No space left" not in err or "stay in memory" not in err:
                raise Failure(f"nothing is said of a full disk ({room} bytes):\n{err}")
            self.same(good, bad)

    def case_lost(self):
        asan = ":".join(filter(None, [os.environ.get("ASAN_OPTIONS"), "verify_asan_link_order=0"]))
        env = {**os.environ, "LD_PRELOAD": f"{self.bin}/../tests/liblost_disk.so",
               "ASAN_OPTIONS": asan}
        for lost in (1, 4):
            out = f"{self.folder}/lost{lost}.png"
            child = self.start("render", self.small, *self.options(), "--size", "64x64", "-o", out,
                               env={**env, "HELIO_LOSE": str(lost)})
            try:
                _, err = child.communicate(timeout=PATIENCE_S)
            except subprocess.TimeoutExpired:
                self.kill_session(child)
                raise Failure(f"no end after {PATIENCE_S} s") from None
            if child.returncode != 7:
                raise Failure(f"exit code {child.returncode}\n{err}")
            said = (f"{self.cache}/store: byte ", "cannot be read back", "scene.gltf")
            if any(text not in err for text in said):
                raise Failure(f"no folder or no asset in what is said:\n{err}")
            if os.path.exists(out):
                raise Failure("a picture was written")
            self.nothing_left()

    def case_kill(self):
        good, rng = self.places()[0], random.Random(9)
        whole = self.walk_s
        for _ in range(4):
            shutil.rmtree(f"{self.cache}/store", ignore_errors=True)
            child = self.start("run", f"{good}/script", *self.options())
            time.sleep(0.2 + rng.random() * 0.6 * whole)
            self.kill_session(child)
            if os.path.isdir(f"{self.cache}/store"):
                self.nothing_left()
        _, err = self.walk(self.small, f"{self.folder}/healed")
        if "stay in memory" in err:
            raise Failure(f"with a folder again:\n{err}")
        self.same(good, f"{self.folder}/healed")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--bin", required=True)
    parser.add_argument("--keep", help="folder for scenes, caches and pictures, which stay")
    parser.add_argument("--place", default=".", help="where a folder for them is made")
    parser.add_argument("cases", nargs="*", default=[])
    options = parser.parse_args()
    cases = options.cases or ["peak", "place", "nospace", "lost", "kill"]
    # Not in the folder for temporary files: it may be in memory.
    folder = options.keep or tempfile.mkdtemp(prefix="host-memory-", dir=options.place)
    folder = os.path.abspath(folder)
    try:
        test = Test(folder, os.path.abspath(options.bin))
        for name in cases:
            print(f"{name}:", flush=True)
            getattr(test, f"case_{name}")()
    except Failure as failure:
        print(f"FAILED: {failure}")
        return 1
    finally:
        if not options.keep:
            shutil.rmtree(folder, ignore_errors=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
