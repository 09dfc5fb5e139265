#include "renderer/image/check.h"

#include <stdio.h>
#include <string.h>

#include "base/bytes.h"

static enum hg_status fail_at(
    struct hg_error *err, const char *name, size_t offset, const char *reason)
{
    char where[32];
    snprintf(where, sizeof where, "byte %zu", offset);
    return hg_error_set(err, HG_E_FORMAT, name, where, "%s", reason);
}

static uint32_t read_be32(const uint8_t *p)
{
    return (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | p[3];
}

enum hg_status hg_check_png(
    const uint8_t *data, size_t size, const char *name, struct hg_error *err)
{
    for (size_t at = 8; at < size;) {
        if (size - at < 12)
            return fail_at(err, name, at, "the PNG ends inside a chunk");
        uint32_t length = read_be32(data + at);
        if (length > size - at - 12)
            return fail_at(err, name, at, "a PNG chunk runs past the end of the file");
        if (memcmp(data + at + 4, "IEND", 4) == 0)
            return HG_OK;
        at += 12 + (size_t)length;
    }
    return fail_at(err, name, size, "the PNG has no end chunk");
}

// Reads a zero-terminated name of at most 255 bytes; false when there is none.
static bool read_name(struct hg_reader *r, size_t *length)
{
    *length = 0;
    for (uint8_t c = hg_read_u8(r); c && !r->failed && *length < 256; c = hg_read_u8(r))
        ++*length;
    return !r->failed && *length < 256;
}

// What OpenEXR takes memory for when it opens a file: whole tiles of every channel, also larger
// ones than the picture, and rows of the full width.
enum { max_tile_px = 1 << 24, max_width_px = 1 << 17 };

static bool tile_size_ok(const uint8_t *value, size_t size)
{
    struct hg_reader r = hg_reader_make(value, size);
    uint64_t width = hg_read_u32(&r), height = hg_read_u32(&r);
    return !r.failed && width <= max_tile_px && width * height <= max_tile_px;
}

static bool data_window_ok(const uint8_t *value, size_t size)
{
    struct hg_reader r = hg_reader_make(value, size);
    int64_t left = (int32_t)hg_read_u32(&r);
    hg_read_u32(&r);
    int64_t right = (int32_t)hg_read_u32(&r);
    return !r.failed && right - left < max_width_px;
}

static bool is_name(const uint8_t *start, size_t length, const char *name)
{
    return length == strlen(name) && memcmp(start, name, length) == 0;
}

// Reads the attributes of one header up to its empty name; *count is how many there were. NULL, or
// what is wrong.
static const char *read_exr_header(struct hg_reader *r, uint32_t *count)
{
    static const char *const outside = "an attribute of the EXR runs past the end";
    for (*count = 0;; ++*count) {
        size_t name, type;
        const uint8_t *start = r->data + r->pos;
        if (!read_name(r, &name))
            return outside;
        if (name == 0)
            return NULL;
        if (!read_name(r, &type))
            return outside;
        uint32_t size = hg_read_u32(r);
        const uint8_t *value = hg_read_bytes(r, size);
        if (!value || r->failed)
            return outside;
        if (is_name(start, name, "tiles") && !tile_size_ok(value, size))
            return "the tiles of the EXR are too large";
        if (is_name(start, name, "dataWindow") && !data_window_ok(value, size))
            return "the rows of the EXR are too long";
    }
}

// The attributes of all headers of an EXR lie inside the file. OpenEXR 3.1 takes memory for the
// length an attribute claims (up to 2 GiB) before it looks whether there are as many bytes, and for
// whole tiles and rows, which may be no larger than 2^24 and 2^17 px here.
// HG_E_FORMAT with the byte offset. The first 4 bytes are known to be EXR's.
static enum hg_status check_exr(
    const uint8_t *data, size_t size, const char *name, struct hg_error *err)
{
    enum { multi_part = 0x1000 };
    struct hg_reader r = hg_reader_make(data, size);
    hg_read_u32(&r); // magic
    bool parts = (hg_read_u32(&r) & multi_part) != 0;
    uint32_t count;
    do {
        const char *reason = read_exr_header(&r, &count);
        if (reason)
            return fail_at(err, name, r.pos, reason);
    } while (parts && count > 0); // an empty header ends a list of parts
    return HG_OK;
}

// Bits per pixel and compression of a BMP fit together: OpenImageIO 2.4 unpacks run lengths of any
// depth as if there were one byte a pixel, and crashes. HG_E_FORMAT with the byte offset. The first
// 2 bytes are known to be BMP's.
static enum hg_status check_bmp(
    const uint8_t *data, size_t size, const char *name, struct hg_error *err)
{
    enum { info_at = 14, old_info = 12, plain = 0, rle8 = 1, rle4 = 2, bit_fields = 3 };
    struct hg_reader r = hg_reader_make(data, size);
    hg_read_bytes(&r, info_at);
    bool old = hg_read_u32(&r) == old_info; // OS/2: 16-bit sizes, no compression
    hg_read_bytes(&r, old ? 6 : 10);
    uint16_t bits = hg_read_u16(&r);
    uint32_t compression = old ? plain : hg_read_u32(&r);
    if (r.failed)
        return fail_at(err, name, size, "the BMP ends inside its header");
    bool deep = bits == 16 || bits == 24 || bits == 32;
    bool ok = compression == plain        ? deep || bits == 1 || bits == 4 || bits == 8
              : compression == rle8       ? bits == 8
              : compression == rle4       ? bits == 4
              : compression == bit_fields ? bits == 16 || bits == 32
                                          : false;
    return ok ? HG_OK
              : fail_at(err, name, old ? 24 : 28, "the BMP's compression does not fit its depth");
}

enum hg_status hg_check_bytes(
    const char *format, const uint8_t *data, size_t size, const char *name, struct hg_error *err)
{
    if (strcmp(format, "png") == 0)
        return hg_check_png(data, size, name, err);
    if (strcmp(format, "openexr") == 0)
        return check_exr(data, size, name, err);
    return strcmp(format, "bmp") == 0 ? check_bmp(data, size, name, err) : HG_OK;
}
