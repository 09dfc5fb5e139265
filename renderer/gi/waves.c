// waves.c - see waves.h.
#include "renderer/gi/waves.h"

#include <float.h>
#include <string.h>

#include "base/alloc.h"
#include "base/hash.h"
#include "renderer/math/vec.h"

#define PEAK_SHARE 8 // rays for each that goes to a peak of the environment, or to an emitter
#define MOST_PEAKS (HG_GI_MOST_RAYS / PEAK_SHARE)
#define DYNAMIC_MOST 10 // updates that a mean of the dynamic field is of
#define DYNAMIC_FADE 3  // for each so many since the change it is of one more

// A wave under way.
struct run {
    struct hg_gi_wave wave;
    struct hg_gi_waves *waves;
    uint32_t peaks, emitters; // rays to them, of each probe
    float sky[3][HG_PROBE_IRRADIANCE_TEXELS]; // as of hg_gi_brought
};

// --- life ----------------------------------------------------------------------------------------

static enum hg_status create_buffers(struct hg_gi_waves *w, struct hg_error *err)
{
    const uint64_t most = HG_GI_WAVE_PROBES * HG_GI_MOST_RAYS;
    const uint64_t peaks = HG_GI_WAVE_PROBES * 2 * MOST_PEAKS;
    const struct {
        struct hg_gpu_buffer *buffer;
        uint64_t bytes;
        const char *name;
    } rows[] = {{&w->probe_rays, most * sizeof(struct hg_gpu_ray), "probe rays"},
        {&w->probe_hits, most * sizeof(struct hg_gpu_hit), "probe hits"},
        {&w->shadow_rays, most * HG_HOST_SHADOW_RAYS * sizeof(struct hg_gpu_ray), "probe shadows"},
        {&w->blocked, most * HG_HOST_SHADOW_RAYS * sizeof(uint32_t), "probe shadows blocked"},
        {&w->peak_rays, peaks * sizeof(struct hg_gpu_ray), "rays to peaks"},
        {&w->peak_blocked, peaks * sizeof(uint32_t), "rays to peaks blocked"}};
    enum hg_status status = HG_OK;
    for (size_t i = 0; i < sizeof rows / sizeof *rows && status == HG_OK; i++)
        status = hg_gpu_buffer_create(w->params.gpu, HG_GPU_BUFFER_READBACK, rows[i].bytes,
            rows[i].name, rows[i].buffer, err);
    return status;
}

enum hg_status hg_gi_waves_init(
    struct hg_gi_waves *w, const struct hg_gi_params *params, struct hg_error *err)
{
    const size_t most = HG_GI_WAVE_PROBES * HG_GI_MOST_RAYS;
    *w = (struct hg_gi_waves){.params = *params};
    w->brought = hg_calloc(most, sizeof *w->brought);
    w->direct = hg_calloc(most, sizeof *w->direct);
    w->peaks = hg_calloc(HG_GI_WAVE_PROBES * 2 * MOST_PEAKS, sizeof *w->peaks);
    enum hg_status status =
        w->brought && w->direct && w->peaks
            ? HG_OK
            : hg_error_set(err, HG_E_NOMEM, "probes", NULL, "out of host memory");
    if (status == HG_OK)
        status = create_buffers(w, err);
    if (status != HG_OK)
        hg_gi_waves_finish(w);
    return status;
}

void hg_gi_waves_finish(struct hg_gi_waves *w)
{
    struct hg_gpu *gpu = w->params.gpu;
    hg_rays_unref(w->rays);
    hg_host_emissive_finish(&w->emissive);
    hg_host_caster_finish(&w->caster);
    hg_host_surfaces_finish(&w->surfaces);
    hg_gpu_buffer_destroy(gpu, &w->probe_rays);
    hg_gpu_buffer_destroy(gpu, &w->probe_hits);
    hg_gpu_buffer_destroy(gpu, &w->shadow_rays);
    hg_gpu_buffer_destroy(gpu, &w->blocked);
    hg_gpu_buffer_destroy(gpu, &w->peak_rays);
    hg_gpu_buffer_destroy(gpu, &w->peak_blocked);
    hg_host_environment_finish(&w->environment);
    hg_free(w->brought);
    hg_free(w->peaks);
    hg_free(w->direct);
    *w = (struct hg_gi_waves){0};
}

// --- what rays meet ------------------------------------------------------------------------------

static enum hg_status no_memory(enum hg_status status, struct hg_error *err)
{
    return status == HG_OK ? HG_OK
                           : hg_error_set(err, status, "probes", NULL, "out of host memory");
}

enum hg_status hg_gi_waves_sync_surfaces(struct hg_gi_waves *w, bool exact, struct hg_error *err)
{
    struct hg_rays_key rays = hg_rays_default_key(w->params.rays, HG_TRACE_AUTO, exact);
    rays.exact = w->exact = exact;
    enum hg_status status = hg_rays_ref(w->params.rays, &rays, &w->rays, err);
    if (status == HG_OK)
        status = hg_rays_sync(w->rays, err);
    if (status != HG_OK)
        return status;
    w->caster.gpu = w->params.gpu;
    w->caster.trace = hg_rays_trace(w->rays);
    w->caster.surfaces = &w->surfaces;
    status = hg_host_surfaces_sync(
        &w->surfaces, w->params.geometry, hg_rays_geometry(w->rays), w->params.textures);
    if (status == HG_OK)
        status = hg_host_emissive_sync(&w->emissive, &w->surfaces);
    return no_memory(status, err);
}

enum hg_status hg_gi_waves_sync(struct hg_gi_waves *w, const struct hg_gi_key *key,
    const struct hg_lighting_sources *sources, bool exact, struct hg_error *err)
{
    const enum hg_status status = hg_gi_waves_sync_surfaces(w, exact, err);
    if (status != HG_OK)
        return status;
    return no_memory(hg_host_environment_sync(&w->environment, sources, key->environment), err);
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
void hg_gi_sphere_point(uint32_t i, uint32_t count, float out[3])
{
    const double phi = 2 * HG_PI * fmod(i * 0.6180339887498949, 1);
    const double z = 1 - (2.0 * i + 1) / count, r = sqrt(1 - z * z);
    out[0] = (float)(r * cos(phi));
    out[1] = (float)(r * sin(phi));
    out[2] = (float)z;
}

// Of all probes of a wave the same, which are turned for each.
static void sync_around(struct hg_gi_waves *w, uint32_t count)
{
    for (uint32_t i = 0; i < count && w->around_count != count; i++)
        hg_gi_sphere_point(i, count, w->around[i]);
    w->around_count = count;
}

// --- stages of a wave ----------------------------------------------------------------------------

// Rays to peaks of the environment: each in another part of what they bring.
static void cast_peaks(const struct run *w, size_t index, const float at[3])
{
    const size_t first = index * (w->peaks + w->emitters);
    struct hg_gpu_ray *rays = (struct hg_gpu_ray *)w->waves->peak_rays.mapped + first;
    for (uint32_t i = 0; i < w->peaks; i++) {
        struct hg_gi_peak *peak = &w->waves->peaks[first + i];
        const float *d = peak->direction;
        float xi[3];
        random3((w->wave.field->salt + w->wave.probes[index]) * MOST_PEAKS + i, w->wave.round,
            0x7065616bu, xi);
        xi[0] = ((float)i + xi[0]) / (float)w->peaks;
        hg_host_environment_peak(
            &w->waves->environment, w->wave.sources, xi, peak->direction, peak->light);
        rays[i] = (struct hg_gpu_ray){.origin_ws = {at[0], at[1], at[2]},
            .direction_ws = {d[0], d[1], d[2]},
            .t_max = FLT_MAX,
            .mask = HG_RAY_OPAQUE | HG_RAY_MASK};
    }
}

// Of the rays all around, for each that goes to an emitter, 1 / sr.
static float density_of(const struct run *w)
{
    return (float)w->wave.rays / (float)w->emitters * (float)(1 / (4 * HG_PI));
}

static void cast_emitters(const struct run *w, size_t index, const float at[3])
{
    const size_t first = index * (w->peaks + w->emitters) + w->peaks;
    struct hg_gpu_ray *rays = (struct hg_gpu_ray *)w->waves->peak_rays.mapped + first;
    const uint64_t probe = w->wave.field->salt + w->wave.probes[index];
    for (uint32_t i = 0; i < w->emitters; i++) {
        struct hg_gi_peak *emitter = &w->waves->peaks[first + i];
        struct hg_host_emissive_receiver r = {.position = {at[0], at[1], at[2]},
            .density = density_of(w),
            .seed = hg_hash_mix(probe, (uint64_t)w->wave.round * MOST_PEAKS + i)};
        struct hg_host_emissive_ray ray = {.distance = -1};
        (void)hg_host_emissive_choose(&w->waves->emissive, &r, &ray);
        hg_copy3(ray.direction, emitter->direction);
        hg_copy3(ray.light, emitter->light);
        rays[i] = (struct hg_gpu_ray){.origin_ws = {at[0], at[1], at[2]},
            .direction_ws = {ray.direction[0], ray.direction[1], ray.direction[2]},
            .t_max = ray.distance,
            .mask = HG_RAY_OPAQUE | HG_RAY_MASK};
    }
}

static void cast_probe(void *user, size_t index)
{
    const struct run *w = user;
    struct hg_gpu_ray *rays =
        (struct hg_gpu_ray *)w->waves->probe_rays.mapped + index * w->wave.rays;
    float m[9], at[3];
    const uint32_t probe = w->wave.probes[index];
    random_rotation(w->wave.field->salt + probe, w->wave.round, m);
    hg_gi_probe_position(w->wave.field, probe, at);
    for (uint32_t i = 0; i < w->wave.rays; i++) {
        const float *p = w->waves->around[i];
        rays[i] = (struct hg_gpu_ray){.origin_ws = {at[0], at[1], at[2]},
            .direction_ws = {hg_dot3(m, p), hg_dot3(m + 3, p), hg_dot3(m + 6, p)},
            .t_max = FLT_MAX,
            .mask = HG_RAY_OPAQUE | HG_RAY_MASK};
    }
    cast_peaks(w, index, at);
    cast_emitters(w, index, at);
}

static void receive(const struct run *w, size_t i, const struct hg_host_surface *surface)
{
    const struct hg_gpu_ray *ray = (const struct hg_gpu_ray *)w->waves->probe_rays.mapped + i;
    struct hg_gi_ray *out = &w->waves->brought[i];
    struct hg_host_receiver r;
    struct hg_gi_point point;
    float xi[3], bounced[3];
    const uint32_t probe = w->wave.field->salt + w->wave.probes[i / w->wave.rays];
    random3((uint32_t)(probe * w->wave.rays + i % w->wave.rays), w->wave.round, 0x686974u, xi);
    const float from[3] = {ray->origin_ws.x, ray->origin_ws.y, ray->origin_ws.z};
    hg_mad3(from, out->direction, out->distance, r.position);
    hg_copy3(surface->normal, r.normal);
    const float far =
        fmaxf(fabsf(r.position[0]), fmaxf(fabsf(r.position[1]), fabsf(r.position[2])));
    r.lift = 1e-3f * w->wave.field->spacing + 1e-6f * far;
    r.xi = xi[0];
    hg_host_direct_at(w->wave.sources, &r, &w->waves->direct[i]);
    hg_copy3(r.position, point.position);
    hg_copy3(r.normal, point.normal);
    for (int a = 0; a < 3; a++)
        point.view[a] = -out->direction[a];
    hg_gi_field_irradiance(w->wave.light, &point, xi, bounced);
    const struct hg_host_material *m = surface->material;
    const float cosine = fabsf(hg_dot3(surface->normal, out->direction));
    const float share = w->emitters > 0 ? hg_host_emissive_share(&w->waves->emissive, m->emitted,
                                              out->distance, cosine, density_of(w))
                                        : 0;
    for (int c = 0; c < 3; c++) {
        out->emitted[c] = (1 - share) * m->emitted[c];
        out->light[c] = m->emission[c] - share * m->emitted[c] + m->albedo[c] * bounced[c];
        for (int k = 0; k < HG_HOST_SHADOW_RAYS; k++)
            w->waves->direct[i].light[k][c] *= m->albedo[c];
    }
}

// What a ray met; light that comes straight to it waits for its shadow rays.
static void shade_ray(const struct run *w, size_t i)
{
    const struct hg_gpu_ray *ray = (const struct hg_gpu_ray *)w->waves->probe_rays.mapped + i;
    const struct hg_gpu_hit *hit = (const struct hg_gpu_hit *)w->waves->probe_hits.mapped + i;
    struct hg_gpu_ray *shadows =
        (struct hg_gpu_ray *)w->waves->shadow_rays.mapped + i * HG_HOST_SHADOW_RAYS;
    struct hg_gi_ray *out = &w->waves->brought[i];
    *out = (struct hg_gi_ray){.distance = FLT_MAX,
        .direction = {ray->direction_ws.x, ray->direction_ws.y, ray->direction_ws.z}};
    bool receives = false;
    hg_host_environment_even(&w->waves->environment, w->wave.sources, out->direction, out->even);
    if (hit->draw == HG_HIT_NONE) {
        hg_copy3(out->even, out->light);
    } else {
        struct hg_host_surface surface;
        hg_host_surface_at(&w->waves->surfaces, hit, out->direction, &surface);
        out->distance = hit->t;
        out->back = surface.back;
        hg_copy3(surface.normal, out->normal);
        receives = !w->wave.places && !surface.back;
        if (receives)
            receive(w, i, &surface);
    }
    if (!receives)
        hg_host_direct_clear(&w->waves->direct[i]);
    memcpy(shadows, w->waves->direct[i].rays, sizeof w->waves->direct[i].rays);
}

static void shade_probe(void *user, size_t index)
{
    const struct run *w = user;
    for (uint32_t i = 0; i < w->wave.rays; i++)
        shade_ray(w, index * w->wave.rays + i);
}

// Of the dynamic field's probes the first updates fade soon: they had less light that bounced.
static float keep_of(const struct run *w, uint32_t probe)
{
    const float seen = (float)w->wave.field->updates[probe];
    if (w->wave.keep >= 0)
        return w->wave.keep;
    return 1 - 1 / fminf(1 + seen / DYNAMIC_FADE, DYNAMIC_MOST);
}

static void gather_probe(void *user, size_t index)
{
    const struct run *w = user;
    const uint32_t probe = w->wave.probes[index];
    const uint32_t *blocked = w->waves->blocked.mapped;
    struct hg_gi_ray *rays = w->waves->brought + index * w->wave.rays;
    if (w->wave.places) {
        hg_gi_probe_relocate(w->wave.field, probe, rays, w->wave.rays, w->wave.last);
        return;
    }
    for (uint32_t i = 0; i < w->wave.rays; i++) {
        const size_t at = index * w->wave.rays + i;
        for (int k = 0; k < HG_HOST_SHADOW_RAYS; k++) {
            const struct hg_host_direct *d = &w->waves->direct[at];
            const bool dark = d->rays[k].t_max > 0 && blocked[at * HG_HOST_SHADOW_RAYS + (size_t)k];
            for (int c = 0; c < 3 && !dark; c++)
                rays[i].light[c] += d->light[k][c];
        }
    }
    const uint32_t straight = w->peaks + w->emitters;
    const uint32_t *hidden = (const uint32_t *)w->waves->peak_blocked.mapped + index * straight;
    struct hg_gi_peak *peaks = w->waves->peaks + index * straight;
    for (uint32_t i = 0; i < straight; i++)
        peaks[i].hidden = hidden[i];
    const struct hg_gi_brought brought = {.sky = w->sky,
        .rays = rays,
        .peaks = peaks,
        .emitters = peaks + w->peaks,
        .count = w->wave.rays,
        .peak_count = w->peaks,
        .emitter_count = w->emitters};
    hg_gi_probe_gather(w->wave.field, probe, &brought, keep_of(w, probe));
    w->wave.field->updates[probe]++;
}

// --- waves ---------------------------------------------------------------------------------------

static void find_sky(struct run *w)
{
    const struct hg_gi_lobes *lobes = &w->wave.field->lobes;
    for (uint32_t t = 0; t < HG_PROBE_IRRADIANCE_TEXELS; t++) {
        const float way[3] = {
            lobes->irradiance[0][t], lobes->irradiance[1][t], lobes->irradiance[2][t]};
        float light[3];
        hg_host_environment_irradiance(w->wave.sources, way, light);
        for (int c = 0; c < 3; c++)
            w->sky[c][t] = light[c];
    }
}

static void count(const struct run *w)
{
    struct hg_gi_stats *s = &w->waves->stats;
    const uint64_t rays = (uint64_t)w->wave.count * w->wave.rays;
    s->rays += rays;
    s->shadow_rays += (uint64_t)w->wave.count * (w->peaks + w->emitters);
    s->updates += w->wave.places ? 0 : w->wave.count;
    for (uint64_t i = 0; i < rays; i++) {
        const bool missed = w->waves->brought[i].distance == FLT_MAX;
        s->misses += missed;
        s->shaded += !w->wave.places && !missed && !w->waves->brought[i].back;
        for (int k = 0; k < HG_HOST_SHADOW_RAYS; k++)
            s->shadow_rays += w->waves->direct[i].rays[k].t_max > 0;
    }
}

enum hg_status hg_gi_waves_run(
    struct hg_gi_waves *waves, const struct hg_gi_wave *wave, struct hg_error *err)
{
    struct run w = {.wave = *wave, .waves = waves};
    struct hg_jobs *jobs = waves->params.jobs;
    const bool has_peaks = !wave->places && waves->environment.has_peaks;
    const bool has_emitters = !wave->places && wave->keep < 0 && waves->emissive.count > 0;
    w.peaks = has_peaks ? (wave->rays + PEAK_SHARE - 1) / PEAK_SHARE : 0;
    w.emitters = has_emitters ? (wave->rays + PEAK_SHARE - 1) / PEAK_SHARE : 0;
    sync_around(waves, wave->rays);
    if (!wave->places)
        find_sky(&w);
    hg_jobs_for(jobs, wave->count, cast_probe, &w);
    struct hg_trace_wave batch = {
        .rays = &waves->probe_rays, .hits = &waves->probe_hits, .count = wave->count * wave->rays};
    // Where probes stand is found by what surrounds them, holes or not.
    uint32_t more = 0;
    enum hg_status status = wave->places ? hg_trace_closest(waves->caster.trace, &batch, err)
                                         : hg_host_cast(&waves->caster, &batch, &more, err);
    if (status != HG_OK)
        return status;
    hg_jobs_for(jobs, wave->count, shade_probe, &w);
    if (!wave->places && wave->sources->count > 0) {
        batch = (struct hg_trace_wave){.rays = &waves->shadow_rays,
            .blocked = &waves->blocked,
            .count = wave->count * wave->rays * HG_HOST_SHADOW_RAYS};
        status = hg_host_cast_shadows(&waves->caster, &batch, err);
    }
    if (status == HG_OK && w.peaks + w.emitters > 0) {
        batch = (struct hg_trace_wave){.rays = &waves->peak_rays,
            .blocked = &waves->peak_blocked,
            .count = wave->count * (w.peaks + w.emitters)};
        status = hg_host_cast_shadows(&waves->caster, &batch, err);
    }
    if (status != HG_OK)
        return status;
    hg_jobs_for(jobs, wave->count, gather_probe, &w);
    count(&w);
    waves->stats.rays += more;
    return HG_OK;
}

enum hg_status hg_gi_waves_distances(
    struct hg_gi_waves *w, uint32_t count, float *distances, struct hg_error *err)
{
    const struct hg_gpu_hit *hits = w->probe_hits.mapped;
    const struct hg_trace_wave batch = {
        .rays = &w->probe_rays, .hits = &w->probe_hits, .count = count, .coherent = true};
    const enum hg_status status = hg_trace_closest(w->caster.trace, &batch, err);
    for (uint32_t i = 0; i < count && status == HG_OK; i++)
        distances[i] = hits[i].draw == HG_HIT_NONE ? FLT_MAX : hits[i].t;
    return status;
}
