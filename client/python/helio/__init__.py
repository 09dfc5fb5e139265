"""Heliograph from Python: scenes, views, pictures. A thin layer over libhelio (ctypes), with the
same names as the protocol's messages (docs/protocol.md).

    import helio

    with helio.connect(asset_roots=["models"]) as session:   # or "unix:/run/heliod/heliod.sock"
        scene = session.scene()
        scene.load("models/chair.glb")
        view = scene.view(640, 480)
        view.orbit(30, 70, 4)
        view.frame().save("chair.png")

Errors are HelioError with status, what, where and reason. A session belongs to one thread at a time.
Pictures are numpy arrays where numpy is installed, and show themselves in notebooks.
"""
from __future__ import annotations

from ._lib import HelioError
from ._messages import (Background, CameraKind, DebugView, Encoding, EnvironmentKind, ExposureMode, Gi,
                        LightKind, Metric, ObjectKind, Plane, RenderMode, Role, Status, Tonemap)
from .scene import Scene
from .session import Info, Message, Session, connect, version
from .view import Frame, View

__all__ = [
    "Background", "CameraKind", "DebugView", "Encoding", "EnvironmentKind", "ExposureMode", "Frame", "Gi",
    "HelioError", "Info", "LightKind", "Message", "Metric", "ObjectKind", "Plane", "RenderMode", "Role",
    "Scene", "Session", "Status", "Tonemap", "View", "connect", "version",
]
