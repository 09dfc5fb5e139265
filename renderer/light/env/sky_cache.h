// sky_cache.h - the last sky that was drawn.
// Floor 2 (light). Thread: the render thread.
//
// What lights pictures in motion and what rays sample is the same image: it is drawn once for each
// place of the sun and each turbidity, and scenes whose files bring no light have the same.
#ifndef HG_RENDERER_LIGHT_ENV_SKY_CACHE_H
#define HG_RENDERER_LIGHT_ENV_SKY_CACHE_H

#include "renderer/light/env/sky.h"

// Zero-initialise. 8 MiB once it has a sky.
struct hg_sky_cache {
    struct hg_sky sky; // that image shows
    struct hg_image image;
};

// hg_sky_render without the disc, whatever sky->with_disc says. out: borrowed until the next call.
// HG_E_NOMEM: it has no sky then.
enum hg_status hg_sky_cache_render(struct hg_sky_cache *cache, const struct hg_sky *sky,
    struct hg_jobs *jobs, const struct hg_image **out) HG_MUST_CHECK;
void hg_sky_cache_finish(struct hg_sky_cache *cache);

#endif
