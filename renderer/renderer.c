// renderer.c - the facade: renderers and views.
#include "renderer/renderer.h"

#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/log.h"
#include "renderer/frame/exposure/meter.h"
#include "renderer/frame/paths/path_view.h"
#include "renderer/internal.h"
#include "renderer/passes/resolve.h"
#include "renderer/passes/shade.h"
#include "renderer/passes/visibility.h"
#include "shaders/shared/pick.h"

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
        .validation_try = validation_try,
        .overrides = {.no_host_raster = params->overrides.no_cpu_raster,
            .no_host_triangle_cull = params->overrides.no_culling,
            .no_uniform_tables = params->overrides.table_addresses,
            .no_short_shaders = params->overrides.short_shaders == HG_OVERRIDE_OFF,
            .short_shaders = params->overrides.short_shaders == HG_OVERRIDE_ON}};
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

bool hg_renderer_shares_memory(const struct hg_renderer *renderer)
{
    return renderer != NULL && hg_gpu_get_caps(renderer->gpu)->is_cpu;
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
    if (status != HG_OK)
        goto fail;
    status = hg_view_set_params(view, &params, err);
    if (status != HG_OK)
        goto fail;
    status = hg_view_set_camera(view, &camera, err);
    if (status != HG_OK)
        goto fail;
    *out = view;
    return HG_OK;
fail:
    hg_view_destroy(view);
    return status;
}

void hg_view_destroy(struct hg_view *view)
{
    if (view == NULL)
        return;
    hg_view_state_finish(&view->state);
    hg_look_destroy(view->renderer->gpu, view->look);
    hg_free(view);
}

enum hg_status hg_renderer_out_of_range(struct hg_error *err, const char *what, const char *field)
{
    return hg_error_set(err, HG_E_INVAL, what, field, "outside its range");
}

// --- frames --------------------------------------------------------------------------------------

static void fill_info(const struct hg_view *view, struct hg_frame_info *info)
{
    const struct hg_view_state *s = &view->state;
    const struct hg_picture_region region = hg_view_region(&s->settings);
    const bool followed = s->settings.mode == HG_VIEW_MODE_PATH && !s->path_begins;
    struct hg_geometry_stats geometry;
    hg_geometry_stats(s->scene_gpu->geometry, &geometry);
    *info = (struct hg_frame_info){.number = s->stats.number,
        .scene_revision = s->scene_gpu->scene->revision,
        .input_seq = s->camera.input_seq,
        .width = region.width,
        .height = region.height,
        .samples = s->accumulation.samples,
        .noise = followed ? hg_path_noise(s->path) : 0.0f,
        .spent_ns = followed ? hg_path_spent_ns(s->path) : 0,
        .missing_pages = s->accumulation.pages.missing,
        .mip_bias = s->accumulation.pages.bias,
        .missing_clusters = s->stats.missing_clusters + geometry.proxies,
        .exposure_ev = hg_meter_ev(s),
        .metered = s->exposure.automatic && !hg_meter_is_due(s) && !hg_meter_is_adapting(s),
        .adapts = hg_view_state_only_adapts(s),
        .waits = s->stats.waits,
        .error_px = hg_tiled_accumulation_error_px(&s->accumulation, s->settings.error_px),
        .settled = hg_view_state_settled(s),
        .phase = s->accumulation.phase,
        .shortfall = s->accumulation.shortfall,
        .triangles_total = geometry.triangles_total,
        .triangles_drawn = s->stats.triangles_drawn};
    for (uint32_t i = 0; i < s->stats.stage_count && i < 64; i++) {
        struct hg_stage_time *stage = &info->stages[info->stage_count++];
        snprintf(stage->name, sizeof stage->name, "%s", s->stats.stages[i].name);
        stage->ns = s->stats.stages[i].ns;
    }
}

void hg_view_set_final(struct hg_view *view, bool final)
{
    view->state.final = final;
}

void hg_view_set_slice(struct hg_view *view, uint64_t slice_ns)
{
    view->state.accumulation.slices.ns = slice_ns;
}

void hg_view_set_budget(struct hg_view *view, float target_ms)
{
    view->state.motion.budget_ms = target_ms;
}

void hg_view_set_sharing(struct hg_view *view, uint32_t views)
{
    view->state.motion.sharing = views;
}

void hg_view_set_formats(struct hg_view *view, uint32_t formats)
{
    view->state.formats = formats;
}

bool hg_view_has_pixels(const struct hg_view *view, enum hg_pixel_format format)
{
    return hg_view_state_has_pixels(&view->state, (uint32_t)format);
}

enum hg_status hg_view_step(
    struct hg_view *view, uint32_t max_samples, struct hg_frame_info *info, struct hg_error *err)
{
    *info = (struct hg_frame_info){0};
    enum hg_status status = hg_view_state_step(&view->state, max_samples, err);
    if (status != HG_OK)
        return status;
    fill_info(view, info);
    // Not at the end: a worker can be ended at any time, and some drivers compile for seconds.
    if (hg_gpu_save_pipeline_cache(view->renderer->gpu, NULL) != HG_OK)
        hg_warn(GPU, "the pipeline cache could not be written");
    return HG_OK;
}

static enum hg_status take_pixels(struct hg_view *view, enum hg_pixel_format format, bool lends,
    struct hg_refbuf **out, struct hg_error *err)
{
    *out = NULL;
    if ((unsigned)format > HG_PIXEL_RGBA32F)
        return hg_renderer_out_of_range(err, "pixels", "format");
    return hg_view_state_read(&view->state, (uint32_t)format, lends, out, err);
}

enum hg_status hg_view_read_pixels(
    struct hg_view *view, enum hg_pixel_format format, struct hg_refbuf **out, struct hg_error *err)
{
    return take_pixels(view, format, false, out, err);
}

enum hg_status hg_view_lend_pixels(
    struct hg_view *view, enum hg_pixel_format format, struct hg_refbuf **out, struct hg_error *err)
{
    return take_pixels(view, format, true, out, err);
}

enum hg_status hg_view_save(struct hg_view *view, struct hg_refbuf **out, struct hg_error *err)
{
    return hg_path_view_save(&view->state, out, err);
}

enum hg_status hg_view_load(
    struct hg_view *view, const void *data, uint64_t size_bytes, struct hg_error *err)
{
    return hg_path_view_load(&view->state, data, size_bytes, err);
}

enum hg_status hg_view_save_history(
    struct hg_view *view, struct hg_refbuf **out, struct hg_error *err)
{
    return hg_path_view_history_save(&view->state, out, err);
}

enum hg_status hg_view_load_history(
    struct hg_view *view, const void *data, uint64_t size_bytes, struct hg_error *err)
{
    return hg_path_view_history_load(&view->state, data, size_bytes, err);
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
    out->revision = view->state.accumulation.key.scene;
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
