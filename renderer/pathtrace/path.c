#include "renderer/pathtrace/path_state.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/log.h"
#include "renderer/passes/skin.h"

#define STEP_NS 35000000u // a slice of work ends with the piece that passes this

static struct hg_page_cache *pages_of(const struct hg_view_state *view)
{
    return hg_textures_cache(view->scene_gpu->textures);
}

// --- life ----------------------------------------------------------------------------------------

void hg_path_destroy(struct hg_path *p)
{
    if (p == NULL)
        return;
    hg_path_film_destroy(p);
    hg_path_wave_destroy(p);
    hg_denoise_destroy(p->history);
    hg_trace_destroy(p->trace);
    hg_emitters_destroy(p->emitters);
    hg_ray_geometry_free(p->cut);
    hg_motion_blur_destroy(p);
    hg_light_groups_destroy(p);
    hg_cryptomatte_ids_destroy(p);
    hg_free(p);
}

static enum hg_status create(struct hg_view_state *view, struct hg_error *err)
{
    if (view->path != NULL)
        return HG_OK;
    view->path = hg_calloc(1, sizeof *view->path);
    if (view->path == NULL)
        return hg_error_set(err, HG_E_NOMEM, "path", NULL, "out of host memory");
    view->path->context = view->context;
    return HG_OK;
}

static enum hg_status make_trace(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    const uint32_t backend = view->settings.path.trace;
    const struct hg_trace_params params = {.backend = (enum hg_trace_backend)backend,
        .jobs = view->context->jobs,
        .budget_bytes = view->context->geometry_budget_bytes};
    if (p->trace != NULL && p->backend == backend)
        return HG_OK;
    hg_trace_destroy(p->trace);
    p->trace = NULL;
    hg_path_wave_destroy(p); // memory of another kind, perhaps
    p->cut_revision = UINT64_MAX;
    p->backend = backend;
    return hg_trace_create(view->context->gpu, &params, &p->trace, err);
}

// --- sync ----------------------------------------------------------------------------------------

static enum hg_status sync_cut(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    const struct hg_gpu_camera *c = &view->frame.camera;
    const bool flat = c->orthographic != 0;
    const struct hg_ray_geometry_lens lens = {.eye = {c->eye_ws.x, c->eye_ws.y, c->eye_ws.z},
        .px_scale = 1.0f / (flat ? c->pixel_size : c->pixel_angle),
        .orthographic = flat,
        .near = fmaxf(c->near, 1e-6f),
        .motion = (p->options & HG_PATH_BLURS) != 0,
        .error_px = view->settings.error_px};
    enum hg_status status =
        hg_ray_geometry_make(view->scene_gpu->geometry, &lens, view->context->jobs, &p->cut, err);
    if (status != HG_OK || hg_ray_geometry_revision(p->cut) == p->cut_revision)
        return status;
    p->cut_revision = UINT64_MAX;
    status = hg_trace_sync(p->trace, p->cut, err);
    if (status == HG_OK)
        p->cut_revision = hg_ray_geometry_revision(p->cut);
    return status;
}

static enum hg_status sync_emitters(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    const struct hg_scene_gpu *scene_gpu = view->scene_gpu;
    const struct hg_emitters_params params = {0};
    enum hg_status status = HG_OK;
    if (p->emitters == NULL)
        status =
            hg_emitters_create(view->context->gpu, view->context->jobs, &params, &p->emitters, err);
    if (status != HG_OK)
        return status;
    const bool blurs = (p->options & HG_PATH_BLURS) != 0;
    hg_emitters_move_lights(
        p->emitters, blurs ? &p->lights[0] : NULL, blurs ? &p->lights[1] : NULL);
    return hg_emitters_sync(
        p->emitters, scene_gpu->geometry, p->cut, scene_gpu->scene, scene_gpu->textures, err);
}

static uint32_t has_holes(const struct hg_ray_geometry *cut)
{
    const struct hg_ray_geometry_piece *pieces = hg_ray_geometry_pieces(cut);
    for (uint32_t i = 0; i < hg_ray_geometry_count(cut); i++) {
        if ((pieces[i].flags & (HG_DRAW_MASK | HG_DRAW_BLEND)) != 0)
            return 1;
    }
    return 0;
}

// What rays meet, and what shines.
static enum hg_status sync_scene(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    enum hg_status status = sync_cut(view, err);
    if (status == HG_OK)
        status = sync_emitters(view, err);
    if (status == HG_OK)
        p->holes = has_holes(p->cut);
    return status;
}

// The part of the shutter's time that the pass has.
static enum hg_status open_shutter(struct hg_view_state *view, struct hg_error *err)
{
    const uint64_t start = hg_clock_now_ns();
    const enum hg_status status = hg_motion_blur_open(view, err);
    if (status != HG_OK)
        return status;
    const enum hg_status synced = sync_scene(view, err);
    if (synced == HG_OK)
        hg_light_groups_mark_placed(view);
    view->path->stats.build_ns += hg_clock_now_ns() - start;
    return synced;
}

// Everything that does not change while a picture is made.
static enum hg_status begin_picture(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    const uint64_t start = hg_clock_now_ns();
    p->phase = HG_PATH_PHASE_NONE;
    p->finished = p->late = false;
    p->pass = p->next_tile = p->next_row = 0;
    p->noise = 0.0f;
    p->stats = (struct hg_path_stats){0};
    p->spent_ns = 0;
    enum hg_status status = hg_path_denoise_begin(view, err);
    if (status == HG_OK)
        status = make_trace(view, err);
    if (status == HG_OK)
        status = hg_skin_run(view->context->gpu, view->scene_gpu->geometry, err);
    if (status == HG_OK)
        status = hg_motion_blur_begin(view, err);
    if (status == HG_OK && (p->options & HG_PATH_BLURS) == 0)
        status = sync_scene(view, err);
    if (status == HG_OK)
        status = hg_light_groups_make(view, err);
    if (status == HG_OK && (p->options & HG_PATH_BLURS) == 0)
        hg_light_groups_mark_placed(view);
    if (status == HG_OK)
        status = hg_cryptomatte_ids_make(view, err);
    if (status == HG_OK)
        status = hg_path_film_create(p, &view->settings, err);
    if (status == HG_OK)
        status = hg_path_wave_create(p, err);
    if (status == HG_OK && (p->options & HG_PATH_BLURS) != 0)
        status = open_shutter(view, err);
    if (status == HG_OK)
        status = hg_path_splitting_choose(view, err);
    if (status != HG_OK)
        return status;
    memset(p->samples.mapped, 0, (size_t)p->tile_count * 4);
    hg_geometry_origin(view->scene_gpu->geometry, p->origin);
    p->stats.build_ns = hg_clock_now_ns() - start;
    hg_view_add_stage(view, "path build", p->stats.build_ns);
    return hg_path_resume(view, err);
}

// --- passes --------------------------------------------------------------------------------------

// The tiles of the next wave; false: the pass is over. They have to find room in the ring beside
// the row in front of those that the film waits for.
static bool choose_tiles(struct hg_path *p)
{
    uint32_t at = p->next_tile;
    p->wave_tiles = 0;
    while (at < p->tile_count && p->done[at])
        at++;
    if (at / p->columns > p->next_row + 1) // no tile before is left
        p->next_row = at / p->columns - 1;
    const uint64_t end =
        ((uint64_t)p->next_row + p->ring_rows - (p->next_row > 0 ? 1 : 0)) * p->columns;
    for (; at < p->tile_count && at < end && p->wave_tiles < HG_PATH_WAVE_TILES; at++) {
        if (!p->done[at])
            p->tile_index[p->wave_tiles++] = at;
    }
    while (at < p->tile_count && p->done[at])
        at++;
    p->next_tile = at;
    return p->wave_tiles > 0;
}

static bool any_left(const struct hg_path *p)
{
    for (uint32_t i = 0; i < p->tile_count; i++) {
        if (!p->done[i])
            return true;
    }
    return false;
}

static enum hg_status end_pass(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    enum hg_status status = HG_OK;
    p->pass++;
    p->next_tile = p->next_row = 0;
    const bool last = p->pass >= view->settings.samples;
    if (p->pass >= 2 && (last || p->pass % HG_PATH_NOISE_EVERY == 0))
        status = hg_path_film_judge(p, view->settings.path.noise, err);
    p->finished = last || !any_left(p);
    view->samples = p->pass;
    view->number++;
    return status;
}

static enum hg_status next_wave(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    enum hg_status status = HG_OK;
    if (!choose_tiles(p)) {
        status = end_pass(view, err);
        if (status != HG_OK || p->finished)
            return status;
        (void)choose_tiles(p); // tiles that are not done are all there
    }
    if (hg_motion_blur_passes(p))
        status = open_shutter(view, err);
    if (status != HG_OK)
        return status;
    return hg_path_wave_begin(view, err);
}

// --- steps ---------------------------------------------------------------------------------------

// A pass that the last wave of has just finished is ended at once, so that it is shown.
static enum hg_status after_wave(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    if (p->pass == 0)
        view->number++; // tiles that were empty
    return p->next_tile < p->tile_count ? HG_OK : end_pass(view, err);
}

// `start`: of this slice. Time between slices is that of others.
static bool is_late(const struct hg_view_state *view, uint64_t start)
{
    const float limit = view->settings.path.time_s;
    const uint64_t spent = view->path->spent_ns + hg_clock_now_ns() - start;
    return limit > 0.0f && view->path->pass > 0 && (double)spent > (double)limit * 1e9;
}

static void add_stages(struct hg_view_state *view, const struct hg_path_stats *before)
{
    const struct hg_path_stats *now = &view->path->stats;
    for (int i = 0; i < HG_PATH_PIECES; i++) {
        const uint64_t ns = now->pieces[i].ns - before->pieces[i].ns;
        if (ns > 0)
            hg_view_add_stage(view, hg_path_piece_name((enum hg_path_piece)i), ns);
    }
}

static enum hg_status work(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    const uint64_t start = hg_clock_now_ns();
    const uint64_t wanted_ns = p->context->overrides.path_slice_ns;
    const uint64_t slice_ns = wanted_ns > 0 ? wanted_ns : STEP_NS;
    const struct hg_path_stats before = p->stats;
    enum hg_status status = HG_OK;
    do {
        bool over = false;
        if (p->phase == HG_PATH_PHASE_NONE)
            status = next_wave(view, err);
        else
            status = hg_path_advance(view, &over, err);
        if (status == HG_OK && over)
            status = after_wave(view, err);
        p->late = status == HG_OK && is_late(view, start);
    } while (status == HG_OK && !p->finished && !p->late && hg_clock_now_ns() - start < slice_ns);
    add_stages(view, &before);
    p->spent_ns += hg_clock_now_ns() - start;
    if (p->late && p->noise == 0.0f && p->pass >= 2 && status == HG_OK)
        status = hg_path_film_judge(p, 0.0f, err);
    if (p->late)
        view->number++;
    return status;
}

enum hg_status hg_path_step(struct hg_view_state *view, bool changed, struct hg_error *err)
{
    enum hg_status status = create(view, err);
    if (status != HG_OK)
        return status;
    struct hg_path *p = view->path;
    if (changed || p->film.handle == VK_NULL_HANDLE) {
        view->samples = 0;
        status = begin_picture(view, err);
    } else {
        status = hg_page_cache_update(pages_of(view), HG_PAGES_EXACT, UINT64_MAX, err);
        if (status == HG_OK && (p->options & HG_PATH_BLURS) == 0 && !hg_path_done(p))
            status =
                hg_skin_run(view->context->gpu, view->scene_gpu->geometry, err); // others' poses
        if (status == HG_OK && (p->options & HG_PATH_BLURS) != 0 && !hg_path_done(p) &&
            view->scene_gpu->posed != p) { // others have looked at the scene in between
            status = open_shutter(view, err);
            hg_path_wave_fill(view);
        }
    }
    if (status == HG_OK && !hg_path_done(p))
        status = work(view, err);
    if (status == HG_OK && hg_path_done(p) && view->scene_gpu->posed == p)
        status =
            hg_scene_gpu_sync(view->context, view->scene_gpu, view->camera.eye, view->wait, err);
    view->stream.missing = status == HG_OK ? p->missing : 0;
    if (status != HG_OK)
        hg_path_film_destroy(p); // begins anew
    return status;
}

bool hg_path_done(const struct hg_path *p)
{
    return p != NULL && (p->finished || p->late) && p->film.handle != VK_NULL_HANDLE;
}

float hg_path_noise(const struct hg_path *p)
{
    return p != NULL ? p->noise : 0.0f;
}

uint64_t hg_path_spent_ns(const struct hg_path *p)
{
    return p != NULL ? p->spent_ns : 0;
}

uint32_t hg_path_samples(const struct hg_path *p)
{
    return p != NULL ? p->pass : 0;
}

void hg_path_get_stats(const struct hg_path *p, struct hg_path_stats *out)
{
    *out = p != NULL ? p->stats : (struct hg_path_stats){0};
}

enum hg_status hg_path_show(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    struct hg_gpu *gpu = view->context->gpu;
    struct hg_gpu_cmd *cmd;
    if (p == NULL || p->film.handle == VK_NULL_HANDLE || !p->stale || view->path_begins)
        return HG_OK; // of another state the film is not shown in place of the preview
    const bool denoise = view->settings.path.denoise != 0 && p->pass > 0;
    if (denoise && !hg_path_denoise_due(p))
        return HG_OK; // what was made of fewer samples stays until then
    enum hg_status status = denoise ? hg_path_denoise(view, err) : HG_OK;
    if (status == HG_OK)
        status = hg_gpu_begin(gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    struct hg_pass pass = {.gpu = gpu, .cmd = cmd};
    const struct hg_path_show show = {.film = denoise ? p->denoised.address : p->film.address,
        .samples = p->samples.address,
        .target = &view->targets.accumulated,
        .catcher = denoise ? HG_PATH_NO_PLANE : p->planes[HG_PATH_PLANE_CATCHER],
        .transparent = view->settings.background == HG_BACKGROUND_MODE_NONE,
        .clear = p->pass > 0 || !view->path_preview};
    status = hg_path_show_record(&pass, &show, err);
    if (status != HG_OK) {
        hg_gpu_discard(gpu, cmd);
        return status;
    }
    status = hg_gpu_submit_and_wait(gpu, cmd, err);
    p->stale = status != HG_OK;
    return status;
}
