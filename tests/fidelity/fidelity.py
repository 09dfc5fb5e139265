#!/usr/bin/env python3
"""Renders the Render-Fidelity scenarios and ranks us among the other engines.

usage: fidelity.py --helio PROGRAM --score PROGRAM --out DIR --explanations FILE
                   [--only NAME]... [--jobs N] [--spp N] [--candidate ENGINE]
                   [--path all|NAME,...] [--path-spp N] [--no-realtime] [--gi WHICH]

Every scenario of fidelity/scenarios.json in the test data is rendered through the command line at the size the
other engines drew at, by one daemon, reduced to their thumbs' size as theirs were, and scored with the published
metric (see score.h). Rasterisers are compared with rasterisers. A scenario of which at least two of them
have pictures is compared; it passes when our median distance to the others is no larger than the
typical distance among them. At least 80 % must pass, and explanations.txt must explain exactly the others, one line each.

--path-spp N: samples of path mode; 0, the default, chooses for each scenario, so that noise
lies some 3 dB below the distance that decides (a full frame at 16 samples is about -31 dB off).
--path-least N, --path-most N: no scenario gets fewer (4) or more (64). --path-denoise: all get the denoiser, which can only take
them farther from a picture without noise than more samples would.
--path renders scenarios in path mode as well and ranks those pictures among the path tracers. A
scenario passes there when at most one path tracer has a smaller median distance to the others of
them than we have; at least 70 % must pass. With names in place of "all" each of them must, unless
explanations.txt has a line "path NAME: reason". --no-realtime leaves out the rest.
--gi WHICH: global illumination in real time; none, the default, is what rasterisers have.

--candidate scores one engine's pictures in place of ours (no rendering): a rehearsal of the
harness that shows how the engines themselves would rank.
Writes OUT/index.html, OUT/results.json and one line on stdout. Exit code 1 when the aim is missed.
"""
import argparse
import concurrent.futures
import contextlib
import html
import json
import math
import os
import statistics
import subprocess
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../support"))
import test_data
from daemon import baked, daemon

RASTERISERS = ("babylon", "filament", "gltf-sample-viewer", "model-viewer")
PATH_TRACERS = ("blender-cycles", "stellar", "three-gpu-pathtracer", "vray")
# Renders of older settings (FIDELITY.md): shown, never scored.
OUTLIERS = ("dspbr-pt", "rhodonite")
AIM = 0.8
PATH_AIM = 0.7
# Scenarios this near to the line may or may not be explained: versions of Mesa move them across.
NEAR_DB = 0.3
ALIKE_DB = -10
SECONDS_PER_SCENARIO = {"realtime": 240, "path": 1800}


def camera_arguments(scenario):
    t, orbit = scenario["target"], scenario["orbit"]
    arguments = ["--fov", repr(scenario["verticalFoV"])]
    if orbit["radius"]:
        arguments += ["--orbit=%r,%r,%r" % (orbit["theta"], orbit["phi"], orbit["radius"]),
                      "--target=%r,%r,%r" % (t["x"], t["y"], t["z"])]
        return arguments
    # Radius 0: the eye is at the target and looks the way an orbiting camera would.
    theta, phi = math.radians(orbit["theta"]), math.radians(orbit["phi"])
    ahead = (-math.sin(phi) * math.sin(theta), -math.cos(phi), -math.sin(phi) * math.cos(theta))
    at = [t[k] + a for k, a in zip("xyz", ahead)]
    return arguments + ["--eye=%r,%r,%r" % (t["x"], t["y"], t["z"]), "--target=%r,%r,%r" % tuple(at)]


def full_size(scenario):
    """The size the engines drew at, before their pictures were reduced to thumbs."""
    return scenario["dimensions"]["width"] * 2, scenario["dimensions"]["height"] * 2


class Harness:
    def __init__(self, options):
        self.options = options
        self.folder = os.path.join(options.data, "fidelity", "goldens")

    def goldens(self, name, scenario):
        """{engine: file} of the thumbs that share the scenario's aspect, and their size."""
        folder = os.path.join(self.folder, name)
        files = {}
        for entry in sorted(os.listdir(folder)) if os.path.isdir(folder) else ():
            if entry.endswith("-golden.thumb.webp"):
                files[entry[:-len("-golden.thumb.webp")]] = os.path.join(folder, entry)
        if not files:
            return {}, None
        text = subprocess.run([self.options.score, "sizes"] + list(files.values()), check=True,
                              stdout=subprocess.PIPE, text=True).stdout
        sizes = dict(zip(files, (tuple(map(int, line.split())) for line in text.splitlines())))
        for engine, (width, height) in sizes.items():
            if width == 0:
                sys.exit("%s cannot be read" % files[engine])
        want = scenario["dimensions"]
        expected = (512, 512 * want["height"] / want["width"])
        near = [s for s in sizes.values() if abs(s[0] - expected[0]) + abs(s[1] - expected[1]) < 3]
        if not near:
            return {}, None
        size = statistics.mode(near)
        return {e: f for e, f in files.items() if sizes[e] == size}, size

    def path_samples(self, name, goldens, size, peers):
        """Samples per pixel whose noise does not decide the place among the path tracers; None:
        there are no two that show the same."""
        base = os.path.join(self.options.out, name + ".peers")
        matrix = self.distances(base, size, [goldens[e] for e in peers])
        seats = alike(matrix, range(len(peers)))
        if len(seats) < 2:
            return None
        if self.options.path_spp:
            return self.options.path_spp
        between = [statistics.median(matrix[e][o] for o in seats if o != e) for e in seats]
        needed = 16 * 2 ** ((-28 - sorted(between)[1]) / 3)
        return int(max(2 ** math.ceil(math.log2(max(needed, 1))), self.options.path_least))

    def distances(self, base, size, pictures):
        """Matrix of distances in dB; draws BASE.strip.png and BASE.png, the first one's thumb."""
        text = subprocess.run(
            [self.options.score, "compare", "%dx%d" % size, base + ".strip.png", base + ".png"] +
            pictures, check=True, stdout=subprocess.PIPE, text=True).stdout
        return [[float(v) for v in line.split()] for line in text.splitlines()]

    def render(self, scenario, mode, spp, out, denoise=False):
        options = self.options
        command = [options.helio, "render", os.path.join(options.data, scenario["modelFile"]),
                   "-o", out, "--size", "%dx%d" % full_size(scenario),
                   "--env", os.path.join(options.data, scenario["environmentFile"]),
                   "--background", "env" if scenario["renderSkybox"] else "none",
                   "--tonemap", "aces", "--exposure", "0", "--mode", mode, "--spp", str(spp), "--gi", options.gi,
                   "--progress", "none", "--connect", options.url]
        command += camera_arguments(scenario) + (["--denoise"] if denoise else [])
        try:
            done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                  text=True, errors="replace", timeout=SECONDS_PER_SCENARIO[mode])
        except subprocess.TimeoutExpired:
            return "took more than %d s" % SECONDS_PER_SCENARIO[mode]
        if done.returncode:
            lines = done.stdout.strip().splitlines()
            return "exit code %d: %s" % (done.returncode, lines[-1] if lines else "no message")
        return None

    def run(self, name, scenario):
        """The record of one scenario for results.json."""
        record = {"name": name, "state": "scored"}
        held = {key: os.path.join(self.options.data, scenario[key]) if scenario.get(key) else None
                for key in ("modelFile", "environmentFile")}
        for key, path in held.items():
            if not path or not os.path.exists(path):
                return dict(record, state="not held", why="%s %s" % (
                    key[:-4], scenario.get(key) or scenario.get("lighting")))
        goldens, size = self.goldens(name, scenario)
        mine = self.options.candidate
        if mine:
            if mine not in goldens:
                return dict(record, state="no picture", why="%s has none" % mine)
            first = goldens.pop(mine)
        for mode, engines, suffix in (("realtime", RASTERISERS, ""), ("path", PATH_TRACERS, ".path")):
            if not self.wanted(mode, name):
                continue
            peers = [e for e in engines if e in goldens]
            if len(peers) < 2:
                if mode == "realtime":
                    record = dict(
                        record, state="no peers", why="%d comparable pictures" % len(peers))
                continue
            if not mine:
                first = os.path.join(self.options.out, name + suffix + ".full.png")
                started = time.monotonic()
                spp = self.options.spp
                if mode == "path":
                    spp = self.path_samples(name, goldens, size, peers)
                if spp is None:
                    continue
                denoise = mode == "path" and self.options.path_denoise
                if mode == "path":
                    spp = min(spp, self.options.path_most)
                failure = self.render(scenario, mode, spp, first, denoise)
                seconds = round(time.monotonic() - started, 2)
                if failure:
                    return dict(record, state="failed", why="%s mode: %s" % (mode, failure))
            scored = self.score(name + suffix, first, goldens, size)
            if not mine:
                scored["seconds"], scored["samples"] = seconds, spp
            if mode == "realtime":
                record.update(scored)
                group = record["rasterisers"]
                record["passes"] = group["ours_db"] <= group["typical_db"]
            elif "path_tracers" in scored:
                group = scored["path_tracers"]
                nearer = sum(db < group["ours_db"] for db in group["each_db"])
                record["path"] = dict(scored, place=nearer + 1, passes=nearer <= 1)
                if not mine:
                    record["path"]["denoised"] = denoise
        return record

    def wanted(self, mode, name):
        options = self.options
        if mode == "realtime":
            return not options.no_realtime
        return options.path == "all" or name in options.path.split(",")

    def score(self, name, first, goldens, size):
        record = {}
        order = [e for e in RASTERISERS + PATH_TRACERS + OUTLIERS if e in goldens]
        base = os.path.join(self.options.out, name)
        matrix = self.distances(base, size, [first] + [goldens[e] for e in order])
        record["engines"] = order
        record["matrix_db"] = matrix
        record["ours_db"] = dict(zip(order, matrix[0][1:]))
        for key, engines in (("rasterisers", RASTERISERS), ("path_tracers", PATH_TRACERS)):
            group = [order.index(e) + 1 for e in engines if e in order]
            if key == "path_tracers":
                group = alike(matrix, group)
            if len(group) > 1:
                record[key] = rank(matrix, group)
        return record


def alike(matrix, group):
    """Those of a group that show what one of the others shows: a picture that is empty, or of
    something else, is no part of a consensus."""
    return [e for e in group
            if min((matrix[e][o] for o in group if o != e), default=0) <= ALIKE_DB]


def rank(matrix, group):
    """Our distance to a group of engines, and theirs among themselves: each engine in turn gives
    up its seat to us, so that it and we are measured against the same others."""
    theirs, ours = {}, {}
    for engine in group:
        others = [e for e in group if e != engine]
        theirs[engine] = statistics.median(matrix[engine][o] for o in others)
        ours[engine] = statistics.median(matrix[0][o] for o in others)
    return {"ours_db": statistics.median(ours.values()),
            "typical_db": statistics.median(theirs.values()),
            "each_db": [theirs[e] for e in group]}


def read_explanations(path):
    explanations = {}
    with open(path, encoding="utf-8") as file:
        for number, line in enumerate(file, 1):
            line = line.strip()
            if not line or line.startswith("#"):
                continue
            name, colon, text = line.partition(":")
            if not colon or not text.strip():
                sys.exit("%s:%d: not \"SCENARIO: reason\"" % (path, number))
            explanations[name.strip()] = text.strip()
    return explanations


def judge(records, explanations, checked):
    """(compared, passed, complaints)."""
    compared = [r for r in records if "passes" in r]
    passed = [r for r in compared if r["passes"]]
    complaints = ["%s: not rendered: %s" % (r["name"], r["why"]) for r in records
                  if r["state"] == "failed"]
    if not checked:
        return compared, passed, complaints
    if not compared:
        complaints.append("no scenario could be scored: the test data is missing")
    elif len(passed) < AIM * len(compared):
        complaints.append("%d of %d compared scenarios pass, the aim is %d %%" % (
            len(passed), len(compared), AIM * 100))
    above = {r["name"]: r["rasterisers"]["ours_db"] - r["rasterisers"]["typical_db"]
             for r in compared}
    for record in records:
        name = record["name"]
        if above.get(name, -1) > NEAR_DB and name not in explanations:
            complaints.append("%s: farther off than the others by %.2f dB, and explanations.txt "
                              "does not say why" % (name, above[name]))
        if above.get(name, -1) < -NEAR_DB and name in explanations:
            complaints.append("%s: needs no explanation in explanations.txt" % name)
    return compared, passed, complaints


def judge_path(records, explanations, wanted, full):
    """(compared, passed, complaints) of path mode. wanted: names that must be there."""
    compared = [r for r in records if "path" in r]
    passed = [r for r in compared if r["path"]["passes"]]
    complaints = []
    names = {r["name"] for r in compared}
    for name in wanted:
        if name not in names:
            complaints.append("%s: not scored in path mode" % name)
    if full and len(passed) < PATH_AIM * max(len(compared), 1):
        complaints.append("%d of %d scenarios pass in path mode, the aim is %d %%" % (
            len(passed), len(compared), PATH_AIM * 100))
    for record in compared:
        group, key = record["path"]["path_tracers"], "path " + record["name"]
        second = sorted(group["each_db"])[1]
        if group["ours_db"] > second + NEAR_DB and key not in explanations:
            complaints.append("%s: in path mode farther off than two path tracers by %.2f dB, and "
                              "explanations.txt does not say why" % (
                                  record["name"], group["ours_db"] - second))
        if group["ours_db"] < second - NEAR_DB and key in explanations:
            complaints.append("%s: needs no explanation for path mode" % record["name"])
    return compared, passed, complaints


STYLE = """body{font:14px sans-serif;margin:2em;background:#fff;color:#222}
img{max-width:100%;border:1px solid #ccc}h2{margin:1.6em 0 .2em}
.good{color:#176e2c}.bad{color:#a11}.grey{color:#777}table{border-collapse:collapse}
td,th{padding:.1em .8em .1em 0;text-align:left}"""


def describe(record, explanations):
    name = html.escape(record["name"])
    parts = ["<h2 id='%s'>%s</h2>" % (name, name)]
    if record["state"] != "scored":
        parts.append("<p class=grey>%s: %s</p>" % (record["state"], html.escape(record["why"])))
    if "rasterisers" in record and "passes" in record:
        parts += describe_realtime(record, explanations, name)
    if "path" in record:
        parts += describe_path(record, explanations, name)
    return parts


def distances(record):
    return "<table><tr><th>ours" + "".join("<th>" + e for e in record["engines"]) + \
        "</tr><tr><td>" + "".join("<td>%.2f" % record["ours_db"][e] for e in record["engines"]) + \
        "</tr></table>"


def describe_path(record, explanations, name):
    path = record["path"]
    group = path["path_tracers"]
    parts = ["<p class=%s>path mode, place %d among %d path tracers and us: ours %.2f dB, theirs "
             "%s dB</p>" % ("good" if path["passes"] else "bad", path["place"],
                            len(group["each_db"]), group["ours_db"],
                            ", ".join("%.2f" % db for db in group["each_db"]))]
    if "path " + record["name"] in explanations:
        parts.append("<p>%s</p>" % html.escape(explanations["path " + record["name"]]))
    return parts + [distances(path), "<img src='%s.path.strip.png' alt='strip'>" % name]


def describe_realtime(record, explanations, name):
    parts = []
    group = record["rasterisers"]
    kind, word = ("good", "no farther") if record["passes"] else ("bad", "farther")
    parts.append("<p class=%s>%s than the others: ours %.2f dB, typical %.2f dB</p>" % (
        kind, word, group["ours_db"], group["typical_db"]))
    if record["name"] in explanations:
        parts.append("<p>%s</p>" % html.escape(explanations[record["name"]]))
    if "path_tracers" in record:
        traced = record["path_tracers"]
        parts.append("<p class=grey>against path tracers: ours %.2f dB, among them %.2f dB</p>" % (
            traced["ours_db"], traced["typical_db"]))
    parts.append(distances(record))
    parts.append("<img src='%s.strip.png' alt='strip'>" % name)
    return parts


def write_report(out, records, explanations, summary):
    page = ["<!doctype html><meta charset=utf-8><title>Fidelity</title><style>%s</style>" % STYLE,
            "<h1>Fidelity</h1><p>%s</p>" % html.escape(summary),
            "<p>Top row: ours, then each engine. Below: ours minus theirs, four times; grey is "
            "equal, brighter means ours is brighter. Distances in dB of the published metric; "
            "lower is closer.</p>"]
    for record in records:
        page += describe(record, explanations)
    with open(os.path.join(out, "index.html"), "w", encoding="utf-8") as file:
        file.write("\n".join(page) + "\n")
    with open(os.path.join(out, "results.json"), "w", encoding="utf-8") as file:
        json.dump({"summary": summary, "scenarios": records}, file, indent=1, sort_keys=True)
        file.write("\n")


def main():
    parser = argparse.ArgumentParser()
    for name in ("--score", "--out", "--explanations"):
        parser.add_argument(name, required=True)
    parser.add_argument("--helio")
    parser.add_argument("--only", action="append", default=[])
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--spp", type=int, default=5)
    parser.add_argument("--candidate")
    parser.add_argument("--path", default="")
    parser.add_argument("--path-spp", type=int, default=0)
    parser.add_argument("--path-least", type=int, default=4)
    parser.add_argument("--path-most", type=int, default=64)
    parser.add_argument("--path-denoise", action="store_true")
    parser.add_argument("--no-realtime", action="store_true")
    parser.add_argument("--gi", default="none")
    options = parser.parse_args()
    path, = test_data.need("fidelity/scenarios.json")
    options.data = test_data.ROOT
    with open(path, encoding="utf-8") as file:
        scenarios = json.load(file)
    os.makedirs(options.out, exist_ok=True)
    names = [n for n in scenarios if not options.only or any(o in n for o in options.only)]
    harness = Harness(options)
    with daemon(options.helio, [options.data], baked(options.helio)) if options.helio else contextlib.nullcontext() as options.url, \
            concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        records = list(pool.map(lambda n: harness.run(n, scenarios[n]), names))
    explanations = read_explanations(options.explanations)
    compared, passed, complaints = judge(
        records, explanations,
        not options.only and not options.candidate and not options.no_realtime)
    states = {s: sum(r["state"] == s for r in records)
              for s in ("not held", "no peers", "no picture", "failed")}
    summary = "fidelity: %d of %d compared scenarios no farther than the other engines%s" % (
            len(passed), len(compared),
            "".join("; %d %s" % (n, s) for s, n in states.items() if n))
    if options.path:
        everything = options.path == "all"
        traced, good, more = judge_path(
            records, explanations, [] if everything else options.path.split(","),
            everything and not options.only)
        complaints += more if not options.candidate else []
        summary += "; path mode: %d of %d closest or second closest to the path tracers" % (
            len(good), len(traced))
    write_report(options.out, records, explanations, summary)
    for record in records:
        if record["state"] in ("not held", "no peers"):
            print("%s: %s: %s" % (record["name"], record["state"], record["why"]))
    for complaint in complaints:
        print(complaint, file=sys.stderr)
    print(summary)
    sys.exit(1 if complaints else 0)


if __name__ == "__main__":
    main()
