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

// Reads the attributes of one header up to its empty name; *count is how many there were.
static bool read_exr_header(struct hg_reader *r, uint32_t *count)
{
    for (*count = 0;; ++*count) {
        size_t name, type;
        if (!read_name(r, &name))
            return false;
        if (name == 0)
            return true;
        if (!read_name(r, &type) || !hg_read_bytes(r, hg_read_u32(r)) || r->failed)
            return false;
    }
}

enum hg_status hg_check_exr(
    const uint8_t *data, size_t size, const char *name, struct hg_error *err)
{
    enum { multi_part = 0x1000 };
    struct hg_reader r = hg_reader_make(data, size);
    hg_read_u32(&r); // magic
    bool parts = (hg_read_u32(&r) & multi_part) != 0;
    uint32_t count;
    do {
        if (r.failed || !read_exr_header(&r, &count))
            return fail_at(err, name, r.pos, "an attribute of the EXR runs past the end");
    } while (parts && count > 0); // an empty header ends a list of parts
    return HG_OK;
}
