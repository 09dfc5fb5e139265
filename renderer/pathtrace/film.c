// film.c - see film.h.
#include "renderer/pathtrace/film.h"

#include <math.h>
#include <string.h>

#include "renderer/pathtrace/filter.h"
#include "shaders/shared/gi.h"

#define PLANE_COLOR    0u // enum hg_plane of renderer.h
#define PLANE_VARIANCE 17u
#define PLANE_NOISY    19u // the colour

// --- memory --------------------------------------------------------------------------------------

static uint32_t channels_of(uint32_t plane, const struct hg_path_film_plan *plan)
{
    switch (plane) {
    case HG_PATH_PLANE_DEPTH:
    case HG_PATH_PLANE_OBJECT:
    case HG_PATH_PLANE_MATERIAL:
    case HG_PATH_PLANE_HITS:
    case HG_PATH_PLANE_DRAWS:
        return 1;
    case HG_PATH_PLANE_MOTION:
        return 4;
    case HG_PATH_PLANE_MOVED:
        return HG_PATH_MOVED_WORDS;
    case HG_PATH_PLANE_GUIDE:
        return HG_PATH_GUIDE_CHANNELS;
    case HG_PATH_PLANE_GROUPS:
        return 3 * plan->group_count;
    case HG_PATH_PLANE_CATCHER:
        return HG_PATH_CATCHER_WORDS;
    case HG_PATH_PLANE_LAMPS:
        return plan->lamp_count;
    default:
        return 3;
    }
}

static bool is_stored(
    uint32_t plane, const struct hg_path_settings *settings, const struct hg_path_film_plan *plan)
{
    const uint32_t of_hits = 1u << HG_PATH_PLANE_DEPTH | 1u << HG_PATH_PLANE_POSITION;
    switch (plane) {
    case PLANE_COLOR:
    case PLANE_VARIANCE:
    case PLANE_NOISY:
        return false;
    case HG_PATH_PLANE_HITS:
        return (settings->planes & of_hits) != 0;
    case HG_PATH_PLANE_GUIDE:
        return settings->denoise != 0;
    case HG_PATH_PLANE_MOVED:
        return settings->denoise == HG_PATH_DENOISE_SERIES;
    case HG_PATH_PLANE_CATCHER:
        return (plan->options & HG_PATH_CATCHER) != 0;
    case HG_PATH_PLANE_LAMPS:
        return (plan->options & HG_PATH_LAMPS) != 0;
    default:
        return (settings->planes >> plane & 1u) != 0;
    }
}

static void plan_channels(struct hg_path_film *f, const struct hg_path_settings *settings,
    const struct hg_path_film_plan *plan)
{
    f->channels = HG_PATH_FILM_WORDS;
    for (uint32_t i = 0; i < HG_PATH_PLANE_COUNT; i++) {
        const bool stored = is_stored(i, settings, plan);
        f->planes[i] = stored ? f->channels : HG_PATH_NO_PLANE;
        f->channels += stored ? channels_of(i, plan) : 0;
    }
    f->sampled_channels = f->channels;
    f->lamp_count = plan->lamp_count;
    const bool gathers = (plan->options & HG_PATH_GATHERS) != 0;
    f->halves = gathers ? HG_PATH_GUIDE_LIGHT : HG_PATH_GUIDE_CHANNELS;
    if (settings->denoise != 0)
        f->channels += f->halves + (gathers ? 0 : HG_PATH_SHOWN_CHANNELS);
    f->lists = f->channels;
    f->channels += plan->list_count * 2 * HG_PATH_DRAWS_LENGTH;
}

void hg_path_film_destroy(struct hg_gpu *gpu, struct hg_path_film *f)
{
    struct hg_gpu_buffer *all[] = {&f->sums, &f->read_back, &f->samples, &f->ring, &f->traced};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        hg_gpu_buffer_destroy(gpu, all[i]);
}

static uint64_t film_bytes(const struct hg_path_film *f)
{
    return (uint64_t)f->channels * f->width * f->height * sizeof(float);
}

#define RING_ROWS                                                                                  \
    32u // of tiles besides those of a wave, so that waves are full where few tiles are left

static enum hg_status make_ring(struct hg_gpu *gpu, struct hg_path_film *f, struct hg_error *err)
{
    const uint32_t rows = HG_PATH_WAVE_TILES / f->columns + RING_ROWS;
    f->ring_rows = rows < f->rows ? rows : f->rows;
    const uint64_t words =
        (uint64_t)f->ring_rows * f->columns * HG_PATH_TILE_PX * (f->sampled_channels - 1);
    enum hg_status status = hg_gpu_buffer_create(
        gpu, HG_GPU_BUFFER_DEVICE, words * sizeof(float), "samples of a pass", &f->ring, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_create(gpu, HG_GPU_BUFFER_UPLOAD, (uint64_t)f->tile_count * 4,
            "traced tiles", &f->traced, err);
    if (status == HG_OK)
        memset(f->traced.mapped, 0, (size_t)f->tile_count * 4);
    return status;
}

enum hg_status hg_path_film_create(struct hg_gpu *gpu, const struct hg_path_request *request,
    const struct hg_path_film_plan *plan, struct hg_path_film *f, struct hg_error *err)
{
    hg_path_film_destroy(gpu, f);
    f->width = request->width;
    f->height = request->height;
    f->region = request->region;
    f->columns = (f->width + HG_PATH_TILE_SIDE - 1) / HG_PATH_TILE_SIDE;
    f->rows = (f->height + HG_PATH_TILE_SIDE - 1) / HG_PATH_TILE_SIDE;
    f->tile_count = f->columns * f->rows;
    f->transparent = request->transparent;
    f->splats = hg_path_filter_splats(&request->settings);
    plan_channels(f, &request->settings, plan);
    enum hg_status status =
        hg_gpu_buffer_create(gpu, HG_GPU_BUFFER_DEVICE, film_bytes(f), "film", &f->sums, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_create(gpu, HG_GPU_BUFFER_UPLOAD, (uint64_t)f->tile_count * 4,
            "tile samples", &f->samples, err);
    return status == HG_OK ? make_ring(gpu, f, err) : status;
}

enum hg_status hg_path_film_clear(struct hg_gpu *gpu, struct hg_path_film *f, struct hg_error *err)
{
    struct hg_gpu_cmd *cmd;
    const enum hg_status status = hg_gpu_begin(gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    vkCmdFillBuffer(hg_gpu_cmd_handle(cmd), f->sums.handle, 0, VK_WHOLE_SIZE, 0);
    return hg_gpu_submit_and_wait(gpu, cmd, err);
}

enum hg_status hg_path_film_fetch(struct hg_gpu *gpu, struct hg_path_film *f, uint32_t channels,
    const float **out, struct hg_error *err)
{
    const uint64_t bytes = film_bytes(f) / f->channels * channels;
    *out = f->sums.mapped;
    if (f->sums.mapped != NULL && hg_gpu_strategy(gpu)->host_reads)
        return HG_OK;
    struct hg_gpu_cmd *cmd;
    enum hg_status status = hg_gpu_buffer_reserve(
        gpu, HG_GPU_BUFFER_READBACK, bytes, "film readback", &f->read_back, err);
    if (status == HG_OK)
        status = hg_gpu_begin(gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    const VkBufferCopy region = {.size = bytes};
    vkCmdCopyBuffer(hg_gpu_cmd_handle(cmd), f->sums.handle, f->read_back.handle, 1, &region);
    hg_gpu_memory_barrier(cmd);
    *out = f->read_back.mapped;
    return hg_gpu_submit_and_wait(gpu, cmd, err);
}

// --- pixels --------------------------------------------------------------------------------------

uint32_t hg_path_film_samples_at(const struct hg_path_film *f, uint32_t x, uint32_t y)
{
    const uint32_t tile = y / HG_PATH_TILE_SIDE * f->columns + x / HG_PATH_TILE_SIDE;
    return ((const uint32_t *)f->samples.mapped)[tile];
}

double hg_path_film_luminance(const float *sums, uint64_t at, uint64_t pixels)
{
    return 0.2126 * (double)sums[at] + 0.7152 * (double)sums[pixels + at] +
           0.0722 * (double)sums[2 * pixels + at];
}

double hg_path_film_variance(
    const struct hg_path_film *f, const float *sums, uint64_t at, double n, double *mean)
{
    const uint64_t pixels = (uint64_t)f->width * f->height;
    const double squares = sums[HG_PATH_FILM_SQUARES * pixels + at];
    *mean = hg_path_film_luminance(sums, at, pixels) / n;
    const double v = (squares / n - *mean * *mean) / (n - 1.0);
    return v > 0.0 ? v : 0.0;
}

float hg_path_film_caught(const struct hg_path_film *f, const float *sums, uint64_t at)
{
    const uint64_t pixels = (uint64_t)f->width * f->height;
    const float *from = sums + f->planes[HG_PATH_PLANE_CATCHER] * pixels + at;
    const float unlit = from[HG_PATH_CATCHER_UNLIT * pixels];
    return unlit > 0.0f ? fminf(from[0] / unlit, 1.0f) : 1.0f;
}

void hg_path_film_catch(const struct hg_path_film *f, const float *sums, uint64_t at, float sum[4])
{
    const uint64_t pixels = (uint64_t)f->width * f->height;
    const uint32_t catcher = f->planes[HG_PATH_PLANE_CATCHER];
    if (catcher == HG_PATH_NO_PLANE)
        return;
    const float *from = sums + catcher * pixels + at;
    const float share = hg_path_film_caught(f, sums, at);
    for (uint32_t c = 0; c < 3; c++)
        sum[c] += share * from[(HG_PATH_CATCHER_BEHIND + c) * pixels];
    sum[3] += from[HG_PATH_CATCHER_SAMPLES * pixels] * (f->transparent ? 1.0f - share : 1.0f);
}
