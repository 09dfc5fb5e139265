// lib/bsdf.glsl over many directions; see enum op in tests/analytic/bsdf.c.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/frame.glsl"
#include "lib/vertex.glsl"
#include "lib/texture.glsl"
#include "lib/material.glsl"
#include "lib/bsdf.glsl"

layout(local_size_x = 32) in;
layout(constant_id = 0) const uint op = 0u;

#define MATERIAL_VECTORS 8u

layout(buffer_reference, scalar, buffer_reference_align = 16) buffer probe_vectors
{
    vec4 v[];
};
layout(push_constant, scalar) uniform probe_push
{
    probe_vectors source, result;
    uint count;
} push;

// The surface lies in the plane z = 0, its outside up. v.z < 0: seen from behind.
hg_bsdf make(vec3 v, float front)
{
    vec4 m[MATERIAL_VECTORS];
    for (uint i = 0u; i < MATERIAL_VECTORS; i++)
        m[i] = push.source.v[i];
    hg_surface s;
    float side = v.z >= 0.0 ? 1.0 : -1.0;
    s.base_color = m[0].rgb;
    s.alpha = 1.0;
    s.normal = s.geometric_normal = vec3(0.0, 0.0, side);
    s.metallic = m[0].w;
    s.roughness = m[1].x;
    s.emissive = vec3(0.0);
    s.occlusion = 1.0;
    s.unlit = false;
    s.front = front > 0.0;
    s.ior = m[1].y;
    s.f0 = hg_ior_f0(s.ior);
    s.specular = m[1].z;
    s.transmission = m[1].w;
    s.specular_color = m[2].rgb;
    s.thickness = m[2].w;
    s.clearcoat = m[3].x;
    s.clearcoat_roughness = m[3].y;
    s.anisotropy = m[3].z;
    s.diffuse_transmission = m[3].w;
    s.sheen_color = m[4].rgb;
    s.sheen_roughness = m[4].w;
    s.iridescence = m[5].x;
    s.iridescence_ior = m[5].y;
    s.iridescence_nm = m[5].z;
    s.dispersion = m[5].w;
    s.diffuse_transmission_color = m[6].rgb;
    s.attenuation = vec3(0.0);
    s.clearcoat_normal = normalize(vec3(m[7].x, 0.0, side));
    s.tangent = vec3(cos(m[7].y), sin(m[7].y), 0.0);
    return hg_bsdf_make(s, v, m[6].w);
}

// Share of the light that arrives in thermal equilibrium: radiance is n^2 there.
vec3 balance(hg_bsdf b, hg_bsdf_sample_result r)
{
    bool bent = (r.lobe & HG_LOBE_TRANSMISSION) != 0u && !b.thin && b.transmission > 0.0;
    return r.weight * (bent ? b.eta * b.eta : 1.0);
}

// Sums are made in parts: llvmpipe ends loops after 65535 rounds, nested ones counted together.
#define PARTS 50u
// Of these parts so many in a row are samples of one random shift: how far such sums differ is the
// noise.
#define SHIFTED 5u

// One sample of three random numbers (n == 0), or of the n samples of each shift those of a part:
// sum of their weights, rgb; w: share of samples that end. One call for both: most of a run of this
// shader is the time that it takes to compile.
void samples(hg_bsdf b, vec4 c, out vec4 x, out vec4 y)
{
    uint part = uint(c.x), n = uint(c.w);
    vec3 shift = fract(float(part / SHIFTED) * vec3(0.8191725, 0.6710436, 0.5497005));
    uint each = n / SHIFTED, first = n == 0u ? 0u : each * (part % SHIFTED);
    x = y = vec4(0.0);
    for (uint i = first; i < first + max(each, 1u); i++) {
        vec3 u = c.xyz;
        if (n > 0u) {
            // Multiples of the golden ratio, in integers: floats would leave ten bits of them.
            u = vec3(hg_hammersley(i, n), (float((i * 2654435769u) >> 8) + 0.5) * exp2(-24.0));
            u = min(fract(u + shift), 0.99999994);
        }
        hg_bsdf_sample_result r = hg_bsdf_sample(b, u);
        if (n == 0u) {
            x = vec4(r.direction, r.pdf);
            y = vec4(balance(b, r), float(r.lobe));
            return;
        }
        if (r.pdf > 0.0)
            x.rgb += balance(b, r);
        else
            x.w += 1.0;
    }
    x /= float(n * (PARTS / SHIFTED));
}

void main()
{
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.count)
        return;
    vec4 a = push.source.v[MATERIAL_VECTORS + 2u * i];
    vec4 c = push.source.v[MATERIAL_VECTORS + 2u * i + 1u];
    hg_bsdf b = make(a.xyz, a.w);
    vec4 x = vec4(0.0), y = vec4(0.0);
    float pdf;
    if (op == 0u) {
        samples(b, c, x, y);
    } else if (op == 1u) {
        x.rgb = hg_bsdf_evaluate(b, c.xyz, pdf);
        x.w = pdf;
    } else if (op == 2u) {
        x = vec4(hg_film_fresnel(a.x, c.x, c.y, vec3(c.z)), hg_fresnel_dielectric(a.x, c.w));
        y = vec4(hg_sheen_albedo(a.x, c.z).x, hg_bsdf_attenuation(vec3(c.y), c.x).x, 0.0, 0.0);
    }
    if (op == 3u) {
        hg_surface s;
        s.transmission = 1.0;
        s.ior = c.x;
        s.dispersion = c.y;
        uint channel = 3u;
        x.rgb = hg_surface_disperse(s, channel, c.z);
        y.x = s.ior;
        y.y = float(channel);
        y.zw = hg_surface_disperse(s, channel, 0.5).xy; // once per path
    }
    push.result.v[2u * i] = x;
    push.result.v[2u * i + 1u] = y;
}
