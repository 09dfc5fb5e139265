// film_cpu.c - accumulates samples in the film on the host, for CPU devices: the same as
// path_add.comp, row by row instead of word by word.
#include <string.h>

#include "base/jobs.h"
#include "base/simd.h"
#include "renderer/pathtrace/path_state.h"

#define SIDE HG_PATH_TILE_SIDE
#define TAPS 9
#define OWN  4 // of the nine

struct work {
    const struct hg_path_film *film;
    const struct hg_cryptomatte_ids *ids;
    const float *state;    // of the wave (keep)
    const uint32_t *tiles; // numbers of tiles of the picture, or of the wave (keep)
    uint32_t pass;
    float weights[TAPS];
};

static size_t ring_stride(const struct hg_path_film *f)
{
    return (size_t)f->columns * SIDE;
}

// First word of a row of pixels in the ring.
static size_t ring_row(const struct hg_path_film *f, uint32_t word, uint32_t y)
{
    const size_t row = (size_t)(y / SIDE % f->ring_rows) * SIDE + y % SIDE;
    return ((size_t)word * f->ring_rows * SIDE + row) * ring_stride(f);
}

// --- from the wave to the ring -------------------------------------------------------------------

static uint32_t even_bits(uint32_t i)
{
    i &= 0x55u;
    i = (i | i >> 1) & 0x33u;
    return (i | i >> 2) & 0x0fu;
}

static void keep_tile(void *user, size_t index)
{
    const struct work *work = user;
    const struct hg_path_film *f = work->film;
    const uint32_t tile = work->tiles[index];
    const uint32_t x0 = tile % f->columns * SIDE, y0 = tile / f->columns * SIDE;
    for (uint32_t k = 0; k + 1 < f->sampled_channels; k++) {
        const float *from =
            work->state + (size_t)(HG_PATH_OUT + k) * HG_PATH_WAVE_PX + index * HG_PATH_TILE_PX;
        float *to = (float *)f->ring.mapped + ring_row(f, k, y0) + x0;
        for (uint32_t i = 0; i < HG_PATH_TILE_PX; i++)
            to[even_bits(i >> 1) * ring_stride(f) + even_bits(i)] = from[i];
    }
}

// --- from the ring to the film -------------------------------------------------------------------

// A tile of the picture, and its pixels' samples of one channel.
struct tile {
    const struct hg_path_film *film;
    const struct hg_cryptomatte_ids *ids;
    const float *weights;
    uint32_t x0, y0, width, height;
    uint32_t pass;
    bool first, whole; // whole: all tiles around have samples
    bool around[TAPS]; // which of them do
};

static struct tile tile_of(const struct work *work, uint32_t number)
{
    const struct hg_path_film *f = work->film;
    const uint32_t *traced = f->traced.mapped;
    const uint32_t column = number % f->columns, row = number / f->columns;
    struct tile t = {.film = f,
        .ids = work->ids,
        .weights = work->weights,
        .x0 = column * SIDE,
        .y0 = row * SIDE,
        .pass = work->pass,
        .first = work->pass == 0};
    t.width = f->width - t.x0 < SIDE ? f->width - t.x0 : SIDE;
    t.height = f->height - t.y0 < SIDE ? f->height - t.y0 : SIDE;
    t.whole = t.width == SIDE && t.height == SIDE;
    for (uint32_t i = 0; i < TAPS; i++) {
        const uint32_t x = column + i % 3 - 1, y = row + i / 3 - 1; // wraps at the edge
        t.around[i] = x < f->columns && y < f->rows && traced[y * f->columns + x] == work->pass + 1;
        t.whole = t.whole && t.around[i];
    }
    return t;
}

// Index (0..8) of the surrounding tile that holds a pixel's neighbour.
static uint32_t side_of(uint32_t at, uint32_t tap)
{
    const uint32_t moved = at + tap; // position + 1
    return moved == 0 ? 0 : moved > SIDE ? 2 : 1;
}

// Weights of the pixel's neighbours that have samples, normalised to 1.
static void weights_at(const struct tile *t, uint32_t x, uint32_t y, float out[TAPS])
{
    const struct hg_path_film *f = t->film;
    float sum = 0.0f;
    for (uint32_t i = 0; i < TAPS; i++) {
        const uint32_t px = t->x0 + x + i % 3 - 1, py = t->y0 + y + i / 3 - 1;
        const bool there =
            px < f->width && py < f->height && t->around[side_of(y, i / 3) * 3 + side_of(x, i % 3)];
        out[i] = there ? t->weights[i] : 0.0f;
        sum += out[i];
    }
    for (uint32_t i = 0; i < TAPS; i++)
        out[i] /= sum;
}

// One pixel; taps without weight may lie outside of the ring and are not read.
static float taken(const struct tile *t, uint32_t word, uint32_t x, uint32_t y, const float w[TAPS])
{
    const float *ring = t->film->ring.mapped;
    float sum = 0.0f;
    for (uint32_t i = 0; i < TAPS; i++) {
        if (w[i] != 0.0f)
            sum +=
                ring[ring_row(t->film, word, t->y0 + y + i / 3 - 1) + t->x0 + x + i % 3 - 1] * w[i];
    }
    return sum;
}

HG_SIMD_LOOP static void blend_row(
    const float *const rows[3], const float w[TAPS], float out[restrict SIDE])
{
    for (uint32_t x = 0; x < SIDE; x++) {
        float sum = 0.0f;
        for (uint32_t i = 0; i < TAPS; i++)
            sum += rows[i / 3][x + i % 3] * w[i];
        out[x] = sum;
    }
}

// Reads one channel of the ring for all pixels of a tile.
static void blend(const struct tile *t, uint32_t word, float out[HG_PATH_TILE_PX])
{
    const float *ring = t->film->ring.mapped;
    float w[TAPS];
    if (t->whole) {
        weights_at(t, 1, 1, w);
        for (uint32_t y = 0; y < SIDE; y++) {
            const float *rows[3];
            for (uint32_t i = 0; i < 3; i++)
                rows[i] = ring + ring_row(t->film, word, t->y0 + y + i - 1) + t->x0 - 1;
            blend_row(rows, w, out + y * SIDE);
        }
        return;
    }
    for (uint32_t y = 0; y < t->height; y++) {
        for (uint32_t x = 0; x < t->width; x++) {
            weights_at(t, x, y, w);
            out[y * SIDE + x] = taken(t, word, x, y, w);
        }
    }
}

static void add_channel(
    const struct tile *t, uint32_t channel, bool fresh, const float in[HG_PATH_TILE_PX])
{
    const struct hg_path_film *f = t->film;
    float *film = (float *)f->sums.mapped + (size_t)channel * f->width * f->height +
                  (size_t)t->y0 * f->width + t->x0;
    for (uint32_t y = 0; y < t->height; y++, film += f->width) {
        for (uint32_t x = 0; x < t->width; x++)
            film[x] = fresh ? in[y * SIDE + x] : film[x] + in[y * SIDE + x];
    }
}

// Adds a sample's weight to the entry of the name that it hit, in a pixel's list.
static void list_name(float *list, size_t pixels, float draw, float weight)
{
    for (uint32_t i = 0; i < HG_PATH_DRAWS_LENGTH; i++, list += 2 * pixels) {
        if (list[0] != 0.0f && list[0] != draw)
            continue;
        list[0] = draw;
        list[pixels] += weight;
        return;
    }
}

// Updates the list of one pixel from the hits of its neighbours and their weights.
static void list_pixel(const struct tile *t, uint32_t number, const float w[TAPS],
    const float draws[TAPS], float *list)
{
    const struct hg_path_film *f = t->film;
    const size_t pixels = (size_t)f->width * f->height;
    const uint32_t *names = (const uint32_t *)t->ids->names.mapped + (size_t)number * t->ids->draws;
    list += (size_t)number * 2 * HG_PATH_DRAWS_LENGTH * pixels;
    for (uint32_t i = 0; i < 2 * HG_PATH_DRAWS_LENGTH && t->first; i++)
        list[i * pixels] = 0.0f;
    for (uint32_t i = 0; i < TAPS; i++) {
        if (w[i] > 0.0f && draws[i] > 0.0f)
            list_name(list, pixels, (float)(names[(uint32_t)draws[i] - 1] + 1), w[i]);
    }
}

static void list_all(const struct tile *t)
{
    const struct hg_path_film *f = t->film;
    const size_t pixels = (size_t)f->width * f->height;
    const uint32_t word = f->planes[HG_PATH_PLANE_DRAWS] - 1;
    for (uint32_t y = 0; y < t->height; y++) {
        for (uint32_t x = 0; x < t->width; x++) {
            float *list = (float *)f->sums.mapped + f->lists * pixels +
                          (size_t)(t->y0 + y) * f->width + t->x0 + x;
            float w[TAPS], one[TAPS], draws[TAPS];
            weights_at(t, x, y, w);
            for (uint32_t i = 0; i < TAPS; i++) {
                memset(one, 0, sizeof one);
                one[i] = w[i] != 0.0f ? 1.0f : 0.0f;
                draws[i] = taken(t, word, x, y, one);
            }
            for (uint32_t i = 0; i < t->ids->list_count; i++)
                list_pixel(t, i, w, draws, list);
        }
    }
}

// Denoiser inputs are not splatted: the denoiser assumes independent noise of neighbouring pixels.
static bool is_own(const struct hg_path_film *f, uint32_t c)
{
    const uint32_t moved = f->planes[HG_PATH_PLANE_MOVED], guide = f->planes[HG_PATH_PLANE_GUIDE];
    return c >= guide || (c >= moved && c - moved < HG_PATH_MOVED_WORDS);
}

// Channels that are ids and have no mean are taken from the pixel's own first sample.
static bool is_number(const struct hg_path_film *f, uint32_t c)
{
    const uint32_t moved = f->planes[HG_PATH_PLANE_MOVED];
    return c == f->planes[HG_PATH_PLANE_OBJECT] || c == f->planes[HG_PATH_PLANE_MATERIAL] ||
           c == f->planes[HG_PATH_PLANE_DRAWS] ||
           (moved != HG_PATH_NO_PLANE && c == moved + HG_PATH_MOVED_WHAT);
}

static void note_own(const struct tile *t, uint32_t channel, float out[HG_PATH_TILE_PX])
{
    const float *ring = t->film->ring.mapped;
    for (uint32_t y = 0; y < t->height; y++)
        memcpy(out + y * SIDE, ring + ring_row(t->film, channel - 1, t->y0 + y) + t->x0,
            t->width * sizeof *out);
}

// HG_PATH_SHOWN_*: guide channels of the denoiser; light is the sum of several channels.
static void add_shown(const struct tile *t, uint32_t guide)
{
    const uint32_t to = guide + 2 * HG_PATH_GUIDE_CHANNELS;
    float value[HG_PATH_TILE_PX], sum[HG_PATH_TILE_PX];
    for (uint32_t c = 0; c < HG_PATH_SHOWN_CHANNELS; c++) {
        const uint32_t from = c < HG_PATH_SHOWN_ALBEDO ? HG_PATH_GUIDE_DIRECT + c
                              : c < HG_PATH_SHOWN_HITS
                                  ? HG_PATH_GUIDE_ALBEDO + c - HG_PATH_SHOWN_ALBEDO
                                  : HG_PATH_GUIDE_HITS;
        blend(t, guide + from - 1, sum);
        for (uint32_t k = 3; c < HG_PATH_SHOWN_ALBEDO && k < HG_DENOISE_LIGHT; k += 3) {
            blend(t, guide + from + k - 1, value);
            for (uint32_t i = 0; i < HG_PATH_TILE_PX; i++)
                sum[i] += value[i];
        }
        add_channel(t, to + c, t->first, sum);
    }
}

static void add_planes(const struct tile *t)
{
    const struct hg_path_film *f = t->film;
    const uint32_t guide = f->planes[HG_PATH_PLANE_GUIDE];
    float value[HG_PATH_TILE_PX];
    for (uint32_t c = HG_PATH_FILM_WORDS; c < f->sampled_channels; c++) {
        if (is_number(f, c) && !t->first)
            continue;
        if (is_number(f, c) || is_own(f, c))
            note_own(t, c, value);
        else
            blend(t, c - 1, value);
        add_channel(t, c, t->first, value);
        if (c >= guide && c - guide < f->halves && HG_PATH_IS_FIRST_HALF(t->pass))
            add_channel(t, c + HG_PATH_GUIDE_CHANNELS, t->first, value);
    }
    if (t->ids->list_count > 0)
        list_all(t);
    if (guide != HG_PATH_NO_PLANE && f->halves == HG_PATH_GUIDE_CHANNELS)
        add_shown(t, guide);
}

static void add_tile(void *user, size_t index)
{
    const struct work *work = user;
    const struct tile t = tile_of(work, work->tiles[index]);
    float color[4][HG_PATH_TILE_PX], squares[HG_PATH_TILE_PX];
    for (uint32_t c = 0; c < 4; c++) {
        blend(&t, c, color[c]);
        add_channel(&t, c, t.first, color[c]);
    }
    for (uint32_t y = 0; y < t.height; y++) {
        for (uint32_t i = y * SIDE; i < y * SIDE + t.width; i++) {
            const float l = color[0][i] * 0.2126f + color[1][i] * 0.7152f + color[2][i] * 0.0722f;
            squares[i] = l * l;
        }
    }
    add_channel(&t, HG_PATH_FILM_SQUARES, t.first, squares);
    add_planes(&t);
}

// --- both ----------------------------------------------------------------------------------------

bool hg_film_cpu_is_used(const struct hg_path *p)
{
    return hg_gpu_strategy(p->context->gpu)->host_film && p->film.sums.mapped != NULL &&
           p->film.ring.mapped != NULL && p->wave.buffers.state.mapped != NULL;
}

void hg_film_cpu_keep(const struct hg_path *p)
{
    struct work work = {
        .film = &p->film, .state = p->wave.buffers.state.mapped, .tiles = p->wave.tile_index};
    hg_jobs_for(p->context->jobs, p->wave.tile_count, keep_tile, &work);
}

void hg_film_cpu_add(const struct hg_path *p, const uint32_t *tiles, uint32_t count)
{
    struct work work = {
        .film = &p->film, .ids = &p->scene.ids, .tiles = tiles, .pass = p->progress.pass};
    const float *x = &p->wave.block.splat_x.x, *y = &p->wave.block.splat_y.x;
    for (uint32_t i = 0; i < TAPS; i++)
        work.weights[i] = p->film.splats ? x[i % 3] * y[i / 3] : i == OWN ? 1.0f : 0.0f;
    hg_jobs_for(p->context->jobs, count, add_tile, &work);
}
