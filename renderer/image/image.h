// image.h - pixels in memory: reading and writing files, most of them by OpenImageIO; conversions.
// Floor 1. Thread-safe; each object belongs to one thread. Only oiio.cpp is C++.
#ifndef HG_RENDERER_IMAGE_IMAGE_H
#define HG_RENDERER_IMAGE_IMAGE_H

#include "base/bytes.h"
#include "base/status.h"

enum hg_pixel_format {
    HG_PIXEL_RGBA8,   // 4 x u8, straight alpha; transfer as the file has it
    HG_PIXEL_RGBA16,  // 4 x u16, straight alpha
    HG_PIXEL_RGBA32F, // 4 x f32, linear when the file is (exr, hdr), else as stored scaled to 0..1
};

struct hg_image {
    uint32_t width, height;      // px
    enum hg_pixel_format format; //
    bool has_alpha;              // false: the file had none and alpha is 1
    size_t size_bytes;           // width * height * bytes per pixel; rows from the top, no padding
    void *pixels;                // owned; hg_free
};

// An image file in memory. `name` is used in messages and, by its extension, as a hint; content
// decides.
struct hg_image_bytes {
    const void *data; // borrowed
    size_t size;
    const char *name;
};

// A rectangle of a mip, in texels of that mip, whose sides are max(1, side >> mip).
struct hg_image_rect {
    uint32_t mip, at[2], size[2];
};

// An image that is made on demand, for textures that no file could hold.
struct hg_image_tiles {
    uint32_t width, height;      // px
    enum hg_pixel_format format; // RGBA8 or RGBA32F
    uint8_t id[32];              // hash of what is made: equal ids give equal pixels
    // Fills a rectangle that lies inside its mip, rows tight. Called by many threads at once.
    // False: it cannot be made.
    bool (*make)(void *user, const struct hg_image_rect *rect, void *pixels);
    void *user;
};

struct hg_image_limits {
    uint32_t max_side_px; // default 32768
    uint64_t max_pixels;  // default 2^28
    uint64_t max_bytes;   // of decoded pixels; default 2^31
};

// What a file says about itself, without decoding pixels.
struct hg_image_info {
    uint32_t width, height, channels; // channels as stored
    bool is_float, is_16bit;
    char file_format[16]; // "png", "jpeg", "openexr", "ktx2", ...
};

// Bytes per pixel of a format.
size_t hg_pixel_bytes(enum hg_pixel_format format);

// All four: `limits` may be NULL (defaults). HG_E_NOTFOUND, HG_E_FORMAT (malformed or unknown),
// HG_E_UNSUPPORTED (a kind of its format that is not read), HG_E_LIMIT (checked before memory is
// taken), HG_E_NOMEM, HG_E_IO; err names file and reason. Grey becomes RGB; missing alpha becomes
// 1; CMYK and palettes are converted. Orientation metadata is ignored, as glTF demands. *out is
// zeroed on failure.
enum hg_status hg_image_probe_file(
    const char *path, struct hg_image_info *out, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_image_read_file(const char *path, enum hg_pixel_format format,
    const struct hg_image_limits *limits, struct hg_image *out, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_image_probe_memory(const struct hg_image_bytes *file, struct hg_image_info *out,
    struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_image_read_memory(const struct hg_image_bytes *file, enum hg_pixel_format format,
    const struct hg_image_limits *limits, struct hg_image *out, struct hg_error *err) HG_MUST_CHECK;

// What hg_image_examine found in a complete file.
struct hg_image_summary {
    uint32_t width, height; // of the first part
    uint32_t parts;
    char file_format[16];
    char value[160]; // of the attribute asked for; empty when there is none
};

// Decodes every part of a file and reads the text attribute `key` that hg_image_encode has written.
// HG_E_FORMAT when anything of it is missing or damaged; HG_E_LIMIT.
enum hg_status hg_image_examine(const struct hg_image_bytes *file, const char *key,
    const struct hg_image_limits *limits, struct hg_image_summary *out,
    struct hg_error *err) HG_MUST_CHECK;

// Zeroed pixels. HG_E_LIMIT, HG_E_NOMEM.
enum hg_status hg_image_create(uint32_t width, uint32_t height, enum hg_pixel_format format,
    const struct hg_image_limits *limits, struct hg_image *out) HG_MUST_CHECK;
// Accepts a zeroed image.
void hg_image_finish(struct hg_image *image);

// Files are made in memory (the worker writes no output files).
enum hg_image_file {
    HG_IMAGE_PNG8,      // from RGBA8: sRGB-tagged
    HG_IMAGE_PNG16,     // from RGBA16 or RGBA32F display values 0..1: sRGB-tagged
    HG_IMAGE_JPEG,      // from RGBA8, alpha dropped; 4:4:4 at quality >= 90, else 4:2:0
    HG_IMAGE_EXR_HALF,  // from RGBA32F, linear Rec.709 (chromaticities attribute), zip;
                        // beyond +-65504 it is 65504
    HG_IMAGE_EXR_FLOAT, // the same, without an end
};

struct hg_image_attribute {
    const char *name; // "heliograph:samples"
    enum {
        HG_ATTR_STRING,
        HG_ATTR_INT,
        HG_ATTR_COUNT,
        HG_ATTR_FLOAT,
        HG_ATTR_MAT4,
        HG_ATTR_RATIO
    } type;
    const char *string;
    int integer;    // of a ratio: its numerator
    uint32_t count; // an EXR file's integers have a sign: a double there. Or a ratio's denominator
    const float *floats; // 1 or 16
};

struct hg_image_encode {
    enum hg_image_file file;
    int quality;                                 // JPEG 1..100, default 90
    bool opaque;                                 // drop alpha: RGB instead of RGBA
    const struct hg_image_attribute *attributes; // [attribute_count]; EXR, PNG and JPEG text
    size_t attribute_count;
    bool full_chroma; // JPEG: 4:4:4 at any quality
};

// Appends the file's bytes to `out`. The same image and parameters give the same bytes.
// HG_E_INVAL (wrong pixel format), HG_E_NOMEM, HG_E_IO.
enum hg_status hg_image_encode(const struct hg_image *image, const struct hg_image_encode *params,
    struct hg_writer *out, struct hg_error *err) HG_MUST_CHECK;

// Most formats are read and written by OpenImageIO, which depends on some 250 libraries. It comes
// with a module that is loaded when it is first needed; a process that gives up the right to open
// files loads it before, or keeps the right to read this file and the system's libraries.
// HG_E_UNSUPPORTED: the module cannot be loaded, and so says every call that needs it.
enum hg_status hg_image_load_module(struct hg_error *err) HG_MUST_CHECK;
// Path of the module's file, searched for in the first call; the same text in all.
const char *hg_image_module_path(void);

#endif
