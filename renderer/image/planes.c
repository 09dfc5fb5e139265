#include "renderer/image/planes.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/checked.h"

float *hg_planes_create(uint32_t width, uint32_t height, size_t count)
{
    size_t n;
    if (!hg_mul_size((size_t)width * height, count, &n))
        return NULL;
    return hg_calloc(n, sizeof(float));
}

static float clamp01(float v)
{
    return v > 0.0f ? (v < 1.0f ? v : 1.0f) : 0.0f; // NaN is 0
}

void hg_display_pixel(const struct hg_image *image, size_t i, float rgb[3])
{
    if (image->format == HG_PIXEL_RGBA8) {
        const uint8_t *p = (const uint8_t *)image->pixels + i * 4;
        float alpha = (float)p[3] / 255.0f;
        for (int c = 0; c < 3; c++)
            rgb[c] = (float)p[c] / 255.0f * alpha;
    } else {
        const float *p = (const float *)image->pixels + i * 4;
        float alpha = clamp01(p[3]);
        for (int c = 0; c < 3; c++)
            rgb[c] = clamp01(p[c]) * alpha;
    }
}

static uint32_t clamp_index(int64_t i, uint32_t count)
{
    return i < 0 ? 0 : i >= count ? count - 1 : (uint32_t)i;
}

static void filter_row(float *dst, const float *src, uint32_t width, const struct hg_taps *taps)
{
    int r = taps->radius;
    memset(dst, 0, width * sizeof *dst);
    for (int t = -r; t <= r; t++) {
        float k = taps->x[t + r];
        uint32_t first = t < 0 ? (uint32_t)-t : 0, end = t > 0 ? width - (uint32_t)t : width;
        if (t > 0 && (uint32_t)t >= width)
            end = 0;
        for (uint32_t x = 0; x < first && x < width; x++)
            dst[x] += k * src[0];
        for (uint32_t x = first; x < end; x++)
            dst[x] += k * src[(int64_t)x + t];
        for (uint32_t x = end > first ? end : first; x < width && t > 0; x++)
            dst[x] += k * src[width - 1];
    }
}

static void add_row(float *restrict dst, const float *restrict src, uint32_t width, float k)
{
    for (uint32_t x = 0; x < width; x++)
        dst[x] += k * src[x];
}

void hg_plane_filter_add(float *dst, const float *src, float *scratch, const uint32_t size_px[2],
    const struct hg_taps *taps, float weight)
{
    const uint32_t width = size_px[0], height = size_px[1];
    int r = taps->radius;
    for (uint32_t y = 0; y < height; y++)
        filter_row(scratch + (size_t)y * width, src + (size_t)y * width, width, taps);
    for (uint32_t y = 0; y < height; y++)
        for (int t = -r; t <= r; t++) {
            size_t from = clamp_index((int64_t)y + t, height);
            add_row(
                dst + (size_t)y * width, scratch + from * width, width, weight * taps->y[t + r]);
        }
}

static uint8_t heat_channel(float e, int channel)
{
    static const float stops[5][3] = {
        {0, 0, 0}, {70, 15, 120}, {190, 45, 95}, {250, 150, 60}, {252, 253, 200}};
    float at = clamp01(e) * 4.0f;
    int i = at >= 4.0f ? 3 : (int)at;
    float v = stops[i][channel] + (stops[i + 1][channel] - stops[i][channel]) * (at - (float)i);
    return (uint8_t)(v + 0.5f);
}

enum hg_status hg_heat_map(
    const float *error, uint32_t width, uint32_t height, struct hg_image *out)
{
    enum hg_status st = hg_image_create(width, height, HG_PIXEL_RGBA8, NULL, out);
    if (st)
        return st;
    uint8_t *px = out->pixels;
    for (size_t i = 0; i < (size_t)width * height; i++) {
        for (int c = 0; c < 3; c++)
            px[i * 4 + (size_t)c] = heat_channel(error[i], c);
        px[i * 4 + 3] = 255;
    }
    return HG_OK;
}
