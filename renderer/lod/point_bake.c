// point_bake.c - a cloud of points to the bytes of its hierarchy: levels of ever fewer and larger
// discs, in the groups, chunks and file of mesh hierarchies.
//
// Groups are nodes of the k-d tree. Four neighbours of a group become one disc that covers theirs,
// so a closed surface stays closed on all levels; four groups become one of the next level. The
// error of a group is how far its points were moved by all levels: the root mean square of each.
//
// Source: Rusinkiewicz and Levoy 2000, "QSplat: a multiresolution point rendering system for large
// meshes" (spheres that contain those below, mean normals and colours); Gobbetti and Marton 2004,
// "Layered point clouds" (blocks of points as units of streaming).
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/spill.h"
#include "renderer/lod/build.h"
#include "renderer/lod/discs.h"
#include "renderer/lod/vertex_pack.h"

#define GROUP_POINTS  128u // at most; more than half of them
#define MERGED        4u   // points that become one
#define UPPER_SIDES   4u   // of discs that stand for several: they are drawn about a pixel wide
#define CHUNKS_MAX    (1u << (32 - HG_LOD_SHIFT))
#define RADIUS_STEPS  32.0f // lattice steps of a median radius, at least
#define SAMPLE_GROUPS 64u   // whose radii are looked at to find the lattice step

struct level {
    struct hg_surfel *surfels; // [first[groups]]; level 0: NULL, they are measured
    uint32_t *first;           // [groups + 1] points of each group
    uint32_t *made;            // [groups + 1] points that are made of each group
    uint32_t groups, sides;
    uint32_t first_built; // number of the first group among those that are built
};

struct points_bake {
    struct hg_lod_build *build;
    const struct hg_mesh_part *part;
    struct hg_point_tree tree;
    uint32_t depth;                // of the groups of level 0 in the tree
    struct level below, now, next; // below: without its points
    bool terminal;
};

struct chunk_job {
    const struct points_bake *bake;
    uint32_t first_group, group_count; // of the level
    struct hg_writer bytes;
    struct hg_lod_chunk chunk;
    struct hg_lod_cluster *clusters;
    uint32_t cluster_count;
    float *moved; // [group_count] how far points of a group are from those made of them, on average
    enum hg_status status;
};

// ---- points of a group --------------------------------------------------------------------------

static uint32_t merged_count(uint32_t points)
{
    return (points + MERGED - 1) / MERGED;
}

// Points in an order in which each MERGED of them are neighbours.
static void order_neighbours(struct hg_point_item *items, uint32_t count)
{
    if (count <= MERGED)
        return;
    const uint32_t half = merged_count(count) / 2 * MERGED;
    hg_point_select(items, count, half, hg_point_longest_axis(items, count));
    order_neighbours(items, half);
    order_neighbours(items + half, count - half);
}

static void order_of(const struct hg_surfel *surfels, uint32_t count, struct hg_point_item *items)
{
    for (uint32_t i = 0; i < count; i++) {
        memcpy(items[i].at, surfels[i].at, sizeof items[i].at);
        items[i].number = i;
    }
    order_neighbours(items, count);
}

// The disc of some points; the sum of the squares of their distances to its middle.
static float merge(const struct hg_surfel *surfels, const struct hg_point_item *items,
    uint32_t count, struct hg_surfel *out)
{
    const float *lead = surfels[items[0].number].normal, share = 1.0f / (float)count;
    float moved = 0.0f, length = 0.0f;
    memset(out, 0, sizeof *out);
    for (uint32_t i = 0; i < count; i++) {
        const struct hg_surfel *s = &surfels[items[i].number];
        const float dot = s->normal[0] * lead[0] + s->normal[1] * lead[1] + s->normal[2] * lead[2];
        for (int k = 0; k < 3; k++) {
            out->at[k] += s->at[k] * share;
            out->normal[k] += dot < 0.0f ? -s->normal[k] : s->normal[k];
        }
        for (int k = 0; k < 4; k++)
            out->color[k] += s->color[k] * share;
    }
    for (uint32_t i = 0; i < count; i++) {
        const struct hg_surfel *s = &surfels[items[i].number];
        const float d[3] = {s->at[0] - out->at[0], s->at[1] - out->at[1], s->at[2] - out->at[2]};
        const float distance = sqrtf(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
        moved += distance * distance;
        out->radius = fmaxf(out->radius, distance + s->radius);
    }
    for (int k = 0; k < 3; k++)
        length += out->normal[k] * out->normal[k];
    for (int k = 0; k < 3; k++)
        out->normal[k] = length > 1e-12f ? out->normal[k] / sqrtf(length) : lead[k];
    return moved;
}

static float merge_group(const struct hg_surfel *surfels, const struct hg_point_item *items,
    uint32_t count, struct hg_surfel *out)
{
    float moved = 0.0f;
    for (uint32_t i = 0; i < count; i += MERGED)
        moved += merge(surfels, items + i, count - i < MERGED ? count - i : MERGED, out++);
    return sqrtf(moved / (float)count);
}

// ---- clusters -----------------------------------------------------------------------------------

// Bounds hold the discs as they will be decoded: positions and radii rounded to the lattice.
static struct hg_lod_cluster cluster_of(
    const struct points_bake *b, const struct hg_surfel *surfels, uint32_t count)
{
    struct hg_lod_cluster c = {
        .made_from = HG_LOD_NONE, .triangle_count = count * hg_disc_triangles(b->now.sides)};
    float min[3] = {FLT_MAX, FLT_MAX, FLT_MAX}, max[3] = {-FLT_MAX, -FLT_MAX, -FLT_MAX};
    float square = 0.0f;
    for (uint32_t i = 0; i < count; i++) {
        const float reach = surfels[i].radius * HG_DISC_REACH + b->build->mesh.format.quantum;
        for (int k = 0; k < 3; k++) {
            min[k] = fminf(min[k], surfels[i].at[k] - reach);
            max[k] = fmaxf(max[k], surfels[i].at[k] + reach);
        }
    }
    for (int k = 0; k < 3; k++) {
        c.center[k] = 0.5f * (min[k] + max[k]);
        c.extent[k] = fmaxf(max[k] - c.center[k], c.center[k] - min[k]) * 1.00001f;
        square += c.extent[k] * c.extent[k];
    }
    c.radius = sqrtf(square) * 1.00001f;
    c.cone_axis[2] = 1.0f;
    c.cone_cutoff = 1.0f; // both sides are seen
    return c;
}

static uint32_t cluster_points(uint32_t sides)
{
    const uint32_t triangles = HG_LOD_CLUSTER_TRIANGLES / hg_disc_triangles(sides);
    const uint32_t vertices = HG_LOD_CLUSTER_VERTICES / sides;
    return (triangles < vertices ? triangles : vertices) / MERGED * MERGED;
}

// Clusters of a group of the lowest level, or one for each group that its points were made of.
static void add_clusters(struct chunk_job *job, const struct hg_surfel *surfels, uint32_t group)
{
    const struct points_bake *b = job->bake;
    const uint32_t count = b->now.first[group + 1] - b->now.first[group];
    const uint32_t most = cluster_points(b->now.sides);
    struct hg_lod_cluster *c = job->clusters + job->cluster_count;
    if (b->now.surfels == NULL) {
        for (uint32_t i = 0; i < count; i += most, c++, job->cluster_count++) {
            *c = cluster_of(b, surfels + i, count - i < most ? count - i : most);
            c->group = group;
        }
        return;
    }
    for (uint32_t i = 0; i < 4; i++, c++, job->cluster_count++) {
        const uint32_t child = group * 4 + i, *made = b->below.made + child;
        *c = cluster_of(b, surfels + (made[0] - b->now.first[group]), made[1] - made[0]);
        c->group = group;
        c->made_from = b->below.first_built + child;
    }
}

// ---- chunks -------------------------------------------------------------------------------------

static uint32_t unorm(float v, float scale)
{
    return !(v > 0.0f) ? 0 : v >= 1.0f ? (uint32_t)scale : (uint32_t)(v * scale + 0.5f);
}

static void make_words(const struct hg_lod_format *f, const struct hg_surfel *s, uint32_t *words)
{
    const float *c = s->color;
    words[f->normal] = hg_lod_normal_word(s->normal);
    const float radius = s->radius / f->quantum * HG_LOD_RADIUS_STEPS;
    words[f->radius] = (uint32_t)lrintf(fminf(radius, (float)HG_LOD_LATTICE_MAX));
    if (f->flags & HG_DRAW_COLOR8) {
        words[f->color] = unorm(c[0], 255.0f) | unorm(c[1], 255.0f) << 8 |
                          unorm(c[2], 255.0f) << 16 | unorm(c[3], 255.0f) << 24;
    } else if (f->flags & HG_DRAW_COLOR16) {
        words[f->color] = unorm(c[0], 65535.0f) | unorm(c[1], 65535.0f) << 16;
        words[f->color + 1] = unorm(c[2], 65535.0f) | unorm(c[3], 65535.0f) << 16;
    }
}

static enum hg_status encode(struct chunk_job *job, const struct hg_surfel *surfels, uint32_t count)
{
    const struct hg_lod_mesh *mesh = &job->bake->build->mesh;
    const struct hg_lod_format *f = &mesh->format;
    int32_t(*lattice)[3] = hg_calloc(count, sizeof *lattice);
    uint32_t *words = hg_calloc((size_t)count * f->words, 4);
    enum hg_status status = HG_E_NOMEM;
    if (lattice != NULL && words != NULL) {
        for (uint32_t i = 0; i < count; i++) {
            for (int k = 0; k < 3; k++)
                lattice[i][k] = (int32_t)lrintf(surfels[i].at[k] / f->quantum);
            make_words(f, &surfels[i], words + (size_t)i * f->words);
        }
        const struct hg_lod_points points = {
            (const int32_t(*)[3])lattice, words, count, job->bake->now.sides};
        status = hg_lod_encode_points(mesh, &points, &job->bytes, &job->chunk);
    }
    hg_free(lattice);
    hg_free(words);
    return status;
}

// The surfels of a group of the lowest level, in the order of their neighbours.
static enum hg_status measure_group(
    const struct points_bake *b, uint32_t group, struct hg_surfel *out)
{
    struct hg_surfel measured[GROUP_POINTS];
    struct hg_point_item items[GROUP_POINTS];
    const uint32_t first = b->now.first[group], count = b->now.first[group + 1] - first;
    const enum hg_status status = hg_surfels_measure(&b->tree, b->part, first, count, measured);
    if (status != HG_OK)
        return status;
    order_of(measured, count, items);
    for (uint32_t i = 0; i < count; i++)
        out[i] = measured[items[i].number];
    return HG_OK;
}

static void make_next(
    struct chunk_job *job, uint32_t group, const struct hg_surfel *surfels, uint32_t count)
{
    const struct points_bake *b = job->bake;
    struct hg_point_item items[GROUP_POINTS];
    order_of(surfels, count, items);
    job->moved[group - job->first_group] =
        merge_group(surfels, items, count, b->next.surfels + b->now.made[group]);
}

static void run_chunk(void *user, size_t index)
{
    struct chunk_job *job = (struct chunk_job *)user + index;
    const struct points_bake *b = job->bake;
    const uint32_t *first = b->now.first + job->first_group;
    const uint32_t count = first[job->group_count] - first[0];
    struct hg_surfel *surfels =
        b->now.surfels != NULL ? b->now.surfels + first[0] : hg_calloc(count, sizeof *surfels);
    job->clusters =
        hg_calloc((size_t)job->group_count * HG_LOD_GROUP_CLUSTERS, sizeof *job->clusters);
    job->moved = hg_calloc(job->group_count, sizeof *job->moved);
    job->status =
        surfels != NULL && job->clusters != NULL && job->moved != NULL ? HG_OK : HG_E_NOMEM;
    for (uint32_t g = 0; g < job->group_count && job->status == HG_OK; g++) {
        struct hg_surfel *own = surfels + (first[g] - first[0]);
        if (b->now.surfels == NULL)
            job->status = measure_group(b, job->first_group + g, own);
        if (job->status != HG_OK)
            break;
        add_clusters(job, own, job->first_group + g);
        if (!b->terminal)
            make_next(job, job->first_group + g, own, first[g + 1] - first[g]);
    }
    job->chunk.group_count = job->group_count;
    if (job->status == HG_OK)
        job->status = encode(job, surfels, count);
    if (b->now.surfels == NULL)
        hg_free(surfels);
}

// ---- what is finished ---------------------------------------------------------------------------

static void finish_group(const struct points_bake *p, const struct chunk_job *job, uint32_t group,
    struct hg_lod_group *out)
{
    const struct hg_lod_build *b = p->build;
    struct hg_lod_sphere spheres[HG_LOD_GROUP_CLUSTERS * 2];
    uint32_t n = 0;
    float below = 0.0f;
    for (uint32_t i = 0; i < out->cluster_count; i++) {
        const struct hg_lod_cluster *c = &b->built.clusters[out->first_cluster + i];
        memcpy(spheres[n].center, c->center, sizeof c->center);
        spheres[n++].radius = c->radius;
        if (c->made_from == HG_LOD_NONE)
            continue;
        const struct hg_lod_group *from = &b->built.groups[c->made_from];
        memcpy(spheres[n].center, from->center, sizeof from->center);
        spheres[n++].radius = from->radius;
        below = fmaxf(below, from->error * 1.0001f);
    }
    const struct hg_lod_sphere s = hg_lod_sphere_around(spheres, n);
    const float own = below > 0.0f ? 0.0f : b->mesh.format.quantum * 0.8660255f;
    memcpy(out->center, s.center, sizeof s.center);
    out->radius = s.radius;
    out->error = p->terminal
                     ? FLT_MAX
                     : fminf(below + job->moved[group - job->first_group] + own, 0.5f * FLT_MAX);
}

static enum hg_status keep_group(
    struct points_bake *p, const struct chunk_job *job, uint32_t group, uint32_t *at)
{
    struct hg_lod_build *b = p->build;
    uint32_t count = 0;
    while (*at + count < job->cluster_count && job->clusters[*at + count].group == group)
        count++;
    if (hg_grow(&b->built.groups, &b->built.group_capacity, b->built.group_count + 1ull,
            sizeof *b->built.groups) ||
        hg_grow(&b->built.clusters, &b->built.cluster_capacity,
            (size_t)b->built.cluster_count + count, sizeof *b->built.clusters))
        return HG_E_NOMEM;
    struct hg_lod_group *out = &b->built.groups[b->built.group_count];
    *out = (struct hg_lod_group){.first_cluster = b->built.cluster_count,
        .cluster_count = count,
        .level = b->level,
        .chunk = b->built.chunk_count};
    for (uint32_t i = 0; i < count; i++) {
        struct hg_lod_cluster *c = &b->built.clusters[b->built.cluster_count++];
        *c = job->clusters[*at + i];
        c->group = b->built.group_count;
        b->report.stored_triangles += c->triangle_count;
        for (int k = 0; k < 3; k++) {
            b->min[k] = fminf(b->min[k], c->center[k] - c->extent[k]);
            b->max[k] = fmaxf(b->max[k], c->center[k] + c->extent[k]);
        }
    }
    finish_group(p, job, group, out);
    if (!p->terminal)
        b->report.root_error = fmaxf(b->report.root_error, out->error);
    b->report.terminal_clusters += p->terminal ? count : 0;
    b->built.group_count++;
    *at += count;
    return HG_OK;
}

static enum hg_status keep_chunk(struct points_bake *p, struct chunk_job *job)
{
    struct hg_lod_build *b = p->build;
    uint32_t at = 0;
    if (b->built.chunk_count >= CHUNKS_MAX)
        return hg_error_set(b->err, HG_E_LIMIT, "cluster bake", NULL,
            "%u points are too many for one part", p->tree.count);
    if (hg_grow(&b->built.chunks, &b->built.chunk_capacity, b->built.chunk_count + 1ull,
            sizeof *b->built.chunks) != HG_OK)
        return HG_E_NOMEM;
    job->chunk.offset = b->built.bytes.size;
    job->chunk.first_group = b->built.group_count;
    hg_write_bytes(&b->built.bytes, job->bytes.data, job->bytes.size);
    struct hg_lod_layout layout;
    hg_lod_layout_of(&b->mesh.format, &job->chunk, &layout);
    b->report.decoded_bytes += layout.total_bytes;
    enum hg_status status = b->built.bytes.failed ? HG_E_NOMEM : HG_OK;
    for (uint32_t g = 0; g < job->group_count && status == HG_OK; g++)
        status = keep_group(p, job, job->first_group + g, &at);
    b->built.chunks[b->built.chunk_count++] = job->chunk;
    return status;
}

static void drop_job(struct chunk_job *job)
{
    hg_writer_finish(&job->bytes);
    hg_free(job->clusters);
    hg_free(job->moved);
}

// ---- levels -------------------------------------------------------------------------------------

// Points that a chunk holds.
static uint32_t chunk_points(const struct hg_lod_format *f, uint32_t sides)
{
    const uint32_t vertex = 12 + (uint32_t)sizeof(struct hg_gpu_vertex) + f->extra_words * 4;
    return (HG_LOD_CHUNK_BYTES - 64) / (sides * vertex + hg_disc_triangles(sides) * 12);
}

// Groups in a row share a chunk while they fit. Jobs for groups from *group on; their number.
static uint32_t plan_jobs(const struct points_bake *p, uint32_t *group, struct chunk_job *jobs)
{
    const uint32_t most = chunk_points(&p->build->mesh.format, p->now.sides);
    const uint32_t *first = p->now.first;
    uint32_t n = 0;
    for (; n < HG_LOD_BATCH && *group < p->now.groups; n++) {
        uint32_t end = *group + 1;
        while (end < p->now.groups && first[end + 1] - first[*group] <= most)
            end++;
        jobs[n] = (struct chunk_job){.bake = p, .first_group = *group, .group_count = end - *group};
        *group = end;
    }
    return n;
}

static enum hg_status build_chunks(struct points_bake *p)
{
    struct hg_lod_build *b = p->build;
    struct chunk_job *jobs = hg_calloc(HG_LOD_BATCH, sizeof *jobs);
    enum hg_status status = jobs != NULL ? HG_OK : HG_E_NOMEM;
    for (uint32_t group = 0; group < p->now.groups && status == HG_OK;) {
        const uint32_t n = plan_jobs(p, &group, jobs);
        hg_lod_build_each(b, n, run_chunk, jobs);
        for (uint32_t i = 0; i < n; i++) {
            if (status == HG_OK)
                status = jobs[i].status;
            if (status == HG_OK)
                status = keep_chunk(p, &jobs[i]);
            drop_job(&jobs[i]);
        }
        b->done = (uint64_t)b->total * b->built.group_count / (p->now.groups * 2ull + 1);
        if (status == HG_OK)
            status = hg_lod_build_tell(b);
    }
    hg_free(jobs);
    return status;
}

static void free_level(struct level *l)
{
    hg_free(l->surfels);
    hg_free(l->first);
    hg_free(l->made);
    memset(l, 0, sizeof *l);
}

// What each group of the present level gives; room for all of it.
static enum hg_status begin_next(struct points_bake *p)
{
    struct level *now = &p->now;
    now->made = hg_spill_scratch((size_t)now->groups + 1, sizeof *now->made);
    if (now->made == NULL)
        return HG_E_NOMEM;
    for (uint32_t g = 0; g < now->groups; g++)
        now->made[g + 1] = now->made[g] + merged_count(now->first[g + 1] - now->first[g]);
    p->next = (struct level){.groups = now->groups / 4, .sides = UPPER_SIDES};
    p->next.surfels = hg_spill_scratch(now->made[now->groups], sizeof *p->next.surfels);
    p->next.first = hg_spill_scratch((size_t)p->next.groups + 1, sizeof *p->next.first);
    if (p->next.surfels == NULL || p->next.first == NULL)
        return HG_E_NOMEM;
    for (uint32_t g = 0; g <= p->next.groups; g++)
        p->next.first[g] = now->made[g * 4];
    return HG_OK;
}

static enum hg_status build_level(struct points_bake *p, bool *more)
{
    struct hg_lod_build *b = p->build;
    p->terminal = p->now.groups < 4;
    enum hg_status status = p->terminal ? HG_OK : begin_next(p);
    p->now.first_built = b->built.group_count;
    if (status == HG_OK)
        status = build_chunks(p);
    *more = status == HG_OK && !p->terminal;
    b->level++;
    if (!*more)
        return status;
    free_level(&p->below);
    p->below = p->now;
    hg_free(p->below.surfels);
    hg_free(p->below.first);
    p->below.surfels = NULL;
    p->below.first = NULL;
    p->now = p->next;
    p->next = (struct level){0};
    return HG_OK;
}

// ---- beginning ----------------------------------------------------------------------------------

static enum hg_status check(const struct hg_mesh_part *part, struct hg_error *err)
{
    float most = 0.0f;
    for (uint32_t i = 0; i < part->index_count; i++) {
        if (part->indices[i] >= part->vertex_count)
            return hg_error_set(err, HG_E_INVAL, "part", "indices", "index %u of vertex %u of %u",
                i, part->indices[i], part->vertex_count);
        for (size_t k = 0; k < 3; k++) {
            const float v = fabsf(part->positions[(size_t)part->indices[i] * 3 + k]);
            if (!(v <= FLT_MAX))
                return hg_error_set(err, HG_E_INVAL, "part", "positions", "a value is not finite");
            most = fmaxf(most, v);
        }
    }
    return most <= HG_LOD_FARTHEST ? HG_OK
                                   : hg_error_set(err, HG_E_LIMIT, "part", "positions",
                                         "a coordinate is beyond 1e36 m");
}

static enum hg_status check_memory(struct points_bake *p)
{
    // The tree, and a third more points on the levels above, of which two are in memory.
    const uint64_t bytes = p->part->index_count *
                           (sizeof(struct hg_point_item) + 1 + sizeof(struct hg_surfel) * 5 / 16);
    struct hg_lod_budget *budget = &p->build->budget;
    budget->peak = bytes;
    return budget->limit > 0 && bytes > budget->limit ? HG_E_LIMIT : HG_OK;
}

static int compare_floats(const void *a, const void *b)
{
    const float x = *(const float *)a, y = *(const float *)b;
    return x < y ? -1 : x > y;
}

// The lattice step from the radii of groups that lie evenly in the tree.
static enum hg_status choose_step(struct points_bake *p)
{
    struct hg_surfel surfels[GROUP_POINTS];
    float radii[SAMPLE_GROUPS], most = 0.0f;
    const uint32_t groups = p->now.groups, n = groups < SAMPLE_GROUPS ? groups : SAMPLE_GROUPS;
    for (uint32_t i = 0; i < n; i++) {
        const uint32_t g = (uint32_t)((uint64_t)groups * i / n);
        const uint32_t count = p->now.first[g + 1] - p->now.first[g];
        const enum hg_status status =
            hg_surfels_measure(&p->tree, p->part, p->now.first[g], count, surfels);
        if (status != HG_OK)
            return status;
        radii[i] = surfels[count / 2].radius;
    }
    qsort(radii, n, sizeof *radii, compare_floats);
    for (uint32_t i = 0; i < p->tree.count; i++)
        for (int k = 0; k < 3; k++)
            most = fmaxf(most, fabsf(p->tree.items[i].at[k]));
    const float asked = p->build->params->quantum;
    const float wanted = asked > 0.0f ? asked : radii[n / 2] / RADIUS_STEPS;
    p->build->mesh.format.quantum =
        fmaxf(hg_lod_power_below(fminf(wanted, FLT_MAX / (2.0f * HG_LOD_LATTICE_MAX))),
            hg_lod_power_below(most / HG_LOD_LATTICE_MAX * 4.0f));
    return HG_OK;
}

// Room for all clusters and groups: every level but the lowest has a cluster per group below.
static enum hg_status reserve_tables(struct points_bake *p)
{
    struct hg_lod_built *built = &p->build->built;
    const size_t groups = p->now.groups, most = cluster_points(p->now.sides);
    built->group_capacity = groups + groups / 3 + 1;
    built->groups = hg_spill_scratch(built->group_capacity, sizeof *built->groups);
    built->cluster_capacity = groups * ((GROUP_POINTS + most - 1) / most) + built->group_capacity;
    built->clusters = hg_spill_scratch(built->cluster_capacity, sizeof *built->clusters);
    return built->groups != NULL && built->clusters != NULL ? HG_OK : HG_E_NOMEM;
}

static enum hg_status begin(struct points_bake *p)
{
    struct hg_lod_build *b = p->build;
    struct hg_pack_layout layout;
    const uint64_t start = hg_clock_now_ns();
    enum hg_status status = check(p->part, b->err);
    if (status == HG_OK)
        status = check_memory(p);
    if (status == HG_OK)
        status = hg_pack_layout_of(p->part, 0, &layout);
    if (status == HG_OK)
        status = hg_point_tree_build(p->part, 1, true, b->params->jobs, &p->tree);
    if (status != HG_OK)
        return status;
    hg_lod_format_set(&b->mesh.format,
        HG_DRAW_DISCS | (layout.flags & (HG_DRAW_COLOR8 | HG_DRAW_COLOR16)) |
            (hg_discs_are_lit(p->part) ? HG_DRAW_NORMALS : 0u),
        false);
    b->mesh.format.uv_quantum = b->mesh.format.quantum = 1.0f;
    if (p->tree.count == 0)
        return HG_OK;
    p->depth = p->tree.depth > 2 ? p->tree.depth - 2 : 0;
    p->now.groups = 1u << p->depth;
    p->now.sides = hg_disc_sides(p->tree.count);
    p->now.first = hg_spill_scratch((size_t)p->now.groups + 1, sizeof *p->now.first);
    if (p->now.first == NULL)
        return HG_E_NOMEM;
    for (uint32_t g = 0; g <= p->now.groups; g++)
        p->now.first[g] = hg_point_tree_first(&p->tree, p->depth, g);
    b->mesh.triangle_count = p->tree.count * hg_disc_triangles(p->now.sides);
    b->total = p->tree.count;
    hg_writer_spill(&b->built.bytes, (size_t)p->tree.count * 16);
    status = reserve_tables(p);
    b->report.cluster_ns = hg_clock_now_ns() - start;
    return status == HG_OK ? choose_step(p) : status;
}

enum hg_status hg_lod_build_points(
    struct hg_lod_build *b, const struct hg_mesh_part *part, uint32_t *root_chunks)
{
    struct points_bake p = {.build = b, .part = part};
    for (int k = 0; k < 3; k++) {
        b->min[k] = FLT_MAX;
        b->max[k] = -FLT_MAX;
    }
    enum hg_status status = begin(&p);
    uint32_t first = 0;
    for (bool more = status == HG_OK && p.tree.count > 0; more;) {
        first = b->built.chunk_count;
        status = build_level(&p, &more);
    }
    *root_chunks = b->built.chunk_count - first;
    b->held.first_chunk = b->built.chunk_count;
    free_level(&p.below);
    free_level(&p.now);
    free_level(&p.next);
    hg_point_tree_finish(&p.tree);
    return status;
}
