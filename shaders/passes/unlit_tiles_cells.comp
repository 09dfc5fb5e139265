// Which cells of the picture hold nothing but surfaces that no light reaches, for sure: everything
// is rounded towards lit. One invocation per cell.
//
// What a cell shows lies in the piece of the view behind it between its nearest and its farthest
// surface. Such a piece is a range of directions times a range of depths, so its bounds along an
// axis are those of the product of two intervals.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/frame.glsl"
#include "lib/tables.glsl"
#include "lib/unlit_tiles.glsl"
#include "shared/pass_io.h"

layout(local_size_x = HG_UNLIT_TILES_GROUP) in;
HG_DEPTH_IO(HG_IO_DECLARE) // 0 = nothing

// Filter radius around a receiver in texels: HG_SHADOW_RADIUS_PX, bilinear, rounding.
#define REACH_PX 3.0
// Distance in texels of what is compared with a receiver's plane, and its steepest slope (that of
// HG_SHADOW_MIN_COS): how far along the light its depth may be raised, with its bias.
#define STEEPEST 20.0
#define RAISE_PX (2.93 * STEEPEST + 0.5)
// Surface points by way of facets and of depth differ by less than this, of their distance.
#define ERROR 1e-3

struct piece {
    vec2 low, high; // px
    float near, far; // metres along the view
};

// Nearest and farthest surface as depths; far = 0 where there is none.
vec2 depths_of(uvec2 first)
{
    vec2 inv_size = 1.0 / vec2(unlit.width, unlit.height);
    float near = 0.0, far = 2.0;
    const uint gathers = uint(HG_UNLIT_TILES_CELL_PX) / 2u; // along a side
    uint i = 0u;
    do {
        vec2 at = vec2(first) + 2.0 * vec2(i % gathers, i / gathers) + 1.0;
        vec4 d = textureGather(hg_depth, at * inv_size);
        near = max(near, max(max(d.x, d.y), max(d.z, d.w)));
        d = mix(d, vec4(2.0), equal(d, vec4(0.0)));
        far = min(far, min(min(d.x, d.y), min(d.z, d.w)));
    } while (++i < gathers * gathers);
    return vec2(near, far);
}

float distance_of(float depth)
{
    mat4 p = hg_frame.camera.proj;
    return hg_frame.camera.orthographic != 0u ? (p[3][2] - depth) / p[2][2]
                                              : p[3][2] / (depth + p[2][2]);
}

// Bounds of a piece along an axis, from the eye.
vec2 along(piece p, vec3 axis)
{
    float x = dot(hg_frame.camera.ray_x_ws, axis), y = dot(hg_frame.camera.ray_y_ws, axis);
    vec2 at_x = vec2(p.low.x, p.high.x) * x, at_y = vec2(p.low.y, p.high.y) * y;
    vec2 side = vec2(min(at_x.x, at_x.y) + min(at_y.x, at_y.y),
        max(at_x.x, at_x.y) + max(at_y.x, at_y.y));
    if (hg_frame.camera.orthographic != 0u) {
        vec2 deep = vec2(p.near, p.far) * dot(hg_frame.camera.forward_ws, axis);
        side += dot(hg_frame.camera.ray_origin_ws - hg_frame.camera.eye_ws, axis);
        return side + vec2(min(deep.x, deep.y), max(deep.x, deep.y));
    }
    side += dot(hg_frame.camera.ray_origin_ws, axis);
    return vec2(min(side.x * p.near, side.x * p.far), max(side.y * p.near, side.y * p.far));
}

// Farthest caster over the texels [low, high] of the atlas; 0 when the range exceeds the pyramid.
float farthest(vec2 low, vec2 high)
{
    uvec2 first = uvec2(low) / uint(HG_UNLIT_TILES_TEXELS), last = uvec2(high) / uint(HG_UNLIT_TILES_TEXELS);
    uint level = 0u;
    do {
        if (any(greaterThan(last - first, uvec2(1u)))) {
            level++;
            first >>= 1u;
            last >>= 1u;
        }
    } while (level < uint(HG_UNLIT_TILES_LEVELS - 1) && any(greaterThan(last - first, uvec2(1u))));
    if (any(greaterThan(last - first, uvec2(1u))))
        return 0.0;
    uint side = hg_unlit_tiles_side(level), base = hg_unlit_tiles_first(level);
    return min(min(unlit.levels.v[base + first.y * side + first.x],
                   unlit.levels.v[base + first.y * side + last.x]),
        min(unlit.levels.v[base + last.y * side + first.x],
            unlit.levels.v[base + last.y * side + last.x]));
}

#define LIT  0u
#define DARK 1u
#define AWAY 2u // no part of the piece lies in the map

// last: no map comes after this one. whole: all of the piece lies in the map, wherever cascades hand
// over.
uint in_map(hg_gpu_shadow s, piece p, bool last, out bool whole)
{
    bool disc = (hg_frame.flags & HG_FRAME_SUN_DISC) != 0u;
    float wider = disc ? HG_PENUMBRA_MOST_PX : 0.0;
    vec3 eye = hg_frame.camera.eye_ws - s.origin_ws;
    vec2 x = along(p, s.right_ws) + dot(eye, s.right_ws);
    vec2 y = along(p, s.up_ws) + dot(eye, s.up_ws);
    vec2 z = along(p, s.forward_ws) + dot(eye, s.forward_ws);
    float off = s.texel_size + hg_frame.lighting.shadow_slack_m +
        hg_frame.lighting.shadow_slack_per_m * p.far + ERROR * p.far;
    x += vec2(-off, off);
    y += vec2(-off, off);
    z += vec2(-off, off);
    vec4 edges = vec4(x, y) * s.scale;
    vec4 apart = abs(edges);
    whole = max(max(apart.x, apart.y), max(apart.z, apart.w)) <= (last ? 1.0 : 0.9) * s.extent &&
        z.y * s.depth_scale < 1.0;
    if (edges.x > s.extent || edges.y < -s.extent || edges.z > s.extent || edges.w < -s.extent)
        return AWAY;
    // What lies past the edge falls to the next map, or is lit when this is the last one.
    edges = clamp(edges, -s.extent, s.extent);
    vec2 middle = s.rect_px + 0.5 * s.size_px;
    vec2 low = middle + vec2(edges.x, -edges.w) * (0.5 * s.size_px) - REACH_PX - wider;
    vec2 high = middle + vec2(edges.y, -edges.z) * (0.5 * s.size_px) + REACH_PX + wider;
    low = max(low, s.rect_px);
    high = min(high, s.rect_px + s.size_px - 1.0);
    float depth = 1.0 - (z.x - (RAISE_PX + wider * STEEPEST) * s.texel_size) * s.depth_scale;
    return farthest(low, high) > depth + 1e-5 ? DARK : LIT;
}

bool hides_sun(hg_gpu_light light, piece p)
{
    uint i = light.shadow, last = light.shadow + light.shadow_count - 1u;
    if ((hg_frame.flags & HG_FRAME_COARSE_SHADOWS) != 0u)
        i = last;
    bool hidden = true, whole;
    do {
        uint found = in_map(hg_shadow_at(i), p, i == last, whole);
        hidden = hidden && found != LIT && (i < last || (found == DARK && whole));
    } while (hidden && !whole && ++i <= last);
    return hidden;
}

bool out_of_range(hg_gpu_light light, piece p)
{
    vec3 eye = hg_frame.camera.eye_ws - light.position_ws;
    vec2 x = along(p, vec3(1.0, 0.0, 0.0)) + eye.x;
    vec2 y = along(p, vec3(0.0, 1.0, 0.0)) + eye.y;
    vec2 z = along(p, vec3(0.0, 0.0, 1.0)) + eye.z;
    vec3 apart = max(max(vec3(x.x, y.x, z.x), -vec3(x.y, y.y, z.y)) - ERROR * p.far, vec3(0.0));
    return dot(apart, apart) * light.inv_range_sq > 1.0;
}

bool is_dark(uvec2 cell)
{
    uvec2 first = cell * uint(HG_UNLIT_TILES_CELL_PX);
    vec2 depths = depths_of(first);
    if (depths.x <= 0.0)
        return false; // nothing is there: it need not be marked
    piece p; // a pixel more on each side, for lines and points
    p.low = vec2(first) - 1.0;
    p.high = vec2(first + uint(HG_UNLIT_TILES_CELL_PX)) + 1.0;
    p.near = distance_of(depths.x);
    p.far = distance_of(depths.y);
    bool hidden = true;
    uint i = 0u;
    do {
        hg_gpu_light light = hg_light_at(i);
        if (light.kind != HG_LIGHT_KIND_DIRECTIONAL)
            hidden = hidden && out_of_range(light, p);
        else if (light.shadow != HG_SHADOW_NONE && light.radiance <= 0.0)
            hidden = hidden && hides_sun(light, p);
        else
            hidden = false;
    } while (hidden && ++i < hg_frame.lighting.light_count);
    return hidden;
}

void main()
{
    uint at = gl_GlobalInvocationID.x;
    if (at == 0u)
        unlit.head.v = hg_gpu_unlit_head(0u, 1u, 0u, 0u, 0u);
    if (at < unlit.columns * unlit.rows)
        unlit.cells.v[at] = is_dark(uvec2(at % unlit.columns, at / unlit.columns)) ? 1u : 0u;
}
