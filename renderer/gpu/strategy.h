// strategy.h - what a renderer does in another way because its device is a processor.
// Floor 1. No Vulkan. Filled once, when the device is created; constant from then on.
//
// A software rasteriser runs on the same cores and in the same memory as the host: work may move
// between both without copies, and what is cheap differs (every branch of a shader runs, a triangle
// costs as much whatever its size, a word by address several times a word of a uniform block).
// Each decision that follows from it is one field here. Rooms ask for the decision; only this file
// and the description of the device ask what kind of device it is. All are false on GPUs.
#ifndef HG_RENDERER_GPU_STRATEGY_H
#define HG_RENDERER_GPU_STRATEGY_H

#include <stdbool.h>

struct hg_device_strategy {
    // Mapped memory is read by the host as fast as its own: no copies of indices, clusters or the
    // film are kept or made, and rays see the buffers themselves. (On GPUs mapped memory is
    // write-combined: reads are slow.)
    bool host_reads;
    // Mapped memory is asked for in huge pages (renderer/gpu/memory.c).
    bool huge_pages;
    // Opaque clusters of baked parts are drawn by the host: 16 ns for each triangle of a pixel, in
    // place of 270 (docs/decisions/0010-small-triangles-on-the-host.md).
    bool host_raster;
    // Triangles that show at no sample are left out of index lists on the host, each by itself
    // (docs/internals/geometry.md): 10 ns each, and one that is drawn costs 75 ns on one thread.
    bool host_triangle_cull;
    // Parts that are not posed have lists in which the first corner of a triangle belongs to it
    // alone and holds its number (docs/internals/geometry.md).
    bool provoking_vertices;
    // Tables that fit are bound as uniform blocks, three-word triangles are cached in texels, and
    // pipelines are made for the features and mixes of one scene (docs/internals/geometry.md and
    // frame.md).
    bool uniform_tables;
    // Pipelines of the sky and of paths know what the scene has: a branch that is not taken costs
    // as much as one that is (docs/internals/frame.md). On GPUs fewer pipelines are compiled.
    bool exact_pipelines;
    // Cells of the picture that no light reaches are found and shaded without lights
    // (docs/internals/light.md).
    bool unlit_tiles;
    // Shading takes words of the frame as flat varyings and not from uniforms (shade_flat.*,
    // shaders/lib/flat.glsl).
    bool flat_shading;
    // Samples of paths go to the film by the host: rows of pixels in place of words by address.
    bool host_film;
    // Rays go to Embree first: 17 Mrays/s of primary rays against 2.8 of the compute backend
    // (docs/internals/trace.md).
    bool host_rays;
    // Shaders go through gpu/optimise.h before the driver has them: its front end takes a third of
    // the time (docs/internals/gpu.md).
    bool short_shaders;
    // Pipelines compile when they are first drawn with, so that warming up draws pictures.
    bool lazy_pipelines;
};

// For tests and for people who look into a frame: decisions taken as on a GPU, but short_shaders,
// which asks for what is not done on GPUs.
struct hg_device_overrides {
    bool no_host_raster, no_host_triangle_cull, no_uniform_tables, no_short_shaders, short_shaders;
};

// is_cpu: the device is a software rasteriser.
struct hg_device_strategy hg_device_strategy_choose(
    bool is_cpu, const struct hg_device_overrides *overrides);

#endif
