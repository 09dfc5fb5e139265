// pool.c - see pool.h.
#include "renderer/texture/cache/pool.h"

#include <string.h>

void hg_pool_init(struct hg_pool *pool, struct hg_gpu *gpu, uint32_t texel_bytes, bool small)
{
    *pool = (struct hg_pool){.gpu = gpu, .texel_bytes = texel_bytes};
    if (texel_bytes == 8) {
        pool->side = HG_POOL_HALF_SIDE;
        pool->row = HG_POOL_HALF_SLOTS;
    } else {
        pool->side = small ? HG_POOL_SMALL_SIDE : HG_POOL_SIDE;
        pool->row = small ? HG_POOL_SMALL_SLOTS : HG_POOL_SLOTS;
    }
}

bool hg_pool_is_small(const struct hg_pool *pool)
{
    return pool->texel_bytes == 4 && pool->side == HG_POOL_SMALL_SIDE;
}

uint32_t hg_pool_slots(const struct hg_pool *pool)
{
    return pool->layers * pool->row * pool->row;
}

uint32_t hg_pool_place(const struct hg_pool *pool, uint32_t slot)
{
    const uint32_t cell = slot % (pool->row * pool->row);
    return slot / (pool->row * pool->row) << 8 | cell / pool->row << 4 | cell % pool->row;
}

uint32_t hg_pool_slot(const struct hg_pool *pool, uint32_t place)
{
    return ((place >> 8) * pool->row + (place >> 4 & 15)) * pool->row + (place & 15);
}

static void destroy_images(struct hg_pool *pool)
{
    hg_gpu_image_destroy(pool->gpu, &pool->srgb);
    hg_gpu_image_destroy(pool->gpu, &pool->image);
    pool->layers = 0;
}

void hg_pool_finish(struct hg_pool *pool)
{
    if (pool->gpu != NULL)
        destroy_images(pool);
    memset(pool, 0, sizeof *pool);
}

uint64_t hg_pool_layer_bytes(const struct hg_pool *pool)
{
    return (uint64_t)pool->side * pool->side * pool->texel_bytes;
}

// A batch that does nothing but end what was recorded before, or copy layers.
static enum hg_status run_copy(
    struct hg_pool *pool, struct hg_gpu_image *to, uint32_t layers, struct hg_error *err)
{
    struct hg_gpu_cmd *cmd;
    enum hg_status status = hg_gpu_begin(pool->gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    if (to != NULL) {
        hg_gpu_image_use(cmd, &pool->image, HG_GPU_USE_COPY_READ);
        hg_gpu_image_use(cmd, to, HG_GPU_USE_COPY_WRITE);
        const VkImageCopy copy = {
            .srcSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, layers},
            .dstSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, layers},
            .extent = {pool->side, pool->side, 1},
        };
        vkCmdCopyImage(hg_gpu_cmd_handle(cmd), pool->image.handle,
            VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, to->handle, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL,
            1, &copy);
        hg_gpu_image_use(cmd, &pool->image, HG_GPU_USE_SAMPLED);
    }
    return hg_gpu_submit_and_wait(pool->gpu, cmd, err);
}

static enum hg_status create_images(struct hg_pool *pool, uint32_t layers,
    struct hg_gpu_image *image, struct hg_gpu_image *srgb, struct hg_error *err)
{
    const bool half = pool->texel_bytes == 8;
    const struct hg_gpu_image_params params = {.kind = HG_GPU_IMAGE_2D_ARRAY,
        .format = half ? VK_FORMAT_R16G16B16A16_SFLOAT : VK_FORMAT_R8G8B8A8_UNORM,
        .width = pool->side,
        .height = pool->side,
        .layers = layers,
        .aliased = !half,
        .name = half ? "pages-half" : "pages-8"};
    *srgb = (struct hg_gpu_image){0};
    enum hg_status status = hg_gpu_image_create(pool->gpu, &params, image, err);
    if (status == HG_OK && !half)
        status = hg_gpu_image_alias(
            pool->gpu, image, VK_FORMAT_R8G8B8A8_SRGB, "pages-8-srgb", srgb, err);
    if (status != HG_OK)
        hg_gpu_image_destroy(pool->gpu, image);
    return status;
}

enum hg_status hg_pool_resize(
    struct hg_pool *pool, uint32_t layers, bool keep, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    if (layers == pool->layers)
        return HG_OK;
    if (!keep || layers == 0) {
        // What was recorded but not submitted keeps the old image alive: it goes first.
        if (pool->layers > 0)
            status = run_copy(pool, NULL, 0, err);
        if (status == HG_OK)
            destroy_images(pool);
    }
    if (status != HG_OK || layers == 0)
        return status;
    struct hg_gpu_image image, srgb;
    status = create_images(pool, layers, &image, &srgb, err);
    if (status != HG_OK)
        return status;
    const uint32_t kept = pool->layers < layers ? pool->layers : layers;
    if (kept > 0)
        status = run_copy(pool, &image, kept, err);
    if (status != HG_OK) {
        hg_gpu_image_destroy(pool->gpu, &srgb);
        hg_gpu_image_destroy(pool->gpu, &image);
        return status;
    }
    destroy_images(pool);
    pool->image = image;
    pool->srgb = srgb;
    pool->layers = layers;
    return HG_OK;
}

enum hg_status hg_pool_write(
    struct hg_pool *pool, uint32_t slot, const void *texels, struct hg_error *err)
{
    const uint32_t place = hg_pool_place(pool, slot);
    const struct hg_gpu_region region = {.layer = place >> 8,
        .x = (place & 15) * HG_PAGE_PITCH,
        .y = (place >> 4 & 15) * HG_PAGE_PITCH,
        .width = HG_PAGE_PITCH,
        .height = HG_PAGE_PITCH};
    return hg_gpu_image_upload(pool->gpu, &pool->image, &region, texels, 0, err);
}
