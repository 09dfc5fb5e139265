// warp.js - the last frame as the local camera would see it, by the depth that came with it: what
// is shown between frames, so that the picture follows the hand however long the way is.
//
// With (x, y) of the old picture, -1..1 and y up, and d what cells hold (1 / depth with perspective,
// depth without), a surface lies at a linear function of (x, y, 1, d) in the new clip space. So a
// mesh of one vertex per cell is exact for planes. Functions are pure but for class Warp.
import { axes, cross, dot, scale, sub } from "./camera.js";

const HEAD_BYTES = 12;
const STEPS = 4094;

// The cells of a frame's `depth`: { columns, rows, values }, row by row; NaN where nothing is.
export async function decodeDepth(data, inflate) {
    const view = new DataView(data.buffer, data.byteOffset, data.length);
    const columns = view.getUint16(0, true), rows = view.getUint16(2, true);
    const low = view.getFloat32(4, true), high = view.getFloat32(8, true);
    const count = columns * rows;
    const planes = await inflate(data.subarray(HEAD_BYTES));
    if (planes.length !== 2 * count)
        throw new Error("the depth of a frame has another size than it says");
    const q = new Uint16Array(count), values = new Float32Array(count);
    for (let i = 0; i < count; i++) {
        const folded = planes[i] | planes[count + i] << 8;
        const left = i % columns ? q[i - 1] : 0, above = i >= columns ? q[i - columns] : 0;
        const between = i % columns && i >= columns ? q[i - columns - 1] : 0;
        q[i] = left + above - between + (folded >> 1 ^ -(folded & 1));
        values[i] = q[i] ? low + (q[i] - 1) / STEPS * (high - low) : NaN;
    }
    return { columns, rows, values, high, low };
}

const isFlat = (camera) => camera.kind === "ORTHOGRAPHIC";

// Right, up and forward, and half of the height of what is seen at a distance of 1.
function frameOf(camera) {
    const { forward, up } = camera;
    return { right: cross(forward, up), up, forward,
        half: isFlat(camera) ? camera.half_height : Math.tan(camera.vfov_rad / 2) };
}

// The 4 x 4 matrix, column-major, from (x, y, 1, d) of a picture to clip space of another camera.
// Cameras are { eye, forward, up, kind, vfov_rad, half_height }, of the same kind; most is the
// greatest amount of d.
export function warpMatrix(from, to, aspect, most = 1) {
    const a = frameOf(from), b = frameOf(to), flat = isFlat(from);
    const shift = sub(from.eye, to.eye);
    // A point less the new eye, times 1 / depth with perspective.
    const columns = [scale(a.right, a.half * aspect), scale(a.up, a.half),
        flat ? shift : a.forward, flat ? a.forward : shift];
    const out = columns.flatMap((c, i) => {
        const depth = dot(c, b.forward);
        const one = i === 2 ? 1 : 0;
        return [dot(c, b.right) / (b.half * aspect), dot(c, b.up) / b.half,
            flat ? depth / (4 * most) : depth, flat ? one : depth];
    });
    // What is nearer wins: z / w is 1 - 1 / (2 most depth), or a part of the depth.
    if (!flat)
        out[14] -= 0.5 / most;
    return out;
}

// Where the matrix takes a place of the picture, -1..1; null: behind the eye.
export function warpPoint(matrix, x, y, d) {
    const at = (row) => matrix[row] * x + matrix[4 + row] * y + matrix[8 + row] + matrix[12 + row] * d;
    const w = at(3);
    return w > 0 ? [at(0) / w, at(1) / w] : null;
}

// ---- drawing -----------------------------------------------------------------------------------

// Two triangles between four neighbouring cells; around the picture lies a ring of more, which holds
// the border's depth. Where the depth jumps and a wide gap opens, what is behind fills it; narrow ones
// are bridged.
const VERTEX = `#version 300 es
precision highp float;
uniform highp sampler2D cells;
uniform mat4 warp;
uniform bool flatten; // without perspective: d is the depth
uniform float most;
out vec2 place;
flat out vec2 behind;
flat out float gap;
ivec2 count;
vec2 placeOf(ivec2 v) {
    vec2 p = vec2(2 * v + 1) / vec2(count) - 1.0;
    p = mix(p, vec2(-3), lessThan(v, ivec2(0)));
    p = mix(p, vec2(3), greaterThanEqual(v, count));
    return vec2(p.x, -p.y);
}
float depthOf(ivec2 v) {
    return texelFetch(cells, clamp(v, ivec2(0), count - 1), 0).r;
}
vec4 clipOf(ivec2 v) {
    return warp * vec4(placeOf(v), 1, depthOf(v));
}
void main() {
    count = textureSize(cells, 0);
    int quad = gl_VertexID / 6, corner = gl_VertexID % 6;
    ivec2 at = ivec2(quad % (count.x + 1), quad / (count.x + 1)) - 1;
    ivec2 farthest = at;
    float low = depthOf(at), high = low;
    vec2 least = vec2(1e9), greatest = vec2(-1e9);
    for (int i = 0; i < 4; i++) {
        ivec2 v = at + ivec2(i & 1, i >> 1);
        float d = depthOf(v);
        vec4 clip = clipOf(v);
        vec2 p = clip.xy / max(clip.w, 1e-9) * vec2(count) / 2.0; // in cells
        least = min(least, p);
        greatest = max(greatest, p);
        if (flatten ? d > high : d < low)
            farthest = v;
        low = min(low, d);
        high = max(high, d);
    }
    bool inside = all(greaterThanEqual(at, ivec2(0))) && all(lessThan(at + 1, count));
    bool jumps = inside && (flatten ? high - low > 0.02 * most : high > 1.5 * low);
    vec2 extent = greatest - least;
    gap = jumps ? smoothstep(2.0, 5.0, max(extent.x, extent.y)) : 0.0;
    behind = placeOf(farthest);
    ivec2 v = at + ivec2(corner == 1 || corner == 3 || corner == 4, corner == 2 || corner == 4 || corner == 5);
    place = placeOf(v);
    gl_Position = clipOf(v);
}`;

// What fills gaps is soft; beyond the border the picture gets softer with the distance.
const FRAGMENT = `#version 300 es
precision highp float;
uniform sampler2D picture;
in vec2 place;
flat in vec2 behind;
flat in float gap;
out vec4 color;
void main() {
    vec2 p = mix(place, behind, gap);
    vec2 beyond = max(abs(p) - 1.0, 0.0);
    float level = 2.0 * gap + log2(1.0 + 60.0 * max(beyond.x, beyond.y));
    color = vec4(textureLod(picture, vec2(0.5 + 0.5 * p.x, 0.5 - 0.5 * p.y), level).rgb, 1);
}`;

function makeProgram(gl) {
    const program = gl.createProgram();
    for (const [type, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
        const shader = gl.createShader(type);
        gl.shaderSource(shader, text);
        gl.compileShader(shader);
        gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS))
        throw new Error(`reprojection: ${gl.getProgramInfoLog(program)}`);
    return program;
}

function makeTexture(gl, unit, filters) {
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    for (const [name, value] of [["WRAP_S", "CLAMP_TO_EDGE"], ["WRAP_T", "CLAMP_TO_EDGE"],
        ["MIN_FILTER", filters[0]], ["MAG_FILTER", filters[1]]])
        gl.texParameteri(gl.TEXTURE_2D, gl[`TEXTURE_${name}`], gl[value]);
}

// A canvas over the picture, hidden while the picture itself is what is to be seen.
export class Warp {
    constructor(canvas) {
        this.canvas = canvas;
        this.state = null; // { seq, revision, grid, camera } of the newest depth
        this.isNew = { picture: false, grid: false }; // not on the device yet
    }

    // False: this browser has no WebGL 2, or has taken it away.
    start() {
        if (this.gl === undefined) {
            this.gl = this.canvas.getContext("webgl2",
                { alpha: false, antialias: false, powerPreference: "low-power" });
            this.canvas.addEventListener("webglcontextlost", () => {
                this.gl = null;
                this.hide();
            });
            try {
                this.gl &&= this.prepare(this.gl);
            } catch (error) {
                console.warn(error.message);
                this.gl = null;
            }
        }
        return Boolean(this.gl);
    }

    prepare(gl) {
        this.program = makeProgram(gl);
        this.at = Object.fromEntries(["cells", "picture", "warp", "flatten", "most"].map(
            (name) => [name, gl.getUniformLocation(this.program, name)]));
        gl.useProgram(this.program);
        makeTexture(gl, 0, ["LINEAR_MIPMAP_LINEAR", "LINEAR"]);
        makeTexture(gl, 1, ["NEAREST", "NEAREST"]);
        gl.uniform1i(this.at.picture, 0);
        gl.uniform1i(this.at.cells, 1);
        gl.enable(gl.DEPTH_TEST);
        gl.depthFunc(gl.LEQUAL); // what is infinitely far is at 1
        return gl;
    }

    // The picture on the canvas is another one: with its own depth, that of its state, or none.
    take(frame) {
        const { input_seq: seq, scene_revision: revision, grid } = frame;
        if (grid)
            this.state = { seq, revision, grid, camera: { eye: frame.eye, forward: frame.forward,
                up: frame.up, kind: frame.kind ?? "PERSPECTIVE", vfov_rad: frame.vfov_rad,
                half_height: frame.half_height } };
        else if (this.state?.seq !== seq || this.state.revision !== revision)
            this.state = null;
        this.isNew.grid ||= Boolean(grid);
        this.isNew.picture = true;
    }

    hide() {
        this.canvas.hidden = true;
    }

    // Shows the picture of `source` as `camera` sees it; false: there is nothing to do that with.
    show(source, camera) {
        const { state } = this;
        if (!state || state.camera.kind !== camera.kind || !this.start()) {
            this.hide();
            return false;
        }
        this.upload(source, state.grid);
        this.draw(source.width / source.height, { ...camera, ...axes(camera) });
        this.canvas.hidden = false;
        return true;
    }

    upload(source, { columns, rows, values, low, high }) {
        const { gl, canvas, isNew } = this;
        if (canvas.width !== source.width || canvas.height !== source.height) {
            canvas.width = source.width;
            canvas.height = source.height;
        }
        if (isNew.picture) {
            gl.activeTexture(gl.TEXTURE0);
            gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, source);
            gl.generateMipmap(gl.TEXTURE_2D);
        }
        if (isNew.grid) {
            const isFar = isFlat(this.state.camera) ? high : 0; // where nothing is
            gl.activeTexture(gl.TEXTURE1);
            gl.texImage2D(gl.TEXTURE_2D, 0, gl.R32F, columns, rows, 0, gl.RED, gl.FLOAT,
                values.map((v) => Number.isNaN(v) ? isFar : v));
            this.most = Math.max(Math.abs(low), Math.abs(high)) || 1;
        }
        this.isNew = { picture: false, grid: false };
    }

    draw(aspect, camera) {
        const { gl, at, canvas, state, most } = this;
        const { columns, rows } = state.grid;
        gl.viewport(0, 0, canvas.width, canvas.height);
        gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
        gl.uniformMatrix4fv(at.warp, false, warpMatrix(state.camera, camera, aspect, most));
        gl.uniform1i(at.flatten, isFlat(camera) ? 1 : 0);
        gl.uniform1f(at.most, most);
        gl.drawArrays(gl.TRIANGLES, 0, 6 * (columns + 1) * (rows + 1));
    }
}
