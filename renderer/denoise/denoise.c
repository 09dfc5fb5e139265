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

struct work {
    struct hg_dn_planes *p;
    struct pass *pass;
    struct hg_dn_clean clean;
    float *out;
};

// Both halves in one, in the place of the first; what is left of the noise, from their difference.
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
    }
}

static void put_row(void *user, size_t y)
{
    const struct work *w = user;
    const struct hg_dn_planes *p = w->p;
    const size_t pixels = (size_t)p->width * p->height;
    for (uint32_t x = 0; x < p->width; x++) {
        const size_t at = hg_dn_at(p, x, (uint32_t)y), to = y * p->width + x;
        for (size_t k = 0; k < HG_DN_KINDS; k++) {
            for (size_t c = 0; c < 3; c++)
                w->out[(k * 3 + c) * pixels + to] =
                    w->clean.rgb[k][c][at] * p->albedo[hg_dn_lobe((int)k)][c][at];
        }
    }
}

#define RADIUS         7      // px, of the window
#define ONLY_STRENGTH  0.7f   // of the only pass, without halves
#define FIRST_STRENGTH 0.45f  // standard deviations
#define LEFT_LEAST     0.005f // variance that the first pass leaves at least, of what it began with

// Half the squared difference of the filtered halves: what is left of the noise in each, in the
// place of the variance that the first pass was guided by.
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

// Guided by the samples, then, with halves, by what came out: that shows edges which noise hid.
static enum hg_status filter(struct work *w, struct pass *guide, struct hg_jobs *jobs)
{
    struct hg_dn_planes *p = w->p;
    struct hg_dn_filter filter = {
        .radius = RADIUS, .patch = 3, .strength = p->halves ? FIRST_STRENGTH : ONLY_STRENGTH};
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
        w->clean.luma[k] = w->pass->light[k][0].luma;
        w->clean.variance[k] = p->halves ? w->pass->light[k][1].luma : p->variance[k];
    }
    hg_jobs_for(jobs, p->height, merge_row, w);
}

enum hg_status hg_denoise_run(
    struct hg_jobs *jobs, const struct hg_denoise_input *input, float *out, struct hg_error *err)
{
    struct hg_dn_planes p;
    struct pass pass = {0}, guide = {0};
    struct work work = {.p = &p, .pass = &pass, .out = out};
    enum hg_status status = hg_dn_planes_init(&p, jobs, input);
    if (status == HG_OK)
        status = pass_init(&pass, &p);
    if (status == HG_OK && p.halves)
        status = pass_init(&guide, &p);
    if (status == HG_OK)
        status = filter(&work, &guide, jobs);
    if (status == HG_OK)
        merge(&work, jobs);
    if (status == HG_OK && input->history != NULL) {
        for (int k = 0; k < HG_DN_KINDS; k++)
            hg_dn_smooth(&p, jobs, &work.clean.variance[k]);
        status = hg_dn_history_blend(input->history, &p, input, &work.clean, jobs);
    }
    if (status == HG_OK)
        hg_jobs_for(jobs, p.height, put_row, &work);
    hg_free(guide.memory);
    hg_free(pass.memory);
    hg_dn_planes_finish(&p);
    return status == HG_OK ? HG_OK
                           : hg_error_set(err, status, "denoise", NULL, "out of host memory");
}
