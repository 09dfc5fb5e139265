// rows.h - image files of one part whose rows are decoded in order, in this process and without
// OpenImageIO (png.h, jpeg_read.c): what scenes and pictures are made of.
// Floor 1, private to renderer/image. One thread at a time per input.
#ifndef HG_RENDERER_IMAGE_ROWS_H
#define HG_RENDERER_IMAGE_ROWS_H

#include "renderer/image/oiio.h"

struct hg_rows_input { // the first member of a format's own
    const struct hg_rows_functions *functions;
    struct hg_oiio_header header;
    FILE *file;                  // borrowed; NULL: bytes
    struct hg_image_bytes bytes; //
    char *name;                  // owned; for messages
};

// One set for a format; they check nothing that the functions below check.
struct hg_rows_functions {
    size_t size_bytes; // of the format's struct, which is zeroed but for the members above
    // Fills in the header.
    enum hg_status (*begin)(struct hg_rows_input *input, struct hg_error *err);
    enum hg_status (*read_rows)(struct hg_rows_input *input, uint32_t y, uint32_t count,
        const struct hg_oiio_target *target, struct hg_error *err);
    void (*read_text)(
        const struct hg_rows_input *input, const char *key, char *text, size_t size_bytes);
    void (*close)(struct hg_rows_input *input); // frees what the format took
};

// What hg_png_open and hg_jpeg_open do.
enum hg_status hg_rows_open(const struct hg_rows_functions *functions, FILE *file,
    const struct hg_image_bytes *bytes, bool large, struct hg_rows_input **out,
    struct hg_error *err) HG_MUST_CHECK;

// As hg_oiio_open. PNG: palettes, few bits and transparent colours are expanded; 16 bits stay.
// HG_E_FORMAT (with the library's reason), HG_E_LIMIT (2 GiB of pixels, unless large; scans of a
// JPEG), HG_E_NOMEM.
enum hg_status hg_png_open(FILE *file, const struct hg_image_bytes *bytes, bool large,
    struct hg_rows_input **out, struct hg_error *err) HG_MUST_CHECK;
// The same; HG_E_UNSUPPORTED for colours that only OpenImageIO converts (CMYK).
enum hg_status hg_jpeg_open(FILE *file, const struct hg_image_bytes *bytes, bool large,
    struct hg_rows_input **out, struct hg_error *err) HG_MUST_CHECK;

void hg_rows_close(struct hg_rows_input *input); // accepts NULL
// The value of a text chunk before the pixels of a PNG, cut to size_bytes; "" when there is none.
void hg_rows_read_text(
    const struct hg_rows_input *input, const char *key, char *text, size_t size_bytes);
// `count` rows from row y on: NATIVE, U8, U16 or F32. Rows are decoded in order, going back
// starts over; an interlaced PNG is decoded whole and kept (2 GiB at most: HG_E_LIMIT).
// HG_E_INVAL, HG_E_FORMAT, HG_E_NOMEM. After an error every call fails.
enum hg_status hg_rows_read(struct hg_rows_input *input, uint32_t y, uint32_t count,
    const struct hg_oiio_target *target, struct hg_error *err) HG_MUST_CHECK;

// For the formats' own files: pixels are 2 GiB at most.
enum hg_status hg_rows_check_size(
    const struct hg_oiio_header *header, const char *name, struct hg_error *err) HG_MUST_CHECK;
// A row as it is stored to the first channels of the target; `dst` holds width pixels of it.
void hg_rows_convert(const struct hg_oiio_header *header, const void *row,
    const struct hg_oiio_target *target, void *dst);
size_t hg_rows_pixel_bytes(
    const struct hg_oiio_header *header, const struct hg_oiio_target *target);

#endif
