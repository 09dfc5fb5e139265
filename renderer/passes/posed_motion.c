#include "renderer/passes/posed_motion.h"

static const struct hg_gpu_io posed_motion_io = HG_GPU_IO(HG_POSED_MOTION_IO);
struct posed_motion_inputs {
    HG_POSED_MOTION_IO(HG_GPU_IO_MEMBER)
};

static uint32_t groups(uint32_t px)
{
    return (px + HG_POSED_MOTION_GROUP - 1) / HG_POSED_MOTION_GROUP;
}

enum hg_status hg_posed_motion_record(struct hg_pass *pass, struct hg_gpu_image *visibility,
    const struct hg_gpu_posed_motion *push, struct hg_error *err)
{
    const struct posed_motion_inputs inputs = {.visibility = {.image = visibility}};
    const struct hg_gpu_pipeline_params params = {.compute = "posed_motion.comp",
        .spec = {0, pass->tables, pass->features},
        .spec_count = 3,
        .io = &posed_motion_io};
    enum hg_status status = hg_pass_bind(pass, &posed_motion_io, &inputs, sizeof inputs, err);
    if (status == HG_OK)
        status = hg_gpu_cmd_pipeline(pass->cmd, &params, err);
    if (status != HG_OK)
        return status;
    hg_gpu_cmd_push(pass->cmd, push, sizeof *push);
    vkCmdDispatch(
        hg_gpu_cmd_handle(pass->cmd), groups(push->size & 0xffffu), groups(push->size >> 16), 1);
    return HG_OK;
}
