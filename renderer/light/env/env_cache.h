// env_cache.h - prefiltered environments in the store.
// Floor 2 (light). Any thread.
#ifndef HG_RENDERER_LIGHT_ENV_ENV_CACHE_H
#define HG_RENDERER_LIGHT_ENV_ENV_CACHE_H

#include "base/status.h"
#include "renderer/light/env/environment.h"
#include "base/store/store.h"

// One entry per content and size: a block per level of the specular map, then the irradiance. False
// when there is none: *map is zeroed then.
bool hg_env_cache_read(struct hg_store *store, const uint8_t key[32], uint32_t image_width,
    struct hg_environment_map *map) HG_MUST_CHECK;
// HG_E_NOMEM and what the store's writers return.
enum hg_status hg_env_cache_write(struct hg_store *store, const uint8_t key[32],
    uint32_t image_width, const struct hg_environment_map *map, struct hg_error *err) HG_MUST_CHECK;

// The background of a sky that was drawn: width x height RGBA16F. NULL when there is none, else to
// be freed with hg_free.
uint16_t *hg_env_cache_read_sky(
    struct hg_store *store, const uint8_t key[32], uint32_t width, uint32_t height) HG_MUST_CHECK;
enum hg_status hg_env_cache_write_sky(struct hg_store *store, const uint8_t key[32], uint32_t width,
    uint32_t height, const uint16_t *texels, struct hg_error *err) HG_MUST_CHECK;

#endif
