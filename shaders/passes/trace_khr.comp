// A wave of rays through the device's own acceleration structures: nearest hits, or whether there
// are any.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_ray_query : require

#include "shared/khr.h"

layout(constant_id = 0) const uint any = 0u;
layout(local_size_x = HG_KHR_GROUP) in;
layout(push_constant, scalar) uniform hg_push
{
    hg_gpu_khr_wave wave;
};

bool is_ray(hg_gpu_ray r)
{
    float at = dot(abs(r.origin_ws), vec3(1.0)), length = dot(abs(r.direction_ws), vec3(1.0));
    return at <= HG_RAY_FARTHEST && length > 0.0 && length <= HG_RAY_FARTHEST && r.t_max > r.t_min &&
        r.t_max > 0.0;
}

// The next floats: the ends themselves are not hit.
float above(float t)
{
    return t >= 1.2e-38 ? uintBitsToFloat(floatBitsToUint(t) + 1u) : 1.2e-38;
}

float below(float t)
{
    return t > 3e38 ? 3e38 : uintBitsToFloat(floatBitsToUint(t) - 1u);
}

hg_gpu_hit trace(hg_gpu_ray ray)
{
    hg_gpu_hit hit = hg_gpu_hit(0.0, 0.0, 0.0, HG_HIT_NONE, 0u);
    if (wave.scene == uvec2(0u) || !is_ray(ray))
        return hit;
    uint flags = gl_RayFlagsOpaqueEXT | (any != 0u ? gl_RayFlagsTerminateOnFirstHitEXT : 0u);
    rayQueryEXT query;
    rayQueryInitializeEXT(query, accelerationStructureEXT(wave.scene), flags, ray.mask & 0xffu,
        ray.origin_ws, above(ray.t_min), ray.direction_ws, below(ray.t_max));
    for (uint step = 0u; step < HG_KHR_STEPS && rayQueryProceedEXT(query); step++)
        ;
    if (rayQueryGetIntersectionTypeEXT(query, true) == gl_RayQueryCommittedIntersectionNoneEXT)
        return hit;
    vec2 uv = rayQueryGetIntersectionBarycentricsEXT(query, true);
    hg_gpu_khr_instance i =
        wave.instances.v[rayQueryGetIntersectionInstanceCustomIndexEXT(query, true)];
    hg_gpu_khr_geometry g =
        wave.geometries.v[i.first_geometry + rayQueryGetIntersectionGeometryIndexEXT(query, true)];
    hit.t = rayQueryGetIntersectionTEXT(query, true);
    hit.u = uv.x;
    hit.v = uv.y;
    hit.draw = i.draw + g.draw;
    hit.primitive = g.first_primitive + rayQueryGetIntersectionPrimitiveIndexEXT(query, true);
    return hit;
}

void main()
{
    uint at = gl_GlobalInvocationID.x;
    if (at >= wave.count)
        return;
    if (uvec2(wave.list) != uvec2(0u))
        at = wave.list.v[at];
    hg_gpu_hit hit = trace(wave.rays.v[at]);
    if (any != 0u)
        wave.blocked.v[at] = hit.draw != HG_HIT_NONE ? 1u : 0u;
    else
        wave.hits.v[at] = hit;
}
