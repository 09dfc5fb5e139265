// pass.c - see pass.h.
#include "renderer/passes/pass.h"

#include <string.h>

enum hg_status hg_pass_fullscreen(
    const struct hg_pass *pass, const struct hg_fullscreen *f, struct hg_error *err)
{
    struct hg_gpu_pipeline_params params = {.vertex = "fullscreen.vert",
        .fragment = f->fragment,
        .spec_count = f->spec_count,
        .colors = {f->target->format, f->second != NULL ? f->second->format : VK_FORMAT_UNDEFINED},
        .color_count = f->second != NULL ? 2 : 1,
        .topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST,
        .io = f->io};
    const struct hg_gpu_rendering rendering = {
        .colors = {{.image = f->target, .discard = true}, {.image = f->second, .discard = true}},
        .color_count = params.color_count};
    memcpy(params.spec, f->spec, f->spec_count * sizeof params.spec[0]);
    enum hg_status status = hg_pass_bind(pass, f->io, f->inputs, f->inputs_bytes, err);
    if (status != HG_OK)
        return status;
    hg_gpu_cmd_begin_rendering(pass->cmd, &rendering);
    status = hg_gpu_cmd_pipeline(pass->cmd, &params, err);
    if (status == HG_OK && f->push_bytes > 0)
        hg_gpu_cmd_push(pass->cmd, f->push, f->push_bytes);
    if (status == HG_OK)
        vkCmdDraw(hg_gpu_cmd_handle(pass->cmd), 3, 1, 0, 0);
    hg_gpu_cmd_end_rendering(pass->cmd);
    return status;
}
