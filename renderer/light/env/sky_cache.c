#include "renderer/light/env/sky_cache.h"

#include <string.h>

static bool is_same(const struct hg_sky *a, const struct hg_sky *b)
{
    return memcmp(a->sun_direction, b->sun_direction, sizeof a->sun_direction) == 0 &&
           memcmp(&a->turbidity, &b->turbidity, sizeof a->turbidity) == 0;
}

enum hg_status hg_sky_cache_render(struct hg_sky_cache *cache, const struct hg_sky *sky,
    struct hg_jobs *jobs, const struct hg_image **out)
{
    *out = NULL;
    if (cache->image.pixels == NULL || !is_same(&cache->sky, sky)) {
        hg_sky_cache_finish(cache);
        cache->sky = *sky;
        cache->sky.with_disc = false;
        const enum hg_status status = hg_sky_render(&cache->sky, jobs, &cache->image);
        if (status)
            return status;
    }
    *out = &cache->image;
    return HG_OK;
}

void hg_sky_cache_finish(struct hg_sky_cache *cache)
{
    hg_image_finish(&cache->image);
    *cache = (struct hg_sky_cache){0};
}
