// frame.c - the order of one batch: bring the device in line, then draw samples.
#include "renderer/frame/frame.h"

#include <string.h>

#include "base/clock.h"
#include "base/cond.h"
#include "base/log.h"
#include "renderer/passes/debug.h"
#include "renderer/passes/triangle_cache.h"
#include "renderer/passes/peel_test.h"
#include "renderer/passes/shade.h"
#include "renderer/passes/skin.h"
#include "shaders/shared/unlit_tiles.h"
#include "shaders/shared/debug.h"
#include "shaders/shared/features.h"

#define BAKE_WAIT_NS   UINT64_C(20000000) // of a step, for levels that are being made
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
    const uint64_t until_ns = view->wait ? hg_cond_after(BAKE_WAIT_NS) : 0;
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

// --- draw ----------------------------------------------------------------------------------------

static bool has_blend(const struct hg_view_state *view)
{
    const struct hg_culling_set *set = hg_culling_set(view->visible, 0);
    return set->class_first[HG_DRAW_CLASS_BLEND + 1] > set->class_first[HG_DRAW_CLASS_BLEND];
}

// Cells without light pay for their own pipeline and the search in pictures that follow each other.
#define DARK_LEAST 0.25f // share of cells; with less the search rests for DARK_REST pictures
#define DARK_REST  15

static enum hg_status make_layers(struct hg_view_state *view, struct hg_error *err)
{
    enum hg_status status = hg_view_make_image(
        view, HG_VISIBILITY_FORMAT, "layer visibility", &view->targets.layer_visibility, err);
    if (status == HG_OK)
        status = hg_view_make_image(
            view, HG_COLOR_FORMAT, "layer colour", &view->targets.layer_color, err);
    for (int i = 0; i < 2 && status == HG_OK; i++)
        status =
            hg_view_make_image(view, HG_DEPTH_FORMAT, "layer depth", &view->targets.layers[i], err);
    return status;
}

bool hg_frame_transmits(const struct hg_view_state *view)
{
    return (view->scene_gpu->features & HG_FEATURE_TRANSMISSION) != 0;
}

// The opaque scene as it is seen through layers.
static enum hg_status record_behind(
    struct hg_view_state *view, struct hg_pass *pass, struct hg_error *err)
{
    enum hg_status status =
        hg_view_make_image(view, HG_COLOR_FORMAT, "scene behind", &view->targets.behind, err);
    const struct hg_shade shade = {.visibility = &view->targets.visibility,
        .depth = &view->targets.depth,
        .target = &view->targets.behind,
        .clear = true,
        .counted = view->stream.exact,
        .alone = true};
    return status == HG_OK ? hg_shade_record(pass, &shade, err) : status;
}

static enum hg_status record_layers(
    struct hg_view_state *view, struct hg_pass *pass, uint32_t slot, struct hg_error *err)
{
    const struct hg_visibility_scene scene = {view->visible, 0, 0};
    enum hg_status status = HG_OK;
    // What lets light through shows what is behind it by itself: it hides further layers.
    const bool holes = view->scene_gpu->has_holes;
    for (uint32_t i = 0; i < (holes ? view->layer_limit : 1) && status == HG_OK; i++) {
        const struct hg_visibility_target target = {
            &view->targets.layer_visibility, &view->targets.layers[i % 2]};
        status = hg_visibility_record_layer(pass, &scene, &target, &view->targets.depth,
            i > 0 ? &view->targets.layers[(i + 1) % 2] : NULL, err);
        const struct hg_shade shade = {.visibility = &view->targets.layer_visibility,
            .depth = target.depth,
            .target = &view->targets.layer_color,
            .clear = i == 0,
            .counted = view->stream.exact,
            .layer = true,
            .behind = hg_frame_transmits(view) ? &view->targets.behind : NULL};
        if (status == HG_OK)
            status = hg_shade_record(pass, &shade, err);
    }
    struct hg_gpu_image *last = &view->targets.layers[(view->layer_limit - 1) % 2];
    return status == HG_OK && holes ? hg_peel_test_record(pass, last, &view->layers_full, slot, err)
                                    : status;
}

// A debug view takes one sample through the pixels' centres and needs no light.
static enum hg_status record_debug(
    struct hg_view_state *view, struct hg_gpu_cmd *cmd, struct hg_error *err)
{
    hg_frame_fill(view, 0, false, 0);
    struct hg_pass pass = hg_frame_pass(view, cmd, 0);
    const struct hg_visibility_target target = {&view->targets.visibility, &view->targets.depth};
    const bool counts = view->settings.debug == HG_DEBUG_VIEW_OVERDRAW;
    const bool sampled = view->settings.debug <= HG_DEBUG_VIEW_MISSING;
    const struct hg_visibility_scene scene = {view->visible, 0, 0};
    enum hg_status status = hg_visibility_record(&pass, &scene, &target, err);
    if (status == HG_OK && counts)
        status = hg_view_make_image(
            view, HG_COLOR_FORMAT, "layer colour", &view->targets.layer_color, err);
    if (status == HG_OK && counts)
        status = hg_visibility_record_overdraw(&pass, &scene, &view->targets.layer_color, err);
    // The picture itself, drawn over below: it asks for the pages that it would show.
    const struct hg_shade shade = {.visibility = &view->targets.visibility,
        .depth = &view->targets.depth,
        .target = &view->targets.accumulated,
        .clear = true};
    if (status == HG_OK && sampled)
        status = hg_shade_record(&pass, &shade, err);
    const struct hg_debug debug = {.view = view->settings.debug,
        .visibility = &view->targets.visibility,
        .counts = counts ? &view->targets.layer_color : NULL,
        .target = &view->targets.accumulated};
    return status == HG_OK ? hg_debug_record(&pass, &debug, err) : status;
}

static bool tells_dark(struct hg_view_state *view, const struct hg_pass *pass)
{
    const enum hg_override wish = view->context->overrides.unlit_tiles;
    const uint32_t lights = view->frame.lighting.light_count;
    if (wish == HG_OVERRIDE_OFF || lights == 0 || lights > HG_UNLIT_TILES_MOST_LIGHTS ||
        pass->area.extent.width > 0)
        return false;
    if (wish == HG_OVERRIDE_ON)
        return true;
    if (!view->direct || !hg_gpu_get_caps(pass->gpu)->is_cpu)
        return false;
    if (view->dark_wait > 0)
        view->dark_wait--;
    return view->dark_wait == 0;
}

// What the host draws of a sample; the frame block is that of the sample.
static enum hg_status draw_hosted(
    struct hg_view_state *view, uint32_t slot, uint32_t slots, struct hg_error *err)
{
    if (!hg_culling_set(view->visible, 0)->hosted)
        return HG_OK;
    const uint64_t start = hg_clock_now_ns();
    const struct hg_culling_lens lens = hg_frame_lens(&view->frame.camera, hg_frame_size(view));
    const enum hg_status status =
        hg_culling_draw_cpu(view->visible, &lens, slot, slots, view->context->jobs, err);
    hg_view_add_stage(view, "host raster", hg_clock_now_ns() - start);
    return status;
}

// slot: of the sample in this batch, of `slots`.
static enum hg_status record_sample(struct hg_view_state *view, struct hg_gpu_cmd *cmd,
    uint32_t sample, uint32_t slot, uint32_t slots, struct hg_error *err)
{
    hg_frame_fill(view, sample, true, slot);
    struct hg_pass pass = hg_frame_pass(view, cmd, slot);
    const struct hg_visibility_target target = {&view->targets.visibility, &view->targets.depth};
    const bool blend = has_blend(view);
    const struct hg_visibility_scene scene = {view->visible, 0, slot};
    enum hg_status status = draw_hosted(view, slot, slots, err);
    if (status == HG_OK)
        status = hg_visibility_record(&pass, &scene, &target, err);
    if (status == HG_OK && view->stream.behind)
        return record_behind(view, &pass, err);
    if (status == HG_OK && blend)
        status = make_layers(view, err);
    if (status == HG_OK && blend && hg_frame_transmits(view) && !view->stream.behind_there)
        status = record_behind(view, &pass, err);
    if (status == HG_OK && blend)
        status = record_layers(view, &pass, slot, err);
    const bool dark = tells_dark(view, &pass);
    view->dark_told = dark;
    if (status == HG_OK && dark)
        status = hg_unlit_tiles_find(
            &pass, &view->dark, view->lighting, view->coarse, &view->targets.depth, err);
    if (status == HG_OK && dark)
        status = hg_unlit_tiles_mark(&pass, &view->dark, &view->targets.depth, err);
    const struct hg_shade shade = {.visibility = &view->targets.visibility,
        .depth = &view->targets.depth,
        .target = &view->targets.accumulated,
        .picture = view->direct && view->stream.finding == 0 ? &view->targets.pixels[0] : NULL,
        .tonemap = view->settings.tonemap,
        .clear = sample == 0 && !view->stream.exact,
        .counted = view->stream.exact,
        .dark = dark,
        .front = blend ? &view->targets.layer_color : NULL};
    return status == HG_OK ? hg_shade_record(&pass, &shade, err) : status;
}

static enum hg_status record_shadows(
    struct hg_view_state *view, struct hg_gpu_cmd *cmd, uint32_t first_set, struct hg_error *err)
{
    struct hg_lighting_stats stats;
    hg_lighting_stats(view->lighting, &stats);
    view->stale_shadows = stats.shadow_maps_stale;
    hg_frame_fill(view, view->samples, true, 0); // where the geometry is
    struct hg_pass pass = hg_frame_pass(view, cmd, 0);
    const struct hg_tiled_accumulation *s = &view->stream;
    pass.area = s->shadow_count > 0 ? s->shadow_areas[s->shadow_count - 1].rect : (VkRect2D){0};
    pass.adds = s->shadow_count > 0 && s->shadow_begun;
    return hg_shadow_record(&pass, view->lighting, view->coarse, view->visible, first_set, err);
}

static enum hg_status record_facets(
    struct hg_view_state *view, struct hg_gpu_cmd *cmd, struct hg_error *err)
{
    hg_frame_fill(view, view->samples, true, 0);
    struct hg_pass pass = hg_frame_pass(view, cmd, 0);
    return hg_triangle_cache_record(&pass, view->scene_gpu->geometry, err);
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

enum hg_status hg_frame_record(
    struct hg_view_state *view, struct hg_gpu_cmd *cmd, uint32_t samples, struct hg_error *err)
{
    enum hg_status status = hg_skin_record(cmd, view->scene_gpu->geometry, err);
    if (status == HG_OK)
        status = record_facets(view, cmd, err);
    if (status == HG_OK && view->settings.debug != 0)
        return record_debug(view, cmd, err);
    if (status == HG_OK)
        status = record_shadows(view, cmd, 1, err);
    const uint32_t first = hg_view_first_sample(view);
    for (uint32_t i = 0; i < samples && status == HG_OK; i++)
        status = record_sample(view, cmd, first + i, i, samples, err);
    return status;
}

enum hg_status hg_frame_record_shadows(
    struct hg_view_state *view, struct hg_gpu_cmd *cmd, struct hg_error *err)
{
    const enum hg_status status = hg_skin_record(cmd, view->scene_gpu->geometry, err);
    return status == HG_OK ? record_shadows(view, cmd, 0, err) : status;
}

// Opaque surfaces in the textures that the camera asks for; casters' own demands are small.
enum hg_status hg_frame_record_prefetch(
    struct hg_view_state *view, struct hg_gpu_cmd *cmd, struct hg_error *err)
{
    hg_frame_fill(view, 0, true, 0);
    enum hg_status status = hg_frame_cull_prefetch(view, err);
    if (status != HG_OK)
        return status;
    struct hg_pass pass = hg_frame_pass(view, cmd, 0);
    const struct hg_visibility_target target = {&view->targets.visibility, &view->targets.depth};
    const struct hg_visibility_scene scene = {view->visible, 0, 0};
    status = hg_visibility_record(&pass, &scene, &target, err);
    const struct hg_shade shade = {.visibility = &view->targets.visibility,
        .depth = &view->targets.depth,
        .target = &view->targets.accumulated,
        .clear = true};
    return status == HG_OK ? hg_shade_record(&pass, &shade, err) : status;
}
