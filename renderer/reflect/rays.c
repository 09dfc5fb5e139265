// rays.c - see rays.h.
#include "renderer/reflect/rays.h"

#include <float.h>

#include "base/hash.h"
#include "renderer/host_shading/texels.h"
#include "renderer/math/sequence.h"

#define LIFT 2e-3f // of the depth, that rays begin off surfaces: levels of detail differ
#define FAR  1e4f  // metres; where a ray that meets nothing counts as having ended

// --- surfaces ------------------------------------------------------------------------------------

// What probe light says of a texel's surface; false: it is left to others.
static bool read_texel(const struct hg_reflect_work *w, const uint32_t at[2],
    struct hg_host_texel_mirror *m, struct hg_reflect_texel *out)
{
    const size_t texel = (size_t)at[1] * w->r->image.columns + at[0];
    const struct hg_host_texels texels = {w->p->camera, w->p->width, w->p->height};
    memcpy(&out->depth, &w->p->light[4 * texel + 3], sizeof out->depth);
    hg_host_texel_mirror(w->p->mirrors + 2 * texel, m);
    out->sends = false;
    out->mirrors = out->depth > 0 && (w->p->dense || m->roughness < HG_LOBE_ROUGH);
    if (!out->mirrors)
        return false;
    out->roughness = m->roughness;
    out->f0 = m->f0;
    out->length = 0;
    hg_host_texel_place(&texels, at, out->depth, out->position, out->view);
    hg_host_texel_mirror_normal(m, out->view, out->normal);
    return true;
}

// Pictures in which a texel sends once, as a power of two.
static int turns_log2(const struct hg_reflect_work *w)
{
    return w->p->share == 0 || w->p->share > 0.7f ? 0 : w->p->share > 0.35f ? 1 : 2;
}

// --- rays ----------------------------------------------------------------------------------------

// The reflected ray of a texel, above the plane of its triangle. Its own points are evenly spread.
static void send(
    const struct hg_reflect_work *w, size_t i, const struct hg_host_texel_mirror *m, int turns)
{
    struct hg_reflect_texel *t = &w->r->texels[i];
    const uint64_t bits = hg_hash_mix(0x7265666cu, i);
    const float turn[2] = {
        (float)(bits >> 40) * 0x1p-24f, (float)(bits >> 16 & 0xffffff) * 0x1p-24f};
    const float *point = w->xi[turns];
    float xi[2], from[3];
    for (int a = 0; a < 2; a++) { // Cranley-Patterson rotation
        xi[a] = point[a] + turn[a];
        xi[a] -= floorf(xi[a]);
    }
    struct hg_lobe_sample s = hg_lobe_take(t->roughness, t->f0, t->normal, t->view, xi);
    const float below = hg_dot3(s.direction, m->facet);
    if (below < 0) // interpolated normals and normal maps bend rays into the surface
        hg_mad3(s.direction, m->facet, -2 * below, s.direction);
    hg_mad3(t->position, m->facet, LIFT * t->depth, from);
    ((struct hg_gpu_ray *)w->r->rays.mapped)[i] =
        (struct hg_gpu_ray){.origin_ws = {from[0], from[1], from[2]},
            .direction_ws = {s.direction[0], s.direction[1], s.direction[2]},
            .t_max = s.weight > 0 ? FLT_MAX : -1,
            .mask = HG_RAY_OPAQUE | HG_RAY_MASK};
    w->r->samples[i] = s;
    hg_copy3(from, t->position);
    t->sends = true;
}

static void begin_row(void *user, size_t y)
{
    const struct hg_reflect_work *w = user;
    struct hg_reflect *r = w->r;
    const int turns = turns_log2(w);
    const uint32_t columns = r->image.columns, mask = (1u << turns) - 1;
    uint32_t *list = (uint32_t *)r->list.mapped + y * columns, count = 0;
    r->smooth[y] = 0;
    for (uint32_t x = 0; x < columns; x++) {
        const uint32_t at[2] = {x, (uint32_t)y};
        const size_t i = y * columns + x;
        struct hg_reflect_texel *t = &r->texels[i];
        struct hg_host_texel_mirror m;
        const bool mirrors = read_texel(w, at, &m, t);
        r->sources[i] = t->depth > 0 ? HG_REFLECT_ROUGH : HG_REFLECT_NOTHING;
        r->smooth[y] += mirrors;
        if (!mirrors || (hg_dither_rank(x, (uint32_t)y, 2) & mask) != (r->number & mask))
            continue;
        send(w, i, &m, turns);
        list[count++] = (uint32_t)i;
    }
    r->row_counts[y] = count;
}

// Rays of all rows one after the other.
static uint32_t compact(struct hg_reflect *r)
{
    uint32_t *list = r->list.mapped, count = 0;
    for (uint32_t y = 0; y < r->image.rows; y++) {
        memmove(list + count, list + (size_t)y * r->image.columns, r->row_counts[y] * sizeof *list);
        count += r->row_counts[y];
    }
    return count;
}

// Where a smooth texel sent no ray a neighbour's tells how far things are.
static void lend_row(void *user, size_t y)
{
    struct hg_reflect *r = user;
    const struct hg_reflect_image *image = &r->image;
    for (uint32_t x = 0; x < image->columns && image->counts[y] > 0; x++) {
        struct hg_reflect_texel *t = &r->texels[y * image->columns + x];
        if (!t->mirrors || t->sends)
            continue;
        for (uint32_t k = 0; k < 4; k++) {
            const uint32_t qx = (x & ~1u) + (k & 1), qy = ((uint32_t)y & ~1u) + (k >> 1);
            if (qx >= image->columns || qy >= image->rows)
                continue;
            const struct hg_reflect_texel *q = &r->texels[(size_t)qy * image->columns + qx];
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
        r->texels[i].length = met ? hits[i].t : FAR;
    }
}

enum hg_status hg_reflect_cast(struct hg_reflect_work *w, struct hg_error *err)
{
    struct hg_reflect *r = w->r;
    const uint32_t samples = w->p->samples > 0 ? w->p->samples : 1;
    for (int k = 0; k < HG_REFLECT_PERIODS; k++) {
        const uint32_t number = (r->number >> k) * samples + w->sample;
        w->xi[k][0] = hg_radical_inverse(number, 2);
        w->xi[k][1] = hg_radical_inverse(number, 3);
    }
    hg_jobs_for(r->jobs, r->image.rows, begin_row, w);
    r->ray_count = compact(r);
    const struct hg_trace_wave wave = {
        .rays = &r->rays, .hits = &r->hits, .list = &r->list, .count = r->ray_count};
    uint32_t more;
    const enum hg_status status =
        wave.count > 0 ? hg_host_cast(w->p->world.caster, &wave, &more, err) : HG_OK;
    if (status != HG_OK)
        return status;
    measure_lengths(r);
    hg_jobs_for(r->jobs, r->image.rows, lend_row, r);
    return HG_OK;
}
