// denoise.h - denoiser for path-traced pictures.
// Floor 2. Thread: any, one at a time per object; work is spread over jobs. Pure functions of their
// input: the same bytes for any number of threads.
//
// Diffuse light of the first surface and its specular (reflected or transmitted) light are filtered
// separately, each divided by the surface's albedo, so that textures are not blurred. A pixel
// becomes a weighted mean of neighbours with similar features whose light differs by no more than
// their noise (non-local means over patches). Half buffers estimate the noise; each half is
// cross-filtered with weights from the other one, so that a sample does not affect its own weight.
// The filter converges: its width vanishes with the noise.
// Sources: Rousselle, Knaus and Zwicker 2012, "Adaptive Rendering with Non-Local Means Filtering"
// (patch distance, halves); Rousselle, Manzi and Zwicker 2013, "Robust Denoising using Feature and
// Color Information"; Bitterli et al. 2016, "Nonlinearly Weighted First-order Regression for
// Denoising Monte Carlo Renderings" (regression on features).
#ifndef HG_RENDERER_DENOISE_DENOISE_H
#define HG_RENDERER_DENOISE_DENOISE_H

#include <stdbool.h>

#include "base/jobs.h"
#include "base/refbuf.h"
#include "base/status.h"
#include "shaders/shared/path.h"

#define HG_DENOISE_LIGHT 9 // channels: rgb of HG_PATH_GUIDE_DIRECT, _INDIRECT, _SPECULAR

// Camera rays of pixels: from the eye through across + px x + py y, at a depth of one metre;
// orthographic: from there along forward. Scene space; x, y and forward are orthogonal.
struct hg_denoise_camera {
    double eye[3], forward[3], across[3], x[3], y[3];
    bool orthographic;
};

// History of an animation's previous pictures.
struct hg_denoise;
struct hg_denoise *hg_denoise_create(void) HG_MUST_CHECK; // NULL: no memory
void hg_denoise_destroy(struct hg_denoise *history);      // accepts NULL
// Begins the next picture; the last one that was run becomes the previous one. Running the same
// picture again, with more samples, replaces it.
void hg_denoise_next(struct hg_denoise *history);

// Saves the last picture for another process, which continues bit for bit after hg_denoise_next.
// HG_E_STATE: there is none; HG_E_NOMEM.
enum hg_status hg_denoise_save(
    const struct hg_denoise *history, struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;
// HG_E_INVAL: not a saved history; HG_E_NOMEM.
enum hg_status hg_denoise_load(const void *data, uint64_t size_bytes, struct hg_denoise **out,
    struct hg_error *err) HG_MUST_CHECK;

// Separable pixel filter: weights of the left neighbour, the pixel itself and the right one (above,
// ...); each three sum to 1, >= 0.
struct hg_denoise_taps {
    float x[3], y[3];
};

struct hg_denoise_input {
    uint32_t width, height; // px
    const float *sums;      // [HG_PATH_GUIDE_CHANNELS][height][width] over all samples
    const float *halves;    // the same over those with HG_PATH_IS_FIRST_HALF
    // What pixels show, where samples of others count for them as well: sums
    // [HG_PATH_SHOWN_CHANNELS][height][width]. Light without noise is of whole pixels; taps do the
    // rest of what the pixel filter does, by the samples of a tile: 1, 2, ..., taps_count or more.
    // NULL: pixels show their own samples.
    const float *shown;
    const struct hg_denoise_taps *taps;
    uint32_t taps_count;
    const uint32_t *samples;         // of each tile of HG_PATH_TILE_SIDE px, row by row
    uint32_t part_px; // side of parts of large pictures; 0 = default. Does not affect the result
    struct hg_denoise *history;      // NULL: by itself
    struct hg_denoise_camera camera; // with a history
    // [HG_PATH_MOVED_WORDS][height][width] sums: metres in scene space to where surfaces, and
    // images in them, were in the picture before, and a number of what the first sample met, 0 =
    // none. NULL: none is known to stand still, none to move.
    const float *moved;
};

// Means of light without noise: out [HG_DENOISE_LIGHT][height][width]. Besides it and the history
// (270 bytes a pixel) takes 0.4 GB at most, however large the picture is. HG_E_NOMEM.
enum hg_status hg_denoise_run(struct hg_jobs *jobs, const struct hg_denoise_input *input,
    float *out, struct hg_error *err) HG_MUST_CHECK;

#endif
