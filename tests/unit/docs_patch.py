#!/usr/bin/env python3
"""docs_patch.py - an example of a change that documents show still applies, and is as small as they say.

    docs_patch.py ROOT PATCH LINES FILES
"""
import os
import re
import subprocess
import sys
import tempfile


def main(root, patch, lines, files):
    path = os.path.join(root, patch)
    with open(path, encoding="utf-8") as f:
        text = f.read()
    if len(text.splitlines()) > int(lines):
        return "%s: more than %s lines" % (patch, lines)
    changed = re.findall(r"^diff --git a/(\S+) b/", text, re.M)
    if not changed or len(changed) > int(files):
        return "%s: %d files, at most %s" % (patch, len(changed), files)
    with tempfile.TemporaryDirectory() as folder:  # a copy of what it touches, outside of any repository
        for name in changed:
            source = os.path.join(root, name)
            target = os.path.join(folder, name)
            os.makedirs(os.path.dirname(target), exist_ok=True)
            if os.path.exists(source):
                with open(source, "rb") as f, open(target, "wb") as g:
                    g.write(f.read())
        done = subprocess.run(["git", "apply", path], cwd=folder, capture_output=True, text=True,
                              env=dict(os.environ, GIT_CEILING_DIRECTORIES=os.path.dirname(folder)))
        if done.returncode != 0:
            return "%s does not apply: %s" % (patch, done.stderr.strip())
        for name in changed:
            if not os.path.exists(os.path.join(folder, name)):
                return "%s: %s is missing" % (patch, name)
            with open(os.path.join(folder, name), encoding="utf-8") as f:
                after = f.read()
            source = os.path.join(root, name)
            before = open(source, encoding="utf-8").read() if os.path.exists(source) else ""
            if after == before:
                return "%s changed nothing in %s" % (patch, name)
    return None


if __name__ == "__main__":
    failure = main(*sys.argv[1:])
    if failure:
        print(failure, file=sys.stderr)
    sys.exit(1 if failure else 0)
