// points.h - light that arrives at points of surfaces: straight from lamps, the sun and the
// environment by shadow rays, the rest from the field of probes.
// Floor 2, for renderer/gi and renderer/reflect. Thread: the render thread; points are lit on jobs.
#ifndef HG_RENDERER_GI_POINTS_H
#define HG_RENDERER_GI_POINTS_H

#include "base/jobs.h"
#include "renderer/gi/field.h"
#include "renderer/host_shading/caster.h"
#include "renderer/host_shading/direct.h"

struct hg_gi_lit {
    float position[3], normal[3];
    float view[3];  // unit, towards where it is looked at from
    float xi;       // in [0, 1), for what is chosen by chance
    bool skipped;   // no surface: it has no light
    float light[3]; // out: irradiance over pi
};

// All borrowed.
struct hg_gi_points {
    struct hg_jobs *jobs;
    struct hg_host_caster *caster;
    const struct hg_lighting_sources *sources;
    const struct hg_gi_field *field;
    // Of count * HG_HOST_SHADOW_RAYS rays and words.
    struct hg_gpu_buffer *rays, *blocked;
    struct hg_host_direct *direct; // [count]
};
// Computes `light` of points [0, count). Device errors.
enum hg_status hg_gi_points_light(const struct hg_gi_points *with, struct hg_gi_lit *points,
    uint32_t count, struct hg_error *err) HG_MUST_CHECK;
// Shadow rays that the last call cast for them.
uint32_t hg_gi_points_rays(const struct hg_gi_points *with, uint32_t count);

#endif
