// tile_cache.h - decoded tiles of files that are read in place, least recently used first to go:
// neighbouring pages share most tiles. Floor 2, private to the page sources.
// Thread-safe; takes no other lock while it holds its own.
#ifndef HG_RENDERER_TEXTURE_SOURCE_TILE_CACHE_H
#define HG_RENDERER_TEXTURE_SOURCE_TILE_CACHE_H

#include "renderer/texture/source/open_files.h"

struct hg_tile_cache;

// At most limit_bytes of tiles. HG_E_NOMEM.
enum hg_status hg_tile_cache_create(uint64_t limit_bytes, struct hg_tile_cache **out) HG_MUST_CHECK;
void hg_tile_cache_destroy(struct hg_tile_cache *cache); // accepts NULL
// As hg_open_file_rect. *bytes: decoded for it, 0 when all tiles were cached.
enum hg_status hg_tile_cache_rect(struct hg_tile_cache *cache, struct hg_open_file *file,
    const struct hg_image_rect *rect, void *pixels, uint64_t *bytes,
    struct hg_error *err) HG_MUST_CHECK;
void hg_tile_cache_forget(struct hg_tile_cache *cache, const struct hg_open_file *file);
// Tiles used longest ago go until at most so many bytes are left; the limit stays.
void hg_tile_cache_trim(struct hg_tile_cache *cache, uint64_t bytes);

struct hg_tile_cache_stats {
    uint64_t bytes, peak_bytes; // now, and at most
    uint64_t tiles_found, tiles_decoded;
};
void hg_tile_cache_stats(struct hg_tile_cache *cache, struct hg_tile_cache_stats *out);

#endif
