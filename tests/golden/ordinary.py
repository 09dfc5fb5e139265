#!/usr/bin/env python3
"""An ordinary file looks right at the first try: `helio render FILE -o picture.png`, nothing else.

usage: ordinary.py --helio PROGRAM --out DIR [--only NAME]... [--update]

ordinary_scenes.py makes the files. Of each picture these are checked, and then the stored picture
(references/ordinary_NAME.png; --update writes it: look at it first):

    covered   30 to 90 % of the frame, in its longer side, by the scene's bounds in the picture
    not black, not clipped     of the pixels that show the scene, at most 5 % are 0 or 255 throughout
    contrast  the scene differs from the background around it
    upright   of a tower: the foot is below the shaft

What covers is found with a second picture that has no background. Scripts draw both of each scene, so that a scene
is loaded and lit once; a few files of different kinds (BY_COMMAND) are drawn by `helio render` as well, whose picture
must be the script's byte for byte. The others have fewer samples than by default, which is a third of the time and
changes noise and edges by a FLIP of at most 0.0057, where FLIP_LIMIT is 0.01. One daemon draws all.
"""
import argparse
import concurrent.futures
import os
import shutil
import subprocess
import sys

import ordinary_scenes

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../support"))
import png_files
from daemon import daemon

HERE = os.path.dirname(os.path.abspath(__file__))
SIZE = "240x135"
SECONDS_PER_PICTURE = 240
FLIP_LIMIT = 0.01  # drivers round differently, automatic exposure follows them
# name: what is asked of the picture beside the rest
SCENES = {
    "blender.glb": {}, "blender.dae": {}, "blender.fbx": {},
    "cube.obj": {}, "cube.ply": {}, "cube.stl": {}, "cube.glb": {},
    "tower.stl": {"upright"}, "tower_text.stl": {"upright"}, "tower.obj": {"upright"},
    "tower.dae": {"upright"},
    "tower_corner.obj": {"upright"}, "behind.glb": {},
    "cloud.ply": {}, "cloud.obj": {}, "cloud.glb": {}, "room.obj": {}, "tiny.obj": {}, "huge.obj": {}, "far.obj": {}, "far.ply": {},
    "smooth.obj": {}, "transparency.dae": {}, "wide.dae": {},
}
# Of the side that the sun of the sky does not reach.
ARGUMENTS = {"behind.glb": ["--view", "150,20"]}
# A lamp and a camera of the file's own; a file that is turned, with a camera around it; an argument.
BY_COMMAND = ("blender.fbx", "tower_corner.obj", "behind.glb")
SCRIPTS = 2  # at a time
SAMPLES = 16
# What the same scene looks like from different formats: as this file, within FLIP.
ALIKE = {"blender.dae": ("blender.glb", 0.04), "blender.fbx": ("blender.glb", 0.06),
         "cloud.obj": ("cloud.ply", 0.02), "cloud.glb": ("cloud.ply", 0.05), "wide.dae": ("blender.dae", 0.001),
         "tower_text.stl": ("tower.stl", 0.001), "cube.ply": ("cube.stl", 0.02),
         "far.obj": ("cube.obj", 0.02), "far.ply": ("cube.ply", 0.02), "tiny.obj": ("cube.obj", 0.02),
         "huge.obj": ("cube.obj", 0.02)}


def mask_of(path):
    """Pixels that the scene covers."""
    width, height, channels, rows = png_files.read(path)
    assert channels == 4, "the picture without background has no alpha"
    return [[rows[y][4 * x + 3] >= 128 for x in range(width)] for y in range(height)]


def mean(values):
    return sum(values) / len(values) if values else 0


def look(picture, mask, asked):
    """What is wrong with a picture."""
    width, height, channels, rows = png_files.read(picture)
    pixel = lambda x, y: rows[y][channels * x:channels * x + 3]
    inside = [(x, y) for y in range(height) for x in range(width) if mask[y][x]]
    if not inside:
        return ["shows nothing"]
    wrong = []
    xs, ys = [x for x, _ in inside], [y for _, y in inside]
    share = max((max(xs) - min(xs) + 1) / width, (max(ys) - min(ys) + 1) / height)
    if not 0.3 <= share <= 0.9:
        wrong.append("covers %.0f %% of the frame" % (100 * share))
    black = mean([max(pixel(*p)) <= 3 for p in inside])
    clipped = mean([min(pixel(*p)) >= 252 for p in inside])
    if black > 0.05:
        wrong.append("%.0f %% are black" % (100 * black))
    if clipped > 0.05:
        wrong.append("%.0f %% are clipped" % (100 * clipped))
    luma = [mean(pixel(*p)) for p in inside]
    if not 40 <= mean(luma) <= 215:
        wrong.append("its mean is %.0f of 255" % mean(luma))
    # Pixels on both sides of the silhouette, two apart.
    steps = []
    for y in range(height):
        for x in range(2, width - 2):
            if mask[y][x] and not mask[y][x - 1]:
                a, b = pixel(x + 1, y), pixel(x - 2, y)
                steps.append(max(abs(i - j) for i, j in zip(a, b)))
    if steps and mean([s >= 12 for s in steps]) < 0.6:
        wrong.append("dissolves into the background")
    if "upright" in asked:
        widths = [sum(row) for row in mask if any(row)]
        third = len(widths) // 4
        if mean(widths[-third:]) < 1.5 * mean(widths[:third]):
            wrong.append("is not upright")
    return wrong


class Test:
    def __init__(self, options):
        self.options = options
        self.scenes = os.path.join(options.out, "scenes")
        ordinary_scenes.make(self.scenes)

    def path(self, name, ending):
        return os.path.join(self.options.out, name.replace(".", "_") + ending)

    def run(self, *arguments, pictures=1):
        seconds = SECONDS_PER_PICTURE * pictures
        try:
            done = subprocess.run([self.options.helio, *arguments], stdout=subprocess.PIPE,
                                  stderr=subprocess.STDOUT, text=True, errors="replace",
                                  timeout=seconds)
        except subprocess.TimeoutExpired:
            return -1, "took more than %d s" % seconds
        return done.returncode, done.stdout.strip()

    def render(self, name):
        """What is wrong with what `helio render` makes of a file, beside the script's picture."""
        made, drawn = self.path(name, ".command.png"), self.path(name, ".png")
        code, text = self.run("render", os.path.join(self.scenes, name), "-o", made,
                              *ARGUMENTS.get(name, ()), "--size", SIZE, "--connect", self.url, "--progress", "none")
        if code != 0:
            return ["rendering failed with %d: %s" % (code, text)]
        with open(made, "rb") as one, open(drawn, "rb") as other:
            return [] if one.read() == other.read() else ["%s is not %s" % (made, drawn)]

    def draw(self, part):
        """What the program printed, if drawing the pictures of these scenes failed."""
        number, names = part
        script = os.path.join(self.options.out, "pictures%d.script" % number)
        with open(script, "w") as file:
            for name in names:
                file.write("\n".join((
                    "scene " + name, "load " + os.path.join(self.scenes, name), "set size " + SIZE,
                    *(["camera fit view " + ARGUMENTS[name][1]] if name in ARGUMENTS else []),
                    *([] if name in BY_COMMAND else ["set samples %d" % SAMPLES]),
                    "frame " + self.path(name, ".png"), "set background none", "set samples 4",
                    "set gi none", "frame " + self.path(name, ".mask.png"), "")))
        code, text = self.run("run", script, "--connect", self.url, pictures=2 * len(names))
        return "" if code == 0 else "drawing %s failed with %d: %s" % (", ".join(names), code, text)

    def check_all(self, names):
        """What is wrong with each of the pictures."""
        cache = os.path.join(self.options.out, "cache")
        parts = [names[i::SCRIPTS] for i in range(SCRIPTS)]
        with daemon(self.options.helio, [self.scenes], cache, "llvmpipe") as self.url, \
                concurrent.futures.ThreadPoolExecutor(SCRIPTS) as pool:
            failures = [f for f in pool.map(self.draw, enumerate(p for p in parts if p)) if f]
            if failures:
                sys.exit("\n".join(failures))
            return dict(zip(names, pool.map(self.check, names)))

    def compare(self, a, b, limit):
        return self.run("compare", a, b, "--metric", "flip", "--fail-above", str(limit))

    def check(self, name):
        wrong = look(self.path(name, ".png"), mask_of(self.path(name, ".mask.png")), SCENES[name])
        wrong += self.render(name) if name in BY_COMMAND else []
        reference = os.path.join(HERE, "references", "ordinary_%s.png" % name.replace(".", "_"))
        if self.options.update:
            shutil.copyfile(self.path(name, ".png"), reference)
        code, text = self.compare(self.path(name, ".png"), reference, FLIP_LIMIT)
        return wrong + (["differs from %s: %s" % (reference, text)] if code != 0 else [])

    def check_alike(self, name):
        other, limit = ALIKE[name]
        code, text = self.compare(self.path(name, ".png"), self.path(other, ".png"), limit)
        return ["is not like %s: %s" % (other, text)] if code != 0 else []


def main():
    parser = argparse.ArgumentParser()
    for name in ("--helio", "--out"):
        parser.add_argument(name, required=True)
    parser.add_argument("--only", action="append", default=[])
    parser.add_argument("--update", action="store_true")
    options = parser.parse_args()
    shutil.rmtree(options.out, ignore_errors=True)
    os.makedirs(options.out)
    test = Test(options)
    names = [n for n in SCENES if not options.only or n in options.only]
    found = test.check_all(names)
    for name in names:
        if name in ALIKE and not found[name] and ALIKE[name][0] in found:
            found[name] = test.check_alike(name)
        print("%-20s %s" % (name, "; ".join(found[name]) or "ok"))
    sys.exit(1 if any(found.values()) else 0)


if __name__ == "__main__":
    main()
