// patches.c - see patches.h.
#include "renderer/gi/patches.h"

#include "base/alloc.h"
#include "base/hash.h"
#include "renderer/math/vec.h"

void hg_gi_patches_finish(struct hg_gi_patches *patches, struct hg_gpu *gpu)
{
    hg_gpu_buffer_destroy(gpu, &patches->rays);
    hg_gpu_buffer_destroy(gpu, &patches->blocked);
    hg_free(patches->points);
    hg_free(patches->direct);
    hg_free(patches->lit);
    hg_free(patches->radiance);
    *patches = (struct hg_gi_patches){0};
}

enum hg_status hg_gi_patches_reserve(
    struct hg_gi_patches *patches, struct hg_gpu *gpu, uint32_t count, struct hg_error *err)
{
    const uint64_t rays = (uint64_t)count * HG_HOST_SHADOW_RAYS;
    patches->count = 0;
    if (count <= patches->capacity)
        return HG_OK;
    hg_gi_patches_finish(patches, gpu);
    patches->points = hg_calloc(count, sizeof *patches->points);
    patches->direct = hg_calloc(count, sizeof *patches->direct);
    patches->lit = hg_calloc(count, sizeof *patches->lit);
    patches->radiance = hg_calloc(count, sizeof *patches->radiance);
    enum hg_status status =
        patches->points && patches->direct && patches->lit && patches->radiance
            ? HG_OK
            : hg_error_set(err, HG_E_NOMEM, "light by surfaces", NULL, "out of host memory");
    if (status == HG_OK)
        status = hg_gpu_buffer_create(gpu, HG_GPU_BUFFER_READBACK, rays * sizeof(struct hg_gpu_ray),
            "shadow rays of patches", &patches->rays, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_create(gpu, HG_GPU_BUFFER_READBACK, rays * sizeof(uint32_t),
            "patches in shadow", &patches->blocked, err);
    if (status == HG_OK)
        patches->capacity = count;
    else
        hg_gi_patches_finish(patches, gpu);
    return status;
}

enum hg_status hg_gi_patches_light(struct hg_gi_patches *patches,
    const struct hg_gi_patch_lighting *with, uint32_t *shadow_rays, struct hg_error *err)
{
    const struct hg_gi_points points = {.jobs = with->jobs,
        .caster = with->world->caster,
        .sources = with->sources,
        .field = with->world->field,
        .rays = &patches->rays,
        .blocked = &patches->blocked,
        .direct = patches->direct};
    for (uint32_t i = 0; i < patches->count; i++) {
        const struct hg_gi_patch *s = &patches->points[i];
        struct hg_gi_lit *lit = &patches->lit[i];
        hg_copy3(s->position, lit->position);
        hg_copy3(s->normal, lit->normal);
        hg_copy3(s->normal, lit->view); // the same from wherever it is looked at
        lit->xi = (float)(hg_hash_mix(with->number, i) >> 40) * 0x1p-24f;
    }
    const enum hg_status status = hg_gi_points_light(&points, patches->lit, patches->count, err);
    for (uint32_t i = 0; i < patches->count && status == HG_OK; i++)
        for (int c = 0; c < 3; c++)
            patches->radiance[i][c] = patches->points[i].emission[c] +
                                      patches->points[i].albedo[c] * patches->lit[i].light[c];
    if (status == HG_OK)
        *shadow_rays += hg_gi_points_rays(&points, patches->count);
    return status;
}
