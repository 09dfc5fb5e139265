#include "renderer/gi/sights.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/gi/direct.h"
#include "renderer/math/vec.h"

#define AT_ONCE 64 // rays that one job shades

struct job {
    const struct hg_gi_sights *s;
    struct hg_gi_direct *direct; // [count]
    struct hg_gi_sight *out;
    uint32_t count;
};

static void receive(const struct job *j, uint32_t i, const struct hg_gi_surface *surface)
{
    const struct hg_gpu_ray *ray = (const struct hg_gpu_ray *)j->s->rays->mapped + i;
    const struct hg_gpu_hit *hit = (const struct hg_gpu_hit *)j->s->hits->mapped + i;
    const float from[3] = {ray->origin_ws.x, ray->origin_ws.y, ray->origin_ws.z};
    const float way[3] = {ray->direction_ws.x, ray->direction_ws.y, ray->direction_ws.z};
    const float length = sqrtf(hg_dot3(way, way));
    // In a picture that is metered neighbours should not share their chances.
    const float xi = (float)(i * 2654435769u >> 8) * (1.0f / 16777216.0f);
    const float middle[3] = {0.5f, 0.5f, 0.5f};
    struct hg_gi_sight *out = &j->out[i];
    struct hg_gi_receiver r = {.xi = xi};
    struct hg_gi_point point;
    hg_mad3(from, way, hit->t, r.position);
    hg_copy3(surface->normal, r.normal);
    const float far =
        fmaxf(fabsf(r.position[0]), fmaxf(fabsf(r.position[1]), fabsf(r.position[2])));
    r.lift = 1e-3f * j->s->field->spacing + 1e-6f * far;
    hg_gi_direct_at(j->s->sources, &r, &j->direct[i]);
    hg_copy3(r.position, point.position);
    hg_copy3(r.normal, point.normal);
    for (int a = 0; a < 3; a++)
        point.view[a] = -way[a] / length;
    hg_gi_field_irradiance(j->s->field, &point, middle, out->light);
    hg_copy3(surface->material->albedo, out->albedo);
    hg_copy3(surface->material->emission, out->emission);
    out->hit = true;
}

static void shade(void *user, size_t index)
{
    const struct job *j = user;
    const uint32_t first = (uint32_t)index * AT_ONCE;
    const uint32_t end = first + AT_ONCE < j->count ? first + AT_ONCE : j->count;
    struct hg_gpu_ray *shadows = j->s->shadow_rays->mapped;
    for (uint32_t i = first; i < end; i++) {
        const struct hg_gpu_ray *ray = (const struct hg_gpu_ray *)j->s->rays->mapped + i;
        const struct hg_gpu_hit *hit = (const struct hg_gpu_hit *)j->s->hits->mapped + i;
        const float way[3] = {ray->direction_ws.x, ray->direction_ws.y, ray->direction_ws.z};
        struct hg_gi_surface surface;
        for (int k = 0; k < HG_GI_SHADOW_RAYS; k++)
            j->direct[i].rays[k].t_max = -1;
        if (hit->draw != HG_HIT_NONE) {
            hg_gi_surface_at(j->s->surfaces, hit, way, &surface);
            if (!surface.back)
                receive(j, i, &surface);
        }
        memcpy(
            shadows + (size_t)i * HG_GI_SHADOW_RAYS, j->direct[i].rays, sizeof j->direct[i].rays);
    }
}

static void add_direct(const struct job *j)
{
    const uint32_t *blocked = j->s->blocked->mapped;
    for (uint32_t i = 0; i < j->count; i++)
        for (uint32_t k = 0; k < HG_GI_SHADOW_RAYS && j->out[i].hit; k++) {
            const struct hg_gi_direct *d = &j->direct[i];
            if (d->rays[k].t_max > 0 && blocked[i * HG_GI_SHADOW_RAYS + k])
                continue;
            for (int c = 0; c < 3; c++)
                j->out[i].light[c] += d->light[k][c];
        }
}

enum hg_status hg_gi_sights_see(const struct hg_gi_sights *s, const struct hg_gpu_ray *rays,
    uint32_t count, struct hg_gi_sight *out, struct hg_error *err)
{
    struct job job = {.s = s, .out = out, .count = count};
    memset(out, 0, count * sizeof *out);
    job.direct = hg_calloc(count > 0 ? count : 1, sizeof *job.direct);
    if (job.direct == NULL)
        return hg_error_set(err, HG_E_NOMEM, "probes", NULL, "out of host memory");
    memcpy(s->rays->mapped, rays, count * sizeof *rays);
    struct hg_trace_wave wave = {
        .rays = s->rays, .hits = s->hits, .count = count, .coherent = true};
    enum hg_status status = hg_trace_closest(s->trace, &wave, err);
    if (status == HG_OK) {
        hg_jobs_for(s->jobs, (count + AT_ONCE - 1) / AT_ONCE, shade, &job);
        wave = (struct hg_trace_wave){
            .rays = s->shadow_rays, .blocked = s->blocked, .count = count * HG_GI_SHADOW_RAYS};
        status = hg_trace_blocked(s->trace, &wave, err);
    }
    if (status == HG_OK)
        add_direct(&job);
    hg_free(job.direct);
    return status;
}
