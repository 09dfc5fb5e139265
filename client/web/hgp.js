// hgp.js - the Heliograph protocol: framing and message codec. Bytes in, objects out.
// Made by protocol/gen from protocol/messages.def and protocol/gen/runtime.js; change those,
// then build the target protocol_update. No dependencies; browsers and Node.

export const VERSION_MIN = 1;
export const VERSION_MAX = 1;
export const LIMIT_BEFORE_AUTH = 16384;

// Codes of error and notice messages, by name.
export const status = {
    "ok": 0,
    "invalid": 1,
    "no-memory": 2,
    "limit": 3,
    "io": 4,
    "no-space": 5,
    "format": 6,
    "unsupported": 7,
    "not-found": 8,
    "exists": 9,
    "not-allowed": 10,
    "auth": 11,
    "state": 12,
    "version": 13,
    "again": 14,
    "truncated": 15,
    "closed": 16,
    "timeout": 17,
    "cancelled": 18,
    "device": 19,
    "device-lost": 20,
    "worker": 21,
    "hash": 22,
    "busy": 23,
    "internal": 24,
};

export const enums = {
    role: { NONE: 0, VIEW: 1, EDIT: 2, ADMIN: 3 },
    encoding: { RAW_RGBA8: 0, RAW_RGBA32F: 1, ZSTD_RGBA8: 2, PNG8: 3, PNG16: 4, JPEG: 5, EXR_HALF: 6, EXR_FLOAT: 7, JPEG_444: 8, H264: 9, H264_444: 10, AV1: 11, TILES: 12, TILES_JPEG: 13 },
    render_mode: { REALTIME: 0, PATH: 1 },
    trace_backend: { AUTO: 0, EMBREE: 1, COMPUTE: 2, KHR: 3 },
    denoise: { OFF: 0, STILL: 1, ANIMATION: 2 },
    checkpoint_kind: { FILM: 0, HISTORY: 1 },
    plane: { COLOR: 0, ALBEDO: 1, NORMAL: 2, GEOMETRIC_NORMAL: 3, DEPTH: 4, POSITION: 5, EMISSION: 6, DIRECT_DIFFUSE: 7, DIRECT_SPECULAR: 8, DIRECT_TRANSMISSION: 9, INDIRECT_DIFFUSE: 10, INDIRECT_SPECULAR: 11, INDIRECT_TRANSMISSION: 12, MOTION: 13, OBJECT: 14, MATERIAL: 15, SAMPLES: 16, VARIANCE: 17, LIGHT_GROUPS: 18, CRYPTO_OBJECT: 19, CRYPTO_MATERIAL: 20, CRYPTO_ASSET: 21, NOISY: 22 },
    tonemap: { ACES: 0, AGX: 1, PBR_NEUTRAL: 2, LINEAR: 3 },
    exposure_mode: { FIXED: 0, AUTO: 1, CAMERA: 2 },
    filter: { BLACKMAN_HARRIS: 0, BOX: 1, TENT: 2, GAUSSIAN: 3 },
    background: { ENV: 0, NONE: 1, COLOR: 2, BLUR: 3, DISPLAY: 4 },
    ao: { AUTO: 0, NONE: 1 },
    mirrors: { AUTO: 0, NONE: 1 },
    shadow_maps: { AUTO: 0, CASCADES: 1, VIRTUAL: 2 },
    temporal: { NONE: 0, AUTO: 1, CHECKERBOARD: 2 },
    gi: { NONE: 0, AUTO: 1, RAYS: 2, PROBES: 3 },
    reflections: { ENVIRONMENT: 0, AUTO: 1, RAYS: 2, CACHE: 3 },
    ground: { NONE: 0, Y: 1, Z: 2, X: 3, MINUS_Y: 4, MINUS_Z: 5, MINUS_X: 6 },
    cap_style: { MATERIAL: 0, COLOR: 1, HATCH: 2, NONE: 3 },
    environment_kind: { NONE: 0, COLOR: 1, FILE: 2, SKY: 3, AUTO: 4 },
    camera_kind: { PERSPECTIVE: 0, ORTHOGRAPHIC: 1 },
    up_axis: { AUTO: 0, X: 1, Y: 2, Z: 3, MINUS_X: 4, MINUS_Y: 5, MINUS_Z: 6 },
    light_kind: { DIRECTIONAL: 0, POINT: 1, SPOT: 2, RECTANGLE: 3, DISC: 4, TUBE: 5 },
    alpha_mode: { OPAQUE: 0, MASK: 1, BLEND: 2 },
    primitive_mode: { POINTS: 0, LINES: 1, LINE_LOOP: 2, LINE_STRIP: 3, TRIANGLES: 4, TRIANGLE_STRIP: 5, TRIANGLE_FAN: 6 },
    pixel_format: { RGBA8_SRGB: 0, RGBA8_LINEAR: 1, RGBA32F: 2, FILE: 3 },
    wrap: { REPEAT: 0, CLAMP: 1, MIRROR: 2 },
    object_kind: { NODE: 0, MESH: 1, MATERIAL: 2, TEXTURE: 3, LIGHT: 4, CAMERA: 5 },
    debug_view: { OFF: 0, MIP: 1, RESIDENCY: 2, MISSING: 3, CLUSTER: 4, LOD: 5, OVERDRAW: 6, MOTION: 7, HISTORY: 8, PROBES: 9, IRRADIANCE: 10, SHADOWS: 11, REFLECTIONS: 12, SCALE: 13, SHADOW_PAGES: 14 },
    camera_change: { NONE: 0, REQUESTED: 1, TAKEN: 2, GIVEN: 3, RELEASED: 4, INACTIVE: 5, TURN_OVER: 6, LEFT: 7, LOCK: 8, WAITING: 9 },
    annotation_kind: { MARKER: 0, TEXT: 1 },
    metric: { PSNR: 0, SSIM: 1, FLIP: 2, RMSE: 3, MAX: 4 },
};

// Parts of lists.
export const structs = {
    // one string
    text: [
        { name: "value", kind: "str", max: 256, since: 1 },
    ],
    // one content hash
    content: [
        { name: "hash", kind: "hash", since: 1 },
    ],
    // one answer
    flag: [
        { name: "value", kind: "bool", since: 1 },
    ],
    // a file of an uploaded asset
    asset_file: [
        { name: "uri", kind: "str", max: 1024, since: 1 },
        { name: "hash", kind: "hash", since: 1 },
    ],
    // how long a stage of a frame took
    stage_time: [
        { name: "name", kind: "str", max: 32, since: 1 },
        { name: "ns", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
    ],
    // a node in a list
    node_entry: [
        { name: "node", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
        { name: "parent", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
        { name: "mesh", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
        { name: "light", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
        { name: "camera", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
        { name: "visible", kind: "bool", since: 1 },
        { name: "name", kind: "str", max: 256, since: 1 },
    ],
    // a clipping plane: what is shown has dot(normal, p) >= distance
    clip_plane: [
        { name: "normal", kind: "vec3", since: 1 },
        { name: "distance", kind: "f32", least: -1e+09, most: 1e+09, since: 1 },
    ],
    // how one view shows a node and what is below it; of each property the nearest node that sets it counts
    node_override: [
        { name: "node", kind: "u64", least: 1n, most: 18446744073709551615n, since: 1 },
        { name: "set", kind: "u8", least: 0, most: 15, since: 1 },
        { name: "hidden", kind: "bool", since: 1 },
        { name: "tint", kind: "vec4", since: 1 },
        { name: "selected", kind: "bool", since: 1 },
        { name: "alpha", kind: "f32", least: 0, most: 1, since: 1 },
    ],
    // pixels of a picture
    pixel_rect: [
        { name: "x", kind: "u32", least: 0, most: 16383, since: 1 },
        { name: "y", kind: "u32", least: 0, most: 16383, since: 1 },
        { name: "width", kind: "u32", least: 1, most: 16384, since: 1 },
        { name: "height", kind: "u32", least: 1, most: 16384, since: 1 },
    ],
    // a node whose surfaces are seen
    seen_node: [
        { name: "node", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
        { name: "pixels", kind: "u32", least: 0, most: 4294967295, since: 1 },
        { name: "outside", kind: "u32", least: 0, most: 4294967295, since: 1 },
    ],
    // one primitive of a mesh made by a client
    mesh_part: [
        { name: "mode", kind: "enum", values: "primitive_mode", since: 1 },
        { name: "material", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
        { name: "positions", kind: "bytes", max: 67108864, since: 1 },
        { name: "normals", kind: "bytes", max: 67108864, since: 1 },
        { name: "tangents", kind: "bytes", max: 67108864, since: 1 },
        { name: "uv0", kind: "bytes", max: 67108864, since: 1 },
        { name: "uv1", kind: "bytes", max: 67108864, since: 1 },
        { name: "colors", kind: "bytes", max: 67108864, since: 1 },
        { name: "indices", kind: "bytes", max: 67108864, since: 1 },
    ],
    // a session that has a scene open
    participant: [
        { name: "session", kind: "u64", least: 1n, most: 18446744073709551615n, since: 1 },
        { name: "role", kind: "enum", values: "role", since: 1 },
        { name: "name", kind: "str", max: 128, since: 1 },
        { name: "label", kind: "str", max: 64, since: 1 },
        { name: "color", kind: "u32", least: 0, most: 16777215, since: 1 },
        { name: "away", kind: "bool", since: 1 },
    ],
    // a session that waits for the shared camera
    waiting_session: [
        { name: "session", kind: "u64", least: 1n, most: 18446744073709551615n, since: 1 },
    ],
    // a text or marker in a scene
    annotation_entry: [
        { name: "annotation", kind: "u64", least: 1n, most: 18446744073709551615n, since: 1 },
        { name: "kind", kind: "enum", values: "annotation_kind", since: 1 },
        { name: "position", kind: "vec3", since: 1 },
        { name: "normal", kind: "vec3", since: 1 },
        { name: "node", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
        { name: "color", kind: "u32", least: 0, most: 16777215, since: 1 },
        { name: "text", kind: "str", max: 2048, since: 1 },
        { name: "author", kind: "str", max: 128, since: 1 },
        { name: "label", kind: "str", max: 64, since: 1 },
        { name: "own", kind: "bool", since: 1 },
        { name: "time_ms", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
        { name: "changed_ms", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
    ],
};

export const messages = {
    // first message of a connection
    hello: {
        type: 0x0101, direction: "C2S", state: "HELLO", role: "NONE", since: 1,
        fields: [
            { name: "version_min", kind: "u16", least: 1, most: 65535, since: 1 },
            { name: "version_max", kind: "u16", least: 1, most: 65535, since: 1 },
            { name: "client", kind: "str", max: 128, since: 1 },
            { name: "capabilities", kind: "list", items: "text", max: 64, since: 1 },
        ],
    },
    // answer to hello
    welcome: {
        type: 0x0102, direction: "S2C", state: "HELLO", role: "NONE", since: 1,
        fields: [
            { name: "version", kind: "u16", least: 1, most: 65535, since: 1 },
            { name: "server", kind: "str", max: 128, since: 1 },
            { name: "session", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "auth_required", kind: "bool", since: 1 },
            { name: "role", kind: "enum", values: "role", since: 1 },
            { name: "max_message_bytes", kind: "u32", least: 1024, most: 4294967295, since: 1 },
            { name: "capabilities", kind: "list", items: "text", max: 64, since: 1 },
        ],
    },
    // present a token, or a join ticket: what join_scene says comes before auth_ok then
    auth: {
        type: 0x0103, direction: "C2S", state: "AUTH", role: "NONE", since: 1,
        fields: [
            { name: "token", kind: "str", max: 256, since: 1 },
        ],
    },
    // the session is open
    auth_ok: {
        type: 0x0104, direction: "S2C", state: "AUTH", role: "NONE", since: 1,
        fields: [
            { name: "role", kind: "enum", values: "role", since: 1 },
            { name: "name", kind: "str", max: 128, since: 1 },
        ],
    },
    // the request with this id failed; 0 = the connection
    error: {
        type: 0x0105, direction: "ANY", state: "HELLO", role: "NONE", since: 1,
        fields: [
            { name: "code", kind: "u16", least: 1, most: 65535, since: 1 },
            { name: "what", kind: "str", max: 256, since: 1 },
            { name: "where", kind: "str", max: 128, since: 1 },
            { name: "reason", kind: "str", max: 512, since: 1 },
        ],
    },
    // the request with this id is done
    ok: {
        type: 0x0106, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "revision", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
        ],
    },
    // answered by pong at once
    ping: {
        type: 0x0107, direction: "ANY", state: "HELLO", role: "NONE", since: 1,
        fields: [
            { name: "nonce", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
        ],
    },
    // answer to ping
    pong: {
        type: 0x0108, direction: "ANY", state: "HELLO", role: "NONE", since: 1,
        fields: [
            { name: "nonce", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
        ],
    },
    // sessions end soon: the server stops, or is closed to all but administrators (drain_set); no new scenes or views
    drain: {
        type: 0x0109, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "deadline_ms", kind: "u32", least: 0, most: 4294967295, since: 1 },
            { name: "reason", kind: "str", max: 256, since: 1 },
        ],
    },
    // the sender closes after this
    bye: {
        type: 0x010a, direction: "ANY", state: "HELLO", role: "NONE", since: 1,
        fields: [
            { name: "reason", kind: "str", max: 256, since: 1 },
        ],
    },
    // the request with this id is under way
    progress: {
        type: 0x010b, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "stage", kind: "str", max: 64, since: 1 },
            { name: "done", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "total", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
        ],
    },
    // a warning about the request with this id, or the scene
    notice: {
        type: 0x010c, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "code", kind: "u16", least: 0, most: 65535, since: 1 },
            { name: "what", kind: "str", max: 256, since: 1 },
            { name: "where", kind: "str", max: 128, since: 1 },
            { name: "reason", kind: "str", max: 512, since: 1 },
        ],
    },
    // keep this session for a while when its connection is lost, and with a state folder when the daemon ends; answered by ticket. After bye it is not kept
    keep: {
        type: 0x010d, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [],
    },
    // answer to keep; it voids older tickets of the session
    ticket: {
        type: 0x010e, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "secret", kind: "bytes", max: 64, since: 1 },
            { name: "valid_s", kind: "u32", least: 0, most: 4294967295, since: 1 },
        ],
    },
    // go on with the session of a ticket, in place of the one that has just been opened and has no scene open; answered by resumed; error AUTH: the ticket is unknown, used, or too old
    resume: {
        type: 0x010f, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "secret", kind: "bytes", max: 64, since: 1 },
        ],
    },
    // answer: scene, views and subscriptions are as they were, with the credit of the newest subscribe, and every subscribed view is shown anew. Edits that were under way were done or not, in their order; all other requests were dropped
    resumed: {
        type: 0x0110, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "session", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "secret", kind: "bytes", max: 64, since: 1 },
            { name: "valid_s", kind: "u32", least: 0, most: 4294967295, since: 1 },
            { name: "revision", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "first_id", kind: "u32", least: 0, most: 4294967295, since: 1 },
            { name: "id_count", kind: "u32", least: 0, most: 4294967295, since: 1 },
        ],
    },
    // which of these is this session told about the open scene? Those not named here stay as they were, at first false. Before ok comes the state of what became true: participants, camera_state (camera_moved, if it was moved), annotations. It ends with the scene, and goes on in a resumed session
    scene_watch: {
        type: 0x0130, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "participants", kind: "bool", since: 1, optional: true },
            { name: "cursors", kind: "bool", since: 1, optional: true },
            { name: "camera", kind: "bool", since: 1, optional: true },
            { name: "annotations", kind: "bool", since: 1, optional: true },
            { name: "edits", kind: "bool", since: 1, optional: true },
        ],
    },
    // how others see this session
    participant_set: {
        type: 0x0131, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "label", kind: "str", max: 64, since: 1, optional: true },
            { name: "color", kind: "u32", least: 0, most: 16777215, since: 1, optional: true },
        ],
    },
    // who has the scene open; all of them each time, those of several changes within a twentieth of a second at once
    participants: {
        type: 0x0132, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "sessions", kind: "list", items: "participant", max: 4096, since: 1 },
        ],
    },
    // where this client points; newest wins. Without a request number it is never answered
    cursor_set: {
        type: 0x0133, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "shown", kind: "bool", since: 1 },
            { name: "position", kind: "vec3", since: 1 },
            { name: "normal", kind: "vec3", since: 1 },
            { name: "node", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
        ],
    },
    // where another session points; at most 20 a second of each
    cursor: {
        type: 0x0134, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "session", kind: "u64", least: 1n, most: 18446744073709551615n, since: 1 },
            { name: "shown", kind: "bool", since: 1 },
            { name: "position", kind: "vec3", since: 1 },
            { name: "normal", kind: "vec3", since: 1 },
            { name: "node", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
        ],
    },
    // an edit has taken effect; all watchers are told all edits, those of their own too, in the one order in which the worker accepted them
    edited: {
        type: 0x0135, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "number", kind: "u64", least: 1n, most: 18446744073709551615n, since: 1 },
            { name: "revision", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "session", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "message", kind: "u16", least: 1, most: 65535, since: 1 },
            { name: "object", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
        ],
    },
    // ask for the shared camera of the scene. Without a holder (and unlocked) it is given at once; else this session waits for its turn. ok says that the request counts, camera_state who has it; a second one changes nothing
    camera_request: {
        type: 0x0136, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [],
    },
    // take it from whoever has it; error PERM: it is locked, and this session is no administrator's
    camera_take: {
        type: 0x0137, direction: "C2S", state: "OPEN", role: "EDIT", since: 1,
        fields: [],
    },
    // the holder, or an administrator, gives it to another session of the scene, or to the one that waits longest; one that waits no longer waits
    camera_give: {
        type: 0x0138, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "session", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
        ],
    },
    // locked, only administrators change who has it, and its holder keeps it however inactive
    camera_lock: {
        type: 0x0139, direction: "C2S", state: "OPEN", role: "ADMIN", since: 1,
        fields: [
            { name: "locked", kind: "bool", since: 1 },
        ],
    },
    // a view of this session has the shared camera, or no longer. While this session is the holder, view_camera for such a view moves the shared camera; else view_camera for it is refused (silently, without a request number)
    camera_follow: {
        type: 0x013a, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "follow", kind: "bool", since: 1 },
        ],
    },
    // who has the shared camera, whenever that or who waits for it changes
    camera_state: {
        type: 0x013b, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "holder", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "locked", kind: "bool", since: 1 },
            { name: "change", kind: "enum", values: "camera_change", since: 1 },
            { name: "waiting", kind: "list", items: "waiting_session", max: 4096, since: 1 },
        ],
    },
    // the shared camera, newest wins: all fields of view_camera that count now. Frames of views that follow have its input_seq
    camera_moved: {
        type: 0x013c, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "session", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "input_seq", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "camera", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "eye", kind: "vec3", since: 1, optional: true },
            { name: "target", kind: "vec3", since: 1, optional: true },
            { name: "up", kind: "vec3", since: 1, optional: true },
            { name: "kind", kind: "enum", values: "camera_kind", since: 1, optional: true },
            { name: "vfov_rad", kind: "f32", least: 0.001, most: 3.13, since: 1, optional: true },
            { name: "half_height", kind: "f32", least: 1e-06, most: 1e+09, since: 1, optional: true },
            { name: "near", kind: "f32", least: 1e-06, most: 1e+09, since: 1, optional: true },
            { name: "far", kind: "f32", least: 0, most: 1e+12, since: 1, optional: true },
        ],
    },
    // make an annotation of the open scene, or change one: one's own, with the role EDIT any. Answered by annotation; error LIMIT: the scene, or this author, has as many as it may
    annotation_set: {
        type: 0x0140, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "annotation", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "kind", kind: "enum", values: "annotation_kind", since: 1, optional: true },
            { name: "position", kind: "vec3", since: 1, optional: true },
            { name: "normal", kind: "vec3", since: 1, optional: true },
            { name: "node", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "color", kind: "u32", least: 0, most: 16777215, since: 1, optional: true },
            { name: "text", kind: "str", max: 2048, since: 1, optional: true },
        ],
    },
    // remove one's own, with the role EDIT any
    annotation_remove: {
        type: 0x0141, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "annotation", kind: "u64", least: 1n, most: 18446744073709551615n, since: 1 },
        ],
    },
    // list the annotations of the open scene
    annotations_query: {
        type: 0x0142, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [],
    },
    // all annotations, in the order in which they were made
    annotations: {
        type: 0x0143, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "annotations", kind: "list", items: "annotation_entry", max: 4096, since: 1 },
        ],
    },
    // as it is now: the answer, and without a request number for those who watch
    annotation: {
        type: 0x0144, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "annotation", kind: "list", items: "annotation_entry", max: 1, since: 1 },
        ],
    },
    // for those who watch
    annotation_removed: {
        type: 0x0145, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "annotation", kind: "u64", least: 1n, most: 18446744073709551615n, since: 1 },
        ],
    },
    // make a join ticket, with which others log in as with a token, into one scene of this session's tenant. Needs the role EDIT, or a token with tickets=COUNT; answered by join_ticket; error LIMIT: the tenant has as many as it may
    join_make: {
        type: 0x0148, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "scene", kind: "str", max: 128, since: 1, optional: true },
            { name: "role", kind: "enum", values: "role", since: 1, optional: true },
            { name: "uses", kind: "u32", least: 1, most: 1000000, since: 1, optional: true },
            { name: "valid_s", kind: "u32", least: 1, most: 31536000, since: 1, optional: true },
            { name: "label", kind: "str", max: 64, since: 1, optional: true },
        ],
    },
    // answer; the daemon keeps a hash of the secret only, so it is told this once
    join_ticket: {
        type: 0x0149, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "ticket", kind: "u64", least: 1n, most: 18446744073709551615n, since: 1 },
            { name: "secret", kind: "str", max: 128, since: 1 },
            { name: "scene", kind: "str", max: 128, since: 1 },
            { name: "role", kind: "enum", values: "role", since: 1 },
            { name: "uses", kind: "u32", least: 1, most: 1000000, since: 1 },
            { name: "valid_s", kind: "u32", least: 1, most: 31536000, since: 1 },
        ],
    },
    // before auth_ok, of a join ticket: the only scene that this session may open
    join_scene: {
        type: 0x014a, direction: "S2C", state: "AUTH", role: "NONE", since: 1,
        fields: [
            { name: "scene", kind: "str", max: 128, since: 1 },
        ],
    },
    // in place of auth, when a session is to be resumed: a join ticket that is used up, or too old, still lets a session that was made with it in, for the message resume and nothing else
    auth_resume: {
        type: 0x014b, direction: "C2S", state: "AUTH", role: "NONE", since: 1,
        fields: [
            { name: "token", kind: "str", max: 256, since: 1 },
            { name: "secret", kind: "bytes", max: 64, since: 1 },
        ],
    },
    // list join tickets: with the role ADMIN all, else those made with the same token; json: tickets[] with ticket, tenant, issuer, scene, role, label, uses, used, valid_s, sessions
    join_query: {
        type: 0x014c, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [],
    },
    // void join tickets and end the sessions that were made with them, kept ones too: with the role ADMIN any, else those made with the same token; ok; error NOTFOUND: there is none
    join_revoke: {
        type: 0x014d, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "ticket", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
        ],
    },
    // show a text to clients; ok; error NOTFOUND: there is no such session or scene
    message_send: {
        type: 0x0150, direction: "C2S", state: "OPEN", role: "ADMIN", since: 1,
        fields: [
            { name: "text", kind: "str", max: 1024, since: 1 },
            { name: "session", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "scene", kind: "str", max: 128, since: 1, optional: true },
        ],
    },
    // an administrator says something
    message: {
        type: 0x0151, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "from", kind: "str", max: 128, since: 1 },
            { name: "text", kind: "str", max: 1024, since: 1 },
        ],
    },
    // end a session, kept ones too; it cannot be resumed. ok; error NOTFOUND: there is none
    kick: {
        type: 0x0152, direction: "C2S", state: "OPEN", role: "ADMIN", since: 1,
        fields: [
            { name: "session", kind: "u64", least: 1n, most: 18446744073709551615n, since: 1 },
            { name: "reason", kind: "str", max: 256, since: 1 },
            { name: "block_s", kind: "u32", least: 0, most: 31536000, since: 1, optional: true },
        ],
    },
    // stop in a while: drain is told to all sessions, new logins, scenes and views are refused, and at the deadline, or when all sessions but those of administrators have gone, the daemon ends as after SIGTERM. ok
    drain_set: {
        type: 0x0153, direction: "C2S", state: "OPEN", role: "ADMIN", since: 1,
        fields: [
            { name: "deadline_ms", kind: "u32", least: 0, most: 86400000, since: 1 },
            { name: "reason", kind: "str", max: 256, since: 1 },
            { name: "stay", kind: "bool", since: 1, optional: true },
            { name: "cancel", kind: "bool", since: 1, optional: true },
        ],
    },
    // be sent what sessions_query answers again and again; ok
    sessions_watch: {
        type: 0x0154, direction: "C2S", state: "OPEN", role: "ADMIN", since: 1,
        fields: [
            { name: "interval_ms", kind: "u32", least: 0, most: 3600000, since: 1 },
        ],
    },
    // of sessions_watch; none is sent while the one before waits for the client
    statistics: {
        type: 0x0155, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "text", kind: "str", max: 16777216, since: 1 },
        ],
    },
    // this session ends soon, because nothing but pings and credit comes from its client; every other message keeps it
    idle_warning: {
        type: 0x0156, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "remaining_ms", kind: "u32", least: 0, most: 4294967295, since: 1 },
        ],
    },
    // right before an error or a notice: which limit it was
    limited: {
        type: 0x0157, direction: "S2C", state: "HELLO", role: "NONE", since: 1,
        fields: [
            { name: "request", kind: "u32", least: 0, most: 4294967295, since: 1 },
            { name: "limit", kind: "str", max: 64, since: 1 },
            { name: "retry_after_ms", kind: "u32", least: 0, most: 4294967295, since: 1 },
        ],
    },
    // after drain: the server goes on
    drain_cancelled: {
        type: 0x0158, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [],
    },
    // join a scene, or make it
    scene_open: {
        type: 0x0201, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "name", kind: "str", max: 128, since: 1 },
        ],
    },
    // answer; one scene per session at a time
    scene_opened: {
        type: 0x0202, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "revision", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "existed", kind: "bool", since: 1 },
            { name: "first_id", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "id_count", kind: "u32", least: 1, most: 4294967295, since: 1 },
        ],
    },
    // leave; a scene that no session holds is dropped
    scene_close: {
        type: 0x0203, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [],
    },
    // which contents does the daemon have?
    upload_query: {
        type: 0x0204, direction: "C2S", state: "OPEN", role: "EDIT", since: 1,
        fields: [
            { name: "contents", kind: "list", items: "content", max: 1024, since: 1 },
        ],
    },
    // answer, in the same order
    upload_have: {
        type: 0x0205, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "have", kind: "list", items: "flag", max: 1024, since: 1 },
        ],
    },
    // a piece of a content; pieces come in order; ok follows the last
    upload: {
        type: 0x0206, direction: "C2S", state: "OPEN", role: "EDIT", since: 1,
        fields: [
            { name: "hash", kind: "hash", since: 1 },
            { name: "total", kind: "u64", least: 0n, most: 1099511627776n, since: 1 },
            { name: "offset", kind: "u64", least: 0n, most: 1099511627776n, since: 1 },
            { name: "data", kind: "bytes", max: 4194304, since: 1 },
        ],
    },
    // load a file into the scene; progress, notices, then asset_loaded
    asset_load: {
        type: 0x0207, direction: "C2S", state: "OPEN", role: "EDIT", since: 1,
        fields: [
            { name: "asset", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "path", kind: "str", max: 4096, since: 1 },
            { name: "files", kind: "list", items: "asset_file", max: 4096, since: 1 },
            { name: "parent", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "transform", kind: "mat4", since: 1, optional: true },
            { name: "scene_index", kind: "i32", least: -1, most: 2147483647, since: 1, optional: true },
            { name: "variant", kind: "str", max: 256, since: 1, optional: true },
            { name: "up", kind: "enum", values: "up_axis", since: 1, optional: true },
            { name: "point_scale", kind: "f32", least: 0.001, most: 1e+03, since: 1, optional: true },
            { name: "point_diameter", kind: "f32", least: 1e-09, most: 1e+09, since: 1, optional: true },
        ],
    },
    // answer to asset_load
    asset_loaded: {
        type: 0x0208, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "asset", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "revision", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "nodes", kind: "u32", least: 0, most: 4294967295, since: 1 },
            { name: "meshes", kind: "u32", least: 0, most: 4294967295, since: 1 },
            { name: "materials", kind: "u32", least: 0, most: 4294967295, since: 1 },
            { name: "textures", kind: "u32", least: 0, most: 4294967295, since: 1 },
            { name: "lights", kind: "u32", least: 0, most: 4294967295, since: 1 },
            { name: "cameras", kind: "u32", least: 0, most: 4294967295, since: 1 },
            { name: "animations", kind: "u32", least: 0, most: 4294967295, since: 1 },
            { name: "triangles", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "bounds_min", kind: "vec3", since: 1 },
            { name: "bounds_max", kind: "vec3", since: 1 },
            { name: "duration_s", kind: "f64", least: 0, most: 1e+12, since: 1 },
            { name: "up", kind: "enum", values: "up_axis", since: 1, optional: true },
            { name: "up_reason", kind: "str", max: 128, since: 1, optional: true },
        ],
    },
    // remove an asset and its objects
    asset_unload: {
        type: 0x0209, direction: "C2S", state: "OPEN", role: "EDIT", since: 1,
        fields: [
            { name: "asset", kind: "u32", least: 1, most: 4294967295, since: 1 },
        ],
    },
    // make or replace a mesh
    mesh_set: {
        type: 0x020a, direction: "C2S", state: "OPEN", role: "EDIT", since: 1,
        fields: [
            { name: "mesh", kind: "u64", least: 1n, most: 18446744073709551615n, since: 1 },
            { name: "parts", kind: "list", items: "mesh_part", max: 256, since: 1 },
        ],
    },
    // make or replace a texture
    texture_set: {
        type: 0x020b, direction: "C2S", state: "OPEN", role: "EDIT", since: 1,
        fields: [
            { name: "texture", kind: "u64", least: 1n, most: 18446744073709551615n, since: 1 },
            { name: "format", kind: "enum", values: "pixel_format", since: 1 },
            { name: "width", kind: "u32", least: 0, most: 65536, since: 1 },
            { name: "height", kind: "u32", least: 0, most: 65536, since: 1 },
            { name: "wrap_s", kind: "enum", values: "wrap", since: 1 },
            { name: "wrap_t", kind: "enum", values: "wrap", since: 1 },
            { name: "nearest", kind: "bool", since: 1 },
            { name: "pixels", kind: "bytes", max: 268435456, since: 1 },
        ],
    },
    // make or change a material (glTF 2.0 metallic-roughness)
    material_set: {
        type: 0x020c, direction: "C2S", state: "OPEN", role: "EDIT", since: 1,
        fields: [
            { name: "material", kind: "u64", least: 1n, most: 18446744073709551615n, since: 1 },
            { name: "base_color", kind: "vec4", since: 1, optional: true },
            { name: "metallic", kind: "f32", least: 0, most: 1, since: 1, optional: true },
            { name: "roughness", kind: "f32", least: 0, most: 1, since: 1, optional: true },
            { name: "emissive", kind: "vec3", since: 1, optional: true },
            { name: "emissive_strength", kind: "f32", least: 0, most: 1e+09, since: 1, optional: true },
            { name: "normal_scale", kind: "f32", least: -1e+03, most: 1e+03, since: 1, optional: true },
            { name: "occlusion_strength", kind: "f32", least: 0, most: 1, since: 1, optional: true },
            { name: "alpha_mode", kind: "enum", values: "alpha_mode", since: 1, optional: true },
            { name: "alpha_cutoff", kind: "f32", least: 0, most: 1e+09, since: 1, optional: true },
            { name: "double_sided", kind: "bool", since: 1, optional: true },
            { name: "unlit", kind: "bool", since: 1, optional: true },
            { name: "base_color_texture", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "metallic_roughness_texture", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "normal_texture", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "occlusion_texture", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "emissive_texture", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "name", kind: "str", max: 256, since: 1, optional: true },
        ],
    },
    // make or change a node
    node_set: {
        type: 0x020d, direction: "C2S", state: "OPEN", role: "EDIT", since: 1,
        fields: [
            { name: "node", kind: "u64", least: 1n, most: 18446744073709551615n, since: 1 },
            { name: "parent", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "translation", kind: "vec3", since: 1, optional: true },
            { name: "rotation", kind: "vec4", since: 1, optional: true },
            { name: "scale", kind: "vec3", since: 1, optional: true },
            { name: "visible", kind: "bool", since: 1, optional: true },
            { name: "mesh", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "light", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "camera", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "name", kind: "str", max: 256, since: 1, optional: true },
            { name: "catches_shadows", kind: "bool", since: 1, optional: true },
            { name: "next_translation", kind: "vec3", since: 1, optional: true },
            { name: "next_rotation", kind: "vec4", since: 1, optional: true },
            { name: "next_scale", kind: "vec3", since: 1, optional: true },
            { name: "layers", kind: "u32", least: 0, most: 4294967295, since: 1, optional: true },
        ],
    },
    // make or change a light (KHR_lights_punctual)
    light_set: {
        type: 0x020e, direction: "C2S", state: "OPEN", role: "EDIT", since: 1,
        fields: [
            { name: "light", kind: "u64", least: 1n, most: 18446744073709551615n, since: 1 },
            { name: "kind", kind: "enum", values: "light_kind", since: 1, optional: true },
            { name: "color", kind: "vec3", since: 1, optional: true },
            { name: "intensity", kind: "f32", least: 0, most: 1e+12, since: 1, optional: true },
            { name: "range", kind: "f32", least: 0, most: 1e+12, since: 1, optional: true },
            { name: "inner_cone_rad", kind: "f32", least: 0, most: 1.5707964, since: 1, optional: true },
            { name: "outer_cone_rad", kind: "f32", least: 0, most: 1.5707964, since: 1, optional: true },
            { name: "casts_shadow", kind: "bool", since: 1, optional: true },
            { name: "radius", kind: "f32", least: 0, most: 1e+06, since: 1, optional: true },
            { name: "width", kind: "f32", least: 0, most: 1e+06, since: 1, optional: true },
            { name: "height", kind: "f32", least: 0, most: 1e+06, since: 1, optional: true },
            { name: "angular_diameter_rad", kind: "f32", least: 0, most: 3, since: 1, optional: true },
            { name: "lumens", kind: "f32", least: 0, most: 1e+12, since: 1, optional: true },
            { name: "profile", kind: "bytes", max: 4194304, since: 1, optional: true },
            { name: "profile_absolute", kind: "bool", since: 1, optional: true },
            { name: "texture", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
        ],
    },
    // make or change a camera object
    camera_set: {
        type: 0x020f, direction: "C2S", state: "OPEN", role: "EDIT", since: 1,
        fields: [
            { name: "camera", kind: "u64", least: 1n, most: 18446744073709551615n, since: 1 },
            { name: "kind", kind: "enum", values: "camera_kind", since: 1, optional: true },
            { name: "vfov_rad", kind: "f32", least: 0.001, most: 3.13, since: 1, optional: true },
            { name: "half_height", kind: "f32", least: 1e-06, most: 1e+09, since: 1, optional: true },
            { name: "near", kind: "f32", least: 1e-06, most: 1e+09, since: 1, optional: true },
            { name: "far", kind: "f32", least: 0, most: 1e+12, since: 1, optional: true },
        ],
    },
    // change the environment; fields that are not there stay
    environment_set: {
        type: 0x0210, direction: "C2S", state: "OPEN", role: "EDIT", since: 1,
        fields: [
            { name: "kind", kind: "enum", values: "environment_kind", since: 1, optional: true },
            { name: "path", kind: "str", max: 4096, since: 1, optional: true },
            { name: "hash", kind: "hash", since: 1, optional: true },
            { name: "color", kind: "vec3", since: 1, optional: true },
            { name: "intensity", kind: "f32", least: 0, most: 1e+09, since: 1, optional: true },
            { name: "rotation_rad", kind: "f32", least: -1e+04, most: 1e+04, since: 1, optional: true },
            { name: "sun_direction", kind: "vec3", since: 1, optional: true },
            { name: "turbidity", kind: "f32", least: 1, most: 1e+01, since: 1, optional: true },
            { name: "sun", kind: "bool", since: 1, optional: true },
        ],
    },
    // pose an asset at a time
    animation_set: {
        type: 0x0211, direction: "C2S", state: "OPEN", role: "EDIT", since: 1,
        fields: [
            { name: "asset", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "animation", kind: "i32", least: -1, most: 2147483647, since: 1 },
            { name: "time_s", kind: "f64", least: -1e+12, most: 1e+12, since: 1 },
        ],
    },
    // choose a material variant
    variant_set: {
        type: 0x0212, direction: "C2S", state: "OPEN", role: "EDIT", since: 1,
        fields: [
            { name: "asset", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "variant", kind: "str", max: 256, since: 1 },
        ],
    },
    // remove an object made by a client
    object_remove: {
        type: 0x0213, direction: "C2S", state: "OPEN", role: "EDIT", since: 1,
        fields: [
            { name: "kind", kind: "enum", values: "object_kind", since: 1 },
            { name: "object", kind: "u64", least: 1n, most: 18446744073709551615n, since: 1 },
        ],
    },
    // edits up to batch_end become one revision
    batch_begin: {
        type: 0x0214, direction: "C2S", state: "OPEN", role: "EDIT", since: 1,
        fields: [],
    },
    // publish the edits since batch_begin
    batch_end: {
        type: 0x0215, direction: "C2S", state: "OPEN", role: "EDIT", since: 1,
        fields: [],
    },
    // make or change a view of the session's scene
    view_set: {
        type: 0x0301, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "width", kind: "u32", least: 1, most: 16384, since: 1, optional: true },
            { name: "height", kind: "u32", least: 1, most: 16384, since: 1, optional: true },
            { name: "mode", kind: "enum", values: "render_mode", since: 1, optional: true },
            { name: "encoding", kind: "enum", values: "encoding", since: 1, optional: true },
            { name: "still_encoding", kind: "enum", values: "encoding", since: 1, optional: true },
            { name: "quality", kind: "u8", least: 1, most: 100, since: 1, optional: true },
            { name: "tonemap", kind: "enum", values: "tonemap", since: 1, optional: true },
            { name: "exposure_ev", kind: "f32", least: -32, most: 32, since: 1, optional: true },
            { name: "background", kind: "enum", values: "background", since: 1, optional: true },
            { name: "background_color", kind: "vec3", since: 1, optional: true },
            { name: "samples", kind: "u32", least: 1, most: 65536, since: 1, optional: true },
            { name: "seed", kind: "u32", least: 0, most: 4294967295, since: 1, optional: true },
            { name: "max_fps", kind: "f32", least: 0.01, most: 1e+03, since: 1, optional: true },
            { name: "debug_view", kind: "enum", values: "debug_view", since: 1, optional: true },
            { name: "error_px", kind: "f32", least: 0.01, most: 1024, since: 1, optional: true },
            { name: "target_ms", kind: "f32", least: 0, most: 1e+05, since: 1, optional: true },
            { name: "trace", kind: "enum", values: "trace_backend", since: 1, optional: true },
            { name: "max_bounces", kind: "u32", least: 1, most: 256, since: 1, optional: true },
            { name: "noise", kind: "f32", least: 0, most: 1, since: 1, optional: true },
            { name: "time_limit_s", kind: "f32", least: 0, most: 1e+06, since: 1, optional: true },
            { name: "planes", kind: "u32", least: 0, most: 8388607, since: 1, optional: true },
            { name: "denoise", kind: "enum", values: "denoise", since: 1, optional: true },
            { name: "frame_s", kind: "f32", least: 1e-06, most: 1e+06, since: 1, optional: true },
            { name: "shutter_open", kind: "f32", least: -1, most: 1, since: 1, optional: true },
            { name: "shutter_close", kind: "f32", least: -1, most: 1, since: 1, optional: true },
            { name: "series_s", kind: "f32", least: 1e-06, most: 1e+06, since: 1, optional: true },
            { name: "filter", kind: "enum", values: "filter", since: 1, optional: true },
            { name: "filter_radius_px", kind: "f32", least: 0, most: 8, since: 1, optional: true },
            { name: "clamp_indirect", kind: "f32", least: 0, most: 1e+09, since: 1, optional: true },
            { name: "exposure_mode", kind: "enum", values: "exposure_mode", since: 1, optional: true },
            { name: "ground", kind: "enum", values: "ground", since: 1, optional: true },
            { name: "region", kind: "vec4", since: 1, optional: true },
            { name: "gi", kind: "enum", values: "gi", since: 1, optional: true },
            { name: "temporal", kind: "enum", values: "temporal", since: 1, optional: true },
            { name: "scale", kind: "f32", least: 5e+01, most: 1e+02, since: 1, optional: true },
            { name: "reflections", kind: "enum", values: "reflections", since: 1, optional: true },
            { name: "f_number", kind: "f32", least: 0.1, most: 1e+03, since: 1, optional: true },
            { name: "shutter_s", kind: "f32", least: 1e-06, most: 1e+06, since: 1, optional: true },
            { name: "iso", kind: "f32", least: 0.1, most: 1e+07, since: 1, optional: true },
            { name: "sensor_mm", kind: "f32", least: 0.01, most: 1e+04, since: 1, optional: true },
            { name: "ao", kind: "enum", values: "ao", since: 1, optional: true },
            { name: "mirrors", kind: "enum", values: "mirrors", since: 1, optional: true },
            { name: "shadow_maps", kind: "enum", values: "shadow_maps", since: 1, optional: true },
            { name: "sharpen", kind: "f32", least: 0, most: 1, since: 1, optional: true },
            { name: "codecs", kind: "bytes", max: 16, since: 1, optional: true },
            { name: "bitrate", kind: "u32", least: 0, most: 1000000000, since: 1, optional: true },
            { name: "target_fps", kind: "f32", least: 0, most: 1e+03, since: 1, optional: true },
            { name: "hidden", kind: "u8", least: 0, most: 1, since: 1, optional: true },
            { name: "names", kind: "u8", least: 0, most: 1, since: 1, optional: true },
            { name: "layers", kind: "u32", least: 0, most: 4294967295, since: 1, optional: true },
            { name: "depth", kind: "u8", least: 0, most: 1, since: 1, optional: true },
        ],
    },
    // drop a view
    view_close: {
        type: 0x0302, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
        ],
    },
    // newest wins; usually sent without a request number, and then never answered (what is wrong is told by notice); with one by ok
    view_camera: {
        type: 0x0303, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "input_seq", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "camera", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "eye", kind: "vec3", since: 1, optional: true },
            { name: "target", kind: "vec3", since: 1, optional: true },
            { name: "up", kind: "vec3", since: 1, optional: true },
            { name: "kind", kind: "enum", values: "camera_kind", since: 1, optional: true },
            { name: "vfov_rad", kind: "f32", least: 0.001, most: 3.13, since: 1, optional: true },
            { name: "half_height", kind: "f32", least: 1e-06, most: 1e+09, since: 1, optional: true },
            { name: "near", kind: "f32", least: 1e-06, most: 1e+09, since: 1, optional: true },
            { name: "far", kind: "f32", least: 0, most: 1e+12, since: 1, optional: true },
            { name: "next_eye", kind: "vec3", since: 1, optional: true },
            { name: "next_target", kind: "vec3", since: 1, optional: true },
            { name: "next_up", kind: "vec3", since: 1, optional: true },
            { name: "lens_radius", kind: "f32", least: 0, most: 1e+06, since: 1, optional: true },
            { name: "focus_distance", kind: "f32", least: 0, most: 1e+12, since: 1, optional: true },
            { name: "received_ns", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
        ],
    },
    // one frame, answered by frame with this request id
    frame_request: {
        type: 0x0304, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "settled", kind: "bool", since: 1 },
            { name: "encoding", kind: "enum", values: "encoding", since: 1, optional: true },
            { name: "quality", kind: "u8", least: 1, most: 100, since: 1, optional: true },
            { name: "parts", kind: "bool", since: 1, optional: true },
            { name: "rate_numerator", kind: "u32", least: 1, most: 4294967295, since: 1, optional: true },
            { name: "rate_denominator", kind: "u32", least: 1, most: 4294967295, since: 1, optional: true },
        ],
    },
    // frames whenever the view changes or improves, while credit lasts
    subscribe: {
        type: 0x0305, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "credit_frames", kind: "u32", least: 0, most: 1024, since: 1 },
        ],
    },
    // frames the client has taken
    credit: {
        type: 0x0306, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "frames", kind: "u32", least: 1, most: 1024, since: 1 },
        ],
    },
    // a picture and where it comes from
    frame: {
        type: 0x0307, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "number", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "scene_revision", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "input_seq", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "width", kind: "u32", least: 1, most: 16384, since: 1 },
            { name: "height", kind: "u32", least: 1, most: 16384, since: 1 },
            { name: "encoding", kind: "enum", values: "encoding", since: 1 },
            { name: "samples", kind: "u32", least: 0, most: 4294967295, since: 1 },
            { name: "missing_pages", kind: "u32", least: 0, most: 4294967295, since: 1 },
            { name: "missing_clusters", kind: "u32", least: 0, most: 4294967295, since: 1 },
            { name: "settled", kind: "bool", since: 1 },
            { name: "lossless", kind: "bool", since: 1 },
            { name: "hash", kind: "hash", since: 1, optional: true },
            { name: "stages", kind: "list", items: "stage_time", max: 64, since: 1 },
            { name: "data", kind: "bytes", max: 536870912, since: 1 },
            { name: "mip_bias", kind: "f32", least: 0, most: 32, since: 1, optional: true },
            { name: "error_px", kind: "f32", least: 0, most: 1e+06, since: 1, optional: true },
            { name: "mode", kind: "enum", values: "render_mode", since: 1, optional: true },
            { name: "noise", kind: "f32", least: 0, most: 1e+09, since: 1, optional: true },
            { name: "job", kind: "hash", since: 1, optional: true },
            { name: "size", kind: "u64", least: 1n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "exposure_ev", kind: "f32", least: -64, most: 64, since: 1, optional: true },
            { name: "black", kind: "f32", least: 0, most: 1, since: 1, optional: true },
            { name: "clipped", kind: "f32", least: 0, most: 1, since: 1, optional: true },
            { name: "depends", kind: "u32", least: 1, most: 4294967295, since: 1, optional: true },
            { name: "codec", kind: "str", max: 32, since: 1, optional: true },
            { name: "input_ns", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "taken_ns", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "render_begin_ns", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "render_end_ns", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "encode_begin_ns", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "encode_end_ns", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "sent_ns", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "depth", kind: "bytes", max: 67108864, since: 1, optional: true },
            { name: "eye", kind: "vec3", since: 1, optional: true },
            { name: "forward", kind: "vec3", since: 1, optional: true },
            { name: "up", kind: "vec3", since: 1, optional: true },
            { name: "kind", kind: "enum", values: "camera_kind", since: 1, optional: true },
            { name: "vfov_rad", kind: "f32", least: 0.001, most: 3.13, since: 1, optional: true },
            { name: "half_height", kind: "f32", least: 1e-06, most: 1e+09, since: 1, optional: true },
        ],
    },
    // what would a settled frame of this view be made from? From here on its settled frames say it, too
    job_query: {
        type: 0x0308, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "encoding", kind: "enum", values: "encoding", since: 1, optional: true },
            { name: "quality", kind: "u8", least: 1, most: 100, since: 1, optional: true },
            { name: "after", kind: "hash", since: 1, optional: true },
        ],
    },
    // answer
    job: {
        type: 0x0309, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "hash", kind: "hash", since: 1 },
            { name: "scene_revision", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
        ],
    },
    // the film of a PATH view as it is, to go on with later
    checkpoint_query: {
        type: 0x030a, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "kind", kind: "enum", values: "checkpoint_kind", since: 1, optional: true },
            { name: "offset", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
        ],
    },
    // answer
    checkpoint: {
        type: 0x030b, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "job", kind: "hash", since: 1 },
            { name: "samples", kind: "u32", least: 0, most: 4294967295, since: 1 },
            { name: "data", kind: "bytes", max: 536870912, since: 1 },
            { name: "size", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
        ],
    },
    // go on from a checkpoint; refused when it is of another job
    checkpoint_set: {
        type: 0x030c, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "data", kind: "bytes", max: 536870912, since: 1 },
            { name: "kind", kind: "enum", values: "checkpoint_kind", since: 1, optional: true },
            { name: "offset", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "size", kind: "u64", least: 1n, most: 18446744073709551615n, since: 1, optional: true },
        ],
    },
    // a part of the data of the frame that a request waits for; they come in order, and begin again when the worker was replaced
    frame_part: {
        type: 0x030d, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "offset", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "data", kind: "bytes", max: 536870912, since: 1 },
        ],
    },
    // which camera shows the scene, or a node of it, as a whole? The view stays as it is: fields of the answer go into view_camera
    view_fit: {
        type: 0x030e, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "node", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "azimuth_rad", kind: "f32", least: -1e+04, most: 1e+04, since: 1, optional: true },
            { name: "elevation_rad", kind: "f32", least: -1.5707964, most: 1.5707964, since: 1, optional: true },
            { name: "kind", kind: "enum", values: "camera_kind", since: 1, optional: true },
            { name: "vfov_rad", kind: "f32", least: 0.001, most: 3.13, since: 1, optional: true },
            { name: "margin", kind: "f32", least: 0, most: 0.9, since: 1, optional: true },
            { name: "cameras", kind: "bool", since: 1, optional: true },
            { name: "turntable", kind: "bool", since: 1, optional: true },
        ],
    },
    // answer; geometry as posed at this revision
    view_fitted: {
        type: 0x030f, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "revision", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "empty", kind: "bool", since: 1 },
            { name: "camera", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "eye", kind: "vec3", since: 1 },
            { name: "target", kind: "vec3", since: 1 },
            { name: "up", kind: "vec3", since: 1 },
            { name: "kind", kind: "enum", values: "camera_kind", since: 1 },
            { name: "vfov_rad", kind: "f32", least: 0.001, most: 3.13, since: 1 },
            { name: "half_height", kind: "f32", least: 1e-06, most: 1e+09, since: 1 },
        ],
    },
    // what exposure would the settled frame of this view have? Answered once it is metered; nothing else is rendered for it
    exposure_query: {
        type: 0x0310, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
        ],
    },
    // answer
    exposure: {
        type: 0x0311, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "mode", kind: "enum", values: "exposure_mode", since: 1 },
            { name: "exposure_ev", kind: "f32", least: -64, most: 64, since: 1 },
        ],
    },
    // the client no longer waits for the answer to a frame_request or exposure_query of the view: that is answered by an error, cancelled, and nothing more is rendered for it
    frame_cancel: {
        type: 0x0312, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "request", kind: "u32", least: 0, most: 4294967295, since: 1 },
        ],
    },
    // the client has this frame of the view's subscription, and gives credit for one more. Of every frame, for views with names 1
    taken: {
        type: 0x0313, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "number", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "begun_ns", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "received_ns", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "rtt_ns", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
        ],
    },
    // what time is it at the daemon? Answered at once
    clock_query: {
        type: 0x0314, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [],
    },
    // answer
    clock: {
        type: 0x0315, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "time_ns", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
        ],
    },
    // the subscription's next frame is to depend on none before it: the client has lost one, or cannot decode what it got
    key_frame: {
        type: 0x0318, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "failed", kind: "u8", least: 0, most: 255, since: 1, optional: true },
        ],
    },
    // of a view with codecs: frames in motion have this encoding from now on; comes after view_set or key_frame was answered, and before the first such frame
    view_codec: {
        type: 0x0319, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "encoding", kind: "enum", values: "encoding", since: 1 },
        ],
    },
    // clipping planes of a view, in place of those it had. They clip what its camera sees in both modes, what it picks and queries; shadows, reflections and global illumination are those of the whole scene
    view_clip: {
        type: 0x0320, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "planes", kind: "list", items: "clip_plane", max: 6, since: 1 },
            { name: "caps", kind: "enum", values: "cap_style", since: 1, optional: true },
            { name: "cap_color", kind: "vec3", since: 1, optional: true },
            { name: "hatch_px", kind: "f32", least: 2, most: 256, since: 1, optional: true },
        ],
    },
    // how one view shows nodes, whatever other views do; the scene stays as it is, shadows and other light too. All of a list or nothing takes effect. Error NOTFOUND: no such node; LIMIT: more than 65536 nodes
    view_overrides: {
        type: 0x0321, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "overrides", kind: "list", items: "node_override", max: 4096, since: 1 },
            { name: "clear", kind: "bool", since: 1, optional: true },
            { name: "select_color", kind: "vec3", since: 1, optional: true },
        ],
    },
    // material variant of an asset in one view
    view_variant: {
        type: 0x0322, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "asset", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "variant", kind: "str", max: 256, since: 1, optional: true },
        ],
    },
    // what is under a pixel of the newest frame?
    pick: {
        type: 0x0401, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "x", kind: "u32", least: 0, most: 16383, since: 1 },
            { name: "y", kind: "u32", least: 0, most: 16383, since: 1 },
        ],
    },
    // answer to pick
    picked: {
        type: 0x0402, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "revision", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "hit", kind: "bool", since: 1 },
            { name: "node", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "mesh", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "material", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "part", kind: "u32", least: 0, most: 4294967295, since: 1 },
            { name: "triangle", kind: "u32", least: 0, most: 4294967295, since: 1 },
            { name: "position", kind: "vec3", since: 1 },
            { name: "normal", kind: "vec3", since: 1 },
            { name: "uv", kind: "vec2", since: 1 },
            { name: "distance", kind: "f32", least: 0, most: 1e+30, since: 1 },
        ],
    },
    // box of a node's subtree
    bounds_query: {
        type: 0x0403, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "node", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
        ],
    },
    // answer
    bounds: {
        type: 0x0404, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "revision", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "empty", kind: "bool", since: 1 },
            { name: "min", kind: "vec3", since: 1 },
            { name: "max", kind: "vec3", since: 1 },
        ],
    },
    // list nodes
    nodes_query: {
        type: 0x0405, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "first", kind: "u32", least: 0, most: 4294967295, since: 1 },
            { name: "count", kind: "u32", least: 1, most: 4096, since: 1 },
        ],
    },
    // answer
    nodes: {
        type: 0x0406, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "revision", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "total", kind: "u32", least: 0, most: 4294967295, since: 1 },
            { name: "nodes", kind: "list", items: "node_entry", max: 4096, since: 1 },
        ],
    },
    // statistics of a view's newest frame and of the worker
    stats_query: {
        type: 0x0407, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 0, most: 4294967295, since: 1 },
        ],
    },
    // list sessions; answered by the broker
    sessions_query: {
        type: 0x0408, direction: "C2S", state: "OPEN", role: "ADMIN", since: 1,
        fields: [],
    },
    // describe the scene (helio info); needs no device; json: revision, assets[], environment: what environment_set has chosen
    info_query: {
        type: 0x0409, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [],
    },
    // answer to the queries whose result is one JSON object
    json: {
        type: 0x040a, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "text", kind: "str", max: 16777216, since: 1 },
        ],
    },
    // compare two image files
    compare: {
        type: 0x040b, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "metric", kind: "enum", values: "metric", since: 1 },
            { name: "a", kind: "bytes", max: 268435456, since: 1 },
            { name: "b", kind: "bytes", max: 268435456, since: 1 },
            { name: "want_diff", kind: "bool", since: 1 },
            { name: "mask", kind: "bytes", max: 268435456, since: 1, optional: true },
        ],
    },
    // answer
    compared: {
        type: 0x040c, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "value", kind: "f64", least: -1e+300, most: 1e+300, since: 1 },
            { name: "width", kind: "u32", least: 0, most: 65536, since: 1 },
            { name: "height", kind: "u32", least: 0, most: 65536, since: 1 },
            { name: "diff", kind: "bytes", max: 268435456, since: 1 },
        ],
    },
    // make the page packs and cluster files of the scene's assets in the worker's cache; progress, then json; private workers only
    bake: {
        type: 0x040e, direction: "C2S", state: "OPEN", role: "ADMIN", since: 1,
        fields: [
            { name: "options", kind: "str", max: 65536, since: 1 },
        ],
    },
    // is this image file whole, and what does it say about itself? All of it is decoded; json: format, width, height, parts[], channels, job; error FORMAT or TRUNCATED when it is not whole
    image_query: {
        type: 0x040f, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "data", kind: "bytes", max: 536870912, since: 1 },
            { name: "offset", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "size", kind: "u64", least: 1n, most: 18446744073709551615n, since: 1, optional: true },
        ],
    },
    // files that workers died at; answered by the broker; json: quarantine[] with key, tenant, file, deaths, refused_s (0: suspected only)
    quarantine_query: {
        type: 0x0410, direction: "C2S", state: "OPEN", role: "ADMIN", since: 1,
        fields: [],
    },
    // forget what files did; ok; not-found when none is meant
    quarantine_clear: {
        type: 0x0411, direction: "C2S", state: "OPEN", role: "ADMIN", since: 1,
        fields: [
            { name: "key", kind: "str", max: 64, since: 1 },
        ],
    },
    // which nodes are seen in these rectangles of the newest frame?
    box_select: {
        type: 0x0412, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "rects", kind: "list", items: "pixel_rect", max: 1024, since: 1 },
            { name: "inside", kind: "bool", since: 1, optional: true },
            { name: "frame", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
        ],
    },
    // answer to box_select
    box_selected: {
        type: 0x0413, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "revision", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "frame", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "total", kind: "u32", least: 0, most: 4294967295, since: 1 },
            { name: "nodes", kind: "list", items: "seen_node", max: 65536, since: 1 },
        ],
    },
    // what is seen at each pixel of a rectangle of the newest frame?
    surface_query: {
        type: 0x0414, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "x", kind: "u32", least: 0, most: 16383, since: 1 },
            { name: "y", kind: "u32", least: 0, most: 16383, since: 1 },
            { name: "width", kind: "u32", least: 1, most: 16384, since: 1 },
            { name: "height", kind: "u32", least: 1, most: 16384, since: 1 },
            { name: "what", kind: "u32", least: 1, most: 31, since: 1 },
            { name: "frame", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
        ],
    },
    // answer to surface_query
    surfaces: {
        type: 0x0415, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "revision", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "frame", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "width", kind: "u32", least: 1, most: 16384, since: 1 },
            { name: "height", kind: "u32", least: 1, most: 16384, since: 1 },
            { name: "what", kind: "u32", least: 1, most: 31, since: 1 },
            { name: "data", kind: "bytes", max: 201326592, since: 1 },
        ],
    },
    // how far are the surfaces at two pixels of the newest frame apart?
    measure: {
        type: 0x0416, direction: "C2S", state: "OPEN", role: "VIEW", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "x0", kind: "u32", least: 0, most: 16383, since: 1 },
            { name: "y0", kind: "u32", least: 0, most: 16383, since: 1 },
            { name: "x1", kind: "u32", least: 0, most: 16383, since: 1 },
            { name: "y1", kind: "u32", least: 0, most: 16383, since: 1 },
            { name: "frame", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
        ],
    },
    // answer to measure
    measured: {
        type: 0x0417, direction: "S2C", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "revision", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "frame", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "hit", kind: "bool", since: 1 },
            { name: "node0", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "node1", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "position0", kind: "vec3", since: 1 },
            { name: "position1", kind: "vec3", since: 1 },
            { name: "normal0", kind: "vec3", since: 1 },
            { name: "normal1", kind: "vec3", since: 1 },
            { name: "distance", kind: "f32", least: 0, most: 1e+30, since: 1 },
            { name: "along_normal", kind: "f32", least: 0, most: 1e+30, since: 1 },
            { name: "angle_rad", kind: "f32", least: 0, most: 3.1415927, since: 1 },
        ],
    },
    // the worker accepts sessions
    worker_ready: {
        type: 0x0501, direction: "W2B", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "pid", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "device", kind: "str", max: 65536, since: 1 },
        ],
    },
    // the header's channel now carries this session
    session_attach: {
        type: 0x0502, direction: "B2W", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "session", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "role", kind: "enum", values: "role", since: 1 },
            { name: "scene", kind: "str", max: 256, since: 1 },
            { name: "first_id", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "id_count", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "max_pixels", kind: "u64", least: 1n, most: 18446744073709551615n, since: 1 },
            { name: "replay", kind: "bool", since: 1 },
        ],
    },
    // drop the channel's views and its hold on the scene
    session_detach: {
        type: 0x0503, direction: "B2W", state: "OPEN", role: "NONE", since: 1,
        fields: [],
    },
    // the journal has been replayed
    replay_end: {
        type: 0x0504, direction: "B2W", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "revision", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
        ],
    },
    // sent every 500 ms by the worker's loop
    pulse: {
        type: 0x0505, direction: "W2B", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "busy_ns", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "rss_bytes", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "views", kind: "u32", least: 0, most: 4294967295, since: 1 },
        ],
    },
    // whose session the channel carries: all sessions of one tenant share its turns; without it those without one share theirs
    session_tenant: {
        type: 0x0506, direction: "B2W", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "tenant", kind: "str", max: 128, since: 1 },
            { name: "weight", kind: "u32", least: 1, most: 10000, since: 1 },
            { name: "roots", kind: "str", max: 511, since: 1, optional: true },
        ],
    },
    // before a pulse: what the thread of its busy_ns is at
    busy: {
        type: 0x0507, direction: "W2B", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "channel", kind: "u32", least: 0, most: 4294967295, since: 1 },
            { name: "request", kind: "u32", least: 0, most: 4294967295, since: 1 },
            { name: "view", kind: "u32", least: 0, most: 4294967295, since: 1 },
        ],
    },
    // the client of the channel has a frame of its subscription, and all before it
    delivered: {
        type: 0x0508, direction: "B2W", state: "OPEN", role: "NONE", since: 1,
        fields: [
            { name: "view", kind: "u32", least: 1, most: 4294967295, since: 1 },
            { name: "number", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "at_ns", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1 },
            { name: "begun_ns", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "received_ns", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
            { name: "rtt_ns", kind: "u64", least: 0n, most: 18446744073709551615n, since: 1, optional: true },
        ],
    },
};

// ---- codec -------------------------------------------------------------------------------------
//
// A message is a plain object by the names of messages.def. u8 .. f64 are numbers, u64 is a BigInt
// (whole numbers are taken as well), enums are the names of their values, str is a string, bytes
// and hash are Uint8Array, vectors and matrices are arrays of numbers, lists are arrays of objects.
// An optional field that is not there is not a key of the object.

export const PREFACE = Uint8Array.of(0x48, 0x47, 0x50, 0x0d, 0x0a, 0x1a, 0x0a, 0x01);
export const HEADER_BYTES = 16;
export const FLAG_OPTIONAL = 1;

// Thrown for everything refused. `status` is a name of the status table; `field` is empty when the
// payload ends inside the message or runs over; `offset` counts bytes of the payload.
export class HgpError extends Error {
    constructor(status, field, offset, reason) {
        super(`${field ? field + ": " : ""}${reason} (${status}, byte ${offset})`);
        this.name = "HgpError";
        this.status = status;
        this.field = field;
        this.offset = offset;
        this.reason = reason;
    }
}

const byType = new Map(Object.entries(messages).map(([name, m]) => [m.type, { name, ...m }]));

// { name, type, direction, state, role, since, fields }, or undefined for an unknown type.
export function findMessage(type) {
    return byType.get(type);
}

// ---- headers -----------------------------------------------------------------------------------

export function encodeHeader({ length, type, flags = 0, request = 0, channel = 0 }) {
    const view = new DataView(new ArrayBuffer(HEADER_BYTES));
    view.setUint32(0, length, true);
    view.setUint16(4, type, true);
    view.setUint16(6, flags, true);
    view.setUint32(8, request, true);
    view.setUint32(12, channel, true);
    return new Uint8Array(view.buffer);
}

export function decodeHeader(bytes, limit) {
    if (bytes.length < HEADER_BYTES)
        throw new HgpError("truncated", "", bytes.length, "a header has 16 bytes");
    const view = new DataView(bytes.buffer, bytes.byteOffset, HEADER_BYTES);
    const header = {
        length: view.getUint32(0, true),
        type: view.getUint16(4, true),
        flags: view.getUint16(6, true),
        request: view.getUint32(8, true),
        channel: view.getUint32(12, true),
    };
    if (header.length > limit)
        throw new HgpError("limit", "length", 0, "the payload is longer than allowed");
    if (header.flags & ~FLAG_OPTIONAL)
        throw new HgpError("format", "flags", 6, "an unknown flag is set");
    return header;
}

// ---- rules of values, the same for both directions ---------------------------------------------

const WIDTHS = { u8: 1, u16: 2, u32: 4, u64: 8, i32: 4, f32: 4, f64: 8, bool: 1, enum: 2, hash: 32 };
const FLOATS = { vec2: 2, vec3: 3, vec4: 4, mat4: 16 };

function checkRange(value, least, most) {
    return value < least || value > most ? `${value} is outside of ${least} to ${most}` : null;
}

// The reason why a number, enum or vector is refused, or null.
function checkValue(field, value) {
    switch (field.kind) {
    case "f32":
        if (!Number.isFinite(value))
            return `${value} is not a finite number`;
        return checkRange(value, Math.fround(field.least), Math.fround(field.most));
    case "f64":
        if (!Number.isFinite(value))
            return `${value} is not a finite number`;
        return checkRange(value, field.least, field.most);
    case "vec2":
    case "vec3":
    case "vec4":
    case "mat4":
        return value.every(Number.isFinite) ? null : "not a finite number";
    case "enum":
        return value === undefined ? "not a value of its enum" : null;
    case "hash":
        return null;
    default:
        return checkRange(value, field.least, field.most);
    }
}

function optionalFields(fields, version) {
    return fields.filter((f) => f.optional && f.since <= version);
}

// Optional fields of one bitmap. A message with more has a second one in front of the first of
// the others, and only when one of them is there.
const BITMAP_FIELDS = 32;

// The bits of the optional fields of a bitmap for which is(field) holds.
function bitmapOf(fields, bitmap, is) {
    let bits = 0;
    fields.filter((f) => f.optional).forEach((f, i) => {
        if (Math.floor(i / BITMAP_FIELDS) === bitmap && is(f))
            bits |= 1 << i % BITMAP_FIELDS;
    });
    return bits >>> 0;
}

function knownBits(fields, bitmap, version) {
    return bitmapOf(fields, bitmap, (f) => f.since <= version);
}

function leastBytes(fields, version) {
    const required = fields.filter((f) => !f.optional && f.since <= version);
    const one = (f) => WIDTHS[f.kind] ?? (f.kind in FLOATS ? 4 * FLOATS[f.kind] : 4);
    const bitmap = optionalFields(fields, version).length ? 4 : 0;
    return required.reduce((sum, f) => sum + one(f), bitmap);
}

// ---- decoding ----------------------------------------------------------------------------------

const utf8 = new TextDecoder("utf-8", { fatal: true, ignoreBOM: true });

class Reader {
    constructor(bytes, version) {
        this.bytes = bytes;
        this.view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
        this.version = version;
        this.pos = 0;
    }
    // Moves over `size` bytes and returns where they start.
    take(size) {
        if (size > this.bytes.length - this.pos)
            throw new HgpError("truncated", "", this.pos, "the payload ends inside the message");
        const at = this.pos;
        this.pos += size;
        return at;
    }
    u8() { return this.view.getUint8(this.take(1)); }
    u16() { return this.view.getUint16(this.take(2), true); }
    u32() { return this.view.getUint32(this.take(4), true); }
    i32() { return this.view.getInt32(this.take(4), true); }
    u64() { return this.view.getBigUint64(this.take(8), true); }
    f32() { return this.view.getFloat32(this.take(4), true); }
    f64() { return this.view.getFloat64(this.take(8), true); }
    blob(size) {
        const at = this.take(size);
        return this.bytes.subarray(at, at + size);
    }
}

function readText(bytes) {
    try {
        const text = utf8.decode(bytes);
        return text.includes("\0") ? null : text;
    } catch {
        return null;
    }
}

function decodeBlob(r, field, path, at) {
    const size = r.u32();
    if (size > field.max)
        throw new HgpError("limit", path, at, "longer than allowed");
    const bytes = r.blob(size);
    if (field.kind === "bytes")
        return bytes;
    const text = readText(bytes);
    if (text === null)
        throw new HgpError("format", path, at, "not UTF-8 without NUL");
    return text;
}

function decodeList(r, field, path, at) {
    const count = r.u32();
    if (count > field.max)
        throw new HgpError("limit", path, at, "more items than allowed");
    const fields = structs[field.items];
    if (count * leastBytes(fields, r.version) > r.bytes.length - r.pos)
        throw new HgpError("truncated", "", r.pos, "the payload ends inside the message");
    const list = [];
    for (let i = 0; i < count; i++)
        list.push(decodeFields(r, fields, `${path}[${i}].`));
    return list;
}

function readFixed(r, field) {
    if (field.kind in FLOATS)
        return Array.from({ length: FLOATS[field.kind] }, () => r.f32());
    if (field.kind === "enum") {
        const value = r.u16();
        return Object.keys(enums[field.values]).find((name) => enums[field.values][name] === value);
    }
    return field.kind === "hash" ? r.blob(32) : r[field.kind]();
}

function decodeField(r, field, path) {
    const at = r.pos;
    if (field.kind === "list")
        return decodeList(r, field, path, at);
    if (field.kind === "str" || field.kind === "bytes")
        return decodeBlob(r, field, path, at);
    if (field.kind === "bool") {
        const byte = r.u8();
        if (byte > 1)
            throw new HgpError("format", path, at, "a bool is 0 or 1");
        return byte === 1;
    }
    const value = readFixed(r, field);
    const reason = checkValue(field, value);
    if (reason)
        throw new HgpError("invalid", path, at, reason);
    return value;
}

function decodeBitmap(r, fields, prefix, bitmap) {
    const known = knownBits(fields, bitmap, r.version);
    if (!known || (bitmap > 0 && r.bytes.length - r.pos < 4))
        return 0;
    const bits = r.u32();
    if (bitmap > 0 && bits === 0)
        throw new HgpError("format", prefix + "has", r.pos - 4,
            "a second bitmap without a field");
    if (bits & ~known)
        throw new HgpError("format", prefix + "has", r.pos - 4,
            "a bit of an unknown optional field is set");
    return bits;
}

function decodeFields(r, fields, prefix) {
    let bits = decodeBitmap(r, fields, prefix, 0);
    const out = {};
    let optional = 0;
    for (const field of fields) {
        let there = field.since <= r.version;
        if (field.optional) {
            if (optional === BITMAP_FIELDS)
                bits = decodeBitmap(r, fields, prefix, 1);
            there &&= (bits >>> optional++ % BITMAP_FIELDS & 1) === 1;
        }
        if (there)
            out[field.name] = decodeField(r, field, prefix + field.name);
    }
    return out;
}

// A whole payload by a list of fields; missing and extra bytes are refused.
export function decodeLayout(fields, version, payload) {
    const r = new Reader(payload, version);
    const message = decodeFields(r, fields, "");
    if (r.pos !== payload.length)
        throw new HgpError("format", "", r.pos, "bytes behind the end of the message");
    return message;
}

// bytes and hash fields are views of `payload`.
export function decode(version, type, payload) {
    const info = findMessage(type);
    if (!info || info.since > version)
        throw new HgpError("unsupported", "", 0, "unknown message type");
    return decodeLayout(info.fields, version, payload);
}

// ---- encoding ----------------------------------------------------------------------------------

const utf8Encoder = new TextEncoder();

class Writer {
    constructor(version, start) {
        this.version = version;
        this.start = start;
        this.size = start;
        this.bytes = new Uint8Array(256);
        this.view = new DataView(this.bytes.buffer);
    }
    // Makes room for `size` bytes and returns where they start.
    grow(size) {
        const at = this.size;
        this.size += size;
        if (this.size > this.bytes.length) {
            const bytes = new Uint8Array(Math.max(this.size, this.bytes.length * 2));
            bytes.set(this.bytes.subarray(0, at));
            this.bytes = bytes;
            this.view = new DataView(bytes.buffer);
        }
        return at;
    }
    u8(v) { this.view.setUint8(this.grow(1), v); }
    u16(v) { const at = this.grow(2); this.view.setUint16(at, v, true); }
    u32(v) { const at = this.grow(4); this.view.setUint32(at, v, true); }
    i32(v) { const at = this.grow(4); this.view.setInt32(at, v, true); }
    u64(v) { const at = this.grow(8); this.view.setBigUint64(at, v, true); }
    f32(v) { const at = this.grow(4); this.view.setFloat32(at, v, true); }
    f64(v) { const at = this.grow(8); this.view.setFloat64(at, v, true); }
    blob(bytes) { const at = this.grow(bytes.length); this.bytes.set(bytes, at); }
}

function refuse(w, path, reason) {
    throw new HgpError("invalid", path, w.size - w.start, reason);
}

// The value as it will be on the wire, or undefined when it has the wrong type.
function coerce(field, value) {
    switch (field.kind) {
    case "u64":
        if (Number.isSafeInteger(value))
            return BigInt(value);
        return typeof value === "bigint" ? value : undefined;
    case "f32":
        return typeof value === "number" ? Math.fround(value) : undefined;
    case "f64":
        return typeof value === "number" ? value : undefined;
    case "vec2":
    case "vec3":
    case "vec4":
    case "mat4": {
        const list = Array.from(value ?? [], (v) => (typeof v === "number" ? Math.fround(v) : NaN));
        return list.length === FLOATS[field.kind] ? list : undefined;
    }
    case "bool":
        return typeof value === "boolean" ? value : undefined;
    case "enum":
        return Object.hasOwn(enums[field.values], value) ? enums[field.values][value] : undefined;
    case "hash":
        return value instanceof Uint8Array && value.length === 32 ? value : undefined;
    default:
        return Number.isInteger(value) ? value : undefined;
    }
}

function encodeBlob(w, field, path, value) {
    let bytes = value;
    if (field.kind === "str") {
        // A lone surrogate has no UTF-8 form; TextEncoder would replace it without a word.
        if (typeof value !== "string" || /[\ud800-\udfff]/u.test(value) || value.includes("\0"))
            refuse(w, path, "not UTF-8 without NUL");
        bytes = utf8Encoder.encode(value);
    }
    if (!(bytes instanceof Uint8Array))
        refuse(w, path, "not a Uint8Array");
    if (bytes.length > field.max)
        refuse(w, path, "longer than allowed");
    w.u32(bytes.length);
    w.blob(bytes);
}

function encodeList(w, field, path, value) {
    if (!Array.isArray(value))
        refuse(w, path, "not an array");
    if (value.length > field.max)
        refuse(w, path, "more items than allowed");
    w.u32(value.length);
    value.forEach((item, i) => encodeFields(w, structs[field.items], item, `${path}[${i}].`));
}

function encodeField(w, field, path, value) {
    if (field.kind === "list")
        return encodeList(w, field, path, value);
    if (field.kind === "str" || field.kind === "bytes")
        return encodeBlob(w, field, path, value);
    const wire = coerce(field, value);
    if (wire === undefined)
        refuse(w, path, field.kind === "enum" ? "not a value of its enum" : `not a ${field.kind}`);
    if (field.kind === "bool")
        return w.u8(wire ? 1 : 0);
    const reason = checkValue(field, wire);
    if (reason)
        refuse(w, path, reason);
    if (field.kind in FLOATS)
        return wire.forEach((v) => w.f32(v));
    if (field.kind === "enum")
        return w.u16(wire);
    return field.kind === "hash" ? w.blob(wire) : w[field.kind](wire);
}

function writeBitmap(w, fields, message, bitmap) {
    const bits = bitmapOf(fields, bitmap,
        (f) => f.since <= w.version && message[f.name] !== undefined);
    if (bitmap === 0 ? knownBits(fields, 0, w.version) : bits)
        w.u32(bits);
}

function encodeFields(w, fields, message, prefix) {
    if (typeof message !== "object" || message === null)
        refuse(w, prefix, "not an object");
    for (const key of Object.keys(message))
        if (!fields.some((f) => f.name === key))
            refuse(w, prefix + key, "no such field");
    writeBitmap(w, fields, message, 0);
    let optional = 0;
    for (const field of fields) {
        const value = message[field.name];
        if (field.optional && optional++ === BITMAP_FIELDS)
            writeBitmap(w, fields, message, 1);
        if (field.since > w.version || (field.optional && value === undefined))
            continue;
        if (value === undefined)
            refuse(w, prefix + field.name, "the field is missing");
        encodeField(w, field, prefix + field.name, value);
    }
}

// The payload alone, by a list of fields.
export function encodeLayout(fields, version, message) {
    const w = new Writer(version, 0);
    encodeFields(w, fields, message, "");
    return w.bytes.subarray(0, w.size);
}

// Header and payload of one message, by its name.
export function encode(version, name, message, { request = 0, channel = 0 } = {}) {
    const info = Object.hasOwn(messages, name) ? messages[name] : undefined;
    if (!info || info.since > version)
        throw new HgpError("unsupported", "", 0, "unknown message type");
    const w = new Writer(version, HEADER_BYTES);
    encodeFields(w, info.fields, message, "");
    const length = w.size - HEADER_BYTES;
    w.bytes.set(encodeHeader({ length, type: info.type, request, channel }), 0);
    return w.bytes.subarray(0, w.size);
}
