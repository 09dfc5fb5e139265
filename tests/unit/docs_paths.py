#!/usr/bin/env python3
"""docs_paths.py - fails when a page of documentation names something that is not in the tree.

    docs_paths.py ROOT [--tests FILE | --build BUILD --ctest CTEST]
    docs_paths.py --self-check

Pages are README.md, CONTRIBUTING.md, CHANGELOG.md and docs/. Rules (names as they are printed):
    link        a relative link that leads nowhere, or to a heading that its page does not have
    path        a source file that is not there: `a/b.c` has to be the end of a path of the tree, so
                that pages may leave out the folder they are about; `*` and `{a,b}` are patterns
    folder      a folder in backquotes, with a slash at its end, that is not there
    symbol      an hg_, HG_ or HELIO_ word in backquotes that no source contains
    test        a row of docs/techniques.md without a test, or with the name of one that ctest does not
                list
    id          an ID of docs/techniques.md that stands in two rows
Pages whose tables are generated are checked for links only. Names of tests come from ctest itself
(or from a file with one name per line), as many are made in loops of CMake.
"""
import argparse
import fnmatch
import os
import re
import subprocess
import sys
import tempfile

TOPS = (".ci", "base", "client", "deploy", "docs", "protocol", "renderer", "server", "shaders", "tests")
LINKS_ONLY = {"docs/client.md", "docs/configuration.md", "docs/protocol.md"}
TECHNIQUES = "docs/techniques.md"
# What may be a path; those that end like a source are.
NAME = re.compile(r"(?<![\w$./*{-])[\w.*-][\w.*/-]*(?:\{[\w.,]+\}[\w.*/-]*)*")
PRODUCTS = {"three.js"}
SUFFIX = re.compile(r"\w.*\.(?:c|h|cpp|glsl|comp|frag|vert|def|py|sh|mjs|js|cmake|toml|jsonl)$")
FOLDER = re.compile(r"`((?:%s)(?:/[\w.{},*-]+)*)/`" % "|".join(re.escape(t) for t in TOPS))
QUOTED = re.compile(r"`([^`\n]+)`")
SYMBOL = re.compile(r"\b(?:hg|HG|HELIO)_\w+")
LINK = re.compile(r"\]\(([^)\s]+)\)")
ID = re.compile(r"\b(?:RTR|RTG|PBR|NOTE)[\w.]*-[\w.-]*\w")


def read(path):
    with open(path, encoding="utf-8", errors="replace") as f:
        return f.read()


def files_of(root):
    found = [n for n in os.listdir(root) if os.path.isfile(os.path.join(root, n))]
    for top in TOPS:
        for folder, folders, names in os.walk(os.path.join(root, top)):
            folders[:] = [n for n in folders if n not in ("node_modules", "__pycache__")]
            found += [os.path.relpath(os.path.join(folder, n), root) for n in names]
    return found


def alternatives(pattern):
    """`a{b,c}` as `ab` and `ac`."""
    braces = re.search(r"\{([^}]*)\}", pattern)
    if not braces:
        return [pattern]
    return [name for word in braces.group(1).split(",")
            for name in alternatives(pattern[:braces.start()] + word + pattern[braces.end():])]


def anchors_of(text):
    """Headings as links name them."""
    titles = re.findall(r"^#+ +(.*?) *$", re.sub(r"^```.*?^```", "", text, flags=re.S | re.M), re.M)
    return {re.sub(r"[^\w -]", "", t.lower()).replace(" ", "-") for t in titles}


class Tree:
    def __init__(self, root, tests):
        self.root = root
        self.tests = tests  # names, or None: not asked
        self.files = files_of(root)
        self.folders = {os.path.dirname(p) for p in self.files}
        self.folders |= {os.path.dirname(p) for p in self.folders}
        self.words = set()
        for path in self.files:
            if not path.endswith((".md", ".png", ".jpg", ".exr", ".ktx2")):
                self.words.update(SYMBOL.findall(read(os.path.join(root, path))))
        self.wrong = []

    def say(self, page, line, rule, what):
        self.wrong.append((page, line, rule, what))

    def is_there(self, name):
        return all(any(fnmatch.fnmatchcase("/" + p, "*/" + one) for p in self.files)
                   for one in alternatives(name))

    def is_folder(self, name):
        return all(fnmatch.filter(self.folders, one) for one in alternatives(name))

    def check_link(self, page, line, target):
        if re.match(r"[a-z]+:", target):
            return
        path, _, anchor = target.partition("#")
        full = os.path.normpath(os.path.join(self.root, os.path.dirname(page), path)) if path \
            else os.path.join(self.root, page)
        if not os.path.exists(full):
            self.say(page, line, "link", target)
        elif anchor and full.endswith(".md") and anchor not in anchors_of(read(full)):
            self.say(page, line, "link", target)

    def check_names(self, page, line, text):
        for name in NAME.findall(text):
            name = name.rstrip(".")
            if name not in PRODUCTS and all(SUFFIX.search(one) for one in alternatives(name)) and not self.is_there(name):
                self.say(page, line, "path", name)
        for name in FOLDER.findall(text):
            if not self.is_folder(name):
                self.say(page, line, "folder", name + "/")
        for quoted in QUOTED.findall(text):
            for word in SYMBOL.findall(quoted):
                known = any(w.startswith(word) for w in self.words) if word.endswith("_") \
                    else word in self.words
                if not known:
                    self.say(page, line, "symbol", word)

    def check_row(self, page, line, text, seen):
        cells = [c.strip() for c in text.strip().strip("|").split("|")]
        ids = ID.findall(cells[0])
        if not ids:
            return
        for row in ids:
            if row in seen:
                self.say(page, line, "id", row)
            seen.add(row)
        if len(cells) < 4 or self.tests is None:
            return
        names = [n for n in QUOTED.findall(cells[3]) if re.fullmatch(r"[\w*]+", n)]
        if not names:
            self.say(page, line, "test", "none")
        for name in names:
            if not fnmatch.filter(self.tests, name):
                self.say(page, line, "test", name)

    def check(self):
        pages = sorted(p for p in self.files if p.endswith(".md") and ("/" not in p or p.startswith("docs/")))
        for page in pages:
            seen = set()
            for line, text in enumerate(read(os.path.join(self.root, page)).splitlines(), 1):
                for target in LINK.findall(text):
                    self.check_link(page, line, target)
                if page not in LINKS_ONLY:
                    self.check_names(page, line, text)
                if page == TECHNIQUES and text.startswith("|"):
                    self.check_row(page, line, text, seen)
        return self.wrong


def tests_of(arguments):
    if arguments.tests:
        return read(arguments.tests).split()
    if not arguments.build:
        return None
    listed = subprocess.run([arguments.ctest, "--test-dir", arguments.build, "-N"], check=True,
                            stdout=subprocess.PIPE, text=True).stdout
    names = re.findall(r"^ *Test +#\d+: (\S+)", listed, re.M)
    if not names:
        sys.exit("docs_paths: ctest lists no tests in " + arguments.build)
    return names


def self_check():
    """A tree with one mistake of each kind beside its right form."""
    page = {
        "README.md": "[a](docs/a.md) [b](docs/b.md) [c](docs/a.md#right-one) [d](docs/a.md#wrong-one)\n",
        "docs/a.md": "# A\n## Right one\n`base/x.{c,h}` `base/x.{c,cpp}` x.c y.c `base/` `base/none/`\n"
                     "`hg_x_do` `hg_x_undo` `HG_X_` `HG_Y_`\n",
        "docs/techniques.md": "| ID | what | where | shown by |\n"
                              "| RTR1.1-ONE | a | x.c | `x_one`, `x_t*` |\n| RTR1.2-TWO | a | x.c | `x_gone` |\n"
                              "| RTR1.1-ONE | a | x.c | a picture |\n",
        "base/x.c": "int hg_x_do(void);\n#define HG_X_A 1\n", "base/x.h": "",
    }
    with tempfile.TemporaryDirectory() as root:
        for name, text in page.items():
            os.makedirs(os.path.join(root, os.path.dirname(name)), exist_ok=True)
            with open(os.path.join(root, name), "w", encoding="utf-8") as f:
                f.write(text)
        found = {(rule, what) for _, _, rule, what in Tree(root, ["x_one", "x_two"]).check()}
    expected = {("link", "docs/b.md"), ("link", "docs/a.md#wrong-one"), ("path", "base/x.{c,cpp}"),
                ("path", "y.c"), ("folder", "base/none/"), ("symbol", "hg_x_undo"), ("symbol", "HG_Y_"),
                ("test", "x_gone"), ("test", "none"), ("id", "RTR1.1-ONE")}
    for rule, what in sorted(expected ^ found):
        print("self-check: %s %s: %s" % ("missed" if (rule, what) in expected else "wrong", rule, what))
    return 1 if expected ^ found else 0


def main():
    parser = argparse.ArgumentParser(usage=__doc__)
    parser.add_argument("root", nargs="?")
    parser.add_argument("--build")
    parser.add_argument("--ctest", default="ctest")
    parser.add_argument("--tests")
    parser.add_argument("--self-check", action="store_true")
    arguments = parser.parse_args()
    if arguments.self_check:
        return self_check()
    if not arguments.root:
        parser.error("ROOT is missing")
    wrong = Tree(arguments.root, tests_of(arguments)).check()
    for page, line, rule, what in wrong:
        print("%s:%d: %s: %s" % (page, line, rule, what))
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
