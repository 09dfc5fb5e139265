#include "server/worker/encode/encode_tiles.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/image/deflate.h"

// Levels of deflate: a still is looked at for long, and may take longer.
enum { MOTION_LEVEL = 1, STILL_LEVEL = 6 };

enum { HEADER_BYTES = 20 };

// Of 255: what a tile with loss may be off, besides its loss. Indirect light changes by as much all
// over the picture when one thing does. Where a tile is even JPEG loses little, and a step between
// two tiles would be seen; where it has contrast both are hidden by that (visual masking; Legge and
// Foley 1980), and JPEG loses in proportion to it and to its quantisation.
enum { UNSEEN_LEVELS = 1, MOST_UNSEEN_LEVELS = 4 };
#define UNSEEN_SHARE 0.0625f // of a tile's range of levels, at quality 50

// What is sent of a tile.
enum tile { SAME, EXACT, JPEG };

struct rect {
    uint32_t x, y, width, height; // px
    uint32_t atlas_x, atlas_y;    // px, JPEG: where it lies in the file
    enum tile kind;
};

struct tiles {
    uint32_t width, height; // px
    uint32_t columns, rows; // of tiles
    uint8_t *sent;          // pixels that the client's tiles were made from
    bool is_sent;           // false: no frame was
    bool *lossy;            // [rows][columns]: the client has it with loss
    uint8_t *kinds;         // [rows][columns] enum tile, of the frame that is made
    struct rect *rects;     // [rect_count], at most one a tile; those of JPEG first
    uint32_t rect_count, jpeg_count;
    uint32_t atlas_width, atlas_height; // px
};

void hg_tiles_close(void *state)
{
    struct tiles *t = state;
    hg_free(t->sent);
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
    t->sent = hg_calloc((size_t)t->width * t->height, 4);
    t->lossy = hg_calloc(count, sizeof *t->lossy);
    t->kinds = hg_calloc(count, sizeof *t->kinds);
    t->rects = hg_calloc(count, sizeof *t->rects);
    if (!t->sent || !t->lossy || !t->kinds || !t->rects) {
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

// `off`: by how many levels at most channels of a pixel may differ from what was sent.
static bool is_same(const struct tiles *t, const struct rect *r, const uint8_t *pixels, int off)
{
    for (uint32_t y = 0; y < r->height; y++) {
        const uint8_t *old = t->sent + offset_of(t, r->x, r->y + y),
                      *now = pixels + offset_of(t, r->x, r->y + y);
        if (memcmp(old, now, 4 * (size_t)r->width) == 0)
            continue;
        int most = 0;
        for (size_t i = 0; i < 4 * (size_t)r->width; i++) {
            const int d = abs(old[i] - now[i]);
            most = d > most ? d : most;
        }
        if (most > off)
            return false;
    }
    return true;
}

// Steps of quantisation over those of quality 50, as the IJG's library scales them.
static float quantisation(uint8_t quality)
{
    return quality < 50 ? 50.0f / (float)(quality > 0 ? quality : 1)
                        : 2.0f - (float)(quality < 100 ? quality : 100) / 50.0f;
}

static int unseen_levels(
    const struct tiles *t, const struct rect *r, const uint8_t *pixels, uint8_t quality)
{
    int least = 255, most = 0;
    for (uint32_t y = 0; y < r->height; y++) {
        const uint8_t *row = pixels + offset_of(t, r->x, r->y + y);
        for (uint32_t x = 0; x < r->width; x++) { // green is most of what is bright
            const int level = row[4 * (size_t)x + 1];
            least = level < least ? level : least;
            most = level > most ? level : most;
        }
    }
    const float more = UNSEEN_SHARE * quantisation(quality) * (float)(most - least);
    const int levels = UNSEEN_LEVELS + (int)more;
    return levels < MOST_UNSEEN_LEVELS ? levels : MOST_UNSEEN_LEVELS;
}

// JPEG files have no alpha.
static bool is_opaque(const struct tiles *t, const struct rect *r, const uint8_t *pixels)
{
    uint8_t alpha = 255;
    for (uint32_t y = 0; y < r->height; y++) {
        const uint8_t *row = pixels + offset_of(t, r->x, r->y + y);
        for (uint32_t x = 0; x < r->width; x++)
            alpha &= row[4 * (size_t)x + 3];
    }
    return alpha == 255;
}

static enum tile choose(const struct tiles *t, const struct encode_request *request,
    const struct rect *r, uint32_t index, bool jpeg)
{
    const uint8_t *pixels = request->pixels->data;
    const bool may_stay = t->is_sent && !request->key_frame && (jpeg || !t->lossy[index]);
    if (may_stay && is_same(t, r, pixels, 0))
        return SAME;
    if (may_stay && jpeg && is_same(t, r, pixels, unseen_levels(t, r, pixels, request->quality)))
        return SAME;
    return jpeg && is_opaque(t, r, pixels) ? JPEG : EXACT;
}

// Where most of the picture changes, all of it with subsampled chroma takes fewer bytes than parts
// of it without.
static void choose_all(struct tiles *t, const struct encode_request *request, bool jpeg)
{
    const uint32_t count = t->columns * t->rows;
    uint32_t sums[3] = {0};
    for (uint32_t i = 0; i < count; i++) {
        const struct rect r = tile_at(t, i % t->columns, i / t->columns);
        t->kinds[i] = (uint8_t)choose(t, request, &r, i, jpeg);
        sums[t->kinds[i]]++;
    }
    if (!sums[EXACT] && (uint64_t)sums[JPEG] * 2 > count)
        memset(t->kinds, JPEG, count);
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

// JPEG first, the highest of them first; the others from the top.
static int compare_rects(const void *a, const void *b)
{
    const struct rect *p = a, *q = b;
    if (p->kind != q->kind)
        return p->kind == JPEG ? -1 : 1;
    if (p->kind == JPEG && p->height != q->height)
        return p->height > q->height ? -1 : 1;
    if (p->y != q->y)
        return p->y < q->y ? -1 : 1;
    return p->x < q->x ? -1 : p->x > q->x;
}

static void collect(struct tiles *t, const struct encode_request *request, bool jpeg)
{
    t->rect_count = t->jpeg_count = 0;
    choose_all(t, request, jpeg);
    for (uint32_t row = 0; row < t->rows; row++)
        collect_row(t, row);
    qsort(t->rects, t->rect_count, sizeof *t->rects, compare_rects);
    while (t->jpeg_count < t->rect_count && t->rects[t->jpeg_count].kind == JPEG)
        t->jpeg_count++;
}

// ---- the atlas ----------------------------------------------------------------------------------

static uint32_t round_up(uint32_t px)
{
    return (px + HG_TILE_PX - 1) / HG_TILE_PX * HG_TILE_PX;
}

// About as wide as high, at least as wide as its widest rectangle.
static uint32_t choose_atlas_width(const struct tiles *t)
{
    uint64_t area = 0;
    uint32_t least = 0;
    for (uint32_t i = 0; i < t->jpeg_count; i++) {
        const uint32_t width = round_up(t->rects[i].width);
        area += (uint64_t)width * round_up(t->rects[i].height);
        least = width > least ? width : least;
    }
    const uint32_t side = round_up((uint32_t)ceil(sqrt((double)area)));
    const uint32_t most = round_up(t->width);
    return side < least ? least : side < most ? side : most;
}

// In shelves, each as high as its first rectangle: at most twice the rectangles' area and a shelf.
// On a grid of tiles, so that no block of the file has pixels of two.
// Source: Coffman et al. 1980, "Performance Bounds for Level-Oriented Two-Dimensional Packing
// Algorithms" (NFDH).
static void pack_atlas(struct tiles *t)
{
    const uint32_t width = choose_atlas_width(t);
    uint32_t x = 0, y = 0, shelf = 0;
    t->atlas_width = t->atlas_height = 0;
    for (uint32_t i = 0; i < t->jpeg_count; i++) {
        struct rect *r = &t->rects[i];
        if (x + round_up(r->width) > width) {
            y += shelf;
            x = 0;
        }
        if (x == 0)
            shelf = round_up(r->height);
        r->atlas_x = x;
        r->atlas_y = y;
        x += round_up(r->width);
        const uint32_t right = r->atlas_x + r->width, bottom = y + r->height;
        t->atlas_width = right > t->atlas_width ? right : t->atlas_width;
        t->atlas_height = bottom > t->atlas_height ? bottom : t->atlas_height;
    }
}

// ---- bytes --------------------------------------------------------------------------------------

// Blocks that reach beyond the picture's border go on with its pixels: another colour there would
// be seen on this side of it.
static void copy_to_atlas(
    const struct tiles *t, const struct rect *r, const uint8_t *pixels, uint8_t *atlas)
{
    const uint32_t width = round_up(r->width), height = round_up(r->height);
    const uint32_t columns =
                       width < t->atlas_width - r->atlas_x ? width : t->atlas_width - r->atlas_x,
                   rows = height < t->atlas_height - r->atlas_y ? height
                                                                : t->atlas_height - r->atlas_y;
    for (uint32_t y = 0; y < rows; y++) {
        const uint32_t from_y = y < r->height ? y : r->height - 1;
        const uint8_t *from = pixels + offset_of(t, r->x, r->y + from_y);
        uint8_t *to = atlas + 4 * ((size_t)t->atlas_width * (r->atlas_y + y) + r->atlas_x);
        memcpy(to, from, 4 * (size_t)r->width);
        for (uint32_t x = r->width; x < columns; x++)
            memcpy(to + 4 * (size_t)x, from + 4 * (size_t)(r->width - 1), 4);
    }
}

// Rectangles beside each other in the file are strangers: subsampled chroma would be interpolated
// from one into the other.
static enum hg_status write_jpeg(struct tiles *t, const struct encode_request *request,
    struct hg_writer *out, struct hg_error *err)
{
    pack_atlas(t);
    if (!t->jpeg_count)
        return HG_OK;
    struct hg_image image = {.width = t->atlas_width,
        .height = t->atlas_height,
        .format = HG_PIXEL_RGBA8,
        .size_bytes = 4 * (size_t)t->atlas_width * t->atlas_height};
    uint8_t *pixels = hg_calloc(image.size_bytes, 1);
    if (!pixels)
        return hg_error_set(err, HG_E_NOMEM, "tiles", NULL, "no memory");
    for (uint32_t i = 0; i < t->jpeg_count; i++)
        copy_to_atlas(t, &t->rects[i], request->pixels->data, pixels);
    image.pixels = pixels;
    const enum hg_status status = hg_image_encode(&image,
        &(struct hg_image_encode){.file = HG_IMAGE_JPEG,
            .quality = request->quality,
            .opaque = true,
            .full_chroma = t->jpeg_count > 1},
        out, err);
    hg_free(pixels);
    return status;
}

static void write_table(const struct tiles *t, struct hg_writer *out)
{
    for (uint32_t i = 0; i < t->rect_count; i++) {
        const struct rect *r = &t->rects[i];
        hg_write_u16(out, (uint16_t)r->x);
        hg_write_u16(out, (uint16_t)r->y);
        hg_write_u16(out, (uint16_t)r->width);
        hg_write_u16(out, (uint16_t)r->height);
        if (i >= t->jpeg_count)
            continue;
        hg_write_u16(out, (uint16_t)r->atlas_x);
        hg_write_u16(out, (uint16_t)r->atlas_y);
    }
}

// Each pixel of a row less the one at its left, the first one less the one above.
static void subtract_neighbours(const struct rect *r, uint8_t *pixels)
{
    const size_t pitch = 4 * (size_t)r->width;
    for (uint32_t y = r->height; y-- > 0;) {
        uint8_t *row = pixels + pitch * y;
        for (size_t i = pitch; i-- > 4;)
            row[i] = (uint8_t)(row[i] - row[i - 4]);
        for (size_t i = 0; i < 4 && y > 0; i++)
            row[i] = (uint8_t)(row[i] - row[i - pitch]);
    }
}

static void write_pixels(
    const struct tiles *t, const struct encode_request *request, struct hg_writer *out)
{
    for (uint32_t i = t->jpeg_count; i < t->rect_count; i++) {
        const struct rect *r = &t->rects[i];
        const size_t begin = out->size;
        for (uint32_t y = 0; y < r->height; y++)
            hg_write_bytes(
                out, request->pixels->data + offset_of(t, r->x, r->y + y), 4 * (size_t)r->width);
        if (!out->failed)
            subtract_neighbours(r, out->data + begin);
    }
}

// The table, and the pixels of tiles without loss.
static enum hg_status write_packed(const struct tiles *t, const struct encode_request *request,
    struct hg_writer *out, size_t *unpacked_bytes, struct hg_error *err)
{
    const int level = request->frame.settled ? STILL_LEVEL : MOTION_LEVEL;
    struct hg_writer plain = {0};
    write_table(t, &plain);
    write_pixels(t, request, &plain);
    *unpacked_bytes = plain.size;
    enum hg_status status = HG_OK;
    if (plain.failed)
        status = hg_error_set(err, HG_E_NOMEM, "tiles", NULL, "no memory");
    else if (plain.size)
        status = hg_deflate_encode(plain.data, plain.size, level, out, err);
    hg_writer_finish(&plain);
    return status;
}

static enum hg_status write_tiles(struct tiles *t, const struct encode_request *request,
    struct hg_writer *out, struct hg_error *err)
{
    static const uint8_t header[HEADER_BYTES] = {0};
    const size_t begin = out->size;
    size_t unpacked_bytes = 0;
    hg_write_bytes(out, header, sizeof header);
    enum hg_status status = write_jpeg(t, request, out, err);
    const size_t jpeg_bytes = out->size - begin - sizeof header;
    if (!status)
        status = write_packed(t, request, out, &unpacked_bytes, err);
    hg_write_patch_u32(out, begin, t->atlas_width | t->atlas_height << 16);
    hg_write_patch_u32(out, begin + 4, (uint32_t)jpeg_bytes);
    hg_write_patch_u32(out, begin + 8, t->jpeg_count);
    hg_write_patch_u32(out, begin + 12, t->rect_count - t->jpeg_count);
    hg_write_patch_u32(out, begin + 16, (uint32_t)unpacked_bytes);
    return status;
}

// The client has this frame from now on.
static void note_sent(
    struct tiles *t, const struct encode_request *request, struct encode_output *out)
{
    const uint8_t *pixels = request->pixels->data;
    const uint32_t count = t->columns * t->rows;
    out->depends = t->is_sent && !request->key_frame;
    for (uint32_t i = 0; i < count; i++) {
        const struct rect r = tile_at(t, i % t->columns, i / t->columns);
        t->lossy[i] = t->kinds[i] == JPEG ||
                      (t->kinds[i] == SAME && (t->lossy[i] || !is_same(t, &r, pixels, 0)));
        out->lossy |= t->lossy[i];
        for (uint32_t y = 0; y < r.height && t->kinds[i] != SAME; y++)
            memcpy(t->sent + offset_of(t, r.x, r.y + y), pixels + offset_of(t, r.x, r.y + y),
                4 * (size_t)r.width);
    }
    t->is_sent = true;
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
