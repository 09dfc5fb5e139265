// pass.h - what all passes have in common: the batch, the images of the scene, the frame block.
// Floor 3.
#ifndef HG_RENDERER_PASSES_PASS_H
#define HG_RENDERER_PASSES_PASS_H

#include "renderer/gpu/io.h"
#include "shaders/shared/pass_io.h"

struct hg_pass {
    struct hg_gpu *gpu;
    struct hg_gpu_cmd *cmd;
    struct hg_jobs *jobs; // compiles missing pipelines in parallel; NULL: sequentially
    // Images of textures and lighting, the frame block and tables. What a pass reads besides is
    // declared in shaders/shared/pass_io.h.
    struct hg_gpu_bindings bindings;
    // Second and third specialisation constant of shaders that include lib/tables.glsl: which
    // tables are bound as uniform blocks, and HG_FEATURE_* (shaders/shared/features.h).
    uint32_t tables, features;
    uint32_t features2;  // HG_MIX_*, HG_FEATURE2_*, the sixth of those that shade
    uint32_t background; // HG_FEATURE_SKY_*: what backgrounds have besides
    VkRect2D area;       // of the view that is drawn, clears included; zero = all of it
    // Only what is asked of textures counts, nothing that is drawn: a small view fills the area,
    // and of shadow casters those with holes are drawn, whatever hides them.
    bool find;
    bool clips; // clipping planes of the frame block count
    bool adds; // shadow maps: to what is in them already
};

// Binds the scene, and what the pass reads and writes.
static inline enum hg_status hg_pass_bind(const struct hg_pass *pass, const struct hg_gpu_io *io,
    const void *bound, size_t size_bytes, struct hg_error *err)
{
    const enum hg_status status = hg_gpu_cmd_bind(pass->cmd, &pass->bindings, err);
    return status == HG_OK ? hg_gpu_cmd_bind_io(pass->cmd, io, bound, size_bytes, err) : status;
}

// One fragment shader over all of an image, whose contents before do not matter.
struct hg_fullscreen {
    const char *fragment; // name of the shader
    struct hg_gpu_image *target;
    struct hg_gpu_image *second; // target of output 1, as large; NULL: none
    const struct hg_gpu_io *io;
    const void *inputs; // struct of HG_GPU_IO_MEMBERs
    size_t inputs_bytes;
    const void *push; // constants
    uint32_t push_bytes;
    uint32_t spec[HG_GPU_MAX_SPEC], spec_count;
};
enum hg_status hg_pass_fullscreen(
    const struct hg_pass *pass, const struct hg_fullscreen *f, struct hg_error *err) HG_MUST_CHECK;

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
