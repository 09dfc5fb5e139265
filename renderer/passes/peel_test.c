#include "renderer/passes/peel_test.h"

static const struct hg_gpu_io depth_io = HG_GPU_IO(HG_DEPTH_IO);
struct depth_inputs {
    HG_DEPTH_IO(HG_GPU_IO_MEMBER)
};

enum hg_status hg_peel_test_record(struct hg_pass *pass, struct hg_gpu_image *depth,
    const struct hg_gpu_buffer *target, uint32_t index, struct hg_error *err)
{
    const struct depth_inputs inputs = {.depth = {.image = depth}};
    const struct hg_gpu_pipeline_params params = {.compute = "peel_test.comp", .io = &depth_io};
    const struct {
        uint64_t target;
        uint32_t width, height;
    } push = {target->address + index * sizeof(uint32_t), depth->width, depth->height};
    const uint32_t rows = (depth->height + 1) / 2;
    enum hg_status status = hg_pass_bind(pass, &depth_io, &inputs, sizeof inputs, err);
    if (status == HG_OK)
        status = hg_gpu_cmd_pipeline(pass->cmd, &params, err);
    if (status != HG_OK)
        return status;
    hg_gpu_cmd_push(pass->cmd, &push, sizeof push);
    vkCmdDispatch(hg_gpu_cmd_handle(pass->cmd), (rows + 63) / 64, 1, 1);
    return HG_OK;
}
