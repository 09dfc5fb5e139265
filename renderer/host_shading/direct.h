// direct.h - light that comes straight from lamps, the sun and the environment, on the host.
// Floor 2. Pure; any thread.
#ifndef HG_RENDERER_HOST_SHADING_DIRECT_H
#define HG_RENDERER_HOST_SHADING_DIRECT_H

#include "renderer/light/lighting.h"
#include "shaders/shared/ray.h"

#define HG_HOST_SHADOW_RAYS 3 // of one hit: two directional lights and one of the others, by chance

// Light of a surface's point if nothing is in the way of its ray; a ray with t_max < t_min has
// none.
struct hg_host_direct {
    struct hg_gpu_ray rays[HG_HOST_SHADOW_RAYS];
    float light[HG_HOST_SHADOW_RAYS][3]; // irradiance over pi
};

// No light, and no rays.
static inline void hg_host_direct_clear(struct hg_host_direct *out)
{
    static const struct hg_gpu_ray none = {.t_max = -1};
    for (uint32_t i = 0; i < HG_HOST_SHADOW_RAYS; i++) {
        out->rays[i] = none;
        out->light[i][0] = out->light[i][1] = out->light[i][2] = 0;
    }
}

// lift: metres that rays begin off the surface. xi: a number in [0, 1).
struct hg_host_receiver {
    float position[3], normal[3], lift, xi;
};
void hg_host_direct_at(const struct hg_lighting_sources *sources,
    const struct hg_host_receiver *receiver, struct hg_host_direct *out);

#endif
