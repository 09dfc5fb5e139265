#!/usr/bin/env python3
"""Faults of the cache folder and of source files, seen from outside: the picture is always right,
nothing crashes, the next run heals.

  cache.py --bin BUILD/bin [--kills N] [CASE ...]
      cases: kill damage vanish full nospace tmpfs replace exchange budget progress
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
import time
import zlib

TEXTURES = 6
SIDE = 1024
PATIENCE_S = 240


def png(path, seed, side=SIDE):
    """Noise on a few tones: does not compress away, differs everywhere."""
    rng = random.Random(seed)
    tone = rng.randbytes(3)
    noise = rng.randbytes(side * side)
    rows = bytearray()
    for y in range(side):
        rows.append(0)
        for value in noise[y * side:(y + 1) * side:4]:
            texel = bytes(((t + value // 4) & 255) for t in tone)
            rows += texel * 4

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    with open(path + ".new", "wb") as f:
        f.write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0))
                + chunk(b"IDAT", zlib.compress(bytes(rows), 1)) + chunk(b"IEND", b""))
    os.rename(path + ".new", path)


def scene(folder):
    """Unlit squares side by side, each with a picture of its own."""
    os.makedirs(folder)
    for i in range(TEXTURES):
        png(f"{folder}/{i}.png", i)
    corners = [(0, 0), (1, 0), (1, 1), (0, 1)]
    data = b"".join(struct.pack("<3f", x, y, 0) for x, y in corners)
    data += b"".join(struct.pack("<2f", x, 1 - y) for x, y in corners)
    data += struct.pack("<6H", 0, 1, 2, 0, 2, 3)
    with open(f"{folder}/scene.bin", "wb") as f:
        f.write(data)
    views = [{"buffer": 0, "byteOffset": o, "byteLength": n} for o, n in ((0, 48), (48, 32), (80, 12))]
    accessors = [
        {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0],
         "max": [1, 1, 0]},
        {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
        {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"}]
    gltf = {
        "asset": {"version": "2.0"}, "extensionsUsed": ["KHR_materials_unlit"],
        "buffers": [{"uri": "scene.bin", "byteLength": len(data)}], "bufferViews": views,
        "accessors": accessors,
        "images": [{"uri": f"{i}.png"} for i in range(TEXTURES)],
        "textures": [{"source": i} for i in range(TEXTURES)],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": i}},
                       "extensions": {"KHR_materials_unlit": {}}} for i in range(TEXTURES)],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2,
                                    "material": i}]} for i in range(TEXTURES)],
        "nodes": [{"mesh": i, "translation": [i % 3 * 1.1, i // 3 * 1.1, 0]} for i in range(TEXTURES)],
        "scenes": [{"nodes": list(range(TEXTURES))}], "scene": 0}
    with open(f"{folder}/scene.gltf", "w") as f:
        json.dump(gltf, f)
    return f"{folder}/scene.gltf"


class Failure(Exception):
    pass


class Test:
    def __init__(self, folder, bin_folder, kills):
        self.folder, self.bin, self.kills = folder, bin_folder, kills
        self.helio, self.heliod = f"{bin_folder}/helio", f"{bin_folder}/heliod"
        self.scene = scene(f"{folder}/scene")
        self.cache = f"{folder}/cache"
        self.shaders = f"{folder}/shaders"
        self.count = 0
        self.was_full = False  # case_nospace ran
        self.right = self.render(cache=self.shaders)["frame"]["hash"]

    def start(self, *words, **more):
        return subprocess.Popen([self.helio, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                text=True, start_new_session=True, **more)

    def outputs(self, child):
        try:
            return child.communicate(timeout=PATIENCE_S)
        except subprocess.TimeoutExpired:
            self.kill_session(child)
            raise Failure(f"{' '.join(child.args)}: no end after {PATIENCE_S} s") from None

    def run(self, *words, codes=(0,), **more):
        child = self.start(*words, **more)
        out, err = self.outputs(child)
        if child.returncode not in codes:
            raise Failure(f"helio {' '.join(words)}: exit code {child.returncode}\n{err}")
        return child.returncode, out, err

    def words(self, name, scene=None, cache=None, more=()):
        words = ["render", scene or self.scene, "-o", f"{name}.png", "--stats", f"{name}.json",
                 "--size", "256x144", "--samples", "2", "--env", "none", "--exposure", "0", "--gi", "none", *more]
        return words if cache is None else [*words, "--cache-dir", cache]

    def render(self, scene=None, cache=None, more=(), **how):
        self.count += 1
        name = f"{self.folder}/{self.count}"
        self.run(*self.words(name, scene, cache, more), **how)
        with open(f"{name}.json") as f:
            return json.load(f)

    def same(self, what, **how):
        stats = self.render(**how)
        if stats["frame"]["hash"] != self.right:
            raise Failure(f"{what}: the picture is wrong, see {self.folder}/{self.count}.png")
        return stats

    def entries(self):
        store = f"{self.cache}/store"
        found = []
        for base, _, names in os.walk(store):
            found += [f"{base}/{n}" for n in names if os.path.getsize(f"{base}/{n}") > 4096]
        return sorted(found)

    # ---- cases ----------------------------------------------------------------------------------

    def kill_session(self, leader):
        """The client and its worker, which leads a group of its own."""
        for name in filter(str.isdigit, os.listdir("/proc")):
            try:
                with open(f"/proc/{name}/stat") as f:
                    fields = f.read().rsplit(")", 1)[1].split()
                if int(fields[3]) == leader.pid:
                    os.kill(int(name), signal.SIGKILL)
            except (FileNotFoundError, ProcessLookupError):
                pass
        leader.communicate()

    def case_kill(self):
        rng = random.Random(1)
        begin = time.monotonic()
        self.run("bake", self.scene, "-o", self.cache)
        whole = time.monotonic() - begin
        for i in range(self.kills):
            if i % 2 == 0:
                shutil.rmtree(f"{self.cache}/store", ignore_errors=True)
            child = self.start("bake", self.scene, "-o", self.cache)
            time.sleep(rng.random() * whole * 1.1)
            self.kill_session(child)
            self.same(f"after kill {i}", cache=self.cache)
        report = json.loads(self.run("bake", self.scene, "-o", self.cache)[1])
        if report["textures"]["failed"] or report["textures"]["packs"] != TEXTURES:
            raise Failure(f"the last bake: {report}")
        again = json.loads(self.run("bake", self.scene, "-o", self.cache)[1])
        if again["textures"]["found"] != TEXTURES:
            raise Failure(f"not all packs are found again: {again}")

    def case_damage(self):
        rng = random.Random(2)
        self.run("bake", self.scene, "-o", self.cache)
        if not self.entries():
            raise Failure("there is nothing in the store to damage")
        damaged = 0
        for i in range(12):
            entries = self.entries()
            victim = rng.choice(entries)
            size = os.path.getsize(victim)
            with open(victim, "r+b") as f:
                at = rng.randrange(size)
                if i % 3 == 2:
                    f.truncate(at)
                else:
                    f.seek(at)
                    byte = f.read(1)[0]
                    f.seek(at)
                    f.write(bytes([byte ^ 1 << rng.randrange(8)]))
            stats = self.same(f"damage {i} to {victim}", cache=self.cache)
            damaged += stats["cache"]["damaged"]
            self.run("bake", self.scene, "-o", self.cache)
        print(f"  {damaged} of 12 damages were met while rendering")
        if damaged == 0:
            raise Failure("no damage was noticed")

    def daemon(self, *more, **how):
        socket, ready = f"{self.folder}/socket", f"{self.folder}/ready"
        if os.path.exists(ready):
            os.remove(ready)
        child = subprocess.Popen([self.heliod, "--listen", f"unix:{socket}", "--port-file", ready,
                                  "--asset-root", self.folder, "--cache-dir", self.cache,
                                  "--sandbox", "best-effort", "--no-seed-shaders", "--log", "error", *more], **how)
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end and child.poll() is None:
            if os.path.exists(ready):
                return child, ("--connect", f"unix:{socket}")
            time.sleep(0.05)
        child.kill()
        raise Failure(f"the daemon does not listen (ended: {child.wait()})")

    def end_daemon(self, child):
        if child.poll() is not None:
            raise Failure(f"the daemon ended with {child.returncode}")
        child.terminate()
        try:
            child.wait(timeout=PATIENCE_S)
        except subprocess.TimeoutExpired:
            child.kill()
        if child.wait():
            raise Failure(f"the daemon ended with {child.returncode}")

    def case_vanish(self):
        child, connect = self.daemon()
        try:
            self.same("before", more=connect)
            rng = random.Random(3)
            for i in range(6):
                self.count += 1
                name = f"{self.folder}/{self.count}"
                client = self.start(*self.words(name, None, None, (*connect, "--samples", "64")))
                time.sleep(rng.random() * 0.5)
                shutil.rmtree(self.cache, ignore_errors=True)
                _, err = self.outputs(client)
                if client.returncode:
                    raise Failure(f"with a vanished cache folder: exit code {client.returncode}\n{err}")
                self.same(f"after the folder vanished {i} times", more=connect)
        finally:
            self.end_daemon(child)
        self.same("the next run", cache=self.cache)

    def case_full(self):
        self.same("a limit of 1 MiB", cache=self.cache, more=("--cache-limit", "1"))
        shutil.rmtree(self.cache)
        os.makedirs(self.cache)
        with open(f"{self.cache}/store", "w") as f:
            f.write("not a folder")
        self.same("a file in the folder's place", cache=self.cache)
        os.remove(f"{self.cache}/store")
        self.same("the next run", cache=self.cache)

    # Bakes in the background are seen while a picture is made, also those that only wait for a core.
    # One image is large and shaders are compiled before, so that the bake outlives the first frame.
    def case_progress(self):
        side = 4 * SIDE
        png(f"{self.folder}/scene/0.png", 0, side)
        texels = side * side + (TEXTURES - 1) * SIDE * SIDE
        stages = set()
        for samples in (64, 256, 1024):
            shutil.rmtree(f"{self.shaders}/store", ignore_errors=True)
            words = self.words(f"{self.folder}/progress", cache=self.shaders,
                               more=("--progress", "json", "--samples", str(samples)))
            events = [json.loads(l) for l in self.run(*words)[2].splitlines() if l.startswith("{")]
            lines = [e for e in events if e["event"] == "progress"]
            baking = [l for l in lines if l["stage"] == "baking textures"]
            if any(l["done"] > l["total"] for l in lines if l["total"]):
                raise Failure(f"more is done than there is: {lines}")
            if any(l["total"] > texels for l in baking):
                raise Failure(f"there is more to bake than the scene has: {baking}")
            stages |= {l["stage"] for l in lines}
            if baking:
                break
        png(f"{self.folder}/scene/0.png", 0)  # for the cases behind
        if "baking textures" not in stages:
            raise Failure(f"no bake was seen: {sorted(stages)}")

    # A disk with so many bytes in all, seen by every process that is started with `how`.
    def check_full_disk(self, bytes_in_all, how, free):
        self.same(f"a disk of {bytes_in_all} bytes", cache=self.cache, **how)
        code, _, err = self.run("bake", self.scene, "-o", self.cache, codes=(0, 3, 6), **how)
        print(f"  {bytes_in_all >> 10} KiB: the bake ends with {code}")
        if code and "No space left" not in err:
            raise Failure(f"a disk of {bytes_in_all} bytes: the bake ends with {code} and says:\n{err}")
        child, connect = self.daemon(**how)
        try:
            self.same("a daemon on the full disk", more=connect)
        finally:
            self.end_daemon(child)
        how = free()
        report = json.loads(self.run("bake", self.scene, "-o", self.cache, **how)[1])["textures"]
        if report["failed"]:
            raise Failure(f"with room again: {report}")
        if self.same("with room again", cache=self.cache, **how)["cache"]["damaged"]:
            raise Failure("the full disk left damaged entries")
        left = [n for n in os.listdir(f"{self.cache}/store") if n.endswith(".tmp")]
        if left:
            raise Failure(f"the full disk left {left}")
        return code != 0

    def check_full_disks(self, case, sizes):
        if not any([case(size) for size in sizes]):
            raise Failure("no disk was ever full")

    # By a preloaded library: needs no rights.
    def case_nospace(self):
        self.was_full = True
        def case(size):
            shutil.rmtree(self.cache, ignore_errors=True)
            # Programs with sanitizers would insist on being the first library.
            asan = ":".join(filter(None, [os.environ.get("ASAN_OPTIONS"), "verify_asan_link_order=0"]))
            env = {**os.environ, "LD_PRELOAD": f"{self.bin}/../tests/libfull_disk.so",
                   "ASAN_OPTIONS": asan, "HELIO_FULL_DIR": self.cache, "HELIO_FULL_BYTES": str(size)}
            return self.check_full_disk(size, {"env": env}, lambda: {})
        self.check_full_disks(case, (0, 40_000, 1 << 20, 3 << 20))

    # By the kernel, where a user may mount a file system of their own; else as above.
    def case_tmpfs(self):
        if os.environ.get("HELIO_OWN_MOUNTS") == "1":
            def case(size):
                shutil.rmtree(self.cache, ignore_errors=True)
                os.makedirs(self.cache)
                subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "cache", self.cache], check=True)
                try:
                    # With its source, or mount would repeat a user id that has no name in here.
                    return self.check_full_disk(size, {}, lambda: subprocess.run(
                        ["mount", "-o", "remount,size=64m", "cache", self.cache], check=True) and {})
                finally:
                    subprocess.run(["umount", self.cache], check=True)
            self.check_full_disks(case, (1 << 16, 1 << 20, 3 << 20))
            return
        alone = ["unshare", "--user", "--map-root-user", "--mount"]
        probe = subprocess.run([*alone, "mount", "-t", "tmpfs", "probe", self.folder],
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        if probe.returncode:
            print("  no file system may be mounted here; the disk is full by a preloaded library")
            if not self.was_full:
                self.case_nospace()
            return
        inside = [sys.executable, __file__, "--bin", self.bin, "tmpfs"]
        if subprocess.run([*alone, *inside], env={**os.environ, "HELIO_OWN_MOUNTS": "1"}).returncode:
            raise Failure("on a small file system, see above")

    # A file is exchanged, or overwritten in place, while a view of it is drawn and streamed.
    def case_exchange(self):
        rng = random.Random(4)
        path = f"{self.folder}/scene/0.png"
        versions = []
        for seed in (200, 201):
            png(path, seed)
            versions.append((open(path, "rb").read(), self.render(cache=self.shaders)["frame"]["hash"]))
        seen = [0, 0, 0]
        child, connect = self.daemon()
        try:
            for i in range(12):
                new = versions[i % 2]
                shutil.rmtree(self.cache, ignore_errors=True)
                self.count += 1
                name = f"{self.folder}/{self.count}"
                client = self.start(*self.words(name, None, None, (*connect, "--samples", "2")))
                time.sleep(rng.random() * 0.4)
                if i % 4 < 2:
                    with open(path + ".new", "wb") as f:
                        f.write(new[0])
                    os.rename(path + ".new", path)
                else:
                    with open(path, "r+b") as f:
                        f.write(new[0])
                        f.truncate()
                _, err = self.outputs(client)
                if client.returncode not in (0, 3):
                    raise Failure(f"exchange {i}: exit code {client.returncode}\n{err}")
                if client.returncode == 0:
                    with open(f"{name}.json") as f:
                        stats = json.load(f)
                    found = {h: n for n, (_, h) in enumerate(versions)}.get(stats["frame"]["hash"], 2)
                    if found == 2 and (stats["texture"]["failed"] != 1 or "cannot be read" not in err):
                        raise Failure(f"exchange {i}: neither picture, and nothing is said: {name}.png")
                    seen[found] += 1
                self.right = new[1]
                self.same(f"after exchange {i}", more=connect)
        finally:
            self.end_daemon(child)
        print(f"  drawn meanwhile: {seen[0] + seen[1]} with one version or the other, {seen[2]} without")

    def case_replace(self):
        child, connect = self.daemon()
        try:
            self.same("before", more=connect)
            png(f"{self.folder}/scene/0.png", 100)
            fresh = self.render(cache=self.shaders)["frame"]["hash"]
            if fresh == self.right:
                raise Failure("the new file makes no difference")
            self.right = fresh
            self.same("the file was replaced", more=connect)
            with open(f"{self.folder}/scene/1.png", "r+b") as f:
                f.truncate(1000)
            cut = f"{self.folder}/cut"
            self.run(*self.words(cut, more=connect))
            os.remove(f"{cut}.png")
            self.run(*self.words(cut, more=(*connect, "--strict")), codes=(3,))
            if os.path.exists(f"{cut}.png"):
                raise Failure("--strict wrote a picture without one of its images")
            png(f"{self.folder}/scene/1.png", 1)
            self.same("the file is whole again", more=connect)
        finally:
            self.end_daemon(child)

    def case_budget(self):
        for option in ("--texture-budget", "--geometry-budget", "--host-budget"):
            for mib in (1, 2, 4, 8, 16, 64):
                name = f"{self.folder}/budget"
                code, _, err = self.run(*self.words(name, None, self.shaders, (option, str(mib))),
                                        codes=(0, 6))
                if code and "budget" not in err:
                    raise Failure(f"{option} {mib}: refused without naming the budget: {err}")
                if code == 0:
                    with open(f"{name}.json") as f:
                        stats = json.load(f)
                    if stats["frame"]["hash"] != self.right:
                        raise Failure(f"{option} {mib}: the picture is wrong")
                    room = stats["texture" if option == "--texture-budget" else "geometry"]
                    if option != "--host-budget" and room["peak_bytes"] > mib << 20:
                        raise Failure(f"{option} {mib}: peak of {room['peak_bytes']} bytes")
                print(f"  {option} {mib}: {'refused' if code else 'same picture'}")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--bin", required=True)
    parser.add_argument("--kills", type=int, default=6)
    parser.add_argument("cases", nargs="*")
    args = parser.parse_args()
    os.environ.pop("MESA_SHADER_CACHE_DIR", None)  # compiled shaders lie in the cache folder, too
    cases = args.cases or ["kill", "damage", "vanish", "full", "nospace", "tmpfs", "replace", "exchange",
                           "budget", "progress"]
    # Names of sockets have room for 108 bytes.
    room = tempfile.gettempdir() if len(tempfile.gettempdir()) < 64 else "/tmp"
    folder = tempfile.mkdtemp(prefix="helio-cache-", dir=room)
    try:
        test = Test(folder, args.bin, args.kills)
        for case in cases:
            begin = time.monotonic()
            shutil.rmtree(test.cache, ignore_errors=True)
            getattr(test, f"case_{case}")()
            print(f"{case}: {time.monotonic() - begin:.1f} s", flush=True)
    except Failure as failure:
        print(f"{case if 'case' in locals() else 'scene'}: {failure}", file=sys.stderr)
        return 1
    shutil.rmtree(folder, ignore_errors=True)
    return 0


sys.exit(main())
