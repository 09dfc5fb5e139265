// pool.h - a physical page pool: one 2D array image of slots. Floor 2 (texture), render thread.
#ifndef HG_RENDERER_TEXTURE_POOL_H
#define HG_RENDERER_TEXTURE_POOL_H

#include "renderer/gpu/gpu.h"
#include "shaders/shared/texture.h"

#define HG_POOL_LAYER_SLOTS (HG_POOL_SLOTS * HG_POOL_SLOTS)

// Zero-initialise, then hg_pool_init.
struct hg_pool {
    struct hg_gpu *gpu;
    struct hg_gpu_image image; // handle VK_NULL_HANDLE while there are no layers
    VkFormat format;
    const char *name;
    uint32_t texel_bytes;
    uint32_t layers, used; // slots in use
    uint64_t *taken;       // [layers] one bit per slot
    size_t taken_capacity;
};

void hg_pool_init(struct hg_pool *pool, struct hg_gpu *gpu, uint32_t kind); // HG_POOL_*
void hg_pool_finish(struct hg_pool *pool);                                  // accepts a zeroed pool

uint64_t hg_pool_layer_bytes(const struct hg_pool *pool);
// Layers needed for `more` slots beside those in use, less `freed` ones.
uint32_t hg_pool_layers_for(const struct hg_pool *pool, uint64_t more, uint64_t freed);
// Grows to `layers` and copies what is there in a batch of its own (none may be open). HG_E_LIMIT,
// HG_E_NOMEM: the pool is as it was.
enum hg_status hg_pool_grow(
    struct hg_pool *pool, uint32_t layers, struct hg_error *err) HG_MUST_CHECK;
// Lowest free slot; there must be one.
uint32_t hg_pool_take(struct hg_pool *pool);
void hg_pool_give(struct hg_pool *pool, uint32_t slot);
// Texels of a slot, HG_PAGE_PITCH^2.
enum hg_status hg_pool_write(
    struct hg_pool *pool, uint32_t slot, const void *texels, struct hg_error *err) HG_MUST_CHECK;

#endif
