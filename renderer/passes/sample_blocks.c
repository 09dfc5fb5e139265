#include "renderer/passes/sample_blocks.h"

enum hg_status hg_sample_blocks_record(const struct hg_pass *pass, struct hg_gpu_image *depth,
    const struct hg_gpu_sample_blocks *blocks, struct hg_error *err)
{
    const struct hg_gpu_pipeline_params params = {.vertex = "fullscreen.vert",
        .fragment = "sample_blocks.frag",
        .depth = VK_FORMAT_D32_SFLOAT,
        .depth_compare = VK_COMPARE_OP_ALWAYS,
        .depth_write = true,
        .topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST};
    const struct hg_gpu_rendering rendering = {.depth = {.image = depth}, .area = pass->area};
    enum hg_status status = hg_gpu_cmd_bind(pass->cmd, &pass->bindings, err);
    if (status != HG_OK)
        return status;
    hg_gpu_cmd_begin_rendering(pass->cmd, &rendering);
    hg_pass_view_whole(pass, depth);
    status = hg_gpu_cmd_pipeline(pass->cmd, &params, err);
    if (status == HG_OK) {
        hg_gpu_cmd_push(pass->cmd, blocks, sizeof *blocks);
        vkCmdDraw(hg_gpu_cmd_handle(pass->cmd), 3, 1, 0, 0);
    }
    hg_gpu_cmd_end_rendering(pass->cmd);
    return status;
}
