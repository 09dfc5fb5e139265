// sharpen.c - see sharpen.h.
#include "renderer/temporal/sharpen.h"

#include <string.h>

#include "base/simd.h"

#define BAND 24u // rows that one thread works on

struct job {
    const uint8_t *from;
    uint32_t width, height;
    float gain;
    uint8_t *to;
};

static inline float least(float a, float b)
{
    return a < b ? a : b;
}

static inline float most(float a, float b)
{
    return a > b ? a : b;
}

// first .. end of the bytes of a row that have neighbours on both sides.
HG_SIMD_LOOP
static void sharpen(const uint8_t *restrict above, const uint8_t *restrict row,
    const uint8_t *restrict below, const uint32_t range[2], float gain, uint8_t *restrict to)
{
    for (uint32_t i = range[0]; i < range[1]; i++) {
        const float here = row[i], a = above[i], b = below[i], l = row[i - 4], r = row[i + 4];
        const float low = least(here, least(least(a, b), least(l, r)));
        const float high = most(here, most(most(a, b), most(l, r)));
        const float calm = 1.0f - (high - low) * (1.0f / 255.0f);
        const float off = here - 0.25f * (a + b + l + r);
        const float v = here + gain * calm * calm * off;
        to[i] = (uint8_t)(int32_t)(least(most(v, low), high) + 0.5f);
    }
}

static void sharpen_band(void *user, size_t index)
{
    const struct job *j = user;
    const size_t pitch = 4 * (size_t)j->width;
    const uint32_t first = (uint32_t)index * BAND;
    const uint32_t end = first + BAND < j->height ? first + BAND : j->height;
    for (uint32_t y = first; y < end; y++) {
        const uint8_t *row = j->from + y * pitch;
        uint8_t *to = j->to + y * pitch;
        memcpy(to, row, pitch);
        if (y == 0 || y + 1 == j->height || j->width < 3)
            continue;
        const uint32_t range[2] = {4, (uint32_t)pitch - 4};
        sharpen(row - pitch, row, row + pitch, range, j->gain, to);
        for (uint32_t x = 0; x < j->width; x++)
            to[4 * x + 3] = row[4 * x + 3];
    }
}

void hg_temporal_sharpen(
    struct hg_jobs *jobs, const uint8_t *from, const uint32_t size[2], float strength, uint8_t *to)
{
    struct job j = {from, size[0], size[1], 2.0f * strength, to};
    hg_jobs_for(jobs, (size[1] + BAND - 1) / BAND, sharpen_band, &j);
}
