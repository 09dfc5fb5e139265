// path_denoise.c - runs the denoiser on the film.
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/denoise/denoise.h"
#include "renderer/pathtrace/filter.h"
#include "renderer/pathtrace/path_state.h"

void hg_path_denoise_destroy(struct hg_path_denoiser *d, struct hg_gpu *gpu)
{
    hg_gpu_buffer_destroy(gpu, &d->image);
    hg_gpu_buffer_destroy(gpu, &d->samples);
    hg_denoise_destroy(d->history);
    hg_denoise_destroy(d->loaded);
}

// Intermediate pictures are denoised whenever the number of samples has doubled.
static bool is_due(const struct hg_path *p)
{
    const uint32_t pass = p->progress.pass;
    const bool wanted =
        p->request.settings.denoise != 0 && !p->request.surfaces && !p->request.gather.on;
    return wanted && pass > p->denoiser.pass &&
           (hg_path_done(p) || (p->request.watched && pass >= 2 * p->denoiser.pass));
}

// HG_PATH_SHOWN_* in the film.
static const float *shown_of(const struct hg_path_film *f, const float *film)
{
    const size_t pixels = (size_t)f->width * f->height;
    return film + (f->planes[HG_PATH_PLANE_GUIDE] + 2 * HG_PATH_GUIDE_CHANNELS) * pixels;
}

// The film's sums with the noisy light replaced by the denoised.
static void compose(const struct hg_path_film *f, const float *film, const float *light, float *out)
{
    const size_t pixels = (size_t)f->width * f->height;
    const float *shown = shown_of(f, film);
    for (uint32_t y = 0; y < f->height; y++) {
        for (uint32_t x = 0; x < f->width; x++) {
            const size_t at = (size_t)y * f->width + x;
            const float n = (float)hg_path_film_samples_at(f, x, y);
            for (size_t c = 0; c < 3; c++) {
                const float noisy = shown[(HG_PATH_SHOWN_LIGHT + c) * pixels + at];
                float clean = 0.0f;
                for (size_t k = 0; k < HG_DENOISE_LIGHT; k += 3)
                    clean += light[(k + c) * pixels + at];
                const float rest = film[c * pixels + at] - noisy;
                out[c * pixels + at] = (rest > 0.0f ? rest : 0.0f) + n * clean;
            }
            float sum[4] = {out[at], out[pixels + at], out[2 * pixels + at], film[3 * pixels + at]};
            hg_path_film_catch(f, film, at, sum);
            for (size_t c = 0; c < 4; c++)
                out[c * pixels + at] = sum[c];
        }
    }
}

enum hg_status hg_path_denoise_begin(struct hg_path *p, struct hg_error *err)
{
    p->denoiser.pass = 0;
    if (p->request.settings.denoise != HG_PATH_DENOISE_SERIES) {
        hg_denoise_destroy(p->denoiser.history);
        p->denoiser.history = NULL;
        return HG_OK;
    }
    if (p->denoiser.loaded != NULL) {
        hg_denoise_destroy(p->denoiser.history);
        p->denoiser.history = p->denoiser.loaded;
        p->denoiser.loaded = NULL; // is used once
    }
    if (p->denoiser.history == NULL)
        p->denoiser.history = hg_denoise_create();
    else
        hg_denoise_next(p->denoiser.history);
    return p->denoiser.history != NULL
               ? HG_OK
               : hg_error_set(err, HG_E_NOMEM, "denoise", NULL, "out of host memory");
}

enum hg_status hg_path_history_save(struct hg_path *p, struct hg_refbuf **out, struct hg_error *err)
{
    *out = NULL;
    if (p == NULL || p->denoiser.history == NULL || !hg_path_done(p) ||
        p->denoiser.pass != p->progress.pass)
        return hg_error_set(err, HG_E_STATE, "view", NULL, "has no settled picture of a series");
    return hg_denoise_save(p->denoiser.history, out, err);
}

enum hg_status hg_path_history_load(
    struct hg_path *p, const void *data, uint64_t size_bytes, struct hg_error *err)
{
    struct hg_denoise *history;
    const enum hg_status status = hg_denoise_load(data, size_bytes, &history, err);
    if (status != HG_OK)
        return status;
    hg_denoise_destroy(p->denoiser.loaded);
    p->denoiser.loaded = history;
    return HG_OK;
}

static void fill_camera(const struct hg_path *p, struct hg_denoise_camera *out)
{
    const struct hg_gpu_camera *c = p->host.camera;
    const double *origin = p->film.origin;
    out->orthographic = c->orthographic != 0;
    for (int i = 0; i < 3; i++) {
        out->eye[i] = origin[i] + (double)(&c->eye_ws.x)[i];
        out->forward[i] = (double)(&c->forward_ws.x)[i];
        out->across[i] = (out->orthographic ? origin[i] : 0.0) + (double)(&c->ray_origin_ws.x)[i];
        out->x[i] = (double)(&c->ray_x_ws.x)[i];
        out->y[i] = (double)(&c->ray_y_ws.x)[i];
    }
}

// The image, and how many samples it stands for.
static enum hg_status reserve(struct hg_path *p, struct hg_error *err)
{
    const struct hg_path_film *f = &p->film;
    const uint64_t pixels = (uint64_t)f->width * f->height;
    enum hg_status status = hg_gpu_buffer_reserve(p->context->gpu, HG_GPU_BUFFER_UPLOAD,
        4 * pixels * sizeof(float), "denoised", &p->denoiser.image, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_reserve(p->context->gpu, HG_GPU_BUFFER_UPLOAD,
            (uint64_t)f->tile_count * 4, "denoised samples", &p->denoiser.samples, err);
    return status;
}

static enum hg_status filter(
    struct hg_path *p, const float *film, float *light, struct hg_error *err)
{
    const struct hg_path_film *f = &p->film;
    const size_t pixels = (size_t)f->width * f->height;
    const float *guide = film + f->planes[HG_PATH_PLANE_GUIDE] * pixels;
    struct hg_denoise_taps taps[HG_PATH_RESTS];
    hg_path_splat_rest(&p->request.settings, f->splats, p->request.seed, taps);
    struct hg_denoise_input input = {.width = f->width,
        .height = f->height,
        .sums = guide,
        .halves = guide + HG_PATH_GUIDE_CHANNELS * pixels,
        .shown = shown_of(f, film),
        .taps = taps,
        .taps_count = HG_PATH_RESTS,
        .samples = f->samples.mapped,
        .history = p->denoiser.history};
    fill_camera(p, &input.camera);
    if (f->planes[HG_PATH_PLANE_MOVED] != HG_PATH_NO_PLANE)
        input.moved = film + f->planes[HG_PATH_PLANE_MOVED] * pixels;
    return hg_denoise_run(p->context->jobs, &input, light, err);
}

static enum hg_status denoise(struct hg_path *p, struct hg_error *err)
{
    struct hg_path_film *f = &p->film;
    const size_t pixels = (size_t)f->width * f->height;
    const float *film;
    enum hg_status status = hg_path_film_fetch(p->context->gpu, f, f->channels, &film, err);
    if (status == HG_OK)
        status = reserve(p, err);
    if (status != HG_OK)
        return status;
    float *light = hg_calloc(HG_DENOISE_LIGHT * pixels, sizeof *light);
    if (light == NULL)
        return hg_error_set(err, HG_E_NOMEM, "denoise", NULL, "out of host memory");
    status = filter(p, film, light, err);
    if (status == HG_OK) {
        compose(f, film, light, p->denoiser.image.mapped);
        memcpy(p->denoiser.samples.mapped, f->samples.mapped, (size_t)f->tile_count * 4);
    }
    hg_free(light);
    return status;
}

enum hg_status hg_path_read_gathered(
    struct hg_path *p, struct hg_path_gathered *out, struct hg_error *err)
{
    struct hg_path_film *f = &p->film;
    const size_t pixels = (size_t)f->width * f->height;
    const float *film;
    *out = (struct hg_path_gathered){0};
    if (!hg_path_done(p) || !p->request.gather.on)
        return hg_error_set(err, HG_E_STATE, "view", NULL, "nothing was gathered yet");
    const enum hg_status status = hg_path_film_fetch(p->context->gpu, f, f->channels, &film, err);
    if (status != HG_OK)
        return status;
    out->sums = film + f->planes[HG_PATH_PLANE_GUIDE] * pixels;
    if (f->planes[HG_PATH_PLANE_LAMPS] != HG_PATH_NO_PLANE) {
        out->lamps = film + f->planes[HG_PATH_PLANE_LAMPS] * pixels;
        out->lamp_count = f->lamp_count;
    }
    return HG_OK;
}

enum hg_status hg_path_denoise_if_due(struct hg_path *p, struct hg_error *err)
{
    if (!is_due(p))
        return HG_OK;
    const uint64_t start = hg_clock_now_ns();
    const enum hg_status status = denoise(p, err);
    const uint64_t spent = hg_clock_now_ns() - start;
    p->denoiser.pass = status == HG_OK ? p->progress.pass : 0;
    p->denoiser.unshown = true;
    p->stats.denoise_ns += spent;
    p->host.add_stage(p->host.user, "denoise", spent);
    return status;
}
