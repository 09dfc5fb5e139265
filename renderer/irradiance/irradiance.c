// irradiance.c - see irradiance.h.
#include "renderer/irradiance/irradiance.h"

#include <float.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/hash.h"
#include "renderer/gi/environment.h"
#include "renderer/gi/patches.h"
#include "renderer/gi/surfaces.h"
#include "renderer/gi/words.h"
#include "renderer/irradiance/cells.h"
#include "renderer/math/sequence.h"

#define MOST_RAYS  6144u
#define MOST_EACH  2u                    // rays of a texel in one picture
#define TURN_BITS  3                     // of places along a side that have turns of their own
#define MOST_TURNS (1u << 2 * TURN_BITS) // pictures in which each texel sends once, at most
#define ACROSS     20.0f                 // cells that the height of a picture is, at any distance
#define FINEST     0.005f                // metres of the smallest cells
#define BELIEVED   6.0f                  // samples that count as much as that probe light is right
#define ENOUGH     128.0f                // samples of a cell from which on it is asked less often,
#define SELDOM     8u                    // in one of so many turns
#define GREY       0.02f // of the brightest channel, that a dark one is taken to have
#define MOST_RATIO 16.0f
#define LIFT       2e-3f // of the depth, that rays begin off surfaces: levels of detail differ

struct sample {
    uint32_t cell;
    float normal[3], facet[3]; // interpolated; of the triangle
    float direction[3], position[3];
    float without[3];  // probe light
    float gathered[3]; // irradiance over pi
    float peak[3];     // the same of a peak of the environment, if nothing is in the way
};

struct hg_irradiance {
    struct hg_gpu *gpu;
    struct hg_jobs *jobs;
    struct hg_irradiance_cells cells;
    double origin[3];
    uint64_t light;
    uint32_t doublings;
    struct sample *samples; // [MOST_RAYS]
    uint32_t *met;          // [MOST_RAYS] samples whose ray met a surface
    uint32_t count;
    struct hg_gpu_buffer rays, hits, peaks, hidden;
    struct hg_gi_patches patches;
    struct hg_irradiance_stats stats;
};

// One picture in the making.
struct work {
    struct hg_irradiance *r;
    const struct hg_irradiance_picture *p;
    uint32_t *words;
    uint32_t columns, rows;
};

// --- life ----------------------------------------------------------------------------------------

static enum hg_status make_buffers(struct hg_irradiance *r, struct hg_error *err)
{
    const struct {
        struct hg_gpu_buffer *buffer;
        uint64_t item;
        const char *name;
    } rows[] = {{&r->rays, sizeof(struct hg_gpu_ray), "irradiance rays"},
        {&r->hits, sizeof(struct hg_gpu_hit), "irradiance hits"},
        {&r->peaks, sizeof(struct hg_gpu_ray), "irradiance rays to peaks"},
        {&r->hidden, sizeof(uint32_t), "irradiance hidden peaks"}};
    enum hg_status status = HG_OK;
    for (size_t i = 0; i < sizeof rows / sizeof *rows && status == HG_OK; i++)
        status = hg_gpu_buffer_create(r->gpu, HG_GPU_BUFFER_READBACK, MOST_RAYS * rows[i].item,
            rows[i].name, rows[i].buffer, err);
    return status;
}

uint64_t hg_irradiance_bytes(void)
{
    const uint64_t patch = sizeof(struct hg_gi_patch) + sizeof(struct hg_gi_direct) +
                           sizeof(struct hg_gi_lit) + 3 * sizeof(float) +
                           HG_GI_SHADOW_RAYS * (sizeof(struct hg_gpu_ray) + sizeof(uint32_t));
    const uint64_t ray = 2 * sizeof(struct hg_gpu_ray) + sizeof(struct hg_gpu_hit) +
                         sizeof(struct sample) + 2 * sizeof(uint32_t);
    return sizeof(struct hg_irradiance_cell) * HG_IRRADIANCE_CELLS + MOST_RAYS * (patch + ray);
}

enum hg_status hg_irradiance_create(
    struct hg_gpu *gpu, struct hg_jobs *jobs, struct hg_irradiance **out, struct hg_error *err)
{
    struct hg_irradiance *r = hg_calloc(1, sizeof *r);
    *out = r;
    if (!r)
        return hg_error_set(err, HG_E_NOMEM, "irradiance", NULL, "out of host memory");
    r->gpu = gpu;
    r->jobs = jobs;
    r->samples = hg_calloc(MOST_RAYS, sizeof *r->samples);
    r->met = hg_calloc(MOST_RAYS, sizeof *r->met);
    enum hg_status status = hg_irradiance_cells_init(&r->cells, FINEST);
    if (!r->samples || !r->met || status != HG_OK)
        status = hg_error_set(err, HG_E_NOMEM, "irradiance", NULL, "out of host memory");
    if (status == HG_OK)
        status = make_buffers(r, err);
    if (status == HG_OK)
        status = hg_gi_patches_reserve(&r->patches, gpu, MOST_RAYS, err);
    if (status != HG_OK) {
        hg_irradiance_destroy(r);
        *out = NULL;
    }
    return status;
}

void hg_irradiance_destroy(struct hg_irradiance *r)
{
    if (!r)
        return;
    struct hg_gpu_buffer *buffers[] = {&r->rays, &r->hits, &r->peaks, &r->hidden};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++)
        hg_gpu_buffer_destroy(r->gpu, buffers[i]);
    hg_gi_patches_finish(&r->patches, r->gpu);
    hg_irradiance_cells_finish(&r->cells);
    hg_free(r->samples);
    hg_free(r->met);
    hg_free(r);
}

// --- which texels send ---------------------------------------------------------------------------

// False: there is no surface.
static bool find_point(
    const struct work *w, const uint32_t at[2], struct hg_irradiance_point *out, float *depth)
{
    const size_t texel = (size_t)at[1] * w->columns + at[0];
    const uint32_t *light = w->p->looked_up + 4 * texel;
    const struct hg_gpu_camera *c = w->p->texels.camera;
    float view[3];
    memcpy(depth, &light[3], sizeof *depth);
    if (!(*depth > 0))
        return false;
    hg_gi_texel_place(&w->p->texels, at, *depth, out->position, view);
    hg_gi_texel_normal(light[2], out->normal);
    const float pixel = c->orthographic ? c->pixel_size : c->pixel_angle * *depth;
    out->level =
        hg_irradiance_level(&w->r->cells, pixel * (float)w->p->texels.height * (1 / ACROSS));
    return true;
}

// Over the cosine. Each cell has a sequence of its own: Halton points, turned (Cranley and
// Patterson 1976).
static void choose_direction(struct hg_irradiance_cell *cell, struct sample *s, float xi[3])
{
    const uint64_t bits = hg_hash_mix(0x6972u, cell->key);
    const uint32_t number = cell->rays++;
    float t[3], b[3];
    for (int a = 0; a < 3; a++) {
        static const uint32_t bases[3] = {2, 3, 5};
        xi[a] = hg_radical_inverse(number + 1, bases[a]) +
                (float)(bits >> (20 * a) & 0xfffff) * (1.0f / 0x100000);
        xi[a] -= floorf(xi[a]);
    }
    const float radius = sqrtf(xi[0]), angle = 2 * (float)HG_PI * xi[1];
    const float x = radius * cosf(angle), y = radius * sinf(angle), z = sqrtf(fmaxf(1 - xi[0], 0));
    hg_basis3(s->normal, t, b);
    for (int a = 0; a < 3; a++)
        s->direction[a] = x * t[a] + y * b[a] + z * s->normal[a];
}

static struct hg_gpu_ray ray_of(const struct sample *s, const float direction[3])
{
    return (struct hg_gpu_ray){.origin_ws = {s->position[0], s->position[1], s->position[2]},
        .direction_ws = {direction[0], direction[1], direction[2]},
        .t_max = FLT_MAX,
        .mask = HG_RAY_OPAQUE | HG_RAY_MASK};
}

// Interpolated normals may lie far off their triangle. What comes from behind that is lost, as it
// is in path mode.
static bool is_lost(const struct sample *s)
{
    return hg_dot3(s->direction, s->facet) < 0;
}

// A ray to a peak of the environment, beside each that samples the cosine.
static void choose_peak(const struct work *w, uint32_t i, const float xi[3])
{
    struct sample *s = &w->r->samples[i];
    float direction[3] = {0, 1, 0}, light[3];
    hg_gi_environment_peak(w->p->world.environment, w->p->sources, xi, direction, light);
    const float cosine = hg_dot3(direction, s->facet) > 0 ? hg_dot3(direction, s->normal) : 0;
    for (int c = 0; c < 3; c++)
        s->peak[c] = cosine > 0 ? light[c] * cosine * (1 / (float)HG_PI) : 0;
    struct hg_gpu_ray *ray = (struct hg_gpu_ray *)w->r->peaks.mapped + i;
    *ray = ray_of(s, direction);
    ray->t_max = cosine > 0 ? FLT_MAX : -1;
}

static void send(const struct work *w, const uint32_t at[2], uint32_t cell,
    const struct hg_irradiance_point *point, float depth)
{
    struct hg_irradiance *r = w->r;
    const size_t texel = (size_t)at[1] * w->columns + at[0];
    struct sample *s = &r->samples[r->count];
    float xi[3];
    *s = (struct sample){.cell = cell};
    hg_copy3(point->normal, s->normal);
    struct hg_gi_texel_mirror m;
    hg_gi_texel_mirror(w->p->mirrors + 2 * texel, &m);
    hg_copy3(m.facet, s->facet);
    hg_mad3(point->position, m.facet, LIFT * depth, s->position);
    hg_gi_rgb9e5_read(w->p->looked_up[4 * texel], s->without);
    choose_direction(&r->cells.cells[cell], s, xi);
    ((struct hg_gpu_ray *)r->rays.mapped)[r->count] = ray_of(s, s->direction);
    if (is_lost(s))
        ((struct hg_gpu_ray *)r->rays.mapped)[r->count].t_max = -1;
    if (w->p->world.environment->has_peaks)
        choose_peak(w, r->count, xi);
    r->count++;
}

// Rays of the texel at this place of the picture, if it is its turn.
static void choose_texel(const struct work *w, const uint32_t at[2], uint32_t turns)
{
    struct hg_irradiance *r = w->r;
    const uint32_t rank = hg_dither_rank(at[0], at[1], TURN_BITS);
    struct hg_irradiance_point point;
    float depth;
    if (rank % turns != r->cells.picture % turns || !find_point(w, at, &point, &depth))
        return;
    const uint32_t cell = hg_irradiance_ask(&r->cells, &point);
    if (cell == HG_IRRADIANCE_NONE)
        return;
    const bool enough = r->cells.cells[cell].sums.samples >= ENOUGH;
    if (!enough || (rank / turns + r->cells.picture / turns) % SELDOM == 0)
        send(w, at, cell, &point, depth);
}

// In the order of texels: what cells count does not depend on threads.
static void choose(const struct work *w)
{
    struct hg_irradiance *r = w->r;
    const float most = (w->p->share > 0 ? w->p->share : 1) * MOST_RAYS;
    const float texels = (float)w->columns * (float)w->rows;
    const uint32_t each = 2 * texels <= most ? MOST_EACH : 1;
    uint32_t turns = 1;
    while (turns < MOST_TURNS && texels > most * (float)turns)
        turns *= 2;
    r->count = 0;
    for (uint32_t k = 0; k < each; k++)
        for (uint32_t y = 0; y < w->rows; y++)
            for (uint32_t x = 0; x < w->columns && r->count < MOST_RAYS; x++)
                choose_texel(w, (const uint32_t[2]){x, y}, turns);
}

// --- what rays bring -----------------------------------------------------------------------------

// Surfaces that rays met; the rest has its light.
static void meet(const struct work *w)
{
    struct hg_irradiance *r = w->r;
    const struct hg_gpu_hit *hits = r->hits.mapped;
    r->patches.count = 0;
    for (uint32_t i = 0; i < r->count; i++) {
        struct sample *s = &r->samples[i];
        struct hg_gi_surface surface;
        if (is_lost(s))
            continue;
        if (hits[i].draw == HG_HIT_NONE) {
            hg_gi_environment_even(
                w->p->world.environment, w->p->sources, s->direction, s->gathered);
            r->stats.misses++;
            continue;
        }
        hg_gi_surface_at(w->p->world.surfaces, &hits[i], s->direction, &surface);
        struct hg_gi_patch *patch = &r->patches.points[r->patches.count];
        r->met[r->patches.count++] = i;
        hg_mad3(s->position, s->direction, hits[i].t, patch->position);
        hg_copy3(surface.normal, patch->normal);
        hg_copy3(surface.material->albedo, patch->albedo);
        for (int c = 0; c < 3; c++) // what has one side shines to that side
            patch->emission[c] = surface.back ? 0 : surface.material->emission[c];
    }
}

static void add(const struct work *w)
{
    struct hg_irradiance *r = w->r;
    const uint32_t *hidden = r->hidden.mapped;
    const bool peaks = w->p->world.environment->has_peaks;
    for (uint32_t k = 0; k < r->patches.count; k++)
        hg_copy3(r->patches.radiance[k], r->samples[r->met[k]].gathered);
    for (uint32_t i = 0; i < r->count; i++) {
        struct sample *s = &r->samples[i];
        float without[3];
        const float most = fmaxf(s->without[0], fmaxf(s->without[1], s->without[2]));
        for (int c = 0; c < 3; c++) {
            s->gathered[c] += peaks && !hidden[i] ? s->peak[c] : 0;
            without[c] = s->without[c] + GREY * most;
        }
        const float sum = s->gathered[0] + s->gathered[1] + s->gathered[2];
        if (most > 0 && sum < FLT_MAX)
            hg_irradiance_add(&r->cells, s->cell, s->gathered, without);
    }
}

static enum hg_status gather(const struct work *w, struct hg_error *err)
{
    struct hg_irradiance *r = w->r;
    struct hg_trace *trace = w->p->world.trace;
    const struct hg_gi_patch_lighting with = {
        r->jobs, w->p->sources, &w->p->world, r->cells.picture};
    struct hg_trace_wave wave = {.rays = &r->rays, .hits = &r->hits, .count = r->count};
    enum hg_status status = r->count > 0 ? hg_trace_closest(trace, &wave, err) : HG_OK;
    if (status != HG_OK)
        return status;
    meet(w);
    status = hg_gi_patches_light(&r->patches, &with, &r->stats.shadow_rays, err);
    wave = (struct hg_trace_wave){.rays = &r->peaks, .blocked = &r->hidden, .count = r->count};
    if (status == HG_OK && r->count > 0 && w->p->world.environment->has_peaks)
        status = hg_trace_blocked(trace, &wave, err);
    if (status == HG_OK)
        add(w);
    return status;
}

// --- what they change ----------------------------------------------------------------------------

static void apply_texel(const struct work *w, const uint32_t at[2])
{
    struct hg_irradiance_point point;
    struct hg_irradiance_sums sums;
    float depth, light[3];
    if (!find_point(w, at, &point, &depth))
        return;
    hg_irradiance_look_up(&w->r->cells, &point, &sums);
    uint32_t *word = w->words + 4 * ((size_t)at[1] * w->columns + at[0]);
    if (!(sums.samples > 0))
        return;
    hg_gi_rgb9e5_read(*word, light);
    const float most = fmaxf(light[0], fmaxf(light[1], light[2]));
    for (int c = 0; c < 3; c++) {
        const float ratio = fminf(sums.gathered[c] / fmaxf(sums.without[c], FLT_MIN), MOST_RATIO);
        const float grey = light[c] + GREY * most;
        light[c] = (sums.samples * ratio * grey + BELIEVED * light[c]) / (sums.samples + BELIEVED);
    }
    *word = hg_gi_rgb9e5(light[0], light[1], light[2]);
}

static void apply_row(void *user, size_t y)
{
    const struct work *w = user;
    for (uint32_t x = 0; x < w->columns; x++)
        apply_texel(w, (const uint32_t[2]){x, (uint32_t)y});
}

// --- the picture ---------------------------------------------------------------------------------

static void sync(struct hg_irradiance *r, const struct hg_irradiance_picture *p)
{
    if (memcmp(r->origin, p->origin, sizeof r->origin) != 0)
        hg_irradiance_cells_clear(&r->cells);
    memcpy(r->origin, p->origin, sizeof r->origin);
    // Views that have the field of rest have seen no updates.
    const bool is_new = p->light != r->light;
    r->cells.light += is_new || p->doublings > r->doublings;
    r->doublings = is_new || p->doublings > r->doublings ? p->doublings : r->doublings;
    r->light = p->light;
    r->cells.picture++;
}

enum hg_status hg_irradiance_run(struct hg_irradiance *r,
    const struct hg_irradiance_picture *picture, uint32_t *words, struct hg_error *err)
{
    const uint64_t begin = hg_clock_now_ns(), cpu = hg_clock_cpu_ns();
    struct work w = {.r = r,
        .p = picture,
        .words = words,
        .columns = (picture->texels.width + HG_PROBE_LIGHT_PX - 1) / HG_PROBE_LIGHT_PX,
        .rows = (picture->texels.height + HG_PROBE_LIGHT_PX - 1) / HG_PROBE_LIGHT_PX};
    r->stats = (struct hg_irradiance_stats){0};
    sync(r, picture);
    choose(&w);
    const enum hg_status status = gather(&w, err);
    if (status == HG_OK)
        hg_jobs_for(r->jobs, w.rows, apply_row, &w);
    r->stats.rays = r->count;
    r->stats.cells = r->cells.count;
    r->stats.ns = hg_clock_now_ns() - begin;
    r->stats.cpu_ns = hg_clock_cpu_ns() - cpu;
    r->stats.bytes = hg_irradiance_bytes();
    return status;
}

void hg_irradiance_stats(const struct hg_irradiance *r, struct hg_irradiance_stats *out)
{
    *out = r ? r->stats : (struct hg_irradiance_stats){0};
}
