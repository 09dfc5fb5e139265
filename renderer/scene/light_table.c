#include "renderer/scene/light_table.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/hash.h"
#include "renderer/math/vec.h"
#include "renderer/scene/scene.h"

#define MOST_PIXELS (1u << 24) // of an image file that is averaged down

_Static_assert(HG_LIGHT_WRAP_REPEAT == HG_WRAP_REPEAT && HG_LIGHT_WRAP_CLAMP == HG_WRAP_CLAMP &&
                   HG_LIGHT_WRAP_MIRROR == HG_WRAP_MIRROR,
    "words hold enum hg_wrap");

// --- life ----------------------------------------------------------------------------------------

static struct hg_light_table *create(uint32_t word_count)
{
    struct hg_light_table *table = hg_calloc(1, sizeof *table + (size_t)word_count * 4);
    if (table) {
        table->refs = 1;
        table->word_count = word_count;
    }
    return table;
}

static void seal(struct hg_light_table *table)
{
    table->hash = hg_hash_mix_bytes(table->word_count, table->words, (size_t)table->word_count * 4);
}

struct hg_light_table *hg_light_table_ref(struct hg_light_table *table)
{
    table->refs++;
    return table;
}

void hg_light_table_unref(struct hg_light_table *table)
{
    if (table && --table->refs == 0)
        hg_free(table);
}

// --- profiles ------------------------------------------------------------------------------------

// Integral of the sine over what linear interpolation gives theta i of.
static double theta_weight(uint32_t i, uint32_t thetas)
{
    const double step = HG_PI / (thetas - 1);
    if (i == 0 || i == thetas - 1)
        return 1 - sin(step) / step;
    return 2 * sin(i * step) * (1 - cos(step)) / step;
}

enum hg_status hg_light_profile_create(
    const float *factors, uint32_t thetas, uint32_t phis, struct hg_light_table **out)
{
    const uint32_t count = thetas * phis;
    float most = 0;
    double sum = 0;
    *out = NULL;
    for (uint32_t i = 0; i < count; i++)
        most = fmaxf(most, factors[i]);
    if (!(most > 0))
        return HG_E_INVAL;
    struct hg_light_table *table = create(HG_LIGHT_PROFILE_HEAD + count);
    if (!table)
        return HG_E_NOMEM;
    table->words[0] = thetas | phis << 16;
    for (uint32_t i = 0; i < count; i++) {
        const float factor = factors[i] / most;
        memcpy(&table->words[HG_LIGHT_PROFILE_HEAD + i], &factor, sizeof factor);
        sum += (double)factor * theta_weight(i % thetas, thetas);
    }
    table->peak_cd = most;
    table->solid_angle = (float)(sum * 2 * HG_PI / phis);
    seal(table);
    *out = table;
    return HG_OK;
}

float hg_light_profile_at(const uint32_t *words, const float direction[3])
{
    const uint32_t thetas = words[0] & 0xffff, phis = words[0] >> 16;
    const uint32_t *factors = words + HG_LIGHT_PROFILE_HEAD;
    const float pi = (float)HG_PI;
    const float t = acosf(hg_clampf(-direction[2], -1, 1)) / pi * (float)(thetas - 1);
    const float turn = atan2f(direction[1], direction[0]) / (2 * pi);
    const float p = (turn < 0 ? turn + 1 : turn) * (float)phis;
    const uint32_t t0 = (uint32_t)fminf(t, (float)(thetas - 2)), p0 = (uint32_t)p % phis;
    const uint32_t p1 = (p0 + 1) % phis;
    const float ft = t - (float)t0, fp = phis > 1 ? p - floorf(p) : 0;
    float low[2], high[2];
    memcpy(low, factors + p0 * thetas + t0, sizeof low);
    memcpy(high, factors + p1 * thetas + t0, sizeof high);
    const float a = low[0] + (low[1] - low[0]) * ft, b = high[0] + (high[1] - high[0]) * ft;
    return a + (b - a) * fp;
}

// --- images --------------------------------------------------------------------------------------

static uint32_t side_at(uint32_t side, uint32_t level)
{
    return side >> level > 0 ? side >> level : 1;
}

static float linear_of(float v, bool srgb)
{
    if (!(v > 0))
        return 0;
    v = fminf(v, 60000.0f);
    if (!srgb)
        return v;
    return v <= 0.04045f ? v / 12.92f : powf((v + 0.055f) / 1.055f, 2.4f);
}

static float texel_of(const struct hg_image *image, size_t pixel, int channel, bool srgb)
{
    const size_t at = pixel * 4 + (size_t)channel;
    if (image->format == HG_PIXEL_RGBA32F)
        return linear_of(((const float *)image->pixels)[at], srgb);
    return linear_of((float)((const uint8_t *)image->pixels)[at] / 255, srgb);
}

// Mean of the pixels that a texel of a smaller image covers, whole ones.
static void average(
    const struct hg_image *image, bool srgb, uint32_t width, uint32_t height, float *out)
{
    for (uint32_t y = 0; y < height; y++)
        for (uint32_t x = 0; x < width; x++) {
            const uint32_t x0 = (uint32_t)((uint64_t)x * image->width / width);
            const uint32_t x1 = (uint32_t)((uint64_t)(x + 1) * image->width / width);
            const uint32_t y0 = (uint32_t)((uint64_t)y * image->height / height);
            const uint32_t y1 = (uint32_t)((uint64_t)(y + 1) * image->height / height);
            double sum[3] = {0};
            for (uint32_t sy = y0; sy < y1; sy++)
                for (uint32_t sx = x0; sx < x1; sx++)
                    for (int c = 0; c < 3; c++)
                        sum[c] += (double)texel_of(image, (size_t)sy * image->width + sx, c, srgb);
            for (int c = 0; c < 3; c++)
                out[((size_t)y * width + x) * 3 + (size_t)c] =
                    (float)(sum[c] / ((double)(x1 - x0) * (y1 - y0)));
        }
}

// Halves a level, then blurs it along one axis by a binomial filter of five texels, within its
// edges.
static void halve(const float *from, uint32_t fw, uint32_t fh, float *to, uint32_t w, uint32_t h)
{
    for (uint32_t y = 0; y < h; y++)
        for (uint32_t x = 0; x < w; x++) {
            const uint32_t x1 = x + 1 < w ? 2 * x + 2 : fw, y1 = y + 1 < h ? 2 * y + 2 : fh;
            float sum[3] = {0};
            for (uint32_t sy = 2 * y; sy < y1; sy++)
                for (uint32_t sx = 2 * x; sx < x1; sx++)
                    for (uint32_t c = 0; c < 3; c++)
                        sum[c] += from[((size_t)sy * fw + sx) * 3 + c];
            for (uint32_t c = 0; c < 3; c++)
                to[((size_t)y * w + x) * 3 + c] = sum[c] / (float)((x1 - 2 * x) * (y1 - 2 * y));
        }
}

static void blur(const float *from, uint32_t count, size_t stride, float *to)
{
    static const float weights[5] = {1, 4, 6, 4, 1};
    for (uint32_t i = 0; i < count; i++) {
        float sum[3] = {0}, weight = 0;
        for (int k = -2; k <= 2; k++) {
            const int64_t at = (int64_t)i + k;
            if (at < 0 || at >= (int64_t)count)
                continue;
            weight += weights[k + 2];
            for (size_t c = 0; c < 3; c++)
                sum[c] += weights[k + 2] * from[(size_t)at * stride + c];
        }
        for (size_t c = 0; c < 3; c++)
            to[i * stride + c] = sum[c] / weight;
    }
}

static void blur_level(float *texels, uint32_t w, uint32_t h, float *scratch)
{
    for (uint32_t y = 0; y < h; y++)
        blur(texels + (size_t)y * w * 3, w, 3, scratch + (size_t)y * w * 3);
    for (uint32_t x = 0; x < w; x++)
        blur(scratch + (size_t)x * 3, h, (size_t)w * 3, texels + (size_t)x * 3);
}

static uint32_t *put_level(const float *texels, size_t count, uint32_t *words)
{
    for (size_t i = 0; i < count; i++, words += 2) {
        words[0] = hg_half(texels[3 * i]) | (uint32_t)hg_half(texels[3 * i + 1]) << 16;
        words[1] = hg_half(texels[3 * i + 2]);
    }
    return words;
}

static enum hg_status make_table(const struct hg_texture *texture, const struct hg_image *image,
    bool srgb, struct hg_light_table **out)
{
    const uint32_t most = HG_LIGHT_IMAGE_MOST_SIDE;
    const uint32_t w = image->width < most ? image->width : most;
    const uint32_t h = image->height < most ? image->height : most;
    uint32_t levels = 1, texels = w * h;
    for (; side_at(w, levels - 1) > 1 || side_at(h, levels - 1) > 1; levels++)
        texels += side_at(w, levels) * side_at(h, levels);
    float *rows = hg_calloc((size_t)w * h * 3, 3 * sizeof *rows);
    struct hg_light_table *table = create(HG_LIGHT_IMAGE_HEAD + 2 * texels);
    if (!rows || !table) {
        hg_free(rows);
        hg_light_table_unref(table);
        return HG_E_NOMEM;
    }
    float *now = rows, *next = rows + (size_t)w * h * 3, *scratch = next + (size_t)w * h * 3;
    table->words[0] = w | h << 16;
    table->words[1] = levels | (uint32_t)texture->wrap_s << 8 | (uint32_t)texture->wrap_t << 16;
    average(image, srgb, w, h, now);
    uint32_t *at = put_level(now, (size_t)w * h, table->words + HG_LIGHT_IMAGE_HEAD);
    for (uint32_t l = 1; l < levels; l++) {
        const uint32_t lw = side_at(w, l), lh = side_at(h, l);
        halve(now, side_at(w, l - 1), side_at(h, l - 1), next, lw, lh);
        blur_level(next, lw, lh, scratch);
        at = put_level(next, (size_t)lw * lh, at);
        float *swap = now;
        now = next;
        next = swap;
    }
    hg_free(rows);
    seal(table);
    *out = table;
    return HG_OK;
}

static enum hg_status read_image(
    const struct hg_image_source *source, struct hg_image *out, bool *srgb, struct hg_error *err)
{
    const struct hg_image_limits limits = {.max_pixels = MOST_PIXELS};
    const struct hg_image_bytes bytes = {source->encoded ? source->encoded->data : NULL,
        source->encoded ? source->encoded->size : 0, source->label};
    struct hg_image_info info;
    enum hg_status status = source->path ? hg_image_probe_file(source->path, &info, err)
                                         : hg_image_probe_memory(&bytes, &info, err);
    if (status)
        return status;
    *srgb = !info.is_float;
    return source->path ? hg_image_read_file(source->path, HG_PIXEL_RGBA32F, &limits, out, err)
                        : hg_image_read_memory(&bytes, HG_PIXEL_RGBA32F, &limits, out, err);
}

enum hg_status hg_light_image_create(
    const struct hg_texture *texture, struct hg_light_table **out, struct hg_error *err)
{
    const struct hg_image_source *source = texture->image;
    struct hg_image read = {0};
    const struct hg_image *image = &read;
    enum hg_status status = HG_OK;
    bool srgb = false;
    *out = NULL;
    if (!source || source->tiles)
        return hg_error_set(err, HG_E_UNSUPPORTED, source ? source->label : "texture", NULL,
            "a light's texture has to have an image");
    if (source->pixels.pixels) {
        image = &source->pixels;
        srgb = source->pixels_srgb;
    } else {
        status = read_image(source, &read, &srgb, err);
    }
    if (!status && image->format != HG_PIXEL_RGBA8 && image->format != HG_PIXEL_RGBA32F)
        status = hg_error_set(err, HG_E_UNSUPPORTED, source->label, NULL, "no pixels of lights");
    if (!status && make_table(texture, image, srgb, out))
        status =
            hg_error_set(err, HG_E_NOMEM, source->label, NULL, "no memory for a light's image");
    hg_image_finish(&read);
    return status;
}

static uint32_t wrapped(int32_t i, uint32_t side, uint32_t wrap)
{
    const int32_t n = (int32_t)side;
    if (wrap == HG_LIGHT_WRAP_CLAMP)
        return (uint32_t)(i < 0 ? 0 : i >= n ? n - 1 : i);
    const int32_t period = wrap == HG_LIGHT_WRAP_MIRROR ? 2 * n : n;
    const int32_t at = i % period, positive = at < 0 ? at + period : at;
    return (uint32_t)(positive < n ? positive : period - 1 - positive);
}

void hg_light_image_at(const uint32_t *words, float u, float v, float out[3])
{
    const uint32_t w = words[0] & 0xffff, h = words[0] >> 16;
    const uint32_t wrap_s = words[1] >> 8 & 0xff, wrap_t = words[1] >> 16;
    const float x = hg_clampf(u * (float)w - 0.5f, -1e6f, 1e6f);
    const float y = hg_clampf(v * (float)h - 0.5f, -1e6f, 1e6f);
    const float fx = x - floorf(x), fy = y - floorf(y);
    const int32_t x0 = (int32_t)floorf(x), y0 = (int32_t)floorf(y);
    out[0] = out[1] = out[2] = 0;
    for (int32_t k = 0; k < 4; k++) {
        const uint32_t column = wrapped(x0 + k % 2, w, wrap_s),
                       row = wrapped(y0 + k / 2, h, wrap_t);
        const uint32_t *texel = words + HG_LIGHT_IMAGE_HEAD + 2 * (row * w + column);
        const float weight = (k % 2 ? fx : 1 - fx) * (k / 2 ? fy : 1 - fy);
        out[0] += weight * hg_half_to_float((uint16_t)(texel[0] & 0xffff));
        out[1] += weight * hg_half_to_float((uint16_t)(texel[0] >> 16));
        out[2] += weight * hg_half_to_float((uint16_t)(texel[1] & 0xffff));
    }
}
