// history.h - what the denoiser keeps of the pictures before. Private to renderer/denoise/.
//
// Where the surface of a pixel was seen before (same place, same normal), the filtered light of
// then is averaged with that of now, over up to HG_DN_MOST_HISTORY pictures. How much it counts
// depends on whether both differ, in the mean of a patch, by more than what is left of the noise:
// light that has changed is not kept. Light that a smooth surface mirrors is looked up where its
// image was, which curved mirrors have nearer than plane ones. Sources: Schied et al. 2017,
// "Spatiotemporal Variance-Guided Filtering" (averaging by length); Zimmer et al. 2015, "Path-space
// Motion Estimation and Decomposition for Robust Animation Filtering" (motion of what is mirrored).
#ifndef HG_RENDERER_DENOISE_HISTORY_H
#define HG_RENDERER_DENOISE_HISTORY_H

#include "renderer/denoise/internal.h"

#define HG_DN_MOST_HISTORY 12.0f // pictures

// A picture is put in the place of the one that is being made. HG_E_NOMEM.
enum hg_status hg_dn_history_begin(
    struct hg_denoise *history, const struct hg_denoise_input *input) HG_MUST_CHECK;
// A part of it.
void hg_dn_history_keep(struct hg_denoise *history, const struct hg_dn_planes *p,
    const struct hg_dn_rect *rect, const struct hg_dn_clean *clean, struct hg_jobs *jobs);
// All of it is there: it gets its energy back, and is averaged with what was seen before. out: the
// light. HG_E_NOMEM.
enum hg_status hg_dn_history_blend(struct hg_denoise *history, struct hg_jobs *jobs,
    const struct hg_denoise_input *input, const struct hg_dn_energy *energy,
    float *out) HG_MUST_CHECK;

#endif
