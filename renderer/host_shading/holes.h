// holes.h - rays of the host through the holes of alpha masks, which traversal takes for solid.
// Floor 2. Thread: the render thread.
#ifndef HG_RENDERER_HOST_SHADING_HOLES_H
#define HG_RENDERER_HOST_SHADING_HOLES_H

#include "renderer/host_shading/surfaces.h"
#include "renderer/trace/trace.h"

#define HG_HOST_HOLES 8 // of one ray, that it passes

// After hg_trace_closest of the wave, whose rays and hits are mapped: rays that met a hole are cast
// again from there. Masks are as coarse as 64 texels a side. list: room for as many words as the
// wave has rays, other than its own list. more: rays that were cast. Device errors.
enum hg_status hg_host_pass_holes(const struct hg_host_surfaces *surfaces, struct hg_trace *trace,
    const struct hg_trace_wave *wave, const struct hg_gpu_buffer *list, uint32_t *more,
    struct hg_error *err) HG_MUST_CHECK;

#endif
