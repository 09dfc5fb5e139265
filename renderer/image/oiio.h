// oiio.h - OpenImageIO, callable from C: images are opened, decoded and encoded here; what is read,
// checked and converted is decided in decode.c, row_reader.c, encode.c and exr.c.
// Floor 1, private to renderer/image. No exception leaves oiio.cpp. The library comes with a module
// that is loaded when it is first needed (oiio_module.h): HG_E_UNSUPPORTED also when it cannot be.
#ifndef HG_RENDERER_IMAGE_OIIO_H
#define HG_RENDERER_IMAGE_OIIO_H

#include <stdio.h>

#include "renderer/image/image.h"

enum { HG_OIIO_MAX_CHANNELS = 256 };

enum hg_oiio_type {
    HG_OIIO_NATIVE, // as the file stores it
    HG_OIIO_U8,
    HG_OIIO_U16,
    HG_OIIO_U32,
    HG_OIIO_HALF,
    HG_OIIO_F32,
};

// What a file says about one of its images.
struct hg_oiio_header {
    int width, height, tile_width, tile_height; // px; tiles 0: rows
    int channels, alpha_channel;                // alpha_channel -1: none
    bool is_float, is_16bit;
    bool straight_alpha;                          // false: colour is stored times alpha
    uint64_t pixel_bytes, row_bytes, image_bytes; // decoded as HG_OIIO_NATIVE
};

// Decoded pixels, tightly packed: the first `channels` channels of the image.
struct hg_oiio_target {
    enum hg_oiio_type type;
    int channels;
    void *pixels; // large enough
};

// An image of one part to be encoded to a file in memory. `name` is used in messages.
struct hg_oiio_encode {
    const char *format, *name;                   // "openexr" here, "png" in png.h
    uint32_t width, height, channels;            //
    uint32_t x, y, full_width, full_height;      // data window in the display window; 0: the same
    const char *const *channel_names;            // [channels]; NULL: R, G, B, A
    enum hg_oiio_type type;                      // in the file
    const struct hg_image_attribute *attributes; // [attribute_count]
    size_t attribute_count;
    enum hg_oiio_type pixel_type; // of `pixels`
    size_t pixel_stride_bytes;    //
    const void *pixels;
};

#ifdef __cplusplus
extern "C" {
#endif

// A file opened for decoding; one thread at a time. Errors name the file.
struct hg_oiio_input;

// `file` stays the caller's and must outlive the input; NULL: bytes->data does. `format` is
// OpenImageIO's name of the reader. large: without the limit for images that are decoded whole.
// HG_E_UNSUPPORTED, HG_E_FORMAT (also: no pixels, or a volume), HG_E_NOMEM.
enum hg_status hg_oiio_open(FILE *file, const struct hg_image_bytes *bytes, const char *format,
    bool large, struct hg_oiio_input **out, struct hg_error *err) HG_MUST_CHECK;
void hg_oiio_close(struct hg_oiio_input *input); // accepts NULL
const char *hg_oiio_name(const struct hg_oiio_input *input);
// Of the first part.
const struct hg_oiio_header *hg_oiio_get_header(const struct hg_oiio_input *input);
// A part of an OpenEXR file or a page of a TIFF file. HG_E_NOTFOUND: there are fewer.
enum hg_status hg_oiio_part_header(struct hg_oiio_input *input, int part,
    struct hg_oiio_header *out, struct hg_error *err) HG_MUST_CHECK;
// False when the first part has no such mip.
bool hg_oiio_mip_size(struct hg_oiio_input *input, uint32_t mip, uint32_t size_px[2]);
// A text attribute of the first part, cut to size_bytes; "" when there is none. HG_E_NOMEM.
enum hg_status hg_oiio_read_text(struct hg_oiio_input *input, const char *key, char *text,
    size_t size_bytes, struct hg_error *err) HG_MUST_CHECK;

// Each: HG_E_FORMAT (with the decoder's reason), HG_E_NOMEM.
enum hg_status hg_oiio_read_image(struct hg_oiio_input *input, int part,
    const struct hg_oiio_target *target, struct hg_error *err) HG_MUST_CHECK;
// `count` rows of mip 0 from row y on.
enum hg_status hg_oiio_read_rows(struct hg_oiio_input *input, int part, uint32_t y, uint32_t count,
    const struct hg_oiio_target *target, struct hg_error *err) HG_MUST_CHECK;
// Whole tiles of the first part: the area begins at a tile and ends with one, or with the mip.
enum hg_status hg_oiio_read_tiles(struct hg_oiio_input *input, const struct hg_image_rect *area,
    const struct hg_oiio_target *target, struct hg_error *err) HG_MUST_CHECK;

// Appends the file's bytes to `out` (which may fail for want of room: the caller checks it).
// EXR: zip, Rec.709 chromaticities, no date. HG_E_UNSUPPORTED, HG_E_IO.
enum hg_status hg_oiio_encode_image(
    const struct hg_oiio_encode *image, struct hg_writer *out, struct hg_error *err) HG_MUST_CHECK;

#ifdef __cplusplus
}
#endif

#endif
