// pick.h - the surface point of one pixel.
// Floor 3.
#ifndef HG_RENDERER_PASSES_PICK_H
#define HG_RENDERER_PASSES_PICK_H

#include "renderer/passes/pass.h"
#include "shaders/shared/pick.h"

// Writes struct hg_gpu_pick at the start of `target` (readback memory).
enum hg_status hg_pick_record(struct hg_pass *pass, struct hg_gpu_image *visibility, uint32_t x,
    uint32_t y, const struct hg_gpu_buffer *target, struct hg_error *err) HG_MUST_CHECK;

#endif
