// sights.h - what a few rays of a camera see, and how much light falls there: shaded from means as
// what the rays of probes meet, at points of the probes' field.
// Floor 2, private to renderer/gi. Thread: the render thread; rays are shaded on jobs.
#ifndef HG_RENDERER_GI_SIGHTS_H
#define HG_RENDERER_GI_SIGHTS_H

#include "base/jobs.h"
#include "renderer/gi/field.h"
#include "renderer/gi/gi.h"
#include "renderer/gi/surfaces.h"

// All borrowed. Buffers hold HG_GI_MOST_SIGHTS rays, and HG_GI_SHADOW_RAYS times as many.
struct hg_gi_sights {
    struct hg_trace *trace;
    struct hg_jobs *jobs;
    const struct hg_gi_surfaces *surfaces;
    const struct hg_gi_field *field;
    const struct hg_lighting_sources *sources;
    struct hg_gpu_buffer *rays, *hits, *shadow_rays, *blocked;
};
// As hg_gi_see. HG_E_NOMEM, device errors.
enum hg_status hg_gi_sights_see(const struct hg_gi_sights *sights, const struct hg_gpu_ray *rays,
    uint32_t count, struct hg_gi_sight *out, struct hg_error *err) HG_MUST_CHECK;

#endif
