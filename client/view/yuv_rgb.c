#include "client/view/yuv_rgb.h"

#include <string.h>

#include "base/alloc.h"
#include "base/simd.h"

// Coefficients times 2^13; chroma comes 8 times as large.
enum { SHIFT = 16, Y = 9539 << 3, R_CR = 14686, G_CB = -1747, G_CR = -4366, B_CB = 17305 };

// Three quarters of the nearer row and a quarter of the other one, and between columns the mean: 8
// times the value. `sums` has room for one more than a pair of columns.
HG_SIMD_LOOP
static void sum_rows(const uint8_t *restrict near, const uint8_t *restrict far, uint32_t count,
    int32_t *restrict sums)
{
    for (uint32_t i = 0; i < count; i++)
        sums[i] = 3 * near[i] + far[i] - 4 * 128;
    sums[count] = sums[count - 1];
}

HG_SIMD_LOOP
static void widen(const int32_t *restrict sums, uint32_t count, int32_t *restrict out)
{
    for (uint32_t i = 0; i < count; i++) {
        out[2 * i] = 2 * sums[i];
        out[2 * i + 1] = sums[i] + sums[i + 1];
    }
}

static inline uint32_t clamp(int32_t v)
{
    v = v < 0 ? 0 : v;
    return (uint32_t)(v > 255 ? 255 : v);
}

HG_SIMD_LOOP
static void convert(const uint8_t *restrict luma, const int32_t *restrict cb,
    const int32_t *restrict cr, uint32_t width, uint8_t *restrict rgba)
{
    for (uint32_t x = 0; x < width; x++) {
        const int32_t base = Y * (luma[x] - 16) + (1 << (SHIFT - 1));
        const uint32_t p = clamp((base + R_CR * cr[x]) >> SHIFT) |
                           clamp((base + G_CB * cb[x] + G_CR * cr[x]) >> SHIFT) << 8 |
                           clamp((base + B_CB * cb[x]) >> SHIFT) << 16 | 255u << 24;
        memcpy(rgba + 4 * (size_t)x, &p, 4);
    }
}

enum hg_status hg_view_rgb_of_planes(
    const struct hg_view_planes *planes, uint32_t width, uint32_t height, uint8_t *rgba)
{
    const uint32_t columns = (width + 1) / 2, rows = (height + 1) / 2;
    int32_t *sums = hg_calloc(5 * (size_t)columns + 1, sizeof *sums);
    if (!sums)
        return HG_E_NOMEM;
    int32_t *cb = sums + columns + 1, *cr = cb + 2 * (size_t)columns;
    for (uint32_t y = 0; y < height; y++) {
        const uint32_t near = y / 2,
                       other = y % 2  ? near + 1
                               : near ? near - 1
                                      : 0,
                       far = other < rows ? other : near;
        const size_t a = planes->c_pitch * near, b = planes->c_pitch * far;
        sum_rows(planes->cb + a, planes->cb + b, columns, sums);
        widen(sums, columns, cb);
        sum_rows(planes->cr + a, planes->cr + b, columns, sums);
        widen(sums, columns, cr);
        convert(planes->y + planes->y_pitch * y, cb, cr, width, rgba + 4 * (size_t)width * y);
    }
    hg_free(sums);
    return HG_OK;
}
