#include "renderer/passes/shadow.h"

#include "shaders/shared/features.h"

static VkPrimitiveTopology topology_of(uint32_t flags)
{
    return (flags & HG_DRAW_LINES) != 0    ? VK_PRIMITIVE_TOPOLOGY_LINE_LIST
           : (flags & HG_DRAW_POINTS) != 0 ? VK_PRIMITIVE_TOPOLOGY_POINT_LIST
                                           : VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST;
}

static struct hg_gpu_pipeline_params pipeline_of(
    bool masked, VkPrimitiveTopology topology, uint32_t tables, uint32_t features)
{
    return (struct hg_gpu_pipeline_params){
        .vertex = masked ? "shadow_mask.vert" : "shadow.vert",
        .fragment = masked ? "shadow_mask.frag" : NULL,
        .spec = {0, tables, features},
        .spec_count = 3,
        .depth = VK_FORMAT_D32_SFLOAT,
        .depth_compare = VK_COMPARE_OP_GREATER,
        .depth_write = true,
        .topology = topology,
    };
}

static enum hg_status draw_class(struct hg_pass *pass, const struct hg_draw_ranges *ranges,
    enum hg_draw_class class, const float view_proj[16], struct hg_error *err)
{
    const VkCommandBuffer cmd = hg_gpu_cmd_handle(pass->cmd);
    VkPipeline bound = VK_NULL_HANDLE;
    for (uint32_t i = ranges->class_first[class]; i < ranges->class_first[class + 1]; i++) {
        const struct hg_draw_range *range = &ranges->items[i];
        const struct hg_gpu_pipeline_params params = pipeline_of(
            class == HG_DRAW_CLASS_MASK, topology_of(range->flags), pass->tables, pass->features);
        VkPipeline pipeline;
        enum hg_status status = hg_gpu_pipeline_get(pass->gpu, &params, &pipeline, err);
        if (status != HG_OK)
            return status;
        if (pipeline != bound) {
            vkCmdBindPipeline(cmd, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline);
            hg_gpu_cmd_push(pass->cmd, view_proj, 16 * sizeof(float));
        }
        bound = pipeline;
        vkCmdBindIndexBuffer(cmd, range->index_buffer, range->index_offset, VK_INDEX_TYPE_UINT32);
        vkCmdDrawIndexed(cmd, range->index_count, range->draw_count, 0, 0, range->first_draw);
    }
    return HG_OK;
}

static enum hg_status cull_map(const struct hg_geometry *geometry, const struct hg_shadow_map *map,
    struct hg_draw_ranges *out, struct hg_error *err)
{
    struct hg_cull cull = {.casters_only = true};
    cull.plane_count = hg_cull_planes(map->view_proj, cull.planes);
    enum hg_status status = hg_geometry_cull(geometry, &cull, out);
    return status ? hg_error_set(err, status, "shadow maps", NULL, "no memory for draw lists")
                  : HG_OK;
}

static enum hg_status draw_map(struct hg_pass *pass, const struct hg_shadow_map *map,
    struct hg_gpu_image *atlas, const struct hg_draw_ranges *ranges, struct hg_error *err)
{
    const uint32_t side = (uint32_t)map->gpu.size_px;
    const struct hg_gpu_rendering rendering = {
        .depth = {.image = atlas, .clear = true},
        .area = {{(int32_t)map->gpu.rect_px.x, (int32_t)map->gpu.rect_px.y}, {side, side}},
    };
    hg_gpu_cmd_begin_rendering(pass->cmd, &rendering);
    enum hg_status status = draw_class(pass, ranges, HG_DRAW_CLASS_OPAQUE, map->view_proj, err);
    if (!status)
        status = draw_class(pass, ranges, HG_DRAW_CLASS_MASK, map->view_proj, err);
    hg_gpu_cmd_end_rendering(pass->cmd);
    return status;
}

enum hg_status hg_shadow_record(struct hg_pass *pass, const struct hg_geometry *geometry,
    struct hg_lighting *lighting, bool coarse, struct hg_draw_ranges *scratch, struct hg_error *err)
{
    uint32_t count, stale = 0;
    struct hg_shadow_map *maps = hg_lighting_shadow_maps(lighting, &count);
    for (uint32_t i = 0; i < count; i++)
        stale += maps[i].stale && !(coarse && maps[i].refines);
    if (!stale)
        return HG_OK;
    // The atlas is what is drawn to: it must not be bound as an input.
    struct hg_gpu_bindings bindings = pass->bindings;
    bindings.images[HG_BIND_SHADOW] = NULL;
    enum hg_status status = hg_gpu_cmd_bind(pass->cmd, &bindings, err);
    if (status)
        return status;
    hg_gpu_cmd_begin_stage(pass->cmd, "shadow");
    for (uint32_t i = 0; i < count && !status; i++) {
        if (!maps[i].stale || (coarse && maps[i].refines))
            continue;
        status = cull_map(geometry, &maps[i], scratch, err);
        if (!status)
            status = draw_map(pass, &maps[i], hg_lighting_image_shadow(lighting), scratch, err);
        maps[i].stale = status != HG_OK;
    }
    hg_gpu_cmd_end_stage(pass->cmd);
    return status;
}

enum hg_status hg_shadow_warm_up(
    struct hg_gpu *gpu, uint32_t index, uint32_t *count, struct hg_error *err)
{
    *count = 2;
    const struct hg_gpu_pipeline_params params =
        pipeline_of(index % 2 == 1, VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST, 0, HG_FEATURE_ALL);
    VkPipeline pipeline;
    return hg_gpu_pipeline_get(gpu, &params, &pipeline, err);
}
