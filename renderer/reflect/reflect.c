// reflect.c - see reflect.h.
#include "renderer/reflect/reflect.h"

#include <float.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/hash.h"
#include "renderer/gi/words.h"
#include "renderer/reflect/filter.h"
#include "renderer/reflect/light.h"

#define SPARSE   0.45f // from this roughness on one texel of 2 x 2 sends a ray, each in its turn
#define MOST_LIT 8192  // surfaces that are lit for one picture
#define LIFT     2e-3f // of the depth, that rays begin off surfaces: levels of detail differ
#define FAR      1e4f  // metres; where a ray that meets nothing counts as having ended
#define SEQUENCE 1024  // pictures until directions repeat

struct ask { // of a texel that waits for light
    uint32_t texel;
    struct hg_cache_place place;
    bool cached; // the light is that of the place
    uint32_t point;
};

struct hg_reflect {
    struct hg_gpu *gpu;
    struct hg_jobs *jobs;
    uint32_t columns, rows, number;
    struct hg_reflect_texel *texels;
    struct hg_lobe_sample *samples;
    hg_reflect_sums *sums, *spare;
    uint8_t *sources, *answers; // [rows][columns] enum hg_reflect_source, hg_cache_answer
    uint32_t *waiting;          // [rows][columns] texels that the cache has no light for
    struct hg_cache_place *places;
    uint32_t *row_counts; // [rows + 1]
    struct ask *asks;     // [MOST_LIT]
    uint32_t ask_count;
    struct hg_gpu_buffer rays, hits, list, capture_rays, capture_hits;
    struct hg_reflect_light light;
    struct hg_reflect_history before;
    double origin[3]; // that the history is relative to
    struct hg_reflect_stats stats;
};

// One picture.
struct work {
    struct hg_reflect *r;
    const struct hg_reflect_picture *p;
    uint32_t *out;
    float xi[2]; // of the sample
};

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
    hg_free(r->texels);
    hg_free(r->samples);
    hg_free(r->sums);
    hg_free(r->spare);
    hg_free(r->sources);
    hg_free(r->answers);
    hg_free(r->waiting);
    hg_free(r->places);
    hg_free(r->row_counts);
    r->texels = NULL;
    r->samples = NULL;
    r->sums = r->spare = NULL;
    r->sources = r->answers = NULL;
    r->waiting = NULL;
    r->places = NULL;
    r->row_counts = NULL;
    r->columns = r->rows = 0;
}

void hg_reflect_destroy(struct hg_reflect *r)
{
    if (!r)
        return;
    struct hg_gpu_buffer *buffers[] = {
        &r->rays, &r->hits, &r->list, &r->capture_rays, &r->capture_hits};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++)
        hg_gpu_buffer_destroy(r->gpu, buffers[i]);
    hg_reflect_light_finish(&r->light, r->gpu);
    forget(r);
    free_texels(r);
    hg_free(r->asks);
    hg_free(r);
}

static enum hg_status make_buffers(struct hg_reflect *r, uint32_t count, struct hg_error *err)
{
    const struct {
        struct hg_gpu_buffer *buffer;
        uint64_t bytes;
        const char *name;
    } rows[] = {{&r->rays, count * sizeof(struct hg_gpu_ray), "reflection rays"},
        {&r->hits, count * sizeof(struct hg_gpu_hit), "reflection hits"},
        {&r->list, count * sizeof(uint32_t), "reflection list"},
        {&r->capture_rays, MOST_LIT * sizeof(struct hg_gpu_ray), "radiance cache rays"},
        {&r->capture_hits, MOST_LIT * sizeof(struct hg_gpu_hit), "radiance cache hits"}};
    enum hg_status status = HG_OK;
    for (size_t i = 0; i < sizeof rows / sizeof *rows && status == HG_OK; i++)
        status = hg_gpu_buffer_reserve(
            r->gpu, HG_GPU_BUFFER_READBACK, rows[i].bytes, rows[i].name, rows[i].buffer, err);
    return status;
}

static enum hg_status resize(
    struct hg_reflect *r, uint32_t columns, uint32_t rows, struct hg_error *err)
{
    const size_t count = (size_t)columns * rows;
    if (r->columns == columns && r->rows == rows)
        return HG_OK;
    free_texels(r);
    forget(r);
    r->texels = hg_calloc(count, sizeof *r->texels);
    r->samples = hg_calloc(count, sizeof *r->samples);
    r->sums = hg_calloc(count, sizeof *r->sums);
    r->spare = hg_calloc(count, sizeof *r->spare);
    r->sources = hg_calloc(count, sizeof *r->sources);
    r->answers = hg_calloc(count, sizeof *r->answers);
    r->waiting = hg_calloc(count, sizeof *r->waiting);
    r->places = hg_calloc(count, sizeof *r->places);
    r->row_counts = hg_calloc((size_t)rows + 1, sizeof *r->row_counts);
    if (!r->asks)
        r->asks = hg_calloc(MOST_LIT, sizeof *r->asks);
    if (!r->texels || !r->samples || !r->sums || !r->spare || !r->sources || !r->answers ||
        !r->waiting || !r->places || !r->row_counts || !r->asks)
        return no_memory(err);
    enum hg_status status = make_buffers(r, (uint32_t)count, err);
    if (status == HG_OK)
        status = hg_reflect_light_reserve(&r->light, r->gpu, MOST_LIT, err);
    if (status == HG_OK) {
        r->columns = columns;
        r->rows = rows;
    }
    return status;
}

// --- rays ----------------------------------------------------------------------------------------

static float halton(uint32_t i, uint32_t base)
{
    float f = 1, sum = 0;
    for (; i > 0; i /= base) {
        f /= (float)base;
        sum += f * (float)(i % base);
    }
    return sum;
}

// Where the middle of a texel's block is; view: unit, towards the eye.
static void place(const struct hg_gpu_camera *c, float px, float py, struct hg_reflect_texel *t)
{
    const float origin[3] = {c->ray_origin_ws.x, c->ray_origin_ws.y, c->ray_origin_ws.z};
    const float x[3] = {c->ray_x_ws.x, c->ray_x_ws.y, c->ray_x_ws.z};
    const float y[3] = {c->ray_y_ws.x, c->ray_y_ws.y, c->ray_y_ws.z};
    const float eye[3] = {c->eye_ws.x, c->eye_ws.y, c->eye_ws.z};
    const float ahead[3] = {c->forward_ws.x, c->forward_ws.y, c->forward_ws.z};
    for (int a = 0; a < 3; a++) {
        const float ray = origin[a] + px * x[a] + py * y[a];
        t->position[a] = c->orthographic ? ray + ahead[a] * t->depth : eye[a] + ray * t->depth;
        t->view[a] = c->orthographic ? -ahead[a] : -ray;
    }
    hg_normalize3(t->view);
}

// The reflected ray of a texel, above the surface that its triangle lies in.
static void send(const struct work *w, size_t i, const float smooth[3])
{
    struct hg_reflect_texel *t = &w->r->texels[i];
    const uint64_t bits = hg_hash_mix(0x7265666cu, i);
    const float turn[2] = {
        (float)(bits >> 40) * 0x1p-24f, (float)(bits >> 16 & 0xffffff) * 0x1p-24f};
    float xi[2], from[3];
    for (int a = 0; a < 2; a++) { // Cranley-Patterson rotation
        xi[a] = w->xi[a] + turn[a];
        xi[a] -= floorf(xi[a]);
    }
    struct hg_lobe_sample s = hg_lobe_take(t->roughness, t->f0, t->normal, t->view, xi);
    const float below = hg_dot3(s.direction, smooth);
    if (below < 0) // normal maps bend rays into the surface
        hg_mad3(s.direction, smooth, -2 * below, s.direction);
    hg_mad3(t->position, smooth, LIFT * t->depth, from);
    ((struct hg_gpu_ray *)w->r->rays.mapped)[i] =
        (struct hg_gpu_ray){.origin_ws = {from[0], from[1], from[2]},
            .direction_ws = {s.direction[0], s.direction[1], s.direction[2]},
            .t_max = s.weight > 0 ? FLT_MAX : -1,
            .mask = HG_RAY_OPAQUE | HG_RAY_MASK};
    w->r->samples[i] = s;
    hg_copy3(from, t->position);
}

// Of the four texels of a block another one each picture.
static bool is_turn(const struct hg_reflect *r, uint32_t x, uint32_t y)
{
    static const uint8_t order[4] = {0, 3, 1, 2};
    return order[r->number & 3] == ((x & 1) | (y & 1) << 1);
}

static void sample_row(void *user, size_t y)
{
    const struct work *w = user;
    struct hg_reflect *r = w->r;
    uint32_t count = 0;
    for (uint32_t x = 0; x < r->columns; x++) {
        const size_t i = y * r->columns + x;
        const uint32_t *light = w->p->light + 4 * i, *mirror = w->p->mirrors + 2 * i;
        struct hg_reflect_texel *t = &r->texels[i];
        float smooth[3];
        memcpy(&t->depth, &light[3], sizeof t->depth);
        t->roughness = (float)(mirror[1] & HG_MIRROR_MOST) / HG_MIRROR_MOST;
        t->f0 = (float)(mirror[1] >> HG_MIRROR_ROUGHNESS_BITS) / HG_MIRROR_MOST;
        t->mirrors = t->depth > 0 && mirror[1] != UINT32_MAX;
        t->sends =
            t->mirrors && (t->roughness < SPARSE || w->p->dense || is_turn(r, x, (uint32_t)y));
        r->sources[i] = t->mirrors ? HG_REFLECT_ROUGH : HG_REFLECT_NOTHING;
        if (!t->mirrors)
            continue;
        hg_octahedral3((float)(int16_t)(mirror[0] & 0xffff) / 32767,
            (float)(int16_t)(mirror[0] >> 16) / 32767, t->normal);
        hg_octahedral3((float)(light[2] & 4095) * (2.0f / 4095) - 1,
            (float)(light[2] >> 12 & 4095) * (2.0f / 4095) - 1, smooth);
        const float px = hg_clampf((float)(x * HG_PROBE_LIGHT_PX + 2), 0, (float)(w->p->width - 1));
        const float py =
            hg_clampf((float)(y * HG_PROBE_LIGHT_PX + 2), 0, (float)(w->p->height - 1));
        place(w->p->camera, px + 0.5f, py + 0.5f, t);
        const float facing = hg_dot3(t->normal, t->view);
        if (facing < 0.02f) { // normal maps turn some surfaces away from the eye
            hg_mad3(t->normal, t->view, 0.02f - facing, t->normal);
            hg_normalize3(t->normal);
        }
        if (!t->sends)
            continue;
        send(w, i, smooth);
        ((uint32_t *)r->list.mapped)[y * r->columns + count++] = (uint32_t)i;
    }
    r->row_counts[y] = count;
}

// Rays of all rows one after the other.
static uint32_t compact(struct hg_reflect *r)
{
    uint32_t *list = r->list.mapped, count = 0;
    for (uint32_t y = 0; y < r->rows; y++) {
        memmove(list + count, list + (size_t)y * r->columns, r->row_counts[y] * sizeof *list);
        count += r->row_counts[y];
    }
    return count;
}

// --- what they meet ------------------------------------------------------------------------------

static void add(struct hg_reflect *r, size_t i, const float radiance[3], float open)
{
    const float w = r->samples[i].weight;
    if (!(radiance[0] + radiance[1] + radiance[2] < FLT_MAX))
        return; // filters would spread what is not a number
    r->sums[i] +=
        (hg_reflect_sums){w * radiance[0], w * radiance[1], w * radiance[2], w * open, w, 0, 0, 0};
}

static struct hg_cache_query query_of(const struct work *w, size_t i, bool captured)
{
    const struct hg_reflect_texel *t = &w->r->texels[i];
    const struct hg_gpu_hit *hit = (const struct hg_gpu_hit *)w->r->hits.mapped + i;
    const float *d = w->r->samples[i].direction;
    struct hg_cache_query q = {.roughness = t->roughness,
        .length = t->length,
        .sample = w->r->samples[i],
        .captured = captured};
    struct hg_gi_surface surface;
    hg_gi_surface_at(w->p->world.surfaces, hit, d, &surface);
    hg_mad3(t->position, d, t->length, q.position);
    hg_copy3(surface.normal, q.normal);
    return q;
}

// Of a ray that met something: what the cache has, or that the texel waits (HG_REFLECT_LATE).
static void look_up(const struct work *w, size_t i, bool captured)
{
    struct hg_reflect *r = w->r;
    const struct hg_cache_query q = query_of(w, i, captured);
    float radiance[3] = {0};
    const enum hg_cache_answer answer =
        hg_radiance_cache_find(w->p->cache, &q, &r->places[i], radiance);
    r->sources[i] = HG_REFLECT_LATE;
    r->answers[i] = (uint8_t)answer;
    if (answer < HG_CACHE_STALE)
        return;
    add(r, i, radiance, 0);
    r->sources[i] = HG_REFLECT_CACHED;
}

static void find_row(void *user, size_t y)
{
    const struct work *w = user;
    struct hg_reflect *r = w->r;
    static const float none[3] = {0};
    for (size_t i = y * r->columns; i < (y + 1) * r->columns; i++) {
        const struct hg_gpu_hit *hit = (const struct hg_gpu_hit *)r->hits.mapped + i;
        if (!r->texels[i].sends)
            continue;
        const bool met = hit->draw != HG_HIT_NONE && r->samples[i].weight > 0;
        r->texels[i].length = met ? hit->t : FAR;
        r->sources[i] = met ? HG_REFLECT_LATE : HG_REFLECT_SKY;
        r->answers[i] = HG_CACHE_NOTHING;
        if (!met)
            add(r, i, none, 1);
        else if (w->p->cache)
            look_up(w, i, false);
    }
}

// --- light ---------------------------------------------------------------------------------------

// Texels that wait for light; those of the cache whose light is old have it for now, and come last.
static uint32_t list_waiting(struct hg_reflect *r)
{
    const size_t count = (size_t)r->columns * r->rows;
    uint32_t waiting = 0;
    for (size_t i = 0; i < count; i++)
        if (r->sources[i] == HG_REFLECT_LATE)
            r->waiting[waiting++] = (uint32_t)i;
    const uint32_t late = waiting;
    for (size_t i = 0; i < count && late < MOST_LIT; i++)
        if (r->sources[i] == HG_REFLECT_CACHED && r->answers[i] == HG_CACHE_STALE)
            r->waiting[waiting++] = (uint32_t)i;
    return waiting;
}

// Every n-th of them where there are more than one picture has time for, others in the next one.
struct turn {
    uint32_t at, step;
};
static struct turn take_turn(const struct hg_reflect *r, uint32_t waiting)
{
    const uint32_t step = (waiting + MOST_LIT - 1) / MOST_LIT;
    return (struct turn){step > 0 ? r->number % step : 0, step > 0 ? step : 1};
}

static enum hg_status trace_captures(const struct work *w, uint32_t asked, struct hg_error *err)
{
    struct hg_reflect *r = w->r;
    const struct hg_gpu_ray *rays = r->capture_rays.mapped;
    const struct hg_gpu_hit *hits = r->capture_hits.mapped;
    const struct hg_trace_wave wave = {
        .rays = &r->capture_rays, .hits = &r->capture_hits, .count = asked};
    enum hg_status status = HG_OK;
    if (asked > 0)
        status = hg_trace_closest(w->p->world.trace, &wave, err);
    for (uint32_t i = 0; i < asked && status == HG_OK; i++) {
        const float d[3] = {rays[i].direction_ws.x, rays[i].direction_ws.y, rays[i].direction_ws.z};
        const bool met = hits[i].draw != HG_HIT_NONE;
        struct hg_gi_surface surface;
        if (met)
            hg_gi_surface_at(w->p->world.surfaces, &hits[i], d, &surface);
        hg_radiance_cache_capture(w->p->cache, r->asks[i].place, hits[i].t, met ? &surface : NULL);
    }
    r->stats.captured += asked;
    return status;
}

// Places that no ray has reached yet are captured, each once; then they are looked up again.
static enum hg_status capture(const struct work *w, uint32_t waiting, struct hg_error *err)
{
    struct hg_reflect *r = w->r;
    struct hg_gpu_ray *rays = r->capture_rays.mapped;
    const struct turn turn = take_turn(r, waiting);
    uint32_t asked = 0;
    for (uint32_t k = turn.at; k < waiting && asked < MOST_LIT; k += turn.step) {
        const uint32_t i = r->waiting[k];
        if (r->answers[i] != HG_CACHE_EMPTY || !hg_radiance_cache_ask(w->p->cache, r->places[i]))
            continue;
        hg_radiance_cache_ray(w->p->cache, r->places[i], &rays[asked]);
        r->asks[asked++].place = r->places[i];
    }
    const enum hg_status status = trace_captures(w, asked, err);
    for (uint32_t k = turn.at; k < waiting && status == HG_OK; k += turn.step)
        if (r->answers[r->waiting[k]] == HG_CACHE_EMPTY)
            look_up(w, r->waiting[k], true);
    return status;
}

static void point_of_hit(const struct work *w, uint32_t i, struct hg_cache_surface *out)
{
    const struct hg_reflect_texel *t = &w->r->texels[i];
    const struct hg_gpu_hit *hit = (const struct hg_gpu_hit *)w->r->hits.mapped + i;
    const float *d = w->r->samples[i].direction;
    struct hg_gi_surface surface;
    hg_gi_surface_at(w->p->world.surfaces, hit, d, &surface);
    hg_mad3(t->position, d, t->length, out->position);
    hg_copy3(surface.normal, out->normal);
    hg_copy3(surface.material->albedo, out->albedo);
    hg_copy3(surface.material->emission, out->emission);
}

// What is lit for this picture: places of the cache, each once, and hits that it has no place for.
static void choose_lit(const struct work *w, uint32_t waiting)
{
    struct hg_reflect *r = w->r;
    const struct turn turn = take_turn(r, waiting);
    r->ask_count = r->light.count = 0;
    for (uint32_t k = turn.at; k < waiting && r->ask_count < MOST_LIT; k += turn.step) {
        const uint32_t i = r->waiting[k];
        const bool cached = r->answers[i] >= HG_CACHE_UNLIT;
        if (r->sources[i] == HG_REFLECT_CACHED && r->answers[i] != HG_CACHE_STALE)
            continue;
        struct ask *ask = &r->asks[r->ask_count++];
        *ask = (struct ask){i, r->places[i], cached, UINT32_MAX};
        if (cached && !hg_radiance_cache_ask(w->p->cache, r->places[i]))
            continue; // another texel's
        ask->point = r->light.count++;
        if (cached)
            hg_radiance_cache_surface(w->p->cache, r->places[i], &r->light.points[ask->point]);
        else
            point_of_hit(w, i, &r->light.points[ask->point]);
    }
}

static void spread_light(const struct work *w)
{
    struct hg_reflect *r = w->r;
    for (uint32_t k = 0; k < r->ask_count; k++) {
        const struct ask *ask = &r->asks[k];
        if (ask->cached && ask->point != UINT32_MAX)
            hg_radiance_cache_light(w->p->cache, ask->place, r->light.radiance[ask->point]);
    }
    for (uint32_t k = 0; k < r->ask_count; k++) {
        const struct ask *ask = &r->asks[k];
        if (r->sources[ask->texel] == HG_REFLECT_CACHED)
            continue; // old light was good enough for this picture
        if (ask->cached)
            look_up(w, ask->texel, true);
        else
            add(r, ask->texel, r->light.radiance[ask->point], 0);
        r->sources[ask->texel] = HG_REFLECT_SHADED;
    }
}

static enum hg_status light(const struct work *w, struct hg_error *err)
{
    struct hg_reflect *r = w->r;
    const struct hg_reflect_lighting with = {r->jobs, w->p->sources, &w->p->world, r->number};
    const uint32_t waiting = list_waiting(r);
    enum hg_status status = w->p->cache ? capture(w, waiting, err) : HG_OK;
    if (status != HG_OK)
        return status;
    choose_lit(w, waiting);
    r->stats.lit += r->light.count;
    status = hg_reflect_light_run(&r->light, &with, &r->stats.shadow_rays, err);
    if (status == HG_OK)
        spread_light(w);
    return status;
}

// --- the picture ---------------------------------------------------------------------------------

static void count_sources(struct hg_reflect *r)
{
    for (size_t i = 0; i < (size_t)r->columns * r->rows; i++)
        r->stats.counts[r->sources[i]]++;
    r->stats.texels = r->columns * r->rows;
}

static uint64_t bytes_of(const struct hg_reflect *r)
{
    const uint64_t texel = 2 * sizeof *r->texels + sizeof *r->samples + 3 * sizeof *r->sums +
                           2 * sizeof *r->sources + sizeof *r->waiting + sizeof *r->places +
                           sizeof(struct hg_gpu_ray) + sizeof(struct hg_gpu_hit) + sizeof(uint32_t);
    const uint64_t lit = sizeof *r->asks + sizeof(struct hg_gpu_ray) + sizeof(struct hg_gpu_hit) +
                         sizeof *r->light.points + sizeof *r->light.direct +
                         sizeof *r->light.radiance +
                         HG_GI_SHADOW_RAYS * (sizeof(struct hg_gpu_ray) + sizeof(uint32_t));
    return (uint64_t)r->columns * r->rows * texel + MOST_LIT * lit;
}

// The picture is the history of the next one, whose texels take the place of those of the one
// before.
static enum hg_status keep(struct hg_reflect *r, const struct hg_reflect_picture *p)
{
    const size_t count = (size_t)r->columns * r->rows;
    struct hg_reflect_history *h = &r->before;
    if (!h->texels) {
        h->texels = hg_calloc(count, sizeof *h->texels);
        h->sums = hg_calloc(count, sizeof *h->sums);
        if (!h->texels || !h->sums) {
            forget(r);
            return HG_E_NOMEM;
        }
    }
    struct hg_reflect_texel *texels = h->texels;
    hg_reflect_sums *sums = h->sums;
    h->texels = r->texels;
    h->sums = r->sums;
    r->texels = texels;
    r->sums = sums;
    h->columns = r->columns;
    h->rows = r->rows;
    h->width = p->width;
    h->height = p->height;
    h->camera = *p->camera;
    memcpy(r->origin, p->origin, sizeof r->origin);
    return HG_OK;
}

static void pack_row(void *user, size_t y)
{
    const struct work *w = user;
    const struct hg_reflect *r = w->r;
    for (size_t i = y * r->columns; i < (y + 1) * r->columns; i++) {
        const uint32_t *light = w->p->light + 4 * i;
        uint32_t *out = w->out + 4 * i;
        const hg_reflect_sums s = r->sums[i];
        memcpy(out, light, 4 * sizeof *out);
        if (!r->texels[i].mirrors || !(s[HG_REFLECT_WEIGHT] > 1e-4f))
            continue;
        const float scale = 1 / s[HG_REFLECT_WEIGHT];
        const float open = hg_clampf(s[HG_REFLECT_OPEN] * scale, 0, 1);
        out[1] = hg_gi_rgb9e5(
            s[HG_REFLECT_RED] * scale, s[HG_REFLECT_GREEN] * scale, s[HG_REFLECT_BLUE] * scale);
        out[2] = (light[2] & 0xffffff) | (uint32_t)(open * 255 + 0.5f) << 24;
    }
}

// Where no ray was sent the one of the same block tells how far things are.
static void lend_row(void *user, size_t y)
{
    const struct work *w = user;
    struct hg_reflect *r = w->r;
    for (uint32_t x = 0; x < r->columns; x++) {
        struct hg_reflect_texel *t = &r->texels[y * r->columns + x];
        if (!t->mirrors || t->sends)
            continue;
        t->length = 0;
        for (uint32_t k = 0; k < 4; k++) {
            const uint32_t qx = (x & ~1u) + (k & 1), qy = ((uint32_t)y & ~1u) + (k >> 1);
            if (qx >= r->columns || qy >= r->rows)
                continue;
            const struct hg_reflect_texel *q = &r->texels[(size_t)qy * r->columns + qx];
            if (q->sends && hg_dot3(q->normal, t->normal) > 0.8f)
                t->length = q->length;
        }
    }
}

static enum hg_status trace(const struct work *w, struct hg_error *err)
{
    struct hg_reflect *r = w->r;
    hg_jobs_for(r->jobs, r->rows, sample_row, (void *)w);
    const struct hg_trace_wave wave = {
        .rays = &r->rays, .hits = &r->hits, .list = &r->list, .count = compact(r)};
    const enum hg_status status =
        wave.count > 0 ? hg_trace_closest(w->p->world.trace, &wave, err) : HG_OK;
    if (status == HG_OK) {
        hg_jobs_for(r->jobs, r->rows, find_row, (void *)w);
        hg_jobs_for(r->jobs, r->rows, lend_row, (void *)w);
    }
    return status;
}

// One ray of each texel, and the light that it brings.
static enum hg_status sample(struct work *w, uint32_t number, struct hg_error *err)
{
    w->xi[0] = halton(number, 2);
    w->xi[1] = halton(number, 3);
    const enum hg_status status = trace(w, err);
    return status == HG_OK ? light(w, err) : status;
}

static enum hg_status reflect(struct work *w, struct hg_error *err)
{
    struct hg_reflect *r = w->r;
    const struct hg_reflect_image image = {r->columns, r->rows, r->texels, r->jobs};
    const bool same = memcmp(r->origin, w->p->origin, sizeof r->origin) == 0;
    const uint32_t samples = w->p->samples > 0 ? w->p->samples : 1;
    enum hg_status status = HG_OK;
    memset(r->sums, 0, (size_t)r->columns * r->rows * sizeof *r->sums);
    for (uint32_t s = 0; s < samples && status == HG_OK; s++)
        status = sample(w, r->number * samples + s, err);
    if (status != HG_OK)
        return status;
    hg_reflect_filter_spatial(&image, &r->sums, &r->spare);
    if (!w->p->continues || !same)
        forget(r);
    hg_reflect_filter_temporal(&image, &r->before, &r->sums, &r->spare);
    hg_jobs_for(r->jobs, r->rows, pack_row, w);
    count_sources(r);
    return keep(r, w->p) == HG_OK ? HG_OK : no_memory(err);
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
    struct work w = {.r = r, .p = picture, .out = out};
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
