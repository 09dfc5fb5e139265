// film.c - the film: sums of samples, how good they are, planes.
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/pathtrace/path_state.h"

#define PLANE_COLOR    0u  // enum hg_plane of renderer.h
#define PLANE_SAMPLES  16u // stored by tile; its place in the film is taken by HG_PATH_PLANE_HITS
#define PLANE_VARIANCE 17u
#define PLANE_NOISY    19u // the colour

// --- filters -------------------------------------------------------------------------------------

enum filter { FILTER_BLACKMAN_HARRIS, FILTER_BOX, FILTER_TENT, FILTER_GAUSSIAN };

// Height at x in -1..1.
static double filter_at(uint32_t filter, double x)
{
    switch (filter) {
    case FILTER_BOX:
        return 1.0;
    case FILTER_TENT:
        return 1.0 - fabs(x);
    case FILTER_GAUSSIAN: // less its height at the end
        return exp(-4.5 * x * x) - exp(-4.5);
    default: // window of Harris 1978, four terms
        return 0.35875 + 0.48829 * cos(M_PI * x) + 0.14128 * cos(2.0 * M_PI * x) +
               0.01168 * cos(3.0 * M_PI * x);
    }
}

// Entry i: where the filter's integral from its left end is i / steps of the whole.
void hg_path_filter_fill(uint32_t filter, float radius_px, float out[HG_PATH_FILTER_STEPS + 1])
{
    enum { FINE = 8192 };
    double total = 0.0, sum = 0.0;
    uint32_t next = 1;
    for (int i = 0; i < FINE; i++)
        total += filter_at(filter, (i + 0.5) * 2.0 / FINE - 1.0);
    for (int i = 0; i < FINE && next < HG_PATH_FILTER_STEPS; i++) {
        const double h = filter_at(filter, (i + 0.5) * 2.0 / FINE - 1.0) / total;
        double want = (double)next / HG_PATH_FILTER_STEPS;
        while (next < HG_PATH_FILTER_STEPS && want <= sum + h) {
            const double part = h > 0.0 ? (want - sum) / h : 0.5;
            out[next++] = radius_px * (float)((i + part) * 2.0 / FINE - 1.0);
            want = (double)next / HG_PATH_FILTER_STEPS;
        }
        sum += h;
    }
    while (next < HG_PATH_FILTER_STEPS)
        out[next++] = radius_px;
    out[0] = -radius_px;
    out[HG_PATH_FILTER_STEPS] = radius_px;
}

// --- samples that count for neighbours -----------------------------------------------------------

#define SPLAT_RADIUS_PX 1.5f // of the widest filter that does not reach farther than the next pixel

static bool splats(const struct hg_path_settings *s)
{
    return s->filter_radius_px <= SPLAT_RADIUS_PX;
}

static uint32_t mix_bits(uint32_t x)
{
    x ^= x >> 16;
    x *= 0x21f0aaadu;
    x ^= x >> 15;
    x *= 0x735a2d97u;
    return x ^ (x >> 15);
}

// Each bit is flipped depending on the bits above it: Owen's scrambling, bit by bit.
static uint32_t scramble(uint32_t x, uint32_t seed)
{
    uint32_t out = 0, above = seed;
    for (int bit = 31; bit >= 0; bit--) {
        const uint32_t b = x >> bit & 1u;
        out |= (b ^ (mix_bits(above) & 1u)) << bit;
        above = mix_bits(above * 2u + b + 0x9e3779b9u);
    }
    return out;
}

// Points of Sobol's second and third dimension, scrambled; -0.5..0.5. The first one is by which
// parts of the shutter's time follow each other (path_time.c): all three together are well
// distributed. Source of the direction numbers: Joe and Kuo 2008, "Constructing Sobol Sequences
// with Better Two-Dimensional Projections".
static void splat_offset(uint32_t number, uint32_t seed, float out[2])
{
    uint32_t v[2] = {1u << 31, 1u << 31}, before = 0, x = 0, y = 0;
    for (uint32_t i = number, bit = 0; i != 0; i >>= 1, bit++) {
        x ^= (i & 1u) != 0 ? v[0] : 0;
        y ^= (i & 1u) != 0 ? v[1] : 0;
        v[0] ^= v[0] >> 1;
        const uint32_t next = bit == 0 ? 3u << 30 : v[1] ^ before ^ before >> 2;
        before = v[1];
        v[1] = next;
    }
    const uint32_t salt = mix_bits(seed ^ 0xb5297a4du);
    x = scramble(x, mix_bits(salt ^ 0x68bc21ebu));
    y = scramble(y, mix_bits(salt ^ 0x02e5be93u));
    out[0] = ((float)(x >> 8) + 0.5f) / 16777216.0f - 0.5f;
    out[1] = ((float)(y >> 8) + 0.5f) / 16777216.0f - 0.5f;
}

static struct hg_vec3 splat_weights(const struct hg_path_settings *s, float offset)
{
    float w[3], sum = 0.0f;
    for (int i = 0; i < 3; i++) {
        const double x = ((double)offset + i - 1) / (double)s->filter_radius_px;
        w[i] = fabs(x) < 1.0 ? fmaxf((float)filter_at(s->filter, x), 0.0f) : 0.0f;
        sum += w[i];
    }
    if (!(sum > 0.0f)) // between filters that are narrower than pixels
        return (struct hg_vec3){0.0f, 1.0f, 0.0f};
    return (struct hg_vec3){w[0] / sum, w[1] / sum, w[2] / sum};
}

void hg_path_splat_fill(
    const struct hg_path_settings *s, uint32_t pass, uint32_t seed, struct hg_gpu_path *out)
{
    splat_offset(pass, seed, out->splat_offset);
    for (int i = 0; i < 2 && s->filter_radius_px < 0.5f; i++)
        out->splat_offset[i] *= 2.0f * s->filter_radius_px;
    out->splat_x = splat_weights(s, out->splat_offset[0]);
    out->splat_y = splat_weights(s, out->splat_offset[1]);
}

// A pixel's own samples are a mean over its places, which the filter is wider than: three weights
// that do the rest, so that both together have the mean and the variance of what the filter does.
struct spread {
    double own, own2, all, all2; // sums of places, and squared: own samples', all that count
    bool reaches;                // neighbours count
};

#define SPREAD_LEAST 0.002 // variance: where a pixel's own samples see nothing, those around tell

static void spread_add(struct spread *s, float offset, struct hg_vec3 weights)
{
    const float w[3] = {weights.x, weights.y, weights.z};
    s->own += (double)offset;
    s->own2 += (double)offset * (double)offset;
    for (int i = 0; i < 3; i++) {
        const double place = (double)offset + i - 1;
        s->all += (double)w[i] * place;
        s->all2 += (double)w[i] * place * place;
        s->reaches = s->reaches || (i != 1 && w[i] > 0.0f);
    }
}

static void spread_weights(const struct spread *s, double n, float out[3])
{
    const double own = s->own / n, all = s->all / n, off = all - own;
    const double wanted = s->all2 / n - all * all - (s->own2 / n - own * own);
    const double least = fmax(fabs(off) * (1.0 - fabs(off)), s->reaches ? SPREAD_LEAST : 0.0);
    const double second = fmax(wanted, least) + off * off;
    out[0] = (float)(0.5 * (second - off));
    out[1] = (float)(1.0 - second);
    out[2] = (float)(0.5 * (second + off));
}

void hg_path_splat_rest(const struct hg_path *p, const struct hg_path_settings *s, uint32_t seed,
    struct hg_denoise_taps out[HG_PATH_RESTS])
{
    struct spread x = {0}, y = {0};
    for (uint32_t i = 0; i < HG_PATH_RESTS; i++) {
        struct hg_gpu_path pass = {.splat_x = {0.0f, 1.0f, 0.0f}, .splat_y = {0.0f, 1.0f, 0.0f}};
        if (p->splats)
            hg_path_splat_fill(s, i, seed, &pass);
        spread_add(&x, pass.splat_offset[0], pass.splat_x);
        spread_add(&y, pass.splat_offset[1], pass.splat_y);
        spread_weights(&x, i + 1, out[i].x);
        spread_weights(&y, i + 1, out[i].y);
    }
}

// --- memory --------------------------------------------------------------------------------------

static uint32_t channels_of(const struct hg_path *p, uint32_t plane)
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
        return 3 * p->group_count;
    case HG_PATH_PLANE_CATCHER:
        return HG_PATH_CATCHER_WORDS;
    default:
        return 3;
    }
}

static void plan_channels(struct hg_path *p, const struct hg_path_settings *settings)
{
    const uint32_t planes = settings->planes;
    p->channels = HG_PATH_FILM_WORDS;
    for (uint32_t i = 0; i < HG_PATH_PLANE_COUNT; i++) {
        bool stored = i != PLANE_COLOR && i != PLANE_SAMPLES && i != PLANE_VARIANCE &&
                      i != PLANE_NOISY && (planes >> i & 1u) != 0;
        if (i == HG_PATH_PLANE_HITS)
            stored = (planes & (1u << HG_PATH_PLANE_DEPTH | 1u << HG_PATH_PLANE_POSITION)) != 0;
        if (i == HG_PATH_PLANE_GUIDE)
            stored = settings->denoise != 0;
        if (i == HG_PATH_PLANE_MOVED)
            stored = settings->denoise == HG_PATH_DENOISE_SERIES;
        if (i == HG_PATH_PLANE_CATCHER)
            stored = (p->options & HG_PATH_CATCHER) != 0;
        p->planes[i] = stored ? p->channels : HG_PATH_NO_PLANE;
        p->channels += stored ? channels_of(p, i) : 0;
    }
    p->sampled_channels = p->channels;
    if (settings->denoise != 0)
        p->channels += HG_PATH_GUIDE_CHANNELS + HG_PATH_SHOWN_CHANNELS;
    p->lists = p->channels;
    p->channels += p->list_count * 2 * HG_PATH_DRAWS_LENGTH;
}

void hg_path_film_destroy(struct hg_path *p)
{
    struct hg_gpu *gpu = p->context->gpu;
    hg_gpu_buffer_destroy(gpu, &p->film);
    hg_gpu_buffer_destroy(gpu, &p->film_read);
    hg_gpu_buffer_destroy(gpu, &p->samples);
    hg_gpu_buffer_destroy(gpu, &p->ring);
    hg_gpu_buffer_destroy(gpu, &p->traced);
    hg_gpu_buffer_destroy(gpu, &p->denoised);
    hg_free(p->done);
    hg_free(p->errors);
    p->done = NULL;
    p->errors = NULL;
}

static uint64_t film_bytes(const struct hg_path *p)
{
    return (uint64_t)p->channels * p->width * p->height * sizeof(float);
}

#define RING_ROWS                                                                                  \
    32u // of tiles besides those of a wave, so that waves are full where few tiles are left

static enum hg_status make_ring(struct hg_path *p, struct hg_error *err)
{
    struct hg_gpu *gpu = p->context->gpu;
    const uint32_t rows = HG_PATH_WAVE_TILES / p->columns + RING_ROWS;
    p->ring_rows = rows < p->rows ? rows : p->rows;
    const uint64_t words =
        (uint64_t)p->ring_rows * p->columns * HG_PATH_TILE_PX * (p->sampled_channels - 1);
    enum hg_status status = hg_gpu_buffer_create(
        gpu, HG_GPU_BUFFER_DEVICE, words * sizeof(float), "samples of a pass", &p->ring, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_create(gpu, HG_GPU_BUFFER_UPLOAD, (uint64_t)p->tile_count * 4,
            "traced tiles", &p->traced, err);
    if (status == HG_OK)
        memset(p->traced.mapped, 0, (size_t)p->tile_count * 4);
    return status;
}

enum hg_status hg_path_film_create(
    struct hg_path *p, const struct hg_view_settings *settings, struct hg_error *err)
{
    struct hg_gpu *gpu = p->context->gpu;
    hg_path_film_destroy(p);
    p->width = settings->width;
    p->height = settings->height;
    p->columns = (p->width + HG_PATH_TILE_SIDE - 1) / HG_PATH_TILE_SIDE;
    p->rows = (p->height + HG_PATH_TILE_SIDE - 1) / HG_PATH_TILE_SIDE;
    p->tile_count = p->columns * p->rows;
    p->transparent = settings->background == HG_BACKGROUND_MODE_NONE;
    p->splats = splats(&settings->path);
    plan_channels(p, &settings->path);
    enum hg_status status =
        hg_gpu_buffer_create(gpu, HG_GPU_BUFFER_DEVICE, film_bytes(p), "film", &p->film, err);
    if (status == HG_OK)
        status = hg_gpu_buffer_create(gpu, HG_GPU_BUFFER_UPLOAD, (uint64_t)p->tile_count * 4,
            "tile samples", &p->samples, err);
    if (status == HG_OK)
        status = make_ring(p, err);
    p->done = hg_calloc(p->tile_count, 1);
    p->errors = hg_calloc(p->tile_count, sizeof *p->errors);
    if (status == HG_OK && (p->done == NULL || p->errors == NULL))
        status = hg_error_set(err, HG_E_NOMEM, "path", NULL, "out of host memory");
    return status;
}

enum hg_status hg_path_film_fetch(
    struct hg_path *p, uint32_t channels, const float **out, struct hg_error *err)
{
    struct hg_gpu *gpu = p->context->gpu;
    const uint64_t bytes = film_bytes(p) / p->channels * channels;
    *out = p->film.mapped;
    if (p->film.mapped != NULL && hg_gpu_get_caps(gpu)->is_cpu)
        return HG_OK;
    struct hg_gpu_cmd *cmd;
    enum hg_status status = hg_gpu_buffer_reserve(
        gpu, HG_GPU_BUFFER_READBACK, bytes, "film readback", &p->film_read, err);
    if (status == HG_OK)
        status = hg_gpu_begin(gpu, &cmd, err);
    if (status != HG_OK)
        return status;
    const VkBufferCopy region = {.size = bytes};
    vkCmdCopyBuffer(hg_gpu_cmd_handle(cmd), p->film.handle, p->film_read.handle, 1, &region);
    hg_gpu_memory_barrier(cmd);
    *out = p->film_read.mapped;
    return hg_gpu_submit_and_wait(gpu, cmd, err);
}

// --- noise ---------------------------------------------------------------------------------------

static double luminance(const float *film, uint64_t at, uint64_t pixels)
{
    return 0.2126 * (double)film[at] + 0.7152 * (double)film[pixels + at] +
           0.0722 * (double)film[2 * pixels + at];
}

// Variance of a pixel's mean, of its luminance; n >= 2.
static double variance(const float *film, uint64_t at, uint64_t pixels, double n, double *mean)
{
    const double squares = film[HG_PATH_FILM_SQUARES * pixels + at];
    *mean = luminance(film, at, pixels) / n;
    const double v = (squares / n - *mean * *mean) / (n - 1.0);
    return v > 0.0 ? v : 0.0;
}

// Share of the light that arrives at a shadow catcher, as far as is known.
static float caught(const struct hg_path *p, const float *film, uint64_t at)
{
    const uint64_t pixels = (uint64_t)p->width * p->height;
    const float *from = film + p->planes[HG_PATH_PLANE_CATCHER] * pixels + at;
    const float unlit = from[HG_PATH_CATCHER_UNLIT * pixels];
    return unlit > 0.0f ? fminf(from[0] / unlit, 1.0f) : 1.0f;
}

// Of a shadow catcher's alpha: no more than that of as many yes and no.
static double caught_error(const struct hg_path *p, const float *film, uint64_t at, double n)
{
    if (p->planes[HG_PATH_PLANE_CATCHER] == HG_PATH_NO_PLANE)
        return 0.0;
    const double share = (double)caught(p, film, at);
    return share * (1.0 - share) / n;
}

// Root of the mean of variance over squared luminance; floor2 keeps black pixels from counting.
static float tile_error(const struct hg_path *p, const float *film, uint32_t tile, double floor2)
{
    const uint64_t pixels = (uint64_t)p->width * p->height;
    const uint32_t x0 = tile % p->columns * HG_PATH_TILE_SIDE;
    const uint32_t y0 = tile / p->columns * HG_PATH_TILE_SIDE;
    const double n = ((const uint32_t *)p->samples.mapped)[tile];
    double sum = 0.0, mean;
    uint32_t count = 0;
    if (n < 2.0)
        return INFINITY;
    for (uint32_t y = y0; y < y0 + HG_PATH_TILE_SIDE && y < p->height; y++) {
        for (uint32_t x = x0; x < x0 + HG_PATH_TILE_SIDE && x < p->width; x++) {
            const double v = variance(film, (uint64_t)y * p->width + x, pixels, n, &mean);
            sum +=
                v / (mean * mean + floor2) + caught_error(p, film, (uint64_t)y * p->width + x, n);
            count++;
        }
    }
    return (float)sqrt(sum / count);
}

static double mean_luminance(const struct hg_path *p, const float *film)
{
    const uint64_t pixels = (uint64_t)p->width * p->height;
    const uint32_t *samples = p->samples.mapped;
    double sum = 0.0;
    for (uint32_t y = 0; y < p->height; y++) {
        for (uint32_t x = 0; x < p->width; x++) {
            const uint32_t tile = y / HG_PATH_TILE_SIDE * p->columns + x / HG_PATH_TILE_SIDE;
            if (samples[tile] > 0)
                sum += luminance(film, (uint64_t)y * p->width + x, pixels) / samples[tile];
        }
    }
    return sum / (double)pixels;
}

// A tile is done when those around it are good enough as well: by itself it may have been lucky.
static bool is_good(const struct hg_path *p, uint32_t tile, float noise)
{
    const int32_t x = (int32_t)(tile % p->columns), y = (int32_t)(tile / p->columns);
    for (int32_t j = y - 1; j <= y + 1; j++) {
        for (int32_t i = x - 1; i <= x + 1; i++) {
            const bool inside = i >= 0 && j >= 0 && i < (int32_t)p->columns && j < (int32_t)p->rows;
            if (inside && !(p->errors[(uint32_t)j * p->columns + (uint32_t)i] <= noise))
                return false;
        }
    }
    return true;
}

enum hg_status hg_path_film_judge(struct hg_path *p, float noise, struct hg_error *err)
{
    const float *film;
    enum hg_status status = hg_path_film_fetch(
        p, p->options & HG_PATH_CATCHER ? p->channels : HG_PATH_FILM_WORDS, &film, err);
    if (status != HG_OK)
        return status;
    const double low = 0.05 * mean_luminance(p, film);
    double sum = 0.0;
    for (uint32_t i = 0; i < p->tile_count; i++) {
        p->errors[i] = tile_error(p, film, i, low * low + 1e-20);
        sum += (double)p->errors[i] * (double)p->errors[i];
    }
    p->noise = (float)sqrt(sum / p->tile_count);
    const uint32_t *samples = p->samples.mapped;
    const uint32_t least = // all parts of the shutter's time
        p->time_parts > HG_PATH_LEAST_SAMPLES ? p->time_parts : HG_PATH_LEAST_SAMPLES;
    for (uint32_t i = 0; i < p->tile_count && noise > 0.0f; i++)
        p->done[i] |= samples[i] >= least && is_good(p, i, noise);
    return HG_OK;
}

// --- planes --------------------------------------------------------------------------------------

static bool is_id(uint32_t plane)
{
    return plane == HG_PATH_PLANE_OBJECT || plane == HG_PATH_PLANE_MATERIAL ||
           plane == HG_PATH_PLANE_DRAWS;
}

static bool is_of_hits(uint32_t plane)
{
    return plane == HG_PATH_PLANE_DEPTH || plane == HG_PATH_PLANE_POSITION;
}

void hg_path_film_catch(const struct hg_path *p, const float *film, uint64_t at, float sum[4])
{
    const uint64_t pixels = (uint64_t)p->width * p->height;
    const uint32_t catcher = p->planes[HG_PATH_PLANE_CATCHER];
    if (catcher == HG_PATH_NO_PLANE)
        return;
    const float *from = film + catcher * pixels + at;
    const float share = caught(p, film, at);
    for (uint32_t c = 0; c < 3; c++)
        sum[c] += share * from[(HG_PATH_CATCHER_BEHIND + c) * pixels];
    sum[3] += from[HG_PATH_CATCHER_SAMPLES * pixels] * (p->transparent ? 1.0f - share : 1.0f);
}

static void color_pixel(const struct hg_path *p, const float *film, uint64_t at, float scale,
    uint32_t channels, float *out)
{
    const uint64_t pixels = (uint64_t)p->width * p->height;
    float sum[4];
    for (uint32_t c = 0; c < 4; c++)
        sum[c] = film[(HG_PATH_FILM_COLOR + c) * pixels + at];
    hg_path_film_catch(p, film, at, sum);
    for (uint32_t c = 0; c < channels; c++)
        out[c] = sum[c] * scale;
}

// One pixel of a plane from the film, of its channels from `skip` on.
static void plane_pixel(const struct hg_path *p, const float *film, uint32_t plane, uint32_t skip,
    uint32_t channels, uint64_t at, float *out)
{
    const uint64_t pixels = (uint64_t)p->width * p->height;
    const uint32_t x = (uint32_t)(at % p->width), y = (uint32_t)(at / p->width);
    const uint32_t tile = y / HG_PATH_TILE_SIDE * p->columns + x / HG_PATH_TILE_SIDE;
    const uint32_t n = ((const uint32_t *)p->samples.mapped)[tile];
    const float scale = n > 0 ? 1.0f / (float)n : 0.0f;
    double mean;
    if (plane == PLANE_SAMPLES) {
        out[0] = (float)n;
        return;
    }
    if (plane == PLANE_VARIANCE) {
        out[0] = n > 1 ? (float)variance(film, at, pixels, n, &mean) : 0.0f;
        return;
    }
    if (plane == PLANE_COLOR || plane == PLANE_NOISY) {
        color_pixel(p, film, at, scale, channels, out);
        return;
    }
    const uint32_t first = (plane == HG_PATH_PLANE_DRAWS ? p->lists : p->planes[plane]) + skip;
    float share = is_id(plane) ? (n > 0 ? 1.0f : 0.0f) : scale;
    if (is_of_hits(plane)) {
        const float hits = film[p->planes[HG_PATH_PLANE_HITS] * pixels + at];
        share = n > 0 && hits > 0.0f ? 1.0f / hits : 0.0f;
    }
    const bool moved = plane == HG_PATH_PLANE_POSITION && share > 0.0f;
    for (uint32_t c = 0; c < channels; c++) {
        const float value = film[(first + c) * pixels + at] * share;
        out[c] = moved ? (float)((double)value + p->origin[c]) : value;
    }
}

static enum hg_status read(struct hg_view_state *view, uint32_t plane, uint32_t skip,
    uint32_t channels, struct hg_refbuf **out, struct hg_error *err)
{
    struct hg_path *p = view->path;
    const float *film;
    *out = NULL;
    if (p == NULL || p->film.handle == VK_NULL_HANDLE || view->path_begins)
        return hg_error_set(err, HG_E_STATE, "view", NULL, "nothing was path-traced yet");
    const bool made = plane == PLANE_COLOR || plane == PLANE_NOISY || plane == PLANE_SAMPLES ||
                      plane == PLANE_VARIANCE;
    if (!made && p->planes[plane] == HG_PATH_NO_PLANE)
        return hg_error_set(err, HG_E_STATE, "view", "planes", "was not asked for");
    const uint64_t pixels = (uint64_t)p->width * p->height;
    enum hg_status status = hg_path_film_fetch(p, p->channels, &film, err);
    if (status != HG_OK)
        return status;
    *out = hg_refbuf_create(pixels * channels * sizeof(float));
    if (*out == NULL)
        return hg_error_set(err, HG_E_NOMEM, "planes", NULL, "out of host memory");
    float *to = (float *)(void *)(*out)->data;
    for (uint64_t i = 0; i < pixels; i++)
        plane_pixel(p, film, plane, skip, channels, i, to + i * channels);
    return HG_OK;
}

enum hg_status hg_path_read(struct hg_view_state *view, uint32_t plane, uint32_t channels,
    struct hg_refbuf **out, struct hg_error *err)
{
    return read(view, plane, 0, channels, out, err);
}

enum hg_status hg_path_read_group(
    struct hg_view_state *view, uint32_t group, struct hg_refbuf **out, struct hg_error *err)
{
    *out = NULL;
    if (group >= hg_path_group_count(view))
        return hg_error_set(err, HG_E_STATE, "view", "planes", "there is no such group of lights");
    return read(view, HG_PATH_PLANE_GROUPS, 3 * group, 3, out, err);
}

enum hg_status hg_path_read_names(
    struct hg_view_state *view, uint32_t kind, struct hg_refbuf **out, struct hg_error *err)
{
    const uint32_t channels = 2 * HG_PATH_DRAWS_LENGTH;
    uint32_t list;
    *out = NULL;
    if (!hg_path_list_of(view, kind, &list))
        return hg_error_set(err, HG_E_STATE, "view", "mattes", "was not asked for");
    return read(view, HG_PATH_PLANE_DRAWS, list * channels, channels, out, err);
}
