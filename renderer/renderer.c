// renderer.c - the facade: renderers and views.
#include "renderer/renderer.h"

#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/log.h"
#include "renderer/internal.h"
#include "renderer/passes/resolve.h"
#include "renderer/passes/shade.h"
#include "renderer/passes/visibility.h"
#include "shaders/shared/pick.h"

#define DEFAULT_WIDTH    1280
#define DEFAULT_HEIGHT   720
#define DEFAULT_SAMPLES  32
#define DEFAULT_ERROR_PX 1.0f

// --- renderer ------------------------------------------------------------------------------------

// Page packs and cluster files: `<cache>/store`.
static enum hg_status open_store(struct hg_renderer *r, uint64_t limit_bytes, struct hg_error *err)
{
    char dir[PATH_MAX];
    if (r->cache_dir == NULL)
        return HG_OK;
    if (snprintf(dir, sizeof dir, "%s/store", r->cache_dir) >= (int)sizeof dir)
        return hg_error_set(err, HG_E_INVAL, "renderer", "cache_dir", "the name is too long");
    const struct hg_store_params params = {.dir = dir, .limit_bytes = limit_bytes};
    return hg_store_open(&params, &r->store, err);
}

static enum hg_status init(
    struct hg_renderer *r, const struct hg_renderer_params *params, struct hg_error *err)
{
#ifdef HELIO_VALIDATION
    const bool validation_try = true;
#else
    const bool validation_try = false;
#endif
    const struct hg_gpu_params gpu = {.device = params->device,
        .cache_dir = params->cache_dir,
        .shader_dir = params->shader_dir,
        .validation = params->validation,
        .validation_try = validation_try};
    if (params->cache_dir != NULL) {
        r->cache_dir = hg_strdup(params->cache_dir);
        if (r->cache_dir == NULL)
            return hg_error_set(err, HG_E_NOMEM, "renderer", NULL, "out of host memory");
    }
    enum hg_status status = open_store(r, params->cache_limit_bytes, err);
    if (status != HG_OK)
        return status;
    r->jobs = hg_jobs_create(params->threads);
    if (r->jobs == NULL)
        return hg_error_set(err, HG_E_NOMEM, "renderer", NULL, "no threads or no memory");
    status = hg_gpu_create(&gpu, &r->gpu, err);
    r->context = (struct hg_frame_context){.gpu = r->gpu,
        .jobs = r->jobs,
        .cache_dir = r->cache_dir,
        .texture_budget_bytes = params->texture_budget_bytes,
        .geometry_budget_bytes = params->geometry_budget_bytes,
        .host_budget_bytes = params->host_budget_bytes,
        .store = r->store,
        .overrides = params->overrides};
    return status;
}

enum hg_status hg_renderer_create(
    const struct hg_renderer_params *params, struct hg_renderer **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_renderer *renderer = hg_calloc(1, sizeof *renderer);
    if (renderer == NULL)
        return hg_error_set(err, HG_E_NOMEM, "renderer", NULL, "out of host memory");
    enum hg_status status = init(renderer, params, err);
    if (status != HG_OK) {
        hg_renderer_destroy(renderer);
        return status;
    }
    *out = renderer;
    return HG_OK;
}

void hg_renderer_linger(struct hg_renderer *renderer, uint64_t most_ns)
{
    if (renderer != NULL && renderer->context.pages != NULL)
        hg_page_sources_linger(hg_page_cache_sources(renderer->context.pages), most_ns);
}

void hg_renderer_destroy(struct hg_renderer *renderer)
{
    if (renderer == NULL)
        return;
    hg_frame_context_finish(&renderer->context);
    hg_gpu_destroy(renderer->gpu);
    hg_jobs_destroy(renderer->jobs);
    hg_store_close(renderer->store);
    hg_free(renderer->cache_dir);
    hg_free(renderer);
}

enum hg_status hg_renderer_device_json(struct hg_renderer *renderer, char **text)
{
    return hg_gpu_device_json(renderer->gpu, text);
}

struct hg_jobs *hg_renderer_jobs(struct hg_renderer *renderer)
{
    return renderer->jobs;
}

uint32_t hg_renderer_validation_messages(const struct hg_renderer *renderer)
{
    return hg_gpu_validation_messages(renderer->gpu);
}

// --- views ---------------------------------------------------------------------------------------

enum hg_status hg_view_create(struct hg_renderer *renderer, struct hg_scene *scene,
    struct hg_view **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_view *view = hg_calloc(1, sizeof *view);
    if (view == NULL)
        return hg_error_set(err, HG_E_NOMEM, "view", NULL, "out of host memory");
    view->renderer = renderer;
    const struct hg_view_params params = {0};
    const struct hg_view_camera camera = {.eye = {0, 0, 3}};
    enum hg_status status = hg_view_state_init(&view->state, &renderer->context, scene, err);
    if (status == HG_OK)
        status = hg_view_set_params(view, &params, err);
    if (status == HG_OK)
        status = hg_view_set_camera(view, &camera, err);
    if (status != HG_OK) {
        hg_view_destroy(view);
        return status;
    }
    *out = view;
    return HG_OK;
}

void hg_view_destroy(struct hg_view *view)
{
    if (view == NULL)
        return;
    hg_view_state_finish(&view->state);
    hg_free(view);
}

enum hg_status hg_renderer_out_of_range(struct hg_error *err, const char *what, const char *field)
{
    return hg_error_set(err, HG_E_INVAL, what, field, "outside its range");
}

#define ALL_MATTES (1u << HG_MATTE_OBJECT | 1u << HG_MATTE_MATERIAL | 1u << HG_MATTE_ASSET)

static enum hg_status check_planes(const struct hg_view_params *p, struct hg_error *err)
{
    if (p->planes >> HG_PLANE_COUNT != 0)
        return hg_renderer_out_of_range(err, "view", "planes");
    if ((p->mattes & ~ALL_MATTES) != 0)
        return hg_renderer_out_of_range(err, "view", "mattes");
    for (uint32_t i = 0; i < HG_PLANE_COUNT && p->mode != HG_MODE_PATH; i++)
        if ((p->planes >> i & 1u) != 0 && hg_plane_needs_light(i))
            return hg_error_set(err, HG_E_UNSUPPORTED, "view", "planes",
                "%s is only kept by path-traced views", hg_plane_name((enum hg_plane)i));
    return HG_OK;
}

static enum hg_status check_path(const struct hg_view_params *p, struct hg_error *err)
{
    if ((unsigned)p->mode > HG_MODE_PATH)
        return hg_renderer_out_of_range(err, "view", "mode");
    if ((unsigned)p->trace > HG_VIEW_TRACE_KHR)
        return hg_renderer_out_of_range(err, "view", "trace");
    if (p->max_bounces > HG_VIEW_MAX_BOUNCES)
        return hg_renderer_out_of_range(err, "view", "max_bounces");
    if (!(p->noise >= 0.0f && p->noise <= 1.0f))
        return hg_renderer_out_of_range(err, "view", "noise");
    if (!(p->time_s >= 0.0f && p->time_s <= 1e9f))
        return hg_renderer_out_of_range(err, "view", "time_s");
    if ((unsigned)p->filter > HG_FILTER_GAUSSIAN)
        return hg_renderer_out_of_range(err, "view", "filter");
    if (!(p->filter_radius_px >= 0.0f && p->filter_radius_px <= 8.0f))
        return hg_renderer_out_of_range(err, "view", "filter_radius_px");
    if (!(p->clamp_indirect >= 0.0f && p->clamp_indirect <= 1e9f))
        return hg_renderer_out_of_range(err, "view", "clamp_indirect");
    if (!(p->frame_s >= 0.0f && p->frame_s <= 1e9f))
        return hg_renderer_out_of_range(err, "view", "frame_s");
    if (!(p->series_s >= 0.0f && p->series_s <= 1e9f))
        return hg_renderer_out_of_range(err, "view", "series_s");
    if (!(fabsf(p->shutter_open) <= 1.0f))
        return hg_renderer_out_of_range(err, "view", "shutter_open");
    if (!(fabsf(p->shutter_close) <= 1.0f && p->shutter_close >= p->shutter_open))
        return hg_renderer_out_of_range(err, "view", "shutter_close");
    if ((unsigned)p->denoise > HG_DENOISE_ANIMATION)
        return hg_renderer_out_of_range(err, "view", "denoise");
    return check_planes(p, err);
}

static enum hg_status check_params(const struct hg_view_params *p, struct hg_error *err)
{
    if (p->width > HG_VIEW_MAX_SIDE_PX)
        return hg_renderer_out_of_range(err, "view", "width");
    if (p->height > HG_VIEW_MAX_SIDE_PX)
        return hg_renderer_out_of_range(err, "view", "height");
    if ((unsigned)p->tonemap > HG_TONEMAP_LINEAR)
        return hg_renderer_out_of_range(err, "view", "tonemap");
    if ((unsigned)p->background > HG_BACKGROUND_COLOR)
        return hg_renderer_out_of_range(err, "view", "background");
    if (!(fabsf(p->exposure_ev) <= 64.0f))
        return hg_renderer_out_of_range(err, "view", "exposure_ev");
    for (int i = 0; i < 3; i++) {
        if (!(p->background_color[i] >= 0.0f && p->background_color[i] <= 65504.0f))
            return hg_renderer_out_of_range(err, "view", "background_color");
    }
    if ((unsigned)p->debug > HG_DEBUG_OVERDRAW)
        return hg_renderer_out_of_range(err, "view", "debug");
    if (p->error_px != 0.0f && !(p->error_px >= 0.01f && p->error_px <= 1024.0f))
        return hg_renderer_out_of_range(err, "view", "error_px");
    if (!(p->target_ms >= 0.0f && p->target_ms <= 1e5f))
        return hg_renderer_out_of_range(err, "view", "target_ms");
    if (p->samples > HG_VIEW_MAX_SAMPLES)
        return hg_renderer_out_of_range(err, "view", "samples");
    return check_path(p, err);
}

float hg_filter_radius_px(enum hg_filter filter)
{
    static const float radius_px[] = {1.5f, 0.5f, 1.0f, 1.5f};
    return (unsigned)filter <= HG_FILTER_GAUSSIAN ? radius_px[filter] : 0.0f;
}

static void fill_path(const struct hg_view_params *p, struct hg_path_settings *s)
{
    s->trace = (uint32_t)p->trace; // same values as enum hg_trace_backend
    s->filter = (uint32_t)p->filter;
    s->filter_radius_px =
        p->filter_radius_px > 0 ? p->filter_radius_px : hg_filter_radius_px(p->filter);
    s->max_bounces = p->max_bounces > 0 ? p->max_bounces : HG_VIEW_DEFAULT_BOUNCES;
    s->planes = p->planes;
    s->mattes = p->mattes != 0 ? p->mattes : ALL_MATTES;
    s->noise = p->noise;
    s->time_s = p->time_s;
    s->clamp_indirect = p->clamp_indirect;
    s->frame_s = p->frame_s > 0.0f ? p->frame_s : 1.0f / 24.0f;
    s->shutter_open = p->shutter_close > p->shutter_open ? p->shutter_open : 0.0f;
    s->shutter_close = p->shutter_close > p->shutter_open ? p->shutter_close : 0.0f;
    s->denoise = (uint32_t)p->denoise;
    if (p->denoise == HG_DENOISE_ANIMATION)
        s->series_s = p->series_s > 0.0f ? p->series_s : s->frame_s;
}

// Of a real-time picture: by the filter that it has itself.
static void fill_planes(const struct hg_view_params *p, struct hg_path_settings *s)
{
    const struct hg_view_params seen = {
        .trace = p->trace, .planes = p->planes, .mattes = p->mattes, .frame_s = p->frame_s};
    fill_path(&seen, s);
}

enum hg_status hg_view_set_params(
    struct hg_view *view, const struct hg_view_params *p, struct hg_error *err)
{
    enum hg_status status = check_params(p, err);
    if (status != HG_OK)
        return status;
    struct hg_view_settings s;
    memset(&s, 0, sizeof s); // compared as bytes
    s.width = p->width > 0 ? p->width : DEFAULT_WIDTH;
    s.height = p->height > 0 ? p->height : DEFAULT_HEIGHT;
    s.tonemap = (uint32_t)p->tonemap;       // same values as HG_FRAME_TONEMAP_*
    s.background = (uint32_t)p->background; // same values as HG_BACKGROUND_MODE_*
    memcpy(s.background_color, p->background_color, sizeof s.background_color);
    s.exposure = exp2f(p->exposure_ev);
    s.samples = p->samples > 0 ? p->samples : DEFAULT_SAMPLES;
    s.seed = p->seed;
    s.debug = (uint32_t)p->debug;
    s.error_px = p->error_px > 0 ? p->error_px : DEFAULT_ERROR_PX;
    s.target_ms = p->target_ms;
    s.mode = p->debug == HG_DEBUG_OFF ? (uint32_t)p->mode : HG_VIEW_MODE_REALTIME;
    if (s.mode == HG_VIEW_MODE_PATH)
        fill_path(p, &s.path);
    else if (p->mode == HG_MODE_REALTIME && s.debug == HG_DEBUG_OFF && p->planes != 0)
        fill_planes(p, &s.path);
    if (s.debug != HG_DEBUG_OFF) { // colours of a legend: as they are, and sharp
        s.samples = 1;
        s.exposure = 1.0f;
        s.tonemap = HG_FRAME_TONEMAP_LINEAR;
    }
    return hg_view_state_set(&view->state, &s, err);
}

// --- frames --------------------------------------------------------------------------------------

static void fill_info(const struct hg_view *view, struct hg_frame_info *info)
{
    const struct hg_view_state *s = &view->state;
    const bool followed = s->settings.mode == HG_VIEW_MODE_PATH && !s->path_begins;
    struct hg_geometry_stats geometry;
    hg_geometry_stats(s->scene_gpu->geometry, &geometry);
    *info = (struct hg_frame_info){.number = s->number,
        .scene_revision = s->scene_gpu->scene->revision,
        .input_seq = s->camera.input_seq,
        .width = s->settings.width,
        .height = s->settings.height,
        .samples = s->samples,
        .noise = followed ? hg_path_noise(s->path) : 0.0f,
        .spent_ns = followed ? hg_path_spent_ns(s->path) : 0,
        .missing_pages = s->stream.missing,
        .mip_bias = s->stream.bias,
        .missing_clusters = s->missing_clusters + geometry.proxies,
        .error_px = hg_view_error_px(s),
        .settled = hg_view_state_settled(s),
        .triangles_total = geometry.triangles_total,
        .triangles_drawn = s->triangles_drawn};
    for (uint32_t i = 0; i < s->stage_count && i < 64; i++) {
        struct hg_stage_time *stage = &info->stages[info->stage_count++];
        snprintf(stage->name, sizeof stage->name, "%s", s->stages[i].name);
        stage->ns = s->stages[i].ns;
    }
}

void hg_view_set_final(struct hg_view *view, bool final)
{
    view->state.final = final;
}

enum hg_status hg_view_step(
    struct hg_view *view, uint32_t max_samples, struct hg_frame_info *info, struct hg_error *err)
{
    *info = (struct hg_frame_info){0};
    enum hg_status status = hg_view_state_step(&view->state, max_samples, err);
    if (status == HG_OK)
        fill_info(view, info);
    return status;
}

enum hg_status hg_view_read_pixels(
    struct hg_view *view, enum hg_pixel_format format, struct hg_refbuf **out, struct hg_error *err)
{
    *out = NULL;
    if ((unsigned)format > HG_PIXEL_RGBA32F)
        return hg_renderer_out_of_range(err, "pixels", "format");
    return hg_view_state_read(&view->state, (uint32_t)format, out, err);
}

enum hg_status hg_view_save(struct hg_view *view, struct hg_refbuf **out, struct hg_error *err)
{
    return hg_path_save(&view->state, out, err);
}

enum hg_status hg_view_load(
    struct hg_view *view, const void *data, uint64_t size_bytes, struct hg_error *err)
{
    return hg_path_load(&view->state, data, size_bytes, err);
}

enum hg_status hg_view_save_history(
    struct hg_view *view, struct hg_refbuf **out, struct hg_error *err)
{
    return hg_path_history_save(&view->state, out, err);
}

enum hg_status hg_view_load_history(
    struct hg_view *view, const void *data, uint64_t size_bytes, struct hg_error *err)
{
    return hg_path_history_load(&view->state, data, size_bytes, err);
}

enum hg_status hg_view_pick(
    struct hg_view *view, uint32_t x, uint32_t y, struct hg_pick *out, struct hg_error *err)
{
    *out = (struct hg_pick){0};
    struct hg_gpu_pick hit;
    const struct hg_geometry *geometry = view->state.scene_gpu->geometry;
    enum hg_status status = hg_view_state_pick(&view->state, x, y, &hit, err);
    if (status != HG_OK)
        return status;
    struct hg_draw_info draw;
    double origin[3];
    out->revision = view->state.key.scene;
    if (hit.draw_plus_one == 0 || !hg_geometry_draw_info(geometry, hit.draw_plus_one - 1, &draw))
        return HG_OK;
    hg_geometry_origin(geometry, origin);
    out->hit = true;
    out->node = draw.node->head.id;
    out->mesh = draw.mesh->head.id;
    out->material = draw.material != NULL ? draw.material->head.id : 0;
    out->part = draw.part;
    out->triangle = hit.triangle;
    out->position[0] = (float)(hit.position_ws.x + origin[0]);
    out->position[1] = (float)(hit.position_ws.y + origin[1]);
    out->position[2] = (float)(hit.position_ws.z + origin[2]);
    memcpy(out->normal, &hit.normal_ws, sizeof out->normal);
    memcpy(out->uv, &hit.uv, sizeof out->uv);
    out->distance = hit.distance;
    return HG_OK;
}
