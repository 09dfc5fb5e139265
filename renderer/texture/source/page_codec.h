// page_codec.h - rectangles of texels, compressed without loss.
// Floor 2 (texture). Each codec belongs to one thread at a time.
//
// RGBA8: rows are predicted from their neighbours as in PNG (one predictor per row: none, left,
// above, mean, median edge detector), red and blue optionally by green first; constant channels
// cost a byte; what is left goes through Zstandard, channel by channel. RGBA16F: the same on 16-bit
// integers, high and low bytes apart.
// Sources: Weinberger, Seroussi and Sapiro 2000, "The LOCO-I Lossless Image Compression Algorithm"
// (median edge detector); PNG specification, chapter 9 (choice of the row filter); RFC 8878.
#ifndef HG_RENDERER_TEXTURE_SOURCE_PAGE_CODEC_H
#define HG_RENDERER_TEXTURE_SOURCE_PAGE_CODEC_H

#include "base/bytes.h"
#include "base/status.h"

#define HG_PAGE_CODEC_SIDE 132 // largest rectangle

struct hg_page_codec;

struct hg_page_codec *hg_page_codec_create(void) HG_MUST_CHECK; // NULL: no memory
void hg_page_codec_destroy(struct hg_page_codec *codec);        // accepts NULL

// A rectangle of texels in memory.
struct hg_texel_layout {
    uint32_t width, height; // texels, 1..HG_PAGE_CODEC_SIDE
    uint32_t texel_bytes;   // 4: RGBA8, 8: RGBA16F
    size_t pitch_bytes;     // from row to row
};

// Appends to `out`. level: of Zstandard, 1..19. HG_E_NOMEM.
enum hg_status hg_page_encode(struct hg_page_codec *codec, const void *texels,
    const struct hg_texel_layout *layout, int level, struct hg_writer *out) HG_MUST_CHECK;
// The inverse; `data` must be exactly what encode made for these sides. HG_E_FORMAT.
enum hg_status hg_page_decode(struct hg_page_codec *codec, const void *data, size_t size,
    const struct hg_texel_layout *layout, void *texels) HG_MUST_CHECK;

#endif
