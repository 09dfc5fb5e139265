#include "renderer/light/light_shared.h"

#include "base/alloc.h"
#include "renderer/light/albedo/dfg_embed.h"
#include "renderer/light/ltc/ltc_embed.h"

// Tables of albedo, and those of linearly transformed cosines behind them (HG_LTC_FIRST).
static enum hg_status create_dfg(struct hg_light_shared *s, struct hg_error *err)
{
    const uint64_t bytes = sizeof hg_dfg_words, more = sizeof hg_ltc_words;
    enum hg_status status =
        hg_gpu_buffer_create(s->gpu, HG_GPU_BUFFER_DEVICE, bytes + more, "dfg", &s->dfg, err);
    if (!status)
        status = hg_gpu_buffer_upload(s->gpu, &s->dfg, 0, hg_dfg_words, bytes, err);
    if (!status)
        status = hg_gpu_buffer_upload(s->gpu, &s->dfg, bytes, hg_ltc_words, more, err);
    return status;
}

enum hg_status hg_light_shared_create(struct hg_gpu *gpu, struct hg_sky_cache *sky,
    struct hg_light_shared **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_light_shared *s = hg_calloc(1, sizeof *s);
    if (!s)
        return hg_error_set(err, HG_E_NOMEM, "lighting", NULL, "no memory");
    s->gpu = gpu;
    s->sky = sky ? sky : &s->own_sky;
    enum hg_status status = hg_env_device_init(&s->env, gpu, err);
    if (!status)
        status = create_dfg(s, err);
    if (!status)
        status = hg_shadow_atlases_init(&s->atlases, gpu, err);
    if (status)
        hg_light_shared_destroy(s);
    else
        *out = s;
    return status;
}

void hg_light_shared_destroy(struct hg_light_shared *s)
{
    if (!s)
        return;
    hg_env_device_finish(&s->env, s->gpu);
    hg_sky_cache_finish(&s->own_sky);
    hg_gpu_buffer_destroy(s->gpu, &s->dfg);
    hg_shadow_atlases_finish(&s->atlases);
    hg_free(s);
}

struct hg_sky_cache *hg_light_shared_sky(struct hg_light_shared *s)
{
    return s->sky;
}
