// mix.c - see mix.h.
#include "renderer/temporal/mix.h"

#include <math.h>
#include <string.h>

#include "base/simd.h"

#define REACH       0.75f // deviations that history may be away from the mean
#define LEAST_REACH 2e-5f // and what always goes, squared encoded values
#define LEAST_TRUST 0.02f
#define OPAQUE      0.9999f // what stored alphas come to again
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

static inline float reach_of(float deviation)
{
    return REACH * deviation + LEAST_REACH;
}

// One channel of history, moved into the range of deviations about the mean, and mixed.
static inline float mixed(float old, float mean, float reach, float now, float share)
{
    const float was = smaller(larger(old, mean - reach), mean + reach);
    return was + (now - was) * share;
}

// plane: history in, the mixture out. weight: of history, then of the mixture.
HG_SIMD_LOOP
static void blend(const struct hg_temporal_about *about, float *const plane[4], float row_trust,
    const float *restrict columns, uint32_t width, float *restrict weight)
{
    const float *restrict m0 = about->mean[0], *restrict m1 = about->mean[1];
    const float *restrict m2 = about->mean[2], *restrict m3 = about->mean[3];
    const float *restrict d0 = about->deviation[0], *restrict d1 = about->deviation[1];
    const float *restrict d2 = about->deviation[2], *restrict d3 = about->deviation[3];
    const float *restrict c0 = about->color[0], *restrict c1 = about->color[1];
    const float *restrict c2 = about->color[2], *restrict c3 = about->color[3];
    float *restrict p0 = plane[0], *restrict p1 = plane[1];
    float *restrict p2 = plane[2], *restrict p3 = plane[3];
    for (uint32_t i = 0; i < width; i++) {
        const float reach = reach_of(d0[i]), away = fabsf(p0[i] - m0[i]);
        const float trust = larger(row_trust * columns[i], LEAST_TRUST);
        const float kept = reach / larger(reach, away);
        const float had = weight[i] * (CLIPPED + (1.0f - CLIPPED) * kept), sum = had + trust;
        const float share = trust / sum; // 1 without history
        p0[i] = mixed(p0[i], m0[i], reach, c0[i], share);
        p1[i] = mixed(p1[i], m1[i], reach_of(d1[i]), c1[i], share);
        p2[i] = mixed(p2[i], m2[i], reach_of(d2[i]), c2[i], share);
        p3[i] = mixed(p3[i], m3[i], reach_of(d3[i]), c3[i], share);
        weight[i] = smaller(sum, HG_TEMPORAL_MOST_WEIGHT);
    }
}

static inline float root(float v)
{
    return sqrtf(v > 0.0f ? v : 0.0f);
}

static inline uint32_t rounded(float v, float most)
{
    return (uint32_t)(int32_t)(smaller(v * most, most) + 0.5f);
}

// Opaque rows: alpha is 1 everywhere.
HG_SIMD_LOOP
static void store_opaque(
    float *const plane[4], uint32_t width, uint32_t *restrict color, uint32_t *restrict rgba)
{
    const float *restrict luma = plane[0], *restrict orange = plane[1], *restrict green = plane[2];
    for (uint32_t i = 0; i < width; i++) {
        const float y = luma[i] - green[i];
        const float r = root(y + orange[i]), g = root(luma[i] + green[i]), b = root(y - orange[i]);
        color[2 * i] = rounded(r, 65535.0f) | rounded(g, 65535.0f) << 16;
        color[2 * i + 1] = rounded(b, 65535.0f) | 0xffff0000u;
        rgba[i] =
            rounded(r, 255.0f) | rounded(g, 255.0f) << 8 | rounded(b, 255.0f) << 16 | 0xff000000u;
    }
}

// Straight alpha out.
static void store(
    float *const plane[4], uint32_t width, uint32_t *restrict color, uint32_t *restrict rgba)
{
    for (uint32_t i = 0; i < width; i++) {
        const float y = plane[0][i] - plane[2][i], a = larger(smaller(plane[3][i], 1.0f), 0.0f);
        const float r = root(y + plane[1][i]), g = root(plane[0][i] + plane[2][i]);
        const float b = root(y - plane[1][i]), per_a = a > 0.0f ? 1.0f / sqrtf(a) : 0.0f;
        color[2 * i] = rounded(r, 65535.0f) | rounded(g, 65535.0f) << 16;
        color[2 * i + 1] = rounded(b, 65535.0f) | rounded(a, 65535.0f) << 16;
        rgba[i] = rounded(r * per_a, 255.0f) | rounded(g * per_a, 255.0f) << 8 |
                  rounded(b * per_a, 255.0f) << 16 | rounded(a, 255.0f) << 24;
    }
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
    blend(about, about->spare, trust->row, trust->columns, width, found->weight);
    if (is_opaque(about->spare[3], width))
        store_opaque(about->spare, width, color, pixels);
    else
        store(about->spare, width, color, pixels);
    memcpy(to->depth, about->motion.depth, width * sizeof *to->depth);
    for (uint32_t i = 0; i < width; i++)
        to->weight[i] = (uint8_t)(int32_t)(found->weight[i] * 16.0f + 0.5f);
}
