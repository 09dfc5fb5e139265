// path.c - a path-traced picture: resources, passes, slices of work. See path.h.
#include "renderer/pathtrace/path.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/cond.h"
#include "renderer/passes/skin.h"
#include "renderer/pathtrace/path_state.h"

#define STEP_NS 35000000u // a slice of work ends with the piece that passes this

struct hg_page_cache *hg_path_pages(const struct hg_path *p)
{
    return hg_textures_cache(p->scene_gpu->textures);
}

// --- life ----------------------------------------------------------------------------------------

struct hg_path *hg_path_create(struct hg_frame_context *context, struct hg_scene_gpu *scene_gpu,
    const struct hg_path_host *host)
{
    struct hg_path *p = hg_calloc(1, sizeof *p);
    if (p == NULL)
        return NULL;
    p->context = context;
    p->scene_gpu = scene_gpu;
    p->host = *host;
    return p;
}

static void destroy_scene(struct hg_path_scene *scene, struct hg_gpu *gpu)
{
    hg_rays_unref(scene->rays);
    hg_emitters_destroy(scene->emitters);
    hg_motion_blur_destroy(&scene->blur);
    hg_light_groups_destroy(&scene->groups, gpu);
    hg_cryptomatte_ids_destroy(&scene->ids, gpu);
}

void hg_path_destroy(struct hg_path *p)
{
    if (p == NULL)
        return;
    struct hg_gpu *gpu = p->context->gpu;
    hg_path_film_destroy(gpu, &p->film);
    hg_path_progress_finish(&p->progress);
    hg_path_wave_destroy(&p->wave, gpu);
    hg_path_denoise_destroy(&p->denoiser, gpu);
    destroy_scene(&p->scene, gpu);
    hg_free(p->resume.data);
    hg_free(p);
}

// --- sync ----------------------------------------------------------------------------------------

enum hg_status hg_path_sync_scene(struct hg_path *p, struct hg_error *err)
{
    const uint64_t wait_ns = p->request.build_wait_ns;
    return hg_scene_gpu_sync(p->context, p->scene_gpu, p->request.camera.eye,
        wait_ns > 0 ? hg_cond_after(wait_ns) : 0, err);
}

// Ray geometry at the requested LOD error. With motion blur it belongs to this picture alone.
static enum hg_status ref_rays(struct hg_path *p, struct hg_error *err)
{
    const struct hg_gpu_camera *c = p->host.camera;
    const bool flat = c->orthographic != 0, blurs = (p->options & HG_PATH_BLURS) != 0;
    const struct hg_rays_key key = {.backend = (enum hg_trace_backend)p->request.settings.trace,
        .exact = true,
        .owner = blurs ? p : NULL,
        .lens = {.eye = {c->eye_ws.x, c->eye_ws.y, c->eye_ws.z},
            .px_scale = 1.0f / (flat ? c->pixel_size : c->pixel_angle),
            .orthographic = flat,
            .near = fmaxf(c->near, 1e-6f),
            .motion = blurs,
            .error_px = p->request.error_px}};
    if (p->scene.backend != p->request.settings.trace) // memory of another kind, perhaps
        hg_path_wave_destroy(&p->wave, p->context->gpu);
    p->scene.backend = p->request.settings.trace;
    return hg_rays_ref(p->scene_gpu->rays, &key, &p->scene.rays, err);
}

static enum hg_status sync_rays(struct hg_path *p, struct hg_error *err)
{
    const enum hg_status status = ref_rays(p, err);
    return status == HG_OK ? hg_rays_sync(p->scene.rays, err) : status;
}

static enum hg_status sync_emitters(struct hg_path *p, struct hg_error *err)
{
    const struct hg_scene_gpu *scene_gpu = p->scene_gpu;
    const struct hg_emitters_params params = {.sky = hg_light_shared_sky(scene_gpu->light)};
    enum hg_status status = HG_OK;
    if (p->scene.emitters == NULL)
        status =
            hg_emitters_create(p->context->gpu, p->context->jobs, &params, &p->scene.emitters, err);
    if (status != HG_OK)
        return status;
    const bool blurs = (p->options & HG_PATH_BLURS) != 0;
    hg_emitters_move_lights(p->scene.emitters, blurs ? &p->scene.blur.lights[0] : NULL,
        blurs ? &p->scene.blur.lights[1] : NULL);
    return hg_emitters_sync(p->scene.emitters, scene_gpu->geometry, hg_rays_geometry(p->scene.rays),
        scene_gpu->scene, scene_gpu->textures, err);
}

static uint32_t has_alpha_mask(const struct hg_ray_geometry *geometry)
{
    const struct hg_ray_geometry_piece *pieces = hg_ray_geometry_pieces(geometry);
    for (uint32_t i = 0; i < hg_ray_geometry_count(geometry); i++) {
        if ((pieces[i].flags & (HG_DRAW_MASK | HG_DRAW_BLEND)) != 0)
            return 1;
    }
    return 0;
}

// Marks the draws that rays intersect in object space.
static void mark_placed(struct hg_path *p)
{
    struct hg_geometry_stats stats;
    hg_geometry_stats(p->scene_gpu->geometry, &stats);
    hg_light_groups_mark_placed(
        &p->scene.groups, hg_rays_trace(p->scene.rays), (uint32_t)stats.draws, &p->options);
}

// Ray geometry and emitters.
static enum hg_status sync_scene(struct hg_path *p, struct hg_error *err)
{
    enum hg_status status = sync_rays(p, err);
    if (status == HG_OK)
        status = sync_emitters(p, err);
    if (status == HG_OK)
        p->scene.has_alpha_mask = has_alpha_mask(hg_rays_geometry(p->scene.rays));
    return status;
}

// The shutter interval of the pass.
static enum hg_status open_shutter(struct hg_path *p, struct hg_error *err)
{
    const uint64_t start = hg_clock_now_ns();
    enum hg_status status = ref_rays(p, err);
    if (status == HG_OK)
        status = hg_motion_blur_open(p, err);
    if (status != HG_OK)
        return status;
    const enum hg_status synced = sync_scene(p, err);
    if (synced == HG_OK)
        mark_placed(p);
    p->stats.build_ns += hg_clock_now_ns() - start;
    return synced;
}

// Ray geometry and all that depends on it, up to the film's channels.
static enum hg_status begin_scene(struct hg_path *p, struct hg_error *err)
{
    struct hg_gpu *gpu = p->context->gpu;
    const struct hg_geometry *geometry = p->scene_gpu->geometry;
    enum hg_status status = hg_skin_run(gpu, p->scene_gpu->geometry, err);
    if (status == HG_OK)
        status = hg_motion_blur_begin(p, err);
    const bool blurs = (p->options & HG_PATH_BLURS) != 0;
    if (status == HG_OK && !blurs)
        status = sync_scene(p, err);
    if (status == HG_OK)
        status = hg_light_groups_make(
            &p->scene.groups, gpu, p->scene_gpu, &p->request, &p->options, err);
    if (status == HG_OK && !blurs)
        mark_placed(p);
    if (status == HG_OK)
        status = hg_cryptomatte_ids_make(&p->scene.ids, gpu, geometry, &p->request.settings, err);
    return status;
}

// Where tiles stop by their noise, each depends on its neighbours and on the mean of the picture;
// denoised pixels depend on those far around. Such pictures are made whole, whatever is read. Paths
// that gather have the denoiser's channels alone.
static bool needs_whole(const struct hg_path_request *request)
{
    const struct hg_picture_region r = request->region;
    const bool denoises = request->settings.denoise != 0 && !request->gather.on;
    return request->settings.noise > 0.0f || denoises ||
           (r.width == request->width && r.height == request->height);
}

static enum hg_status begin_film(struct hg_path *p, struct hg_error *err)
{
    const bool part = !needs_whole(&p->request);
    const struct hg_path_film_plan plan = {.options = p->options,
        .group_count = p->scene.groups.count,
        .list_count = p->scene.ids.list_count,
        .lamp_count = p->request.gather.lamps};
    enum hg_status status = hg_path_film_create(p->context->gpu, &p->request, &plan, &p->film, err);
    if (status == HG_OK)
        status = hg_path_progress_begin(&p->progress, &p->film, part, err);
    return status == HG_OK && part ? hg_path_film_clear(p->context->gpu, &p->film, err) : status;
}

// Everything that stays constant while a picture is rendered.
static enum hg_status begin_picture(struct hg_path *p, struct hg_error *err)
{
    const uint64_t start = hg_clock_now_ns();
    p->wave.phase = HG_PATH_PHASE_NONE;
    p->stats = (struct hg_path_stats){0};
    enum hg_status status = p->request.aside ? HG_OK : hg_path_denoise_begin(p, err);
    if (status == HG_OK)
        status = begin_scene(p, err);
    if (status == HG_OK)
        status = begin_film(p, err);
    // With motion blur, ray geometry is built for the first shutter interval.
    if (status == HG_OK && (p->options & HG_PATH_BLURS) != 0)
        status = open_shutter(p, err);
    if (status == HG_OK)
        status = hg_path_wave_create(p, err);
    if (status == HG_OK)
        status = hg_path_splitting_choose(p, err);
    if (status != HG_OK)
        return status;
    memset(p->film.samples.mapped, 0, (size_t)p->film.tile_count * 4);
    hg_geometry_origin(p->scene_gpu->geometry, p->film.origin);
    p->stats.build_ns = hg_clock_now_ns() - start;
    p->host.add_stage(p->host.user, "path build", p->stats.build_ns);
    return p->request.aside ? HG_OK : hg_path_resume(p, err);
}

// --- passes --------------------------------------------------------------------------------------

static uint32_t choose_tiles(struct hg_path *p)
{
    p->wave.tile_count = hg_path_progress_choose(&p->progress, &p->film, p->wave.tile_index);
    return p->wave.tile_count;
}

static enum hg_status judge(struct hg_path *p, float noise, struct hg_error *err)
{
    const uint32_t least = // all parts of the shutter's time
        p->scene.blur.parts > HG_PATH_LEAST_SAMPLES ? p->scene.blur.parts : HG_PATH_LEAST_SAMPLES;
    return hg_path_progress_judge(&p->progress, p->context->gpu, &p->film, noise, least, err);
}

static uint32_t last_pass(const struct hg_path *p)
{
    return hg_path_lamps_from(p) + (p->request.gather.on ? p->request.gather.lamp_samples : 0);
}

static enum hg_status end_pass(struct hg_path *p, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    p->progress.pass++;
    p->progress.next_tile = p->progress.next_row = 0;
    const bool last = p->progress.pass >= last_pass(p);
    if (p->progress.pass >= 2 && (last || p->progress.pass % HG_PATH_NOISE_EVERY == 0))
        status = judge(p, p->request.settings.noise, err);
    p->progress.finished = last || !hg_path_progress_any_left(&p->progress, &p->film);
    p->progress.changes++;
    return status;
}

static enum hg_status next_wave(struct hg_path *p, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    if (choose_tiles(p) == 0) {
        status = end_pass(p, err);
        if (status != HG_OK || p->progress.finished)
            return status;
        (void)choose_tiles(p); // all tiles that are not done
    }
    if (hg_motion_blur_passes(&p->scene.blur, p->progress.pass))
        status = open_shutter(p, err);
    if (status != HG_OK)
        return status;
    return hg_path_wave_begin(p, err);
}

// --- steps ---------------------------------------------------------------------------------------

// Ends the pass right after its last wave, so that it is displayed.
static enum hg_status after_wave(struct hg_path *p, struct hg_error *err)
{
    if (p->progress.pass == 0)
        p->progress.changes++; // first samples of these tiles
    return p->progress.next_tile < p->film.tile_count ? HG_OK : end_pass(p, err);
}

// `start`: of this slice. Time between slices is not counted.
static bool is_late(const struct hg_path *p, uint64_t start)
{
    const float limit = p->request.settings.time_s;
    const uint64_t spent = p->progress.spent_ns + hg_clock_now_ns() - start;
    return limit > 0.0f && p->progress.pass > 0 && (double)spent > (double)limit * 1e9;
}

static void add_stages(struct hg_path *p, const struct hg_path_stats *before)
{
    const struct hg_path_stats *now = &p->stats;
    for (int i = 0; i < HG_PATH_PIECES; i++) {
        const uint64_t ns = now->pieces[i].ns - before->pieces[i].ns;
        if (ns > 0)
            p->host.add_stage(p->host.user, hg_path_piece_name((enum hg_path_piece)i), ns);
    }
}

static enum hg_status work(struct hg_path *p, struct hg_error *err)
{
    const uint64_t start = hg_clock_now_ns();
    const uint64_t wanted_ns = p->context->overrides.path_slice_ns;
    const uint64_t slice_ns = wanted_ns > 0 ? wanted_ns : STEP_NS;
    const struct hg_path_stats before = p->stats;
    enum hg_status status = HG_OK;
    do {
        bool over = false;
        if (p->wave.phase == HG_PATH_PHASE_NONE)
            status = next_wave(p, err);
        else
            status = hg_path_wave_advance(p, &over, err);
        if (status == HG_OK && over)
            status = after_wave(p, err);
        p->progress.late = status == HG_OK && is_late(p, start);
    } while (status == HG_OK && !p->progress.finished && !p->progress.late &&
             hg_clock_now_ns() - start < slice_ns);
    add_stages(p, &before);
    p->progress.spent_ns += hg_clock_now_ns() - start;
    if (p->progress.late && p->progress.noise == 0.0f && p->progress.pass >= 2 && status == HG_OK)
        status = judge(p, 0.0f, err);
    if (p->progress.late)
        p->progress.changes++;
    return status;
}

// Continues the picture; other views may have used the scene in between.
static enum hg_status go_on(struct hg_path *p, struct hg_error *err)
{
    const bool blurs = (p->options & HG_PATH_BLURS) != 0;
    enum hg_status status = hg_page_cache_update(hg_path_pages(p), HG_PAGES_EXACT, UINT64_MAX, err);
    if (status != HG_OK || hg_path_done(p))
        return status;
    if (!blurs)
        return hg_skin_run(
            p->context->gpu, p->scene_gpu->geometry, err); // other views may have posed it
    if (p->scene_gpu->posed != p) {
        status = open_shutter(p, err);
        hg_path_wave_fill(p);
    }
    return status;
}

enum hg_status hg_path_step(
    struct hg_path *p, const struct hg_path_request *request, bool begins, struct hg_error *err)
{
    p->request = *request;
    enum hg_status status = begins || !hg_path_has_film(p) ? begin_picture(p, err) : go_on(p, err);
    if (status == HG_OK && !hg_path_done(p))
        status = work(p, err);
    if (status == HG_OK)
        status = hg_path_denoise_if_due(p, err);
    if (status == HG_OK && hg_path_done(p) && p->scene_gpu->posed == p)
        status = hg_path_sync_scene(p, err);
    if (status != HG_OK)
        hg_path_film_destroy(p->context->gpu, &p->film); // restarts
    return status;
}

bool hg_path_has_film(const struct hg_path *p)
{
    return p != NULL && p->film.sums.handle != VK_NULL_HANDLE;
}

uint64_t hg_path_changes(const struct hg_path *p)
{
    return p->progress.changes;
}

uint32_t hg_path_missing(const struct hg_path *p)
{
    return p->wave.missing;
}

bool hg_path_done(const struct hg_path *p)
{
    return hg_path_has_film(p) && (p->progress.finished || p->progress.late);
}

float hg_path_noise(const struct hg_path *p)
{
    return p != NULL ? p->progress.noise : 0.0f;
}

uint64_t hg_path_spent_ns(const struct hg_path *p)
{
    return p != NULL ? p->progress.spent_ns : 0;
}

uint32_t hg_path_samples(const struct hg_path *p)
{
    return p != NULL ? p->progress.pass : 0;
}

void hg_path_get_stats(const struct hg_path *p, struct hg_path_stats *out)
{
    *out = p != NULL ? p->stats : (struct hg_path_stats){0};
    if (p == NULL)
        return;
    out->branch_bits = p->branch_bits;
    if (p->scene.rays != NULL)
        hg_trace_stats(hg_rays_trace(p->scene.rays), &out->structures);
}

enum hg_status hg_path_show(
    struct hg_path *p, struct hg_gpu_image *target, bool clear, struct hg_error *err)
{
    struct hg_gpu *gpu = p->context->gpu;
    struct hg_gpu_cmd *cmd;
    const bool denoised = p->denoiser.pass > 0;
    bool *unshown = denoised ? &p->denoiser.unshown : &p->progress.unshown;
    if (!hg_path_has_film(p) || !*unshown)
        return HG_OK;
    enum hg_status status = hg_gpu_begin(gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    struct hg_pass pass = {.gpu = gpu, .cmd = cmd};
    const struct hg_path_show show = {
        .film = denoised ? p->denoiser.image.address : p->film.sums.address,
        .samples = denoised ? p->denoiser.samples.address : p->film.samples.address,
        .target = target,
        .catcher = denoised ? HG_PATH_NO_PLANE : p->film.planes[HG_PATH_PLANE_CATCHER],
        .transparent = p->film.transparent,
        .clear = clear || p->progress.pass > 0};
    status = hg_path_show_record(&pass, &show, err);
    if (status != HG_OK) {
        hg_gpu_discard(gpu, cmd);
        return status;
    }
    status = hg_gpu_submit_and_wait(gpu, cmd, err);
    *unshown = status != HG_OK;
    return status;
}
