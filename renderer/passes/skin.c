// skin.c - see skin.h.
#include "renderer/passes/skin.h"

enum hg_status hg_skin_record(
    struct hg_gpu_cmd *cmd, const struct hg_geometry *geometry, struct hg_error *err)
{
    const uint32_t count = hg_geometry_deform_count(geometry);
    if (count == 0)
        return HG_OK;
    const struct hg_gpu_pipeline_params params = {.compute = "skin.comp"};
    const enum hg_status status = hg_gpu_cmd_pipeline(cmd, &params, err);
    if (status != HG_OK)
        return status;
    for (uint32_t i = 0; i < count; i++) {
        const struct hg_deform_job job = hg_geometry_deform(geometry, i);
        hg_gpu_cmd_push(cmd, &job.address, sizeof job.address);
        vkCmdDispatch(hg_gpu_cmd_handle(cmd),
            (job.vertex_count + HG_DEFORM_GROUP - 1) / HG_DEFORM_GROUP, 1, 1);
    }
    hg_gpu_memory_barrier(cmd);
    return HG_OK;
}

enum hg_status hg_skin_run(struct hg_gpu *gpu, struct hg_geometry *geometry, struct hg_error *err)
{
    struct hg_gpu_cmd *cmd;
    if (hg_geometry_deform_count(geometry) == 0)
        return HG_OK;
    enum hg_status status = hg_gpu_begin(gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    status = hg_skin_record(cmd, geometry, err);
    if (status != HG_OK) {
        hg_gpu_discard(gpu, cmd);
        return status;
    }
    status = hg_gpu_submit_and_wait(gpu, cmd, err);
    if (status == HG_OK)
        hg_geometry_deforms_done(geometry);
    return status;
}
