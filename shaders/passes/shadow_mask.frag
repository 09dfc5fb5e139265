// Alpha test of casters with holes: masked surfaces, and blended and transmissive ones, which cover as many
// texels as they hold light back. Source: Wyman and McGuire 2017, "Hashed Alpha Testing"; thresholds are ordered here.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#define HG_MATERIAL_DETAIL 1u

#include "lib/frame.glsl"
#include "lib/vertex.glsl"
#include "lib/texture.glsl"
#include "lib/material.glsl"
#include "lib/bsdf_surface.glsl"
#include "lib/shadow.glsl"

layout(location = 0) in vec4 in_uv;
layout(location = 1) in float in_alpha;
layout(location = 2) flat in uvec2 in_draw; // and its material

// A rank-1 lattice over the texels of the map, 0 to 1, whose steps the filter of lib/light.glsl averages:
// in the mean of some turns of its taps 3 to 5 % of the light are left of them, of white noise 14 %. Fronts and
// backs of a surface, and one draw and the next, have generators whose sums and differences are as fine,
// as layers cover each other's texels independently.
float threshold()
{
    uint layer = in_draw.x * 2u + (gl_FrontFacing ? 1u : 0u);
    vec2 px = floor(gl_FragCoord.xy) - hg_push.corner_px;
    vec2 generator = (layer & 2u) != 0u ? vec2(0.3696, 0.1434) : vec2(0.2019, 0.3033);
    generator.x = (layer & 1u) != 0u ? generator.x : -generator.x;
    return fract(dot(px, generator) + 0.6180339887 * float(layer >> 2u & 1023u));
}

// Clear panes that let more than this through cast no shadow: steps of the lattice would show more.
#define CLEAR 0.85

// From this roughness on glass scatters the light that it holds back to what is behind it: to its own other
// wall, when it is the shade of a lamp. Nothing carries that on, so it casts no shadow.
#define CLEAR_ROUGHNESS 0.3

// Share of light that a smooth pane lets through, as shadow rays have it (through_pane of path_shadow.comp),
// of light from straight ahead; what is thick blocks it.
float pane(uint material, hg_vertex v)
{
    if (!HG_HAS(HG_FEATURE_TRANSMISSION) || (HG_MATERIAL_AT(material, flags) & HG_MATERIAL_TRANSMITS) == 0u)
        return 0.0;
    v.material = material;
    v.flags = 0u;
    v.front = gl_FrontFacing;
    v.geometric_ws = v.normal_ws = vec3(0.0, 0.0, 1.0);
    v.tangent_ws = vec4(1.0, 0.0, 0.0, 1.0);
    hg_surface s = hg_material_evaluate(v);
    float facing = (1.0 - s.metallic) * (1.0 - s.f0);
    float share = s.transmission * facing * dot(s.base_color, vec3(0.2126, 0.7152, 0.0722));
    bool straight = s.thickness <= 0.0 && s.roughness < HG_DELTA_ROUGHNESS;
    float rough = s.roughness >= CLEAR_ROUGHNESS ? s.transmission * (1.0 - s.metallic) : 0.0;
    return !straight ? rough : share > CLEAR ? 1.0 : share;
}

void main()
{
    uint material = in_draw.y;
    hg_vertex v;
    v.uv0 = in_uv.xy;
    v.uv0_dx = dFdx(in_uv.xy);
    v.uv0_dy = dFdy(in_uv.xy);
    v.uv1 = in_uv.zw;
    v.uv1_dx = dFdx(in_uv.zw);
    v.uv1_dy = dFdy(in_uv.zw);
    v.color = vec4(1.0, 1.0, 1.0, in_alpha);
    uint flags = HG_MATERIAL_AT(material, flags);
    float alpha = hg_material_alpha(material, v);
    float covers = ((flags & HG_MATERIAL_BLEND) != 0u ? alpha : 1.0) * (1.0 - pane(material, v));
    if (HG_HAS(HG_FEATURE_STREAM) && hg_texture_coarser != 0u) {
        atomicAdd(HG_TEXTURES.feedback.v[HG_FEEDBACK_SHADOWS], 1u); // this map has to be drawn again
        if (hg_textures_exact())
            discard; // on top of what is there now
    }
    bool hole = (flags & HG_MATERIAL_MASK) != 0u && alpha < HG_MATERIAL_AT(material, alpha_cutoff);
    if (hole || covers <= threshold())
        discard;
}
