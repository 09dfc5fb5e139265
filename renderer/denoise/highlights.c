// highlights.c - what smooth surfaces mirror of small lights: the filter leaves it in its pixels.
//
// A lamp seen in polished metal is smaller than a pixel, and hundreds of times as bright as what is
// around it. It is neither noise that neighbours know better, nor like them: the firefly clamp
// would take it away, and patches, which hardly tell it, spread what is left of it over the
// filter's window.
#include <math.h>

#include "base/alloc.h"
#include "renderer/denoise/internal.h"

#define REACH       8     // px: surroundings
#define ABOVE_LEVEL 2.0f  // times the level of the surroundings,
#define ABOVE_NOISE 30.0f // and times their noise, that highlights begin at
#define SMOOTH      0.15f // roughness up to which surfaces have any, and
#define ROUGH       0.3f  // from which on they have none

struct work {
    struct hg_dn_planes *p;
    float *level, *noise, *seen; // of rows: sums of roots, which single pixels hardly change
};

static void sum_row(void *user, size_t y)
{
    const struct work *w = user;
    const struct hg_dn_planes *p = w->p;
    const struct hg_dn_light *light = p->light[HG_DN_SPECULAR];
    for (uint32_t x = 0; x < p->width; x++) {
        const size_t at = hg_dn_at(p, x, (uint32_t)y);
        float level = 0.0f, noise = 0.0f, seen = 0.0f;
        for (size_t q = at - REACH; q <= at + REACH; q++) {
            const float a = light[0].luma[q], b = light[1].luma[q];
            level += sqrtf(0.5f * (a + b));
            noise += sqrtf(fabsf(a - b));
            seen += p->seen[q] > 0.0f ? 1.0f : 0.0f;
        }
        w->level[at] = level;
        w->noise[at] = noise;
        w->seen[at] = seen;
    }
}

// Luminance that highlights are above.
static float limit_at(const struct work *w, size_t at)
{
    float level = 0.0f, noise = 0.0f, seen = 0.0f;
    for (int dy = -REACH; dy <= REACH; dy++) {
        const size_t q = at + (size_t)(dy * (ptrdiff_t)w->p->stride);
        level += w->level[q];
        noise += w->noise[q];
        seen += w->seen[q];
    }
    return (ABOVE_LEVEL * level * level + ABOVE_NOISE * noise * noise) / (seen * seen);
}

static void split_row(void *user, size_t y)
{
    const struct work *w = user;
    struct hg_dn_planes *p = w->p;
    for (uint32_t x = 0; x < p->width; x++) {
        const size_t at = hg_dn_at(p, x, (uint32_t)y);
        const float polish = (ROUGH - p->roughness[at]) * (1.0f / (ROUGH - SMOOTH));
        float above[2] = {0};
        if (!(p->seen[at] > 0.0f && polish > 0.0f))
            continue;
        const float limit = limit_at(w, at);
        for (int j = 0; j < 2; j++) {
            struct hg_dn_light *light = &p->light[HG_DN_SPECULAR][j];
            const float luma = light->luma[at];
            if (!(luma > limit))
                continue;
            const float part = (1.0f - limit / luma) * (polish < 1.0f ? polish : 1.0f);
            const float share = j == 0 ? p->share[at] : 1.0f - p->share[at];
            above[j] = part * luma;
            light->luma[at] -= above[j];
            for (int c = 0; c < 3; c++) {
                const float own = part * light->rgb[c][at];
                light->rgb[c][at] -= own;
                p->highlight[c][at] += share * own;
            }
        }
        const float off = above[0] - above[1];
        p->highlight_var[at] = 0.25f * off * off;
    }
}

void hg_dn_split_highlights(struct hg_dn_planes *p, struct hg_jobs *jobs)
{
    struct work w = {p, p->scratch[0], p->scratch[1], p->scratch[2]};
    if (!p->halves)
        return;
    for (size_t i = 0; i < p->count; i++)
        w.level[i] = w.noise[i] = w.seen[i] = 0.0f;
    hg_jobs_for(jobs, p->height, sum_row, &w);
    hg_jobs_for(jobs, p->height, split_row, &w);
}

void hg_dn_put_highlights(const struct hg_dn_planes *p, size_t at, struct hg_dn_clean *clean)
{
    for (int c = 0; c < 3; c++)
        clean->rgb[HG_DN_SPECULAR][c][at] += p->highlight[c][at];
    clean->variance[HG_DN_SPECULAR][at] += p->highlight_var[at];
}
