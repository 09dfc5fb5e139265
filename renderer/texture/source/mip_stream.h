// mip_stream.h - the mip chain of an image of any size, row by row.
// Floor 2 (texture). Pure: any thread, memory through base/alloc.h: about 64 bytes per column.
//
// All mips are filtered here: mips.h collects the rows in memory, page_pack.h cuts them into
// pages. Each texel is the mean of the texels above it by exact overlap (2 or 3 per axis), in
// linear light, from the unrounded values of the mip above; weighted colours are divided by their
// alpha. Normals become unit vectors; their alpha, 1 in mip 0, is 1 - sqrt(2 / kappa), where kappa
// is the concentration of the normals under the texel, less the variation that linear filtering
// brings back (a smooth bend keeps its gloss). The squared width of a GGX lobe grows by 2 / kappa,
// so that what is bumpy is rough far away. Sources: Banerjee et al. 2005, "Clustering on the Unit
// Hypersphere using von Mises-Fisher Distributions", eq. 4.4 (kappa from the mean); Toksvig 2005,
// "Mipmapping Normal Maps" (the idea).
#ifndef HG_RENDERER_TEXTURE_SOURCE_MIP_STREAM_H
#define HG_RENDERER_TEXTURE_SOURCE_MIP_STREAM_H

#include "renderer/image/image.h"

#define HG_MIPS_MAX     18
#define HG_MIPS_SIDE_PX 131072u

enum hg_mip_filter {
    HG_MIP_PLAIN,
    HG_MIP_WEIGHTED, // colours weighted by alpha
    HG_MIP_NORMAL,
};

struct hg_mip_stream_params {
    uint32_t width, height; // of mip 0, 1..HG_MIPS_SIDE_PX
    enum hg_pixel_format format;
    enum hg_mip_filter filter;
    bool srgb; // integer pixels hold sRGB-encoded colours (alpha is linear)
    bool half; // RGBA16F whatever the image has; else RGBA8 stays RGBA8
    // Gets every row of every mip, each mip's rows from the top: texels as the mip holds them.
    // Anything but HG_OK ends the stream with that status.
    enum hg_status (*row)(void *user, uint32_t mip, uint32_t y, const void *texels);
    void *user;
};

struct hg_mip_stream;

// HG_E_INVAL (sides), HG_E_NOMEM.
enum hg_status hg_mip_stream_create(
    const struct hg_mip_stream_params *params, struct hg_mip_stream **out) HG_MUST_CHECK;
void hg_mip_stream_destroy(struct hg_mip_stream *stream); // accepts NULL
// The next row of mip 0, in the image's format. After the last one all mips are complete.
enum hg_status hg_mip_stream_push(struct hg_mip_stream *stream, const void *pixels) HG_MUST_CHECK;

// Number of mips down to 1x1.
uint32_t hg_mips_count(uint32_t width, uint32_t height);
// Side of a mip, at least 1.
uint32_t hg_mips_side(uint32_t side, uint32_t mip);
// Bytes of a texel of the mips: 4 (RGBA8) or 8 (RGBA16F).
uint32_t hg_mips_texel_bytes(enum hg_pixel_format format, bool half);

// Pixels of any format as linear RGBA16F, as mip 0 holds them.
void hg_mips_to_half(
    enum hg_pixel_format format, bool srgb, const void *pixels, size_t count, uint16_t *dst);

// Table that scales 8-bit alpha so that of the texels counted in `mip` (by alpha) the same share
// passes `cutoff` as of those in `top`. Source: Castano 2010, "Computing Alpha Mipmaps".
void hg_mips_mask_table(
    const uint64_t top[256], const uint64_t mip[256], float cutoff, uint8_t table[256]);

#endif
