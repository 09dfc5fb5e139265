// meter.c - see meter.h.
#include "renderer/frame/exposure/meter.h"

#include <math.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "renderer/camera/exposure.h"
#include "renderer/frame/paths/path_view.h"
#include "renderer/light/env/sky.h"
#include "renderer/light/lights.h"

#define PLANE_COLOR    0u // enum hg_plane of renderer.h
#define PLANE_ALBEDO   1u
#define PLANE_EMISSION 6u
#define FILTER_BOX     1u           // enum hg_filter of renderer.h
#define SPREAD_PX      1.5          // of the light of noisy pixels; a pixel has 16 samples
#define LEAST_S        (1.0 / 60.0) // of a step of a view that rests
#define MOST_S         0.25         // so that a slow frame does not jump
#define CUT_COS        0.5 // of the angle that a camera turned by from one picture to the next

// --- value ---------------------------------------------------------------------------------------

static float factor_of(const struct hg_view_exposure *e)
{
    return exp2f(e->shown_ev + e->stated_ev); // as of a stated exposure
}

void hg_meter_set(struct hg_view_state *view, bool automatic, float ev)
{
    struct hg_view_exposure *e = &view->exposure;
    e->automatic = automatic;
    e->stated_ev = ev;
}

float hg_meter_ev(const struct hg_view_state *view)
{
    const struct hg_view_exposure *e = &view->exposure;
    return e->automatic ? e->shown_ev + e->stated_ev : e->stated_ev;
}

// A picture of the view's shape. Sizes of the same shape have the same one, but for rounding.
void hg_meter_size(
    const struct hg_view_settings *s, double side_px, uint32_t *width, uint32_t *height)
{
    const uint32_t longer = s->width > s->height ? s->width : s->height;
    const double scale = side_px / (double)longer;
    *width = (uint32_t)fmax(round((double)s->width * scale), 1.0);
    *height = (uint32_t)fmax(round((double)s->height * scale), 1.0);
}

static struct hg_meter_key present_key(const struct hg_view_state *view)
{
    struct hg_meter_key key = {.scene = view->scene_gpu->scene->revision,
        .environment = view->scene_gpu->scene->environment.revision,
        .geometry = view->scene_gpu->geometry_revision,
        .camera = view->camera_revision};
    hg_meter_size(&view->settings, HG_METER_SIDE_PX, &key.width, &key.height);
    return key;
}

bool hg_meter_is_due(const struct hg_view_state *view)
{
    const struct hg_meter_key key = present_key(view);
    const struct hg_view_exposure *e = &view->exposure;
    return e->automatic && view->settings.debug == 0 &&
           !(e->metered && memcmp(&key, &e->key, sizeof key) == 0);
}

bool hg_meter_is_of_scene(const struct hg_view_state *view)
{
    const struct hg_meter_key now = present_key(view), *then = &view->exposure.key;
    return now.scene == then->scene && now.environment == then->environment &&
           now.geometry == then->geometry;
}

bool hg_meter_has_begun(const struct hg_view_state *view)
{
    const struct hg_meter_key key = present_key(view);
    return hg_meter_is_due(view) && view->exposure.begun &&
           memcmp(&key, &view->exposure.begun_key, sizeof key) == 0;
}

// --- adaptation ----------------------------------------------------------------------------------

bool hg_meter_is_adapting(const struct hg_view_state *view)
{
    const struct hg_view_exposure *e = &view->exposure;
    return e->automatic && e->shown_ev != e->metered_ev;
}

static void show(struct hg_view_state *view, float ev)
{
    view->exposure.shown_ev = ev;
    view->settings.exposure = factor_of(&view->exposure);
    view->stats.number += view->stats.number > 0 ? 1 : 0;
}

void hg_meter_adapt(struct hg_view_state *view, bool rests)
{
    struct hg_view_exposure *e = &view->exposure;
    const uint64_t now = hg_clock_now_ns();
    const double since = (double)(now - e->adapted_ns) * 1e-9;
    const double seconds = fmin(fmax(since, rests ? LEAST_S : 0.0), MOST_S);
    e->adapted_ns = now;
    if (hg_meter_is_adapting(view))
        show(view,
            view->final ? e->metered_ev : hg_exposure_adapt(e->shown_ev, e->metered_ev, seconds));
}

void hg_meter_note_camera(struct hg_view_state *view, const struct hg_view_camera_state *next)
{
    const struct hg_view_camera_state *now = &view->camera;
    double dot = 0, lengths[2] = {0};
    for (int i = 0; i < 3; i++) {
        const double a = now->target[i] - now->eye[i], b = next->target[i] - next->eye[i];
        dot += a * b;
        lengths[0] += a * a;
        lengths[1] += b * b;
    }
    view->exposure.cut |= !(dot > CUT_COS * sqrt(lengths[0] * lengths[1]));
}

// What is metered of nothing is no picture that another one could be adapted from.
static bool has_shapes(const struct hg_view_state *view)
{
    float min[3], max[3];
    return hg_scene_bounds(view->scene_gpu->scene, NULL, min, max);
}

void hg_meter_take(struct hg_view_state *view, float ev)
{
    struct hg_view_exposure *e = &view->exposure;
    e->metered_ev = ev;
    e->metered = false; // for `key`, unless the caller knows better
    if (!e->adapts || e->cut || view->final)
        show(view, ev);
    e->cut = false;
    e->adapts = has_shapes(view);
}

// The picture itself stays, it is linear until it is read, but is settled once it has that value.
static void note(struct hg_view_state *view, const struct hg_meter_key *key, float ev)
{
    struct hg_view_exposure *e = &view->exposure;
    hg_meter_take(view, ev);
    e->rest = (struct hg_exposure_rest){.camera = view->camera, .known = true, .ev = ev};
    e->key = *key;
    e->metered = true;
    view->stats.number += view->stats.number > 0 ? 1 : 0;
}

// --- picture -------------------------------------------------------------------------------------

static struct hg_view_settings settings_of(
    const struct hg_view_state *view, const struct hg_meter_key *key)
{
    return (struct hg_view_settings){.width = key->width * HG_METER_SPLIT,
        .height = key->height * HG_METER_SPLIT,
        .background = HG_BACKGROUND_MODE_NONE,
        .exposure = 1.0f,
        .samples = 1,
        .error_px = HG_METER_SPLIT,
        .mode = HG_VIEW_MODE_PATH,
        .path = {.filter = FILTER_BOX,
            .filter_radius_px = 0.5f,
            .max_bounces = HG_METER_BOUNCES,
            .planes = 1u << PLANE_ALBEDO | 1u << PLANE_EMISSION,
            .trace = view->settings.mode == HG_VIEW_MODE_PATH ? view->settings.path.trace : 0,
            .frame_s = 1.0f / 24.0f}};
}

// Means over blocks of pixels, which take the place of the first of them: what is written lies
// before all that is still read.
static void take_means(float *pixels, const struct hg_view_settings *s, uint32_t channels)
{
    const uint32_t columns = s->width / HG_METER_SPLIT, rows = s->height / HG_METER_SPLIT;
    for (uint32_t i = 0; i < columns * rows; i++) {
        const uint32_t x = i % columns * HG_METER_SPLIT, y = i / columns * HG_METER_SPLIT;
        float sum[4] = {0};
        for (uint32_t k = 0; k < HG_METER_SPLIT * HG_METER_SPLIT; k++) {
            const size_t from =
                (size_t)(y + k / HG_METER_SPLIT) * s->width + x + k % HG_METER_SPLIT;
            for (uint32_t c = 0; c < channels; c++)
                sum[c] += pixels[from * channels + c];
        }
        for (uint32_t c = 0; c < channels; c++)
            pixels[(size_t)i * channels + c] = sum[c] / (HG_METER_SPLIT * HG_METER_SPLIT);
    }
}

double hg_meter_sun_stops(const struct hg_scene *scene)
{
    return log2(
        (double)hg_sky_sun_luminance(&scene->environment, hg_scene_has_directional_light(scene)));
}

static enum hg_status read_value(struct hg_view_state *view, float *ev, struct hg_error *err)
{
    static const struct {
        uint32_t plane, channels;
    } planes[3] = {{PLANE_COLOR, 4}, {PLANE_ALBEDO, 3}, {PLANE_EMISSION, 3}};
    struct hg_refbuf *read[3] = {NULL};
    enum hg_status status = HG_OK;
    for (int i = 0; i < 3 && status == HG_OK; i++)
        status = hg_path_read(view->path, planes[i].plane, planes[i].channels, &read[i], err);
    if (status == HG_OK) {
        const struct hg_view_settings *s = view->exposure.metering;
        for (int i = 0; i < 3; i++)
            take_means((float *)(void *)read[i]->data, s, planes[i].channels);
        const struct hg_exposure_picture picture = {.width = s->width / HG_METER_SPLIT,
            .height = s->height / HG_METER_SPLIT,
            .color = (const float *)(const void *)read[0]->data,
            .albedo = (const float *)(const void *)read[1]->data,
            .emission = (const float *)(const void *)read[2]->data,
            .sun_stops = hg_meter_sun_stops(view->scene_gpu->scene),
            .spread_px = SPREAD_PX};
        *ev = hg_exposure_of_picture(&picture);
    }
    for (int i = 0; i < 3; i++)
        hg_refbuf_unref(read[i]);
    return status;
}

// A slice of the picture; *ev once *done.
static enum hg_status draw_slice(struct hg_view_state *view, const struct hg_draw_request *draw,
    bool begins, float *ev, struct hg_error *err)
{
    const struct hg_gpu_frame frame = view->frame; // of what is shown
    enum hg_status status = hg_path_view_meter(view, draw, begins, err);
    if (status == HG_OK && hg_path_done(view->path))
        status = read_value(view, ev, err);
    view->frame = frame;
    return status;
}

static bool is_refusal(enum hg_status status)
{
    return status == HG_E_LIMIT || status == HG_E_NOMEM || status == HG_E_UNSUPPORTED;
}

// A picture that is not displayed before it is settled depends on no budget.
static enum hg_status fail(struct hg_view_state *view, enum hg_status status, struct hg_error *err)
{
    const struct hg_error cause = *err;
    view->exposure.begun = false;
    return hg_error_set(err, status, cause.what, cause.where[0] ? cause.where : NULL,
        "%s; a fixed exposure needs none", cause.reason);
}

enum hg_status hg_meter_step(
    struct hg_view_state *view, const struct hg_draw_request *draw, struct hg_error *err)
{
    struct hg_view_exposure *e = &view->exposure;
    const struct hg_meter_key key = present_key(view);
    const bool begins = !e->begun || memcmp(&key, &e->begun_key, sizeof key) != 0;
    const struct hg_view_settings settings = settings_of(view, &key);
    float ev = 0.0f;
    if (!hg_meter_is_due(view))
        return HG_OK;
    e->begun = true;
    e->begun_key = key;
    e->metering = &settings;
    view->path_begins = true;
    enum hg_status status = draw_slice(view, draw, begins, &ev, err);
    e->metering = NULL;
    if (view->final && (status == HG_E_LIMIT || status == HG_E_NOMEM))
        return fail(view, status, err);
    if (is_refusal(status)) {
        hg_warn(FRAME, "no automatic exposure, it stays 0: %s: %s", err->what, err->reason);
        *err = (struct hg_error){0};
        note(view, &key, 0.0f);
    } else if (status == HG_OK && hg_path_done(view->path)) {
        note(view, &key, ev);
    } else if (status == HG_OK) {
        return HG_OK; // the next slice goes on
    }
    e->begun = false;
    return is_refusal(status) ? HG_OK : status;
}

void hg_meter_let_go(struct hg_view_state *view)
{
    if (view->path == NULL || !view->final || !view->exposure.metered || view->exposure.begun ||
        view->settings.mode == HG_VIEW_MODE_PATH || view->settings.path.planes != 0)
        return;
    hg_path_destroy(view->path);
    view->path = NULL;
}
