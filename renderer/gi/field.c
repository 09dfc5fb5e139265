#include "renderer/gi/field.h"

#include <float.h>

#include "base/alloc.h"
#include "base/jobs.h"
#include "base/simd.h"
#include "renderer/math/rgb9e5.h"
#include "renderer/math/vec.h"

#define IRRADIANCE_SIDE   HG_PROBE_IRRADIANCE_SIDE
#define IRRADIANCE_TEXELS HG_PROBE_IRRADIANCE_TEXELS
#define MOMENT_SIDE       HG_PROBE_MOMENT_SIDE
#define MOMENT_TEXELS     HG_PROBE_MOMENT_TEXELS
#define PROBE_WORDS       (1 + 4 * IRRADIANCE_TEXELS + MOMENT_TEXELS)
#define INSET             0.25f // of the outermost probes from the bounds, in spacings
#define INSIDE            0.25f // share of rays that meet backs, from which a probe sleeps
#define CLEARANCE         0.15f // distance that probes keep from surfaces, in spacings
#define MOST_OFFSET       0.45f
#define LOBE_POWER        32 // of the cosine in moments
// Between probes is this share of the mean of their light, and else the square of the mean of its
// roots, which is less where they differ: along corridors light falls off by factors, and the mean
// would be too much, with each bounce more (Majercik et al. 2021 have roots alone).
#define LINEAR            0.4f
#define NEAR              2.3f // spacings: no surface whose lookups read a probe is farther from it
#define SEED_WEIGHT       4    // of light that a probe begins with, in updates of 8 rays

// --- octahedral tables ---------------------------------------------------------------------------

static void texel_direction(uint32_t texel, uint32_t side, float out[3])
{
    const float x = 2 * ((float)(texel % side) + 0.5f) / (float)side - 1;
    const float y = 2 * ((float)(texel / side) + 0.5f) / (float)side - 1;
    const float z = 1 - fabsf(x) - fabsf(y), fold = fmaxf(-z, 0);
    out[0] = x + (x >= 0 ? -fold : fold);
    out[1] = y + (y >= 0 ? -fold : fold);
    out[2] = z;
    hg_normalize3(out);
}

static inline uint32_t wrapped_texel(int x, int y, int side)
{
    if (x < 0 || x >= side) {
        x = x < 0 ? 0 : side - 1;
        y = side - 1 - y;
    }
    if (y < 0 || y >= side) {
        x = side - 1 - x;
        y = y < 0 ? 0 : side - 1;
    }
    x = x < 0 ? 0 : x >= side ? side - 1 : x;
    return (uint32_t)(y * side + x);
}

static inline uint32_t texel_of(const float d[3], int side, float xi_x, float xi_y)
{
    float e[2];
    hg_octahedral2(d, e);
    const float x = (e[0] * 0.5f + 0.5f) * (float)side + xi_x - 0.5f;
    const float y = (e[1] * 0.5f + 0.5f) * (float)side + xi_y - 0.5f;
    return wrapped_texel((int)floorf(x), (int)floorf(y), side);
}

// --- placing -------------------------------------------------------------------------------------

// Probes along an axis, and where the first one stands.
static uint32_t along(float min, float max, float spacing, float *first)
{
    const float extent = max - min - 2 * INSET * spacing;
    const uint32_t steps = extent > spacing ? (uint32_t)ceilf(extent / spacing) : 1;
    *first = 0.5f * (min + max - (float)steps * spacing);
    return steps < HG_GI_MOST_PROBES ? steps + 1 : HG_GI_MOST_PROBES;
}

void hg_gi_field_grid(struct hg_gi_field *f, const float min[3], const float max[3])
{
    float extent = 0;
    for (int a = 0; a < 3; a++)
        extent = fmaxf(extent, max[a] - min[a]);
    f->spacing = fmaxf(extent / 512, 1e-6f);
    for (;;) {
        uint64_t count = 1;
        for (int a = 0; a < 3; a++) {
            f->counts[a] = along(min[a], max[a], f->spacing, &f->origin[a]);
            count *= f->counts[a];
        }
        f->count = (uint32_t)count;
        if (count <= HG_GI_MOST_PROBES)
            return;
        f->spacing *= 1.02f;
    }
}

static void set_lobes(struct hg_gi_lobes *out)
{
    for (uint32_t t = 0; t < IRRADIANCE_TEXELS; t++) {
        float d[3];
        texel_direction(t, IRRADIANCE_SIDE, d);
        for (int a = 0; a < 3; a++)
            out->irradiance[a][t] = d[a];
    }
    for (uint32_t t = 0; t < MOMENT_TEXELS; t++)
        texel_direction(t, MOMENT_SIDE, out->moments[t]);
}

enum hg_status hg_gi_field_place_grid(struct hg_gi_field *f, const struct hg_gi_field *grid)
{
    struct hg_gi_field next = {.count = grid->count,
        .spacing = grid->spacing,
        .coarser = grid->coarser,
        .salt = grid->salt,
        .buffer = f->buffer};
    memcpy(next.counts, grid->counts, sizeof next.counts);
    hg_copy3(grid->origin, next.origin);
    f->buffer = (struct hg_gpu_buffer){0};
    hg_gi_field_finish(f, NULL);
    next.offsets = hg_calloc(next.count, sizeof *next.offsets);
    next.walls = hg_calloc(next.count, sizeof *next.walls);
    next.inside = hg_calloc(next.count, sizeof *next.inside);
    next.covered = hg_calloc(next.count, sizeof *next.covered);
    next.needed = hg_calloc(next.count, sizeof *next.needed);
    next.updates = hg_calloc(next.count, sizeof *next.updates);
    next.doubted = hg_calloc(next.count, sizeof *next.doubted);
    next.irradiance = hg_calloc(next.count, sizeof *next.irradiance);
    next.moments = hg_calloc(next.count, sizeof *next.moments);
    next.means = hg_calloc(next.count, sizeof *next.means);
    next.words = hg_calloc((size_t)next.count * PROBE_WORDS, sizeof *next.words);
    next.stale = hg_calloc(next.count, sizeof *next.stale);
    *f = next;
    if (!f->offsets || !f->walls || !f->inside || !f->covered || !f->needed || !f->updates ||
        !f->doubted || !f->irradiance || !f->moments || !f->means || !f->words || !f->stale) {
        hg_gi_field_finish(f, NULL);
        return HG_E_NOMEM;
    }
    memset(f->needed, f->coarser == NULL, f->count * sizeof *f->needed);
    memset(f->stale, true, f->count * sizeof *f->stale);
    set_lobes(&f->lobes);
    return HG_OK;
}

void hg_gi_field_finish(struct hg_gi_field *f, struct hg_gpu *gpu)
{
    if (gpu)
        hg_gpu_buffer_destroy(gpu, &f->buffer);
    hg_free(f->offsets);
    hg_free(f->walls);
    hg_free(f->inside);
    hg_free(f->covered);
    hg_free(f->needed);
    hg_free(f->updates);
    hg_free(f->doubted);
    hg_free(f->irradiance);
    hg_free(f->moments);
    hg_free(f->means);
    hg_free(f->words);
    hg_free(f->stale);
    *f = (struct hg_gi_field){.buffer = f->buffer};
}

static uint64_t host_bytes(uint32_t probes)
{
    const struct hg_gi_field *f = NULL;
    return probes *
           (sizeof *f->offsets + sizeof *f->walls + sizeof *f->inside + sizeof *f->covered +
               sizeof *f->needed + sizeof *f->updates + sizeof *f->doubted + sizeof *f->irradiance +
               sizeof *f->moments + sizeof *f->means + sizeof *f->stale + PROBE_WORDS * 4ull);
}

uint64_t hg_gi_field_bytes(const struct hg_gi_field *f)
{
    return host_bytes(f->count) + f->buffer.size_bytes;
}

uint64_t hg_gi_field_bytes_of(uint32_t probes)
{
    return host_bytes(probes) + probes * PROBE_WORDS * 4ull;
}

void hg_gi_probe_position(const struct hg_gi_field *f, uint32_t probe, float out[3])
{
    const uint32_t cell[3] = {probe % f->counts[0], probe / f->counts[0] % f->counts[1],
        probe / f->counts[0] / f->counts[1]};
    for (int a = 0; a < 3; a++)
        out[a] = f->origin[a] + ((float)cell[a] + f->offsets[probe][a]) * f->spacing;
}

// --- gathering -----------------------------------------------------------------------------------

static void keep_share(float *values, size_t count, float keep)
{
    for (size_t i = 0; i < count; i++)
        values[i] = keep > 0 ? values[i] * keep : 0;
}

HG_SIMD_LOOP static void add_light(struct hg_gi_irradiance *to, const struct hg_gi_ray *ray,
    const float directions[3][IRRADIANCE_TEXELS])
{
    const float *d = ray->direction, hit = ray->distance < FLT_MAX ? 1.0f : 0.0f;
    for (uint32_t t = 0; t < IRRADIANCE_TEXELS; t++) {
        const float c = d[0] * directions[0][t] + d[1] * directions[1][t] + d[2] * directions[2][t];
        const float w = c > 0 ? c : 0;
        to->weight[t] += w;
        to->sky[t] += w * (1 - hit);
        for (int k = 0; k < 3; k++) {
            to->light[k][t] += w * ray->light[k];
            to->surfaces[k][t] += w * hit * ray->light[k];
            to->even[k][t] += w * ray->even[k];
        }
    }
}

// Few rays meet emitters.
HG_SIMD_LOOP static void add_emitter(struct hg_gi_irradiance *to, const struct hg_gi_ray *ray,
    const float directions[3][IRRADIANCE_TEXELS])
{
    const float *d = ray->direction;
    for (uint32_t t = 0; t < IRRADIANCE_TEXELS; t++) {
        const float c = d[0] * directions[0][t] + d[1] * directions[1][t] + d[2] * directions[2][t];
        for (int k = 0; k < 3; k++)
            to->emitters[k][t] += (c > 0 ? c : 0) * ray->emitted[k];
    }
}

static void add_distance(struct hg_gi_moments *to, const struct hg_gi_ray *ray, float spacing,
    const struct hg_gi_lobes *lobes)
{
    float e[2];
    hg_octahedral2(ray->direction, e);
    const int x0 = (int)floorf((e[0] * 0.5f + 0.5f) * MOMENT_SIDE);
    const int y0 = (int)floorf((e[1] * 0.5f + 0.5f) * MOMENT_SIDE);
    float distance = fminf(ray->distance / spacing, HG_GI_FARTHEST);
    if (ray->back)
        distance *= 0.2f;
    for (int y = y0 - 1; y <= y0 + 1; y++)
        for (int x = x0 - 1; x <= x0 + 1; x++) {
            const uint32_t t = wrapped_texel(x, y, MOMENT_SIDE);
            struct hg_gi_moment *m = &to->texels[t];
            float w = hg_maxf(hg_dot3(lobes->moments[t], ray->direction), 0);
            for (int power = 1; power < LOBE_POWER; power *= 2)
                w *= w;
            m->distance += w * distance;
            m->squared += w * distance * distance;
            m->weight += w;
        }
}

#define STAYS 0.02f // spacings that a probe may have moved by for what its rays met to be as far

void hg_gi_probe_relocate(
    struct hg_gi_field *f, uint32_t probe, const struct hg_gi_ray *rays, uint32_t count, bool last)
{
    const struct hg_gi_ray *back = NULL, *front = NULL;
    float was[3];
    hg_copy3(f->offsets[probe], was);
    uint32_t backs = 0;
    for (uint32_t i = 0; i < count; i++) {
        const struct hg_gi_ray **nearest = rays[i].back ? &back : &front;
        backs += rays[i].back;
        if (rays[i].distance < FLT_MAX && (!*nearest || rays[i].distance < (*nearest)->distance))
            *nearest = &rays[i];
    }
    const bool inside = (float)backs > INSIDE * (float)count;
    float step = 0;
    const struct hg_gi_ray *by = inside ? back : front;
    if (inside)
        step = back->distance / f->spacing + CLEARANCE;
    else if (front)
        step = fminf(front->distance / f->spacing - CLEARANCE, 0);
    for (int a = 0; a < 3 && by; a++)
        f->offsets[probe][a] =
            hg_clampf(f->offsets[probe][a] + by->direction[a] * step, -MOST_OFFSET, MOST_OFFSET);
    // Offsets are what the device has of them.
    for (int a = 0; a < 3; a++)
        f->offsets[probe][a] =
            rintf((f->offsets[probe][a] + 0.5f) * HG_PROBE_OFFSET_STEPS) / HG_PROBE_OFFSET_STEPS -
            0.5f;
    f->inside[probe] = inside;
    float moved[3];
    hg_sub3(f->offsets[probe], was, moved);
    const bool stays = last && hg_length3(moved) < STAYS;
    hg_gi_wall_find(stays && !inside ? front : NULL, rays, count, f->spacing, &f->walls[probe]);
    if (stays)
        for (uint32_t i = 0; i < count; i++)
            add_distance(&f->moments[probe], &rays[i], f->spacing, &f->lobes);
    if (!f->coarser)
        return;
    f->needed[probe] |= (front && front->distance < NEAR * f->spacing) ||
                        (back && back->distance < NEAR * f->spacing);
}

#define DOUBT 0.3f // what old distances are worth

void hg_gi_field_doubt_distances(struct hg_gi_field *field)
{
    for (uint32_t i = 0; i < field->count; i++) {
        struct hg_gi_moments *m = &field->moments[i];
        if (field->updates[i] == 0 || field->doubted[i])
            continue;
        field->doubted[i] = true;
        for (uint32_t t = 0; t < HG_PROBE_MOMENT_TEXELS; t++) {
            m->texels[t].distance *= DOUBT;
            m->texels[t].squared *= DOUBT;
            m->texels[t].weight *= DOUBT;
        }
    }
}

static void reach_of(const struct hg_gi_moment *m, float *mean, float *variance)
{
    const float w = m->weight;
    *mean = w > 0 ? m->distance / w : HG_GI_FARTHEST;
    *variance = w > 0 ? hg_maxf(m->squared / w - *mean * *mean, 1e-4f) : 1;
}

// sky: as of hg_gi_brought.
static void set_means(struct hg_gi_field *f, uint32_t probe, const float sky[3][IRRADIANCE_TEXELS])
{
    struct hg_gi_means *to = &f->means[probe];
    const struct hg_gi_irradiance *from = &f->irradiance[probe];
    for (uint32_t t = 0; t < IRRADIANCE_TEXELS; t++) {
        const float scale = from->weight[t] > 0 ? 1 / from->weight[t] : 0;
        for (int c = 0; c < 3; c++) {
            const float seen = from->light[c][t] - from->surfaces[c][t], all = from->even[c][t];
            const float share = all > 0 ? hg_clampf(seen / all, 0, 1) : 0;
            to->light[t][c] = from->surfaces[c][t] * scale + share * sky[c][t];
        }
        to->light[t][3] = from->weight[t];
    }
    for (uint32_t t = 0; t < MOMENT_TEXELS; t++)
        reach_of(&f->moments[probe].texels[t], &to->reach[t][0], &to->reach[t][1]);
    f->stale[probe] = true;
}

// Light that comes in one direction, as sums over `count` rays from all around have it; emitter: a
// surface sends it, else the environment.
HG_SIMD_LOOP static void add_peak(struct hg_gi_irradiance *to, const struct hg_gi_peak *peak,
    float scale, bool emitter, const struct hg_gi_lobes *lobes)
{
    const float *d = peak->direction, even = emitter ? 0.0f : 1.0f,
                seen = peak->hidden ? 0.0f : 1.0f;
    const float surface = emitter ? seen : 0.0f;
    const float(*directions)[IRRADIANCE_TEXELS] =
        (const float(*)[IRRADIANCE_TEXELS])lobes->irradiance;
    for (uint32_t t = 0; t < IRRADIANCE_TEXELS; t++) {
        const float c = d[0] * directions[0][t] + d[1] * directions[1][t] + d[2] * directions[2][t];
        const float w = (c > 0 ? c : 0) * scale;
        for (int k = 0; k < 3; k++) {
            to->light[k][t] += w * seen * peak->light[k];
            to->even[k][t] += w * even * peak->light[k];
            to->surfaces[k][t] += w * surface * peak->light[k];
            to->emitters[k][t] += w * surface * peak->light[k];
        }
    }
}

void hg_gi_probe_gather(
    struct hg_gi_field *f, uint32_t probe, const struct hg_gi_brought *brought, float keep)
{
    struct hg_gi_irradiance *to = &f->irradiance[probe];
    const struct hg_gi_lobes *lobes = &f->lobes;
    uint32_t backs = 0;
    for (uint32_t i = 0; i < brought->count; i++)
        backs += brought->rays[i].back;
    const bool was_covered =
        f->covered[probe]; // by what it no longer is in: nothing is worth keeping
    f->covered[probe] = f->follows && 2 * backs > brought->count;
    f->doubted[probe] = false;
    if (was_covered && !f->covered[probe])
        keep = 0;
    keep_share(&to->light[0][0], sizeof *to / sizeof(float), keep);
    for (uint32_t i = 0; i < brought->count; i++) {
        const struct hg_gi_ray *ray = &brought->rays[i];
        add_light(to, ray, (const float(*)[IRRADIANCE_TEXELS])lobes->irradiance);
        if (ray->emitted[0] + ray->emitted[1] + ray->emitted[2] > 0)
            add_emitter(to, ray, (const float(*)[IRRADIANCE_TEXELS])lobes->irradiance);
        add_distance(&f->moments[probe], ray, f->spacing, lobes);
    }
    // A ray stands for 4 pi / count steradians.
    const float each = (float)brought->count / (float)(4 * HG_PI);
    for (uint32_t i = 0; i < brought->peak_count; i++)
        add_peak(to, &brought->peaks[i], each / (float)brought->peak_count, false, lobes);
    for (uint32_t i = 0; i < brought->emitter_count; i++)
        add_peak(to, &brought->emitters[i], each / (float)brought->emitter_count, true, lobes);
    set_means(f, probe, brought->sky);
}

#define DARK 1e-6 // of the brightest probe's light: darker ones count as that

double hg_gi_field_log_light(const struct hg_gi_field *f, const uint32_t *probes, uint32_t count)
{
    double most = 0, sum = 0;
    for (int pass = 0; pass < 2; pass++)
        for (uint32_t i = 0; i < count; i++) {
            const struct hg_gi_means *m = &f->means[probes[i]];
            double light = 0;
            for (uint32_t t = 0; t < IRRADIANCE_TEXELS; t++)
                light += (double)m->light[t][0] + (double)m->light[t][1] + (double)m->light[t][2];
            most = pass == 0 ? fmax(most, light) : most;
            sum += pass == 1 && most > 0 ? log(fmax(light, DARK * most)) : 0;
        }
    return count > 0 ? sum / count : 0;
}

bool hg_gi_probe_is_lit(const struct hg_gi_field *f, uint32_t probe)
{
    const float *weight = f->irradiance[probe].weight;
    return weight[0] > 0 && weight[IRRADIANCE_TEXELS / 2 + IRRADIANCE_SIDE / 2] > 0;
}

// --- looking -------------------------------------------------------------------------------------

// One of the eight probes around a point.
struct corner {
    uint32_t probe;
    float weight;       // trilinear
    float at[3];        // the probe's position
    float from[3];      // from there to the point that is looked up, metres
    const float *reach; // mean and variance of distances that way, spacings
    const float *light; // and its weight
};

static float visibility(
    const struct hg_gi_field *f, const struct corner *c, const struct hg_gi_point *p)
{
    float to[3];
    hg_sub3(c->at, p->position, to);
    hg_normalize3(to);
    const float wrap = hg_dot3(to, p->normal) * 0.5f + 0.5f;
    const float distance = hg_length3(c->from) / f->spacing;
    const float beyond = hg_maxf(distance - c->reach[0], 0);
    const bool hidden = !f->follows && hg_gi_wall_hides(&f->walls[c->probe], c->from, f->spacing);
    const float seen = hidden ? 0 : c->reach[1] / (c->reach[1] + beyond * beyond);
    const float weight = hg_maxf((wrap * wrap + 0.02f) * seen * seen * seen, 1e-6f);
    return weight < 0.2f ? weight * weight * weight * 25 : weight;
}

// The probes around a point that take part and what is read of them, which is on its way into the
// cache afterwards: a field is larger than caches, and waiting for one probe after another was half
// of a lookup. at: the point that is looked up, in units of the grid. Returns how many.
static uint32_t find_corners(const struct hg_gi_field *f, const float lifted[3], const float at[3],
    uint32_t texel, const float xi[3], struct corner corners[8])
{
    float fraction[3];
    uint32_t base[3], found = 0;
    for (int a = 0; a < 3; a++) {
        const float most = f->counts[a] > 1 ? (float)(f->counts[a] - 2) : 0;
        base[a] = (uint32_t)hg_clampf(floorf(at[a]), 0, most);
        fraction[a] = hg_clampf(at[a] - (float)base[a], 0, 1);
    }
    for (uint32_t i = 0; i < 8; i++) {
        struct corner *c = &corners[found];
        uint32_t cell[3];
        c->weight = 1;
        for (int a = 0; a < 3; a++) {
            const uint32_t off = i >> a & 1;
            c->weight *= off ? fraction[a] : 1 - fraction[a];
            cell[a] = base[a] + off < f->counts[a] ? base[a] + off : f->counts[a] - 1;
        }
        c->probe = (cell[2] * f->counts[1] + cell[1]) * f->counts[0] + cell[0];
        if (c->weight <= 0 || !hg_gi_probe_is_read(f, c->probe))
            continue;
        hg_gi_probe_position(f, c->probe, c->at);
        hg_sub3(lifted, c->at, c->from);
        const struct hg_gi_means *means = &f->means[c->probe];
        c->reach = means->reach[texel_of(c->from, MOMENT_SIDE, xi[1], xi[2])];
        c->light = means->light[texel];
        __builtin_prefetch(c->reach);
        __builtin_prefetch(c->light);
        found++;
    }
    return found;
}

// Light between the eight probes around a point, and their weight in all.
static float look(const struct hg_gi_field *f, const struct hg_gi_point *p, const float lifted[3],
    const float at[3], const float xi[3], float out[3])
{
    struct corner corners[8];
    float roots[3] = {0}, linear[3] = {0}, sum = 0;
    const uint32_t texel = texel_of(p->normal, IRRADIANCE_SIDE, xi[0], xi[1]);
    const uint32_t count = find_corners(f, lifted, at, texel, xi, corners);
    for (uint32_t i = 0; i < count; i++) {
        const struct corner *c = &corners[i];
        if (c->light[3] <= 0)
            continue;
        const float weight = c->weight * visibility(f, c, p);
        for (int k = 0; k < 3; k++) {
            roots[k] += weight * sqrtf(c->light[k]);
            linear[k] += weight * c->light[k];
        }
        sum += weight;
    }
    for (int k = 0; k < 3; k++) {
        const float root = sum > 0 ? roots[k] / sum : 0, mean = sum > 0 ? linear[k] / sum : 0;
        out[k] = root * root + LINEAR * (mean - root * root);
    }
    return sum;
}

// How much of the light at a point is that of this grid: all of it inside, none far beyond its
// edge.
static float share_of(const struct hg_gi_field *f, const float at[3])
{
    float edge = 1;
    for (int a = 0; a < 3 && f->coarser; a++) {
        const float inner = fminf(at[a], (float)(f->counts[a] - 1) - at[a]);
        edge = fminf(edge, inner + HG_PROBE_BEYOND);
    }
    return fmaxf(edge, 0);
}

float hg_gi_field_irradiance(
    const struct hg_gi_field *f, const struct hg_gi_point *p, const float xi[3], float out[3])
{
    float left = 1;
    out[0] = out[1] = out[2] = 0;
    for (; f && left > 0; f = f->coarser) {
        float lifted[3], at[3], light[3];
        for (int a = 0; a < 3; a++) {
            const float bias =
                p->normal[a] * HG_PROBE_BIAS_NORMAL + p->view[a] * HG_PROBE_BIAS_VIEW;
            lifted[a] = p->position[a] + bias * f->spacing;
            at[a] = (lifted[a] - f->origin[a]) / f->spacing;
        }
        float share = left * share_of(f, at);
        if (share <= 0)
            continue;
        const float weight = look(f, p, lifted, at, xi, light);
        if (f->coarser || weight <= 0)
            share *= fminf(HG_PROBE_SURE * weight, 1);
        for (int c = 0; c < 3; c++)
            out[c] += share * light[c];
        left -= share;
    }
    return 1 - left;
}

// --- probes of grids with a coarser one ----------------------------------------------------------

void hg_gi_probe_copy(
    struct hg_gi_field *f, uint32_t probe, const struct hg_gi_field *from, uint32_t k)
{
    memcpy(f->offsets[probe], from->offsets[k], sizeof f->offsets[probe]);
    f->walls[probe] = from->walls[k];
    f->inside[probe] = from->inside[k];
    f->covered[probe] = from->covered[k];
    f->needed[probe] = from->needed[k];
    f->updates[probe] = from->updates[k];
    f->doubted[probe] = from->doubted[k];
    f->irradiance[probe] = from->irradiance[k];
    f->moments[probe] = from->moments[k];
    f->means[probe] = from->means[k];
    f->stale[probe] = true;
}

void hg_gi_probe_seed(struct hg_gi_field *f, uint32_t probe)
{
    static const float middle[3] = {0.5f, 0.5f, 0.5f}, no_sky[3][IRRADIANCE_TEXELS];
    const float weight = SEED_WEIGHT * 8 * 0.25f; // the mean of max(0, cos) over the sphere is 1/4
    struct hg_gi_irradiance *to = &f->irradiance[probe];
    struct hg_gi_point point;
    hg_gi_probe_position(f, probe, point.position);
    for (uint32_t t = 0; t < IRRADIANCE_TEXELS; t++) {
        float light[3];
        for (int a = 0; a < 3; a++)
            point.normal[a] = point.view[a] = f->lobes.irradiance[a][t];
        if (hg_gi_field_irradiance(f->coarser, &point, middle, light) < 0.5f) {
            *to = (struct hg_gi_irradiance){0};
            for (t = 0; t < IRRADIANCE_TEXELS; t++)
                f->means[probe].light[t][3] = 0;
            f->stale[probe] = true;
            return;
        }
        for (int c = 0; c < 3; c++)
            to->light[c][t] = to->surfaces[c][t] = weight * light[c];
        to->weight[t] = weight;
    }
    f->updates[probe] = SEED_WEIGHT;
    set_means(f, probe, no_sky);
}

// --- the device ----------------------------------------------------------------------------------

static uint32_t place_word(const struct hg_gi_field *f, uint32_t probe)
{
    const bool inside = f->inside[probe] || f->covered[probe];
    const bool awake = hg_gi_probe_is_read(f, probe) && hg_gi_probe_is_lit(f, probe);
    uint32_t word = inside ? HG_PROBE_INSIDE : awake ? HG_PROBE_AWAKE : 0;
    for (int a = 0; a < 3; a++)
        word |= (uint32_t)rintf((f->offsets[probe][a] + 0.5f) * HG_PROBE_OFFSET_STEPS)
                << (HG_PROBE_BITS * a);
    return word | (f->follows ? HG_GI_NO_WALL : f->walls[probe].code) << (3 * HG_PROBE_BITS);
}

static void pack_probe(void *user, size_t probe)
{
    const struct hg_gi_field *f = user;
    uint32_t *irradiance = f->words + f->count + probe * IRRADIANCE_TEXELS;
    uint32_t *moments =
        f->words + (size_t)f->count * (1 + IRRADIANCE_TEXELS) + probe * MOMENT_TEXELS;
    uint32_t *reflection = f->words + (size_t)f->count * (1 + IRRADIANCE_TEXELS + MOMENT_TEXELS) +
                           probe * 2 * IRRADIANCE_TEXELS;
    uint32_t *between = f->words + (size_t)f->count * (1 + 3 * IRRADIANCE_TEXELS + MOMENT_TEXELS) +
                        probe * IRRADIANCE_TEXELS;
    const struct hg_gi_irradiance *from = &f->irradiance[probe];
    const float(*means)[4] = (const float(*)[4])f->means[probe].light;
    f->words[probe] = place_word(f, (uint32_t)probe);
    if (!f->stale[probe])
        return;
    for (uint32_t t = 0; t < IRRADIANCE_TEXELS; t++) {
        const float scale = from->weight[t] > 0 ? 1 / from->weight[t] : 0;
        const float sky = from->sky[t] * scale;
        irradiance[t] = hg_rgb9e5_pack(means[t][0], means[t][1], means[t][2]);
        between[t] = hg_rgb9e5_pack(fmaxf(means[t][0] - from->emitters[0][t] * scale, 0),
            fmaxf(means[t][1] - from->emitters[1][t] * scale, 0),
            fmaxf(means[t][2] - from->emitters[2][t] * scale, 0));
        reflection[2 * t] = hg_rgb9e5_pack(from->surfaces[0][t] * scale,
            from->surfaces[1][t] * scale, from->surfaces[2][t] * scale);
        memcpy(&reflection[2 * t + 1], &sky, sizeof sky);
    }
    for (uint32_t t = 0; t < MOMENT_TEXELS; t++) {
        const float *reach = f->means[probe].reach[t];
        moments[t] = (uint32_t)hg_half(reach[0]) | (uint32_t)hg_half(reach[1]) << 16;
    }
}

// Of one table, the words of probes first .. end - 1.
static enum hg_status upload_words(const struct hg_gi_field *f, struct hg_gpu *gpu, size_t table,
    uint32_t texels, const uint32_t range[2], struct hg_error *err)
{
    const size_t first = f->count * table + (size_t)range[0] * texels;
    const uint64_t count = (uint64_t)(range[1] - range[0]) * texels;
    return hg_gpu_buffer_upload(
        gpu, &f->buffer, first * sizeof *f->words, f->words + first, count * sizeof *f->words, err);
}

// A picture in motion updates a few probes that follow each other: packing and copying all of them
// takes longer than what their rays cost.
enum hg_status hg_gi_field_upload(
    struct hg_gi_field *f, struct hg_gpu *gpu, struct hg_jobs *jobs, struct hg_error *err)
{
    static const struct {
        uint32_t before, texels; // words of the tables before it, and its own, of a probe
    } tables[] = {{1, IRRADIANCE_TEXELS}, {1 + IRRADIANCE_TEXELS, MOMENT_TEXELS},
        {1 + IRRADIANCE_TEXELS + MOMENT_TEXELS, 2 * IRRADIANCE_TEXELS},
        {1 + 3 * IRRADIANCE_TEXELS + MOMENT_TEXELS, IRRADIANCE_TEXELS}};
    const uint64_t bytes = (uint64_t)f->count * PROBE_WORDS * sizeof *f->words;
    enum hg_status status =
        hg_gpu_buffer_reserve(gpu, HG_GPU_BUFFER_DEVICE, bytes, "probes", &f->buffer, err);
    if (status != HG_OK)
        return status;
    hg_jobs_for(jobs, f->count, pack_probe, f);
    uint32_t range[2] = {0, f->count};
    status = upload_words(f, gpu, 0, 1, range, err);
    while (range[0] < range[1] && !f->stale[range[0]])
        range[0]++;
    while (range[0] < range[1] && !f->stale[range[1] - 1])
        range[1]--;
    for (size_t i = 0; i < sizeof tables / sizeof *tables && range[0] < range[1]; i++)
        if (status == HG_OK)
            status = upload_words(f, gpu, tables[i].before, tables[i].texels, range, err);
    if (status == HG_OK)
        memset(f->stale, false, f->count * sizeof *f->stale);
    return status;
}
