// rays.c - see rays.h.
#include "renderer/reflect/rays.h"

#include <float.h>

#include "base/hash.h"
#include "renderer/gi/texels.h"
#include "renderer/math/sequence.h"

#define ROUGH       0.45f // roughness from which blocks mirror for their texels
#define BLOCK_TURNS 4u    // pictures in which each block sends once,
#define BRIGHT      0.25f // but metals, from this reflectance on, in each
#define LIFT        2e-3f // of the depth, that rays begin off surfaces: levels of detail differ
#define FAR         1e4f  // metres; where a ray that meets nothing counts as having ended

// --- surfaces ------------------------------------------------------------------------------------

// What probe light says of a texel's surface.
static void read_texel(const struct hg_reflect_work *w, size_t texel, struct hg_reflect_texel *out)
{
    const uint32_t *light = w->p->light + 4 * texel, *mirror = w->p->mirrors + 2 * texel;
    memcpy(&out->depth, &light[3], sizeof out->depth);
    struct hg_gi_texel_mirror m;
    hg_gi_texel_mirror(mirror, &m);
    out->roughness = m.roughness;
    out->f0 = m.f0;
    out->mirrors = out->depth > 0;
}

static bool is_rough(const struct hg_reflect_work *w, const struct hg_reflect_texel *texel)
{
    return texel->mirrors && !w->p->dense && texel->roughness >= ROUGH;
}

// Normals at which the mirrored view leads behind the triangle are bent, as those of paths and of
// settled pictures are (hg_valid_normal of shaders/lib/shading_normal.glsl).
static void bend(const float facet[3], const float view[3], float normal[3])
{
    float along[3], half_way[3];
    const float twice = 2 * hg_dot3(normal, view);
    for (int a = 0; a < 3; a++)
        along[a] = twice * normal[a] - view[a];
    const float height = hg_dot3(along, facet);
    const float least = fminf(0.9f * hg_dot3(view, facet), 0.01f);
    if (height >= least)
        return;
    hg_mad3(along, facet, -height, along);
    const float scale = sqrtf((1 - least * least) / fmaxf(hg_dot3(along, along), 1e-12f));
    hg_mad3(view, along, scale, half_way);
    hg_mad3(half_way, facet, least, normal);
    hg_normalize3(normal);
}

void hg_reflect_place(
    const struct hg_reflect_work *w, uint32_t x, uint32_t y, struct hg_reflect_texel *t)
{
    const size_t texel = (size_t)y * w->r->levels[HG_REFLECT_TEXELS].image.columns + x;
    const struct hg_gi_texels texels = {w->p->camera, w->p->width, w->p->height};
    const uint32_t at[2] = {x, y};
    struct hg_gi_texel_mirror m;
    hg_gi_texel_mirror(w->p->mirrors + 2 * texel, &m);
    hg_copy3(m.normal, t->normal);
    hg_gi_texel_place(&texels, at, t->depth, t->position, t->view);
    const float facing = hg_dot3(t->normal, t->view);
    if (facing < 0.02f) { // normal maps turn some surfaces away from the eye
        hg_mad3(t->normal, t->view, 0.02f - facing, t->normal);
        hg_normalize3(t->normal);
    }
    bend(m.facet, t->view, t->normal);
}

// --- turns ---------------------------------------------------------------------------------------

static uint32_t turns_of(
    const struct hg_reflect_work *w, const struct hg_reflect_texel *t, int level)
{
    const uint32_t share = w->p->share == 0 || w->p->share > 0.7f ? 1 : w->p->share > 0.35f ? 2 : 4;
    const bool seldom = level == HG_REFLECT_BLOCKS && t->f0 < BRIGHT;
    return share * (seldom ? BLOCK_TURNS : 1);
}

static int log2_of(uint32_t turns)
{
    int log2 = 0;
    for (; turns > 1; turns /= 2)
        log2++;
    return log2;
}

// --- rays ----------------------------------------------------------------------------------------

// The reflected ray of a texel, above the plane of its triangle. turns: pictures since its last
// one, so that its own points are evenly spread.
static void send(const struct hg_reflect_work *w, size_t i, const uint32_t *mirror, uint32_t turns)
{
    struct hg_reflect_texel *t = hg_reflect_texel_at(w->r, i);
    const uint64_t bits = hg_hash_mix(0x7265666cu, i);
    const float turn[2] = {
        (float)(bits >> 40) * 0x1p-24f, (float)(bits >> 16 & 0xffffff) * 0x1p-24f};
    const float *point = w->xi[log2_of(turns)];
    struct hg_gi_texel_mirror m;
    float xi[2], from[3];
    for (int a = 0; a < 2; a++) { // Cranley-Patterson rotation
        xi[a] = point[a] + turn[a];
        xi[a] -= floorf(xi[a]);
    }
    hg_gi_texel_mirror(mirror, &m);
    struct hg_lobe_sample s = hg_lobe_take(t->roughness, t->f0, t->normal, t->view, xi);
    const float below = hg_dot3(s.direction, m.facet);
    if (below < 0) // interpolated normals and normal maps bend rays into the surface
        hg_mad3(s.direction, m.facet, -2 * below, s.direction);
    hg_mad3(t->position, m.facet, LIFT * t->depth, from);
    ((struct hg_gpu_ray *)w->r->rays.mapped)[i] =
        (struct hg_gpu_ray){.origin_ws = {from[0], from[1], from[2]},
            .direction_ws = {s.direction[0], s.direction[1], s.direction[2]},
            .t_max = s.weight > 0 ? FLT_MAX : -1,
            .mask = HG_RAY_OPAQUE | HG_RAY_MASK};
    w->r->samples[i] = s;
    hg_copy3(from, t->position);
}

// A texel of `level` whose surface was read from (x, y) of probe light. True: it sends a ray.
static bool begin_texel(const struct hg_reflect_work *w, int level, size_t i, const uint32_t at[2])
{
    const struct hg_reflect *r = w->r;
    const struct hg_reflect_level *l = &r->levels[level];
    struct hg_reflect_texel *t = &l->texels[i];
    const uint32_t x = (uint32_t)(i % l->image.columns), y = (uint32_t)(i / l->image.columns);
    const uint32_t turns = turns_of(w, t, level);
    const size_t texel = (size_t)at[1] * r->levels[HG_REFLECT_TEXELS].image.columns + at[0];
    hg_reflect_place(w, at[0], at[1], t);
    t->length = 0;
    t->sends = hg_dither_rank(x, y, 2) % turns == w->r->number % turns;
    if (t->sends)
        send(w, l->first + i, w->p->mirrors + 2 * texel, turns);
    return t->sends;
}

// Texels of a block that are smooth, and one of the others for all of these.
static uint32_t begin_block(
    const struct hg_reflect_work *w, uint32_t bx, uint32_t by, uint32_t *list)
{
    struct hg_reflect *r = w->r;
    const struct hg_reflect_level *texels = &r->levels[HG_REFLECT_TEXELS];
    const struct hg_reflect_level *blocks = &r->levels[HG_REFLECT_BLOCKS];
    const size_t block = (size_t)by * blocks->image.columns + bx;
    struct hg_reflect_texel *b = &blocks->texels[block];
    uint32_t count = 0, stands[2] = {0}, soonest = 4;
    b->mirrors = b->sends = false;
    for (uint32_t k = 0; k < 4; k++) {
        const uint32_t at[2] = {2 * bx + (k & 1), 2 * by + (k >> 1)};
        if (at[0] >= texels->image.columns || at[1] >= texels->image.rows)
            continue;
        const size_t i = (size_t)at[1] * texels->image.columns + at[0];
        struct hg_reflect_texel *t = &texels->texels[i];
        read_texel(w, i, t);
        r->sources[i] = t->mirrors ? HG_REFLECT_ROUGH : HG_REFLECT_NOTHING;
        t->sends = false;
        if (!t->mirrors)
            continue;
        if (!is_rough(w, t)) {
            r->smooth[at[1]]++;
            if (begin_texel(w, HG_REFLECT_TEXELS, i, at))
                list[count++] = (uint32_t)i;
            continue;
        }
        const uint32_t turn =
            (hg_dither_rank(k & 1, k >> 1, 1) - r->number / turns_of(w, t, HG_REFLECT_BLOCKS)) & 3;
        if (turn < soonest) {
            soonest = turn;
            *b = *t;
            memcpy(stands, at, sizeof stands);
        }
        t->mirrors = false;
    }
    if (b->mirrors) {
        r->chosen[block] = stands[1] * texels->image.columns + stands[0];
        if (begin_texel(w, HG_REFLECT_BLOCKS, block, stands))
            list[count++] = (uint32_t)(blocks->first + block);
    }
    return count;
}

static void begin_row(void *user, size_t by)
{
    const struct hg_reflect_work *w = user;
    struct hg_reflect *r = w->r;
    const uint32_t columns = r->levels[HG_REFLECT_BLOCKS].image.columns;
    uint32_t *list = (uint32_t *)r->list.mapped + 5 * by * columns, count = 0;
    r->smooth[2 * by] = 0;
    if (2 * by + 1 < r->levels[HG_REFLECT_TEXELS].image.rows)
        r->smooth[2 * by + 1] = 0;
    for (uint32_t bx = 0; bx < columns; bx++)
        count += begin_block(w, bx, (uint32_t)by, list + count);
    r->row_counts[by] = count;
}

// Rays of all rows one after the other.
static uint32_t compact(struct hg_reflect *r)
{
    const struct hg_reflect_image *blocks = &r->levels[HG_REFLECT_BLOCKS].image;
    uint32_t *list = r->list.mapped, count = 0;
    for (uint32_t y = 0; y < blocks->rows; y++) {
        memmove(
            list + count, list + (size_t)5 * y * blocks->columns, r->row_counts[y] * sizeof *list);
        count += r->row_counts[y];
    }
    return count;
}

// Where a smooth texel sent no ray a neighbour's tells how far things are.
static void lend_row(void *user, size_t y)
{
    const struct hg_reflect_level *l = user;
    for (uint32_t x = 0; x < l->image.columns && l->image.counts[y] > 0; x++) {
        struct hg_reflect_texel *t = &l->texels[y * l->image.columns + x];
        if (!t->mirrors || t->sends)
            continue;
        for (uint32_t k = 0; k < 4; k++) {
            const uint32_t qx = (x & ~1u) + (k & 1), qy = ((uint32_t)y & ~1u) + (k >> 1);
            if (qx >= l->image.columns || qy >= l->image.rows)
                continue;
            const struct hg_reflect_texel *q = &l->texels[(size_t)qy * l->image.columns + qx];
            if (q->sends && hg_dot3(q->normal, t->normal) > 0.8f)
                t->length = q->length;
        }
    }
}

static void measure_lengths(struct hg_reflect *r)
{
    const struct hg_gpu_hit *hits = r->hits.mapped;
    const uint32_t *list = r->list.mapped;
    for (uint32_t k = 0; k < r->ray_count; k++) {
        const uint32_t i = list[k];
        const bool met = hits[i].draw != HG_HIT_NONE && r->samples[i].weight > 0;
        hg_reflect_texel_at(r, i)->length = met ? hits[i].t : FAR;
    }
}

enum hg_status hg_reflect_cast(struct hg_reflect_work *w, struct hg_error *err)
{
    struct hg_reflect *r = w->r;
    struct hg_reflect_level *texels = &r->levels[HG_REFLECT_TEXELS];
    const uint32_t samples = w->p->samples > 0 ? w->p->samples : 1;
    for (int k = 0; k < HG_REFLECT_PERIODS; k++) {
        const uint32_t number = (r->number >> k) * samples + w->sample;
        w->xi[k][0] = hg_radical_inverse(number, 2);
        w->xi[k][1] = hg_radical_inverse(number, 3);
    }
    hg_jobs_for(r->jobs, r->levels[HG_REFLECT_BLOCKS].image.rows, begin_row, w);
    r->ray_count = compact(r);
    const struct hg_trace_wave wave = {
        .rays = &r->rays, .hits = &r->hits, .list = &r->list, .count = r->ray_count};
    const enum hg_status status =
        wave.count > 0 ? hg_trace_closest(w->p->world.trace, &wave, err) : HG_OK;
    if (status != HG_OK)
        return status;
    measure_lengths(r);
    hg_jobs_for(r->jobs, texels->image.rows, lend_row, texels);
    return HG_OK;
}
