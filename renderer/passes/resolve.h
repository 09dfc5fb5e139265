// resolve.h - resolves accumulated radiance to pixels: mean of the samples, exposure, tone curve,
// sRGB, straight alpha. Floor 3.
#ifndef HG_RENDERER_PASSES_RESOLVE_H
#define HG_RENDERER_PASSES_RESOLVE_H

#include "renderer/passes/pass.h"

struct hg_resolve {
    struct hg_gpu_image *accumulated; // sums of premultiplied radiance
    struct hg_gpu_image *target;      // RGBA8, RGBA16 (display values) or RGBA32F (linear)
    uint32_t samples;                 // in the sums, >= 1
    float exposure;                   // linear factor
    uint32_t tonemap;                 // HG_FRAME_TONEMAP_*
    // Where pixels have different numbers of samples: a word each (shaders/shared/texture.h), and
    // the sum of one sample that those show which have none. 0 and NULL otherwise.
    VkDeviceAddress progress;
    struct hg_gpu_image *fallback;
    // Samples that blocks of pixels have at most (shaders/shared/sample_blocks.h), and columns of
    // blocks. 0: all pixels have as many.
    VkDeviceAddress blocks;
    uint32_t block_columns;
    const float *backdrop; // linear display colour behind what is transparent; NULL: none
};

enum hg_status hg_resolve_record(
    struct hg_pass *pass, const struct hg_resolve *resolve, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_resolve_warm_up(
    struct hg_gpu *gpu, uint32_t index, uint32_t *count, struct hg_error *err) HG_MUST_CHECK;

#endif
