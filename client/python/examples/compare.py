#!/usr/bin/env python3
"""How far real time is from path tracing, for a scene: compare.py SCENE [SAMPLES [WIDTH HEIGHT]]"""
import os
import sys

import helio

if len(sys.argv) not in (2, 3, 5):
    sys.exit(print(__doc__, file=sys.stderr) or 2)
samples = int(sys.argv[2]) if len(sys.argv) > 2 else 16
width, height = (int(a) for a in sys.argv[3:5]) if len(sys.argv) > 4 else (160, 120)
with helio.connect(asset_roots=[os.path.dirname(os.path.abspath(sys.argv[1]))]) as session:
    scene = session.scene()
    scene.load(sys.argv[1])
    pictures = []
    for mode in ("realtime", "path"):
        with scene.view(width, height, mode=mode, samples=samples) as view:
            view.fit()
            pictures.append(view.frame().data)
    for metric in ("psnr", "ssim", "flip"):
        print(metric, round(session.compare(pictures[0], pictures[1], metric), 4))
