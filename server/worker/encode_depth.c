#include "server/worker/encode_depth.h"

#include <math.h>

#include "base/alloc.h"
#include "renderer/image/deflate.h"

enum { LEVEL = 1 }; // of deflate: what is left of predicted depth is mostly zeros

void hg_depth_grid_destroy(struct hg_depth_grid *g)
{
    if (!g)
        return;
    hg_free(g->sums);
    hg_free(g->nearest);
    hg_free(g->farthest);
    hg_free(g->counts);
    hg_free(g);
}

enum hg_status hg_depth_grid_create(uint32_t width, uint32_t height, bool orthographic,
    struct hg_depth_grid **out, struct hg_error *err)
{
    struct hg_depth_grid *g = *out = hg_calloc(1, sizeof *g);
    if (!g)
        return hg_error_set(err, HG_E_NOMEM, "depth", NULL, "no memory");
    g->width = width;
    g->height = height;
    g->columns = (width + HG_DEPTH_CELL_PX - 1) / HG_DEPTH_CELL_PX;
    g->rows = (height + HG_DEPTH_CELL_PX - 1) / HG_DEPTH_CELL_PX;
    g->orthographic = orthographic;
    const size_t cells = (size_t)g->columns * g->rows;
    g->sums = hg_calloc(cells, sizeof *g->sums);
    g->nearest = hg_calloc(cells, sizeof *g->nearest);
    g->farthest = hg_calloc(cells, sizeof *g->farthest);
    g->counts = hg_calloc(cells, sizeof *g->counts);
    if (g->sums && g->nearest && g->farthest && g->counts)
        return HG_OK;
    hg_depth_grid_destroy(g);
    *out = NULL;
    return hg_error_set(err, HG_E_NOMEM, "depth", NULL, "no memory");
}

// What is affine over the picture of a plane.
static float affine(const struct hg_depth_grid *g, float depth)
{
    return g->orthographic ? depth : 1 / depth;
}

void hg_depth_grid_add(struct hg_depth_grid *g, uint32_t x, uint32_t y, float depth)
{
    if (!isfinite(depth) || (!g->orthographic && !(depth > 0)))
        return;
    const size_t i = (size_t)(y / HG_DEPTH_CELL_PX) * g->columns + x / HG_DEPTH_CELL_PX;
    const bool first = g->counts[i]++ == 0;
    g->nearest[i] = first ? depth : fminf(g->nearest[i], depth);
    g->farthest[i] = first ? depth : fmaxf(g->farthest[i], depth);
    g->sums[i] += affine(g, depth);
}

static uint32_t pixels_of(const struct hg_depth_grid *g, uint32_t column, uint32_t row)
{
    const uint32_t x = column * HG_DEPTH_CELL_PX, y = row * HG_DEPTH_CELL_PX;
    const uint32_t across = g->width - x < HG_DEPTH_CELL_PX ? g->width - x : HG_DEPTH_CELL_PX,
                   down = g->height - y < HG_DEPTH_CELL_PX ? g->height - y : HG_DEPTH_CELL_PX;
    return across * down;
}

// The middle of one surface that fills the cell; where there are several, the nearest: what is in
// front moves most, and its edge must not stay behind.
static float value_of(const struct hg_depth_grid *g, uint32_t column, uint32_t row)
{
    const size_t i = (size_t)row * g->columns + column;
    const float spread = g->farthest[i] - g->nearest[i];
    const bool whole = g->counts[i] == pixels_of(g, column, row);
    if (whole && spread <= HG_DEPTH_SURFACE * fabsf(g->nearest[i]))
        return g->sums[i] / (float)g->counts[i];
    return affine(g, g->nearest[i]);
}

struct range {
    float low, high;
};

static struct range range_of(const struct hg_depth_grid *g)
{
    struct range r = {INFINITY, -INFINITY};
    for (uint32_t row = 0; row < g->rows; row++)
        for (uint32_t c = 0; c < g->columns; c++) {
            if (g->counts[(size_t)row * g->columns + c] == 0)
                continue;
            const float v = value_of(g, c, row);
            r.low = fminf(r.low, v);
            r.high = fmaxf(r.high, v);
        }
    return r.low <= r.high ? r : (struct range){0, 0};
}

static uint16_t quantise(
    const struct hg_depth_grid *g, struct range r, uint32_t column, uint32_t row)
{
    if (g->counts[(size_t)row * g->columns + column] == 0)
        return 0;
    const float share = r.high > r.low ? (value_of(g, column, row) - r.low) / (r.high - r.low) : 0;
    return (uint16_t)(1 + lrintf(share * HG_DEPTH_STEPS));
}

// Of a plane the sum of the left and the upper neighbour, less the one between, is off by the
// rounding alone.
static uint16_t predict(const uint16_t *row, const uint16_t *above, uint32_t c)
{
    if (!above)
        return c ? row[c - 1] : 0;
    return c ? (uint16_t)(row[c - 1] + above[c] - above[c - 1]) : above[0];
}

// The low bytes of all cells, then the high ones.
static void write_planes(
    const struct hg_depth_grid *g, struct range r, uint16_t *values, uint8_t *planes)
{
    const size_t cells = (size_t)g->columns * g->rows;
    for (uint32_t y = 0; y < g->rows; y++) {
        uint16_t *row = values + (size_t)y * g->columns;
        for (uint32_t c = 0; c < g->columns; c++) {
            row[c] = quantise(g, r, c, y);
            const uint16_t rest = (uint16_t)(row[c] - predict(row, y ? row - g->columns : NULL, c));
            // Small ones of either sign have no high bits.
            const uint16_t folded = (uint16_t)(rest << 1 ^ (rest & 0x8000 ? 0xffff : 0));
            planes[(size_t)y * g->columns + c] = (uint8_t)folded;
            planes[cells + (size_t)y * g->columns + c] = (uint8_t)(folded >> 8);
        }
    }
}

enum hg_status hg_depth_encode(
    const struct hg_depth_grid *g, struct hg_writer *out, struct hg_error *err)
{
    const size_t cells = (size_t)g->columns * g->rows;
    const struct range r = range_of(g);
    uint16_t *values = hg_calloc(cells, sizeof *values);
    uint8_t *planes = hg_calloc(cells, 2);
    enum hg_status status =
        values && planes ? HG_OK : hg_error_set(err, HG_E_NOMEM, "depth", NULL, "no memory");
    if (!status) {
        hg_write_u16(out, (uint16_t)g->columns);
        hg_write_u16(out, (uint16_t)g->rows);
        hg_write_f32(out, r.low);
        hg_write_f32(out, r.high);
        write_planes(g, r, values, planes);
        status = hg_deflate_encode(planes, 2 * cells, LEVEL, out, err);
    }
    hg_free(values);
    hg_free(planes);
    return status;
}
