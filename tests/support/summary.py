#!/usr/bin/env python3
"""The end of a run of the suite: what failed, what was skipped, why, and how to get what it needs.

usage: summary.py REPORT.xml     (ctest --output-junit REPORT.xml --test-output-size-passed 1000000)
"""
import re
import sys
import xml.etree.ElementTree as xml

# Lines that test_data.h, test_data.py and shell.sh print.
MISSING = re.compile(r"SKIPPED: test data is missing: (\S.*)")
ADVICE = """\
To get it: set HELIO_TEST_DATA to a folder that holds these files; docs/testing.md says where each of
its folders comes from. Where HELIO_TEST_DATA is set or CI=true, missing test data is a failure."""


def read(report):
    """(name, status, names of missing test data) of each test."""
    for case in xml.parse(report).getroot().iter("testcase"):
        text = "".join(case.itertext())
        missing = list(dict.fromkeys(m.strip() for m in MISSING.findall(text)))
        yield case.get("name"), case.get("status"), missing


def describe(missing):
    return ", ".join(missing[:2]) + (" and %d more" % (len(missing) - 2) if len(missing) > 2 else "")


def main():
    cases = list(read(sys.argv[1]))
    failed = [name for name, status, _ in cases if status == "fail"]
    skipped = [(name, missing) for name, status, missing in cases if status in ("notrun", "disabled")]
    partial = [(name, missing) for name, status, missing in cases if status == "run" and missing]
    print("%d tests: %d passed, %d failed, %d skipped" % (
        len(cases), len(cases) - len(failed) - len(skipped), len(failed), len(skipped)))
    for title, rows in (("Skipped", skipped), ("Passed, with parts skipped", partial)):
        if rows:
            print("%s:" % title)
        for name, missing in rows:
            print("  %-24s %s" % (name, "needs " + describe(missing) if missing else "cannot run here"))
    if any(missing for _, missing in skipped + partial):
        print(ADVICE)
    for name in failed:
        print("FAILED: %s" % name)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
