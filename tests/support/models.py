#!/usr/bin/env python3
"""Makes the scenes, textures and models that tests use in place of other people's.

usage: models.py FOLDER

  knot/knot.gltf    a torus knot of 4224 triangles with a texture of 512 x 512 and a camera; its files
                    knot.bin and knot.png lie beside it
  worm.glb          a tube on a skin of 12 joints, animated over 2 s
  panes.glb         plates of every alpha mode and a pane of glass over a floor, instances, lines,
                    points, a lamp and a spotlight
  gallery/gallery.gltf  five half transparent plates behind each other, each with five textures of
                    512 x 512: more pages than a small budget holds
  startup.glb       a cube, a point lamp of 54351 cd and a camera: the startup scene of Blender as its
                    exporter writes it, without an environment
  leaves.glb        a street with 200 leaf cards whose alpha is blended, one behind the other
  leaves_opaque.glb the same, opaque
  morph.glb         a plate with two morph targets, animated over 2 s
  statue.ply.gz     a closed, bumpy surface of 204,800 triangles, 0.2 m high
  heights.png       16-bit heights of 1201 x 1201 samples
  large.png         a picture of 8192 x 4096, noise that changes every 8 rows
  room.hdr          a bright window and a dim room, equirectangular, 1024 x 512

The same bytes on every run of one machine. The functions serve other scripts as well.
"""
import gzip
import json
import math
import os
import random
import struct
import sys
import zlib

ARRAY_BUFFER, ELEMENT_ARRAY_BUFFER = 34962, 34963
UNSIGNED_BYTE, UNSIGNED_SHORT, UNSIGNED_INT, FLOAT = 5121, 5123, 5125, 5126


def write(path, data):
    os.makedirs(os.path.dirname(path) or ".", exist_ok=True)
    with open(path, "wb") as file:
        file.write(data)


def png(width, height, channels, bits, rows, level=6):
    """A PNG of rows of bytes; channels 1, 3 or 4."""
    def chunk(kind, data):
        crc = zlib.crc32(kind + data)
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", crc)
    head = struct.pack(">IIBBBBB", width, height, bits, {1: 0, 3: 2, 4: 6}[channels], 0, 0, 0)
    body = zlib.compress(b"".join(b"\0" + row for row in rows), level)
    return (b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", body) + chunk(b"IEND", b""))


class Gltf:
    """A glTF in the making: arrays go to one buffer."""

    def __init__(self):
        self.data = bytearray()
        self.json = {"asset": {"version": "2.0"}, "scene": 0, "bufferViews": [], "accessors": []}

    def array(self, kind, component, rows, target=None, bounds=False):
        """The accessor of a list of tuples."""
        flat = [value for row in rows for value in row]
        code = {UNSIGNED_BYTE: "B", UNSIGNED_SHORT: "H", UNSIGNED_INT: "I", FLOAT: "f"}[component]
        self.data += bytes(-len(self.data) % 4)
        view = {"buffer": 0, "byteOffset": len(self.data)}
        self.data += struct.pack("<%d%s" % (len(flat), code), *flat)
        view["byteLength"] = len(self.data) - view["byteOffset"]
        if target:
            view["target"] = target
        accessor = {"bufferView": len(self.json["bufferViews"]), "componentType": component,
                    "count": len(rows), "type": kind}
        if bounds:
            single = [struct.unpack("<%df" % len(r), struct.pack("<%df" % len(r), *r)) for r in rows]
            accessor["min"] = [min(column) for column in zip(*single)]
            accessor["max"] = [max(column) for column in zip(*single)]
        self.json["bufferViews"].append(view)
        self.json["accessors"].append(accessor)
        return len(self.json["accessors"]) - 1

    def attribute(self, kind, rows, component=FLOAT, bounds=False):
        return self.array(kind, component, rows, ARRAY_BUFFER, bounds)

    def indices(self, triangles):
        flat = [(i,) for triangle in triangles for i in triangle]
        return self.array("SCALAR", UNSIGNED_SHORT, flat, ELEMENT_ARRAY_BUFFER)

    def image(self, data):
        """The texture of a PNG inside the file."""
        self.data += bytes(-len(self.data) % 4)
        self.json["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.data), "byteLength": len(data)})
        self.data += data
        source = {"bufferView": len(self.json["bufferViews"]) - 1, "mimeType": "image/png"}
        self.json.setdefault("images", []).append(source)
        self.json.setdefault("textures", []).append({"source": len(self.json["images"]) - 1})
        return {"index": len(self.json["textures"]) - 1}

    def write_gltf(self, folder, name):
        self.json["buffers"] = [{"uri": name + ".bin", "byteLength": len(self.data)}]
        write(os.path.join(folder, name + ".bin"), self.data)
        write(os.path.join(folder, name + ".gltf"), json.dumps(self.json, indent=1).encode())

    def write_glb(self, path):
        self.data += bytes(-len(self.data) % 4)
        self.json["buffers"] = [{"byteLength": len(self.data)}]
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        size = 12 + 8 + len(text) + 8 + len(self.data)
        write(path, struct.pack("<4sII", b"glTF", 2, size) + struct.pack("<I4s", len(text), b"JSON") +
              text + struct.pack("<I4s", len(self.data), b"BIN\0") + bytes(self.data))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def normalize(v):
    length = math.sqrt(sum(x * x for x in v)) or 1
    return tuple(x / length for x in v)


def grid_triangles(columns, rows):
    """Of a grid of (columns + 1) x (rows + 1) vertices, row by row; front faces look at +v x +u."""
    triangles = []
    for j in range(rows):
        for i in range(columns):
            a = j * (columns + 1) + i
            b = a + columns + 1
            triangles += [(a, a + 1, b), (b, a + 1, b + 1)]
    return triangles


def sweep(center, radius, columns, rows):
    """Positions, normals and texture coordinates of a tube around the curve center(t), t in 0..1."""
    positions, normals, uvs = [], [], []
    for j in range(rows + 1):
        t = j / rows
        c = center(t)
        ahead = normalize(tuple(b - a for a, b in zip(center(t - 1e-4), center(t + 1e-4))))
        side = normalize(cross(ahead, (0.31, 0.17, 0.93)))
        up = cross(side, ahead)
        for i in range(columns + 1):
            angle = 2 * math.pi * i / columns
            n = tuple(math.cos(angle) * s + math.sin(angle) * u for s, u in zip(side, up))
            positions.append(tuple(p + radius(t) * k for p, k in zip(c, n)))
            normals.append(n)
            uvs.append((4 * t, i / columns))
    return positions, normals, uvs


def checks(size, seed):
    """Rows of RGB: a checkerboard of 16 cells with grain, so that every texel counts."""
    grain, rows = random.Random(seed), []
    for y in range(size):
        row, noise = bytearray(), grain.randbytes(size * 3)
        for x in range(size):
            base = (205, 170, 60) if (x * 16 // size + y * 16 // size) % 2 else (60, 95, 150)
            row += bytes(base[c] + noise[x * 3 + c] % 40 for c in range(3))
        rows.append(bytes(row))
    return rows


def knot_point(t):
    angle = 2 * math.pi * t
    r = 0.55 + 0.2 * math.cos(3 * angle)
    return (r * math.cos(2 * angle), 0.8 + r * math.sin(2 * angle), 0.2 * math.sin(3 * angle))


def make_knot(folder):
    gltf = Gltf()
    positions, normals, uvs = sweep(knot_point, lambda t: 0.13, 16, 132)
    attributes = {"POSITION": gltf.attribute("VEC3", positions, bounds=True),
                  "NORMAL": gltf.attribute("VEC3", normals), "TEXCOORD_0": gltf.attribute("VEC2", uvs)}
    indices = gltf.indices(grid_triangles(16, 132))
    gltf.json.update({
        "scenes": [{"nodes": [0]}],
        "nodes": [{"name": "root", "children": [1, 2]},
                  {"name": "eye", "camera": 0, "translation": [0.3, 1.2, 2.6],
                   "rotation": [-0.0767, 0.0572, 0.0044, 0.9954]},
                  {"name": "knot", "mesh": 0}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.01, "zfar": 100}}],
        "meshes": [{"name": "knot", "primitives": [
            {"attributes": attributes, "indices": indices, "material": 0}]}],
        "materials": [{"name": "checks", "pbrMetallicRoughness": {
            "baseColorTexture": {"index": 0}, "metallicFactor": 0, "roughnessFactor": 0.4}}],
        "textures": [{"source": 0}], "images": [{"uri": "knot.png"}]})
    gltf.write_gltf(folder, "knot")
    write(os.path.join(folder, "knot.png"), png(512, 512, 3, 8, checks(512, 1)))


def turn_z(angle):
    return (0, 0, math.sin(angle / 2), math.cos(angle / 2))


def make_worm(path):
    joints, bone, columns, rows = 12, 0.25, 24, 96
    gltf = Gltf()
    positions, normals, uvs = sweep(
        lambda t: (0, joints * bone * t, 0), lambda t: 0.22 - 0.12 * t, columns, rows)
    influences, weights = [], []
    for p in positions:
        at = min(max(p[1] / bone - 0.5, 0), joints - 1)
        first = min(int(at), joints - 2)
        influences.append((first, first + 1, 0, 0))
        weights.append((1 - (at - first), at - first, 0, 0))
    attributes = {"POSITION": gltf.attribute("VEC3", positions, bounds=True),
                  "NORMAL": gltf.attribute("VEC3", normals), "TEXCOORD_0": gltf.attribute("VEC2", uvs),
                  "JOINTS_0": gltf.attribute("VEC4", influences, UNSIGNED_BYTE),
                  "WEIGHTS_0": gltf.attribute("VEC4", weights)}
    indices = gltf.indices(grid_triangles(columns, rows))
    binds = gltf.array("MAT4", FLOAT, [
        (1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, -bone * k, 0, 1) for k in range(joints)])
    times = [0.1 * k for k in range(21)]
    clock = gltf.array("SCALAR", FLOAT, [(t,) for t in times], bounds=True)
    samplers, channels = [], []
    for k in range(joints):
        turns = [turn_z(0.22 * math.sin(math.pi * t + 0.7 * k)) for t in times]
        channels.append({"sampler": k, "target": {"node": 1 + k, "path": "rotation"}})
        samplers.append({"input": clock, "output": gltf.array("VEC4", FLOAT, turns)})
    nodes = [{"name": "worm", "mesh": 0, "skin": 0}]
    for k in range(joints):
        node = {"name": "joint %d" % k, "translation": [0, bone if k else 0, 0]}
        if k + 1 < joints:
            node["children"] = [2 + k]
        nodes.append(node)
    gltf.json.update({
        "scenes": [{"nodes": [0, 1]}], "nodes": nodes,
        "meshes": [{"name": "worm", "primitives": [
            {"attributes": attributes, "indices": indices, "material": 0}]}],
        "materials": [{"name": "skin", "pbrMetallicRoughness": {
            "baseColorFactor": [0.7, 0.35, 0.25, 1], "metallicFactor": 0, "roughnessFactor": 0.5}}],
        "skins": [{"joints": list(range(1, joints + 1)), "inverseBindMatrices": binds, "skeleton": 1}],
        "animations": [{"name": "wave", "channels": channels, "samplers": samplers}]})
    gltf.write_glb(path)


def make_morph(path):
    n, gltf = 24, Gltf()
    flat = [(i / n - 0.5, j / n - 0.5, 0) for j in range(n + 1) for i in range(n + 1)]
    bulge = [(0, 0, 0.4 * math.cos(math.pi * x) * math.cos(math.pi * y)) for x, y, _ in flat]
    bent = [(0.2 * y * y, 0.1 * x, 0.3 * x * x) for x, y, _ in flat]
    # d z / d x and d z / d y of the bulge turn the normal.
    turned = [(0.4 * math.pi * math.sin(math.pi * x) * math.cos(math.pi * y),
               0.4 * math.pi * math.cos(math.pi * x) * math.sin(math.pi * y), 0) for x, y, _ in flat]
    still = [(0, 0, 0)] * len(flat)
    attributes = {"POSITION": gltf.attribute("VEC3", flat, bounds=True),
                  "NORMAL": gltf.attribute("VEC3", [(0, 0, 1)] * len(flat))}
    targets = [{"POSITION": gltf.attribute("VEC3", move, bounds=True),
                "NORMAL": gltf.attribute("VEC3", turn)} for move, turn in ((bulge, turned), (bent, still))]
    indices = gltf.indices(grid_triangles(n, n))
    times = [0, 0.5, 1, 1.5, 2]
    clock = gltf.array("SCALAR", FLOAT, [(t,) for t in times], bounds=True)
    amounts = gltf.array("SCALAR", FLOAT, [(w,) for t in times for w in (t / 2, 1 - abs(t - 1))])
    gltf.json.update({
        "scenes": [{"nodes": [0]}], "nodes": [{"name": "plate", "mesh": 0}],
        "meshes": [{"name": "plate", "weights": [0, 0], "primitives": [
            {"attributes": attributes, "indices": indices, "targets": targets, "material": 0}]}],
        "materials": [{"doubleSided": True, "pbrMetallicRoughness": {
            "baseColorFactor": [0.3, 0.5, 0.7, 1], "metallicFactor": 0, "roughnessFactor": 0.6}}],
        "animations": [{"channels": [{"sampler": 0, "target": {"node": 0, "path": "weights"}}],
                        "samplers": [{"input": clock, "output": amounts}]}]})
    gltf.write_glb(path)


def plate(gltf, material, cells=4):
    """A mesh: a square of 1 m in the plane z = 0."""
    grid = [(i / cells, j / cells) for j in range(cells + 1) for i in range(cells + 1)]
    attributes = {
        "POSITION": gltf.attribute("VEC3", [(u - 0.5, v - 0.5, 0) for u, v in grid], bounds=True),
        "NORMAL": gltf.attribute("VEC3", [(0, 0, 1)] * len(grid)),
        "TEXCOORD_0": gltf.attribute("VEC2", [(u, 1 - v) for u, v in grid])}
    return {"primitives": [{"attributes": attributes, "material": material,
                            "indices": gltf.indices(grid_triangles(cells, cells))}]}


def wires(gltf, material):
    """A mesh: a spiral of lines and one of points."""
    curve = [(0.3 * math.cos(k / 3), k / 60, 0.3 * math.sin(k / 3)) for k in range(60)]
    return {"primitives": [
        {"mode": 3, "material": material,
         "attributes": {"POSITION": gltf.attribute("VEC3", curve, bounds=True)}},
        {"mode": 0, "material": material, "attributes": {"POSITION": gltf.attribute(
            "VEC3", [(z, y, x) for x, y, z in curve], bounds=True)}}]}


def discs(size):
    """Rows of RGBA: discs whose alpha falls to the rim, none between them."""
    rows = []
    for y in range(size):
        row = bytearray()
        for x in range(size):
            u, v = x * 4 % size / size - 0.5, y * 4 % size / size - 0.5
            row += bytes((230, 90 + 120 * x // size, 40, min(255, int(255 * (1.3 - 3 * math.hypot(u, v)))))
                         if math.hypot(u, v) < 0.43 else (230, 90, 40, 0))
        rows.append(bytes(row))
    return rows


def make_panes(path):
    gltf = Gltf()
    texture = gltf.image(png(64, 64, 4, 8, discs(64)))

    def material(color, **more):
        pbr = {"baseColorFactor": color, "metallicFactor": 0, "roughnessFactor": 0.4}
        if more.pop("textured", False):
            pbr["baseColorTexture"] = texture
        return dict({"pbrMetallicRoughness": pbr}, **more)
    materials = [
        material([0.6, 0.6, 0.6, 1]),
        material([0.9, 0.2, 0.2, 0.5], alphaMode="BLEND", doubleSided=True),
        material([0.2, 0.3, 0.9, 0.6], alphaMode="BLEND"),
        material([1, 1, 1, 1], alphaMode="BLEND", textured=True),
        material([1, 1, 1, 1], alphaMode="MASK", alphaCutoff=0.4, doubleSided=True, textured=True),
        material([0.9, 1, 0.9, 1], extensions={
            "KHR_materials_transmission": {"transmissionFactor": 0.9},
            "KHR_materials_ior": {"ior": 1.3}})]
    meshes = [plate(gltf, m) for m in range(len(materials))] + [wires(gltf, 0)]
    spots = gltf.array("VEC3", FLOAT, [(0.5 * k, 0, -0.1 * k) for k in range(3)])
    upright = {"EXT_mesh_gpu_instancing": {"attributes": {"TRANSLATION": spots}}}
    half = math.sqrt(0.5)
    nodes = [{"mesh": 0, "scale": [4, 4, 1], "rotation": [-half, 0, 0, half]},
             {"mesh": 1, "translation": [-0.6, 0.6, 0.3]},
             {"mesh": 2, "translation": [-0.4, 0.7, 0.6]},
             {"mesh": 3, "translation": [-0.2, 0.5, 0.9], "rotation": [0, 0.17, 0, 0.985]},
             {"mesh": 4, "translation": [0.4, 0.55, 0], "extensions": upright},
             {"mesh": 5, "translation": [0.7, 0.6, 0.8]},
             {"mesh": 6, "translation": [1.4, 0, -0.5]},
             {"translation": [0.2, 1.6, 1], "extensions": {"KHR_lights_punctual": {"light": 0}}},
             {"translation": [-1, 2, 1.5], "rotation": [-0.4, -0.3, 0, 0.866],
              "extensions": {"KHR_lights_punctual": {"light": 1}}}]
    lights = [{"type": "point", "intensity": 20, "color": [1, 0.8, 0.6]},
              {"type": "spot", "intensity": 60, "spot": {"outerConeAngle": 0.6}}]
    gltf.json.update({
        "scenes": [{"nodes": list(range(len(nodes)))}], "nodes": nodes, "meshes": meshes,
        "materials": materials, "extensions": {"KHR_lights_punctual": {"lights": lights}},
        "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_transmission", "KHR_materials_ior",
                           "EXT_mesh_gpu_instancing"]})
    gltf.write_glb(path)


def cube(gltf, material, half=1.0):
    """A mesh: a cube around the origin with flat faces."""
    positions, normals, triangles = [], [], []
    for axis in range(3):
        for sign in (-1, 1):
            normal = tuple(sign if i == axis else 0 for i in range(3))
            u = tuple(1 if i == (axis + 1) % 3 else 0 for i in range(3))
            v = cross(normal, u)
            first = len(positions)
            for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                positions.append(tuple(half * (n + a * p + b * q) for n, p, q in zip(normal, u, v)))
                normals.append(normal)
            triangles += [(first, first + 1, first + 2), (first, first + 2, first + 3)]
    attributes = {"POSITION": gltf.attribute("VEC3", positions, bounds=True),
                  "NORMAL": gltf.attribute("VEC3", normals)}
    return {"primitives": [{"attributes": attributes, "material": material,
                            "indices": gltf.indices(triangles)}]}


def make_startup(path):
    gltf = Gltf()
    yaw, pitch = math.radians(46.6919) / 2, math.radians(63.5593 - 90) / 2
    look = [math.cos(yaw) * math.sin(pitch), math.sin(yaw) * math.cos(pitch),
            -math.sin(yaw) * math.sin(pitch), math.cos(yaw) * math.cos(pitch)]
    gltf.json.update({
        "scenes": [{"nodes": [0, 1, 2]}], "meshes": [cube(gltf, 0)],
        "nodes": [{"name": "Cube", "mesh": 0},
                  {"name": "Light", "translation": [4.076245, 5.903862, -1.005454],
                   "extensions": {"KHR_lights_punctual": {"light": 0}}},
                  {"name": "Camera", "translation": [7.358891, 4.958309, 6.925791], "rotation": look,
                   "camera": 0}],
        "materials": [{"name": "Material", "doubleSided": True, "pbrMetallicRoughness": {
            "baseColorFactor": [0.8, 0.8, 0.8, 1], "metallicFactor": 0, "roughnessFactor": 0.5}}],
        "cameras": [{"type": "perspective", "perspective": {
            "aspectRatio": 16 / 9, "yfov": 0.3995965, "znear": 0.1, "zfar": 100}}],
        # 1000 W as KHR_lights_punctual has them: 683 lm/W, in all directions.
        "extensions": {"KHR_lights_punctual": {"lights": [
            {"name": "Light", "type": "point", "color": [1, 1, 1], "intensity": 54351.41}]}},
        "extensionsUsed": ["KHR_lights_punctual"]})
    gltf.write_glb(path)


def lathe(profile, steps=24):
    """Corners and triangles of what a closed profile of (radius, z) sweeps about the z axis."""
    corners, triangles, count = [], [], len(profile)
    for i in range(steps):
        angle = 2 * math.pi * i / steps
        corners += [(r * math.cos(angle), r * math.sin(angle), z) for r, z in profile]
    for i in range(steps):
        for k in range(count):
            a, b = i * count + k, i * count + (k + 1) % count
            c, d = ((i + 1) % steps) * count + k, ((i + 1) % steps) * count + (k + 1) % count
            triangles += [(a, c, b), (b, c, d)]
    return corners, triangles


def make_bearing(path):
    """A part of closed solids: a housing with a cavity, a shaft with a core inside of it, rings and balls."""
    gltf = Gltf()
    balls = [(0.1 * math.sin(math.pi * i / 8), 0.1 * math.cos(math.pi * i / 8)) for i in range(8, -1, -1)]
    solids = [
        ("housing", (0.35, 0.4, 0.45), [(0.25, -1), (1, -1), (1, 1), (0.25, 1), (0.25, 0.85),
                                        (0.85, 0.85), (0.85, -0.85), (0.25, -0.85)]),
        ("shaft", (0.7, 0.7, 0.72), [(0, -1.4), (0.2, -1.4), (0.2, 1.4), (0, 1.4)]),
        ("core", (0.8, 0.45, 0.2), [(0, -1.2), (0.1, -1.2), (0.1, 1.2), (0, 1.2)]),
        ("inner ring", (0.2, 0.5, 0.8), [(0.2, -0.2), (0.4, -0.2), (0.4, 0.2), (0.2, 0.2)]),
        ("outer ring", (0.2, 0.6, 0.3), [(0.6, -0.2), (0.85, -0.2), (0.85, 0.2), (0.6, 0.2)]),
        ("ball", (0.85, 0.75, 0.2), balls)]
    meshes, materials = [], []
    for name, color, profile in solids:
        corners, triangles = lathe(profile)
        flat = [corners[i] for triangle in triangles for i in triangle]
        meshes.append({"name": name, "primitives": [{"material": len(materials), "attributes": {
            "POSITION": gltf.attribute("VEC3", flat, bounds=True)}}]})
        materials.append({"name": name, "pbrMetallicRoughness": {
            "baseColorFactor": [*color, 1], "metallicFactor": 0, "roughnessFactor": 0.5}})
    nodes = [{"name": solids[i][0], "mesh": i} for i in range(5)]
    nodes += [{"name": "ball %d" % k, "mesh": 5, "translation": [
        0.5 * math.cos(k * math.pi / 4), 0.5 * math.sin(k * math.pi / 4), 0]} for k in range(8)]
    nodes.append({"name": "bearing", "children": list(range(3, 13))})
    gltf.json.update({"scenes": [{"nodes": [0, 1, 2, 13]}], "nodes": nodes, "meshes": meshes,
                      "materials": materials})
    gltf.write_glb(path)


def foliage(size):
    """Rows of RGBA: leaves on a twig with soft rims, nothing between them."""
    grain = random.Random(6)
    leaves = []
    for k in range(14):
        radius = 0.36 * math.sqrt(k / 14)
        leaves.append((0.5 + radius * math.cos(k * 2.4), 0.5 + radius * math.sin(k * 2.4),
                       grain.uniform(0, math.pi), grain.uniform(0.7, 1)))
    rows = []
    for y in range(size):
        row = bytearray()
        for x in range(size):
            u, v, color, best = (x + 0.5) / size, (y + 0.5) / size, (70, 120, 40), 0.0
            for cx, cy, turn, shade in leaves:
                along = (u - cx) * math.cos(turn) + (v - cy) * math.sin(turn)
                across = (v - cy) * math.cos(turn) - (u - cx) * math.sin(turn)
                inside = min(1.0, max(0.0, 6 * (1 - (along / 0.14) ** 2 - (across / 0.07) ** 2)))
                if inside > best:
                    vein = 20 if abs(across) < 0.004 else 0
                    best, color = inside, (int(90 * shade) + vein, int(160 * shade) + vein, int(50 * shade))
            row += bytes(color + (int(255 * best),))
        rows.append(bytes(row))
    return rows


def make_leaves(path, alpha_mode, count=200):
    """A street between two rows of houses, under leaf cards along it that hide each other."""
    gltf, grain = Gltf(), random.Random(5)
    leaf = gltf.image(png(256, 256, 4, 8, foliage(256)))
    paint = gltf.image(png(128, 128, 3, 8, checks(128, 9)))

    def material(texture, **more):
        return dict({"pbrMetallicRoughness": {
            "baseColorTexture": texture, "metallicFactor": 0, "roughnessFactor": 0.7}}, **more)
    materials = [material(paint), material(leaf, alphaMode=alpha_mode, doubleSided=True)]
    half = math.sqrt(0.5)
    nodes = [{"mesh": 0, "scale": [8, 60, 1], "translation": [0, 0, -20], "rotation": [-half, 0, 0, half]},
             {"mesh": 0, "scale": [60, 7, 1], "translation": [-4, 3.5, -20], "rotation": [0, half, 0, half]},
             {"mesh": 0, "scale": [60, 7, 1], "translation": [4, 3.5, -20], "rotation": [0, -half, 0, half]}]
    for k in range(count):
        turn, lean = grain.uniform(-0.5, 0.5), grain.uniform(-0.3, 0.3)
        side = -1 if k % 2 else 1
        nodes.append({"mesh": 1, "scale": [3.2, 3.2, 1],
                      "translation": [side * grain.uniform(0.2, 2.4), grain.uniform(1.2, 3.6), 4 - 40 * k / count],
                      "rotation": [math.sin(lean / 2) * math.cos(turn / 2), math.cos(lean / 2) * math.sin(turn / 2),
                                   -math.sin(lean / 2) * math.sin(turn / 2), math.cos(lean / 2) * math.cos(turn / 2)]})
    nodes += [{"rotation": [-0.48, -0.24, 0, math.sqrt(1 - 0.48 ** 2 - 0.24 ** 2)], "extensions": {"KHR_lights_punctual": {"light": 0}}},
              {"translation": [0, 1.7, 9], "camera": 0}]
    gltf.json.update({
        "scenes": [{"nodes": list(range(len(nodes)))}], "nodes": nodes,
        "meshes": [plate(gltf, 0), plate(gltf, 1, 1)], "materials": materials,
        "cameras": [{"type": "perspective", "perspective": {
            "yfov": 0.9, "aspectRatio": 16 / 9, "znear": 0.1}}],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "directional", "intensity": 3}]}},
        "extensionsUsed": ["KHR_lights_punctual"]})
    gltf.write_glb(path)


def make_gallery(folder):
    gltf, grain = Gltf(), random.Random(4)
    materials, images = [], []

    def texture(channels, level):
        name = "%02d.png" % len(images)
        rows = [bytes(grain.randbytes(512 * channels)) for _ in range(512)]
        write(os.path.join(folder, name), png(512, 512, channels, 8, rows, level))
        images.append({"uri": name})
        return {"index": len(images) - 1}
    for _ in range(5):
        materials.append({
            "alphaMode": "BLEND", "doubleSided": True, "normalTexture": texture(3, 0),
            "occlusionTexture": texture(3, 0), "emissiveTexture": texture(3, 0),
            "emissiveFactor": [0.2, 0.2, 0.2],
            "pbrMetallicRoughness": {"baseColorTexture": texture(4, 0),
                                     "metallicRoughnessTexture": texture(3, 0)}})
    gltf.json.update({
        "scenes": [{"nodes": list(range(5))}], "materials": materials, "images": images,
        "textures": [{"source": i} for i in range(len(images))],
        "meshes": [plate(gltf, m) for m in range(5)],
        "nodes": [{"mesh": m, "scale": [2, 1.2, 1], "translation": [0, 0, -0.05 * m]}
                  for m in range(5)]})
    gltf.write_gltf(folder, "gallery")


def make_statue(path):
    """A sphere with waves of four sizes; latitudes meet in two poles, so the surface is closed."""
    columns, rows = 320, 321
    vertices = [(0.0, 0.1, 0.0)]
    for j in range(1, rows):
        theta = math.pi * j / rows
        for i in range(columns):
            phi = 2 * math.pi * i / columns
            r = 0.07 * (1 + 0.22 * math.sin(3 * theta) ** 2 * math.cos(2 * phi) +
                        0.06 * math.sin(8 * theta) * math.sin(theta) * math.cos(7 * phi) +
                        0.02 * math.sin(24 * theta) * math.sin(theta) ** 2 * math.cos(23 * phi) +
                        0.006 * math.sin(70 * theta) * math.sin(theta) ** 2 * math.cos(61 * phi))
            s = math.sin(theta)
            vertices.append((r * s * math.cos(phi), 1.4 * r * math.cos(theta), r * s * math.sin(phi)))
    vertices.append((0.0, -0.1, 0.0))
    faces, last = [], len(vertices) - 1
    for i in range(columns):
        k = (i + 1) % columns
        faces.append((0, 1 + k, 1 + i))
        faces.append((last, last - columns + i, last - columns + k))
        for j in range(rows - 2):
            a, b = 1 + j * columns, 1 + (j + 1) * columns
            faces += [(a + i, a + k, b + i), (b + i, a + k, b + k)]
    head = ("ply\nformat binary_little_endian 1.0\nelement vertex %d\nproperty float x\n"
            "property float y\nproperty float z\nelement face %d\n"
            "property list uchar int vertex_indices\nend_header\n" % (len(vertices), len(faces)))
    data = head.encode() + b"".join(struct.pack("<3f", *v) for v in vertices)
    data += b"".join(struct.pack("<B3i", 3, *f) for f in faces)
    write(path, gzip.compress(data, 1, mtime=0))


def make_heights(path):
    n, rows = 1201, []
    columns = [(math.sin(0.011 * x), math.sin(0.047 * x + 1), math.sin(0.31 * x)) for x in range(n)]
    for y in range(n):
        a, b, c = math.cos(0.013 * y), math.cos(0.053 * y + 2), math.cos(0.29 * y)
        row = [int(2000 + 900 * p * a + 260 * q * b + 22 * r * c) for p, q, r in columns]
        rows.append(struct.pack(">%dH" % n, *row))
    write(path, png(n, n, 1, 16, rows, 1))


def make_large(path):
    grain = random.Random(2)
    rows = [row for _ in range(512) for row in [grain.randbytes(8192 * 3)] * 8]
    write(path, png(8192, 4096, 3, 8, rows, 1))


def rgbe(color):
    top = max(color)
    if top < 1e-32:
        return b"\0\0\0\0"
    mantissa, exponent = math.frexp(top)
    scale = mantissa * 256 / top
    return bytes(int(c * scale) for c in color) + bytes([exponent + 128])


def make_room(path):
    width, height, body = 1024, 512, bytearray()
    grain = random.Random(3)
    for y in range(height):
        up, noise = 1 - 2 * (y + 0.5) / height, grain.randbytes(width)
        for x in range(width):
            window = 660 <= x < 780 and 120 <= y < 220
            wall = 0.25 + 0.1 * math.sin(2 * math.pi * x / width) + noise[x] / 2560
            body += rgbe((9, 8.5, 8) if window else (wall, wall * (0.9 + 0.1 * up), wall * (0.8 + 0.2 * up)))
    write(path, b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 512 +X 1024\n" + bytes(body))


def main():
    folder = sys.argv[1]
    make_knot(os.path.join(folder, "knot"))
    make_worm(os.path.join(folder, "worm.glb"))
    make_gallery(os.path.join(folder, "gallery"))
    make_panes(os.path.join(folder, "panes.glb"))
    make_startup(os.path.join(folder, "startup.glb"))
    make_bearing(os.path.join(folder, "bearing.glb"))
    make_leaves(os.path.join(folder, "leaves.glb"), "BLEND")
    make_leaves(os.path.join(folder, "leaves_opaque.glb"), "OPAQUE")
    make_morph(os.path.join(folder, "morph.glb"))
    make_statue(os.path.join(folder, "statue.ply.gz"))
    make_heights(os.path.join(folder, "heights.png"))
    make_large(os.path.join(folder, "large.png"))
    make_room(os.path.join(folder, "room.hdr"))


if __name__ == "__main__":
    main()
