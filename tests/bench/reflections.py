#!/usr/bin/env python3
"""helio bench reflections on two tiny pictures of the demo: its report has every way of making reflections, and counts
that say what each does.

    reflections.py --helio build/bin/helio
"""
import argparse
import tempfile

import bench_report
from bench_report import check

PATH = [{"eye": [3.5, 1.8, 4], "target": [0, 0.8, 0]}, {"eye": [2.5, 1.8, 3], "target": [0, 0.8, 0]}]


def bench(args, folder):
    options = {"width": 64, "height": 36, "samples": 1, "path": PATH}
    return bench_report.bench(args.helio, "reflections", folder, options)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--helio", required=True)
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        views = bench(args, folder)["views"]
    check(len(views) == len(PATH), views)
    for view in views:
        check("cpu_ms" not in view["environment"] and view["environment"]["flip"] > 0, view)
        for way in ("full", "rays", "cache_32", "cache_256"):
            found = view[way]
            check(found["cpu_ms"] > 0 and 0 < found["flip"] < 1 and found["ratio"] > 0, way, view)
            check((found["gathered"] > 0) == (way != "full"), way, view)
            check(found["texels"] == sum(found[key] for key in ("sky", "cached", "shaded", "late")), way, view)
        check(view["full"]["ratio"] == 1 and view["full"]["cached"] == view["rays"]["cached"] == 0, view)
        check(view["full"]["texels"] > view["rays"]["texels"] > 0, view)
    check(sum(view["cache_32"]["cached"] for view in views) > 0, views)


if __name__ == "__main__":
    main()
