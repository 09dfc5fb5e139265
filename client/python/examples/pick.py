#!/usr/bin/env python3
"""Says what is in the middle of the picture of a scene: pick.py SCENE [WIDTH HEIGHT]"""
import os
import sys

import helio

if len(sys.argv) not in (2, 4):
    sys.exit(print(__doc__, file=sys.stderr) or 2)
width, height = (int(a) for a in sys.argv[2:4]) if len(sys.argv) > 3 else (320, 240)
with helio.connect(asset_roots=[os.path.dirname(os.path.abspath(sys.argv[1]))]) as session:
    scene = session.scene()
    scene.load(sys.argv[1])
    view = scene.view(width, height, samples=1)
    view.fit()
    view.frame()
    hit = view.pick(width // 2, height // 2)
    if hit is None:
        sys.exit("nothing")
    names = {node["node"]: node["name"] for node in scene.nodes()}
    print("%s at (%.3f %.3f %.3f), %.3f m away" % ((names[hit["node"]] or hit["node"],) + hit["position"]
                                                   + (hit["distance"],)))
