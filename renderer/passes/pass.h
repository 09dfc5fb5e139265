// pass.h - what all passes have in common: the batch, the images of the scene, the frame block.
// Floor 3.
#ifndef HG_RENDERER_PASSES_PASS_H
#define HG_RENDERER_PASSES_PASS_H

#include "renderer/gpu/gpu.h"

struct hg_pass {
    struct hg_gpu *gpu;
    struct hg_gpu_cmd *cmd;
    struct hg_jobs *jobs; // for pipelines that are not there yet; NULL: one after the other
    // Images of textures and lighting and the frame block are filled in; a pass adds its own inputs
    // (HG_BIND_VISIBILITY and up) to a copy.
    struct hg_gpu_bindings bindings;
    // Second and third specialisation constant of shaders that include lib/tables.glsl: which
    // tables are bound as uniform blocks, and HG_FEATURE_* (shaders/shared/features.h).
    uint32_t tables, features;
    uint32_t mixes;      // HG_MIX_*, the sixth of those that shade
    uint32_t background; // HG_FEATURE_SKY_*: what backgrounds have besides
    VkRect2D area;       // of the view that is drawn, clears included; zero = all of it
    // Only what is asked of textures counts, nothing that is drawn: a small view fills the area,
    // and of shadow casters those with holes are drawn, whatever hides them.
    bool find;
    bool adds; // shadow maps: to what is in them already
};

// After beginning a rendering with the pass's area: what is drawn covers the view, not the area.
static inline void hg_pass_view_whole(const struct hg_pass *pass, const struct hg_gpu_image *image)
{
    const VkExtent2D size =
        pass->find ? pass->area.extent : (VkExtent2D){image->width, image->height};
    const VkViewport whole = {0.0f, 0.0f, (float)size.width, (float)size.height, 0.0f, 1.0f};
    if (pass->area.extent.width > 0)
        vkCmdSetViewport(hg_gpu_cmd_handle(pass->cmd), 0, 1, &whole);
}

#endif
