// raster_plain.c - one vertex, one triangle, one pixel at a time. See raster_kernel.h.
#include <math.h>
#include <string.h>

#include "renderer/cpu_raster/raster_kernel.h"

static inline float mad(bool fused, float a, float b, float c)
{
    return fused ? fmaf(a, b, c) : a * b + c;
}

// --- vertices ------------------------------------------------------------------------------------

static void project(
    const struct hg_raster_shot *s, const float p[3], struct hg_raster_vertices *out, uint32_t at)
{
    float relative[3], clip[4];
    for (int i = 0; i < 3; i++)
        relative[i] =
            s->rotate[i] * p[0] + (s->rotate[3 + i] * p[1] + s->rotate[6 + i] * p[2]) + s->shift[i];
    for (int i = 0; i < 4; i++)
        clip[i] = s->project[i] * relative[0] +
                  (s->project[4 + i] * relative[1] + s->project[8 + i] * relative[2]) + s->clip[i];
    const float per_w = 1.0f / clip[3];
    out->x[at] = mad(s->fused, clip[0] * per_w, s->half_width, s->half_width);
    out->y[at] = mad(s->fused, clip[1] * per_w, s->half_height, s->half_height);
    out->z[at] = clip[2] * per_w;
}

// --- triangles -----------------------------------------------------------------------------------

// Corners in an order in which the triangle runs counter-clockwise on the screen.
struct corners {
    float x[3], y[3], z[3];
    int64_t at_x[3], at_y[3]; // 1/256 px from the centre of the first pixel
};

static int64_t snap(float v)
{
    return (int64_t)rintf((v - 0.5f) * 256.0f);
}

// False when the triangle has no area or its side is not shown.
static bool take_corners(const struct hg_raster_shot *s, const struct hg_raster_vertices *v,
    const uint32_t index[3], struct corners *out)
{
    for (int k = 0; k < 3; k++) {
        out->x[k] = v->x[index[k]];
        out->y[k] = v->y[index[k]];
        out->z[k] = v->z[index[k]];
        out->at_x[k] = snap(out->x[k]);
        out->at_y[k] = snap(out->y[k]);
    }
    const int64_t area = (out->at_x[0] - out->at_x[1]) * (out->at_y[2] - out->at_y[0]) -
                         (out->at_x[2] - out->at_x[0]) * (out->at_y[0] - out->at_y[1]);
    return area != 0 && (s->sides & (area > 0 ? HG_RASTER_SHOWS_CCW : HG_RASTER_SHOWS_CW)) != 0;
}

static bool runs_clockwise(const struct corners *c)
{
    return (c->at_x[0] - c->at_x[1]) * (c->at_y[2] - c->at_y[0]) <
           (c->at_x[2] - c->at_x[0]) * (c->at_y[0] - c->at_y[1]);
}

struct plane {
    float at, dx, dy;
};

static struct plane depth_plane(const struct corners *c)
{
    const float dx01 = c->x[0] - c->x[1], dy01 = c->y[0] - c->y[1];
    const float dx20 = c->x[2] - c->x[0], dy20 = c->y[2] - c->y[0];
    const float dz01 = c->z[0] - c->z[1], dz20 = c->z[2] - c->z[0];
    const float per_area = 1.0f / (dx01 * dy20 - dy01 * dx20);
    struct plane p;
    p.dx = dz01 * (dy20 * per_area) - dz20 * (dy01 * per_area);
    p.dy = dz20 * (dx01 * per_area) - dz01 * (dx20 * per_area);
    p.at = c->z[0] - (p.dx * (c->x[0] - 0.5f) + p.dy * (c->y[0] - 0.5f));
    return p;
}

// What is left of or above an edge's own side; points on top and left edges are inside.
struct edge {
    int64_t at, dx, dy; // at the first pixel; per pixel
};

static struct edge edge_of(const struct corners *c, int a, int b, int64_t x, int64_t y)
{
    const int64_t dx = c->at_x[b] - c->at_x[a], dy = c->at_y[b] - c->at_y[a];
    const int64_t on_edge = dy > 0 || (dy == 0 && dx < 0) ? 0 : 1;
    return (struct edge){
        dy * (x * 256 - c->at_x[a]) - dx * (y * 256 - c->at_y[a]) - on_edge, dy * 256, -dx * 256};
}

static inline int64_t most(int64_t a, int64_t b)
{
    return a > b ? a : b;
}

static inline int64_t least(int64_t a, int64_t b)
{
    return a < b ? a : b;
}

// Pixels [first, end) of a row or column whose centres are between the corners.
static void bounds(const int64_t at[3], int64_t low, int64_t high, int64_t *first, int64_t *end)
{
    *first = most((least(least(at[0], at[1]), at[2]) + 255) >> 8, low);
    *end = least((most(most(at[0], at[1]), at[2]) >> 8) + 1, high);
}

static void put(
    const struct hg_raster_tile *tile, int64_t x, int64_t y, float depth, uint32_t order)
{
    uint64_t *key = &tile->keys[(y - tile->y) * HG_RASTER_WIDE + (x - tile->x)];
    uint32_t bits;
    if (!(depth > 0.0f))
        return;
    depth = depth < 1.0f ? depth : 1.0f;
    memcpy(&bits, &depth, 4);
    const uint64_t mine = (uint64_t)bits << 32 | order;
    if (mine > *key)
        *key = mine;
}

static void fill(const struct hg_raster_shot *s, const struct hg_raster_tile *tile,
    const struct corners *c, uint32_t order)
{
    int64_t first_x, first_y, end_x, end_y;
    bounds(c->at_x, tile->x, tile->end_x, &first_x, &end_x);
    bounds(c->at_y, tile->y, tile->end_y, &first_y, &end_y);
    if (first_x >= end_x || first_y >= end_y)
        return;
    const struct plane p = depth_plane(c);
    struct edge e[3];
    for (int k = 0; k < 3; k++)
        e[k] = edge_of(c, k, (k + 1) % 3, first_x, first_y);
    for (int64_t y = first_y; y < end_y; y++) {
        for (int64_t x = first_x; x < end_x; x++) {
            const int64_t i = x - first_x, j = y - first_y;
            if (((e[0].at + e[0].dx * i + e[0].dy * j) | (e[1].at + e[1].dx * i + e[1].dy * j) |
                    (e[2].at + e[2].dx * i + e[2].dy * j)) < 0)
                continue;
            const float along = mad(s->fused, p.dx, (float)x, p.at);
            put(tile, x, y, mad(s->fused, p.dy, (float)y, along), order);
        }
    }
}

void hg_raster_triangle(const struct hg_raster_shot *s, const struct hg_raster_tile *tile,
    const struct hg_raster_vertices *vertices, uint32_t triangle)
{
    uint32_t index[3];
    struct corners c;
    for (int k = 0; k < 3; k++)
        index[k] = s->indices[triangle * 3 + (uint32_t)k] - s->first_vertex;
    if (!take_corners(s, vertices, index, &c))
        return;
    if (runs_clockwise(&c)) {
        const uint32_t turned[3] = {index[0], index[2], index[1]};
        struct hg_raster_shot both = *s;
        both.sides = HG_RASTER_SHOWS_CCW | HG_RASTER_SHOWS_CW;
        take_corners(&both, vertices, turned, &c);
    }
    fill(s, tile, &c, s->order - triangle);
}

void hg_raster_plain(const struct hg_raster_shot *s, const struct hg_raster_tile *tile)
{
    struct hg_raster_vertices v;
    for (uint32_t i = 0; i < s->vertex_count; i++)
        project(s, s->positions + (size_t)i * 3, &v, i);
    for (uint32_t i = 0; i < s->count; i++)
        hg_raster_triangle(s, tile, &v, i);
}

bool hg_raster_has_fma(void)
{
#if defined(__x86_64__)
    return __builtin_cpu_supports("fma");
#elif defined(__aarch64__)
    return true;
#else
    return false;
#endif
}
