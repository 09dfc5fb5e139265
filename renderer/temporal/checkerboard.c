// checkerboard.c - see checkerboard.h.
#include "renderer/temporal/checkerboard.h"

#include "base/simd.h"

#define LEAST_CONTRAST 0.02f // of luma, that says where an edge runs
#define LEAST_AWAY     0.01f // relative difference of depths of one surface

// Neighbours of a row of pixels between shaded ones.
struct neighbours {
    const float *left[HG_TEMPORAL_CHANNELS], *right[HG_TEMPORAL_CHANNELS];
    const float *above[HG_TEMPORAL_CHANNELS], *below[HG_TEMPORAL_CHANNELS];
    const float *depth[3]; // rows of the whole picture
    uint32_t first;        // column of the first pixel
};

static inline float magnitude(float v)
{
    return v < 0.0f ? -v : v;
}

static inline float likeness(float here, float there)
{
    const float most = here > there ? here : there;
    return most / (magnitude(here - there) + LEAST_AWAY * most + 1e-30f);
}

// Weights of the neighbours: those of the same surface, along edges rather than across.
HG_SIMD_LOOP
static void weigh(const struct neighbours *n, uint32_t count, float *const weight[4])
{
    const float *restrict l = n->left[0], *restrict r = n->right[0];
    const float *restrict a = n->above[0], *restrict b = n->below[0];
    const float *restrict above = n->depth[0] + n->first, *restrict below = n->depth[2] + n->first;
    const float *restrict here = n->depth[1] + n->first;
    float *restrict wl = weight[0], *restrict wr = weight[1];
    float *restrict wa = weight[2], *restrict wb = weight[3];
    for (uint32_t i = 0; i < count; i++) {
        const float across = magnitude(l[i] - r[i]) + LEAST_CONTRAST;
        const float down = magnitude(a[i] - b[i]) + LEAST_CONTRAST;
        const float d = here[2 * i];
        wl[i] = down * likeness(d, here[2 * (int64_t)i - 1]);
        wr[i] = down * likeness(d, here[2 * i + 1]);
        wa[i] = across * likeness(d, above[2 * i]);
        wb[i] = across * likeness(d, below[2 * i]);
        const float sum = 1.0f / (wl[i] + wr[i] + wa[i] + wb[i]);
        wl[i] *= sum;
        wr[i] *= sum;
        wa[i] *= sum;
        wb[i] *= sum;
    }
}

HG_SIMD_LOOP
static void mix(const struct neighbours *n, int channel, uint32_t count, float *const weight[4],
    const float *restrict shaded, float *restrict out)
{
    const float *restrict l = n->left[channel], *restrict r = n->right[channel];
    const float *restrict a = n->above[channel], *restrict b = n->below[channel];
    const float *restrict wl = weight[0], *restrict wr = weight[1];
    const float *restrict wa = weight[2], *restrict wb = weight[3];
    float *restrict between = out + n->first, *restrict known = out + 1 - n->first;
    for (uint32_t i = 0; i < count; i++) {
        between[2 * i] = wl[i] * l[i] + wr[i] * r[i] + wa[i] * a[i] + wb[i] * b[i];
        known[2 * i] = shaded[i];
    }
}

// A picture goes on beyond its sides as it ends.
static void repeat_ends(float *const planes[HG_TEMPORAL_CHANNELS], uint32_t count)
{
    for (int c = 0; c < HG_TEMPORAL_CHANNELS; c++) {
        planes[c][-1] = planes[c][0];
        planes[c][count] = planes[c][count - 1];
    }
}

void hg_temporal_checkerboard_fill(const struct hg_temporal_picture *p, uint32_t y,
    const struct hg_temporal_checkerboard *scratch, struct hg_temporal_line *line)
{
    const uint32_t half = (p->width + 1) / 2, last = p->height - 1;
    const uint32_t last_column = p->width - 1;
    const uint32_t above = y > 0 ? y - 1 : last > 0 ? 1 : 0, below = y < last ? y + 1 : above;
    const uint32_t rows[3] = {above, y, below};
    const bool odd = ((y + p->first) & 1u) != 0; // where the first shaded pixel lies
    struct neighbours n = {.first = odd ? 0 : 1};
    line->opaque = true;
    line->motion.depth[-1] = line->motion.depth[0];
    line->motion.depth[p->width] = line->motion.depth[last_column];
    for (int k = 0; k < 3; k++) {
        line->opaque &=
            hg_temporal_decode(p->rgba + 4 * (size_t)rows[k] * half, half, scratch->rows[k]);
        repeat_ends(scratch->rows[k], half);
        n.depth[k] = k == 1 ? line->motion.depth : p->depth + (size_t)rows[k] * p->width;
    }
    for (int c = 0; c < HG_TEMPORAL_CHANNELS; c++) {
        n.left[c] = scratch->rows[1][c] - (odd ? 1 : 0);
        n.right[c] = n.left[c] + 1;
        n.above[c] = scratch->rows[0][c];
        n.below[c] = scratch->rows[2][c];
    }
    weigh(&n, p->width / 2 + (odd ? p->width & 1 : 0), scratch->rows[3]);
    for (int c = 0; c < HG_TEMPORAL_CHANNELS; c++)
        mix(&n, c, half, scratch->rows[3], scratch->rows[1][c], line->color[c]);
    hg_temporal_line_repeat(p->width, line);
}
