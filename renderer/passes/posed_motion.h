// posed_motion.h - where the surfaces of skinned and morphed parts were in the picture before.
// Floor 3.
#ifndef HG_RENDERER_PASSES_POSED_MOTION_H
#define HG_RENDERER_PASSES_POSED_MOTION_H

#include "renderer/passes/pass.h"
#include "shaders/shared/posed_motion.h"

// Fills push->target, [rows][columns] x 3 floats; the rectangle lies inside of `visibility`.
enum hg_status hg_posed_motion_record(struct hg_pass *pass, struct hg_gpu_image *visibility,
    const struct hg_gpu_posed_motion *push, struct hg_error *err) HG_MUST_CHECK;

#endif
