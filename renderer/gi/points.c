// points.c - see points.h.
#include "renderer/gi/points.h"

#include "renderer/math/vec.h"

#define AT_ONCE 64    // points that one job lights
#define LIFT    1e-3f // spacings of the field that shadow rays begin off surfaces

struct job {
    const struct hg_gi_points *with;
    struct hg_gi_lit *points;
    uint32_t count;
};

static void receive(
    const struct hg_gi_points *with, struct hg_gi_lit *p, struct hg_host_direct *out)
{
    const float middle[3] = {0.5f, 0.5f, 0.5f}; // what is kept is not to be noisy
    const float far =
        fmaxf(fabsf(p->position[0]), fmaxf(fabsf(p->position[1]), fabsf(p->position[2])));
    struct hg_host_receiver r = {.lift = LIFT * with->field->spacing + 1e-6f * far, .xi = p->xi};
    struct hg_gi_point point;
    hg_copy3(p->position, r.position);
    hg_copy3(p->normal, r.normal);
    hg_host_direct_at(with->sources, &r, out);
    hg_copy3(p->position, point.position);
    hg_copy3(p->normal, point.normal);
    hg_copy3(p->view, point.view);
    hg_gi_field_irradiance(with->field, &point, middle, p->light);
}

static void begin(void *user, size_t index)
{
    const struct job *j = user;
    struct hg_gpu_ray *rays = j->with->rays->mapped;
    for (size_t i = index * AT_ONCE; i < (index + 1) * AT_ONCE && i < j->count; i++) {
        struct hg_host_direct *d = &j->with->direct[i];
        memset(j->points[i].light, 0, sizeof j->points[i].light);
        for (int k = 0; k < HG_HOST_SHADOW_RAYS; k++)
            d->rays[k].t_max = -1;
        if (!j->points[i].skipped)
            receive(j->with, &j->points[i], d);
        memcpy(rays + i * HG_HOST_SHADOW_RAYS, d->rays, sizeof d->rays);
    }
}

static void end(void *user, size_t index)
{
    const struct job *j = user;
    const uint32_t *blocked = j->with->blocked->mapped;
    for (size_t i = index * AT_ONCE; i < (index + 1) * AT_ONCE && i < j->count; i++)
        for (uint32_t k = 0; k < HG_HOST_SHADOW_RAYS && !j->points[i].skipped; k++) {
            const struct hg_host_direct *d = &j->with->direct[i];
            if (d->rays[k].t_max > 0 && blocked[i * HG_HOST_SHADOW_RAYS + k])
                continue;
            for (int c = 0; c < 3; c++)
                j->points[i].light[c] += d->light[k][c];
        }
}

enum hg_status hg_gi_points_light(
    const struct hg_gi_points *with, struct hg_gi_lit *points, uint32_t count, struct hg_error *err)
{
    struct job job = {with, points, count};
    const size_t jobs = ((size_t)count + AT_ONCE - 1) / AT_ONCE;
    enum hg_status status = HG_OK;
    if (count == 0)
        return HG_OK;
    hg_jobs_for(with->jobs, jobs, begin, &job);
    if (with->sources->count > 0) {
        const struct hg_trace_wave wave = {
            .rays = with->rays, .blocked = with->blocked, .count = count * HG_HOST_SHADOW_RAYS};
        status = hg_host_cast_shadows(with->caster, &wave, err);
    }
    if (status == HG_OK)
        hg_jobs_for(with->jobs, jobs, end, &job);
    return status;
}

uint32_t hg_gi_points_rays(const struct hg_gi_points *with, uint32_t count)
{
    uint32_t rays = 0;
    for (uint32_t i = 0; i < count; i++)
        for (int k = 0; k < HG_HOST_SHADOW_RAYS; k++)
            rays += with->direct[i].rays[k].t_max > 0;
    return rays;
}
