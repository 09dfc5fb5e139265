#!/usr/bin/env python3
"""Remote viewing of one scene: Heliograph, ParaView's server, and three.js in Chromium behind TigerVNC.

    npm ci && ./viewing.py --helio ../../../build/bin/helio [--scene FILE] [--size 1280x720] [--poses 60]
                           [--rounds 3] [--only helio,paraview,vnc] [--cache-dir DIR] [--json FILE]

For each, in turns: milliseconds from an input (a pose of the camera, a movement of the pointer) until its client has
the pixels of the picture that it changed, bytes on the wire a picture, and processor time a picture of all
its processes, client and server. Each waits for one picture before it sends the next input. All draw in
software. Heliograph's textures are baked and its shaders compiled in a run before the first round, into a
cache that all its runs share (--cache-dir: one that stays). The pictures are not alike: Heliograph shades,
shadows and accumulates, three.js shades with a shadow map, ParaView draws the triangles without their textures.

Packages: paraview, python3-paraview, tigervnc-standalone-server, xvfb, chromium, iproute2.
"""
import argparse
import functools
import http.server
import json
import os
import re
import signal
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time

from rfb import Screen

HERE = os.path.dirname(os.path.abspath(__file__))
DATA = os.environ.get("HELIO_TEST_DATA", os.path.join(HERE, "../../../../shared/data"))
PATIENCE_S = 180
TICK_S = 1 / os.sysconf("SC_CLK_TCK")


class Failure(Exception):
    pass


def free_port():
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return s.getsockname()[1]


def processor_s(roots):
    """Of processes and all that they started."""
    parents, seconds = {}, {}
    for pid in filter(str.isdigit, os.listdir("/proc")):
        try:
            with open(f"/proc/{pid}/stat", encoding="utf8", errors="replace") as f:
                fields = f.read().rsplit(") ", 1)[1].split()
        except OSError:  # it ended meanwhile
            continue
        parents[int(pid)] = int(fields[1])
        seconds[int(pid)] = (int(fields[11]) + int(fields[12])) * TICK_S

    def belongs(pid):
        return pid in roots or (pid in parents and belongs(parents[pid]))
    return sum(s for pid, s in seconds.items() if belongs(pid))


class Programs:
    """Started in groups of their own, ended together."""

    def __init__(self):
        self.started = []

    def start(self, *words, env=None, **others):
        child = subprocess.Popen(words, start_new_session=True, env={**os.environ, **(env or {})}, **others)
        self.started.append(child)
        return child

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for child in reversed(self.started):
            try:
                os.killpg(child.pid, signal.SIGKILL)
            except ProcessLookupError:
                pass
            child.wait()


def await_true(what, condition):
    until = time.monotonic() + PATIENCE_S
    while not condition():
        if time.monotonic() > until:
            raise Failure(f"{what}: not within {PATIENCE_S} s")
        time.sleep(0.05)


def is_listening(port):
    """Asked without connecting: pvserver takes one client."""
    out = subprocess.run(["ss", "-tlnH", f"sport = :{port}"], check=True, capture_output=True, text=True).stdout
    return bool(out.strip())


def result(latency_ms, sent_bytes, cpu_s):
    latency_ms = sorted(latency_ms)
    pick = lambda share: latency_ms[min(len(latency_ms) - 1, int(share * len(latency_ms)))]
    return {"p50_ms": pick(0.5), "p95_ms": pick(0.95), "p99_ms": pick(0.99),
            "bytes": sent_bytes / len(latency_ms), "cpu_ms": 1e3 * cpu_s / len(latency_ms)}


# ---- Heliograph -----------------------------------------------------------------------------------

def latency_run(args, poses):
    width, height = args.size
    options = {"scene": args.scene, "width": width, "height": height, "poses": poses}
    child = subprocess.run([args.helio, "bench", "latency", "-q", "--options", json.dumps(options), "--cache-dir",
                            args.cache_dir], stdout=subprocess.PIPE, text=True)
    if child.returncode:
        raise Failure(f"helio bench latency: exit code {child.returncode}")
    return json.loads(child.stdout)


def helio(args):
    report = latency_run(args, args.poses)
    total = report["total_ms"]
    return {"p50_ms": total["p50"], "p95_ms": total["p95"], "p99_ms": total["p99"],
            "bytes": report["bytes_per_frame"], "cpu_ms": report["cpu_ms"]["total"]}


# ---- ParaView -------------------------------------------------------------------------------------

def received_bytes(port):
    """By the clients of a port on this machine."""
    out = subprocess.run(["ss", "-tinH", f"dport = :{port}"], check=True, capture_output=True, text=True).stdout
    return sum(int(n) for n in re.findall(r"bytes_received:(\d+)", out))


def paraview(args):
    width, height = args.size
    with Programs() as programs:
        port, display = free_port(), f":{100 + os.getpid() % 400}"
        programs.start("Xvfb", display, "-screen", "0", f"{width + 64}x{height + 64}x24", "-noreset")
        await_true("Xvfb", lambda: os.path.exists(f"/tmp/.X11-unix/X{display[1:]}"))
        env = {"DISPLAY": display, "LIBGL_ALWAYS_SOFTWARE": "1"}
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        server = programs.start("pvserver", f"--server-port={port}", env=env, **quiet)
        await_true("pvserver", lambda: is_listening(port))
        client = programs.start("pvpython", os.path.join(HERE, "paraview_client.py"), str(port), args.scene,
                                str(width), str(height), str(args.poses), env=env, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                stderr=subprocess.DEVNULL, text=True)
        roots = {server.pid, client.pid}
        for line in client.stdout:
            if line.startswith("begin"):
                before = processor_s(roots), received_bytes(port)
            elif line.startswith("latencies "):
                after = processor_s(roots), received_bytes(port)
                return result(json.loads(line.split(" ", 1)[1]), after[1] - before[1], after[0] - before[0])
        raise Failure("pvpython ended without a result")


# ---- three.js, Chromium, TigerVNC -----------------------------------------------------------------

class Pages(http.server.SimpleHTTPRequestHandler):
    def __init__(self, *words, scene, ready, **others):
        self.scene, self.ready = scene, ready
        super().__init__(*words, directory=HERE, **others)

    def translate_path(self, path):
        path = path.split("?")[0]
        for first, folder in (("/three/", os.path.join(HERE, "node_modules/three")),
                              ("/scene/", os.path.dirname(self.scene))):
            if path.startswith(first):
                return os.path.join(folder, os.path.normpath("/" + path[len(first):]).lstrip("/"))
        return super().translate_path(path)

    def do_POST(self):
        self.send_response(204)
        self.end_headers()
        self.ready.set()

    def log_message(self, *_):
        pass


def vnc(args):
    width, height = args.size
    ready = threading.Event()
    handler = functools.partial(Pages, scene=args.scene, ready=ready)
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    page = f"http://127.0.0.1:{server.server_port}/orbit.html?scene=/scene/{os.path.basename(args.scene)}"
    with Programs() as programs, tempfile.TemporaryDirectory() as profile:
        port, display = free_port(), f":{500 + os.getpid() % 400}"
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        screen = programs.start("Xvnc", display, "-geometry", f"{width}x{height}", "-depth", "24", "-SecurityTypes",
                                "None", "-localhost", "-rfbport", str(port), "-AlwaysShared", **quiet)
        await_true("Xvnc", lambda: is_listening(port))
        browser = programs.start("chromium", "--no-sandbox", "--kiosk", "--no-first-run", f"--user-data-dir={profile}",
                                 f"--window-size={width},{height}", "--window-position=0,0", "--use-angle=swiftshader",
                                 "--enable-unsafe-swiftshader", page, env={"DISPLAY": display}, **quiet)
        await_true("the page", ready.is_set)
        time.sleep(1)
        client = Screen("127.0.0.1", port)
        client.drain()
        latencies = []
        roots = {screen.pid, browser.pid}
        before = processor_s(roots) + time.process_time(), client.bytes
        for i in range(args.poses):
            latencies.append(client.move(int(width * (0.1 + 0.8 * (i + 1) / args.poses)), height // 2))
        after = processor_s(roots) + time.process_time(), client.bytes
        return result(latencies, after[1] - before[1], after[0] - before[0])


# ---- all ------------------------------------------------------------------------------------------

SYSTEMS = {"helio": helio, "paraview": paraview, "vnc": vnc}


def parse():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--helio", default=os.path.join(HERE, "../../../build/bin/helio"))
    parser.add_argument("--scene", default=os.path.join(DATA, "scenes/Sponza/glTF/Sponza.gltf"))
    parser.add_argument("--size", default="1280x720")
    parser.add_argument("--poses", type=int, default=60)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", default=",".join(SYSTEMS))
    parser.add_argument("--cache-dir")
    parser.add_argument("--json")
    args = parser.parse_args()
    args.size = tuple(map(int, args.size.split("x")))
    args.scene = os.path.abspath(args.scene)
    args.helio = os.path.abspath(args.helio)
    return args


def measure(args):
    rounds = {name: [] for name in args.only.split(",")}
    if "helio" in rounds:
        latency_run(args, 1)
    for _ in range(args.rounds):
        for name, found in rounds.items():
            found.append(SYSTEMS[name](args))
    return rounds


def main():
    args = parse()
    with tempfile.TemporaryDirectory() as cache:
        args.cache_dir = args.cache_dir or cache
        rounds = measure(args)
    medians = {name: {key: statistics.median(r[key] for r in found) for key in found[0]}
               for name, found in rounds.items()}
    print(f"{'':10}{'p50':>9}{'p95':>9}{'p99 ms':>9}{'KB':>9}{'cpu ms':>9}   a picture; median of {args.rounds} rounds")
    for name, m in medians.items():
        print(f"{name:10}{m['p50_ms']:9.1f}{m['p95_ms']:9.1f}{m['p99_ms']:9.1f}{m['bytes'] / 1e3:9.1f}{m['cpu_ms']:9.1f}")
    if args.json:
        with open(args.json, "w", encoding="utf8") as f:
            json.dump({"size": args.size, "scene": os.path.basename(args.scene), "rounds": rounds}, f, indent=1)


if __name__ == "__main__":
    try:
        main()
    except Failure as failure:
        sys.exit(f"viewing.py: {failure}")
