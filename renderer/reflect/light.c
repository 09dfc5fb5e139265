// light.c - see light.h.
#include "renderer/reflect/light.h"

#include "base/alloc.h"
#include "base/hash.h"

#define BLOCK 64    // points that one job lights
#define LIFT  1e-3f // spacings of the field that shadow rays begin off surfaces

void hg_reflect_light_finish(struct hg_reflect_light *light, struct hg_gpu *gpu)
{
    hg_gpu_buffer_destroy(gpu, &light->rays);
    hg_gpu_buffer_destroy(gpu, &light->blocked);
    hg_free(light->points);
    hg_free(light->direct);
    hg_free(light->radiance);
    *light = (struct hg_reflect_light){0};
}

enum hg_status hg_reflect_light_reserve(
    struct hg_reflect_light *light, struct hg_gpu *gpu, uint32_t count, struct hg_error *err)
{
    const uint64_t rays = (uint64_t)count * HG_GI_SHADOW_RAYS;
    light->count = 0;
    if (count <= light->capacity)
        return HG_OK;
    hg_reflect_light_finish(light, gpu);
    light->points = hg_calloc(count, sizeof *light->points);
    light->direct = hg_calloc(count, sizeof *light->direct);
    light->radiance = hg_calloc(count, sizeof *light->radiance);
    enum hg_status status =
        light->points && light->direct && light->radiance
            ? HG_OK
            : hg_error_set(err, HG_E_NOMEM, "reflections", NULL, "out of host memory");
    if (status == HG_OK)
        status = hg_gpu_buffer_create(gpu, HG_GPU_BUFFER_READBACK, rays * sizeof(struct hg_gpu_ray),
            "reflection shadows", &light->rays, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_create(gpu, HG_GPU_BUFFER_READBACK, rays * sizeof(uint32_t),
            "reflection shadows blocked", &light->blocked, err);
    if (status == HG_OK)
        light->capacity = count;
    else
        hg_reflect_light_finish(light, gpu);
    return status;
}

struct work {
    struct hg_reflect_light *light;
    const struct hg_reflect_lighting *with;
};

static float chance(const struct work *w, uint32_t i)
{
    const uint64_t bits = hg_hash_mix(w->with->number, i);
    return (float)(bits >> 40) * 0x1p-24f;
}

static void begin_point(const struct work *w, uint32_t i)
{
    const struct hg_cache_surface *s = &w->light->points[i];
    const struct hg_gi_field *field = w->with->world->field;
    const float *p = s->position;
    const float far = fmaxf(fabsf(p[0]), fmaxf(fabsf(p[1]), fabsf(p[2])));
    struct hg_gi_receiver receiver = {
        .lift = LIFT * field->spacing + 1e-6f * far, .xi = chance(w, i)};
    struct hg_gi_point point;
    const float xi[3] = {0.5f, 0.5f, 0.5f}; // what is cached is not to be noisy
    float bounced[3];
    hg_copy3(p, receiver.position);
    hg_copy3(s->normal, receiver.normal);
    hg_gi_direct_at(w->with->sources, &receiver, &w->light->direct[i]);
    hg_copy3(p, point.position);
    hg_copy3(s->normal, point.normal);
    hg_copy3(s->normal, point.view);
    hg_gi_field_irradiance(field, &point, xi, bounced);
    for (int c = 0; c < 3; c++)
        w->light->radiance[i][c] = s->emission[c] + s->albedo[c] * bounced[c];
    memcpy((struct hg_gpu_ray *)w->light->rays.mapped + (size_t)i * HG_GI_SHADOW_RAYS,
        w->light->direct[i].rays, sizeof w->light->direct[i].rays);
}

static void begin_block(void *user, size_t block)
{
    const struct work *w = user;
    for (uint32_t i = (uint32_t)block * BLOCK; i < (block + 1) * BLOCK && i < w->light->count; i++)
        begin_point(w, i);
}

static void end_block(void *user, size_t block)
{
    const struct work *w = user;
    const uint32_t *blocked = w->light->blocked.mapped;
    for (uint32_t i = (uint32_t)block * BLOCK; i < (block + 1) * BLOCK && i < w->light->count; i++)
        for (uint32_t k = 0; k < HG_GI_SHADOW_RAYS; k++) {
            const struct hg_gi_direct *d = &w->light->direct[i];
            const bool dark = d->rays[k].t_max > 0 && blocked[i * HG_GI_SHADOW_RAYS + k] != 0;
            for (int c = 0; c < 3 && !dark; c++)
                w->light->radiance[i][c] += w->light->points[i].albedo[c] * d->light[k][c];
        }
}

enum hg_status hg_reflect_light_run(struct hg_reflect_light *light,
    const struct hg_reflect_lighting *with, uint32_t *shadow_rays, struct hg_error *err)
{
    struct work w = {light, with};
    const size_t blocks = (light->count + BLOCK - 1) / BLOCK;
    enum hg_status status = HG_OK;
    if (light->count == 0)
        return HG_OK;
    hg_jobs_for(with->jobs, blocks, begin_block, &w);
    if (with->sources->count > 0) {
        const struct hg_trace_wave wave = {.rays = &light->rays,
            .blocked = &light->blocked,
            .count = light->count * HG_GI_SHADOW_RAYS};
        status = hg_trace_blocked(with->world->trace, &wave, err);
    }
    if (status != HG_OK)
        return status;
    hg_jobs_for(with->jobs, blocks, end_block, &w);
    for (uint32_t i = 0; i < light->count; i++)
        for (int k = 0; k < HG_GI_SHADOW_RAYS; k++)
            *shadow_rays += light->direct[i].rays[k].t_max > 0;
    return HG_OK;
}
