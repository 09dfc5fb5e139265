// exr.h - OpenEXR files of several named parts: a picture and the planes that belong to it.
// Floor 1. Thread-safe; no state.
//
// Each part is compressed on its own (zip, 16 rows a chunk) and then joined to one file in memory.
// Channels carry the part's name too ("depth.Z"), as readers that do not look at parts expect;
// those of the first part may be plain R, G, B, A. All parts have the size of the picture. Source:
// "OpenEXR File Layout" and "Multi-Part" of the OpenEXR documentation.
#ifndef HG_RENDERER_IMAGE_EXR_H
#define HG_RENDERER_IMAGE_EXR_H

#include "renderer/image/image.h"

enum { HG_EXR_MAX_PARTS = 64, HG_EXR_MAX_CHANNELS = 4 };

enum hg_exr_type {
    HG_EXR_HALF,  // from f32; beyond +-65504 it is 65504, infinity too
    HG_EXR_FLOAT, // from f32
    HG_EXR_UINT,  // from u32
};

struct hg_exr_part {
    const char *name;                          // "depth"; unique in the file, <= 31 bytes
    const char *channels[HG_EXR_MAX_CHANNELS]; // [channel_count] "depth.Z"
    uint32_t channel_count;                    // 1..4
    uint32_t stride;                           // values from pixel to pixel, >= channel_count
    enum hg_exr_type type;                     //
    const void *pixels; // of pixel i from i * stride on; f32 or u32; borrowed
    size_t size_bytes;  // of pixels; must fit
    const struct hg_image_attribute *attributes; // [attribute_count], borrowed
    uint32_t attribute_count;
};

// The data window of all parts, px: [0, width) x [0, height) moved by x and y. The display window
// begins at 0, 0; full_width or full_height 0: it is the data window.
struct hg_exr_window {
    uint32_t width, height; // 1..65536
    uint32_t x, y;
    uint32_t full_width, full_height;
};

// Appends the file. The same parts give the same bytes. HG_E_INVAL (shapes above), HG_E_LIMIT (more
// parts, or more than limit_bytes of pixels in them; checked before memory is taken), HG_E_NOMEM,
// HG_E_IO.
enum hg_status hg_exr_encode(const struct hg_exr_window *window, const struct hg_exr_part *parts,
    uint32_t part_count, uint64_t limit_bytes, struct hg_writer *out,
    struct hg_error *err) HG_MUST_CHECK;

struct hg_exr_piece {
    const char *name;
    const uint8_t *data; // an OpenEXR file of one scanline part
    size_t size;
};

#endif
