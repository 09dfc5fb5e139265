// What the renderer does, as colours (renderer/passes/debug.h).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

layout(constant_id = 0) const uint hg_view = 1u; // HG_DEBUG_VIEW_*

#include "lib/frame.glsl"
#include "lib/vertex.glsl"
#include "lib/texture.glsl"
#include "lib/material.glsl"
#define HG_PROBES_BILINEAR // one sample per pixel
#include "lib/probes.glsl"
#include "lib/debug_probes.glsl"
#include "lib/light.glsl"
#include "shared/pass_io.h"

HG_DEBUG_IO(HG_IO_DECLARE)

layout(location = 0) out vec4 out_color;

const vec3 hg_grey = vec3(0.2);
// Levels 0 .. 7: red, orange, yellow, green, turquoise, blue, indigo, violet. Linear.
const vec3 hg_levels[8] = vec3[8](vec3(0.8, 0.02, 0.02), vec3(0.9, 0.25, 0.0), vec3(0.85, 0.75, 0.0),
    vec3(0.05, 0.55, 0.05), vec3(0.0, 0.6, 0.55), vec3(0.02, 0.15, 0.9), vec3(0.12, 0.02, 0.4),
    vec3(0.5, 0.05, 0.7));

vec3 level_color(uint level)
{
    return hg_levels[min(level, 7u)];
}

// A colour for a number: well-mixed bits (Wellons 2018, "lowbias32"), never dark.
vec3 number_color(uint n)
{
    n ^= n >> 16;
    n *= 0x7feb352du;
    n ^= n >> 15;
    n *= 0x846ca68bu;
    n ^= n >> 16;
    vec3 c = vec3(n & 255u, (n >> 8) & 255u, (n >> 16) & 255u) / 255.0;
    return 0.05 + 0.75 * c * c;
}

// Where the base colour is looked up, as a rasteriser's sampler would.
struct lookup {
    bool there;
    uint wanted, resident; // mips
    bool border;           // within a texel of the edge of a page
};

lookup base_color_lookup(hg_vertex v)
{
    lookup l = lookup(false, 0u, 0u, false);
    hg_gpu_texture t = hg_material_texture_at(v.material, HG_MATERIAL_BASE_COLOR);
    if ((HG_MATERIAL_AT(v.material, flags) & HG_MATERIAL_HAS(HG_MATERIAL_BASE_COLOR)) == 0u)
        return l;
    hg_texture_place p = hg_material_place(t, v.material, HG_MATERIAL_BASE_COLOR, v);
    uint last = bitfieldExtract(t.bits, HG_TEX_MIPS_SHIFT, 5) - 1u;
    l.there = true;
    l.wanted = min(p.mip, last);
    hg_texture_address(t, p, l.wanted); // says how far up its finest resident ancestor is
    l.resident = min(l.wanted + hg_texture_coarser, last);
    uint tail = bitfieldExtract(t.bits, HG_TEX_TAIL_SHIFT, 4);
    vec2 at = fract(p.uv * vec2(max(p.size >> l.resident, 1u)) / float(HG_PAGE_TEXELS));
    vec2 edge = min(at, 1.0 - at) * float(HG_PAGE_TEXELS);
    l.border = l.resident < tail && min(edge.x, edge.y) < 2.0;
    return l;
}

vec3 missing_color(uint coarser)
{
    return coarser == 0u ? vec3(0.05, 0.45, 0.05)
                         : mix(vec3(0.85, 0.75, 0.0), vec3(0.8, 0.02, 0.02),
                               min(float(coarser) - 1.0, 3.0) / 3.0);
}

vec3 view_of(hg_vertex v)
{
    return hg_frame.camera.orthographic == 0u ? normalize(hg_frame.camera.eye_ws - v.position_ws)
                                              : -hg_frame.camera.forward_ws;
}

// Darker where the surface turns away, for views that would else be one flat colour.
float facing(hg_vertex v)
{
    return 0.4 + 0.6 * abs(dot(v.geometric_ws, view_of(v)));
}

vec3 texture_color(hg_vertex v)
{
    lookup l = base_color_lookup(v);
    if (!l.there)
        return hg_grey * facing(v);
    if (hg_view == HG_DEBUG_VIEW_MIP)
        return level_color(l.wanted);
    if (hg_view == HG_DEBUG_VIEW_MISSING)
        return missing_color(l.resident - l.wanted) * facing(v);
    return level_color(l.resident) * (l.border ? 0.3 : 1.0);
}

// 1 blue, 4 green, 16 red; between them by powers of two.
vec3 overdraw_color(float count)
{
    if (count < 0.5)
        return vec3(0.02);
    float at = clamp(log2(count) * 0.5, 0.0, 2.0);
    vec3 low = mix(vec3(0.02, 0.1, 0.8), vec3(0.05, 0.6, 0.05), min(at, 1.0));
    return at <= 1.0 ? low : mix(vec3(0.05, 0.6, 0.05), vec3(0.9, 0.02, 0.02), at - 1.0);
}

vec3 lod_color(uvec2 id)
{
    hg_gpu_draw d = hg_draw_at(id.x - 1u);
    if (!HG_HAS(HG_FEATURE_LOD) || (d.flags & HG_DRAW_LOD) == 0u)
        return hg_grey;
    // Records of the chunk: level and end of the triangles that have it (cluster_mesh.c).
    hg_word_stream levels = hg_part_at(d.part).extra;
    uint record = levels.v[id.y >> HG_LOD_SHIFT];
    uint triangle = id.y & ((1u << HG_LOD_SHIFT) - 1u);
    while ((levels.v[record] >> 8) <= triangle)
        record++;
    return level_color(levels.v[record] & 255u);
}

vec3 irradiance_color(hg_vertex v)
{
    float side = v.front ? 1.0 : -1.0;
    vec3 view = view_of(v), n = v.normal_ws * side;
    if (hg_frame.probes.count == 0u)
        return vec3(0.0);
    hg_probes_look(v.position_ws, v.geometric_ws * side, n, view, reflect(-view, n), vec3(0.5));
    return hg_debug_light(hg_probes_irradiance);
}

// The map that the first light with shadows has here, in squares of 32 texels; or a colour for its
// place in the atlas.
vec3 shadow_color(hg_vertex v)
{
    vec3 n = v.geometric_ws * (v.front ? 1.0 : -1.0);
    for (uint i = 0u; i < hg_frame.lighting.light_count; i++) {
        hg_gpu_light light = hg_light_at(i);
        if (light.shadow >= HG_SHADOW_UNASKED)
            continue;
        vec3 l;
        hg_light_illuminance(light, v.position_ws, l);
        if (dot(n, l) <= 0.0)
            return hg_grey;
        for (uint k = 0u; k < light.shadow_count; k++) {
            hg_gpu_shadow s = hg_shadow_at(light.shadow + k);
            hg_shadow_receiver r = hg_shadow_receive(s, v.position_ws, n, dot(n, l), 0.0);
            if (!hg_shadow_holds(s, r, true))
                continue;
            if (hg_view == HG_DEBUG_VIEW_SHADOW_PAGES) {
                vec2 at = s.rect_px + (vec2(r.ndc.x, -r.ndc.y) * 0.5 + 0.5) * s.size_px;
                uvec2 page = uvec2(at / float(HG_SHADOW_PAGE_PX));
                return number_color(page.y * 128u + page.x);
            }
            ivec2 square = ivec2(floor((r.ndc * 0.5 + 0.5) * s.size_px / 32.0));
            return level_color(k) * (((square.x + square.y) & 1) == 0 ? 1.0 : 0.6);
        }
    }
    return hg_grey;
}

vec3 surface_color(uvec2 id)
{
    hg_vertex v = hg_fetch_triangle(id.x - 1u, id.y, gl_FragCoord.xy);
    if (hg_view == HG_DEBUG_VIEW_PROBES)
        return hg_grey * facing(v);
    if (hg_view == HG_DEBUG_VIEW_IRRADIANCE)
        return irradiance_color(v);
    if (hg_view == HG_DEBUG_VIEW_SHADOWS || hg_view == HG_DEBUG_VIEW_SHADOW_PAGES)
        return shadow_color(v);
    if (hg_view == HG_DEBUG_VIEW_CLUSTER)
        return number_color((id.x << 20) + id.y / 128u) * facing(v);
    if (hg_view == HG_DEBUG_VIEW_LOD)
        return lod_color(id) * facing(v);
    return texture_color(v);
}

vec4 probe_color(uvec2 id)
{
    vec3 at = hg_frame.camera.ray_origin_ws + gl_FragCoord.x * hg_frame.camera.ray_x_ws +
        gl_FragCoord.y * hg_frame.camera.ray_y_ws;
    bool parallel = hg_frame.camera.orthographic != 0u;
    vec3 start = parallel ? at : hg_frame.camera.eye_ws;
    vec3 direction = parallel ? hg_frame.camera.forward_ws : at;
    float most = 3.4e38;
    if (id.x != 0u) {
        vec3 to = hg_fetch_triangle(id.x - 1u, id.y, gl_FragCoord.xy).position_ws - start;
        most = dot(to, direction) / dot(direction, direction);
    }
    return hg_debug_probes(start, direction, most);
}

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    uvec2 id = texelFetch(hg_visibility, pixel, 0).xy;
    vec3 color = vec3(0.02);
    if (hg_view == HG_DEBUG_VIEW_MOTION || hg_view == HG_DEBUG_VIEW_REFLECTIONS)
        color = vec3(0.2158605); // 128 of 255
    else if (hg_view == HG_DEBUG_VIEW_HISTORY)
        color = vec3(0.0);
    else if (hg_view == HG_DEBUG_VIEW_SCALE)
        color = vec3(0.0, 1.0, 0.0);
    else if (hg_view == HG_DEBUG_VIEW_OVERDRAW)
        color = overdraw_color(texelFetch(hg_counts, pixel, 0).r);
    else if (id.x != 0u)
        color = surface_color(id);
    if (hg_view == HG_DEBUG_VIEW_PROBES) {
        vec4 probe = probe_color(id);
        color = mix(color, probe.rgb, probe.a);
    }
    out_color = vec4(color, 1.0);
}
