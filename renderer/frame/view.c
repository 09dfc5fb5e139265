// view.c - see view.h.
#include "renderer/frame/view.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/frame/batch/batch.h"
#include "renderer/frame/light/gather_view.h"
#include "renderer/frame/light/gi_view.h"
#include "renderer/frame/exposure/motion_meter.h"
#include "renderer/frame/quality/governor.h"
#include "renderer/frame/exposure/meter.h"
#include "renderer/frame/paths/path_lease.h"
#include "renderer/frame/paths/path_view.h"
#include "renderer/frame/view_pixels.h"
#include "renderer/geometry/pose_snapshot.h"
#include "renderer/passes/shade.h"
#include "renderer/passes/visibility.h"
#include "shaders/shared/debug.h"
#include "shaders/shared/pick.h"

#define STILL_PICTURES      8          // of a view that has come to rest, before it is refined;
#define MOST_STILL_PICTURES 24         // while textures arrive
#define SHOWN_SAMPLES       4          // before the refined picture takes their place
#define OPENING_WAIT_NS     500000000u // for texture pages, before the first picture is shown

// --- images --------------------------------------------------------------------------------------

static void destroy_extras(struct hg_view_state *view)
{
    struct hg_gpu *gpu = view->context->gpu;
    hg_gpu_image_destroy(gpu, &view->targets.behind);
    for (int i = 0; i < 3; i++)
        hg_gpu_image_destroy(gpu, &view->targets.pixels[i]);
    hg_gpu_image_destroy(gpu, &view->targets.checkered);
    hg_tiled_accumulation_finish(gpu, &view->accumulation);
    hg_gpu_buffer_destroy(gpu, &view->blend.lists.heads);
    hg_gpu_buffer_destroy(gpu, &view->blend.lists.nodes);
    view->blend.nodes = view->blend.strips = 0;
    hg_gpu_readback_finish(gpu, &view->buffers.readback, &view->context->lent);
    hg_gpu_buffer_destroy(gpu, &view->buffers.motion);
    hg_temporal_view_finish(gpu, &view->motion.temporal);
    hg_view_forget_grid(view);
}

// New images first, so that a refusal leaves the old ones.
static enum hg_status resize(
    struct hg_view_state *view, uint32_t width, uint32_t height, struct hg_error *err)
{
    static const struct {
        VkFormat format;
        const char *name;
    } kinds[3] = {{HG_VISIBILITY_FORMAT, "visibility"}, {HG_DEPTH_FORMAT, "depth"},
        {HG_COLOR_FORMAT, "accumulated"}};
    struct hg_view_targets *t = &view->targets;
    struct hg_gpu_image *const to[3] = {&t->visibility, &t->depth, &t->accumulated};
    struct hg_gpu *gpu = view->context->gpu;
    struct hg_gpu_image images[3] = {0};
    enum hg_status status = HG_OK;
    if (t->visibility.width == width && t->visibility.height == height)
        return HG_OK;
    for (int i = 0; i < 3 && status == HG_OK; i++) {
        const struct hg_gpu_image_params params = {.format = kinds[i].format,
            .width = width,
            .height = height,
            .attachment = true,
            .name = kinds[i].name};
        status = hg_gpu_image_create(gpu, &params, &images[i], err);
    }
    for (int i = 0; i < 3; i++)
        hg_gpu_image_destroy(gpu, status == HG_OK ? to[i] : &images[i]);
    if (status == HG_E_NOMEM || status == HG_E_LIMIT) {
        const struct hg_error cause = *err;
        return hg_error_set(err, HG_E_LIMIT, "view", "size", "%ux%u px are too many: %s: %s", width,
            height, cause.what, cause.reason);
    }
    if (status != HG_OK)
        return status;
    destroy_extras(view);
    for (int i = 0; i < 3; i++)
        *to[i] = images[i];
    return HG_OK;
}

// --- life ----------------------------------------------------------------------------------------

enum hg_status hg_view_state_init(struct hg_view_state *view, struct hg_frame_context *context,
    struct hg_scene *scene, struct hg_error *err)
{
    *view =
        (struct hg_view_state){.context = context, .formats = 1, .unlit.wait = HG_VIEW_UNLIT_AFTER};
    view->history.wanted = context->overrides.keeps_history;
    enum hg_status status = hg_scene_gpu_ref(context, scene, &view->scene_gpu, err);
    const struct hg_lighting_params lighting = {
        .store = context->store, .shared = status == HG_OK ? view->scene_gpu->light : NULL};
    if (status == HG_OK)
        status = hg_lighting_create(context->gpu, context->jobs, &lighting, &view->lighting, err);
    if (status == HG_OK)
        status = hg_culling_create(context->gpu, &view->culling, err);
    if (status == HG_OK)
        status = hg_culling_create(context->gpu, &view->buffers.pick_culling, err);
    if (status == HG_OK) {
        status = hg_gpu_buffer_create(context->gpu, HG_GPU_BUFFER_UPLOAD,
            (HG_VIEW_MAX_SAMPLES_PER_STEP + 1) * HG_FRAME_SLOT_BYTES, "frame blocks",
            &view->buffers.blocks, err);
    }
    if (status == HG_OK) {
        status = hg_gpu_buffer_create(context->gpu, HG_GPU_BUFFER_READBACK,
            sizeof(struct hg_gpu_pick), "pick", &view->buffers.pick, err);
    }
    if (status == HG_OK) {
        status = hg_gpu_buffer_create(context->gpu, HG_GPU_BUFFER_READBACK,
            HG_VIEW_MAX_SAMPLES_PER_STEP * sizeof(struct hg_gpu_blend_report), "blend reports",
            &view->blend.lists.reports, err);
    }
    if (status != HG_OK)
        hg_view_state_finish(view);
    return status;
}

void hg_view_state_finish(struct hg_view_state *view)
{
    if (view->context == NULL)
        return;
    struct hg_gpu *gpu = view->context->gpu;
    destroy_extras(view);
    hg_path_lease_end(view);
    hg_path_destroy(view->path);
    hg_gather_view_finish(view);
    hg_graph_destroy(view->targets.graph);
    hg_frame_history_finish(&view->history);
    hg_temporal_view_finish(gpu, &view->motion.temporal);
    hg_reflect_view_finish(gpu, &view->motion.reflections);
    hg_mirror_view_finish(gpu, &view->motion.mirrors);
    hg_glass_view_finish(gpu, &view->motion.glass);
    hg_gpu_image_destroy(gpu, &view->targets.visibility);
    hg_gpu_image_destroy(gpu, &view->targets.depth);
    hg_gpu_image_destroy(gpu, &view->targets.accumulated);
    hg_gpu_buffer_destroy(gpu, &view->buffers.blocks);
    hg_gpu_buffer_destroy(gpu, &view->buffers.pick);
    hg_gpu_buffer_destroy(gpu, &view->blend.lists.reports);
    hg_prefetch_finish(gpu, &view->prefetch);
    hg_unlit_tiles_finish(gpu, &view->unlit.tiles);
    hg_culling_destroy(view->culling);
    hg_culling_destroy(view->buffers.pick_culling);
    hg_lighting_destroy(view->lighting);
    hg_scene_gpu_unref(view->context, view->scene_gpu);
    *view = (struct hg_view_state){0};
}

// Settings that affect only the resolve of a path-traced picture.
static bool differs_when_read(const struct hg_view_settings *a, const struct hg_view_settings *b)
{
    struct hg_view_settings same = *a;
    same.exposure = b->exposure;
    same.tonemap = b->tonemap;
    same.target_ms = b->target_ms;
    return a->mode == HG_VIEW_MODE_PATH && memcmp(&same, b, sizeof same) == 0;
}

enum hg_status hg_view_state_set(
    struct hg_view_state *view, const struct hg_view_settings *settings, struct hg_error *err)
{
    enum hg_status status = resize(view, settings->width, settings->height, err);
    if (status != HG_OK)
        return status;
    const bool differs = memcmp(&view->settings, settings, sizeof *settings) != 0;
    if (differs && view->stats.number > 0 && differs_when_read(&view->settings, settings)) {
        view->stats.number++; // the film stays valid
    } else if (differs) {
        view->settings_revision++;
        view->path_begins = true; // the film is of another picture, perhaps of another size
    }
    view->settings = *settings;
    return HG_OK;
}

void hg_view_state_note_look(struct hg_view_state *view)
{
    view->settings_revision++;
    view->path_begins = true;
}

void hg_view_state_look(struct hg_view_state *view, const struct hg_view_camera_state *camera)
{
    struct hg_view_camera_state old = view->camera;
    old.input_seq = camera->input_seq;
    if (memcmp(&old, camera, sizeof old) != 0) {
        hg_meter_note_camera(view, camera);
        view->camera_revision++;
    }
    view->camera = *camera;
}

// --- step ----------------------------------------------------------------------------------------

static struct hg_view_key present_key(const struct hg_view_state *view)
{
    return (struct hg_view_key){.scene = view->scene_gpu->scene->revision,
        .environment = view->scene_gpu->scene->environment.revision,
        .geometry = view->scene_gpu->geometry_revision,
        .settings = view->settings_revision,
        .camera = view->camera_revision,
        .gi = hg_gi_view_stage(view)};
}

static bool bakes(const struct hg_view_state *view)
{
    return hg_geometry_baking(view->scene_gpu->geometry) > 0;
}

static bool is_known(const struct hg_view_state *view)
{
    const struct hg_view_key key = present_key(view);
    return view->stats.number > 0 && memcmp(&key, &view->accumulation.key, sizeof key) == 0;
}

// The real-time picture has all of its samples.
static bool is_drawn(const struct hg_view_state *view)
{
    const struct hg_tiled_accumulation *a = &view->accumulation;
    return is_known(view) && (a->phase == HG_VIEW_ACCUMULATING || a->phase == HG_VIEW_EXACT) &&
           a->shortfall == 0 && a->samples >= view->settings.samples && hg_gi_view_is_done(view);
}

// Planes of a real-time picture are path-traced (first hits only) once it is drawn.
static bool keeps_planes(const struct hg_view_state *view)
{
    return view->settings.mode != HG_VIEW_MODE_PATH && view->settings.path.planes != 0;
}

// The picture is complete with the current geometry.
static bool is_complete(const struct hg_view_state *view)
{
    const bool followed = !view->path_begins && hg_path_done(view->path);
    if (view->settings.mode == HG_VIEW_MODE_PATH)
        return is_known(view) && followed;
    return is_drawn(view) && (followed || !keeps_planes(view));
}

bool hg_view_state_has_planes(const struct hg_view_state *view)
{
    return keeps_planes(view) && !view->path_begins && hg_path_done(view->path);
}

bool hg_view_state_only_adapts(const struct hg_view_state *view)
{
    return is_complete(view) && !bakes(view) && !hg_meter_is_due(view) &&
           hg_meter_is_adapting(view);
}

bool hg_view_state_settled(const struct hg_view_state *view)
{
    return is_complete(view) && !bakes(view) && !hg_meter_is_due(view) &&
           !hg_meter_is_adapting(view);
}

// The request of a step. In motion geometry may be coarser to keep the frame time.
static struct hg_draw_request make_request(struct hg_view_state *view, uint32_t max_samples)
{
    const struct hg_view_settings *s = &view->settings;
    const struct hg_tiled_accumulation *a = &view->accumulation;
    const struct hg_view_key key = present_key(view);
    const bool changes = memcmp(&key, &a->key, sizeof key) != 0;
    const bool moves = max_samples == 1 && !view->final && changes && view->motion.still == 0;
    if (key.camera != a->key.camera)
        hg_culling_relax(view->culling);
    struct hg_draw_request request = {.settings = s,
        .camera = &view->camera,
        .samples = s->samples,
        .max_samples = max_samples,
        .error_px = s->error_px};
    if (moves)
        request.error_px *= hg_governor_choice(view).factor;
    request.flags |= moves ? HG_DRAW_MOVES : 0;
    request.flags |= view->motion.still > 0 ? HG_DRAW_STILL : 0;
    request.flags |= view->final ? HG_DRAW_FINAL : 0;
    request.flags |= (view->formats & ~1u) != 0 ? HG_DRAW_ACCUMULATE : 0;
    if (max_samples > 1 || view->final || (a->phase == HG_VIEW_EXACT && !moves))
        request.flags |= HG_DRAW_WAIT;
    return request;
}

// Flags of the next sample: in motion without finer cascades when these are stale, and directly to
// pixels unless it is the last one.
static uint32_t shown_flags(const struct hg_draw *draw, bool changed)
{
    const struct hg_draw_request *r = draw->request;
    const bool refines = hg_draw_is(draw, HG_DRAW_STILL) && !hg_draw_is(draw, HG_DRAW_MOVES);
    const bool moves =
        changed && !refines && r->max_samples == 1 && !hg_draw_is(draw, HG_DRAW_FINAL);
    if (!moves)
        return r->flags;
    const bool coarse =
        hg_lighting_needs_cascades(draw->lighting) || hg_lighting_has_pages(draw->lighting);
    const uint32_t debug = r->settings->debug;
    const bool legend = debug == HG_DEBUG_VIEW_MOTION || debug == HG_DEBUG_VIEW_HISTORY ||
                        debug == HG_DEBUG_VIEW_SCALE || debug == HG_DEBUG_VIEW_REFLECTIONS ||
                        debug == HG_DEBUG_VIEW_SHADOW_PAGES;
    const bool direct = !hg_draw_is(draw, HG_DRAW_ACCUMULATE) &&
                        (legend || (debug == 0 && (coarse || r->samples > 1)));
    return r->flags | (coarse ? HG_DRAW_COARSE_SHADOWS : 0) | (direct ? HG_DRAW_DIRECT : 0);
}

// One batch of the whole picture, after its cull.
static enum hg_status run_shown(
    struct hg_view_state *view, struct hg_draw *draw, uint32_t count, struct hg_error *err)
{
    struct hg_page_cache *pages = hg_textures_cache(draw->scene_gpu->textures);
    struct hg_gpu_cmd *cmd;
    enum hg_status status = hg_gpu_begin(draw->context->gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    memset(draw->blend->lists.reports.mapped, 0, draw->blend->lists.reports.size_bytes);
    hg_page_cache_begin(pages, cmd);
    status = hg_frame_record(draw, cmd, count, err);
    if (status != HG_OK) {
        hg_gpu_discard(draw->context->gpu, cmd);
        return status;
    }
    if (hg_draw_is(draw, HG_DRAW_DIRECT))
        hg_view_record_copy(draw, cmd);
    hg_page_cache_end(pages, cmd);
    status = hg_gpu_submit_and_wait(draw->context->gpu, cmd, err);
    if (status != HG_OK)
        return status;
    hg_geometry_deforms_done(draw->scene_gpu->geometry);
    hg_geometry_triangle_cache_done(draw->scene_gpu->geometry);
    hg_frame_note_drawn(draw, count);
    draw->accumulation->samples += count;
    draw->stats->number++;
    status = hg_temporal_view_resolve(view, draw, err);
    if (status == HG_OK && draw->request->settings->debug == HG_DEBUG_VIEW_REFLECTIONS)
        hg_reflect_view_show(view, draw);
    if (status == HG_OK && draw->request->settings->debug == HG_DEBUG_VIEW_SHADOW_PAGES)
        hg_temporal_view_show_pages(view, draw);
    if (status == HG_OK)
        status = hg_frame_history_note(draw, err);
    return status == HG_OK ? hg_tiled_accumulation_shown(draw, err) : status;
}

// Samples of the next batch of the whole picture, at most.
static uint32_t shown_samples(const struct hg_draw *draw)
{
    const struct hg_draw_request *r = draw->request;
    uint32_t count = r->samples - draw->accumulation->samples;
    count = count < r->max_samples ? count : r->max_samples;
    count = count < HG_VIEW_MAX_SAMPLES_PER_STEP ? count : HG_VIEW_MAX_SAMPLES_PER_STEP;
    return draw->accumulation->pages.on ? 1 : count;
}

// Samples of the whole picture with the texels that are there.
static enum hg_status draw_shown(struct hg_view_state *view, const struct hg_draw_request *asked,
    bool changed, struct hg_error *err)
{
    struct hg_draw_request request = *asked;
    struct hg_draw draw = hg_view_draw(view, &request);
    struct hg_tiled_accumulation *a = draw.accumulation;
    request.flags = shown_flags(&draw, changed);
    if (hg_draw_is(&draw, HG_DRAW_DIRECT))
        hg_temporal_view_begin(view, &request);
    enum hg_status status = hg_temporal_view_targets(view, &draw, err);
    if (changed || a->phase != HG_VIEW_ACCUMULATING)
        a->samples = 0;
    hg_tiled_accumulation_note(
        a, HG_SHORT_OF_DETAIL, request.error_px > request.settings->error_px);
    struct hg_lighting_stats lights;
    hg_lighting_stats(view->lighting, &lights);
    hg_tiled_accumulation_note(
        a, HG_SHORT_OF_SHADOWS, hg_draw_is(&draw, HG_DRAW_COARSE_SHADOWS) || lights.hasty);
    uint32_t count = shown_samples(&draw);
    if (status == HG_OK)
        status = hg_view_make_pixels(&draw, &view->buffers.readback, 0, err);
    if (status == HG_OK)
        status = hg_frame_cull(&draw, HG_FRAME_PICTURE, count, err);
    const bool clipped = draw.crowded && request.settings->debug == 0;
    hg_tiled_accumulation_note(a, HG_SHORT_OF_GEOMETRY, clipped);
    if (status == HG_OK && clipped && view->final)
        return hg_tiled_accumulation_begin_exact(&draw, err);
    if (status == HG_OK)
        status = run_shown(view, &draw, clipped ? 1 : hg_frame_batch(&draw, count), err);
    const bool prefetches = changed && request.max_samples == 1 && request.settings->debug == 0 &&
                            !hg_draw_is(&draw, HG_DRAW_STILL);
    return status == HG_OK && prefetches
               ? hg_prefetch_draw(&view->prefetch, &draw, view->camera_revision, err)
               : status;
}

// The accumulation belongs to another state.
static void restart(struct hg_view_state *view)
{
    struct hg_page_cache *pages = hg_textures_cache(view->scene_gpu->textures);
    hg_tiled_accumulation_restart(&view->accumulation, view->lighting);
    // A region is drawn as an area, whose pixels are counted.
    view->accumulation.pages.on =
        !hg_page_cache_is_complete(pages) || view->settings.region.width > 0;
}

// A new state. A picture that is not displayed yet is not drawn provisionally first.
static enum hg_status begin_state(
    struct hg_view_state *view, const struct hg_draw_request *request, struct hg_error *err)
{
    const struct hg_draw draw = hg_view_draw(view, request);
    restart(view);
    hg_tiled_accumulation_sharpen_shadows(&draw);
    const bool cut = view->accumulation.pages.on || hg_tiled_accumulation_slices(&draw);
    if (!cut || !view->final || view->settings.debug != 0)
        return HG_OK;
    return hg_tiled_accumulation_begin_exact(&draw, err);
}

// Moving parts are needed at other times than that of the pose.
static void deform_for_motion(struct hg_view_state *view)
{
    if (hg_path_view_needs_time(view) && hg_geometry_deform_all(view->scene_gpu->geometry))
        view->scene_gpu->scene_revision = UINT64_MAX;
}

static enum hg_status sync(
    struct hg_view_state *view, const struct hg_draw_request *request, struct hg_error *err)
{
    struct hg_draw draw = hg_view_draw(view, request);
    return hg_frame_sync(&draw, err);
}

// One batch of a synced scene.
static enum hg_status draw_batch(struct hg_view_state *view, const struct hg_draw_request *request,
    bool changed, struct hg_error *err)
{
    struct hg_tiled_accumulation *a = &view->accumulation;
    const struct hg_draw draw = hg_view_draw(view, request);
    enum hg_status status = HG_OK;
    if (changed)
        status = begin_state(view, request, err);
    else if (a->phase != HG_VIEW_EXACT && a->phase != HG_VIEW_DIRECT)
        status = hg_tiled_accumulation_rest(&draw, err);
    if (status == HG_OK)
        status = a->phase == HG_VIEW_EXACT ? hg_tiled_accumulation_draw(&draw, err)
                                           : draw_shown(view, request, changed, err);
    if (status == HG_OK && a->phase == HG_VIEW_EXACT &&
        (a->shortfall & HG_SHORT_OF_LAYERS) != 0) { // all of it lacks layers
        status = begin_state(view, request, err);
        if (status == HG_OK && a->phase != HG_VIEW_EXACT)
            status = draw_shown(view, request, true, err);
    }
    if (a->phase == HG_VIEW_EXACT)
        hg_tiled_accumulation_note(
            a, HG_SHORT_OF_DETAIL, request->error_px > view->settings.error_px);
    return status;
}

// The first samples of the refined picture have not the antialiasing of what is shown already.
static bool is_rougher(const struct hg_view_state *view)
{
    const struct hg_tiled_accumulation *a = &view->accumulation;
    return view->motion.still > 0 && !view->final && a->phase != HG_VIEW_DIRECT &&
           a->samples < SHOWN_SAMPLES && a->samples < view->settings.samples && a->areas.count <= 1;
}

static enum hg_status draw(
    struct hg_view_state *view, uint32_t max_samples, bool sharpens, struct hg_error *err)
{
    struct hg_tiled_accumulation *a = &view->accumulation;
    struct hg_draw_request request = make_request(view, max_samples);
    request.flags |= sharpens ? HG_DRAW_MOVES : 0;
    if (keeps_planes(view))
        deform_for_motion(view);
    enum hg_status status = sync(view, &request, err);
    if (status != HG_OK || (bakes(view) && (view->final || is_drawn(view))))
        return status;
    bool waits;
    status = hg_gi_view_step(view, !sharpens && (view->final || is_known(view)), &waits, err);
    if (waits && view->motion.still > 0)
        a->key.gi = hg_gi_view_stage(view); // the light is new, what is shown stays
    if (status != HG_OK || waits)
        return status;
    const struct hg_view_key key = present_key(view);
    // A client subscribed to a view that was rendering in the background, before its first sample.
    const bool blank = hg_tiled_accumulation_is_blank(a) && !view->final;
    const bool changed = (view->stats.number == 0 && a->phase != HG_VIEW_EXACT) ||
                         memcmp(&key, &a->key, sizeof key) != 0 || blank || sharpens;
    view->path_begins |= changed;
    if (changed && max_samples == 1 && !view->final && (sharpens || view->motion.still == 0))
        status = hg_motion_meter_step(view, err);
    const uint64_t number = view->stats.number;
    if (status == HG_OK)
        status = draw_batch(view, &request, changed, err);
    if (status == HG_OK && number > 0 && is_rougher(view))
        view->stats.number = number;
    if (status == HG_OK)
        a->key = key;
    return status;
}

// A real-time preview of the new state, until the path tracer has samples.
static enum hg_status draw_preview(
    struct hg_view_state *view, const struct hg_draw_request *asked, struct hg_error *err)
{
    struct hg_draw_request request = *asked;
    request.samples = request.max_samples = 1;
    request.flags |= HG_DRAW_ACCUMULATE; // the film is shown over it
    view->gi.gathered = view->gi.gathered && hg_gather_view_is_done(view); // else of another state
    restart(view);
    const enum hg_status status = draw_shown(view, &request, true, err);
    view->accumulation.samples = 0;
    view->path_preview = status == HG_OK;
    return status;
}

// A client subscribed to a view that was rendering in the background, while some of its pixels have
// no sample.
static bool lacks_preview(const struct hg_view_state *view)
{
    return !view->final && !view->path_begins && !view->path_preview &&
           hg_path_samples(view->path) == 0;
}

static enum hg_status draw_path(
    struct hg_view_state *view, uint32_t max_samples, struct hg_error *err)
{
    struct hg_view_key key = present_key(view);
    const bool known = memcmp(&key, &view->accumulation.key, sizeof key) == 0;
    const bool blank = known && lacks_preview(view);
    const bool posed = known && !blank && hg_path_is_posed(view->path) && !view->path_begins;
    enum hg_status status = HG_OK;
    struct hg_draw_request request = make_request(view, max_samples);
    request.flags &= ~(uint32_t)HG_DRAW_WAIT;
    request.flags |= view->final || known ? HG_DRAW_WAIT : 0;
    deform_for_motion(view);
    if (!posed)
        status = sync(view, &request, err);
    if (status != HG_OK || (bakes(view) && view->final))
        return status;
    key = present_key(view);
    const bool changed = memcmp(&key, &view->accumulation.key, sizeof key) != 0;
    if (changed) {
        restart(view);
        view->path_begins = true;
        view->path_preview = false;
        view->accumulation.key = key;
    }
    if (blank || (changed && !view->final))
        return draw_preview(view, &request, err);
    if (bakes(view))
        return HG_OK; // the path tracer uses the geometry that is resident in the end
    const bool begins = view->path_begins;
    view->path_begins = false;
    uint64_t changes = 0;
    status = hg_path_view_step(view, &request, begins, &changes, err);
    view->path_begins |= status != HG_OK;
    view->stats.number += changes;
    view->accumulation.samples = hg_path_samples(view->path);
    return status;
}

// The planes of a real-time picture that is drawn; nothing of it changes.
static enum hg_status draw_planes(struct hg_view_state *view, struct hg_error *err)
{
    const bool begins = view->path_begins;
    uint64_t changes;
    struct hg_draw_request request = make_request(view, 1);
    request.flags |= HG_DRAW_WAIT;
    enum hg_status status = sync(view, &request, err); // other views may have posed the scene
    if (status != HG_OK || !is_known(view))
        return status;
    view->path_begins = false;
    status = hg_path_view_step(view, &request, begins, &changes, err);
    view->path_begins |= status != HG_OK;
    view->stats.number += hg_path_done(view->path) ? 1 : 0; // planes are shown once they are whole
    return status;
}

// A picture in motion keeps the exposure that was metered last: its own is metered when it rests,
// and before anything is drawn where only the settled picture is displayed.
static bool meters(const struct hg_view_state *view)
{
    return hg_meter_is_due(view) && (view->final || (is_known(view) && !bakes(view)));
}

static enum hg_status meter(struct hg_view_state *view, uint32_t max_samples, struct hg_error *err)
{
    struct hg_draw_request request = make_request(view, max_samples);
    request.flags |= HG_DRAW_WAIT;
    const enum hg_status status = sync(view, &request, err);
    if (status != HG_OK || bakes(view)) // of the geometry that is resident in the end
        return status;
    return hg_meter_step(view, &request, err);
}

static enum hg_status draw_mode(
    struct hg_view_state *view, uint32_t max_samples, struct hg_error *err)
{
    if (meters(view)) {
        if (!hg_path_lease_take(view))
            return HG_OK;
        const enum hg_status status = meter(view, max_samples, err);
        hg_meter_let_go(view);
        return status;
    }
    if (view->settings.mode == HG_VIEW_MODE_PATH)
        return draw_path(view, max_samples, err);
    return keeps_planes(view) && is_drawn(view) && !bakes(view)
               ? draw_planes(view, err)
               : draw(view, max_samples, false, err);
}

// Of a state that differs by more than the light that has been gathered for it.
static bool is_other(const struct hg_view_state *view)
{
    struct hg_view_key key = present_key(view);
    key.gi = view->accumulation.key.gi;
    return memcmp(&key, &view->accumulation.key, sizeof key) != 0;
}

// Exposure and light of a view at rest take seconds. Pictures like those in motion, but of the
// whole size and with all rays, come first: history antialiases them, and textures arrive.
static bool sharpens(const struct hg_view_state *view)
{
    const struct hg_view_settings *s = &view->settings;
    const struct hg_tiled_accumulation *a = &view->accumulation;
    const uint32_t most = a->pages.missing > 0 ? MOST_STILL_PICTURES : STILL_PICTURES;
    return !view->final && s->mode == HG_VIEW_MODE_REALTIME && s->debug == 0 &&
           s->temporal != HG_VIEW_TEMPORAL_NONE && a->phase == HG_VIEW_DIRECT && is_known(view) &&
           view->motion.still < most && (!hg_gi_view_is_done(view) || hg_meter_is_due(view));
}

// The first picture of a view in motion finds the pages that it needs; without any of them it would
// have no colours. It is drawn again with those that come soon.
static enum hg_status draw_opening(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_tiled_accumulation *a = &view->accumulation;
    if (a->phase != HG_VIEW_DIRECT || a->pages.missing == 0)
        return HG_OK;
    const struct hg_draw_request request = make_request(view, 1);
    const struct hg_draw shown = hg_view_draw(view, &request);
    const uint64_t number = view->stats.number;
    enum hg_status status = hg_tiled_accumulation_await(&shown, OPENING_WAIT_NS, err);
    a->key = (struct hg_view_key){0};
    if (status == HG_OK)
        status = draw(view, 1, false, err);
    view->stats.number = number;
    return status;
}

enum hg_status hg_view_state_step(
    struct hg_view_state *view, uint32_t max_samples, struct hg_error *err)
{
    if (hg_view_state_settled(view))
        return HG_OK;
    const uint64_t start = hg_clock_now_ns();
    const bool sharp = sharpens(view);
    view->motion.still = is_other(view) ? 0 : view->motion.still + (sharp ? 1 : 0);
    const bool moves =
        max_samples <= 1 && !view->final && !is_known(view) && view->motion.still == 0;
    const bool adapts = hg_view_state_only_adapts(view), opens = view->stats.number == 0;
    view->stats.stage_count = 0;
    view->stats.waits = false;
    const uint32_t most = max_samples > 0 ? max_samples : 1;
    // Pixels of phase DIRECT are as they were drawn.
    if (moves || sharp || (view->accumulation.phase != HG_VIEW_DIRECT && !is_rougher(view)))
        hg_meter_adapt(view, adapts);
    if (moves)
        hg_path_lease_note_motion(view);
    enum hg_status status = adapts  ? HG_OK
                            : sharp ? draw(view, 1, true, err)
                                    : draw_mode(view, most, err);
    if (status == HG_OK && opens)
        status = draw_opening(view, err);
    view->stats.step_ns = hg_clock_now_ns() - start;
    if (status == HG_OK)
        hg_view_stats_add_device(&view->stats, view->context->gpu);
    if (status == HG_OK && moves)
        hg_governor_note(view);
    if (hg_view_state_settled(view))
        hg_lighting_rest(view->lighting);
    if (status != HG_OK) { // the accumulation may be incomplete
        restart(view);
        view->accumulation.key = (struct hg_view_key){0};
        // It is unknown which shadow maps were drawn.
        hg_tiled_accumulation_mark_shadows(view->lighting, true);
        view->unlit.tiles.seen = 0;
        hg_frame_history_forget(&view->history);
        hg_temporal_view_forget(&view->motion.temporal);
        if (view->targets.graph != NULL)
            hg_graph_reset(view->targets.graph);
        if (view->motion.temporal.targets.graph != NULL)
            hg_graph_reset(view->motion.temporal.targets.graph);
        if (view->prefetch.targets.graph != NULL)
            hg_graph_reset(view->prefetch.targets.graph);
        if (view->buffers.grid.graph != NULL)
            hg_graph_reset(view->buffers.grid.graph);
    }
    return status;
}
