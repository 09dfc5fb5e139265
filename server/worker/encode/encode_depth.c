#include "server/worker/encode/encode_depth.h"

#include <math.h>

#include "base/alloc.h"
#include "renderer/image/deflate.h"

enum { LEVEL = 1 }; // of deflate: what is left of predicted depth is mostly zeros

void hg_depth_grid_destroy(struct hg_depth_grid *g)
{
    if (!g)
        return;
    hg_free(g->depths);
    hg_free(g);
}

enum hg_status hg_depth_grid_create(uint32_t width, uint32_t height, bool orthographic,
    struct hg_depth_grid **out, struct hg_error *err)
{
    struct hg_depth_grid *g = *out = hg_calloc(1, sizeof *g);
    if (!g)
        return hg_error_set(err, HG_E_NOMEM, "depth", NULL, "no memory");
    g->columns = (width + HG_DEPTH_CELL_PX - 1) / HG_DEPTH_CELL_PX;
    g->rows = (height + HG_DEPTH_CELL_PX - 1) / HG_DEPTH_CELL_PX;
    g->orthographic = orthographic;
    g->depths = hg_calloc((size_t)g->columns * g->rows, sizeof *g->depths);
    if (g->depths)
        return HG_OK;
    hg_depth_grid_destroy(g);
    *out = NULL;
    return hg_error_set(err, HG_E_NOMEM, "depth", NULL, "no memory");
}

// What is affine over the picture of a plane; infinite: nothing is there.
static float value_of(const struct hg_depth_grid *g, uint32_t column, uint32_t row)
{
    const float depth = g->depths[(size_t)row * g->columns + column];
    if (!isfinite(depth) || (!g->orthographic && !(depth > 0)))
        return INFINITY;
    return g->orthographic ? depth : 1 / depth;
}

struct range {
    float low, high;
};

static struct range range_of(const struct hg_depth_grid *g)
{
    struct range r = {INFINITY, -INFINITY};
    for (uint32_t row = 0; row < g->rows; row++)
        for (uint32_t c = 0; c < g->columns; c++) {
            const float v = value_of(g, c, row);
            if (!isfinite(v))
                continue;
            r.low = fminf(r.low, v);
            r.high = fmaxf(r.high, v);
        }
    return r.low <= r.high ? r : (struct range){0, 0};
}

static uint16_t quantise(
    const struct hg_depth_grid *g, struct range r, uint32_t column, uint32_t row)
{
    const float v = value_of(g, column, row);
    if (!isfinite(v))
        return 0;
    const float share = r.high > r.low ? (v - r.low) / (r.high - r.low) : 0;
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
