// path_denoise.c - path-traced pictures without their noise, for views that ask for it.
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/denoise/denoise.h"
#include "renderer/pathtrace/path_state.h"

// While samples come in, a picture is made again when there are twice as many.
bool hg_path_denoise_due(const struct hg_path *p)
{
    return p->pass > 0 && (p->finished || p->late || p->pass >= 2 * p->denoised_pass);
}

static uint32_t samples_at(const struct hg_path *p, uint32_t x, uint32_t y)
{
    const uint32_t tile = y / HG_PATH_TILE_SIDE * p->columns + x / HG_PATH_TILE_SIDE;
    return ((const uint32_t *)p->samples.mapped)[tile];
}

// HG_PATH_SHOWN_* in the film.
static const float *shown_of(const struct hg_path *p, const float *film)
{
    const size_t pixels = (size_t)p->width * p->height;
    return film + (p->planes[HG_PATH_PLANE_GUIDE] + 2 * HG_PATH_GUIDE_CHANNELS) * pixels;
}

// The film's sums, with the noisy part of the light in the place of the other.
static void compose(const struct hg_path *p, const float *film, const float *light, float *out)
{
    const size_t pixels = (size_t)p->width * p->height;
    const float *shown = shown_of(p, film);
    for (uint32_t y = 0; y < p->height; y++) {
        for (uint32_t x = 0; x < p->width; x++) {
            const size_t at = (size_t)y * p->width + x;
            const float n = (float)samples_at(p, x, y);
            for (size_t c = 0; c < 3; c++) {
                const float noisy = shown[(HG_PATH_SHOWN_LIGHT + c) * pixels + at];
                float clean = 0.0f;
                for (size_t k = 0; k < HG_DENOISE_LIGHT; k += 3)
                    clean += light[(k + c) * pixels + at];
                const float rest = film[c * pixels + at] - noisy;
                out[c * pixels + at] = (rest > 0.0f ? rest : 0.0f) + n * clean;
            }
            float sum[4] = {out[at], out[pixels + at], out[2 * pixels + at], film[3 * pixels + at]};
            hg_path_film_catch(p, film, at, sum);
            for (size_t c = 0; c < 4; c++)
                out[c * pixels + at] = sum[c];
        }
    }
}

enum hg_status hg_path_denoise_begin(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    p->denoised_pass = 0;
    if (view->settings.path.denoise != HG_PATH_DENOISE_SERIES) {
        hg_denoise_destroy(p->history);
        p->history = NULL;
        return HG_OK;
    }
    if (view->path_history != NULL) {
        hg_denoise_destroy(p->history);
        p->history = view->path_history;
        view->path_history = NULL; // counts once
    }
    if (p->history == NULL)
        p->history = hg_denoise_create();
    else
        hg_denoise_next(p->history);
    return p->history != NULL
               ? HG_OK
               : hg_error_set(err, HG_E_NOMEM, "denoise", NULL, "out of host memory");
}

enum hg_status hg_path_history_save(
    struct hg_view_state *view, struct hg_refbuf **out, struct hg_error *err)
{
    const struct hg_path *p = view->path;
    *out = NULL;
    if (p == NULL || p->history == NULL || !hg_path_done(p) || p->denoised_pass != p->pass)
        return hg_error_set(err, HG_E_STATE, "view", NULL, "has no settled picture of a series");
    return hg_denoise_save(p->history, out, err);
}

enum hg_status hg_path_history_load(
    struct hg_view_state *view, const void *data, uint64_t size_bytes, struct hg_error *err)
{
    struct hg_denoise *history;
    if (view->settings.mode != HG_VIEW_MODE_PATH ||
        view->settings.path.denoise != HG_PATH_DENOISE_SERIES)
        return hg_error_set(err, HG_E_INVAL, "history", NULL, "is for views that make a series");
    enum hg_status status = hg_denoise_load(data, size_bytes, &history, err);
    if (status != HG_OK)
        return status;
    hg_denoise_destroy(view->path_history);
    view->path_history = history;
    return HG_OK;
}

static void fill_camera(const struct hg_view_state *view, struct hg_denoise_camera *out)
{
    const struct hg_gpu_camera *c = &view->frame.camera;
    const double *origin = view->path->origin;
    out->orthographic = c->orthographic != 0;
    for (int i = 0; i < 3; i++) {
        out->eye[i] = origin[i] + (double)(&c->eye_ws.x)[i];
        out->forward[i] = (double)(&c->forward_ws.x)[i];
        out->across[i] = (out->orthographic ? origin[i] : 0.0) + (double)(&c->ray_origin_ws.x)[i];
        out->x[i] = (double)(&c->ray_x_ws.x)[i];
        out->y[i] = (double)(&c->ray_y_ws.x)[i];
    }
}

enum hg_status hg_path_denoise(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_path *p = view->path;
    const size_t pixels = (size_t)p->width * p->height;
    const uint64_t start = hg_clock_now_ns();
    const float *film;
    enum hg_status status = hg_path_film_fetch(p, p->channels, &film, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_reserve(p->context->gpu, HG_GPU_BUFFER_UPLOAD,
            4 * pixels * sizeof(float), "denoised", &p->denoised, err);
    if (status != HG_OK)
        return status;
    float *light = hg_calloc(HG_DENOISE_LIGHT * pixels, sizeof *light);
    if (light == NULL)
        return hg_error_set(err, HG_E_NOMEM, "denoise", NULL, "out of host memory");
    const float *guide = film + p->planes[HG_PATH_PLANE_GUIDE] * pixels;
    struct hg_denoise_taps taps[HG_PATH_RESTS];
    hg_path_splat_rest(p, &view->settings.path, view->settings.seed, taps);
    struct hg_denoise_input input = {.width = p->width,
        .height = p->height,
        .sums = guide,
        .halves = guide + HG_PATH_GUIDE_CHANNELS * pixels,
        .shown = shown_of(p, film),
        .taps = taps,
        .taps_count = HG_PATH_RESTS,
        .samples = p->samples.mapped,
        .history = p->history};
    fill_camera(view, &input.camera);
    if (p->planes[HG_PATH_PLANE_MOVED] != HG_PATH_NO_PLANE)
        input.moved = film + p->planes[HG_PATH_PLANE_MOVED] * pixels;
    status = hg_denoise_run(view->context->jobs, &input, light, err);
    if (status == HG_OK)
        compose(p, film, light, p->denoised.mapped);
    hg_free(light);
    p->denoised_pass = status == HG_OK ? p->pass : 0;
    p->stats.denoise_ns += hg_clock_now_ns() - start;
    hg_view_add_stage(view, "denoise", hg_clock_now_ns() - start);
    return status;
}
