// page_codec.c - see page_codec.h.
//
// A block: u8 flags, the constant channels' values (1 or 2 bytes each), then one Zstandard frame of
// `height` row filters and the planes of the other channels. Residuals are kept in channel order.
#include "renderer/texture/source/page_codec.h"

#include <stdlib.h>
#include <string.h>
#include <zstd.h>

#include "base/alloc.h"

enum {
    SIDE = HG_PAGE_CODEC_SIDE,
    TEXELS = SIDE * SIDE,
    PLANES_BYTES = SIDE + TEXELS * 8,
    FLAG_RED_GREEN = 0x10, // stored as the difference to green
    FLAG_BLUE_GREEN = 0x20,
};

enum filter { NONE, LEFT, ABOVE, MEAN, MEDIAN, FILTERS };

// Four channels of one texel. 16-bit lanes hold 8-bit values too: differences wrap by masking.
typedef uint16_t lanes __attribute__((vector_size(8)));
typedef int16_t signed_lanes __attribute__((vector_size(8)));

struct hg_page_codec {
    ZSTD_CCtx *compressor; // made when first needed
    ZSTD_DCtx *decompressor;
    lanes texels[TEXELS], residuals[TEXELS];
    lanes trial[FILTERS][SIDE];
    uint8_t planes[PLANES_BYTES];
    uint8_t packed[PLANES_BYTES + PLANES_BYTES / 128 + 1024];
};

struct hg_page_codec *hg_page_codec_create(void)
{
    struct hg_page_codec *codec = hg_calloc(1, sizeof *codec);
    if (codec == NULL)
        return NULL;
    codec->decompressor = ZSTD_createDCtx();
    if (codec->decompressor != NULL)
        return codec;
    hg_free(codec);
    return NULL;
}

void hg_page_codec_destroy(struct hg_page_codec *codec)
{
    if (codec == NULL)
        return;
    ZSTD_freeCCtx(codec->compressor);
    ZSTD_freeDCtx(codec->decompressor);
    hg_free(codec);
}

// --- prediction ----------------------------------------------------------------------------------

// min(a, b) when c is above both, max(a, b) when below both, else the plane a + b - c. Branch-free:
// clamp(a + b - c, min, max); 16-bit texels are compared as they are, sums wrap.
static inline lanes select_lanes(signed_lanes mask, lanes yes, lanes no)
{
    return ((lanes)mask & yes) | (~(lanes)mask & no);
}

static inline lanes median8(lanes a, lanes b, lanes c)
{
    const signed_lanes x = (signed_lanes)a, y = (signed_lanes)b, plane = x + y - (signed_lanes)c;
    const signed_lanes low = (signed_lanes)select_lanes(x < y, a, b);
    const signed_lanes high = (signed_lanes)select_lanes(x < y, b, a);
    const signed_lanes p = (signed_lanes)select_lanes(plane < low, (lanes)low, (lanes)plane);
    return select_lanes(p > high, (lanes)high, (lanes)p);
}

static inline lanes median16(lanes a, lanes b, lanes c)
{
    const lanes low = select_lanes((signed_lanes)(a < b), a, b);
    const lanes high = select_lanes((signed_lanes)(a < b), b, a);
    lanes p = select_lanes((signed_lanes)(c >= high), low, a + b - c);
    return select_lanes((signed_lanes)(c <= low), high, p);
}

static inline lanes mean_of(lanes a, lanes b)
{
    return (a & b) + ((a ^ b) >> 1);
}

static inline lanes predict(enum filter filter, lanes left, lanes above, lanes corner, bool wide)
{
    switch (filter) {
    case LEFT:
        return left;
    case ABOVE:
        return above;
    case MEAN:
        return mean_of(left, above);
    case MEDIAN:
        return wide ? median16(left, above, corner) : median8(left, above, corner);
    default:
        return (lanes){0};
    }
}

// One row to residuals. `above` is a row of zeroes for the first one.
static inline void subtract_row(
    enum filter filter, const lanes *row, const lanes *above, uint32_t width, bool wide, lanes *out)
{
    const lanes mask = (lanes){0} + (uint16_t)(wide ? 0xffff : 0xff);
    lanes left = {0}, corner = {0};
    for (uint32_t i = 0; i < width; i++) {
        out[i] = (row[i] - predict(filter, left, above[i], corner, wide)) & mask;
        left = row[i];
        corner = above[i];
    }
}

static inline void add_row(enum filter filter, const lanes *residuals, const lanes *above,
    uint32_t width, bool wide, lanes *out)
{
    const lanes mask = (lanes){0} + (uint16_t)(wide ? 0xffff : 0xff);
    lanes left = {0}, corner = {0};
    for (uint32_t i = 0; i < width; i++) {
        left = (residuals[i] + predict(filter, left, above[i], corner, wide)) & mask;
        corner = above[i];
        out[i] = left;
    }
}

static void add_row_of(uint8_t filter, const lanes *residuals, const lanes *above, uint32_t width,
    bool wide, lanes *out)
{
#define CASE(f)                                                                                    \
    case f:                                                                                        \
        if (wide)                                                                                  \
            add_row(f, residuals, above, width, true, out);                                        \
        else                                                                                       \
            add_row(f, residuals, above, width, false, out);                                       \
        break;
    switch (filter) {
        CASE(NONE)
        CASE(LEFT)
        CASE(ABOVE)
        CASE(MEAN)
        CASE(MEDIAN)
    }
#undef CASE
}

// Sum of the absolute residuals. A row of 8-bit ones fits into 16 bits per channel.
static uint32_t cost_of(const lanes *residuals, uint32_t width, bool wide)
{
    if (!wide) {
        lanes sum = {0};
        for (uint32_t i = 0; i < width; i++) {
            const signed_lanes v = (signed_lanes)(residuals[i] << 8) >> 8, sign = v >> 15;
            sum += (lanes)((v ^ sign) - sign);
        }
        return (uint32_t)sum[0] + sum[1] + sum[2] + sum[3];
    }
    uint32_t sum = 0;
    for (uint32_t i = 0; i < width; i++)
        for (int c = 0; c < 4; c++) {
            const int v = (int16_t)residuals[i][c];
            sum += (uint32_t)(v < 0 ? -v : v);
        }
    return sum;
}

// Filters every row with the predictor that leaves the smallest residuals.
static void filter_rows(
    struct hg_page_codec *k, uint32_t width, uint32_t height, bool wide, uint8_t *filters)
{
    static const lanes zeroes[SIDE];
    for (uint32_t y = 0; y < height; y++) {
        const lanes *row = k->texels + (size_t)y * width, *above = y > 0 ? row - width : zeroes;
        uint32_t best = NONE, best_cost = UINT32_MAX;
        for (uint32_t f = NONE; f < FILTERS; f++) {
            subtract_row((enum filter)f, row, above, width, wide, k->trial[f]);
            const uint32_t cost = cost_of(k->trial[f], width, wide);
            if (cost < best_cost) {
                best = f;
                best_cost = cost;
            }
        }
        filters[y] = (uint8_t)best;
        memcpy(k->residuals + (size_t)y * width, k->trial[best], width * sizeof(lanes));
    }
}

// --- texels to lanes and back --------------------------------------------------------------------

// Four bytes to four 16-bit lanes in one word, and back. Texel bytes lie in memory order either
// way.
static inline uint64_t spread_bytes(uint32_t texel)
{
    uint64_t v = texel;
    v = (v | v << 16) & 0x0000ffff0000ffffu;
    return (v | v << 8) & 0x00ff00ff00ff00ffu;
}

static inline uint32_t gather_bytes(uint64_t v)
{
    v &= 0x00ff00ff00ff00ffu;
    v = (v | v >> 8) & 0x0000ffff0000ffffu;
    return (uint32_t)(v | v >> 16);
}

static void load_texels(struct hg_page_codec *k, const uint8_t *texels, size_t pitch,
    uint32_t width, uint32_t height, bool wide)
{
    for (uint32_t y = 0; y < height; y++, texels += pitch) {
        lanes *row = k->texels + (size_t)y * width;
        if (wide) {
            memcpy(row, texels, width * sizeof *row);
            continue;
        }
        for (uint32_t i = 0; i < width; i++) {
            uint32_t texel;
            memcpy(&texel, texels + i * 4, sizeof texel);
            const uint64_t v = spread_bytes(texel);
            memcpy(&row[i], &v, sizeof v);
        }
    }
}

static void store_row(const lanes *row, uint32_t width, bool wide, uint8_t *texels)
{
    if (wide) {
        memcpy(texels, row, width * sizeof *row);
        return;
    }
    for (uint32_t i = 0; i < width; i++) {
        uint64_t v;
        memcpy(&v, &row[i], sizeof v);
        const uint32_t texel = gather_bytes(v);
        memcpy(texels + i * 4, &texel, sizeof texel);
    }
}

// Bit c is set for a channel that is the same everywhere.
static uint8_t find_constants(const lanes *texels, uint32_t count)
{
    lanes differs = {0};
    for (uint32_t i = 1; i < count; i++)
        differs |= texels[i] ^ texels[0];
    uint8_t flags = 0;
    for (int c = 0; c < 4; c++)
        flags |= (uint8_t)((differs[c] == 0) << c);
    return flags;
}

// Whether a channel is smoother as a difference to green.
static bool follows_green(const lanes *texels, uint32_t count, int channel)
{
    uint64_t alone = 0, apart = 0;
    for (uint32_t i = 1; i < count; i++) {
        const int d = (int)texels[i][channel] - (int)texels[i - 1][channel];
        const int g = (int)texels[i][1] - (int)texels[i - 1][1];
        alone += (uint64_t)abs(d);
        apart += (uint64_t)abs(d - g);
    }
    return apart < alone;
}

static uint8_t subtract_green(struct hg_page_codec *k, uint32_t count, uint8_t constants)
{
    uint8_t flags = 0;
    if (constants & 2) // green itself is constant
        return 0;
    for (int c = 0; c < 3; c += 2) {
        if (constants >> c & 1 || !follows_green(k->texels, count, c))
            continue;
        flags |= c == 0 ? FLAG_RED_GREEN : FLAG_BLUE_GREEN;
        for (uint32_t i = 0; i < count; i++)
            k->texels[i][c] = (uint16_t)(k->texels[i][c] - k->texels[i][1]);
    }
    return flags;
}

// Constant channels become 0, 8-bit differences 8 bits.
static void mask_lanes(lanes *texels, uint32_t count, uint8_t constants, bool wide)
{
    lanes mask;
    for (int c = 0; c < 4; c++)
        mask[c] = constants >> c & 1 ? 0 : wide ? 0xffff : 0xff;
    for (uint32_t i = 0; i < count; i++)
        texels[i] &= mask;
}

// --- planes --------------------------------------------------------------------------------------

static size_t planes_size(uint8_t constants, uint32_t width, uint32_t height, bool wide)
{
    const unsigned channels = 4u - (unsigned)__builtin_popcount(constants & 15u);
    return height + (size_t)width * height * channels * (wide ? 2 : 1);
}

static void write_planes(
    struct hg_page_codec *k, uint32_t height, uint32_t count, uint8_t constants, bool wide)
{
    uint8_t *dst = k->planes + height;
    for (int c = 0; c < 4; c++) {
        if (constants >> c & 1)
            continue;
        for (uint32_t i = 0; i < count; i++)
            dst[i] = (uint8_t)k->residuals[i][c];
        dst += count;
        for (uint32_t i = 0; wide && i < count; i++)
            dst[i] = (uint8_t)(k->residuals[i][c] >> 8);
        dst += wide ? count : 0;
    }
}

static void read_planes(
    struct hg_page_codec *k, uint32_t height, uint32_t count, uint8_t constants, bool wide)
{
    static const uint8_t zeroes[TEXELS];
    const uint8_t *planes[4], *high[4], *src = k->planes + height;
    for (int c = 0; c < 4; c++) {
        const bool constant = constants >> c & 1;
        planes[c] = constant ? zeroes : src;
        high[c] = constant ? zeroes : src + count;
        src += constant ? 0 : wide ? 2 * count : count;
    }
    if (!wide) {
        for (uint32_t i = 0; i < count; i++)
            k->residuals[i] = (lanes){planes[0][i], planes[1][i], planes[2][i], planes[3][i]};
        return;
    }
    for (uint32_t i = 0; i < count; i++)
        for (int c = 0; c < 4; c++)
            k->residuals[i][c] = (uint16_t)(planes[c][i] | high[c][i] << 8);
}

// --- encode --------------------------------------------------------------------------------------

// Filters and every plane are blocks of their own, so that each gets its own entropy tables.
static size_t compress(
    struct hg_page_codec *k, uint32_t height, size_t plane, size_t size, int level)
{
    ZSTD_CCtx *z = k->compressor;
    ZSTD_CCtx_reset(z, ZSTD_reset_session_and_parameters);
    ZSTD_CCtx_setParameter(z, ZSTD_c_compressionLevel, level);
    ZSTD_CCtx_setParameter(z, ZSTD_c_contentSizeFlag, 0);
    ZSTD_CCtx_setPledgedSrcSize(z, size);
    ZSTD_outBuffer out = {k->packed, sizeof k->packed, 0};
    for (size_t at = 0; at < size;) {
        const size_t part = at == 0 ? height : plane;
        ZSTD_inBuffer in = {k->planes + at, part, 0};
        at += part;
        const ZSTD_EndDirective end = at == size ? ZSTD_e_end : ZSTD_e_flush;
        size_t left;
        do {
            left = ZSTD_compressStream2(z, &out, &in, end);
        } while (!ZSTD_isError(left) && left > 0 && out.pos < out.size);
        if (ZSTD_isError(left) || left > 0)
            return 0;
    }
    return out.pos;
}

enum hg_status hg_page_encode(struct hg_page_codec *k, const void *texels,
    const struct hg_texel_layout *layout, int level, struct hg_writer *out)
{
    const bool wide = layout->texel_bytes == 8;
    const uint32_t width = layout->width, height = layout->height, count = width * height;
    if (k->compressor == NULL && (k->compressor = ZSTD_createCCtx()) == NULL)
        return HG_E_NOMEM;
    load_texels(k, texels, layout->pitch_bytes, width, height, wide);
    const uint8_t constants = find_constants(k->texels, count);
    const lanes first = k->texels[0];
    const uint8_t flags = (uint8_t)(constants | subtract_green(k, count, constants));
    hg_write_u8(out, flags);
    for (int c = 0; c < 4; c++)
        if (constants >> c & 1)
            wide ? hg_write_u16(out, first[c]) : hg_write_u8(out, (uint8_t)first[c]);
    if ((constants & 15) != 15) {
        mask_lanes(k->texels, count, constants, wide);
        filter_rows(k, width, height, wide, k->planes);
        write_planes(k, height, count, constants, wide);
        const size_t size =
            compress(k, height, count, planes_size(constants, width, height, wide), level);
        if (size == 0)
            return HG_E_NOMEM;
        hg_write_bytes(out, k->packed, size);
    }
    return out->failed ? HG_E_NOMEM : HG_OK;
}

// --- decode --------------------------------------------------------------------------------------

static void finish_row(lanes *row, uint32_t width, uint8_t flags, const lanes *values)
{
    const uint16_t red = flags & FLAG_RED_GREEN ? 0xffff : 0,
                   blue = flags & FLAG_BLUE_GREEN ? 0xffff : 0;
    const lanes green = {red, 0, blue, 0};
    for (uint32_t i = 0; i < width; i++) {
        const uint16_t g = row[i][1];
        row[i] = (row[i] + ((lanes){g, g, g, g} & green)) | *values;
    }
}

static bool rebuild(struct hg_page_codec *k, uint8_t flags, lanes values,
    const struct hg_texel_layout *layout, uint8_t *texels)
{
    const bool wide = layout->texel_bytes == 8;
    const uint32_t width = layout->width, height = layout->height;
    const size_t pitch = layout->pitch_bytes;
    static const lanes zeroes[SIDE];
    const lanes *above = zeroes;
    for (uint32_t y = 0; y < height; y++, texels += pitch) {
        lanes *row = k->texels + (size_t)y * width;
        if (k->planes[y] >= FILTERS)
            return false;
        add_row_of(k->planes[y], k->residuals + (size_t)y * width, above, width, wide, row);
        above = row;
    }
    texels -= pitch * height;
    for (uint32_t y = 0; y < height; y++, texels += pitch) {
        lanes *row = k->texels + (size_t)y * width;
        finish_row(row, width, flags, &values);
        store_row(row, width, wide, texels);
    }
    return true;
}

enum hg_status hg_page_decode(struct hg_page_codec *k, const void *data, size_t size,
    const struct hg_texel_layout *layout, void *texels)
{
    const bool wide = layout->texel_bytes == 8;
    const uint32_t width = layout->width, height = layout->height;
    struct hg_reader r = hg_reader_make(data, size);
    const uint8_t flags = hg_read_u8(&r);
    lanes values = {0};
    for (int c = 0; c < 4; c++)
        if (flags >> c & 1)
            values[c] = wide ? hg_read_u16(&r) : hg_read_u8(&r);
    // A constant channel is stored as zeroes: green must not be one that others follow.
    if (r.failed || flags >> 6 || (flags & 2 && flags >> 4) ||
        (flags & 1 && flags & FLAG_RED_GREEN) || (flags & 4 && flags & FLAG_BLUE_GREEN))
        return HG_E_FORMAT;
    if ((flags & 15) == 15) {
        if (r.pos != size)
            return HG_E_FORMAT;
        memset(k->planes, NONE, height);
    } else {
        const size_t planes = planes_size(flags & 15, width, height, wide);
        const size_t done = ZSTD_decompressDCtx(k->decompressor, k->planes, sizeof k->planes,
            (const uint8_t *)data + r.pos, size - r.pos);
        if (ZSTD_isError(done) || done != planes)
            return HG_E_FORMAT;
    }
    read_planes(k, height, width * height, flags & 15, wide);
    return rebuild(k, flags, values, layout, texels) ? HG_OK : HG_E_FORMAT;
}
