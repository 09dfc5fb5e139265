#include "server/worker/encode_tiles.h"

#include <string.h>

#include "base/alloc.h"
#include "renderer/image/deflate.h"

// Levels of deflate: a still is looked at for long, and may take longer.
enum { MOTION_LEVEL = 1, STILL_LEVEL = 6 };

// What is sent of a tile.
enum tile { SAME, EXACT, JPEG };

struct rect {
    uint32_t x, y, width, height; // px
    enum tile kind;
};

struct tiles {
    uint32_t width, height;   // px
    uint32_t columns, rows;   // of tiles
    struct hg_refbuf *before; // pixels of the newest frame; NULL: none was sent
    bool *lossy;              // [rows][columns]: the client has it with loss
    uint8_t *kinds;           // [rows][columns] enum tile, of the frame that is made
    struct rect *rects;       // [rect_count], at most one a tile
    uint32_t rect_count;
};

void hg_tiles_close(void *state)
{
    struct tiles *t = state;
    hg_refbuf_unref(t->before);
    hg_free(t->lossy);
    hg_free(t->kinds);
    hg_free(t->rects);
    hg_free(t);
}

enum hg_status hg_tiles_open(const struct encode_request *first, void **state, struct hg_error *err)
{
    struct tiles *t = hg_calloc(1, sizeof *t);
    *state = NULL;
    if (!t)
        return hg_error_set(err, HG_E_NOMEM, "tiles", NULL, "no memory");
    t->width = first->frame.width;
    t->height = first->frame.height;
    t->columns = (t->width + HG_TILE_PX - 1) / HG_TILE_PX;
    t->rows = (t->height + HG_TILE_PX - 1) / HG_TILE_PX;
    const size_t count = (size_t)t->columns * t->rows;
    t->lossy = hg_calloc(count, sizeof *t->lossy);
    t->kinds = hg_calloc(count, sizeof *t->kinds);
    t->rects = hg_calloc(count, sizeof *t->rects);
    if (!t->lossy || !t->kinds || !t->rects) {
        hg_tiles_close(t);
        return hg_error_set(err, HG_E_NOMEM, "tiles", NULL, "no memory");
    }
    *state = t;
    return HG_OK;
}

// ---- which tiles --------------------------------------------------------------------------------

static struct rect tile_at(const struct tiles *t, uint32_t column, uint32_t row)
{
    const uint32_t x = column * HG_TILE_PX, y = row * HG_TILE_PX;
    return (struct rect){.x = x,
        .y = y,
        .width = t->width - x < HG_TILE_PX ? t->width - x : HG_TILE_PX,
        .height = t->height - y < HG_TILE_PX ? t->height - y : HG_TILE_PX};
}

static size_t offset_of(const struct tiles *t, uint32_t x, uint32_t y)
{
    return 4 * ((size_t)t->width * y + x);
}

static bool is_same(const struct tiles *t, const struct rect *r, const uint8_t *pixels)
{
    for (uint32_t y = 0; y < r->height; y++) {
        const size_t at = offset_of(t, r->x, r->y + y);
        if (memcmp(t->before->data + at, pixels + at, 4 * (size_t)r->width) != 0)
            return false;
    }
    return true;
}

// All pixels are equal, or some are not opaque: what JPEG files are bad for.
static bool is_plain(const struct tiles *t, const struct rect *r, const uint8_t *pixels)
{
    uint32_t first, differs = 0, alpha = UINT32_MAX;
    memcpy(&first, pixels + offset_of(t, r->x, r->y), sizeof first);
    for (uint32_t y = 0; y < r->height; y++) {
        const uint8_t *row = pixels + offset_of(t, r->x, r->y + y);
        for (uint32_t x = 0; x < r->width; x++) {
            uint32_t p;
            memcpy(&p, row + 4 * (size_t)x, sizeof p);
            differs |= p ^ first;
            alpha &= p;
        }
    }
    uint8_t least[4];
    memcpy(least, &alpha, sizeof least);
    return !differs || least[3] != 255;
}

static enum tile choose(const struct tiles *t, const struct encode_request *request,
    const struct rect *r, uint32_t index, bool jpeg)
{
    const uint8_t *pixels = request->pixels->data;
    const bool same = t->before && !request->key_frame && is_same(t, r, pixels);
    if (same && (jpeg || !t->lossy[index]))
        return SAME;
    return jpeg && !is_plain(t, r, pixels) ? JPEG : EXACT;
}

// Tiles of a kind side by side are one rectangle, and such rectangles below each other, too.
static void add_run(struct tiles *t, struct rect run)
{
    const uint32_t looked_at = 2 * t->columns; // the newest; of those before some stay apart
    for (uint32_t i = t->rect_count; i > 0 && t->rect_count - i < looked_at; i--) {
        struct rect *r = &t->rects[i - 1];
        if (r->kind == run.kind && r->x == run.x && r->width == run.width &&
            r->y + r->height == run.y) {
            r->height += run.height;
            return;
        }
    }
    t->rects[t->rect_count++] = run;
}

static void collect_row(struct tiles *t, uint32_t row)
{
    const uint8_t *kinds = t->kinds + (size_t)row * t->columns;
    for (uint32_t c = 0; c < t->columns;) {
        struct rect run = tile_at(t, c, row);
        const uint32_t begin = c++;
        for (; c < t->columns && kinds[c] == kinds[begin]; c++)
            run.width += tile_at(t, c, row).width;
        run.kind = (enum tile)kinds[begin];
        if (run.kind != SAME)
            add_run(t, run);
    }
}

static void collect(struct tiles *t, const struct encode_request *request, bool jpeg)
{
    t->rect_count = 0;
    for (uint32_t row = 0; row < t->rows; row++) {
        for (uint32_t c = 0; c < t->columns; c++) {
            const struct rect r = tile_at(t, c, row);
            const uint32_t i = row * t->columns + c;
            t->kinds[i] = (uint8_t)choose(t, request, &r, i, jpeg);
        }
        collect_row(t, row);
    }
}

// ---- bytes --------------------------------------------------------------------------------------

static void copy_rect(
    const struct tiles *t, const struct rect *r, const uint8_t *pixels, uint8_t *to)
{
    for (uint32_t y = 0; y < r->height; y++)
        memcpy(to + 4 * (size_t)r->width * y, pixels + offset_of(t, r->x, r->y + y),
            4 * (size_t)r->width);
}

static size_t bytes_of(const struct rect *r)
{
    return 4 * (size_t)r->width * r->height;
}

static enum hg_status write_jpeg(const struct tiles *t, const struct rect *r,
    const struct encode_request *request, struct hg_writer *out, struct hg_error *err)
{
    struct hg_image image = {.width = r->width,
        .height = r->height,
        .format = HG_PIXEL_RGBA8,
        .size_bytes = bytes_of(r),
        .pixels = hg_calloc(bytes_of(r), 1)};
    if (!image.pixels)
        return hg_error_set(err, HG_E_NOMEM, "tiles", NULL, "no memory");
    copy_rect(t, r, request->pixels->data, image.pixels);
    const enum hg_status status = hg_image_encode(&image,
        &(struct hg_image_encode){
            .file = HG_IMAGE_JPEG, .quality = request->quality, .opaque = true},
        out, err);
    hg_free(image.pixels);
    return status;
}

// Each pixel of a row less the one at its left.
static void subtract_left(const struct rect *r, uint8_t *pixels)
{
    for (uint32_t y = 0; y < r->height; y++) {
        uint8_t *row = pixels + 4 * (size_t)r->width * y;
        for (size_t i = 4 * (size_t)r->width; i-- > 4;)
            row[i] = (uint8_t)(row[i] - row[i - 4]);
    }
}

static enum hg_status write_exact(const struct tiles *t, const struct encode_request *request,
    struct hg_writer *out, struct hg_error *err)
{
    size_t size = 0, at = 0;
    for (uint32_t i = 0; i < t->rect_count; i++)
        size += t->rects[i].kind == EXACT ? bytes_of(&t->rects[i]) : 0;
    if (!size)
        return HG_OK;
    uint8_t *pixels = hg_calloc(size, 1);
    if (!pixels)
        return hg_error_set(err, HG_E_NOMEM, "tiles", NULL, "no memory");
    for (uint32_t i = 0; i < t->rect_count; i++) {
        const struct rect *r = &t->rects[i];
        if (r->kind != EXACT)
            continue;
        copy_rect(t, r, request->pixels->data, pixels + at);
        subtract_left(r, pixels + at);
        at += bytes_of(r);
    }
    const int level = request->frame.settled ? STILL_LEVEL : MOTION_LEVEL;
    const enum hg_status status = hg_deflate_encode(pixels, size, level, out, err);
    hg_free(pixels);
    return status;
}

static enum hg_status write_tiles(const struct tiles *t, const struct encode_request *request,
    struct hg_writer *out, struct hg_error *err)
{
    enum { RECT_BYTES = 12 };
    const size_t head = out->size + 4;
    hg_write_u32(out, t->rect_count);
    for (uint32_t i = 0; i < t->rect_count; i++) {
        hg_write_u16(out, (uint16_t)t->rects[i].x);
        hg_write_u16(out, (uint16_t)t->rects[i].y);
        hg_write_u16(out, (uint16_t)t->rects[i].width);
        hg_write_u16(out, (uint16_t)t->rects[i].height);
        hg_write_u32(out, 0);
    }
    for (uint32_t i = 0; i < t->rect_count; i++) {
        const size_t before = out->size;
        if (t->rects[i].kind != JPEG)
            continue;
        const enum hg_status status = write_jpeg(t, &t->rects[i], request, out, err);
        if (status)
            return status;
        hg_write_patch_u32(out, head + RECT_BYTES * (size_t)i + 8, (uint32_t)(out->size - before));
    }
    return write_exact(t, request, out, err);
}

// The client has this frame from now on.
static void note_sent(
    struct tiles *t, const struct encode_request *request, struct encode_output *out)
{
    const uint32_t count = t->columns * t->rows;
    for (uint32_t i = 0; i < count; i++) {
        if (t->kinds[i] != SAME)
            t->lossy[i] = t->kinds[i] == JPEG;
        out->lossy |= t->lossy[i];
    }
    out->depends = t->before && !request->key_frame;
    hg_refbuf_unref(t->before);
    t->before = hg_refbuf_ref(request->pixels);
}

static enum hg_status encode(struct tiles *t, const struct encode_request *request, bool jpeg,
    struct encode_output *out, struct hg_error *err)
{
    collect(t, request, jpeg);
    const enum hg_status status = write_tiles(t, request, &out->data, err);
    if (!status)
        note_sent(t, request, out);
    return status;
}

enum hg_status hg_tiles_encode(void *state, const struct encode_request *request,
    struct encode_output *out, struct hg_error *err)
{
    return encode(state, request, false, out, err);
}

enum hg_status hg_tiles_encode_jpeg(void *state, const struct encode_request *request,
    struct encode_output *out, struct hg_error *err)
{
    return encode(state, request, true, out, err);
}
