#include "renderer/passes/checkerboard.h"

static const struct hg_gpu_io depth_io = HG_GPU_IO(HG_DEPTH_IO);
struct depth_inputs {
    HG_DEPTH_IO(HG_GPU_IO_MEMBER)
};

enum hg_status hg_checkerboard_record(const struct hg_pass *pass, struct hg_gpu_image *depth,
    struct hg_gpu_image *half, uint32_t number, struct hg_error *err)
{
    const struct depth_inputs inputs = {.depth = {.image = depth}};
    const struct hg_gpu_pipeline_params params = {.vertex = "fullscreen.vert",
        .fragment = "checkerboard.frag",
        .depth = VK_FORMAT_D32_SFLOAT,
        .depth_compare = VK_COMPARE_OP_ALWAYS,
        .depth_write = true,
        .topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST,
        .io = &depth_io};
    const struct hg_gpu_rendering rendering = {.depth = {.image = half, .discard = true}};
    const struct hg_gpu_checkerboard push = {number, depth->width};
    enum hg_status status = hg_pass_bind(pass, &depth_io, &inputs, sizeof inputs, err);
    if (status != HG_OK)
        return status;
    hg_gpu_cmd_begin_rendering(pass->cmd, &rendering);
    status = hg_gpu_cmd_pipeline(pass->cmd, &params, err);
    if (status == HG_OK) {
        hg_gpu_cmd_push(pass->cmd, &push, sizeof push);
        vkCmdDraw(hg_gpu_cmd_handle(pass->cmd), 3, 1, 0, 0);
    }
    hg_gpu_cmd_end_rendering(pass->cmd);
    return status;
}
