// descriptor.c - samplers, descriptor sets and their layouts.
#include <string.h>

#include "base/alloc.h"
#include "renderer/gpu/internal.h"

static const struct {
    bool linear, mips, repeat_u, compare;
    enum hg_gpu_image_kind kind;
    VkFormat dummy;
} bindings[HG_BIND_IMAGE_COUNT] = {
    [HG_BIND_PAGES_SRGB] = {true, false, false, false, HG_GPU_IMAGE_2D_ARRAY,
        VK_FORMAT_R8G8B8A8_SRGB},
    [HG_BIND_PAGES_LINEAR] = {true, false, false, false, HG_GPU_IMAGE_2D_ARRAY,
        VK_FORMAT_R8G8B8A8_UNORM},
    [HG_BIND_PAGES_FLOAT] = {true, false, false, false, HG_GPU_IMAGE_2D_ARRAY,
        VK_FORMAT_R16G16B16A16_SFLOAT},
    [HG_BIND_ENV_SPECULAR] = {true, true, false, false, HG_GPU_IMAGE_CUBE,
        VK_FORMAT_R16G16B16A16_SFLOAT},
    [HG_BIND_ENV_RADIANCE] = {true, true, true, false, HG_GPU_IMAGE_2D,
        VK_FORMAT_R16G16B16A16_SFLOAT},
    [HG_BIND_DFG] = {true, false, false, false, HG_GPU_IMAGE_2D, VK_FORMAT_R16G16B16A16_SFLOAT},
    [HG_BIND_SHADOW] = {false, false, false, false, HG_GPU_IMAGE_2D, VK_FORMAT_D32_SFLOAT},
    [HG_BIND_SHADOW_CMP] = {true, false, false, true, HG_GPU_IMAGE_2D, VK_FORMAT_D32_SFLOAT},
};

_Static_assert(HG_BIND_IMAGE_COUNT <= HG_GPU_MAX_IO, "sizes of descriptor pools");

static enum hg_status create_sampler(struct hg_gpu *gpu, uint32_t i, struct hg_error *err)
{
    const VkFilter filter = bindings[i].linear ? VK_FILTER_LINEAR : VK_FILTER_NEAREST;
    const VkSamplerCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO,
        .magFilter = filter,
        .minFilter = filter,
        .mipmapMode =
            bindings[i].mips ? VK_SAMPLER_MIPMAP_MODE_LINEAR : VK_SAMPLER_MIPMAP_MODE_NEAREST,
        .addressModeU = bindings[i].repeat_u ? VK_SAMPLER_ADDRESS_MODE_REPEAT
                                             : VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE,
        .addressModeV = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE,
        .addressModeW = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE,
        .compareEnable = bindings[i].compare,
        .compareOp = VK_COMPARE_OP_LESS_OR_EQUAL,
        .maxLod = bindings[i].mips ? VK_LOD_CLAMP_NONE : 0.0f,
    };
    return HG_VK(gpu, err, vkCreateSampler, gpu->device, &info, NULL, &gpu->shared_set.samplers[i]);
}

// The dummies are left undefined in content: nothing may depend on an unbound image.
static enum hg_status create_dummy(struct hg_gpu *gpu, uint32_t i, struct hg_error *err)
{
    const struct hg_gpu_image_params params = {
        .kind = bindings[i].kind,
        .format = bindings[i].dummy,
        .width = 1,
        .height = 1,
        .name = "dummy",
    };
    return hg_gpu_image_create(gpu, &params, &gpu->shared_set.dummies[i], err);
}

static enum hg_status create_set_layout(struct hg_gpu *gpu, struct hg_error *err)
{
    VkDescriptorSetLayoutBinding slots[HG_BIND_COUNT] = {0};
    for (uint32_t i = 0; i < HG_BIND_IMAGE_COUNT; i++) {
        slots[i] = (VkDescriptorSetLayoutBinding){i, VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, 1,
            VK_SHADER_STAGE_ALL, &gpu->shared_set.samplers[i]};
    }
    for (uint32_t i = HG_BIND_UNIFORM_FIRST; i < HG_BIND_COUNT; i++) {
        slots[i] = (VkDescriptorSetLayoutBinding){
            i, VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, 1, VK_SHADER_STAGE_ALL, NULL};
    }
    slots[HG_BIND_TEXELS].descriptorType = VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER;
    const VkDescriptorSetLayoutCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO,
        .bindingCount = HG_BIND_COUNT,
        .pBindings = slots};
    return HG_VK(
        gpu, err, vkCreateDescriptorSetLayout, gpu->device, &info, NULL, &gpu->shared_set.layout);
}

static enum hg_status create_pipeline_layout(struct hg_gpu *gpu, struct hg_error *err)
{
    const VkPushConstantRange push = {VK_SHADER_STAGE_ALL, 0, 128};
    const VkPipelineLayoutCreateInfo info = {.sType = VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO,
        .setLayoutCount = 1,
        .pSetLayouts = &gpu->shared_set.layout,
        .pushConstantRangeCount = 1,
        .pPushConstantRanges = &push};
    return HG_VK(gpu, err, vkCreatePipelineLayout, gpu->device, &info, NULL,
        &gpu->shared_set.pipeline_layout);
}

static enum hg_status add_set_pool(struct hg_gpu_cmd *cmd, struct hg_error *err)
{
    struct hg_gpu *gpu = cmd->gpu;
    if (hg_grow(&cmd->set_pools, &cmd->set_pool_capacity, cmd->set_pool_count + 1,
            sizeof *cmd->set_pools) != HG_OK)
        return hg_error_set(err, HG_E_NOMEM, "descriptor pool", NULL, "out of host memory");
    // Any set of the pool may be the scene's or a pass's.
    const VkDescriptorPoolSize sizes[] = {
        {VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, HG_GPU_MAX_IO * HG_GPU_SETS_PER_POOL},
        {VK_DESCRIPTOR_TYPE_STORAGE_IMAGE, HG_GPU_MAX_IO * HG_GPU_SETS_PER_POOL},
        {VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER, HG_BIND_UNIFORM_COUNT * HG_GPU_SETS_PER_POOL},
        {VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER, HG_GPU_SETS_PER_POOL}};
    const VkDescriptorPoolCreateInfo info = {.sType = VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO,
        .maxSets = HG_GPU_SETS_PER_POOL,
        .poolSizeCount = sizeof sizes / sizeof sizes[0],
        .pPoolSizes = sizes};
    enum hg_status status = HG_VK(gpu, err, vkCreateDescriptorPool, gpu->device, &info, NULL,
        &cmd->set_pools[cmd->set_pool_count]);
    if (status == HG_OK)
        cmd->set_pool_count++;
    return status;
}

enum hg_status hg_gpu_set_take(struct hg_gpu_cmd *cmd, VkDescriptorSetLayout layout,
    VkDescriptorSet *out, struct hg_error *err)
{
    struct hg_gpu *gpu = cmd->gpu;
    *out = VK_NULL_HANDLE;
    const uint32_t pool = cmd->sets_used / HG_GPU_SETS_PER_POOL;
    enum hg_status status = pool < cmd->set_pool_count ? HG_OK : add_set_pool(cmd, err);
    if (status != HG_OK)
        return status;
    const VkDescriptorSetAllocateInfo info = {
        .sType = VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO,
        .descriptorPool = cmd->set_pools[pool],
        .descriptorSetCount = 1,
        .pSetLayouts = &layout};
    status = HG_VK(gpu, err, vkAllocateDescriptorSets, gpu->device, &info, out);
    if (status == HG_OK)
        cmd->sets_used++;
    return status;
}

bool hg_gpu_can_bind_uniform(const struct hg_gpu *gpu, const struct hg_gpu_uniform *uniform)
{
    if (uniform->address == 0 || uniform->size_bytes == 0 || uniform->size_bytes > HG_TABLE_BYTES ||
        gpu->physical.properties.limits.maxUniformBufferRange < HG_TABLE_BYTES)
        return false;
    const struct hg_gpu_live *live = hg_gpu_find_live(gpu, uniform->address);
    return live != NULL &&
           (uniform->address - live->address) %
                   gpu->physical.properties.limits.minUniformBufferOffsetAlignment ==
               0 &&
           uniform->size_bytes <= live->size_bytes - (uniform->address - live->address);
}

static VkDescriptorBufferInfo uniform_info(
    const struct hg_gpu *gpu, const struct hg_gpu_uniform *uniform)
{
    const uint64_t most = gpu->physical.properties.limits.maxUniformBufferRange;
    if (!hg_gpu_can_bind_uniform(gpu, uniform))
        return (VkDescriptorBufferInfo){gpu->shared_set.dummy_frame.handle, 0,
            gpu->shared_set.dummy_frame.size_bytes < most ? gpu->shared_set.dummy_frame.size_bytes
                                                          : most};
    const struct hg_gpu_live *live = hg_gpu_find_live(gpu, uniform->address);
    return (VkDescriptorBufferInfo){
        live->handle, uniform->address - live->address, uniform->size_bytes};
}

// What the writes of one set point to.
struct set_infos {
    VkDescriptorImageInfo images[HG_BIND_IMAGE_COUNT];
    VkDescriptorBufferInfo uniforms[HG_BIND_UNIFORM_COUNT];
    VkBufferView texels;
};

static void fill_infos(
    struct hg_gpu_cmd *cmd, const struct hg_gpu_bindings *bound, struct set_infos *infos)
{
    struct hg_gpu *gpu = cmd->gpu;
    for (uint32_t i = 0; i < HG_BIND_IMAGE_COUNT; i++) {
        struct hg_gpu_image *image =
            bound->images[i] != NULL ? bound->images[i] : &gpu->shared_set.dummies[i];
        hg_gpu_image_use(cmd, image, HG_GPU_USE_SAMPLED);
        infos->images[i] = (VkDescriptorImageInfo){
            VK_NULL_HANDLE, image->view, VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL};
    }
    for (uint32_t i = 0; i < HG_BIND_UNIFORM_COUNT; i++)
        infos->uniforms[i] = uniform_info(gpu, &bound->uniforms[i]);
    infos->texels = (bound->texels != NULL ? bound->texels : &gpu->shared_set.dummy_texels)->texels;
}

static void write_set(struct hg_gpu *gpu, VkDescriptorSet set, const struct set_infos *infos)
{
    // Immutable samplers differ, so one write cannot run over all images.
    VkWriteDescriptorSet writes[HG_BIND_COUNT];
    for (uint32_t i = 0; i < HG_BIND_COUNT; i++) {
        const bool image = i < HG_BIND_IMAGE_COUNT;
        writes[i] = (VkWriteDescriptorSet){.sType = VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET,
            .dstSet = set,
            .dstBinding = i,
            .descriptorCount = 1,
            .descriptorType = image ? VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER
                                    : VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER,
            .pImageInfo = image ? &infos->images[i] : NULL,
            .pBufferInfo = image ? NULL : &infos->uniforms[i - HG_BIND_UNIFORM_FIRST]};
    }
    writes[HG_BIND_TEXELS].descriptorType = VK_DESCRIPTOR_TYPE_UNIFORM_TEXEL_BUFFER;
    writes[HG_BIND_TEXELS].pBufferInfo = NULL;
    writes[HG_BIND_TEXELS].pTexelBufferView = &infos->texels;
    vkUpdateDescriptorSets(gpu->device, HG_BIND_COUNT, writes, 0, NULL);
}

enum hg_status hg_gpu_cmd_bind(
    struct hg_gpu_cmd *cmd, const struct hg_gpu_bindings *bound, struct hg_error *err)
{
    VkDescriptorSet set;
    enum hg_status status = hg_gpu_set_take(cmd, cmd->gpu->shared_set.layout, &set, err);
    if (status != HG_OK)
        return status;
    struct set_infos infos;
    fill_infos(cmd, bound, &infos);
    write_set(cmd->gpu, set, &infos);
    for (VkPipelineBindPoint point = VK_PIPELINE_BIND_POINT_GRAPHICS;
         point <= VK_PIPELINE_BIND_POINT_COMPUTE; point++)
        vkCmdBindDescriptorSets(
            cmd->handle, point, cmd->gpu->shared_set.pipeline_layout, 0, 1, &set, 0, NULL);
    return HG_OK;
}

enum hg_status hg_gpu_descriptors_init(struct hg_gpu *gpu, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < HG_BIND_IMAGE_COUNT && status == HG_OK; i++) {
        status = create_sampler(gpu, i, err);
        if (status == HG_OK)
            status = create_dummy(gpu, i, err);
    }
    if (status == HG_OK) {
        status = hg_gpu_buffer_create(gpu, HG_GPU_BUFFER_UPLOAD, HG_TABLE_BYTES, "no table",
            &gpu->shared_set.dummy_frame, err);
    }
    if (status == HG_OK) {
        memset(gpu->shared_set.dummy_frame.mapped, 0, HG_TABLE_BYTES);
        status = hg_gpu_buffer_create(
            gpu, HG_GPU_BUFFER_TEXELS, 16, "no texels", &gpu->shared_set.dummy_texels, err);
    }
    if (status == HG_OK)
        status = create_set_layout(gpu, err);
    if (status == HG_OK)
        status = create_pipeline_layout(gpu, err);
    return status == HG_OK ? hg_gpu_io_init(gpu, err) : status;
}

void hg_gpu_descriptors_finish(struct hg_gpu *gpu)
{
    hg_gpu_io_finish(gpu);
    vkDestroyPipelineLayout(gpu->device, gpu->shared_set.pipeline_layout, NULL);
    vkDestroyDescriptorSetLayout(gpu->device, gpu->shared_set.layout, NULL);
    hg_gpu_buffer_destroy(gpu, &gpu->shared_set.dummy_frame);
    hg_gpu_buffer_destroy(gpu, &gpu->shared_set.dummy_texels);
    for (uint32_t i = 0; i < HG_BIND_IMAGE_COUNT; i++) {
        hg_gpu_image_destroy(gpu, &gpu->shared_set.dummies[i]);
        vkDestroySampler(gpu->device, gpu->shared_set.samplers[i], NULL);
    }
}
