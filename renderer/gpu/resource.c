// resource.c - buffers and images.
#include <string.h>

#include "base/alloc.h"
#include "renderer/gpu/internal.h"

// --- buffers by address --------------------------------------------------------------------------

// Index of the first live buffer above an address.
static uint32_t above(const struct hg_gpu *gpu, VkDeviceAddress address)
{
    uint32_t low = 0, high = gpu->live.count;
    while (low < high) {
        const uint32_t middle = (low + high) / 2;
        if (gpu->live.items[middle].address <= address)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

const struct hg_gpu_live *hg_gpu_find_live(const struct hg_gpu *gpu, VkDeviceAddress address)
{
    const uint32_t i = above(gpu, address);
    if (i == 0)
        return NULL;
    const struct hg_gpu_live *live = &gpu->live.items[i - 1];
    return address - live->address < live->size_bytes ? live : NULL;
}

static bool remember(struct hg_gpu *gpu, const struct hg_gpu_buffer *buffer)
{
    if (hg_grow(&gpu->live.items, &gpu->live.capacity, gpu->live.count + 1,
            sizeof *gpu->live.items) != HG_OK)
        return false;
    const uint32_t i = above(gpu, buffer->address);
    memmove(gpu->live.items + i + 1, gpu->live.items + i,
        (gpu->live.count - i) * sizeof *gpu->live.items);
    gpu->live.items[i] = (struct hg_gpu_live){buffer->address, buffer->size_bytes, buffer->handle};
    gpu->live.count++;
    return true;
}

static void forget(struct hg_gpu *gpu, const struct hg_gpu_buffer *buffer)
{
    const uint32_t i = above(gpu, buffer->address);
    if (i == 0 || gpu->live.items[i - 1].handle != buffer->handle)
        return;
    gpu->live.count--;
    memmove(gpu->live.items + i - 1, gpu->live.items + i,
        (gpu->live.count - (i - 1)) * sizeof *gpu->live.items);
}

#define RAY_USAGE                                                                                  \
    (VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_BUILD_INPUT_READ_ONLY_BIT_KHR |                        \
        VK_BUFFER_USAGE_ACCELERATION_STRUCTURE_STORAGE_BIT_KHR)

// --- buffers -------------------------------------------------------------------------------------

static void retire_buffer(struct hg_gpu *gpu, const struct hg_gpu_buffer *buffer)
{
    const struct hg_gpu_retired object = {
        .buffer = buffer->handle, .texels = buffer->texels, .memory = buffer->memory};
    hg_gpu_retire(gpu, &object);
}

static enum hg_status bind_buffer(struct hg_gpu *gpu, enum hg_gpu_buffer_kind kind,
    struct hg_gpu_buffer *out, struct hg_error *err)
{
    VkMemoryRequirements need;
    vkGetBufferMemoryRequirements(gpu->device, out->handle, &need);
    const bool on_device = kind == HG_GPU_BUFFER_DEVICE || kind == HG_GPU_BUFFER_TEXELS;
    enum hg_status status = hg_gpu_memory_take(gpu,
        on_device ? HG_GPU_MEMORY_DEVICE : (enum hg_gpu_memory_kind)kind, &need, &out->memory, err);
    if (status != HG_OK)
        return status;
    struct hg_gpu_block *block = out->memory.block;
    status = HG_VK(
        gpu, err, vkBindBufferMemory, gpu->device, out->handle, block->memory, out->memory.offset);
    if (status != HG_OK)
        return status;
    const VkBufferDeviceAddressInfo info = {
        .sType = VK_STRUCTURE_TYPE_BUFFER_DEVICE_ADDRESS_INFO, .buffer = out->handle};
    out->address = vkGetBufferDeviceAddress(gpu->device, &info);
    const bool hidden = on_device && !gpu->caps.mapped;
    if (block->mapped != NULL && !hidden)
        out->mapped = (uint8_t *)block->mapped + out->memory.offset;
    return HG_OK;
}

static enum hg_status create_texels(
    struct hg_gpu *gpu, const char *name, struct hg_gpu_buffer *buffer, struct hg_error *err)
{
    if (buffer->size_bytes / 16 > gpu->caps.max_texels) {
        return hg_error_set(err, HG_E_LIMIT, name, NULL, "%llu bytes, the device allows %u texels",
            (unsigned long long)buffer->size_bytes, gpu->caps.max_texels);
    }
    const VkBufferViewCreateInfo info = {.sType = VK_STRUCTURE_TYPE_BUFFER_VIEW_CREATE_INFO,
        .buffer = buffer->handle,
        .format = VK_FORMAT_R32G32B32A32_UINT,
        .range = buffer->size_bytes / 16 * 16};
    return HG_VK(gpu, err, vkCreateBufferView, gpu->device, &info, NULL, &buffer->texels);
}

enum hg_status hg_gpu_buffer_create(struct hg_gpu *gpu, enum hg_gpu_buffer_kind kind,
    uint64_t size_bytes, const char *name, struct hg_gpu_buffer *out, struct hg_error *err)
{
    *out = (struct hg_gpu_buffer){0};
    size_bytes = size_bytes == 0 ? 4 : size_bytes;
    if (size_bytes > gpu->caps.max_buffer_bytes) {
        return hg_error_set(err, HG_E_LIMIT, name, NULL, "%llu bytes, the device allows %llu",
            (unsigned long long)size_bytes, (unsigned long long)gpu->caps.max_buffer_bytes);
    }
    const VkBufferCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO,
        .size = size_bytes,
        .usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_UNIFORM_BUFFER_BIT |
                 VK_BUFFER_USAGE_INDEX_BUFFER_BIT | VK_BUFFER_USAGE_VERTEX_BUFFER_BIT |
                 VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_SRC_BIT |
                 VK_BUFFER_USAGE_TRANSFER_DST_BIT | VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT |
                 (kind == HG_GPU_BUFFER_TEXELS ? VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT : 0u) |
                 (gpu->caps.ray_query ? RAY_USAGE : 0u),
    };
    enum hg_status status = HG_VK(gpu, err, vkCreateBuffer, gpu->device, &info, NULL, &out->handle);
    if (status != HG_OK)
        return status;
    out->size_bytes = size_bytes;
    hg_gpu_name(gpu, VK_OBJECT_TYPE_BUFFER, (uint64_t)out->handle, name);
    status = bind_buffer(gpu, kind, out, err);
    if (status == HG_OK && kind == HG_GPU_BUFFER_TEXELS)
        status = create_texels(gpu, name, out, err);
    if (status == HG_OK && !remember(gpu, out))
        status = hg_error_set(err, HG_E_NOMEM, name, NULL, "out of host memory");
    if (status != HG_OK) {
        retire_buffer(gpu, out);
        *out = (struct hg_gpu_buffer){0};
    }
    return status;
}

void hg_gpu_buffer_destroy(struct hg_gpu *gpu, struct hg_gpu_buffer *buffer)
{
    if (buffer->handle != VK_NULL_HANDLE) {
        forget(gpu, buffer);
        retire_buffer(gpu, buffer);
    }
    *buffer = (struct hg_gpu_buffer){0};
}

enum hg_status hg_gpu_buffer_reserve(struct hg_gpu *gpu, enum hg_gpu_buffer_kind kind,
    uint64_t size_bytes, const char *name, struct hg_gpu_buffer *buffer, struct hg_error *err)
{
    if (buffer->handle != VK_NULL_HANDLE && buffer->size_bytes >= size_bytes)
        return HG_OK;
    uint64_t grown = buffer->size_bytes + buffer->size_bytes / 2;
    if (grown < size_bytes || grown > gpu->caps.max_buffer_bytes)
        grown = size_bytes;
    hg_gpu_buffer_destroy(gpu, buffer);
    return hg_gpu_buffer_create(gpu, kind, grown, name, buffer, err);
}

// --- images --------------------------------------------------------------------------------------

static VkImageAspectFlags aspect_of(VkFormat format)
{
    if (format == VK_FORMAT_D32_SFLOAT || format == VK_FORMAT_D16_UNORM)
        return VK_IMAGE_ASPECT_DEPTH_BIT;
    return VK_IMAGE_ASPECT_COLOR_BIT;
}

static VkImageUsageFlags usage_of(const struct hg_gpu_image_params *params)
{
    VkImageUsageFlags usage = VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT |
                              VK_IMAGE_USAGE_TRANSFER_DST_BIT;
    if (params->attachment) {
        usage |= aspect_of(params->format) == VK_IMAGE_ASPECT_DEPTH_BIT
                     ? VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT
                     : VK_IMAGE_USAGE_COLOR_ATTACHMENT_BIT;
    }
    return usage | (params->storage ? VK_IMAGE_USAGE_STORAGE_BIT : 0);
}

static VkImageCreateInfo info_of(const struct hg_gpu_image_params *params)
{
    const bool cube = params->kind == HG_GPU_IMAGE_CUBE;
    const bool solid = params->kind == HG_GPU_IMAGE_3D;
    return (VkImageCreateInfo){
        .sType = VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO,
        .flags = (cube ? VK_IMAGE_CREATE_CUBE_COMPATIBLE_BIT : 0u) |
                 (params->aliased ? VK_IMAGE_CREATE_MUTABLE_FORMAT_BIT : 0u) |
                 (params->memory != NULL ? VK_IMAGE_CREATE_ALIAS_BIT : 0u),
        .imageType = solid ? VK_IMAGE_TYPE_3D : VK_IMAGE_TYPE_2D,
        .format = params->format,
        .extent = {params->width, params->height, solid && params->depth > 0 ? params->depth : 1},
        .mipLevels = params->mips != 0 ? params->mips : 1,
        .arrayLayers = params->layers != 0 ? params->layers : (cube ? 6 : 1),
        .samples = VK_SAMPLE_COUNT_1_BIT,
        .tiling = VK_IMAGE_TILING_OPTIMAL,
        .usage = usage_of(params),
    };
}

// Mips down to one texel.
static uint32_t chain_length(const VkExtent3D *extent)
{
    uint32_t side = extent->width, count = 1;
    side = extent->height > side ? extent->height : side;
    side = extent->depth > side ? extent->depth : side;
    for (; side > 1; side /= 2)
        count++;
    return count < HG_GPU_MAX_MIPS ? count : HG_GPU_MAX_MIPS;
}

static enum hg_status check_limits(
    struct hg_gpu *gpu, const VkImageCreateInfo *info, const char *name, struct hg_error *err)
{
    VkImageFormatProperties props;
    const VkResult result = vkGetPhysicalDeviceImageFormatProperties(gpu->physical.handle,
        info->format, info->imageType, info->tiling, info->usage, info->flags, &props);
    if (result != VK_SUCCESS)
        return hg_error_set(err, HG_E_LIMIT, name, NULL, "format %d not supported", info->format);
    const uint32_t most_mips = chain_length(&info->extent);
    if (info->mipLevels > most_mips)
        return hg_error_set(
            err, HG_E_LIMIT, name, NULL, "%u mips, there can be %u", info->mipLevels, most_mips);
    if (info->extent.depth > props.maxExtent.depth)
        return hg_error_set(err, HG_E_LIMIT, name, NULL, "%u slices, the device allows %u",
            info->extent.depth, props.maxExtent.depth);
    if (info->extent.width > props.maxExtent.width ||
        info->extent.height > props.maxExtent.height || info->arrayLayers > props.maxArrayLayers) {
        return hg_error_set(err, HG_E_LIMIT, name, NULL,
            "%ux%u px with %u layers, the device allows %ux%u with %u", info->extent.width,
            info->extent.height, info->arrayLayers, props.maxExtent.width, props.maxExtent.height,
            props.maxArrayLayers);
    }
    uint64_t bytes = 0;
    for (uint32_t mip = 0; mip < info->mipLevels; mip++) {
        const uint64_t width = info->extent.width >> mip, height = info->extent.height >> mip;
        const uint64_t depth = info->extent.depth >> mip;
        bytes += (width ? width : 1) * (height ? height : 1) * (depth ? depth : 1) *
                 info->arrayLayers * hg_gpu_texel_bytes(info->format);
    }
    if (bytes > props.maxResourceSize)
        return hg_error_set(err, HG_E_LIMIT, name, NULL, "%llu bytes, the device allows %llu",
            (unsigned long long)bytes, (unsigned long long)props.maxResourceSize);
    return HG_OK;
}

static enum hg_status create_view(struct hg_gpu *gpu, const struct hg_gpu_image *image,
    VkImageViewType type, const VkImageSubresourceRange *range, VkImageView *out,
    struct hg_error *err)
{
    const VkImageViewCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO,
        .image = image->handle,
        .viewType = type,
        .format = image->format,
        .subresourceRange = *range,
    };
    return HG_VK(gpu, err, vkCreateImageView, gpu->device, &info, NULL, out);
}

// Views of every mip and layer, or of every mip.
static enum hg_status create_parts(struct hg_gpu *gpu, const struct hg_gpu_image *image,
    bool by_layer, VkImageView **out, struct hg_error *err)
{
    static const VkImageViewType types[] = {[HG_GPU_IMAGE_2D] = VK_IMAGE_VIEW_TYPE_2D,
        [HG_GPU_IMAGE_2D_ARRAY] = VK_IMAGE_VIEW_TYPE_2D_ARRAY,
        [HG_GPU_IMAGE_CUBE] = VK_IMAGE_VIEW_TYPE_2D_ARRAY,
        [HG_GPU_IMAGE_3D] = VK_IMAGE_VIEW_TYPE_3D};
    const uint32_t layers = by_layer ? image->layers : 1;
    *out = hg_calloc((size_t)image->mips * layers, sizeof **out);
    if (*out == NULL)
        return hg_error_set(err, HG_E_NOMEM, "image", NULL, "out of host memory");
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < image->mips * layers && status == HG_OK; i++) {
        const VkImageSubresourceRange range = {
            image->aspect, i / layers, 1, i % layers, by_layer ? 1 : image->layers};
        status = create_view(gpu, image, by_layer ? VK_IMAGE_VIEW_TYPE_2D : types[image->kind],
            &range, *out + i, err);
    }
    return status;
}

static enum hg_status create_views(struct hg_gpu *gpu, struct hg_gpu_image *image, bool attachment,
    bool storage, struct hg_error *err)
{
    static const VkImageViewType types[] = {[HG_GPU_IMAGE_2D] = VK_IMAGE_VIEW_TYPE_2D,
        [HG_GPU_IMAGE_2D_ARRAY] = VK_IMAGE_VIEW_TYPE_2D_ARRAY,
        [HG_GPU_IMAGE_CUBE] = VK_IMAGE_VIEW_TYPE_CUBE,
        [HG_GPU_IMAGE_3D] = VK_IMAGE_VIEW_TYPE_3D};
    const VkImageSubresourceRange all = {image->aspect, 0, image->mips, 0, image->layers};
    enum hg_status status = create_view(gpu, image, types[image->kind], &all, &image->view, err);
    if (status == HG_OK && attachment && image->mips * image->layers > 1)
        status = create_parts(gpu, image, true, &image->layer_views, err);
    if (status == HG_OK && (storage || (attachment && image->mips > 1)))
        status = create_parts(gpu, image, false, &image->mip_views, err);
    return status;
}

static enum hg_status bind_image(struct hg_gpu *gpu, const struct hg_gpu_image_params *params,
    struct hg_gpu_image *image, struct hg_error *err)
{
    if (params->memory != NULL)
        return HG_VK(gpu, err, vkBindImageMemory, gpu->device, image->handle,
            params->memory->block->memory, params->memory->offset + params->memory_offset);
    VkMemoryRequirements need;
    vkGetImageMemoryRequirements(gpu->device, image->handle, &need);
    enum hg_status status =
        hg_gpu_memory_take(gpu, HG_GPU_MEMORY_DEVICE, &need, &image->memory, err);
    if (status != HG_OK)
        return status;
    return HG_VK(gpu, err, vkBindImageMemory, gpu->device, image->handle,
        image->memory.block->memory, image->memory.offset);
}

enum hg_status hg_gpu_image_create(struct hg_gpu *gpu, const struct hg_gpu_image_params *params,
    struct hg_gpu_image *out, struct hg_error *err)
{
    const VkImageCreateInfo info = info_of(params);
    *out = (struct hg_gpu_image){.format = params->format,
        .aspect = aspect_of(params->format),
        .width = params->width,
        .height = params->height,
        .depth = info.extent.depth,
        .layers = info.arrayLayers,
        .mips = info.mipLevels,
        .kind = params->kind};
    enum hg_status status = check_limits(gpu, &info, params->name, err);
    if (status == HG_OK)
        status = HG_VK(gpu, err, vkCreateImage, gpu->device, &info, NULL, &out->handle);
    if (status == HG_OK && !hg_gpu_state_add(gpu, out->handle))
        status = hg_error_set(err, HG_E_NOMEM, params->name, NULL, "out of host memory");
    if (status == HG_OK)
        status = bind_image(gpu, params, out, err);
    if (status == HG_OK)
        status = create_views(gpu, out, params->attachment, params->storage, err);
    if (status != HG_OK) {
        hg_gpu_image_destroy(gpu, out);
        return status;
    }
    hg_gpu_name(gpu, VK_OBJECT_TYPE_IMAGE, (uint64_t)out->handle, params->name);
    hg_gpu_name(gpu, VK_OBJECT_TYPE_IMAGE_VIEW, (uint64_t)out->view, params->name);
    return HG_OK;
}

void hg_gpu_image_need(
    struct hg_gpu *gpu, const struct hg_gpu_image_params *params, struct hg_gpu_image_need *out)
{
    VkImageCreateInfo info = info_of(params);
    info.flags |= VK_IMAGE_CREATE_ALIAS_BIT;
    const VkDeviceImageMemoryRequirements image = {
        .sType = VK_STRUCTURE_TYPE_DEVICE_IMAGE_MEMORY_REQUIREMENTS, .pCreateInfo = &info};
    VkMemoryRequirements2 need = {.sType = VK_STRUCTURE_TYPE_MEMORY_REQUIREMENTS_2};
    vkGetDeviceImageMemoryRequirements(gpu->device, &image, &need);
    *out = (struct hg_gpu_image_need){need.memoryRequirements.size,
        need.memoryRequirements.alignment, need.memoryRequirements.memoryTypeBits};
}

enum hg_status hg_gpu_memory_create(struct hg_gpu *gpu, const struct hg_gpu_image_need *need,
    struct hg_gpu_memory *out, struct hg_error *err)
{
    const VkMemoryRequirements all = {need->size_bytes, need->alignment, need->type_bits};
    return hg_gpu_memory_take(gpu, HG_GPU_MEMORY_DEVICE, &all, out, err);
}

void hg_gpu_memory_destroy(struct hg_gpu *gpu, struct hg_gpu_memory *memory)
{
    const struct hg_gpu_retired object = {.memory = *memory};
    if (memory->block != NULL)
        hg_gpu_retire(gpu, &object);
    *memory = (struct hg_gpu_memory){0};
}

enum hg_status hg_gpu_image_alias(struct hg_gpu *gpu, const struct hg_gpu_image *image,
    VkFormat format, const char *name, struct hg_gpu_image *out, struct hg_error *err)
{
    *out = *image;
    out->format = format;
    out->view = VK_NULL_HANDLE;
    out->memory = (struct hg_gpu_memory){0};
    out->layer_views = NULL;
    out->mip_views = NULL;
    out->is_alias = true;
    const enum hg_status status = create_views(gpu, out, false, false, err);
    if (status != HG_OK) {
        *out = (struct hg_gpu_image){0};
        return status;
    }
    hg_gpu_name(gpu, VK_OBJECT_TYPE_IMAGE_VIEW, (uint64_t)out->view, name);
    return HG_OK;
}

void hg_gpu_image_destroy(struct hg_gpu *gpu, struct hg_gpu_image *image)
{
    if (image->is_alias) {
        const struct hg_gpu_retired view = {.view = image->view};
        hg_gpu_retire(gpu, &view);
    } else if (image->handle != VK_NULL_HANDLE) {
        hg_gpu_state_remove(gpu, image->handle);
        const struct hg_gpu_retired object = {
            .image = image->handle,
            .view = image->view,
            .layer_views = image->layer_views,
            .layer_view_count = image->layer_views != NULL ? image->mips * image->layers : 0,
            .mip_views = image->mip_views,
            .mip_view_count = image->mip_views != NULL ? image->mips : 0,
            .memory = image->memory,
        };
        hg_gpu_retire(gpu, &object);
    }
    *image = (struct hg_gpu_image){0};
}
