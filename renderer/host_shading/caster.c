#include "renderer/host_shading/caster.h"

#define BEHIND 1e-6f // of the way to a hole, that a ray begins behind it

void hg_host_caster_finish(struct hg_host_caster *c)
{
    hg_gpu_buffer_destroy(c->gpu, &c->list);
    hg_gpu_buffer_destroy(c->gpu, &c->behind);
    *c = (struct hg_host_caster){0};
}

static enum hg_status reserve_list(struct hg_host_caster *c, uint64_t count, struct hg_error *err)
{
    return hg_gpu_buffer_reserve(c->gpu, HG_GPU_BUFFER_READBACK, count * sizeof(uint32_t),
        "rays that passed holes of masks", &c->list, err);
}

// True: the ray goes on.
static bool pass(const struct hg_host_surfaces *s, const struct hg_trace_wave *wave, uint32_t i)
{
    const struct hg_gpu_hit *hit =
        (const struct hg_gpu_hit *)wave->hits->mapped + wave->first_hit + i;
    struct hg_gpu_ray *ray = (struct hg_gpu_ray *)wave->rays->mapped + wave->first_ray + i;
    if (hit->draw == HG_HIT_NONE || !hg_host_surface_is_hole(s, hit))
        return false;
    ray->t_min = hit->t * (1 + BEHIND);
    return true;
}

enum hg_status hg_host_cast(struct hg_host_caster *c, const struct hg_trace_wave *wave,
    uint32_t *more, struct hg_error *err)
{
    struct hg_trace_wave again = *wave;
    enum hg_status status = hg_trace_closest(c->trace, wave, err);
    *more = 0;
    if (status == HG_OK && c->surfaces->has_masks)
        status = reserve_list(c, wave->count, err);
    for (int round = 0; round < HG_HOST_HOLES && c->surfaces->has_masks && status == HG_OK;
         round++) {
        // Places that are read lie before those written.
        const uint32_t *of = again.list ? again.list->mapped : NULL;
        uint32_t *to = c->list.mapped;
        const uint32_t count = again.count;
        again.count = 0;
        for (uint32_t k = 0; k < count; k++) {
            const uint32_t i = of ? of[k] : k;
            if (pass(c->surfaces, wave, i))
                to[again.count++] = i;
        }
        if (again.count == 0)
            break;
        again.list = &c->list;
        status = hg_trace_closest(c->trace, &again, err);
        *more += again.count;
    }
    return status;
}

// Which rays nothing solid blocks: they look for masks alone.
static uint32_t list_open(const struct hg_trace_wave *wave, uint32_t *list)
{
    struct hg_gpu_ray *rays = wave->rays->mapped;
    const uint32_t *blocked = wave->blocked->mapped;
    uint32_t count = 0;
    for (uint32_t i = 0; i < wave->count; i++) {
        if (blocked[i] || !(rays[i].t_max > rays[i].t_min))
            continue;
        rays[i].mask = HG_RAY_MASK;
        list[count++] = i;
    }
    return count;
}

enum hg_status hg_host_cast_shadows(
    struct hg_host_caster *c, const struct hg_trace_wave *wave, struct hg_error *err)
{
    if (!c->surfaces->has_masks)
        return hg_trace_blocked(c->trace, wave, err);
    struct hg_gpu_ray *rays = wave->rays->mapped;
    for (uint32_t i = 0; i < wave->count; i++)
        rays[i].mask &= ~HG_RAY_MASK;
    enum hg_status status = hg_trace_blocked(c->trace, wave, err);
    if (status == HG_OK)
        status = reserve_list(c, wave->count, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_reserve(c->gpu, HG_GPU_BUFFER_READBACK,
            wave->count * sizeof(struct hg_gpu_hit), "masks in the way of light", &c->behind, err);
    if (status != HG_OK)
        return status;
    struct hg_trace_wave masks = {.rays = wave->rays, .hits = &c->behind, .list = &c->list};
    uint32_t *blocked = wave->blocked->mapped, *list = c->list.mapped, more;
    const struct hg_gpu_hit *hits = c->behind.mapped;
    for (uint32_t i = 0; i < wave->count; i++)
        ((struct hg_gpu_hit *)c->behind.mapped)[i].draw = HG_HIT_NONE;
    masks.count = list_open(wave, list);
    if (masks.count > 0)
        status = hg_host_cast(c, &masks, &more, err);
    for (uint32_t i = 0; i < wave->count && status == HG_OK; i++)
        blocked[i] |= hits[i].draw != HG_HIT_NONE;
    return status;
}
