// path.h - kernels over waves of paths (shaders/shared/path.h).
// Floor 3. Thread: the render thread.
#ifndef HG_RENDERER_PASSES_PATH_H
#define HG_RENDERER_PASSES_PATH_H

#include "renderer/passes/pass.h"
#include "shaders/shared/path.h"

enum hg_path_kernel {
    HG_PATH_BEGIN,      // camera rays
    HG_PATH_SHADE,      // shades the hits
    HG_PATH_MISS,       // the same of rays that left the scene,
    HG_PATH_SURFACE,    // and of those that did not
    HG_PATH_END,        // of those where gathering paths end: the others are marked HG_PATH_FINE
    HG_PATH_SUNLIT,     // of first surfaces, for what directional lights bring alone
    HG_PATH_ARRIVE,     // adds light whose shadow rays passed all opaque surfaces
    HG_PATH_ALPHA_MASK, // the next masked or blended surface along its shadow ray
    HG_PATH_CLEAR,      // there is none
    HG_PATH_KEEP,       // samples of the wave to the ring
    HG_PATH_ADD,        // samples of the ring to the film
};

// `block`: struct hg_gpu_path of the wave; options: HG_PATH_BLURS and its like. Its results are visible to later commands and the host.
enum hg_status hg_path_record(struct hg_pass *pass, enum hg_path_kernel kernel,
    uint32_t options, const struct hg_gpu_uniform *block, const struct hg_gpu_path_push *push,
    struct hg_error *err) HG_MUST_CHECK;

// A kernel and its options, as above.
struct hg_path_variant {
    enum hg_path_kernel kernel;
    uint32_t options;
};
// Kernels that will be needed, compiled side by side (at most HG_GPU_MAX_MAKING).
enum hg_status hg_path_make(struct hg_pass *pass, const struct hg_path_variant *variants,
    uint32_t count, struct hg_error *err) HG_MUST_CHECK;

struct hg_path_show {
    VkDeviceAddress film, samples; // samples: of each tile
    struct hg_gpu_image *target;   // gets the mean of the samples
    uint32_t catcher;              // HG_PATH_PLANE_CATCHER in the film, or HG_PATH_NO_PLANE
    bool transparent;              // the background has alpha 0
    bool clear;                    // pixels without samples; else they are kept
};
enum hg_status hg_path_show_record(
    struct hg_pass *pass, const struct hg_path_show *show, struct hg_error *err) HG_MUST_CHECK;

#endif
