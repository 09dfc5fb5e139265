#!/usr/bin/env python3
"""helio bench gi on five tiny pictures of a street: its report says what it should, references are kept and
found again, pictures are written, light from probes changes pictures, and neither walls of two rooms nor changes of their light
are far off.

    gi.py --helio build/bin/helio --models build/tests/models
"""
import argparse
import os
import tempfile

import bench_report
from bench_report import check

MODES = ("none", "probes", "rested", "shown", "shown_rested", "settled")
PATH = [{"eye": [0.2 * (k % 3 - 1), 1.7, 9 - 0.7 * k], "target": [0, 2, -0.7 * k]} for k in range(5)]


def bench(args, folder, **options):
    options = dict(width=32, height=18, samples=1, path=PATH, lamps=2,
                   scene=os.path.abspath(os.path.join(args.models, "leaves_opaque.glb")),
                   references=os.path.join(folder, "references"), **options)
    return bench_report.bench(args.helio, "gi", folder, options)


def check_references(light, found, made):
    check((light["references_found"], light["references_made"]) == (found, made), light)


def check_light(light):
    for mode in MODES:
        check(0 < light[mode]["flip"] < 1 and light[mode]["region_error"] > 0, mode, light[mode])
        check(light[mode]["worst_region_error"] >= light[mode]["region_error"], mode, light[mode])
    check(len({light[mode]["flip"] for mode in ("none", "probes", "rested")}) == 3, light)
    check(len({light[mode]["flip"] for mode in ("rested", "shown_rested", "settled")}) == 3, light)


def check_rooms(report):
    check([leak["wall_m"] for leak in report["leaks"]] == [0.1, 0.01], report["leaks"])
    for leak, most in zip(report["leaks"], (0.01, 0.05)):
        check(0 < leak["probes"] <= most and 0 < leak["rays"] <= most, leak)
        check(leak["motion"] >= leak["motion_last"] > 0, leak)
    check([r["change"] for r in report["responses"]] ==
          ["lamp_on", "lamp_off", "sun_turned", "door_opened"], report["responses"])
    for response in report["responses"]:
        check(0.8 < response["after_60"] < 1.2 and response["settled_over_motion"] > 0.5, response)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--helio", required=True)
    parser.add_argument("--models", required=True)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        os.mkdir(os.path.join(folder, "references"))
        pictures = os.path.join(folder, "pictures")
        os.mkdir(pictures)
        first = bench(args, folder, pictures=pictures)
        check((first["poses"], first["compared"], first["truth"]) == (5, 1, "path"), first)
        check_rooms(first)
        check(sorted(os.listdir(pictures)) == sorted(
            f"{light}_{mode}_04.png" for light in ("day", "night") for mode in (*MODES, "truth")), pictures)
        again = bench(args, folder, only="walk", ways=["rested"])
        check("leaks" not in again and "settled" not in again["day"], again)
        for name in ("day", "night"):
            check_light(first[name])
            check_references(first[name], 0, 2)
            check_references(again[name], 2, 0)
            check(first[name]["rested"]["flip"] == again[name]["rested"]["flip"], first, again)
        high = bench(args, folder, only="day", sun=[60, 75], exposure=2, ways=["none"])
        check("night" not in high and "leaks" not in high, high)
        check_references(high["day"], 0, 2)
        check(high["day"]["exposure_ev"] == 2 and high["day"]["none"]["flip"] != first["day"]["none"]["flip"], high)


if __name__ == "__main__":
    main()
