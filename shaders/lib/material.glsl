// material.glsl - from a surface point to what the lighting needs.
//
// Include lib/frame.glsl, lib/vertex.glsl and lib/texture.glsl first.
//
// Specular antialiasing: a still view averages jittered samples, which integrates the variation of
// normals between texels exactly. What a mip has averaged away within its texels widens the lobe:
// alpha of a normal map is 1 - sqrt of what its squared width gains (renderer/texture/mip_stream.h).
#ifndef HG_LIB_MATERIAL_GLSL
#define HG_LIB_MATERIAL_GLSL

#include "lib/texture.glsl"
#include "lib/vertex.glsl"
#include "shared/material.h"

struct hg_surface {
    vec3 base_color; // linear
    float alpha;     // 1 unless the material blends; masked texels are 0 or 1
    vec3 normal;     // shading normal, unit, towards the eye's side
    float metallic;
    vec3 geometric_normal; // of the triangle, unit, towards the eye's side
    float roughness;       // perceptual
    vec3 emissive;
    float occlusion; // 0..1, strength applied; for indirect light only
    float f0;        // dielectric reflectance at normal incidence
    bool unlit;      // the colour is base_color + emissive
};

// Coordinates of a slot at a surface point, for looking up in its texture.
hg_texture_place hg_material_place(hg_gpu_texture t, uint material, uint slot, hg_vertex v)
{
    if (!HG_HAS(HG_FEATURE_SAMPLERS))
        return hg_texture_find(t, v.uv0, v.uv0_dx, v.uv0_dy);
    bool second = (t.bits & HG_TEX_UV1) != 0u;
    vec2 uv = second ? v.uv1 : v.uv0;
    vec2 dx = second ? v.uv1_dx : v.uv0_dx, dy = second ? v.uv1_dy : v.uv0_dy;
    if ((t.bits & HG_TEX_TRANSFORM) != 0u) {
        uint at = slot * 6u;
        vec3 r0 = vec3(HG_MATERIAL_AT(material, transforms[at]),
            HG_MATERIAL_AT(material, transforms[at + 1u]),
            HG_MATERIAL_AT(material, transforms[at + 2u]));
        vec3 r1 = vec3(HG_MATERIAL_AT(material, transforms[at + 3u]),
            HG_MATERIAL_AT(material, transforms[at + 4u]),
            HG_MATERIAL_AT(material, transforms[at + 5u]));
        uv = vec2(dot(r0, vec3(uv, 1.0)), dot(r1, vec3(uv, 1.0)));
        dx = vec2(dot(r0.xy, dx), dot(r1.xy, dx));
        dy = vec2(dot(r0.xy, dy), dot(r1.xy, dy));
    }
    return hg_texture_find(t, uv, dx, dy);
}

// A slot's texel, white where it has no texture. colour: the slot holds sRGB files. The pool is
// known from that (float images aside), so that only one is sampled.
vec4 hg_material_sample(uint material, uint slot, bool colour, hg_vertex v)
{
    hg_gpu_texture t = hg_material_texture_at(material, slot);
    if (!HG_HAS(HG_FEATURE_SHAPES)) { // place and address are worked out once for all slots
        hg_gpu_texture shape = hg_material_texture_at(material, HG_MATERIAL_BASE_COLOR);
        t.size = shape.size;
        t.bits = shape.bits;
    }
    hg_texture_place p = hg_material_place(t, material, slot, v);
    p.note = slot;
    vec4 texel = vec4(1.0);
    if (colour)
        texel = hg_texture_fetch(hg_pages_srgb, t, p);
    else
        texel = hg_texture_fetch(hg_pages_linear, t, p);
    if (HG_HAS(HG_FEATURE_FLOAT)) {
        if (bitfieldExtract(t.bits, HG_TEX_POOL_SHIFT, 2) == HG_POOL_FLOAT)
            texel = hg_texture_fetch(hg_pages_float, t, p);
    }
    return (HG_MATERIAL_AT(material, flags) & HG_MATERIAL_HAS(slot)) != 0u ? texel : vec4(1.0);
}

// Base colour alone, for alpha tests of depth-only passes. Alpha is linear in both views of the
// pool, and the one that is not sRGB is twice as fast on software rasterisers.
float hg_material_alpha(uint material, hg_vertex v)
{
    float alpha = HG_MATERIAL_AT(material, base_color.w) * v.color.w;
    if (HG_HAS(HG_FEATURE_TEXTURES))
        alpha *= hg_material_sample(material, HG_MATERIAL_BASE_COLOR, false, v).w;
    return alpha;
}

// Straight-line code: absent slots of a material cost a lookup that is thrown away, slots that no
// material of the scene uses cost nothing (HG_HAS).
hg_surface hg_material_evaluate(hg_vertex v)
{
    uint flags = HG_MATERIAL_AT(v.material, flags);
    vec4 base_texel = vec4(1.0), normal_texel = vec4(1.0), mr_texel = vec4(1.0);
    vec3 emissive_texel = vec3(1.0);
    float occlusion = 1.0;
    if (HG_HAS(HG_FEATURE_TEXTURES)) {
        base_texel = hg_material_sample(v.material, HG_MATERIAL_BASE_COLOR, true, v);
        normal_texel = hg_material_sample(v.material, HG_MATERIAL_NORMAL, false, v);
        mr_texel = hg_material_sample(v.material, HG_MATERIAL_MR, false, v);
    }
    if (HG_HAS(HG_FEATURE_EMISSIVE))
        emissive_texel = hg_material_sample(v.material, HG_MATERIAL_EMISSIVE, true, v).rgb;
    if (HG_HAS(HG_FEATURE_OCCLUSION))
        occlusion = hg_material_sample(v.material, HG_MATERIAL_OCCLUSION, false, v).r;
    if (HG_HAS(HG_FEATURE_UNCOMMON) && (flags & HG_MATERIAL_PACKED_ORM) != 0u)
        occlusion = mr_texel.r;

    hg_surface s;
    float side = v.front ? 1.0 : -1.0;
    vec4 base = HG_MATERIAL_AT(v.material, base_color) * v.color * base_texel;
    s.base_color = base.rgb;
    s.alpha = (flags & HG_MATERIAL_BLEND) != 0u ? clamp(base.a, 0.0, 1.0) : 1.0;
    if ((flags & HG_MATERIAL_MASK) != 0u)
        s.alpha = base.a >= HG_MATERIAL_AT(v.material, alpha_cutoff) ? 1.0 : 0.0;
    s.metallic = HG_MATERIAL_AT(v.material, metallic) * mr_texel.b;
    s.roughness = HG_MATERIAL_AT(v.material, roughness) * mr_texel.g;
    s.f0 = HG_MATERIAL_F0;
    s.emissive = vec3(0.0);
    s.occlusion = 1.0;
    if (HG_HAS(HG_FEATURE_EMITS))
        s.emissive = HG_MATERIAL_AT(v.material, emissive) * emissive_texel;
    if (HG_HAS(HG_FEATURE_UNCOMMON)) {
        s.f0 = HG_MATERIAL_AT(v.material, f0);
        s.occlusion = 1.0 + HG_MATERIAL_AT(v.material, occlusion_strength) * (occlusion - 1.0);
    }
    bool no_normals = HG_HAS(HG_FEATURE_VERTICES) &&
        (v.flags & (HG_DRAW_POINTS | HG_DRAW_LINES)) != 0u &&
        (v.flags & HG_DRAW_NORMALS) == 0u;
    s.unlit = (HG_HAS(HG_FEATURE_UNCOMMON) && (flags & HG_MATERIAL_UNLIT) != 0u) || no_normals; // glTF 2.0 section 3.7.2.1
    s.geometric_normal = v.geometric_ws * side;
    s.normal = v.normal_ws;
    if ((flags & HG_MATERIAL_HAS(HG_MATERIAL_NORMAL)) != 0u) {
        vec3 n = normal_texel.xyz * 2.0 - 1.0;
        float scale = 1.0;
        if (HG_HAS(HG_FEATURE_UNCOMMON))
            scale = HG_MATERIAL_AT(v.material, normal_scale);
        float lost = (1.0 - normal_texel.a) * scale;
        float width2 = s.roughness * s.roughness * s.roughness * s.roughness + lost * lost;
        s.roughness = lost == 0.0 ? s.roughness : sqrt(sqrt(min(width2, 1.0)));
        n.xy *= scale;
        vec3 bitangent = cross(v.normal_ws, v.tangent_ws.xyz) * v.tangent_ws.w;
        n = v.tangent_ws.xyz * n.x + bitangent * n.y + v.normal_ws * n.z;
        s.normal = n * inversesqrt(max(dot(n, n), 1e-20));
    }
    s.normal *= side;
    return s;
}

#endif
