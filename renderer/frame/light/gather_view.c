// gather_view.c - see gather_view.h.
#include "renderer/frame/light/gather_view.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/frame/batch/batch.h"
#include "renderer/frame/light/gi_view.h"
#include "renderer/frame/light/glass_region.h"
#include "renderer/frame/paths/path_view.h"
#include "renderer/gather/gather.h"
#include "shaders/shared/features.h"
#include "shaders/shared/gi.h"
#include "shaders/shared/path.h"
#include "shaders/shared/sample_blocks.h"

#define FILTER_BOX   1u       // enum hg_filter of renderer.h
#define FULL_PX      921600.0 // pictures of so many pixels have 2 samples for each,
#define FULL_SAMPLES 32.0     // where so many are asked for
#define MOST_BITS    6        // log2 of samples
#define SUN_SAMPLES  2u       // at least, of directional lights: their shadows have edges
#define LAMP_RAYS    2u       // of a pixel, to each lamp without a size,
#define LAMPS_APART  3u       // of so many; more share them
#define MOST_BOUNCE  6        // of paths that do not find the field,
#define GLASS_BOUNCE 16       // and of those by way of glass, which pass both its sides
#define COLOR        0u       // enum hg_plane of renderer.h
#define TEXEL_BYTES  16u      // of its four floats
#define REACH        0.5f     // spacings of the finest grid of probes there

struct hg_gather_key hg_gather_view_key(const struct hg_view_state *view)
{
    return (struct hg_gather_key){.scene = view->scene_gpu->scene->revision,
        .environment = view->scene_gpu->scene->environment.revision,
        .geometry = view->scene_gpu->geometry_revision,
        .settings = view->settings_revision,
        .camera = view->camera_revision};
}

bool hg_gather_view_is_done(const struct hg_view_state *view)
{
    const struct hg_gather_key key = hg_gather_view_key(view);
    return view->gi.gather.done && memcmp(&key, &view->gi.gather.key, sizeof key) == 0;
}

static void forget_blocks(struct hg_view_state *view)
{
    hg_gpu_buffer_destroy(view->context->gpu, &view->gi.gather.blocks.buffer);
    hg_free(view->gi.gather.blocks.counts);
    view->gi.gather.blocks = (struct hg_draw_blocks){0};
}

void hg_gather_view_finish(struct hg_view_state *view)
{
    hg_path_destroy(view->gi.gather.path);
    hg_gpu_image_destroy(view->context->gpu, &view->gi.gather.light);
    hg_gpu_image_destroy(view->context->gpu, &view->gi.gather.glass);
    forget_blocks(view);
    view->gi.gather = (struct hg_view_gather){0};
}

// About as many for a picture of any size, as the filter is as wide as a part of it: a power of two
// for each pixel, in proportion to the samples that the settled picture is to have.
static uint32_t samples_of(const struct hg_view_settings *s)
{
    const double smaller = log2(FULL_PX / ((double)s->width * s->height));
    const double asked = log2(s->samples / FULL_SAMPLES);
    const double bits = round(1 + 0.75 * smaller + fmin(asked, 0));
    return 1u << (uint32_t)fmin(fmax(bits, 0), MOST_BITS);
}

// Together with those of directional lights alone.
static uint32_t all_samples_of(const struct hg_view_settings *s)
{
    const uint32_t samples = samples_of(s);
    return samples > SUN_SAMPLES ? samples : SUN_SAMPLES;
}

// Nearest hit that the field may shade, metres: the last grid is the finest (shaders/shared/gi.h).
static float nearest_end(const struct hg_view_state *view)
{
    struct hg_gpu_probes probes;
    hg_gi_fill(view->scene_gpu->gi, view->gi.field, hg_gi_view_id(view), &probes);
    return probes.count > 0 ? REACH * probes.grids[probes.count - 1].spacing : 0;
}

// Lamps beyond the first ones share numbers.
static uint32_t lamps_of(const struct hg_view_state *view)
{
    struct hg_lighting_sources lights;
    hg_lighting_sources(view->lighting, &lights);
    if (hg_lighting_shadowed_lamps(view->lighting) == 0)
        return 0;
    return lights.count < HG_GATHERED_LAMPS ? lights.count : HG_GATHERED_LAMPS;
}

// Samples of lamps alone, with two rays each, so that each lamp has some from each pixel; where no
// directional light has it the second ray of all others is for lamps as well.
static uint32_t lamp_samples_of(const struct hg_view_state *view)
{
    struct hg_lighting_sources lights;
    hg_lighting_sources(view->lighting, &lights);
    const uint32_t lamps = hg_lighting_shadowed_lamps(view->lighting);
    const uint32_t rays = LAMP_RAYS * (lamps < LAMPS_APART ? lamps : LAMPS_APART);
    const uint32_t there = lights.directional_count > 0 ? 0 : samples_of(&view->settings);
    return rays > there ? (rays - there + 1) / 2 : 0;
}

static struct hg_path_request request_of(const struct hg_view_state *view, bool glass)
{
    const struct hg_view_settings *s = &view->settings;
    struct hg_path_request request = {.camera = view->camera,
        .width = s->width,
        .height = s->height,
        .region = {0, 0, s->width, s->height}, // the filter looks around
        .samples = glass ? samples_of(s) : all_samples_of(s),
        .seed = s->seed,
        .error_px = s->error_px,
        .gather = {.on = true,
            .glass = glass,
            .lamps = glass ? 0 : lamps_of(view),
            .reach = REACH,
            .near_m = nearest_end(view),
            .full = samples_of(s),
            .lamp_samples = glass ? 0 : lamp_samples_of(view)},
        .aside = true,
        .build_wait_ns = HG_FRAME_BUILD_WAIT_NS};
    request.settings = (struct hg_path_settings){.trace = s->path.trace,
        .filter = FILTER_BOX,
        .filter_radius_px = 0.5f,
        .max_bounces = glass ? GLASS_BOUNCE : MOST_BOUNCE,
        .denoise = true, // the film has what the denoiser is guided by
        .frame_s = s->path.frame_s};
    if (glass)
        request.region = hg_glass_region(view);
    return request;
}

static uint32_t first_half(uint32_t samples)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < samples; i++)
        count += HG_PATH_IS_FIRST_HALF(i);
    return count;
}

static enum hg_status make_image(struct hg_view_state *view, struct hg_gpu_image *image,
    uint32_t rows, VkFormat format, const char *name, struct hg_error *err)
{
    const uint32_t width = view->settings.width;
    const struct hg_gpu_image_params params = {
        .format = format, .width = width, .height = rows, .name = name};
    if (image->width == width && image->height == rows)
        return HG_OK;
    hg_gpu_image_destroy(view->context->gpu, image);
    return hg_gpu_image_create(view->context->gpu, &params, image, err);
}

// The film knows all that the picture shows but for what emissive textures have.
static bool film_tells_all(const struct hg_view_state *view)
{
    return hg_geometry_is_solid(view->scene_gpu->geometry) && view->settings.look == NULL &&
           (view->scene_gpu->features & HG_FEATURE_EMISSIVE) == 0;
}

// Where surfaces are alike all over fewer samples are enough.
static enum hg_status make_blocks(
    struct hg_view_state *view, const struct hg_gather_input *film, struct hg_error *err)
{
    const struct hg_view_settings *s = &view->settings;
    struct hg_draw_blocks *b = &view->gi.gather.blocks;
    const uint32_t columns = HG_SAMPLE_BLOCK_COLUMNS(s->width),
                   rows = HG_SAMPLE_BLOCK_ROWS(s->height);
    const size_t count = (size_t)columns * rows;
    forget_blocks(view);
    if (!film_tells_all(view) || s->samples <= HG_GATHER_LEAST_SAMPLES)
        return HG_OK;
    uint32_t *counts = hg_calloc(count, sizeof *counts);
    if (counts == NULL)
        return hg_error_set(err, HG_E_NOMEM, "gathered light", NULL, "out of host memory");
    hg_gather_samples(view->context->jobs, film, s->samples, counts);
    *b = (struct hg_draw_blocks){.counts = counts, .columns = columns, .least = s->samples};
    for (size_t i = 0; i < count; i++)
        b->least = counts[i] < b->least ? counts[i] : b->least;
    const enum hg_status status = hg_gpu_buffer_create(view->context->gpu, HG_GPU_BUFFER_DEVICE,
        count * sizeof *counts, "sample counts", &b->buffer, err);
    return status == HG_OK ? hg_gpu_buffer_upload(view->context->gpu, &b->buffer, 0, counts,
                                 count * sizeof *counts, err)
                           : status;
}

// What the paths brought, out of their film, which is large and let go of.
static enum hg_status load(
    struct hg_view_state *view, struct hg_gather **out, uint32_t *rows, struct hg_error *err)
{
    const struct hg_view_settings *s = &view->settings;
    struct hg_gather_input input = {.width = s->width,
        .height = s->height,
        .samples = samples_of(s),
        .first_half = first_half(samples_of(s))};
    struct hg_path_gathered film;
    enum hg_status status = hg_path_read_gathered(view->gi.gather.path, &film, err);
    input.sums = film.sums;
    input.lamps = film.lamps;
    input.lamp_count = film.lamp_count;
    *rows = hg_gather_rows(s->height, input.lamps != NULL);
    if (status == HG_OK) {
        input.halves = input.sums + HG_PATH_GUIDE_CHANNELS * (size_t)s->width * s->height;
        status = hg_gather_load(view->context->jobs, &input, out, err);
    }
    if (status == HG_OK)
        status = make_blocks(view, &input, err);
    hg_path_destroy(view->gi.gather.path);
    view->gi.gather.path = NULL;
    return status;
}

static enum hg_status filter(struct hg_view_state *view, struct hg_error *err)
{
    const struct hg_view_settings *s = &view->settings;
    uint32_t rows;
    const uint64_t start = hg_clock_now_ns();
    struct hg_gather *gather = NULL;
    uint32_t *words = NULL;
    enum hg_status status = load(view, &gather, &rows, err);
    const struct hg_gpu_region all = {.width = s->width, .height = rows};
    if (status == HG_OK) {
        words = hg_calloc(4 * (size_t)s->width * rows, sizeof *words);
        status = words != NULL
                     ? hg_gather_filter(gather, view->context->jobs, words, err)
                     : hg_error_set(err, HG_E_NOMEM, "gathered light", NULL, "out of host memory");
    }
    hg_gather_free(gather);
    if (status == HG_OK)
        status = make_image(
            view, &view->gi.gather.light, rows, VK_FORMAT_R32G32B32A32_UINT, "gathered light", err);
    if (status == HG_OK)
        status =
            hg_gpu_image_upload(view->context->gpu, &view->gi.gather.light, &all, words, 0, err);
    hg_free(words);
    hg_view_stats_add_stage(&view->stats, "gather filter", hg_clock_now_ns() - start);
    return status;
}

// Of each channel of a film the part of the picture that glass may be seen in.
static float *crop(
    const float *film, const struct hg_view_settings *s, const struct hg_picture_region *part)
{
    const size_t channels = HG_PATH_GUIDE_CHANNELS + HG_PATH_GUIDE_LIGHT;
    const size_t row = part->width;
    float *out = hg_calloc(channels * row * part->height, sizeof *out);
    for (size_t i = 0; i < channels * part->height && out != NULL; i++) {
        const size_t channel = i / part->height, y = part->y + i % part->height;
        memcpy(out + i * row, film + (channel * s->height + y) * s->width + part->x,
            row * sizeof *out);
    }
    return out;
}

static enum hg_status filter_glass(struct hg_view_state *view, const struct hg_picture_region *part,
    float *colors, struct hg_error *err)
{
    const uint32_t samples = samples_of(&view->settings);
    const uint64_t start = hg_clock_now_ns();
    struct hg_gather_input input = {.width = part->width,
        .height = part->height,
        .samples = samples,
        .first_half = first_half(samples)};
    struct hg_path_gathered film;
    enum hg_status status = hg_path_read_gathered(view->gi.gather.path, &film, err);
    if (status != HG_OK)
        return status;
    float *sums = crop(film.sums, &view->settings, part);
    if (sums == NULL)
        return hg_error_set(err, HG_E_NOMEM, "gathered light", NULL, "out of host memory");
    input.sums = sums;
    input.halves = sums + HG_PATH_GUIDE_CHANNELS * (size_t)part->width * part->height;
    status = hg_gather_glass(view->context->jobs, &input, view->settings.height, colors, err);
    hg_free(sums);
    hg_view_stats_add_stage(&view->stats, "gather filter", hg_clock_now_ns() - start);
    return status;
}

// What paths by way of glass brought: as they end at the first surface that scatters, clear glass
// has hardly any noise, and is left as it is.
static enum hg_status take_glass(struct hg_view_state *view, struct hg_error *err)
{
    const struct hg_view_settings *s = &view->settings;
    const struct hg_gpu_region all = {.width = s->width, .height = s->height};
    const struct hg_picture_region part = hg_glass_region(view);
    struct hg_gpu_image *image = &view->gi.gather.glass;
    struct hg_refbuf *colors = NULL;
    float *whole = hg_calloc((size_t)s->width * s->height, TEXEL_BYTES);
    enum hg_status status =
        whole != NULL ? hg_path_read(view->gi.gather.path, COLOR, 4, &colors, err)
                      : hg_error_set(err, HG_E_NOMEM, "gathered light", NULL, "out of host memory");
    if (status == HG_OK)
        status = filter_glass(view, &part, (float *)(void *)colors->data, err);
    for (uint32_t y = 0; y < part.height && status == HG_OK; y++)
        memcpy(whole + 4 * ((size_t)(part.y + y) * s->width + part.x),
            colors->data + (size_t)y * part.width * TEXEL_BYTES, (size_t)part.width * TEXEL_BYTES);
    if (status == HG_OK)
        status = make_image(
            view, image, s->height, VK_FORMAT_R32G32B32A32_SFLOAT, "light by way of glass", err);
    if (status == HG_OK)
        status = hg_gpu_image_upload(view->context->gpu, image, &all, whole, 0, err);
    hg_free(whole);
    hg_refbuf_unref(colors);
    hg_path_destroy(view->gi.gather.path);
    view->gi.gather.path = NULL;
    return status;
}

static enum hg_status take(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_view_gather *g = &view->gi.gather;
    const bool transmits = (view->scene_gpu->features & HG_FEATURE_TRANSMISSION) != 0 &&
                           hg_glass_region(view).width > 0;
    const enum hg_status status = g->lit ? take_glass(view, err) : filter(view, err);
    if (status != HG_OK)
        return status;
    g->done = g->lit || !transmits;
    g->lit = true;
    g->begun = false; // what comes next has a path of its own
    if (!transmits)
        hg_gpu_image_destroy(view->context->gpu, &g->glass);
    return HG_OK;
}

enum hg_status hg_gather_view_step(struct hg_view_state *view, struct hg_error *err)
{
    struct hg_view_gather *g = &view->gi.gather;
    const struct hg_gather_key key = hg_gather_view_key(view);
    const bool other = memcmp(&key, &g->key, sizeof key) != 0, begins = !g->begun || other;
    g->lit &= !other;
    const struct hg_path_request request = request_of(view, g->lit);
    enum hg_status status = hg_path_view_create(view, &g->path, err);
    g->key = key;
    g->begun = true;
    g->done = false;
    if (status == HG_OK)
        status = hg_path_step(g->path, &request, begins, err);
    hg_path_get_stats(g->path, &g->stats[g->lit]);
    if (status == HG_OK && hg_path_done(g->path))
        status = take(view, err);
    g->begun &= status == HG_OK;
    g->lit &= status == HG_OK;
    return status;
}
