// energy.c - restores locally the energy that filtering removed.
//
// Fireflies are clamped (planes.c), and the weights are biased towards dark pixels: the filtered
// picture has too little energy. A grid with one node every CELL px collects sampled and filtered
// light with bilinear weights; the factor of a node is their ratio. Interpolating the factors with
// the same weights preserves the sum over the picture exactly, except where factors are clamped:
// a single sample far brighter than its surroundings is treated as an outlier.
#include "base/alloc.h"
#include "renderer/denoise/internal.h"

#define CELL  64    // px from node to node
#define LIMIT 0.25f // of the light around

struct work {
    struct hg_dn_energy *e;
    const struct hg_denoise_input *input;
    const float *light;
};

static float weight(uint32_t x, uint32_t node)
{
    const float off = ((float)x + 0.5f) / CELL - (float)node;
    return off < 0.0f ? 1.0f + off : 1.0f - off;
}

static uint32_t first_px(uint32_t node)
{
    return node > 0 ? (node - 1) * CELL : 0;
}

static uint32_t end_px(uint32_t node, uint32_t size)
{
    return (node + 1) * CELL < size ? (node + 1) * CELL : size;
}

// Filtered and sampled light of one pixel, of one kind.
static void look(const struct work *w, int kind, size_t at, float n, float *out, float *sampled)
{
    const struct hg_denoise_input *in = w->input;
    const size_t pixels = (size_t)in->width * in->height;
    *out = *sampled = 0.0f;
    for (size_t c = 0; c < 3; c++) {
        const size_t k = ((size_t)kind * 3 + c) * pixels + at;
        *out += w->light[k];
        *sampled += in->sums[k] / n;
    }
}

static void find_node(void *user, size_t index)
{
    const struct work *w = user;
    const struct hg_denoise_input *in = w->input;
    const uint32_t column = (uint32_t)(index % w->e->columns);
    const uint32_t row = (uint32_t)(index / w->e->columns);
    double sum[HG_DN_KINDS] = {0}, lost[HG_DN_KINDS] = {0};
    for (uint32_t y = first_px(row); y < end_px(row, in->height); y++) {
        for (uint32_t x = first_px(column); x < end_px(column, in->width); x++) {
            const uint32_t n = hg_dn_samples(in, x, y);
            const float share = weight(x, column) * weight(y, row);
            for (int k = 0; k < HG_DN_KINDS && n > 0; k++) {
                float out, sampled;
                look(w, k, (size_t)y * in->width + x, (float)n, &out, &sampled);
                sum[k] += (double)(share * out);
                lost[k] += (double)(share * (sampled - out));
            }
        }
    }
    for (int k = 0; k < HG_DN_KINDS; k++) {
        const float q = sum[k] > 0.0 ? (float)(lost[k] / sum[k]) : 0.0f;
        w->e->factor[k][index] = 1.0f + (q > LIMIT ? LIMIT : q < -LIMIT ? -LIMIT : q);
    }
}

enum hg_status hg_dn_energy_find(struct hg_dn_energy *e, struct hg_jobs *jobs,
    const struct hg_denoise_input *input, const float *light)
{
    *e =
        (struct hg_dn_energy){.columns = input->width / CELL + 2, .rows = input->height / CELL + 2};
    const size_t nodes = (size_t)e->columns * e->rows;
    float *memory = hg_calloc(HG_DN_KINDS * nodes, sizeof *memory);
    if (memory == NULL)
        return HG_E_NOMEM;
    for (int k = 0; k < HG_DN_KINDS; k++)
        e->factor[k] = memory + (size_t)k * nodes;
    struct work work = {e, input, light};
    hg_jobs_for(jobs, nodes, find_node, &work);
    return HG_OK;
}

void hg_dn_energy_finish(struct hg_dn_energy *e)
{
    hg_free(e->factor[0]);
    *e = (struct hg_dn_energy){0};
}

float hg_dn_energy_at(const struct hg_dn_energy *e, int kind, uint32_t x, uint32_t y)
{
    const uint32_t column = x / CELL, row = y / CELL;
    const float right = weight(x, column + 1), below = weight(y, row + 1);
    const float *f = e->factor[kind] + (size_t)row * e->columns + column;
    const float above = f[0] + right * (f[1] - f[0]);
    const float under = f[e->columns] + right * (f[e->columns + 1] - f[e->columns]);
    return above + below * (under - above);
}
