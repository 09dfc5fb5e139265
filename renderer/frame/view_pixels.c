// view_pixels.c - reading a view's pixels, and picking. See view.h.
#include "renderer/frame/view_pixels.h"

#include <string.h>

#include "renderer/frame/frame.h"
#include "renderer/frame/path_view.h"
#include "renderer/frame/view.h"
#include "renderer/passes/skin.h"
#include "shaders/shared/pick.h"

static const struct {
    VkFormat format;
    uint32_t bytes;
    const char *name;
} formats[3] = {{VK_FORMAT_R8G8B8A8_UNORM, 4, "pixels 8"},
    {VK_FORMAT_R16G16B16A16_UNORM, 8, "pixels 16"},
    {VK_FORMAT_R32G32B32A32_SFLOAT, 16, "pixels 32"}};

enum hg_status hg_view_make_pixels(const struct hg_draw *draw, struct hg_gpu_buffer *readback,
    uint32_t format, struct hg_error *err)
{
    struct hg_view_targets *t = draw->targets;
    const struct hg_view_settings *s = draw->request->settings;
    const uint64_t px = (uint64_t)s->width * s->height;
    const enum hg_status status = hg_draw_make_image(
        draw, formats[format].format, formats[format].name, &t->pixels[format], err);
    return status == HG_OK ? hg_gpu_buffer_reserve(draw->context->gpu, HG_GPU_BUFFER_READBACK,
                                 px * formats[format].bytes, "readback", readback, err)
                           : status;
}

void hg_view_record_copy(const struct hg_draw *draw, struct hg_gpu_cmd *cmd)
{
    struct hg_gpu_image *pixels = hg_draw_picture(draw);
    const struct hg_gpu_region all = {.width = pixels->width, .height = pixels->height};
    hg_gpu_image_read(cmd, pixels, &all, &draw->buffers->readback, 0);
}

// --- reading ------------------------------------------------------------------------------------

// Resolves the accumulation to `readback`.
static enum hg_status fetch_pixels(
    struct hg_view_state *view, uint32_t format, struct hg_error *err)
{
    const struct hg_draw_request request = {.settings = &view->settings, .camera = &view->camera};
    struct hg_draw draw = hg_view_draw(view, &request);
    struct hg_gpu_cmd *cmd;
    enum hg_status status = hg_view_make_pixels(&draw, &view->buffers.readback, format, err);
    if (status == HG_OK)
        status = hg_gpu_begin(view->context->gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    status = hg_frame_record_read(&draw, cmd, format, err);
    if (status != HG_OK) {
        hg_gpu_discard(view->context->gpu, cmd);
        return status;
    }
    return hg_gpu_submit_and_wait(view->context->gpu, cmd, err);
}

bool hg_view_state_has_pixels(const struct hg_view_state *view, uint32_t format)
{
    const struct hg_tiled_accumulation *a = &view->accumulation;
    if (view->settings.mode == HG_VIEW_MODE_PATH)
        return view->stats.number > 0;
    return (a->samples > 0 || a->has_fallback) && (a->phase != HG_VIEW_DIRECT || format == 0);
}

// The pixels of the region out of those of the whole picture.
static enum hg_status copy_region(const struct hg_view_state *view, uint32_t pixel_bytes,
    struct hg_refbuf **out, struct hg_error *err)
{
    const struct hg_picture_region r = hg_view_region(&view->settings);
    const uint8_t *from = view->buffers.readback.mapped;
    const size_t row_bytes = (size_t)r.width * pixel_bytes;
    *out = hg_refbuf_create(row_bytes * r.height);
    if (*out == NULL)
        return hg_error_set(err, HG_E_NOMEM, "pixels", NULL, "out of host memory");
    for (size_t y = 0; y < r.height; y++)
        memcpy((*out)->data + y * row_bytes,
            from + ((r.y + y) * view->targets.accumulated.width + r.x) * pixel_bytes, row_bytes);
    return HG_OK;
}

enum hg_status hg_view_state_read(
    struct hg_view_state *view, uint32_t format, struct hg_refbuf **out, struct hg_error *err)
{
    *out = NULL;
    if (!hg_view_state_has_pixels(view, 0))
        return hg_error_set(err, HG_E_STATE, "view", NULL, "nothing was rendered yet");
    if (!hg_view_state_has_pixels(view, format))
        return hg_error_set(err, HG_E_STATE, "view", "format",
            "the newest picture is one in motion, of which only 8-bit pixels were asked for");
    enum hg_status status = HG_OK;
    if (view->settings.mode == HG_VIEW_MODE_PATH)
        status = hg_path_view_show(view, err);
    if (status == HG_OK && view->accumulation.phase != HG_VIEW_DIRECT)
        status = fetch_pixels(view, format, err);
    if (status != HG_OK)
        return status;
    return copy_region(view, formats[format].bytes, out, err);
}

// --- picking ------------------------------------------------------------------------------------

static enum hg_status run_pick(
    struct hg_view_state *view, struct hg_draw *draw, VkRect2D pixel, struct hg_error *err)
{
    struct hg_gpu_cmd *cmd;
    enum hg_status status = hg_gpu_begin(view->context->gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    memset(view->buffers.pick.mapped, 0, sizeof(struct hg_gpu_pick));
    status = hg_frame_record_pick(draw, cmd, pixel, err);
    if (status != HG_OK) {
        hg_gpu_discard(view->context->gpu, cmd);
        return status;
    }
    return hg_gpu_submit_and_wait(view->context->gpu, cmd, err);
}

// Restores the scene's pose, if motion blur has changed it.
static enum hg_status unpose(struct hg_view_state *view, struct hg_error *err)
{
    if (view->scene_gpu->posed == NULL)
        return HG_OK;
    const enum hg_status status =
        hg_scene_gpu_sync(view->context, view->scene_gpu, view->camera.eye, 0, err);
    return status == HG_OK ? hg_skin_run(view->context->gpu, view->scene_gpu->geometry, err)
                           : status;
}

enum hg_status hg_view_state_pick(struct hg_view_state *view, uint32_t x, uint32_t y,
    struct hg_gpu_pick *out, struct hg_error *err)
{
    memset(out, 0, sizeof *out);
    if (!hg_view_state_has_pixels(view, 0))
        return hg_error_set(err, HG_E_STATE, "view", NULL, "nothing was rendered yet");
    if (x >= view->targets.visibility.width || y >= view->targets.visibility.height)
        return hg_error_set(err, HG_E_INVAL, "pick", "x, y", "outside the view");
    const VkRect2D pixel = {{(int32_t)x, (int32_t)y}, {1, 1}};
    const struct hg_draw_request request = {.settings = &view->settings,
        .camera = &view->camera,
        .flags = HG_DRAW_WAIT,
        .samples = view->settings.samples,
        .max_samples = 1,
        .error_px = view->accumulation.error_px}; // as the picture shows it
    struct hg_draw draw = hg_view_draw(view, &request);
    draw.culling = view->buffers.pick_culling;
    enum hg_status status = unpose(view, err);
    if (status == HG_OK)
        status = hg_frame_cull_part(&draw, pixel, err);
    if (status == HG_OK)
        status = run_pick(view, &draw, pixel, err);
    if (status != HG_OK)
        return status;
    memcpy(out, view->buffers.pick.mapped, sizeof *out);
    const float position[3] = {out->position_ws.x, out->position_ws.y, out->position_ws.z};
    out->triangle = hg_geometry_source_primitive(
        view->scene_gpu->geometry, out->draw_plus_one - 1, out->triangle, position);
    return HG_OK;
}
