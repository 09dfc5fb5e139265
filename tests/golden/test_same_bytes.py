#!/usr/bin/env python3
"""Shows that same_bytes.py tells what differs: a recording is the same as its build; with another
digest, another device or another row in it, it is refused.

usage: test_same_bytes.py BUILD OUT
"""
import json
import os
import shutil
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
ROW = "rt_stl" # made by the tool itself: needs no test data


def main():
    build, out = sys.argv[1:]
    shutil.rmtree(out, ignore_errors=True)
    os.makedirs(out)
    recording = os.path.join(out, "recording.json")

    def run(*words):
        done = subprocess.run([sys.executable, os.path.join(HERE, "same_bytes.py"), "--build", build,
                               "--work", os.path.join(out, "work"), "--only", "^%s$" % ROW, *words],
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        return done.returncode, done.stdout

    def expect(code, text, *words):
        seen, printed = run(*words)
        if seen != code or text not in printed:
            sys.exit("%s: exit code %d (expected %d with '%s'):\n%s" % (
                " ".join(words), seen, code, text, printed))

    def change(edit):
        with open(recording) as file:
            changed = json.load(file)
        edit(changed)
        path = os.path.join(out, "changed.json")
        with open(path, "w") as file:
            json.dump(changed, file)
        return path

    def picture(recorded):
        return recorded["rows"][ROW]["found"]["out.png"]

    expect(0, "all 1 rows are recorded", "--record", recording, "--repeat", "2")
    # Rendered once more, not taken from the recording's run.
    expect(0, "all 1 rows are the same", "--compare", recording, "--fresh")
    expect(1, "out.png: pixels", "--compare", change(lambda r: picture(r).update(pixels="0")))
    expect(1, "out.png: file", "--compare", change(lambda r: picture(r).update(file="0")))
    expect(1, "is not made any more", "--compare",
           change(lambda r: r["rows"][ROW]["found"].update(gone={})))
    expect(1, "does not have this row", "--compare", change(lambda r: r["rows"].clear()))
    expect(2, "another device", "--compare", change(lambda r: r.update(devices=[])))


main()
