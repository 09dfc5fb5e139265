// mips.h - the mip chain of one image.
// Floor 2 (texture). Pure: any thread, memory through base/alloc.h.
#ifndef HG_RENDERER_TEXTURE_SOURCE_MIPS_H
#define HG_RENDERER_TEXTURE_SOURCE_MIPS_H

#include "renderer/texture/source/mip_stream.h"
#include "renderer/texture/textures.h"

struct hg_mips {
    uint32_t width, height, count; // of mip 0; mips down to 1x1, sides rounded down
    uint32_t texel_bytes;          // 4: RGBA8, 8: RGBA16F
    uint64_t bytes;                // of all levels
    uint8_t *levels[HG_MIPS_MAX];  // rows from the top, tight; one allocation at levels[0]
};

struct hg_mips_params {
    bool srgb; // integer pixels hold sRGB-encoded colours (alpha is linear)
    bool half; // linear RGBA16F whatever the image has
    enum hg_texture_use use;
    float cutoff; // for HG_TEXTURE_MASK
};

// How the mips of a use are filtered.
enum hg_mip_filter hg_mips_filter(enum hg_texture_use use);

// Filters with the exact overlap of each texel with the texels above it (2 or 3 per axis), in
// linear light, from unrounded values of the mip above.
// RGBA8 gives RGBA8 in the same transfer unless `half`; RGBA16 and RGBA32F give linear RGBA16F,
// infinities and values above 65504 are cut, NaN becomes 0.
// HG_E_INVAL (empty, or a side above 131072), HG_E_NOMEM. *out is zeroed on failure.
// Sources: area-average filter for sizes that are no powers of two: Guthe and Heckbert 2005,
// "Non-Power-of-Two Mipmapping"; alpha coverage: Castano 2010, "Computing Alpha Mipmaps".
enum hg_status hg_mips_build(const struct hg_image *image, const struct hg_mips_params *params,
    struct hg_mips *out) HG_MUST_CHECK;
void hg_mips_finish(struct hg_mips *mips); // accepts a zeroed chain
// How many texels of an RGBA8 mip have each alpha.
void hg_mips_count_alpha(const struct hg_mips *mips, uint32_t mip, uint64_t histogram[256]);

#endif
