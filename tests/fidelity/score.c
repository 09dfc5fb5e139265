#include "tests/fidelity/score.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <webp/decode.h>
#include <webp/encode.h>

#include "base/alloc.h"

static const double largest_delta = 35215.0;
static const double equal_db = -100.0;

static double over_white(const uint8_t *px, int channel)
{
    double alpha = px[3] / 255.0;
    return 255.0 + (px[channel] - 255.0) * alpha;
}

static double pixel_delta(const uint8_t *a, const uint8_t *b)
{
    double d[3];
    for (int c = 0; c < 3; c++)
        d[c] = over_white(a, c) - over_white(b, c);
    double y = 0.29889531 * d[0] + 0.58662247 * d[1] + 0.11448223 * d[2];
    double i = 0.59597799 * d[0] - 0.27417610 * d[1] - 0.32180189 * d[2];
    double q = 0.21147017 * d[0] - 0.52261711 * d[1] + 0.31114694 * d[2];
    return 0.5053 * y * y + 0.299 * i * i + 0.1957 * q * q;
}

double score_db(const struct hg_image *candidate, const struct hg_image *golden)
{
    const uint8_t *a = candidate->pixels, *b = golden->pixels;
    double sum = 0, count = 0;
    for (size_t i = 0; i < candidate->size_bytes; i += 4) {
        if (a[i + 3] == 0)
            continue;
        double delta = pixel_delta(a + i, b + i);
        sum += delta * delta;
        count += 1;
    }
    if (count == 0)
        return NAN;
    double rms = sqrt(sum / count) / largest_delta;
    return rms > 0 ? fmax(10 * log10(rms), equal_db) : equal_db;
}

double score_distance(const struct hg_image *a, const struct hg_image *b)
{
    double ab = score_db(a, b), ba = score_db(b, a);
    if (isnan(ab) || isnan(ba))
        return isnan(ab) && isnan(ba) ? equal_db : 0;
    return fmax(ab, ba);
}

static void *take(size_t count, size_t size)
{
    void *p = hg_calloc(count, size);
    if (!p) {
        fprintf(stderr, "no memory for %zu values\n", count);
        exit(1);
    }
    return p;
}

static double lanczos3(double x)
{
    x = fabs(x) * 3.14159265358979;
    if (x < 1e-9)
        return 1;
    return x >= 3 * 3.14159265358979 ? 0 : sin(x) * sin(x / 3) / (x * x / 3);
}

// Resamples rows: src is [height][from][4], dst is [to][height][4] (turned, so that a second call
// does the other direction).
static void resize_turned(const float *src, uint32_t from, uint32_t height, float *dst, uint32_t to)
{
    double scale = (double)from / to, stretch = fmax(scale, 1), reach = 3 * stretch;
    for (uint32_t x = 0; x < to; x++) {
        double center = (x + 0.5) * scale - 0.5;
        int first = (int)ceil(center - reach), last = (int)floor(center + reach);
        double total = 0;
        for (int s = first; s <= last; s++)
            total += lanczos3((s - center) / stretch);
        for (int s = first; s <= last; s++) {
            float k = (float)(lanczos3((s - center) / stretch) / total);
            uint32_t at = s < 0 ? 0 : s >= (int)from ? from - 1 : (uint32_t)s;
            for (uint32_t y = 0; y < height; y++)
                for (int c = 0; c < 4; c++)
                    dst[((size_t)x * height + y) * 4 + (size_t)c] +=
                        k * src[((size_t)y * from + at) * 4 + (size_t)c];
        }
    }
}

static void to_premultiplied(const struct hg_image *image, float *dst)
{
    const uint8_t *px = image->pixels;
    for (size_t i = 0; i < image->size_bytes; i++)
        dst[i] = (float)px[i] * (i % 4 == 3 ? 1.0f : (float)px[i / 4 * 4 + 3] / 255.0f);
}

static void from_premultiplied(const float *src, struct hg_image *image)
{
    uint8_t *px = image->pixels;
    for (size_t i = 0; i < image->size_bytes; i++) {
        float alpha = src[i / 4 * 4 + 3], v = src[i];
        if (i % 4 != 3)
            v = alpha > 0.5f ? v * 255.0f / fminf(alpha, 255.0f) : 0;
        px[i] = (uint8_t)fminf(fmaxf(v + 0.5f, 0.0f), 255.0f);
    }
}

void score_resize(
    const struct hg_image *image, uint32_t width, uint32_t height, struct hg_image *out)
{
    float *full = take((size_t)image->width * image->height * 4, sizeof(float));
    float *half = take((size_t)width * image->height * 4, sizeof(float));
    float *small = take((size_t)width * height * 4, sizeof(float));
    if (hg_image_create(width, height, HG_PIXEL_RGBA8, NULL, out))
        exit(1);
    to_premultiplied(image, full);
    resize_turned(full, image->width, image->height, half, width);
    resize_turned(half, image->height, width, small, height);
    from_premultiplied(small, out);
    out->has_alpha = image->has_alpha;
    hg_free(full);
    hg_free(half);
    hg_free(small);
}

bool score_as_webp(struct hg_image *image, float quality)
{
    uint8_t *bytes = NULL;
    int width = (int)image->width, height = (int)image->height;
    size_t size = WebPEncodeRGBA(image->pixels, width, height, width * 4, quality, &bytes);
    bool ok = size && WebPDecodeRGBAInto(bytes, size, image->pixels, image->size_bytes, width * 4);
    WebPFree(bytes);
    return ok;
}
