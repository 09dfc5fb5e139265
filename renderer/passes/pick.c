#include "renderer/passes/pick.h"

enum hg_status hg_pick_record(struct hg_pass *pass, struct hg_gpu_image *visibility, uint32_t x,
    uint32_t y, const struct hg_gpu_buffer *target, struct hg_error *err)
{
    struct hg_gpu_bindings bindings = pass->bindings;
    bindings.images[HG_BIND_VISIBILITY] = visibility;
    const struct hg_gpu_pipeline_params params = {
        .compute = "pick.comp", .spec = {0, pass->tables, pass->features}, .spec_count = 3};
    const struct {
        uint64_t target;
        uint32_t x, y;
    } push = {target->address, x, y};
    enum hg_status status = hg_gpu_cmd_bind(pass->cmd, &bindings, err);
    if (status == HG_OK)
        status = hg_gpu_cmd_pipeline(pass->cmd, &params, err);
    if (status != HG_OK)
        return status;
    hg_gpu_cmd_push(pass->cmd, &push, sizeof push);
    vkCmdDispatch(hg_gpu_cmd_handle(pass->cmd), 1, 1, 1);
    return HG_OK;
}
