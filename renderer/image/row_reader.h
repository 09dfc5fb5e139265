// row_reader.h - images that OpenImageIO decodes piece by piece: rows in order, or rectangles of
// tiled files. See reader.h, which has the same calls for all kinds of files.
// Floor 1, private to renderer/image. Several threads may use a reader; they take turns.
#ifndef HG_RENDERER_IMAGE_ROW_READER_H
#define HG_RENDERER_IMAGE_ROW_READER_H

#include <stdio.h>

#include "renderer/image/reader.h"

struct hg_row_reader;

// `file` stays the caller's and must outlive the reader; NULL: bytes->data does. bytes->name is
// used in messages. `format` is OpenImageIO's name of the reader.
enum hg_status hg_row_reader_open(FILE *file, const struct hg_image_bytes *bytes,
    const char *format, uint32_t max_side_px, struct hg_row_reader **out,
    struct hg_error *err) HG_MUST_CHECK;
void hg_row_reader_close(struct hg_row_reader *reader); // accepts NULL
const struct hg_image_reader_info *hg_row_reader_info(const struct hg_row_reader *reader);
enum hg_status hg_row_reader_rows(struct hg_row_reader *reader, enum hg_pixel_format format,
    uint32_t count, void *pixels, struct hg_error *err) HG_MUST_CHECK;
void hg_row_reader_skip(struct hg_row_reader *reader, uint32_t count);
enum hg_status hg_row_reader_rect(struct hg_row_reader *reader, const struct hg_image_rect *rect,
    enum hg_pixel_format format, void *pixels, uint64_t *bytes, struct hg_error *err) HG_MUST_CHECK;

#endif
