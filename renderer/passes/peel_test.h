// peel_test.h - whether a layer of blended surfaces holds anything.
// Floor 3.
#ifndef HG_RENDERER_PASSES_PEEL_TEST_H
#define HG_RENDERER_PASSES_PEEL_TEST_H

#include "renderer/passes/pass.h"

// Sets word `index` of `target` (readback memory) to 1 if anything was drawn into `depth`
// (reversed, 0 = nothing); leaves it unchanged otherwise. An occlusion query would do the same, but
// the software rasteriser of Mesa 22.3 crashes with several of them in one batch.
enum hg_status hg_peel_test_record(struct hg_pass *pass, struct hg_gpu_image *depth,
    const struct hg_gpu_buffer *target, uint32_t index, struct hg_error *err) HG_MUST_CHECK;

#endif
