#include "renderer/light/emitters/emissive_mips.h"

#include <math.h>

#include "base/alloc.h"
#include "renderer/math/vec.h"
#include "renderer/texture/source/page_source.h"

#define MOST_TEXELS 4 // per axis that one lookup adds up, about

// --- texels --------------------------------------------------------------------------------------

static float srgb_decode(float v)
{
    return v <= 0.04045f ? v / 12.92f : powf((v + 0.055f) / 1.055f, 2.4f);
}

static float luminance_at(const uint8_t *texel, const struct hg_page_source_info *info)
{
    static const float weights[3] = {0.2126f, 0.7152f, 0.0722f};
    float sum = 0;
    for (int c = 0; c < 3; c++) {
        uint16_t half;
        memcpy(&half, texel + 2 * (info->texel_bytes == 8 ? c : 0), sizeof half);
        float v = info->texel_bytes == 8 ? hg_half_to_float(half) : (float)texel[c] / 255;
        if (info->pool == HG_POOL_SRGB)
            v = srgb_decode(v);
        sum += v > 0 && v < 1e30f ? v * weights[c] : 0;
    }
    return sum;
}

struct reading {
    struct hg_page_source *source;
    const struct hg_page_source_info *info;
    uint32_t mip;
    uint8_t *page;
    struct hg_emissive_mips *out;
};

// One page of the mip into its place; the corner of its payload in the page is (cx, cy).
static void take_page(const struct reading *r, uint32_t px, uint32_t py, uint32_t cx, uint32_t cy)
{
    const struct hg_emissive_mips *g = r->out;
    const uint32_t x0 = px * HG_PAGE_TEXELS, y0 = py * HG_PAGE_TEXELS;
    for (uint32_t y = 0; y < HG_PAGE_TEXELS && y0 + y < g->height; y++)
        for (uint32_t x = 0; x < HG_PAGE_TEXELS && x0 + x < g->width; x++)
            g->texels[0][(size_t)(y0 + y) * g->width + x0 + x] = luminance_at(
                r->page + ((size_t)(cy + y) * HG_PAGE_PITCH + cx + x) * r->info->texel_bytes,
                r->info);
}

static enum hg_status read_mip(const struct reading *r, struct hg_error *err)
{
    const uint32_t tail = r->info->layout.tail;
    if (r->mip >= tail) {
        const uint32_t j = r->mip - tail;
        enum hg_status status = hg_page_source_read(r->source, tail, 0, 0, r->page, err);
        if (!status)
            take_page(r, 0, 0, HG_TAIL_X(j) + HG_PAGE_BORDER, HG_TAIL_Y(j) + HG_PAGE_BORDER);
        return status;
    }
    enum hg_status status = HG_OK;
    for (uint32_t y = 0; y * HG_PAGE_TEXELS < r->out->height && !status; y++)
        for (uint32_t x = 0; x * HG_PAGE_TEXELS < r->out->width && !status; x++) {
            status = hg_page_source_read(r->source, r->mip, x, y, r->page, err);
            if (!status)
                take_page(r, x, y, HG_PAGE_BORDER, HG_PAGE_BORDER);
        }
    return status;
}

// --- levels --------------------------------------------------------------------------------------

static uint32_t side_at(uint32_t side, uint32_t level)
{
    return side >> level > 0 ? side >> level : 1;
}

static enum hg_status allocate(struct hg_emissive_mips *g, uint32_t width, uint32_t height)
{
    g->width = width;
    g->height = height;
    do {
        g->texels[g->levels] = hg_calloc(
            (size_t)side_at(width, g->levels) * side_at(height, g->levels), sizeof(float));
        if (!g->texels[g->levels++])
            return HG_E_NOMEM;
    } while (side_at(width, g->levels - 1) > 1 || side_at(height, g->levels - 1) > 1);
    return HG_OK;
}

// Each texel of a coarser level is the mean of those it covers; of three where a side is odd.
static void shrink(const struct hg_emissive_mips *g, uint32_t level)
{
    const uint32_t fw = side_at(g->width, level - 1), fh = side_at(g->height, level - 1);
    const uint32_t w = side_at(g->width, level), h = side_at(g->height, level);
    const float *from = g->texels[level - 1];
    for (uint32_t y = 0; y < h; y++)
        for (uint32_t x = 0; x < w; x++) {
            const uint32_t y1 = y + 1 < h ? 2 * y + 2 : fh, x1 = x + 1 < w ? 2 * x + 2 : fw;
            float sum = 0;
            for (uint32_t fy = 2 * y; fy < y1; fy++)
                for (uint32_t fx = 2 * x; fx < x1; fx++)
                    sum += from[(size_t)fy * fw + fx];
            g->texels[level][(size_t)y * w + x] = sum / (float)((y1 - 2 * y) * (x1 - 2 * x));
        }
}

static enum hg_status make_white(struct hg_emissive_mips *g)
{
    hg_emissive_mips_finish(g);
    enum hg_status status = allocate(g, 1, 1);
    if (!status)
        g->texels[0][0] = 1;
    return status;
}

static enum hg_status make_from(struct hg_page_source *source, struct hg_emissive_mips *out)
{
    struct hg_error err = {0};
    struct reading r = {.source = source, .info = hg_page_source_info(source), .out = out};
    if (hg_page_source_wait(source, &err) != HG_OK)
        return make_white(out);
    const struct hg_page_layout *l = &r.info->layout;
    while (r.mip + 1 < l->mips && (side_at(l->width, r.mip) > HG_EMISSIVE_MIPS_SIDE ||
                                      side_at(l->height, r.mip) > HG_EMISSIVE_MIPS_SIDE))
        r.mip++;
    enum hg_status status = allocate(out, side_at(l->width, r.mip), side_at(l->height, r.mip));
    r.page = hg_calloc((size_t)HG_PAGE_PITCH * HG_PAGE_PITCH, r.info->texel_bytes);
    if (!status && !r.page)
        status = HG_E_NOMEM;
    const bool unreadable = !status && read_mip(&r, &err) != HG_OK;
    hg_free(r.page);
    if (status || unreadable)
        return status ? status : make_white(out);
    for (uint32_t level = 1; level < out->levels; level++)
        shrink(out, level);
    return HG_OK;
}

enum hg_status hg_emissive_mips_make(struct hg_page_sources *sources,
    const struct hg_texture *texture, enum hg_texture_use use, uint32_t cutoff,
    struct hg_emissive_mips *out)
{
    struct hg_error err = {0};
    struct hg_page_source *source;
    const struct hg_page_source_params params = {.image = texture->image,
        .use = use,
        .cutoff = (uint8_t)cutoff,
        .wrap_s = texture->wrap_s,
        .wrap_t = texture->wrap_t};
    *out = (struct hg_emissive_mips){0};
    enum hg_status status;
    if (!texture->image || hg_page_source_open(sources, &params, &source, &err) != HG_OK) {
        status = make_white(out);
    } else {
        status = make_from(source, out);
        hg_page_source_close(source);
    }
    out->wrap_s = texture->wrap_s;
    out->wrap_t = texture->wrap_t;
    if (status)
        hg_emissive_mips_finish(out);
    return status;
}

void hg_emissive_mips_finish(struct hg_emissive_mips *g)
{
    for (uint32_t i = 0; i < HG_EMISSIVE_MIPS_LEVELS; i++)
        hg_free(g->texels[i]);
    *g = (struct hg_emissive_mips){0};
}

// --- lookups -------------------------------------------------------------------------------------

static uint32_t wrapped(int64_t i, uint32_t side, enum hg_wrap wrap)
{
    const int64_t n = side;
    if (wrap == HG_WRAP_CLAMP)
        return (uint32_t)(i < 0 ? 0 : i >= n ? n - 1 : i);
    const int64_t period = wrap == HG_WRAP_MIRROR ? 2 * n : n;
    int64_t at = i % period;
    at = at < 0 ? at + period : at;
    return (uint32_t)(at < n ? at : period - 1 - at);
}

float hg_emissive_mips_mean(
    const struct hg_emissive_mips *g, const float min[2], const float max[2])
{
    const uint32_t last = g->levels - 1;
    const double span_x = (double)(max[0] - min[0]) * g->width;
    const double span_y = (double)(max[1] - min[1]) * g->height;
    uint32_t level = 0;
    while (level < last && fmax(span_x, span_y) > (double)(MOST_TEXELS << level))
        level++;
    const bool wild = !(fabsf(min[0]) < 1e6f && fabsf(min[1]) < 1e6f && fabsf(max[0]) < 1e6f &&
                          fabsf(max[1]) < 1e6f) ||
                      max[0] - min[0] > 1 || max[1] - min[1] > 1;
    if (wild)
        return g->texels[last][0];
    const uint32_t w = side_at(g->width, level), h = side_at(g->height, level);
    // Half a texel around the box: what bilinear lookups see.
    const int64_t x0 = (int64_t)floor((double)min[0] * w - 0.5);
    const int64_t x1 = (int64_t)floor((double)max[0] * w + 0.5);
    const int64_t y0 = (int64_t)floor((double)min[1] * h - 0.5);
    const int64_t y1 = (int64_t)floor((double)max[1] * h + 0.5);
    double sum = 0;
    for (int64_t y = y0; y <= y1; y++)
        for (int64_t x = x0; x <= x1; x++)
            sum += (double)g->texels[level][(size_t)wrapped(y, h, g->wrap_t) * w +
                                            wrapped(x, w, g->wrap_s)];
    return (float)(sum / (double)((x1 - x0 + 1) * (y1 - y0 + 1)));
}
