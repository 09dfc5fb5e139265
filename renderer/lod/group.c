// group.c - one group: its clusters gathered, simplified and cut again; samples handed on.
#include <float.h>
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/spill.h"
#include "renderer/lod/internal.h"

#define ENOUGH_NUM 17u // a group is worth a level if at most 17/20 of it is left
#define ENOUGH_DEN 20u
#define ROOM       1e-5f // of spheres for rounding, against size and coordinates

void hg_lod_product_unref(struct hg_lod_product *product)
{
    if (product == NULL || --product->users > 0)
        return;
    hg_free(product->triangles);
    hg_free(product->samples);
    hg_free(product);
}

// ---- bounds -------------------------------------------------------------------------------------

// The corners of a piece with every vertex once.
struct corners {
    float at[HG_LOD_CLUSTER_TRIANGLES * 3][3];
    uint16_t of[HG_LOD_CLUSTER_TRIANGLES * 3]; // into `at`
    uint32_t count;
};

static void gather_corners(
    const struct hg_lod_mesh *m, const uint32_t *vertices, uint32_t count, struct corners *out)
{
    uint16_t table[1024] = {0};
    uint32_t names[HG_LOD_CLUSTER_TRIANGLES * 3];
    out->count = 0;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t v = vertices[i];
        uint32_t slot = v * 0x9e3779b1u >> 22;
        while (table[slot] != 0 && names[table[slot] - 1] != v)
            slot = (slot + 1) & 1023;
        if (table[slot] == 0) {
            const int32_t *lattice = m->lattice[m->position_of[v]];
            for (int k = 0; k < 3; k++)
                out->at[out->count][k] = (float)lattice[k] * m->format.quantum;
            names[out->count] = v;
            table[slot] = (uint16_t)++out->count;
        }
        out->of[i] = (uint16_t)(table[slot] - 1);
    }
}

static void set_box(const struct corners *corners, struct hg_lod_cluster *c)
{
    const uint32_t n = corners->count;
    float min[3] = {INFINITY, INFINITY, INFINITY}, max[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (uint32_t i = 0; i < n; i++) {
        for (int k = 0; k < 3; k++) {
            const float v = corners->at[i][k];
            min[k] = v < min[k] ? v : min[k];
            max[k] = v > max[k] ? v : max[k];
        }
    }
    float reach = 0.0f;
    double farthest2 = 0.0;
    for (int k = 0; k < 3; k++) {
        c->center[k] = 0.5f * min[k] + 0.5f * max[k];
        c->extent[k] = fmaxf(max[k] - c->center[k], c->center[k] - min[k]);
        reach = fmaxf(reach, fmaxf(fabsf(min[k]), fabsf(max[k])));
    }
    for (uint32_t i = 0; i < n; i++) {
        double d2 = 0.0;
        for (int k = 0; k < 3; k++) {
            const double d = (double)corners->at[i][k] - (double)c->center[k];
            d2 += d * d;
        }
        farthest2 = d2 > farthest2 ? d2 : farthest2;
    }
    c->radius = (float)sqrt(farthest2) * (1.0f + ROOM) + reach * 1e-7f;
}

static bool unit_normal(const struct corners *corners, uint32_t triangle, float n[3])
{
    const uint16_t *t = corners->of + (size_t)triangle * 3;
    const float *a = corners->at[t[0]];
    double e[2][3], c[3];
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 3; k++)
            e[i][k] = (double)corners->at[t[i + 1]][k] - (double)a[k];
    c[0] = e[0][1] * e[1][2] - e[0][2] * e[1][1];
    c[1] = e[0][2] * e[1][0] - e[0][0] * e[1][2];
    c[2] = e[0][0] * e[1][1] - e[0][1] * e[1][0];
    const double length = sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]);
    const double inverse = length > 0.0 ? 1.0 / length : 0.0;
    for (int k = 0; k < 3; k++)
        n[k] = (float)(c[k] * inverse);
    return length > 0.0;
}

void hg_lod_cone_axis(const int8_t q[3], float axis[3])
{
    for (int k = 0; k < 3; k++)
        axis[k] = (float)q[k] / 127.0f;
}

static float least_cosine(const float (*normals)[3], uint32_t count, const float a[3])
{
    const float length = sqrtf(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
    if (!(length > 0.0f))
        return 1.0f;
    float least = length;
    for (uint32_t t = 0; t < count; t++) {
        const float along = normals[t][0] * a[0] + normals[t][1] * a[1] + normals[t][2] * a[2];
        least = along < least ? along : least;
    }
    return least / length;
}

// All normals lie within acos(least) of the axis; a cone wider than a half space culls nothing.
// Axis and cutoff are what one byte each can say, rounded to the safe side: the axis gets shorter.
static void set_cone(const struct corners *corners, struct hg_lod_cluster *c)
{
    float sum[3] = {0}, normals[HG_LOD_CLUSTER_TRIANGLES][3];
    uint32_t n = 0;
    for (uint32_t t = 0; t < c->triangle_count; t++) {
        if (!unit_normal(corners, t, normals[n]))
            continue;
        for (int k = 0; k < 3; k++)
            sum[k] += normals[n][k];
        n++;
    }
    const float length = sqrtf(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]);
    int8_t q[3] = {0};
    for (int k = 0; k < 3; k++)
        q[k] = (int8_t)(length > 0.0f ? sum[k] / length * 127.0f : 0.0f);
    hg_lod_cone_axis(q, c->cone_axis);
    const float least = least_cosine((const float(*)[3])normals, n, c->cone_axis);
    const float cutoff = length > 0.0f && least > 0.05f
                             ? fminf(1.0f, sqrtf(fmaxf(0.0f, 1.0f - least * least)) + 1e-3f)
                             : 1.0f;
    c->cone_cutoff = ceilf(cutoff * 255.0f) / 255.0f;
}

// Bounds, cone and vertex count of the triangles of a piece.
static void bound_piece(const struct hg_lod_mesh *mesh, struct hg_lod_piece *piece)
{
    struct corners corners;
    gather_corners(mesh, piece->triangles, piece->info.triangle_count * 3, &corners);
    set_box(&corners, &piece->info);
    set_cone(&corners, &piece->info);
    piece->vertex_count = corners.count;
}

struct hg_lod_sphere hg_lod_sphere_around(const struct hg_lod_sphere *spheres, uint32_t count)
{
    struct hg_lod_sphere s = {{0}, 0};
    double reach = 0.0, radius = 0.0;
    for (int k = 0; k < 3; k++) {
        float min = INFINITY, max = -INFINITY;
        for (uint32_t i = 0; i < count; i++) {
            min = fminf(min, spheres[i].center[k] - spheres[i].radius);
            max = fmaxf(max, spheres[i].center[k] + spheres[i].radius);
        }
        s.center[k] = count > 0 ? 0.5f * min + 0.5f * max : 0.0f;
        reach = fmax(reach, fabs((double)s.center[k]));
    }
    for (uint32_t i = 0; i < count; i++) {
        double d2 = 0.0;
        for (int k = 0; k < 3; k++) {
            const double d = (double)spheres[i].center[k] - (double)s.center[k];
            d2 += d * d;
        }
        radius = fmax(radius, sqrt(d2) + (double)spheres[i].radius);
    }
    s.radius = (float)(radius * (1.0 + (double)ROOM) + reach * 1e-6);
    return s;
}

// ---- samples ------------------------------------------------------------------------------------

static bool farther(const struct hg_lod_sample *x, const struct hg_lod_sample *y)
{
    return x->distance > y->distance || (x->distance == y->distance && x->vertex < y->vertex);
}

// Moves the `nth` farthest to the front (Hoare 1961, "Algorithm 65: find").
static void select_farthest(struct hg_lod_sample *samples, uint32_t count, uint32_t nth)
{
    int64_t low = 0, high = (int64_t)count - 1;
    while (low < high) {
        const struct hg_lod_sample pivot = samples[low + (high - low) / 2];
        int64_t i = low, j = high;
        while (i <= j) {
            while (farther(&samples[i], &pivot))
                i++;
            while (farther(&pivot, &samples[j]))
                j--;
            if (i > j)
                break;
            const struct hg_lod_sample t = samples[i];
            samples[i++] = samples[j];
            samples[j--] = t;
        }
        if (j < (int64_t)nth)
            low = i;
        if ((int64_t)nth < i)
            high = j;
    }
}

// Keeps the farthest half of what may stay, and of the others every n-th.
static uint32_t thin(struct hg_lod_sample *samples, uint32_t count, uint32_t most)
{
    if (count <= most)
        return count;
    const uint32_t top = most / 2, rest = count - top;
    select_farthest(samples, count, top);
    for (uint32_t i = 0; i < most - top; i++)
        samples[top + i] = samples[top + (uint64_t)i * rest / (most - top)];
    return most;
}

// Hands every sample to the piece that has the triangle it is nearest to. piece_of [triangles as
// they were numbered before the cut].
static enum hg_status hand_out(struct hg_lod_group_job *job, const struct hg_lod_sample *samples,
    uint32_t count, const uint32_t *piece_of)
{
    struct hg_lod_sample *sorted = hg_calloc(count, sizeof *sorted);
    uint32_t *starts = hg_calloc((size_t)job->made_count + 2, sizeof *starts), out = 0;
    if (sorted == NULL || starts == NULL) {
        hg_free(sorted);
        hg_free(starts);
        return HG_E_NOMEM;
    }
    for (uint32_t i = 0; i < count; i++)
        if (samples[i].triangle != HG_LOD_NONE)
            starts[piece_of[samples[i].triangle] + 2]++;
    for (uint32_t i = 0; i < job->made_count; i++)
        starts[i + 2] += starts[i + 1];
    for (uint32_t i = 0; i < count; i++)
        if (samples[i].triangle != HG_LOD_NONE)
            sorted[starts[piece_of[samples[i].triangle] + 1]++] = samples[i];
    for (uint32_t piece = 0; piece < job->made_count; piece++) {
        const uint32_t first = starts[piece];
        const uint32_t n = thin(sorted + first, starts[piece + 1] - first, job->samples_per_piece);
        memmove(sorted + out, sorted + first, n * sizeof *sorted);
        job->made[piece].samples = sorted + out;
        job->made[piece].sample_count = n;
        out += n;
    }
    hg_free(starts);
    job->product->samples = sorted;
    job->product->sample_count = out;
    return HG_OK;
}

// ---- the group ----------------------------------------------------------------------------------

static enum hg_status gather(struct hg_lod_group_job *job, struct hg_lod_simplify_job *s)
{
    uint32_t triangles = 0, samples = 0;
    for (uint32_t i = 0; i < job->member_count; i++) {
        triangles += job->pieces[job->members[i]].info.triangle_count;
        samples += job->pieces[job->members[i]].sample_count;
    }
    job->triangle_count = triangles;
    s->triangles = hg_calloc(triangles, 12);
    s->samples = hg_calloc(samples, sizeof *s->samples);
    if (s->triangles == NULL || s->samples == NULL)
        return HG_E_NOMEM;
    for (uint32_t i = 0; i < job->member_count; i++) {
        const struct hg_lod_piece *piece = &job->pieces[job->members[i]];
        memcpy(s->triangles + (size_t)s->triangle_count * 3, piece->triangles,
            (size_t)piece->info.triangle_count * 12);
        if (piece->sample_count > 0)
            memcpy(s->samples + s->sample_count, piece->samples,
                piece->sample_count * sizeof *s->samples);
        s->triangle_count += piece->info.triangle_count;
        s->sample_count += piece->sample_count;
    }
    return HG_OK;
}

// to: scratch for the cut of the product's triangles.
static enum hg_status cut(struct hg_lod_group_job *job, struct hg_lod_cut *to, uint32_t *piece_of)
{
    struct hg_lod_product *p = job->product;
    const uint32_t *starts = to->starts;
    enum hg_status status = hg_lod_cut(job->mesh, p->triangles, p->triangle_count, to, NULL);
    job->made_count = to->count;
    job->made = status == HG_OK ? hg_calloc(job->made_count, sizeof *job->made) : NULL;
    if (status == HG_OK && job->made == NULL)
        status = HG_E_NOMEM;
    for (uint32_t i = 0; status == HG_OK && i < job->made_count; i++) {
        struct hg_lod_piece *piece = &job->made[i];
        piece->triangles = p->triangles + (size_t)starts[i] * 3;
        piece->info.triangle_count = starts[i + 1] - starts[i];
        piece->product = p;
        bound_piece(job->mesh, piece);
        for (uint32_t t = starts[i]; t < starts[i + 1]; t++)
            piece_of[to->order[t]] = i;
    }
    p->users = job->made_count;
    return status;
}

static enum hg_status make_product(struct hg_lod_group_job *job, struct hg_lod_simplify_job *s)
{
    const uint32_t n = s->triangle_count, bound = hg_lod_cut_bound(n) + 1;
    job->error = s->error;
    job->product = hg_calloc(1, sizeof *job->product);
    uint32_t *scratch = hg_calloc((size_t)n * 2 + bound, sizeof *scratch);
    uint32_t *small = hg_realloc(s->triangles, n, 12);
    enum hg_status status = HG_E_NOMEM;
    if (small != NULL)
        s->triangles = small;
    if (job->product != NULL && scratch != NULL && small != NULL) {
        s->triangles = NULL;
        job->product->triangles = small;
        job->product->triangle_count = n;
        struct hg_lod_cut pieces = {.starts = scratch + (size_t)n * 2, .order = scratch};
        status = cut(job, &pieces, scratch + n);
        if (status == HG_OK)
            status = hand_out(job, s->samples, s->sample_count, scratch + n);
    }
    hg_free(scratch);
    return status;
}

void hg_lod_group_run(struct hg_lod_group_job *job)
{
    struct hg_lod_simplify_job s = {
        .mesh = job->mesh, .locked = job->locked, .open = job->open, .weights = job->weights};
    enum hg_status status = gather(job, &s);
    s.target_count = job->triangle_count / 2;
    if (status == HG_OK)
        status = hg_lod_simplify(&s);
    const bool enough =
        (uint64_t)s.triangle_count * ENOUGH_DEN <= (uint64_t)job->triangle_count * ENOUGH_NUM;
    if (status == HG_OK && enough && s.triangle_count > 0)
        status = make_product(job, &s);
    if (job->product != NULL && s.mean_count > 0) {
        struct hg_lod_mean *small = hg_realloc(s.means, s.mean_count, sizeof *small);
        job->means = small != NULL ? small : s.means;
        job->mean_count = s.mean_count;
        s.means = NULL;
    }
    hg_free(s.means);
    if (status != HG_OK && job->product != NULL) {
        job->product->users = 1;
        hg_lod_product_unref(job->product);
        job->product = NULL;
    }
    hg_free(s.triangles);
    hg_free(s.samples);
    job->status = status;
}

// ---- the welded mesh ----------------------------------------------------------------------------

static void sample_piece(const struct hg_lod_mesh *m, const uint8_t *open, const uint8_t *crowd,
    uint8_t *seen, struct hg_lod_piece *piece, struct hg_lod_product *product)
{
    piece->samples = product->samples + product->sample_count;
    for (uint32_t i = 0; i < piece->info.triangle_count * 3; i++) {
        const uint32_t v = piece->triangles[i], p = m->position_of[v];
        if (seen[p])
            continue;
        seen[p] = 1;
        struct hg_lod_sample *s = &product->samples[product->sample_count++];
        s->vertex = v;
        s->anchor = p & 0x3fffffffu;
        s->flags = (open[p] ? HG_LOD_SAMPLE_OPEN : 0u) | (crowd[p] ? HG_LOD_SAMPLE_SEAM : 0u);
        piece->sample_count++;
    }
}

enum hg_status hg_lod_first_samples(
    const struct hg_lod_mesh *m, const uint8_t *open, struct hg_lod_pieces *pieces)
{
    struct hg_lod_product *product = pieces->items[0].product;
    uint8_t *seen = hg_spill_scratch(m->position_count, 1);
    uint8_t *crowd = hg_spill_scratch(m->position_count, 1);
    product->samples = hg_spill_scratch(m->position_count, sizeof *product->samples);
    if (seen == NULL || crowd == NULL || product->samples == NULL) {
        hg_free(seen);
        hg_free(crowd);
        return HG_E_NOMEM;
    }
    for (uint32_t v = 0; v < m->vertex_count; v++) {
        const uint32_t p = m->position_of[v];
        crowd[p] = seen[p];
        seen[p] = 1;
    }
    memset(seen, 0, m->position_count);
    for (uint32_t i = 0; i < pieces->count; i++)
        sample_piece(m, open, crowd, seen, &pieces->items[i], product);
    hg_free(seen);
    hg_free(crowd);
    return HG_OK;
}

enum hg_status hg_lod_first_pieces(const struct hg_lod_mesh *m, const uint32_t *starts,
    uint32_t count, struct hg_lod_pieces *pieces)
{
    struct hg_lod_product *product = hg_calloc(1, sizeof *product);
    if (product == NULL ||
        hg_grow(&pieces->items, &pieces->capacity, count, sizeof *pieces->items) != HG_OK) {
        hg_free(product);
        return HG_E_NOMEM;
    }
    product->triangle_count = m->triangle_count;
    product->users = count;
    for (uint32_t i = 0; i < count; i++) {
        struct hg_lod_piece *piece = &pieces->items[pieces->count++];
        memset(piece, 0, sizeof *piece);
        piece->triangles = m->triangles + (size_t)starts[i] * 3;
        piece->info.triangle_count = starts[i + 1] - starts[i];
        piece->info.made_from = HG_LOD_NONE;
        piece->product = product;
        bound_piece(m, piece);
    }
    return HG_OK;
}
