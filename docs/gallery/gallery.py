#!/usr/bin/env python3
"""Renders the pictures of docs/gallery.md into this folder.

usage: gallery.py [--helio PROGRAM] [--only NAME]...

Scenes are the built-in one, and of the test data (docs/testing.md) those whose licences allow to show
pictures of them; what is not there is skipped and named.
"""
import argparse
import os
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
ROOT = os.path.dirname(os.path.dirname(HERE))
sys.path.insert(0, os.path.join(ROOT, "tests/support"))
import test_data

SIZE = "640x360"
STUDIO, MEADOW, HALL = ("hdr/lightroom_14b_from_filament_ktx.hdr", "hdr/noon_grass_1k.hdr",
                        "hdr/royal_esplanade_1k.hdr")
PATH = ["--mode=path", "--spp=64", "--denoise"]

# name: scene, environment (None: the default), further arguments
PICTURES = {
    "demo": ("demo:", None, []),
    "demo_path": ("demo:", None, PATH),
    "demo_clusters": ("demo:", None, ["--debug-view=cluster", "--jpeg-quality=75"]),
    "chair": ("khronos/SheenChair/glTF/SheenChair.gltf", STUDIO, []),
    "chair_path": ("khronos/SheenChair/glTF/SheenChair.gltf", STUDIO, PATH + ["--variant=Peacock Velvet"]),
    "iridescence": ("khronos/IridescenceSuzanne/glTF-Binary/IridescenceSuzanne.glb", HALL, PATH),
    "transmission": ("khronos/TransmissionTest/glTF-Binary/TransmissionTest.glb", MEADOW, ["--view=front"]),
    "anisotropy": ("khronos/AnisotropyStrengthTest/glTF-Binary/AnisotropyStrengthTest.glb", HALL,
                   ["--view=front", "--background=blur"]),
    "spheres": ("khronos/MetalRoughSpheresNoTextures/glTF-Binary/MetalRoughSpheresNoTextures.glb", STUDIO,
                ["--view=front"]),
    "instances": ("khronos/SimpleInstancing/glTF-Binary/SimpleInstancing.glb", None, []),
    "terrain": ("big-geometry/srtm/N46E008_height16.png", None, ["--view=35,45"]),
    "statue": ("MADE/statue.ply.gz", None, []),
}


def render(helio, name):
    """None, or what is wrong."""
    scene, environment, more = PICTURES[name]
    if scene.startswith("MADE/"):
        path = os.path.join(ROOT, "build/tests/models", scene[5:])
    else:
        path = scene if scene == "demo:" else test_data.find(scene)
    light = test_data.find(environment) if environment else None
    if not path or (environment and not light):
        return "skipped: %s is not there" % (environment if path else scene)
    command = [helio, "render", path, "-o", os.path.join(HERE, name + ".jpg"), "--size", SIZE,
               "--progress", "none", *(["--env", light] if light else []), *more]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    return None if done.returncode == 0 else "failed with %d: %s" % (done.returncode, done.stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--helio", default=os.path.join(ROOT, "build/bin/helio"))
    parser.add_argument("--only", action="append", default=[])
    options = parser.parse_args()
    wrong = {name: render(options.helio, name) for name in PICTURES
             if not options.only or name in options.only}
    for name, what in wrong.items():
        print("%-16s %s" % (name, what or "ok"))
    sys.exit(1 if any(w and w.startswith("failed") for w in wrong.values()) else 0)


if __name__ == "__main__":
    main()
