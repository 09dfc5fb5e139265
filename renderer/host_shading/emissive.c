// emissive.c - see emissive.h.
#include "renderer/host_shading/emissive.h"

#include <math.h>

#include "base/alloc.h"
#include "base/hash.h"
#include "renderer/math/sums.h"
#include "renderer/math/vec.h"

#define CANDIDATES 8u
#define BEFORE     0.999f // of the way to a point, that has to be free
#define GAIN       4.0f // times the density of candidates, that of those that are chosen counts as

// --- triangles -----------------------------------------------------------------------------------

void hg_host_emissive_finish(struct hg_host_emissive *e)
{
    hg_free(e->triangles);
    hg_free(e->sums);
    *e = (struct hg_host_emissive){0};
}

static const struct hg_host_material *material_of(const struct hg_host_surfaces *s, uint32_t piece)
{
    return &s->materials[s->piece_materials[piece]];
}

static void corners_of(
    const struct hg_ray_geometry_piece *p, uint32_t triangle, float corners[3][3])
{
    for (int k = 0; k < 3; k++) {
        const float *v = p->positions + (size_t)p->indices[(size_t)triangle * 3 + (size_t)k] * 3;
        for (int a = 0; a < 3; a++)
            corners[k][a] = p->world[a] * v[0] + p->world[3 + a] * v[1] + p->world[6 + a] * v[2] +
                            p->world[9 + a];
    }
}

// Twice the area, along the normal.
static void cross_of(const float corners[3][3], float out[3])
{
    float a[3], b[3];
    hg_sub3(corners[1], corners[0], a);
    hg_sub3(corners[2], corners[0], b);
    hg_cross3(a, b, out);
}

static bool shines(const struct hg_host_surfaces *s, uint32_t piece)
{
    return s->pieces[piece].positions != NULL && hg_luminance(material_of(s, piece)->emitted) > 0;
}

static enum hg_status add_piece(
    struct hg_host_emissive *e, const struct hg_host_surfaces *s, uint32_t piece, double *sum)
{
    const struct hg_ray_geometry_piece *p = &s->pieces[piece];
    const float luminance = hg_luminance(material_of(s, piece)->emitted);
    const size_t most = (size_t)e->count + p->triangle_count;
    if (hg_grow(&e->triangles, &e->triangle_capacity, most, sizeof *e->triangles) ||
        hg_grow(&e->sums, &e->sum_capacity, most, sizeof *e->sums))
        return HG_E_NOMEM;
    for (uint32_t i = 0; i < p->triangle_count; i++) {
        float corners[3][3], cross[3];
        corners_of(p, i, corners);
        cross_of((const float(*)[3])corners, cross);
        const float power = 0.5f * hg_length3(cross) * luminance;
        if (!(power > 0 && power < INFINITY))
            continue;
        *sum += (double)power;
        e->state = hg_hash_mix_bytes(e->state, corners, sizeof corners);
        e->state = hg_hash_mix_bytes(e->state, &power, sizeof power);
        e->triangles[e->count] = (struct hg_host_emissive_triangle){piece, i};
        e->sums[e->count++] = (float)*sum;
    }
    return HG_OK;
}

enum hg_status hg_host_emissive_sync(
    struct hg_host_emissive *e, const struct hg_host_surfaces *surfaces)
{
    uint64_t triangles = 0;
    double sum = 0;
    if (e->surfaces == surfaces && e->built == surfaces->built && e->pieces == surfaces->pieces)
        return HG_OK;
    e->surfaces = NULL;
    e->count = 0;
    e->state = 0;
    const struct hg_host_surfaces *s = surfaces;
    for (uint32_t i = 0; i < s->piece_count; i++)
        triangles += shines(s, i) ? s->pieces[i].triangle_count : 0;
    for (uint32_t i = 0; i < s->piece_count && triangles <= HG_HOST_MOST_EMISSIVE; i++)
        if (shines(s, i) && add_piece(e, s, i, &sum) != HG_OK) {
            e->count = 0;
            return HG_E_NOMEM;
        }
    e->surfaces = s;
    e->pieces = s->pieces;
    e->built = s->built;
    return HG_OK;
}

// --- points --------------------------------------------------------------------------------------

// A point, and what it brings for the chance that it is a candidate with.
struct candidate {
    float way[3], distance; // to the point: unit, metres
    float weight;           // luminance
    float light[3];         // over the luminance of what it brings
};

// Three numbers in [0, 1).
static void random3(uint64_t seed, uint32_t i, float out[3])
{
    uint64_t bits = hg_hash_mix(seed, i);
    for (int a = 0; a < 3; a++, bits >>= 21)
        out[a] = (float)(bits & 0x1fffff) * 0x1p-21f;
}

// Evenly over a triangle. Source: Pharr, Jakob and Humphreys, "Physically Based Rendering", 4th
// ed., section A.5.1.
static void point_in(const float corners[3][3], const float xi[2], float out[3])
{
    const float root = sqrtf(xi[0]), b = xi[1] * root;
    for (int a = 0; a < 3; a++)
        out[a] = (1 - root) * corners[0][a] + (root - b) * corners[1][a] + b * corners[2][a];
}

// Cosine at the emitter, 0 behind one that has one side.
static float cosine_of(
    const struct hg_host_surfaces *s, uint32_t piece, const float cross[3], const float way[3])
{
    const uint32_t flags = s->pieces[piece].flags;
    const float facing = -hg_dot3(cross, way) / hg_length3(cross);
    const bool both = material_of(s, piece)->double_sided || (flags & HG_DRAW_DOUBLE_SIDED) != 0;
    const float front = (flags & HG_DRAW_MIRRORED) != 0 ? -facing : facing;
    return both ? fabsf(facing) : fmaxf(front, 0);
}

float hg_host_emissive_share(const struct hg_host_emissive *e, const float emitted[3],
    float distance, float cosine, float other)
{
    const float luminance = hg_luminance(emitted);
    if (e->count == 0 || !(luminance > 0) || !(cosine > 0))
        return 0;
    const float density = GAIN * luminance * distance * distance;
    return density / (density + other * e->sums[e->count - 1] * cosine);
}

static bool take_candidate(const struct hg_host_emissive *e,
    const struct hg_host_emissive_receiver *r, uint32_t i, struct candidate *out)
{
    float xi[3], corners[3][3], cross[3], at[3];
    random3(r->seed, i, xi);
    const float all = e->sums[e->count - 1];
    const struct hg_host_emissive_triangle t =
        e->triangles[hg_sums_find(e->sums, e->count, xi[0] * all)];
    corners_of(&e->surfaces->pieces[t.piece], t.triangle, corners);
    cross_of((const float(*)[3])corners, cross);
    point_in((const float(*)[3])corners, xi + 1, at);
    hg_sub3(at, r->position, out->way);
    const float d2 = hg_dot3(out->way, out->way);
    if (!(d2 > 0))
        return false;
    out->distance = sqrtf(d2);
    for (int a = 0; a < 3; a++)
        out->way[a] /= out->distance;
    const float *emitted = material_of(e->surfaces, t.piece)->emitted;
    const float cosine = cosine_of(e->surfaces, t.piece, cross, out->way);
    const float over = r->normal ? fmaxf(hg_dot3(r->normal, out->way), 0) / (float)HG_PI : 1;
    const float share =
        hg_host_emissive_share(e, emitted, out->distance, cosine, r->normal ? over : r->density);
    // The chance per area is the luminance over the sum of all.
    out->weight = cosine / d2 * over * share * all;
    for (int c = 0; c < 3; c++)
        out->light[c] = emitted[c] / hg_luminance(emitted);
    return out->weight > 0 && out->weight < INFINITY;
}

bool hg_host_emissive_choose(const struct hg_host_emissive *e,
    const struct hg_host_emissive_receiver *receiver, struct hg_host_emissive_ray *out)
{
    struct candidate chosen = {0}, next;
    float sum = 0, xi[3];
    random3(receiver->seed, CANDIDATES, xi);
    for (uint32_t i = 0; i < CANDIDATES; i++) {
        if (!take_candidate(e, receiver, i, &next))
            continue;
        // One number serves all choices: it is stretched over what is left of it.
        sum += next.weight;
        const float chance = next.weight / sum;
        const bool takes = xi[0] < chance;
        chosen = takes ? next : chosen;
        xi[0] = takes ? xi[0] / chance : (xi[0] - chance) / fmaxf(1 - chance, 1e-6f);
    }
    if (!(sum > 0))
        return false;
    hg_copy3(chosen.way, out->direction);
    out->distance = BEFORE * chosen.distance;
    for (int c = 0; c < 3; c++)
        out->light[c] = chosen.light[c] * sum / CANDIDATES;
    return true;
}
