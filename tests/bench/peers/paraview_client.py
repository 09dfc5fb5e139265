"""The client half of ParaView in viewing.py, run by pvpython: PORT SCENE WIDTH HEIGHT POSES. The server draws and
sends the pictures, compressed as ParaView does by default; each Render returns with the picture."""
import json
import math
import sys
import time

from paraview.simple import Connect, CreateView, OpenDataFile, Render, ResetCamera, SetActiveView, Show

port, scene, width, height, poses = sys.argv[1], sys.argv[2], *map(int, sys.argv[3:6])
Connect("127.0.0.1", int(port))
view = CreateView("RenderView")
view.RemoteRenderThreshold = 0  # MiB of geometry that a client draws itself
SetActiveView(view)
view.ViewSize = [width, height]
Show(OpenDataFile(scene), view)
ResetCamera(view)
Render(view)
focus, eye = list(view.CameraFocalPoint), list(view.CameraPosition)
radius = math.dist(focus, eye)


def turn(angle):
    view.CameraPosition = [focus[0] + radius * math.sin(angle), focus[1], focus[2] + radius * math.cos(angle)]
    view.CameraViewUp = [0, 1, 0]
    begun = time.monotonic()
    Render(view)
    return 1e3 * (time.monotonic() - begun)


for i in range(5):
    turn(0.01 * i)
print("begin", flush=True)
latencies = [turn(2 * math.pi * (i + 1) / poses) for i in range(poses)]
print("latencies", json.dumps(latencies), flush=True)
sys.stdin.readline()
