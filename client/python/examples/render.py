#!/usr/bin/env python3
"""Renders a scene, as helio render does: render.py SCENE OUT.png [URL]"""
import os
import sys

import helio

if len(sys.argv) not in (3, 4):
    sys.exit(print(__doc__, file=sys.stderr) or 2)
scene_file, out = sys.argv[1:3]
url = sys.argv[3] if len(sys.argv) > 3 else None
with helio.connect(url, asset_roots=[os.path.dirname(os.path.abspath(scene_file))]) as session:
    scene = session.scene()
    scene.load(scene_file)
    view = scene.view(320, 180)
    view.fit(cameras=True)
    frame = view.frame()
    frame.save(out)
    print(frame, frame.hash)
