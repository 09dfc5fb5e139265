// camera.js - the viewer's camera: where it stands, how it moves, where it sees a point.
// Pure functions over plain objects; metres and radians, right-handed, +Y up. No DOM.
//
// A camera is { eye, target, up, kind, vfov_rad, half_height }, as in view_camera of the protocol.

const POLE = 0.002; // radians that an orbit stays away from straight up and down

export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scale = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) =>
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const length = (a) => Math.hypot(...a);
export const normalize = (a) => {
    const l = length(a);
    return l > 0 ? scale(a, 1 / l) : [0, 0, -1];
};

export function makeCamera(from = {}) {
    return {
        eye: from.eye ?? [0, 0, 4],
        target: from.target ?? [0, 0, 0],
        up: from.up ?? [0, 1, 0],
        kind: from.kind ?? "PERSPECTIVE",
        vfov_rad: from.vfov_rad || Math.PI / 4,
        half_height: from.half_height || 1,
    };
}

export const distance = (camera) => length(sub(camera.target, camera.eye));

// Right, up and forward of the picture, of unit length.
export function axes(camera) {
    const forward = normalize(sub(camera.target, camera.eye));
    let right = cross(forward, camera.up);
    if (length(right) < 1e-6)
        right = cross(forward, [0, 0, forward[1] > 0 ? 1 : -1]);
    right = normalize(right);
    return { right, up: cross(right, forward), forward };
}

// Angles of a direction: azimuth about +Y from +Z, elevation above the horizon.
function anglesOf(direction) {
    const d = normalize(direction);
    return [Math.atan2(d[0], d[2]), Math.asin(Math.max(-1, Math.min(1, d[1])))];
}

function directionOf(azimuth, elevation) {
    const most = Math.PI / 2 - POLE;
    const e = Math.max(-most, Math.min(most, elevation));
    return [Math.cos(e) * Math.sin(azimuth), Math.sin(e), Math.cos(e) * Math.cos(azimuth)];
}

// Around the target.
export function orbit(camera, azimuth_rad, elevation_rad) {
    const [a, e] = anglesOf(sub(camera.eye, camera.target));
    const direction = directionOf(a + azimuth_rad, e + elevation_rad);
    camera.eye = add(camera.target, scale(direction, distance(camera)));
    camera.up = [0, 1, 0];
}

// The eye stays, what it looks at changes.
export function look(camera, azimuth_rad, elevation_rad) {
    const [a, e] = anglesOf(sub(camera.target, camera.eye));
    const direction = directionOf(a + azimuth_rad, e + elevation_rad);
    camera.target = add(camera.eye, scale(direction, distance(camera)));
    camera.up = [0, 1, 0];
}

// Half of the picture's height in metres, in the plane of the target.
export function halfHeight(camera) {
    return camera.kind === "ORTHOGRAPHIC" ? camera.half_height
        : distance(camera) * Math.tan(camera.vfov_rad / 2);
}

function shift(camera, by) {
    camera.eye = add(camera.eye, by);
    camera.target = add(camera.target, by);
}

// Moves so that what lies in the target's plane follows a pointer: px of a picture height_px high.
export function pan(camera, dx_px, dy_px, height_px) {
    const { right, up } = axes(camera);
    const metres = 2 * halfHeight(camera) / Math.max(1, height_px);
    shift(camera, add(scale(right, -dx_px * metres), scale(up, dy_px * metres)));
}

// Nearer (factor < 1) or farther; the point under (x, y), -1..1 of the picture, stays under it.
export function dolly(camera, factor, x = 0, y = 0, aspect = 1) {
    const before = halfHeight(camera);
    const { right, up } = axes(camera);
    const by = (1 - factor) * before;
    camera.half_height *= factor;
    const offset = scale(sub(camera.eye, camera.target), factor);
    camera.target = add(camera.target, add(scale(right, x * aspect * by), scale(up, y * by)));
    camera.eye = add(camera.target, offset);
}

// Flies by metres along the picture's axes; `level` walks: forward is horizontal, up is +Y.
export function move(camera, rightward, upward, forward, level) {
    const a = axes(camera);
    const ahead = level ? normalize([a.forward[0], 0, a.forward[2]]) : a.forward;
    const above = level ? [0, 1, 0] : a.up;
    shift(camera, add(scale(a.right, rightward), add(scale(above, upward), scale(ahead, forward))));
}

// Where the picture shows a point, in px from the top left, or null behind the eye.
export function project(camera, point, width_px, height_px) {
    const { right, up, forward } = axes(camera);
    const d = sub(point, camera.eye);
    const depth = dot(d, forward);
    if (depth <= 1e-6)
        return null;
    const half = camera.kind === "ORTHOGRAPHIC" ? camera.half_height
        : depth * Math.tan(camera.vfov_rad / 2);
    return {
        x: width_px / 2 + dot(d, right) / half * height_px / 2,
        y: height_px / 2 - dot(d, up) / half * height_px / 2,
        depth,
    };
}

// ---- a part of the picture that is free --------------------------------------------------------

const size = ([from, to]) => to - from;

// The same lens for a picture that shows `share` of it.
export const narrowed = (vfov_rad, share) => 2 * Math.atan(Math.tan(vfov_rad / 2) * share);

// A camera that was fitted for `share` of the picture (narrowed), as one of the whole picture that shows the same in the
// middle of what is free ({ x, y }: shares from the left and the top).
export function intoFree(fitted, share, free, aspect) {
    const camera = makeCamera({ ...fitted, vfov_rad: narrowed(fitted.vfov_rad, 1 / share),
        half_height: fitted.half_height / share });
    const away = ([from, to]) => (from + to - 1) / 2;
    pan(camera, away(free.x) * aspect, away(free.y), 1);
    return camera;
}

// Whether a box of the world lies in what is free.
export function isFree(camera, box, free, aspect) {
    const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((i) =>
        project(camera, [0, 1, 2].map((k) => (i >> k & 1 ? box.max : box.min)[k]), aspect, 1));
    const within = (v, [from, to]) => v >= from && v <= to;
    return corners.every((p) => p && within(p.x / aspect, free.x) && within(p.y, free.y));
}

// The shares of the picture to fit for, the best first: all that is free of its width or height, then of both.
export function sharesOf(free) {
    return [...new Set([Math.max(size(free.x), size(free.y)), Math.min(size(free.x), size(free.y))])];
}

// Between two cameras, 0..1; around the target, so that a turn keeps its distance.
export function blend(a, b, t) {
    const mix = (x, y) => x + (y - x) * t;
    const mix3 = (x, y) => x.map((v, i) => mix(v, y[i]));
    const [a1, e1] = anglesOf(sub(a.eye, a.target));
    const [a2, e2] = anglesOf(sub(b.eye, b.target));
    const turn = ((a2 - a1 + 3 * Math.PI) % (2 * Math.PI) + 2 * Math.PI) % (2 * Math.PI) - Math.PI;
    const target = mix3(a.target, b.target);
    const direction = directionOf(a1 + turn * t, mix(e1, e2));
    return {
        eye: t >= 1 ? b.eye : add(target, scale(direction, mix(distance(a), distance(b)))),
        target,
        up: t >= 1 ? b.up : [0, 1, 0],
        kind: b.kind,
        vfov_rad: mix(a.vfov_rad, b.vfov_rad),
        half_height: mix(a.half_height, b.half_height),
    };
}

// As messages carry them, in single precision: the server draws nothing for a camera that it has.
export function isSame(a, b) {
    const same = (v, w) => Math.fround(v) === Math.fround(w);
    return a.kind === b.kind && same(a.vfov_rad, b.vfov_rad) && same(a.half_height, b.half_height)
        && ["eye", "target", "up"].every((k) => a[k].every((v, i) => same(v, b[k][i])));
}

// ---- as text, for links ------------------------------------------------------------------------

const round = (v) => Number(v.toPrecision(7));

export function cameraToText(camera) {
    const flat = camera.kind === "ORTHOGRAPHIC";
    const lens = flat ? camera.half_height : camera.vfov_rad;
    return [...camera.eye, ...camera.target, lens].map(round).join(",") + (flat ? ",o" : "");
}

// A camera, or null when the text is none.
export function cameraFromText(text) {
    const parts = text.split(",");
    const flat = parts.length === 8 && parts[7] === "o";
    const numbers = parts.slice(0, 7).map(Number);
    if (numbers.length !== 7 || (parts.length !== 7 && !flat) || !numbers.every(Number.isFinite)
        || numbers[6] <= 0 || (!flat && numbers[6] > 3.13))
        return null;
    const eye = numbers.slice(0, 3), target = numbers.slice(3, 6);
    if (length(sub(eye, target)) === 0)
        return null;
    return makeCamera({ eye, target, kind: flat ? "ORTHOGRAPHIC" : "PERSPECTIVE",
        [flat ? "half_height" : "vfov_rad"]: numbers[6] });
}
