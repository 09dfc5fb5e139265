// udim.c - see udim.h.
#include "renderer/texture/source/udim.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/texture/source/mip_stream.h"

static const char token[] = "<UDIM>";

bool hg_udim_is_pattern(const char *path)
{
    return strstr(path, token) != NULL;
}

// Path of the tile at `column` and `row` (0 at the bottom), freed with hg_free; NULL: no memory.
static char *tile_path(const char *pattern, uint32_t column, uint32_t row)
{
    const char *at = strstr(pattern, token);
    const size_t room = strlen(pattern) + 8;
    char *path = hg_calloc(room, 1);
    if (path != NULL)
        snprintf(path, room, "%.*s%u%s", (int)(at - pattern), pattern, 1001 + column + 10 * row,
            at + sizeof token - 1);
    return path;
}

static enum hg_status no_memory(const char *pattern, struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, pattern, NULL, "no memory for the tiles");
}

// NULL and HG_OK: there is no such tile.
static enum hg_status open_tile(const char *pattern, uint32_t column, uint32_t row,
    struct hg_image_reader **out, struct hg_error *err)
{
    *out = NULL;
    char *path = tile_path(pattern, column, row);
    if (path == NULL)
        return no_memory(pattern, err);
    const enum hg_status status = hg_image_reader_open(path, HG_MIPS_SIDE_PX, out, err);
    hg_free(path);
    return status == HG_E_NOTFOUND ? HG_OK : status;
}

// --- identity ------------------------------------------------------------------------------------

struct survey {
    struct hg_sha256 *content, *stamp;
    uint32_t columns, rows, cell_width, cell_height;
    bool is_float;
};

static enum hg_status survey_tile(struct hg_store *store, struct hg_image_reader *reader,
    const uint32_t at[2], struct survey *s, struct hg_error *err)
{
    const struct hg_image_reader_info *info = hg_image_reader_info(reader);
    uint8_t hash[HG_SHA256_BYTES];
    enum hg_status status = hg_source_hash_file(store, reader, hash, err);
    if (status != HG_OK)
        return status;
    hg_sha256_update(s->content, at, 2 * sizeof *at);
    hg_sha256_update(s->content, hash, sizeof hash);
    status = hg_source_stamp(info, hash);
    if (status != HG_OK)
        return status;
    hg_sha256_update(s->stamp, hash, sizeof hash);
    s->columns = at[0] + 1 > s->columns ? at[0] + 1 : s->columns;
    s->rows = at[1] + 1 > s->rows ? at[1] + 1 : s->rows;
    s->cell_width = info->width > s->cell_width ? info->width : s->cell_width;
    s->cell_height = info->height > s->cell_height ? info->height : s->cell_height;
    s->is_float |= info->is_float;
    return HG_OK;
}

static enum hg_status survey_tiles(
    struct hg_store *store, const char *pattern, struct survey *s, struct hg_error *err)
{
    for (uint32_t i = 0; i < HG_UDIM_COLUMNS * HG_UDIM_ROWS; i++) {
        const uint32_t at[2] = {i % HG_UDIM_COLUMNS, i / HG_UDIM_COLUMNS};
        struct hg_image_reader *reader;
        enum hg_status status = open_tile(pattern, at[0], at[1], &reader, err);
        if (status == HG_OK && reader != NULL)
            status = survey_tile(store, reader, at, s, err);
        hg_image_reader_close(reader);
        if (status != HG_OK)
            return status;
    }
    if (s->rows == 0)
        return hg_error_set(err, HG_E_NOTFOUND, pattern, NULL, "no tile of the set is there");
    return HG_OK;
}

enum hg_status hg_udim_identify(
    struct hg_store *store, const char *pattern, struct hg_source_info *out, struct hg_error *err)
{
    struct survey s = {.content = hg_sha256_create(), .stamp = hg_sha256_create()};
    enum hg_status status = s.content != NULL && s.stamp != NULL ? HG_OK : no_memory(pattern, err);
    if (status == HG_OK)
        status = survey_tiles(store, pattern, &s, err);
    if (s.content != NULL)
        hg_sha256_end(s.content, out->hash);
    if (s.stamp != NULL)
        hg_sha256_end(s.stamp, out->stamp);
    if (status != HG_OK)
        return status;
    const uint64_t width = (uint64_t)s.columns * s.cell_width;
    const uint64_t height = (uint64_t)s.rows * s.cell_height;
    if (width > HG_MIPS_SIDE_PX || height > HG_MIPS_SIDE_PX)
        return hg_error_set(err, HG_E_LIMIT, pattern, NULL, "%u x %u tiles of %u x %u texels",
            s.columns, s.rows, s.cell_width, s.cell_height);
    out->width = (uint32_t)width;
    out->height = (uint32_t)height;
    out->is_float = s.is_float;
    out->udim_columns = s.columns;
    out->udim_rows = s.rows;
    return HG_OK;
}

// --- rows ----------------------------------------------------------------------------------------

struct tile {
    struct hg_image_reader *reader; // NULL: missing
    uint8_t *row;                   // the one that was read last
    uint32_t read;                  // rows that were read
};

struct hg_udim_rows {
    char *pattern;
    struct hg_source_info info;
    enum hg_pixel_format format;
    uint32_t cell_width, cell_height, y;
    struct tile tiles[HG_UDIM_COLUMNS]; // of the row of cells at y
};

static void close_tiles(struct hg_udim_rows *r)
{
    for (uint32_t i = 0; i < HG_UDIM_COLUMNS; i++) {
        hg_image_reader_close(r->tiles[i].reader);
        hg_free(r->tiles[i].row);
        r->tiles[i] = (struct tile){0};
    }
}

static enum hg_status open_cells(struct hg_udim_rows *r, uint32_t row, struct hg_error *err)
{
    close_tiles(r);
    for (uint32_t i = 0; i < r->info.udim_columns; i++) {
        struct tile *t = &r->tiles[i];
        const enum hg_status status = open_tile(r->pattern, i, row, &t->reader, err);
        if (status != HG_OK)
            return status;
        if (t->reader == NULL)
            continue;
        const struct hg_image_reader_info *info = hg_image_reader_info(t->reader);
        if (info->width > r->cell_width || info->height > r->cell_height)
            return hg_error_set(err, HG_E_HASH, r->pattern, NULL, "a tile was changed");
        t->row = hg_calloc(info->width, hg_pixel_bytes(r->format));
        if (t->row == NULL)
            return no_memory(r->pattern, err);
    }
    return HG_OK;
}

enum hg_status hg_udim_rows_open(const char *pattern, const struct hg_source_info *info,
    struct hg_udim_rows **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_udim_rows *r = hg_calloc(1, sizeof *r);
    if (r == NULL || (r->pattern = hg_strdup(pattern)) == NULL) {
        hg_free(r);
        return no_memory(pattern, err);
    }
    r->info = *info;
    r->format = info->is_float ? HG_PIXEL_RGBA32F : HG_PIXEL_RGBA8;
    r->cell_width = info->width / info->udim_columns;
    r->cell_height = info->height / info->udim_rows;
    *out = r;
    return HG_OK;
}

void hg_udim_rows_close(struct hg_udim_rows *rows)
{
    if (rows == NULL)
        return;
    close_tiles(rows);
    hg_free(rows->pattern);
    hg_free(rows);
}

uint64_t hg_udim_rows_bytes(const struct hg_udim_rows *rows)
{
    return (uint64_t)rows->info.width * hg_pixel_bytes(rows->format) * 64; // rows of tiles
}

// Row y of a cell: that of the tile, texels repeated where the tile is smaller.
static enum hg_status fill_cell(
    struct hg_udim_rows *r, struct tile *t, uint32_t y, uint8_t *dst, struct hg_error *err)
{
    const size_t texel = hg_pixel_bytes(r->format);
    if (t->reader == NULL) {
        memset(dst, 0, r->cell_width * texel);
        return HG_OK;
    }
    const struct hg_image_reader_info *info = hg_image_reader_info(t->reader);
    const uint32_t from = (uint32_t)((uint64_t)y * info->height / r->cell_height);
    while (t->read <= from) {
        const enum hg_status status = hg_image_reader_rows(t->reader, r->format, 1, t->row, err);
        if (status != HG_OK)
            return status;
        t->read++;
    }
    if (info->width == r->cell_width) {
        memcpy(dst, t->row, r->cell_width * texel);
        return HG_OK;
    }
    for (uint32_t x = 0; x < r->cell_width; x++)
        memcpy(dst + x * texel,
            t->row + (size_t)((uint64_t)x * info->width / r->cell_width) * texel, texel);
    return HG_OK;
}

enum hg_status hg_udim_rows_next(
    struct hg_udim_rows *r, uint32_t count, void *pixels, struct hg_error *err)
{
    const size_t cell = r->cell_width * hg_pixel_bytes(r->format);
    uint8_t *dst = pixels;
    for (uint32_t end = r->y + count; r->y < end; r->y++) {
        const uint32_t y = r->y % r->cell_height;
        enum hg_status status = HG_OK;
        if (y == 0)
            status = open_cells(r, r->info.udim_rows - 1 - r->y / r->cell_height, err);
        for (uint32_t i = 0; i < r->info.udim_columns && status == HG_OK; i++, dst += cell)
            status = fill_cell(r, &r->tiles[i], y, dst, err);
        if (status != HG_OK)
            return status;
    }
    return HG_OK;
}

enum hg_status hg_udim_rows_check(const struct hg_udim_rows *r, struct hg_error *err)
{
    struct hg_sha256 *h = hg_sha256_create();
    enum hg_status status = h != NULL ? HG_OK : no_memory(r->pattern, err);
    for (uint32_t i = 0; i < HG_UDIM_COLUMNS * HG_UDIM_ROWS && status == HG_OK; i++) {
        struct hg_image_reader *reader;
        uint8_t stamp[HG_SHA256_BYTES];
        status = open_tile(r->pattern, i % HG_UDIM_COLUMNS, i / HG_UDIM_COLUMNS, &reader, err);
        if (status == HG_OK && reader != NULL) {
            status = hg_source_stamp(hg_image_reader_info(reader), stamp);
            hg_sha256_update(h, stamp, sizeof stamp);
        }
        hg_image_reader_close(reader);
    }
    uint8_t all[HG_SHA256_BYTES] = {0};
    if (h != NULL)
        hg_sha256_end(h, all);
    if (status == HG_OK && memcmp(all, r->info.stamp, sizeof all) != 0)
        status = hg_error_set(err, HG_E_HASH, r->pattern, NULL, "a tile was changed");
    return status;
}
