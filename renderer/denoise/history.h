// history.h - what the denoiser keeps of the pictures before. Private to renderer/denoise/.
//
// Where the surface of a pixel was seen before (same place, same normal), the filtered light of
// then is averaged with that of now, over up to HG_DN_MOST_HISTORY pictures. How much it counts
// depends on whether both differ, in the mean of a patch, by more than what is left of the noise:
// light that has changed is not kept. Source of the averaging by length: Schied et al. 2017,
// "Spatiotemporal Variance-Guided Filtering".
#ifndef HG_RENDERER_DENOISE_HISTORY_H
#define HG_RENDERER_DENOISE_HISTORY_H

#include "renderer/denoise/internal.h"

#define HG_DN_MOST_HISTORY 12.0f // pictures

// Light without noise, divided by its albedo: that of a picture, in its planes' layout.
struct hg_dn_clean {
    float *rgb[HG_DN_KINDS][3];
    float *luma[HG_DN_KINDS], *variance[HG_DN_KINDS]; // of what is left of the noise, in the luma
};

// Averages `clean` with what was seen before, in place, and keeps the result for the next picture.
// Scratch planes of p are overwritten. HG_E_NOMEM.
enum hg_status hg_dn_history_blend(struct hg_denoise *history, struct hg_dn_planes *p,
    const struct hg_denoise_input *input, struct hg_dn_clean *clean, struct hg_jobs *jobs);

#endif
