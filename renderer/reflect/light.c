// light.c - see light.h.
#include "renderer/reflect/light.h"

#include "base/alloc.h"
#include "base/hash.h"

void hg_reflect_light_finish(struct hg_reflect_light *light, struct hg_gpu *gpu)
{
    hg_gpu_buffer_destroy(gpu, &light->rays);
    hg_gpu_buffer_destroy(gpu, &light->blocked);
    hg_free(light->points);
    hg_free(light->direct);
    hg_free(light->lit);
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
    light->lit = hg_calloc(count, sizeof *light->lit);
    light->radiance = hg_calloc(count, sizeof *light->radiance);
    enum hg_status status =
        light->points && light->direct && light->lit && light->radiance
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

enum hg_status hg_reflect_light_run(struct hg_reflect_light *light,
    const struct hg_reflect_lighting *with, uint32_t *shadow_rays, struct hg_error *err)
{
    const struct hg_gi_points points = {.jobs = with->jobs,
        .trace = with->world->trace,
        .sources = with->sources,
        .field = with->world->field,
        .rays = &light->rays,
        .blocked = &light->blocked,
        .direct = light->direct};
    for (uint32_t i = 0; i < light->count; i++) {
        const struct hg_cache_surface *s = &light->points[i];
        struct hg_gi_lit *lit = &light->lit[i];
        hg_copy3(s->position, lit->position);
        hg_copy3(s->normal, lit->normal);
        hg_copy3(s->normal, lit->view); // the same from wherever it is looked at
        lit->xi = (float)(hg_hash_mix(with->number, i) >> 40) * 0x1p-24f;
    }
    const enum hg_status status = hg_gi_points_light(&points, light->lit, light->count, err);
    for (uint32_t i = 0; i < light->count && status == HG_OK; i++)
        for (int c = 0; c < 3; c++)
            light->radiance[i][c] =
                light->points[i].emission[c] + light->points[i].albedo[c] * light->lit[i].light[c];
    if (status == HG_OK)
        *shadow_rays += hg_gi_points_rays(&points, light->count);
    return status;
}
