// debug_overrides.h - parts of a renderer that tests, benchmarks and people who look into a frame
// switch off or to something else. Zero of each member is what everybody else gets.
// Floor 2 (scene_gpu), no Vulkan. Copied when a renderer is made.
#ifndef HG_RENDERER_SCENE_GPU_DEBUG_OVERRIDES_H
#define HG_RENDERER_SCENE_GPU_DEBUG_OVERRIDES_H

#include <stdbool.h>
#include <stdint.h>

enum hg_override { HG_OVERRIDE_AUTO, HG_OVERRIDE_OFF, HG_OVERRIDE_ON };

struct hg_debug_overrides {
    // Settled pictures are the same with each of these.
    bool no_culling;      // everything is drawn
    bool no_cpu_raster;   // on CPU devices, too, the device draws every triangle
    bool no_prefetch;     // no texture page is read before it is missing
    bool table_addresses; // shaders reach every table by address, as on GPUs; same to one in 255
    enum hg_override short_shaders; // shaders by gpu/optimise.h; the same to rounding
    enum hg_override unlit_tiles; // shading tiles that no light reaches without lights
    uint64_t path_slice_ns;       // length of a step of path tracing; 0 = that of pathtrace/path.c
    uint32_t blend_first_nodes;   // of lists of blended surfaces; 0 = by the picture's size
    uint32_t blend_most_nodes;    // of them, in one strip; 0 = that of frame/batch/blend.c
    bool blend_lists;             // pictures in motion have them, too, however long they are
    // Pictures agree within their noise.
    uint32_t cache_side;      // texels along a face of radiance caches; 0 = HG_CACHE_SIDE
    uint32_t reflect_samples; // rays of a texel of reflections; 0 = 1
    bool reflect_dense;       // rough surfaces send as many as others
    bool no_irradiance_rays;  // pictures in motion have the light of probes as it is
    uint32_t path_estimators; // HG_PATH_USE_* bits; 0 = all
    uint32_t path_branches;   // of each path at what the camera sees; 0 = chosen
    // What is not kept otherwise: the frame before, though no pass reads it; motion vectors of
    // pictures in motion (hg_view_report).
    bool keeps_history, keeps_motion;
    // Statistics of paths have the time of Embree alone on the same rays, which takes as long
    // again.
    bool trace_raw;
};

#endif
