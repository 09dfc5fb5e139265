#include "renderer/passes/shade.h"

#include "shaders/shared/features.h"

// Values of the specialisation constant of shade.frag.
enum variant { OPAQUE, OPAQUE_BEHIND, LAYER, VARIANTS };

// flat: shade_flat.*, for CPU devices.
static struct hg_gpu_pipeline_params pipeline_of(enum variant variant, bool background, bool first,
    bool flat, uint32_t tables, uint32_t features)
{
    return (struct hg_gpu_pipeline_params){
        .vertex = flat ? "shade_flat.vert" : "fullscreen.vert",
        .fragment = flat ? "shade_flat.frag" : "shade.frag",
        .spec = {variant, tables, features, background},
        .spec_count = 4,
        .colors = {HG_COLOR_FORMAT},
        .color_count = 1,
        // The triangle lies at infinity (0): in front of it is a surface, else nothing.
        .depth = VK_FORMAT_D32_SFLOAT,
        .depth_compare = background ? VK_COMPARE_OP_EQUAL : VK_COMPARE_OP_LESS,
        .topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST,
        .blend = variant == LAYER ? HG_GPU_BLEND_UNDER
                 : first          ? HG_GPU_BLEND_NONE
                                  : HG_GPU_BLEND_ADD,
    };
}

static struct hg_gpu_pipeline_params pipeline_for(
    const struct hg_pass *pass, enum variant variant, bool background, bool first)
{
    const bool flat = hg_gpu_get_caps(pass->gpu)->is_cpu;
    return pipeline_of(variant, background, first, flat, pass->tables, pass->features);
}

static enum hg_status draw(
    struct hg_pass *pass, enum variant variant, bool background, bool first, struct hg_error *err)
{
    const struct hg_gpu_pipeline_params params = pipeline_for(pass, variant, background, first);
    enum hg_status status = hg_gpu_cmd_pipeline(pass->cmd, &params, err);
    if (status == HG_OK)
        vkCmdDraw(hg_gpu_cmd_handle(pass->cmd), 3, 1, 0, 0);
    return status;
}

// Both pipelines of a pass, side by side when they are new.
static enum hg_status make_both(
    struct hg_pass *pass, enum variant variant, bool first, struct hg_error *err)
{
    const struct hg_gpu_pipeline_params params[2] = {
        pipeline_for(pass, variant, false, first), pipeline_for(pass, variant, true, first)};
    return pass->jobs != NULL ? hg_gpu_pipelines_make(pass->gpu, params, 2, pass->jobs, err)
                              : HG_OK;
}

enum hg_status hg_shade_record(
    struct hg_pass *pass, const struct hg_shade *shade, struct hg_error *err)
{
    struct hg_gpu_bindings bindings = pass->bindings;
    bindings.images[HG_BIND_VISIBILITY] = shade->visibility;
    bindings.images[HG_BIND_COLOR_A] = shade->front;
    const enum variant variant = shade->layer           ? LAYER
                                 : shade->front != NULL ? OPAQUE_BEHIND
                                                        : OPAQUE;
    enum hg_status status = hg_gpu_cmd_bind(pass->cmd, &bindings, err);
    if (status == HG_OK && variant != LAYER)
        status = make_both(pass, variant, shade->clear, err);
    if (status != HG_OK)
        return status;
    const struct hg_gpu_rendering rendering = {
        // Surfaces and background write every pixel between them.
        .colors = {{.image = shade->target,
            .clear = shade->clear && shade->layer,
            .discard = shade->clear && !shade->layer}},
        .color_count = 1,
        .depth = {.image = shade->depth},
        .area = pass->area};
    if (shade->counted)
        hg_gpu_memory_barrier(pass->cmd);
    hg_gpu_cmd_begin_stage(pass->cmd, shade->layer ? "blend shading" : "shading");
    hg_gpu_cmd_begin_rendering(pass->cmd, &rendering);
    hg_pass_view_whole(pass, shade->target);
    status = draw(pass, variant, false, shade->clear, err);
    if (status == HG_OK && variant != LAYER)
        status = draw(pass, variant, true, shade->clear, err);
    hg_gpu_cmd_end_rendering(pass->cmd);
    hg_gpu_cmd_end_stage(pass->cmd);
    return status;
}

enum hg_status hg_shade_warm_up(
    struct hg_gpu *gpu, uint32_t index, uint32_t *count, struct hg_error *err)
{
    *count = 2 * VARIANTS - 1; // layers have no background
    const struct hg_gpu_pipeline_params params =
        pipeline_of((enum variant)(index % VARIANTS), index % (2 * VARIANTS - 1) >= VARIANTS, true,
            hg_gpu_get_caps(gpu)->is_cpu, 0, HG_FEATURE_ALL);
    VkPipeline pipeline;
    return hg_gpu_pipeline_get(gpu, &params, &pipeline, err);
}
