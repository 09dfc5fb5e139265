// view.c - see view.h.
#include "renderer/frame/view.h"

#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/frame/frame.h"
#include "renderer/frame/path_view.h"
#include "renderer/geometry/pose_snapshot.h"
#include "renderer/passes/pick.h"
#include "renderer/passes/shade.h"
#include "renderer/passes/skin.h"
#include "renderer/passes/visibility.h"

static const struct {
    VkFormat format;
    uint32_t bytes;
    const char *name;
} formats[3] = {{VK_FORMAT_R8G8B8A8_UNORM, 4, "pixels 8"},
    {VK_FORMAT_R16G16B16A16_UNORM, 8, "pixels 16"},
    {VK_FORMAT_R32G32B32A32_SFLOAT, 16, "pixels 32"}};

// --- images --------------------------------------------------------------------------------------

static void destroy_extras(struct hg_view_state *view)
{
    struct hg_gpu *gpu = view->context->gpu;
    hg_gpu_image_destroy(gpu, &view->targets.behind);
    for (int i = 0; i < 3; i++)
        hg_gpu_image_destroy(gpu, &view->targets.pixels[i]);
    hg_tiled_accumulation_finish(gpu, &view->stream);
    hg_gpu_buffer_destroy(gpu, &view->readback);
}

static enum hg_status create_image(struct hg_view_state *view, uint32_t width, uint32_t height,
    VkFormat format, const char *name, struct hg_gpu_image *out, struct hg_error *err)
{
    const struct hg_gpu_image_params params = {
        .format = format, .width = width, .height = height, .attachment = true, .name = name};
    return hg_gpu_image_create(view->context->gpu, &params, out, err);
}

// New images first, so that a refusal leaves the old ones.
static enum hg_status resize(
    struct hg_view_state *view, uint32_t width, uint32_t height, struct hg_error *err)
{
    struct hg_gpu *gpu = view->context->gpu;
    if (view->targets.visibility.width == width && view->targets.visibility.height == height)
        return HG_OK;
    struct hg_gpu_image images[3] = {0};
    enum hg_status status =
        create_image(view, width, height, HG_VISIBILITY_FORMAT, "visibility", &images[0], err);
    if (status == HG_OK)
        status = create_image(view, width, height, HG_DEPTH_FORMAT, "depth", &images[1], err);
    if (status == HG_OK) {
        status = create_image(view, width, height, HG_COLOR_FORMAT, "accumulated", &images[2], err);
    }
    if (status != HG_OK) {
        for (int i = 0; i < 3; i++)
            hg_gpu_image_destroy(gpu, &images[i]);
        return status == HG_E_NOMEM ? hg_error_set(err, HG_E_LIMIT, "view", "size",
                                          "no memory for %ux%u px", width, height)
                                    : status;
    }
    hg_gpu_image_destroy(gpu, &view->targets.visibility);
    hg_gpu_image_destroy(gpu, &view->targets.depth);
    hg_gpu_image_destroy(gpu, &view->targets.accumulated);
    destroy_extras(view);
    view->targets.visibility = images[0];
    view->targets.depth = images[1];
    view->targets.accumulated = images[2];
    return HG_OK;
}

// --- life ----------------------------------------------------------------------------------------

enum hg_status hg_view_state_init(struct hg_view_state *view, struct hg_frame_context *context,
    struct hg_scene *scene, struct hg_error *err)
{
    *view = (struct hg_view_state){
        .context = context, .layer_limit = HG_VIEW_FIRST_LAYERS, .dark_wait = HG_VIEW_DARK_AFTER};
    const struct hg_lighting_params lighting = {.store = context->store};
    enum hg_status status = hg_scene_gpu_ref(context, scene, &view->scene_gpu, err);
    if (status == HG_OK)
        status = hg_lighting_create(context->gpu, context->jobs, &lighting, &view->lighting, err);
    if (status == HG_OK)
        status = hg_culling_create(context->gpu, &view->visible, err);
    if (status == HG_OK)
        status = hg_culling_create(context->gpu, &view->pick_visible, err);
    if (status == HG_OK) {
        status = hg_gpu_buffer_create(context->gpu, HG_GPU_BUFFER_UPLOAD,
            HG_VIEW_MAX_SAMPLES_PER_STEP * HG_FRAME_SLOT_BYTES, "frame blocks", &view->blocks, err);
    }
    if (status == HG_OK) {
        status = hg_gpu_buffer_create(context->gpu, HG_GPU_BUFFER_READBACK,
            sizeof(struct hg_gpu_pick), "pick", &view->pick, err);
    }
    if (status == HG_OK) {
        status = hg_gpu_buffer_create(context->gpu, HG_GPU_BUFFER_READBACK,
            HG_VIEW_MAX_SAMPLES_PER_STEP * sizeof(uint32_t), "layers", &view->layers_full, err);
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
    hg_path_destroy(view->path);
    hg_graph_destroy(view->targets.graph);
    hg_frame_history_finish(&view->history);
    hg_gpu_image_destroy(gpu, &view->targets.visibility);
    hg_gpu_image_destroy(gpu, &view->targets.depth);
    hg_gpu_image_destroy(gpu, &view->targets.accumulated);
    hg_gpu_buffer_destroy(gpu, &view->blocks);
    hg_gpu_buffer_destroy(gpu, &view->pick);
    hg_gpu_buffer_destroy(gpu, &view->layers_full);
    hg_prefetch_finish(gpu, &view->ahead);
    hg_unlit_tiles_finish(gpu, &view->dark);
    hg_culling_destroy(view->visible);
    hg_culling_destroy(view->pick_visible);
    hg_lighting_destroy(view->lighting);
    hg_scene_gpu_unref(view->context, view->scene_gpu);
    *view = (struct hg_view_state){0};
}

// Of a path-traced picture only what reading its pixels does with them differs.
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
    if (view->settings.width != settings->width || view->settings.height != settings->height)
        view->samples = 0; // new images
    const bool differs = memcmp(&view->settings, settings, sizeof *settings) != 0;
    if (differs && view->number > 0 && differs_when_read(&view->settings, settings)) {
        view->number++; // what was followed stays
    } else if (differs) {
        view->settings_revision++;
        view->path_begins = true; // the film is of another picture, perhaps of another size
    }
    view->settings = *settings;
    return HG_OK;
}

void hg_view_state_look(struct hg_view_state *view, const struct hg_view_camera_state *camera)
{
    struct hg_view_camera_state old = view->camera;
    old.input_seq = camera->input_seq;
    if (memcmp(&old, camera, sizeof old) != 0)
        view->camera_revision++;
    view->camera = *camera;
}

// --- step ----------------------------------------------------------------------------------------

static struct hg_view_key present_key(const struct hg_view_state *view)
{
    return (struct hg_view_key){.scene = view->scene_gpu->scene->revision,
        .environment = view->scene_gpu->scene->environment.revision,
        .geometry = view->scene_gpu->geometry_revision,
        .settings = view->settings_revision,
        .camera = view->camera_revision};
}

static bool bakes(const struct hg_view_state *view)
{
    return hg_geometry_baking(view->scene_gpu->geometry) > 0;
}

static bool is_known(const struct hg_view_state *view)
{
    const struct hg_view_key key = present_key(view);
    return view->number > 0 && memcmp(&key, &view->key, sizeof key) == 0;
}

// The real-time picture has all of its samples.
static bool is_drawn(const struct hg_view_state *view)
{
    return is_known(view) && view->samples >= view->settings.samples && !view->coarse &&
           !view->shallow && !view->direct && !view->stream.inexact && !view->eased &&
           !view->clipped && view->missing_clusters == 0;
}

// Planes of a real-time picture are seen by paths that end where they begin, once it is drawn.
static bool keeps_planes(const struct hg_view_state *view)
{
    return view->settings.mode != HG_VIEW_MODE_PATH && view->settings.path.planes != 0;
}

// Nothing is left to do with the geometry that is there.
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

bool hg_view_state_settled(const struct hg_view_state *view)
{
    return is_complete(view) && !bakes(view);
}

static bool needs_cascades(const struct hg_view_state *view)
{
    uint32_t count;
    const struct hg_shadow_map *maps = hg_lighting_shadow_maps(view->lighting, &count);
    for (uint32_t i = 0; i < count; i++) {
        if (maps[i].stale && maps[i].refines)
            return true;
    }
    return false;
}

static void collect_times(struct hg_view_state *view)
{
    struct hg_gpu_stage_time times[HG_GPU_MAX_STAGES];
    const uint32_t count = hg_gpu_stage_times(view->context->gpu, times);
    for (uint32_t i = 0; i < count; i++)
        hg_view_add_stage(view, times[i].name, times[i].ns);
}

// In motion geometry may be coarser, so that frames keep to their time.
static void choose_error(struct hg_view_state *view, uint32_t max_samples)
{
    const struct hg_view_settings *s = &view->settings;
    const struct hg_view_key key = present_key(view);
    const bool moves =
        max_samples == 1 && !view->final && memcmp(&key, &view->key, sizeof key) != 0;
    if (key.camera != view->key.camera)
        hg_culling_relax(view->visible);
    view->wait = max_samples > 1 || view->final || (view->stream.exact && !moves);
    view->error_px =
        moves ? hg_quality_error_px(&view->quality, s->error_px, s->target_ms) : s->error_px;
}

static enum hg_status make_pixels(struct hg_view_state *view, uint32_t format, struct hg_error *err)
{
    const uint64_t px =
        (uint64_t)view->targets.accumulated.width * view->targets.accumulated.height;
    const enum hg_status status = hg_view_make_image(
        view, formats[format].format, formats[format].name, &view->targets.pixels[format], err);
    return status == HG_OK ? hg_gpu_buffer_reserve(view->context->gpu, HG_GPU_BUFFER_READBACK,
                                 px * formats[format].bytes, "readback", &view->readback, err)
                           : status;
}

static void record_copy(struct hg_view_state *view, struct hg_gpu_cmd *cmd, uint32_t format)
{
    const struct hg_gpu_region all = {
        .width = view->targets.accumulated.width, .height = view->targets.accumulated.height};
    hg_gpu_image_read(cmd, &view->targets.pixels[format], &all, &view->readback, 0);
}

// Whether the next sample, of a picture that moves, need not be accumulated.
static bool goes_direct(const struct hg_view_state *view)
{
    return !view->accumulate && view->settings.debug == 0 &&
           (view->coarse || view->settings.samples > 1);
}

// Samples of the whole picture with the texels that are there.
static enum hg_status draw_shown(
    struct hg_view_state *view, bool changed, uint32_t max_samples, struct hg_error *err)
{
    struct hg_page_cache *pages = hg_textures_cache(view->scene_gpu->textures);
    struct hg_gpu_cmd *cmd;
    if (changed || view->coarse || view->direct || view->shallow || view->stream.inexact ||
        view->eased || view->clipped || view->missing_clusters > 0)
        view->samples = 0;
    view->eased = view->error_px > view->settings.error_px;
    const bool moves = changed && max_samples == 1 && !view->final;
    view->coarse = moves && needs_cascades(view);
    view->direct = moves && goes_direct(view);
    uint32_t count = view->settings.samples - view->samples;
    count = count < max_samples ? count : max_samples;
    count = count < HG_VIEW_MAX_SAMPLES_PER_STEP ? count : HG_VIEW_MAX_SAMPLES_PER_STEP;
    count = view->stream.on ? 1 : count;
    enum hg_status status = make_pixels(view, 0, err);
    if (status == HG_OK)
        status = hg_frame_cull(view, HG_FRAME_PICTURE, count, err);
    view->clipped = view->crowded && view->settings.debug == 0;
    if (status == HG_OK && view->clipped && view->final)
        return hg_tiled_accumulation_begin_exact(view, err);
    if (status == HG_OK)
        status = hg_gpu_begin(view->context->gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    count = view->clipped ? 1 : hg_frame_batch(view, count);
    memset(view->layers_full.mapped, 0, HG_VIEW_MAX_SAMPLES_PER_STEP * sizeof(uint32_t));
    hg_page_cache_begin(pages, cmd);
    status = hg_frame_record(view, cmd, count, err);
    if (status != HG_OK) {
        hg_gpu_discard(view->context->gpu, cmd);
        return status;
    }
    if (view->direct)
        record_copy(view, cmd, 0);
    hg_page_cache_end(pages, cmd);
    status = hg_gpu_submit_and_wait(view->context->gpu, cmd, err);
    if (status != HG_OK)
        return status;
    hg_geometry_deforms_done(view->scene_gpu->geometry);
    hg_geometry_triangle_cache_done(view->scene_gpu->geometry);
    hg_frame_note_drawn(view, count);
    view->samples += count;
    view->number++;
    status = hg_frame_history_note(view, err);
    if (status == HG_OK)
        status = hg_tiled_accumulation_shown(view, err);
    const bool ahead = changed && max_samples == 1 && view->settings.debug == 0;
    return status == HG_OK && ahead ? hg_prefetch_draw(view, err) : status;
}

// A new state. What nobody looks at yet is not drawn with coarser texels first.
static enum hg_status start_anew(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_tiled_accumulation *s = &view->stream;
    hg_tiled_accumulation_restart(view);
    s->on = !hg_page_cache_is_complete(hg_textures_cache(view->scene_gpu->textures));
    if (!s->on || !view->final || view->settings.debug != 0)
        return HG_OK;
    view->coarse = false;
    return hg_tiled_accumulation_begin_exact(view, err);
}

// Moving parts are needed at other times than that of the pose.
static void deform_for_motion(struct hg_view_state *view)
{
    if (hg_path_view_needs_time(view) && hg_geometry_deform_all(view->scene_gpu->geometry))
        view->scene_gpu->scene_revision = UINT64_MAX;
}

static enum hg_status draw(struct hg_view_state *view, uint32_t max_samples, struct hg_error *err)
{
    choose_error(view, max_samples);
    if (keeps_planes(view))
        deform_for_motion(view);
    enum hg_status status = hg_frame_sync(view, err);
    if (status != HG_OK || (bakes(view) && (view->final || is_drawn(view))))
        return status;
    const struct hg_view_key key = present_key(view);
    const bool blank =
        hg_tiled_accumulation_is_blank(view) && !view->final; // somebody wants to look now
    const bool changed = (view->number == 0 && !view->stream.exact) ||
                         memcmp(&key, &view->key, sizeof key) != 0 || blank;
    view->path_begins |= changed;
    if (changed)
        status = start_anew(view, err);
    else if (!view->stream.exact && !view->direct)
        status = hg_tiled_accumulation_rest(view, err);
    if (status == HG_OK)
        status = view->stream.exact ? hg_tiled_accumulation_draw(view, max_samples, err)
                                    : draw_shown(view, changed, max_samples, err);
    if (status == HG_OK && view->stream.exact && view->shallow) { // all of it lacks layers
        status = start_anew(view, err);
        if (status == HG_OK && !view->stream.exact)
            status = draw_shown(view, true, max_samples, err);
        view->shallow &= !view->stream.exact;
    }
    if (view->stream.exact)
        view->eased = view->error_px > view->settings.error_px;
    if (status == HG_OK)
        view->key = key;
    return status;
}

// A picture of the new state at once, until light has been followed.
static enum hg_status draw_preview(struct hg_view_state *view, struct hg_error *err)
{
    const uint32_t samples = view->settings.samples;
    hg_tiled_accumulation_restart(view);
    view->settings.samples = 1;
    view->accumulate = true;
    enum hg_status status = draw_shown(view, true, 1, err);
    view->accumulate = false;
    view->settings.samples = samples;
    view->samples = 0;
    view->path_preview = status == HG_OK;
    return status;
}

// Somebody looks at a picture that was begun for nobody, while pixels of it lack their first
// sample.
static bool lacks_preview(const struct hg_view_state *view)
{
    return !view->final && !view->path_begins && !view->path_preview &&
           hg_path_samples(view->path) == 0;
}

static enum hg_status draw_path(
    struct hg_view_state *view, uint32_t max_samples, struct hg_error *err)
{
    struct hg_view_key key = present_key(view);
    const bool known = memcmp(&key, &view->key, sizeof key) == 0;
    const bool blank = known && lacks_preview(view);
    const bool posed = known && !blank && hg_path_is_posed(view->path) && !view->path_begins;
    enum hg_status status = HG_OK;
    choose_error(view, max_samples);
    view->wait = view->final || known;
    deform_for_motion(view);
    if (!posed)
        status = hg_frame_sync(view, err);
    if (status != HG_OK || (bakes(view) && view->final))
        return status;
    key = present_key(view);
    const bool changed = memcmp(&key, &view->key, sizeof key) != 0;
    if (changed) {
        hg_tiled_accumulation_restart(view);
        view->path_begins = true;
        view->path_preview = false;
        view->samples = 0;
        view->key = key;
    }
    if (blank || (changed && !view->final))
        return draw_preview(view, err);
    if (bakes(view))
        return HG_OK; // light is followed through what is there at last
    const bool begins = view->path_begins;
    view->path_begins = false;
    status = hg_path_view_step(view, begins, err);
    view->path_begins |= status != HG_OK;
    return status;
}

// The planes of a real-time picture that is drawn; nothing of it changes.
static enum hg_status draw_planes(struct hg_view_state *view, struct hg_error *err)
{
    const struct hg_view_key key = view->key;
    const uint32_t samples = view->samples;
    const uint64_t number = view->number;
    const bool on = view->stream.on, begins = view->path_begins;
    view->wait = true;
    enum hg_status status = hg_frame_sync(view, err); // others may have posed the scene
    const struct hg_view_key now = present_key(view);
    if (status != HG_OK || memcmp(&key, &now, sizeof key) != 0)
        return status;
    view->path_begins = false;
    status = hg_path_view_step(view, begins, err);
    view->path_begins |= status != HG_OK;
    view->samples = samples;
    view->number = number + (hg_path_done(view->path) ? 1 : 0);
    view->stream.on = on;
    return status;
}

static enum hg_status draw_mode(
    struct hg_view_state *view, uint32_t max_samples, struct hg_error *err)
{
    if (view->settings.mode == HG_VIEW_MODE_PATH)
        return draw_path(view, max_samples, err);
    return keeps_planes(view) && is_drawn(view) && !bakes(view) ? draw_planes(view, err)
                                                                : draw(view, max_samples, err);
}

enum hg_status hg_view_state_step(
    struct hg_view_state *view, uint32_t max_samples, struct hg_error *err)
{
    if (hg_view_state_settled(view))
        return HG_OK;
    const uint64_t start = hg_clock_now_ns();
    const struct hg_view_key key = present_key(view);
    const bool moves =
        max_samples <= 1 && !view->final && memcmp(&key, &view->key, sizeof key) != 0;
    view->stage_count = 0;
    const uint32_t most = max_samples > 0 ? max_samples : 1;
    enum hg_status status = draw_mode(view, most, err);
    view->step_ns = hg_clock_now_ns() - start;
    if (status == HG_OK && moves)
        hg_quality_note(
            &view->quality, (float)((double)view->step_ns * 1e-6), view->settings.target_ms);
    if (status == HG_OK)
        collect_times(view);
    if (status != HG_OK) { // what was accumulated may be incomplete
        view->samples = 0;
        hg_tiled_accumulation_restart(view);
        view->key = (struct hg_view_key){0};
        hg_view_mark_shadows(view, true); // nobody knows which were drawn
        view->dark.seen = 0;
        hg_frame_history_forget(&view->history);
        if (view->targets.graph != NULL)
            hg_graph_reset(view->targets.graph);
    }
    return status;
}

// --- reading -------------------------------------------------------------------------------------

// Brings the pixels to `readback`.
static enum hg_status fetch_pixels(
    struct hg_view_state *view, uint32_t format, struct hg_error *err)
{
    struct hg_gpu_cmd *cmd;
    enum hg_status status = make_pixels(view, format, err);
    if (status == HG_OK)
        status = hg_gpu_begin(view->context->gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    status = hg_frame_record_read(view, cmd, format, err);
    if (status != HG_OK) {
        hg_gpu_discard(view->context->gpu, cmd);
        return status;
    }
    return hg_gpu_submit_and_wait(view->context->gpu, cmd, err);
}

// Other pixels than those that were drawn at once: the sample again, accumulated.
static enum hg_status draw_accumulated(struct hg_view_state *view, struct hg_error *err)
{
    view->accumulate = true;
    const enum hg_status status = draw(view, 1, err);
    view->accumulate = false;
    return status;
}

enum hg_status hg_view_state_read(
    struct hg_view_state *view, uint32_t format, struct hg_refbuf **out, struct hg_error *err)
{
    *out = NULL;
    const bool path = view->settings.mode == HG_VIEW_MODE_PATH;
    if (path ? view->number == 0 : view->samples == 0 && !view->stream.has_fallback)
        return hg_error_set(err, HG_E_STATE, "view", NULL, "nothing was rendered yet");
    const uint64_t size = (uint64_t)view->targets.accumulated.width *
                          view->targets.accumulated.height * formats[format].bytes;
    const bool ready = format == 0 && view->key.settings == view->settings_revision;
    enum hg_status status = HG_OK;
    if (path)
        status = hg_path_view_show(view, err);
    else if (view->direct && !ready)
        status = draw_accumulated(view, err);
    if (status == HG_OK && !view->direct)
        status = fetch_pixels(view, format, err);
    if (status != HG_OK)
        return status;
    *out = hg_refbuf_create(size);
    if (*out == NULL)
        return hg_error_set(err, HG_E_NOMEM, "pixels", NULL, "out of host memory");
    memcpy((*out)->data, view->readback.mapped, size);
    return HG_OK;
}

// Where a shutter has brought the geometry elsewhere, back to the scene.
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
    if (view->number == 0 || (view->settings.mode != HG_VIEW_MODE_PATH && view->samples == 0 &&
                                 !view->stream.has_fallback))
        return hg_error_set(err, HG_E_STATE, "view", NULL, "nothing was rendered yet");
    if (x >= view->targets.visibility.width || y >= view->targets.visibility.height)
        return hg_error_set(err, HG_E_INVAL, "pick", "x, y", "outside the view");
    const VkRect2D pixel = {{(int32_t)x, (int32_t)y}, {1, 1}};
    struct hg_gpu_cmd *cmd;
    enum hg_status status = unpose(view, err);
    if (status == HG_OK)
        status = hg_frame_cull_part(view, pixel, view->pick_visible, err);
    if (status == HG_OK)
        status = hg_gpu_begin(view->context->gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    memset(view->pick.mapped, 0, sizeof *out);
    status = hg_frame_record_pick(view, cmd, pixel, err);
    if (status != HG_OK) {
        hg_gpu_discard(view->context->gpu, cmd);
        return status;
    }
    status = hg_gpu_submit_and_wait(view->context->gpu, cmd, err);
    if (status == HG_OK) {
        memcpy(out, view->pick.mapped, sizeof *out);
        const float position[3] = {out->position_ws.x, out->position_ws.y, out->position_ws.z};
        out->triangle = hg_geometry_source_primitive(
            view->scene_gpu->geometry, out->draw_plus_one - 1, out->triangle, position);
    }
    return status;
}
