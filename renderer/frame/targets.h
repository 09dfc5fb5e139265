// targets.h - the images that a view draws to.
// Floor 4. Thread: the render thread.
#ifndef HG_RENDERER_FRAME_TARGETS_H
#define HG_RENDERER_FRAME_TARGETS_H

#include "renderer/graph/graph.h"

struct hg_view_targets {
    struct hg_graph *graph; // has what lasts for one sample; made when it is first used
    struct hg_gpu_image visibility, depth, accumulated;
    struct hg_gpu_image behind;    // the opaque scene, while transmissive draws are drawn
    struct hg_gpu_image pixels[3]; // RGBA8, RGBA16, RGBA32F; made on first read
    struct hg_gpu_image checkered; // RGBA8, half as wide, while every second pixel is shaded
};

#endif
