// Light from the field of probes on every fourth opaque surface along each side of a picture (shared/gi.h).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

layout(constant_id = 3) const bool hg_mirrors = false; // how surfaces mirror is wanted, too

#define HG_NO_LOBES
#define HG_PROBES_BILINEAR // few pixels are looked at, and none of them a second time

#include "lib/frame.glsl"
#include "lib/tables.glsl"
#include "lib/vertex.glsl"
#include "lib/triangle_cache.glsl"
#include "lib/probes.glsl"
#include "lib/texture.glsl"
#include "lib/material.glsl"
#include "shared/pass_io.h"
#include "shared/reflect.h"

HG_PROBE_LIGHT_IO(HG_IO_DECLARE)
#include "lib/probe_light_texel.glsl"

float hg_gtao_depth(ivec2 pixel)
{
    float d = texelFetch(hg_depth, pixel, 0).r; // reversed: depth 1 at the near plane
    return d > 0.0 ? hg_frame.camera.proj[3][2] / (d + hg_frame.camera.proj[2][2]) : 0.0;
}
#include "lib/gtao.glsl"

layout(location = 0) out uvec4 out_light;
layout(location = 1) out uvec2 out_mirror; // shared/reflect.h

uint pack_rgb9e5(vec3 c)
{
    c = clamp(c, 0.0, 65408.0);
    float most = max(c.r, max(c.g, c.b));
    float exponent = clamp(floor(log2(max(most, 1e-20))) + 16.0, 0.0, 31.0);
    uvec3 m = uvec3(min(round(c * exp2(24.0 - exponent)), 511.0));
    return m.r | m.g << 9 | m.b << 18 | uint(exponent) << 27;
}

// Textures as a texel of this picture covers them: what normal maps lose by that widens the lobe.
// facet: normal of the triangle.
uvec2 mirror_of(hg_vertex v, vec3 facet)
{
    v.uv0_dx *= float(HG_PROBE_LIGHT_PX);
    v.uv0_dy *= float(HG_PROBE_LIGHT_PX);
    v.uv1_dx *= float(HG_PROBE_LIGHT_PX);
    v.uv1_dy *= float(HG_PROBE_LIGHT_PX);
    hg_surface s = hg_material_evaluate(v);
    float f0 = mix(s.f0, max(s.base_color.r, max(s.base_color.g, s.base_color.b)), s.metallic);
    uvec2 words = uvec2(round(clamp(vec2(s.roughness, f0), 0.0, 1.0) * float(HG_MIRROR_MOST)));
    uint how = s.unlit ? uint(HG_MIRROR_MOST) : words.x | words.y << HG_MIRROR_F0_SHIFT;
    uint way = packSnorm4x8(vec4(hg_oct_encode(facet), 0.0, 0.0)) << HG_MIRROR_FACET_SHIFT;
    return uvec2(hg_encode_normal(s.normal), how | way);
}

// Neighbours have values far apart, and so have samples. Jimenez 2014, "Next Generation Post Processing in
// Call of Duty: Advanced Warfare" (interleaved gradient noise).
vec2 spread(ivec2 texel)
{
    vec2 at = vec2(texel) + 5.588238 * float(hg_frame.sample_index & 63u);
    float angle = fract(52.9829189 * fract(dot(at, vec2(0.06711056, 0.00583715))));
    return vec2(angle, fract(angle * 7.0 + 0.25 * float((texel.x ^ texel.y) & 3)));
}

void main()
{
    out_mirror = uvec2(0u, uint(HG_MIRROR_MOST));
    ivec2 texel = ivec2(gl_FragCoord.xy), pixel = hg_probe_light_pixel(texel, 0);
    uvec2 id = texelFetch(hg_visibility, pixel, 0).xy;
    for (int i = 1; i < HG_PROBE_LIGHT_TRIES; i++) {
        ivec2 other = hg_probe_light_pixel(texel, i);
        uvec2 there = texelFetch(hg_visibility, other, 0).xy;
        bool take = id.x == 0u && there.x != 0u;
        pixel = take ? other : pixel;
        id = take ? there : id;
    }
    if (id.x == 0u) {
        out_light = uvec4(0u);
        return;
    }
    hg_vertex v = hg_fetch_surface(max(id.x, 1u) - 1u, id.y, vec2(pixel) + 0.5);
    vec3 view = -hg_frame.camera.forward_ws;
    if (hg_frame.camera.orthographic == 0u)
        view = normalize(hg_frame.camera.eye_ws - v.position_ws);
    float side = v.front ? 1.0 : -1.0;
    if (hg_mirrors)
        out_mirror = mirror_of(v, v.geometric_ws * side);
    vec3 n = v.normal_ws * side;
    vec4 open = vec4(n, 1.0);
    if ((hg_frame.flags & HG_FRAME_OCCLUSION) != 0u && hg_frame.camera.orthographic == 0u)
        open = hg_gtao(vec2(pixel) + 0.5, v.position_ws - hg_frame.camera.eye_ws, v.geometric_ws * side,
            HG_GTAO_REACH * hg_probes_spacing(v.position_ws), spread(texel));
    // Of what is hidden by what is near, probes farther away see the light beyond it.
    vec3 bent = normalize(mix(open.xyz, n, open.w));
    hg_probes_hidden_way = n - open.w * open.xyz + 1e-3 * n;
    hg_probes_look(v.position_ws, v.geometric_ws * side, bent, view, reflect(-view, n),
        hg_random3(uvec2(pixel), 15u));
    uint share = uint(round(open.w * float(HG_PROBE_LIGHT_OPEN_MASK)));
    vec3 light = mix(hg_probes_hiding, hg_probes_irradiance, open.w);
    out_light = uvec4(pack_rgb9e5(light), pack_rgb9e5(hg_probes_surfaces),
        hg_probe_light_pack(n, hg_probes_sky),
        (floatBitsToUint(v.depth) & ~HG_PROBE_LIGHT_OPEN_MASK) | share);
}
