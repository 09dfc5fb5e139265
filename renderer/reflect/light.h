// light.h - light that surfaces send back, for a list of them, from what arrives there
// (renderer/gi/points.h).
// Floor 2, private to renderer/reflect. Thread: the render thread; points are lit on jobs.
#ifndef HG_RENDERER_REFLECT_LIGHT_H
#define HG_RENDERER_REFLECT_LIGHT_H

#include "base/jobs.h"
#include "renderer/gi/gi.h"
#include "renderer/gi/points.h"
#include "renderer/reflect/cache.h"

struct hg_reflect_light { // zeroed: empty
    struct hg_gpu_buffer rays, blocked;
    struct hg_cache_surface *points;
    struct hg_gi_direct *direct;
    struct hg_gi_lit *lit;
    float (*radiance)[3];
    uint32_t count, capacity;
};
void hg_reflect_light_finish(struct hg_reflect_light *light, struct hg_gpu *gpu);
// Room for so many. HG_E_NOMEM.
enum hg_status hg_reflect_light_reserve(struct hg_reflect_light *light, struct hg_gpu *gpu,
    uint32_t count, struct hg_error *err) HG_MUST_CHECK;

struct hg_reflect_lighting {
    struct hg_jobs *jobs;
    const struct hg_lighting_sources *sources;
    const struct hg_gi_world *world;
    uint32_t number; // of the picture, for what is chosen by chance
};
// radiance of points [0, count); counts shadow rays. Device errors.
enum hg_status hg_reflect_light_run(struct hg_reflect_light *light,
    const struct hg_reflect_lighting *with, uint32_t *shadow_rays,
    struct hg_error *err) HG_MUST_CHECK;

#endif
