// lib/gtao.glsl on depths of planes; see tests/analytic/gtao.c.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/frame.glsl"

layout(local_size_x = 32) in;
layout(constant_id = 0) const uint op = 0u;

layout(buffer_reference, scalar, buffer_reference_align = 16) buffer gtao_vectors
{
    vec4 v[];
};
layout(push_constant, scalar) uniform gtao_push
{
    gtao_vectors source, result;
    uint count;
} push;

// A floor at y = -1, and on it a wall at z = -4 whose height is the first vector's x. No floor behind it.
float hg_gtao_depth(ivec2 pixel)
{
    vec2 px = vec2(pixel) + 0.5;
    vec3 d = hg_frame.camera.ray_origin_ws + px.x * hg_frame.camera.ray_x_ws + px.y * hg_frame.camera.ray_y_ws;
    float floor_depth = d.y < 0.0 ? -1.0 / d.y : 1e9;
    if (floor_depth < 4.0)
        return floor_depth;
    return 4.0 * d.y < push.source.v[0].x - 1.0 ? 4.0 : 0.0;
}

#define HG_GTAO_SLICES 24
#define HG_GTAO_STEPS  48
#include "lib/gtao.glsl"

// In: point and radius; out: hg_gtao. Of points on the wall the normal is +z, of others +y.
void main()
{
    uint i = gl_GlobalInvocationID.x;
    if (i >= push.count)
        return;
    vec4 at = push.source.v[i + 1u];
    vec3 n = at.z < -3.999 ? vec3(0.0, 0.0, 1.0) : vec3(0.0, 1.0, 0.0);
    vec4 clip = hg_frame.camera.proj * (hg_frame.camera.view * vec4(at.xyz, 1.0));
    vec2 px = (clip.xy / clip.w * 0.5 + 0.5) * vec2(hg_frame.width, hg_frame.height);
    push.result.v[i] = hg_gtao(px, at.xyz, n, at.w, vec2(0.37, 0.5));
}
