#!/usr/bin/env python3
"""keys.py ROOT - client/view/keys.def against docs/client.md, and itself: no key does two things, every
row (pointer, panels and gamepad, too) stands in the guide, and browsers' codes are of the form that KeyboardEvent has."""
import re
import sys

ROOT = sys.argv[1]


def read(path):
    with open("%s/%s" % (ROOT, path), encoding="utf-8") as f:
        return f.read()


rows = re.findall(r'^HG_VIEW_KEY\((\w+), "([^"]+)", "([^"]+)", "([^"]+)", "([^"]+)"\)$',
                  read("client/view/keys.def"), re.M)
guide = read("docs/client.md")
wrong = [] if len(rows) > 30 else ["the table of keys is not understood"]
for column, what in ((0, "action"), (1, "key"), (2, "code"), (3, "name")):
    seen = [row[column] for row in rows]
    wrong += ["two rows have the %s %s" % (what, value) for value in set(seen) if seen.count(value) > 1]
for action, key, code, _, doc in rows:
    if "| `%s` | %s |" % (key, doc) not in guide:
        wrong.append("docs/client.md lacks the row of %s: | `%s` | %s |" % (action, key, doc))
    if not re.fullmatch(r"Key[A-Z]|Digit\d|Arrow\w+|F\d+|[A-Z]\w+", code):
        wrong.append("%s is no code of a key" % code)
others = re.findall(r'^HG_VIEW_(POINTER|PANEL|PAD)\("([^"]+)", "([^"]+)"\)$', read("client/view/keys.def"), re.M)
wrong += [] if len(others) > 10 else ["the rows of pointer, panels and gamepad are not understood"]
for kind, what, doc in others:
    row = "| %s%s | %s |" % (what, {"POINTER": "", "PANEL": " in a panel", "PAD": " of a gamepad"}[kind], doc)
    if row not in guide:
        wrong.append("docs/client.md lacks the row " + row)
print("\n".join(wrong))
sys.exit(1 if wrong else 0)
