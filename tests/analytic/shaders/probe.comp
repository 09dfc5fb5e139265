// One function of the shading libraries per operation; see enum probe_op in tests/analytic/probe.h.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/frame.glsl"
#include "lib/brdf.glsl"
#include "lib/light.glsl"
#include "lib/environment.glsl"
#include "lib/tonemap.glsl"

layout(local_size_x = 32) in;
layout(constant_id = 0) const uint op = 0u;

layout(buffer_reference, scalar, buffer_reference_align = 16) buffer probe_vectors
{
    vec4 v[];
};
layout(push_constant, scalar) uniform probe_push
{
    probe_vectors source, result;
    uint count;
} push;

const vec3 up = vec3(0.0, 0.0, 1.0);

vec3 tilted(float cosine)
{
    return vec3(sqrt(max(0.0, 1.0 - cosine * cosine)), 0.0, cosine);
}

// Over theta with t = tan(theta): the substitution follows the lobe at every alpha.
vec4 d_integral(float alpha)
{
    const uint n = 2048u;
    float sum = 0.0;
    for (uint i = 0u; i < n; i++) {
        float u = (float(i) + 0.5) / float(n);
        float t = alpha * u / (1.0 - u), dt = alpha / ((1.0 - u) * (1.0 - u) * float(n));
        float c2 = 1.0 / (1.0 + t * t), s2 = t * t * c2;
        // d omega n.h = 2 pi sin cos d theta, d theta = cos^2 d t
        sum += hg_ggx_d(sqrt(c2), s2, alpha) * 2.0 * HG_PI * sqrt(s2 * c2) * c2 * dt;
    }
    return vec4(sum);
}

// Integral over half vectors of G1(v) D(h) max(0, v.h) / n.v. Heitz 2014 eq. 16.
vec4 white_furnace(float alpha, float n_dot_v)
{
    const uint n = 256u, m = 64u; // llvmpipe ends loops after 65535 rounds, nested ones together
    vec3 v = tilted(n_dot_v);
    float sum = 0.0;
    for (uint i = 0u; i < n; i++) {
        float u = (float(i) + 0.5) / float(n);
        float t = alpha * u / (1.0 - u), dt = alpha / ((1.0 - u) * (1.0 - u) * float(n));
        float c = inversesqrt(1.0 + t * t), s = t * c, ring = 0.0;
        for (uint k = 0u; k < m; k++) {
            float phi = 2.0 * HG_PI * (float(k) + 0.5) / float(m);
            ring += max(0.0, dot(v, vec3(s * cos(phi), s * sin(phi), c)));
        }
        sum += ring * 2.0 * HG_PI / float(m) * hg_ggx_d(c, s * s, alpha) * s * c * c * dt;
    }
    return vec4(sum * hg_smith_g1(n_dot_v, alpha) / n_dot_v);
}

vec4 reciprocity(vec4 a, vec4 b)
{
    vec3 v = hg_sample_cosine(b.xy), l = hg_sample_cosine(b.zw);
    v.z = max(v.z, 0.02);
    l.z = max(l.z, 0.02);
    v = normalize(v);
    l = normalize(l);
    vec3 base = vec3(0.9, 0.5, 0.2);
    hg_brdf at_v = hg_brdf_make(base, a.y, a.x, HG_DIELECTRIC_F0, up, v);
    hg_brdf at_l = hg_brdf_make(base, a.y, a.x, HG_DIELECTRIC_F0, up, l);
    vec3 f = hg_brdf_evaluate(at_v, l) / l.z, g = hg_brdf_evaluate(at_l, v) / v.z;
    vec3 d = abs(f - g) / max(f, g);
    return vec4(f.x, g.x, max(d.x, max(d.y, d.z)), 0.0);
}

vec4 albedo(vec4 a)
{
    const uint n = 16384u;
    hg_brdf b = hg_brdf_make(vec3(a.w), a.y, a.x, HG_DIELECTRIC_F0, up, tilted(a.z));
    float sum = 0.0;
    for (uint i = 0u; i < n; i++) {
        vec2 u = hg_hammersley(i, n);
        vec3 l = hg_brdf_sample(b, vec3(u, fract(float(i) * 0.618033988)));
        float pdf = hg_brdf_pdf(b, l);
        if (pdf > 0.0)
            sum += hg_brdf_evaluate(b, l).x / pdf;
    }
    return vec4(sum / float(n));
}

vec4 run(vec4 a, vec4 b)
{
    switch (op) {
    case 0u:
        return d_integral(a.x);
    case 1u:
        return white_furnace(a.x, a.y);
    case 2u:
        return reciprocity(a, b);
    case 3u:
        return albedo(a);
    case 4u:
        return vec4(hg_schlick(vec3(a.x), a.y), 0.0);
    case 5u: {
        hg_brdf s = hg_brdf_make(vec3(0.5), a.y, a.x, HG_DIELECTRIC_F0, up, tilted(a.z));
        return vec4(hg_brdf_sample(s, b.xyz), 0.0);
    }
    case 6u: {
        hg_brdf s = hg_brdf_make(vec3(0.5), a.y, a.x, HG_DIELECTRIC_F0, up, tilted(a.z));
        return vec4(hg_brdf_pdf(s, b.xyz));
    }
    case 7u:
        return vec4(hg_dfg(a.x, a.y), hg_dfg_average(a.y));
    case 8u:
        return vec4(hg_tonemap(a.rgb, uint(a.w)), 0.0);
    case 9u:
        return vec4(hg_srgb_encode(a.xxx).x, hg_srgb_decode(hg_srgb_encode(a.xxx)).x, 0.0, 0.0);
    case 10u:
        return vec4(hg_environment_radiance(a.xyz), 0.0);
    case 11u:
        return vec4(hg_environment_irradiance(a.xyz), 0.0);
    case 12u:
        return vec4(hg_environment_prefiltered(a.xyz, a.w), 0.0);
    case 13u: {
        hg_brdf s = hg_brdf_make(vec3(a.w), a.y, a.x, HG_DIELECTRIC_F0, up, tilted(a.z));
        return vec4(hg_environment_brdf(s, 1.0), 0.0);
    }
    case 14u: {
        vec3 l;
        vec3 e = hg_light_illuminance(hg_frame.lighting.lights.v[uint(a.w)], a.xyz, l);
        return vec4(e, l.y);
    }
    case 15u: {
        vec3 n = normalize(-a.xyz);
        hg_brdf s = hg_brdf_make(vec3(0.7, 0.5, 0.3), 0.2, 0.4, HG_DIELECTRIC_F0, n, n);
        return vec4(hg_light_brdf(s, a.xyz, n, b.xy, b.z), 0.0);
    }
    case 16u:
        return vec4(hg_ggx_d(a.x, 1.0 - a.x * a.x, a.y), hg_smith_v(a.x, a.x, a.y), 0.0, 0.0);
    }
    return vec4(0.0);
}

void main()
{
    uint i = gl_GlobalInvocationID.x;
    if (i < push.count)
        push.result.v[i] = run(push.source.v[2u * i], push.source.v[2u * i + 1u]);
}
