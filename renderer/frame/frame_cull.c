// frame_cull.c - what the camera and the shadow maps of a batch see. See frame.h.
#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "renderer/math/frustum.h"
#include "renderer/frame/frame.h"

#define MARGIN_PX 2.0f // jitter and rounding

// Clip space of a part of the image, a few pixels wider so that it holds every jittered sample.
static void narrow(const struct hg_view_state *view, VkRect2D part, float m[16])
{
    const float px[2] = {(float)view->settings.width, (float)view->settings.height};
    const float first[2] = {(float)part.offset.x - MARGIN_PX, (float)part.offset.y - MARGIN_PX};
    const float size[2] = {
        (float)part.extent.width + 2.0f * MARGIN_PX, (float)part.extent.height + 2.0f * MARGIN_PX};
    for (int r = 0; r < 2; r++) {
        const float centre = (2.0f * first[r] + size[r]) / px[r] - 1.0f;
        for (int c = 0; c < 4; c++)
            m[c * 4 + r] = (m[c * 4 + r] - centre * m[c * 4 + 3]) * (px[r] / size[r]);
    }
}

static bool is_exact(const struct hg_view_state *view)
{
    return view->stream.exact && view->settings.debug == 0;
}

// What does not fit the budget is drawn in parts, not coarser.
static bool is_whole(const struct hg_view_state *view)
{
    return is_exact(view) && !view->stream.forced && !view->stream.finding;
}

// What the camera sees of `part`.
static struct hg_culling_view camera_view(const struct hg_view_state *view, VkRect2D part)
{
    // Not the newest sample's: that may have been of a smaller picture, for which less would do.
    struct hg_gpu_camera camera;
    const struct hg_camera_setup setup = hg_frame_setup(view);
    hg_camera_fill(&setup, &camera);
    const bool off = view->context->overrides.no_culling;
    struct hg_culling_view look = {.eye = {camera.eye_ws.x, camera.eye_ws.y, camera.eye_ws.z},
        .forward = {camera.forward_ws.x, camera.forward_ws.y, camera.forward_ws.z},
        .orthographic = camera.orthographic != 0,
        .error_px = view->error_px,
        .near = fmaxf(camera.near, 1e-6f),
        .wait = view->wait || is_exact(view),
        .whole = is_whole(view),
        .both_sides = off,
        .numbered = true,
        .history = !off && view->settings.debug == 0 && view->stream.finding == 0};
    look.px_scale = 1.0f / (look.orthographic ? camera.pixel_size : camera.pixel_angle);
    float m[16];
    memcpy(m, camera.view_proj.m, sizeof m);
    narrow(view, part, m);
    if (!off)
        look.plane_count = hg_frustum_planes(m, look.planes);
    return look;
}

struct hg_culling_lens hg_frame_lens(const struct hg_gpu_camera *camera, VkExtent2D size)
{
    struct hg_culling_lens lens = {.width = size.width, .height = size.height};
    memcpy(lens.view_proj, camera->view_proj.m, sizeof lens.view_proj);
    memcpy(lens.clip, camera->proj.m + 12, sizeof lens.clip);
    return lens;
}

// Where the samples of the next batch lie. One sample is known to lie there, several only nearly.
static struct hg_culling_lens lens_of(const struct hg_view_state *view, uint32_t samples)
{
    struct hg_gpu_camera camera;
    struct hg_camera_setup setup = hg_frame_setup(view);
    const bool known = samples == 1 && view->settings.debug == 0;
    if (known)
        hg_camera_jitter(hg_view_first_sample(view), view->settings.seed, setup.jitter_px);
    hg_camera_fill(&setup, &camera);
    struct hg_culling_lens lens = hg_frame_lens(&camera, hg_frame_size(view));
    lens.shift_px = known || view->settings.debug != 0 ? 0.0f : MARGIN_PX;
    return lens;
}

static VkRect2D area_of(const struct hg_view_state *view)
{
    const struct hg_tiled_accumulation_area *area = hg_view_area(view);
    return area != NULL ? area->rect
                        : (VkRect2D){{0, 0}, {view->settings.width, view->settings.height}};
}

static enum hg_status select_sets(
    struct hg_view_state *view, enum hg_frame_part part, uint32_t samples, struct hg_error *err)
{
    const struct hg_tiled_accumulation *s = &view->stream;
    struct hg_jobs *jobs = view->context->jobs;
    struct hg_culling_view look = camera_view(view, area_of(view));
    const struct hg_culling_lens lens = lens_of(view, samples);
    const bool is_cpu = hg_gpu_get_caps(view->context->gpu)->is_cpu;
    if (is_cpu && !view->context->overrides.no_culling)
        look.lens = &lens;
    struct hg_gpu_camera camera;
    const struct hg_camera_setup setup = hg_frame_setup(view);
    hg_camera_fill(&setup, &camera);
    const struct hg_culling_lens host = hg_frame_lens(&camera, hg_frame_size(view));
    if (is_cpu && !view->context->overrides.no_cpu_raster && view->settings.debug == 0)
        look.host = &host;
    struct hg_shadow_choice choice = {
        .coarse = view->coarse, .wait = look.wait, .whole = look.whole};
    enum hg_status status = HG_OK;
    if (part == HG_FRAME_PICTURE)
        status = hg_culling_add(view->visible, view->scene_gpu->geometry, &look, jobs, err);
    else if (s->shadow_count > 0) {
        const struct hg_tiled_accumulation_area *top = &s->shadow_areas[s->shadow_count - 1];
        choice.area = top->rect;
        choice.share = top->share;
        choice.shares = s->forced ? 0 : top->shares; // a coarser cut is another, and drawn whole
    }
    return status == HG_OK && view->settings.debug == 0
               ? hg_shadow_select(
                     view->scene_gpu->geometry, view->lighting, &choice, jobs, view->visible, err)
               : status;
}

static void note_sets(struct hg_view_state *view, enum hg_frame_part part)
{
    view->missing_clusters = 0;
    view->crowded = false;
    for (uint32_t i = 0; i < hg_culling_count(view->visible); i++) {
        const struct hg_culling_set *set = hg_culling_set(view->visible, i);
        view->missing_clusters += set->missing;
        view->crowded |= set->crowded;
    }
    if (part == HG_FRAME_SHADOWS) { // those that are coarser than a texel make the picture so
        for (uint32_t i = 0; i < hg_culling_count(view->visible); i++) {
            const float texels = hg_culling_set(view->visible, i)->error_px;
            float *most_px = &view->stream.shadow_error_px;
            *most_px = texels > 1.0f ? fmaxf(*most_px, view->error_px * texels) : *most_px;
        }
        return;
    }
    const float error_px = hg_culling_set(view->visible, 0)->error_px;
    view->shown_error_px = view->stream.exact ? fmaxf(view->shown_error_px, error_px) : error_px;
}

enum hg_status hg_frame_cull(
    struct hg_view_state *view, enum hg_frame_part part, uint32_t samples, struct hg_error *err)
{
    const uint64_t start = hg_clock_now_ns();
    hg_culling_reset(view->visible);
    enum hg_status status = select_sets(view, part, samples, err);
    if (status == HG_OK)
        note_sets(view, part);
    if (status == HG_OK && !(view->crowded && is_whole(view)))
        status = hg_culling_upload(view->visible, view->context->jobs, err);
    hg_view_add_stage(view, "cull", hg_clock_now_ns() - start);
    return status;
}

enum hg_status hg_frame_cull_part(
    struct hg_view_state *view, VkRect2D part, struct hg_culling *visible, struct hg_error *err)
{
    struct hg_culling_view look = camera_view(view, part);
    look.error_px = view->shown_error_px; // as the picture shows it
    look.wait = look.whole = true;
    look.history = false;
    hg_culling_reset(visible);
    struct hg_jobs *jobs = view->context->jobs;
    enum hg_status status = hg_culling_add(visible, view->scene_gpu->geometry, &look, jobs, err);
    if (status == HG_OK && hg_culling_set(visible, 0)->crowded) { // then as fine as can be
        look.whole = false;
        hg_culling_reset(visible);
        status = hg_culling_add(visible, view->scene_gpu->geometry, &look, jobs, err);
    }
    return status == HG_OK ? hg_culling_upload(visible, jobs, err) : status;
}

enum hg_status hg_frame_cull_prefetch(struct hg_view_state *view, struct hg_error *err)
{
    const VkRect2D all = {{0, 0}, {view->settings.width, view->settings.height}};
    const struct hg_culling_view look = camera_view(view, all);
    struct hg_jobs *jobs = view->context->jobs;
    hg_culling_reset(view->visible);
    const enum hg_status status =
        hg_culling_add(view->visible, view->scene_gpu->geometry, &look, jobs, err);
    return status == HG_OK ? hg_culling_upload(view->visible, jobs, err) : status;
}
