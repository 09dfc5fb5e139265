"""Enums of the protocol.

Written by client/python/generate.py from protocol/messages.def: do not edit."""
from __future__ import annotations

import enum
from typing import Dict


class Status(enum.IntEnum):
    OK = 0
    E_INVAL = 1
    E_NOMEM = 2
    E_LIMIT = 3
    E_IO = 4
    E_NOSPACE = 5
    E_FORMAT = 6
    E_UNSUPPORTED = 7
    E_NOTFOUND = 8
    E_EXISTS = 9
    E_PERM = 10
    E_AUTH = 11
    E_STATE = 12
    E_VERSION = 13
    E_AGAIN = 14
    E_TRUNCATED = 15
    E_CLOSED = 16
    E_TIMEOUT = 17
    E_CANCELLED = 18
    E_DEVICE = 19
    E_DEVICE_LOST = 20
    E_WORKER = 21
    E_HASH = 22
    E_BUSY = 23
    E_INTERNAL = 24


STATUS_NAMES: Dict[int, str] = {
    0: "ok",
    1: "invalid",
    2: "no-memory",
    3: "limit",
    4: "io",
    5: "no-space",
    6: "format",
    7: "unsupported",
    8: "not-found",
    9: "exists",
    10: "not-allowed",
    11: "auth",
    12: "state",
    13: "version",
    14: "again",
    15: "truncated",
    16: "closed",
    17: "timeout",
    18: "cancelled",
    19: "device",
    20: "device-lost",
    21: "worker",
    22: "hash",
    23: "busy",
    24: "internal",
}


class Role(enum.IntEnum):
    NONE = 0
    VIEW = 1
    EDIT = 2
    ADMIN = 3


class Encoding(enum.IntEnum):
    RAW_RGBA8 = 0
    RAW_RGBA32F = 1
    ZSTD_RGBA8 = 2
    PNG8 = 3
    PNG16 = 4
    JPEG = 5
    EXR_HALF = 6
    EXR_FLOAT = 7
    JPEG_444 = 8
    H264 = 9
    H264_444 = 10
    AV1 = 11
    TILES = 12
    TILES_JPEG = 13


class RenderMode(enum.IntEnum):
    REALTIME = 0
    PATH = 1


class TraceBackend(enum.IntEnum):
    AUTO = 0
    EMBREE = 1
    COMPUTE = 2
    KHR = 3


class Denoise(enum.IntEnum):
    OFF = 0
    STILL = 1
    ANIMATION = 2


class CheckpointKind(enum.IntEnum):
    FILM = 0
    HISTORY = 1


class Plane(enum.IntEnum):
    COLOR = 0
    ALBEDO = 1
    NORMAL = 2
    GEOMETRIC_NORMAL = 3
    DEPTH = 4
    POSITION = 5
    EMISSION = 6
    DIRECT_DIFFUSE = 7
    DIRECT_SPECULAR = 8
    DIRECT_TRANSMISSION = 9
    INDIRECT_DIFFUSE = 10
    INDIRECT_SPECULAR = 11
    INDIRECT_TRANSMISSION = 12
    MOTION = 13
    OBJECT = 14
    MATERIAL = 15
    SAMPLES = 16
    VARIANCE = 17
    LIGHT_GROUPS = 18
    CRYPTO_OBJECT = 19
    CRYPTO_MATERIAL = 20
    CRYPTO_ASSET = 21
    NOISY = 22


class Tonemap(enum.IntEnum):
    ACES = 0
    AGX = 1
    PBR_NEUTRAL = 2
    LINEAR = 3


class ExposureMode(enum.IntEnum):
    FIXED = 0
    AUTO = 1
    CAMERA = 2


class Filter(enum.IntEnum):
    BLACKMAN_HARRIS = 0
    BOX = 1
    TENT = 2
    GAUSSIAN = 3


class Background(enum.IntEnum):
    ENV = 0
    NONE = 1
    COLOR = 2
    BLUR = 3
    DISPLAY = 4


class Ao(enum.IntEnum):
    AUTO = 0
    NONE = 1


class Mirrors(enum.IntEnum):
    AUTO = 0
    NONE = 1


class ShadowMaps(enum.IntEnum):
    AUTO = 0
    CASCADES = 1
    VIRTUAL = 2


class Temporal(enum.IntEnum):
    NONE = 0
    AUTO = 1
    CHECKERBOARD = 2


class Gi(enum.IntEnum):
    NONE = 0
    AUTO = 1
    RAYS = 2
    PROBES = 3


class Reflections(enum.IntEnum):
    ENVIRONMENT = 0
    AUTO = 1
    RAYS = 2
    CACHE = 3


class Ground(enum.IntEnum):
    NONE = 0
    Y = 1
    Z = 2
    X = 3
    MINUS_Y = 4
    MINUS_Z = 5
    MINUS_X = 6


class CapStyle(enum.IntEnum):
    MATERIAL = 0
    COLOR = 1
    HATCH = 2
    NONE = 3


class EnvironmentKind(enum.IntEnum):
    NONE = 0
    COLOR = 1
    FILE = 2
    SKY = 3
    AUTO = 4


class CameraKind(enum.IntEnum):
    PERSPECTIVE = 0
    ORTHOGRAPHIC = 1


class UpAxis(enum.IntEnum):
    AUTO = 0
    X = 1
    Y = 2
    Z = 3
    MINUS_X = 4
    MINUS_Y = 5
    MINUS_Z = 6


class LightKind(enum.IntEnum):
    DIRECTIONAL = 0
    POINT = 1
    SPOT = 2
    RECTANGLE = 3
    DISC = 4
    TUBE = 5


class AlphaMode(enum.IntEnum):
    OPAQUE = 0
    MASK = 1
    BLEND = 2


class PrimitiveMode(enum.IntEnum):
    POINTS = 0
    LINES = 1
    LINE_LOOP = 2
    LINE_STRIP = 3
    TRIANGLES = 4
    TRIANGLE_STRIP = 5
    TRIANGLE_FAN = 6


class PixelFormat(enum.IntEnum):
    RGBA8_SRGB = 0
    RGBA8_LINEAR = 1
    RGBA32F = 2
    FILE = 3


class Wrap(enum.IntEnum):
    REPEAT = 0
    CLAMP = 1
    MIRROR = 2


class ObjectKind(enum.IntEnum):
    NODE = 0
    MESH = 1
    MATERIAL = 2
    TEXTURE = 3
    LIGHT = 4
    CAMERA = 5


class DebugView(enum.IntEnum):
    OFF = 0
    MIP = 1
    RESIDENCY = 2
    MISSING = 3
    CLUSTER = 4
    LOD = 5
    OVERDRAW = 6
    MOTION = 7
    HISTORY = 8
    PROBES = 9
    IRRADIANCE = 10
    SHADOWS = 11
    REFLECTIONS = 12
    SCALE = 13
    SHADOW_PAGES = 14


class CameraChange(enum.IntEnum):
    NONE = 0
    REQUESTED = 1
    TAKEN = 2
    GIVEN = 3
    RELEASED = 4
    INACTIVE = 5
    TURN_OVER = 6
    LEFT = 7
    LOCK = 8
    WAITING = 9


class AnnotationKind(enum.IntEnum):
    MARKER = 0
    TEXT = 1


class Metric(enum.IntEnum):
    PSNR = 0
    SSIM = 1
    FLIP = 2
    RMSE = 3
    MAX = 4


ENUMS: Dict[str, type[enum.IntEnum]] = {
    "role": Role,
    "encoding": Encoding,
    "render_mode": RenderMode,
    "trace_backend": TraceBackend,
    "denoise": Denoise,
    "checkpoint_kind": CheckpointKind,
    "plane": Plane,
    "tonemap": Tonemap,
    "exposure_mode": ExposureMode,
    "filter": Filter,
    "background": Background,
    "ao": Ao,
    "mirrors": Mirrors,
    "shadow_maps": ShadowMaps,
    "temporal": Temporal,
    "gi": Gi,
    "reflections": Reflections,
    "ground": Ground,
    "cap_style": CapStyle,
    "environment_kind": EnvironmentKind,
    "camera_kind": CameraKind,
    "up_axis": UpAxis,
    "light_kind": LightKind,
    "alpha_mode": AlphaMode,
    "primitive_mode": PrimitiveMode,
    "pixel_format": PixelFormat,
    "wrap": Wrap,
    "object_kind": ObjectKind,
    "debug_view": DebugView,
    "camera_change": CameraChange,
    "annotation_kind": AnnotationKind,
    "metric": Metric,
}
