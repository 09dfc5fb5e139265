"""Scenes of truth.py that no file holds: a mine of emissive crystals, and Sponza with lamps.

The same bytes on every run.
"""
import json
import math
import os
import random
import shutil
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../support"))
import models

MINE_SEED, CRYSTALS = 200, 200
GALLERY_M, RADIUS_M, CELLS = 14.0, 2.4, (72, 40)  # along the gallery and around it
COLOURS = ((0.15, 0.55, 1.0), (0.1, 1.0, 0.6), (0.9, 0.25, 1.0), (1.0, 0.5, 0.12))
RADIANCE = 2.5
# Along the court and in the arcades to both sides of it, metres; candela, warm as candles.
LAMPS = [(x, 2.4, z) for x in (-9.0, -3.0, 3.0, 9.0) for z in (-4.4, 4.0)] + [(-6.0, 3.2, 0.0), (2.0, 3.2, 0.0)]
CANDELA = 30.0


# --- the mine ------------------------------------------------------------------------------------

def bumps(rng, count=24):
    """A smooth random function of the place in the gallery (along, angle): waves of falling height."""
    waves = [(rng.uniform(0.3, 2.5), rng.randint(0, 6), rng.uniform(0, 2 * math.pi)) for _ in range(count)]

    def height(along, angle):
        return sum(math.cos(k * along + m * angle + phase) / (1 + k * k + 0.5 * m * m)
                   for k, m, phase in waves) * 0.35
    return height


def wall_point(height, along, angle):
    """A point of the wall; the floor is flatter than the rest."""
    low = max(-math.sin(angle), 0.0) ** 2
    radius = RADIUS_M * (1 - 0.45 * low) + height(along, angle) * (1 - 0.5 * low)
    # Both ends are closed.
    end = min(along, GALLERY_M - along) / 1.5
    radius *= math.sqrt(max(1 - max(1 - end, 0.0) ** 2, 0.0)) if end < 1 else 1.0
    return (radius * math.cos(angle), radius * math.sin(angle), -along)


def wall_normal(height, along, angle):
    """Into the gallery."""
    step = 1e-3
    p = [wall_point(height, along + a, angle + b) for a, b in ((step, 0), (-step, 0), (0, step), (0, -step))]
    n = models.cross(tuple(a - b for a, b in zip(p[2], p[3])), tuple(a - b for a, b in zip(p[0], p[1])))
    n = models.normalize(n)
    inwards = -(n[0] * math.cos(angle) + n[1] * math.sin(angle))
    return n if inwards > 0 else tuple(-x for x in n)


def mine_walls(gltf, height):
    positions, normals = [], []
    columns, rows = CELLS[1], CELLS[0]
    for j in range(rows + 1):
        along = 0.01 + (GALLERY_M - 0.02) * j / rows
        for i in range(columns + 1):
            angle = 2 * math.pi * i / columns
            positions.append(wall_point(height, along, angle))
            normals.append(wall_normal(height, along, angle))
    triangles = models.grid_triangles(columns, rows)  # front faces look inwards
    for j in (0, rows):  # what is left of the ends
        middle = len(positions)
        z = positions[j * (columns + 1)][2]
        positions.append((0.0, 0.0, z))
        normals.append((0.0, 0.0, -1.0 if j == 0 else 1.0))
        ring = range(j * (columns + 1), j * (columns + 1) + columns)
        triangles += [(middle, k + 1, k) if j == 0 else (middle, k, k + 1) for k in ring]
    attributes = {"POSITION": gltf.attribute("VEC3", positions, bounds=True),
                  "NORMAL": gltf.attribute("VEC3", normals)}
    return {"primitives": [{"attributes": attributes, "material": 0, "indices": gltf.indices(triangles)}]}


def crystal(gltf, material):
    """A prism of six sides with a pointed end, of length 1 along +Y, with flat faces."""
    positions, normals, triangles = [], [], []
    ring = [(math.cos(math.pi * k / 3), math.sin(math.pi * k / 3)) for k in range(7)]
    for (ax, az), (bx, bz) in zip(ring, ring[1:]):
        for face in (((ax, 0, az), (bx, 0, bz), (bx, 0.7, bz), (ax, 0.7, az)),
                     ((ax, 0.7, az), (bx, 0.7, bz), (0.0, 1.0, 0.0))):
            n = models.cross(tuple(p - q for p, q in zip(face[2], face[0])),
                             tuple(p - q for p, q in zip(face[1], face[0])))
            # The radius of a crystal is a sixth of its length.
            n = models.normalize((n[0], n[1] / 6, n[2]))
            first = len(positions)
            positions += [(x / 6, y, z / 6) for x, y, z in face]
            normals += [n] * len(face)
            triangles += [(first, first + k + 2, first + k + 1) for k in range(len(face) - 2)]
    attributes = {"POSITION": gltf.attribute("VEC3", positions, bounds=True),
                  "NORMAL": gltf.attribute("VEC3", normals)}
    return {"primitives": [{"attributes": attributes, "material": material,
                            "indices": gltf.indices(triangles)}]}


def turn_to(direction):
    """The quaternion that turns +Y to a unit vector."""
    x, y, z = direction
    if y < -0.9999:
        return [1.0, 0.0, 0.0, 0.0]
    w = math.sqrt((1 + y) / 2)
    return [z / (2 * w), 0.0, -x / (2 * w), w]


def crystal_node(rng, height, mesh):
    along, angle = rng.uniform(1.0, GALLERY_M - 1.0), rng.uniform(0, 2 * math.pi)
    n = wall_normal(height, along, angle)
    lean = tuple(a + rng.uniform(-0.5, 0.5) for a in n)
    length = rng.uniform(0.2, 0.8)
    at = tuple(p - 0.05 * k for p, k in zip(wall_point(height, along, angle), n))
    return {"mesh": mesh, "translation": list(at), "rotation": turn_to(models.normalize(lean)),
            "scale": [length, length, length]}


def make_mine(path):
    gltf, rng = models.Gltf(), random.Random(MINE_SEED)
    height = bumps(rng)
    rock = {"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.44, 0.4, 1], "metallicFactor": 0,
                                     "roughnessFactor": 0.9}}
    glow = [{"pbrMetallicRoughness": {"baseColorFactor": [0.2, 0.2, 0.2, 1], "metallicFactor": 0,
                                      "roughnessFactor": 0.3}, "emissiveFactor": list(colour),
             "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": RADIANCE}}}
            for colour in COLOURS]
    meshes = [mine_walls(gltf, height)] + [crystal(gltf, 1 + k) for k in range(len(COLOURS))]
    nodes = [{"mesh": 0}] + [crystal_node(rng, height, 1 + k % len(COLOURS)) for k in range(CRYSTALS)]
    gltf.json.update({"scenes": [{"nodes": list(range(len(nodes)))}], "nodes": nodes, "meshes": meshes,
                      "materials": [rock] + glow, "extensionsUsed": ["KHR_materials_emissive_strength"]})
    gltf.write_glb(path)
    return path


# --- Sponza with lamps ---------------------------------------------------------------------------

def make_night(path, source):
    """The glTF file `source`, whose root is the metre, with LAMPS; its files are copied beside it."""
    os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(source, encoding="utf-8") as file:
        scene = json.load(file)
    for entry in scene["buffers"] + scene["images"]:
        target = os.path.join(os.path.dirname(path), entry["uri"])
        if not os.path.exists(target):
            shutil.copyfile(os.path.join(os.path.dirname(source), entry["uri"]), target)
    scene["extensions"] = {"KHR_lights_punctual": {"lights": [
        {"type": "point", "color": [1, 0.72, 0.42], "intensity": CANDELA}]}}
    scene["extensionsUsed"] = scene.get("extensionsUsed", []) + ["KHR_lights_punctual"]
    for at in LAMPS:
        scene["scenes"][0]["nodes"].append(len(scene["nodes"]))
        scene["nodes"].append({"translation": list(at), "extensions": {"KHR_lights_punctual": {"light": 0}}})
    models.write(path, json.dumps(scene).encode())
    return path
