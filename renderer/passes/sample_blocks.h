// sample_blocks.h - leaves out pixels that have samples enough. Floor 3.
#ifndef HG_RENDERER_PASSES_SAMPLE_BLOCKS_H
#define HG_RENDERER_PASSES_SAMPLE_BLOCKS_H

#include "renderer/passes/pass.h"
#include "shaders/shared/sample_blocks.h"

// Depth becomes HG_UNLIT_TILES_DEPTH where a block has samples enough without this one, which
// hg_shade.masked leaves out.
enum hg_status hg_sample_blocks_record(const struct hg_pass *pass, struct hg_gpu_image *depth,
    const struct hg_gpu_sample_blocks *blocks, struct hg_error *err) HG_MUST_CHECK;

#endif
