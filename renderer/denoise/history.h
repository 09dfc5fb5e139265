// history.h - temporal accumulation of the denoiser. Private to renderer/denoise/.
//
// Where the surface of a pixel was visible before (same position and normal), its previous filtered
// light is blended with the current one, over up to HG_DN_MOST_HISTORY pictures. The history is
// rejected where patch means differ by more than the residual noise: light that has changed is not
// kept. Specular light of smooth surfaces is reprojected by the motion of its virtual image, which
// curved mirrors have nearer than plane ones. Sources: Schied et al. 2017,
// "Spatiotemporal Variance-Guided Filtering" (averaging by length); Zimmer et al. 2015, "Path-space
// Motion Estimation and Decomposition for Robust Animation Filtering" (motion of what is mirrored).
#ifndef HG_RENDERER_DENOISE_HISTORY_H
#define HG_RENDERER_DENOISE_HISTORY_H

#include "renderer/denoise/internal.h"

#define HG_DN_MOST_HISTORY 12.0f // pictures

// Begins filtering of the current picture. HG_E_NOMEM.
enum hg_status hg_dn_history_begin(
    struct hg_denoise *history, const struct hg_denoise_input *input) HG_MUST_CHECK;
// A part of it.
void hg_dn_history_keep(struct hg_denoise *history, const struct hg_dn_planes *p,
    const struct hg_dn_rect *rect, const struct hg_dn_clean *clean, struct hg_jobs *jobs);
// After all parts: restores energy and blends with the history. out: the light. HG_E_NOMEM.
enum hg_status hg_dn_history_blend(struct hg_denoise *history, struct hg_jobs *jobs,
    const struct hg_denoise_input *input, const struct hg_dn_energy *energy,
    float *out) HG_MUST_CHECK;

#endif
