#include "renderer/passes/debug.h"

#include "shaders/shared/pass_io.h"

static const struct hg_gpu_io debug_io = HG_GPU_IO(HG_DEBUG_IO);
struct debug_inputs {
    HG_DEBUG_IO(HG_GPU_IO_MEMBER)
};

#define COLOR_FORMAT VK_FORMAT_R32G32B32A32_SFLOAT

static struct hg_gpu_pipeline_params pipeline_of(const struct hg_pass *pass, uint32_t view)
{
    return (struct hg_gpu_pipeline_params){
        .vertex = "fullscreen.vert",
        .fragment = "debug.frag",
        .spec = {view, pass->tables, pass->features},
        .spec_count = 3,
        .colors = {COLOR_FORMAT},
        .color_count = 1,
        .topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST,
        .io = &debug_io,
    };
}

enum hg_status hg_debug_record(
    struct hg_pass *pass, const struct hg_debug *debug, struct hg_error *err)
{
    const struct debug_inputs inputs = {
        .visibility = {debug->visibility}, .counts = {debug->counts}};
    enum hg_status status = hg_pass_bind(pass, &debug_io, &inputs, sizeof inputs, err);
    if (status != HG_OK)
        return status;
    const struct hg_gpu_rendering rendering = {
        .colors = {{.image = debug->target, .clear = true}}, .color_count = 1};
    const struct hg_gpu_pipeline_params params = pipeline_of(pass, debug->view);
    hg_gpu_cmd_begin_stage(pass->cmd, "debug view");
    hg_gpu_cmd_begin_rendering(pass->cmd, &rendering);
    status = hg_gpu_cmd_pipeline(pass->cmd, &params, err);
    if (status == HG_OK)
        vkCmdDraw(hg_gpu_cmd_handle(pass->cmd), 3, 1, 0, 0);
    hg_gpu_cmd_end_rendering(pass->cmd);
    hg_gpu_cmd_end_stage(pass->cmd);
    return status;
}
