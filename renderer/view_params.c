// view_params.c - the parameters of views: their ranges and defaults, from the table
// protocol/view_params.def.
#include <assert.h>
#include <math.h>
#include <string.h>

#include "protocol/view_params.h"
#include "renderer/camera/exposure.h"
#include "renderer/frame/exposure/meter.h"
#include "renderer/internal.h"

#define ALL_MATTES (1u << HG_MATTE_OBJECT | 1u << HG_MATTE_MATERIAL | 1u << HG_MATTE_ASSET)

// The renderer's enums have the values of the protocol's.
static_assert((int)HG_MODE_PATH == HGP_COUNT_render_mode - 1, "");
static_assert((int)HG_TONEMAP_LINEAR == HGP_COUNT_tonemap - 1, "");
static_assert((int)HG_GROUND_MINUS_X == HGP_COUNT_ground - 1, "");
static_assert((int)HG_GI_PROBES == HGP_COUNT_gi - 1, "");
static_assert((int)HG_REFLECTIONS_CACHE == HGP_COUNT_reflections - 1, "");
static_assert((int)HG_BACKGROUND_DISPLAY == HGP_COUNT_background - 1, "");
static_assert((int)HG_EXPOSURE_CAMERA == HGP_COUNT_exposure_mode - 1, "");
static_assert((int)HG_AO_NONE == HGP_COUNT_ao - 1, "");
static_assert((int)HG_MIRRORS_NONE == HGP_COUNT_mirrors - 1, "");
static_assert((int)HG_TEMPORAL_CHECKERBOARD == HGP_COUNT_temporal - 1, "");
static_assert((int)HG_SHADOW_MAPS_VIRTUAL == HGP_COUNT_shadow_maps - 1, "");
static_assert((int)HG_DEBUG_SHADOW_PAGES == HGP_COUNT_debug_view - 1, "");
static_assert((int)HG_VIEW_TRACE_KHR == HGP_COUNT_trace_backend - 1, "");
static_assert((int)HG_DENOISE_ANIMATION == HGP_COUNT_denoise - 1, "");
static_assert((int)HG_FILTER_GAUSSIAN == HGP_COUNT_filter - 1, "");

// ---- ranges ------------------------------------------------------------------------------------

static bool is_u32_in(uint32_t value, uint32_t least, uint32_t most)
{
    return value == 0 || (value >= least && value <= most);
}

static bool is_f32_in(float value, float least, float most)
{
    return value == 0.0f || (value >= least && value <= most);
}

static bool is_vec3_in(const float v[3], float least, float most)
{
    return is_f32_in(v[0], least, most) && is_f32_in(v[1], least, most) &&
           is_f32_in(v[2], least, most);
}

static bool is_vec4_in(const float v[4], float least, float most)
{
    return is_vec3_in(v, least, most) && is_f32_in(v[3], least, most);
}

#define IS_IN_U32(value, a, b)  is_u32_in(value, a, b)
#define IS_IN_F32(value, a, b)  is_f32_in(value, (float)(a), (float)(b))
#define IS_IN_VEC3(value, a, b) is_vec3_in(value, (float)(a), (float)(b))
#define IS_IN_VEC4(value, a, b) is_vec4_in(value, (float)(a), (float)(b))
#define IS_IN_ENUM(value, a, b) ((unsigned)(value) < HGP_COUNT_##a)

static enum hg_status out_of_range(struct hg_error *err, const char *field)
{
    return hg_renderer_out_of_range(err, "view", field);
}

static enum hg_status check_planes(const struct hg_view_params *p, struct hg_error *err)
{
    if (p->planes >> HG_PLANE_COUNT != 0)
        return out_of_range(err, "planes");
    if ((p->mattes & ~ALL_MATTES) != 0)
        return out_of_range(err, "mattes");
    for (uint32_t i = 0; i < HG_PLANE_COUNT && p->mode != HG_MODE_PATH; i++)
        if ((p->planes >> i & 1u) != 0 && hg_plane_needs_light(i))
            return hg_error_set(err, HG_E_UNSUPPORTED, "view", "planes",
                "%s is only kept by path-traced views", hg_plane_name((enum hg_plane)i));
    return HG_OK;
}

// Values are in their range.
static struct hg_picture_region region_of(const struct hg_view_params *p)
{
    return (struct hg_picture_region){(uint32_t)p->region[0], (uint32_t)p->region[1],
        (uint32_t)p->region[2], (uint32_t)p->region[3]};
}

static enum hg_status check_region(const struct hg_view_params *params, struct hg_error *err)
{
    const struct hg_view_params p = hg_view_params_filled(params);
    const struct hg_picture_region r = region_of(params);
    const bool whole = r.x == 0 && r.y == 0 && r.width == 0 && r.height == 0;
    const bool part = r.width > 0 && r.height > 0;
    for (int i = 0; i < 4; i++)
        if (p.region[i] != floorf(p.region[i]))
            return hg_error_set(err, HG_E_INVAL, "view", "region", "%g is not a whole number of px",
                (double)p.region[i]);
    if (whole || (part && r.x + r.width <= p.width && r.y + r.height <= p.height))
        return HG_OK;
    return hg_error_set(err, HG_E_INVAL, "view", "region",
        "%ux%u px at %u,%u are not inside of the picture of %ux%u px", r.width, r.height, r.x, r.y,
        p.width, p.height);
}

enum hg_status hg_view_params_check(const struct hg_view_params *p, struct hg_error *err)
{
#define HGP_VIEW_PARAM(kind, field, a, b, ...)                                                     \
    if (!IS_IN_##kind(p->field, a, b))                                                             \
        return out_of_range(err, #field);
#include "protocol/view_params.def"
    if (p->shutter_close < p->shutter_open)
        return out_of_range(err, "shutter_close");
    const enum hg_status status = check_region(p, err);
    return status == HG_OK ? check_planes(p, err) : status;
}

// ---- defaults ----------------------------------------------------------------------------------

// Radius where the parameters name none; 0 of what is no filter.
static float default_radius_px(enum hg_filter filter)
{
    static const float radius_px[] = {1.5f, 0.5f, 1.0f, 1.5f};
    return (unsigned)filter <= HG_FILTER_GAUSSIAN ? radius_px[filter] : 0.0f;
}

#define FILL_U32(value, standard)                                                                  \
    if ((value) == 0)                                                                              \
        value = standard;
#define FILL_F32(value, standard)                                                                  \
    if ((value) == 0.0f)                                                                           \
        value = (float)(standard);
#define FILL_VEC3(value, standard) // 0
#define FILL_VEC4(value, standard) // 0
#define FILL_ENUM(value, standard) // the first

struct hg_view_params hg_view_params_filled(const struct hg_view_params *params)
{
    struct hg_view_params p = *params;
#define HGP_VIEW_PARAM(kind, field, a, b, standard, ...) FILL_##kind(p.field, standard)
#include "protocol/view_params.def"
    FILL_F32(p.filter_radius_px, default_radius_px(p.filter))
    FILL_F32(p.series_s, p.frame_s)
    FILL_U32(p.mattes, ALL_MATTES)
    return p;
}

static void fill_path(const struct hg_view_params *params, struct hg_path_settings *s)
{
    const struct hg_view_params p = hg_view_params_filled(params);
    const bool blurs = p.shutter_close > p.shutter_open, timed = !blurs && params->shutter_s > 0.0f;
    const float half = fminf(0.5f * params->shutter_s / p.frame_s, 1.0f); // of the time, frames
    s->trace = (uint32_t)p.trace; // same values as enum hg_trace_backend
    s->filter = (uint32_t)p.filter;
    s->filter_radius_px = p.filter_radius_px;
    s->max_bounces = p.max_bounces;
    s->planes = p.planes;
    s->mattes = p.mattes;
    s->noise = p.noise;
    s->time_s = p.time_limit_s;
    s->clamp_indirect = p.clamp_indirect;
    s->frame_s = p.frame_s;
    s->shutter_open = blurs ? p.shutter_open : timed ? -half : 0.0f;
    s->shutter_close = blurs ? p.shutter_close : timed ? half : 0.0f;
    if (params->f_number > 0.0f && params->sensor_mm > 0.0f)
        s->sensor_share_m = 0.25e-3f * params->sensor_mm / params->f_number;
    s->denoise = (uint32_t)p.denoise;
    s->series_s = p.denoise == HG_DENOISE_ANIMATION ? p.series_s : 0.0f;
}

// Of a real-time picture: by the filter that it has itself.
static void fill_planes(const struct hg_view_params *p, struct hg_path_settings *s)
{
    const struct hg_view_params seen = {
        .trace = p->trace, .planes = p->planes, .mattes = p->mattes, .frame_s = p->frame_s};
    fill_path(&seen, s);
}

float hg_view_params_ev(const struct hg_view_params *params)
{
    const struct hg_view_params p = hg_view_params_filled(params);
    const double of_camera =
        p.exposure_mode == HG_EXPOSURE_CAMERA
            ? (double)hg_exposure_of_camera((double)p.f_number, (double)p.shutter_s, (double)p.iso)
            : 0.0;
    return (float)(of_camera + (double)p.exposure_ev);
}

// The exposure of an automatic one is the metered one, or on its way to it.
static enum hg_status set_state(struct hg_view *view, const struct hg_view_params *p,
    struct hg_view_settings *s, struct hg_error *err)
{
    const bool legend = p->debug_view != HG_DEBUG_OFF;
    const bool automatic = p->exposure_mode == HG_EXPOSURE_AUTO && !legend;
    const float stated = hg_view_params_ev(p);
    if (!legend)
        s->exposure = exp2f(stated + (automatic ? view->state.exposure.shown_ev : 0.0f));
    const enum hg_status status = hg_view_state_set(&view->state, s, err);
    if (status == HG_OK)
        hg_meter_set(&view->state, automatic, legend ? 0.0f : stated);
    return status;
}

static enum hg_status apply_params(
    struct hg_view *view, const struct hg_view_params *params, struct hg_error *err)
{
    const struct hg_view_params p = hg_view_params_filled(params);
    struct hg_view_settings s;
    memset(&s, 0, sizeof s); // compared as bytes
    s.width = p.width;
    s.height = p.height;
    s.region = region_of(&p);
    s.tonemap = (uint32_t)p.tonemap;       // same values as HG_FRAME_TONEMAP_*
    s.background = (uint32_t)p.background; // same values as HG_BACKGROUND_MODE_*
    memcpy(s.background_color, p.background_color, sizeof s.background_color);
    s.ground = (uint32_t)p.ground;
    if (p.mode == HG_MODE_REALTIME && p.debug_view == HG_DEBUG_OFF && p.gi != HG_GI_NONE)
        s.gi = p.gi == HG_GI_PROBES ? HG_VIEW_GI_PROBES : HG_VIEW_GI_RAYS;
    if (p.debug_view == HG_DEBUG_PROBES || p.debug_view == HG_DEBUG_IRRADIANCE ||
        p.debug_view == HG_DEBUG_REFLECTIONS)
        s.gi = HG_VIEW_GI_PROBES;
    if (p.debug_view == HG_DEBUG_REFLECTIONS ||
        (s.gi != 0 && p.reflections != HG_REFLECTIONS_ENVIRONMENT))
        s.reflections = p.reflections == HG_REFLECTIONS_RAYS ? HG_VIEW_REFLECTIONS_RAYS
                                                             : HG_VIEW_REFLECTIONS_CACHE;
    s.temporal = (uint32_t)p.temporal;
    s.ao = (uint32_t)p.ao;
    s.mirrors = (uint32_t)p.mirrors;
    s.shadow_maps = (uint32_t)p.shadow_maps;
    s.samples = p.samples;
    s.seed = p.seed;
    s.debug = (uint32_t)p.debug_view;
    s.error_px = p.error_px;
    s.target_ms = p.target_ms;
    s.scale = p.scale * 0.01f;
    s.sharpen = p.sharpen;
    s.mode = p.debug_view == HG_DEBUG_OFF ? (uint32_t)p.mode : HG_VIEW_MODE_REALTIME;
    if (s.mode == HG_VIEW_MODE_PATH)
        fill_path(params, &s.path);
    else if (p.mode == HG_MODE_REALTIME && s.debug == HG_DEBUG_OFF && p.planes != 0)
        fill_planes(params, &s.path);
    if (s.debug != HG_DEBUG_OFF) { // colours of a legend: as they are, and sharp
        s.samples = 1;
        s.exposure = 1.0f;
        s.tonemap = HG_FRAME_TONEMAP_LINEAR;
    }
    const enum hg_status status = hg_view_set_layers(view, p.layers, err);
    s.look = view->look;
    return status == HG_OK ? set_state(view, &p, &s, err) : status;
}

// What a file says of its camera counts where the view's parameters say nothing, as far as it is in
// range.
static struct hg_view_params with_optics(
    const struct hg_view_params *params, const struct hg_camera_optics *optics)
{
    struct hg_view_params with = *params;
    const struct {
        float *to, value;
    } optical[] = {{&with.f_number, optics->f_number}, {&with.shutter_s, optics->shutter_s},
        {&with.iso, optics->iso}, {&with.sensor_mm, optics->sensor_mm}};
    for (size_t i = 0; i < sizeof optical / sizeof *optical; i++) {
        struct hg_error err = {0};
        if (*optical[i].to != 0 || !(optical[i].value > 0))
            continue;
        *optical[i].to = optical[i].value;
        if (hg_view_params_check(&with, &err))
            *optical[i].to = 0;
    }
    return with;
}

enum hg_status hg_view_set_params(
    struct hg_view *view, const struct hg_view_params *params, struct hg_error *err)
{
    enum hg_status status = hg_view_params_check(params, err);
    if (status != HG_OK)
        return status;
    const struct hg_view_params with = with_optics(params, &view->optics);
    status = apply_params(view, &with, err);
    if (status != HG_OK)
        return status;
    view->params = *params;
    view->has_params = true;
    return HG_OK;
}

enum hg_status hg_view_set_optics(
    struct hg_view *view, const struct hg_camera_optics *optics, struct hg_error *err)
{
    if (memcmp(&view->optics, optics, sizeof *optics) == 0)
        return HG_OK;
    view->optics = *optics;
    if (!view->has_params)
        return HG_OK;
    const struct hg_view_params params = view->params;
    return hg_view_set_params(view, &params, err);
}
