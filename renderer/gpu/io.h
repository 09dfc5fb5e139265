// io.h - descriptor set 1: the images that one pass reads and writes, by the list it declares them
// with (shaders/shared/io.h).
// Floor 1. Thread: the render thread.
//
//     static const struct hg_gpu_io io = HG_GPU_IO(HG_VIGNETTE_IO);
//     struct inputs { HG_VIGNETTE_IO(HG_GPU_IO_MEMBER) };
//
//     const struct inputs in = {.picture = {picture}, .sharpness = {sharpness}};
//     status = hg_gpu_cmd_bind_io(cmd, &io, &in, sizeof in, err);
//
// The layout of the set and of its pipelines follows from the list and is made once per content;
// pipelines say which one is theirs (hg_gpu_pipeline_params.io).
#ifndef HG_RENDERER_GPU_IO_H
#define HG_RENDERER_GPU_IO_H

#include "renderer/gpu/gpu.h"
#include "shaders/shared/io.h"

#define HG_GPU_MAX_IO 16

enum hg_gpu_io_kind {
#define HG_GPU_IO_KIND(kind, ...) HG_GPU_IO_##kind,
    HG_IO_SAMPLED_KINDS(HG_GPU_IO_KIND) HG_IO_STORAGE_KINDS(HG_GPU_IO_KIND)
#undef HG_GPU_IO_KIND
        HG_GPU_IO_KINDS
};

struct hg_gpu_io {
    enum hg_gpu_io_kind kinds[HG_GPU_MAX_IO]; // by slot, without gaps
    uint32_t count;
};

struct hg_gpu_bound {
    struct hg_gpu_image *image; // NULL = a 1x1 stand-in of undefined content
    uint32_t mip_plus_one;      // 0 = all that a sampler can see; of storage images the first
};

#define HG_GPU_IO_SLOT(slot, kind, name)   [slot] = HG_GPU_IO_##kind,
#define HG_GPU_IO_ONE(slot, kind, name)    +1
#define HG_GPU_IO_MEMBER(slot, kind, name) struct hg_gpu_bound name;
#define HG_GPU_IO(list)                                                                            \
    {                                                                                              \
        {list(HG_GPU_IO_SLOT)}, list(HG_GPU_IO_ONE)                                                \
    }

// Binds set 1 for graphics and compute and brings the images to the use that their kind says.
// bound: a struct of HG_GPU_IO_MEMBERs, `size_bytes` large. Call outside rendering.
// HG_E_LIMIT: more images than the device allows; HG_E_NOMEM, device errors.
enum hg_status hg_gpu_cmd_bind_io(struct hg_gpu_cmd *cmd, const struct hg_gpu_io *io,
    const void *bound, size_t size_bytes, struct hg_error *err) HG_MUST_CHECK;

#endif
