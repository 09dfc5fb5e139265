#include "renderer/passes/path.h"

#include "shaders/shared/features.h"

_Static_assert(HG_BIND_PATH == HG_BIND_HISTORY, "paths have no history");

static const struct {
    const char *shader, *stage;
    uint32_t variant;
} kernels[] = {{"path_begin.comp", "path begin", 0}, {"path_shade.comp", "path shade", 0},
    {"path_shade.comp", "path miss", 1}, {"path_shade.comp", "path shade", 2},
    {"path_shade.comp", "path end", 3}, {"path_shade.comp", "path sunlit", 4},
    {"path_shadow.comp", "path light", 0}, {"path_shadow.comp", "path holes", 1},
    {"path_shadow.comp", "path light", 2}, {"path_add.comp", "path film", 0},
    {"path_add.comp", "path film", 1}};

static struct hg_gpu_pipeline_params pipeline_of(
    const struct hg_pass *pass, enum hg_path_kernel kernel, uint32_t options)
{
    return (struct hg_gpu_pipeline_params){.compute = kernels[kernel].shader,
        .spec = {kernels[kernel].variant, pass->tables, pass->features | pass->background, options,
            0, pass->features2 & ~(HG_FEATURE2_PROBES | HG_FEATURE2_SIZED)},
        .spec_count = 6};
}

enum hg_status hg_path_make(struct hg_pass *pass, const struct hg_path_variant *variants,
    uint32_t count, struct hg_error *err)
{
    struct hg_gpu_pipeline_params params[HG_GPU_MAX_MAKING];
    for (uint32_t i = 0; i < count; i++)
        params[i] = pipeline_of(pass, variants[i].kernel, variants[i].options);
    return pass->jobs != NULL ? hg_gpu_pipelines_make(pass->gpu, params, count, pass->jobs, err)
                              : HG_OK;
}

enum hg_status hg_path_record(struct hg_pass *pass, enum hg_path_kernel kernel, uint32_t options,
    const struct hg_gpu_uniform *block, const struct hg_gpu_path_push *push, struct hg_error *err)
{
    struct hg_gpu_bindings bindings = pass->bindings;
    bindings.uniforms[HG_BIND_PATH - HG_BIND_UNIFORM_FIRST] = *block;
    const struct hg_gpu_pipeline_params params = pipeline_of(pass, kernel, options);
    enum hg_status status = hg_gpu_cmd_bind(pass->cmd, &bindings, err);
    if (status == HG_OK)
        status = hg_gpu_cmd_pipeline(pass->cmd, &params, err);
    if (status != HG_OK)
        return status;
    hg_gpu_cmd_begin_stage(pass->cmd, kernels[kernel].stage);
    hg_gpu_cmd_push(pass->cmd, push, sizeof *push);
    vkCmdDispatch(
        hg_gpu_cmd_handle(pass->cmd), (push->count + HG_PATH_GROUP - 1) / HG_PATH_GROUP, 1, 1);
    hg_gpu_memory_barrier(pass->cmd);
    hg_gpu_cmd_end_stage(pass->cmd);
    return HG_OK;
}

enum hg_status hg_path_show_record(
    struct hg_pass *pass, const struct hg_path_show *show, struct hg_error *err)
{
    const struct hg_gpu_pipeline_params params = {.vertex = "fullscreen.vert",
        .fragment = "path_show.frag",
        .colors = {show->target->format},
        .color_count = 1,
        .topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST};
    const struct hg_gpu_rendering rendering = {
        .colors = {{.image = show->target, .clear = show->clear}}, .color_count = 1};
    const struct {
        uint64_t film, samples;
        uint32_t width, height, columns, catcher, transparent, reserved;
    } push = {show->film, show->samples, show->target->width, show->target->height,
        (show->target->width + HG_PATH_TILE_SIDE - 1) / HG_PATH_TILE_SIDE, show->catcher,
        show->transparent, 0};
    enum hg_status status = hg_gpu_cmd_bind(pass->cmd, &pass->bindings, err);
    if (status != HG_OK)
        return status;
    hg_gpu_cmd_begin_stage(pass->cmd, "path show");
    hg_gpu_cmd_begin_rendering(pass->cmd, &rendering);
    status = hg_gpu_cmd_pipeline(pass->cmd, &params, err);
    if (status == HG_OK) {
        hg_gpu_cmd_push(pass->cmd, &push, sizeof push);
        vkCmdDraw(hg_gpu_cmd_handle(pass->cmd), 3, 1, 0, 0);
    }
    hg_gpu_cmd_end_rendering(pass->cmd);
    hg_gpu_cmd_end_stage(pass->cmd);
    return status;
}
