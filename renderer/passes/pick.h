// pick.h - surface points of pixels.
// Floor 3.
#ifndef HG_RENDERER_PASSES_PICK_H
#define HG_RENDERER_PASSES_PICK_H

#include "renderer/passes/pass.h"
#include "shaders/shared/pick.h"

// Writes a struct hg_gpu_pick for each pixel of the area, row by row, to the start of `target`
// (readback memory, which holds zeros).
enum hg_status hg_pick_record(struct hg_pass *pass, struct hg_gpu_image *visibility, VkRect2D area,
    const struct hg_gpu_buffer *target, struct hg_error *err) HG_MUST_CHECK;

#endif
