#include "client/view/decode_tiles.h"

#include <libdeflate.h>
#include <string.h>

#include "base/alloc.h"
#include "base/bytes.h"
#include "client/view/decode_image.h"

enum { TILE_PX = 64, RECT_BYTES = 12 };

struct hg_view_tiles {
    struct hg_view_pixels picture;
    uint64_t number; // of the frame that it shows
    bool is_whole;   // false: the next frame has to be a key frame
    uint8_t *exact;  // of the frame that is decoded: pixels of its tiles without loss
    size_t exact_capacity;
    struct libdeflate_decompressor *inflate;
};

struct rect {
    uint32_t x, y, width, height; // px
    uint32_t jpeg_bytes;          // 0: without loss
};

// A frame's data in parts, which are checked.
struct parts {
    struct hg_reader table; // from the first rectangle on
    uint32_t count;
    const uint8_t *files;  // JPEG, one behind the other
    const uint8_t *packed; // zlib data of the tiles without loss
    size_t packed_bytes, exact_bytes;
};

static struct rect read_rect(struct hg_reader *table)
{
    struct rect r;
    r.x = hg_read_u16(table);
    r.y = hg_read_u16(table);
    r.width = hg_read_u16(table);
    r.height = hg_read_u16(table);
    r.jpeg_bytes = hg_read_u32(table);
    return r;
}

static size_t bytes_of(const struct rect *r)
{
    return 4 * (size_t)r->width * r->height;
}

static bool is_inside(const struct rect *r, const struct hgp_frame *frame)
{
    return r->width > 0 && r->height > 0 && r->x + r->width <= frame->width &&
           r->y + r->height <= frame->height;
}

// All sizes are known before anything is decoded.
static enum hg_status take_apart(
    const struct hgp_frame *frame, struct parts *out, struct hg_error *err)
{
    const size_t columns = (frame->width + TILE_PX - 1) / TILE_PX,
                 rows = (frame->height + TILE_PX - 1) / TILE_PX,
                 most_bytes = 4 * (size_t)frame->width * frame->height;
    struct hg_reader r = hg_reader_make(frame->data.data, frame->data.size);
    size_t files_bytes = 0;
    *out = (struct parts){.count = hg_read_u32(&r)};
    if (r.failed || out->count > columns * rows ||
        (size_t)out->count * RECT_BYTES > frame->data.size - r.pos)
        return hg_view_decode_fail(err, HG_E_FORMAT, "it ends inside its table of tiles");
    out->table = r;
    for (uint32_t i = 0; i < out->count; i++) {
        const struct rect rect = read_rect(&r);
        if (!is_inside(&rect, frame))
            return hg_view_decode_fail(err, HG_E_FORMAT, "a tile lies outside of the picture");
        files_bytes += rect.jpeg_bytes;
        out->exact_bytes += rect.jpeg_bytes ? 0 : bytes_of(&rect);
    }
    out->files = frame->data.data + r.pos;
    if (files_bytes > frame->data.size - r.pos || out->exact_bytes > most_bytes)
        return hg_view_decode_fail(err, HG_E_FORMAT, "its tiles are larger than it is");
    out->packed = out->files + files_bytes;
    out->packed_bytes = frame->data.size - r.pos - files_bytes;
    return HG_OK;
}

static enum hg_status unpack(
    struct hg_view_tiles *t, const struct parts *parts, struct hg_error *err)
{
    size_t got = 0;
    if (!parts->exact_bytes)
        return HG_OK;
    if (!t->inflate)
        t->inflate = libdeflate_alloc_decompressor();
    if (!t->inflate || hg_grow(&t->exact, &t->exact_capacity, parts->exact_bytes, 1))
        return hg_view_decode_fail(err, HG_E_NOMEM, "no memory for tiles");
    if (libdeflate_zlib_decompress(t->inflate, parts->packed, parts->packed_bytes, t->exact,
            parts->exact_bytes, &got) != LIBDEFLATE_SUCCESS ||
        got != parts->exact_bytes)
        return hg_view_decode_fail(err, HG_E_FORMAT, "damaged tiles");
    return HG_OK;
}

// Rows hold differences to the pixel at the left.
static void put_exact(const struct rect *r, const uint8_t *from, const struct hg_view_area *to)
{
    for (uint32_t y = 0; y < r->height; y++, from += 4 * (size_t)r->width) {
        uint8_t *row = to->pixels + to->pitch * y;
        memcpy(row, from, 4);
        for (size_t i = 4; i < 4 * (size_t)r->width; i++)
            row[i] = (uint8_t)(from[i] + row[i - 4]);
    }
}

static enum hg_status put_all(
    struct hg_view_tiles *t, const struct parts *parts, void **jpeg, struct hg_error *err)
{
    struct hg_reader table = parts->table;
    struct hgp_bytes file = {.data = parts->files};
    const uint8_t *exact = t->exact;
    const size_t pitch = 4 * (size_t)t->picture.width;
    for (uint32_t i = 0; i < parts->count; i++) {
        const struct rect r = read_rect(&table);
        const struct hg_view_area area = {.pixels = t->picture.data + pitch * r.y + 4 * (size_t)r.x,
            .width = r.width,
            .height = r.height,
            .pitch = pitch};
        if (!r.jpeg_bytes) {
            put_exact(&r, exact, &area);
            exact += bytes_of(&r);
            continue;
        }
        file.size = r.jpeg_bytes;
        const enum hg_status status = hg_view_decode_jpeg(jpeg, &file, &area, err);
        if (status)
            return status;
        file.data += r.jpeg_bytes;
    }
    return HG_OK;
}

// The picture that the frame changes: that of the frame before, or one of its own.
static enum hg_status begin(
    struct hg_view_tiles *t, const struct hgp_frame *frame, struct hg_error *err)
{
    struct hg_view_pixels *p = &t->picture;
    const bool same_size = p->width == frame->width && p->height == frame->height;
    if (frame->has_depends)
        return t->is_whole && same_size && t->number + frame->depends == frame->number
                   ? HG_OK
                   : hg_view_decode_fail(err, HG_E_FORMAT, "the frame before it was lost");
    const size_t bytes = 4 * (size_t)frame->width * frame->height;
    if (hg_grow(&p->data, &p->capacity, bytes, 1))
        return hg_view_decode_fail(err, HG_E_NOMEM, "no memory for its pixels");
    memset(p->data, 0, bytes);
    p->width = frame->width;
    p->height = frame->height;
    return HG_OK;
}

enum hg_status hg_view_tiles_decode(struct hg_view_tiles **tiles, void **jpeg,
    const struct hgp_frame *frame, struct hg_view_pixels *out, struct hg_error *err)
{
    struct parts parts;
    if (!*tiles)
        *tiles = hg_calloc(1, sizeof **tiles);
    struct hg_view_tiles *t = *tiles;
    if (!t)
        return hg_view_decode_fail(err, HG_E_NOMEM, "no memory for tiles");
    enum hg_status status = begin(t, frame, err);
    t->is_whole = false;
    if (!status)
        status = take_apart(frame, &parts, err);
    if (!status)
        status = unpack(t, &parts, err);
    if (!status)
        status = put_all(t, &parts, jpeg, err);
    if (status)
        return status;
    t->is_whole = true;
    t->number = frame->number;
    memcpy(out->data, t->picture.data, 4 * (size_t)frame->width * frame->height);
    return HG_OK;
}

void hg_view_tiles_destroy(struct hg_view_tiles *t)
{
    if (!t)
        return;
    hg_view_pixels_finish(&t->picture);
    libdeflate_free_decompressor(t->inflate);
    hg_free(t->exact);
    hg_free(t);
}
