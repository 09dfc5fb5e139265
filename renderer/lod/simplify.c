// simplify.c - a group of clusters with half the triangles: edges are collapsed onto one of
// their ends, cheapest first, by quadrics of shape and attributes.
//
// A collapse maps one position to another, so whatever had no border before has none after: seen as
// a chain of oriented triangles, the border of the result is the image of the border, and locked
// positions are their own image. That is why the cuts of the hierarchy cannot crack.
//
// Vertices never move off the lattice and attributes are never blended: a vertex that goes takes
// its triangles to a vertex of the other position, the one on its side of the seam if there is one.
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/lod/simplifier.h"

#define OPEN_WEIGHT 4.0f  // of the planes that hold open edges, against the triangle's
#define SEAM_WEIGHT 0.5f  // of those that hold seams
#define SLIVER      1e-7f // squared sine below which a triangle has no gradients
#define JUMP        2.5f  // an error so many times that of the level below is looked into

// ---- quadrics -----------------------------------------------------------------------------------

// e1, e2: edges from the first corner; normal: their cross product.
static void add_attributes(
    struct hg_lod_simplifier *s, uint32_t t, hg_lod_vec e1, hg_lod_vec e2, hg_lod_vec normal)
{
    const struct hg_lod_patch *p = &s->patch;
    const uint32_t n = p->attribute_count, *v = p->triangles[t];
    const float *a0 = p->attributes + (size_t)v[0] * n, *a1 = p->attributes + (size_t)v[1] * n,
                *a2 = p->attributes + (size_t)v[2] * n;
    const float normal2 = hg_lod_vec_dot(normal, normal), area = 0.5f * sqrtf(normal2);
    const bool sliver = normal2 <= SLIVER * hg_lod_vec_dot(e1, e1) * hg_lod_vec_dot(e2, e2);
    const float inverse = sliver ? 0.0f : 1.0f / normal2;
    const hg_lod_vec along1 = hg_lod_vec_cross(e2, normal) * inverse;
    const hg_lod_vec along2 = hg_lod_vec_cross(normal, e1) * inverse;
    struct hg_lod_quadric q = {0};
    hg_lod_vec gradients[HG_LOD_ATTRIBUTES];
    for (uint32_t k = 0; k < n; k++) {
        const hg_lod_vec g = along1 * (a1[k] - a0[k]) + along2 * (a2[k] - a0[k]);
        hg_lod_quadric_add_plane(&q, g, area);
        gradients[k] = g * area;
    }
    for (int i = 0; i < 3; i++) {
        if (p->fixed[p->places[t][i]])
            continue; // nothing is asked of what cannot move
        struct hg_lod_quadric *to = &s->looks[v[i]];
        hg_lod_vec *slope = &s->gradients[(size_t)v[i] * n];
        to->x += q.x;
        to->y += q.y;
        to->z += q.z;
        s->looks_area[v[i]] += area;
        for (uint32_t k = 0; k < n; k++)
            slope[k] += gradients[k];
    }
}

static void add_triangle(struct hg_lod_simplifier *s, uint32_t t)
{
    const struct hg_lod_patch *p = &s->patch;
    const uint32_t *at = p->places[t];
    if (p->fixed[at[0]] && p->fixed[at[1]] && p->fixed[at[2]])
        return;
    const hg_lod_vec a = hg_lod_vec_at(p, at[0]);
    const hg_lod_vec e1 = hg_lod_vec_at(p, at[1]) - a, e2 = hg_lod_vec_at(p, at[2]) - a;
    const hg_lod_vec normal = hg_lod_vec_cross(e1, e2);
    const float length = sqrtf(hg_lod_vec_dot(normal, normal)), area = 0.5f * length;
    if (!(length > 0.0f))
        return;
    struct hg_lod_quadric q = {0};
    hg_lod_quadric_add_plane(&q, normal / length, area);
    for (int i = 0; i < 3; i++) {
        struct hg_lod_quadric *to = &s->shape[at[i]];
        if (p->fixed[at[i]])
            continue;
        to->x += q.x;
        to->y += q.y;
        to->z += q.z;
        s->area[at[i]] += area;
    }
    if (p->attribute_count > 0)
        add_attributes(s, t, e1, e2, normal);
}

// A plane through the edge from corner 0 to `other` of a triangle, upright on the triangle.
static void add_upright(struct hg_lod_simplifier *s, uint32_t position, const uint32_t v[3],
    uint32_t other, float weight)
{
    const struct hg_lod_patch *p = &s->patch;
    const hg_lod_vec a = hg_lod_vec_at(p, position), edge = hg_lod_vec_at(p, other) - a;
    const hg_lod_vec normal = hg_lod_vec_cross(
        hg_lod_vec_at(p, p->position_of[v[1]]) - a, hg_lod_vec_at(p, p->position_of[v[2]]) - a);
    const hg_lod_vec upright = hg_lod_vec_cross(edge, normal);
    const float length = sqrtf(hg_lod_vec_dot(upright, upright));
    if (length > 0.0f)
        hg_lod_quadric_add_plane(
            &s->shape[position], upright / length, weight * hg_lod_vec_dot(edge, edge));
}

static bool is_seam(const struct hg_lod_patch *p, uint32_t position)
{
    return p->vertex_next[p->vertex_first[position]] != HG_LOD_NONE;
}

// Planes along open edges and seams, so that they keep their shape.
static void add_edges(struct hg_lod_simplifier *s, uint32_t position)
{
    const struct hg_lod_patch *p = &s->patch;
    struct hg_lod_ring r;
    hg_lod_gather(s, position, &r);
    s->plain[position] = r.odd == 0 && r.twisted == 0 && !r.full;
    if (r.odd == 0 && !is_seam(p, position))
        return;
    uint32_t sides[HG_LOD_RING_MAX][2]; // vertex at the neighbour and here, of the first triangle
    memset(sides, 0xff, sizeof sides);
    HG_LOD_FOR_CORNERS(p, position, c)
    {
        uint32_t v[3];
        hg_lod_corner_vertices(p, c, v);
        for (int k = 1; k < 3; k++) {
            const uint32_t other = p->position_of[v[k]];
            uint32_t i = 0;
            while (i < r.count && r.at[i] != other)
                i++;
            if (i == r.count)
                continue;
            if (r.uses[i] != 2)
                add_upright(s, position, v, other, OPEN_WEIGHT);
            else if (sides[i][0] == HG_LOD_NONE)
                memcpy(sides[i], (uint32_t[]){v[k], v[0]}, sizeof sides[i]);
            else if (sides[i][0] != v[k] || sides[i][1] != v[0])
                add_upright(s, position, v, other, SEAM_WEIGHT);
        }
    }
}

static uint32_t vertices_at(const struct hg_lod_patch *p, uint32_t position)
{
    uint32_t n = 0;
    for (uint32_t v = p->vertex_first[position]; v != HG_LOD_NONE; v = p->vertex_next[v])
        n++;
    return n;
}

// Shapes and topology are given up, so nothing is plain any more.
static void run_permissive(struct hg_lod_simplifier *s, uint32_t target)
{
    s->permissive = true;
    memset(s->plain, 0, s->patch.position_count);
    for (uint32_t i = 0; i < s->patch.position_count; i++)
        hg_lod_evaluate(s, i, false);
    hg_lod_collapse(s, target);
}

static enum hg_status take(struct hg_lod_simplifier *s)
{
    const struct hg_lod_patch *p = &s->patch;
    const size_t n = p->position_count, v = p->vertex_count, gradients = v * p->attribute_count;
    const size_t bytes = (n + v) * sizeof *s->shape + (gradients + v) * sizeof *s->gradients +
                         n * sizeof *s->heap + (n * 6 + v) * sizeof(float) + n * 5;
    s->memory = hg_calloc(1, bytes);
    if (s->memory == NULL)
        return HG_E_NOMEM;
    s->shape = s->memory; // aligned to 16 bytes
    s->looks = s->shape + n;
    s->gradients = (hg_lod_vec *)(void *)(s->looks + v);
    s->mean = s->gradients + gradients;
    s->heap = (uint64_t *)(void *)(s->mean + v);
    s->area = (float *)(void *)(s->heap + n);
    s->looks_area = s->area + n;
    s->root = s->looks_area + v;
    s->cost = s->root + n;
    s->target = (uint32_t *)(void *)(s->cost + n);
    s->place = s->target + n;
    s->stamp = s->place + n;
    s->slot = (uint8_t *)(s->stamp + n);
    s->plain = s->slot + n;
    s->rim = s->plain + n;
    s->sure = s->rim + n;
    s->stale = s->sure + n;
    memset(s->place, 0xff, n * sizeof *s->place);
    return HG_OK;
}

static bool has_normals(const struct hg_lod_patch *p)
{
    return p->job->mesh->format.normal >= 0 && p->weight[0] > 0.0f;
}

// Finds what kind of position it is and its first collapse.
static void prepare_position(struct hg_lod_simplifier *s, uint32_t position)
{
    if (!is_seam(&s->patch, position) && hg_lod_choose_if_plain(s, position))
        return;
    add_edges(s, position);
    hg_lod_evaluate(s, position, false);
}

static enum hg_status prepare(struct hg_lod_simplifier *s)
{
    const struct hg_lod_patch *p = &s->patch;
    if (take(s) != HG_OK)
        return HG_E_NOMEM;
    for (uint32_t t = 0; t < p->triangle_count; t++)
        add_triangle(s, t);
    for (uint32_t i = 0; i < p->position_count; i++) {
        if (vertices_at(p, i) >= HG_LOD_RING_MAX)
            s->patch.fixed[i] = 1;
        s->root[i] = sqrtf(s->area[i] + HG_LOD_LEAST_AREA);
        if (!p->fixed[i])
            prepare_position(s, i);
    }
    for (uint32_t v = 0; has_normals(p) && v < p->vertex_count; v++)
        for (int k = 0; k < 3; k++)
            s->mean[v][k] = s->looks_area[v] * p->attributes[(size_t)v * p->attribute_count + k];
    return HG_OK;
}

// What is left stands for what went: a small triangle shades as its surroundings did on the mean.
static enum hg_status turn_normals(struct hg_lod_simplifier *s, struct hg_lod_simplify_job *job)
{
    const struct hg_lod_patch *p = &s->patch;
    job->mean_count = 0;
    if (!has_normals(p))
        return HG_OK;
    job->means = hg_calloc(p->vertex_count, sizeof *job->means);
    if (job->means == NULL)
        return HG_E_NOMEM;
    for (uint32_t v = 0; v < p->vertex_count; v++) {
        const uint32_t position = p->position_of[v];
        const float length = sqrtf(hg_lod_vec_dot(s->mean[v], s->mean[v]));
        if (p->fixed[position] || p->into[position] != position || !(length > 0.0f))
            continue;
        float *normal = p->attributes + (size_t)v * p->attribute_count;
        for (int k = 0; k < 3; k++)
            normal[k] = s->mean[v][k] / length * p->weight[k];
        job->means[job->mean_count++] =
            (struct hg_lod_mean){p->vertex_global[v], hg_lod_normal_word(normal)};
    }
    return HG_OK;
}

// What is left, in the old order; samples name triangles by their new numbers.
static void write_back(const struct hg_lod_patch *p, struct hg_lod_simplify_job *job)
{
    uint32_t n = 0, *number = p->next; // corners are no longer looked for
    for (uint32_t t = 0; t < p->triangle_count; t++) {
        if (p->triangles[t][0] == HG_LOD_NONE)
            continue;
        for (int k = 0; k < 3; k++)
            job->triangles[n * 3 + (uint32_t)k] = p->vertex_global[p->triangles[t][k]];
        number[t] = n++;
    }
    for (uint32_t i = 0; i < job->sample_count; i++)
        if (job->samples[i].triangle != HG_LOD_NONE)
            job->samples[i].triangle = number[job->samples[i].triangle];
    job->triangle_count = n;
}

// Simplifies a fresh patch of the job and measures its samples.
static enum hg_status attempt(
    struct hg_lod_simplifier *s, struct hg_lod_simplify_job *job, bool permissive)
{
    *s = (struct hg_lod_simplifier){0};
    enum hg_status status = hg_lod_patch_init(&s->patch, job);
    if (status == HG_OK)
        status = prepare(s);
    if (status != HG_OK)
        return status;
    if (!permissive)
        hg_lod_collapse(s, job->target_count);
    if (permissive || s->patch.live > job->target_count + job->triangle_count / 8)
        run_permissive(s, job->target_count);
    status = turn_normals(s, job);
    if (status == HG_OK)
        status = hg_lod_measure(&s->patch, &job->error);
    return status;
}

static void close(struct hg_lod_simplifier *s)
{
    hg_free(s->memory);
    hg_lod_patch_finish(&s->patch);
}

static float worst_of(const struct hg_lod_simplify_job *job)
{
    float worst = 0.0f;
    for (uint32_t i = 0; i < job->sample_count; i++)
        worst = fmaxf(worst, job->samples[i].distance);
    return worst;
}

// Scans have handles and tunnels by the hundred. When what is left of a surface is hardly more than
// they need, keeping them costs whole limbs: then the surface is better off without.
static enum hg_status attempt_again(
    struct hg_lod_simplifier *s, struct hg_lod_simplify_job *job, struct hg_lod_sample *samples)
{
    struct hg_lod_simplifier other;
    struct hg_lod_simplify_job loose = *job;
    loose.samples = samples;
    loose.means = NULL;
    const enum hg_status status = attempt(&other, &loose, true);
    const bool better = status == HG_OK && loose.error < job->error;
    if (better) {
        memcpy(job->samples, samples, job->sample_count * sizeof *samples);
        job->error = loose.error;
        job->mean_count = loose.mean_count;
        struct hg_lod_mean *means = job->means;
        job->means = loose.means;
        loose.means = means;
        other.patch.job = job;
        close(s);
        *s = other;
    } else {
        close(&other);
    }
    hg_free(loose.means);
    return status;
}

enum hg_status hg_lod_simplify(struct hg_lod_simplify_job *job)
{
    struct hg_lod_simplifier s = {0};
    const float before = worst_of(job);
    struct hg_lod_sample *samples = hg_calloc(job->sample_count, sizeof *samples);
    enum hg_status status = samples != NULL ? HG_OK : HG_E_NOMEM;
    job->error = 0.0f;
    if (status == HG_OK && job->sample_count > 0)
        memcpy(samples, job->samples, job->sample_count * sizeof *samples);
    if (status == HG_OK)
        status = attempt(&s, job, false);
    if (status == HG_OK && before > 0.0f && job->error > JUMP * before)
        status = attempt_again(&s, job, samples);
    if (status == HG_OK)
        write_back(&s.patch, job);
    close(&s);
    hg_free(samples);
    return status;
}
