"""Messages of the protocol.

Written by client/python/generate.py from protocol/messages.def: do not edit."""
from __future__ import annotations

from typing import Dict, List, Tuple

# (field, kind, enum or list part, optional)
Field = Tuple[str, str, str, bool]

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
        ("uri", "STR", "", False), ("hash", "HASH", "", False),
    ]),
    "stage_time": (0x0000, "", [
        ("name", "STR", "", False), ("ns", "U64", "", False),
    ]),
    "node_entry": (0x0000, "", [
        ("node", "U64", "", False), ("parent", "U64", "", False), ("mesh", "U64", "", False),
        ("light", "U64", "", False), ("camera", "U64", "", False), ("visible", "BOOL", "", False),
        ("name", "STR", "", False),
    ]),
    "clip_plane": (0x0000, "", [
        ("normal", "VEC3", "", False), ("distance", "F32", "", False),
    ]),
    "node_override": (0x0000, "", [
        ("node", "U64", "", False), ("set", "U8", "", False), ("hidden", "BOOL", "", False),
        ("tint", "VEC4", "", False), ("selected", "BOOL", "", False), ("alpha", "F32", "", False),
    ]),
    "pixel_rect": (0x0000, "", [
        ("x", "U32", "", False), ("y", "U32", "", False), ("width", "U32", "", False),
        ("height", "U32", "", False),
    ]),
    "seen_node": (0x0000, "", [
        ("node", "U64", "", False), ("pixels", "U32", "", False), ("outside", "U32", "", False),
    ]),
    "mesh_part": (0x0000, "", [
        ("mode", "ENUM", "primitive_mode", False), ("material", "U64", "", False),
        ("positions", "BYTES", "", False), ("normals", "BYTES", "", False), ("tangents", "BYTES", "", False),
        ("uv0", "BYTES", "", False), ("uv1", "BYTES", "", False), ("colors", "BYTES", "", False),
        ("indices", "BYTES", "", False),
    ]),
    "participant": (0x0000, "", [
        ("session", "U64", "", False), ("role", "ENUM", "role", False), ("name", "STR", "", False),
        ("label", "STR", "", False), ("color", "U32", "", False), ("away", "BOOL", "", False),
    ]),
    "waiting_session": (0x0000, "", [
        ("session", "U64", "", False),
    ]),
    "annotation_entry": (0x0000, "", [
        ("annotation", "U64", "", False), ("kind", "ENUM", "annotation_kind", False),
        ("position", "VEC3", "", False), ("normal", "VEC3", "", False), ("node", "U64", "", False),
        ("color", "U32", "", False), ("text", "STR", "", False), ("author", "STR", "", False),
        ("label", "STR", "", False), ("own", "BOOL", "", False), ("time_ms", "U64", "", False),
        ("changed_ms", "U64", "", False),
    ]),
    "hello": (0x0101, "C2S", [
        ("version_min", "U16", "", False), ("version_max", "U16", "", False), ("client", "STR", "", False),
        ("capabilities", "LIST", "text", False),
    ]),
    "welcome": (0x0102, "S2C", [
        ("version", "U16", "", False), ("server", "STR", "", False), ("session", "U64", "", False),
        ("auth_required", "BOOL", "", False), ("role", "ENUM", "role", False),
        ("max_message_bytes", "U32", "", False), ("capabilities", "LIST", "text", False),
    ]),
    "auth": (0x0103, "C2S", [
        ("token", "STR", "", False),
    ]),
    "auth_ok": (0x0104, "S2C", [
        ("role", "ENUM", "role", False), ("name", "STR", "", False),
    ]),
    "error": (0x0105, "ANY", [
        ("code", "U16", "", False), ("what", "STR", "", False), ("where", "STR", "", False),
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
        ("deadline_ms", "U32", "", False), ("reason", "STR", "", False),
    ]),
    "bye": (0x010a, "ANY", [
        ("reason", "STR", "", False),
    ]),
    "progress": (0x010b, "S2C", [
        ("stage", "STR", "", False), ("done", "U64", "", False), ("total", "U64", "", False),
    ]),
    "notice": (0x010c, "S2C", [
        ("code", "U16", "", False), ("what", "STR", "", False), ("where", "STR", "", False),
        ("reason", "STR", "", False),
    ]),
    "keep": (0x010d, "C2S", [
    ]),
    "ticket": (0x010e, "S2C", [
        ("secret", "BYTES", "", False), ("valid_s", "U32", "", False),
    ]),
    "resume": (0x010f, "C2S", [
        ("secret", "BYTES", "", False),
    ]),
    "resumed": (0x0110, "S2C", [
        ("session", "U64", "", False), ("secret", "BYTES", "", False), ("valid_s", "U32", "", False),
        ("revision", "U64", "", False), ("first_id", "U32", "", False), ("id_count", "U32", "", False),
    ]),
    "scene_watch": (0x0130, "C2S", [
        ("participants", "BOOL", "", True), ("cursors", "BOOL", "", True), ("camera", "BOOL", "", True),
        ("annotations", "BOOL", "", True), ("edits", "BOOL", "", True),
    ]),
    "participant_set": (0x0131, "C2S", [
        ("label", "STR", "", True), ("color", "U32", "", True),
    ]),
    "participants": (0x0132, "S2C", [
        ("sessions", "LIST", "participant", False),
    ]),
    "cursor_set": (0x0133, "C2S", [
        ("shown", "BOOL", "", False), ("position", "VEC3", "", False), ("normal", "VEC3", "", False),
        ("node", "U64", "", False),
    ]),
    "cursor": (0x0134, "S2C", [
        ("session", "U64", "", False), ("shown", "BOOL", "", False), ("position", "VEC3", "", False),
        ("normal", "VEC3", "", False), ("node", "U64", "", False),
    ]),
    "edited": (0x0135, "S2C", [
        ("number", "U64", "", False), ("revision", "U64", "", False), ("session", "U64", "", False),
        ("message", "U16", "", False), ("object", "U64", "", False),
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
        ("view", "U32", "", False), ("follow", "BOOL", "", False),
    ]),
    "camera_state": (0x013b, "S2C", [
        ("holder", "U64", "", False), ("locked", "BOOL", "", False), ("change", "ENUM", "camera_change", False),
        ("waiting", "LIST", "waiting_session", False),
    ]),
    "camera_moved": (0x013c, "S2C", [
        ("session", "U64", "", False), ("input_seq", "U64", "", False), ("camera", "U64", "", True),
        ("eye", "VEC3", "", True), ("target", "VEC3", "", True), ("up", "VEC3", "", True),
        ("kind", "ENUM", "camera_kind", True), ("vfov_rad", "F32", "", True), ("half_height", "F32", "", True),
        ("near", "F32", "", True), ("far", "F32", "", True),
    ]),
    "annotation_set": (0x0140, "C2S", [
        ("annotation", "U64", "", False), ("kind", "ENUM", "annotation_kind", True),
        ("position", "VEC3", "", True), ("normal", "VEC3", "", True), ("node", "U64", "", True),
        ("color", "U32", "", True), ("text", "STR", "", True),
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
        ("scene", "STR", "", True), ("role", "ENUM", "role", True), ("uses", "U32", "", True),
        ("valid_s", "U32", "", True), ("label", "STR", "", True),
    ]),
    "join_ticket": (0x0149, "S2C", [
        ("ticket", "U64", "", False), ("secret", "STR", "", False), ("scene", "STR", "", False),
        ("role", "ENUM", "role", False), ("uses", "U32", "", False), ("valid_s", "U32", "", False),
    ]),
    "join_scene": (0x014a, "S2C", [
        ("scene", "STR", "", False),
    ]),
    "auth_resume": (0x014b, "C2S", [
        ("token", "STR", "", False), ("secret", "BYTES", "", False),
    ]),
    "join_query": (0x014c, "C2S", [
    ]),
    "join_revoke": (0x014d, "C2S", [
        ("ticket", "U64", "", False),
    ]),
    "message_send": (0x0150, "C2S", [
        ("text", "STR", "", False), ("session", "U64", "", True), ("scene", "STR", "", True),
    ]),
    "message": (0x0151, "S2C", [
        ("from", "STR", "", False), ("text", "STR", "", False),
    ]),
    "kick": (0x0152, "C2S", [
        ("session", "U64", "", False), ("reason", "STR", "", False), ("block_s", "U32", "", True),
    ]),
    "drain_set": (0x0153, "C2S", [
        ("deadline_ms", "U32", "", False), ("reason", "STR", "", False), ("stay", "BOOL", "", True),
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
        ("request", "U32", "", False), ("limit", "STR", "", False), ("retry_after_ms", "U32", "", False),
    ]),
    "drain_cancelled": (0x0158, "S2C", [
    ]),
    "scene_open": (0x0201, "C2S", [
        ("name", "STR", "", False),
    ]),
    "scene_opened": (0x0202, "S2C", [
        ("revision", "U64", "", False), ("existed", "BOOL", "", False), ("first_id", "U32", "", False),
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
        ("hash", "HASH", "", False), ("total", "U64", "", False), ("offset", "U64", "", False),
        ("data", "BYTES", "", False),
    ]),
    "asset_load": (0x0207, "C2S", [
        ("asset", "U32", "", False), ("path", "STR", "", False), ("files", "LIST", "asset_file", False),
        ("parent", "U64", "", True), ("transform", "MAT4", "", True), ("scene_index", "I32", "", True),
        ("variant", "STR", "", True), ("up", "ENUM", "up_axis", True), ("point_scale", "F32", "", True),
        ("point_diameter", "F32", "", True),
    ]),
    "asset_loaded": (0x0208, "S2C", [
        ("asset", "U32", "", False), ("revision", "U64", "", False), ("nodes", "U32", "", False),
        ("meshes", "U32", "", False), ("materials", "U32", "", False), ("textures", "U32", "", False),
        ("lights", "U32", "", False), ("cameras", "U32", "", False), ("animations", "U32", "", False),
        ("triangles", "U64", "", False), ("bounds_min", "VEC3", "", False), ("bounds_max", "VEC3", "", False),
        ("duration_s", "F64", "", False), ("up", "ENUM", "up_axis", True), ("up_reason", "STR", "", True),
    ]),
    "asset_unload": (0x0209, "C2S", [
        ("asset", "U32", "", False),
    ]),
    "mesh_set": (0x020a, "C2S", [
        ("mesh", "U64", "", False), ("parts", "LIST", "mesh_part", False),
    ]),
    "texture_set": (0x020b, "C2S", [
        ("texture", "U64", "", False), ("format", "ENUM", "pixel_format", False), ("width", "U32", "", False),
        ("height", "U32", "", False), ("wrap_s", "ENUM", "wrap", False), ("wrap_t", "ENUM", "wrap", False),
        ("nearest", "BOOL", "", False), ("pixels", "BYTES", "", False),
    ]),
    "material_set": (0x020c, "C2S", [
        ("material", "U64", "", False), ("base_color", "VEC4", "", True), ("metallic", "F32", "", True),
        ("roughness", "F32", "", True), ("emissive", "VEC3", "", True), ("emissive_strength", "F32", "", True),
        ("normal_scale", "F32", "", True), ("occlusion_strength", "F32", "", True),
        ("alpha_mode", "ENUM", "alpha_mode", True), ("alpha_cutoff", "F32", "", True),
        ("double_sided", "BOOL", "", True), ("unlit", "BOOL", "", True), ("base_color_texture", "U64", "", True),
        ("metallic_roughness_texture", "U64", "", True), ("normal_texture", "U64", "", True),
        ("occlusion_texture", "U64", "", True), ("emissive_texture", "U64", "", True), ("name", "STR", "", True),
    ]),
    "node_set": (0x020d, "C2S", [
        ("node", "U64", "", False), ("parent", "U64", "", True), ("translation", "VEC3", "", True),
        ("rotation", "VEC4", "", True), ("scale", "VEC3", "", True), ("visible", "BOOL", "", True),
        ("mesh", "U64", "", True), ("light", "U64", "", True), ("camera", "U64", "", True),
        ("name", "STR", "", True), ("catches_shadows", "BOOL", "", True), ("next_translation", "VEC3", "", True),
        ("next_rotation", "VEC4", "", True), ("next_scale", "VEC3", "", True), ("layers", "U32", "", True),
    ]),
    "light_set": (0x020e, "C2S", [
        ("light", "U64", "", False), ("kind", "ENUM", "light_kind", True), ("color", "VEC3", "", True),
        ("intensity", "F32", "", True), ("range", "F32", "", True), ("inner_cone_rad", "F32", "", True),
        ("outer_cone_rad", "F32", "", True), ("casts_shadow", "BOOL", "", True), ("radius", "F32", "", True),
        ("width", "F32", "", True), ("height", "F32", "", True), ("angular_diameter_rad", "F32", "", True),
        ("lumens", "F32", "", True), ("profile", "BYTES", "", True), ("profile_absolute", "BOOL", "", True),
        ("texture", "U64", "", True),
    ]),
    "camera_set": (0x020f, "C2S", [
        ("camera", "U64", "", False), ("kind", "ENUM", "camera_kind", True), ("vfov_rad", "F32", "", True),
        ("half_height", "F32", "", True), ("near", "F32", "", True), ("far", "F32", "", True),
    ]),
    "environment_set": (0x0210, "C2S", [
        ("kind", "ENUM", "environment_kind", True), ("path", "STR", "", True), ("hash", "HASH", "", True),
        ("color", "VEC3", "", True), ("intensity", "F32", "", True), ("rotation_rad", "F32", "", True),
        ("sun_direction", "VEC3", "", True), ("turbidity", "F32", "", True), ("sun", "BOOL", "", True),
    ]),
    "animation_set": (0x0211, "C2S", [
        ("asset", "U32", "", False), ("animation", "I32", "", False), ("time_s", "F64", "", False),
    ]),
    "variant_set": (0x0212, "C2S", [
        ("asset", "U32", "", False), ("variant", "STR", "", False),
    ]),
    "object_remove": (0x0213, "C2S", [
        ("kind", "ENUM", "object_kind", False), ("object", "U64", "", False),
    ]),
    "batch_begin": (0x0214, "C2S", [
    ]),
    "batch_end": (0x0215, "C2S", [
    ]),
    "view_set": (0x0301, "C2S", [
        ("view", "U32", "", False), ("width", "U32", "", True), ("height", "U32", "", True),
        ("mode", "ENUM", "render_mode", True), ("encoding", "ENUM", "encoding", True),
        ("still_encoding", "ENUM", "encoding", True), ("quality", "U8", "", True),
        ("tonemap", "ENUM", "tonemap", True), ("exposure_ev", "F32", "", True),
        ("background", "ENUM", "background", True), ("background_color", "VEC3", "", True),
        ("samples", "U32", "", True), ("seed", "U32", "", True), ("max_fps", "F32", "", True),
        ("debug_view", "ENUM", "debug_view", True), ("error_px", "F32", "", True), ("target_ms", "F32", "", True),
        ("trace", "ENUM", "trace_backend", True), ("max_bounces", "U32", "", True), ("noise", "F32", "", True),
        ("time_limit_s", "F32", "", True), ("planes", "U32", "", True), ("denoise", "ENUM", "denoise", True),
        ("frame_s", "F32", "", True), ("shutter_open", "F32", "", True), ("shutter_close", "F32", "", True),
        ("series_s", "F32", "", True), ("filter", "ENUM", "filter", True), ("filter_radius_px", "F32", "", True),
        ("clamp_indirect", "F32", "", True), ("exposure_mode", "ENUM", "exposure_mode", True),
        ("ground", "ENUM", "ground", True), ("region", "VEC4", "", True), ("gi", "ENUM", "gi", True),
        ("temporal", "ENUM", "temporal", True), ("scale", "F32", "", True),
        ("reflections", "ENUM", "reflections", True), ("f_number", "F32", "", True),
        ("shutter_s", "F32", "", True), ("iso", "F32", "", True), ("sensor_mm", "F32", "", True),
        ("ao", "ENUM", "ao", True), ("mirrors", "ENUM", "mirrors", True),
        ("shadow_maps", "ENUM", "shadow_maps", True), ("sharpen", "F32", "", True), ("codecs", "BYTES", "", True),
        ("bitrate", "U32", "", True), ("target_fps", "F32", "", True), ("hidden", "U8", "", True),
        ("names", "U8", "", True), ("layers", "U32", "", True), ("depth", "U8", "", True),
    ]),
    "view_close": (0x0302, "C2S", [
        ("view", "U32", "", False),
    ]),
    "view_camera": (0x0303, "C2S", [
        ("view", "U32", "", False), ("input_seq", "U64", "", False), ("camera", "U64", "", True),
        ("eye", "VEC3", "", True), ("target", "VEC3", "", True), ("up", "VEC3", "", True),
        ("kind", "ENUM", "camera_kind", True), ("vfov_rad", "F32", "", True), ("half_height", "F32", "", True),
        ("near", "F32", "", True), ("far", "F32", "", True), ("next_eye", "VEC3", "", True),
        ("next_target", "VEC3", "", True), ("next_up", "VEC3", "", True), ("lens_radius", "F32", "", True),
        ("focus_distance", "F32", "", True), ("received_ns", "U64", "", True),
    ]),
    "frame_request": (0x0304, "C2S", [
        ("view", "U32", "", False), ("settled", "BOOL", "", False), ("encoding", "ENUM", "encoding", True),
        ("quality", "U8", "", True), ("parts", "BOOL", "", True), ("rate_numerator", "U32", "", True),
        ("rate_denominator", "U32", "", True),
    ]),
    "subscribe": (0x0305, "C2S", [
        ("view", "U32", "", False), ("credit_frames", "U32", "", False),
    ]),
    "credit": (0x0306, "C2S", [
        ("view", "U32", "", False), ("frames", "U32", "", False),
    ]),
    "frame": (0x0307, "S2C", [
        ("view", "U32", "", False), ("number", "U64", "", False), ("scene_revision", "U64", "", False),
        ("input_seq", "U64", "", False), ("width", "U32", "", False), ("height", "U32", "", False),
        ("encoding", "ENUM", "encoding", False), ("samples", "U32", "", False),
        ("missing_pages", "U32", "", False), ("missing_clusters", "U32", "", False),
        ("settled", "BOOL", "", False), ("lossless", "BOOL", "", False), ("hash", "HASH", "", True),
        ("stages", "LIST", "stage_time", False), ("data", "BYTES", "", False), ("mip_bias", "F32", "", True),
        ("error_px", "F32", "", True), ("mode", "ENUM", "render_mode", True), ("noise", "F32", "", True),
        ("job", "HASH", "", True), ("size", "U64", "", True), ("exposure_ev", "F32", "", True),
        ("black", "F32", "", True), ("clipped", "F32", "", True), ("depends", "U32", "", True),
        ("codec", "STR", "", True), ("input_ns", "U64", "", True), ("taken_ns", "U64", "", True),
        ("render_begin_ns", "U64", "", True), ("render_end_ns", "U64", "", True),
        ("encode_begin_ns", "U64", "", True), ("encode_end_ns", "U64", "", True), ("sent_ns", "U64", "", True),
        ("depth", "BYTES", "", True), ("eye", "VEC3", "", True), ("forward", "VEC3", "", True),
        ("up", "VEC3", "", True), ("kind", "ENUM", "camera_kind", True), ("vfov_rad", "F32", "", True),
        ("half_height", "F32", "", True),
    ]),
    "job_query": (0x0308, "C2S", [
        ("view", "U32", "", False), ("encoding", "ENUM", "encoding", True), ("quality", "U8", "", True),
        ("after", "HASH", "", True),
    ]),
    "job": (0x0309, "S2C", [
        ("hash", "HASH", "", False), ("scene_revision", "U64", "", False),
    ]),
    "checkpoint_query": (0x030a, "C2S", [
        ("view", "U32", "", False), ("kind", "ENUM", "checkpoint_kind", True), ("offset", "U64", "", True),
    ]),
    "checkpoint": (0x030b, "S2C", [
        ("job", "HASH", "", False), ("samples", "U32", "", False), ("data", "BYTES", "", False),
        ("size", "U64", "", True),
    ]),
    "checkpoint_set": (0x030c, "C2S", [
        ("view", "U32", "", False), ("data", "BYTES", "", False), ("kind", "ENUM", "checkpoint_kind", True),
        ("offset", "U64", "", True), ("size", "U64", "", True),
    ]),
    "frame_part": (0x030d, "S2C", [
        ("offset", "U64", "", False), ("data", "BYTES", "", False),
    ]),
    "view_fit": (0x030e, "C2S", [
        ("view", "U32", "", False), ("node", "U64", "", True), ("azimuth_rad", "F32", "", True),
        ("elevation_rad", "F32", "", True), ("kind", "ENUM", "camera_kind", True), ("vfov_rad", "F32", "", True),
        ("margin", "F32", "", True), ("cameras", "BOOL", "", True), ("turntable", "BOOL", "", True),
    ]),
    "view_fitted": (0x030f, "S2C", [
        ("revision", "U64", "", False), ("empty", "BOOL", "", False), ("camera", "U64", "", False),
        ("eye", "VEC3", "", False), ("target", "VEC3", "", False), ("up", "VEC3", "", False),
        ("kind", "ENUM", "camera_kind", False), ("vfov_rad", "F32", "", False), ("half_height", "F32", "", False),
    ]),
    "exposure_query": (0x0310, "C2S", [
        ("view", "U32", "", False),
    ]),
    "exposure": (0x0311, "S2C", [
        ("mode", "ENUM", "exposure_mode", False), ("exposure_ev", "F32", "", False),
    ]),
    "frame_cancel": (0x0312, "C2S", [
        ("view", "U32", "", False), ("request", "U32", "", False),
    ]),
    "taken": (0x0313, "C2S", [
        ("view", "U32", "", False), ("number", "U64", "", False), ("begun_ns", "U64", "", True),
        ("received_ns", "U64", "", True), ("rtt_ns", "U64", "", True),
    ]),
    "clock_query": (0x0314, "C2S", [
    ]),
    "clock": (0x0315, "S2C", [
        ("time_ns", "U64", "", False),
    ]),
    "key_frame": (0x0318, "C2S", [
        ("view", "U32", "", False), ("failed", "U8", "", True),
    ]),
    "view_codec": (0x0319, "S2C", [
        ("view", "U32", "", False), ("encoding", "ENUM", "encoding", False),
    ]),
    "view_clip": (0x0320, "C2S", [
        ("view", "U32", "", False), ("planes", "LIST", "clip_plane", False), ("caps", "ENUM", "cap_style", True),
        ("cap_color", "VEC3", "", True), ("hatch_px", "F32", "", True),
    ]),
    "view_overrides": (0x0321, "C2S", [
        ("view", "U32", "", False), ("overrides", "LIST", "node_override", False), ("clear", "BOOL", "", True),
        ("select_color", "VEC3", "", True),
    ]),
    "view_variant": (0x0322, "C2S", [
        ("view", "U32", "", False), ("asset", "U32", "", False), ("variant", "STR", "", True),
    ]),
    "pick": (0x0401, "C2S", [
        ("view", "U32", "", False), ("x", "U32", "", False), ("y", "U32", "", False),
    ]),
    "picked": (0x0402, "S2C", [
        ("revision", "U64", "", False), ("hit", "BOOL", "", False), ("node", "U64", "", False),
        ("mesh", "U64", "", False), ("material", "U64", "", False), ("part", "U32", "", False),
        ("triangle", "U32", "", False), ("position", "VEC3", "", False), ("normal", "VEC3", "", False),
        ("uv", "VEC2", "", False), ("distance", "F32", "", False),
    ]),
    "bounds_query": (0x0403, "C2S", [
        ("node", "U64", "", False),
    ]),
    "bounds": (0x0404, "S2C", [
        ("revision", "U64", "", False), ("empty", "BOOL", "", False), ("min", "VEC3", "", False),
        ("max", "VEC3", "", False),
    ]),
    "nodes_query": (0x0405, "C2S", [
        ("first", "U32", "", False), ("count", "U32", "", False),
    ]),
    "nodes": (0x0406, "S2C", [
        ("revision", "U64", "", False), ("total", "U32", "", False), ("nodes", "LIST", "node_entry", False),
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
        ("metric", "ENUM", "metric", False), ("a", "BYTES", "", False), ("b", "BYTES", "", False),
        ("want_diff", "BOOL", "", False), ("mask", "BYTES", "", True),
    ]),
    "compared": (0x040c, "S2C", [
        ("value", "F64", "", False), ("width", "U32", "", False), ("height", "U32", "", False),
        ("diff", "BYTES", "", False),
    ]),
    "bake": (0x040e, "C2S", [
        ("options", "STR", "", False),
    ]),
    "image_query": (0x040f, "C2S", [
        ("data", "BYTES", "", False), ("offset", "U64", "", True), ("size", "U64", "", True),
    ]),
    "quarantine_query": (0x0410, "C2S", [
    ]),
    "quarantine_clear": (0x0411, "C2S", [
        ("key", "STR", "", False),
    ]),
    "box_select": (0x0412, "C2S", [
        ("view", "U32", "", False), ("rects", "LIST", "pixel_rect", False), ("inside", "BOOL", "", True),
        ("frame", "U64", "", True),
    ]),
    "box_selected": (0x0413, "S2C", [
        ("revision", "U64", "", False), ("frame", "U64", "", False), ("total", "U32", "", False),
        ("nodes", "LIST", "seen_node", False),
    ]),
    "surface_query": (0x0414, "C2S", [
        ("view", "U32", "", False), ("x", "U32", "", False), ("y", "U32", "", False), ("width", "U32", "", False),
        ("height", "U32", "", False), ("what", "U32", "", False), ("frame", "U64", "", True),
    ]),
    "surfaces": (0x0415, "S2C", [
        ("revision", "U64", "", False), ("frame", "U64", "", False), ("width", "U32", "", False),
        ("height", "U32", "", False), ("what", "U32", "", False), ("data", "BYTES", "", False),
    ]),
    "measure": (0x0416, "C2S", [
        ("view", "U32", "", False), ("x0", "U32", "", False), ("y0", "U32", "", False), ("x1", "U32", "", False),
        ("y1", "U32", "", False), ("frame", "U64", "", True),
    ]),
    "measured": (0x0417, "S2C", [
        ("revision", "U64", "", False), ("frame", "U64", "", False), ("hit", "BOOL", "", False),
        ("node0", "U64", "", False), ("node1", "U64", "", False), ("position0", "VEC3", "", False),
        ("position1", "VEC3", "", False), ("normal0", "VEC3", "", False), ("normal1", "VEC3", "", False),
        ("distance", "F32", "", False), ("along_normal", "F32", "", False), ("angle_rad", "F32", "", False),
    ]),
    "worker_ready": (0x0501, "W2B", [
        ("pid", "U32", "", False), ("device", "STR", "", False),
    ]),
    "session_attach": (0x0502, "B2W", [
        ("session", "U64", "", False), ("role", "ENUM", "role", False), ("scene", "STR", "", False),
        ("first_id", "U32", "", False), ("id_count", "U32", "", False), ("max_pixels", "U64", "", False),
        ("replay", "BOOL", "", False),
    ]),
    "session_detach": (0x0503, "B2W", [
    ]),
    "replay_end": (0x0504, "B2W", [
        ("revision", "U64", "", False),
    ]),
    "pulse": (0x0505, "W2B", [
        ("busy_ns", "U64", "", False), ("rss_bytes", "U64", "", False), ("views", "U32", "", False),
    ]),
    "session_tenant": (0x0506, "B2W", [
        ("tenant", "STR", "", False), ("weight", "U32", "", False), ("roots", "STR", "", True),
    ]),
    "busy": (0x0507, "W2B", [
        ("channel", "U32", "", False), ("request", "U32", "", False), ("view", "U32", "", False),
    ]),
    "delivered": (0x0508, "B2W", [
        ("view", "U32", "", False), ("number", "U64", "", False), ("at_ns", "U64", "", False),
        ("begun_ns", "U64", "", True), ("received_ns", "U64", "", True), ("rtt_ns", "U64", "", True),
    ]),
}

# Least and greatest value of integers that have not all of their kind.
RANGES: Dict[str, Dict[str, Tuple[int, int]]] = {
    "node_override": {
        "node": (1, 18446744073709551615), "set": (0, 15),
    },
    "pixel_rect": {
        "x": (0, 16383), "y": (0, 16383), "width": (1, 16384), "height": (1, 16384),
    },
    "participant": {
        "session": (1, 18446744073709551615), "color": (0, 16777215),
    },
    "waiting_session": {
        "session": (1, 18446744073709551615),
    },
    "annotation_entry": {
        "annotation": (1, 18446744073709551615), "color": (0, 16777215),
    },
    "hello": {
        "version_min": (1, 65535), "version_max": (1, 65535),
    },
    "welcome": {
        "version": (1, 65535), "max_message_bytes": (1024, 4294967295),
    },
    "error": {
        "code": (1, 65535),
    },
    "participant_set": {
        "color": (0, 16777215),
    },
    "cursor": {
        "session": (1, 18446744073709551615),
    },
    "edited": {
        "number": (1, 18446744073709551615), "message": (1, 65535),
    },
    "camera_follow": {
        "view": (1, 4294967295),
    },
    "annotation_set": {
        "color": (0, 16777215),
    },
    "annotation_remove": {
        "annotation": (1, 18446744073709551615),
    },
    "annotation_removed": {
        "annotation": (1, 18446744073709551615),
    },
    "join_make": {
        "uses": (1, 1000000), "valid_s": (1, 31536000),
    },
    "join_ticket": {
        "ticket": (1, 18446744073709551615), "uses": (1, 1000000), "valid_s": (1, 31536000),
    },
    "kick": {
        "session": (1, 18446744073709551615), "block_s": (0, 31536000),
    },
    "drain_set": {
        "deadline_ms": (0, 86400000),
    },
    "sessions_watch": {
        "interval_ms": (0, 3600000),
    },
    "scene_opened": {
        "first_id": (1, 4294967295), "id_count": (1, 4294967295),
    },
    "upload": {
        "total": (0, 1099511627776), "offset": (0, 1099511627776),
    },
    "asset_load": {
        "asset": (1, 4294967295), "scene_index": (-1, 2147483647),
    },
    "asset_loaded": {
        "asset": (1, 4294967295),
    },
    "asset_unload": {
        "asset": (1, 4294967295),
    },
    "mesh_set": {
        "mesh": (1, 18446744073709551615),
    },
    "texture_set": {
        "texture": (1, 18446744073709551615), "width": (0, 65536), "height": (0, 65536),
    },
    "material_set": {
        "material": (1, 18446744073709551615),
    },
    "node_set": {
        "node": (1, 18446744073709551615),
    },
    "light_set": {
        "light": (1, 18446744073709551615),
    },
    "camera_set": {
        "camera": (1, 18446744073709551615),
    },
    "animation_set": {
        "asset": (1, 4294967295), "animation": (-1, 2147483647),
    },
    "variant_set": {
        "asset": (1, 4294967295),
    },
    "object_remove": {
        "object": (1, 18446744073709551615),
    },
    "view_set": {
        "view": (1, 4294967295), "width": (1, 16384), "height": (1, 16384), "quality": (1, 100),
        "samples": (1, 65536), "max_bounces": (1, 256), "planes": (0, 8388607), "bitrate": (0, 1000000000),
        "hidden": (0, 1), "names": (0, 1), "depth": (0, 1),
    },
    "view_close": {
        "view": (1, 4294967295),
    },
    "view_camera": {
        "view": (1, 4294967295),
    },
    "frame_request": {
        "view": (1, 4294967295), "quality": (1, 100), "rate_numerator": (1, 4294967295),
        "rate_denominator": (1, 4294967295),
    },
    "subscribe": {
        "view": (1, 4294967295), "credit_frames": (0, 1024),
    },
    "credit": {
        "view": (1, 4294967295), "frames": (1, 1024),
    },
    "frame": {
        "view": (1, 4294967295), "width": (1, 16384), "height": (1, 16384), "size": (1, 18446744073709551615),
        "depends": (1, 4294967295),
    },
    "job_query": {
        "view": (1, 4294967295), "quality": (1, 100),
    },
    "checkpoint_query": {
        "view": (1, 4294967295),
    },
    "checkpoint_set": {
        "view": (1, 4294967295), "size": (1, 18446744073709551615),
    },
    "view_fit": {
        "view": (1, 4294967295),
    },
    "exposure_query": {
        "view": (1, 4294967295),
    },
    "frame_cancel": {
        "view": (1, 4294967295),
    },
    "taken": {
        "view": (1, 4294967295),
    },
    "key_frame": {
        "view": (1, 4294967295),
    },
    "view_codec": {
        "view": (1, 4294967295),
    },
    "view_clip": {
        "view": (1, 4294967295),
    },
    "view_overrides": {
        "view": (1, 4294967295),
    },
    "view_variant": {
        "view": (1, 4294967295), "asset": (1, 4294967295),
    },
    "pick": {
        "view": (1, 4294967295), "x": (0, 16383), "y": (0, 16383),
    },
    "nodes_query": {
        "count": (1, 4096),
    },
    "compared": {
        "width": (0, 65536), "height": (0, 65536),
    },
    "image_query": {
        "size": (1, 18446744073709551615),
    },
    "box_select": {
        "view": (1, 4294967295),
    },
    "surface_query": {
        "view": (1, 4294967295), "x": (0, 16383), "y": (0, 16383), "width": (1, 16384), "height": (1, 16384),
        "what": (1, 31),
    },
    "surfaces": {
        "width": (1, 16384), "height": (1, 16384), "what": (1, 31),
    },
    "measure": {
        "view": (1, 4294967295), "x0": (0, 16383), "y0": (0, 16383), "x1": (0, 16383), "y1": (0, 16383),
    },
    "worker_ready": {
        "pid": (1, 4294967295),
    },
    "session_attach": {
        "first_id": (1, 4294967295), "id_count": (1, 4294967295), "max_pixels": (1, 18446744073709551615),
    },
    "session_tenant": {
        "weight": (1, 10000),
    },
    "delivered": {
        "view": (1, 4294967295),
    },
}
