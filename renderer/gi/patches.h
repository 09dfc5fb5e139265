// patches.h - light that pieces of surfaces send back, for a list of them, from what arrives there
// (points.h).
// Floor 2, for rooms whose rays meet surfaces. Thread: the render thread; points are lit on jobs.
#ifndef HG_RENDERER_GI_PATCHES_H
#define HG_RENDERER_GI_PATCHES_H

#include "base/jobs.h"
#include "renderer/gi/gi.h"
#include "renderer/gi/points.h"

// Relative to the geometry's origin; the normal is unit. Means of the material.
struct hg_gi_patch {
    float position[3], normal[3], albedo[3], emission[3];
};

struct hg_gi_patches { // zeroed: empty
    struct hg_gpu_buffer rays, blocked;
    struct hg_gi_patch *points;
    struct hg_host_direct *direct;
    struct hg_gi_lit *lit;
    float (*radiance)[3];
    uint32_t count, capacity;
};
void hg_gi_patches_finish(struct hg_gi_patches *patches, struct hg_gpu *gpu);
// Room for so many. HG_E_NOMEM.
enum hg_status hg_gi_patches_reserve(struct hg_gi_patches *patches, struct hg_gpu *gpu,
    uint32_t count, struct hg_error *err) HG_MUST_CHECK;

struct hg_gi_patch_lighting {
    struct hg_jobs *jobs;
    const struct hg_lighting_sources *sources;
    const struct hg_gi_world *world;
    uint32_t number; // of the picture, for what is chosen by chance
};
// radiance of points [0, count); counts shadow rays. Device errors.
enum hg_status hg_gi_patches_light(struct hg_gi_patches *patches,
    const struct hg_gi_patch_lighting *with, uint32_t *shadow_rays,
    struct hg_error *err) HG_MUST_CHECK;

#endif
