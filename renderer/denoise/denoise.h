// denoise.h - pictures of few samples without their noise.
// Floor 2. Thread: any, one at a time per object; work is spread over jobs. Pure functions of their
// input: the same bytes for any number of threads.
//
// Light that the first surface scattered and light that it mirrored or let through are filtered
// apart, each divided by the surface's albedo, so that textures are not in what is filtered. A
// pixel becomes a mean of pixels around it that show the same kind of surface, and whose light does
// not differ by more than its noise explains (non-local means of patches). Two halves of the
// samples tell how large the noise is; each half is weighted by what the other one looks like, so
// that a sample cannot vote for itself. With the noise the width of the filter goes to nothing.
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

// Where pixels look: from the eye through across + px x + py y, a metre deep; orthographic: from
// there along forward. Scene space; x, y and forward are at right angles.
struct hg_denoise_camera {
    double eye[3], forward[3], across[3], x[3], y[3];
    bool orthographic;
};

// Pictures before this one, for those of an animation.
struct hg_denoise;
struct hg_denoise *hg_denoise_create(void) HG_MUST_CHECK; // NULL: no memory
void hg_denoise_destroy(struct hg_denoise *history);      // accepts NULL
// Another picture begins; what was run last is the one before. A picture that is run again, with
// more samples, takes its own place.
void hg_denoise_next(struct hg_denoise *history);

// The picture that was run last, for another process: what comes after hg_denoise_next is the same
// to the bit. HG_E_STATE: there is none; HG_E_NOMEM.
enum hg_status hg_denoise_save(
    const struct hg_denoise *history, struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;
// HG_E_INVAL: not what was saved; HG_E_NOMEM.
enum hg_status hg_denoise_load(const void *data, uint64_t size_bytes, struct hg_denoise **out,
    struct hg_error *err) HG_MUST_CHECK;

// How much of the light of the pixel to the left, of its own, to the right (above, ...) a pixel
// shows; each three add up to 1, >= 0.
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
    uint32_t part_px;                // side of parts of large pictures; 0 = usual. Changes nothing
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
