#include "renderer/gi/camera_hits.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/gi/points.h"
#include "renderer/math/vec.h"

#define AT_ONCE 64 // rays that one job looks at

struct job {
    const struct hg_gi_camera_hits *s;
    struct hg_gi_lit *points; // [count]
    struct hg_gi_camera_hit *out;
    uint32_t count;
};

// The point to be lit where ray i met the front of a surface.
static void meet(const struct job *j, uint32_t i)
{
    const struct hg_gpu_ray *ray = (const struct hg_gpu_ray *)j->s->rays->mapped + i;
    const struct hg_gpu_hit *hit = (const struct hg_gpu_hit *)j->s->hits->mapped + i;
    const float from[3] = {ray->origin_ws.x, ray->origin_ws.y, ray->origin_ws.z};
    const float way[3] = {ray->direction_ws.x, ray->direction_ws.y, ray->direction_ws.z};
    const float length = sqrtf(hg_dot3(way, way));
    struct hg_gi_lit *p = &j->points[i];
    struct hg_gi_camera_hit *out = &j->out[i];
    struct hg_host_surface surface;
    p->skipped = true;
    if (hit->draw == HG_HIT_NONE)
        return;
    hg_host_surface_at(j->s->caster->surfaces, hit, way, &surface);
    if (surface.back)
        return;
    p->skipped = false;
    // Neighbouring rays should not share their random numbers.
    p->xi = (float)(i * 2654435769u >> 8) * (1.0f / 16777216.0f);
    hg_mad3(from, way, hit->t, p->position);
    hg_copy3(surface.normal, p->normal);
    for (int a = 0; a < 3; a++)
        p->view[a] = -way[a] / length;
    hg_copy3(surface.material->albedo, out->albedo);
    hg_copy3(surface.material->emission, out->emission);
    out->hit = true;
}

static void meet_some(void *user, size_t index)
{
    const struct job *j = user;
    for (size_t i = index * AT_ONCE; i < (index + 1) * AT_ONCE && i < j->count; i++)
        meet(j, (uint32_t)i);
}

static enum hg_status light(
    const struct job *j, struct hg_host_direct *direct, struct hg_error *err)
{
    const struct hg_gi_points with = {.jobs = j->s->jobs,
        .caster = j->s->caster,
        .sources = j->s->sources,
        .field = j->s->field,
        .rays = j->s->shadow_rays,
        .blocked = j->s->blocked,
        .direct = direct};
    const enum hg_status status = hg_gi_points_light(&with, j->points, j->count, err);
    for (uint32_t i = 0; i < j->count && status == HG_OK; i++)
        hg_copy3(j->points[i].light, j->out[i].light);
    return status;
}

enum hg_status hg_gi_camera_hits_find(const struct hg_gi_camera_hits *s,
    const struct hg_gpu_ray *rays, uint32_t count, struct hg_gi_camera_hit *out,
    struct hg_error *err)
{
    struct job job = {.s = s, .out = out, .count = count};
    const size_t room = count > 0 ? count : 1;
    struct hg_host_direct *direct = hg_calloc(room, sizeof *direct);
    memset(out, 0, count * sizeof *out);
    job.points = hg_calloc(room, sizeof *job.points);
    enum hg_status status =
        direct && job.points ? HG_OK
                             : hg_error_set(err, HG_E_NOMEM, "probes", NULL, "out of host memory");
    memcpy(s->rays->mapped, rays, count * sizeof *rays);
    const struct hg_trace_wave wave = {
        .rays = s->rays, .hits = s->hits, .count = count, .coherent = true};
    uint32_t more;
    if (status == HG_OK)
        status = hg_host_cast(s->caster, &wave, &more, err);
    if (status == HG_OK) {
        hg_jobs_for(s->jobs, (room + AT_ONCE - 1) / AT_ONCE, meet_some, &job);
        status = light(&job, direct, err);
    }
    hg_free(direct);
    hg_free(job.points);
    return status;
}
