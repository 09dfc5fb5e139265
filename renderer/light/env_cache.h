// env_cache.h - prefiltered environments on disk.
// Floor 2 (light). Any thread; files appear complete or not at all.
#ifndef HG_RENDERER_LIGHT_ENV_CACHE_H
#define HG_RENDERER_LIGHT_ENV_CACHE_H

#include "base/status.h"
#include "renderer/light/environment.h"

// The file ends in the SHA-256 of what stands before it; its head names the format's version, the
// content and the sizes. False when there is none that fits: *map is zeroed then.
bool hg_env_cache_read(const char *cache_dir, const uint8_t key[32], uint32_t image_width,
    struct hg_environment_map *map) HG_MUST_CHECK;
// HG_E_NOMEM and what hg_file_write_atomic returns.
enum hg_status hg_env_cache_write(const char *cache_dir, const uint8_t key[32],
    uint32_t image_width, const struct hg_environment_map *map, struct hg_error *err) HG_MUST_CHECK;
// Path of the file, freed with hg_free; NULL without memory.
char *hg_env_cache_path(const char *cache_dir, const uint8_t key[32]) HG_MUST_CHECK;

#endif
