// path_view.c - see path_view.h.
#include "renderer/frame/paths/path_view.h"

#include <math.h>
#include <string.h>

#include "renderer/frame/batch/batch.h"

// --- what it does for it -------------------------------------------------------------------------

static void fill(void *user)
{
    hg_frame_fill_path(user);
}

static struct hg_pass begin_batch(void *user, struct hg_gpu_cmd *cmd, bool streams)
{
    hg_frame_fill_path(user);
    return hg_frame_pass_path(user, cmd, streams);
}

static void add_stage(void *user, const char *name, uint64_t ns)
{
    struct hg_view_state *view = user;
    hg_view_stats_add_stage(&view->stats, name, ns);
}

enum hg_status hg_path_view_create(
    struct hg_view_state *view, struct hg_path **path, struct hg_error *err)
{
    const struct hg_path_host host = {.user = view,
        .camera = &view->frame.camera,
        .fill = fill,
        .begin = begin_batch,
        .add_stage = add_stage};
    if (*path == NULL)
        *path = hg_path_create(view->context, view->scene_gpu, &host);
    return *path != NULL ? HG_OK
                         : hg_error_set(err, HG_E_NOMEM, "path", NULL, "out of host memory");
}

// --- what it asks of it --------------------------------------------------------------------------

// The lens of a sensor and an f-number: f / (2 N), of a focal length f = sensor / (2 tan(fov / 2)).
// A camera of the scene that looks at no point is not focused.
static struct hg_view_camera_state camera_of(
    const struct hg_view_state *view, const struct hg_path_settings *s)
{
    struct hg_view_camera_state camera = view->camera;
    const bool focuses = camera.node == 0 || camera.focus_distance > 0.0f;
    if (s->sensor_share_m > 0.0f && !camera.orthographic && !(camera.lens_radius > 0.0f) && focuses)
        camera.lens_radius = s->sensor_share_m / tanf(0.5f * camera.vfov_rad);
    return camera;
}

struct hg_view_camera_state hg_path_view_camera(const struct hg_view_state *view)
{
    return camera_of(view, &view->settings.path);
}

static struct hg_path_request request_of(const struct hg_view_state *view, uint32_t flags)
{
    const struct hg_view_settings *metering = view->exposure.metering;
    const struct hg_view_settings *s = metering != NULL ? metering : &view->settings;
    return (struct hg_path_request){.settings = s->path,
        .camera = camera_of(view, &s->path),
        .width = s->width,
        .height = s->height,
        .region = hg_view_region(s),
        .samples = s->samples,
        .seed = s->seed,
        .error_px = s->error_px,
        .surfaces = s->mode != HG_VIEW_MODE_PATH,
        .transparent = HG_BACKGROUND_IS_CLEAR(s->background),
        .watched = !view->final && metering == NULL,
        .aside = metering != NULL,
        .ground = s->ground != 0,
        .build_wait_ns = (flags & HG_DRAW_WAIT) != 0 ? HG_FRAME_BUILD_WAIT_NS : 0};
}

// All settings that samples depend on, without the stopping criteria.
static enum hg_status hash_state(const struct hg_view_state *view, uint8_t out[HG_SHA256_BYTES])
{
    struct {
        struct hg_view_settings settings;
        struct hg_view_camera_state camera;
    } state;
    memset(&state, 0, sizeof state);
    memcpy(&state.settings, &view->settings, sizeof state.settings);
    memcpy(&state.camera, &view->camera, sizeof state.camera);
    state.camera.input_seq = 0;
    state.settings.exposure = state.settings.target_ms = 0.0f;
    state.settings.tonemap = 0;
    state.settings.path.time_s = 0.0f;
    return hg_sha256(&state, sizeof state, out);
}

// Hierarchies may be built between loading and the first wave: geometry is not compared.
static enum hg_status identify(
    const struct hg_view_state *view, struct hg_path_identity *out, struct hg_error *err)
{
    const struct hg_scene *scene = view->scene_gpu->scene;
    *out = (struct hg_path_identity){.scene = {scene->revision, scene->environment.revision,
                                         view->settings_revision, view->camera_revision}};
    const enum hg_status status = hash_state(view, out->state);
    return status == HG_OK ? HG_OK
                           : hg_error_set(err, status, "checkpoint", NULL, "cannot be hashed");
}

bool hg_path_view_needs_time(const struct hg_view_state *view)
{
    const struct hg_path_request request = request_of(view, 0);
    return hg_path_needs_time(&request, view->scene_gpu);
}

static enum hg_status begin(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path_identity identity;
    const enum hg_status status = identify(view, &identity, err);
    if (status == HG_OK)
        hg_path_expect(view->path, &identity);
    return status;
}

enum hg_status hg_path_view_step(struct hg_view_state *view, const struct hg_draw_request *draw,
    bool begins, uint64_t *changes, struct hg_error *err)
{
    const struct hg_path_request request = request_of(view, draw->flags);
    enum hg_status status = hg_path_view_create(view, &view->path, err);
    const bool restart = begins || !hg_path_has_film(view->path);
    *changes = 0;
    if (status == HG_OK && restart)
        status = begin(view, err);
    if (status != HG_OK)
        return status;
    const uint64_t before = hg_path_changes(view->path);
    status = hg_path_step(view->path, &request, restart, err);
    *changes = hg_path_changes(view->path) - before;
    view->accumulation.pages.missing = status == HG_OK ? hg_path_missing(view->path) : 0;
    return status;
}

enum hg_status hg_path_view_meter(struct hg_view_state *view, const struct hg_draw_request *draw,
    bool begins, struct hg_error *err)
{
    const struct hg_path_request request = request_of(view, draw->flags);
    const enum hg_status status = hg_path_view_create(view, &view->path, err);
    return status == HG_OK
               ? hg_path_step(view->path, &request, begins || !hg_path_has_film(view->path), err)
               : status;
}

// --- what it shows -------------------------------------------------------------------------------

enum hg_status hg_path_view_show(struct hg_view_state *view, struct hg_error *err)
{
    if (view->path == NULL || view->path_begins)
        return HG_OK; // a film of another state does not replace the preview
    return hg_path_show(view->path, &view->targets.accumulated, !view->path_preview, err);
}

enum hg_status hg_path_view_film(
    const struct hg_view_state *view, struct hg_path **out, struct hg_error *err)
{
    *out = view->path;
    return hg_path_has_film(view->path) && !view->path_begins
               ? HG_OK
               : hg_error_set(err, HG_E_STATE, "view", NULL, "nothing was path-traced yet");
}

// --- checkpoints ---------------------------------------------------------------------------------

enum hg_status hg_path_view_save(
    struct hg_view_state *view, struct hg_refbuf **out, struct hg_error *err)
{
    struct hg_path_identity identity;
    struct hg_path *path;
    *out = NULL;
    if (view->settings.mode != HG_VIEW_MODE_PATH)
        return hg_error_set(err, HG_E_STATE, "view", NULL, "nothing was path-traced yet");
    enum hg_status status = hg_path_view_film(view, &path, err);
    if (status == HG_OK)
        status = identify(view, &identity, err);
    return status == HG_OK ? hg_path_save(path, &identity, out, err) : status;
}

enum hg_status hg_path_view_load(
    struct hg_view_state *view, const void *data, uint64_t size_bytes, struct hg_error *err)
{
    const struct hg_path_checkpoint checkpoint = {
        data, size_bytes, view->settings.width, view->settings.height};
    struct hg_path_identity identity;
    if (view->settings.mode != HG_VIEW_MODE_PATH)
        return hg_error_set(err, HG_E_INVAL, "checkpoint", NULL, "is for path-traced views");
    enum hg_status status = hg_path_view_create(view, &view->path, err);
    if (status == HG_OK)
        status = identify(view, &identity, err);
    if (status == HG_OK)
        status = hg_path_load(view->path, &identity, &checkpoint, err);
    view->path_begins |= status == HG_OK; // in the place of what is there
    return status;
}

enum hg_status hg_path_view_history_save(
    struct hg_view_state *view, struct hg_refbuf **out, struct hg_error *err)
{
    *out = NULL;
    if (view->path == NULL)
        return hg_error_set(err, HG_E_STATE, "view", NULL, "has no settled picture of a series");
    return hg_path_history_save(view->path, out, err);
}

enum hg_status hg_path_view_history_load(
    struct hg_view_state *view, const void *data, uint64_t size_bytes, struct hg_error *err)
{
    if (view->settings.mode != HG_VIEW_MODE_PATH ||
        view->settings.path.denoise != HG_PATH_DENOISE_SERIES)
        return hg_error_set(err, HG_E_INVAL, "history", NULL, "is for views that make a series");
    const enum hg_status status = hg_path_view_create(view, &view->path, err);
    return status == HG_OK ? hg_path_history_load(view->path, data, size_bytes, err) : status;
}
