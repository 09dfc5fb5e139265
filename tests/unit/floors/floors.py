#!/usr/bin/env python3
"""floors.py - reads every #include of the project and fails when a floor is broken.

    floors.py ROOT          check the tree
    floors.py --self-check FIXTURES
                            FIXTURES/good must pass; in FIXTURES/bad every file names in a comment
                            "caught: RULE" what has to be found in it, and nothing else may be
Rules (names as they are printed):
    floor       an include goes to the same or a higher floor
    down        rooms of floor 2 include each other only downhill, in the order of HILL
    apart       broker, worker and client meet only in the protocol; client and broker do not
                include the renderer, worker and loader include it without the benchmarks
    border      a folder within a room is included from outside by another header than those of BORDERS
    pass        a pass includes another pass
    vulkan      Vulkan headers outside renderer/, also through headers of the project
    socket      socket headers outside server/ and client/
    root        an include in quotes that is not written from the root, or names no file
    c++         a C++ file that no C++-only library forces
    layer       within a room that lists its layers, an include that does not go to a lower one, or
                a file that is in no layer
    home        in such a room, a function that is exported and not declared in its file's header, nor
                in a header of client/include
A room lists its layers in a comment of one of its headers: "// Layers, lowest first:", then a line
for each, three spaces and the names of its files without suffix; four spaces end the names.
"""
import os
import re
import sys

# Rooms by the longest matching folder. Files directly in renderer/ are the facade.
FLOORS = {
    "base": 0, "shaders/shared": 0,
    "protocol": 1, "renderer/gpu": 1, "renderer/image": 1, "base/store": 1,
    "renderer/residency": 1, "shaders/lib": 1,
    "renderer/math": 1, "renderer/camera": 1,
    "renderer/scene": 2, "renderer/texture": 2, "renderer/lod": 2, "renderer/cluster": 2, "renderer/mesh": 2,
    "renderer/deform": 2, "renderer/geometry": 2, "renderer/cpu_raster": 2, "renderer/cull": 2,
    "renderer/trace": 2, "renderer/light": 2, "renderer/host_shading": 2,
    "renderer/gi": 2, "renderer/irradiance": 2, "renderer/reflect": 2, "renderer/gather": 2, "renderer/denoise": 2, "renderer/graph": 2,
    "renderer/temporal": 2,
    "renderer/scene_gpu": 2, "shaders/passes": 2,
    "renderer/passes": 3,
    "renderer/pathtrace": 3.5,  # made of passes, without a view around it
    "renderer/frame": 4,
    "renderer": 5, "renderer/bake": 5,
    "renderer/bench": 6, "server": 6, "server/broker": 6, "server/loader": 6, "server/worker": 6, "client": 6,
}
# Within floor 2 an include goes to a smaller number.
HILL = {room: height for height, room in enumerate((
    "renderer/scene", "renderer/texture", "renderer/lod", "renderer/cluster", "renderer/mesh",
    "renderer/deform", "renderer/geometry", "renderer/cpu_raster", "renderer/cull",
    "renderer/trace", "renderer/light", "renderer/host_shading", "renderer/gi",
    "renderer/irradiance", "renderer/reflect", "renderer/gather", "renderer/scene_gpu"))}
# Floor 6: which rooms a room may include beside base and protocol; "" stands for itself.
APART = {
    "server": {"server"},
    "server/broker": {"server", "server/broker"},
    "server/loader": {"server", "server/loader", "renderer"},
    "server/worker": {"server", "server/loader", "server/worker", "renderer", "shaders/shared"},
    "client": {"client", "base/store"},
}
# Folders within rooms, and the headers by which files outside of them may include them.
BORDERS = {
    "renderer/scene/demo": {"demo.h"},
    "renderer/scene/formats": {"formats.h"},
    "renderer/scene/formats/gltf": set(), "renderer/scene/formats/import": set(),
    "renderer/scene/formats/mesh": set(),
}
CPP_FILES = {"renderer/image/oiio.cpp", "renderer/scene/formats/gltf/draco.cpp"}
SCANNED = ("base", "protocol", "renderer", "server", "client", "shaders")
SUFFIXES = (".c", ".h", ".cpp", ".cc", ".cxx", ".hpp", ".inl", ".def",
            ".glsl", ".comp", ".vert", ".frag", ".mesh", ".task", ".geom", ".tesc", ".tese")
SHADERS = (".glsl", ".comp", ".vert", ".frag", ".mesh", ".task", ".geom", ".tesc", ".tese")
VULKAN = re.compile(r"^(vulkan/|vk_|volk|vma)")
SOCKET = re.compile(r"^(sys/socket|sys/un|netinet/|arpa/|netdb|net/|linux/(if|in|tcp|un)|openssl/ssl)")
INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]+(?:<([^>]+)>|"([^"]+)")', re.M)
CAUGHT = re.compile(r"caught: ([a-z+]+)")
LAYERS = re.compile(r"^// Layers, lowest first:\n((?://   \S.*\n)+)", re.M)
# A line at the margin that begins a function: its name is the last word before the parenthesis.
FUNCTION = re.compile(r"^(?!static\b|typedef\b|extern\b)[A-Za-z_][\w \t*]*?\b(\w+)\([^;{]*\{", re.M)


def room_of(path):
    folder = os.path.dirname(path)
    while folder:
        if folder in FLOORS:
            return folder
        folder = os.path.dirname(folder)
    return None


class Tree:
    def __init__(self, root):
        self.root = root
        self.files = {}  # path -> [(line, name, quoted)]
        self.text = {}   # path -> its text without block comments
        self.layers = {}  # room -> {stem: layer}
        for top in SCANNED:
            for folder, _, names in os.walk(os.path.join(root, top)):
                for name in names:
                    if name.endswith(SUFFIXES):
                        self.read(os.path.relpath(os.path.join(folder, name), root))

    def read(self, path):
        with open(os.path.join(self.root, path), encoding="utf-8") as f:
            text = f.read()
        # Comments are blanked (not removed) so that line numbers stay.
        text = re.sub(r"/\*.*?\*/", lambda m: re.sub(r"[^\n]", " ", m.group()), text, flags=re.S)
        self.text[path] = text
        listed = LAYERS.search(text) if path.endswith(".h") else None
        if listed:
            lines = [line[5:].split("    ")[0].split() for line in listed.group(1).splitlines()]
            self.layers[os.path.dirname(path)] = {n: i for i, names in enumerate(lines) for n in names}
        self.files[path] = [(text.count("\n", 0, m.start()) + 1, m.group(1) or m.group(2),
                             m.group(2) is not None) for m in INCLUDE.finditer(text)]

    def resolve(self, path, name):
        """The project file that `name` in quotes means, or None. Shaders also know shaders/ as
        their root, users of the library client/include/."""
        roots = [""]
        if path.endswith(SHADERS) or path.startswith("shaders/"):
            roots.append("shaders/")
        if path.startswith("client/"):
            roots.append("client/include/")
        for prefix in roots:
            if os.path.normpath(prefix + name) == prefix + name and prefix + name in self.files:
                return prefix + name
        return None

    def reaches_vulkan(self, path, seen):
        seen.add(path)
        for _, name, quoted in self.files[path]:
            if not quoted and VULKAN.match(name):
                return True
            target = quoted and self.resolve(path, name)
            if target and target not in seen and self.reaches_vulkan(target, seen):
                return True
        return False


def stem(path):
    return os.path.splitext(os.path.basename(path))[0]


def check_target(path, target):
    """The rule that an include of one project file by another breaks, or None."""
    room, other = room_of(path), room_of(target)
    if room is None or other is None:
        return "floor"
    if room == "renderer/passes" and other == room:
        # pass.h is what all passes have in common; it belongs to none.
        return None if stem(target) in (stem(path), "pass") else "pass"
    if room == "shaders/passes" and other == room:
        return "pass"
    if room == other:
        return None
    if room in APART:
        if other in ("base", "protocol") or other in APART[room]:
            return None
        inside = "renderer" in APART[room] and other.startswith("renderer/")
        return None if inside and FLOORS[other] < FLOORS[room] else "apart"
    if room in HILL and other in HILL:
        return None if HILL[other] < HILL[room] else "down"
    return None if FLOORS[other] < FLOORS[room] else "floor"


def check_border(path, target):
    """Do all folders that the include enters offer the header?"""
    return all(os.path.relpath(target, folder) in headers for folder, headers in BORDERS.items()
               if target.startswith(folder + "/") and not path.startswith(folder + "/"))


def check_layer(layers, path, target):
    """Does an include within a room with layers go to a lower one, or to the file's own header?"""
    if stem(target) == stem(path):
        return True
    return layers.get(stem(target), len(layers)) < layers.get(stem(path), -1)


def check_home(tree, path):
    """The lines of functions that a .c file exports without declaring them in its own header."""
    header = tree.text.get(os.path.splitext(path)[0] + ".h", "")
    header += "".join(t for p, t in tree.text.items() if p.startswith("client/include/"))
    text = tree.text[path]
    return [(text.count("\n", 0, m.start()) + 1, m.group(1)) for m in FUNCTION.finditer(text)
            if m.group(1) != "main" and not re.search(r"\b%s\(" % m.group(1), header)]


def check_system(path, name):
    if VULKAN.match(name) and not path.startswith("renderer/"):
        return "vulkan"
    if SOCKET.match(name) and not path.startswith(("server/", "client/")):
        return "socket"
    return None


def check_quoted(tree, path, name):
    target = tree.resolve(path, name)
    if target is None:
        return "root"
    rule = check_target(path, target)
    if rule is None and not check_border(path, target):
        rule = "border"
    room = os.path.dirname(path)
    if rule is None and room in tree.layers and os.path.dirname(target) == room and \
            not check_layer(tree.layers[room], path, target):
        return "layer"
    if rule is None and path.startswith(("server/", "client/")) and \
            not target.startswith(("server/", "client/")) and tree.reaches_vulkan(target, set()):
        return "vulkan"
    return rule


def check(root):
    """All findings as (path, line, rule, include)."""
    tree, found = Tree(root), []
    for path in sorted(tree.files):
        if path.endswith((".cpp", ".cc", ".cxx", ".hpp")) and path not in CPP_FILES:
            found.append((path, 1, "c++", path))
        if os.path.dirname(path) in tree.layers:
            if stem(path) not in tree.layers[os.path.dirname(path)]:
                found.append((path, 1, "layer", "is in no layer"))
            if path.endswith(".c"):
                found += [(path, line, "home", name) for line, name in check_home(tree, path)]
        for line, name, quoted in tree.files[path]:
            rule = check_quoted(tree, path, name) if quoted else check_system(path, name)
            if rule:
                found.append((path, line, rule, name))
    return tree, found


def self_check(fixtures):
    failures = []
    tree, found = check(os.path.join(fixtures, "good"))
    if len(tree.files) < 8:
        failures.append("good: only %d files were read" % len(tree.files))
    failures += ["good: %s:%d: %s wrongly caught" % f[:3] for f in found]
    tree, found = check(os.path.join(fixtures, "bad"))
    rules = set()
    for path in sorted(tree.files):
        with open(os.path.join(tree.root, path), encoding="utf-8") as f:
            want = sorted(CAUGHT.findall(f.read()))
        got = sorted(rule for p, _, rule, _ in found if p == path)
        rules.update(want)
        if want != got:
            failures.append("bad: %s: want %s, caught %s" % (path, want, got))
    for rule in re.findall(r"^    ([a-z+]+)  +\S", __doc__.split("printed")[1], re.M):
        if rule not in rules:
            failures.append("no fixture breaks the rule '%s'" % rule)
    return failures


def main(args):
    if len(args) == 2 and args[0] == "--self-check":
        failures = self_check(args[1])
    elif len(args) == 1:
        tree, found = check(args[0])
        failures = ["%s:%d: %s: %s" % (p, l, rule, name) for p, l, rule, name in found]
        if not tree.files:
            failures.append("%s: no sources were found" % args[0])
        print("%d files read" % len(tree.files))
    else:
        print(__doc__, file=sys.stderr)
        return 2
    for failure in failures:
        print(failure, file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
