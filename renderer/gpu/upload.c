// upload.c - copies through staging memory, recorded in front of the next batch.
#include <string.h>

#include "base/checked.h"
#include "renderer/gpu/internal.h"

void hg_gpu_upload_finish(struct hg_gpu *gpu)
{
    for (uint32_t i = 0; i < HG_GPU_SLOTS; i++) {
        struct hg_gpu_upload *upload = &gpu->uploads.slots[i];
        hg_gpu_buffer_destroy(gpu, &upload->staging);
        if (upload->pool != VK_NULL_HANDLE)
            vkDestroyCommandPool(gpu->device, upload->pool, NULL);
        *upload = (struct hg_gpu_upload){0};
    }
    gpu->uploads.open = NULL;
}

// One whose last submission is over, so that as few as possible take memory; else the oldest.
static struct hg_gpu_upload *choose_upload(struct hg_gpu *gpu)
{
    struct hg_gpu_upload *best = &gpu->uploads.slots[0];
    for (uint32_t i = 0; i < HG_GPU_SLOTS; i++) {
        if (gpu->uploads.slots[i].value <= gpu->batches.completed)
            return &gpu->uploads.slots[i];
        if (gpu->uploads.slots[i].value < best->value)
            best = &gpu->uploads.slots[i];
    }
    return best;
}

static enum hg_status open_upload(struct hg_gpu *gpu, struct hg_error *err)
{
    if (gpu->uploads.open != NULL)
        return HG_OK;
    struct hg_gpu_upload *upload = choose_upload(gpu);
    enum hg_status status = hg_gpu_wait(gpu, upload->value, err);
    if (status == HG_OK && upload->staging.handle == VK_NULL_HANDLE) {
        status = hg_gpu_buffer_create(
            gpu, HG_GPU_BUFFER_UPLOAD, HG_GPU_STAGING_BYTES, "staging", &upload->staging, err);
    }
    if (status == HG_OK)
        status = HG_VK(gpu, err, vkResetCommandPool, gpu->device, upload->pool, 0);
    const VkCommandBufferBeginInfo info = {.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO,
        .flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT};
    if (status == HG_OK)
        status = HG_VK(gpu, err, vkBeginCommandBuffer, upload->handle, &info);
    gpu->uploads.staging_used = 0;
    gpu->uploads.written_count = 0;
    gpu->uploads.open = status == HG_OK ? upload : NULL;
    return status;
}

// Staging room for at least `least` and at most `most` bytes; flushes when it is full.
static enum hg_status take_staging(struct hg_gpu *gpu, uint64_t least, uint64_t most,
    uint64_t *offset, uint64_t *size, struct hg_error *err)
{
    *offset = *size = 0;
    if (least > HG_GPU_STAGING_BYTES)
        return hg_error_set(err, HG_E_LIMIT, "upload", NULL, "one row is larger than staging");
    enum hg_status status = open_upload(gpu, err);
    if (status == HG_OK && gpu->uploads.staging_used + least > HG_GPU_STAGING_BYTES) {
        status = hg_gpu_submit_uploads(gpu, err);
        if (status == HG_OK)
            status = open_upload(gpu, err);
    }
    if (status != HG_OK)
        return status;
    const uint64_t room = HG_GPU_STAGING_BYTES - gpu->uploads.staging_used;
    *offset = gpu->uploads.staging_used;
    *size = most < room ? most : room;
    gpu->uploads.staging_used = (gpu->uploads.staging_used + *size + 255) & ~255ull;
    if (gpu->uploads.staging_used > HG_GPU_STAGING_BYTES)
        gpu->uploads.staging_used = HG_GPU_STAGING_BYTES;
    return HG_OK;
}

static bool overlaps(const struct hg_gpu_written *a, const struct hg_gpu_written *b)
{
    return a->handle == b->handle && a->plane == b->plane && a->low[0] < b->high[0] &&
           b->low[0] < a->high[0] && a->low[1] < b->high[1] && b->low[1] < a->high[1];
}

// Copies of one upload may overtake each other; one that writes what an earlier one wrote waits for
// it. So does one that finds the list full, which is then cleared.
static void order_write(struct hg_gpu *gpu, const struct hg_gpu_written *next)
{
    bool wait = gpu->uploads.written_count == HG_GPU_MAX_WRITTEN;
    for (uint32_t i = 0; i < gpu->uploads.written_count && !wait; i++)
        wait = overlaps(&gpu->uploads.written[i], next);
    if (wait) {
        const VkMemoryBarrier2 barrier = {.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER_2,
            .srcStageMask = VK_PIPELINE_STAGE_2_COPY_BIT,
            .srcAccessMask = VK_ACCESS_2_TRANSFER_WRITE_BIT,
            .dstStageMask = VK_PIPELINE_STAGE_2_COPY_BIT,
            .dstAccessMask = VK_ACCESS_2_TRANSFER_WRITE_BIT};
        const VkDependencyInfo info = {.sType = VK_STRUCTURE_TYPE_DEPENDENCY_INFO,
            .memoryBarrierCount = 1,
            .pMemoryBarriers = &barrier};
        vkCmdPipelineBarrier2(gpu->uploads.open->handle, &info);
        gpu->uploads.written_count = 0;
    }
    gpu->uploads.written[gpu->uploads.written_count++] = *next;
}

enum hg_status hg_gpu_buffer_upload(struct hg_gpu *gpu, const struct hg_gpu_buffer *buffer,
    uint64_t offset, const void *data, uint64_t size_bytes, struct hg_error *err)
{
    if (!hg_range_ok(offset, size_bytes, buffer->size_bytes))
        return hg_error_set(err, HG_E_INVAL, "upload", NULL, "outside the buffer");
    if (buffer->mapped != NULL) {
        if (size_bytes > 0) // else there may be no data
            memcpy((uint8_t *)buffer->mapped + offset, data, size_bytes);
        return HG_OK;
    }
    const uint8_t *bytes = data;
    while (size_bytes > 0) {
        uint64_t from, size;
        enum hg_status status = take_staging(gpu, 1, size_bytes, &from, &size, err);
        if (status != HG_OK)
            return status;
        memcpy((uint8_t *)gpu->uploads.open->staging.mapped + from, bytes, size);
        const struct hg_gpu_written target = {
            (uint64_t)buffer->handle, 0, {offset, 0}, {offset + size, 1}};
        order_write(gpu, &target);
        const VkBufferCopy copy = {from, offset, size};
        vkCmdCopyBuffer(
            gpu->uploads.open->handle, gpu->uploads.open->staging.handle, buffer->handle, 1, &copy);
        bytes += size;
        offset += size;
        size_bytes -= size;
    }
    return HG_OK;
}

uint32_t hg_gpu_texel_bytes(VkFormat format)
{
    switch (format) {
    case VK_FORMAT_R8_UNORM:
        return 1;
    case VK_FORMAT_R8G8_UNORM:
    case VK_FORMAT_R16_SFLOAT:
    case VK_FORMAT_R16_UNORM:
    case VK_FORMAT_D16_UNORM:
        return 2;
    case VK_FORMAT_R16G16B16A16_SFLOAT:
    case VK_FORMAT_R16G16B16A16_UNORM:
    case VK_FORMAT_R32G32_SFLOAT:
    case VK_FORMAT_R32G32_UINT:
        return 8;
    case VK_FORMAT_R32G32B32A32_SFLOAT:
    case VK_FORMAT_R32G32B32A32_UINT:
        return 16;
    default: // RGBA8, R32, RG16, D32, B10G11R11, E5B9G9R9
        return 4;
    }
}

static void copy_to_image(struct hg_gpu *gpu, struct hg_gpu_image *image,
    const struct hg_gpu_region *r, uint32_t y, uint32_t rows, uint64_t from)
{
    const bool slices = image->kind == HG_GPU_IMAGE_3D;
    hg_gpu_image_barrier(
        gpu, 1, image, (struct hg_gpu_mips){0, image->mips}, HG_GPU_USE_COPY_WRITE);
    const struct hg_gpu_written target = {(uint64_t)image->handle, r->mip << 16 | r->layer,
        {r->x, r->y + y}, {r->x + r->width, r->y + y + rows}};
    order_write(gpu, &target);
    const VkBufferImageCopy copy = {
        .bufferOffset = from,
        .imageSubresource = {image->aspect, r->mip, slices ? 0 : r->layer, 1},
        .imageOffset = {(int32_t)r->x, (int32_t)(r->y + y), slices ? (int32_t)r->layer : 0},
        .imageExtent = {r->width, rows, 1},
    };
    vkCmdCopyBufferToImage(gpu->uploads.open->handle, gpu->uploads.open->staging.handle,
        image->handle, VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, 1, &copy);
}

enum hg_status hg_gpu_image_upload(struct hg_gpu *gpu, struct hg_gpu_image *image,
    const struct hg_gpu_region *r, const void *data, uint64_t row_bytes, struct hg_error *err)
{
    const uint64_t tight = (uint64_t)r->width * hg_gpu_texel_bytes(image->format);
    const uint32_t mip_width = image->width >> r->mip > 0 ? image->width >> r->mip : 1;
    const uint32_t mip_height = image->height >> r->mip > 0 ? image->height >> r->mip : 1;
    const uint32_t slices = image->depth >> r->mip > 0 ? image->depth >> r->mip : 1;
    if (r->mip >= image->mips ||
        r->layer >= (image->kind == HG_GPU_IMAGE_3D ? slices : image->layers) ||
        !hg_range_ok(r->x, r->width, mip_width) || !hg_range_ok(r->y, r->height, mip_height))
        return hg_error_set(err, HG_E_INVAL, "upload", NULL, "outside the image");
    row_bytes = row_bytes != 0 ? row_bytes : tight;
    for (uint32_t y = 0; y < r->height;) {
        uint64_t from, size;
        enum hg_status status =
            take_staging(gpu, tight, tight * (r->height - y), &from, &size, err);
        if (status != HG_OK)
            return status;
        const uint32_t rows = (uint32_t)(size / tight);
        uint8_t *dst = (uint8_t *)gpu->uploads.open->staging.mapped + from;
        for (uint32_t i = 0; i < rows; i++)
            memcpy(dst + i * tight, (const uint8_t *)data + (y + i) * row_bytes, tight);
        copy_to_image(gpu, image, r, y, rows, from);
        y += rows;
    }
    return HG_OK;
}

enum hg_status hg_gpu_image_upload_layers(struct hg_gpu *gpu, struct hg_gpu_image *image,
    const struct hg_gpu_region *region, uint32_t layers, const void *data, struct hg_error *err)
{
    const uint64_t stride =
        (uint64_t)region->width * region->height * hg_gpu_texel_bytes(image->format);
    for (uint32_t i = 0; i < layers; i++) {
        struct hg_gpu_region r = *region;
        r.layer += i;
        enum hg_status status =
            hg_gpu_image_upload(gpu, image, &r, (const uint8_t *)data + i * stride, 0, err);
        if (status != HG_OK)
            return status;
    }
    return HG_OK;
}
