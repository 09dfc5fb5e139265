// khr.h - waves of the backend of renderer/trace/ that asks the device's ray queries. Floor 0,
// shared by C and GLSL (scalar layout).
#ifndef HG_SHADERS_SHARED_KHR_H
#define HG_SHADERS_SHARED_KHR_H

#include "shared/ray.h"
#include "shared/types.h"

#define HG_KHR_GROUP 64      // rays per workgroup
#define HG_KHR_STEPS 1048576 // of a query; opaque triangles need one

struct hg_gpu_khr_instance {
    HG_UINT draw;           // added to that of the geometry
    HG_UINT first_geometry; // of its body
};
HG_SHARED_SIZE(hg_gpu_khr_instance, 8);

struct hg_gpu_khr_geometry {
    HG_UINT draw; // of flat ones
    HG_UINT first_primitive;
};
HG_SHARED_SIZE(hg_gpu_khr_geometry, 8);

#ifndef __STDC__
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_khr_instances {
    hg_gpu_khr_instance v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) readonly buffer hg_khr_geometries {
    hg_gpu_khr_geometry v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer hg_khr_blocked {
    uint v[];
};
#endif

#ifdef __STDC__
#define HG_KHR_SCENE uint64_t
#else
#define HG_KHR_SCENE uvec2
#endif

// Push constants of passes/trace_khr.comp.
struct hg_gpu_khr_wave {
    HG_PTR(hg_ray_list) rays;
    HG_PTR(hg_hit_list) hits;
    HG_PTR(hg_khr_blocked) blocked;
    HG_PTR(hg_khr_instances) instances;
    HG_PTR(hg_khr_geometries) geometries;
    HG_KHR_SCENE scene; // address of the acceleration structure; 0: there is nothing
    HG_PTR(hg_ray_slots) list; // which rays; 0: the first `count`
    HG_UINT count, reserved;
};
HG_SHARED_SIZE(hg_gpu_khr_wave, 64);

#endif
