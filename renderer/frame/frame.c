// frame.c - around a batch: brings the device in line before it, notes what it drew after it.
#include "renderer/frame/frame.h"

#include "base/clock.h"
#include "base/cond.h"
#include "base/log.h"
#include "shaders/shared/features.h"

#define SHOW_UPLOAD_NS 4000000u           // of pages, per frame of a moving picture
#define MOST_HOSTED_PX 2000000            // of a batch that the host draws, 12 bytes each

// --- sync ----------------------------------------------------------------------------------------

static enum hg_status sync_lighting(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_lighting_view look = {.scene = view->scene_gpu->scene,
        .camera = &view->frame.camera,
        .width = view->settings.width,
        .height = view->settings.height,
        .shape_revision = hg_geometry_shape_revision(view->scene_gpu->geometry)};
    hg_geometry_origin(view->scene_gpu->geometry, look.origin);
    look.has_bounds =
        hg_geometry_bounds(view->scene_gpu->geometry, look.bounds_min, look.bounds_max);
    return hg_lighting_sync(view->lighting, &look, err);
}

// Between batches: uploads pages that have arrived, decides whether feedback is needed.
static enum hg_status sync_pages(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_tiled_accumulation *s = &view->stream;
    struct hg_page_cache *pages = hg_textures_cache(view->scene_gpu->textures);
    const enum hg_page_mode mode = s->exact ? HG_PAGES_EXACT : HG_PAGES_SHOW;
    const enum hg_status status =
        hg_page_cache_update(pages, mode, s->exact ? UINT64_MAX : SHOW_UPLOAD_NS, err);
    s->on |= !hg_page_cache_is_complete(pages);
    return status;
}

enum hg_status hg_frame_sync(struct hg_view_state *view, struct hg_error *err)
{
    const uint64_t start = hg_clock_now_ns();
    const uint64_t until_ns = view->wait ? hg_cond_after(HG_FRAME_BUILD_WAIT_NS) : 0;
    enum hg_status status =
        hg_scene_gpu_sync(view->context, view->scene_gpu, view->camera.eye, until_ns, err);
    if (status != HG_OK)
        return status;
    const bool facets = hg_gpu_get_caps(view->context->gpu)->is_cpu &&
                        !view->context->overrides.table_addresses &&
                        !hg_geometry_has_levels(view->scene_gpu->geometry) &&
                        (view->scene_gpu->features & HG_FEATURE_VERTICES) == 0;
    status = hg_geometry_sync_triangle_cache(view->scene_gpu->geometry, facets, err);
    if (status != HG_OK)
        return status;
    const uint64_t middle = hg_clock_now_ns();
    hg_view_add_stage(view, "scene sync", middle - start);
    status = sync_pages(view, err);
    if (status != HG_OK)
        return status;
    const struct hg_camera_setup setup = hg_frame_setup(view);
    hg_camera_fill(&setup, &view->frame.camera);
    status = sync_lighting(view, err);
    hg_view_add_stage(view, "light sync", hg_clock_now_ns() - middle);
    return status;
}

// --- after a batch -------------------------------------------------------------------------------

// Cells without light pay for their own pipeline and the search in pictures that follow each other.
#define DARK_LEAST 0.25f // share of cells; with less the search rests for DARK_REST pictures
#define DARK_REST  15

bool hg_frame_transmits(const struct hg_view_state *view)
{
    return (view->scene_gpu->features & HG_FEATURE_TRANSMISSION) != 0;
}

static void adapt_layers(struct hg_view_state *view, uint32_t samples)
{
    bool full = false;
    for (uint32_t i = 0; i < samples; i++)
        full |= ((const uint32_t *)view->layers_full.mapped)[i] != 0;
    view->shallow = full && view->layer_limit < HG_VIEW_MAX_LAYERS;
    if (view->shallow)
        view->layer_limit *= 2;
    else if (full && !view->too_deep_told)
        hg_warn(FRAME, "%u layers of blended surfaces or more: what lies deeper is not seen",
            (unsigned)HG_VIEW_MAX_LAYERS);
    view->too_deep_told = full && !view->shallow;
}

void hg_frame_note_drawn(struct hg_view_state *view, uint32_t samples)
{
    struct hg_culling_stats drawn;
    hg_culling_stats(view->visible, &drawn);
    view->draws_drawn = drawn.draws;
    view->triangles_drawn = drawn.triangles;
    hg_graph_advance(view->targets.graph);
    adapt_layers(view, samples);
    if (view->dark_told && hg_unlit_tiles_share(&view->dark, &view->targets.depth) < DARK_LEAST)
        view->dark_wait = DARK_REST;
}

uint32_t hg_frame_batch(const struct hg_view_state *view, uint32_t samples)
{
    const VkExtent2D size = hg_frame_size(view);
    const uint64_t most = MOST_HOSTED_PX / ((uint64_t)size.width * size.height);
    if (!hg_culling_set(view->visible, 0)->hosted || samples <= most)
        return samples;
    return most > 0 ? (uint32_t)most : 1;
}
