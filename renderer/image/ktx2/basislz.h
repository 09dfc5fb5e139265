// basislz.h - slices of ETC1S blocks under BasisLZ, the smaller of the two codings of Basis
// Universal: a picture is indices into two codebooks that all its slices share.
// Floor 1, private to renderer/image. A slice belongs to one thread.
// Source: KTX File Format Specification 2.0, appendix "BasisLZ/ETC1S Bitstream Specification";
// Khronos Data Format Specification 1.4, "ETC1S".
#ifndef HG_RENDERER_IMAGE_KTX2_BASISLZ_H
#define HG_RENDERER_IMAGE_KTX2_BASISLZ_H

#include <stddef.h>

#include "renderer/image/image.h"

// Codebooks and code tables: the "global data" of a file behind its image descriptions.
struct hg_basislz;

struct hg_basislz_parts {
    uint16_t endpoint_count, selector_count;
    const uint8_t *endpoints, *selectors, *tables; // borrowed for the call
    size_t endpoint_bytes, selector_bytes, table_bytes;
};

// HG_E_FORMAT (`name` and the part), HG_E_NOMEM.
enum hg_status hg_basislz_create(const struct hg_basislz_parts *parts, const char *name,
    struct hg_basislz **out, struct hg_error *err) HG_MUST_CHECK;
void hg_basislz_destroy(struct hg_basislz *codebooks); // accepts NULL

// The blocks of one slice, row after row.
struct hg_basislz_slice;

// Borrows codebooks and data until close. HG_E_NOMEM.
enum hg_status hg_basislz_slice_open(const struct hg_basislz *codebooks,
    const struct hg_image_bytes *bytes, uint32_t blocks_x, struct hg_basislz_slice **out,
    struct hg_error *err) HG_MUST_CHECK;
void hg_basislz_slice_close(struct hg_basislz_slice *slice); // accepts NULL

// The next row of blocks: 4 rows of blocks_x * 4 texels, RGBA8, of which red, green and blue are
// written. HG_E_FORMAT: the slice is damaged.
enum hg_status hg_basislz_slice_row(
    struct hg_basislz_slice *slice, uint8_t *texels, struct hg_error *err) HG_MUST_CHECK;

#endif
