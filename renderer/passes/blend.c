#include "renderer/passes/blend.h"

#include "shaders/shared/blend.h"

void hg_blend_clear(struct hg_pass *pass, const struct hg_blend_lists *lists)
{
    vkCmdFillBuffer(hg_gpu_cmd_handle(pass->cmd), lists->heads.handle, 0, VK_WHOLE_SIZE, 0);
    hg_blend_clear_nodes(pass, lists);
}

void hg_blend_clear_nodes(struct hg_pass *pass, const struct hg_blend_lists *lists)
{
    vkCmdFillBuffer(
        hg_gpu_cmd_handle(pass->cmd), lists->nodes.handle, 0, sizeof(struct hg_gpu_blend_node), 0);
}

// Marks and sorts what lies in front of this depth: lists of more than one node.
#define SORTED_DEPTH 0.75f

enum step { MARK, SORT, STEPS };

static struct hg_gpu_pipeline_params pipeline_of(enum step step)
{
    return (struct hg_gpu_pipeline_params){.vertex = "fullscreen.vert",
        .fragment = step == MARK ? "blend_mark.frag" : "blend_sort.frag",
        .depth = VK_FORMAT_D32_SFLOAT,
        .depth_compare = step == MARK ? VK_COMPARE_OP_ALWAYS : VK_COMPARE_OP_LESS,
        .depth_write = step == MARK,
        .topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST};
}

static enum hg_status record_step(struct hg_pass *pass, enum step step,
    const struct hg_gpu_rendering *rendering, const void *push, uint32_t push_bytes,
    struct hg_error *err)
{
    const struct hg_gpu_image *depth = rendering->depth.image;
    const float near = step == SORT ? SORTED_DEPTH : 0.0f;
    const VkViewport view = {0.0f, 0.0f, (float)depth->width, (float)depth->height, near, 1.0f};
    const struct hg_gpu_pipeline_params params = pipeline_of(step);
    hg_gpu_cmd_begin_rendering(pass->cmd, rendering);
    vkCmdSetViewport(hg_gpu_cmd_handle(pass->cmd), 0, 1, &view);
    const enum hg_status status = hg_gpu_cmd_pipeline(pass->cmd, &params, err);
    if (status == HG_OK) {
        hg_gpu_cmd_push(pass->cmd, push, push_bytes);
        vkCmdDraw(hg_gpu_cmd_handle(pass->cmd), 3, 1, 0, 0);
    }
    hg_gpu_cmd_end_rendering(pass->cmd);
    return status;
}

enum hg_status hg_blend_sort(struct hg_pass *pass, const struct hg_blend_lists *lists,
    struct hg_gpu_image *depth, uint32_t report, struct hg_error *err)
{
    const struct {
        uint64_t reports;
        uint32_t first_x, first_y, report, end_x, end_y, reserved;
    } push = {.reports = lists->reports.address,
        .first_x = (uint32_t)pass->area.offset.x,
        .first_y = (uint32_t)pass->area.offset.y,
        .report = report,
        .end_x = (uint32_t)pass->area.offset.x + pass->area.extent.width,
        .end_y = (uint32_t)pass->area.offset.y + pass->area.extent.height};
    struct hg_gpu_rendering rendering = {
        .depth = {.image = depth, .clear = true}, .area = pass->area};
    enum hg_status status = hg_gpu_cmd_bind(pass->cmd, &pass->bindings, err);
    if (status == HG_OK)
        status = record_step(pass, MARK, &rendering, &push, sizeof push, err);
    rendering.depth.clear = false;
    return status == HG_OK ? record_step(pass, SORT, &rendering, &push, sizeof push, err) : status;
}

enum hg_status hg_blend_warm_up(
    struct hg_gpu *gpu, uint32_t index, uint32_t *count, struct hg_error *err)
{
    *count = STEPS;
    const struct hg_gpu_pipeline_params params = pipeline_of((enum step)(index % STEPS));
    VkPipeline pipeline;
    return hg_gpu_pipeline_get(gpu, &params, &pipeline, err);
}
