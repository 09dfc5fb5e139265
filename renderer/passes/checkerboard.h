// checkerboard.h - depth of the pixels of a picture that are shaded. Floor 3.
#ifndef HG_RENDERER_PASSES_CHECKERBOARD_H
#define HG_RENDERER_PASSES_CHECKERBOARD_H

#include "renderer/passes/pass.h"
#include "shaders/shared/checkerboard.h"

// depth of the whole picture to `half`, which is half as wide, rounded up.
enum hg_status hg_checkerboard_record(const struct hg_pass *pass, struct hg_gpu_image *depth,
    struct hg_gpu_image *half, uint32_t number, struct hg_error *err) HG_MUST_CHECK;

#endif
