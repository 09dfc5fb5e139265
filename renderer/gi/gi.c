// gi.c - waves of probe rays: directions, hits, shading, sums. See gi.h.
#include "renderer/gi/gi.h"

#include <float.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/log.h"
#include "renderer/gi/direct.h"
#include "renderer/gi/environment.h"
#include "renderer/gi/field.h"
#include "renderer/gi/occupancy.h"
#include "renderer/gi/sights.h"
#include "renderer/gi/surfaces.h"
#include "renderer/math/vec.h"

#define WAVE_PROBES 128
#define MOST_RAYS   96 // of a probe in a wave
#define PEAK_SHARE  8  // rays for each that goes to a peak of the environment
#define MOST_PEAKS  (MOST_RAYS / PEAK_SHARE)

// Rounds of the schedule: every probe once in each.
#define PLACE_ROUNDS 3
#define PLACE_RAYS   64
#define WARM_ROUNDS  8 // light that bounces comes to its level; what they sum up is let go of
#define WARM_RAYS    24
#define MAIN_ROUNDS  4
#define MAIN_RAYS    96
#define ROUNDS       (PLACE_ROUNDS + WARM_ROUNDS + MAIN_ROUNDS)
#define WARM_KEEP    0.4f
#define MAIN_KEEP    0.9f
#define MOVE_RAYS    16
#define FIRST_RAYS   8 // of the first updates since a change, so that light bounces on sooner
#define FIRST_ROUNDS 12
#define MOVE_MOST    10 // updates that a mean is of
#define MOVE_FADE    3  // for each so many since the change it is of one more
#define MOVE_ENOUGH  40 // updates of all probes since a change, after which none are needed

struct build { // of a field
    struct hg_gi_field field;
    struct hg_gi_key key;
    bool keyed;
    uint32_t *list, listed; // probes that a round is of, ascending
    uint32_t round, next;   // next: of the list
};

struct hg_gi {
    struct hg_gi_params params;
    struct hg_rays_scene *rays;
    struct hg_gi_surfaces surfaces;
    struct hg_gi_environment environment;
    struct build rest, moving;
    uint32_t moving_at;      // of the list: what is updated next
    uint64_t moving_updates; // of probes since the last change
    struct hg_gpu_buffer wave_rays, wave_hits, shadow_rays, blocked, peak_rays, peak_blocked;
    struct hg_gi_ray *brought; // [WAVE_PROBES * MOST_RAYS]
    struct hg_gi_peak *peaks;  // [WAVE_PROBES * MOST_PEAKS]
    struct hg_gi_direct *direct;
    struct hg_gi_stats stats;
};

// One wave.
struct wave {
    struct hg_gi *gi;
    const struct hg_lighting_sources *sources;
    struct hg_gi_field *field;
    const uint32_t *probes; // [count]
    uint32_t count;
    uint32_t rays, peaks; // of each
    uint32_t round;
    float keep;  // < 0: by what each probe has seen since the last change
    bool places; // finds out where probes stand; no light
};

// --- life ----------------------------------------------------------------------------------------

static enum hg_status create_buffers(struct hg_gi *gi, struct hg_error *err)
{
    const uint64_t most = WAVE_PROBES * MOST_RAYS;
    const struct {
        struct hg_gpu_buffer *buffer;
        uint64_t bytes;
        const char *name;
    } rows[] = {{&gi->wave_rays, most * sizeof(struct hg_gpu_ray), "probe rays"},
        {&gi->wave_hits, most * sizeof(struct hg_gpu_hit), "probe hits"},
        {&gi->shadow_rays, most * HG_GI_SHADOW_RAYS * sizeof(struct hg_gpu_ray), "probe shadows"},
        {&gi->blocked, most * HG_GI_SHADOW_RAYS * sizeof(uint32_t), "probe shadows blocked"},
        {&gi->peak_rays, WAVE_PROBES * MOST_PEAKS * sizeof(struct hg_gpu_ray), "rays to peaks"},
        {&gi->peak_blocked, WAVE_PROBES * MOST_PEAKS * sizeof(uint32_t), "rays to peaks blocked"}};
    enum hg_status status = HG_OK;
    for (size_t i = 0; i < sizeof rows / sizeof *rows && status == HG_OK; i++)
        status = hg_gpu_buffer_create(gi->params.gpu, HG_GPU_BUFFER_READBACK, rows[i].bytes,
            rows[i].name, rows[i].buffer, err);
    return status;
}

enum hg_status hg_gi_create(
    const struct hg_gi_params *params, struct hg_gi **out, struct hg_error *err)
{
    struct hg_gi *gi = hg_calloc(1, sizeof *gi);
    *out = NULL;
    if (!gi)
        return hg_error_set(err, HG_E_NOMEM, "probes", NULL, "out of host memory");
    gi->params = *params;
    gi->brought = hg_calloc(WAVE_PROBES * MOST_RAYS, sizeof *gi->brought);
    gi->direct = hg_calloc(WAVE_PROBES * MOST_RAYS, sizeof *gi->direct);
    gi->peaks = hg_calloc(WAVE_PROBES * MOST_PEAKS, sizeof *gi->peaks);
    enum hg_status status =
        gi->brought && gi->direct && gi->peaks
            ? HG_OK
            : hg_error_set(err, HG_E_NOMEM, "probes", NULL, "out of host memory");
    if (status == HG_OK)
        status = create_buffers(gi, err);
    if (status != HG_OK)
        hg_gi_destroy(gi);
    else
        *out = gi;
    return status;
}

void hg_gi_destroy(struct hg_gi *gi)
{
    if (!gi)
        return;
    struct hg_gpu *gpu = gi->params.gpu;
    hg_rays_unref(gi->rays);
    hg_gi_surfaces_finish(&gi->surfaces);
    hg_gi_field_finish(&gi->rest.field, gpu);
    hg_gi_field_finish(&gi->moving.field, gpu);
    hg_free(gi->rest.list);
    hg_free(gi->moving.list);
    hg_gpu_buffer_destroy(gpu, &gi->wave_rays);
    hg_gpu_buffer_destroy(gpu, &gi->wave_hits);
    hg_gpu_buffer_destroy(gpu, &gi->shadow_rays);
    hg_gpu_buffer_destroy(gpu, &gi->blocked);
    hg_gpu_buffer_destroy(gpu, &gi->peak_rays);
    hg_gpu_buffer_destroy(gpu, &gi->peak_blocked);
    hg_gi_environment_finish(&gi->environment);
    hg_free(gi->brought);
    hg_free(gi->peaks);
    hg_free(gi->direct);
    hg_free(gi);
}

// --- random numbers ------------------------------------------------------------------------------

// pcg3d, as hg_hash3 in shaders/lib/frame.glsl.
static void random3(uint32_t x, uint32_t y, uint32_t z, float out[3])
{
    uint32_t v[3] = {
        x * 1664525u + 1013904223u, y * 1664525u + 1013904223u, z * 1664525u + 1013904223u};
    for (int round = 0; round < 2; round++) {
        v[0] += v[1] * v[2];
        v[1] += v[2] * v[0];
        v[2] += v[0] * v[1];
        for (int a = 0; a < 3 && round == 0; a++)
            v[a] ^= v[a] >> 16;
    }
    for (int a = 0; a < 3; a++)
        out[a] = (float)(v[a] >> 8) * (1.0f / 16777216.0f);
}

// A rotation that is uniform among all. Source: Shoemake 1992, "Uniform Random Rotations".
static void random_rotation(uint32_t probe, uint32_t round, float m[9])
{
    float xi[3];
    random3(probe, round, 0x67697267u, xi);
    const float a = sqrtf(1 - xi[0]), b = sqrtf(xi[0]);
    const float u = 2 * (float)HG_PI * xi[1], v = 2 * (float)HG_PI * xi[2];
    const float x = a * sinf(u), y = a * cosf(u), z = b * sinf(v), w = b * cosf(v);
    const float rows[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w),
        2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w), 2 * (x * z - y * w),
        2 * (y * z + x * w), 1 - 2 * (x * x + y * y)};
    memcpy(m, rows, sizeof rows);
}

// Spherical Fibonacci points. Source: Marques et al. 2013, "Spherical Fibonacci Point Sets for
// Illumination Integrals".
static void fibonacci(uint32_t i, uint32_t count, float out[3])
{
    const double phi = 2 * HG_PI * fmod(i * 0.6180339887498949, 1);
    const double z = 1 - (2.0 * i + 1) / count, r = sqrt(1 - z * z);
    out[0] = (float)(r * cos(phi));
    out[1] = (float)(r * sin(phi));
    out[2] = (float)z;
}

// --- stages of a wave ----------------------------------------------------------------------------

// Rays to peaks of the environment: each in another part of what they bring.
static void cast_peaks(const struct wave *w, size_t index, const float at[3])
{
    const size_t first = index * w->peaks;
    struct hg_gpu_ray *rays = (struct hg_gpu_ray *)w->gi->peak_rays.mapped + first;
    for (uint32_t i = 0; i < w->peaks; i++) {
        struct hg_gi_peak *peak = &w->gi->peaks[first + i];
        const float *d = peak->direction;
        float xi[3];
        random3(w->probes[index] * MOST_PEAKS + i, w->round, 0x7065616bu, xi);
        xi[0] = ((float)i + xi[0]) / (float)w->peaks;
        hg_gi_environment_peak(&w->gi->environment, w->sources, xi, peak->direction, peak->light);
        rays[i] = (struct hg_gpu_ray){.origin_ws = {at[0], at[1], at[2]},
            .direction_ws = {d[0], d[1], d[2]},
            .t_max = FLT_MAX,
            .mask = HG_RAY_OPAQUE | HG_RAY_MASK};
    }
}

static void cast_probe(void *user, size_t index)
{
    const struct wave *w = user;
    struct hg_gpu_ray *rays = (struct hg_gpu_ray *)w->gi->wave_rays.mapped + index * w->rays;
    float m[9], at[3];
    const uint32_t probe = w->probes[index];
    random_rotation(probe, w->round, m);
    hg_gi_probe_position(w->field, probe, at);
    for (uint32_t i = 0; i < w->rays; i++) {
        float p[3];
        fibonacci(i, w->rays, p);
        rays[i] = (struct hg_gpu_ray){.origin_ws = {at[0], at[1], at[2]},
            .direction_ws = {hg_dot3(m, p), hg_dot3(m + 3, p), hg_dot3(m + 6, p)},
            .t_max = FLT_MAX,
            .mask = HG_RAY_OPAQUE | HG_RAY_MASK};
    }
    cast_peaks(w, index, at);
}

static void receive(const struct wave *w, size_t i, const struct hg_gi_surface *surface)
{
    const struct hg_gpu_ray *ray = (const struct hg_gpu_ray *)w->gi->wave_rays.mapped + i;
    struct hg_gi_ray *out = &w->gi->brought[i];
    struct hg_gi_receiver r;
    struct hg_gi_point point;
    float xi[3], bounced[3];
    random3((uint32_t)(w->probes[i / w->rays] * w->rays + i % w->rays), w->round, 0x686974u, xi);
    const float from[3] = {ray->origin_ws.x, ray->origin_ws.y, ray->origin_ws.z};
    hg_mad3(from, out->direction, out->distance, r.position);
    hg_copy3(surface->normal, r.normal);
    const float far =
        fmaxf(fabsf(r.position[0]), fmaxf(fabsf(r.position[1]), fabsf(r.position[2])));
    r.lift = 1e-3f * w->field->spacing + 1e-6f * far;
    r.xi = xi[0];
    hg_gi_direct_at(w->sources, &r, &w->gi->direct[i]);
    hg_copy3(r.position, point.position);
    hg_copy3(r.normal, point.normal);
    for (int a = 0; a < 3; a++)
        point.view[a] = -out->direction[a];
    hg_gi_field_irradiance(w->field, &point, xi, bounced);
    for (int c = 0; c < 3; c++) {
        out->light[c] = surface->material->emission[c] + surface->material->albedo[c] * bounced[c];
        for (int k = 0; k < HG_GI_SHADOW_RAYS; k++)
            w->gi->direct[i].light[k][c] *= surface->material->albedo[c];
    }
}

// What a ray met; light that comes straight to it waits for its shadow rays.
static void shade_ray(const struct wave *w, size_t i)
{
    const struct hg_gpu_ray *ray = (const struct hg_gpu_ray *)w->gi->wave_rays.mapped + i;
    const struct hg_gpu_hit *hit = (const struct hg_gpu_hit *)w->gi->wave_hits.mapped + i;
    struct hg_gpu_ray *shadows =
        (struct hg_gpu_ray *)w->gi->shadow_rays.mapped + i * HG_GI_SHADOW_RAYS;
    struct hg_gi_ray *out = &w->gi->brought[i];
    *out = (struct hg_gi_ray){.distance = FLT_MAX,
        .direction = {ray->direction_ws.x, ray->direction_ws.y, ray->direction_ws.z}};
    w->gi->direct[i] = (struct hg_gi_direct){0};
    for (int k = 0; k < HG_GI_SHADOW_RAYS; k++)
        w->gi->direct[i].rays[k].t_max = -1;
    if (hit->draw == HG_HIT_NONE) {
        hg_gi_environment_even(&w->gi->environment, w->sources, out->direction, out->light);
    } else {
        struct hg_gi_surface surface;
        hg_gi_surface_at(&w->gi->surfaces, hit, out->direction, &surface);
        out->distance = hit->t;
        out->back = surface.back;
        if (!w->places && !surface.back)
            receive(w, i, &surface);
    }
    memcpy(shadows, w->gi->direct[i].rays, sizeof w->gi->direct[i].rays);
}

static void shade_probe(void *user, size_t index)
{
    const struct wave *w = user;
    for (uint32_t i = 0; i < w->rays; i++)
        shade_ray(w, index * w->rays + i);
}

// Of the moving field's probes the first updates fade soon: they had less light that bounced.
static float keep_of(const struct wave *w, uint32_t probe)
{
    const float seen = (float)w->field->updates[probe];
    if (w->keep >= 0)
        return w->keep;
    return 1 - 1 / fminf(1 + seen / MOVE_FADE, MOVE_MOST);
}

static void gather_probe(void *user, size_t index)
{
    const struct wave *w = user;
    const uint32_t probe = w->probes[index];
    const uint32_t *blocked = w->gi->blocked.mapped;
    struct hg_gi_ray *rays = w->gi->brought + index * w->rays;
    if (w->places) {
        hg_gi_probe_relocate(w->field, probe, rays, w->rays);
        return;
    }
    for (uint32_t i = 0; i < w->rays; i++) {
        const size_t at = index * w->rays + i;
        for (int k = 0; k < HG_GI_SHADOW_RAYS; k++) {
            const struct hg_gi_direct *d = &w->gi->direct[at];
            const bool dark = d->rays[k].t_max > 0 && blocked[at * HG_GI_SHADOW_RAYS + (size_t)k];
            for (int c = 0; c < 3 && !dark; c++)
                rays[i].light[c] += d->light[k][c];
        }
    }
    const uint32_t *hidden = (const uint32_t *)w->gi->peak_blocked.mapped + index * w->peaks;
    struct hg_gi_peak *peaks = w->gi->peaks + index * w->peaks;
    for (uint32_t i = 0; i < w->peaks; i++)
        for (int c = 0; c < 3 && hidden[i]; c++)
            peaks[i].light[c] = 0;
    const struct hg_gi_brought brought = {rays, peaks, w->rays, w->peaks};
    hg_gi_probe_gather(w->field, probe, &brought, keep_of(w, probe));
    w->field->updates[probe]++;
}

// --- waves ---------------------------------------------------------------------------------------

static void count_wave(const struct wave *w)
{
    struct hg_gi_stats *s = &w->gi->stats;
    const uint64_t rays = (uint64_t)w->count * w->rays;
    s->rays += rays;
    s->shadow_rays += (uint64_t)w->count * w->peaks;
    s->updates += w->places ? 0 : w->count;
    for (uint64_t i = 0; i < rays; i++) {
        const bool missed = w->gi->brought[i].distance == FLT_MAX;
        s->misses += missed;
        s->shaded += !w->places && !missed && !w->gi->brought[i].back;
        for (int k = 0; k < HG_GI_SHADOW_RAYS; k++)
            s->shadow_rays += w->gi->direct[i].rays[k].t_max > 0;
    }
}

static enum hg_status run(struct wave *w, struct hg_error *err)
{
    struct hg_gi *gi = w->gi;
    struct hg_jobs *jobs = gi->params.jobs;
    struct hg_trace *trace = hg_rays_trace(gi->rays);
    const bool has_peaks = !w->places && gi->environment.has_peaks;
    w->peaks = has_peaks ? (w->rays + PEAK_SHARE - 1) / PEAK_SHARE : 0;
    hg_jobs_for(jobs, w->count, cast_probe, w);
    struct hg_trace_wave wave = {
        .rays = &gi->wave_rays, .hits = &gi->wave_hits, .count = w->count * w->rays};
    enum hg_status status = hg_trace_closest(trace, &wave, err);
    if (status != HG_OK)
        return status;
    hg_jobs_for(jobs, w->count, shade_probe, w);
    if (!w->places && w->sources->count > 0) {
        wave = (struct hg_trace_wave){.rays = &gi->shadow_rays,
            .blocked = &gi->blocked,
            .count = w->count * w->rays * HG_GI_SHADOW_RAYS};
        status = hg_trace_blocked(trace, &wave, err);
    }
    if (status == HG_OK && has_peaks) {
        wave = (struct hg_trace_wave){
            .rays = &gi->peak_rays, .blocked = &gi->peak_blocked, .count = w->count * w->peaks};
        status = hg_trace_blocked(trace, &wave, err);
    }
    if (status != HG_OK)
        return status;
    hg_jobs_for(jobs, w->count, gather_probe, w);
    count_wave(w);
    return HG_OK;
}

// --- what rays meet ------------------------------------------------------------------------------

static enum hg_status sync_environment(struct hg_gi *gi, const struct hg_gi_key *key,
    const struct hg_lighting_sources *sources, struct hg_error *err)
{
    const enum hg_status status =
        hg_gi_environment_sync(&gi->environment, sources, key->environment);
    return status == HG_OK ? HG_OK
                           : hg_error_set(err, status, "probes", NULL, "out of host memory");
}

static enum hg_status sync_rays(struct hg_gi *gi, bool rests, struct hg_error *err)
{
    struct hg_rays_key key = hg_rays_default_key(gi->params.rays, HG_TRACE_AUTO, rests);
    key.exact = rests;
    enum hg_status status = hg_rays_ref(gi->params.rays, &key, &gi->rays, err);
    if (status == HG_OK)
        status = hg_rays_sync(gi->rays, err);
    if (status != HG_OK)
        return status;
    status = hg_gi_surfaces_sync(
        &gi->surfaces, gi->params.geometry, hg_rays_geometry(gi->rays), gi->params.textures);
    return status == HG_OK ? HG_OK
                           : hg_error_set(err, status, "probes", NULL, "out of host memory");
}

static bool same_key(const struct build *b, const struct hg_gi_key *key)
{
    return b->keyed && memcmp(&b->key, key, sizeof *key) == 0;
}

// The probes that the rounds to come are of: those that take part, and before it is known which are
// inside of something all.
static void list_probes(struct build *b)
{
    b->listed = b->next = 0;
    for (uint32_t i = 0; i < b->field.count; i++)
        if (b->round < PLACE_ROUNDS || hg_gi_probe_is_awake(&b->field, i))
            b->list[b->listed++] = i;
}

// Before any memory is taken.
static enum hg_status check_budget(
    const struct hg_gi *gi, const float min[3], const float max[3], struct hg_error *err)
{
    struct hg_gi_field grid = {0};
    const uint64_t budget = gi->params.budget_bytes;
    if (budget == 0)
        return HG_OK;
    hg_gi_field_grid(&grid, min, max);
    const uint64_t bytes = hg_gi_field_bytes_of(grid.count);
    return bytes <= budget ? HG_OK
                           : hg_error_set(err, HG_E_LIMIT, "probes", NULL,
                                 "%u probes take %.1f MiB, the geometry budget is %.1f MiB",
                                 grid.count, (double)bytes / (1 << 20), (double)budget / (1 << 20));
}

static enum hg_status place_within(
    struct hg_gi *gi, struct build *b, const float min[3], const float max[3])
{
    const enum hg_status status = hg_gi_field_place(&b->field, min, max);
    hg_free(b->list);
    b->list = status == HG_OK ? hg_calloc(b->field.count, sizeof *b->list) : NULL;
    if (!b->list) {
        hg_gi_field_finish(&b->field, NULL);
        return HG_E_NOMEM;
    }
    hg_gi_occupy(&b->field, &gi->surfaces);
    list_probes(b);
    return HG_OK;
}

// Probes for the scene as it is now; none where there is nothing to put them around.
static enum hg_status place(struct hg_gi *gi, struct build *b, struct hg_error *err)
{
    float min[3], max[3];
    b->round = b->next = b->listed = 0;
    if (!hg_geometry_bounds(gi->params.geometry, min, max)) {
        hg_gi_field_finish(&b->field, NULL);
        b->round = ROUNDS;
        return HG_OK;
    }
    enum hg_status status = check_budget(gi, min, max, err);
    if (status != HG_OK)
        return status;
    status = place_within(gi, b, min, max);
    return status == HG_OK ? HG_OK
                           : hg_error_set(err, status, "probes", NULL, "out of host memory");
}

// --- the field of rest ---------------------------------------------------------------------------

static struct wave wave_of(
    struct hg_gi *gi, struct build *b, const struct hg_lighting_sources *from)
{
    const uint32_t left = b->listed - b->next;
    struct wave w = {.gi = gi,
        .sources = from,
        .field = &b->field,
        .probes = b->list + b->next,
        .count = left < WAVE_PROBES ? left : WAVE_PROBES,
        .round = b->round};
    if (b->round < PLACE_ROUNDS) {
        w.places = true;
        w.rays = PLACE_RAYS;
    } else if (b->round < PLACE_ROUNDS + WARM_ROUNDS) {
        w.rays = WARM_RAYS;
        w.keep = WARM_KEEP;
    } else {
        w.rays = MAIN_RAYS;
        w.keep = b->round == PLACE_ROUNDS + WARM_ROUNDS ? 0 : MAIN_KEEP;
    }
    return w;
}

static enum hg_status advance(struct hg_gi *gi, struct build *b,
    const struct hg_lighting_sources *sources, uint64_t rays, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    for (uint64_t cast = 0; cast < rays && b->round < ROUNDS && status == HG_OK;) {
        struct wave w = wave_of(gi, b, sources);
        status = run(&w, err);
        cast += (uint64_t)w.count * w.rays;
        b->next += w.count;
        if (b->next == b->listed) {
            b->next = 0;
            b->round++;
        }
        if (b->next == 0 && b->round == PLACE_ROUNDS)
            list_probes(b);
        if (b->listed == 0) // nothing that light could reach
            b->round = ROUNDS;
    }
    return status;
}

enum hg_status hg_gi_rest(struct hg_gi *gi, const struct hg_gi_key *key,
    const struct hg_lighting_sources *sources, uint64_t rays, struct hg_error *err)
{
    struct build *b = &gi->rest;
    const uint64_t begin = hg_clock_now_ns();
    if (hg_gi_is_rest(gi, key))
        return HG_OK;
    enum hg_status status = sync_rays(gi, true, err);
    if (status == HG_OK)
        status = sync_environment(gi, key, sources, err);
    if (status == HG_OK && !same_key(b, key)) {
        status = place(gi, b, err);
        b->key = *key;
        b->keyed = true;
    }
    if (status == HG_OK)
        status = advance(gi, b, sources, rays, err);
    if (status == HG_OK && b->round == ROUNDS && b->field.count > 0)
        status = hg_gi_field_upload(&b->field, gi->params.gpu, gi->params.jobs, err);
    b->keyed = b->keyed && status == HG_OK;
    gi->stats.ns += hg_clock_now_ns() - begin;
    return status;
}

bool hg_gi_is_rest(const struct hg_gi *gi, const struct hg_gi_key *key)
{
    return gi && same_key(&gi->rest, key) && gi->rest.round == ROUNDS;
}

// --- the moving field ----------------------------------------------------------------------------

// Its probes are put around a scene once, and again where the scene has outgrown them.
static enum hg_status follow(struct hg_gi *gi, const struct hg_gi_key *key,
    const struct hg_lighting_sources *sources, struct hg_error *err)
{
    struct build *b = &gi->moving;
    float min[3], max[3];
    struct hg_gi_field now = {0};
    const bool changed = !same_key(b, key), moved = b->key.geometry != key->geometry;
    if (changed)
        gi->moving_updates = 0;
    if (changed && hg_geometry_bounds(gi->params.geometry, min, max))
        hg_gi_field_grid(&now, min, max);
    const bool same_grid = b->field.count > 0 &&
                           memcmp(now.counts, b->field.counts, sizeof now.counts) == 0 &&
                           memcmp(now.origin, b->field.origin, sizeof now.origin) == 0 &&
                           now.spacing == b->field.spacing;
    enum hg_status status = HG_OK;
    if (changed && (!same_grid || b->round < PLACE_ROUNDS)) { // an error may have cut that short
        status = place(gi, b, err);
        gi->moving_at = 0;
        while (status == HG_OK && b->field.count > 0 && b->round < PLACE_ROUNDS)
            status = advance(gi, b, sources, 1, err);
    } else if (changed) {
        if (moved) { // surfaces may come anywhere
            hg_gi_field_doubt_distances(&b->field);
            memset(b->field.needed, true, b->field.count * sizeof *b->field.needed);
            list_probes(b);
            gi->moving_at = b->listed > 0 ? gi->moving_at % b->listed : 0;
        }
        memset(b->field.updates, 0, b->field.count * sizeof *b->field.updates);
    }
    b->key = *key;
    b->keyed = status == HG_OK;
    return status;
}

enum hg_status hg_gi_move(struct hg_gi *gi, const struct hg_gi_key *key,
    const struct hg_lighting_sources *sources, uint64_t rays, struct hg_error *err)
{
    struct build *b = &gi->moving;
    const uint64_t begin = hg_clock_now_ns();
    if (same_key(b, key) && gi->moving_updates >= (uint64_t)MOVE_ENOUGH * b->listed)
        return HG_OK;
    enum hg_status status = sync_rays(gi, false, err);
    if (status == HG_OK)
        status = sync_environment(gi, key, sources, err);
    if (status == HG_OK)
        status = follow(gi, key, sources, err);
    for (uint64_t cast = 0; cast < rays && status == HG_OK && b->listed > 0;) {
        const uint32_t left = b->listed - gi->moving_at;
        const bool first = gi->moving_updates < (uint64_t)FIRST_ROUNDS * b->listed;
        struct wave w = {.gi = gi,
            .sources = sources,
            .field = &b->field,
            .probes = b->list + gi->moving_at,
            .count = left < WAVE_PROBES ? left : WAVE_PROBES,
            .rays = first ? FIRST_RAYS : MOVE_RAYS,
            .round = ROUNDS + (uint32_t)(gi->moving_updates / b->listed),
            .keep = -1};
        status = run(&w, err);
        cast += (uint64_t)w.count * w.rays;
        gi->moving_updates += w.count;
        gi->moving_at = (gi->moving_at + w.count) % b->listed;
    }
    if (status == HG_OK && b->field.count > 0)
        status = hg_gi_field_upload(&b->field, gi->params.gpu, gi->params.jobs, err);
    b->keyed = b->keyed && status == HG_OK;
    gi->stats.ns += hg_clock_now_ns() - begin;
    return status;
}

// --- what others ask -----------------------------------------------------------------------------

static_assert(HG_GI_MOST_SIGHTS <= WAVE_PROBES * MOST_RAYS, "buffers of waves");

enum hg_status hg_gi_see(
    struct hg_gi *gi, const struct hg_gi_look *look, struct hg_gi_sight *out, struct hg_error *err)
{
    const bool rests = look->field == HG_GI_REST;
    const struct hg_gi_field *field = rests ? &gi->rest.field : &gi->moving.field;
    memset(out, 0, look->count * sizeof *out);
    if (gi->rays == NULL || field->count == 0)
        return HG_OK;
    const struct hg_gi_sights sights = {.trace = hg_rays_trace(gi->rays),
        .jobs = gi->params.jobs,
        .surfaces = &gi->surfaces,
        .field = field,
        .sources = look->sources,
        .rays = &gi->wave_rays,
        .hits = &gi->wave_hits,
        .shadow_rays = &gi->shadow_rays,
        .blocked = &gi->blocked};
    return hg_gi_sights_see(&sights, look->rays, look->count, out, err);
}

// --- what shaders and statistics get -------------------------------------------------------------

void hg_gi_fill(const struct hg_gi *gi, enum hg_gi_field_kind kind, struct hg_gpu_probes *out)
{
    *out = (struct hg_gpu_probes){0};
    if (!gi || kind == HG_GI_NO_FIELD)
        return;
    const struct hg_gi_field *f = kind == HG_GI_REST ? &gi->rest.field : &gi->moving.field;
    if (f->count == 0)
        return;
    *out = (struct hg_gpu_probes){.words = f->buffer.address,
        .origin_ws = {f->origin[0], f->origin[1], f->origin[2]},
        .spacing = f->spacing,
        .counts = {f->counts[0], f->counts[1], f->counts[2]},
        .count = f->count};
}

void hg_gi_stats(const struct hg_gi *gi, struct hg_gi_stats *out)
{
    *out = gi ? gi->stats : (struct hg_gi_stats){0};
    if (!gi)
        return;
    const struct hg_gi_field *f = gi->rest.field.count > 0 ? &gi->rest.field : &gi->moving.field;
    out->probes = f->count;
    out->spacing = f->spacing;
    for (uint32_t i = 0; i < f->count; i++) {
        const bool awake = hg_gi_probe_is_awake(f, i);
        out->asleep += !awake;
        out->inside += f->inside[i];
        out->moved +=
            awake && hg_dot3(f->offsets[i], f->offsets[i]) > HG_PROBE_MOVED * HG_PROBE_MOVED;
    }
    out->bytes = hg_gi_field_bytes(&gi->rest.field) + hg_gi_field_bytes(&gi->moving.field);
    if (gi->rays != NULL) {
        struct hg_trace_stats structures;
        hg_trace_stats(hg_rays_trace(gi->rays), &structures);
        out->structure_bytes = structures.bytes;
    }
}
