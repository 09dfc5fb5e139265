// look_up.c - see look_up.h.
#include "renderer/temporal/look_up.h"

#include <math.h>
#include <string.h>

#include "renderer/temporal/lanes.h"

HG_SIMD_LOOP
static void find_places(const uint32_t size[2], uint32_t row, const struct hg_temporal_about *about,
    struct hg_temporal_found *out)
{
    const float width = (float)size[0], height = (float)size[1], y0 = (float)row + 0.5f;
    const int32_t across = (int32_t)size[0], pitch = across + 2 * HG_TEMPORAL_BORDER;
    const hg_lanes_int none = (hg_lanes_int){0} - 1;
    for (uint32_t i = 0; i < size[0]; i += HG_LANES) {
        const hg_lanes x0 = HG_LANES_FLOAT(HG_LANES_COUNT_FROM + (int32_t)i) + 0.5f;
        const hg_lanes x = x0 + HG_LANES_AT(about->motion.x, i);
        const hg_lanes y = y0 + HG_LANES_AT(about->motion.y, i);
        const hg_lanes_int inside = (x >= 0.0f) & (x < width) & (y >= 0.0f) & (y < height);
        const hg_lanes here = (hg_lanes){0} + y0;
        const hg_lanes ax = HG_LANES_PICK(inside, x, x0), ay = HG_LANES_PICK(inside, y, here);
        // Half a texel up and left; + 1: truncation is floor
        const hg_lanes_int left = HG_LANES_INT(ax + 0.5f), top = HG_LANES_INT(ay + 0.5f);
        const hg_lanes_int pixel = HG_LANES_INT(ay) * across + HG_LANES_INT(ax);
        HG_LANES_PUT(out->part_x, i, ax + 0.5f - HG_LANES_FLOAT(left));
        HG_LANES_PUT(out->part_y, i, ay + 0.5f - HG_LANES_FLOAT(top));
        // Texel left - 1 is the second of four; the border adds two.
        HG_LANES_PUT(out->texel, i, (hg_lanes)(top * pitch + left));
        HG_LANES_PUT(out->nearest, i, HG_LANES_PICK(inside, pixel, none));
    }
}

typedef float four __attribute__((vector_size(16)));
typedef float eight __attribute__((vector_size(32)));
typedef uint16_t eight_words __attribute__((vector_size(16)));

// Catmull-Rom weights of four texels as polynomials of the place between the second and the third.
#define WEIGHTS(x)                                                                                 \
    ((((four){-0.5f, 1.5f, -1.5f, 0.5f} * (x) + (four){1.0f, -2.5f, 2.0f, -0.5f}) * (x) +          \
         (four){-0.5f, 0.0f, 0.5f, 0.0f}) *                                                        \
            (x) +                                                                                  \
        (four){0.0f, 1.0f, 0.0f, 0.0f})

void hg_temporal_filter_plain(const struct hg_temporal_past *past, size_t pitch, uint32_t width,
    const struct hg_temporal_found *out)
{
    for (uint32_t i = 0; i < width; i++) {
        if (!(out->weight[i] > 0.0f))
            continue;
        const four wx = WEIGHTS(out->part_x[i]) * (1.0f / 65535.0f), wy = WEIGHTS(out->part_y[i]);
        const uint16_t *at = past->color + 4 * (size_t)out->texel[i];
        eight first = {0}, last = {0};
        for (int r = 0; r < 4; r++, at += 4 * pitch) {
            eight_words a, b;
            memcpy(&a, at, sizeof a);
            memcpy(&b, at + 8, sizeof b);
            first += __builtin_convertvector(a, eight) * wy[r];
            last += __builtin_convertvector(b, eight) * wy[r];
        }
        const eight w0 = __builtin_shufflevector(wx, wx, 0, 0, 0, 0, 1, 1, 1, 1);
        const eight w1 = __builtin_shufflevector(wx, wx, 2, 2, 2, 2, 3, 3, 3, 3);
        const eight sum = first * w0 + last * w1;
        const four color = __builtin_shufflevector(sum, sum, 0, 1, 2, 3) +
                           __builtin_shufflevector(sum, sum, 4, 5, 6, 7);
        memcpy(out->color + 4 * (size_t)i, &color, sizeof color);
    }
}

void hg_temporal_weigh_plain(const struct hg_temporal_past *past,
    const struct hg_temporal_about *about, uint32_t width, const struct hg_temporal_found *out)
{
    for (uint32_t i = 0; i < width; i++) {
        const int32_t at = out->nearest[i];
        const float expect = about->motion.expect[i];
        const float most =
            expect * (1.0f + HG_TEMPORAL_DEPTH_REACH) + HG_TEMPORAL_SLOPE_REACH * about->slope[i];
        const bool same = at >= 0 && past->depth[at] <= most;
        // What was farther away then was seen with fewer texels: by the square of that.
        const float now = about->motion.depth[i], farther = expect < now ? expect / now : 1.0f;
        const float share = farther * farther * (1.0f / 16.0f);
        out->weight[i] = same ? (float)past->weight[at] * share : 0.0f;
    }
}

void hg_temporal_look_up(const struct hg_temporal_past *past, const uint32_t size[2], uint32_t y,
    const struct hg_temporal_about *about, struct hg_temporal_found *out)
{
    const bool avx2 = hg_temporal_has_avx2();
    find_places(size, y, about, out);
    (avx2 ? hg_temporal_weigh_avx2 : hg_temporal_weigh_plain)(past, about, size[0], out);
    (avx2 ? hg_temporal_filter_avx2 : hg_temporal_filter_plain)(
        past, size[0] + 2 * HG_TEMPORAL_BORDER, size[0], out);
}
