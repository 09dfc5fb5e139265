// Light sampling of lib/emitters.glsl; see tests/analytic/emitters.c.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#define HG_EMITTER_COUNT_WORK
#include "lib/frame.glsl"
#include "shared/emitters.h"

layout(local_size_x = 32) in;
layout(constant_id = 0) const uint op = 0u;

layout(buffer_reference, scalar, buffer_reference_align = 16) buffer test_vectors
{
    vec4 v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 16) readonly buffer test_emitters
{
    hg_gpu_emitters v;
};
layout(push_constant, scalar) uniform test_push
{
    test_vectors source, result;
    test_emitters emitters;
    uint count, picks, seed;
} push;

#define HG_EMITTERS push.emitters.v
#include "lib/emitters.glsl"

vec3 random(uint i, uint k)
{
    return vec3(hg_hash3(uvec3(i, k, push.seed)) >> 8u) * (1.0 / 16777216.0);
}

float cosine(vec3 normal, vec3 direction)
{
    return normal == vec3(0.0) ? 1.0 : max(0.0, dot(normal, direction));
}

// Light that one sample stands for, on a plane with this normal.
float value(hg_emitter_sample s, vec3 normal)
{
    if (s.delta)
        return s.radiance.g * cosine(normal, s.direction);
    return s.pdf > 0.0 ? s.radiance.g * cosine(normal, s.direction) / s.pdf : 0.0;
}

// Sum, sum of squares, samples that are no numbers, nodes that were looked at.
vec4 estimate(uint i, vec3 position, vec3 normal)
{
    vec4 sum = vec4(0.0);
    for (uint k = 0u; k < push.picks; k++) {
        float e = value(hg_emitter_pick(position, normal, random(i, k)), normal);
        bool bad = isnan(e) || isinf(e) || e < 0.0;
        sum.xyz += bad ? vec3(0.0, 0.0, 1.0) : vec3(e, e * e, 0.0);
    }
    sum.w = float(hg_emitter_work);
    return sum;
}

// The same when each leaf is as likely as the others.
vec4 uniform_choice(uint i, vec3 position, vec3 normal)
{
    vec4 sum = vec4(0.0);
    float count = float(HG_EMITTERS.leaf_count);
    for (uint k = 0u; k < push.picks; k++) {
        vec3 u = random(i, k);
        hg_gpu_emitter_leaf leaf = HG_EMITTERS.leaves.v[min(uint(u.x * count), uint(count) - 1u)];
        float e = value(hg_emitter_light(leaf.draw, 1.0 / count, position, vec2(0.5)), normal);
        sum.xy += vec2(e, e * e);
    }
    return sum;
}

// One sample: direction and density; draw, primitive, whether it is a delta, density once more.
void one(uint i, vec3 position, vec3 normal)
{
    hg_emitter_sample s = hg_emitter_pick(position, normal, random(i, 0u));
    float again = 0.0;
    if (s.pdf > 0.0 && s.group == HG_EMITTER_GROUP_EMISSIVE) {
        hg_emitter_triangle t = hg_emitter_fetch(s.draw, s.primitive);
        vec3 hit = t.p0 + t.e1 * s.barycentrics.x + t.e2 * s.barycentrics.y;
        again = hg_emitter_pdf_triangle(position, normal, s.draw, s.primitive, hit, t.normal);
    } else if (s.pdf > 0.0) {
        again = hg_emitter_pdf_environment(position, normal, s.direction);
    }
    push.result.v[2u * i] = vec4(s.direction, s.pdf);
    push.result.v[2u * i + 1u] =
        vec4(float(s.draw), float(s.primitive), s.delta ? 1.0 : float(s.group) + 2.0, again);
}

void main()
{
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.count)
        return;
    vec4 a = push.source.v[2u * i], b = push.source.v[2u * i + 1u];
    if (op == 0u)
        push.result.v[i] = estimate(i, a.xyz, b.xyz);
    else if (op == 1u)
        one(i, a.xyz, b.xyz);
    else if (op == 2u)
        push.result.v[i] = uniform_choice(i, a.xyz, b.xyz);
    else if (op == 3u) // chance of leaf a.w
        push.result.v[i] = vec4(HG_EMITTERS.trails.v[uint(a.w)] == HG_EMITTER_NONE
                ? 0.0
                : hg_emitter_shares(a.xyz, b.xyz).x *
                    hg_emitter_leaf_chance(HG_EMITTERS.trails.v[uint(a.w)], a.xyz, b.xyz));
    else // densities and radiance of a direction: position is the origin, a the direction
        push.result.v[i] = vec4(hg_emitter_environment(a.xyz).g,
            hg_emitter_pdf_environment(vec3(0.0), b.xyz, a.xyz), 0.0, 0.0);
}
