#!/usr/bin/env python3
"""Shows that two builds make the same bytes: pictures, checkpoints, page packs, cluster files, jobs.

    same_bytes.py --build OLD --record before.json --repeat 2
    same_bytes.py --build NEW --compare before.json

For a change that must not change any picture: record with a build of the tree before, compare
with a build of the tree after, on one machine (another driver or processor rounds differently, so a
recording of another device is refused). same_bytes.toml lists what is made. Of each picture file
three things are recorded:

    pixels   digest of the picture without metadata
    file     digest of all bytes
    job      hash of what the file was made from, by --stats

and, of what is kept for later, `store` (digests of page packs and cluster files, by name) and `read`
(whether what the recorded build left was taken up: checkpoints, histories, page packs). What differs
between the passes of --repeat is not deterministic: it is named and not compared.

The recording is FILE and the folder FILE.kept beside it (--kept): the pictures to look at, and what
the old build left for the new one to take up. A run that was stopped goes on where it was, as long
as the build, the row and the made scenes are the same; --fresh begins again.

Exit code: 0 all the same; 1 something differs that no [[exception]] names, or could not be made
(without the test data, too); 2 wrong usage, or another device.
"""
import argparse
import concurrent.futures
import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
import tomllib
from fnmatch import fnmatchcase

import same_bytes_digest as digest
import same_bytes_scenes as scenes

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
DATA = os.environ.get("HELIO_TEST_DATA") or os.path.join(ROOT, "..", "shared", "data")
LARGE_PICTURE = "big-textures/solarsystemscope/8k_earth_nightmap.jpg"
SECONDS_PER_CALL = 900
STOPPED = 8  # exit code of a command that a signal ended
KINDS = ("picture", "resume", "store")
ASPECTS = ("pixels", "file", "job", "read", "store", "exit")


class Failure(Exception):
    pass


def write_json(path, value):
    """The file is whole, or the one before."""
    with open(path + ".part", "w") as file:
        json.dump(value, file, indent=1, sort_keys=True)
        file.write("\n")
    os.replace(path + ".part", path)


def read_json(path):
    with open(path) as file:
        return json.load(file)


def empty_folder(path):
    shutil.rmtree(path, ignore_errors=True)
    os.makedirs(path)
    return path


def hash_of(*values):
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()


# The head of a checkpoint: magic, version, kind, the job, SHA-256 of the data, samples per pixel.
CHECKPOINT_SAMPLES_AT = 4 + 4 + 4 + 32 + 32


def is_worth_stopping(path):
    """Is this file there, and if it is a checkpoint, with samples in it?"""
    try:
        with open(path, "rb") as file:
            head = file.read(CHECKPOINT_SAMPLES_AT + 4)
    except FileNotFoundError:
        return False
    return any(head[CHECKPOINT_SAMPLES_AT:])


def was_taken_up(path, text):
    """By the error stream: a refusal names the file; a film that goes on tells its samples."""
    if path.endswith(".checkpoint"):
        return ".checkpoint" not in text and re.search(r"\b[1-9]\d* samples", text) is not None
    return ".history" not in text


# ---- rows -----------------------------------------------------------------------------------------

def read_table():
    with open(os.path.join(HERE, "same_bytes.toml"), "rb") as file:
        table = tomllib.load(file)
    rows = [dict(table["defaults"], kind=kind, **row) for kind in KINDS for row in table[kind]]
    names = [row["name"] for row in rows]
    if len(set(names)) != len(names):
        sys.exit("same_bytes.toml: two rows have one name")
    for exception in table.get("exception", []):
        if not exception["reason"] or exception["aspect"] not in ASPECTS:
            sys.exit("same_bytes.toml: an exception needs an aspect and its reason")
    return rows, table.get("exception", [])


class Maker:
    """Makes rows with one build."""

    def __init__(self, options, kept):
        self.helio = os.path.join(options.build, "bin", "helio")
        self.data, self.work, self.device = options.data, options.work, options.device
        self.made = os.path.join(options.work, "made")
        self.kept, self.is_recording = kept, options.record is not None
        self.devices = set()

    def out(self, row, part="out"):
        return os.path.join(self.work, part, row["name"])

    def expand(self, text, out):
        if text.startswith(("DATA/", "MADE/")):
            text = "=" + text
        for name, folder in (("DATA", self.data), ("MADE", self.made), ("OUT", out)):
            text = re.sub(r"([= ])%s/" % name, lambda m: m.group(1) + folder + "/", text)
        return text.removeprefix("=")

    def kept_of(self, row):
        """Where what the recorded build left of this row is; a comparison never makes it."""
        path = os.path.join(self.kept, "%s-%s" % (row["name"], hash_of(row)[:8]))
        if not self.is_recording and not os.path.exists(path):
            raise Failure("%s is missing: record this row again" % path)
        return path

    def is_kept(self, row):
        return row["kind"] == "picture" or os.path.exists(self.kept_of(row))

    def scene(self, row):
        path = self.expand(row["scene"], "")
        if path != "demo:" and not os.path.exists(path):
            raise Failure("%s is missing" % path)
        return path

    def call(self, words, row, until=None):
        """(exit code, text of the error stream). With `until` stopped when that file is there."""
        env = {k: v for k, v in os.environ.items()
               if not k.startswith("HELIO_") and k != "MESA_SHADER_CACHE_DIR"}
        env.update(row.get("env", {}))
        child = subprocess.Popen([self.helio, *words], stdout=subprocess.DEVNULL,
                                 stderr=subprocess.PIPE, env=env)
        if until:
            while child.poll() is None and not is_worth_stopping(until):
                time.sleep(0.005)
            if child.poll() is None:
                child.send_signal(signal.SIGTERM)
        try:
            text = child.communicate(timeout=SECONDS_PER_CALL)[1].decode(errors="replace")
        except subprocess.TimeoutExpired:
            child.kill()
            child.wait()
            raise Failure("took more than %d s" % SECONDS_PER_CALL) from None
        return child.returncode, text

    def render(self, row, out, cache, more=(), until=None):
        """(exit code, error stream, statistics)."""
        stats = os.path.join(out, "stats.json")
        words = ["render", self.scene(row), "-o", os.path.join(out, row.get("output", "out.png")),
                 "--size", row["size"], "--samples", str(row["samples"]), "--exposure", "0", "--gi", "none",
                 "--stats", stats,
                 "--device", self.device, "--progress", "none", "--cache-dir", cache]
        # Of an option that is given twice, the last counts.
        words += [self.expand(a, out) for a in row["arguments"]] + list(more)
        code, text = self.call(words, row, until)
        found = read_json(stats) if os.path.exists(stats) else {}
        if found:
            os.remove(stats)
            self.devices.add("%(name)s, %(driver)s" % found["device"])
        return code, text, found

    def script(self, row, out, cache):
        path = os.path.join(self.work, row["name"] + ".script")
        with open(path, "w") as file:
            file.writelines(self.expand(" " + line, out).strip() + "\n" for line in row["script"])
        words = ["run", path, "--device", self.device, "--progress", "none", "--cache-dir", cache]
        for root in (self.data, self.made):
            words += ["--asset-root", root]
        return self.call(words, row) + ({},)

    # ---- what is recorded -------------------------------------------------------------------------

    def files(self, out, stats):
        jobs = {os.path.basename(f["file"]): f["job"] for f in stats.get("frames", [])
                if f.get("job")}
        found = {}
        for name in sorted(os.listdir(out)):
            if name.endswith((".png", ".jpg", ".exr")):
                found[name] = digest.of_file(os.path.join(out, name))
                if name in jobs:
                    found[name]["job"] = jobs[name]
        if not found:
            raise Failure("no picture was written")
        return found

    def check(self, code, text, wanted=0):
        if code != wanted:
            raise Failure("exit code %d: %s" % (code, text.strip()[-600:]))

    def picture(self, row):
        out, cache = empty_folder(self.out(row)), os.path.join(self.work, "cache")
        code, text, stats = (self.script if "script" in row else self.render)(row, out, cache)
        if code and code == row.get("may_end_with"):
            return {"command": {"exit": code}}
        self.check(code, text)
        return self.files(out, stats)

    def resume(self, row):
        """The picture in one go, and from what the recorded build left."""
        found = {"whole/" + k: v for k, v in self.picture(row).items()}
        cache, kept = os.path.join(self.work, "cache"), self.kept_of(row)
        if not os.path.exists(kept):
            left = empty_folder(self.out(row, "stopped"))
            code, text, _ = self.render(row, left, cache, ("--checkpoint=1",),
                                        os.path.join(left, row["until"]))
            self.check(code, text, STOPPED)
            if not is_worth_stopping(os.path.join(left, row["until"])):
                raise Failure("%s was not left" % row["until"])
            shutil.move(left, kept)
        out = self.out(row, "resumed")
        shutil.rmtree(out, ignore_errors=True)
        shutil.copytree(kept, out)
        code, text, stats = self.render(row, out, cache, ("--resume", "--skip-existing"))
        self.check(code, text)
        found.update(("resumed/" + k, v) for k, v in self.files(out, stats).items())
        found["resumed"] = {"read": was_taken_up(row["until"], text)}
        return found

    def cache_with_shaders(self, row, part):
        """An empty cache, but for the compiled shaders."""
        cache = empty_folder(self.out(row, part))
        shaders = os.path.join(self.work, "cache", "shaders")
        if os.path.exists(shaders):
            shutil.copytree(shaders, os.path.join(cache, "shaders"))
        return cache

    def store(self, row):
        baked, kept = empty_folder(self.out(row, "baked")), self.kept_of(row)
        code, text = self.call(["bake", self.scene(row), "-o", baked, "--progress", "none"], row)
        self.check(code, text)
        found = {"baked": {"store": digest.of_folder(os.path.join(baked, "store"))}}
        if not os.path.exists(kept):
            shutil.copytree(baked, kept)
        cold = self.cache_with_shaders(row, "cold")
        for part, cache in (("cold", cold), ("warm", self.cache_with_shaders(row, "warm"))):
            if part == "warm":
                shutil.copytree(os.path.join(kept, "store"), os.path.join(cache, "store"))
            out = empty_folder(os.path.join(self.out(row), part))
            code, text, stats = self.render(row, out, cache)
            self.check(code, text)
            found.update((part + "/" + k, v) for k, v in self.files(out, stats).items())
            # Packs that the new build does not find it makes again, under other names.
            entries = digest.of_folder(os.path.join(cache, "store"))
            found[part] = {"store": entries}
            if part == "warm":
                old = digest.of_folder(os.path.join(kept, "store"))
                found[part]["read"] = stats["cache"]["damaged"] == 0 and old.items() <= entries.items()
        return found


# ---- passes, kept on the way ----------------------------------------------------------------------

class Progress:
    """The results so far of one build: WORK/results.json."""

    def __init__(self, work, build, fresh):
        self.path = os.path.join(work, "results.json")
        self.lock = threading.Lock()
        self.is_new = True
        self.state = {"build": build, "devices": [], "rows": {}}
        if os.path.exists(self.path) and not fresh:
            before = read_json(self.path)
            if before["build"] == build:
                self.state, self.is_new = before, False

    def find(self, row, number):
        entry = self.state["rows"].get("%s %d" % (row["name"], number))
        return entry if entry and entry["row"] == hash_of(row) else None

    def add(self, row, number, found, seconds, devices):
        with self.lock:
            self.state["devices"] = sorted(devices | set(self.state["devices"]))
            self.state["rows"]["%s %d" % (row["name"], number)] = {
                "row": hash_of(row), "found": found, "seconds": round(seconds, 2)}
            write_json(self.path, self.state)


def build_of(options):
    """What tells builds apart: their programs, the machinery that reads their files, the scenes."""
    found = [options.device, digest.of_folder(os.path.join(options.work, "made"))]
    for name in ("bin/helio", "libexec/helio-worker"):
        path = os.path.join(options.build, name)
        if not os.path.exists(path):
            sys.exit("%s is missing" % path)
        with open(path, "rb") as file:
            found.append(hashlib.sha256(file.read()).hexdigest())
    return hash_of(found)


def make_row(maker, progress, row, number):
    """None, or what went wrong."""
    began = time.monotonic()
    failure = None
    try:
        if progress.find(row, number) and maker.is_kept(row):
            return None
        found = getattr(maker, row["kind"])(row)
        progress.add(row, number, found, time.monotonic() - began, maker.devices)
    except (Failure, digest.Malformed, OSError) as problem:
        failure = str(problem)
    print("%-32s %6.1f s  %s" % (row["name"], time.monotonic() - began, failure or ""), flush=True)
    return failure


def make_all(options, maker, progress, rows, number):
    """{name: what went wrong}."""
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        problems = list(pool.map(lambda row: make_row(maker, progress, row, number), rows))
    return {row["name"]: problem for row, problem in zip(rows, problems) if problem}


# ---- recording ------------------------------------------------------------------------------------

def merge(passes):
    """The first pass, without what differs in another; and the names of that."""
    found, unstable = {}, []
    for name, aspects in passes[0].items():
        same = {a: v for a, v in aspects.items() if all(p.get(name, {}).get(a) == v for p in passes)}
        unstable += ["%s: %s" % (name, a) for a in aspects if a not in same]
        found[name] = same
    return found, unstable


def write_recording(options, maker, progress, rows):
    """What is there so far, beside rows of the same build that are not made now."""
    recorded = {"rows": {}}
    if os.path.exists(options.record):
        before = read_json(options.record)
        if before["build"] == progress.state["build"]:
            recorded = before
        elif options.only:
            sys.exit("%s is of another build: record all rows" % options.record)
    for key in ("build", "devices"):
        recorded[key] = progress.state[key]
    recorded["kept"] = maker.kept
    for row in rows:
        passes = [p["found"] for p in (progress.find(row, n) for n in range(options.repeat)) if p]
        if passes:
            found, unstable = merge(passes)
            recorded["rows"][row["name"]] = {"row": hash_of(row), "found": found,
                                             "unstable": unstable, "passes": len(passes)}
    write_json(options.record, recorded)
    return recorded


def record(options, maker, progress, rows):
    problems = {}
    write_recording(options, maker, progress, rows)
    for number in range(options.repeat):
        print("pass %d of %d" % (number + 1, options.repeat), flush=True)
        problems.update(make_all(options, maker, progress, rows, number))
        if number == 0:
            keep_pictures(maker, rows)
        recorded = write_recording(options, maker, progress, rows)
    for row in rows:
        for name in recorded["rows"].get(row["name"], {}).get("unstable", []):
            print("not deterministic: %s/%s" % (row["name"], name))
    return problems


def keep_pictures(maker, rows):
    for row in rows:
        if os.path.exists(maker.out(row)):
            shutil.copytree(maker.out(row), os.path.join(maker.kept, "pictures", row["name"]),
                            dirs_exist_ok=True)


# ---- comparing ------------------------------------------------------------------------------------

def how_stores_differ(old, new):
    names = set(old) & set(new)
    return "%d of %d files missing, %d new, %d of other bytes" % (
        len(set(old) - names), len(old), len(set(new) - names),
        sum(old[n] != new[n] for n in names))


def differences(recorded, found):
    """[(output, aspect, text)] of one row."""
    result = [(name, "pixels", "is not made any more") for name in recorded["found"]
              if name not in found]
    for name, new in found.items():
        old = recorded["found"].get(name)
        if old is None:
            result.append((name, "pixels", "was not made before"))
            continue
        for aspect in ASPECTS:
            if aspect in old and old[aspect] != new.get(aspect):
                text = how_stores_differ(old[aspect], new.get(aspect, {})) if aspect == "store" \
                    else "%s, was %s" % (new.get(aspect), old[aspect])
                result.append((name, aspect, text))
    return result


def reason_for(exceptions, row, aspect):
    for exception in exceptions:
        if fnmatchcase(row["name"], exception["name"]) and exception["aspect"] == aspect:
            return exception["reason"]
    return None


def compare(options, maker, progress, rows, exceptions, recording):
    problems = make_all(options, maker, progress, rows, 0)
    if set(progress.state["devices"]) - set(recording["devices"]):
        print("another device: %s; recorded: %s" % (progress.state["devices"],
                                                    recording["devices"]))
        sys.exit(2)
    compared = excepted = 0
    for row in rows:
        recorded, made = recording["rows"].get(row["name"]), progress.find(row, 0)
        if not made:
            continue
        if not recorded or recorded["row"] != hash_of(row):
            problems[row["name"]] = "the recording does not have this row; record it again"
            continue
        compared += len(recorded["found"])
        texts = []
        for name, aspect, text in differences(recorded, made["found"]):
            reason = reason_for(exceptions, row, aspect)
            excepted += reason is not None
            print("%s/%s: %s: %s%s" % (row["name"], name, aspect, text,
                                       " (named: %s)" % reason if reason else ""))
            if reason is None:
                texts.append("%s: %s" % (name, aspect))
        if texts:
            problems[row["name"]] = "differs: %s; see %s and %s" % (
                ", ".join(texts), os.path.join(maker.kept, "pictures", row["name"]), maker.out(row))
    print("%d outputs of %d rows compared, %d differences named" % (compared, len(rows), excepted))
    return problems


# ---- the command ----------------------------------------------------------------------------------

def arguments():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", required=True, metavar="DIR",
                        help="build directory: bin/helio and libexec/helio-worker")
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--record", metavar="FILE", help="write what this build makes")
    what.add_argument("--compare", metavar="FILE", help="compare with what was recorded")
    parser.add_argument("--only", metavar="REGEX", help="rows whose name it is found in")
    parser.add_argument("-j", "--jobs", type=int, default=2, help="rows at a time; default 2")
    parser.add_argument("--repeat", type=int, default=1, metavar="N",
                        help="passes of --record, to find what is not deterministic; default 1")
    parser.add_argument("--data", default=DATA, metavar="DIR",
                        help="test data; default HELIO_TEST_DATA, ../shared/data")
    parser.add_argument("--work", metavar="DIR",
                        help="folder for what is made; default BUILD/same_bytes")
    parser.add_argument("--kept", metavar="DIR",
                        help="folder for what is kept of a recording; default FILE.kept")
    parser.add_argument("--device", default="llvmpipe", help="Vulkan device; default llvmpipe")
    parser.add_argument("--fresh", action="store_true", help="do not go on with an earlier run")
    options = parser.parse_args()
    options.build, options.data = os.path.abspath(options.build), os.path.realpath(options.data)
    options.work = os.path.abspath(options.work or os.path.join(options.build, "same_bytes"))
    return options


def main():
    options = arguments()
    began = time.monotonic()
    rows, exceptions = read_table()
    rows = [r for r in rows if not options.only or re.search(options.only, r["name"])]
    os.makedirs(options.work, exist_ok=True)
    scenes.write(os.path.join(options.work, "made"), os.path.join(options.data, LARGE_PICTURE))
    recording = read_json(options.compare) if options.compare else None
    kept = options.kept or (recording["kept"] if recording else options.record + ".kept")
    maker = Maker(options, os.path.abspath(kept))
    progress = Progress(options.work, build_of(options), options.fresh)
    if progress.is_new:
        # No page pack or cluster file of another build may decide what is drawn.
        shutil.rmtree(os.path.join(options.work, "cache", "store"), ignore_errors=True)
        if options.record and not options.only:
            empty_folder(maker.kept)
    os.makedirs(maker.kept, exist_ok=True)
    if options.record:
        problems = record(options, maker, progress, rows)
    else:
        problems = compare(options, maker, progress, rows, exceptions, recording)
    for name, problem in problems.items():
        print("%s: %s" % (name, problem))
    print("%s in %.0f s" % ("%d rows failed" % len(problems) if problems else "all %d rows are %s" % (
        len(rows), "recorded" if options.record else "the same"), time.monotonic() - began))
    sys.exit(1 if problems else 0)


if __name__ == "__main__":
    main()
