// history_state.h - the history of the denoiser: planes of the newest finished pictures. Private to
// renderer/denoise/.
#ifndef HG_RENDERER_DENOISE_HISTORY_STATE_H
#define HG_RENDERER_DENOISE_HISTORY_STATE_H

#include "renderer/denoise/internal.h"

enum {
    HG_DN_KEPT = HG_DN_KINDS * 5 + HG_DN_LOBES * 3 + 7, // planes of a finished picture
};

// A finished picture: [height][width] of each plane.
struct hg_dn_past {
    uint32_t width, height; // 0 = none
    struct hg_denoise_camera camera;
    float *rgb[HG_DN_KINDS][3], *variance[HG_DN_KINDS], *length[HG_DN_KINDS];
    float *albedo[HG_DN_LOBES][3], *normal[3], *disparity, *seen, *id;
    float *image; // disparity of the virtual image in smooth surfaces; 0 = rough
    float *memory;
};

struct hg_denoise {
    struct hg_dn_past before, now; // now: the newest, of the picture that is being made
    // Of now, until it is blended: as it was sampled; of albedos; of the disparity, relative.
    float *own_luma[HG_DN_KINDS], *own_variance[HG_DN_KINDS], *tone_var[HG_DN_LOBES];
    float *slope[HG_DN_LOBES],
        *nearer; // nearer: how often the image is as near as in a plane mirror
    float *own;
};

// Planes of zeros, in place of what `past` held. HG_E_NOMEM.
enum hg_status hg_dn_past_init(
    struct hg_dn_past *past, uint32_t width, uint32_t height) HG_MUST_CHECK;
void hg_dn_past_finish(struct hg_dn_past *past);

#endif
