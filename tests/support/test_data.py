"""Files that tests need and the project does not hold: test_data.h for scripts in Python."""
import os
import sys

SKIPPED = 77  # exit code of a test of which nothing could run
SET = os.environ.get("HELIO_TEST_DATA", "")
SOURCE = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..")
ROOT = SET or os.path.normpath(os.path.join(SOURCE, "..", "shared", "data"))
REQUIRED = bool(SET) or os.environ.get("CI") == "true"


def find(relative):
    """The path of a file or folder of the test data; None, with a line on stdout: it is missing."""
    path = os.path.join(ROOT, relative)
    if os.path.exists(path):
        return path
    print("%s: test data is missing: %s" % ("FAILED" if REQUIRED else "SKIPPED", relative), flush=True)
    return None


def need(*relative):
    """The paths of all of them; the program ends, failed or skipped, when one is missing."""
    paths = [find(name) for name in relative]
    if None in paths:
        sys.exit(1 if REQUIRED else SKIPPED)
    return paths
