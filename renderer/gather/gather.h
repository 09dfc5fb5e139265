// gather.h - gathered light of one picture: what the rays of its pixels brought, filtered.
// Floor 2. Pure but for the jobs.
//
// Each pixel has few samples of two kinds of light: what scatters, over the albedo, and what the
// specular lobe reflects, over its albedo. Both are smooth where surfaces are, so neighbours are
// averaged by an edge-avoiding a-trous filter (Dammertz et al. 2010) that knows the variance of
// each pixel (Schied et al. 2017, "Spatiotemporal Variance-Guided Filtering").
#ifndef HG_RENDERER_GATHER_GATHER_H
#define HG_RENDERER_GATHER_GATHER_H

#include <stdbool.h>

#include "base/status.h"
#include "base/jobs.h"

struct hg_gather_input {
    uint32_t width, height;
    uint32_t samples, first_half; // of each pixel, >= 1; and those of them in `halves`
    // [HG_PATH_GUIDE_CHANNELS][height][width] sums over samples, and [HG_PATH_GUIDE_LIGHT][..][..]
    // over the first half of them (shaders/shared/path.h).
    const float *sums, *halves;
    // [lamp_count][..][..] HG_PATH_PLANE_LAMPS; NULL: there are no such lamps.
    const float *lamps;
    uint32_t lamp_count; // at most HG_GATHERED_LAMPS
};

struct hg_gather; // 92 bytes per pixel, and 57 more while it is filtered; with lamps 12 and
                  // 12 more, and 4 for each

// Creates a film of the input, which it copies. HG_E_NOMEM.
enum hg_status hg_gather_load(struct hg_jobs *jobs, const struct hg_gather_input *input,
    struct hg_gather **out, struct hg_error *err) HG_MUST_CHECK;
// words: [hg_gather_rows(height, lamps)][width][4] as the device reads them
// (shaders/shared/gi.h). The same bytes for any number of threads. Once. HG_E_NOMEM.
enum hg_status hg_gather_filter(struct hg_gather *gather, struct hg_jobs *jobs, uint32_t *words,
    struct hg_error *err) HG_MUST_CHECK;

// Light by way of glass: that of pixels which show frosted glass is filtered as above, what clear
// glass shows stays as it is, to the byte.
//
//   input   as above, of paths by way of glass, of a part of the picture; lamps are not used
//   height  px, of the picture
//   colors  [height][width][4] in and out: mean radiance that `input` is of, and coverage
//
// The same bytes for any number of threads. HG_E_NOMEM.
enum hg_status hg_gather_glass(struct hg_jobs *jobs, const struct hg_gather_input *input,
    uint32_t height, float *colors, struct hg_error *err) HG_MUST_CHECK;

// Samples that the picture is to have, at most `samples`, by blocks of pixels
// (shaders/shared/sample_blocks.h): fewer where surfaces are alike all over, down to
// HG_GATHER_LEAST_SAMPLES. counts: [rows][columns of blocks].
#define HG_GATHER_LEAST_SAMPLES 8u
void hg_gather_samples(
    struct hg_jobs *jobs, const struct hg_gather_input *input, uint32_t samples, uint32_t *counts);
// Rows of the image of words: those of the picture, and behind them those of lamps.
uint32_t hg_gather_rows(uint32_t height, bool lamps);
void hg_gather_free(struct hg_gather *gather); // accepts NULL

#endif
