// mix.c - see mix.h.
#include "renderer/temporal/mix.h"

#include <math.h>
#include <string.h>

#include "renderer/temporal/lanes.h"

#define REACH       0.75f // deviations that history may be away from the mean
#define LEAST_REACH 2e-5f // and what always goes, squared encoded values
#define LEAST_TRUST 0.02f
#define OPAQUE      0.9999f // what stored alphas come to again
#define LESS_BETWEEN (HG_TEMPORAL_MOST_WEIGHT - HG_TEMPORAL_MOST_BETWEEN)
#define CLIPPED     0.5f    // share of its weight that history keeps which was all clipped away

// Stored colours to the planes of rows.h; planes take the place of about->spare.
HG_SIMD_LOOP
static void unpack(const float *restrict color, uint32_t width, float *const plane[4])
{
    float *restrict luma = plane[0], *restrict orange = plane[1], *restrict green = plane[2];
    float *restrict alpha = plane[3];
    for (uint32_t i = 0; i < width; i++) {
        const float r0 = color[4 * i], g0 = color[4 * i + 1], b0 = color[4 * i + 2];
        const float r1 = r0 > 0.0f ? r0 : 0.0f, g1 = g0 > 0.0f ? g0 : 0.0f;
        const float b1 = b0 > 0.0f ? b0 : 0.0f, r = r1 * r1, g = g1 * g1, b = b1 * b1;
        luma[i] = 0.25f * (r + b) + 0.5f * g;
        orange[i] = 0.5f * (r - b);
        green[i] = 0.5f * g - 0.25f * (r + b);
        alpha[i] = color[4 * i + 3];
    }
}

static inline float larger(float a, float b)
{
    return a > b ? a : b;
}

static inline float smaller(float a, float b)
{
    return a < b ? a : b;
}

// plane: history in, the mixture out. Found weights: of history, then of the mixture.
HG_SIMD_LOOP
static void blend(const struct hg_temporal_about *about, float *const plane[4],
    const struct hg_temporal_trust *row, uint32_t width, const struct hg_temporal_found *found)
{
    const hg_lanes least = (hg_lanes){0} + LEAST_TRUST;
    const float even = row->part[0], odd = row->part[1];
    const hg_lanes part = {even, odd, even, odd, even, odd, even, odd};
    float *weight = found->weight;
    for (uint32_t i = 0; i < width; i += HG_LANES) {
        const hg_lanes off = HG_LANES_AT(plane[0], i) - HG_LANES_AT(about->mean[0], i);
        const hg_lanes away = HG_LANES_MAX(off, -off);
        const hg_lanes reach = REACH * HG_LANES_AT(about->deviation[0], i) + LEAST_REACH;
        const hg_lanes seen = row->row * HG_LANES_AT(row->columns, i) * part;
        const hg_lanes trust = HG_LANES_MAX(seen, least);
        const hg_lanes kept = reach / HG_LANES_MAX(reach, away);
        const hg_lanes had = HG_LANES_AT(weight, i) * (CLIPPED + (1.0f - CLIPPED) * kept);
        const hg_lanes x = HG_LANES_AT(found->part_x, i), y = HG_LANES_AT(found->part_y, i);
        const hg_lanes across = x * (1.0f - x), down = y * (1.0f - y);
        const hg_lanes between = 4.0f * HG_LANES_MAX(across, down); // 1 half way
        const hg_lanes most = HG_TEMPORAL_MOST_WEIGHT - LESS_BETWEEN * between;
        const hg_lanes sum = had + trust, share = trust / sum; // 1 without history
        for (int c = 0; c < about->channels;
             c++) { // history in the range of deviations about the mean
            const hg_lanes mean = HG_LANES_AT(about->mean[c], i);
            const hg_lanes range = REACH * HG_LANES_AT(about->deviation[c], i) + LEAST_REACH;
            const hg_lanes old = HG_LANES_AT(plane[c], i), low = mean - range, high = mean + range;
            const hg_lanes above = HG_LANES_MAX(old, low), was = HG_LANES_MIN(above, high);
            HG_LANES_PUT(plane[c], i, was + (HG_LANES_AT(about->color[c], i) - was) * share);
        }
        HG_LANES_PUT(weight, i, HG_LANES_MIN(sum, most));
    }
}

static inline uint32_t rounded(float v, float most)
{
    return (uint32_t)(int32_t)(smaller(v * most, most) + 0.5f);
}

// Encoded red, green and blue in place of luma, orange and green.
HG_SIMD_LOOP
static void encode(float *const plane[4], uint32_t width)
{
    float *restrict first = plane[0], *restrict second = plane[1], *restrict third = plane[2];
    for (uint32_t i = 0; i < width; i++) {
        const float y = first[i] - third[i], g = first[i] + third[i];
        const float r = y + second[i], b = y - second[i];
        first[i] = sqrtf(r > 0.0f ? r : 0.0f);
        second[i] = sqrtf(g > 0.0f ? g : 0.0f);
        third[i] = sqrtf(b > 0.0f ? b : 0.0f);
    }
}

// Opaque rows: alpha is 1 everywhere. Planes: red, green, blue.
HG_SIMD_LOOP
static void store_opaque(float *const plane[4], uint32_t width, uint32_t *color, uint32_t *rgba)
{
    const hg_lanes one = (hg_lanes){0} + 1.0f;
    for (uint32_t i = 0; i < width; i += HG_LANES) {
        hg_lanes_int word[3], byte[3];
        for (int c = 0; c < 3; c++) {
            const hg_lanes v = HG_LANES_MIN(HG_LANES_AT(plane[c], i), one);
            word[c] = HG_LANES_INT(v * 65535.0f + 0.5f);
            byte[c] = HG_LANES_INT(v * 255.0f + 0.5f);
        }
        const hg_lanes_int low = word[0] | word[1] << 16, high = word[2] | (int32_t)0xffff0000;
        const hg_lanes_int all = byte[0] | byte[1] << 8 | byte[2] << 16 | (int32_t)0xff000000;
        const hg_lanes_int both[2] = {__builtin_shufflevector(low, high, 0, 8, 1, 9, 2, 10, 3, 11),
            __builtin_shufflevector(low, high, 4, 12, 5, 13, 6, 14, 7, 15)};
        const uint32_t count = width - i < HG_LANES ? width - i : HG_LANES;
        memcpy(color + 2 * (size_t)i, both, 8 * (size_t)count);
        memcpy(rgba + i, &all, 4 * (size_t)count);
    }
}

// Straight alpha out. Planes: red, green, blue, alpha.
static void store(float *const plane[4], uint32_t width, uint32_t *color, uint32_t *rgba)
{
    for (uint32_t i = 0; i < width; i++) {
        const float a = larger(smaller(plane[3][i], 1.0f), 0.0f);
        const float r = plane[0][i], g = plane[1][i], b = plane[2][i];
        const float per_a = a > 0.0f ? 1.0f / sqrtf(a) : 0.0f;
        color[2 * i] = rounded(r, 65535.0f) | rounded(g, 65535.0f) << 16;
        color[2 * i + 1] = rounded(b, 65535.0f) | rounded(a, 65535.0f) << 16;
        rgba[i] = rounded(r * per_a, 255.0f) | rounded(g * per_a, 255.0f) << 8 |
                  rounded(b * per_a, 255.0f) << 16 | rounded(a, 255.0f) << 24;
    }
}

HG_SIMD_LOOP
static void store_weights(const float *restrict weight, uint32_t width, uint8_t *restrict to)
{
    for (uint32_t i = 0; i < width; i++)
        to[i] = (uint8_t)(int32_t)(weight[i] * 16.0f + 0.5f);
}

static bool is_opaque(const float *alpha, uint32_t width)
{
    bool opaque = true;
    for (uint32_t i = 0; i < width; i++)
        opaque &= alpha[i] >= OPAQUE;
    return opaque;
}

void hg_temporal_mix(const struct hg_temporal_about *about, struct hg_temporal_found *found,
    const struct hg_temporal_trust *trust, uint32_t width, const struct hg_temporal_past *to,
    uint8_t *rgba)
{
    uint32_t *color = (uint32_t *)(void *)to->color, *pixels = (uint32_t *)(void *)rgba;
    unpack(found->color, width, about->spare);
    blend(about, about->spare, trust, width, found);
    encode(about->spare, width);
    if (about->channels < HG_TEMPORAL_CHANNELS || is_opaque(about->spare[3], width))
        store_opaque(about->spare, width, color, pixels);
    else
        store(about->spare, width, color, pixels);
    memcpy(to->depth, about->motion.depth, width * sizeof *to->depth);
    store_weights(found->weight, width, to->weight);
}
