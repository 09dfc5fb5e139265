#include "server/worker/encode/yuv.h"

#include <string.h>

#include "base/alloc.h"
#include "base/simd.h"

// Coefficients times 2^15; those of chroma sum to 0, so that grey is grey.
enum {
    SHIFT = 15,
    Y_R = 5983,
    Y_G = 20127,
    Y_B = 2032,
    CB_R = -3298,
    CB_G = -11094,
    CB_B = 14392,
    CR_R = 14392,
    CR_G = -13072,
    CR_B = -1320,
};

static uint32_t padded(uint32_t side, uint32_t least)
{
    const uint32_t even = (side + 1) & ~1u;
    return even > least ? even : least;
}

enum hg_status hg_yuv_create(
    uint32_t width, uint32_t height, uint32_t least, bool full_chroma, struct hg_yuv *out)
{
    *out = (struct hg_yuv){
        .width = padded(width, least), .height = padded(height, least), .full_chroma = full_chroma};
    const size_t luma = (size_t)out->width * out->height, chroma = full_chroma ? luma : luma / 4;
    out->planes[0] = hg_calloc(luma + 2 * chroma, 1);
    out->rows = hg_calloc(2 * ((size_t)out->width + 2), sizeof *out->rows);
    if (!out->planes[0] || !out->rows) {
        hg_yuv_finish(out);
        return HG_E_NOMEM;
    }
    out->planes[1] = out->planes[0] + luma;
    out->planes[2] = out->planes[1] + chroma;
    out->strides[0] = out->width;
    out->strides[1] = out->strides[2] = full_chroma ? out->width : out->width / 2;
    return HG_OK;
}

void hg_yuv_finish(struct hg_yuv *yuv)
{
    hg_free(yuv->planes[0]);
    hg_free(yuv->rows);
    *yuv = (struct hg_yuv){0};
}

// ---- rows; loops without branches, which compilers turn into vector code ------------------------

static inline uint32_t load(const uint8_t *rgba, uint32_t x)
{
    uint32_t p;
    memcpy(&p, rgba + 4 * (size_t)x, sizeof p);
    return p;
}

#define RED(p)   ((int32_t)((p)&255))
#define GREEN(p) ((int32_t)((p) >> 8 & 255))
#define BLUE(p)  ((int32_t)((p) >> 16 & 255))

HG_SIMD_LOOP
static void convert_luma(const uint8_t *restrict rgba, uint32_t width, uint8_t *restrict y)
{
    const int32_t offset = (16 << SHIFT) + (1 << (SHIFT - 1));
    for (uint32_t x = 0; x < width; x++) {
        const uint32_t p = load(rgba, x);
        y[x] = (uint8_t)((Y_R * RED(p) + Y_G * GREEN(p) + Y_B * BLUE(p) + offset) >> SHIFT);
    }
}

HG_SIMD_LOOP
static void convert_chroma_444(
    const uint8_t *restrict rgba, uint32_t width, uint8_t *restrict cb, uint8_t *restrict cr)
{
    const int32_t offset = (128 << SHIFT) + (1 << (SHIFT - 1));
    for (uint32_t x = 0; x < width; x++) {
        const uint32_t p = load(rgba, x);
        const int32_t r = RED(p), g = GREEN(p), b = BLUE(p);
        cb[x] = (uint8_t)((CB_R * r + CB_G * g + CB_B * b + offset) >> SHIFT);
        cr[x] = (uint8_t)((CR_R * r + CR_G * g + CR_B * b + offset) >> SHIFT);
    }
}

// Sums of two rows of pixels, times 2^15, from index 1 on.
HG_SIMD_LOOP
static void sum_chroma(const uint8_t *restrict upper, const uint8_t *restrict lower, uint32_t width,
    int32_t *restrict cb, int32_t *restrict cr)
{
    for (uint32_t x = 0; x < width; x++) {
        const uint32_t p = load(upper, x), q = load(lower, x);
        const int32_t r = RED(p) + RED(q), g = GREEN(p) + GREEN(q), b = BLUE(p) + BLUE(q);
        cb[x + 1] = CB_R * r + CB_G * g + CB_B * b;
        cr[x + 1] = CR_R * r + CR_G * g + CR_B * b;
    }
    cb[0] = cb[1];
    cr[0] = cr[1];
    cb[width + 1] = cb[width];
    cr[width + 1] = cr[width];
}

// (1 2 1) around every second one; eight pixels in all.
HG_SIMD_LOOP
static void filter_chroma(const int32_t *restrict sums, uint32_t count, uint8_t *restrict out)
{
    const int32_t offset = (128 << (SHIFT + 3)) + (1 << (SHIFT + 2));
    for (uint32_t i = 0; i < count; i++) {
        const int32_t *s = sums + 2 * (size_t)i;
        out[i] = (uint8_t)((s[0] + 2 * s[1] + s[2] + offset) >> (SHIFT + 3));
    }
}

// ---- planes -------------------------------------------------------------------------------------

static void convert_chroma_420(
    struct hg_yuv *yuv, const uint8_t *rgba, uint32_t width, uint32_t height)
{
    int32_t *cb = yuv->rows, *cr = yuv->rows + yuv->width + 2;
    for (uint32_t y = 0; y < height; y += 2) {
        const uint8_t *upper = rgba + 4 * (size_t)width * y;
        sum_chroma(upper, y + 1 < height ? upper + 4 * (size_t)width : upper, width, cb, cr);
        filter_chroma(cb, (width + 1) / 2, yuv->planes[1] + (size_t)yuv->strides[1] * (y / 2));
        filter_chroma(cr, (width + 1) / 2, yuv->planes[2] + (size_t)yuv->strides[2] * (y / 2));
    }
}

// Repeats the last column and row of what was written.
static void pad(struct hg_yuv *yuv, int plane, uint32_t width, uint32_t height)
{
    const size_t stride = yuv->strides[plane];
    const uint32_t rows = plane && !yuv->full_chroma ? yuv->height / 2 : yuv->height;
    uint8_t *p = yuv->planes[plane];
    for (uint32_t y = 0; y < height && width < stride; y++)
        memset(p + stride * y + width, p[stride * y + width - 1], stride - width);
    for (uint32_t y = height; y < rows; y++)
        memcpy(p + stride * y, p + stride * (height - 1), stride);
}

void hg_yuv_convert(struct hg_yuv *yuv, const uint8_t *rgba, uint32_t width, uint32_t height)
{
    for (uint32_t y = 0; y < height; y++) {
        const uint8_t *row = rgba + 4 * (size_t)width * y;
        const size_t at = (size_t)yuv->strides[0] * y;
        convert_luma(row, width, yuv->planes[0] + at);
        if (yuv->full_chroma)
            convert_chroma_444(row, width, yuv->planes[1] + at, yuv->planes[2] + at);
    }
    if (!yuv->full_chroma)
        convert_chroma_420(yuv, rgba, width, height);
    const uint32_t step = yuv->full_chroma ? 1 : 2;
    pad(yuv, 0, width, height);
    for (int plane = 1; plane < 3; plane++)
        pad(yuv, plane, (width + step - 1) / step, (height + step - 1) / step);
}
