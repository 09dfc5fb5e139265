"""Scenes: what is in them, and edits."""
from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any, Dict, Iterator, List, Optional, Tuple

from . import _lib
from ._lib import lib

if TYPE_CHECKING:
    from .session import Session
    from .view import View


def object_id(asset: int, index: int) -> int:
    """Id of object `index` of the asset loaded as `asset` (0 = made by a client)."""
    return int(lib.helio_object_id(asset, index))


class Scene:
    """The scene that a session has open. Left by close(), by `with`, or with its session."""

    def __init__(self, session: "Session", opened: Dict[str, Any]) -> None:
        self.session = session
        self.existed: bool = opened["existed"]
        self.first_id: int = opened["first_id"]
        self.id_count: int = opened["id_count"]
        self._assets = 0
        self._objects = 0
        self._views = 0

    def __enter__(self) -> "Scene":
        return self

    def __exit__(self, *_: Any) -> None:
        if self.session._handle:
            self.close()

    def load(self, path: str, *, upload: bool = False, **fields: Any) -> Dict[str, Any]:
        """Loads a file into the scene and returns the fields of asset_loaded. `upload` sends a file of
        this machine that needs no others. Further fields are those of asset_load (variant, up, ...)."""
        asset = self.first_id + self._assets
        session = self.session
        if upload:
            fields["files"] = [{"uri": uri, "hash": digest} for uri, digest in session.upload([path])]
        elif not fields:
            loaded, err = _lib.structs["asset_loaded"](), _lib.Error()
            session._check(lib.helio_load(session.handle, asset, self._path(path).encode(), loaded, err), err)
            self._assets += 1
            return _lib.decode("asset_loaded", loaded)
        out = session.call("asset_load", "asset_loaded", asset=asset,
                           path="" if upload else self._path(path), **{"files": [], **fields}).fields
        self._assets += 1
        return out

    def _path(self, path: str) -> str:
        """A private worker has another working directory."""
        embedded = self.session.info.worker_pid != 0
        return os.path.realpath(path) if embedded and path != "demo:" else path

    def view(self, width: int = 1280, height: int = 720, **params: Any) -> "View":
        """A new view; params are the fields of view_set (mode="path", samples=64, ...)."""
        from .view import View
        self._views += 1
        return View(self, self._views, width=width, height=height, **params)

    def new_id(self) -> int:
        """An id for an object that this session makes."""
        self._objects += 1
        return object_id(0, self.first_id + self._objects - 1)

    def edit(self, name: str, /, **fields: Any) -> int:
        """An edit such as node_set, material_set, light_set, environment_set, variant_set,
        animation_set, mesh_set; returns the scene's revision."""
        return int(self.session.call(name, "ok", **fields)["revision"])

    def nodes(self) -> Iterator[Dict[str, Any]]:
        """All nodes: node, parent, mesh, light, camera (ids), visible, name."""
        first = 0
        while True:
            page = self.session.call("nodes_query", "nodes", first=first, count=4096)
            yield from page["nodes"]
            first += len(page["nodes"])
            if not page["nodes"] or first >= page["total"]:
                return

    def find(self, name: str) -> Optional[int]:
        """The first node of that name."""
        return next((n["node"] for n in self.nodes() if n["name"] == name), None)

    def bounds(self, node: int = 0) -> Optional[Tuple[Tuple[float, ...], Tuple[float, ...]]]:
        """Box of a node's subtree (0: the scene), least and greatest corner; None: no geometry."""
        box = self.session.call("bounds_query", "bounds", node=node)
        return None if box["empty"] else (box["min"], box["max"])

    def describe(self) -> List[Dict[str, Any]]:
        """What helio info tells, of each asset."""
        return list(self.session.query("info_query")["assets"])

    def pose(self, time_s: float) -> None:
        """Poses the animations of all assets that this session has loaded."""
        for i in range(self._assets):
            self.edit("animation_set", asset=self.first_id + i, animation=-1, time_s=time_s)

    def close(self) -> None:
        """Leaves the scene, whose views are closed; session.scene() may open the next one."""
        self.session.call("scene_close", "ok")
        self.session._credited.clear()
