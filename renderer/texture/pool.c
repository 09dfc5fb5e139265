// pool.c - see pool.h.
#include "renderer/texture/pool.h"

#include <assert.h>
#include <string.h>

#include "base/alloc.h"

static const struct {
    VkFormat format;
    uint32_t texel_bytes;
    const char *name;
} kinds[HG_POOL_COUNT] = {
    [HG_POOL_SRGB] = {VK_FORMAT_R8G8B8A8_SRGB, 4, "pages-srgb"},
    [HG_POOL_LINEAR] = {VK_FORMAT_R8G8B8A8_UNORM, 4, "pages-linear"},
    [HG_POOL_FLOAT] = {VK_FORMAT_R16G16B16A16_SFLOAT, 8, "pages-float"},
};

void hg_pool_init(struct hg_pool *pool, struct hg_gpu *gpu, uint32_t kind)
{
    memset(pool, 0, sizeof *pool);
    pool->gpu = gpu;
    pool->format = kinds[kind].format;
    pool->texel_bytes = kinds[kind].texel_bytes;
    pool->name = kinds[kind].name;
}

void hg_pool_finish(struct hg_pool *pool)
{
    if (pool->gpu != NULL)
        hg_gpu_image_destroy(pool->gpu, &pool->image);
    hg_free(pool->taken);
    memset(pool, 0, sizeof *pool);
}

uint64_t hg_pool_layer_bytes(const struct hg_pool *pool)
{
    return (uint64_t)HG_POOL_SIDE * HG_POOL_SIDE * pool->texel_bytes;
}

uint32_t hg_pool_layers_for(const struct hg_pool *pool, uint64_t more, uint64_t freed)
{
    const uint64_t slots = pool->used + more - freed;
    const uint64_t layers = (slots + HG_POOL_LAYER_SLOTS - 1) / HG_POOL_LAYER_SLOTS;
    return layers > UINT32_MAX ? UINT32_MAX : (uint32_t)layers;
}

// Old layers into the new image, waited for: afterwards uploads may go to any slot.
static enum hg_status copy_layers(
    struct hg_pool *pool, struct hg_gpu_image *to, struct hg_error *err)
{
    struct hg_gpu_cmd *cmd;
    enum hg_status status = hg_gpu_begin(pool->gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    hg_gpu_image_use(cmd, &pool->image, HG_GPU_USE_COPY_READ);
    hg_gpu_image_use(cmd, to, HG_GPU_USE_COPY_WRITE);
    const VkImageCopy copy = {
        .srcSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, pool->layers},
        .dstSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, pool->layers},
        .extent = {HG_POOL_SIDE, HG_POOL_SIDE, 1},
    };
    vkCmdCopyImage(hg_gpu_cmd_handle(cmd), pool->image.handle, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL,
        to->handle, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &copy);
    hg_gpu_image_use(cmd, &pool->image, HG_GPU_USE_SAMPLED);
    uint64_t value;
    status = hg_gpu_submit(pool->gpu, cmd, &value, err);
    return status == HG_OK ? hg_gpu_wait(pool->gpu, value, err) : status;
}

enum hg_status hg_pool_grow(struct hg_pool *pool, uint32_t layers, struct hg_error *err)
{
    if (layers <= pool->layers)
        return HG_OK;
    size_t capacity = pool->taken_capacity;
    if (hg_grow(&pool->taken, &capacity, layers, sizeof *pool->taken) != HG_OK)
        return hg_error_set(err, HG_E_NOMEM, pool->name, NULL, "no memory for %u layers", layers);
    pool->taken_capacity = capacity;
    const struct hg_gpu_image_params params = {.kind = HG_GPU_IMAGE_2D_ARRAY,
        .format = pool->format,
        .width = HG_POOL_SIDE,
        .height = HG_POOL_SIDE,
        .layers = layers,
        .name = pool->name};
    struct hg_gpu_image image;
    enum hg_status status = hg_gpu_image_create(pool->gpu, &params, &image, err);
    if (status == HG_OK && pool->layers > 0)
        status = copy_layers(pool, &image, err);
    if (status != HG_OK) {
        hg_gpu_image_destroy(pool->gpu, &image);
        return status;
    }
    hg_gpu_image_destroy(pool->gpu, &pool->image);
    pool->image = image;
    memset(pool->taken + pool->layers, 0, (layers - pool->layers) * sizeof *pool->taken);
    pool->layers = layers;
    return HG_OK;
}

uint32_t hg_pool_take(struct hg_pool *pool)
{
    uint32_t layer = 0;
    while (pool->taken[layer] == UINT64_MAX)
        layer++;
    assert(layer < pool->layers);
    const uint32_t bit = (uint32_t)__builtin_ctzll(~pool->taken[layer]);
    pool->taken[layer] |= 1ull << bit;
    pool->used++;
    return layer * HG_POOL_LAYER_SLOTS + bit;
}

void hg_pool_give(struct hg_pool *pool, uint32_t slot)
{
    pool->taken[slot / HG_POOL_LAYER_SLOTS] &= ~(1ull << slot % HG_POOL_LAYER_SLOTS);
    pool->used--;
}

enum hg_status hg_pool_write(
    struct hg_pool *pool, uint32_t slot, const void *texels, struct hg_error *err)
{
    const uint32_t cell = slot % HG_POOL_LAYER_SLOTS;
    const struct hg_gpu_region region = {.layer = slot / HG_POOL_LAYER_SLOTS,
        .x = cell % HG_POOL_SLOTS * HG_PAGE_PITCH,
        .y = cell / HG_POOL_SLOTS * HG_PAGE_PITCH,
        .width = HG_PAGE_PITCH,
        .height = HG_PAGE_PITCH};
    return hg_gpu_image_upload(pool->gpu, &pool->image, &region, texels, 0, err);
}
