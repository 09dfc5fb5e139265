#include "renderer/light/env/env_warp.h"

#include <math.h>

#include "base/alloc.h"
#include "renderer/math/vec.h"

#define EVERYWHERE 0.01 // of the mean luminance, added to all cells
#define LEFT_OUT   0.01 // relative variance that coarser cells may add to what a sample stands for

struct warping {
    const struct hg_image *image;
    float *luminance; // [height][width] of the image's texels
    float *sums;      // [rows][width] of the texels of a row of cells
    float *cells;     // [rows][2 * rows]
    double *row_sums; // [rows] of weights
    uint32_t rows;
};

static void luminance_row(void *user, size_t y)
{
    const struct warping *w = user;
    const float *from = (const float *)w->image->pixels + y * w->image->width * 4;
    float *to = w->luminance + y * w->image->width;
    for (uint32_t x = 0; x < w->image->width; x++) {
        float c[3];
        for (int i = 0; i < 3; i++)
            c[i] = from[x * 4 + (uint32_t)i] > 0 ? fminf(from[x * 4 + (uint32_t)i], 65504) : 0;
        to[x] = 0.2126f * c[0] + 0.7152f * c[1] + 0.0722f * c[2];
    }
}

static double solid_angle(const struct warping *w, size_t row)
{
    return HG_PI / w->rows * 2 * sin(HG_PI * ((double)row + 0.5) / w->rows) *
           sin(0.5 * HG_PI / w->rows);
}

// Adds a row of texels as a bilinear lookup shows them from above to below: 1 6 1 over 8.
static void add_shown_row(const struct warping *w, uint32_t y, float weight, float *sums)
{
    const size_t width = w->image->width;
    const float *row = w->luminance + y * width;
    const float *above = y > 0 ? row - width : row;
    const float *below = y + 1 < w->image->height ? row + width : row;
    for (size_t x = 0; x < width; x++)
        sums[x] += (above[x] + 6 * row[x] + below[x]) * (weight / 8);
}

// A row of cells: means over the texels they cover, in part at the ends, times the solid angle.
static void weigh_row(void *user, size_t row)
{
    const struct warping *w = user;
    const uint32_t columns = 2 * w->rows, width = w->image->width;
    const double step_x = (double)width / columns, step_y = (double)w->image->height / w->rows;
    const double top = (double)row * step_y, bottom = top + step_y;
    float *sums = w->sums + row * width;
    for (uint32_t y = (uint32_t)top; y < bottom && y < w->image->height; y++)
        add_shown_row(w, y, (float)(fmin(y + 1, bottom) - fmax(y, top)), sums);
    w->row_sums[row] = 0;
    for (uint32_t x = 0; x < columns; x++) {
        const double left = x * step_x, right = left + step_x;
        double sum = 0;
        for (uint32_t at = (uint32_t)left; at < right && at < width; at++) {
            const double shown = (double)sums[at > 0 ? at - 1 : width - 1] + 6 * (double)sums[at] +
                                 (double)sums[at + 1 < width ? at + 1 : 0];
            sum += shown / 8 * (fmin(at + 1, right) - fmax(at, left));
        }
        const double weight = sum / (step_x * step_y) * solid_angle(w, row);
        w->cells[row * columns + x] = (float)weight;
        w->row_sums[row] += weight;
    }
}

static uint32_t spread_bits(uint32_t v)
{
    uint32_t out = 0;
    for (uint32_t i = 0; i < 16; i++)
        out |= (v >> i & 1) << (2 * i);
    return out;
}

static uint32_t quads_at(uint32_t level)
{
    return 1 + 2 * ((1u << (2 * (level - 1))) - 1) / 3;
}

static float *quad_floats(const struct hg_env_warp *warp, uint32_t quad)
{
    return &warp->quads[quad].x;
}

static void fill_finest(const struct warping *w, struct hg_env_warp *out)
{
    const uint32_t columns = 2 * w->rows;
    double total = 0;
    for (uint32_t y = 0; y < w->rows; y++)
        total += w->row_sums[y];
    out->mean = (float)(total / (4 * HG_PI));
    for (uint32_t y = 0; y < w->rows; y++) {
        const float more = (float)(EVERYWHERE * (double)out->mean * solid_angle(w, y));
        for (uint32_t x = 0; x < columns; x++) {
            const uint32_t half = x >> out->levels, in = x & (w->rows - 1);
            const uint32_t cell = half << (2 * out->levels) | spread_bits(in) | spread_bits(y) << 1;
            quad_floats(out, quads_at(out->levels))[cell] =
                w->cells[(size_t)y * columns + x] + more;
        }
    }
}

static void fill_coarser(struct hg_env_warp *out)
{
    for (uint32_t level = out->levels; level > 0; level--) {
        const float *fine = quad_floats(out, quads_at(level));
        float *coarse = quad_floats(out, level > 1 ? quads_at(level - 1) : 0);
        const uint32_t cells = 2u << (2 * (level - 1));
        for (uint32_t i = 0; i < cells; i++)
            coarse[i] = (fine[i * 4] + fine[i * 4 + 1]) + (fine[i * 4 + 2] + fine[i * 4 + 3]);
    }
}

// Levels without which the weights of samples would vary hardly more: of a sky without its sun few
// are enough, and a descent through fewer of them takes less time and fewer words. Coarser cells
// are drawn evenly, so the relative variance of a sample that stands for a cell within one of them
// is the sum of squares of the fine cells, times their number, over the square of their sum.
static uint32_t enough_levels(const struct hg_env_warp *warp, double *squares)
{
    const uint32_t cells = 2u << (2 * warp->levels);
    const float *finest = quad_floats(warp, quads_at(warp->levels)), *root = quad_floats(warp, 0);
    const double all = (double)root[0] + (double)root[1];
    uint32_t enough = warp->levels;
    double share = 1; // cells of the finest grid in one of the level's
    for (uint32_t i = 0; i < cells; i++)
        squares[i] = (double)finest[i] * (double)finest[i];
    for (uint32_t level = warp->levels - 1; level > 0; level--) {
        const float *sums = quad_floats(warp, quads_at(level));
        double moment = 0;
        share *= 4;
        for (uint32_t i = 0; i < 2u << (2 * level); i++) {
            squares[i] =
                (squares[4 * i] + squares[4 * i + 1]) + (squares[4 * i + 2] + squares[4 * i + 3]);
            moment += squares[i] * share / (double)sums[i];
        }
        if (!(moment / all - 1 <= LEFT_OUT))
            break;
        enough = level;
    }
    return enough;
}

enum hg_status hg_env_warp_make(
    const struct hg_image *image, struct hg_jobs *jobs, struct hg_env_warp *out)
{
    *out = (struct hg_env_warp){.levels = 1};
    while (out->levels < HG_ENV_WARP_MAX_LEVELS && 2u << out->levels < image->width)
        out->levels++;
    struct warping w = {.image = image, .rows = 1u << out->levels};
    out->quad_count = quads_at(out->levels) + (2u << (2 * (out->levels - 1)));
    w.luminance = hg_calloc((size_t)image->width * image->height, sizeof *w.luminance);
    w.sums = hg_calloc((size_t)w.rows * image->width, sizeof *w.sums);
    w.cells = hg_calloc((size_t)w.rows * w.rows, 2 * sizeof *w.cells);
    w.row_sums = hg_calloc(w.rows, sizeof *w.row_sums);
    out->quads = hg_calloc(out->quad_count, sizeof *out->quads);
    double *squares = hg_calloc((size_t)w.rows * w.rows, 2 * sizeof *squares);
    const bool made = w.luminance && w.sums && w.cells && w.row_sums && out->quads && squares;
    if (made) {
        hg_jobs_for(jobs, image->height, luminance_row, &w);
        hg_jobs_for(jobs, w.rows, weigh_row, &w);
        fill_finest(&w, out);
        fill_coarser(out);
        if (out->mean > 0)
            out->levels = enough_levels(out, squares);
        out->quad_count = quads_at(out->levels) + (2u << (2 * (out->levels - 1)));
    }
    hg_free(squares);
    hg_free(w.luminance);
    hg_free(w.sums);
    hg_free(w.cells);
    hg_free(w.row_sums);
    if (!made || !(out->mean > 0) || !isfinite(out->mean))
        hg_env_warp_finish(out);
    return made ? HG_OK : HG_E_NOMEM;
}

void hg_env_warp_finish(struct hg_env_warp *warp)
{
    hg_free(warp->quads);
    *warp = (struct hg_env_warp){0};
}
