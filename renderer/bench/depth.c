#include "renderer/bench/depth.h"

#include <math.h>

#include "base/alloc.h"
#include "renderer/internal.h"

#define REACH_PX 2
#define FAR      0.02f // of the distance

static enum hg_status copy(struct hg_gpu *gpu, struct hg_gpu_image *image,
    const struct hg_gpu_buffer *to, struct hg_error *err)
{
    const struct hg_gpu_region all = {.width = image->width, .height = image->height};
    struct hg_gpu_cmd *cmd;
    enum hg_status status = hg_gpu_begin(gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    hg_gpu_image_read(cmd, image, &all, to, 0);
    hg_gpu_memory_barrier(cmd);
    return hg_gpu_submit_and_wait(gpu, cmd, err);
}

enum hg_status hg_bench_depth_read(
    struct hg_view *view, struct hg_bench_depth *out, struct hg_error *err)
{
    struct hg_view_state *state = &view->state;
    struct hg_gpu *gpu = state->context->gpu;
    struct hg_gpu_image *image = &state->targets.depth;
    struct hg_gpu_buffer back = {0};
    const size_t count = (size_t)image->width * image->height;
    const float *proj = state->frame.camera.proj.m;
    *out = (struct hg_bench_depth){.width = image->width,
        .height = image->height,
        .px_per_radian = 0.5f * (float)image->height * fabsf(proj[5])};
    out->metres = hg_calloc(count, sizeof *out->metres);
    if (out->metres == NULL)
        return hg_error_set(err, HG_E_NOMEM, "bench", NULL, "no memory for depth");
    enum hg_status status = hg_gpu_buffer_create(
        gpu, HG_GPU_BUFFER_READBACK, count * sizeof(float), "depth", &back, err);
    if (status == HG_OK)
        status = copy(gpu, image, &back, err);
    // depth = (m10 z + m14) / -z at -z metres; reversed, so that 0 is infinitely far.
    const float *depth = back.mapped;
    for (size_t i = 0; status == HG_OK && i < count; i++)
        out->metres[i] = depth[i] > 0.0f ? proj[14] / (depth[i] + proj[10]) : INFINITY;
    hg_gpu_buffer_destroy(gpu, &back);
    if (status != HG_OK)
        hg_bench_depth_finish(out);
    return status;
}

void hg_bench_depth_finish(struct hg_bench_depth *depth)
{
    hg_free(depth->metres);
    *depth = (struct hg_bench_depth){0};
}

// How far what a has at (x, y) is from all that b has within REACH_PX, less the slack; metres,
// INFINITY where b has nothing, 0 where it has the like.
static float miss_at(const struct hg_bench_depth *a, const struct hg_bench_depth *b, uint32_t x,
    uint32_t y, float slack)
{
    const float at = a->metres[(size_t)y * a->width + x];
    float low = INFINITY, high = -INFINITY;
    for (uint32_t j = y - REACH_PX; j <= y + REACH_PX; j++) {
        for (uint32_t i = x - REACH_PX; i <= x + REACH_PX; i++) {
            low = fminf(low, b->metres[(size_t)j * b->width + i]);
            high = fmaxf(high, b->metres[(size_t)j * b->width + i]);
        }
    }
    if (isinf(at))
        return isinf(high) ? 0.0f : INFINITY;
    return fmaxf(fmaxf(low - at, at - high) - slack, 0.0f);
}

struct hg_bench_depth_gap hg_bench_depth_compare(
    const struct hg_bench_depth *a, const struct hg_bench_depth *b, float error_px)
{
    struct hg_bench_depth_gap gap = {0};
    for (uint32_t y = REACH_PX; y + REACH_PX < a->height; y++) {
        for (uint32_t x = REACH_PX; x + REACH_PX < a->width; x++) {
            const size_t i = (size_t)y * a->width + x;
            const float near = fminf(a->metres[i], b->metres[i]);
            if (isinf(near))
                continue;
            const float slack = near * error_px / a->px_per_radian;
            const float miss = fmaxf(miss_at(a, b, x, y, slack), miss_at(b, a, x, y, slack));
            gap.shown_px++;
            gap.off_px += miss > 0.0f;
            gap.far_px += miss > near * FAR;
        }
    }
    return gap;
}
