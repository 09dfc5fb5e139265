#!/usr/bin/env python3
"""Renders the rows of golden.toml and compares them with the stored pictures.

usage: golden.py --helio PROGRAM --models DIR --out DIR [--only NAME]... [--update]

A row that differs leaves OUT/NAME.png and OUT/NAME.diff.png and fails the test; so does a missing
reference. Rows with `wrong = true` hold a picture that is wrong on purpose: they must be refused,
which shows that the tolerances bite. One daemon draws all. --update writes the references anew (never the wrong ones):
look at them before you commit them. Rows of scenes that are not there are skipped (test_data.py).
"""
import argparse
import concurrent.futures
import os
import shutil
import subprocess
import sys
import tomllib

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../support"))
import test_data
from daemon import baked, daemon

HERE = os.path.dirname(os.path.abspath(__file__))
SIZE = "256x256"
SECONDS_PER_ROW = 240
# Smaller is better for these; for the others larger is.
SMALL_IS_GOOD = ("flip", "rmse", "max")


def run(command):
    try:
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                              errors="replace", timeout=SECONDS_PER_ROW)
    except subprocess.TimeoutExpired:
        return -1, "took more than %d s" % SECONDS_PER_ROW
    return done.returncode, done.stdout.strip()


def inputs_of(row):
    """Files of the test data that a row needs."""
    files = [] if row["scene"].startswith(("demo", "MODELS/")) else [row["scene"]]
    return files + [a.split("DATA/")[1] for a in row.get("arguments", []) if "DATA/" in a]


def run_script(options, row, scene, out):
    """A picture that takes more than one line to say: `script`, lines of `helio run`."""
    path = os.path.join(options.out, row["name"] + ".hs")
    lines = ["load " + scene, "set size " + row.get("size", SIZE), "set exposure 0", "set gi none"]
    with open(path, "w") as file:
        file.write("\n".join(lines + row["script"] + ["frame " + out, ""]))
    code, text = run([options.helio, "run", path, "--connect", options.url, "--progress", "none"])
    return None if code == 0 else "the script failed with %d: %s" % (code, text)


def render(options, row, out):
    scene = "demo:" if row["scene"] == "demo" else os.path.join(test_data.ROOT, row["scene"])
    if row["scene"].startswith("MODELS/"):
        scene = os.path.join(options.models, row["scene"].removeprefix("MODELS/"))
    if "script" in row:
        return run_script(options, row, scene, out)
    # What a picture depends on is stated; of an option that is given twice, the last counts.
    command = [options.helio, "render", scene, "-o", out, "--size", row.get("size", SIZE),
               "--exposure", "0", "--background", "env", "--tonemap", "aces", "--gi", "none",
               "--connect", options.url, "--progress", "none"]
    if row["scene"] != "demo":  # which has light of its own
        command += ["--env", "auto"]
    for argument in row["arguments"]:
        command.append(argument.replace("DATA/", test_data.ROOT + "/"))
    code, text = run(command)
    return None if code == 0 else "rendering failed with %d: %s" % (code, text)


def compare(options, row, picture, reference, diff):
    """(exit code, what the program printed)."""
    metric = row["metric"]
    side = "--fail-above" if metric in SMALL_IS_GOOD else "--fail-below"
    return run([options.helio, "compare", picture, reference, "--metric", metric, side,
                str(row["limit"]), "--diff", diff])


def check(options, row):
    """None, or what is wrong with this row."""
    name = row["name"]
    picture = os.path.join(options.out, name + ".png")
    reference = os.path.join(HERE, "references", row.get("reference", name) + ".png")
    diff = os.path.join(options.out, name + ".diff.png")
    failure = render(options, row, picture)
    if failure:
        return failure
    if options.update and not row.get("wrong"):
        shutil.copyfile(picture, reference)
        return None
    if not os.path.exists(reference):
        return "%s is missing" % reference
    code, text = compare(options, row, picture, reference, diff)
    if row.get("wrong"):
        return None if code == 1 else "a wrong picture was not refused (%d: %s)" % (code, text)
    if code == 0:
        os.remove(diff)
        return None
    return "%s: %s; tolerance %g because %s; see %s and %s" % (
        row["metric"], text, row["limit"], row["reason"], picture, diff)


def main():
    parser = argparse.ArgumentParser()
    for name in ("--helio", "--models", "--out"):
        parser.add_argument(name, required=True)
    parser.add_argument("--only", action="append", default=[])
    parser.add_argument("--update", action="store_true")
    options = parser.parse_args()
    os.makedirs(options.out, exist_ok=True)
    os.makedirs(os.path.join(HERE, "references"), exist_ok=True)
    with open(os.path.join(HERE, "golden.toml"), "rb") as file:
        table = tomllib.load(file)
    rows = [dict(table["default"], **row) for row in table["row"]]
    rows = [r for r in rows if not options.only or r["name"] in options.only]
    for row in rows:
        if not row["reason"]:
            sys.exit("%s: a tolerance needs its reason" % row["name"])
    if not any(r.get("wrong") for r in rows) and not options.only:
        sys.exit("golden.toml: no wrong picture is left")
    there = [r for r in rows if all([test_data.find(f) for f in inputs_of(r)])]
    if len(there) < len(rows) and test_data.REQUIRED:
        sys.exit("test data is missing")
    with daemon(options.helio, [test_data.ROOT, options.models], baked(options.helio), "llvmpipe") as options.url, \
            concurrent.futures.ThreadPoolExecutor(2) as pool:
        failures = list(pool.map(lambda r: check(options, r), there))
    for row, failure in zip(there, failures):
        print("%-24s %s" % (row["name"], failure or "ok"))
    sys.exit(1 if any(failures) else 0)


main()
