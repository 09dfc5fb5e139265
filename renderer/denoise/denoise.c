#include "renderer/denoise/denoise.h"

#include "base/alloc.h"
#include "renderer/denoise/history.h"
#include "renderer/denoise/internal.h"

struct pass {
    struct hg_dn_light light[HG_DN_KINDS][2];
    float *memory;
};

static enum hg_status pass_init(struct pass *pass, const struct hg_dn_planes *p)
{
    pass->memory = hg_calloc(HG_DN_KINDS * 2 * 4 * p->count, sizeof(float));
    if (pass->memory == NULL)
        return HG_E_NOMEM;
    float *at = pass->memory;
    for (int i = 0; i < HG_DN_KINDS * 2; i++) {
        struct hg_dn_light *light = &pass->light[i / 2][i % 2];
        for (int c = 0; c < 3; c++, at += p->count)
            light->rgb[c] = at;
        light->luma = at;
        at += p->count;
    }
    return HG_OK;
}

// Margins around the output region: each step needs less margin by its own radius.
#define LEFT_REACH   2                        // px: smoothing of what is left of the noise
#define SECOND_REACH (LEFT_REACH + 7 + 2 + 2) // window, patch and smoothed variance
#define REACH        48u // more than 7 + 3 + 2 again, the fireflies' and the highlights'
#define TILE_PX      768u                     // side of parts of large pictures

struct work {
    const struct hg_denoise_input *input;
    struct hg_dn_rect rect; // the output region, in the picture
    struct hg_dn_planes *p;
    struct pass *pass;
    struct hg_dn_clean clean;
    float *out;
    const struct hg_dn_energy *energy;
};

// Merges both halves in place of the first; the residual noise is estimated from their difference.
static void merge_row(void *user, size_t y)
{
    struct work *w = user;
    const struct hg_dn_planes *p = w->p;
    for (uint32_t x = 0; x < p->width; x++) {
        const size_t at = hg_dn_at(p, x, (uint32_t)y);
        const float share = p->halves ? p->share[at] : 1.0f;
        for (int k = 0; k < HG_DN_KINDS; k++) {
            const struct hg_dn_light *a = &w->pass->light[k][0], *b = &w->pass->light[k][1];
            const float off = a->luma[at] - b->luma[at];
            w->clean.variance[k][at] = p->halves ? 0.25f * off * off : p->variance[k][at] / 16.0f;
            for (int c = 0; c < 3; c++)
                a->rgb[c][at] = share * a->rgb[c][at] + (1.0f - share) * b->rgb[c][at];
            a->luma[at] = hg_dn_luma(a->rgb[0][at], a->rgb[1][at], a->rgb[2][at]);
        }
        hg_dn_put_highlights(p, at, &w->clean);
    }
}

static void put_row(void *user, size_t row)
{
    const struct work *w = user;
    const struct hg_dn_planes *p = w->p;
    const size_t pixels = (size_t)w->input->width * w->input->height;
    const uint32_t y = w->rect.y + (uint32_t)row;
    for (uint32_t x = w->rect.x; x < w->rect.x + w->rect.width; x++) {
        const size_t at = hg_dn_at(p, x - p->x, y - p->y), to = (size_t)y * w->input->width + x;
        for (size_t k = 0; k < HG_DN_KINDS; k++) {
            for (size_t c = 0; c < 3; c++)
                w->out[(k * 3 + c) * pixels + to] =
                    w->clean.rgb[k][c][at] * p->face[hg_dn_lobe((int)k)].albedo[c][at];
        }
    }
}

static void give_back_row(void *user, size_t row)
{
    const struct work *w = user;
    const struct hg_denoise_input *in = w->input;
    const size_t pixels = (size_t)in->width * in->height;
    for (uint32_t x = 0; x < in->width; x++) {
        for (size_t k = 0; k < HG_DN_KINDS; k++) {
            const float factor = hg_dn_energy_at(w->energy, (int)k, x, (uint32_t)row);
            for (size_t c = 0; c < 3; c++)
                w->out[(k * 3 + c) * pixels + row * in->width + x] *= factor;
        }
    }
}

#define RADIUS         7      // px, of the window
#define ONLY_STRENGTH  0.7f   // of the only pass, without halves
#define FIRST_STRENGTH 0.45f  // standard deviations
#define LEFT_LEAST     0.005f // variance that the first pass leaves at least, of what it began with

// Half the squared difference of the filtered halves: the residual variance of each, which replaces
// the variance that guided the first pass.
static void left_row(void *user, size_t y)
{
    struct work *w = user;
    struct hg_dn_planes *p = w->p;
    for (uint32_t x = 0; x < p->width; x++) {
        const size_t at = hg_dn_at(p, x, (uint32_t)y);
        for (int k = 0; k < HG_DN_KINDS; k++) {
            const float off = w->pass->light[k][0].luma[at] - w->pass->light[k][1].luma[at];
            p->variance[k][at] = 0.5f * off * off + LEFT_LEAST * p->variance[k][at];
        }
    }
}

// The output region and a margin in px, clipped to the planes.
static struct hg_dn_rect around(const struct work *w, uint32_t px)
{
    const struct hg_dn_planes *p = w->p;
    const uint32_t left = w->rect.x - p->x, above = w->rect.y - p->y;
    const uint32_t x = left > px ? left - px : 0, y = above > px ? above - px : 0;
    const uint32_t right = left + w->rect.width + px, below = above + w->rect.height + px;
    return (struct hg_dn_rect){.x = x,
        .y = y,
        .width = (right < p->width ? right : p->width) - x,
        .height = (below < p->height ? below : p->height) - y};
}

// Two passes: guided by the samples, then (with half buffers) by the result of the first pass, in
// which edges are visible that noise hid.
static enum hg_status filter(struct work *w, struct pass *guide, struct hg_jobs *jobs)
{
    struct hg_dn_planes *p = w->p;
    struct hg_dn_filter filter = {.rect = around(w, p->halves ? SECOND_REACH : LEFT_REACH),
        .radius = RADIUS,
        .patch = 3,
        .strength = p->halves ? FIRST_STRENGTH : ONLY_STRENGTH};
    for (int i = 0; i < HG_DN_KINDS * 2; i++) {
        const int k = i / 2, j = i % 2;
        filter.variance[k] = p->variance[k];
        filter.guide[k][j] = p->light[k][j].luma;
        filter.out[k][j] = (p->halves ? guide : w->pass)->light[k][j];
    }
    enum hg_status status = hg_dn_filter_run(p, jobs, &filter);
    if (status != HG_OK || !p->halves)
        return status;
    struct work left = {.p = p, .pass = guide};
    hg_jobs_for(jobs, p->height, left_row, &left);
    for (int k = 0; k < HG_DN_KINDS; k++)
        hg_dn_smooth(p, jobs, &p->variance[k]);
    filter.rect = around(w, LEFT_REACH);
    filter.patch = 2;
    filter.strength = 1.0f;
    for (int i = 0; i < HG_DN_KINDS * 2; i++) {
        const int k = i / 2, j = i % 2;
        filter.variance[k] = p->variance[k];
        filter.guide[k][j] = guide->light[k][j].luma;
        filter.out[k][j] = w->pass->light[k][j];
    }
    return hg_dn_filter_run(p, jobs, &filter);
}

static void merge(struct work *w, struct hg_jobs *jobs)
{
    const struct hg_dn_planes *p = w->p;
    for (int k = 0; k < HG_DN_KINDS; k++) {
        for (int c = 0; c < 3; c++)
            w->clean.rgb[k][c] = w->pass->light[k][0].rgb[c];
        w->clean.variance[k] = p->halves ? w->pass->light[k][1].luma : p->variance[k];
    }
    hg_jobs_for(jobs, p->height, merge_row, w);
}

// The second half's planes are free after both are merged.
static void show(struct work *w, struct hg_jobs *jobs)
{
    float *to[HG_DN_KINDS][3];
    for (int k = 0; k < HG_DN_KINDS; k++) {
        for (int c = 0; c < 3; c++)
            to[k][c] = w->pass->light[k][1].rgb[c];
    }
    const struct hg_dn_rect rect = around(w, 0);
    hg_dn_show(w->p, jobs, w->input, &rect, &w->clean, to);
}

// --- all -----------------------------------------------------------------------------------------

static enum hg_status run_part(struct work *w, struct hg_jobs *jobs)
{
    const struct hg_denoise_input *in = w->input;
    const struct hg_dn_rect *r = &w->rect;
    struct hg_dn_planes p;
    struct pass pass = {0}, guide = {0};
    struct hg_dn_rect part = {
        .x = r->x > REACH ? r->x - REACH : 0, .y = r->y > REACH ? r->y - REACH : 0};
    const uint32_t right = r->x + r->width + REACH, below = r->y + r->height + REACH;
    part.width = (right < in->width ? right : in->width) - part.x;
    part.height = (below < in->height ? below : in->height) - part.y;
    w->p = &p;
    w->pass = &pass;
    enum hg_status status = hg_dn_planes_init(&p, jobs, in, &part);
    if (status == HG_OK)
        status = pass_init(&pass, &p);
    if (status == HG_OK && p.halves)
        status = pass_init(&guide, &p);
    if (status == HG_OK)
        status = filter(w, &guide, jobs);
    if (status == HG_OK) {
        merge(w, jobs);
        if (in->shown != NULL)
            show(w, jobs);
        hg_jobs_for(jobs, r->height, put_row, w);
    }
    if (status == HG_OK && in->history != NULL) {
        for (int k = 0; k < HG_DN_KINDS; k++)
            hg_dn_smooth(&p, jobs, &w->clean.variance[k]);
        hg_dn_history_keep(in->history, &p, r, &w->clean, jobs);
    }
    hg_free(guide.memory);
    hg_free(pass.memory);
    hg_dn_planes_finish(&p);
    return status;
}

// Large pictures are processed in parts, so that memory does not grow with their size.
static enum hg_status run_parts(struct work *w, struct hg_jobs *jobs)
{
    const struct hg_denoise_input *in = w->input;
    const uint32_t side = in->part_px > 0 ? in->part_px : TILE_PX;
    enum hg_status status = HG_OK;
    for (uint32_t y = 0; y < in->height; y += side) {
        for (uint32_t x = 0; x < in->width && status == HG_OK; x += side) {
            w->rect = (struct hg_dn_rect){.x = x,
                .y = y,
                .width = in->width - x < side ? in->width - x : side,
                .height = in->height - y < side ? in->height - y : side};
            status = run_part(w, jobs);
        }
    }
    return status;
}

enum hg_status hg_denoise_run(
    struct hg_jobs *jobs, const struct hg_denoise_input *input, float *out, struct hg_error *err)
{
    struct hg_dn_energy energy = {0};
    struct work work = {.input = input, .out = out, .energy = &energy};
    enum hg_status status = HG_OK;
    if (input->history != NULL)
        status = hg_dn_history_begin(input->history, input);
    if (status == HG_OK)
        status = run_parts(&work, jobs);
    if (status == HG_OK)
        status = hg_dn_energy_find(&energy, jobs, input, out);
    if (status == HG_OK && input->history != NULL)
        status = hg_dn_history_blend(input->history, jobs, input, &energy, out);
    else if (status == HG_OK)
        hg_jobs_for(jobs, input->height, give_back_row, &work);
    hg_dn_energy_finish(&energy);
    return status == HG_OK ? HG_OK
                           : hg_error_set(err, status, "denoise", NULL, "out of host memory");
}
