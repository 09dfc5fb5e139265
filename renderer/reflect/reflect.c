// reflect.c - see reflect.h.
#include "renderer/reflect/reflect.h"

#include "base/alloc.h"
#include "base/clock.h"
#include "renderer/reflect/hits.h"
#include "renderer/reflect/rays.h"
#include "renderer/math/rgb9e5.h"

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
    hg_free(r->before.texels);
    hg_free(r->before.sums);
    r->before = (struct hg_reflect_history){0};
}

static void free_texels(struct hg_reflect *r)
{
    forget(r);
    hg_free(r->texels);
    hg_free(r->sums);
    hg_free(r->spare);
    hg_free(r->samples);
    hg_free(r->sources);
    hg_free(r->answers);
    hg_free(r->waiting);
    hg_free(r->places);
    hg_free(r->smooth);
    hg_free(r->row_counts);
    r->texels = NULL;
    r->sums = r->spare = NULL;
    r->samples = NULL;
    r->sources = r->answers = NULL;
    r->waiting = r->smooth = r->row_counts = NULL;
    r->places = NULL;
    r->image = (struct hg_reflect_image){0};
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
    const struct {
        struct hg_gpu_buffer *buffer;
        uint64_t bytes;
        const char *name;
    } rows[] = {{&r->rays, r->count * sizeof(struct hg_gpu_ray), "reflection rays"},
        {&r->hits, r->count * sizeof(struct hg_gpu_hit), "reflection hits"},
        {&r->list, r->count * sizeof(uint32_t), "reflection list"}};
    enum hg_status status = HG_OK;
    for (size_t i = 0; i < sizeof rows / sizeof *rows && status == HG_OK; i++)
        status = hg_gpu_buffer_reserve(
            r->gpu, HG_GPU_BUFFER_READBACK, rows[i].bytes, rows[i].name, rows[i].buffer, err);
    return status;
}

static bool make_texels(struct hg_reflect *r, uint32_t columns, uint32_t rows)
{
    const size_t count = (size_t)columns * rows;
    r->count = (uint32_t)count;
    r->texels = hg_calloc(count, sizeof *r->texels);
    r->sums = hg_calloc(count, sizeof *r->sums);
    r->spare = hg_calloc(count, sizeof *r->spare);
    r->samples = hg_calloc(count, sizeof *r->samples);
    r->sources = hg_calloc(count, sizeof *r->sources);
    r->answers = hg_calloc(count, sizeof *r->answers);
    r->waiting = hg_calloc(count, sizeof *r->waiting);
    r->places = hg_calloc(count, sizeof *r->places);
    r->row_counts = hg_calloc(rows, sizeof *r->row_counts);
    r->smooth = hg_calloc(rows, sizeof *r->smooth);
    r->image = (struct hg_reflect_image){columns, rows, r->texels, r->smooth, r->jobs};
    if (!r->asks)
        r->asks = hg_calloc(HG_REFLECT_MOST_LIT, sizeof *r->asks);
    return r->texels && r->sums && r->spare && r->samples && r->sources && r->answers &&
           r->waiting && r->places && r->smooth && r->row_counts && r->asks;
}

static enum hg_status resize(
    struct hg_reflect *r, uint32_t columns, uint32_t rows, struct hg_error *err)
{
    const struct hg_reflect_image *image = &r->image;
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

static void count_sources(struct hg_reflect *r)
{
    for (size_t i = 0; i < r->count; i++)
        r->stats.counts[r->sources[i]]++;
    r->stats.texels = r->count;
}

static uint64_t bytes_of(const struct hg_reflect *r)
{
    const uint64_t texel = 2 * sizeof(struct hg_reflect_texel) + 3 * sizeof(hg_reflect_sums) +
                           sizeof *r->samples + 2 * sizeof *r->sources + sizeof *r->waiting +
                           sizeof *r->places + sizeof(struct hg_gpu_ray) +
                           sizeof(struct hg_gpu_hit) + sizeof(uint32_t);
    const uint64_t lit = sizeof *r->asks + sizeof *r->light.points + sizeof *r->light.direct +
                         sizeof *r->light.lit + sizeof *r->light.radiance +
                         HG_HOST_SHADOW_RAYS * (sizeof(struct hg_gpu_ray) + sizeof(uint32_t));
    return r->count * texel + HG_REFLECT_MOST_LIT * lit;
}

// The picture is the history of the next one, whose texels take the place of those of the one
// before.
static bool keep(struct hg_reflect *r, const struct hg_reflect_picture *p)
{
    struct hg_reflect_history *h = &r->before;
    if (!h->texels)
        h->texels = hg_calloc(r->count, sizeof *h->texels);
    if (!h->sums)
        h->sums = hg_calloc(r->count, sizeof *h->sums);
    if (!h->texels || !h->sums)
        return false;
    struct hg_reflect_texel *texels = h->texels;
    hg_reflect_sums *sums = h->sums;
    h->texels = r->texels;
    h->sums = r->sums;
    r->texels = texels;
    r->sums = sums;
    r->image.texels = texels;
    h->columns = r->image.columns;
    h->rows = r->image.rows;
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
    memset(w->r->sums, 0, w->r->count * sizeof *w->r->sums);
    for (w->sample = 0; w->sample < samples && status == HG_OK; w->sample++) {
        status = hg_reflect_cast(w, err);
        if (status == HG_OK)
            status = hg_reflect_shade(w, err);
    }
    w->r->stats.ray_ns = hg_clock_now_ns() - begin;
    return status;
}

// What each texel mirrors takes the place of what the field says.
static void write_row(void *user, size_t y)
{
    const struct hg_reflect_work *w = user;
    const struct hg_reflect *r = w->r;
    const size_t first = y * r->image.columns;
    memcpy(w->out + 4 * first, w->p->light + 4 * first, (size_t)16 * r->image.columns);
    for (size_t i = first; i < first + r->image.columns; i++) {
        const hg_reflect_sums *s = &r->sums[i];
        const float weight = (*s)[HG_REFLECT_WEIGHT], scale = 1 / weight;
        if (!r->texels[i].mirrors || !(weight > 1e-6f))
            continue;
        const float open = hg_clampf((*s)[HG_REFLECT_OPEN] * scale, 0, 1);
        uint32_t *out = w->out + 4 * i;
        out[1] = hg_rgb9e5_pack((*s)[HG_REFLECT_RED] * scale, (*s)[HG_REFLECT_GREEN] * scale,
            (*s)[HG_REFLECT_BLUE] * scale);
        out[2] = (out[2] & 0xffffff) | (uint32_t)(open * 255 + 0.5f) << 24;
    }
}

static enum hg_status reflect(struct hg_reflect_work *w, struct hg_error *err)
{
    struct hg_reflect *r = w->r;
    const enum hg_status status = sample(w, err);
    if (status != HG_OK)
        return status;
    if (!w->p->continues || memcmp(r->origin, w->p->origin, sizeof r->origin) != 0)
        forget(r);
    memcpy(r->origin, w->p->origin, sizeof r->origin);
    hg_reflect_filter_spatial(&r->image, &r->sums, &r->spare);
    hg_reflect_filter_temporal(&r->image, &r->before, &r->sums, &r->spare);
    hg_jobs_for(r->jobs, r->image.rows, write_row, w);
    count_sources(r);
    return keep(r, w->p) ? HG_OK : no_memory(err);
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
