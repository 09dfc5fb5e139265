#!/usr/bin/env python3
"""Goes once around a scene: orbit.py SCENE PATTERN COUNT [WIDTH HEIGHT], such as orbit.py chair.glb turn-%02d.png 12"""
import math
import os
import sys

import helio

if len(sys.argv) not in (4, 6):
    sys.exit(print(__doc__, file=sys.stderr) or 2)
scene_file, pattern, count = sys.argv[1], sys.argv[2], int(sys.argv[3])
width, height = (int(a) for a in sys.argv[4:6]) if len(sys.argv) > 5 else (320, 240)
with helio.connect(asset_roots=[os.path.dirname(os.path.abspath(scene_file))]) as session:
    scene = session.scene()
    scene.load(scene_file)
    low, high = scene.bounds() or ((-1, -1, -1), (1, 1, 1))
    middle = [(a + b) / 2 for a, b in zip(low, high)]
    radius = math.dist(low, high) * 1.4
    with scene.view(width, height, samples=4) as view:
        for i in range(count):
            view.orbit(360 * i / count, 65, radius, middle)
            view.frame().save(pattern % i)
