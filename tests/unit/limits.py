#!/usr/bin/env python3
"""What one sitting can read: no hand-written file above 700 lines, no struct above 25 members that
is not a table, no function with more than six parameters outside kernels.

  limits.py ROOT         fails and names each that is above

The reading is textual: comments and strings are blanked, then declarations at depth are counted. That
suffices for code in this project's format (.clang-format)."""

import pathlib
import re
import sys

ROOMS = ["base", "client", "protocol", "renderer", "server", "shaders", "tests", "deploy"]
SOURCES = {".c", ".h", ".cpp", ".glsl", ".comp", ".vert", ".frag", ".py", ".sh", ".js", ".mjs"}
MOST_LINES = 700
MOST_MEMBERS = 25
MOST_PARAMETERS = 6

# The head of a generated file names its generator, by its path in the repository.
GENERATED = re.compile(r"\A(?:[^\n]*\n){0,2}[^\n]*\b(?:Made|Written) by ([\w./-]+) from ")

# Blocks that C and GLSL read by offset: tables, one row a name.
TABLES = {"hg_gpu_lighting", "hg_gpu_path"}
# Inner loops written for one register layout each.
KERNELS = {"renderer/cpu_raster/raster_avx2.c"}


def blank(text):
    """`text` without comments, strings and directives; lines stay where they are."""
    text = re.sub(
        r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])*\'',
        lambda m: re.sub(r"[^\n]", " ", m.group()) if m.group()[0] == "/" else '""',
        text,
        flags=re.S,
    )
    return re.sub(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", lambda m: "\n" * m.group().count("\n"), text, flags=re.M)


def closing(text, start):
    """Index behind the bracket that closes the one at `start`."""
    opens, closes = text[start], {"(": ")", "{": "}"}[text[start]]
    depth = 0
    for i in range(start, len(text)):
        depth += (text[i] == opens) - (text[i] == closes)
        if depth == 0:
            return i + 1
    return len(text)


def top_level(text, separator):
    """Parts of `text` between separators that stand in no bracket."""
    parts, depth, start = [], 0, 0
    for i, c in enumerate(text):
        depth += (c in "([{") - (c in ")]}")
        if c == separator and depth == 0:
            parts.append(text[start:i])
            start = i + 1
    return parts + [text[start:]]


def members(body):
    """Names that a struct's body declares; those of a nested struct count as one."""
    count = 0
    for declaration in top_level(body, ";"):
        if declaration.strip() and not declaration.strip().startswith("_Static_assert"):
            count += len(top_level(declaration, ","))
    return count


def line_of(text, index):
    return text.count("\n", 0, index) + 1


def check(root, path, name):
    source = path.read_text(errors="replace")
    lines = source.count("\n")
    generated = GENERATED.match(source)
    if generated and not (root / generated.group(1)).exists():
        yield f"{name}: made by {generated.group(1)}, which is not there"
    if lines > MOST_LINES and not generated:
        yield f"{name}: {lines} lines"
    if path.suffix not in {".c", ".h", ".cpp"}:
        return
    text = blank(source)
    for m in re.finditer(r"\bstruct\s+(\w+)?\s*\{", text):
        if m.group(1) in TABLES:
            continue
        count = members(text[m.end() : closing(text, m.end() - 1) - 1])
        if count > MOST_MEMBERS:
            struct = m.group(1) or "(anonymous)"
            yield f"{name}:{line_of(text, m.start())}: struct {struct} has {count} members"
    if name in KERNELS:
        return
    # A declaration or definition: a type, a name, a list, then ; or {. Calls have no type before them.
    for m in re.finditer(r"^(?!\s*(?:return|else)\b)[ \t]*[A-Za-z_][\w \t]*[ \t*]+(\w+)(\()", text, flags=re.M):
        end = closing(text, m.start(2))
        if not re.match(r"\s*(?:\{|;|__attribute__)", text[end:]):
            continue
        count = len(top_level(text[m.end() : end - 1], ","))
        if count > MOST_PARAMETERS:
            place = f"{name}:{line_of(text, m.start(1))}"
            yield f"{place}: {m.group(1)} has {count} parameters"


def main(root):
    root = pathlib.Path(root)
    found = []
    for room in ROOMS:
        for path in sorted(p for p in (root / room).rglob("*") if "node_modules" not in p.parts):
            if path.suffix in SOURCES and path.is_file():
                found += check(root, path, str(path.relative_to(root)))
    print("\n".join(found) if found else "all within limits")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
