// vertex.glsl - vertices for raster passes, and surface points of pixels for everything after.
//
// Include lib/frame.glsl first: camera and geometry are reached through hg_frame.
#ifndef HG_LIB_VERTEX_GLSL
#define HG_LIB_VERTEX_GLSL

#include "lib/octahedral.glsl"
#include "lib/tables.glsl"
#include "shared/geometry.h"

// Position of a vertex relative to the eye; hg_clip_position takes it to clip space. Precision
// follows the distance to the eye.
vec3 hg_relative_position(mat4x3 world, vec3 position)
{
    return mat3(world) * position + (world[3] - hg_frame.camera.eye_ws);
}

vec4 hg_clip_position(vec3 relative)
{
    // proj * view * p = (proj * rotation) * (p - eye) + last column of proj
    return hg_frame.camera.view_proj * vec4(relative, 0.0) + hg_frame.camera.proj[3];
}

// A corner in world space as structures of rays have it, to the bit (hg_trace_to_world of
// renderer/trace/layout.h): no step is contracted.
vec3 hg_world_corner(mat4x3 world, vec3 p)
{
    precise vec3 q = world[0] * p.x + world[1] * p.y + world[2] * p.z + world[3];
    return q;
}

uint hg_extra_words(uint flags)
{
    return ((flags & HG_DRAW_UV1) != 0u ? 2u : 0u) + ((flags & HG_DRAW_COLOR8) != 0u ? 1u : 0u) +
        ((flags & HG_DRAW_COLOR16) != 0u ? 2u : 0u);
}

vec2 hg_fetch_uv1(hg_word_stream extra, uint flags, uint vertex)
{
    uint at = vertex * hg_extra_words(flags);
    return uintBitsToFloat(uvec2(extra.v[at], extra.v[at + 1u]));
}

vec4 hg_fetch_color(hg_word_stream extra, uint flags, uint vertex)
{
    uint at = vertex * hg_extra_words(flags) + ((flags & HG_DRAW_UV1) != 0u ? 2u : 0u);
    if ((flags & HG_DRAW_COLOR8) != 0u)
        return unpackUnorm4x8(extra.v[at]);
    return vec4(unpackUnorm2x16(extra.v[at]), unpackUnorm2x16(extra.v[at + 1u]));
}

// A point of a surface as a pixel sees it.
struct hg_vertex {
    vec3 position_ws;
    float depth;            // distance along the view direction, metres
    vec3 normal_ws;         // interpolated, unit, on the side the mesh says
    vec3 geometric_ws;      // of the triangle, unit, on the front side (counter-clockwise)
    vec4 tangent_ws;        // unit xyz; w: bitangent = w * cross(normal, tangent)
    vec2 uv0, uv0_dx, uv0_dy; // per pixel
    vec2 uv1, uv1_dx, uv1_dy;
    vec4 color;             // linear
    uint material, flags;   // flags: HG_DRAW_*
    uint instance;
    bool front;             // the eye is on the front side
};

// Perspective-correct barycentrics at a pixel and their change per pixel.
struct hg_barycentrics {
    vec3 at, dx, dy;
};

// v: (x, y, w) of clip space; ndc: the pixel. Works with vertices behind the eye and for any
// projection: with q_i = (x_i, y_i) - ndc w_i, the weights are proportional to the 2D cross
// products of the other two q. Subtracting the pixel first keeps the digits of small triangles.
// Source: Olano and Greer 1997, "Triangle Scan Conversion using 2D Homogeneous Coordinates".
hg_barycentrics hg_barycentrics_triangle(vec3 v0, vec3 v1, vec3 v2, vec2 ndc, vec2 ndc_per_px)
{
    vec2 q0 = v0.xy - ndc * v0.z, q1 = v1.xy - ndc * v1.z, q2 = v2.xy - ndc * v2.z;
    vec3 e = vec3(q1.x * q2.y - q1.y * q2.x, q2.x * q0.y - q2.y * q0.x, q0.x * q1.y - q0.y * q1.x);
    vec3 ex = vec3(q1.y * v2.z - v1.z * q2.y, q2.y * v0.z - v2.z * q0.y, q0.y * v1.z - v0.z * q1.y);
    vec3 ey = vec3(v1.z * q2.x - q1.x * v2.z, v2.z * q0.x - q2.x * v0.z, v0.z * q1.x - q0.x * v1.z);
    float sum = e.x + e.y + e.z;
    float scale = sum != 0.0 ? 1.0 / sum : 0.0;
    hg_barycentrics b;
    b.at = e * scale;
    b.dx = (ex - b.at * (ex.x + ex.y + ex.z)) * (scale * ndc_per_px.x);
    b.dy = (ey - b.at * (ey.x + ey.y + ey.z)) * (scale * ndc_per_px.y);
    return b;
}

// Nearest point of a line on the screen; derivatives are 0 (one pixel wide, sampled sharply).
hg_barycentrics hg_barycentrics_line(vec3 v0, vec3 v1, vec2 ndc)
{
    vec2 a = v0.xy / v0.z - ndc, b = v1.xy / v1.z - ndc;
    float s = clamp(dot(-a, b - a) / max(dot(b - a, b - a), 1e-20), 0.0, 1.0);
    float w = s * v0.z / max(s * v0.z + (1.0 - s) * v1.z, 1e-20);
    return hg_barycentrics(vec3(1.0 - w, w, 0.0), vec3(0.0), vec3(0.0));
}

// Direction of growing u in the triangle, for parts without tangents, not unit; w: sign of the
// bitangent.
vec4 hg_direction_of_u(vec3 e1, vec3 e2, vec2 d1, vec2 d2)
{
    float det = d1.x * d2.y - d1.y * d2.x, side = det < 0.0 ? -1.0 : 1.0;
    return vec4((e1 * d2.y - e2 * d1.y) * side, side);
}

// The part of t that is orthogonal to n, unit; any such direction when there is none.
vec3 hg_orthogonal(vec3 t, vec3 n)
{
    t -= n * dot(n, t);
    float length2 = dot(t, t);
    if (length2 < 1e-30) {
        t = abs(n.x) < 0.5 ? vec3(1.0, 0.0, 0.0) : vec3(0.0, 1.0, 0.0);
        t -= n * dot(n, t);
        length2 = dot(t, t);
    }
    return t * inversesqrt(length2);
}

// Surface point of primitive `triangle` of a draw at pixel (gl_FragCoord.xy: centres at .5).
hg_vertex hg_fetch_triangle(uint draw, uint triangle, vec2 pixel)
{
    hg_gpu_draw d = hg_draw_at(draw);
    hg_gpu_part part = hg_part_at(d.part);
    if (HG_HAS(HG_FEATURE_LOD) && (d.flags & HG_DRAW_LOD) != 0u) {
        part = hg_part_list(part.indices).v[triangle >> HG_LOD_SHIFT];
        triangle &= (1u << HG_LOD_SHIFT) - 1u;
    }
    mat4x3 world = hg_world_at(d.instance);
    uint corners = 3u;
    if (HG_HAS(HG_FEATURE_VERTICES))
        corners = (d.flags & HG_DRAW_POINTS) != 0u ? 1u : (d.flags & HG_DRAW_LINES) != 0u ? 2u : 3u;
    uint first = triangle * corners;
    uint i0 = part.indices.v[first];
    uint i1 = corners > 1u ? part.indices.v[first + 1u] : i0;
    uint i2 = corners > 2u ? part.indices.v[first + 2u] : i1;
    vec3 p0 = hg_relative_position(world, part.positions.v[i0]);
    vec3 p1 = hg_relative_position(world, part.positions.v[i1]);
    vec3 p2 = hg_relative_position(world, part.positions.v[i2]);

    vec2 ndc_per_px = 2.0 * hg_frame.inv_size;
    vec2 ndc = pixel * ndc_per_px - 1.0;
    vec3 c0 = hg_clip_position(p0).xyw, c1 = hg_clip_position(p1).xyw, c2 = hg_clip_position(p2).xyw;
    hg_barycentrics b;
    b = hg_barycentrics_triangle(c0, c1, c2, ndc, ndc_per_px);
    if (HG_HAS(HG_FEATURE_VERTICES) && corners == 2u)
        b = hg_barycentrics_line(c0, c1, ndc);
    if (HG_HAS(HG_FEATURE_VERTICES) && corners == 1u)
        b = hg_barycentrics(vec3(1.0, 0.0, 0.0), vec3(0.0), vec3(0.0));

    hg_vertex o;
    vec3 relative = p0 * b.at.x + p1 * b.at.y + p2 * b.at.z;
    vec3 eye_dir = hg_frame.camera.orthographic != 0u ? -hg_frame.camera.forward_ws : -relative;
    o.position_ws = hg_frame.camera.eye_ws + relative;
    o.depth = dot(relative, hg_frame.camera.forward_ws);
    o.material = d.material;
    o.flags = d.flags;
    o.instance = d.instance;

    float handed = (d.flags & HG_DRAW_MIRRORED) != 0u ? -1.0 : 1.0;
    vec3 face = cross(p1 - p0, p2 - p0) * handed;
    float area2 = dot(face, face);
    o.geometric_ws = corners == 3u && area2 > 0.0 ? face * inversesqrt(area2) : normalize(eye_dir);
    o.front = dot(o.geometric_ws, eye_dir) >= 0.0;

    hg_gpu_vertex a0 = part.vertices.v[i0], a1 = part.vertices.v[i1], a2 = part.vertices.v[i2];
    o.normal_ws = o.geometric_ws;
    if ((d.flags & HG_DRAW_NORMALS) != 0u) {
        vec3 n = hg_decode_normal(a0.normal) * b.at.x + hg_decode_normal(a1.normal) * b.at.y +
            hg_decode_normal(a2.normal) * b.at.z;
        // The cofactor matrix is the inverse transpose times the determinant.
        n = (cross(world[1], world[2]) * n.x + cross(world[2], world[0]) * n.y +
            cross(world[0], world[1]) * n.z) * handed;
        float length2 = dot(n, n);
        if (length2 > 0.0)
            o.normal_ws = n * inversesqrt(length2);
    }
    o.uv0 = a0.uv * b.at.x + a1.uv * b.at.y + a2.uv * b.at.z;
    o.uv0_dx = a0.uv * b.dx.x + a1.uv * b.dx.y + a2.uv * b.dx.z;
    o.uv0_dy = a0.uv * b.dy.x + a1.uv * b.dy.y + a2.uv * b.dy.z;
    if (!HG_HAS(HG_FEATURE_NO_TANGENTS) || (d.flags & HG_DRAW_TANGENTS) != 0u) {
        vec4 t0 = hg_decode_tangent(a0.tangent);
        vec3 t = t0.xyz * b.at.x + hg_decode_tangent(a1.tangent).xyz * b.at.y +
            hg_decode_tangent(a2.tangent).xyz * b.at.z;
        t = mat3(world) * t;
        o.tangent_ws = vec4(t * inversesqrt(max(dot(t, t), 1e-30)), t0.w * handed);
    } else {
        o.tangent_ws = hg_direction_of_u(p1 - p0, p2 - p0, a1.uv - a0.uv, a2.uv - a0.uv);
        o.tangent_ws.xyz = hg_orthogonal(o.tangent_ws.xyz, o.normal_ws);
    }
    o.uv1 = o.uv0;
    o.uv1_dx = o.uv0_dx;
    o.uv1_dy = o.uv0_dy;
    if (HG_HAS(HG_FEATURE_VERTICES) && (d.flags & HG_DRAW_UV1) != 0u) {
        vec2 u0 = hg_fetch_uv1(part.extra, d.flags, i0), u1 = hg_fetch_uv1(part.extra, d.flags, i1);
        vec2 u2 = hg_fetch_uv1(part.extra, d.flags, i2);
        o.uv1 = u0 * b.at.x + u1 * b.at.y + u2 * b.at.z;
        o.uv1_dx = u0 * b.dx.x + u1 * b.dx.y + u2 * b.dx.z;
        o.uv1_dy = u0 * b.dy.x + u1 * b.dy.y + u2 * b.dy.z;
    }
    o.color = vec4(1.0);
    if (HG_HAS(HG_FEATURE_VERTICES) && (d.flags & (HG_DRAW_COLOR8 | HG_DRAW_COLOR16)) != 0u)
        o.color = hg_fetch_color(part.extra, d.flags, i0) * b.at.x +
            hg_fetch_color(part.extra, d.flags, i1) * b.at.y + hg_fetch_color(part.extra, d.flags, i2) * b.at.z;
    return o;
}

#endif
