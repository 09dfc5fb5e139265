// hit.glsl - the surface point that a ray has hit, with the footprint of the ray in its textures.
//
// Include lib/frame.glsl, lib/vertex.glsl and lib/path.glsl first; hg_path_time says when.
#ifndef HG_LIB_HIT_GLSL
#define HG_LIB_HIT_GLSL

#include "lib/vertex.glsl"
#include "shared/ray.h"

float hg_hit_terms = 0.0; // hg_path_terms of the last hit

// direction: unit. width: of the ray's footprint at the hit, metres. The footprint on the surface is
// an ellipse, longest where the ray grazes it; its axes stand for the steps of pixels.
// Source: Akenine-Moller et al. 2021, "Improved Shader and Texture Level of Detail Using Ray Cones".
hg_vertex hg_fetch_hit(hg_gpu_hit hit, vec3 direction, float width)
{
    uint triangle = hit.primitive;
    hg_gpu_draw d = hg_draw_at(hit.draw);
    hg_gpu_part part = hg_part_at(d.part);
    if (HG_HAS(HG_FEATURE_LOD) && (d.flags & HG_DRAW_LOD) != 0u) {
        part = hg_part_list(part.indices).v[triangle >> HG_LOD_SHIFT];
        triangle &= (1u << HG_LOD_SHIFT) - 1u;
    }
    mat4x3 world = hg_path_world(d.instance);
    hg_hit_terms = hg_path_terms(hit.draw, world);
    uint first = triangle * 3u;
    uint i0 = part.indices.v[first], i1 = part.indices.v[first + 1u], i2 = part.indices.v[first + 2u];
    vec3 p0 = part.positions.v[i0], p1 = part.positions.v[i1], p2 = part.positions.v[i2];
    hg_gpu_part before = part;
    if (HG_PATH_CAN(HG_PATH_BLURS)) {
        before = hg_path_part_before(d, part);
        p0 = HG_PATH_BETWEEN(before.positions.v[i0], p0);
        p1 = HG_PATH_BETWEEN(before.positions.v[i1], p1);
        p2 = HG_PATH_BETWEEN(before.positions.v[i2], p2);
    }
    vec3 at = vec3(1.0 - hit.u - hit.v, hit.u, hit.v);
    vec3 e1 = mat3(world) * (p1 - p0), e2 = mat3(world) * (p2 - p0);

    hg_vertex o;
    vec3 q0 = hg_world_corner(world, p0);
    o.position_ws = q0 + (hg_world_corner(world, p1) - q0) * hit.u + (hg_world_corner(world, p2) - q0) * hit.v;
    o.depth = dot(o.position_ws - hg_path_eye(), hg_path_forward());
    o.material = d.material;
    o.flags = d.flags;
    o.instance = d.instance;
    float handed = (d.flags & HG_DRAW_MIRRORED) != 0u ? -1.0 : 1.0;
    vec3 face = cross(e1, e2);
    float area2 = dot(face, face);
    vec3 across = area2 > 0.0 ? face * inversesqrt(area2) : -direction;
    o.geometric_ws = across * handed;
    o.front = dot(o.geometric_ws, direction) <= 0.0;

    // Barycentrics along the axes of the ellipse.
    vec3 along = direction - across * dot(across, direction);
    float sine2 = dot(along, along), cosine = abs(dot(across, direction));
    vec3 major = sine2 > 1e-12 ? along * inversesqrt(sine2) : hg_orthogonal(e1, across);
    vec3 minor = cross(across, major) * width;
    major *= width / max(cosine, 1e-3);
    float scale = area2 > 0.0 ? inversesqrt(area2) : 0.0;
    vec3 c1 = cross(e2, across) * scale, c2 = cross(across, e1) * scale;
    vec2 dx = vec2(dot(c1, major), dot(c2, major)), dy = vec2(dot(c1, minor), dot(c2, minor));

    hg_gpu_vertex a0 = part.vertices.v[i0], a1 = part.vertices.v[i1], a2 = part.vertices.v[i2];
    o.normal_ws = o.geometric_ws;
    if ((d.flags & HG_DRAW_NORMALS) != 0u) {
        vec3 n = hg_decode_normal(a0.normal) * at.x + hg_decode_normal(a1.normal) * at.y +
            hg_decode_normal(a2.normal) * at.z;
        if (HG_PATH_CAN(HG_PATH_BLURS)) {
            vec3 m = hg_decode_normal(before.vertices.v[i0].normal) * at.x +
                hg_decode_normal(before.vertices.v[i1].normal) * at.y +
                hg_decode_normal(before.vertices.v[i2].normal) * at.z;
            n = HG_PATH_BETWEEN(m, n);
        }
        n = (cross(world[1], world[2]) * n.x + cross(world[2], world[0]) * n.y +
            cross(world[0], world[1]) * n.z) * handed;
        float length2 = dot(n, n);
        if (length2 > 0.0)
            o.normal_ws = n * inversesqrt(length2);
    }
    o.uv0 = a0.uv * at.x + a1.uv * at.y + a2.uv * at.z;
    o.uv0_dx = (a1.uv - a0.uv) * dx.x + (a2.uv - a0.uv) * dx.y;
    o.uv0_dy = (a1.uv - a0.uv) * dy.x + (a2.uv - a0.uv) * dy.y;
    if (!HG_HAS(HG_FEATURE_NO_TANGENTS) || (d.flags & HG_DRAW_TANGENTS) != 0u) {
        vec4 t0 = hg_decode_tangent(a0.tangent);
        vec3 t = t0.xyz * at.x + hg_decode_tangent(a1.tangent).xyz * at.y +
            hg_decode_tangent(a2.tangent).xyz * at.z;
        if (HG_PATH_CAN(HG_PATH_BLURS)) {
            vec3 m = hg_decode_tangent(before.vertices.v[i0].tangent).xyz * at.x +
                hg_decode_tangent(before.vertices.v[i1].tangent).xyz * at.y +
                hg_decode_tangent(before.vertices.v[i2].tangent).xyz * at.z;
            t = HG_PATH_BETWEEN(m, t);
        }
        t = mat3(world) * t;
        o.tangent_ws = vec4(t * inversesqrt(max(dot(t, t), 1e-30)), t0.w * handed);
    } else {
        o.tangent_ws = hg_direction_of_u(e1, e2, a1.uv - a0.uv, a2.uv - a0.uv);
        o.tangent_ws.xyz = hg_orthogonal(o.tangent_ws.xyz, o.normal_ws);
    }
    o.uv1 = o.uv0;
    o.uv1_dx = o.uv0_dx;
    o.uv1_dy = o.uv0_dy;
    if (HG_HAS(HG_FEATURE_VERTICES) && (d.flags & HG_DRAW_UV1) != 0u) {
        vec2 u0 = hg_fetch_uv1(part.extra, d.flags, i0), u1 = hg_fetch_uv1(part.extra, d.flags, i1);
        vec2 u2 = hg_fetch_uv1(part.extra, d.flags, i2);
        o.uv1 = u0 * at.x + u1 * at.y + u2 * at.z;
        o.uv1_dx = (u1 - u0) * dx.x + (u2 - u0) * dx.y;
        o.uv1_dy = (u1 - u0) * dy.x + (u2 - u0) * dy.y;
    }
    o.color = vec4(1.0);
    if (HG_HAS(HG_FEATURE_VERTICES) && (d.flags & (HG_DRAW_COLOR8 | HG_DRAW_COLOR16)) != 0u)
        o.color = hg_fetch_color(part.extra, d.flags, i0) * at.x +
            hg_fetch_color(part.extra, d.flags, i1) * at.y + hg_fetch_color(part.extra, d.flags, i2) * at.z;
    return o;
}

// Where a ray starts that leaves a point of a surface on the side of n (unit): off the surface by
// more than the rounding of its position and of the ray's way there.
vec3 hg_hit_offset(vec3 position, vec3 n)
{
    vec3 a = abs(position);
    float rounding = max(max(a.x, max(a.y, a.z)), 1e-2) * 4e-6;
    return position + n * max(rounding, hg_hit_terms * 1e-6);
}

#endif
