// targets.h - the images that a view draws to.
// Floor 4. Thread: the render thread.
#ifndef HG_RENDERER_FRAME_TARGETS_H
#define HG_RENDERER_FRAME_TARGETS_H

#include "renderer/gpu/gpu.h"

struct hg_view_targets {
    struct hg_gpu_image visibility, depth, accumulated;
    struct hg_gpu_image layers[2], layer_visibility, layer_color; // while blended draws are seen
    struct hg_gpu_image behind;    // the opaque scene, while draws that let light through are
    struct hg_gpu_image pixels[3]; // RGBA8, RGBA16, RGBA32F; made on first read
};

#endif
