// view_pixels.c - reading a view's pixels, and picking. See view.h.
#include "renderer/frame/view_pixels.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/frame/look/caps.h"
#include "renderer/frame/look/overlay.h"
#include "renderer/frame/paths/path_view.h"
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

enum hg_status hg_view_make_pixels(const struct hg_draw *draw, struct hg_gpu_readback *readback,
    uint32_t format, struct hg_error *err)
{
    struct hg_view_targets *t = draw->targets;
    const struct hg_view_settings *s = draw->request->settings;
    const uint64_t px = (uint64_t)s->width * s->height;
    const enum hg_status status = hg_draw_make_image(
        draw, formats[format].format, formats[format].name, &t->pixels[format], err);
    hg_gpu_lent_sweep(draw->context->gpu, &draw->context->lent, false);
    return status == HG_OK ? hg_gpu_readback_reserve(draw->context->gpu, readback,
                                 px * formats[format].bytes, "readback", err)
                           : status;
}

void hg_view_record_copy(const struct hg_draw *draw, struct hg_gpu_cmd *cmd)
{
    struct hg_gpu_image *pixels = hg_draw_picture(draw);
    const struct hg_gpu_region all = {.width = pixels->width, .height = pixels->height};
    hg_gpu_image_read(cmd, pixels, &all, &draw->buffers->readback.buffer, 0);
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

static bool is_lent_whole(const struct hg_view_state *view)
{
    const struct hg_picture_region r = hg_view_region(&view->settings);
    const struct hg_gpu_image *whole = &view->targets.accumulated;
    return r.width == whole->width && r.height == whole->height && !hg_overlay_is_wanted(view);
}

// The pixels of the region out of those of the whole picture: lent, or a copy.
static enum hg_status take_region(struct hg_view_state *view, uint32_t pixel_bytes, bool lends,
    struct hg_refbuf **out, struct hg_error *err)
{
    const struct hg_picture_region r = hg_view_region(&view->settings);
    const uint8_t *from = view->buffers.readback.buffer.mapped;
    const size_t row_bytes = (size_t)r.width * pixel_bytes;
    *out = lends ? hg_gpu_readback_lend(&view->buffers.readback, row_bytes * r.height)
                 : hg_refbuf_create(row_bytes * r.height);
    if (*out == NULL)
        return hg_error_set(err, HG_E_NOMEM, "pixels", NULL, "out of host memory");
    for (size_t y = 0; y < r.height && !lends; y++)
        memcpy((*out)->data + y * row_bytes,
            from + ((r.y + y) * view->targets.accumulated.width + r.x) * pixel_bytes, row_bytes);
    return HG_OK;
}

enum hg_status hg_view_state_read(struct hg_view_state *view, uint32_t format, bool lends,
    struct hg_refbuf **out, struct hg_error *err)
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
    status = take_region(view, formats[format].bytes, lends && is_lent_whole(view), out, err);
    if (status == HG_OK && hg_overlay_is_wanted(view))
        status = hg_overlay_apply(view, format, (*out)->data, err);
    if (status != HG_OK) {
        hg_refbuf_unref(*out);
        *out = NULL;
    }
    return status;
}

// --- picking ------------------------------------------------------------------------------------

static enum hg_status run_pick(
    struct hg_view_state *view, struct hg_draw *draw, VkRect2D pixels, struct hg_error *err)
{
    struct hg_gpu_buffer *to = &view->buffers.pick;
    const uint64_t bytes =
        (uint64_t)pixels.extent.width * pixels.extent.height * sizeof(struct hg_gpu_pick);
    struct hg_gpu_cmd *cmd;
    enum hg_status status =
        hg_gpu_buffer_reserve(view->context->gpu, HG_GPU_BUFFER_READBACK, bytes, "pick", to, err);
    if (status == HG_OK)
        status = hg_gpu_begin(view->context->gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    memset(to->mapped, 0, bytes);
    status = hg_frame_record_pick(draw, cmd, pixels, err);
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

// What pixels show, to buffers.pick. In the state of the newest step, without jitter.
static enum hg_status look_behind_caps(
    struct hg_view_state *view, struct hg_draw *draw, VkRect2D pixels, struct hg_error *err)
{
    enum hg_status status = unpose(view, err);
    if (status == HG_OK && view->settings.look != NULL)
        status = hg_look_sync(view->settings.look, view->scene_gpu, err);
    if (status == HG_OK)
        status = hg_frame_cull_part(draw, pixels, err);
    return status == HG_OK ? run_pick(view, draw, pixels, err) : status;
}

static void put_cap(
    const struct hg_draw *draw, const struct hg_cap *cap, VkOffset2D at, struct hg_gpu_pick *out)
{
    float position[3], normal[3], away = 0.0f;
    const struct hg_gpu_camera *camera = &draw->frame->camera;
    hg_caps_place(draw, cap, (uint32_t)at.x, (uint32_t)at.y, position, normal);
    const float eye[3] = {camera->eye_ws.x, camera->eye_ws.y, camera->eye_ws.z};
    for (int i = 0; i < 3; i++)
        away += (position[i] - eye[i]) * (position[i] - eye[i]);
    *out = (struct hg_gpu_pick){.position_ws = {position[0], position[1], position[2]},
        .normal_ws = {normal[0], normal[1], normal[2]},
        .distance = camera->orthographic != 0 ? cap->depth : sqrtf(away),
        .depth = cap->depth,
        .draw_plus_one = cap->draw_plus_one};
}

// Caps in front of what was found. `out`: [pixels], holds that.
static enum hg_status put_caps(
    struct hg_draw *draw, VkRect2D pixels, struct hg_gpu_pick *out, struct hg_error *err)
{
    const struct hg_look *look = draw->request->settings->look;
    const uint32_t area = pixels.extent.width * pixels.extent.height;
    if (!hg_look_clips(look) || look->clip.caps == HG_CAPS_NONE)
        return HG_OK;
    struct hg_cap *caps = hg_calloc(area, sizeof *caps);
    if (caps == NULL)
        return hg_error_set(err, HG_E_NOMEM, "caps", NULL, "no memory");
    const enum hg_status status = hg_caps_find(draw, pixels, caps, err);
    for (uint32_t i = 0; i < area && status == HG_OK; i++) {
        const VkOffset2D at = {pixels.offset.x + (int32_t)(i % pixels.extent.width),
            pixels.offset.y + (int32_t)(i / pixels.extent.width)};
        if (caps[i].draw_plus_one != 0)
            put_cap(draw, &caps[i], at, &out[i]);
    }
    hg_free(caps);
    return status;
}

static struct hg_draw_request request_of(const struct hg_view_state *view)
{
    return (struct hg_draw_request){.settings = &view->settings,
        .camera = &view->camera,
        .flags = HG_DRAW_WAIT,
        .samples = view->settings.samples,
        .max_samples = 1,
        .error_px = view->accumulation.error_px}; // as the picture shows it
}

// What pixels of the drawn size show, into out[pixels].
static enum hg_status look_through(struct hg_view_state *view, struct hg_draw *draw,
    VkRect2D pixels, struct hg_gpu_pick *out, struct hg_error *err)
{
    draw->culling = view->buffers.pick_culling;
    const enum hg_status status = look_behind_caps(view, draw, pixels, err);
    if (status != HG_OK)
        return status;
    memcpy(out, view->buffers.pick.mapped,
        (size_t)pixels.extent.width * pixels.extent.height * sizeof *out);
    return put_caps(draw, pixels, out, err);
}

// Into out[pixels].
static enum hg_status look_at(struct hg_view_state *view, VkRect2D pixels, const char *what,
    struct hg_gpu_pick *out, struct hg_error *err)
{
    const struct hg_gpu_image *seen = &view->targets.visibility;
    if (!hg_view_state_has_pixels(view, 0))
        return hg_error_set(err, HG_E_STATE, "view", NULL, "nothing was rendered yet");
    if ((uint64_t)pixels.offset.x + pixels.extent.width > seen->width ||
        (uint64_t)pixels.offset.y + pixels.extent.height > seen->height)
        return hg_error_set(err, HG_E_INVAL, what, "x, y", "outside the view");
    const struct hg_draw_request request = request_of(view);
    struct hg_draw draw = hg_view_draw(view, &request);
    return look_through(view, &draw, pixels, out, err);
}

enum hg_status hg_view_state_pick(struct hg_view_state *view, uint32_t x, uint32_t y,
    struct hg_gpu_pick *out, struct hg_error *err)
{
    memset(out, 0, sizeof *out);
    const VkRect2D pixel = {{(int32_t)x, (int32_t)y}, {1, 1}};
    const enum hg_status status = look_at(view, pixel, "pick", out, err);
    if (status != HG_OK || out->draw_plus_one == 0)
        return status;
    const float position[3] = {out->position_ws.x, out->position_ws.y, out->position_ws.z};
    out->triangle = hg_geometry_source_primitive(
        view->scene_gpu->geometry, out->draw_plus_one - 1, out->triangle, position);
    return HG_OK;
}

#define PART_PX (1u << 18) // that are looked at at once

struct looking {
    struct hg_view_state *view;
    struct hg_draw *draw; // of a grid; NULL: at the pixels of the picture
    void (*row)(void *user, uint32_t y, const struct hg_gpu_pick *pixels);
    void *user;
};

// Row by row, in parts.
static enum hg_status look_at_rows(const struct looking *l, VkRect2D pixels, struct hg_error *err)
{
    const uint32_t width = pixels.extent.width, most = PART_PX / width > 0 ? PART_PX / width : 1;
    struct hg_gpu_pick *found = hg_calloc((size_t)width * most, sizeof *found);
    enum hg_status status =
        found != NULL ? HG_OK : hg_error_set(err, HG_E_NOMEM, "surfaces", NULL, "no memory");
    for (uint32_t y = 0; y < pixels.extent.height && status == HG_OK; y += most) {
        const uint32_t left = pixels.extent.height - y, rows = left < most ? left : most;
        const VkRect2D part = {{pixels.offset.x, pixels.offset.y + (int32_t)y}, {width, rows}};
        status = l->draw != NULL ? look_through(l->view, l->draw, part, found, err)
                                 : look_at(l->view, part, "surfaces", found, err);
        for (uint32_t i = 0; i < rows && status == HG_OK; i++)
            l->row(l->user, y + i, found + (size_t)i * width);
    }
    hg_free(found);
    return status;
}

enum hg_status hg_view_state_surfaces(struct hg_view_state *view, VkRect2D pixels,
    void (*row)(void *user, uint32_t y, const struct hg_gpu_pick *pixels), void *user,
    struct hg_error *err)
{
    const struct looking l = {.view = view, .row = row, .user = user};
    return look_at_rows(&l, pixels, err);
}

// --- a grid over the picture ---------------------------------------------------------------------

static void destroy_grid(struct hg_view_state *view)
{
    hg_gpu_image_destroy(view->context->gpu, &view->buffers.grid.visibility);
    hg_gpu_image_destroy(view->context->gpu, &view->buffers.grid.depth);
}

void hg_view_forget_grid(struct hg_view_state *view)
{
    destroy_grid(view);
    hg_graph_destroy(view->buffers.grid.graph);
    view->buffers.grid.graph = NULL;
}

static enum hg_status make_grid(
    struct hg_view_state *view, struct hg_draw *draw, struct hg_error *err)
{
    struct hg_view_targets *t = &view->buffers.grid;
    const VkExtent2D size = hg_draw_size(draw->request);
    draw->targets = t;
    draw->gathered = draw->glass = NULL; // per pixel of the whole size
    draw->blocks = NULL;
    if (t->depth.width != size.width || t->depth.height != size.height)
        destroy_grid(view);
    const enum hg_status status =
        hg_draw_make_image(draw, HG_VISIBILITY_FORMAT, "grid visibility", &t->visibility, err);
    return status == HG_OK ? hg_draw_make_image(draw, HG_DEPTH_FORMAT, "grid depth", &t->depth, err)
                           : status;
}

// A picture of as many pixels as there are cells has its samples in their centres.
enum hg_status hg_view_state_grid(struct hg_view_state *view, VkExtent2D cells,
    void (*row)(void *user, uint32_t y, const struct hg_gpu_pick *cells), void *user,
    struct hg_error *err)
{
    const struct hg_view_settings *s = &view->settings;
    if (!hg_view_state_has_pixels(view, 0))
        return hg_error_set(err, HG_E_STATE, "view", NULL, "nothing was rendered yet");
    if (cells.width == 0 || cells.height == 0 || cells.width > s->width || cells.height > s->height)
        return hg_error_set(err, HG_E_INVAL, "grid", "cells", "%u x %u of a picture of %u x %u px",
            cells.width, cells.height, s->width, s->height);
    struct hg_draw_request request = request_of(view);
    request.drawn = cells;
    struct hg_draw draw = hg_view_draw(view, &request);
    const enum hg_status status = make_grid(view, &draw, err);
    const struct looking l = {.view = view, .draw = &draw, .row = row, .user = user};
    return status == HG_OK ? look_at_rows(&l, (VkRect2D){{0, 0}, cells}, err) : status;
}
