// mips.c - see mips.h.
#include <math.h>
#include <pthread.h>
#include <string.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "renderer/texture/half.h"
#include "renderer/texture/mips.h"

// Weight of colour where alpha is 0, so that hidden texels still have a colour.
#define ALPHA_FLOOR  (1.0f / 1024.0f)
#define ENCODE_STEPS 4096

static float decode_table[256];                // sRGB code to linear
static float encode_limit[257];                // smallest linear value of a code; [256] = infinity
static uint8_t encode_guess[ENCODE_STEPS + 1]; // code at the low end of a step
static pthread_once_t tables_once = PTHREAD_ONCE_INIT;

static double srgb_to_linear(double c)
{
    return c <= 0.04045 ? c / 12.92 : pow((c + 0.055) / 1.055, 2.4);
}

static void make_tables(void)
{
    for (int i = 0; i < 256; i++) {
        decode_table[i] = (float)srgb_to_linear(i / 255.0);
        encode_limit[i] = i == 0 ? -INFINITY : (float)srgb_to_linear((i - 0.5) / 255.0);
    }
    encode_limit[256] = INFINITY;
    int code = 0;
    for (int i = 0; i <= ENCODE_STEPS; i++) {
        while ((float)i / ENCODE_STEPS >= encode_limit[code + 1])
            code++;
        encode_guess[i] = (uint8_t)code;
    }
}

static uint8_t encode_srgb(float linear)
{
    if (!(linear > 0.0f))
        return 0;
    if (linear >= 1.0f)
        return 255;
    int code = encode_guess[(int)(linear * ENCODE_STEPS)];
    while (linear >= encode_limit[code + 1])
        code++;
    return (uint8_t)code;
}

static uint8_t encode_unorm(float value)
{
    return !(value > 0.0f) ? 0 : value >= 1.0f ? 255 : (uint8_t)(value * 255.0f + 0.5f);
}

uint32_t hg_mips_count(uint32_t width, uint32_t height)
{
    const uint32_t longer = width > height ? width : height;
    return 32u - (uint32_t)__builtin_clz(longer | 1u);
}

uint32_t hg_mips_side(uint32_t side, uint32_t mip)
{
    return side >> mip > 0 ? side >> mip : 1;
}

// What is filtered: four floats per texel. Colours weighted by alpha, normals as vectors.
struct filter {
    bool srgb, weighted, normal, scale_alpha;
    float cutoff, coverage; // of mip 0
};

struct plane {
    float *texels;
    uint32_t width, height;
};

static float to_finite(float v)
{
    return v != v ? 0.0f : v > 65504.0f ? 65504.0f : v < -65504.0f ? -65504.0f : v;
}

static void load_rgba8(const uint8_t *src, uint32_t count, const struct filter *f, float *dst)
{
    for (uint32_t i = 0; i < count; i++, src += 4, dst += 4) {
        for (int c = 0; c < 3; c++)
            dst[c] = f->srgb ? decode_table[src[c]] : (float)src[c] * (1.0f / 255.0f);
        dst[3] = (float)src[3] * (1.0f / 255.0f);
    }
}

static void load_rgba16(const uint16_t *src, uint32_t count, const struct filter *f, float *dst)
{
    for (uint32_t i = 0; i < count * 4; i++) {
        const float v = (float)src[i] * (1.0f / 65535.0f);
        dst[i] = f->srgb && (i & 3) != 3 ? (float)srgb_to_linear((double)v) : v;
    }
}

// One row of mip 0 as floats to filter.
static void load_row(const struct hg_image *image, uint32_t y, const struct filter *f, float *dst)
{
    const uint32_t w = image->width;
    const size_t first = (size_t)y * w * 4;
    if (image->format == HG_PIXEL_RGBA8) {
        load_rgba8((const uint8_t *)image->pixels + first, w, f, dst);
    } else if (image->format == HG_PIXEL_RGBA16) {
        load_rgba16((const uint16_t *)image->pixels + first, w, f, dst);
    } else {
        const float *src = (const float *)image->pixels + first;
        for (size_t i = 0; i < (size_t)w * 4; i++)
            dst[i] = to_finite(src[i]);
    }
    if (f->normal) {
        for (size_t i = 0; i < (size_t)w * 4; i++)
            dst[i] = (i & 3) == 3 ? dst[i] : dst[i] * 2.0f - 1.0f;
    } else if (f->weighted) {
        for (float *t = dst; t < dst + (size_t)w * 4; t += 4) {
            const float a = t[3] + ALPHA_FLOOR;
            t[0] *= a;
            t[1] *= a;
            t[2] *= a;
        }
    }
}

// Overlap of texel i of `dst` texels with texels first.. of `src`: at most 3 weights, sum 1.
struct taps {
    uint32_t first, count;
    float weights[3];
};

static struct taps taps_at(uint32_t i, uint32_t src, uint32_t dst)
{
    struct taps t = {0};
    const double scale = (double)src / dst, from = i * scale, to = from + scale;
    t.first = (uint32_t)from;
    for (uint32_t x = t.first; x < src && t.count < 3; x++) {
        const double a = from > x ? from : x, b = to < x + 1.0 ? to : x + 1.0;
        if (b - a <= 1e-9)
            break;
        t.weights[t.count++] = (float)((b - a) / scale);
    }
    return t;
}

static void filter_row(const float *src, uint32_t src_width, float *dst, uint32_t dst_width)
{
    if (src_width == dst_width) { // 1 texel wide
        memcpy(dst, src, (size_t)dst_width * 4 * sizeof *dst);
        return;
    }
    if (src_width == dst_width * 2) {
        for (uint32_t i = 0; i < dst_width; i++)
            for (int c = 0; c < 4; c++)
                dst[i * 4 + c] = 0.5f * (src[i * 8 + c] + src[i * 8 + 4 + c]);
        return;
    }
    for (uint32_t i = 0; i < dst_width; i++) {
        const struct taps t = taps_at(i, src_width, dst_width);
        for (int c = 0; c < 4; c++) {
            float sum = 0.0f;
            for (uint32_t k = 0; k < t.count; k++)
                sum += t.weights[k] * src[(t.first + k) * 4 + c];
            dst[i * 4 + c] = sum;
        }
    }
}

// Makes `dst` from mip 0 (image) or from the mip above (src); rows: two rows of the source's width.
static void filter_level(const struct hg_image *image, const struct plane *src,
    const struct filter *f, float *rows, struct plane *dst)
{
    const uint32_t sw = src->width;
    const size_t n = (size_t)sw * 4;
    float *sum = rows, *row = rows + n;
    for (uint32_t y = 0; y < dst->height; y++) {
        const struct taps t = taps_at(y, src->height, dst->height);
        memset(sum, 0, n * sizeof *sum);
        for (uint32_t k = 0; k < t.count; k++) {
            const float *from = src->texels + (size_t)(t.first + k) * n;
            if (image != NULL) {
                load_row(image, t.first + k, f, row);
                from = row;
            }
            const float weight = t.weights[k];
            for (size_t i = 0; i < n; i++)
                sum[i] += weight * from[i];
        }
        filter_row(sum, sw, dst->texels + (size_t)y * dst->width * 4, dst->width);
    }
}

// Filtered floats back to what the mip holds.
static void resolve_texel(const struct filter *f, const float in[4], float out[4])
{
    memcpy(out, in, 4 * sizeof *out);
    if (f->normal) {
        const float length2 = in[0] * in[0] + in[1] * in[1] + in[2] * in[2];
        const float scale = length2 > 1e-12f ? 0.5f / sqrtf(length2) : 0.0f;
        out[0] = in[0] * scale + 0.5f;
        out[1] = in[1] * scale + 0.5f;
        out[2] = length2 > 1e-12f ? in[2] * scale + 0.5f : 1.0f;
    } else if (f->weighted) {
        const float scale = 1.0f / (in[3] + ALPHA_FLOOR);
        for (int c = 0; c < 3; c++)
            out[c] = in[c] * scale;
    }
}

static void store_level(
    const struct plane *p, const struct filter *f, uint32_t texel_bytes, void *dst)
{
    const size_t count = (size_t)p->width * p->height;
    for (size_t i = 0; i < count; i++) {
        float v[4];
        resolve_texel(f, p->texels + i * 4, v);
        if (texel_bytes == 8) {
            for (int c = 0; c < 4; c++)
                ((uint16_t *)dst)[i * 4 + c] = hg_half_from_float(v[c]);
            continue;
        }
        uint8_t *t = (uint8_t *)dst + i * 4;
        for (int c = 0; c < 3; c++)
            t[c] = f->srgb ? encode_srgb(v[c]) : encode_unorm(v[c]);
        t[3] = encode_unorm(v[3]);
    }
}

// Share of texels whose 8-bit alpha passes.
static float coverage_of(const uint8_t *texels, size_t count, float cutoff)
{
    size_t passed = 0;
    for (size_t i = 0; i < count; i++)
        passed += (float)texels[i * 4 + 3] * (1.0f / 255.0f) >= cutoff;
    return (float)passed / (float)count;
}

// Scales alpha so that the same share of texels passes as in mip 0.
static void keep_coverage(const struct filter *f, uint8_t *texels, size_t count)
{
    size_t histogram[256] = {0};
    for (size_t i = 0; i < count; i++)
        histogram[texels[i * 4 + 3]]++;
    const double want = (double)f->coverage * (double)count;
    size_t passed = 0;
    int best = 256;
    double best_gap = want; // nothing passes
    for (int a = 255; a > 0; a--) {
        passed += histogram[a];
        const double gap = fabs((double)passed - want);
        if (gap < best_gap) {
            best_gap = gap;
            best = a;
        }
    }
    const float scale = f->cutoff * 255.0f / ((float)best - 0.25f);
    for (size_t i = 0; i < count; i++)
        texels[i * 4 + 3] = encode_unorm((float)texels[i * 4 + 3] * (1.0f / 255.0f) * scale);
}

static enum hg_status allocate(struct hg_mips *m)
{
    size_t total = 0;
    for (uint32_t i = 0; i < m->count; i++) {
        const size_t texels = (size_t)hg_mips_side(m->width, i) * hg_mips_side(m->height, i);
        if (!hg_add_size(total, texels * m->texel_bytes, &total))
            return HG_E_NOMEM;
    }
    uint8_t *bytes = hg_calloc(total, 1);
    if (bytes == NULL)
        return HG_E_NOMEM;
    m->bytes = total;
    for (uint32_t i = 0; i < m->count; i++) {
        m->levels[i] = bytes;
        bytes += (size_t)hg_mips_side(m->width, i) * hg_mips_side(m->height, i) * m->texel_bytes;
    }
    return HG_OK;
}

static void store_mip0(
    const struct hg_image *image, const struct filter *f, struct hg_mips *m, float *row)
{
    if (m->texel_bytes == 4) {
        memcpy(m->levels[0], image->pixels, (size_t)m->width * m->height * 4);
        return;
    }
    struct filter plain = *f;
    plain.normal = plain.weighted = false;
    for (uint32_t y = 0; y < m->height; y++) {
        load_row(image, y, &plain, row);
        uint16_t *dst = (uint16_t *)(void *)m->levels[0] + (size_t)y * m->width * 4;
        for (size_t i = 0; i < (size_t)m->width * 4; i++)
            dst[i] = hg_half_from_float(row[i]);
    }
}

static void build_levels(const struct hg_image *image, struct filter *f, struct hg_mips *m,
    float *rows, float *planes[2])
{
    const size_t texels = (size_t)m->width * m->height;
    store_mip0(image, f, m, rows);
    f->scale_alpha = f->scale_alpha && m->texel_bytes == 4;
    if (f->scale_alpha)
        f->coverage = coverage_of(m->levels[0], texels, f->cutoff);
    struct plane src = {NULL, m->width, m->height};
    for (uint32_t i = 1; i < m->count; i++) {
        struct plane dst = {planes[i & 1], hg_mips_side(m->width, i), hg_mips_side(m->height, i)};
        filter_level(i == 1 ? image : NULL, &src, f, rows, &dst);
        store_level(&dst, f, m->texel_bytes, m->levels[i]);
        if (f->scale_alpha)
            keep_coverage(f, m->levels[i], (size_t)dst.width * dst.height);
        src = dst;
    }
}

enum hg_status hg_mips_build(
    const struct hg_image *image, const struct hg_mips_params *params, struct hg_mips *out)
{
    memset(out, 0, sizeof *out);
    if (image->width == 0 || image->height == 0 || image->width > 131072 || image->height > 131072)
        return HG_E_INVAL;
    pthread_once(&tables_once, make_tables);
    struct hg_mips m = {.width = image->width,
        .height = image->height,
        .count = hg_mips_count(image->width, image->height),
        .texel_bytes = image->format == HG_PIXEL_RGBA8 && !params->half ? 4 : 8};
    const enum hg_texture_use use = params->use;
    struct filter f = {.srgb = params->srgb,
        .weighted = use == HG_TEXTURE_BLEND || use == HG_TEXTURE_MASK,
        .normal = use == HG_TEXTURE_NORMAL,
        .scale_alpha = use == HG_TEXTURE_MASK && params->cutoff > 0.0f,
        .cutoff = params->cutoff};
    const size_t half = (size_t)hg_mips_side(m.width, 1) * hg_mips_side(m.height, 1) * 4;
    const size_t quarter = (size_t)hg_mips_side(m.width, 2) * hg_mips_side(m.height, 2) * 4;
    float *rows = hg_calloc((size_t)m.width * 8, sizeof *rows);
    float *planes[2] = {hg_calloc(quarter, sizeof(float)), hg_calloc(half, sizeof(float))};
    enum hg_status status = HG_E_NOMEM;
    if (rows != NULL && planes[0] != NULL && planes[1] != NULL)
        status = allocate(&m);
    if (status == HG_OK) {
        build_levels(image, &f, &m, rows, planes);
        *out = m;
    }
    hg_free(rows);
    hg_free(planes[0]);
    hg_free(planes[1]);
    return status;
}

void hg_mips_finish(struct hg_mips *mips)
{
    hg_free(mips->levels[0]);
    memset(mips, 0, sizeof *mips);
}
