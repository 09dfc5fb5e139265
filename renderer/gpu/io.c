// io.c - see io.h.
#include "renderer/gpu/io.h"

#include <assert.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/gpu/internal.h"

static const struct {
    enum hg_gpu_image_kind image;
    VkFormat format;
    bool storage, linear;
} kinds[HG_GPU_IO_KINDS] = {
#define SAMPLED(kind, image, format, linear)                                                       \
    [HG_GPU_IO_##kind] = {HG_GPU_IMAGE_##image, VK_FORMAT_##format, false, linear},
#define STORAGE(kind, image, format)                                                               \
    [HG_GPU_IO_##kind] = {HG_GPU_IMAGE_##image, VK_FORMAT_##format, true, false},
    HG_IO_SAMPLED_KINDS(SAMPLED) HG_IO_STORAGE_KINDS(STORAGE)};

bool hg_gpu_io_same(const struct hg_gpu_io *a, const struct hg_gpu_io *b)
{
    return a == b || (a != NULL && b != NULL && a->count == b->count &&
                         memcmp(a->kinds, b->kinds, a->count * sizeof a->kinds[0]) == 0);
}

// --- layouts -------------------------------------------------------------------------------------

enum hg_status hg_gpu_io_init(struct hg_gpu *gpu, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < 2 && status == HG_OK; i++) {
        const VkFilter filter = i == 0 ? VK_FILTER_NEAREST : VK_FILTER_LINEAR;
        const VkSamplerCreateInfo info = {
            .sType = VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO,
            .magFilter = filter,
            .minFilter = filter,
            .mipmapMode = i == 0 ? VK_SAMPLER_MIPMAP_MODE_NEAREST : VK_SAMPLER_MIPMAP_MODE_LINEAR,
            .addressModeU = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE,
            .addressModeV = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE,
            .addressModeW = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE,
            .maxLod = VK_LOD_CLAMP_NONE,
        };
        status = HG_VK(gpu, err, vkCreateSampler, gpu->device, &info, NULL, &gpu->io.samplers[i]);
    }
    return status;
}

void hg_gpu_io_finish(struct hg_gpu *gpu)
{
    for (uint32_t i = 0; i < gpu->io.count; i++) {
        vkDestroyPipelineLayout(gpu->device, gpu->io.layouts[i].pipeline, NULL);
        vkDestroyDescriptorSetLayout(gpu->device, gpu->io.layouts[i].set, NULL);
    }
    hg_free(gpu->io.layouts);
    gpu->io.layouts = NULL;
    gpu->io.count = 0;
    for (uint32_t i = 0; i < HG_GPU_IO_KINDS; i++)
        hg_gpu_image_destroy(gpu, &gpu->io.dummies[i]);
    for (uint32_t i = 0; i < 2; i++)
        vkDestroySampler(gpu->device, gpu->io.samplers[i], NULL);
}

static const struct hg_gpu_io_layout *find_layout(
    const struct hg_gpu *gpu, const struct hg_gpu_io *io)
{
    for (uint32_t i = 0; i < gpu->io.count; i++)
        if (hg_gpu_io_same(&gpu->io.layouts[i].io, io))
            return &gpu->io.layouts[i];
    return NULL;
}

// With the images of the scene in set 0.
static enum hg_status check_limits(
    const struct hg_gpu *gpu, const struct hg_gpu_io *io, struct hg_error *err)
{
    const VkPhysicalDeviceLimits *most = &gpu->physical.properties.limits;
    uint32_t storage = 0;
    for (uint32_t i = 0; i < io->count; i++)
        storage += kinds[io->kinds[i]].storage;
    const uint32_t sampled = HG_BIND_IMAGE_COUNT + 1 + io->count - storage; // and the texel buffer
    if (storage <= most->maxPerStageDescriptorStorageImages &&
        sampled <= most->maxPerStageDescriptorSampledImages)
        return HG_OK;
    return hg_error_set(err, HG_E_LIMIT, "bindings", NULL,
        "%u sampled and %u storage images, the device allows %u and %u", sampled, storage,
        most->maxPerStageDescriptorSampledImages, most->maxPerStageDescriptorStorageImages);
}

static enum hg_status create_set_layout(
    struct hg_gpu *gpu, struct hg_gpu_io_layout *layout, struct hg_error *err)
{
    VkDescriptorSetLayoutBinding slots[HG_GPU_MAX_IO] = {0};
    for (uint32_t i = 0; i < layout->io.count; i++) {
        const enum hg_gpu_io_kind kind = layout->io.kinds[i];
        slots[i] = (VkDescriptorSetLayoutBinding){i,
            kinds[kind].storage ? VK_DESCRIPTOR_TYPE_STORAGE_IMAGE
                                : VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER,
            1, VK_SHADER_STAGE_FRAGMENT_BIT | VK_SHADER_STAGE_COMPUTE_BIT,
            kinds[kind].storage ? NULL : &gpu->io.samplers[kinds[kind].linear]};
    }
    const VkDescriptorSetLayoutCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO,
        .bindingCount = layout->io.count,
        .pBindings = slots};
    return HG_VK(gpu, err, vkCreateDescriptorSetLayout, gpu->device, &info, NULL, &layout->set);
}

static enum hg_status create_pipeline_layout(
    struct hg_gpu *gpu, struct hg_gpu_io_layout *layout, struct hg_error *err)
{
    const VkDescriptorSetLayout sets[2] = {gpu->shared_set.layout, layout->set};
    const VkPushConstantRange push = {VK_SHADER_STAGE_ALL, 0, 128};
    const VkPipelineLayoutCreateInfo info = {.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO,
        .setLayoutCount = 2,
        .pSetLayouts = sets,
        .pushConstantRangeCount = 1,
        .pPushConstantRanges = &push};
    return HG_VK(gpu, err, vkCreatePipelineLayout, gpu->device, &info, NULL, &layout->pipeline);
}

enum hg_status hg_gpu_io_ready(struct hg_gpu *gpu, const struct hg_gpu_io *io, struct hg_error *err)
{
    if (io == NULL || find_layout(gpu, io) != NULL)
        return HG_OK;
    enum hg_status status = check_limits(gpu, io, err);
    if (status == HG_OK && hg_grow(&gpu->io.layouts, &gpu->io.capacity, gpu->io.count + 1,
                               sizeof *gpu->io.layouts) != HG_OK)
        status = hg_error_set(err, HG_E_NOMEM, "bindings", NULL, "out of host memory");
    if (status != HG_OK)
        return status;
    struct hg_gpu_io_layout layout = {.io = *io};
    status = create_set_layout(gpu, &layout, err);
    if (status == HG_OK)
        status = create_pipeline_layout(gpu, &layout, err);
    if (status == HG_OK)
        gpu->io.layouts[gpu->io.count++] = layout;
    else
        vkDestroyDescriptorSetLayout(gpu->device, layout.set, NULL);
    return status;
}

VkPipelineLayout hg_gpu_io_pipeline_layout(const struct hg_gpu *gpu, const struct hg_gpu_io *io)
{
    return io != NULL ? find_layout(gpu, io)->pipeline : gpu->shared_set.pipeline_layout;
}

// --- binding -------------------------------------------------------------------------------------

// What stands in for an image that is not bound: nothing may depend on its content.
static enum hg_status use_dummy(
    struct hg_gpu *gpu, enum hg_gpu_io_kind kind, struct hg_gpu_image **out, struct hg_error *err)
{
    const struct hg_gpu_image_params params = {.kind = kinds[kind].image,
        .format = kinds[kind].format,
        .width = 1,
        .height = 1,
        .storage = kinds[kind].storage,
        .name = "dummy"};
    *out = &gpu->io.dummies[kind];
    return (*out)->handle != VK_NULL_HANDLE ? HG_OK : hg_gpu_image_create(gpu, &params, *out, err);
}

static enum hg_status fill_info(struct hg_gpu_cmd *cmd, enum hg_gpu_io_kind kind,
    const struct hg_gpu_bound *bound, VkDescriptorImageInfo *out, struct hg_error *err)
{
    const bool storage = kinds[kind].storage;
    const enum hg_gpu_use use = storage ? HG_GPU_USE_STORAGE : HG_GPU_USE_SAMPLED;
    struct hg_gpu_image *image = bound->image;
    if (image == NULL) {
        const enum hg_status status = use_dummy(cmd->gpu, kind, &image, err);
        if (status != HG_OK)
            return status;
    }
    const bool one = (storage || bound->mip_plus_one > 0) && image->mip_views != NULL;
    const uint32_t mip = bound->mip_plus_one > 0 ? bound->mip_plus_one - 1 : 0;
    assert(!storage || one); // an image that was not made for storage
    hg_gpu_image_use_mips(cmd, image, one ? mip : 0, one ? 1 : image->mips, use);
    *out = (VkDescriptorImageInfo){
        VK_NULL_HANDLE, one ? image->mip_views[mip] : image->view, hg_gpu_layout(use)};
    return HG_OK;
}

enum hg_status hg_gpu_cmd_bind_io(struct hg_gpu_cmd *cmd, const struct hg_gpu_io *io,
    const void *bound, size_t size_bytes, struct hg_error *err)
{
    const struct hg_gpu_bound *images = bound;
    VkDescriptorImageInfo infos[HG_GPU_MAX_IO];
    VkWriteDescriptorSet writes[HG_GPU_MAX_IO];
    VkDescriptorSet set;
    assert(size_bytes == io->count * sizeof *images);
    (void)size_bytes;
    enum hg_status status = hg_gpu_io_ready(cmd->gpu, io, err);
    if (status != HG_OK)
        return status;
    const struct hg_gpu_io_layout *layout = find_layout(cmd->gpu, io);
    status = hg_gpu_set_take(cmd, layout->set, &set, err);
    for (uint32_t i = 0; i < io->count && status == HG_OK; i++) {
        status = fill_info(cmd, io->kinds[i], &images[i], &infos[i], err);
        writes[i] = (VkWriteDescriptorSet){.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET,
            .dstSet = set,
            .dstBinding = i,
            .descriptorCount = 1,
            .descriptorType = kinds[io->kinds[i]].storage
                                  ? VK_DESCRIPTOR_TYPE_STORAGE_IMAGE
                                  : VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER,
            .pImageInfo = &infos[i]};
    }
    if (status != HG_OK)
        return status;
    vkUpdateDescriptorSets(cmd->gpu->device, io->count, writes, 0, NULL);
    for (VkPipelineBindPoint point = VK_PIPELINE_BIND_POINT_GRAPHICS;
         point <= VK_PIPELINE_BIND_POINT_COMPUTE; point++)
        vkCmdBindDescriptorSets(cmd->handle, point, layout->pipeline, 1, 1, &set, 0, NULL);
    return HG_OK;
}
