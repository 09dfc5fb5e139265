#include "renderer/passes/triangle_cache.h"

#include "shaders/shared/triangle_cache.h"

enum hg_status hg_triangle_cache_record(
    struct hg_pass *pass, const struct hg_geometry *geometry, struct hg_error *err)
{
    const struct hg_gpu_pipeline_params params = {.compute = "triangle_cache.comp",
        .spec = {0, pass->tables, pass->features},
        .spec_count = 3};
    const struct hg_triangle_cache_job *jobs;
    const uint32_t count = hg_geometry_facet_jobs(geometry, &jobs);
    struct hg_gpu_uniform first;
    const struct hg_gpu_buffer *facets;
    if (!hg_geometry_triangle_cache(geometry, &first, &facets) || count == 0)
        return HG_OK;
    enum hg_status status = hg_gpu_cmd_bind(pass->cmd, &pass->bindings, err);
    if (status == HG_OK)
        status = hg_gpu_cmd_pipeline(pass->cmd, &params, err);
    if (status != HG_OK)
        return status;
    for (uint32_t i = 0; i < count; i++) {
        const struct hg_gpu_facet_push push = {.facets = facets->address,
            .draw = jobs[i].draw,
            .first = jobs[i].first,
            .count = jobs[i].count};
        hg_gpu_cmd_push(pass->cmd, &push, sizeof push);
        vkCmdDispatch(hg_gpu_cmd_handle(pass->cmd),
            (jobs[i].count + HG_TRIANGLE_CACHE_GROUP - 1) / HG_TRIANGLE_CACHE_GROUP, 1, 1);
    }
    return HG_OK;
}
