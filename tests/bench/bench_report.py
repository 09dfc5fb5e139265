"""Runs helio bench and reads what it reports; for the tests of this folder."""
import json
import os
import subprocess


def bench(helio, name, folder, options, *words):
    path = os.path.join(folder, "report.json")
    done = subprocess.run([helio, "bench", name, "--progress", "none", "--json", path, "--cache-dir",
                           os.path.join(folder, "cache"), "--options", json.dumps(options), *words],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    if done.returncode != 0:
        raise SystemExit("exit code %d\n%s" % (done.returncode, done.stdout))
    with open(path, encoding="utf-8") as file:
        return json.load(file)


def check(condition, *what):
    if not condition:
        raise SystemExit("unexpected: %s" % (what,))
