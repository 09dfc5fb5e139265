#include "renderer/host_shading/holes.h"

#define BEHIND 1e-6f // of the way to a hole, that a ray begins behind it

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

enum hg_status hg_host_pass_holes(const struct hg_host_surfaces *surfaces, struct hg_trace *trace,
    const struct hg_trace_wave *wave, const struct hg_gpu_buffer *list, uint32_t *more,
    struct hg_error *err)
{
    const uint32_t *of = wave->list ? wave->list->mapped : NULL;
    struct hg_trace_wave again = *wave;
    enum hg_status status = HG_OK;
    *more = 0;
    again.list = list;
    for (int round = 0; round < HG_HOST_HOLES && surfaces->has_masks && status == HG_OK; round++) {
        uint32_t *to = list->mapped;
        const uint32_t count = round == 0 ? wave->count : again.count;
        again.count = 0;
        for (uint32_t k = 0; k < count; k++) { // places that are read lie before those written
            const uint32_t i = round > 0 ? to[k] : of ? of[k] : k;
            if (pass(surfaces, wave, i))
                to[again.count++] = i;
        }
        if (again.count == 0)
            break;
        status = hg_trace_closest(trace, &again, err);
        *more += again.count;
    }
    return status;
}
