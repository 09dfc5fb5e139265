// gather.h - gathered light of one picture: what the rays of its pixels brought, filtered.
// Floor 2 (gi). Pure but for the jobs.
//
// Each pixel has few samples of two kinds of light: what scatters, over the albedo, and what the
// specular lobe reflects, over its albedo. Both are smooth where surfaces are, so neighbours are
// averaged by an edge-avoiding a-trous filter (Dammertz et al. 2010) that knows the variance of
// each pixel (Schied et al. 2017, "Spatiotemporal Variance-Guided Filtering").
#ifndef HG_RENDERER_GI_GATHER_H
#define HG_RENDERER_GI_GATHER_H

#include "base/status.h"
#include "base/jobs.h"

struct hg_gi_gather_input {
    uint32_t width, height;
    uint32_t samples, first_half; // of each pixel, >= 1; and those of them in `halves`
    // [HG_PATH_GUIDE_CHANNELS][height][width] sums over samples, and over the first half of them
    // (shaders/shared/path.h).
    const float *sums, *halves;
};

// out: [height][width][4] words as the device reads them (shaders/shared/gi.h). The same bytes for
// any number of threads. HG_E_NOMEM. Takes 140 bytes per pixel meanwhile.
enum hg_status hg_gi_gather_filter(struct hg_jobs *jobs, const struct hg_gi_gather_input *input,
    uint32_t *out, struct hg_error *err) HG_MUST_CHECK;

#endif
