// triangle_cull.c - see triangle_cull.h. Loops over arrays of one number per triangle, which
// compilers vectorise.
#include "renderer/cull/triangle_cull.h"

#include <math.h>
#include <string.h>

#define BLOCK 64 // triangles at once

// Twelve roundings of single precision here, about as many in shaders, and some in clipping.
#define ROUNDING  1.5e-6f
#define SNAP_PX   (1.5f / 256.0f)
#define VIEWPORT  6e-7f // of the size of the image
#define MOST_SPAN 1e6f  // px; larger ones are not told apart

// Drivers cut what reaches beyond twice the image (llvmpipe) or its depth, and each piece turns as
// its own corners are rounded. So facing is only told of what lies in here: parts of the size to
// each side of the image, and of the depth.
#define AROUND      0.45f
#define LEAST_DEPTH 1e-6f
#define MOST_DEPTH  0.9999f

struct block {
    float x[3][BLOCK], y[3][BLOCK], z[3][BLOCK], w[3][BLOCK]; // object space; then px, depth, 1 / w
    uint8_t drop[BLOCK];
};

// --- one draw ------------------------------------------------------------------------------------

// Row r of clip space from object space, in double precision, and the sum of its absolute terms.
static double open_row(const struct hg_culling_view *view, const struct hg_mat4x3 *world,
    const double reach[3], int r, double row[4])
{
    const struct hg_culling_lens *lens = view->lens;
    double sum = fabs((double)lens->clip[r]);
    for (int c = 0; c < 4; c++) {
        row[c] = c == 3 ? lens->clip[r] : 0.0;
        for (int i = 0; i < 3; i++) {
            const double at = (double)world->m[c * 3 + i] - (c == 3 ? (double)view->eye[i] : 0.0);
            row[c] += (double)lens->view_proj[i * 4 + r] * at;
        }
    }
    for (int i = 0; i < 3; i++)
        sum += fabs((double)lens->view_proj[i * 4 + r]) * reach[i];
    return sum;
}

// How large the terms get that the corners of a part are summed up from.
static void reach_of(const struct hg_culling_view *view, const struct hg_mat4x3 *world,
    const struct hg_box *bounds, double reach[3])
{
    for (int i = 0; i < 3; i++) {
        reach[i] = fabs((double)world->m[9 + i] - view->eye[i]);
        for (int c = 0; c < 3; c++)
            reach[i] += fabs((double)world->m[c * 3 + i]) *
                        fmax(fabs((double)bounds->min[c]), fabs((double)bounds->max[c]));
    }
}

void hg_triangle_cull_open(const struct hg_culling_view *view, const struct hg_mat4x3 *world,
    const struct hg_box *bounds, uint32_t flags, struct hg_triangle_cull *out)
{
    const struct hg_culling_lens *lens = view->lens;
    const double half[2] = {0.5 * lens->width, 0.5 * lens->height};
    double reach[3], rows[4][4], sums[4];
    reach_of(view, world, bounds, reach);
    for (int r = 0; r < 4; r++)
        sums[r] = open_row(view, world, reach, r, rows[r]);
    for (int c = 0; c < 4; c++) {
        out->x[c] = (float)(rows[0][c] * half[0] + rows[3][c] * (half[0] - 0.5));
        out->y[c] = (float)(rows[1][c] * half[1] + rows[3][c] * (half[1] - 0.5));
        out->z[c] = (float)rows[2][c];
        out->w[c] = (float)rows[3][c];
    }
    out->width = (float)lens->width;
    out->height = (float)lens->height;
    out->shift_px = lens->shift_px;
    out->radius_px = SNAP_PX + VIEWPORT * fmaxf(out->width, out->height);
    out->radius_per_w = (float)(ROUNDING * fmax(half[0] * (sums[0] + 2.0 * sums[3]),
                                               half[1] * (sums[1] + 2.0 * sums[3])));
    const bool both = view->both_sides || (flags & HG_DRAW_DOUBLE_SIDED) != 0;
    out->side = both ? 0.0f : (flags & HG_DRAW_MIRRORED) != 0 ? -1.0f : 1.0f;
}

// --- blocks --------------------------------------------------------------------------------------

static void fetch(const float *positions, const uint32_t *indices, uint32_t count, struct block *b)
{
    for (uint32_t i = 0; i < count; i++)
        for (uint32_t k = 0; k < 3; k++) {
            const float *p = positions + (size_t)indices[i * 3 + k] * 3;
            b->x[k][i] = p[0];
            b->y[k][i] = p[1];
            b->z[k][i] = p[2];
        }
}

static void project(const struct hg_triangle_cull *s, float *restrict xs, float *restrict ys,
    float *restrict zs, float *restrict ws)
{
    for (uint32_t i = 0; i < BLOCK; i++) {
        const float x = xs[i], y = ys[i], z = zs[i];
        const float per_w = 1.0f / (s->w[0] * x + s->w[1] * y + s->w[2] * z + s->w[3]);
        xs[i] = (s->x[0] * x + s->x[1] * y + s->x[2] * z + s->x[3]) * per_w;
        ys[i] = (s->y[0] * x + s->y[1] * y + s->y[2] * z + s->y[3]) * per_w;
        zs[i] = (s->z[0] * x + s->z[1] * y + s->z[2] * z + s->z[3]) * per_w;
        ws[i] = per_w;
    }
}

static inline float least(float a, float b)
{
    return a < b ? a : b;
}

static inline float most(float a, float b)
{
    return a > b ? a : b;
}

static inline int floor_of(float v)
{
    const int whole = (int)v;
    return whole - ((float)whole > v);
}

// What is left of the image, or right of it, falls between the same two numbers.
static inline int shows_nowhere(float low, float high, float size)
{
    const float a = least(most(low, -0.5f), size - 0.5f);
    const float b = least(most(high, -0.5f), size - 0.5f);
    return floor_of(a) == floor_of(b);
}

// All comparisons are false for what is no number: then the triangle stays.
static void test(const struct hg_triangle_cull *s, struct block *restrict b)
{
    const float around_x = AROUND * s->width, around_y = AROUND * s->height;
    for (uint32_t i = 0; i < BLOCK; i++) {
        const float x0 = b->x[0][i], x1 = b->x[1][i], x2 = b->x[2][i];
        const float y0 = b->y[0][i], y1 = b->y[1][i], y2 = b->y[2][i];
        const float z0 = b->z[0][i], z1 = b->z[1][i], z2 = b->z[2][i];
        const float w0 = b->w[0][i], w1 = b->w[1][i], w2 = b->w[2][i];
        const float low_x = least(least(x0, x1), x2), high_x = most(most(x0, x1), x2);
        const float low_y = least(least(y0, y1), y2), high_y = most(most(y0, y1), y2);
        const float low_z = least(least(z0, z1), z2), high_z = most(most(z0, z1), z2);
        const float e = s->radius_px + s->radius_per_w * most(most(w0, w1), w2);
        const float span = (high_x - low_x) + (high_y - low_y), r = e + s->shift_px;
        const int before = (least(least(w0, w1), w2) > 0.0f) & (span < MOST_SPAN);
        const int nowhere = shows_nowhere(low_x - r, high_x + r, s->width) |
                            shows_nowhere(low_y - r, high_y + r, s->height);
        const int inside = (low_x > -around_x) & (high_x < s->width + around_x) &
                           (low_y > -around_y) & (high_y < s->height + around_y) &
                           (low_z > LEAST_DEPTH) & (high_z < MOST_DEPTH);
        const float area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0);
        const int away = area * s->side > 4.0f * e * span + 8.0f * e * e;
        b->drop[i] = (uint8_t)(before & (nowhere | (inside & away)));
    }
}

uint32_t hg_triangle_cull_list(const struct hg_triangle_cull *s, const float *positions,
    const uint32_t *indices, uint32_t count, const struct hg_triangle_list *out)
{
    uint32_t *to = out->indices, *ids = out->ids;
    struct block b;
    uint32_t kept = 0;
    memset(&b, 0, sizeof b);
    for (uint32_t first = 0; first < count; first += BLOCK) {
        const uint32_t n = count - first < BLOCK ? count - first : BLOCK;
        const uint32_t *from = indices + (size_t)first * 3;
        fetch(positions, from, n, &b);
        for (int k = 0; k < 3; k++)
            project(s, b.x[k], b.y[k], b.z[k], b.w[k]);
        test(s, &b);
        for (uint32_t i = 0; i < n; i++) {
            memcpy(to + (size_t)kept * 3, from + (size_t)i * 3, 12);
            if (ids != NULL)
                ids[kept] = out->first_id + first + i;
            kept += !b.drop[i];
        }
    }
    return kept;
}
