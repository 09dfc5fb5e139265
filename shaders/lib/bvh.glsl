// bvh.glsl - a ray through the two-level tree of shared/bvh.h.
//
// Software devices run both sides of a branch for all rays of a group, but no loop that no ray is in.
// So what few steps need (instances, leaves) stands in loops that run once or not at all.
#ifndef HG_LIB_BVH_GLSL
#define HG_LIB_BVH_GLSL

#include "shared/bvh.h"

layout(constant_id = 1) const uint hg_bvh_features = 0u; // HG_BVH_* of any instance

struct hg_bvh_ray { // in the space of the tree that is being walked
    vec3 origin, direction;
    vec3 scale, offset; // t of a grid coordinate: q * scale + offset
};

hg_bvh_ray hg_bvh_enter(vec3 origin, vec3 direction, vec3 grid_origin, vec3 grid_step)
{
    hg_bvh_ray r;
    r.origin = origin;
    r.direction = direction;
    // Axes along which nothing moves: far away, never undefined.
    vec3 d = mix(direction, vec3(1e-30), lessThan(abs(direction), vec3(1e-30)));
    r.scale = grid_step / d;
    r.offset = (grid_origin - origin) / d;
    return r;
}

// Where the ray enters a box, or a negative number when it passes by.
// Slack in t: Ize 2013, "Robust BVH Ray Traversal".
float hg_bvh_box(hg_bvh_ray r, uvec3 box, float t_min, float t_max)
{
    vec3 a = vec3(box & 0xffffu) * r.scale + r.offset;
    vec3 b = vec3(box >> 16) * r.scale + r.offset;
    vec3 lo = min(a, b), hi = max(a, b);
    float near = max(max(lo.x, lo.y), max(lo.z, t_min));
    float far = min(min(hi.x, hi.y), min(hi.z, t_max)) * 1.0000004;
    return near <= far ? near : -1.0;
}

// Edge functions of the ray's line, whose signs agree on both sides of an edge: a product of two
// corners changes its sign exactly when they change places. So closed surfaces let no ray through.
// Source: Shoemake 1998, "Pluecker Coordinate Tutorial"; Davidovic et al. 2012, "3D Rasterization: A
// Bridge between Rasterization and Ray Casting".
float hg_bvh_edge(vec3 a, vec3 b, vec3 direction)
{
    precise vec3 d = a - b, s = a + b;
    precise vec3 c = d.yzx * s.zxy - d.zxy * s.yzx;
    precise float e = c.x * direction.x + c.y * direction.y + c.z * direction.z;
    return e;
}

// Nearer than hit.t: writes t, u, v.
bool hg_bvh_triangle(hg_bvh_ray r, vec3 p0, vec3 p1, vec3 p2, float t_min, inout hg_gpu_hit hit)
{
    vec3 v0 = p0 - r.origin, v1 = p1 - r.origin, v2 = p2 - r.origin;
    float u = hg_bvh_edge(v2, v0, r.direction);
    float v = hg_bvh_edge(v0, v1, r.direction);
    float w = hg_bvh_edge(v1, v2, r.direction);
    float sum = u + v + w, slack = abs(sum) * 1.2e-7;
    if (min(u, min(v, w)) < -slack && max(u, max(v, w)) > slack)
        return false;
    vec3 n = cross(v1 - v0, v2 - v0);
    float along = dot(n, r.direction), t = dot(n, v0) / along;
    if (along == 0.0 || sum == 0.0 || !(t > t_min && t < hit.t))
        return false;
    hit.t = t;
    hit.u = clamp(u / sum, 0.0, 1.0);
    hit.v = clamp(v / sum, 0.0, 1.0 - hit.u);
    return true;
}

// World to object at a time in the shutter.
void hg_bvh_to_object(hg_gpu_bvh_instance i, hg_gpu_ray ray, out vec3 origin, out vec3 direction)
{
    if ((hg_bvh_features & HG_BVH_MOVES) == 0u || (i.flags & HG_BVH_MOVES) == 0u) {
        origin = i.to_object * vec4(ray.origin_ws, 1.0);
        direction = mat3(i.to_object) * ray.direction_ws;
        return;
    }
    mat4x3 m = i.previous * (1.0 - ray.time) + i.world * ray.time;
    vec3 x = cross(m[1], m[2]), y = cross(m[2], m[0]), z = cross(m[0], m[1]);
    mat3 inverse = transpose(mat3(x, y, z)) * (1.0 / dot(m[0], x));
    origin = inverse * (ray.origin_ws - m[3]);
    direction = inverse * ray.direction_ws;
}

struct hg_bvh_body { // that is being walked
    hg_bvh_triangles triangles;
    hg_bvh_openings openings;
    uint draw, flags;
};

bool hg_bvh_leaf(hg_bvh_body i, hg_bvh_ray r, hg_gpu_ray ray, uint leaf, inout hg_gpu_hit hit)
{
    uint first = leaf & HG_BVH_FIRST, count = (leaf >> HG_BVH_COUNT_SHIFT & 7u) + 1u;
    bool found = false;
    for (uint k = first; k < first + count; k++) {
        hg_gpu_bvh_triangle p = i.triangles.v[k];
        if ((p.owner >> 28 & ray.mask) == 0u)
            continue;
        if ((hg_bvh_features & i.flags & HG_BVH_DEFORMS) != 0u) {
            hg_gpu_bvh_corners q = i.openings.v[k];
            p.p0 = mix(q.p0, p.p0, ray.time);
            p.p1 = mix(q.p1, p.p1, ray.time);
            p.p2 = mix(q.p2, p.p2, ray.time);
        }
        if (hg_bvh_triangle(r, p.p0, p.p1, p.p2, ray.t_min, hit)) {
            hit.draw = i.draw + (p.owner & HG_BVH_FIRST);
            hit.primitive = p.primitive;
            found = true;
        }
    }
    return found;
}

bool hg_bvh_is_ray(hg_gpu_ray r)
{
    float at = dot(abs(r.origin_ws), vec3(1.0)), length = dot(abs(r.direction_ws), vec3(1.0));
    return at <= HG_RAY_FARTHEST && length > 0.0 && length <= HG_RAY_FARTHEST && r.t_max > r.t_min &&
        r.t_max > 0.0;
}

// The nearest hit (any: some hit). False: none.
bool hg_bvh_trace(hg_gpu_bvh_wave wave, hg_gpu_ray ray, bool any, out hg_gpu_hit hit)
{
    uint stack[2 * HG_BVH_DEPTH];
    uint depth = 0u, base = 0u, ref = wave.root;
    hit = hg_gpu_hit(min(ray.t_max, 3e38), 0.0, 0.0, HG_HIT_NONE, 0u);
    if (ref == HG_BVH_NONE || !hg_bvh_is_ray(ray))
        return false;
    ray.t_min = max(ray.t_min, 0.0);
    ray.time = clamp(ray.time, 0.0, 1.0);
    hg_bvh_ray r = hg_bvh_enter(ray.origin_ws, ray.direction_ws, wave.origin, wave.step);
    hg_bvh_nodes nodes = wave.nodes;
    bool inside = false; // of an instance
    hg_bvh_body body;
    for (uint step = 0u; step < HG_BVH_STEPS; step++) {
        bool descends = false;
        if ((ref & HG_BVH_LEAF) == 0u) {
            hg_gpu_bvh_node n = nodes.v[ref];
            float t0 = hg_bvh_box(r, uvec3(n.x0, n.y0, n.z0), ray.t_min, hit.t);
            float t1 = hg_bvh_box(r, uvec3(n.x1, n.y1, n.z1), ray.t_min, hit.t);
            bool second = t0 < 0.0 || (t1 >= 0.0 && t1 < t0);
            if (t0 >= 0.0 && t1 >= 0.0 && depth < 2u * HG_BVH_DEPTH)
                stack[depth++] = second ? n.child0 : n.child1;
            descends = t0 >= 0.0 || t1 >= 0.0;
            ref = second ? n.child1 : n.child0;
        } else {
            uint leaves = inside ? 1u : 0u;
            for (; leaves > 0u; leaves--)
                if (hg_bvh_leaf(body, r, ray, ref, hit) && any)
                    return true;
            uint entered = inside ? 0u : 1u;
            for (; entered > 0u; entered--) {
                hg_gpu_bvh_instance i = wave.instances.v[ref & HG_BVH_FIRST];
                if ((i.mask & ray.mask) == 0u)
                    break;
                vec3 origin, direction;
                hg_bvh_to_object(i, ray, origin, direction);
                r = hg_bvh_enter(origin, direction, i.origin, i.step);
                nodes = i.nodes;
                body = hg_bvh_body(i.triangles, i.openings, i.draw, i.flags);
                inside = true;
                descends = true;
                base = depth;
                ref = i.root;
            }
        }
        if (descends)
            continue;
        uint left = inside && depth == base ? 1u : 0u;
        for (; left > 0u; left--) {
            inside = false;
            nodes = wave.nodes;
            r = hg_bvh_enter(ray.origin_ws, ray.direction_ws, wave.origin, wave.step);
        }
        if (depth == 0u)
            break;
        ref = stack[--depth];
    }
    return hit.draw != HG_HIT_NONE;
}

#endif
