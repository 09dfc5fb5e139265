#include "renderer/image/row_reader.h"

#include <pthread.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/image/decode.h"
#include "renderer/image/input.h"

static const uint64_t max_tile_px = UINT64_C(1) << 24;

// A row of tiles, decoded once for all rows of pixels in it.
struct band {
    uint8_t *pixels; // owned
    size_t size_bytes;
    uint32_t first_row, rows; // 0 rows: nothing decoded
    enum hg_pixel_format format;
};

struct hg_row_reader {
    pthread_mutex_t lock; // over all below
    struct hg_input *input;
    struct hg_image_reader_info info;
    uint32_t next_row;
    struct band band;
};

static uint32_t min_u32(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

static uint32_t mip_side(uint32_t side, uint32_t mip)
{
    return side >> mip ? side >> mip : 1;
}

static enum hg_status no_memory(const struct hg_row_reader *r, struct hg_error *err)
{
    return hg_error_set(
        err, HG_E_NOMEM, hg_input_name(r->input), NULL, "no memory to decode or encode");
}

// ---- opening -----------------------------------------------------------------------------------

// Leading mips of the file with the sides max(1, side >> mip).
static uint32_t count_mips(struct hg_input *input, uint32_t width, uint32_t height)
{
    uint32_t count = 1;
    for (; count < 32; count++) {
        const uint32_t w = mip_side(width, count), h = mip_side(height, count);
        uint32_t size_px[2];
        if (!hg_input_mip_size(input, count, size_px) || size_px[0] != w || size_px[1] != h)
            break;
        if (w == 1 && h == 1)
            return count + 1;
    }
    return count;
}

static enum hg_status check_header(
    const struct hg_oiio_header *h, const char *name, uint32_t max_side_px, struct hg_error *err)
{
    if ((uint32_t)h->width > max_side_px || (uint32_t)h->height > max_side_px)
        return hg_error_set(err, HG_E_LIMIT, name, "size", "%dx%d px is more than %u a side",
            h->width, h->height, max_side_px);
    if (h->channels > HG_OIIO_MAX_CHANNELS)
        return hg_error_set(err, HG_E_LIMIT, name, "channels", "%d is more than %d", h->channels,
            HG_OIIO_MAX_CHANNELS);
    if (h->tile_width > 0 && h->tile_height > 0 &&
        (uint64_t)h->tile_width * (uint64_t)h->tile_height > max_tile_px)
        return hg_error_set(err, HG_E_LIMIT, name, "tile", "%dx%d px is more than allowed",
            h->tile_width, h->tile_height);
    return HG_OK;
}

static void describe(struct hg_row_reader *r, const char *format)
{
    const struct hg_oiio_header *h = hg_input_get_header(r->input);
    const bool tiled = h->tile_width > 0 && h->tile_height > 0;
    r->info = (struct hg_image_reader_info){
        .width = (uint32_t)h->width,
        .height = (uint32_t)h->height,
        .tile_width = tiled ? (uint32_t)h->tile_width : 0,
        .tile_height = tiled ? (uint32_t)h->tile_height : 0,
        .channels = (uint32_t)h->channels,
        .mips = tiled ? count_mips(r->input, (uint32_t)h->width, (uint32_t)h->height) : 1,
        .is_float = h->is_float,
        .is_16bit = h->is_16bit,
        .has_alpha = hg_decode_has_alpha(h),
    };
    r->info.row_buffer_bytes =
        (uint64_t)r->info.width * r->info.tile_height * (r->info.is_float ? 16 : 4);
    snprintf(r->info.file_format, sizeof r->info.file_format, "%s", format);
}

enum hg_status hg_row_reader_open(FILE *file, const struct hg_image_bytes *bytes,
    const char *format, uint32_t max_side_px, struct hg_row_reader **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_row_reader *r = hg_calloc(1, sizeof *r);
    if (r == NULL)
        return hg_error_set(err, HG_E_NOMEM, bytes->name, NULL, "no memory to decode or encode");
    pthread_mutex_init(&r->lock, NULL);
    enum hg_status status = hg_input_open(file, bytes, format, true, &r->input, err);
    if (status == HG_OK)
        status = check_header(hg_input_get_header(r->input), bytes->name, max_side_px, err);
    if (status != HG_OK) {
        hg_row_reader_close(r);
        return status;
    }
    describe(r, format);
    *out = r;
    return HG_OK;
}

void hg_row_reader_close(struct hg_row_reader *r)
{
    if (r == NULL)
        return;
    hg_input_close(r->input);
    hg_free(r->band.pixels);
    pthread_mutex_destroy(&r->lock);
    hg_free(r);
}

const struct hg_image_reader_info *hg_row_reader_info(const struct hg_row_reader *r)
{
    return &r->info;
}

// ---- reading -----------------------------------------------------------------------------------

static enum hg_status read_scanlines(struct hg_row_reader *r, enum hg_pixel_format format,
    uint32_t count, void *pixels, struct hg_error *err)
{
    const struct hg_oiio_header *h = hg_input_get_header(r->input);
    const struct hg_oiio_target target = {hg_decode_type(format), hg_decode_channels(h), pixels};
    const enum hg_status status = hg_input_read_rows(r->input, 0, r->next_row, count, &target, err);
    if (status == HG_OK)
        hg_decode_finish_pixels(h, pixels, (size_t)r->info.width * count, format);
    return status;
}

// `area` begins at a tile and ends with one, or with the mip; rows tight.
static enum hg_status read_tiles(struct hg_row_reader *r, const struct hg_image_rect *area,
    enum hg_pixel_format format, void *pixels, struct hg_error *err)
{
    const struct hg_oiio_header *h = hg_input_get_header(r->input);
    const struct hg_oiio_target target = {hg_decode_type(format), hg_decode_channels(h), pixels};
    const enum hg_status status = hg_input_read_tiles(r->input, area, &target, err);
    if (status == HG_OK)
        hg_decode_finish_pixels(h, pixels, (size_t)area->size[0] * area->size[1], format);
    return status;
}

static bool grow_band(struct band *band, size_t size_bytes)
{
    band->rows = 0;
    if (size_bytes <= band->size_bytes)
        return true;
    hg_free(band->pixels);
    band->pixels = hg_calloc(size_bytes, 1);
    band->size_bytes = band->pixels != NULL ? size_bytes : 0;
    return band->pixels != NULL;
}

static enum hg_status fill_band(
    struct hg_row_reader *r, enum hg_pixel_format format, uint32_t y, struct hg_error *err)
{
    const struct hg_image_reader_info *info = &r->info;
    const uint32_t first = y / info->tile_height * info->tile_height;
    const uint32_t rows = min_u32(first + info->tile_height, info->height) - first;
    const struct hg_image_rect area = {0, {0, first}, {info->width, rows}};
    if (!grow_band(&r->band, (size_t)info->width * info->tile_height * hg_pixel_bytes(format)))
        return no_memory(r, err);
    const enum hg_status status = read_tiles(r, &area, format, r->band.pixels, err);
    if (status != HG_OK)
        return status;
    r->band.first_row = first;
    r->band.rows = rows;
    r->band.format = format;
    return HG_OK;
}

static bool is_in_band(const struct band *band, enum hg_pixel_format format, uint32_t y)
{
    return band->format == format && y >= band->first_row && y - band->first_row < band->rows;
}

static enum hg_status read_rows_of_tiles(struct hg_row_reader *r, enum hg_pixel_format format,
    uint32_t count, void *pixels, struct hg_error *err)
{
    const size_t row_bytes = (size_t)r->info.width * hg_pixel_bytes(format);
    uint8_t *dst = pixels;
    for (uint32_t y = r->next_row; y < r->next_row + count; y++, dst += row_bytes) {
        const enum hg_status status =
            is_in_band(&r->band, format, y) ? HG_OK : fill_band(r, format, y, err);
        if (status != HG_OK)
            return status;
        memcpy(dst, r->band.pixels + (y - r->band.first_row) * row_bytes, row_bytes);
    }
    return HG_OK;
}

static enum hg_status read_rows(struct hg_row_reader *r, enum hg_pixel_format format,
    uint32_t count, void *pixels, struct hg_error *err)
{
    if (count > r->info.height - r->next_row)
        return hg_error_set(err, HG_E_INVAL, hg_input_name(r->input), NULL, "no more rows");
    const enum hg_status status = r->info.tile_width != 0
                                      ? read_rows_of_tiles(r, format, count, pixels, err)
                                      : read_scanlines(r, format, count, pixels, err);
    r->next_row += status == HG_OK ? count : 0;
    return status;
}

enum hg_status hg_row_reader_rows(struct hg_row_reader *r, enum hg_pixel_format format,
    uint32_t count, void *pixels, struct hg_error *err)
{
    pthread_mutex_lock(&r->lock);
    const enum hg_status status = read_rows(r, format, count, pixels, err);
    pthread_mutex_unlock(&r->lock);
    return status;
}

void hg_row_reader_skip(struct hg_row_reader *r, uint32_t count)
{
    pthread_mutex_lock(&r->lock);
    r->next_row += min_u32(count, r->info.height - r->next_row);
    pthread_mutex_unlock(&r->lock);
}

// The smallest area of whole tiles that holds `rect`. False: the rectangle is not in the mip, or
// the file has no tiles.
static bool tiles_of_rect(const struct hg_image_reader_info *info, const struct hg_image_rect *rect,
    struct hg_image_rect *area)
{
    const uint32_t tile[2] = {info->tile_width, info->tile_height};
    const uint32_t full[2] = {info->width, info->height};
    *area = (struct hg_image_rect){.mip = rect->mip};
    for (int i = 0; i < 2; i++) {
        if (tile[i] == 0 || rect->mip >= info->mips)
            return false;
        const uint32_t side = mip_side(full[i], rect->mip);
        const uint32_t at = rect->at[i], size = rect->size[i];
        if (size == 0 || at >= side || size > side - at)
            return false;
        area->at[i] = at / tile[i] * tile[i];
        area->size[i] = min_u32((at + size + tile[i] - 1) / tile[i] * tile[i], side) - area->at[i];
    }
    return true;
}

static enum hg_status read_rect(struct hg_row_reader *r, const struct hg_image_rect *rect,
    enum hg_pixel_format format, void *pixels, uint64_t *bytes, struct hg_error *err)
{
    struct hg_image_rect area;
    if (!tiles_of_rect(&r->info, rect, &area))
        return hg_error_set(err, HG_E_INVAL, hg_input_name(r->input), NULL, "no such rectangle");
    const size_t texel = hg_pixel_bytes(format), wide = area.size[0];
    const size_t size_bytes = wide * area.size[1] * texel;
    uint8_t *tiles = hg_calloc(size_bytes, 1);
    if (tiles == NULL)
        return no_memory(r, err);
    const enum hg_status status = read_tiles(r, &area, format, tiles, err);
    const size_t x = rect->at[0] - area.at[0], y = rect->at[1] - area.at[1];
    const size_t row_bytes = rect->size[0] * texel;
    for (size_t i = 0; status == HG_OK && i < rect->size[1]; i++)
        memcpy((uint8_t *)pixels + i * row_bytes, tiles + ((y + i) * wide + x) * texel, row_bytes);
    *bytes = status == HG_OK ? size_bytes : 0;
    hg_free(tiles);
    return status;
}

enum hg_status hg_row_reader_rect(struct hg_row_reader *r, const struct hg_image_rect *rect,
    enum hg_pixel_format format, void *pixels, uint64_t *bytes, struct hg_error *err)
{
    *bytes = 0;
    pthread_mutex_lock(&r->lock);
    const enum hg_status status = read_rect(r, rect, format, pixels, bytes, err);
    pthread_mutex_unlock(&r->lock);
    return status;
}
