#!/usr/bin/env python3
"""Settled pictures with global illumination beside path-traced ones of the same scene.

usage: truth.py --helio PROGRAM --out DIR [--only NAME]...
       truth.py --helio PROGRAM --out DIR [--only NAME]... --make [--samples N] [--chunk N] [--threads N]

The first form is the test: each row of truth.toml is rendered, settled, with `--gi auto` and with what
else the command has by default, by one daemon, and its FLIP to truth/NAME.png may not be above the row's limit. The
aim is printed beside it. Rows of scenes that are not there are skipped (test_data.py). A missing reference is
a failure.

With --make the references are made: path-traced pictures of --chunk samples with the denoiser, each
of another seed, until they are --samples together. A chunk is kept as OUT/chunks/NAME_SAMPLES_SEED.png (16 bits) once
it is whole; when the command is stopped (SIGTERM, Ctrl-C) the film of the one under way is, and the same
command goes on from there. truth/NAME.png is the mean of the chunks that there are, written anew after each;
its text says how many samples it is of. Scenes take turns, so that all have something soon. What the first
two chunks differ by is printed: it is the row's `seeds`. Rows without a limit are not compared yet.
"""
import argparse
import os
import signal
import struct
import subprocess
import sys
import tomllib
import zlib

import truth_scenes

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../support"))
import models
import png_files
import test_data
from daemon import baked, daemon

HERE = os.path.dirname(os.path.abspath(__file__))
SIZE = "480x270"
AIM, SEEDS_AIM = 0.05, 1.5
SECONDS_PER_PICTURE = 900


def scene_of(options, row):
    """The path of a row's scene; None where its file is missing."""
    scene, made = row["scene"], os.path.join(options.out, "scenes")
    if scene == "demo:":
        return scene
    if scene == "made:mine":
        return truth_scenes.make_mine(os.path.join(made, "mine.glb"))
    source = test_data.find("scenes/Sponza/glTF/Sponza.gltf" if scene == "made:night" else scene)
    if scene == "made:night" and source:
        return truth_scenes.make_night(os.path.join(made, "night", "night.gltf"), source)
    return source


def render(options, row, scene, out, arguments):
    command = [options.helio, "render", scene, "-o", out, "--size", SIZE, "--background", "env", "--tonemap",
               "aces", "--progress", "none"]
    command += ["--connect", options.url] if options.url else [
        "--device", "llvmpipe", "--cache-dir", os.path.join(options.out, "cache")]
    return subprocess.Popen(command + row["arguments"] + arguments)


def flip(options, one, other):
    done = subprocess.run([options.helio, "compare", one, other, "--metric", "flip"],
                          stdout=subprocess.PIPE, text=True, check=True)
    return float(done.stdout.split()[-1])


def reference_of(row):
    return os.path.join(HERE, "truth", row["name"] + ".png")


# --- the test ------------------------------------------------------------------------------------

def check(options, row, scene):
    """None, or what is wrong with this row."""
    picture = os.path.join(options.out, row["name"] + ".png")
    code = render(options, row, scene, picture, []).wait(SECONDS_PER_PICTURE)
    if code != 0:
        return "rendering failed with %d" % code
    found = flip(options, picture, reference_of(row))
    seeds = row.get("seeds", 0)
    aim = "%.3f" % max(AIM, SEEDS_AIM * seeds) + (" (two seeds: %.4f)" % seeds if seeds else " or more")
    print("%-14s FLIP %.4f, at most %.3f; the aim is %s" % (row["name"], found, row["limit"], aim), flush=True)
    return None if found <= row["limit"] else "FLIP %.4f is above %.3f; see %s" % (found, row["limit"], picture)


def check_all(options, rows):
    """What is wrong, one line each."""
    failures = []
    for row in rows:
        if "limit" not in row:
            print("%-14s not compared yet: its reference is to be made" % row["name"])
            continue
        scene = scene_of(options, row)
        failure = check(options, row, scene) if scene else test_data.REQUIRED and "no test data"
        failures += ["%s: %s" % (row["name"], failure)] if failure else []
    return failures


# --- making references ---------------------------------------------------------------------------

def chunk_path(options, row, seed):
    return os.path.join(options.out, "chunks", "%s_%d_%d.png" % (row["name"], options.chunk, seed))


def text_chunk(key, text):
    body = b"tEXt" + key.encode() + b"\0" + text.encode()
    return struct.pack(">I", len(body) - 4) + body + struct.pack(">I", zlib.crc32(body))


def write_mean(paths, out, text):
    """An 8-bit PNG of the mean of 16-bit ones. Display values are averaged: what is left of noise is small."""
    pictures = [png_files.read(path, 16) for path in paths]
    width, height, channels = pictures[0][:3]
    rows = []
    for y in range(height):
        values = [struct.unpack(">%dH" % (width * channels), picture[3][y]) for picture in pictures]
        row = bytearray()
        for x in range(width):
            for c in range(3):
                total = sum(v[x * channels + c] for v in values)
                row.append((total * 255 + 32768 * len(values)) // (65535 * len(values)))
        rows.append(bytes(row))
    data = models.png(width, height, 3, 8, rows, 9)
    head = 8 + 25  # signature and IHDR
    models.write(out, data[:head] + text_chunk("Comment", text) + data[head:])


def make_chunk(options, row, scene, seed):
    """Renders one chunk; SIGTERM and Ctrl-C reach the renderer, which keeps its film."""
    path = chunk_path(options, row, seed)
    process = render(options, row, scene, path, [
        "--mode", "path", "--denoise", "--bit-depth", "16", "--samples", str(options.chunk), "--seed", str(seed),
        "--threads", str(options.threads), "--resume", "--checkpoint", "120"])
    signal.signal(signal.SIGTERM, lambda number, frame: process.send_signal(number))
    try:
        code = process.wait()
    except KeyboardInterrupt:
        code = process.wait()
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if code != 0:
        sys.exit("%s: stopped or failed (%d); the same command goes on" % (path, code))


def make(options, rows):
    os.makedirs(os.path.join(options.out, "chunks"), exist_ok=True)
    rows = [(row, scene_of(options, row)) for row in rows]
    for seed in range((options.samples + options.chunk - 1) // options.chunk):
        for row, scene in rows:
            if scene is None or os.path.exists(chunk_path(options, row, seed)):
                continue
            make_chunk(options, row, scene, seed)
            chunks = [chunk_path(options, row, k) for k in range(seed + 1)]
            text = "%d path-traced samples in denoised chunks of %d" % ((seed + 1) * options.chunk, options.chunk)
            write_mean(chunks, reference_of(row), text)
            between = " two chunks: FLIP %.4f" % flip(options, *chunks[:2]) if seed > 0 else ""
            print("%s: %s%s" % (row["name"], text, between), flush=True)


def main():
    parser = argparse.ArgumentParser()
    for name in ("--helio", "--out"):
        parser.add_argument(name, required=True)
    parser.add_argument("--only", action="append", default=[])
    parser.add_argument("--make", action="store_true")
    parser.add_argument("--samples", type=int, default=1024)
    parser.add_argument("--chunk", type=int, default=64)
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args()
    with open(os.path.join(HERE, "truth.toml"), "rb") as file:
        rows = [r for r in tomllib.load(file)["row"] if not options.only or r["name"] in options.only]
    options.out = os.path.abspath(options.out)
    options.url = None
    if options.make:
        make(options, rows)
        return
    made = os.path.abspath(os.path.join(options.out, "scenes"))
    os.makedirs(made, exist_ok=True)
    with daemon(options.helio, [test_data.ROOT, made], baked(options.helio), "llvmpipe") as options.url:
        failures = check_all(options, rows)
    for failure in failures:
        print("FAILED: " + failure)
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
