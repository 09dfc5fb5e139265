// triangle_cache.glsl - surface points of pixels from facets (shared/triangle_cache.h), where the scene has them.
//
// Include lib/frame.glsl and lib/vertex.glsl first.
#ifndef HG_LIB_TRIANGLE_CACHE_GLSL
#define HG_LIB_TRIANGLE_CACHE_GLSL

#include "lib/vertex.glsl"
#include "shared/triangle_cache.h"

layout(set = 0, binding = HG_BIND_TEXELS) uniform usamplerBuffer hg_triangle_cache_texels;

// The ray of a pixel: start relative to the eye, direction.
void hg_triangle_cache_ray(vec2 pixel, out vec3 start, out vec3 direction)
{
    vec3 at = hg_frame.camera.ray_origin_ws + pixel.x * hg_frame.camera.ray_x_ws +
        pixel.y * hg_frame.camera.ray_y_ws;
    bool parallel = hg_frame.camera.orthographic != 0u;
    start = parallel ? at - hg_frame.camera.eye_ws : vec3(0.0);
    direction = parallel ? hg_frame.camera.forward_ws : at;
}

// As hg_fetch_triangle, for triangles without a second uv set and colours.
hg_vertex hg_fetch_facet(uint draw, uint triangle, vec2 pixel)
{
    int at = int((hg_triangle_cache_first_at(draw) + triangle) * uint(HG_TRIANGLE_CACHE_TEXELS));
    uvec4 a = texelFetch(hg_triangle_cache_texels, at), b = texelFetch(hg_triangle_cache_texels, at + 1);
    uvec4 c = texelFetch(hg_triangle_cache_texels, at + 2), e = texelFetch(hg_triangle_cache_texels, at + 3);
    uvec4 f = texelFetch(hg_triangle_cache_texels, at + 4), g = texelFetch(hg_triangle_cache_texels, at + 5);
    hg_gpu_draw d = hg_draw_at(draw);
    vec3 g1 = uintBitsToFloat(a.xyz), g2 = uintBitsToFloat(b.xyz);
    vec3 p0 = uintBitsToFloat(uvec3(a.w, b.w, c.w)) - hg_frame.camera.eye_ws;

    // Where the ray meets the plane, and how that moves from pixel to pixel.
    vec3 start, direction, n = cross(g1, g2);
    hg_triangle_cache_ray(pixel, start, direction);
    float along = dot(n, direction);
    float inverse = along != 0.0 ? 1.0 / along : 0.0;
    float t = dot(n, p0 - start) * inverse;
    vec3 relative = start + direction * t;
    float spread = hg_frame.camera.orthographic != 0u ? 1.0 : t;
    vec3 step_x = hg_frame.camera.ray_x_ws, step_y = hg_frame.camera.ray_y_ws;
    step_x = (step_x - direction * (dot(n, step_x) * inverse)) * spread;
    step_y = (step_y - direction * (dot(n, step_y) * inverse)) * spread;
    vec3 q = relative - p0;
    float b1 = dot(g1, q), b2 = dot(g2, q), b0 = 1.0 - b1 - b2;

    hg_vertex o;
    o.position_ws = hg_frame.camera.eye_ws + relative;
    o.depth = dot(relative, hg_frame.camera.forward_ws);
    o.material = d.material;
    o.flags = d.flags;
    o.instance = d.instance;
    float handed = (d.flags & HG_DRAW_MIRRORED) != 0u ? -1.0 : 1.0;
    o.geometric_ws = n * (inversesqrt(max(dot(n, n), 1e-30)) * handed);
    o.front = along * handed <= 0.0;

    vec2 uv1 = uintBitsToFloat(e.xy), uv2 = uintBitsToFloat(e.zw);
    o.uv0 = uintBitsToFloat(c.xy) + uv1 * b1 + uv2 * b2;
    o.uv0_dx = uv1 * dot(g1, step_x) + uv2 * dot(g2, step_x);
    o.uv0_dy = uv1 * dot(g1, step_y) + uv2 * dot(g2, step_y);
    o.normal_ws = hg_decode_normal(f.x) * b0 + hg_decode_normal(f.y) * b1 + hg_decode_normal(f.z) * b2;
    o.normal_ws *= inversesqrt(max(dot(o.normal_ws, o.normal_ws), 1e-30));
    if ((d.flags & HG_DRAW_NORMALS) == 0u)
        o.normal_ws = o.geometric_ws;
    vec4 t0 = hg_decode_tangent(f.w);
    vec3 tangent = t0.xyz * b0 + hg_decode_tangent(g.x).xyz * b1 + hg_decode_tangent(g.y).xyz * b2;
    o.tangent_ws = vec4(tangent * inversesqrt(max(dot(tangent, tangent), 1e-30)), t0.w);
    if (HG_HAS(HG_FEATURE_NO_TANGENTS) && (d.flags & HG_DRAW_TANGENTS) == 0u)
        o.tangent_ws.xyz = hg_orthogonal(t0.xyz, o.normal_ws);
    o.uv1 = o.uv0;
    o.uv1_dx = o.uv0_dx;
    o.uv1_dy = o.uv0_dy;
    o.color = vec4(1.0);
    return o;
}

// From whichever of the two the scene has.
hg_vertex hg_fetch_surface(uint draw, uint triangle, vec2 pixel)
{
    if (HG_HAS(HG_FEATURE_NO_TRIANGLE_CACHE))
        return hg_fetch_triangle(draw, triangle, pixel);
    return hg_fetch_facet(draw, triangle, pixel);
}

#endif
