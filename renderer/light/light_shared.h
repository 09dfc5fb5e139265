// light_shared.h - what the views of one scene share of its lighting.
// Floor 2 (light). Thread: the render thread.
#ifndef HG_RENDERER_LIGHT_LIGHT_SHARED_H
#define HG_RENDERER_LIGHT_LIGHT_SHARED_H

#include "renderer/light/env/env_device.h"
#include "renderer/light/env/sky_cache.h"
#include "renderer/light/lighting.h"
#include "renderer/light/shadow/shadow_atlas.h"

struct hg_light_shared {
    struct hg_gpu *gpu;
    struct hg_env_device env;
    struct hg_sky_cache *sky, own_sky; // sky: borrowed, or own_sky
    struct hg_gpu_buffer dfg; // tables of albedo, and of linearly transformed cosines behind them
    struct hg_shadow_atlases atlases;
};

#endif
