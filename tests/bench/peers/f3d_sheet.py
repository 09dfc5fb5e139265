#!/usr/bin/env python3
"""Ordinary files as `helio render FILE -o OUT` shows them beside f3d, on one page to look at.

usage: f3d_sheet.py --helio PROGRAM --out DIR FILE...

Both get the file, the size and nothing else. Writes OUT/index.html and the pictures. No test: what looks right is
for eyes. Needs f3d (Debian package f3d) and, without a display, Xvfb (package xvfb).
"""
import argparse
import html
import os
import shutil
import subprocess
import sys

WIDTH, HEIGHT = 320, 180
SECONDS = 240


def run(command):
    """None, or why there is no picture."""
    try:
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, errors="replace",
                              timeout=SECONDS)
    except subprocess.TimeoutExpired:
        return "took more than %d s" % SECONDS
    return None if done.returncode == 0 else done.stdout.strip().splitlines()[-1:] or ["exit %d" % done.returncode]


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--helio", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("files", nargs="+")
    options = parser.parse_args()
    if not shutil.which("f3d"):
        sys.exit("f3d is not installed")
    display = [] if os.environ.get("DISPLAY") else ["xvfb-run", "-a"]
    os.makedirs(options.out, exist_ok=True)
    rows = []
    for number, path in enumerate(options.files):
        cells = []
        for name, command in (
                ("helio", [options.helio, "render", path, "-q", "--size", "%dx%d" % (WIDTH, HEIGHT), "-o"]),
                ("f3d", [*display, "f3d", path, "--resolution=%d,%d" % (WIDTH, HEIGHT), "--output"])):
            picture = "%03d-%s.png" % (number, name)
            if name == "f3d":
                command[-1] += "=" + os.path.join(options.out, picture)
            else:
                command.append(os.path.join(options.out, picture))
            failure = run(command)
            cells.append("<td>%s" % (html.escape(str(failure)) if failure else "<img src='%s'>" % picture))
        rows.append("<tr><th>%s%s" % (html.escape(os.path.basename(path)), "".join(cells)))
        print(path, flush=True)
    with open(os.path.join(options.out, "index.html"), "w", encoding="utf-8") as file:
        file.write("<!doctype html><meta charset=utf-8><title>helio and f3d</title><table><tr><th><th>helio<th>f3d" +
                   "".join(rows) + "</table>\n")


main()
