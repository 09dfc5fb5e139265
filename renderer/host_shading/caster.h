// caster.h - rays of the host against what pictures show: alpha masks, which traversal takes for
// solid, let rays through their holes.
// Floor 2. Thread: the render thread.
#ifndef HG_RENDERER_HOST_SHADING_CASTER_H
#define HG_RENDERER_HOST_SHADING_CASTER_H

#include "renderer/host_shading/surfaces.h"
#include "renderer/trace/trace.h"

#define HG_HOST_HOLES 8 // of one ray, that it passes

struct hg_host_caster {
    struct hg_gpu *gpu;                      // borrowed, as are
    struct hg_trace *trace;                  // NULL: nothing can be cast
    const struct hg_host_surfaces *surfaces; // of the trace's scene
    struct hg_gpu_buffer list, behind;       // scratch, in scenes with masks: places of rays, hits
};
void hg_host_caster_finish(struct hg_host_caster *caster);

// As hg_trace_closest. Masks are as coarse as 64 texels a side. Rays of the wave that passed holes
// begin behind the last one then. more: rays that were cast again. HG_E_NOMEM, device errors.
enum hg_status hg_host_cast(struct hg_host_caster *caster, const struct hg_trace_wave *wave,
    uint32_t *more, struct hg_error *err) HG_MUST_CHECK;
// As hg_trace_blocked, of a wave without a list from the first ray on. Masks of rays (ray.h) may be
// changed. HG_E_NOMEM, device errors.
enum hg_status hg_host_cast_shadows(struct hg_host_caster *caster, const struct hg_trace_wave *wave,
    struct hg_error *err) HG_MUST_CHECK;

#endif
