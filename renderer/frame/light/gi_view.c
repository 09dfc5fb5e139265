// gi_view.c - see gi_view.h.
#include "renderer/frame/light/gi_view.h"

#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "renderer/frame/light/gather_view.h"
#include "renderer/frame/paths/path_lease.h"
#include "renderer/frame/quality/governor.h"
#include "renderer/passes/skin.h"

#define SETTLE_RAYS  60000 // of a step at rest: about a tenth of a second of two cores
#define DYNAMIC_RAYS 8000  // of a picture in motion
#define LEAST_RAYS   256   // also of one of many

static struct hg_gi_key key_of(const struct hg_view_state *view)
{
    const struct hg_scene_gpu *s = view->scene_gpu;
    return (struct hg_gi_key){.scene = s->scene->revision,
        .environment = s->scene->environment.revision,
        .geometry = s->geometry_revision};
}

static bool is_refused(const struct hg_view_state *view, const struct hg_gi_refusal *r)
{
    const struct hg_gi_key key = key_of(view);
    return r->is_set && (r->is_of_device || !view->final) && r->width == view->settings.width &&
           r->height == view->settings.height && memcmp(&key, &r->key, sizeof key) == 0;
}

// Whether pictures have light from probes: parameter gi asks for it, and memory sufficed.
static bool is_on(const struct hg_view_state *view)
{
    const struct hg_view_settings *s = &view->settings;
    return s->gi != 0 && s->mode == HG_VIEW_MODE_REALTIME &&
           !is_refused(view, &view->gi.field_refused);
}

// The rays of the picture, which probes are placed by.
static struct hg_gi_eye eye_of(const struct hg_view_state *view)
{
    const struct hg_view_settings *s = &view->settings;
    const struct hg_camera_setup setup =
        hg_scene_gpu_camera(view->scene_gpu, &view->camera, s->width, s->height);
    struct hg_gpu_camera c;
    hg_camera_fill(&setup, &c);
    const float width = (float)s->width, height = (float)s->height;
    const struct hg_vec3 from = c.orthographic != 0 ? c.forward_ws : c.eye_ws;
    return (struct hg_gi_eye){.view = hg_gi_view_id(view),
        .eye = {from.x, from.y, from.z},
        .corner = {c.ray_origin_ws.x, c.ray_origin_ws.y, c.ray_origin_ws.z},
        .across = {c.ray_x_ws.x * width, c.ray_x_ws.y * width, c.ray_x_ws.z * width},
        .down = {c.ray_y_ws.x * height, c.ray_y_ws.y * height, c.ray_y_ws.z * height},
        .parallel = c.orthographic};
}

uint64_t hg_gi_view_id(const struct hg_view_state *view)
{
    return (uint64_t)(uintptr_t)view;
}

bool hg_gi_view_has_settled(const struct hg_view_state *view)
{
    const struct hg_gi_key key = key_of(view);
    if (view->scene_gpu->gi == NULL)
        return false;
    const struct hg_gi_eye eye = eye_of(view);
    return hg_gi_is_settled(view->scene_gpu->gi, &key, &eye);
}

// The view had the settled field for what it is to show. Its grids may be others' by now, which
// what is drawn is not the worse for.
static bool had_settled(const struct hg_view_state *view)
{
    const struct hg_gather_key key = hg_gather_view_key(view);
    return memcmp(&key, &view->gi.rested, sizeof key) == 0;
}

static bool gathers(const struct hg_view_state *view)
{
    return view->settings.gi == HG_VIEW_GI_RAYS && !is_refused(view, &view->gi.gather_refused);
}

// What is shown has reflections and light of nearby surfaces, which the settled field alone lacks.
static bool lasts(const struct hg_view_state *view)
{
    return view->motion.still > 0 && gathers(view);
}

bool hg_gi_view_is_done(const struct hg_view_state *view)
{
    return !is_on(view) || (had_settled(view) && (!gathers(view) || hg_gather_view_is_done(view)));
}

enum hg_gi_view_stage hg_gi_view_stage(const struct hg_view_state *view)
{
    if (!is_on(view) || !had_settled(view))
        return HG_GI_VIEW_DYNAMIC;
    return hg_gi_view_is_done(view) ? HG_GI_VIEW_DONE : HG_GI_VIEW_SETTLED;
}

static enum hg_status create(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_scene_gpu *s = view->scene_gpu;
    const struct hg_gi_params params = {.gpu = view->context->gpu,
        .jobs = view->context->jobs,
        .geometry = s->geometry,
        .textures = s->textures,
        .rays = s->rays,
        .budget_bytes = view->context->geometry_budget_bytes};
    return s->gi != NULL ? HG_OK : hg_gi_create(&params, &s->gi, err);
}

uint32_t hg_gi_view_rays(const struct hg_view_state *view)
{
    const float share = hg_governor_choice(view).rays;
    const uint32_t views = view->motion.sharing > 0 ? view->motion.sharing : 1;
    const uint32_t rays = (uint32_t)(share * DYNAMIC_RAYS) / views; // of one field for all of them
    return rays > LEAST_RAYS ? rays : LEAST_RAYS;
}

static enum hg_status advance(struct hg_view_state *view, bool rests, struct hg_error *err)
{
    const struct hg_gi_key key = key_of(view);
    struct hg_lighting_sources sources;
    enum hg_status status = create(view, err);
    if (status == HG_OK) // rays meet what is posed
        status = hg_skin_run(view->context->gpu, view->scene_gpu->geometry, err);
    if (status != HG_OK)
        return status;
    hg_lighting_sources(view->lighting, &sources);
    const uint32_t rays = hg_gi_view_rays(view);
    const struct hg_gi_eye eye = eye_of(view);
    return rests ? hg_gi_settle(view->scene_gpu->gi, &key, &eye, &sources, SETTLE_RAYS, err)
                 : hg_gi_update(view->scene_gpu->gi, &key, &eye, &sources, rays, err);
}

static enum hg_status refuse(struct hg_view_state *view, bool is_of_device, const char *what,
    struct hg_gi_refusal *out, struct hg_error *err)
{
    if (!out->is_set) // a scene that changes is tried with each picture
        hg_warn(FRAME, "%s: %s: %s", what, err->what, err->reason);
    *err = (struct hg_error){0};
    *out = (struct hg_gi_refusal){
        true, is_of_device, key_of(view), view->settings.width, view->settings.height};
    return HG_OK;
}

// A picture that is not displayed before it is settled depends on no budget.
static enum hg_status fail(enum hg_status status, const char *without, struct hg_error *err)
{
    const struct hg_error cause = *err;
    return hg_error_set(err, status, cause.what, cause.where[0] ? cause.where : NULL,
        "%s; gi %s needs less memory", cause.reason, without);
}

// Without memory for rays or probes a picture that is displayed is that of `none`.
static enum hg_status refuse_field(
    struct hg_view_state *view, enum hg_status status, struct hg_error *err)
{
    const bool is_of_device = status == HG_E_UNSUPPORTED;
    if (status != HG_E_LIMIT && status != HG_E_NOMEM && !is_of_device)
        return status;
    if (view->final && !is_of_device)
        return fail(status, "none", err);
    return refuse(view, is_of_device, "no global illumination", &view->gi.field_refused, err);
}

// Without memory for the film of the gathering it is that of `probes`. No budget counts the film:
// limits are those of the device's buffers.
static enum hg_status refuse_gathering(
    struct hg_view_state *view, enum hg_status status, struct hg_error *err)
{
    const bool is_of_device = status == HG_E_UNSUPPORTED || status == HG_E_LIMIT;
    hg_gather_view_finish(view);
    if (status != HG_E_NOMEM && !is_of_device)
        return status;
    if (view->final && !is_of_device)
        return fail(status, "probes", err);
    return refuse(view, is_of_device,
        "light is not gathered per pixel, and comes from probes alone", &view->gi.gather_refused,
        err);
}

enum hg_status hg_gi_view_step(
    struct hg_view_state *view, bool rests, bool *waits, struct hg_error *err)
{
    const uint64_t begin = hg_clock_now_ns();
    enum hg_status status = HG_OK;
    *waits = false;
    view->gi.field = HG_GI_NO_FIELD;
    view->gi.gathered = false;
    view->motion.reflections.world = (struct hg_gi_world){0};
    if (!is_on(view))
        return HG_OK;
    hg_gi_touch(view->scene_gpu->gi, hg_gi_view_id(view));
    const bool had = hg_gi_view_has_settled(view);
    if (!had)
        status = advance(view, rests, err);
    if (status != HG_OK)
        return refuse_field(view, status, err);
    view->gi.field_refused.is_set = false;
    const bool has = had || hg_gi_view_has_settled(view),
               shows = has && !had_settled(view) && !view->final && !lasts(view);
    view->gi.field = has ? HG_GI_SETTLED : HG_GI_DYNAMIC;
    if (has)
        view->gi.rested = hg_gather_view_key(view);
    if (had && rests && gathers(view) && !hg_gather_view_is_done(view) && hg_path_lease_take(view))
        status = hg_gather_view_step(view, err);
    if (status != HG_OK)
        status = refuse_gathering(view, status, err);
    if (status != HG_OK)
        return status;
    *waits = rests && !shows && !(has && hg_gi_view_is_done(view));
    view->gi.gathered = gathers(view) && hg_gather_view_is_done(view);
    if (view->gi.gathered)
        view->gi.gather_refused.is_set = false;
    status = hg_reflect_view_step(view, !rests, err);
    hg_view_stats_add_stage(&view->stats, "probes", hg_clock_now_ns() - begin);
    return status;
}
