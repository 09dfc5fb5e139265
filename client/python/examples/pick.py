#!/usr/bin/env python3
"""Says what is in the middle of the picture of a scene: pick.py SCENE"""
import os
import sys

import helio

with helio.connect(asset_roots=[os.path.dirname(os.path.abspath(sys.argv[1]))]) as session:
    scene = session.scene()
    scene.load(sys.argv[1])
    view = scene.view(320, 240, samples=1)
    view.fit()
    view.frame()
    hit = view.pick(160, 120)
    if hit is None:
        sys.exit("nothing")
    names = {node["node"]: node["name"] for node in scene.nodes()}
    print("%s at (%.3f %.3f %.3f), %.3f m away" % ((names[hit["node"]] or hit["node"],) + hit["position"]
                                                   + (hit["distance"],)))
