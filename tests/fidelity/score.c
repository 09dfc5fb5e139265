#include "tests/fidelity/score.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <webp/decode.h>
#include <webp/encode.h>

#include "base/alloc.h"
#include "base/file.h"

static const double largest_delta = 35215.0;
static const double equal_db = -100.0;
enum { max_webp_bytes = 64 << 20 };

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

static double decibels(double sum, double count)
{
    if (count == 0)
        return NAN;
    double rms = sqrt(sum / count) / largest_delta;
    return rms > 0 ? fmax(10 * log10(rms), equal_db) : equal_db;
}

// Of the pixels that are not transparent in each of the two.
static void both_db(const struct hg_image *a, const struct hg_image *b, double db[2])
{
    const uint8_t *pa = a->pixels, *pb = b->pixels;
    double sum[2] = {0}, count[2] = {0};
    for (size_t i = 0; i < a->size_bytes; i += 4) {
        double delta = pixel_delta(pa + i, pb + i);
        const bool shows[2] = {pa[i + 3] != 0, pb[i + 3] != 0};
        for (int k = 0; k < 2; k++) {
            sum[k] += shows[k] ? delta * delta : 0;
            count[k] += shows[k];
        }
    }
    for (int k = 0; k < 2; k++)
        db[k] = decibels(sum[k], count[k]);
}

double score_db(const struct hg_image *candidate, const struct hg_image *golden)
{
    double db[2];
    both_db(candidate, golden, db);
    return db[0];
}

double score_distance(const struct hg_image *a, const struct hg_image *b)
{
    double db[2];
    both_db(a, b, db);
    if (isnan(db[0]) || isnan(db[1]))
        return isnan(db[0]) && isnan(db[1]) ? equal_db : 0;
    return fmax(db[0], db[1]);
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

// Where a pixel of the smaller row reads, and how much of each: `weights` has room for a row.
static void tap_weights(double scale, uint32_t x, int taps[2], float *weights)
{
    double stretch = fmax(scale, 1), reach = 3 * stretch;
    double center = (x + 0.5) * scale - 0.5, total = 0;
    taps[0] = (int)ceil(center - reach);
    taps[1] = (int)floor(center + reach);
    for (int s = taps[0]; s <= taps[1]; s++)
        total += lanczos3((s - center) / stretch);
    for (int s = taps[0]; s <= taps[1]; s++)
        weights[s - taps[0]] = (float)(lanczos3((s - center) / stretch) / total);
}

// Resamples rows: src is [height][from][4], dst is [to][height][4] (turned, so that a second call
// does the other direction).
static void resize_turned(const float *src, uint32_t from, uint32_t height, float *dst, uint32_t to)
{
    const double scale = (double)from / to;
    float *weights = take((size_t)(6 * fmax(scale, 1)) + 2, sizeof *weights);
    for (uint32_t x = 0; x < to; x++) {
        int taps[2];
        tap_weights(scale, x, taps, weights);
        for (uint32_t y = 0; y < height; y++) {
            float sum[4] = {0};
            for (int s = taps[0]; s <= taps[1]; s++) {
                uint32_t at = s < 0 ? 0 : s >= (int)from ? from - 1 : (uint32_t)s;
                for (size_t c = 0; c < 4; c++)
                    sum[c] += weights[s - taps[0]] * src[((size_t)y * from + at) * 4 + c];
            }
            memcpy(dst + ((size_t)x * height + y) * 4, sum, sizeof sum);
        }
    }
    hg_free(weights);
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

enum hg_status score_open_webp(const char *path, struct score_webp *out, struct hg_error *err)
{
    WebPBitstreamFeatures features;
    *out = (struct score_webp){0};
    enum hg_status status = hg_file_read(path, max_webp_bytes, &out->bytes, &out->size, err);
    if (status)
        return status;
    if (WebPGetFeatures(out->bytes, out->size, &features) != VP8_STATUS_OK) {
        score_close_webp(out);
        return hg_error_set(err, HG_E_FORMAT, path, NULL, "is not a WebP file");
    }
    out->width = (uint32_t)features.width;
    out->height = (uint32_t)features.height;
    out->has_alpha = features.has_alpha;
    return HG_OK;
}

void score_close_webp(struct score_webp *webp)
{
    hg_free(webp->bytes);
    *webp = (struct score_webp){0};
}

enum hg_status score_read_webp(const char *path, struct hg_image *out, struct hg_error *err)
{
    struct score_webp webp;
    *out = (struct hg_image){0};
    enum hg_status status = score_open_webp(path, &webp, err);
    if (status)
        return status;
    status = hg_image_create(webp.width, webp.height, HG_PIXEL_RGBA8, NULL, out);
    if (status) {
        hg_error_set(
            err, status, path, NULL, "no memory for %ux%u pixels", webp.width, webp.height);
    } else if (!WebPDecodeRGBAInto(
                   webp.bytes, webp.size, out->pixels, out->size_bytes, (int)webp.width * 4)) {
        hg_image_finish(out);
        status = hg_error_set(err, HG_E_FORMAT, path, NULL, "cannot be decoded");
    }
    out->has_alpha = webp.has_alpha;
    score_close_webp(&webp);
    return status;
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
