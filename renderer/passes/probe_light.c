#include "renderer/passes/probe_light.h"

static const struct hg_gpu_io probe_light_io = HG_GPU_IO(HG_PROBE_LIGHT_IO);
struct probe_light_inputs {
    HG_PROBE_LIGHT_IO(HG_GPU_IO_MEMBER)
};

enum hg_status hg_probe_light_record(
    struct hg_pass *pass, const struct hg_probe_light *light, struct hg_error *err)
{
    const struct probe_light_inputs inputs = {
        .visibility = {.image = light->visibility}, .depth = {.image = light->depth}};
    const struct hg_fullscreen fullscreen = {.fragment = "probe_light.frag",
        .target = light->target,
        .second = light->surfaces,
        .io = &probe_light_io,
        .inputs = &inputs,
        .inputs_bytes = sizeof inputs,
        .spec = {0, pass->tables, pass->features, light->surfaces != NULL},
        .spec_count = 4};
    return hg_pass_fullscreen(pass, &fullscreen, err);
}
