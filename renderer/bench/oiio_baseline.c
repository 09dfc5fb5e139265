#include "renderer/bench/oiio_baseline.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/jobs.h"
#include "base/json.h"
#include "renderer/bench/common.h"
#include "renderer/bench/sampler.h"
#include "renderer/bench/scene.h"
#include "renderer/image/texture_system.h"
#include "renderer/image/writer.h"

enum { SHOWN = 24, GRID = 64, ROUNDS = 3, TILE = 64, PATH_BYTES = 4096 };

struct comparison {
    const struct hg_bench_oiio_params *params;
    struct hg_store *store;
    struct hg_page_sources *sources;
    struct hg_image_source *origins; // [most]; path owned
    struct hg_page_source **opened;  // [most], NULL: left out or not there yet
    char (*paths)[PATH_BYTES];       // [count] of tiled files
    uint32_t most, count;
    uint32_t steps;
};

static enum hg_status no_memory(struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, "bench", NULL, "out of host memory");
}

static enum hg_status step_done(struct comparison *c, struct hg_error *err)
{
    const struct hg_bench_oiio_params *params = c->params;
    if (params->progress == NULL || params->progress(params->progress_user, ++c->steps))
        return HG_OK;
    return hg_error_set(err, HG_E_CANCELLED, "bench", NULL, "cancelled");
}

// Bytes that this process has read by calls of the system.
static enum hg_status count_bytes_read(uint64_t *bytes, struct hg_error *err)
{
    unsigned long long count = 0;
    FILE *f = fopen("/proc/self/io", "re");
    const bool known = f != NULL && fscanf(f, "rchar: %llu", &count) == 1;
    if (f != NULL)
        fclose(f);
    *bytes = count;
    return known ? HG_OK
                 : hg_error_set(err, HG_E_STATE, "/proc/self/io", NULL,
                       "this system does not count the bytes that are read");
}

// --- the set -------------------------------------------------------------------------------------

struct painting {
    struct hg_image *image;
    struct hg_bench_pattern pattern;
};

static void paint_row(void *user, size_t y)
{
    const struct painting *p = user;
    uint8_t *rgba = (uint8_t *)p->image->pixels + y * p->image->width * 4;
    hg_bench_pattern_row(&p->pattern, 0, 0, (uint32_t)y, p->image->width, rgba);
}

static enum hg_status paint(
    struct hg_image_source *origin, uint32_t index, uint32_t side_px, struct hg_error *err)
{
    struct hg_jobs *jobs = hg_jobs_create(0);
    enum hg_status status = HG_E_NOMEM;
    if (jobs != NULL)
        status = hg_image_create(side_px, side_px, HG_PIXEL_RGBA8, NULL, &origin->pixels);
    if (status == HG_OK) {
        struct painting painting = {&origin->pixels, {index + 1}};
        hg_jobs_for(jobs, side_px, paint_row, &painting);
        origin->pixels_srgb = true;
    }
    hg_jobs_destroy(jobs);
    return status == HG_OK ? HG_OK : no_memory(err);
}

// Opens texture number `index` of made ones and files, and makes its pack.
static enum hg_status open_texture(struct comparison *c, uint32_t index, struct hg_error *err)
{
    const struct hg_bench_oiio_params *params = c->params;
    struct hg_image_source *origin = &c->origins[index];
    struct hg_page_bake bake;
    enum hg_status status = HG_OK;
    static char label[] = "bench";
    *origin = (struct hg_image_source){.label = label};
    if (index < params->made)
        status = paint(origin, index, params->side_px, err);
    else if ((origin->path = hg_strdup(params->images[index - params->made])) == NULL)
        status = no_memory(err);
    const struct hg_page_source_params source = {.image = origin};
    struct hg_page_source *opened = NULL;
    if (status == HG_OK)
        status = hg_page_source_open(c->sources, &source, &opened, err);
    if (status == HG_OK && hg_page_source_info(opened)->texel_bytes != 4) {
        hg_page_source_close(opened);
        return HG_OK;
    }
    if (status == HG_OK)
        status = hg_page_source_bake(opened, &bake, err);
    if (opened != NULL)
        c->opened[c->count++] = opened;
    return status;
}

static enum hg_status open_set(struct comparison *c, struct hg_error *err)
{
    const struct hg_bench_oiio_params *params = c->params;
    char dir[PATH_BYTES];
    if (params->cache_dir == NULL ||
        snprintf(dir, sizeof dir, "%s/store", params->cache_dir) >= (int)sizeof dir)
        return hg_error_set(
            err, HG_E_STATE, "bench", NULL, "packs and tiled files need a cache folder");
    c->most = params->made + params->image_count;
    c->origins = hg_calloc(c->most + 1, sizeof *c->origins);
    c->opened = hg_calloc(c->most + 1, sizeof *c->opened);
    c->paths = hg_calloc(c->most + 1, sizeof *c->paths);
    if (c->origins == NULL || c->opened == NULL || c->paths == NULL)
        return no_memory(err);
    enum hg_status status = hg_store_open(&(struct hg_store_params){.dir = dir}, &c->store, err);
    const struct hg_page_sources_params sources = {
        .store = c->store, .memory_bytes = params->host_bytes};
    if (status == HG_OK)
        status = hg_page_sources_create(&sources, &c->sources, err);
    for (uint32_t i = 0; i < c->most && status == HG_OK; i++)
        status = open_texture(c, i, err);
    if (status == HG_OK && c->count == 0)
        return hg_error_set(err, HG_E_INVAL, "bench", NULL, "no textures of 8 bits");
    return status == HG_OK ? step_done(c, err) : status;
}

static void close_set(struct comparison *c)
{
    for (uint32_t i = 0; i < c->count; i++) {
        hg_page_source_close(c->opened[i]);
        if (c->paths[i][0] != '\0')
            unlink(c->paths[i]);
    }
    for (uint32_t i = 0; c->origins != NULL && i < c->most; i++) {
        hg_image_finish(&c->origins[i].pixels);
        hg_free(c->origins[i].path);
    }
    hg_page_sources_destroy(c->sources);
    hg_store_close(c->store);
    hg_free(c->origins);
    hg_free(c->opened);
    hg_free(c->paths);
}

// --- tiled files ---------------------------------------------------------------------------------

// The tiles of a page that lie inside its mip; `from` is its first texel in the page.
static enum hg_status put_tiles(struct hg_image_writer *writer, const uint8_t *page,
    const uint32_t from[2], const uint32_t at[2], const uint32_t side[2], struct hg_error *err)
{
    uint8_t tile[TILE * TILE * 4];
    enum hg_status status = HG_OK;
    for (uint32_t i = 0; i < 4 && status == HG_OK; i++) {
        const uint32_t dx = i % 2 * TILE, dy = i / 2 * TILE;
        if (at[0] + dx >= side[0] || at[1] + dy >= side[1])
            continue;
        for (uint32_t y = 0; y < TILE; y++)
            for (uint32_t x = 0; x < TILE; x++) { // beyond the page: whatever, it is not read
                const uint32_t px = from[0] + dx + x, py = from[1] + dy + y;
                const bool inside = px < HG_PAGE_PITCH && py < HG_PAGE_PITCH;
                memcpy(tile + (y * TILE + x) * 4,
                    page + (inside ? (size_t)py * HG_PAGE_PITCH + px : 0) * 4, 4);
            }
        status = hg_image_writer_tile(writer, at[0] + dx, at[1] + dy, tile, err);
    }
    return status;
}

static enum hg_status write_mip(struct hg_page_source *source, uint32_t mip,
    struct hg_image_writer *writer, uint8_t *page, struct hg_error *err)
{
    const struct hg_page_layout *l = &hg_page_source_info(source)->layout;
    const uint32_t side[2] = {hg_mips_side(l->width, mip), hg_mips_side(l->height, mip)};
    const bool tail = mip >= l->tail;
    const uint32_t j = tail ? mip - l->tail : 0;
    const uint32_t from[2] = {HG_PAGE_BORDER + (uint32_t)(tail ? HG_TAIL_X(j) : 0),
        HG_PAGE_BORDER + (uint32_t)(tail ? HG_TAIL_Y(j) : 0)};
    enum hg_status status = HG_OK;
    for (uint32_t y = 0; y < side[1] && status == HG_OK; y += HG_PAGE_TEXELS)
        for (uint32_t x = 0; x < side[0] && status == HG_OK; x += HG_PAGE_TEXELS) {
            const uint32_t at[2] = {x, y};
            status = hg_page_source_read(
                source, tail ? l->tail : mip, x / HG_PAGE_TEXELS, y / HG_PAGE_TEXELS, page, err);
            if (status == HG_OK)
                status = put_tiles(writer, page, from, at, side, err);
        }
    return status;
}

static enum hg_status write_file(
    struct hg_page_source *source, const char *path, uint8_t *page, struct hg_error *err)
{
    const struct hg_page_layout *l = &hg_page_source_info(source)->layout;
    const struct hg_image_writer_params params = {.path = path,
        .format = "tiff",
        .width = l->width,
        .height = l->height,
        .channels = 4,
        .tile_px = TILE};
    struct hg_image_writer *writer;
    enum hg_status status = hg_image_writer_begin(&params, &writer, err);
    if (status != HG_OK)
        return status;
    for (uint32_t m = 0; m < l->mips && status == HG_OK; m++) {
        if (m > 0)
            status = hg_image_writer_next_mip(writer, err);
        if (status == HG_OK)
            status = write_mip(source, m, writer, page, err);
    }
    if (status == HG_OK)
        return hg_image_writer_end(writer, err);
    hg_image_writer_abort(writer);
    return status;
}

static enum hg_status write_files(struct comparison *c, struct hg_error *err)
{
    uint8_t *page = hg_calloc((size_t)HG_PAGE_PITCH * HG_PAGE_PITCH, 4);
    enum hg_status status = page != NULL ? HG_OK : no_memory(err);
    for (uint32_t i = 0; i < c->count && status == HG_OK; i++) {
        if (snprintf(c->paths[i], PATH_BYTES, "%s/bench-%ld-%u.tif", c->params->cache_dir,
                (long)getpid(), i) >= PATH_BYTES)
            c->paths[i][0] = '\0';
        status = write_file(c->opened[i], c->paths[i], page, err);
    }
    hg_free(page);
    return status == HG_OK ? step_done(c, err) : status;
}

// --- the trace -----------------------------------------------------------------------------------

// One of two sides.
struct side {
    struct hg_bench_sampler *packs;
    struct hg_texture_system *oiio;
    double sum;
};

static bool sample_patch(
    struct side *side, uint32_t texture, const float centre[2], float scale, struct hg_error *err)
{
    if (side->packs != NULL)
        hg_bench_sampler_begin(side->packs);
    bool good = true;
    for (uint32_t i = 0; i < GRID * GRID && good; i++) {
        const float u = centre[0] + scale * ((float)(i % GRID) / GRID - 0.5f);
        const float v = centre[1] + scale * ((float)(i / GRID) / GRID - 0.5f);
        float rgba[4] = {0};
        const float uv[2] = {u - floorf(u), v - floorf(v)}, footprint = scale / GRID;
        good = side->packs != NULL
                   ? hg_bench_sampler_sample(side->packs, texture, uv, footprint, rgba, err)
                   : hg_texture_system_sample(side->oiio, texture, uv[0], uv[1], footprint, rgba);
        side->sum += (double)rgba[1];
    }
    return good;
}

static enum hg_status run_trace(const struct comparison *c, struct side *side, struct hg_error *err)
{
    for (uint32_t moment = 0; moment < c->params->moments; moment++)
        for (uint32_t k = 0; k < SHOWN; k++) {
            const uint32_t texture = (moment / 12 + k * 5) % c->count;
            const float at = (float)moment, phase = at * 0.03f + (float)k * 0.7f;
            const float scale = exp2f(-4.5f + 4.5f * cosf(phase)); // 1 .. 1/512 of the texture
            const float centre[2] = {0.5f + 0.4f * sinf(at * 0.011f + (float)k),
                0.5f + 0.4f * cosf(at * 0.013f + (float)k * 2)};
            struct hg_error reason = {0};
            if (!sample_patch(side, texture, centre, scale, &reason))
                return hg_error_set(
                    err, HG_E_IO, "bench", NULL, "a sample failed: %s", reason.reason);
        }
    return HG_OK;
}

static enum hg_status open_side(
    const struct comparison *c, bool packs, struct side *side, struct hg_error *err)
{
    *side = (struct side){0};
    if (packs)
        return hg_bench_sampler_create(
            c->opened, c->count, c->params->memory_bytes, &side->packs, err);
    enum hg_status status = hg_texture_system_create(c->params->memory_bytes, &side->oiio, err);
    for (uint32_t i = 0; i < c->count && status == HG_OK; i++)
        status = hg_texture_system_add(side->oiio, c->paths[i], err);
    return status;
}

static void close_side(struct side *side)
{
    hg_bench_sampler_destroy(side->packs);
    hg_texture_system_destroy(side->oiio);
}

// A round of one side, from nothing in memory.
static enum hg_status run_round(struct comparison *c, bool packs, struct hg_bench_times *times,
    struct hg_bench_oiio_side *out, struct hg_error *err)
{
    struct side side;
    uint64_t before = 0, after = 0, start = 0;
    enum hg_status status = open_side(c, packs, &side, err);
    if (status == HG_OK)
        status = count_bytes_read(&before, err);
    start = hg_clock_now_ns();
    if (status == HG_OK)
        status = run_trace(c, &side, err);
    const uint64_t ns = hg_clock_now_ns() - start;
    if (status == HG_OK)
        status = count_bytes_read(&after, err);
    if (status == HG_OK && hg_bench_times_add(times, ns) != HG_OK)
        status = no_memory(err);
    if (status == HG_OK) {
        out->bytes_read = after - before;
        out->texel_bytes = packs ? hg_bench_sampler_decoded_bytes(side.packs)
                                 : hg_texture_system_decoded_bytes(side.oiio);
        out->mean = side.sum / ((double)c->params->moments * SHOWN * GRID * GRID);
    }
    close_side(&side);
    return status == HG_OK ? step_done(c, err) : status;
}

static enum hg_status run_rounds(
    struct comparison *c, struct hg_bench_oiio_result *out, struct hg_error *err)
{
    struct hg_bench_times times[2] = {{0}};
    struct hg_bench_oiio_side *sides[2] = {&out->oiio, &out->packs};
    enum hg_status status = HG_OK;
    for (int i = 0; i < 2 * ROUNDS && status == HG_OK; i++) {
        const bool packs = (i + i / 2) % 2 == 0; // packs, oiio, oiio, packs, packs, oiio
        status = run_round(c, packs, &times[packs], sides[packs], err);
    }
    out->samples = (uint64_t)c->params->moments * SHOWN * GRID * GRID;
    for (int i = 0; i < 2; i++) {
        const double ms = hg_bench_times_at(&times[i], 0.5);
        sides[i]->samples_per_s = ms > 0 ? (double)out->samples / (ms * 1e-3) : 0;
        hg_bench_times_finish(&times[i]);
    }
    return status;
}

enum hg_status hg_bench_oiio_run(const struct hg_bench_oiio_params *params,
    struct hg_bench_oiio_result *out, struct hg_error *err)
{
    struct comparison comparison = {.params = params};
    *out = (struct hg_bench_oiio_result){0};
    enum hg_status status = open_set(&comparison, err);
    if (status == HG_OK)
        status = write_files(&comparison, err);
    if (status == HG_OK)
        status = run_rounds(&comparison, out, err);
    out->images = comparison.count;
    for (uint32_t i = 0; i < comparison.count; i++) {
        const struct hg_page_layout *l = &hg_page_source_info(comparison.opened[i])->layout;
        for (uint32_t m = 0; m < l->mips; m++)
            out->set_bytes += (uint64_t)hg_mips_side(l->width, m) * hg_mips_side(l->height, m) * 4;
    }
    close_set(&comparison);
    if (status != HG_OK)
        *out = (struct hg_bench_oiio_result){0};
    return status;
}

// --- report --------------------------------------------------------------------------------------

static void put_side(struct hg_writer *w, const char *prefix, const struct hg_bench_oiio_side *s)
{
    hg_json_put(w, "\"%ssamples_per_s\":%.0f,\"%sbytes_read\":%llu,\"%stexel_bytes\":%llu,", prefix,
        s->samples_per_s, prefix, (unsigned long long)s->bytes_read, prefix,
        (unsigned long long)s->texel_bytes);
}

void hg_bench_oiio_put(struct hg_writer *w, const struct hg_bench_oiio_params *params,
    const struct hg_bench_oiio_result *r)
{
    const struct hg_bench_oiio_side *packs = &r->packs, *oiio = &r->oiio;
    hg_json_put(w, "\"peer\":{\"system\":");
    hg_json_string(w, hg_texture_system_version());
    hg_json_put(w, ",\"memory_bytes\":%llu,\"images\":%u,\"set_bytes\":%llu,\"samples\":%llu,",
        (unsigned long long)params->memory_bytes, r->images, (unsigned long long)r->set_bytes,
        (unsigned long long)r->samples);
    put_side(w, "", oiio);
    put_side(w, "our_", packs);
    hg_json_put(w, "\"samples_ratio\":%.3f,\"bytes_ratio\":%.3f,\"mean_difference\":%.6f}",
        oiio->samples_per_s > 0 ? packs->samples_per_s / oiio->samples_per_s : 0,
        oiio->bytes_read > 0 ? (double)packs->bytes_read / (double)oiio->bytes_read : 0,
        fabs(packs->mean - oiio->mean));
}
