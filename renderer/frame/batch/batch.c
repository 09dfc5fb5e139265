// batch.c - syncs the device before a batch, and evaluates its counters afterwards.
#include "renderer/frame/batch/batch.h"

#include "base/clock.h"
#include "base/cond.h"
#include "shaders/shared/debug.h"
#include "shaders/shared/features.h"

#define SHOW_UPLOAD_NS 4000000u // of pages, per frame of a moving picture
#define MOST_HOSTED_PX 2000000  // of a batch that the host draws, 12 bytes each

// --- sync ----------------------------------------------------------------------------------------

// Pages are asked for by the depth of pictures in motion, which is read for the sake of history.
static enum hg_shadow_paging paging_of(const struct hg_draw *draw)
{
    const struct hg_view_settings *s = draw->request->settings;
    if (!hg_draw_is(draw, HG_DRAW_MOVES) || s->temporal == HG_VIEW_TEMPORAL_NONE)
        return HG_PAGING_OFF;
    if (s->shadow_maps == HG_VIEW_SHADOWS_VIRTUAL || s->debug == HG_DEBUG_VIEW_SHADOW_PAGES)
        return HG_PAGING_ON;
    return s->shadow_maps == HG_VIEW_SHADOWS_AUTO && s->gi != HG_VIEW_GI_NONE ? HG_PAGING_AUTO
                                                                              : HG_PAGING_OFF;
}

static bool moved_since(
    const void *shapes, uint64_t revision, const struct hg_box **moved, uint32_t *count)
{
    return hg_geometry_moved_casters(shapes, revision, moved, count);
}

static enum hg_status sync_lighting(struct hg_draw *draw, struct hg_error *err)
{
    struct hg_lighting_view look = {.scene = draw->scene_gpu->scene,
        .camera = &draw->frame->camera,
        .width = draw->request->settings->width,
        .height = draw->request->settings->height,
        .moved_since = moved_since,
        .shapes = draw->scene_gpu->geometry,
        .moves = hg_draw_is(draw, HG_DRAW_MOVES),
        .keeps = hg_draw_is(draw, HG_DRAW_FINAL) || draw->accumulation->phase == HG_VIEW_EXACT,
        .once = draw->request->settings->mode == HG_VIEW_MODE_PATH,
        .paging = paging_of(draw),
        .shape_revision = hg_geometry_shape_revision(draw->scene_gpu->geometry)};
    hg_geometry_origin(draw->scene_gpu->geometry, look.origin);
    look.has_bounds =
        hg_geometry_bounds(draw->scene_gpu->geometry, look.bounds_min, look.bounds_max);
    look.has_ground = hg_draw_ground(draw, look.ground_up, &look.ground_height);
    return hg_lighting_sync(draw->lighting, &look, err);
}

// Between batches: uploads pages that have arrived, decides whether feedback is needed.
static enum hg_status sync_pages(struct hg_draw *draw, struct hg_error *err)
{
    struct hg_tiled_accumulation *s = draw->accumulation;
    struct hg_page_cache *pages = hg_textures_cache(draw->scene_gpu->textures);
    const bool exact = s->phase == HG_VIEW_EXACT;
    const enum hg_status status = hg_page_cache_update(
        pages, exact ? HG_PAGES_EXACT : HG_PAGES_SHOW, exact ? UINT64_MAX : SHOW_UPLOAD_NS, err);
    s->pages.on |= !hg_page_cache_is_complete(pages);
    return status;
}

enum hg_status hg_frame_sync(struct hg_draw *draw, struct hg_error *err)
{
    const uint64_t start = hg_clock_now_ns();
    const uint64_t until_ns =
        hg_draw_is(draw, HG_DRAW_WAIT) ? hg_cond_after(HG_FRAME_BUILD_WAIT_NS) : 0;
    enum hg_status status = hg_scene_gpu_sync(
        draw->context, draw->scene_gpu, draw->request->camera->eye, until_ns, err);
    if (status != HG_OK)
        return status;
    const bool triangle_cache = hg_gpu_strategy(draw->context->gpu)->uniform_tables &&
                                !hg_geometry_has_levels(draw->scene_gpu->geometry) &&
                                (draw->scene_gpu->features & HG_FEATURE_VERTICES) == 0;
    status = hg_geometry_sync_triangle_cache(draw->scene_gpu->geometry, triangle_cache, err);
    if (status == HG_OK && draw->request->settings->look != NULL)
        status = hg_look_sync(draw->request->settings->look, draw->scene_gpu, err);
    if (status != HG_OK)
        return status;
    const uint64_t middle = hg_clock_now_ns();
    hg_view_stats_add_stage(draw->stats, "scene sync", middle - start);
    status = sync_pages(draw, err);
    if (status != HG_OK)
        return status;
    const struct hg_camera_setup setup = hg_frame_setup(draw);
    hg_camera_fill(&setup, &draw->frame->camera);
    status = sync_lighting(draw, err);
    hg_view_stats_add_stage(draw->stats, "light sync", hg_clock_now_ns() - middle);
    return status;
}

// --- after a batch -------------------------------------------------------------------------------

// Unlit tiles are worth their search and pipeline only in consecutive pictures.
#define UNLIT_LEAST 0.25f // share of cells; with less the search rests for UNLIT_REST pictures
#define UNLIT_REST  15

bool hg_frame_transmits(const struct hg_draw *draw)
{
    return (draw->scene_gpu->features & HG_FEATURE_TRANSMISSION) != 0;
}

void hg_frame_note_drawn(struct hg_draw *draw, uint32_t samples)
{
    struct hg_culling_stats drawn;
    hg_culling_stats(draw->culling, &drawn);
    draw->stats->draws_drawn = drawn.draws;
    draw->stats->triangles_drawn = drawn.triangles;
    draw->stats->triangles_hosted = drawn.hosted;
    hg_graph_advance(draw->targets->graph);
    hg_frame_note_blend(draw, samples);
    if (draw->unlit->found &&
        hg_unlit_tiles_share(&draw->unlit->tiles, &draw->targets->depth) < UNLIT_LEAST)
        draw->unlit->wait = UNLIT_REST;
}

uint32_t hg_frame_batch(const struct hg_draw *draw, uint32_t samples)
{
    const VkExtent2D size = hg_frame_size(draw);
    const uint64_t most = MOST_HOSTED_PX / ((uint64_t)size.width * size.height);
    if (!hg_culling_set(draw->culling, 0)->hosted || samples <= most)
        return samples;
    return most > 0 ? (uint32_t)most : 1;
}
