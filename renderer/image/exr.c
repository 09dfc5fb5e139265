#include "renderer/image/exr.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "renderer/image/oiio.h"
#include "renderer/image/pixels.h"

enum {
    MAGIC = 20000630,
    VERSION = 2,
    FLAG_TILED = 0x200,
    FLAG_LONG_NAMES = 0x400,
    FLAG_DEEP = 0x800,
    FLAG_PARTS = 0x1000,
    NAME_LIMIT = 31, // of the format without its flag for long names
    CHUNK_HEAD_BYTES = 8,
};

// ---- one part taken apart ----------------------------------------------------------------------

struct piece {
    const uint8_t *attributes; // without the byte that ends them
    size_t attribute_bytes;
    const uint8_t *chunks;
    size_t chunk_bytes;
    uint32_t chunk_count;
};

static enum hg_status bad(struct hg_error *err, const char *name, const char *reason)
{
    return hg_error_set(err, HG_E_FORMAT, name, NULL, "%s", reason);
}

// A terminated text of at most 255 bytes; NULL when there is none.
static const char *read_name(struct hg_reader *r)
{
    const char *start = (const char *)r->data + r->pos;
    size_t n =
        r->pos < r->size ? strnlen(start, r->size - r->pos < 256 ? r->size - r->pos : 256) : 256;
    return n < 256 && hg_read_bytes(r, n + 1) ? start : NULL;
}

// Rows of a chunk by the value of `compression`; 0 = not one that is expected here.
static uint32_t rows_of(uint8_t compression)
{
    return compression == 0 || compression == 2 ? 1 : compression == 3 ? 16 : 0;
}

static enum hg_status read_attributes(
    struct hg_reader *r, const char *name, struct piece *out, uint32_t *rows, uint32_t *height)
{
    size_t first = r->pos;
    *rows = *height = 0;
    while (r->pos < r->size && r->data[r->pos]) {
        const char *key = read_name(r), *type = key ? read_name(r) : NULL;
        uint32_t size = hg_read_u32(r);
        const uint8_t *value = hg_read_bytes(r, size);
        if (!type || !value || r->failed)
            return HG_E_FORMAT;
        if (strcmp(key, "compression") == 0 && size == 1)
            *rows = rows_of(value[0]);
        if (strcmp(key, "dataWindow") == 0 && size == 16) {
            struct hg_reader box = hg_reader_make(value, size);
            int32_t v[4];
            for (int i = 0; i < 4; i++)
                v[i] = (int32_t)hg_read_u32(&box);
            *height = v[3] >= v[1] ? (uint32_t)(v[3] - v[1]) + 1 : 0;
        }
    }
    (void)name;
    out->attributes = r->data + first;
    out->attribute_bytes = r->pos - first;
    hg_read_u8(r);
    return r->failed || !*rows || !*height ? HG_E_FORMAT : HG_OK;
}

// Chunks must follow each other in the order of their rows, as every writer of whole pictures puts
// them.
static enum hg_status check_chunks(const struct piece *p)
{
    struct hg_reader r = hg_reader_make(p->chunks, p->chunk_bytes);
    for (uint32_t i = 0; i < p->chunk_count; i++) {
        hg_read_u32(&r);
        hg_read_bytes(&r, hg_read_u32(&r));
    }
    return r.failed || r.pos != r.size ? HG_E_FORMAT : HG_OK;
}

static enum hg_status take_apart(
    const struct hg_exr_piece *in, struct piece *out, struct hg_error *err)
{
    struct hg_reader r = hg_reader_make(in->data, in->size);
    uint32_t magic = hg_read_u32(&r), version = hg_read_u32(&r), rows, height;
    if (r.failed || magic != MAGIC || (version & 0xff) != VERSION ||
        (version & (FLAG_TILED | FLAG_DEEP | FLAG_PARTS)))
        return bad(err, in->name, "not an OpenEXR file of one scanline part");
    if (read_attributes(&r, in->name, out, &rows, &height))
        return bad(err, in->name, "its header is damaged");
    out->chunk_count = (height + rows - 1) / rows;
    if (!hg_read_bytes(&r, (size_t)out->chunk_count * 8))
        return bad(err, in->name, "its table of chunks is cut short");
    out->chunks = r.data + r.pos;
    out->chunk_bytes = r.size - r.pos;
    return check_chunks(out) ? bad(err, in->name, "its chunks are damaged") : HG_OK;
}

// ---- and put together --------------------------------------------------------------------------

static void write_text(struct hg_writer *w, const char *key, const char *value)
{
    hg_write_bytes(w, key, strlen(key) + 1);
    hg_write_bytes(w, "string", 7);
    hg_write_u32(w, (uint32_t)strlen(value));
    hg_write_bytes(w, value, strlen(value));
}

static void write_header(struct hg_writer *w, const char *name, const struct piece *p)
{
    hg_write_bytes(w, p->attributes, p->attribute_bytes);
    write_text(w, "name", name);
    write_text(w, "type", "scanlineimage");
    hg_write_bytes(w, "chunkCount", 11);
    hg_write_bytes(w, "int", 4);
    hg_write_u32(w, 4);
    hg_write_u32(w, p->chunk_count);
    hg_write_u8(w, 0);
}

// The places of all chunks of a part, which begins at *at; *at moves behind it.
static void write_offsets(struct hg_writer *w, const struct piece *p, uint64_t *at)
{
    struct hg_reader r = hg_reader_make(p->chunks, p->chunk_bytes);
    for (uint32_t i = 0; i < p->chunk_count; i++) {
        hg_write_u64(w, *at);
        hg_read_u32(&r);
        uint32_t size = hg_read_u32(&r);
        hg_read_bytes(&r, size);
        *at += 4 + CHUNK_HEAD_BYTES + (uint64_t)size;
    }
}

static void write_chunks(struct hg_writer *w, uint32_t part, const struct piece *p)
{
    struct hg_reader r = hg_reader_make(p->chunks, p->chunk_bytes);
    for (uint32_t i = 0; i < p->chunk_count; i++) {
        size_t start = r.pos;
        hg_read_u32(&r);
        hg_read_bytes(&r, hg_read_u32(&r));
        hg_write_u32(w, part);
        hg_write_bytes(w, r.data + start, r.pos - start);
    }
}

// Joins files of one part each to one of several. HG_E_FORMAT when a piece is not such a file;
// HG_E_NOMEM.
static enum hg_status join_parts(
    const struct hg_exr_piece *pieces, uint32_t count, struct hg_writer *out, struct hg_error *err)
{
    struct piece parts[HG_EXR_MAX_PARTS];
    if (count < 1 || count > HG_EXR_MAX_PARTS)
        return hg_error_set(
            err, HG_E_LIMIT, "exr", "parts", "%u is not in 1..%d", count, HG_EXR_MAX_PARTS);
    for (uint32_t i = 0; i < count; i++) {
        enum hg_status status = take_apart(&pieces[i], &parts[i], err);
        if (status)
            return status;
    }
    size_t begin = out->size;
    hg_write_u32(out, MAGIC);
    hg_write_u32(out, VERSION | FLAG_PARTS);
    for (uint32_t i = 0; i < count; i++)
        write_header(out, pieces[i].name, &parts[i]);
    hg_write_u8(out, 0);
    uint64_t at = out->size - begin;
    for (uint32_t i = 0; i < count; i++)
        at += (uint64_t)parts[i].chunk_count * 8;
    for (uint32_t i = 0; i < count; i++)
        write_offsets(out, &parts[i], &at);
    for (uint32_t i = 0; i < count; i++)
        write_chunks(out, i, &parts[i]);
    return out->failed ? hg_error_set(err, HG_E_NOMEM, "exr", NULL, "no room for the file") : HG_OK;
}

// ---- parts from pixels -------------------------------------------------------------------------

static enum hg_status check_part(
    const struct hg_exr_window *window, const struct hg_exr_part *p, struct hg_error *err)
{
    size_t values = 0, bytes = 0; // up to the last value that is read
    size_t name = p->name ? strlen(p->name) : 0;
    bool fits = hg_mul_size(window->width, window->height, &values) &&
                hg_mul_size(values - 1, p->stride, &values) &&
                hg_add_size(values, p->channel_count, &values) && hg_mul_size(values, 4, &bytes);
    if (name < 1 || name > NAME_LIMIT || p->channel_count < 1 ||
        p->channel_count > HG_EXR_MAX_CHANNELS || p->stride < p->channel_count || !p->pixels ||
        !fits || p->size_bytes < bytes)
        return hg_error_set(
            err, HG_E_INVAL, "exr", p->name, "a name, channels or pixels that do not fit");
    for (uint32_t i = 0; i < p->channel_count; i++)
        if (!p->channels[i] || !*p->channels[i] || strlen(p->channels[i]) > NAME_LIMIT)
            return hg_error_set(err, HG_E_INVAL, "exr", p->name, "a channel without a good name");
    return HG_OK;
}

static enum hg_status check_parts(const struct hg_exr_window *window,
    const struct hg_exr_part *parts, uint32_t count, uint64_t limit_bytes, struct hg_error *err)
{
    uint64_t total = 0;
    if (count < 1 || count > HG_EXR_MAX_PARTS)
        return hg_error_set(
            err, HG_E_LIMIT, "exr", "parts", "%u is not in 1..%d", count, HG_EXR_MAX_PARTS);
    if (window->width < 1 || window->height < 1 || window->width > 65536 || window->height > 65536)
        return hg_error_set(
            err, HG_E_INVAL, "exr", "size", "%ux%u px", window->width, window->height);
    if (window->full_width > 65536 || window->full_height > 65536 || window->x > 65536 ||
        window->y > 65536)
        return hg_error_set(err, HG_E_INVAL, "exr", "window", "of %ux%u px at %u,%u",
            window->full_width, window->full_height, window->x, window->y);
    for (uint32_t i = 0; i < count; i++) {
        enum hg_status status = check_part(window, &parts[i], err);
        if (status)
            return status;
        for (uint32_t j = 0; j < i; j++)
            if (strcmp(parts[i].name, parts[j].name) == 0)
                return hg_error_set(err, HG_E_INVAL, "exr", parts[i].name, "two parts of a name");
        total += (uint64_t)window->width * window->height * parts[i].channel_count *
                 (parts[i].type == HG_EXR_HALF ? 2 : 4);
    }
    if (total > limit_bytes)
        return hg_error_set(err, HG_E_LIMIT, "exr", "size",
            "%llu bytes of pixels in %u parts are more than %llu; ask for fewer planes or a "
            "smaller picture",
            (unsigned long long)total, count, (unsigned long long)limit_bytes);
    return HG_OK;
}

// A part whose values all fit its type.
static enum hg_status encode_fitting(const struct hg_exr_window *window,
    const struct hg_exr_part *p, const void *pixels, struct hg_writer *out, struct hg_error *err)
{
    static const enum hg_oiio_type types[] = {
        [HG_EXR_HALF] = HG_OIIO_HALF, [HG_EXR_FLOAT] = HG_OIIO_F32, [HG_EXR_UINT] = HG_OIIO_U32};
    const struct hg_oiio_encode e = {
        .format = "openexr",
        .name = p->name,
        .width = window->width,
        .height = window->height,
        .x = window->x,
        .y = window->y,
        .full_width = window->full_width,
        .full_height = window->full_height,
        .channels = p->channel_count,
        .channel_names = p->channels,
        .type = types[p->type],
        .attributes = p->attributes,
        .attribute_count = p->attribute_count,
        .pixel_type = p->type == HG_EXR_UINT ? HG_OIIO_U32 : HG_OIIO_F32,
        .pixel_stride_bytes = (size_t)p->stride * 4,
        .pixels = pixels,
    };
    const enum hg_status status = hg_oiio_encode_image(&e, out, err);
    if (status == HG_OK && out->failed)
        return hg_error_set(err, HG_E_NOMEM, p->name, NULL, "no room for the part");
    return status;
}

// An OpenEXR file of one part.
static enum hg_status encode_part(const struct hg_exr_window *window, const struct hg_exr_part *p,
    struct hg_writer *out, struct hg_error *err)
{
    const size_t values =
        ((size_t)window->width * window->height - 1) * p->stride + p->channel_count;
    if (p->type != HG_EXR_HALF || hg_pixels_fit_half(p->pixels, values))
        return encode_fitting(window, p, p->pixels, out, err);
    float *clamped = hg_calloc(values, sizeof *clamped);
    if (clamped == NULL)
        return hg_error_set(err, HG_E_NOMEM, p->name, NULL, "no memory to decode or encode");
    memcpy(clamped, p->pixels, values * sizeof *clamped);
    hg_pixels_clamp_to_half(clamped, values);
    const enum hg_status status = encode_fitting(window, p, clamped, out, err);
    hg_free(clamped);
    return status;
}

enum hg_status hg_exr_encode(const struct hg_exr_window *window, const struct hg_exr_part *parts,
    uint32_t part_count, uint64_t limit_bytes, struct hg_writer *out, struct hg_error *err)
{
    enum hg_status status = check_parts(window, parts, part_count, limit_bytes, err);
    if (status)
        return status;
    if (part_count == 1)
        return encode_part(window, parts, out, err);
    struct hg_writer files[HG_EXR_MAX_PARTS] = {0};
    struct hg_exr_piece pieces[HG_EXR_MAX_PARTS];
    for (uint32_t i = 0; i < part_count && !status; i++) {
        status = encode_part(window, &parts[i], &files[i], err);
        pieces[i] = (struct hg_exr_piece){parts[i].name, files[i].data, files[i].size};
    }
    if (!status)
        status = join_parts(pieces, part_count, out, err);
    for (uint32_t i = 0; i < part_count; i++)
        hg_writer_finish(&files[i]);
    return status;
}
