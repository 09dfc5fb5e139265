#include "renderer/passes/debug.h"

static const struct hg_gpu_io debug_io = HG_GPU_IO(HG_DEBUG_IO);
struct debug_inputs {
    HG_DEBUG_IO(HG_GPU_IO_MEMBER)
};

enum hg_status hg_debug_record(
    struct hg_pass *pass, const struct hg_debug *debug, struct hg_error *err)
{
    const struct debug_inputs inputs = {
        .visibility = {.image = debug->visibility}, .counts = {.image = debug->counts}};
    const struct hg_fullscreen fullscreen = {.fragment = "debug.frag",
        .target = debug->target,
        .io = &debug_io,
        .inputs = &inputs,
        .inputs_bytes = sizeof inputs,
        .spec = {debug->view, pass->tables, pass->features},
        .spec_count = 3};
    return hg_pass_fullscreen(pass, &fullscreen, err);
}
