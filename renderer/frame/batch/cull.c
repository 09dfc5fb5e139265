// cull.c - culling for the camera and the shadow maps of a batch. See batch.h.
#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "renderer/math/frustum.h"
#include "renderer/frame/batch/batch.h"
#include "shaders/shared/debug.h"
#include "shaders/shared/features.h"

#define MARGIN_PX 2.0f // jitter and rounding

// Clip space of a part of an image of that size, a few pixels wider so that it holds every jittered
// sample.
static void narrow(VkExtent2D size_px, VkRect2D part, float m[16])
{
    const float px[2] = {(float)size_px.width, (float)size_px.height};
    const float first[2] = {(float)part.offset.x - MARGIN_PX, (float)part.offset.y - MARGIN_PX};
    const float size[2] = {
        (float)part.extent.width + 2.0f * MARGIN_PX, (float)part.extent.height + 2.0f * MARGIN_PX};
    for (int r = 0; r < 2; r++) {
        const float centre = (2.0f * first[r] + size[r]) / px[r] - 1.0f;
        for (int c = 0; c < 4; c++)
            m[c * 4 + r] = (m[c * 4 + r] - centre * m[c * 4 + 3]) * (px[r] / size[r]);
    }
}

static bool is_exact(const struct hg_draw *draw)
{
    return hg_draw_is(draw, HG_DRAW_EXACT) && draw->request->settings->debug == 0;
}

// Geometry that exceeds the budget is drawn in parts, not coarser.
static bool is_whole(const struct hg_draw *draw)
{
    return is_exact(draw) && !draw->accumulation->forced && !draw->request->smaller;
}

static VkExtent2D whole_of(const struct hg_draw *draw)
{
    const struct hg_view_settings *s = draw->request->settings;
    return (VkExtent2D){s->width, s->height};
}

// Culls `part` of a picture of that size for the camera.
static struct hg_culling_view camera_view(
    const struct hg_draw *draw, VkExtent2D size, VkRect2D part)
{
    // Not the newest sample's: that may have been smaller, with a coarser LOD cut.
    struct hg_gpu_camera camera;
    const struct hg_camera_setup setup = hg_frame_setup(draw);
    hg_camera_fill(&setup, &camera);
    const bool off = draw->context->overrides.no_culling;
    struct hg_culling_view look = {.eye = {camera.eye_ws.x, camera.eye_ws.y, camera.eye_ws.z},
        .forward = {camera.forward_ws.x, camera.forward_ws.y, camera.forward_ws.z},
        .orthographic = camera.orthographic != 0,
        .error_px = draw->request->error_px,
        .near = fmaxf(camera.near, 1e-6f),
        .wait = hg_draw_is(draw, HG_DRAW_WAIT) || is_exact(draw),
        .whole = is_whole(draw),
        .both_sides = off,
        .numbered = true,
        .shown = hg_look_draws(draw->request->settings->look),
        .history = !off && draw->request->settings->debug == 0 && draw->request->smaller == 0};
    look.px_scale = 1.0f / (look.orthographic ? camera.pixel_size : camera.pixel_angle);
    look.px_scale /= hg_frame_scale(draw); // errors are px of the picture that is seen
    float m[16];
    memcpy(m, camera.view_proj.m, sizeof m);
    narrow(size, part, m);
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

// Of a picture without jitter.
static struct hg_culling_lens centres_of(const struct hg_draw *draw)
{
    struct hg_gpu_camera camera;
    const struct hg_camera_setup setup = hg_frame_setup(draw);
    hg_camera_fill(&setup, &camera);
    return hg_frame_lens(&camera, hg_frame_size(draw));
}

// Sample positions of the next batch: exact for one sample, a range for several.
static struct hg_culling_lens lens_of(const struct hg_draw *draw, uint32_t samples)
{
    struct hg_gpu_camera camera;
    struct hg_camera_setup setup = hg_frame_setup(draw);
    const bool known = samples == 1 && draw->request->settings->debug == 0;
    if (known)
        hg_camera_jitter(
            hg_draw_first_sample(draw), draw->request->settings->seed, setup.jitter_px);
    if (draw->request->moment > 0)
        memcpy(setup.jitter_px, draw->request->jitter_px, sizeof setup.jitter_px);
    hg_camera_fill(&setup, &camera);
    struct hg_culling_lens lens = hg_frame_lens(&camera, hg_frame_size(draw));
    lens.shift_px = known || draw->request->settings->debug != 0 ? 0.0f : MARGIN_PX;
    return lens;
}

static VkRect2D area_of(const struct hg_draw *draw)
{
    const struct hg_tiled_area *area = hg_draw_area(draw);
    return area != NULL ? area->rect : (VkRect2D){{0, 0}, whole_of(draw)};
}

// Rays have told which lights each opaque surface sees, and there are no others that maps are for.
static bool needs_shadow_maps(const struct hg_draw *draw)
{
    return draw->blocks == NULL || draw->request->settings->ground != 0 ||
           (draw->scene_gpu->features & HG_FEATURE_DIFFUSE_TRANSMISSION) != 0;
}

static enum hg_status select_sets(
    struct hg_draw *draw, enum hg_frame_part part, uint32_t samples, struct hg_error *err)
{
    const struct hg_tiled_accumulation *s = draw->accumulation;
    struct hg_jobs *jobs = draw->context->jobs;
    struct hg_culling_view look = camera_view(draw, whole_of(draw), area_of(draw));
    const struct hg_culling_lens lens = lens_of(draw, samples);
    const struct hg_device_strategy *strategy = hg_gpu_strategy(draw->context->gpu);
    if (strategy->host_triangle_cull)
        look.lens = &lens;
    const struct hg_culling_lens host = centres_of(draw);
    if (strategy->host_raster && draw->request->settings->debug == 0 &&
        !hg_look_clips(draw->request->settings->look))
        look.host = &host;
    // A settled picture shows triangles at the border of the image as the device cuts them.
    look.host_parts = hg_draw_is(draw, HG_DRAW_MOTION);
    struct hg_shadow_choice choice = {
        .coarse = hg_draw_is(draw, HG_DRAW_COARSE_SHADOWS), .wait = look.wait, .whole = look.whole};
    enum hg_status status = HG_OK;
    if (part == HG_FRAME_PICTURE)
        status = hg_culling_add(draw->culling, draw->scene_gpu->geometry, &look, jobs, err);
    else if (s->shadows.areas.count > 0) {
        const struct hg_tiled_area *top = &s->shadows.areas.items[s->shadows.areas.count - 1];
        choice.area = top->rect;
        choice.share = top->share;
        choice.shares = s->forced ? 0 : top->shares; // a coarser cut is another, and drawn whole
    }
    const uint32_t debug = draw->request->settings->debug;
    if (status == HG_OK && part == HG_FRAME_PICTURE && !needs_shadow_maps(draw))
        return HG_OK; // they stay as stale as they are
    return status == HG_OK && (debug == 0 || debug == HG_DEBUG_VIEW_SHADOW_PAGES)
               ? hg_shadow_select(
                     draw->scene_gpu->geometry, draw->lighting, &choice, jobs, draw->culling, err)
               : status;
}

static void note_sets(struct hg_draw *draw, enum hg_frame_part part)
{
    draw->stats->missing_clusters = 0;
    draw->crowded = false;
    for (uint32_t i = 0; i < hg_culling_count(draw->culling); i++) {
        const struct hg_culling_set *set = hg_culling_set(draw->culling, i);
        draw->stats->missing_clusters += set->missing;
        draw->crowded |= set->crowded;
    }
    const bool missing = draw->stats->missing_clusters > 0;
    hg_tiled_accumulation_note(draw->accumulation, HG_SHORT_OF_CLUSTERS, missing);
    if (part == HG_FRAME_SHADOWS) { // those that are coarser than a texel make the picture so
        for (uint32_t i = 0; i < hg_culling_count(draw->culling); i++) {
            const float texels = hg_culling_set(draw->culling, i)->error_px;
            float *most_px = &draw->accumulation->shadows.error_px;
            *most_px = texels > 1.0f ? fmaxf(*most_px, draw->request->error_px * texels) : *most_px;
        }
        return;
    }
    float *shown_px = &draw->accumulation->error_px;
    const float error_px = hg_culling_set(draw->culling, 0)->error_px;
    *shown_px = hg_draw_is(draw, HG_DRAW_EXACT) ? fmaxf(*shown_px, error_px) : error_px;
}

enum hg_status hg_frame_cull(
    struct hg_draw *draw, enum hg_frame_part part, uint32_t samples, struct hg_error *err)
{
    const uint64_t start = hg_clock_now_ns();
    hg_culling_reset(draw->culling);
    enum hg_status status = select_sets(draw, part, samples, err);
    if (status == HG_OK)
        note_sets(draw, part);
    if (status == HG_OK && !(draw->crowded && is_whole(draw)))
        status = hg_culling_upload(draw->culling, draw->context->jobs, err);
    hg_view_stats_add_stage(draw->stats, "cull", hg_clock_now_ns() - start);
    return status;
}

enum hg_status hg_frame_cull_part(struct hg_draw *draw, VkRect2D part, struct hg_error *err)
{
    struct hg_culling *culling = draw->culling;
    struct hg_culling_view look = camera_view(draw, hg_draw_size(draw->request), part);
    const struct hg_culling_lens lens = centres_of(draw);
    look.wait = look.whole = true;
    look.history = false;
    // Most triangles show at none of the few samples of a grid.
    if (draw->request->drawn.width > 0 && hg_gpu_strategy(draw->context->gpu)->host_triangle_cull)
        look.lens = &lens;
    hg_culling_reset(culling);
    struct hg_jobs *jobs = draw->context->jobs;
    enum hg_status status = hg_culling_add(culling, draw->scene_gpu->geometry, &look, jobs, err);
    if (status == HG_OK && hg_culling_set(culling, 0)->crowded) { // then as fine as can be
        look.whole = false;
        hg_culling_reset(culling);
        status = hg_culling_add(culling, draw->scene_gpu->geometry, &look, jobs, err);
    }
    return status == HG_OK ? hg_culling_upload(culling, jobs, err) : status;
}

enum hg_status hg_frame_cull_cuts(struct hg_draw *draw, VkRect2D part, struct hg_error *err)
{
    struct hg_culling *culling = draw->culling;
    struct hg_culling_view look = camera_view(draw, hg_draw_size(draw->request), part);
    look.wait = look.both_sides = true;
    look.history = false;
    look.cut_count = draw->frame->clip_count;
    for (uint32_t i = 0; i < look.cut_count; i++)
        memcpy(look.cuts[i], &draw->frame->clip_planes[i], sizeof look.cuts[i]);
    hg_culling_reset(culling);
    struct hg_jobs *jobs = draw->context->jobs;
    const enum hg_status status =
        hg_culling_add(culling, draw->scene_gpu->geometry, &look, jobs, err);
    return status == HG_OK ? hg_culling_upload(culling, jobs, err) : status;
}

enum hg_status hg_frame_cull_prefetch(struct hg_draw *draw, struct hg_error *err)
{
    const VkExtent2D size = whole_of(draw);
    struct hg_culling_view look = camera_view(draw, size, (VkRect2D){{0, 0}, size});
    struct hg_jobs *jobs = draw->context->jobs;
    const struct hg_culling_lens lens = centres_of(draw);
    // Most triangles show at no pixel of so small a picture.
    if (hg_gpu_strategy(draw->context->gpu)->host_triangle_cull)
        look.lens = &lens;
    hg_culling_reset(draw->culling);
    const enum hg_status status =
        hg_culling_add(draw->culling, draw->scene_gpu->geometry, &look, jobs, err);
    return status == HG_OK ? hg_culling_upload(draw->culling, jobs, err) : status;
}
