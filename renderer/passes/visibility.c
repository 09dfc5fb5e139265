#include "renderer/passes/visibility.h"

#include "shaders/shared/features.h"

// How a range is drawn. Values are also the specialisation constant of visibility_alpha.frag.
enum variant { SOLID, MASK, LAYER_FIRST, LAYER_NEXT, VARIANTS, OVERDRAW };

static const VkPrimitiveTopology topologies[3] = {VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST,
    VK_PRIMITIVE_TOPOLOGY_LINE_LIST, VK_PRIMITIVE_TOPOLOGY_POINT_LIST};

static VkPrimitiveTopology topology_of(uint32_t flags)
{
    return topologies[(flags & HG_DRAW_LINES) != 0 ? 1 : (flags & HG_DRAW_POINTS) != 0 ? 2 : 0];
}

static struct hg_gpu_pipeline_params pipeline_of(
    enum variant variant, VkPrimitiveTopology topology, uint32_t tables, uint32_t features)
{
    const bool textured = variant != SOLID;
    if (variant == OVERDRAW) {
        return (struct hg_gpu_pipeline_params){
            .vertex = "visibility.vert",
            .fragment = "overdraw.frag",
            .spec = {0, tables, features},
            .spec_count = 3,
            .colors = {VK_FORMAT_R32G32B32A32_SFLOAT},
            .color_count = 1,
            .topology = topology,
            .blend = HG_GPU_BLEND_ADD,
        };
    }
    return (struct hg_gpu_pipeline_params){
        .vertex = "visibility.vert",
        .fragment = textured ? "visibility_alpha.frag" : "visibility.frag",
        .spec = {textured ? (uint32_t)variant : 0, tables, features},
        .spec_count = 3,
        .colors = {HG_VISIBILITY_FORMAT},
        .color_count = 1,
        .depth = HG_DEPTH_FORMAT,
        .depth_compare = VK_COMPARE_OP_GREATER,
        .depth_write = true,
        .topology = topology,
    };
}

static void set_culling(VkCommandBuffer cmd, uint32_t flags)
{
    const bool both = (flags & (HG_DRAW_DOUBLE_SIDED | HG_DRAW_LINES | HG_DRAW_POINTS)) != 0;
    vkCmdSetCullMode(cmd, both ? VK_CULL_MODE_NONE : VK_CULL_MODE_BACK_BIT);
    vkCmdSetFrontFace(cmd, (flags & HG_DRAW_MIRRORED) != 0 ? VK_FRONT_FACE_CLOCKWISE
                                                           : VK_FRONT_FACE_COUNTER_CLOCKWISE);
}

static enum hg_status draw_class(struct hg_pass *pass, const struct hg_draw_ranges *ranges,
    enum hg_draw_class class, enum variant variant, struct hg_error *err)
{
    const VkCommandBuffer cmd = hg_gpu_cmd_handle(pass->cmd);
    VkPipeline bound = VK_NULL_HANDLE;
    for (uint32_t i = ranges->class_first[class]; i < ranges->class_first[class + 1]; i++) {
        const struct hg_draw_range *range = &ranges->items[i];
        const struct hg_gpu_pipeline_params params =
            pipeline_of(variant, topology_of(range->flags), pass->tables, pass->features);
        VkPipeline pipeline;
        enum hg_status status = hg_gpu_pipeline_get(pass->gpu, &params, &pipeline, err);
        if (status != HG_OK)
            return status;
        if (pipeline != bound)
            vkCmdBindPipeline(cmd, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
        bound = pipeline;
        set_culling(cmd, range->flags);
        vkCmdBindIndexBuffer(cmd, range->index_buffer, range->index_offset, VK_INDEX_TYPE_UINT32);
        vkCmdDrawIndexed(cmd, range->index_count, range->draw_count, 0, 0, range->first_draw);
    }
    return HG_OK;
}

static void begin(struct hg_pass *pass, const struct hg_visibility_target *target, VkRect2D area)
{
    const struct hg_gpu_rendering rendering = {
        .colors = {{.image = target->visibility, .clear = true}},
        .color_count = 1,
        .depth = {.image = target->depth, .clear = true}, // 0 = infinitely far
        .area = area,
    };
    hg_gpu_cmd_begin_rendering(pass->cmd, &rendering);
}

enum hg_status hg_visibility_record(struct hg_pass *pass, const struct hg_draw_ranges *ranges,
    const struct hg_visibility_target *target, struct hg_error *err)
{
    enum hg_status status = hg_gpu_cmd_bind(pass->cmd, &pass->bindings, err);
    if (status != HG_OK)
        return status;
    hg_gpu_cmd_begin_stage(pass->cmd, "visibility");
    begin(pass, target, (VkRect2D){0});
    status = draw_class(pass, ranges, HG_DRAW_CLASS_OPAQUE, SOLID, err);
    if (status == HG_OK)
        status = draw_class(pass, ranges, HG_DRAW_CLASS_MASK, MASK, err);
    hg_gpu_cmd_end_rendering(pass->cmd);
    hg_gpu_cmd_end_stage(pass->cmd);
    return status;
}

enum hg_status hg_visibility_record_layer(struct hg_pass *pass, const struct hg_draw_ranges *ranges,
    const struct hg_visibility_target *target, struct hg_gpu_image *opaque_depth,
    struct hg_gpu_image *previous, struct hg_error *err)
{
    struct hg_gpu_bindings bindings = pass->bindings;
    bindings.images[HG_BIND_DEPTH] = opaque_depth;
    bindings.images[HG_BIND_COLOR_A] = previous;
    enum hg_status status = hg_gpu_cmd_bind(pass->cmd, &bindings, err);
    if (status != HG_OK)
        return status;
    hg_gpu_cmd_begin_stage(pass->cmd, "blend visibility");
    begin(pass, target, (VkRect2D){0});
    status = draw_class(
        pass, ranges, HG_DRAW_CLASS_BLEND, previous != NULL ? LAYER_NEXT : LAYER_FIRST, err);
    hg_gpu_cmd_end_rendering(pass->cmd);
    hg_gpu_cmd_end_stage(pass->cmd);
    return status;
}

enum hg_status hg_visibility_record_pick(struct hg_pass *pass, const struct hg_draw_ranges *ranges,
    const struct hg_visibility_target *target, VkRect2D area, struct hg_error *err)
{
    static const enum variant variants[] = {SOLID, MASK, SOLID};
    enum hg_status status = hg_gpu_cmd_bind(pass->cmd, &pass->bindings, err);
    if (status != HG_OK)
        return status;
    begin(pass, target, area);
    const VkViewport whole = {0.0f, 0.0f, (float)target->visibility->width,
        (float)target->visibility->height, 0.0f, 1.0f};
    vkCmdSetViewport(hg_gpu_cmd_handle(pass->cmd), 0, 1, &whole);
    for (uint32_t c = HG_DRAW_CLASS_OPAQUE; c <= HG_DRAW_CLASS_BLEND && status == HG_OK; c++)
        status = draw_class(pass, ranges, (enum hg_draw_class)c, variants[c], err);
    hg_gpu_cmd_end_rendering(pass->cmd);
    return status;
}

enum hg_status hg_visibility_record_overdraw(struct hg_pass *pass,
    const struct hg_draw_ranges *ranges, struct hg_gpu_image *counts, struct hg_error *err)
{
    enum hg_status status = hg_gpu_cmd_bind(pass->cmd, &pass->bindings, err);
    if (status != HG_OK)
        return status;
    const struct hg_gpu_rendering rendering = {
        .colors = {{.image = counts, .clear = true}}, .color_count = 1};
    hg_gpu_cmd_begin_stage(pass->cmd, "overdraw");
    hg_gpu_cmd_begin_rendering(pass->cmd, &rendering);
    for (uint32_t c = HG_DRAW_CLASS_OPAQUE; c <= HG_DRAW_CLASS_BLEND && status == HG_OK; c++)
        status = draw_class(pass, ranges, (enum hg_draw_class)c, OVERDRAW, err);
    hg_gpu_cmd_end_rendering(pass->cmd);
    hg_gpu_cmd_end_stage(pass->cmd);
    return status;
}

enum hg_status hg_visibility_warm_up(
    struct hg_gpu *gpu, uint32_t index, uint32_t *count, struct hg_error *err)
{
    *count = VARIANTS;
    const struct hg_gpu_pipeline_params params =
        pipeline_of((enum variant)(index % VARIANTS), topologies[0], 0, HG_FEATURE_ALL);
    VkPipeline pipeline;
    return hg_gpu_pipeline_get(gpu, &params, &pipeline, err);
}
