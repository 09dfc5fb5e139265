// ray.h - wavefronts of rays and what they hit. Floor 0, shared by C and GLSL (scalar layout).
//
// Buffers of rays and hits lie in memory that host and device share; shaders write rays, a backend
// of renderer/trace/ writes hits, shaders read them.
#ifndef HG_SHADERS_SHARED_RAY_H
#define HG_SHADERS_SHARED_RAY_H

#include "shared/types.h"

// hg_gpu_ray.mask: what it may hit, by class of draw.
#define HG_RAY_OPAQUE 0x1u
#define HG_RAY_MASK   0x2u
#define HG_RAY_BLEND  0x4u
#define HG_RAY_ALL    0x7u
// Beside those, of rays to lights: nothing but this ray finds the light, which therefore also goes
// straight through panes.
#define HG_RAY_STRAIGHT 0x8u

// Rays that begin farther away than that (sum over the axes), or have a longer direction, are none.
#define HG_RAY_FARTHEST 1e12f

// "World space" is that of the frame: relative to the origin of the geometry room.
struct hg_gpu_ray {
    HG_VEC3 origin_ws;
    float t_min;         // negative counts as 0
    HG_VEC3 direction_ws; // any length but 0; t counts in it
    float t_max;          // < t_min: no ray, it misses
    float time;           // 0..1 in the shutter
    HG_UINT mask;         // HG_RAY_*; of no class: it hits nothing
};
HG_SHARED_SIZE(hg_gpu_ray, 40);

#define HG_HIT_NONE 0xffffffffu

// The nearest hit with t_min < t < t_max. Both sides of triangles are hit.
struct hg_gpu_hit {
    float t;
    float u, v;        // barycentrics: weights of the second and third corner
    HG_UINT draw;      // HG_HIT_NONE: nothing; the other fields are then undefined
    HG_UINT primitive; // as in the visibility buffer (HG_LOD_SHIFT)
};
HG_SHARED_SIZE(hg_gpu_hit, 20);

#ifndef __STDC__
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer hg_ray_list {
    hg_gpu_ray v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer hg_hit_list {
    hg_gpu_hit v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_ray_slots {
    uint v[];
};
#endif

#endif
