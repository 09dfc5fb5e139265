#!/usr/bin/env python3
"""Writes helio/_enums.py and helio/_messages.py, the messages of the protocol as tables, from
protocol/messages.def and protocol/view_params.def; with --check it fails when they are not current.

    generate.py ROOT [--check]
"""
import os
import re
import sys

MACRO = re.compile(r"^HGP_(\w+)\((.*)\)\s*$")


def arguments(text):
    """The arguments of a macro; texts in quotes may hold commas."""
    out, depth, quoted, part = [], 0, False, ""
    for i, c in enumerate(text):
        if c == '"' and text[i - 1:i] != "\\":
            quoted = not quoted
        depth += 0 if quoted else (c == "(") - (c == ")")
        if c == "," and not quoted and depth == 0:
            out.append(part.strip())
            part = ""
        else:
            part += c
    return out + [part.strip()]


def rows(path):
    with open(path, encoding="utf-8") as f:
        text = f.read().replace("\\\n", " ")
    for line in text.splitlines():
        if '#include "protocol/view_params.def"' in line:
            yield "INCLUDE", []
        match = MACRO.match(line)
        if match:
            yield match.group(1), arguments(match.group(2))


WHOLE = {"U8": (0, 2 ** 8 - 1), "U16": (0, 2 ** 16 - 1), "U32": (0, 2 ** 32 - 1), "U64": (0, 2 ** 64 - 1),
         "I32": (-2 ** 31, 2 ** 31 - 1)}
NAMED = {"UINT32_MAX": 2 ** 32 - 1, "UINT64_MAX": 2 ** 64 - 1}


def field(name, kind, a, b, optional):
    """(name, kind, enum or list part, optional) and the range of an integer that has not all of its kind."""
    span = None
    if kind in WHOLE:
        span = tuple(NAMED[text] if text in NAMED else int(text, 0) for text in (a, b))
    return (name, kind, a if kind in ("ENUM", "LIST") else "", optional), None if span == WHOLE.get(kind) else span


def params(root):
    for name, a in rows(os.path.join(root, "protocol/view_params.def")):
        if name in ("VIEW_PARAM", "VIEW_DELIVERY"):
            yield field(a[1], a[0], a[2], a[3], True)


def read(root):
    """enums {name: [(value name, number)]}, records {name: (id, direction, [field()])}."""
    enums, records, fields = {}, {}, []
    for name, a in rows(os.path.join(root, "protocol/messages.def")):
        if name == "ENUM":
            enums[a[0]] = []
        elif name == "VALUE":
            enums[a[0]].append((a[1], int(a[2], 0)))
        elif name in ("STRUCT", "MESSAGE"):
            fields = []
            message = name == "MESSAGE"
            records[a[0]] = (int(a[1], 0) if message else 0, a[2] if message else "", fields)
        elif name == "F":
            fields.append(field(a[2], a[1], a[3], a[4], a[0] == "OPT"))
        elif name == "INCLUDE":
            fields.extend(params(root))
    return enums, records


def statuses(root):
    for name, a in rows_of_status(root):
        yield a[0], int(a[1]), a[2].strip('"')


def rows_of_status(root):
    with open(os.path.join(root, "base/status.def"), encoding="utf-8") as f:
        for match in re.finditer(r"^HG_STATUS\((.*)\)$", f.read(), re.M):
            yield "STATUS", arguments(match.group(1))


def packed(items):
    """As many to a line as there is room for."""
    lines, line = [], " " * 7
    for item in items:
        if len(line) + 1 + len(item) > 115:
            lines.append(line)
            line = " " * 7
        line += " " + item
    return lines + ([line] if line.strip() else [])


HEAD = ('"""%s of the protocol.\n\nWritten by client/python/generate.py from protocol/messages.def: do not edit."""\n'
        "from __future__ import annotations\n\n")


def title(name):
    return "".join(part.capitalize() for part in name.split("_"))


def enum_file(root, enums):
    out = [HEAD % "Enums" + "import enum", "from typing import Dict", "", "", "class Status(enum.IntEnum):"]
    out += ["    %s = %d" % (symbol, value) for symbol, value, _ in statuses(root)]
    out += ["", "", "STATUS_NAMES: Dict[int, str] = {"]
    out += ['    %d: "%s",' % (value, name) for _, value, name in statuses(root)] + ["}"]
    for name, values in enums.items():
        out += ["", "", "class %s(enum.IntEnum):" % title(name)]
        out += ["    %s = %d" % value for value in values]
    out += ["", "", "ENUMS: Dict[str, type[enum.IntEnum]] = {"]
    out += ['    "%s": %s,' % (name, title(name)) for name in enums]
    return "\n".join(out + ["}"]) + "\n"


def message_file(records):
    out = [HEAD % "Messages" + "from typing import Dict, List, Tuple", "",
           "# (field, kind, enum or list part, optional)", "Field = Tuple[str, str, str, bool]", "",
           "# Parts of lists have number 0. In the order of C's structs.",
           "RECORDS: Dict[str, Tuple[int, str, List[Field]]] = {"]
    for name, (number, direction, fields) in records.items():
        out.append('    "%s": (0x%04x, "%s", [' % (name, number, direction))
        out += packed(['("%s", "%s", "%s", %s),' % row for row, _ in fields])
        out.append("    ]),")
    out += ["}", "", "# Least and greatest value of integers that have not all of their kind.",
            "RANGES: Dict[str, Dict[str, Tuple[int, int]]] = {"]
    for name, (_, _, fields) in records.items():
        spans = ['"%s": %r,' % (row[0], span) for row, span in fields if span]
        if spans:
            out += ['    "%s": {' % name] + packed(spans) + ["    },"]
    return "\n".join(out + ["}"]) + "\n"


def main():
    root = sys.argv[1]
    enums, records = read(root)
    for name, text in (("_enums.py", enum_file(root, enums)), ("_messages.py", message_file(records))):
        path = os.path.join(root, "client/python/helio", name)
        if sys.argv[2:] != ["--check"]:
            with open(path, "w", encoding="utf-8") as f:
                f.write(text)
            continue
        with open(path, encoding="utf-8") as f:
            if f.read() != text:
                sys.exit("client/python/helio/%s is not current: run client/python/generate.py ROOT, or "
                         "cmake --build build --target protocol_update" % name)


if __name__ == "__main__":
    main()
