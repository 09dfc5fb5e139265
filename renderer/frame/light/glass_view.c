// glass_view.c - see glass_view.h.
#include "renderer/frame/light/glass_view.h"

#include "base/alloc.h"
#include "base/clock.h"
#include "base/log.h"
#include "renderer/frame/batch/recording.h"
#include "renderer/frame/light/mirror_view.h"
#include "renderer/frame/light/reflect_view.h"
#include "renderer/frame/state.h"
#include "renderer/passes/shade.h"

#define COLOR_BYTES 16u // of HG_COLOR_FORMAT, and of a texel
#define RAYS_FORMAT VK_FORMAT_R32G32B32A32_UINT

void hg_glass_view_finish(struct hg_gpu *gpu, struct hg_glass_view *v)
{
    hg_glass_destroy(v->glass);
    hg_gpu_image_destroy(gpu, &v->rays);
    hg_gpu_buffer_destroy(gpu, &v->back);
    hg_free(v->words);
    *v = (struct hg_glass_view){0};
}

static enum hg_status go_without(
    struct hg_glass_view *v, enum hg_status status, struct hg_error *err)
{
    v->is_on = false;
    if (status != HG_E_LIMIT && status != HG_E_NOMEM)
        return status;
    hg_debug(FRAME, "no rays through glass: %s: %s", err->what, err->reason);
    *err = (struct hg_error){0};
    return HG_OK;
}

static VkExtent2D texels_of(const struct hg_draw *draw)
{
    const VkExtent2D size = hg_draw_size(draw->request);
    const uint32_t step = hg_mirror_view_step(size);
    return (VkExtent2D){(size.width + step - 1) / step, (size.height + step - 1) / step};
}

enum hg_status hg_batch_reserve_glass(struct hg_draw *draw, struct hg_error *err)
{
    struct hg_glass_view *v = draw->clear_glass;
    struct hg_gpu *gpu = draw->context->gpu;
    const VkExtent2D size = hg_draw_size(draw->request), texels = texels_of(draw);
    const uint64_t count = (uint64_t)texels.width * texels.height;
    v->is_on = hg_frame_transmits(draw) && hg_reflect_view_is_on(draw) &&
               !draw->request->camera->orthographic;
    if (!v->is_on)
        return HG_OK;
    enum hg_status status = hg_gpu_buffer_reserve(gpu, HG_GPU_BUFFER_READBACK,
        (uint64_t)size.width * size.height * COLOR_BYTES, "scene behind glass", &v->back, err);
    if (status == HG_OK && (v->rays.width != texels.width || v->rays.height != texels.height)) {
        const struct hg_gpu_image_params params = {.format = RAYS_FORMAT,
            .width = texels.width,
            .height = texels.height,
            .name = "glass rays"};
        hg_gpu_image_destroy(gpu, &v->rays);
        hg_free(v->words);
        v->words = hg_calloc(count, COLOR_BYTES);
        status = v->words ? hg_gpu_image_create(gpu, &params, &v->rays, err)
                          : hg_error_set(err, HG_E_NOMEM, "glass", NULL, "out of host memory");
    }
    if (status == HG_OK && !v->glass)
        status = hg_glass_create(gpu, draw->context->jobs, &v->glass, err);
    return status == HG_OK ? HG_OK : go_without(v, status, err);
}

static enum hg_status send_rays(struct hg_draw *draw, struct hg_error *err)
{
    struct hg_glass_view *v = draw->clear_glass;
    const VkExtent2D size = hg_draw_size(draw->request);
    const struct hg_gpu_region all = {.width = v->rays.width, .height = v->rays.height};
    const struct hg_glass_picture picture = {.camera = &draw->frame->camera,
        .width = size.width,
        .height = size.height,
        .columns = v->rays.width,
        .rows = v->rays.height,
        .behind = v->back.mapped,
        .shows_sky = draw->frame->background_mode == HG_BACKGROUND_MODE_ENV,
        .sources = &draw->reflections->sources,
        .world = draw->reflections->world};
    enum hg_status status = hg_glass_run(v->glass, &picture, v->words, err);
    if (status == HG_E_NOMEM) // texels that are 0 show nothing
        status = go_without(v, status, err);
    return status == HG_OK
               ? hg_gpu_image_upload(draw->context->gpu, &v->rays, &all, v->words, 0, err)
               : status;
}

static enum hg_status record(const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    struct hg_batch *f = hg_batch_of(run);
    struct hg_draw *draw = f->draw;
    const VkExtent2D size = hg_draw_size(draw->request);
    const struct hg_gpu_region all = {.width = size.width, .height = size.height};
    (void)user;
    hg_gpu_image_read(
        run->cmd, hg_graph_run_image(run, f->behind), &all, &draw->clear_glass->back, 0);
    enum hg_status status = hg_gpu_pause(run->gpu, run->cmd, err);
    if (status != HG_OK)
        return status;
    hg_view_stats_add_device(draw->stats, run->gpu);
    const uint64_t begin = hg_clock_now_ns();
    status = send_rays(draw, err);
    hg_view_stats_add_stage(draw->stats, "glass", hg_clock_now_ns() - begin);
    return status == HG_OK ? hg_gpu_resume(run->gpu, run->cmd, err) : status;
}

void hg_batch_declare_glass(struct hg_batch *f)
{
    if (!f->draw->clear_glass->is_on)
        return;
    f->blend.rays = hg_graph_import(f->graph, "glass rays", &f->draw->clear_glass->rays);
    hg_batch_add(f,
        &(struct hg_graph_pass){.name = "glass",
            .record = record,
            .accesses = {{f->behind, HG_GRAPH_COPY_FROM, 0}, {f->blend.rays, HG_GRAPH_COPY_TO, 0}},
            .untimed = true});
}
