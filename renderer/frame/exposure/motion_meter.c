// motion_meter.c - see motion_meter.h.
#include "renderer/frame/exposure/motion_meter.h"

#include <float.h>
#include <math.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/camera/exposure.h"
#include "renderer/frame/exposure/meter.h"
#include "renderer/frame/light/gi_view.h"
#include "renderer/math/vec.h"

#define MOST_RAYS (HG_MOTION_METER_SIDE_PX * HG_MOTION_METER_SIDE_PX)
static_assert(MOST_RAYS <= HG_GI_MOST_CAMERA_RAYS, "");

// What exposure.h reads.
struct picture {
    float color[MOST_RAYS * 4], albedo[MOST_RAYS * 3], emission[MOST_RAYS * 3];
    struct hg_gi_camera_hit hits[MOST_RAYS];
    struct hg_gpu_ray rays[MOST_RAYS];
    uint32_t width, height;
};

// Right, up and ahead, unit.
static void find_axes(const struct hg_camera_setup *c, float axes[3][3])
{
    for (int i = 0; i < 3; i++) {
        axes[2][i] = (float)(c->target[i] - c->eye[i]);
        axes[1][i] = (float)c->up[i];
    }
    hg_normalize3(axes[2]);
    hg_cross3(axes[2], axes[1], axes[0]);
    hg_normalize3(axes[0]);
    hg_cross3(axes[0], axes[2], axes[1]);
}

static void aim(const struct hg_camera_setup *c, struct picture *p)
{
    const float aspect = (float)p->width / (float)p->height;
    const float half = c->orthographic ? c->half_height : tanf(0.5f * c->vfov_rad);
    float axes[3][3];
    find_axes(c, axes);
    for (uint32_t i = 0; i < p->width * p->height; i++) {
        const float x = 2 * ((float)(i % p->width) + 0.5f) / (float)p->width - 1;
        const float y = 1 - 2 * ((float)(i / p->width) + 0.5f) / (float)p->height;
        float at[3], to[3], aside[3] = {0};
        hg_mad3(aside, axes[0], x * half * aspect, aside);
        hg_mad3(aside, axes[1], y * half, aside);
        for (int a = 0; a < 3; a++) {
            at[a] = (float)c->eye[a] + (c->orthographic ? aside[a] : 0);
            to[a] = axes[2][a] + (c->orthographic ? 0 : aside[a]);
        }
        p->rays[i] = (struct hg_gpu_ray){.origin_ws = {at[0], at[1], at[2]},
            .direction_ws = {to[0], to[1], to[2]},
            .t_min = c->near,
            .t_max = FLT_MAX,
            .mask = HG_RAY_OPAQUE | HG_RAY_MASK};
    }
}

static float value_of(struct picture *p, double sun_stops)
{
    const uint32_t count = p->width * p->height;
    for (uint32_t i = 0; i < count; i++) {
        const struct hg_gi_camera_hit *s = &p->hits[i];
        for (int c = 0; c < 3; c++) {
            p->albedo[3 * i + (uint32_t)c] = s->albedo[c];
            p->emission[3 * i + (uint32_t)c] = s->emission[c];
            p->color[4 * i + (uint32_t)c] = s->emission[c] + s->albedo[c] * s->light[c];
        }
        p->color[4 * i + 3] = s->hit ? 1.0f : 0.0f;
    }
    const struct hg_exposure_picture metered = {.width = p->width,
        .height = p->height,
        .color = p->color,
        .albedo = p->albedo,
        .emission = p->emission,
        .sun_stops = sun_stops};
    return hg_exposure_of_picture(&metered);
}

static bool is_due(struct hg_view_state *view)
{
    struct hg_view_exposure *e = &view->exposure;
    const uint64_t now = hg_clock_now_ns();
    const bool cuts = e->cut && e->adapts;
    if (!cuts && now - e->motion_metered_ns < HG_MOTION_METER_NS)
        return false;
    e->motion_metered_ns = now;
    return view->gi.field != HG_GI_NO_FIELD && hg_meter_is_due(view);
}

// The exposure (*ev, stops) that a camera of the present scene is metered for.
static enum hg_status meter(struct hg_view_state *view, const struct hg_view_camera_state *eye,
    float *ev, struct hg_error *err)
{
    struct hg_lighting_sources sources;
    struct picture *p = hg_calloc(1, sizeof *p);
    if (p == NULL)
        return hg_error_set(err, HG_E_NOMEM, "exposure", NULL, "out of host memory");
    hg_meter_size(&view->settings, HG_MOTION_METER_SIDE_PX, &p->width, &p->height);
    const struct hg_camera_setup camera =
        hg_scene_gpu_camera(view->scene_gpu, eye, p->width, p->height);
    aim(&camera, p);
    hg_lighting_sources(view->lighting, &sources);
    const struct hg_gi_camera_rays rays = {
        view->gi.field, hg_gi_view_id(view), &sources, p->rays, p->width * p->height};
    const enum hg_status status = hg_gi_trace_camera(view->scene_gpu->gi, &rays, p->hits, err);
    if (status == HG_OK)
        *ev = value_of(p, hg_meter_sun_stops(view->scene_gpu->scene));
    hg_free(p);
    return status;
}

// This meter knows nothing of what surfaces mirror, nor of the noise of few paths. Its error for
// the camera that rested last, of which the meter at rest has the value, corrects the values that
// follow, the less the more they differ from that one.
static enum hg_status compare(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_exposure_rest *rest = &view->exposure.rest;
    if (view->exposure.cut || (!rest->compared && !hg_meter_is_of_scene(view)))
        rest->known = rest->compared = false;
    if (!rest->known || rest->compared)
        return HG_OK;
    const enum hg_status status = meter(view, &rest->camera, &rest->motion_ev, err);
    rest->compared = status == HG_OK;
    rest->off = rest->ev - rest->motion_ev;
    return status;
}

enum hg_status hg_motion_meter_step(struct hg_view_state *view, struct hg_error *err)
{
    const struct hg_exposure_rest *rest = &view->exposure.rest;
    if (!is_due(view))
        return HG_OK;
    const uint64_t start = hg_clock_now_ns();
    float ev = 0.0f;
    enum hg_status status = compare(view, err);
    if (status == HG_OK)
        status = meter(view, &view->camera, &ev, err);
    if (status == HG_OK && rest->compared)
        ev += rest->off * exp2f(-fabsf(ev - rest->motion_ev));
    if (status == HG_OK)
        hg_meter_take(view, ev);
    hg_view_stats_add_stage(&view->stats, "meter", hg_clock_now_ns() - start);
    return status;
}
