"""Views: cameras, and the pictures that they see."""
from __future__ import annotations

import ctypes
import math
import os
from typing import TYPE_CHECKING, Any, Dict, Iterator, Optional, Sequence, Tuple

from . import _lib
from ._lib import lib
from ._enums import Encoding

if TYPE_CHECKING:
    from .scene import Scene


_ENDS: Dict[Encoding, Tuple[str, ...]] = {
    Encoding.PNG8: (".png",), Encoding.PNG16: (".png",), Encoding.JPEG: (".jpg", ".jpeg"),
    Encoding.JPEG_444: (".jpg", ".jpeg"), Encoding.EXR_HALF: (".exr",), Encoding.EXR_FLOAT: (".exr",)}
_PICTURE_ENDS = (".png", ".jpg", ".jpeg", ".exr", ".tif", ".tiff", ".webp", ".bmp", ".hdr")


class Frame:
    """A picture and where it comes from: width, height, encoding, data, settled, samples, hash, stages,
    ... as attributes, the fields of the message `frame`."""

    def __init__(self, fields: Dict[str, Any], data: Optional[bytes] = None) -> None:
        self.fields = fields
        self.data: bytes = fields["data"] if data is None else data
        self.width: int = fields["width"]
        self.height: int = fields["height"]
        self.encoding = Encoding(fields["encoding"])
        self.settled: bool = fields["settled"]
        self.hash: Optional[str] = fields["hash"].hex() if "hash" in fields else None

    def __getattr__(self, name: str) -> Any:
        if name != "fields" and name in self.fields:
            return self.fields[name]
        raise AttributeError(name)

    def __repr__(self) -> str:
        return "<helio.Frame %dx%d %s, %d samples%s>" % (
            self.width, self.height, self.encoding.name, self.fields["samples"],
            ", settled" if self.settled else "")

    def save(self, path: str) -> None:
        """Writes the data as it is: a file, where the encoding is that of files. A name that ends as
        those of another kind of picture is refused."""
        ends = _ENDS.get(self.encoding, ())
        end = os.path.splitext(path)[1].lower()
        if end in _PICTURE_ENDS and end not in ends:
            raise ValueError("%s: the frame is %s, whose files end with %s; frame(encoding=...) asks for another" % (
                path, self.encoding.name, " or ".join(ends) or "something else"))
        with open(path, "wb") as f:
            f.write(self.data)

    @property
    def array(self) -> Any:
        """numpy array [height, width, 4]: u8 of RAW_RGBA8, f32 of RAW_RGBA32F. Shares the data."""
        import numpy
        kinds = {Encoding.RAW_RGBA8: numpy.uint8, Encoding.RAW_RGBA32F: numpy.float32}
        if self.encoding not in kinds:
            raise ValueError("%s is no array: ask for frame(encoding=\"raw_rgba8\")" % self.encoding.name)
        return numpy.frombuffer(self.data, kinds[self.encoding]).reshape(self.height, self.width, 4)

    def __array__(self, dtype: Any = None) -> Any:
        return self.array if dtype is None else self.array.astype(dtype)

    def _repr_png_(self) -> Optional[bytes]:
        return self.data if self.encoding in (Encoding.PNG8, Encoding.PNG16) else None

    def _repr_jpeg_(self) -> Optional[bytes]:
        return self.data if self.encoding == Encoding.JPEG else None


class View:
    """A camera, a size and what pictures are made with. Closed by close(), by `with`, or with its
    session."""

    def __init__(self, scene: "Scene", number: int, **params: Any) -> None:
        self.scene, self.session, self.number = scene, scene.session, number
        self.input_seq = 0
        self.set(**params)

    def __enter__(self) -> "View":
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def close(self) -> None:
        self.session.call("view_close", "ok", view=self.number)

    def set(self, **params: Any) -> None:
        """Fields of view_set: width, mode="path", samples, exposure_ev, background="none", ..."""
        self.session.call("view_set", "ok", view=self.number, **params)

    # ---- cameras -------------------------------------------------------------------------------

    def camera(self, eye: Optional[Sequence[float]] = None, target: Optional[Sequence[float]] = None,
               **fields: Any) -> int:
        """Places the camera; further fields are those of view_camera, such as vfov_rad, or camera=, a
        node of the scene that carries one. Returns the input_seq of the frames that show it. In a loop
        over frames() it does not wait for the answer, and what is wrong with it is raised by the loop."""
        self.input_seq += 1
        fields = dict(fields, view=self.number, input_seq=self.input_seq, eye=eye, target=target)
        if self.number in self.session._credited:
            self.session.send("view_camera", **fields)
        else:
            self.session.call("view_camera", "ok", **fields)
        return self.input_seq

    def orbit(self, theta_deg: float, phi_deg: float, radius: float,
              target: Sequence[float] = (0, 0, 0), **fields: Any) -> int:
        """eye = target + radius (sin phi sin theta, cos phi, sin phi cos theta)."""
        camera = _lib.structs["view_camera"]()
        lib.helio_camera_orbit(theta_deg, phi_deg, radius, (ctypes.c_double * 3)(*target), camera)
        return self.camera(tuple(camera.eye), tuple(camera.target), up=tuple(camera.up), **fields)

    def fit(self, name: Optional[str] = None, **fields: Any) -> int:
        """Shows all of the scene: from a named side (front, back, left, right, top, bottom, iso), from
        azimuth_rad and elevation_rad, or as helio render does without a camera (cameras=True)."""
        if name is not None:
            azimuth, elevation = ctypes.c_double(), ctypes.c_double()
            if not lib.helio_view_angles(name.encode(), azimuth, elevation):
                raise ValueError("%r is no named view" % name)
            fields["azimuth_rad"] = math.radians(azimuth.value)
            fields["elevation_rad"] = math.radians(elevation.value)
        ask = _lib.encode("view_fit", {"view": self.number, **fields}, [])
        found, err = _lib.structs["view_camera"](), _lib.Error()
        self.session._check(lib.helio_camera_fit(self.session.handle, ask, found, err), err)
        camera = _lib.decode("view_camera", found)
        return self.camera(**{k: v for k, v in camera.items() if k not in ("view", "input_seq")})

    # ---- pictures ------------------------------------------------------------------------------

    def frame(self, settled: bool = True, encoding: Any = "png8", **fields: Any) -> Frame:
        """One picture: the settled one, or the next. Encodings are those of the protocol: png8, png16,
        jpeg, exr_half, exr_float, raw_rgba8, raw_rgba32f, zstd_rgba8."""
        keep: Any = []
        ask = _lib.encode("frame_request", {"view": self.number, "settled": settled, "encoding": encoding,
                                            **fields}, keep)
        out, err = ctypes.POINTER(_lib.Message)(), _lib.Error()
        self.session._check(lib.helio_frame(self.session.handle, ask, out, err), err)
        return Frame(self.session._take(out).fields)

    def frames(self, credit: int = 32, timeout: Optional[float] = None) -> Iterator[Frame]:
        """Pictures as the view changes or improves, until the loop is left or `timeout` seconds pass
        without one. Cameras may be placed meanwhile."""
        self.set(names=1)
        self.session._credited.add(self.number)
        self.session.call("subscribe", "ok", view=self.number, credit_frames=credit)
        try:
            for message in self.session._arrivals(
                    timeout, lambda m: m.name == "frame" and m["view"] == self.number):
                if message.name == "error":
                    raise _lib.HelioError(message["code"], message["what"], message["where"],
                                          message["reason"])
                if message.name == "frame" and message["view"] == self.number:
                    yield Frame(message.fields)
        finally:
            self.session._credited.discard(self.number)
            if self.session._handle:
                self.session.call("subscribe", "ok", view=self.number, credit_frames=0)

    # ---- questions -----------------------------------------------------------------------------

    def pick(self, x: int, y: int) -> Optional[Dict[str, Any]]:
        """What is under a pixel of the newest frame: node, mesh, material, position, normal, ...;
        None: nothing."""
        found = self.session.call("pick", "picked", view=self.number, x=x, y=y).fields
        return found if found["hit"] else None

    def stats(self) -> Dict[str, Any]:
        """The statistics of docs/client.md."""
        return dict(self.session.query("stats_query", self.number))

    def _repr_png_(self) -> bytes:
        return self.frame(encoding="png8").data
