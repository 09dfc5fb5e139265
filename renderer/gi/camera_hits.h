// camera_hits.h - hits of a few camera rays and the light that arrives there, shaded from means of
// materials as the hits of probe rays are.
// Floor 2, private to renderer/gi. Thread: the render thread; rays are shaded on jobs.
#ifndef HG_RENDERER_GI_CAMERA_HITS_H
#define HG_RENDERER_GI_CAMERA_HITS_H

#include "base/jobs.h"
#include "renderer/gi/field.h"
#include "renderer/gi/gi.h"
#include "renderer/host_shading/caster.h"

// All borrowed. Buffers hold HG_GI_MOST_CAMERA_RAYS rays, and HG_HOST_SHADOW_RAYS times as many.
struct hg_gi_camera_hits {
    struct hg_host_caster *caster;
    struct hg_jobs *jobs;
    const struct hg_gi_field *field;
    const struct hg_lighting_sources *sources;
    struct hg_gpu_buffer *rays, *hits, *shadow_rays, *blocked;
};
// As hg_gi_trace_camera. HG_E_NOMEM, device errors.
enum hg_status hg_gi_camera_hits_find(const struct hg_gi_camera_hits *with,
    const struct hg_gpu_ray *rays, uint32_t count, struct hg_gi_camera_hit *out,
    struct hg_error *err) HG_MUST_CHECK;

#endif
