// pipeline.c - pipelines and their cache on disk.
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/file.h"
#include "base/log.h"
#include "renderer/gpu/internal.h"

// --- the cache on disk ---------------------------------------------------------------------------

// Drivers trust the blob's length but should not: header, device and a hash are checked here.
struct cache_header {
    char magic[8];
    uint64_t size_bytes, hash;
    uint32_t vendor, device, driver, reserved;
    uint8_t uuid[VK_UUID_SIZE];
};

static uint64_t fnv1a(const uint8_t *data, size_t size)
{
    uint64_t hash = 14695981039346656037ull;
    for (size_t i = 0; i < size; i++)
        hash = (hash ^ data[i]) * 1099511628211ull;
    return hash;
}

static struct cache_header cache_header(const struct hg_gpu *gpu, const void *data, size_t size)
{
    struct cache_header header = {.magic = "HGPIPE1",
        .size_bytes = size,
        .hash = fnv1a(data, size),
        .vendor = gpu->physical.properties.vendorID,
        .device = gpu->physical.properties.deviceID,
        .driver = gpu->physical.properties.driverVersion};
    memcpy(header.uuid, gpu->physical.properties.pipelineCacheUUID, VK_UUID_SIZE);
    return header;
}

static bool cache_path(const struct hg_gpu *gpu, char *path, size_t size)
{
    if (gpu->pipelines.cache_dir == NULL || gpu->pipelines.driver_keeps_cache)
        return false;
    return snprintf(path, size, "%s/shaders/pipelines.bin", gpu->pipelines.cache_dir) < (int)size;
}

static enum hg_status create_cache(struct hg_gpu *gpu, struct hg_error *err)
{
    char path[4096];
    uint8_t *data = NULL;
    size_t size = 0;
    VkPipelineCacheCreateInfo info = {.sType = VK_STRUCTURE_TYPE_PIPELINE_CACHE_CREATE_INFO};
    if (cache_path(gpu, path, sizeof path) &&
        hg_file_read(path, 256u << 20, &data, &size, NULL) == HG_OK &&
        size > sizeof(struct cache_header)) {
        const uint8_t *blob = data + sizeof(struct cache_header);
        const size_t blob_size = size - sizeof(struct cache_header);
        const struct cache_header want = cache_header(gpu, blob, blob_size);
        if (memcmp(&want, data, sizeof want) == 0) {
            info.initialDataSize = blob_size;
            info.pInitialData = blob;
        } else {
            hg_info(GPU, "pipeline cache of another device or driver ignored");
        }
    }
    gpu->pipelines.cache_bytes = info.initialDataSize;
    enum hg_status status =
        HG_VK(gpu, err, vkCreatePipelineCache, gpu->device, &info, NULL, &gpu->pipelines.cache);
    hg_free(data);
    return status;
}

enum hg_status hg_gpu_save_pipeline_cache(struct hg_gpu *gpu, struct hg_error *err)
{
    char path[4096];
    size_t size = 0;
    if (gpu->pipelines.count == gpu->pipelines.saved_count || !cache_path(gpu, path, sizeof path))
        return HG_OK;
    gpu->pipelines.saved_count = gpu->pipelines.count; // what fails is not tried at every frame
    enum hg_status status =
        HG_VK(gpu, err, vkGetPipelineCacheData, gpu->device, gpu->pipelines.cache, &size, NULL);
    if (status != HG_OK || size <= gpu->pipelines.cache_bytes)
        return status;
    uint8_t *data = hg_calloc(1, sizeof(struct cache_header) + size);
    if (data == NULL)
        return hg_error_set(err, HG_E_NOMEM, path, NULL, "out of host memory");
    uint8_t *blob = data + sizeof(struct cache_header);
    status =
        HG_VK(gpu, err, vkGetPipelineCacheData, gpu->device, gpu->pipelines.cache, &size, blob);
    if (status == HG_OK) {
        const struct cache_header header = cache_header(gpu, blob, size);
        memcpy(data, &header, sizeof header);
        status = hg_file_write_atomic(path, data, sizeof header + size, err);
    }
    if (status == HG_OK)
        gpu->pipelines.cache_bytes = size;
    hg_free(data);
    return status;
}

// --- pipelines -----------------------------------------------------------------------------------

struct stages { // scratch of one pipeline creation
    VkSpecializationMapEntry entries[HG_GPU_MAX_SPEC];
    VkSpecializationInfo spec;
    VkPipelineShaderStageCreateInfo list[2];
    uint32_t count;
};

static enum hg_status add_stage(struct hg_gpu *gpu, struct stages *stages, const char *name,
    VkShaderStageFlagBits stage, struct hg_error *err)
{
    struct hg_gpu_shader_module module;
    enum hg_status status = hg_gpu_shader_module(
        gpu, name, stages->spec.pData, stages->spec.mapEntryCount, &module, err);
    const bool values = stages->spec.mapEntryCount > 0 && !module.specialised;
    stages->list[stages->count++] = (VkPipelineShaderStageCreateInfo){
        .sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO,
        .stage = stage,
        .module = module.handle,
        .pName = "main",
        .pSpecializationInfo = values ? &stages->spec : NULL};
    return status;
}

static void fill_spec(struct stages *stages, const struct hg_gpu_pipeline_params *params)
{
    for (uint32_t i = 0; i < params->spec_count; i++)
        stages->entries[i] = (VkSpecializationMapEntry){i, i * 4, 4};
    stages->spec = (VkSpecializationInfo){
        params->spec_count, stages->entries, params->spec_count * 4, params->spec};
}

static VkPipelineColorBlendAttachmentState blend_state(enum hg_gpu_blend blend)
{
    VkPipelineColorBlendAttachmentState state = {
        .blendEnable = blend != HG_GPU_BLEND_NONE,
        .srcColorBlendFactor = VK_BLEND_FACTOR_ONE,
        .dstColorBlendFactor = VK_BLEND_FACTOR_ONE,
        .colorBlendOp = VK_BLEND_OP_ADD,
        .alphaBlendOp = VK_BLEND_OP_ADD,
        .colorWriteMask = 0xf,
    };
    if (blend == HG_GPU_BLEND_PREMULTIPLIED)
        state.dstColorBlendFactor = VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA;
    state.srcAlphaBlendFactor = state.srcColorBlendFactor;
    state.dstAlphaBlendFactor = state.dstColorBlendFactor;
    return state;
}

static enum hg_status create_graphics(struct hg_gpu *gpu, const struct stages *stages,
    const struct hg_gpu_pipeline_params *p, VkPipeline *out, struct hg_error *err)
{
    const VkVertexInputBindingDescription buffer = {.stride = p->with_words ? 16 : 12};
    const VkVertexInputAttributeDescription attributes[] = {{.format = VK_FORMAT_R32G32B32_SFLOAT},
        {.location = 1, .format = VK_FORMAT_R32_UINT, .offset = 12}};
    const VkPipelineVertexInputStateCreateInfo input = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_STATE_CREATE_INFO,
        .vertexBindingDescriptionCount = p->positions ? 1 : 0,
        .pVertexBindingDescriptions = &buffer,
        .vertexAttributeDescriptionCount = p->positions ? (p->with_words ? 2 : 1) : 0,
        .pVertexAttributeDescriptions = attributes};
    const VkPipelineInputAssemblyStateCreateInfo assembly = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_INPUT_ASSEMBLY_STATE_CREATE_INFO,
        .topology = p->topology};
    const VkPipelineViewportStateCreateInfo viewport = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_VIEWPORT_STATE_CREATE_INFO,
        .viewportCount = 1,
        .scissorCount = 1};
    const VkPipelineRasterizationStateCreateInfo raster = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_STATE_CREATE_INFO,
        .depthClampEnable = p->depth_clamp && gpu->caps.depth_clamp,
        .depthBiasEnable = p->depth_bias,
        .polygonMode = VK_POLYGON_MODE_FILL,
        .lineWidth = 1.0f};
    const VkPipelineMultisampleStateCreateInfo samples = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_MULTISAMPLE_STATE_CREATE_INFO,
        .rasterizationSamples = VK_SAMPLE_COUNT_1_BIT};
    const VkPipelineDepthStencilStateCreateInfo depth = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_DEPTH_STENCIL_STATE_CREATE_INFO,
        .depthTestEnable = p->depth_compare != VK_COMPARE_OP_NEVER,
        .depthWriteEnable = p->depth_write,
        .depthCompareOp = p->depth_compare};
    VkPipelineColorBlendAttachmentState blends[HG_GPU_MAX_COLORS];
    for (uint32_t i = 0; i < p->color_count; i++)
        blends[i] = blend_state(i == 0 ? p->blend : HG_GPU_BLEND_NONE);
    const VkPipelineColorBlendStateCreateInfo blend = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_COLOR_BLEND_STATE_CREATE_INFO,
        .attachmentCount = p->color_count,
        .pAttachments = blends};
    static const VkDynamicState dynamics[] = {VK_DYNAMIC_STATE_VIEWPORT, VK_DYNAMIC_STATE_SCISSOR,
        VK_DYNAMIC_STATE_CULL_MODE, VK_DYNAMIC_STATE_FRONT_FACE, VK_DYNAMIC_STATE_DEPTH_BIAS};
    const VkPipelineDynamicStateCreateInfo dynamic = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_DYNAMIC_STATE_CREATE_INFO,
        .dynamicStateCount = sizeof dynamics / sizeof dynamics[0],
        .pDynamicStates = dynamics};
    const VkPipelineRenderingCreateInfo rendering = {
        .sType = VK_STRUCTURE_TYPE_PIPELINE_RENDERING_CREATE_INFO,
        .colorAttachmentCount = p->color_count,
        .pColorAttachmentFormats = p->colors,
        .depthAttachmentFormat = p->depth};
    const VkGraphicsPipelineCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO,
        .pNext = &rendering,
        .stageCount = stages->count,
        .pStages = stages->list,
        .pVertexInputState = &input,
        .pInputAssemblyState = &assembly,
        .pViewportState = &viewport,
        .pRasterizationState = &raster,
        .pMultisampleState = &samples,
        .pDepthStencilState = &depth,
        .pColorBlendState = &blend,
        .pDynamicState = &dynamic,
        .layout = hg_gpu_io_pipeline_layout(gpu, p->io)};
    return HG_VK(gpu, err, vkCreateGraphicsPipelines, gpu->device, gpu->pipelines.cache, 1, &info,
        NULL, out);
}

static enum hg_status create_compute(struct hg_gpu *gpu, const struct stages *stages,
    const struct hg_gpu_io *io, VkPipeline *out, struct hg_error *err)
{
    const VkComputePipelineCreateInfo info = {
        .sType = VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO,
        .stage = stages->list[0],
        .layout = hg_gpu_io_pipeline_layout(gpu, io)};
    return HG_VK(
        gpu, err, vkCreateComputePipelines, gpu->device, gpu->pipelines.cache, 1, &info, NULL, out);
}

// Its shaders are ready.
static enum hg_status create_pipeline(struct hg_gpu *gpu,
    const struct hg_gpu_pipeline_params *params, VkPipeline *out, struct hg_error *err)
{
    struct stages stages = {0};
    fill_spec(&stages, params);
    const bool compute = params->compute != NULL;
    enum hg_status status = add_stage(gpu, &stages, compute ? params->compute : params->vertex,
        compute ? VK_SHADER_STAGE_COMPUTE_BIT : VK_SHADER_STAGE_VERTEX_BIT, err);
    if (status == HG_OK && params->fragment != NULL)
        status = add_stage(gpu, &stages, params->fragment, VK_SHADER_STAGE_FRAGMENT_BIT, err);
    if (status == HG_OK)
        status = compute ? create_compute(gpu, &stages, params->io, out, err)
                         : create_graphics(gpu, &stages, params, out, err);
    for (uint32_t i = 0; i < stages.count; i++)
        vkDestroyShaderModule(gpu->device, stages.list[i].module, NULL);
    return status;
}

static bool same_name(const char *a, const char *b)
{
    return a == b || (a != NULL && b != NULL && strcmp(a, b) == 0);
}

static bool same_params(
    const struct hg_gpu_pipeline_params *a, const struct hg_gpu_pipeline_params *b)
{
    return same_name(a->compute, b->compute) && same_name(a->vertex, b->vertex) &&
           same_name(a->fragment, b->fragment) && a->spec_count == b->spec_count &&
           memcmp(a->spec, b->spec, sizeof a->spec) == 0 && a->color_count == b->color_count &&
           memcmp(a->colors, b->colors, sizeof a->colors) == 0 && a->depth == b->depth &&
           a->depth_compare == b->depth_compare && a->depth_write == b->depth_write &&
           a->depth_bias == b->depth_bias && a->depth_clamp == b->depth_clamp &&
           a->positions == b->positions && a->with_words == b->with_words &&
           a->topology == b->topology && a->blend == b->blend && hg_gpu_io_same(a->io, b->io);
}

static VkPipeline find_pipeline(
    const struct hg_gpu *gpu, const struct hg_gpu_pipeline_params *params)
{
    for (uint32_t i = 0; i < gpu->pipelines.count; i++)
        if (same_params(&gpu->pipelines.items[i].params, params))
            return gpu->pipelines.items[i].handle;
    return VK_NULL_HANDLE;
}

static enum hg_status reserve_pipelines(struct hg_gpu *gpu, uint32_t more, struct hg_error *err)
{
    return hg_grow(&gpu->pipelines.items, &gpu->pipelines.capacity, gpu->pipelines.count + more,
               sizeof *gpu->pipelines.items) == HG_OK
               ? HG_OK
               : hg_error_set(err, HG_E_NOMEM, "pipeline", NULL, "out of host memory");
}

// There is room for it.
static void keep_pipeline(
    struct hg_gpu *gpu, const struct hg_gpu_pipeline_params *params, VkPipeline handle)
{
    gpu->pipelines.items[gpu->pipelines.count++] = (struct hg_gpu_pipeline){*params, handle};
    hg_gpu_name(gpu, VK_OBJECT_TYPE_PIPELINE, (uint64_t)handle,
        params->compute != NULL    ? params->compute
        : params->fragment != NULL ? params->fragment
                                   : params->vertex);
}

// On one thread: the lists of shaders and of layouts grow.
static enum hg_status make_ready(
    struct hg_gpu *gpu, const struct hg_gpu_pipeline_params *params, struct hg_error *err)
{
    const char *const names[] = {params->compute, params->vertex, params->fragment};
    enum hg_status status = hg_gpu_io_ready(gpu, params->io, err);
    for (int i = 0; i < 3 && status == HG_OK; i++)
        if (names[i] != NULL)
            status = hg_gpu_shader_ready(gpu, names[i], err);
    return status;
}

enum hg_status hg_gpu_pipeline_get(struct hg_gpu *gpu, const struct hg_gpu_pipeline_params *params,
    VkPipeline *out, struct hg_error *err)
{
    *out = find_pipeline(gpu, params);
    if (*out != VK_NULL_HANDLE)
        return HG_OK;
    enum hg_status status = reserve_pipelines(gpu, 1, err);
    if (status == HG_OK)
        status = make_ready(gpu, params, err);
    if (status == HG_OK)
        status = create_pipeline(gpu, params, out, err);
    if (status == HG_OK)
        keep_pipeline(gpu, params, *out);
    else
        *out = VK_NULL_HANDLE;
    return status;
}

// One pipeline of several that are made side by side.
struct making {
    struct hg_gpu *gpu;
    const struct hg_gpu_pipeline_params *params;
    VkPipeline handle;
    struct hg_error err;
    enum hg_status status;
};

static void make_one(void *user, size_t index)
{
    struct making *m = (struct making *)user + index;
    m->status = create_pipeline(m->gpu, m->params, &m->handle, &m->err);
}

enum hg_status hg_gpu_pipelines_make(struct hg_gpu *gpu,
    const struct hg_gpu_pipeline_params *params, uint32_t count, struct hg_jobs *jobs,
    struct hg_error *err)
{
    struct making list[HG_GPU_MAX_MAKING] = {0};
    uint32_t missing = 0;
    enum hg_status status = reserve_pipelines(gpu, count, err);
    for (uint32_t i = 0; i < count && missing < HG_GPU_MAX_MAKING && status == HG_OK; i++) {
        if (find_pipeline(gpu, &params[i]) != VK_NULL_HANDLE)
            continue;
        list[missing++] = (struct making){.gpu = gpu, .params = &params[i]};
        status = make_ready(gpu, &params[i], err);
    }
    if (status != HG_OK || missing == 0)
        return status;
    hg_jobs_for(jobs, missing, make_one, list);
    for (uint32_t i = 0; i < missing; i++) {
        if (list[i].status == HG_OK)
            keep_pipeline(gpu, list[i].params, list[i].handle);
        else if (status == HG_OK) {
            status = list[i].status;
            *err = list[i].err;
        }
    }
    return status;
}

enum hg_status hg_gpu_cmd_pipeline(
    struct hg_gpu_cmd *cmd, const struct hg_gpu_pipeline_params *params, struct hg_error *err)
{
    VkPipeline pipeline;
    enum hg_status status = hg_gpu_pipeline_get(cmd->gpu, params, &pipeline, err);
    if (status == HG_OK) {
        vkCmdBindPipeline(cmd->handle,
            params->compute != NULL ? VK_PIPELINE_BIND_POINT_COMPUTE
                                    : VK_PIPELINE_BIND_POINT_GRAPHICS,
            pipeline);
    }
    return status;
}

uint32_t hg_gpu_pipeline_count(const struct hg_gpu *gpu)
{
    return gpu->pipelines.count;
}

// --- all of it -----------------------------------------------------------------------------------

enum hg_status hg_gpu_pipelines_init(struct hg_gpu *gpu, struct hg_error *err)
{
    enum hg_status status = hg_gpu_descriptors_init(gpu, err);
    return status == HG_OK ? create_cache(gpu, err) : status;
}

void hg_gpu_pipelines_finish(struct hg_gpu *gpu)
{
    for (uint32_t i = 0; i < gpu->pipelines.count; i++)
        vkDestroyPipeline(gpu->device, gpu->pipelines.items[i].handle, NULL);
    hg_free(gpu->pipelines.items);
    hg_gpu_shaders_finish(gpu);
    vkDestroyPipelineCache(gpu->device, gpu->pipelines.cache, NULL);
    hg_gpu_descriptors_finish(gpu);
}
