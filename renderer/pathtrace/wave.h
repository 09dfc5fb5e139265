// wave.h - one sample of each pixel of some tiles: paths from the camera until all have ended.
// Private to the room. Floor 3.5. Thread: the render thread.
#ifndef HG_RENDERER_PATHTRACE_WAVE_H
#define HG_RENDERER_PATHTRACE_WAVE_H

#include "renderer/gpu/gpu.h"
#include "renderer/pathtrace/path.h"
#include "shaders/shared/path.h"

#define HG_PATH_WAVE_PX (HG_PATH_WAVE_TILES * HG_PATH_TILE_PX)

enum hg_path_phase {          // the next piece of work
    HG_PATH_PHASE_NONE,       // begins a wave, or a pass
    HG_PATH_PHASE_TRACE,      // nearest hits
    HG_PATH_PHASE_SHADE,      // shades them
    HG_PATH_PHASE_SHADOW,     // rays to lights
    HG_PATH_PHASE_ALPHA_MASK, // continues shadow rays behind masked and blended surfaces
    HG_PATH_PHASE_BRANCH,     // begins another branch at the camera hits
    HG_PATH_PHASE_FILM,       // adds the samples to the film
};

// Slots of a wave, for kernels.
struct hg_path_list {
    struct hg_gpu_buffer buffer; // [HG_PATH_WAVE_PX] words
    uint32_t count;
};

struct hg_path_wave_buffers { // by slot
    struct hg_gpu_buffer block, rays, shadow_rays, hits, shadow_hits, blocked, status, state;
    struct hg_gpu_buffer tiles, tile_samples; // [HG_PATH_WAVE_TILES]
};

struct hg_path_wave_lists {
    struct hg_path_list live, waiting, shadows;
    struct hg_path_list suns;    // paths whose second shadow ray comes next
    struct hg_path_list primary; // with a camera hit, when there are branches
};

struct hg_path_wave { // zeroed = empty; hg_path_wave_destroy
    struct hg_gpu_path block;
    struct hg_path_wave_buffers buffers;
    struct hg_path_wave_lists lists;
    uint32_t tile_index[HG_PATH_WAVE_TILES];
    uint32_t tile_count, slots;
    enum hg_path_phase phase;
    uint32_t branch, bounce;
    uint32_t missed;    // the first of `waiting` have rays that left the scene
    bool host_hits;     // the host reads hits
    uint32_t may;       // HG_PATH_PLANES, HG_EMITTER_KIND_*
    uint32_t second;    // 1: `shadows` have rays to directional lights
    uint32_t part;      // most paths that are shaded at once
    uint32_t fruitless; // rounds without progress of any suspended path
    bool wait_pages;
    uint32_t missing; // texture pages, of the newest kernel
};

#endif
