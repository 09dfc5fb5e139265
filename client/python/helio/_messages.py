"""Messages of the protocol. Written by generate.py from protocol/messages.def: do not edit."""
from __future__ import annotations

import enum
from typing import Dict, List, Tuple

# (field, kind, enum or list part, optional)
Field = Tuple[str, str, str, bool]


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

# Parts of lists have number 0. In the order of C's structs.
RECORDS: Dict[str, Tuple[int, str, List[Field]]] = {
    "text": (0x0000, "", [
        ("value", "STR", "", False),
    ]),
    "content": (0x0000, "", [
        ("hash", "HASH", "", False),
    ]),
    "flag": (0x0000, "", [
        ("value", "BOOL", "", False),
    ]),
    "asset_file": (0x0000, "", [
        ("uri", "STR", "", False),
        ("hash", "HASH", "", False),
    ]),
    "stage_time": (0x0000, "", [
        ("name", "STR", "", False),
        ("ns", "U64", "", False),
    ]),
    "node_entry": (0x0000, "", [
        ("node", "U64", "", False),
        ("parent", "U64", "", False),
        ("mesh", "U64", "", False),
        ("light", "U64", "", False),
        ("camera", "U64", "", False),
        ("visible", "BOOL", "", False),
        ("name", "STR", "", False),
    ]),
    "mesh_part": (0x0000, "", [
        ("mode", "ENUM", "primitive_mode", False),
        ("material", "U64", "", False),
        ("positions", "BYTES", "", False),
        ("normals", "BYTES", "", False),
        ("tangents", "BYTES", "", False),
        ("uv0", "BYTES", "", False),
        ("uv1", "BYTES", "", False),
        ("colors", "BYTES", "", False),
        ("indices", "BYTES", "", False),
    ]),
    "participant": (0x0000, "", [
        ("session", "U64", "", False),
        ("role", "ENUM", "role", False),
        ("name", "STR", "", False),
        ("label", "STR", "", False),
        ("color", "U32", "", False),
        ("away", "BOOL", "", False),
    ]),
    "waiting_session": (0x0000, "", [
        ("session", "U64", "", False),
    ]),
    "annotation_entry": (0x0000, "", [
        ("annotation", "U64", "", False),
        ("kind", "ENUM", "annotation_kind", False),
        ("position", "VEC3", "", False),
        ("normal", "VEC3", "", False),
        ("node", "U64", "", False),
        ("color", "U32", "", False),
        ("text", "STR", "", False),
        ("author", "STR", "", False),
        ("label", "STR", "", False),
        ("own", "BOOL", "", False),
        ("time_ms", "U64", "", False),
        ("changed_ms", "U64", "", False),
    ]),
    "hello": (0x0101, "C2S", [
        ("version_min", "U16", "", False),
        ("version_max", "U16", "", False),
        ("client", "STR", "", False),
        ("capabilities", "LIST", "text", False),
    ]),
    "welcome": (0x0102, "S2C", [
        ("version", "U16", "", False),
        ("server", "STR", "", False),
        ("session", "U64", "", False),
        ("auth_required", "BOOL", "", False),
        ("role", "ENUM", "role", False),
        ("max_message_bytes", "U32", "", False),
        ("capabilities", "LIST", "text", False),
    ]),
    "auth": (0x0103, "C2S", [
        ("token", "STR", "", False),
    ]),
    "auth_ok": (0x0104, "S2C", [
        ("role", "ENUM", "role", False),
        ("name", "STR", "", False),
    ]),
    "error": (0x0105, "ANY", [
        ("code", "U16", "", False),
        ("what", "STR", "", False),
        ("where", "STR", "", False),
        ("reason", "STR", "", False),
    ]),
    "ok": (0x0106, "S2C", [
        ("revision", "U64", "", False),
    ]),
    "ping": (0x0107, "ANY", [
        ("nonce", "U64", "", False),
    ]),
    "pong": (0x0108, "ANY", [
        ("nonce", "U64", "", False),
    ]),
    "drain": (0x0109, "S2C", [
        ("deadline_ms", "U32", "", False),
        ("reason", "STR", "", False),
    ]),
    "bye": (0x010a, "ANY", [
        ("reason", "STR", "", False),
    ]),
    "progress": (0x010b, "S2C", [
        ("stage", "STR", "", False),
        ("done", "U64", "", False),
        ("total", "U64", "", False),
    ]),
    "notice": (0x010c, "S2C", [
        ("code", "U16", "", False),
        ("what", "STR", "", False),
        ("where", "STR", "", False),
        ("reason", "STR", "", False),
    ]),
    "keep": (0x010d, "C2S", [
    ]),
    "ticket": (0x010e, "S2C", [
        ("secret", "BYTES", "", False),
        ("valid_s", "U32", "", False),
    ]),
    "resume": (0x010f, "C2S", [
        ("secret", "BYTES", "", False),
    ]),
    "resumed": (0x0110, "S2C", [
        ("session", "U64", "", False),
        ("secret", "BYTES", "", False),
        ("valid_s", "U32", "", False),
        ("revision", "U64", "", False),
        ("first_id", "U32", "", False),
        ("id_count", "U32", "", False),
    ]),
    "scene_watch": (0x0130, "C2S", [
        ("participants", "BOOL", "", True),
        ("cursors", "BOOL", "", True),
        ("camera", "BOOL", "", True),
        ("annotations", "BOOL", "", True),
        ("edits", "BOOL", "", True),
    ]),
    "participant_set": (0x0131, "C2S", [
        ("label", "STR", "", True),
        ("color", "U32", "", True),
    ]),
    "participants": (0x0132, "S2C", [
        ("sessions", "LIST", "participant", False),
    ]),
    "cursor_set": (0x0133, "C2S", [
        ("shown", "BOOL", "", False),
        ("position", "VEC3", "", False),
        ("normal", "VEC3", "", False),
        ("node", "U64", "", False),
    ]),
    "cursor": (0x0134, "S2C", [
        ("session", "U64", "", False),
        ("shown", "BOOL", "", False),
        ("position", "VEC3", "", False),
        ("normal", "VEC3", "", False),
        ("node", "U64", "", False),
    ]),
    "edited": (0x0135, "S2C", [
        ("number", "U64", "", False),
        ("revision", "U64", "", False),
        ("session", "U64", "", False),
        ("message", "U16", "", False),
        ("object", "U64", "", False),
    ]),
    "camera_request": (0x0136, "C2S", [
    ]),
    "camera_take": (0x0137, "C2S", [
    ]),
    "camera_give": (0x0138, "C2S", [
        ("session", "U64", "", True),
    ]),
    "camera_lock": (0x0139, "C2S", [
        ("locked", "BOOL", "", False),
    ]),
    "camera_follow": (0x013a, "C2S", [
        ("view", "U32", "", False),
        ("follow", "BOOL", "", False),
    ]),
    "camera_state": (0x013b, "S2C", [
        ("holder", "U64", "", False),
        ("locked", "BOOL", "", False),
        ("change", "ENUM", "camera_change", False),
        ("waiting", "LIST", "waiting_session", False),
    ]),
    "camera_moved": (0x013c, "S2C", [
        ("session", "U64", "", False),
        ("input_seq", "U64", "", False),
        ("camera", "U64", "", True),
        ("eye", "VEC3", "", True),
        ("target", "VEC3", "", True),
        ("up", "VEC3", "", True),
        ("kind", "ENUM", "camera_kind", True),
        ("vfov_rad", "F32", "", True),
        ("half_height", "F32", "", True),
        ("near", "F32", "", True),
        ("far", "F32", "", True),
    ]),
    "annotation_set": (0x0140, "C2S", [
        ("annotation", "U64", "", False),
        ("kind", "ENUM", "annotation_kind", True),
        ("position", "VEC3", "", True),
        ("normal", "VEC3", "", True),
        ("node", "U64", "", True),
        ("color", "U32", "", True),
        ("text", "STR", "", True),
    ]),
    "annotation_remove": (0x0141, "C2S", [
        ("annotation", "U64", "", False),
    ]),
    "annotations_query": (0x0142, "C2S", [
    ]),
    "annotations": (0x0143, "S2C", [
        ("annotations", "LIST", "annotation_entry", False),
    ]),
    "annotation": (0x0144, "S2C", [
        ("annotation", "LIST", "annotation_entry", False),
    ]),
    "annotation_removed": (0x0145, "S2C", [
        ("annotation", "U64", "", False),
    ]),
    "join_make": (0x0148, "C2S", [
        ("scene", "STR", "", True),
        ("role", "ENUM", "role", True),
        ("uses", "U32", "", True),
        ("valid_s", "U32", "", True),
        ("label", "STR", "", True),
    ]),
    "join_ticket": (0x0149, "S2C", [
        ("ticket", "U64", "", False),
        ("secret", "STR", "", False),
        ("scene", "STR", "", False),
        ("role", "ENUM", "role", False),
        ("uses", "U32", "", False),
        ("valid_s", "U32", "", False),
    ]),
    "join_scene": (0x014a, "S2C", [
        ("scene", "STR", "", False),
    ]),
    "auth_resume": (0x014b, "C2S", [
        ("token", "STR", "", False),
        ("secret", "BYTES", "", False),
    ]),
    "join_query": (0x014c, "C2S", [
    ]),
    "join_revoke": (0x014d, "C2S", [
        ("ticket", "U64", "", False),
    ]),
    "message_send": (0x0150, "C2S", [
        ("text", "STR", "", False),
        ("session", "U64", "", True),
        ("scene", "STR", "", True),
    ]),
    "message": (0x0151, "S2C", [
        ("from", "STR", "", False),
        ("text", "STR", "", False),
    ]),
    "kick": (0x0152, "C2S", [
        ("session", "U64", "", False),
        ("reason", "STR", "", False),
        ("block_s", "U32", "", True),
    ]),
    "drain_set": (0x0153, "C2S", [
        ("deadline_ms", "U32", "", False),
        ("reason", "STR", "", False),
        ("stay", "BOOL", "", True),
        ("cancel", "BOOL", "", True),
    ]),
    "sessions_watch": (0x0154, "C2S", [
        ("interval_ms", "U32", "", False),
    ]),
    "statistics": (0x0155, "S2C", [
        ("text", "STR", "", False),
    ]),
    "idle_warning": (0x0156, "S2C", [
        ("remaining_ms", "U32", "", False),
    ]),
    "limited": (0x0157, "S2C", [
        ("request", "U32", "", False),
        ("limit", "STR", "", False),
        ("retry_after_ms", "U32", "", False),
    ]),
    "drain_cancelled": (0x0158, "S2C", [
    ]),
    "scene_open": (0x0201, "C2S", [
        ("name", "STR", "", False),
    ]),
    "scene_opened": (0x0202, "S2C", [
        ("revision", "U64", "", False),
        ("existed", "BOOL", "", False),
        ("first_id", "U32", "", False),
        ("id_count", "U32", "", False),
    ]),
    "scene_close": (0x0203, "C2S", [
    ]),
    "upload_query": (0x0204, "C2S", [
        ("contents", "LIST", "content", False),
    ]),
    "upload_have": (0x0205, "S2C", [
        ("have", "LIST", "flag", False),
    ]),
    "upload": (0x0206, "C2S", [
        ("hash", "HASH", "", False),
        ("total", "U64", "", False),
        ("offset", "U64", "", False),
        ("data", "BYTES", "", False),
    ]),
    "asset_load": (0x0207, "C2S", [
        ("asset", "U32", "", False),
        ("path", "STR", "", False),
        ("files", "LIST", "asset_file", False),
        ("parent", "U64", "", True),
        ("transform", "MAT4", "", True),
        ("scene_index", "I32", "", True),
        ("variant", "STR", "", True),
        ("up", "ENUM", "up_axis", True),
        ("point_scale", "F32", "", True),
        ("point_diameter", "F32", "", True),
    ]),
    "asset_loaded": (0x0208, "S2C", [
        ("asset", "U32", "", False),
        ("revision", "U64", "", False),
        ("nodes", "U32", "", False),
        ("meshes", "U32", "", False),
        ("materials", "U32", "", False),
        ("textures", "U32", "", False),
        ("lights", "U32", "", False),
        ("cameras", "U32", "", False),
        ("animations", "U32", "", False),
        ("triangles", "U64", "", False),
        ("bounds_min", "VEC3", "", False),
        ("bounds_max", "VEC3", "", False),
        ("duration_s", "F64", "", False),
        ("up", "ENUM", "up_axis", True),
        ("up_reason", "STR", "", True),
    ]),
    "asset_unload": (0x0209, "C2S", [
        ("asset", "U32", "", False),
    ]),
    "mesh_set": (0x020a, "C2S", [
        ("mesh", "U64", "", False),
        ("parts", "LIST", "mesh_part", False),
    ]),
    "texture_set": (0x020b, "C2S", [
        ("texture", "U64", "", False),
        ("format", "ENUM", "pixel_format", False),
        ("width", "U32", "", False),
        ("height", "U32", "", False),
        ("wrap_s", "ENUM", "wrap", False),
        ("wrap_t", "ENUM", "wrap", False),
        ("nearest", "BOOL", "", False),
        ("pixels", "BYTES", "", False),
    ]),
    "material_set": (0x020c, "C2S", [
        ("material", "U64", "", False),
        ("base_color", "VEC4", "", True),
        ("metallic", "F32", "", True),
        ("roughness", "F32", "", True),
        ("emissive", "VEC3", "", True),
        ("emissive_strength", "F32", "", True),
        ("normal_scale", "F32", "", True),
        ("occlusion_strength", "F32", "", True),
        ("alpha_mode", "ENUM", "alpha_mode", True),
        ("alpha_cutoff", "F32", "", True),
        ("double_sided", "BOOL", "", True),
        ("unlit", "BOOL", "", True),
        ("base_color_texture", "U64", "", True),
        ("metallic_roughness_texture", "U64", "", True),
        ("normal_texture", "U64", "", True),
        ("occlusion_texture", "U64", "", True),
        ("emissive_texture", "U64", "", True),
        ("name", "STR", "", True),
    ]),
    "node_set": (0x020d, "C2S", [
        ("node", "U64", "", False),
        ("parent", "U64", "", True),
        ("translation", "VEC3", "", True),
        ("rotation", "VEC4", "", True),
        ("scale", "VEC3", "", True),
        ("visible", "BOOL", "", True),
        ("mesh", "U64", "", True),
        ("light", "U64", "", True),
        ("camera", "U64", "", True),
        ("name", "STR", "", True),
        ("catches_shadows", "BOOL", "", True),
        ("next_translation", "VEC3", "", True),
        ("next_rotation", "VEC4", "", True),
        ("next_scale", "VEC3", "", True),
    ]),
    "light_set": (0x020e, "C2S", [
        ("light", "U64", "", False),
        ("kind", "ENUM", "light_kind", True),
        ("color", "VEC3", "", True),
        ("intensity", "F32", "", True),
        ("range", "F32", "", True),
        ("inner_cone_rad", "F32", "", True),
        ("outer_cone_rad", "F32", "", True),
        ("casts_shadow", "BOOL", "", True),
        ("radius", "F32", "", True),
        ("width", "F32", "", True),
        ("height", "F32", "", True),
        ("angular_diameter_rad", "F32", "", True),
        ("lumens", "F32", "", True),
        ("profile", "BYTES", "", True),
        ("profile_absolute", "BOOL", "", True),
        ("texture", "U64", "", True),
    ]),
    "camera_set": (0x020f, "C2S", [
        ("camera", "U64", "", False),
        ("kind", "ENUM", "camera_kind", True),
        ("vfov_rad", "F32", "", True),
        ("half_height", "F32", "", True),
        ("near", "F32", "", True),
        ("far", "F32", "", True),
    ]),
    "environment_set": (0x0210, "C2S", [
        ("kind", "ENUM", "environment_kind", True),
        ("path", "STR", "", True),
        ("hash", "HASH", "", True),
        ("color", "VEC3", "", True),
        ("intensity", "F32", "", True),
        ("rotation_rad", "F32", "", True),
        ("sun_direction", "VEC3", "", True),
        ("turbidity", "F32", "", True),
        ("sun", "BOOL", "", True),
    ]),
    "animation_set": (0x0211, "C2S", [
        ("asset", "U32", "", False),
        ("animation", "I32", "", False),
        ("time_s", "F64", "", False),
    ]),
    "variant_set": (0x0212, "C2S", [
        ("asset", "U32", "", False),
        ("variant", "STR", "", False),
    ]),
    "object_remove": (0x0213, "C2S", [
        ("kind", "ENUM", "object_kind", False),
        ("object", "U64", "", False),
    ]),
    "batch_begin": (0x0214, "C2S", [
    ]),
    "batch_end": (0x0215, "C2S", [
    ]),
    "view_set": (0x0301, "C2S", [
        ("view", "U32", "", False),
        ("width", "U32", "", True),
        ("height", "U32", "", True),
        ("mode", "ENUM", "render_mode", True),
        ("encoding", "ENUM", "encoding", True),
        ("still_encoding", "ENUM", "encoding", True),
        ("quality", "U8", "", True),
        ("tonemap", "ENUM", "tonemap", True),
        ("exposure_ev", "F32", "", True),
        ("background", "ENUM", "background", True),
        ("background_color", "VEC3", "", True),
        ("samples", "U32", "", True),
        ("seed", "U32", "", True),
        ("max_fps", "F32", "", True),
        ("debug_view", "ENUM", "debug_view", True),
        ("error_px", "F32", "", True),
        ("target_ms", "F32", "", True),
        ("trace", "ENUM", "trace_backend", True),
        ("max_bounces", "U32", "", True),
        ("noise", "F32", "", True),
        ("time_limit_s", "F32", "", True),
        ("planes", "U32", "", True),
        ("denoise", "ENUM", "denoise", True),
        ("frame_s", "F32", "", True),
        ("shutter_open", "F32", "", True),
        ("shutter_close", "F32", "", True),
        ("series_s", "F32", "", True),
        ("filter", "ENUM", "filter", True),
        ("filter_radius_px", "F32", "", True),
        ("clamp_indirect", "F32", "", True),
        ("exposure_mode", "ENUM", "exposure_mode", True),
        ("ground", "ENUM", "ground", True),
        ("region", "VEC4", "", True),
        ("gi", "ENUM", "gi", True),
        ("temporal", "ENUM", "temporal", True),
        ("scale", "F32", "", True),
        ("reflections", "ENUM", "reflections", True),
        ("f_number", "F32", "", True),
        ("shutter_s", "F32", "", True),
        ("iso", "F32", "", True),
        ("sensor_mm", "F32", "", True),
        ("ao", "ENUM", "ao", True),
        ("mirrors", "ENUM", "mirrors", True),
        ("shadow_maps", "ENUM", "shadow_maps", True),
        ("sharpen", "F32", "", True),
        ("codecs", "BYTES", "", True),
        ("bitrate", "U32", "", True),
        ("target_fps", "F32", "", True),
        ("hidden", "U8", "", True),
        ("names", "U8", "", True),
    ]),
    "view_close": (0x0302, "C2S", [
        ("view", "U32", "", False),
    ]),
    "view_camera": (0x0303, "C2S", [
        ("view", "U32", "", False),
        ("input_seq", "U64", "", False),
        ("camera", "U64", "", True),
        ("eye", "VEC3", "", True),
        ("target", "VEC3", "", True),
        ("up", "VEC3", "", True),
        ("kind", "ENUM", "camera_kind", True),
        ("vfov_rad", "F32", "", True),
        ("half_height", "F32", "", True),
        ("near", "F32", "", True),
        ("far", "F32", "", True),
        ("next_eye", "VEC3", "", True),
        ("next_target", "VEC3", "", True),
        ("next_up", "VEC3", "", True),
        ("lens_radius", "F32", "", True),
        ("focus_distance", "F32", "", True),
        ("received_ns", "U64", "", True),
    ]),
    "frame_request": (0x0304, "C2S", [
        ("view", "U32", "", False),
        ("settled", "BOOL", "", False),
        ("encoding", "ENUM", "encoding", True),
        ("quality", "U8", "", True),
        ("parts", "BOOL", "", True),
    ]),
    "subscribe": (0x0305, "C2S", [
        ("view", "U32", "", False),
        ("credit_frames", "U32", "", False),
    ]),
    "credit": (0x0306, "C2S", [
        ("view", "U32", "", False),
        ("frames", "U32", "", False),
    ]),
    "frame": (0x0307, "S2C", [
        ("view", "U32", "", False),
        ("number", "U64", "", False),
        ("scene_revision", "U64", "", False),
        ("input_seq", "U64", "", False),
        ("width", "U32", "", False),
        ("height", "U32", "", False),
        ("encoding", "ENUM", "encoding", False),
        ("samples", "U32", "", False),
        ("missing_pages", "U32", "", False),
        ("missing_clusters", "U32", "", False),
        ("settled", "BOOL", "", False),
        ("lossless", "BOOL", "", False),
        ("hash", "HASH", "", True),
        ("stages", "LIST", "stage_time", False),
        ("data", "BYTES", "", False),
        ("mip_bias", "F32", "", True),
        ("error_px", "F32", "", True),
        ("mode", "ENUM", "render_mode", True),
        ("noise", "F32", "", True),
        ("job", "HASH", "", True),
        ("size", "U64", "", True),
        ("exposure_ev", "F32", "", True),
        ("black", "F32", "", True),
        ("clipped", "F32", "", True),
        ("depends", "U32", "", True),
        ("codec", "STR", "", True),
        ("input_ns", "U64", "", True),
        ("taken_ns", "U64", "", True),
        ("render_begin_ns", "U64", "", True),
        ("render_end_ns", "U64", "", True),
        ("encode_begin_ns", "U64", "", True),
        ("encode_end_ns", "U64", "", True),
        ("sent_ns", "U64", "", True),
    ]),
    "job_query": (0x0308, "C2S", [
        ("view", "U32", "", False),
        ("encoding", "ENUM", "encoding", True),
        ("quality", "U8", "", True),
        ("after", "HASH", "", True),
    ]),
    "job": (0x0309, "S2C", [
        ("hash", "HASH", "", False),
        ("scene_revision", "U64", "", False),
    ]),
    "checkpoint_query": (0x030a, "C2S", [
        ("view", "U32", "", False),
        ("kind", "ENUM", "checkpoint_kind", True),
        ("offset", "U64", "", True),
    ]),
    "checkpoint": (0x030b, "S2C", [
        ("job", "HASH", "", False),
        ("samples", "U32", "", False),
        ("data", "BYTES", "", False),
        ("size", "U64", "", True),
    ]),
    "checkpoint_set": (0x030c, "C2S", [
        ("view", "U32", "", False),
        ("data", "BYTES", "", False),
        ("kind", "ENUM", "checkpoint_kind", True),
        ("offset", "U64", "", True),
        ("size", "U64", "", True),
    ]),
    "frame_part": (0x030d, "S2C", [
        ("offset", "U64", "", False),
        ("data", "BYTES", "", False),
    ]),
    "view_fit": (0x030e, "C2S", [
        ("view", "U32", "", False),
        ("node", "U64", "", True),
        ("azimuth_rad", "F32", "", True),
        ("elevation_rad", "F32", "", True),
        ("kind", "ENUM", "camera_kind", True),
        ("vfov_rad", "F32", "", True),
        ("margin", "F32", "", True),
        ("cameras", "BOOL", "", True),
        ("turntable", "BOOL", "", True),
    ]),
    "view_fitted": (0x030f, "S2C", [
        ("revision", "U64", "", False),
        ("empty", "BOOL", "", False),
        ("camera", "U64", "", False),
        ("eye", "VEC3", "", False),
        ("target", "VEC3", "", False),
        ("up", "VEC3", "", False),
        ("kind", "ENUM", "camera_kind", False),
        ("vfov_rad", "F32", "", False),
        ("half_height", "F32", "", False),
    ]),
    "exposure_query": (0x0310, "C2S", [
        ("view", "U32", "", False),
    ]),
    "exposure": (0x0311, "S2C", [
        ("mode", "ENUM", "exposure_mode", False),
        ("exposure_ev", "F32", "", False),
    ]),
    "taken": (0x0313, "C2S", [
        ("view", "U32", "", False),
        ("number", "U64", "", False),
        ("begun_ns", "U64", "", True),
        ("received_ns", "U64", "", True),
        ("rtt_ns", "U64", "", True),
    ]),
    "clock_query": (0x0314, "C2S", [
    ]),
    "clock": (0x0315, "S2C", [
        ("time_ns", "U64", "", False),
    ]),
    "key_frame": (0x0318, "C2S", [
        ("view", "U32", "", False),
        ("failed", "U8", "", True),
    ]),
    "view_codec": (0x0319, "S2C", [
        ("view", "U32", "", False),
        ("encoding", "ENUM", "encoding", False),
    ]),
    "pick": (0x0401, "C2S", [
        ("view", "U32", "", False),
        ("x", "U32", "", False),
        ("y", "U32", "", False),
    ]),
    "picked": (0x0402, "S2C", [
        ("revision", "U64", "", False),
        ("hit", "BOOL", "", False),
        ("node", "U64", "", False),
        ("mesh", "U64", "", False),
        ("material", "U64", "", False),
        ("part", "U32", "", False),
        ("triangle", "U32", "", False),
        ("position", "VEC3", "", False),
        ("normal", "VEC3", "", False),
        ("uv", "VEC2", "", False),
        ("distance", "F32", "", False),
    ]),
    "bounds_query": (0x0403, "C2S", [
        ("node", "U64", "", False),
    ]),
    "bounds": (0x0404, "S2C", [
        ("revision", "U64", "", False),
        ("empty", "BOOL", "", False),
        ("min", "VEC3", "", False),
        ("max", "VEC3", "", False),
    ]),
    "nodes_query": (0x0405, "C2S", [
        ("first", "U32", "", False),
        ("count", "U32", "", False),
    ]),
    "nodes": (0x0406, "S2C", [
        ("revision", "U64", "", False),
        ("total", "U32", "", False),
        ("nodes", "LIST", "node_entry", False),
    ]),
    "stats_query": (0x0407, "C2S", [
        ("view", "U32", "", False),
    ]),
    "sessions_query": (0x0408, "C2S", [
    ]),
    "info_query": (0x0409, "C2S", [
    ]),
    "json": (0x040a, "S2C", [
        ("text", "STR", "", False),
    ]),
    "compare": (0x040b, "C2S", [
        ("metric", "ENUM", "metric", False),
        ("a", "BYTES", "", False),
        ("b", "BYTES", "", False),
        ("want_diff", "BOOL", "", False),
        ("mask", "BYTES", "", True),
    ]),
    "compared": (0x040c, "S2C", [
        ("value", "F64", "", False),
        ("width", "U32", "", False),
        ("height", "U32", "", False),
        ("diff", "BYTES", "", False),
    ]),
    "bake": (0x040e, "C2S", [
        ("options", "STR", "", False),
    ]),
    "image_query": (0x040f, "C2S", [
        ("data", "BYTES", "", False),
        ("offset", "U64", "", True),
        ("size", "U64", "", True),
    ]),
    "quarantine_query": (0x0410, "C2S", [
    ]),
    "quarantine_clear": (0x0411, "C2S", [
        ("key", "STR", "", False),
    ]),
    "worker_ready": (0x0501, "W2B", [
        ("pid", "U32", "", False),
        ("device", "STR", "", False),
    ]),
    "session_attach": (0x0502, "B2W", [
        ("session", "U64", "", False),
        ("role", "ENUM", "role", False),
        ("scene", "STR", "", False),
        ("first_id", "U32", "", False),
        ("id_count", "U32", "", False),
        ("max_pixels", "U64", "", False),
        ("replay", "BOOL", "", False),
    ]),
    "session_detach": (0x0503, "B2W", [
    ]),
    "replay_end": (0x0504, "B2W", [
        ("revision", "U64", "", False),
    ]),
    "pulse": (0x0505, "W2B", [
        ("busy_ns", "U64", "", False),
        ("rss_bytes", "U64", "", False),
        ("views", "U32", "", False),
    ]),
    "session_tenant": (0x0506, "B2W", [
        ("tenant", "STR", "", False),
        ("weight", "U32", "", False),
    ]),
    "busy": (0x0507, "W2B", [
        ("channel", "U32", "", False),
        ("request", "U32", "", False),
        ("view", "U32", "", False),
    ]),
    "delivered": (0x0508, "B2W", [
        ("view", "U32", "", False),
        ("number", "U64", "", False),
        ("at_ns", "U64", "", False),
        ("begun_ns", "U64", "", True),
        ("received_ns", "U64", "", True),
        ("rtt_ns", "U64", "", True),
    ]),
}
