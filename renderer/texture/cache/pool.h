// pool.h - a physical page pool: one 2D array image of slots. Floor 2 (texture), render thread.
#ifndef HG_RENDERER_TEXTURE_CACHE_POOL_H
#define HG_RENDERER_TEXTURE_CACHE_POOL_H

#include "renderer/gpu/gpu.h"
#include "shaders/shared/texture.h"

// Zero-initialise, then hg_pool_init.
struct hg_pool {
    struct hg_gpu *gpu;
    struct hg_gpu_image image; // handle VK_NULL_HANDLE while there are no layers
    struct hg_gpu_image srgb;  // RGBA8: the same slots seen as sRGB
    uint32_t texel_bytes;      // 4 or 8
    uint32_t side, row;        // of a layer: texels, slots
    uint32_t layers;
};

// small: layers of RGBA8 texels are half as wide and high (4 MiB in place of 16).
void hg_pool_init(struct hg_pool *pool, struct hg_gpu *gpu, uint32_t texel_bytes, bool small);
void hg_pool_finish(struct hg_pool *pool); // accepts a zeroed pool

// Slots are numbered from 0, layer by layer; their places are those of the page table.
uint32_t hg_pool_slots(const struct hg_pool *pool);
uint32_t hg_pool_place(const struct hg_pool *pool, uint32_t slot);
uint32_t hg_pool_slot(const struct hg_pool *pool, uint32_t place);
uint64_t hg_pool_layer_bytes(const struct hg_pool *pool);
bool hg_pool_is_small(const struct hg_pool *pool);
// Makes the pool `layers` large. keep: old layers are copied by a batch of its own (none may be
// open), so that old and new exist for a while; else the old memory is given back first and what
// the slots held is lost. HG_E_LIMIT, HG_E_NOMEM: as it was, without `keep` it may be empty.
enum hg_status hg_pool_resize(
    struct hg_pool *pool, uint32_t layers, bool keep, struct hg_error *err) HG_MUST_CHECK;
// Texels of a slot, HG_PAGE_PITCH^2.
enum hg_status hg_pool_write(
    struct hg_pool *pool, uint32_t slot, const void *texels, struct hg_error *err) HG_MUST_CHECK;

#endif
