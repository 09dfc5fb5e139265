#!/usr/bin/env python3
"""helio bench flight: laps through a scene in which a body moves, under small budgets. Once everything has been
seen no counter of memory grows from lap to lap, all stay within their budgets, and what the process has allocated and
keeps resident does not go on growing. Single steps of those two are no growth: a driver that compiles shaders on
demand keeps up to 100 MiB for each, and which laps need one more depends on the time that others took. Three steps
were seen, at worst in rests one after another; of 21 laps all of the six rests after the first have to grow.

    flight.py --helio build/bin/helio --scene FILE [--laps 21] [--size 96x54]     bounded, as the test suite does
    flight.py --helio build/bin/helio --scene FILE --minutes 60 [--target-ms 40]  the long flight
"""
import argparse
import os
import sys
import tempfile

import bench_report
from bench_report import check

WARM_UP = 0.5     # share of the laps before a counter's growth counts: two of every three rests
LAPS_A_REST = 3   # of the benchmark: each so many laps do the same
# MiB that memory of the process may vary by from rest to rest. Resident pages of an allocated heap that has stopped
# growing are still touched for the first time.
PROCESS = {"rss_bytes": 4, "heap_bytes": 1}
BUDGETS = {"texture": 16, "geometry": 64, "host": 64}  # MiB
# Counts of what was done, that may rise for ever; and highest marks.
FLOWS = ("read_bytes", "written_bytes", "uploaded_bytes", "pack_bytes", "peak_rss_bytes")


def counters(stats, path=""):
    """Everything that is memory: names and bytes."""
    for key, value in stats.items():
        if isinstance(value, dict):
            yield from counters(value, path + key + ".")
        elif key.endswith("bytes") and key not in FLOWS and key not in PROCESS:
            yield path + key, value


def judge(laps):
    """What grew after the warm-up."""
    first = int(len(laps) * WARM_UP)
    before, after = laps[:first], laps[first:]
    grown = []
    for name, value in counters(after[-1]["stats"]):
        most = max(dict(counters(lap["stats"])).get(name, 0) for lap in before)
        if value > most:
            grown.append("%s: %d bytes, at most %d in the first %d laps" % (name, value, most, first))
    for name, room in PROCESS.items():
        each = [lap["stats"]["process"][name] / 2**20 for lap in laps]
        tops = [max(each[k:k + LAPS_A_REST]) for k in range(LAPS_A_REST, len(each) - LAPS_A_REST + 1, LAPS_A_REST)]
        if len(tops) > 2 and all(after > before + room for before, after in zip(tops, tops[1:])):
            grown.append("process.%s: %s MiB" % (name, ", ".join("%.1f" % value for value in each)))
    return grown


def check_budgets(stats):
    for kind in ("texture", "geometry"):
        pool = stats[kind]
        check(0 < pool["resident_bytes"] <= pool["budget_bytes"] == BUDGETS[kind] << 20, kind, pool)


def check_judge():
    """Laps that grow are found."""
    def lap(rss, atlas):
        return {"stats": {"process": {"rss_bytes": rss << 20, "peak_rss_bytes": rss << 20, "heap_bytes": 1 << 20},
                          "light": {"atlas_bytes": atlas}, "texture": {"read_bytes": rss}}}
    check(judge([lap(100, 5)] * 12) == [], "flat laps grow")
    check(judge([lap(100 if k < 8 else 180, 5) for k in range(12)]) == [], "one step grows")
    check(len(judge([lap(100, 5), lap(100, 5), lap(100, 5), lap(100, 6)])) == 1, "a counter that grew")
    check(len(judge([lap(100 + 2 * k, 5) for k in range(12)])) == 1, "resident memory that grew")
    check(len(judge([lap(100 + 5 * (k // 3), 5) for k in range(12)])) == 1, "memory that grew at each rest")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--helio", required=True)
    parser.add_argument("--scene", required=True)
    parser.add_argument("--size", default="96x54")
    parser.add_argument("--laps", type=int, default=21)
    parser.add_argument("--minutes", type=float, default=0)
    parser.add_argument("--target-ms", type=float, default=0)
    options = parser.parse_args()
    check_judge()
    width, height = map(int, options.size.split("x"))
    poses = [{"eye": [0.3 * (k % 5 - 2), 1.7, 9 - 2.5 * k], "target": [0.4 * k, 1.5, -9 - 2.5 * k]}
             for k in range(6)]
    settings = dict(scene=os.path.abspath(options.scene), width=width, height=height, rounds=options.laps,
                    time_s=60 * options.minutes, target_ms=options.target_ms, path=poses)
    budgets = [word for kind, mib in BUDGETS.items()
               for word in ("--%s-budget" % kind, str(mib))]
    with tempfile.TemporaryDirectory() as folder:
        report = bench_report.bench(options.helio, "flight", folder, settings, *budgets)
    laps = report["laps"]
    check(len(laps) >= options.laps and laps[0]["frames"] == 2 * len(poses), len(laps))
    check_budgets(laps[-1]["stats"])
    grown = judge(laps)
    for growth in grown:
        print("grows:", growth)
    for name, value in sorted(counters(laps[-1]["stats"])):
        print("%-36s %10.2f MiB" % (name, value / 2**20))
    for name in PROCESS:
        print(name, *("%.1f" % (lap["stats"]["process"][name] / 2**20) for lap in laps))
    print("%d laps, %d frames, %.1f MiB resident after the first, %.1f after the last" % (
        len(laps), laps[-1]["frames"], laps[0]["stats"]["process"]["rss_bytes"] / 2**20,
        laps[-1]["stats"]["process"]["rss_bytes"] / 2**20))
    check(not grown, *grown)


if __name__ == "__main__":
    sys.exit(main())
