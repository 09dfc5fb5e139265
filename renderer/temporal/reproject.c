// reproject.c - see reproject.h.
#include "renderer/temporal/reproject.h"

#include <string.h>

#include "renderer/temporal/lanes.h"

#define LEAST_W 1e-7f // nearer to the plane of the eye nothing is found

void hg_temporal_way_make(const struct hg_temporal_picture *p, const double m[16], uint32_t width,
    uint32_t height, struct hg_temporal_way *out)
{
    double rows[4][4]; // of clip space, from the number of a sample
    for (int r = 0; r < 4; r++) {
        const double c[4] = {m[r], m[4 + r], m[8 + r], m[12 + r]};
        rows[r][0] = c[0] * 2.0 / p->width;
        rows[r][1] = c[1] * 2.0 / p->height;
        rows[r][2] = c[2];
        rows[r][3] = c[3] + c[0] * (1.0 / p->width - 1.0) + c[1] * (1.0 / p->height - 1.0);
    }
    for (int k = 0; k < 4; k++) {
        out->to[0][k] = (float)((rows[0][k] + rows[3][k]) * 0.5 * width);
        out->to[1][k] = (float)((rows[1][k] + rows[3][k]) * 0.5 * height);
        out->to[2][k] = (float)rows[2][k];
        out->to[3][k] = (float)rows[3][k];
    }
    out->px[0][0] = (float)width / (float)p->width;
    out->px[1][0] = (float)height / (float)p->height;
    for (int a = 0; a < 2; a++)
        out->px[a][1] = (0.5f + p->jitter_px[a]) * out->px[a][0];
}

// Samples first .. end of a row, all of one matrix; up to seven behind them are written as well.
HG_SIMD_LOOP
static void fill(const struct hg_temporal_way *way, const uint32_t range[2], uint32_t row,
    const struct hg_temporal_motion_row *out)
{
    const float y = (float)row, here = way->px[1][0] * y + way->px[1][1];
    float a[4], b[4], d[4];
    for (int k = 0; k < 4; k++) {
        a[k] = way->to[k][0];
        b[k] = way->to[k][1] * y + way->to[k][3];
        d[k] = way->to[k][2];
    }
    const hg_lanes lost = {HG_TEMPORAL_LOST, HG_TEMPORAL_LOST, HG_TEMPORAL_LOST, HG_TEMPORAL_LOST,
        HG_TEMPORAL_LOST, HG_TEMPORAL_LOST, HG_TEMPORAL_LOST, HG_TEMPORAL_LOST};
    const hg_lanes none = {0}, one = none + 1.0f;
    for (uint32_t i = range[0]; i < range[1]; i += HG_LANES) {
        const hg_lanes x = HG_LANES_FLOAT(HG_LANES_COUNT_FROM + (int32_t)i);
        const hg_lanes z = HG_LANES_AT(out->depth, i);
        const hg_lanes w = a[3] * x + (d[3] * z + b[3]);
        const hg_lanes_int ahead = w > LEAST_W;
        const hg_lanes per_w = 1.0f / HG_LANES_PICK(ahead, w, one);
        const hg_lanes was_x = (a[0] * x + (d[0] * z + b[0])) * per_w;
        const hg_lanes was_y = (a[1] * x + (d[1] * z + b[1])) * per_w;
        const hg_lanes to_x = was_x - (way->px[0][0] * x + way->px[0][1]);
        HG_LANES_PUT(out->x, i, HG_LANES_PICK(ahead, to_x, lost));
        HG_LANES_PUT(out->y, i, HG_LANES_PICK(ahead, was_y - here, none));
        HG_LANES_PUT(out->expect, i, (a[2] * x + (d[2] * z + b[2])) * per_w);
    }
}

static uint32_t matrix_of(const struct hg_temporal_picture *p, const uint32_t *id)
{
    const uint32_t draw = *id - 1u; // of the background: no draw
    return draw < p->draw_count ? p->matrix_of_draw[draw] : 0u;
}

static void fill_lost(uint32_t first, uint32_t end, const struct hg_temporal_motion_row *out)
{
    for (uint32_t x = first; x < end; x++) {
        out->x[x] = HG_TEMPORAL_LOST;
        out->y[x] = 0.0f;
    }
}

// Samples of posed surfaces: the rectangle says where they were.
static void fill_posed(const struct hg_temporal_picture *p, const struct hg_temporal_way *way,
    const uint32_t range[2], uint32_t y, const struct hg_temporal_motion_row *out)
{
    const struct hg_temporal_posed *r = &p->posed;
    const float half[2] = {
        0.5f * way->px[0][0] * (float)p->width, 0.5f * way->px[1][0] * (float)p->height};
    for (uint32_t x = range[0]; x < range[1]; x++) {
        // Numbers left of the rectangle or above it wrap around, and are outside as well.
        const uint32_t column = x - r->x, row = y - r->y;
        const bool inside = column < r->width && row < r->height;
        const float *was = inside ? r->was[(size_t)row * r->width + column] : NULL;
        if (!inside || was[2] < 0.0f) {
            fill_lost(x, x + 1, out);
            continue;
        }
        out->x[x] = (was[0] + 1.0f) * half[0] - (way->px[0][0] * (float)x + way->px[0][1]);
        out->y[x] = (was[1] + 1.0f) * half[1] - (way->px[1][0] * (float)y + way->px[1][1]);
        out->expect[x] = was[2];
    }
}

// What moves by itself.
static void fill_moved(const struct hg_temporal_picture *p, const struct hg_temporal_way *ways,
    uint32_t y, struct hg_temporal_motion_row *out)
{
    const uint32_t *ids = p->ids + 2 * (size_t)y * p->width;
    for (uint32_t x = 0; x < p->width;) {
        const uint32_t first = x, matrix = matrix_of(p, ids + 2 * (size_t)x);
        while (x < p->width && matrix_of(p, ids + 2 * (size_t)x) == matrix)
            x++;
        if (matrix == HG_TEMPORAL_DEFORMED)
            fill_posed(p, ways, (const uint32_t[2]){first, x}, y, out);
        else if (matrix > 0)
            fill(&ways[matrix], (const uint32_t[2]){first, x}, y, out);
        else if (first > 0) // what the last run wrote behind its end
            fill(ways, (const uint32_t[2]){first, first + 1}, y, out);
    }
}

void hg_temporal_motion_fill(const struct hg_temporal_picture *p,
    const struct hg_temporal_way *ways, uint32_t y, struct hg_temporal_motion_row *out)
{
    memcpy(out->depth, p->depth + (size_t)y * p->width, p->width * sizeof *out->depth);
    fill(ways, (const uint32_t[2]){0, p->width}, y, out);
    if (p->ids != NULL)
        fill_moved(p, ways, y, out);
}
