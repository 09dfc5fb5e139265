#!/usr/bin/env python3
"""Makes a scene of its own, a red triangle under a lamp, and changes it: edit.py BEFORE.png AFTER.png"""
import struct
import sys

import helio

if len(sys.argv) != 3:
    sys.exit(print(__doc__, file=sys.stderr) or 2)

with helio.connect() as session:
    scene = session.scene()
    material, mesh, node = scene.new_id(), scene.new_id(), scene.new_id()
    scene.edit("material_set", material=material, base_color=(0.8, 0.1, 0.1, 1), roughness=0.6, metallic=0,
               double_sided=True)
    corners = struct.pack("<9f", -1, 0, 0, 1, 0, 0, 0, 1.6, 0)
    scene.edit("mesh_set", mesh=mesh, parts=[{
        "mode": "triangles", "material": material, "positions": corners, "normals": b"", "tangents": b"",
        "uv0": b"", "uv1": b"", "colors": b"", "indices": b""}])
    scene.edit("node_set", node=node, mesh=mesh, name="triangle")
    view = scene.view(160, 120, samples=4)
    view.camera((0, 0.8, 4), (0, 0.8, 0))
    view.frame().save(sys.argv[1])
    scene.edit("node_set", node=node, rotation=(0, 0, 0.7071, 0.7071))
    scene.edit("material_set", material=material, base_color=(0.1, 0.3, 0.8, 1))
    view.frame().save(sys.argv[2])
