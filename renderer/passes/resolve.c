#include "renderer/passes/resolve.h"

#include "shaders/shared/frame.h"

static const struct hg_gpu_io resolve_io = HG_GPU_IO(HG_RESOLVE_IO);
struct resolve_inputs {
    HG_RESOLVE_IO(HG_GPU_IO_MEMBER)
};

#define LINEAR  0xffu // no tone curve, no encoding
#define COUNTED 1u    // bits of the second constant of resolve.frag
#define BLOCKS  2u

static const VkFormat formats[] = {
    VK_FORMAT_R8G8B8A8_UNORM, VK_FORMAT_R16G16B16A16_UNORM, VK_FORMAT_R32G32B32A32_SFLOAT};

// counted: COUNTED, BLOCKS.
static struct hg_gpu_pipeline_params pipeline_of(
    VkFormat format, uint32_t tonemap, uint32_t counted)
{
    return (struct hg_gpu_pipeline_params){
        .vertex = "fullscreen.vert",
        .fragment = "resolve.frag",
        .spec = {format == VK_FORMAT_R32G32B32A32_SFLOAT ? LINEAR : tonemap, counted},
        .spec_count = 2,
        .colors = {format},
        .color_count = 1,
        .topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST,
        .io = &resolve_io,
    };
}

enum hg_status hg_resolve_record(
    struct hg_pass *pass, const struct hg_resolve *resolve, struct hg_error *err)
{
    const struct resolve_inputs inputs = {
        .accumulated = {.image = resolve->accumulated}, .fallback = {.image = resolve->fallback}};
    const float *over = resolve->backdrop;
    const struct {
        uint64_t progress, blocks;
        float scale, exposure;
        uint32_t width, columns, samples;
        float backdrop[4];
    } push = {resolve->progress, resolve->blocks, 1.0f / (float)resolve->samples, resolve->exposure,
        resolve->target->width, resolve->block_columns, resolve->samples,
        {over ? over[0] : 0, over ? over[1] : 0, over ? over[2] : 0, over ? 1 : 0}};
    const struct hg_gpu_pipeline_params params =
        pipeline_of(resolve->target->format, resolve->tonemap,
            (resolve->progress != 0 ? COUNTED : 0) | (resolve->blocks != 0 ? BLOCKS : 0));
    const struct hg_fullscreen fullscreen = {.fragment = params.fragment,
        .target = resolve->target,
        .io = params.io,
        .inputs = &inputs,
        .inputs_bytes = sizeof inputs,
        .push = &push,
        .push_bytes = sizeof push,
        .spec = {params.spec[0], params.spec[1]},
        .spec_count = params.spec_count};
    return hg_pass_fullscreen(pass, &fullscreen, err);
}

enum hg_status hg_resolve_warm_up(
    struct hg_gpu *gpu, uint32_t index, uint32_t *count, struct hg_error *err)
{
    *count = 6;
    const struct hg_gpu_pipeline_params params =
        pipeline_of(formats[index % 3], HG_FRAME_TONEMAP_ACES, index % 6 >= 3 ? COUNTED : 0);
    VkPipeline pipeline;
    return hg_gpu_pipeline_get(gpu, &params, &pipeline, err);
}
