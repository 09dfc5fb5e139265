#!/usr/bin/env python3
"""Each exported symbol of the project's static libraries is defined by one of them: of two the linker takes the first,
without a word.

    symbols.py BUILD_DIR      symbols.py --self-check
"""
import collections
import os
import subprocess
import sys
import tempfile

LOCAL_COPIES = "wWvVu"  # weak and unique ones may be in many


def archives(folder):
    for path, _, files in os.walk(folder):
        for name in files:
            if name.endswith(".a"):
                yield os.path.join(path, name)


def duplicates(folder):
    places = collections.defaultdict(set)
    for archive in archives(folder):
        listed = subprocess.run(["nm", "-A", "--defined-only", "--extern-only", archive], capture_output=True,
                                text=True, check=True).stdout
        for line in listed.splitlines():
            place, kind, symbol = line.rsplit(None, 2)
            if kind not in LOCAL_COPIES:
                places[symbol].add((os.path.basename(archive), place.split(":")[1]))
    return {symbol: found for symbol, found in places.items() if len(found) > 1}, len(places)


def self_check():
    with tempfile.TemporaryDirectory() as folder:
        for name, text in (("a", "int one, two;"), ("b", "int two; static int three;"), ("c", "static int three;")):
            source = os.path.join(folder, name + ".c")
            with open(source, "w", encoding="utf-8") as f:
                f.write(text)
            subprocess.run(["cc", "-fno-common", "-c", source, "-o", source[:-1] + "o"], check=True)
            subprocess.run(["ar", "rc", os.path.join(folder, "lib%s.a" % name), source[:-1] + "o"], check=True)
        found, _ = duplicates(folder)
        assert found == {"two": {("liba.a", "a.o"), ("libb.a", "b.o")}}, found


def main():
    if sys.argv[1] == "--self-check":
        return self_check()
    found, count = duplicates(sys.argv[1])
    for symbol, places in sorted(found.items()):
        print(symbol, "is defined by", " and ".join("%s(%s)" % place for place in sorted(places)))
    print(count, "symbols")
    return 1 if found or count == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
