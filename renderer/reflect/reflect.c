// reflect.c - see reflect.h.
#include "renderer/reflect/reflect.h"

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/reflect/hits.h"
#include "renderer/reflect/rays.h"
#include "renderer/reflect/spread.h"

#define SEQUENCE 1024 // pictures until directions repeat

// --- life ----------------------------------------------------------------------------------------

static enum hg_status no_memory(struct hg_error *err)
{
    return hg_error_set(err, HG_E_NOMEM, "reflections", NULL, "out of host memory");
}

enum hg_status hg_reflect_create(
    struct hg_gpu *gpu, struct hg_jobs *jobs, struct hg_reflect **out, struct hg_error *err)
{
    struct hg_reflect *r = hg_calloc(1, sizeof *r);
    *out = r;
    if (!r)
        return no_memory(err);
    r->gpu = gpu;
    r->jobs = jobs;
    return HG_OK;
}

static void forget(struct hg_reflect *r)
{
    for (int k = 0; k < HG_REFLECT_LEVELS; k++) {
        hg_free(r->levels[k].before.texels);
        hg_free(r->levels[k].before.sums);
        r->levels[k].before = (struct hg_reflect_history){0};
    }
}

static void free_texels(struct hg_reflect *r)
{
    forget(r);
    for (int k = 0; k < HG_REFLECT_LEVELS; k++) {
        hg_free(r->levels[k].texels);
        hg_free(r->levels[k].sums);
        hg_free(r->levels[k].spare);
        r->levels[k] = (struct hg_reflect_level){0};
    }
    hg_free(r->samples);
    hg_free(r->sources);
    hg_free(r->answers);
    hg_free(r->chosen);
    hg_free(r->waiting);
    hg_free(r->places);
    hg_free(r->smooth);
    hg_free(r->row_counts);
    hg_free(r->planes);
    r->samples = NULL;
    r->sources = r->answers = NULL;
    r->chosen = r->waiting = r->smooth = r->row_counts = NULL;
    r->places = NULL;
    r->planes = NULL;
    r->count = 0;
}

void hg_reflect_destroy(struct hg_reflect *r)
{
    if (!r)
        return;
    struct hg_gpu_buffer *buffers[] = {&r->rays, &r->hits, &r->list};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++)
        hg_gpu_buffer_destroy(r->gpu, buffers[i]);
    hg_gi_patches_finish(&r->light, r->gpu);
    free_texels(r);
    hg_free(r->asks);
    hg_free(r);
}

static enum hg_status make_buffers(struct hg_reflect *r, struct hg_error *err)
{
    const struct hg_reflect_image *blocks = &r->levels[HG_REFLECT_BLOCKS].image;
    const struct {
        struct hg_gpu_buffer *buffer;
        uint64_t bytes;
        const char *name;
    } rows[] = {{&r->rays, r->count * sizeof(struct hg_gpu_ray), "reflection rays"},
        {&r->hits, r->count * sizeof(struct hg_gpu_hit), "reflection hits"},
        {&r->list, 5ull * blocks->columns * blocks->rows * sizeof(uint32_t), "reflection list"}};
    enum hg_status status = HG_OK;
    for (size_t i = 0; i < sizeof rows / sizeof *rows && status == HG_OK; i++)
        status = hg_gpu_buffer_reserve(
            r->gpu, HG_GPU_BUFFER_READBACK, rows[i].bytes, rows[i].name, rows[i].buffer, err);
    return status;
}

static bool make_level(struct hg_reflect *r, int level, uint32_t columns, uint32_t rows)
{
    struct hg_reflect_level *l = &r->levels[level];
    const size_t count = (size_t)columns * rows;
    l->texels = hg_calloc(count, sizeof *l->texels);
    l->sums = hg_calloc(count, sizeof *l->sums);
    l->spare = hg_calloc(count, sizeof *l->spare);
    l->first = r->count;
    l->image = (struct hg_reflect_image){columns, rows,
        level == HG_REFLECT_BLOCKS ? 2 * HG_PROBE_LIGHT_PX : HG_PROBE_LIGHT_PX,
        level == HG_REFLECT_BLOCKS, l->texels, NULL, r->jobs};
    r->count += (uint32_t)count;
    return l->texels && l->sums && l->spare;
}

static bool make_texels(struct hg_reflect *r, uint32_t columns, uint32_t rows)
{
    const uint32_t across = (columns + 1) / 2, down = (rows + 1) / 2;
    if (!make_level(r, HG_REFLECT_TEXELS, columns, rows) ||
        !make_level(r, HG_REFLECT_BLOCKS, across, down))
        return false;
    r->samples = hg_calloc(r->count, sizeof *r->samples);
    r->sources = hg_calloc(r->count, sizeof *r->sources);
    r->answers = hg_calloc(r->count, sizeof *r->answers);
    r->chosen = hg_calloc((size_t)across * down, sizeof *r->chosen);
    r->waiting = hg_calloc(r->count, sizeof *r->waiting);
    r->places = hg_calloc(r->count, sizeof *r->places);
    r->row_counts = hg_calloc(down, sizeof *r->row_counts);
    r->smooth = hg_calloc(rows, sizeof *r->smooth);
    r->levels[HG_REFLECT_TEXELS].image.counts = r->smooth;
    r->planes = hg_calloc((size_t)HG_REFLECT_PLANES * (across + 2) * (down + 2), sizeof *r->planes);
    if (!r->asks)
        r->asks = hg_calloc(HG_REFLECT_MOST_LIT, sizeof *r->asks);
    return r->samples && r->sources && r->answers && r->chosen && r->waiting && r->places &&
           r->smooth && r->row_counts && r->planes && r->asks;
}

static enum hg_status resize(
    struct hg_reflect *r, uint32_t columns, uint32_t rows, struct hg_error *err)
{
    const struct hg_reflect_image *image = &r->levels[HG_REFLECT_TEXELS].image;
    if (image->columns == columns && image->rows == rows)
        return HG_OK;
    free_texels(r);
    enum hg_status status = make_texels(r, columns, rows) ? HG_OK : no_memory(err);
    if (status == HG_OK)
        status = make_buffers(r, err);
    if (status == HG_OK)
        status = hg_gi_patches_reserve(&r->light, r->gpu, HG_REFLECT_MOST_LIT, err);
    if (status != HG_OK)
        free_texels(r);
    return status;
}

// --- the picture ---------------------------------------------------------------------------------

// Where a texel of a block sent a ray for all of them the mask says what became of it.
static void count_sources(struct hg_reflect *r)
{
    const struct hg_reflect_level *blocks = &r->levels[HG_REFLECT_BLOCKS];
    const size_t count = (size_t)blocks->image.columns * blocks->image.rows;
    for (size_t i = 0; i < count; i++)
        if (blocks->texels[i].sends)
            r->sources[r->chosen[i]] = r->sources[blocks->first + i];
    for (size_t i = 0; i < blocks->first; i++)
        r->stats.counts[r->sources[i]]++;
    r->stats.texels = blocks->first;
}

static uint64_t bytes_of(const struct hg_reflect *r)
{
    const uint64_t texel = 2 * sizeof(struct hg_reflect_texel) + 3 * sizeof(hg_reflect_sums) +
                           sizeof *r->samples + 2 * sizeof *r->sources + sizeof *r->waiting +
                           sizeof *r->places + sizeof(struct hg_gpu_ray) +
                           sizeof(struct hg_gpu_hit) + sizeof(uint32_t);
    const uint64_t lit = sizeof *r->asks + sizeof *r->light.points + sizeof *r->light.direct +
                         sizeof *r->light.lit + sizeof *r->light.radiance +
                         HG_GI_SHADOW_RAYS * (sizeof(struct hg_gpu_ray) + sizeof(uint32_t));
    return r->count * texel + HG_REFLECT_MOST_LIT * lit;
}

// The picture is the history of the next one, whose texels take the place of those of the one
// before.
static bool keep(struct hg_reflect_level *l, const struct hg_reflect_picture *p)
{
    const size_t count = (size_t)l->image.columns * l->image.rows;
    struct hg_reflect_history *h = &l->before;
    if (!h->texels)
        h->texels = hg_calloc(count, sizeof *h->texels);
    if (!h->sums)
        h->sums = hg_calloc(count, sizeof *h->sums);
    if (!h->texels || !h->sums)
        return false;
    struct hg_reflect_texel *texels = h->texels;
    hg_reflect_sums *sums = h->sums;
    h->texels = l->texels;
    h->sums = l->sums;
    l->texels = texels;
    l->sums = sums;
    l->image.texels = texels;
    h->columns = l->image.columns;
    h->rows = l->image.rows;
    h->width = p->width;
    h->height = p->height;
    h->camera = *p->camera;
    return true;
}

// Rays of each texel that sends, and the light that they bring.
static enum hg_status sample(struct hg_reflect_work *w, struct hg_error *err)
{
    const uint32_t samples = w->p->samples > 0 ? w->p->samples : 1;
    const uint64_t begin = hg_clock_now_ns();
    enum hg_status status = HG_OK;
    for (int k = 0; k < HG_REFLECT_LEVELS; k++) {
        const struct hg_reflect_level *l = &w->r->levels[k];
        memset(l->sums, 0, (size_t)l->image.columns * l->image.rows * sizeof *l->sums);
    }
    for (w->sample = 0; w->sample < samples && status == HG_OK; w->sample++) {
        status = hg_reflect_cast(w, err);
        if (status == HG_OK)
            status = hg_reflect_shade(w, err);
    }
    w->r->stats.ray_ns = hg_clock_now_ns() - begin;
    return status;
}

static enum hg_status reflect(struct hg_reflect_work *w, struct hg_error *err)
{
    struct hg_reflect *r = w->r;
    bool kept = true;
    const enum hg_status status = sample(w, err);
    if (status != HG_OK)
        return status;
    if (!w->p->continues || memcmp(r->origin, w->p->origin, sizeof r->origin) != 0)
        forget(r);
    memcpy(r->origin, w->p->origin, sizeof r->origin);
    for (int k = 0; k < HG_REFLECT_LEVELS; k++) {
        struct hg_reflect_level *l = &r->levels[k];
        hg_reflect_filter_spatial(&l->image, &l->sums, &l->spare);
        hg_reflect_filter_temporal(&l->image, &l->before, &l->sums, &l->spare);
    }
    hg_reflect_spread(w);
    count_sources(r);
    for (int k = 0; k < HG_REFLECT_LEVELS; k++)
        kept &= keep(&r->levels[k], w->p);
    return kept ? HG_OK : no_memory(err);
}

enum hg_status hg_reflect_run(struct hg_reflect *r, const struct hg_reflect_picture *picture,
    uint32_t *out, struct hg_error *err)
{
    const uint64_t begin = hg_clock_now_ns(), cpu = hg_clock_cpu_ns();
    const uint32_t columns = (picture->width + HG_PROBE_LIGHT_PX - 1) / HG_PROBE_LIGHT_PX;
    const uint32_t rows = (picture->height + HG_PROBE_LIGHT_PX - 1) / HG_PROBE_LIGHT_PX;
    enum hg_status status = resize(r, columns, rows, err);
    if (status != HG_OK)
        return status;
    r->number = r->number % SEQUENCE + 1;
    r->stats = (struct hg_reflect_stats){0};
    struct hg_reflect_work w = {.r = r, .p = picture, .out = out};
    status = reflect(&w, err);
    if (status != HG_OK)
        forget(r);
    r->stats.ns = hg_clock_now_ns() - begin;
    r->stats.cpu_ns = hg_clock_cpu_ns() - cpu;
    r->stats.bytes = bytes_of(r);
    return status;
}

const uint8_t *hg_reflect_sources(const struct hg_reflect *r)
{
    return r->sources;
}

void hg_reflect_stats(const struct hg_reflect *r, struct hg_reflect_stats *out)
{
    *out = r ? r->stats : (struct hg_reflect_stats){0};
}
