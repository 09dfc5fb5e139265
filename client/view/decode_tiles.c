#include "client/view/decode_tiles.h"

#include <libdeflate.h>
#include <string.h>

#include "base/alloc.h"
#include "base/bytes.h"
#include "client/view/decode_image.h"

enum { TILE_PX = 8, HEADER_BYTES = 20, JPEG_RECT_BYTES = 12, EXACT_RECT_BYTES = 8 };

struct hg_view_tiles {
    struct hg_view_pixels picture;
    uint64_t number; // of the frame that it shows
    bool is_whole;   // false: the next frame has to be a key frame
    uint8_t *unpacked; // of the frame that is decoded: its table, pixels without loss
    size_t unpacked_capacity;
    uint8_t *atlas; // its JPEG file
    size_t atlas_capacity;
    struct libdeflate_decompressor *inflate;
};

struct rect {
    uint32_t x, y, width, height; // px
};

// A frame's data in parts; their sizes are checked.
struct parts {
    uint32_t atlas_width, atlas_height; // px
    uint32_t jpeg_count, exact_count;   // rectangles
    struct hgp_bytes jpeg;
    struct hgp_bytes packed;
    size_t unpacked_bytes;
};

static struct rect read_rect(struct hg_reader *table)
{
    struct rect r;
    r.x = hg_read_u16(table);
    r.y = hg_read_u16(table);
    r.width = hg_read_u16(table);
    r.height = hg_read_u16(table);
    return r;
}

static size_t bytes_of(const struct rect *r)
{
    return 4 * (size_t)r->width * r->height;
}

static bool is_inside(const struct rect *r, uint32_t width, uint32_t height)
{
    return r->width > 0 && r->height > 0 && r->x + r->width <= width && r->y + r->height <= height;
}

static size_t round_up(uint32_t px)
{
    return ((size_t)px + TILE_PX - 1) / TILE_PX * TILE_PX;
}

// All sizes are known before anything is decoded.
static enum hg_status take_apart(
    const struct hgp_frame *frame, struct parts *out, struct hg_error *err)
{
    const size_t most_px = round_up(frame->width) * round_up(frame->height),
                 tiles = most_px / (TILE_PX * TILE_PX);
    struct hg_reader r = hg_reader_make(frame->data.data, frame->data.size);
    *out = (struct parts){.atlas_width = hg_read_u16(&r), .atlas_height = hg_read_u16(&r)};
    out->jpeg.size = hg_read_u32(&r);
    out->jpeg_count = hg_read_u32(&r);
    out->exact_count = hg_read_u32(&r);
    out->unpacked_bytes = hg_read_u32(&r);
    if (r.failed || out->jpeg.size > frame->data.size - HEADER_BYTES ||
        (size_t)out->jpeg_count + out->exact_count > tiles)
        return hg_view_decode_fail(err, HG_E_FORMAT, "it ends inside its tiles");
    if ((size_t)out->atlas_width * out->atlas_height > 4 * most_px ||
        out->unpacked_bytes > JPEG_RECT_BYTES * tiles + 4 * most_px)
        return hg_view_decode_fail(err, HG_E_FORMAT, "its tiles are larger than it is");
    out->jpeg.data = frame->data.data + HEADER_BYTES;
    out->packed.data = out->jpeg.data + out->jpeg.size;
    out->packed.size = frame->data.size - HEADER_BYTES - out->jpeg.size;
    return HG_OK;
}

static enum hg_status unpack(
    struct hg_view_tiles *t, const struct parts *parts, struct hg_error *err)
{
    size_t got = 0;
    if (!parts->unpacked_bytes)
        return HG_OK;
    if (!t->inflate)
        t->inflate = libdeflate_alloc_decompressor();
    if (!t->inflate || hg_grow(&t->unpacked, &t->unpacked_capacity, parts->unpacked_bytes, 1))
        return hg_view_decode_fail(err, HG_E_NOMEM, "no memory for tiles");
    if (libdeflate_zlib_decompress(t->inflate, parts->packed.data, parts->packed.size, t->unpacked,
            parts->unpacked_bytes, &got) != LIBDEFLATE_SUCCESS ||
        got != parts->unpacked_bytes)
        return hg_view_decode_fail(err, HG_E_FORMAT, "damaged tiles");
    return HG_OK;
}

static enum hg_status open_atlas(
    struct hg_view_tiles *t, const struct parts *parts, void **jpeg, struct hg_error *err)
{
    const size_t pitch = 4 * (size_t)parts->atlas_width;
    if (!parts->jpeg_count)
        return HG_OK;
    if (hg_grow(&t->atlas, &t->atlas_capacity, pitch * parts->atlas_height, 1))
        return hg_view_decode_fail(err, HG_E_NOMEM, "no memory for tiles");
    const struct hg_view_area area = {t->atlas, parts->atlas_width, parts->atlas_height, pitch};
    return hg_view_decode_jpeg(jpeg, &parts->jpeg, &area, err);
}

static uint8_t *pixel_at(const struct hg_view_pixels *picture, uint32_t x, uint32_t y)
{
    return picture->data + 4 * ((size_t)picture->width * y + x);
}

static enum hg_status put_jpeg(struct hg_view_tiles *t, const struct parts *parts,
    struct hg_reader *table, struct hg_error *err)
{
    for (uint32_t i = 0; i < parts->jpeg_count; i++) {
        const struct rect r = read_rect(table);
        const struct rect from = {hg_read_u16(table), hg_read_u16(table), r.width, r.height};
        if (!is_inside(&r, t->picture.width, t->picture.height) ||
            !is_inside(&from, parts->atlas_width, parts->atlas_height))
            return hg_view_decode_fail(err, HG_E_FORMAT, "a tile lies outside of the picture");
        for (uint32_t y = 0; y < r.height; y++)
            memcpy(pixel_at(&t->picture, r.x, r.y + y),
                t->atlas + 4 * ((size_t)parts->atlas_width * (from.y + y) + from.x),
                4 * (size_t)r.width);
    }
    return HG_OK;
}

// Differences to the pixel at the left, in the first column to the one above.
static void add_neighbours(const struct rect *r, const uint8_t *from, struct hg_view_pixels *to)
{
    for (uint32_t y = 0; y < r->height; y++, from += 4 * (size_t)r->width) {
        uint8_t *row = pixel_at(to, r->x, r->y + y);
        const uint8_t *above = row - 4 * (size_t)to->width;
        for (size_t i = 0; i < 4; i++)
            row[i] = (uint8_t)(from[i] + (y ? above[i] : 0));
        for (size_t i = 4; i < 4 * (size_t)r->width; i++)
            row[i] = (uint8_t)(from[i] + row[i - 4]);
    }
}

static enum hg_status put_exact(struct hg_view_tiles *t, const struct parts *parts,
    struct hg_reader *table, struct hg_error *err)
{
    struct hg_reader pixels = *table;
    if (!hg_read_bytes(&pixels, EXACT_RECT_BYTES * (size_t)parts->exact_count))
        return hg_view_decode_fail(err, HG_E_FORMAT, "it ends inside its table of tiles");
    for (uint32_t i = 0; i < parts->exact_count; i++) {
        const struct rect r = read_rect(table);
        const bool inside = is_inside(&r, t->picture.width, t->picture.height);
        const uint8_t *from = inside ? hg_read_bytes(&pixels, bytes_of(&r)) : NULL;
        if (!from)
            return hg_view_decode_fail(err, HG_E_FORMAT, "a tile lies outside of the picture");
        add_neighbours(&r, from, &t->picture);
    }
    return HG_OK;
}

static enum hg_status put_all(
    struct hg_view_tiles *t, const struct parts *parts, void **jpeg, struct hg_error *err)
{
    struct hg_reader table = hg_reader_make(t->unpacked, parts->unpacked_bytes);
    enum hg_status status = open_atlas(t, parts, jpeg, err);
    if (!status)
        status = put_jpeg(t, parts, &table, err);
    if (!status && table.failed)
        status = hg_view_decode_fail(err, HG_E_FORMAT, "it ends inside its table of tiles");
    return status ? status : put_exact(t, parts, &table, err);
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
    hg_free(t->unpacked);
    hg_free(t->atlas);
    hg_free(t);
}
