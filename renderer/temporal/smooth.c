// smooth.c - see smooth.h.
#include "renderer/temporal/smooth.h"

#include <math.h>

#define LEAST_CONTRAST 10.0f  // luma, of 255
#define CONTRAST_SHARE 0.125f // of the brightest neighbour
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

static float luma(const struct picture *p, int32_t x, int32_t y)
{
    const uint8_t *t = texel(p, x, y);
    return 0.299f * (float)t[0] + 0.587f * (float)t[1] + 0.114f * (float)t[2];
}

// An edge between a line of pixels and the next one, in the direction `along`, `across` from a
// pixel.
struct edge {
    int32_t along[2], across[2];
    float middle, contrast; // luma on the edge; difference of both sides
};

// Steps until the edge ends, and to which side it turns there.
static int32_t walk(const struct picture *p, const struct edge *e, const int32_t at[2],
    int32_t sign, bool *brighter)
{
    for (int32_t i = 1;; i++) {
        const int32_t x = at[0] + sign * i * e->along[0], y = at[1] + sign * i * e->along[1];
        const float here = luma(p, x, y), other = luma(p, x + e->across[0], y + e->across[1]);
        const float off = 0.5f * (here + other) - e->middle;
        if (fabsf(off) < 0.25f * e->contrast && i < FARTHEST_PX)
            continue;
        *brighter = off > 0.0f;
        return i;
    }
}

static void lerp(const uint8_t *a, const uint8_t *b, float share, uint8_t out[4])
{
    for (int c = 0; c < 4; c++)
        out[c] = (uint8_t)((float)a[c] + ((float)b[c] - (float)a[c]) * share + 0.5f);
}

// The stronger edge on one side of the pixel.
static struct edge find_edge(const struct picture *p, const int32_t at[2], const float around[4])
{
    const float here = luma(p, at[0], at[1]);
    const float bend_y = fabsf(around[0] + around[1] - 2.0f * here);
    const float bend_x = fabsf(around[2] + around[3] - 2.0f * here);
    const bool level = bend_y >= bend_x; // the edge runs along the row
    const float first = level ? around[0] : around[2], last = level ? around[1] : around[3];
    const bool before = fabsf(first - here) >= fabsf(last - here);
    const float other = before ? first : last;
    const int32_t side = before ? -1 : 1;
    struct edge e = {.middle = 0.5f * (here + other), .contrast = fabsf(here - other)};
    e.along[level ? 0 : 1] = 1;
    e.across[level ? 1 : 0] = side;
    return e;
}

bool hg_temporal_smooth(
    const uint8_t *rgba, const uint32_t size[2], uint32_t x, uint32_t y, uint8_t out[4])
{
    const struct picture p = {rgba, (int32_t)size[0], (int32_t)size[1]};
    const int32_t at[2] = {(int32_t)x, (int32_t)y};
    const float here = luma(&p, at[0], at[1]);
    const float around[4] = {luma(&p, at[0], at[1] - 1), luma(&p, at[0], at[1] + 1),
        luma(&p, at[0] - 1, at[1]), luma(&p, at[0] + 1, at[1])};
    float low = here, high = here;
    for (int i = 0; i < 4; i++) {
        low = fminf(low, around[i]);
        high = fmaxf(high, around[i]);
    }
    if (high - low < fmaxf(LEAST_CONTRAST, CONTRAST_SHARE * high))
        return false;
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
