// ktx2.h - pictures in KTX 2.0 files that hold Basis Universal textures, as KHR_texture_basisu has
// them: ETC1S under BasisLZ, or UASTC as it is or under Zstandard. Only the first mip is read; the
// others are computed, as for every image.
// Floor 1, private to renderer/image. A reader may be used by several threads; they take turns.
// Source: KTX File Format Specification 2.0; Khronos Data Format Specification 1.4;
// KHR_texture_basisu.
#ifndef HG_RENDERER_IMAGE_KTX2_KTX2_H
#define HG_RENDERER_IMAGE_KTX2_KTX2_H

#include <stdio.h>

#include "renderer/image/reader.h"

struct hg_ktx2_reader;

// Of a file, which stays the caller's and must outlive the reader, or of bytes (file NULL), whose
// data are borrowed until close; bytes->name is used in messages. HG_E_FORMAT (malformed),
// HG_E_UNSUPPORTED (no Basis Universal; not one flat picture; turned, swizzled, premultiplied),
// HG_E_LIMIT (sides of more than max_side_px; ETC1S data of more than 1 GiB; much that is not
// texels), HG_E_NOMEM, HG_E_IO.
enum hg_status hg_ktx2_reader_open(FILE *file, const struct hg_image_bytes *bytes,
    uint32_t max_side_px, struct hg_ktx2_reader **out, struct hg_error *err) HG_MUST_CHECK;
void hg_ktx2_reader_close(struct hg_ktx2_reader *reader); // accepts NULL
const struct hg_image_reader_info *hg_ktx2_reader_info(const struct hg_ktx2_reader *reader);
// As hg_image_reader_rows and hg_image_reader_skip. HG_E_LIMIT: Zstandard data that want a window
// of more than the level holds, and than 8 MiB, or than 128 MiB. After an error the same rows may
// be asked for again.
enum hg_status hg_ktx2_reader_rows(struct hg_ktx2_reader *reader, enum hg_pixel_format format,
    uint32_t count, void *pixels, struct hg_error *err) HG_MUST_CHECK;
void hg_ktx2_reader_skip(struct hg_ktx2_reader *reader, uint32_t count);

#endif
