#include "renderer/passes/peel_test.h"

enum hg_status hg_peel_test_record(struct hg_pass *pass, struct hg_gpu_image *depth,
    const struct hg_gpu_buffer *target, uint32_t index, struct hg_error *err)
{
    struct hg_gpu_bindings bindings = pass->bindings;
    bindings.images[HG_BIND_DEPTH] = depth;
    const struct hg_gpu_pipeline_params params = {.compute = "peel_test.comp"};
    const struct {
        uint64_t target;
        uint32_t width, height;
    } push = {target->address + index * sizeof(uint32_t), depth->width, depth->height};
    const uint32_t rows = (depth->height + 1) / 2;
    enum hg_status status = hg_gpu_cmd_bind(pass->cmd, &bindings, err);
    if (status == HG_OK)
        status = hg_gpu_cmd_pipeline(pass->cmd, &params, err);
    if (status != HG_OK)
        return status;
    hg_gpu_cmd_begin_stage(pass->cmd, "blend depth");
    hg_gpu_cmd_push(pass->cmd, &push, sizeof push);
    vkCmdDispatch(hg_gpu_cmd_handle(pass->cmd), (rows + 63) / 64, 1, 1);
    hg_gpu_cmd_end_stage(pass->cmd);
    return HG_OK;
}
