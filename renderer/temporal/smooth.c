// smooth.c - see smooth.h.
#include "renderer/temporal/smooth.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/simd.h"

#define ONE            256        // luma of a level
#define LEAST_CONTRAST (10 * ONE) // of 255
#define CONTRAST_SHARE 8          // of the brightest neighbour, its reciprocal
#define FARTHEST_PX    12

struct picture {
    const uint8_t *rgba;
    int32_t width, height;
};

static const uint8_t *texel(const struct picture *p, int32_t x, int32_t y)
{
    const int32_t cx = x < 0 ? 0 : x >= p->width ? p->width - 1 : x;
    const int32_t cy = y < 0 ? 0 : y >= p->height ? p->height - 1 : y;
    return p->rgba + 4 * ((int64_t)cy * p->width + cx);
}

// Rec. 601, in 1/256.
static int32_t luma(const struct picture *p, int32_t x, int32_t y)
{
    const uint8_t *t = texel(p, x, y);
    return 77 * t[0] + 150 * t[1] + 29 * t[2];
}

// An edge between a line of pixels and the next one, in the direction `along`, `across` from a
// pixel.
struct edge {
    int32_t along[2], across[2];
    int32_t middle, contrast; // luma on the edge; difference of both sides
};

// Steps until the edge ends, and to which side it turns there.
static int32_t walk(const struct picture *p, const struct edge *e, const int32_t at[2],
    int32_t sign, bool *brighter)
{
    for (int32_t i = 1;; i++) {
        const int32_t x = at[0] + sign * i * e->along[0], y = at[1] + sign * i * e->along[1];
        const int32_t here = luma(p, x, y), other = luma(p, x + e->across[0], y + e->across[1]);
        const int32_t off = (here + other) / 2 - e->middle;
        if (4 * abs(off) < e->contrast && i < FARTHEST_PX)
            continue;
        *brighter = off > 0;
        return i;
    }
}

static void lerp(const uint8_t *a, const uint8_t *b, float share, uint8_t out[4])
{
    for (int c = 0; c < 4; c++)
        out[c] = (uint8_t)((float)a[c] + ((float)b[c] - (float)a[c]) * share + 0.5f);
}

// The stronger edge on one side of the pixel.
static struct edge find_edge(const struct picture *p, const int32_t at[2], const int32_t around[4])
{
    const int32_t here = luma(p, at[0], at[1]);
    const int32_t bend_y = abs(around[0] + around[1] - 2 * here);
    const int32_t bend_x = abs(around[2] + around[3] - 2 * here);
    const bool level = bend_y >= bend_x; // the edge runs along the row
    const int32_t first = level ? around[0] : around[2], last = level ? around[1] : around[3];
    const bool before = abs(first - here) >= abs(last - here);
    const int32_t other = before ? first : last;
    const int32_t side = before ? -1 : 1;
    struct edge e = {.middle = (here + other) / 2, .contrast = abs(here - other)};
    e.along[level ? 0 : 1] = 1;
    e.across[level ? 1 : 0] = side;
    return e;
}

// With one more at each end.
HG_SIMD_LOOP
static void fill_luma(const uint8_t *rgba, uint32_t width, int32_t *restrict out)
{
    for (uint32_t i = 0; i < width; i++) {
        uint32_t t;
        memcpy(&t, rgba + 4 * (size_t)i, sizeof t);
        out[i + 1] = (int32_t)(77 * (t & 255) + 150 * (t >> 8 & 255) + 29 * (t >> 16 & 255));
    }
    out[0] = out[1];
    out[width + 1] = out[width];
}

static inline int32_t least(int32_t a, int32_t b)
{
    return a < b ? a : b;
}

static inline int32_t most(int32_t a, int32_t b)
{
    return a > b ? a : b;
}

HG_SIMD_LOOP
static void mark(const int32_t *restrict above, const int32_t *restrict row,
    const int32_t *restrict below, uint32_t width, int32_t *restrict marks)
{
    for (uint32_t i = 0; i < width; i++) {
        const int32_t a = above[i + 1], b = below[i + 1], l = row[i], r = row[i + 2];
        const int32_t here = row[i + 1];
        const int32_t low = least(here, least(least(a, b), least(l, r)));
        const int32_t high = most(here, most(most(a, b), most(l, r)));
        marks[i] = high - low >= most(LEAST_CONTRAST, high / CONTRAST_SHARE);
    }
}

void hg_temporal_smooth_mark(
    const uint8_t *rgba, const uint32_t size[2], uint32_t y, int32_t *scratch, int32_t *marks)
{
    const size_t pitch = (size_t)size[0] + 2, row_bytes = 4 * (size_t)size[0];
    const uint32_t rows[3] = {y > 0 ? y - 1 : 0, y, y + 1 < size[1] ? y + 1 : y};
    for (int i = 0; i < 3; i++)
        fill_luma(rgba + rows[i] * row_bytes, size[0], scratch + (size_t)i * pitch);
    mark(scratch, scratch + pitch, scratch + 2 * pitch, size[0], marks);
}

bool hg_temporal_smooth(
    const uint8_t *rgba, const uint32_t size[2], uint32_t x, uint32_t y, uint8_t out[4])
{
    const struct picture p = {rgba, (int32_t)size[0], (int32_t)size[1]};
    const int32_t at[2] = {(int32_t)x, (int32_t)y};
    const int32_t here = luma(&p, at[0], at[1]);
    const int32_t around[4] = {luma(&p, at[0], at[1] - 1), luma(&p, at[0], at[1] + 1),
        luma(&p, at[0] - 1, at[1]), luma(&p, at[0] + 1, at[1])};
    const struct edge e = find_edge(&p, at, around);
    bool turns[2];
    const int32_t back = walk(&p, &e, at, -1, &turns[0]), on = walk(&p, &e, at, 1, &turns[1]);
    const int32_t nearest = back < on ? back : on;
    // The edge crosses this pixel only if its nearer end turns to the other side.
    const bool brighter = turns[back < on ? 0 : 1];
    if (brighter == (here > e.middle))
        return false;
    const float share = 0.5f - (float)nearest / (float)(back + on);
    lerp(texel(&p, at[0], at[1]), texel(&p, at[0] + e.across[0], at[1] + e.across[1]), share, out);
    return share > 0.0f;
}
