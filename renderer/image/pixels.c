#include "renderer/image/pixels.h"

#include <math.h>
#include <string.h>

static const float largest_half = 65504.0f;

// From the last pixel backwards, so that no pixel is overwritten before it is read. Inlined with a
// constant channel_bytes.
static inline void expand(
    uint8_t *px, size_t count, int channels, size_t channel_bytes, const void *one)
{
    const size_t n = channel_bytes;
    const size_t green = channels >= 3 ? n : 0, blue = channels >= 3 ? 2 * n : 0;
    for (size_t i = count; channels < 4 && i-- > 0;) {
        const uint8_t *src = px + i * (size_t)channels * n;
        uint8_t texel[4 * sizeof(float)];
        memcpy(texel, src, n);
        memcpy(texel + n, src + green, n);
        memcpy(texel + 2 * n, src + blue, n);
        memcpy(texel + 3 * n, channels == 2 ? src + n : one, n);
        memcpy(px + i * 4 * n, texel, 4 * n);
    }
}

void hg_pixels_expand(void *pixels, size_t count, enum hg_pixel_format format, int channels)
{
    static const uint8_t one_u8 = UINT8_MAX;
    static const uint16_t one_u16 = UINT16_MAX;
    static const float one_f32 = 1.0f;
    if (format == HG_PIXEL_RGBA8)
        expand(pixels, count, channels, sizeof one_u8, &one_u8);
    else if (format == HG_PIXEL_RGBA16)
        expand(pixels, count, channels, sizeof one_u16, &one_u16);
    else
        expand(pixels, count, channels, sizeof one_f32, &one_f32);
}

static bool is_translucent(float alpha)
{
    return !(alpha <= 0.0f || alpha >= 1.0f);
}

static uint32_t divide_unorm(uint32_t value, float alpha, float one)
{
    const float v = (float)value / alpha;
    return (uint32_t)((v < one ? v : one) + 0.5f);
}

static void unassociate_u8(uint8_t *px, size_t count)
{
    for (size_t i = 0; i < count; i++, px += 4) {
        const float alpha = (float)px[3] / 255.0f;
        for (int c = 0; c < 3 && is_translucent(alpha); c++)
            px[c] = (uint8_t)divide_unorm(px[c], alpha, 255.0f);
    }
}

static void unassociate_u16(uint16_t *px, size_t count)
{
    for (size_t i = 0; i < count; i++, px += 4) {
        const float alpha = (float)px[3] / 65535.0f;
        for (int c = 0; c < 3 && is_translucent(alpha); c++)
            px[c] = (uint16_t)divide_unorm(px[c], alpha, 65535.0f);
    }
}

static void unassociate_f32(float *px, size_t count)
{
    for (size_t i = 0; i < count; i++, px += 4)
        for (int c = 0; c < 3 && is_translucent(px[3]); c++)
            px[c] /= px[3];
}

void hg_pixels_unassociate(void *pixels, size_t count, enum hg_pixel_format format)
{
    if (format == HG_PIXEL_RGBA8)
        unassociate_u8(pixels, count);
    else if (format == HG_PIXEL_RGBA16)
        unassociate_u16(pixels, count);
    else
        unassociate_f32(pixels, count);
}

void hg_pixels_associate(float *pixels, size_t count)
{
    for (size_t i = 0; i < count; i++)
        for (size_t c = 0; c < 3; c++)
            pixels[i * 4 + c] *= pixels[i * 4 + 3];
}

bool hg_pixels_fit_half(const float *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (fabsf(values[i]) > largest_half)
            return false;
    return true;
}

void hg_pixels_clamp_to_half(float *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (fabsf(values[i]) > largest_half)
            values[i] = copysignf(largest_half, values[i]);
}
