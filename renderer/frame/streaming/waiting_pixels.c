// waiting_pixels.c - see waiting_pixels.h.
#include "renderer/frame/streaming/waiting_pixels.h"

#include <stdbool.h>

#include "shaders/shared/sample_blocks.h"
#include "shaders/shared/texture.h"

#define CELLS     32u    // of the grid over a rectangle, along each side
#define CELL_PX   64u    // sides of cells are multiples of this
#define DRAW_PX   16384u // what beginning a draw costs, in pixels
#define LEAST_WIN 2u     // rectangles are drawn in so small a part of the time, at most

// --- pixels --------------------------------------------------------------------------------------

static uint32_t enough(const struct hg_waiting_pixels *w, uint32_t x, uint32_t y)
{
    return w->counts == NULL
               ? w->samples
               : w->counts[y / HG_SAMPLE_BLOCK_HEIGHT * w->columns + x / HG_SAMPLE_BLOCK_WIDTH];
}

uint32_t hg_waiting_pixels_least(const struct hg_waiting_pixels *w, VkRect2D rect)
{
    uint32_t least = w->samples;
    for (uint32_t i = 0; i < rect.extent.height; i++) {
        const uint32_t y = (uint32_t)rect.offset.y + i;
        const uint32_t *row = w->progress + (size_t)y * w->width;
        for (uint32_t k = 0; k < rect.extent.width; k++) {
            const uint32_t x = (uint32_t)rect.offset.x + k;
            const uint32_t samples = row[x] & HG_PROGRESS_SAMPLES_MASK;
            if (samples < least && samples < enough(w, x, y))
                least = samples;
        }
    }
    return least;
}

// --- rectangles ----------------------------------------------------------------------------------

struct box { // of cells, ends included
    uint32_t left, top, right, bottom;
};

struct grid { // of cells that begin at multiples of their sides
    uint32_t cell_px, left, top, columns, rows;
    uint8_t waits[CELLS + 1][CELLS + 1]; // 1: some pixel does
};

static void fill(const struct hg_waiting_pixels *w, VkRect2D rect, uint32_t reached, struct grid *g)
{
    const uint32_t left = (uint32_t)rect.offset.x, top = (uint32_t)rect.offset.y;
    const uint32_t width = rect.extent.width, height = rect.extent.height;
    const uint32_t side = ((width > height ? width : height) + CELLS - 1) / CELLS;
    *g = (struct grid){.cell_px = (side + CELL_PX - 1) / CELL_PX * CELL_PX};
    g->left = left / g->cell_px;
    g->top = top / g->cell_px;
    g->columns = (left + width - 1) / g->cell_px - g->left + 1;
    g->rows = (top + height - 1) / g->cell_px - g->top + 1;
    for (uint32_t y = top; y < top + height; y++) {
        const uint32_t *row = w->progress + (size_t)y * w->width;
        for (uint32_t x = left; x < left + width; x++) {
            const uint32_t samples = row[x] & HG_PROGRESS_SAMPLES_MASK;
            if (samples < reached && samples < enough(w, x, y))
                g->waits[y / g->cell_px - g->top][x / g->cell_px - g->left] = 1;
        }
    }
}

static uint32_t smaller(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

static uint32_t larger(uint32_t a, uint32_t b)
{
    return a > b ? a : b;
}

static struct box around(const struct box *a, const struct box *b)
{
    return (struct box){smaller(a->left, b->left), smaller(a->top, b->top),
        larger(a->right, b->right), larger(a->bottom, b->bottom)};
}

static uint64_t pixels_of(const struct grid *g, const struct box *b)
{
    return (uint64_t)(b->right - b->left + 1) * (b->bottom - b->top + 1) * g->cell_px * g->cell_px +
           DRAW_PX;
}

// Joins the two boxes that together cost least more than apart; all pairs that cost less, where
// there are few enough.
static bool join(const struct grid *g, struct box *boxes, uint32_t *count, bool must)
{
    uint32_t first = 0, second = 0;
    int64_t least = must ? INT64_MAX : 0;
    for (uint32_t i = 0; i < *count; i++)
        for (uint32_t k = i + 1; k < *count; k++) {
            const struct box both = around(&boxes[i], &boxes[k]);
            const int64_t more = (int64_t)pixels_of(g, &both) - (int64_t)pixels_of(g, &boxes[i]) -
                                 (int64_t)pixels_of(g, &boxes[k]);
            if (more >= least)
                continue;
            least = more;
            first = i;
            second = k;
        }
    if (second == 0)
        return false;
    boxes[first] = around(&boxes[first], &boxes[second]);
    boxes[second] = boxes[--*count];
    return true;
}

// Runs of cells of each row, joined whenever there would be more than one too many.
static uint32_t cover(const struct grid *g, struct box boxes[HG_WAITING_MOST_RECTS + 1])
{
    uint32_t count = 0;
    for (uint32_t y = 0; y < g->rows; y++)
        for (uint32_t x = 0; x < g->columns; x++) {
            if (!g->waits[y][x])
                continue;
            const uint32_t left = x;
            while (x + 1 < g->columns && g->waits[y][x + 1])
                x++;
            boxes[count++] = (struct box){left, y, x, y};
            while (join(g, boxes, &count, count > HG_WAITING_MOST_RECTS))
                ;
        }
    return count;
}

// What of the rectangle is in a box.
static VkRect2D within(const struct grid *g, const struct box *b, VkRect2D rect)
{
    const uint32_t first_x = (uint32_t)rect.offset.x, first_y = (uint32_t)rect.offset.y;
    const uint32_t left = larger((g->left + b->left) * g->cell_px, first_x);
    const uint32_t top = larger((g->top + b->top) * g->cell_px, first_y);
    const uint32_t right =
        smaller((g->left + b->right + 1) * g->cell_px, first_x + rect.extent.width);
    const uint32_t bottom =
        smaller((g->top + b->bottom + 1) * g->cell_px, first_y + rect.extent.height);
    return (VkRect2D){{(int32_t)left, (int32_t)top}, {right - left, bottom - top}};
}

uint32_t hg_waiting_pixels_rects(const struct hg_waiting_pixels *w, VkRect2D rect, uint32_t reached,
    VkRect2D out[HG_WAITING_MOST_RECTS])
{
    struct grid g;
    struct box boxes[HG_WAITING_MOST_RECTS + 1];
    fill(w, rect, reached, &g);
    const uint32_t count = cover(&g, boxes);
    uint64_t cost = 0;
    for (uint32_t i = 0; i < count; i++) {
        out[i] = within(&g, &boxes[i], rect);
        cost += pixels_of(&g, &boxes[i]);
    }
    return LEAST_WIN * cost <= (uint64_t)rect.extent.width * rect.extent.height ? count : 0;
}
