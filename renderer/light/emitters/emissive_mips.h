// emissive_mips.h - mean luminance of an emissive texture over a region.
// Floor 2 (light). Private to the room. Thread: the render thread; lookups from any.
//
// A coarse mip (sides of at most HG_EMISSIVE_MIPS_SIDE texels) of the rendered pages, as luminance,
// with coarser levels computed from it.
#ifndef HG_RENDERER_LIGHT_EMITTERS_EMISSIVE_MIPS_H
#define HG_RENDERER_LIGHT_EMITTERS_EMISSIVE_MIPS_H

#include "renderer/texture/source/page_source.h"

#define HG_EMISSIVE_MIPS_SIDE   256
#define HG_EMISSIVE_MIPS_LEVELS 9

struct hg_emissive_mips {
    uint32_t width, height, levels;
    float *texels[HG_EMISSIVE_MIPS_LEVELS]; // halved each time, down to 1 x 1
    enum hg_wrap wrap_s, wrap_t;
};

// White where the image cannot be read. Waits for it to be decoded. HG_E_NOMEM.
enum hg_status hg_emissive_mips_make(struct hg_page_sources *sources,
    const struct hg_texture *texture, enum hg_texture_use use, uint32_t cutoff,
    struct hg_emissive_mips *out) HG_MUST_CHECK;
void hg_emissive_mips_finish(struct hg_emissive_mips *glow); // accepts a zeroed one

// Approximate mean over a box of texture coordinates; 0 only where the mip is 0 in and around it.
// Boxes that are not finite: mean of the whole texture.
float hg_emissive_mips_mean(
    const struct hg_emissive_mips *glow, const float min[2], const float max[2]);

#endif
