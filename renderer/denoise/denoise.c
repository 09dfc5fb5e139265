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
                w->out[(k * 3 + c) * pixels + to] = w->clean.rgb[k][c][at] * p->albedo[k][c][at];
        }
    }
}

static enum hg_status filter(struct work *w, struct hg_jobs *jobs)
{
    struct hg_dn_planes *p = w->p;
    struct hg_dn_filter filter = {.radius = 8, .step = 1, .patch = 3, .strength = 0.7f};
    for (int k = 0; k < HG_DN_KINDS; k++) {
        filter.variance[k] = p->variance[k];
        for (int j = 0; j < 2; j++) {
            filter.guide[k][j] = p->light[k][j].luma;
            filter.out[k][j] = w->pass->light[k][j];
        }
    }
    const enum hg_status status = hg_dn_filter_run(p, jobs, &filter);
    for (int k = 0; k < HG_DN_KINDS && status == HG_OK; k++) {
        for (int c = 0; c < 3; c++)
            w->clean.rgb[k][c] = w->pass->light[k][0].rgb[c];
        w->clean.luma[k] = w->pass->light[k][0].luma;
        w->clean.variance[k] = p->halves ? w->pass->light[k][1].luma : p->variance[k];
    }
    if (status == HG_OK)
        hg_jobs_for(jobs, p->height, merge_row, w);
    return status;
}

enum hg_status hg_denoise_run(
    struct hg_jobs *jobs, const struct hg_denoise_input *input, float *out, struct hg_error *err)
{
    struct hg_dn_planes p;
    struct pass pass = {0};
    struct work work = {.p = &p, .pass = &pass, .out = out};
    enum hg_status status = hg_dn_planes_init(&p, jobs, input);
    if (status == HG_OK)
        status = pass_init(&pass, &p);
    if (status == HG_OK)
        status = filter(&work, jobs);
    if (status == HG_OK && input->history != NULL) {
        for (int k = 0; k < HG_DN_KINDS; k++)
            hg_dn_smooth(&p, jobs, &work.clean.variance[k]);
        status = hg_dn_history_blend(input->history, &p, &input->camera, &work.clean, jobs);
    }
    if (status == HG_OK)
        hg_jobs_for(jobs, p.height, put_row, &work);
    hg_free(pass.memory);
    hg_dn_planes_finish(&p);
    return status == HG_OK ? HG_OK
                           : hg_error_set(err, status, "denoise", NULL, "out of host memory");
}
