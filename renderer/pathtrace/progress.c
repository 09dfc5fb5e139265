// progress.c - see progress.h.
#include "renderer/pathtrace/progress.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"

// --- life ----------------------------------------------------------------------------------------

void hg_path_progress_finish(struct hg_path_progress *p)
{
    hg_free(p->done);
    hg_free(p->errors);
    p->done = NULL;
    p->errors = NULL;
}

// Samples are splatted to the pixels around them: the tiles next to those of the region, too, get
// samples, as they do in a whole picture.
static void leave_out(struct hg_path_progress *p, const struct hg_path_film *f)
{
    const uint32_t side = HG_PATH_TILE_SIDE, more = f->splats ? 1 : 0;
    const uint32_t left = f->region.x / side, top = f->region.y / side;
    const uint32_t right = (f->region.x + f->region.width - 1) / side + more;
    const uint32_t bottom = (f->region.y + f->region.height - 1) / side + more;
    for (uint32_t i = 0; i < f->tile_count; i++) {
        const uint32_t x = i % f->columns, y = i / f->columns;
        p->done[i] = x + more < left || y + more < top || x > right || y > bottom;
    }
}

enum hg_status hg_path_progress_begin(
    struct hg_path_progress *p, const struct hg_path_film *film, bool part, struct hg_error *err)
{
    const uint32_t tile_count = film->tile_count;
    const uint64_t changes = p->changes;
    hg_path_progress_finish(p);
    *p = (struct hg_path_progress){.changes = changes,
        .done = hg_calloc(tile_count, 1),
        .errors = hg_calloc(tile_count, sizeof *p->errors)};
    if (p->done == NULL || p->errors == NULL)
        return hg_error_set(err, HG_E_NOMEM, "path", NULL, "out of host memory");
    if (part)
        leave_out(p, film);
    return HG_OK;
}

// --- tiles ---------------------------------------------------------------------------------------

// The ring must also hold the row before those that are not in the film yet.
uint32_t hg_path_progress_choose(
    struct hg_path_progress *p, const struct hg_path_film *f, uint32_t tiles[HG_PATH_WAVE_TILES])
{
    uint32_t at = p->next_tile, count = 0;
    while (at < f->tile_count && p->done[at])
        at++;
    if (at / f->columns > p->next_row + 1) // no tile before is left
        p->next_row = at / f->columns - 1;
    const uint64_t end =
        ((uint64_t)p->next_row + f->ring_rows - (p->next_row > 0 ? 1 : 0)) * f->columns;
    for (; at < f->tile_count && at < end && count < HG_PATH_WAVE_TILES; at++) {
        if (!p->done[at])
            tiles[count++] = at;
    }
    while (at < f->tile_count && p->done[at])
        at++;
    p->next_tile = at;
    return count;
}

bool hg_path_progress_any_left(const struct hg_path_progress *p, const struct hg_path_film *f)
{
    for (uint32_t i = 0; i < f->tile_count; i++) {
        if (!p->done[i])
            return true;
    }
    return false;
}

// --- noise ---------------------------------------------------------------------------------------

// Variance of a shadow catcher's alpha: at most that of as many Bernoulli samples.
static double caught_error(const struct hg_path_film *f, const float *sums, uint64_t at, double n)
{
    if (f->planes[HG_PATH_PLANE_CATCHER] == HG_PATH_NO_PLANE)
        return 0.0;
    const double share = (double)hg_path_film_caught(f, sums, at);
    return share * (1.0 - share) / n;
}

// Root mean of variance over squared luminance; floor2 limits the weight of dark pixels.
static float tile_error(
    const struct hg_path_film *f, const float *sums, uint32_t tile, double floor2)
{
    const uint32_t x0 = tile % f->columns * HG_PATH_TILE_SIDE;
    const uint32_t y0 = tile / f->columns * HG_PATH_TILE_SIDE;
    const double n = ((const uint32_t *)f->samples.mapped)[tile];
    double sum = 0.0, mean;
    uint32_t count = 0;
    if (n < 2.0)
        return INFINITY;
    for (uint32_t y = y0; y < y0 + HG_PATH_TILE_SIDE && y < f->height; y++) {
        for (uint32_t x = x0; x < x0 + HG_PATH_TILE_SIDE && x < f->width; x++) {
            const double v = hg_path_film_variance(f, sums, (uint64_t)y * f->width + x, n, &mean);
            sum +=
                v / (mean * mean + floor2) + caught_error(f, sums, (uint64_t)y * f->width + x, n);
            count++;
        }
    }
    return (float)sqrt(sum / count);
}

static double mean_luminance(const struct hg_path_film *f, const float *sums)
{
    const uint64_t pixels = (uint64_t)f->width * f->height;
    const uint32_t *samples = f->samples.mapped;
    uint64_t sampled = 0;
    double sum = 0.0;
    for (uint32_t y = 0; y < f->height; y++) {
        for (uint32_t x = 0; x < f->width; x++) {
            const uint32_t tile = y / HG_PATH_TILE_SIDE * f->columns + x / HG_PATH_TILE_SIDE;
            if (samples[tile] == 0)
                continue; // outside of the region
            sum += hg_path_film_luminance(sums, (uint64_t)y * f->width + x, pixels) / samples[tile];
            sampled++;
        }
    }
    return sampled > 0 ? sum / (double)sampled : 0.0;
}

// A tile has converged when its neighbours have, too: a single estimate may be too low by chance.
static bool is_good(
    const struct hg_path_progress *p, const struct hg_path_film *f, uint32_t tile, float noise)
{
    const int32_t columns = (int32_t)f->columns, rows = (int32_t)f->rows;
    const int32_t x = (int32_t)(tile % f->columns), y = (int32_t)(tile / f->columns);
    for (int32_t j = y - 1; j <= y + 1; j++) {
        for (int32_t i = x - 1; i <= x + 1; i++) {
            const bool inside = i >= 0 && j >= 0 && i < columns && j < rows;
            if (inside && !(p->errors[j * columns + i] <= noise))
                return false;
        }
    }
    return true;
}

enum hg_status hg_path_progress_judge(struct hg_path_progress *p, struct hg_gpu *gpu,
    struct hg_path_film *f, float noise, uint32_t least_samples, struct hg_error *err)
{
    const bool catches = f->planes[HG_PATH_PLANE_CATCHER] != HG_PATH_NO_PLANE;
    const float *sums;
    enum hg_status status =
        hg_path_film_fetch(gpu, f, catches ? f->channels : HG_PATH_FILM_WORDS, &sums, err);
    if (status != HG_OK)
        return status;
    const double low = 0.05 * mean_luminance(f, sums);
    const uint32_t *samples = f->samples.mapped;
    uint32_t count = 0;
    double sum = 0.0;
    for (uint32_t i = 0; i < f->tile_count; i++) {
        p->errors[i] = tile_error(f, sums, i, low * low + 1e-20);
        if (samples[i] == 0)
            continue; // outside of the region
        sum += (double)p->errors[i] * (double)p->errors[i];
        count++;
    }
    p->noise = count > 0 ? (float)sqrt(sum / count) : 0.0f;
    for (uint32_t i = 0; i < f->tile_count && noise > 0.0f; i++)
        p->done[i] |= samples[i] >= least_samples && is_good(p, f, i, noise);
    return HG_OK;
}
