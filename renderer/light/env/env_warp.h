// env_warp.h - importance sampling of an environment: a pyramid of weights for hierarchical
// warping. Floor 2 (light). Pure; rows are spread over jobs, the same bytes for any number of
// threads.
//
// The finest grid has (2 << levels) x (1 << levels) cells of the equirectangular square; a cell's
// weight is the integral over its solid angle of the luminance that a bilinear lookup in the image
// shows, and a little more everywhere, so that no light is left out where the texels
// that are seen are finer than the image. Coarser grids hold sums of 2 x 2. The grid is no finer
// than the light is uneven: a sky without its sun has far fewer cells than its image has texels.
//
// Layout: quads (x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1). Quad 0 holds the two cells of the
// coarsest grid, west and east; then, level by level, one quad for every cell of the grid above, in
// Morton order within each half: the children of cell i are quad i.
// Source: Clarberg, Jarosz, Akenine-Moller and Jensen 2005, "Wavelet Importance Sampling".
#ifndef HG_RENDERER_LIGHT_ENV_ENV_WARP_H
#define HG_RENDERER_LIGHT_ENV_ENV_WARP_H

#include "base/jobs.h"
#include "base/status.h"
#include "renderer/image/image.h"
#include "shaders/shared/types.h"

#define HG_ENV_WARP_MAX_LEVELS 10 // 2048 x 1024 cells: 11 MiB

// Zeroed = none.
struct hg_env_warp {
    struct hg_vec4 *quads;
    uint32_t quad_count, levels;
    float mean; // luminance over all directions; 0: black, and there are no quads
};

// image: RGBA32F equirectangular; NaN, infinite and negative values count as 0, values above 65504,
// which the device cannot hold, as that. HG_E_NOMEM.
enum hg_status hg_env_warp_make(
    const struct hg_image *image, struct hg_jobs *jobs, struct hg_env_warp *out) HG_MUST_CHECK;
void hg_env_warp_finish(struct hg_env_warp *warp); // accepts a zeroed one

#endif
