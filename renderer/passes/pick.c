#include "renderer/passes/pick.h"

static const struct hg_gpu_io pick_io = HG_GPU_IO(HG_PICK_IO);
struct pick_inputs {
    HG_PICK_IO(HG_GPU_IO_MEMBER)
};

#define GROUP 8u // side of the kernel's groups

enum hg_status hg_pick_record(struct hg_pass *pass, struct hg_gpu_image *visibility, VkRect2D area,
    const struct hg_gpu_buffer *target, struct hg_error *err)
{
    const struct pick_inputs inputs = {.visibility = {.image = visibility}};
    const struct hg_gpu_pipeline_params params = {.compute = "pick.comp",
        .spec = {0, pass->tables, pass->features},
        .spec_count = 3,
        .io = &pick_io};
    const struct {
        uint64_t target;
        uint32_t x, y, width, height;
    } push = {target->address, (uint32_t)area.offset.x, (uint32_t)area.offset.y, area.extent.width,
        area.extent.height};
    enum hg_status status = hg_pass_bind(pass, &pick_io, &inputs, sizeof inputs, err);
    if (status == HG_OK)
        status = hg_gpu_cmd_pipeline(pass->cmd, &params, err);
    if (status != HG_OK)
        return status;
    hg_gpu_cmd_push(pass->cmd, &push, sizeof push);
    vkCmdDispatch(hg_gpu_cmd_handle(pass->cmd), (area.extent.width + GROUP - 1) / GROUP,
        (area.extent.height + GROUP - 1) / GROUP, 1);
    return HG_OK;
}
