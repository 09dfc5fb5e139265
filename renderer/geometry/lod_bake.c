// lod_bake.c - a part to the bytes of its hierarchy: weld, cut, then level after level group,
// simplify, encode what was grouped and go on with what was made from it.
#include <float.h>
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/sha256.h"
#include "renderer/geometry/lod_internal.h"

#define BATCH      256u // groups between two calls of the progress function
#define LEVELS_MAX 64u

struct build {
    const struct hg_lod_params *params;
    struct hg_error *err;
    struct hg_lod_budget budget;
    struct hg_lod_mesh mesh;
    struct hg_lod_report report;
    uint8_t *locked, *open; // [position_count]
    uint32_t *owner;        // [position_count] group that has it
    struct hg_lod_pieces pool;
    uint32_t *group_of, *members, *first; // of the pool: groups and who is in them
    size_t pool_capacity;
    uint32_t group_count;
    struct hg_lod_group_job *jobs;
    // What is finished, in the order of building.
    struct hg_lod_cluster *clusters;
    struct hg_lod_group *groups;
    struct hg_lod_chunk *chunks;
    size_t cluster_capacity, group_capacity, chunk_capacity;
    uint32_t cluster_count, built_groups, chunk_count;
    struct hg_writer bytes; // of the chunks
    uint32_t level;
    uint64_t done, total; // triangles simplified
};

static void each(const struct build *b, size_t count, hg_jobs_fn *fn, void *user)
{
    if (b->params->jobs != NULL) {
        hg_jobs_for(b->params->jobs, count, fn, user);
        return;
    }
    for (size_t i = 0; i < count; i++)
        fn(user, i);
}

static enum hg_status fail(struct build *b, enum hg_status status)
{
    if (b->err != NULL && b->err->status == status)
        return status; // said already
    return hg_error_set(b->err, status, "cluster bake", NULL,
        status == HG_E_LIMIT ? "it passes the memory limit" : "no memory");
}

static enum hg_status tell(struct build *b)
{
    if (b->params->progress == NULL || b->params->progress(b->params->progress_user,
                                           b->done < b->total ? b->done : b->total, b->total))
        return HG_OK;
    return hg_error_set(b->err, HG_E_CANCELLED, "cluster bake", NULL, "cancelled");
}

// ---- the surface of a level ---------------------------------------------------------------------

static enum hg_status reserve(struct build *b)
{
    const size_t n = b->pool.count;
    size_t c[3] = {b->pool_capacity, b->pool_capacity, b->pool_capacity};
    if (hg_grow(&b->group_of, &c[0], n + 1, 4) != HG_OK ||
        hg_grow(&b->members, &c[1], n + 1, 4) != HG_OK ||
        hg_grow(&b->first, &c[2], n + 1, 4) != HG_OK)
        return HG_E_NOMEM;
    b->pool_capacity = c[0] < c[1] ? c[0] : c[1];
    b->pool_capacity = c[2] < b->pool_capacity ? c[2] : b->pool_capacity;
    return HG_OK;
}

static enum hg_status partition(struct build *b, uint8_t *open)
{
    const uint32_t n = b->pool.count;
    struct hg_lod_pool pool = {.count = n};
    const uint32_t **triangles = hg_calloc(n, sizeof *triangles);
    uint32_t *counts = hg_calloc((size_t)n * 2, sizeof *counts);
    float(*center)[3] = hg_calloc(n, sizeof *center);
    enum hg_status status = HG_E_NOMEM;
    if (triangles != NULL && counts != NULL && center != NULL) {
        for (uint32_t i = 0; i < n; i++) {
            triangles[i] = b->pool.items[i].triangles;
            counts[i] = b->pool.items[i].info.triangle_count;
            counts[n + i] = b->pool.items[i].vertex_count;
            memcpy(center[i], b->pool.items[i].info.center, sizeof center[i]);
        }
        pool.triangles = triangles;
        pool.triangle_count = counts;
        pool.vertex_count = counts + n;
        pool.center = (const float(*)[3])center;
        status = hg_lod_partition(&b->mesh, &pool, b->group_of, &b->group_count, open);
    }
    hg_free(triangles);
    hg_free(counts);
    hg_free(center);
    return status;
}

// Members of each group, in the order of the pool.
static void sort_members(struct build *b)
{
    memset(b->first, 0, ((size_t)b->group_count + 1) * 4);
    for (uint32_t i = 0; i < b->pool.count; i++)
        b->first[b->group_of[i] + 1]++;
    for (uint32_t g = 0; g < b->group_count; g++)
        b->first[g + 1] += b->first[g];
    for (uint32_t i = 0; i < b->pool.count; i++)
        b->members[b->first[b->group_of[i]]++] = i;
    for (uint32_t g = b->group_count; g > 0; g--)
        b->first[g] = b->first[g - 1];
    b->first[0] = 0;
}

// Positions that more than one group has must stay where they are.
static void lock_borders(struct build *b)
{
    const struct hg_lod_mesh *m = &b->mesh;
    for (uint32_t i = 0; i < b->pool.count; i++) {
        const struct hg_lod_piece *p = &b->pool.items[i];
        for (uint32_t k = 0; k < p->info.triangle_count * 3; k++) {
            b->owner[m->position_of[p->triangles[k]]] = HG_LOD_NONE;
            b->locked[m->position_of[p->triangles[k]]] = 0;
        }
    }
    for (uint32_t i = 0; i < b->pool.count; i++) {
        const struct hg_lod_piece *p = &b->pool.items[i];
        for (uint32_t k = 0; k < p->info.triangle_count * 3; k++) {
            const uint32_t at = m->position_of[p->triangles[k]];
            if (b->owner[at] == HG_LOD_NONE)
                b->owner[at] = b->group_of[i];
            else if (b->owner[at] != b->group_of[i])
                b->locked[at] = 1;
        }
    }
}

// ---- simplification -----------------------------------------------------------------------------

static void run_group(void *user, size_t index)
{
    struct hg_lod_group_job *jobs = user;
    hg_lod_group_run(&jobs[index]);
}

static enum hg_status account(struct build *b, const struct hg_lod_group_job *job)
{
    if (job->product == NULL)
        return HG_OK;
    b->budget.used += job->product->triangle_count * 12ull +
                      job->product->sample_count * sizeof(struct hg_lod_sample);
    if (b->budget.used > b->budget.peak)
        b->budget.peak = b->budget.used;
    return b->budget.limit > 0 && b->budget.used > b->budget.limit ? HG_E_LIMIT : HG_OK;
}

static enum hg_status simplify(struct build *b)
{
    const struct hg_lod_params *p = b->params;
    const struct hg_lod_weights weights = {
        p->normal_weight == 0.0f ? 0.25f : fmaxf(p->normal_weight, 0.0f),
        p->color_weight == 0.0f ? 0.25f : fmaxf(p->color_weight, 0.0f),
        p->uv_weight == 0.0f ? 0.5f : fmaxf(p->uv_weight, 0.0f)};
    // Coarse levels have few clusters, so they can afford more samples each.
    const uint32_t samples = b->level < 12 ? 64 + 48 * b->level : 640;
    for (uint32_t g = 0; g < b->group_count; g++)
        b->jobs[g] = (struct hg_lod_group_job){.samples_per_piece = samples,
            .mesh = &b->mesh,
            .locked = b->locked,
            .open = b->open,
            .weights = weights,
            .pieces = b->pool.items,
            .members = b->members + b->first[g],
            .member_count = b->first[g + 1] - b->first[g]};
    for (uint32_t g = 0; g < b->group_count; g += BATCH) {
        const uint32_t n = b->group_count - g < BATCH ? b->group_count - g : BATCH;
        each(b, n, run_group, b->jobs + g);
        for (uint32_t i = 0; i < n; i++) {
            const struct hg_lod_group_job *job = &b->jobs[g + i];
            enum hg_status status = job->status != HG_OK ? job->status : account(b, job);
            if (status != HG_OK)
                return status;
            b->done += job->triangle_count;
        }
        const enum hg_status status = tell(b);
        if (status != HG_OK)
            return status;
    }
    return HG_OK;
}

// ---- finished groups ----------------------------------------------------------------------------

// Sphere and error of a group: at least those of everything it is made of.
static void finish_group(const struct build *b, const struct hg_lod_group_job *job, bool terminal,
    struct hg_lod_group *out)
{
    struct hg_lod_sphere spheres[HG_LOD_GROUP_CLUSTERS * 2];
    uint32_t n = 0;
    float error = job->error + b->mesh.format.quantum * 0.8660255f;
    for (uint32_t i = 0; i < job->member_count; i++) {
        const struct hg_lod_cluster *c = &b->pool.items[job->members[i]].info;
        memcpy(spheres[n].center, c->center, sizeof c->center);
        spheres[n++].radius = c->radius;
        if (c->made_from == HG_LOD_NONE)
            continue;
        const struct hg_lod_group *from = &b->groups[c->made_from];
        memcpy(spheres[n].center, from->center, sizeof from->center);
        spheres[n++].radius = from->radius;
        error = fmaxf(error, from->error * 1.0001f);
    }
    const struct hg_lod_sphere s = hg_lod_sphere_around(spheres, n);
    memcpy(out->center, s.center, sizeof s.center);
    out->radius = s.radius;
    out->error = terminal ? FLT_MAX : fminf(error, 0.5f * FLT_MAX);
    out->first_cluster = b->cluster_count;
    out->cluster_count = job->member_count;
    out->level = b->level;
}

// Adds group and clusters to what is finished; numbers those made from it.
static enum hg_status add_group(struct build *b, struct hg_lod_group_job *job, bool terminal)
{
    if (hg_grow(&b->groups, &b->group_capacity, b->built_groups + 1ull, sizeof *b->groups) ||
        hg_grow(&b->clusters, &b->cluster_capacity, (size_t)b->cluster_count + job->member_count,
            sizeof *b->clusters))
        return HG_E_NOMEM;
    struct hg_lod_group *group = &b->groups[b->built_groups];
    memset(group, 0, sizeof *group);
    finish_group(b, job, terminal, group);
    for (uint32_t i = 0; i < job->member_count; i++) {
        struct hg_lod_cluster *c = &b->clusters[b->cluster_count++];
        *c = b->pool.items[job->members[i]].info;
        c->group = b->built_groups;
        b->report.stored_triangles += c->triangle_count;
        b->report.terminal_clusters += terminal;
    }
    for (uint32_t i = 0; i < job->made_count; i++)
        job->made[i].info.made_from = b->built_groups;
    if (!terminal)
        b->report.root_error = fmaxf(b->report.root_error, group->error);
    b->built_groups++;
    return HG_OK;
}

// ---- chunks -------------------------------------------------------------------------------------

struct chunk_job {
    const struct build *build;
    const uint32_t *groups; // [group_count] numbers of jobs
    uint32_t group_count;
    struct hg_writer bytes;
    struct hg_lod_chunk chunk;
    enum hg_status status;
};

static void encode_chunk(void *user, size_t index)
{
    struct chunk_job *job = (struct chunk_job *)user + index;
    const struct build *b = job->build;
    uint32_t clusters = 0, triangles = 0, at = 0;
    for (uint32_t g = 0; g < job->group_count; g++) {
        clusters += b->jobs[job->groups[g]].member_count;
        triangles += b->jobs[job->groups[g]].triangle_count;
    }
    uint32_t *list = hg_calloc(triangles, 12), *counts = hg_calloc(clusters, 4);
    job->status = HG_E_NOMEM;
    if (list != NULL && counts != NULL) {
        clusters = 0;
        for (uint32_t g = 0; g < job->group_count; g++) {
            const struct hg_lod_group_job *group = &b->jobs[job->groups[g]];
            for (uint32_t i = 0; i < group->member_count; i++) {
                const struct hg_lod_piece *p = &b->pool.items[group->members[i]];
                memcpy(list + (size_t)at * 3, p->triangles, p->info.triangle_count * 12ull);
                at += p->info.triangle_count;
                counts[clusters++] = p->info.triangle_count;
            }
        }
        job->status = hg_lod_encode(&b->mesh, list, counts, clusters, &job->bytes, &job->chunk);
    }
    job->chunk.group_count = job->group_count;
    hg_free(list);
    hg_free(counts);
}

// Decoded bytes of a group, not counting vertices that its clusters share.
static uint32_t group_bytes(const struct build *b, const struct hg_lod_group_job *job)
{
    const uint32_t vertex =
        12 + (uint32_t)sizeof(struct hg_gpu_vertex) + b->mesh.format.extra_words * 4;
    uint32_t bytes = 64;
    for (uint32_t i = 0; i < job->member_count; i++) {
        const struct hg_lod_piece *p = &b->pool.items[job->members[i]];
        bytes += p->info.triangle_count * 12 + p->vertex_count * vertex;
    }
    return bytes;
}

// Groups in a row share a chunk while they fit.
static uint32_t plan_chunks(
    const struct build *b, const uint32_t *groups, uint32_t count, struct chunk_job *out)
{
    uint32_t n = 0, bytes = 0;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t size = group_bytes(b, &b->jobs[groups[i]]);
        if (n == 0 || bytes + size > HG_LOD_CHUNK_BYTES) {
            out[n] = (struct chunk_job){.build = b, .groups = groups + i};
            bytes = 0;
            n++;
        }
        out[n - 1].group_count++;
        bytes += size;
    }
    return n;
}

static enum hg_status keep_chunk(struct build *b, struct chunk_job *job, uint32_t first_group)
{
    if (job->status != HG_OK)
        return job->status;
    if (hg_grow(&b->chunks, &b->chunk_capacity, b->chunk_count + 1ull, sizeof *b->chunks) != HG_OK)
        return HG_E_NOMEM;
    job->chunk.offset = b->bytes.size;
    job->chunk.first_group = first_group;
    for (uint32_t g = 0; g < job->group_count; g++)
        b->groups[first_group + g].chunk = b->chunk_count;
    b->chunks[b->chunk_count++] = job->chunk;
    hg_write_bytes(&b->bytes, job->bytes.data, job->bytes.size);
    struct hg_lod_layout layout;
    hg_lod_layout_of(&b->mesh.format, &job->chunk, &layout);
    b->report.decoded_bytes += layout.total_bytes;
    return b->bytes.failed ? HG_E_NOMEM : HG_OK;
}

// Encodes the listed groups, which were added from number `first_group` on.
static enum hg_status encode_groups(
    struct build *b, const uint32_t *groups, uint32_t count, uint32_t first_group)
{
    const uint64_t start = hg_clock_now_ns();
    struct chunk_job *jobs = hg_calloc(count, sizeof *jobs);
    if (jobs == NULL)
        return HG_E_NOMEM;
    const uint32_t n = plan_chunks(b, groups, count, jobs);
    enum hg_status status = HG_OK;
    for (uint32_t c = 0; c < n && status == HG_OK; c += BATCH) {
        const uint32_t some = n - c < BATCH ? n - c : BATCH;
        each(b, some, encode_chunk, jobs + c);
        for (uint32_t i = c; i < c + some; i++) {
            if (status == HG_OK)
                status = keep_chunk(b, &jobs[i], first_group);
            first_group += jobs[i].group_count;
            hg_writer_finish(&jobs[i].bytes);
        }
        if (status == HG_OK)
            status = tell(b);
    }
    hg_free(jobs);
    b->report.encode_ns += hg_clock_now_ns() - start;
    return status;
}

// ---- levels -------------------------------------------------------------------------------------

static void release_member(struct build *b, struct hg_lod_piece *piece)
{
    struct hg_lod_product *p = piece->product;
    if (p != NULL && p->users == 1)
        b->budget.used -= p->triangles != NULL || p->samples != NULL
                              ? (p->triangles != NULL ? p->triangle_count * 12ull : 0) +
                                    p->sample_count * sizeof(struct hg_lod_sample)
                              : 0;
    hg_lod_product_unref(p);
    piece->product = NULL;
}

// The next pool: what was made, and the pieces of groups that could not be simplified.
static enum hg_status next_pool(struct build *b)
{
    struct hg_lod_pieces next = {0};
    uint64_t count = 0;
    for (uint32_t g = 0; g < b->group_count; g++)
        count += b->jobs[g].product != NULL ? b->jobs[g].made_count : b->jobs[g].member_count;
    if (hg_grow(&next.items, &next.capacity, count, sizeof *next.items) != HG_OK)
        return HG_E_NOMEM;
    for (uint32_t g = 0; g < b->group_count; g++) {
        struct hg_lod_group_job *job = &b->jobs[g];
        for (uint32_t i = 0; job->product != NULL && i < job->made_count; i++)
            next.items[next.count++] = job->made[i];
        for (uint32_t i = 0; i < job->member_count; i++) {
            if (job->product != NULL)
                release_member(b, &b->pool.items[job->members[i]]);
            else
                next.items[next.count++] = b->pool.items[job->members[i]];
        }
        job->product = NULL;
        hg_free(job->made);
        job->made = NULL;
    }
    hg_free(b->pool.items);
    b->pool = next;
    return HG_OK;
}

static enum hg_status group_pool(struct build *b, uint8_t *open)
{
    const uint64_t start = hg_clock_now_ns();
    enum hg_status status = reserve(b);
    if (status == HG_OK)
        status = partition(b, open);
    if (status == HG_OK)
        sort_members(b);
    b->jobs = status == HG_OK ? hg_calloc(b->group_count, sizeof *b->jobs) : NULL;
    if (status == HG_OK && b->jobs == NULL)
        status = HG_E_NOMEM;
    b->report.group_ns += hg_clock_now_ns() - start;
    return status;
}

static void drop_jobs(struct build *b)
{
    for (uint32_t g = 0; b->jobs != NULL && g < b->group_count; g++) {
        struct hg_lod_group_job *job = &b->jobs[g];
        if (job->product != NULL) {
            job->product->users = 1;
            hg_lod_product_unref(job->product);
        }
        hg_free(job->made);
    }
    hg_free(b->jobs);
    b->jobs = NULL;
}

// Adds the groups that were simplified (or all, as terminal ones) and encodes them.
static enum hg_status keep_groups(struct build *b, bool terminal, uint32_t *kept)
{
    uint32_t *list = hg_calloc(b->group_count, sizeof *list);
    const uint32_t first = b->built_groups;
    enum hg_status status = list != NULL ? HG_OK : HG_E_NOMEM;
    *kept = 0;
    for (uint32_t g = 0; status == HG_OK && g < b->group_count; g++) {
        struct hg_lod_group_job *job = &b->jobs[g];
        if (!terminal && job->product == NULL)
            continue;
        job->triangle_count = 0;
        for (uint32_t i = 0; i < job->member_count; i++)
            job->triangle_count += b->pool.items[job->members[i]].info.triangle_count;
        status = add_group(b, job, terminal);
        list[(*kept)++] = g;
    }
    if (status == HG_OK && *kept > 0)
        status = encode_groups(b, list, *kept, first);
    hg_free(list);
    return status;
}

// One level up. *more is false when the rest of the pool is as coarse as it gets.
static enum hg_status build_level(struct build *b, bool *more)
{
    *more = false;
    if (b->pool.count <= 1 || b->level + 1 >= LEVELS_MAX)
        return HG_OK;
    enum hg_status status = group_pool(b, b->level == 0 ? b->open : NULL);
    const uint64_t start = hg_clock_now_ns();
    if (status == HG_OK && b->level == 0)
        status = hg_lod_first_samples(&b->mesh, b->open, &b->pool);
    if (status == HG_OK && b->level == 0)
        b->budget.used += b->pool.items[0].product->sample_count * sizeof(struct hg_lod_sample);
    if (status == HG_OK) {
        lock_borders(b);
        status = simplify(b);
        b->report.simplify_ns += hg_clock_now_ns() - start;
    }
    uint32_t kept = 0;
    if (status == HG_OK)
        status = keep_groups(b, false, &kept);
    if (status == HG_OK && kept > 0)
        status = next_pool(b);
    drop_jobs(b);
    *more = kept > 0;
    b->level += kept > 0;
    return status;
}

static enum hg_status build_roots(struct build *b, uint32_t *root_chunks)
{
    uint32_t kept = 0;
    const uint32_t first = b->chunk_count;
    *root_chunks = 0;
    if (b->pool.count == 0)
        return HG_OK;
    enum hg_status status = group_pool(b, NULL);
    for (uint32_t g = 0; status == HG_OK && g < b->group_count; g++) {
        b->jobs[g].members = b->members + b->first[g];
        b->jobs[g].member_count = b->first[g + 1] - b->first[g];
    }
    if (status == HG_OK)
        status = keep_groups(b, true, &kept);
    drop_jobs(b);
    b->level++;
    *root_chunks = b->chunk_count - first;
    return status;
}

// ---- from the order of building to the order of the file ----------------------------------------

// Levels were built from fine to coarse; `from` says which old group or chunk a new one is.
struct order {
    uint32_t *group_from, *group_to, *chunk_from;
};

static enum hg_status find_order(const struct build *b, struct order *o)
{
    o->group_from = hg_calloc(b->built_groups, 4);
    o->group_to = hg_calloc(b->built_groups, 4);
    o->chunk_from = hg_calloc(b->chunk_count, 4);
    if (o->group_from == NULL || o->group_to == NULL || o->chunk_from == NULL)
        return HG_E_NOMEM;
    uint32_t groups = 0, chunks = 0;
    for (uint32_t end = b->chunk_count; end > 0;) {
        uint32_t first = end - 1;
        const uint32_t level = b->groups[b->chunks[first].first_group].level;
        while (first > 0 && b->groups[b->chunks[first - 1].first_group].level == level)
            first--;
        for (uint32_t c = first; c < end; c++) {
            o->chunk_from[chunks++] = c;
            for (uint32_t g = 0; g < b->chunks[c].group_count; g++) {
                o->group_to[b->chunks[c].first_group + g] = groups;
                o->group_from[groups++] = b->chunks[c].first_group + g;
            }
        }
        end = first;
    }
    return HG_OK;
}

static void reorder(
    const struct build *b, const struct order *o, struct hg_lod_file *f, struct hg_writer *bytes)
{
    uint32_t cluster = 0, group = 0;
    for (uint32_t c = 0; c < b->chunk_count; c++) {
        f->chunks[c] = b->chunks[o->chunk_from[c]];
        hg_write_bytes(bytes, b->bytes.data + f->chunks[c].offset, f->chunks[c].bytes);
        for (uint32_t i = 0; i < f->chunks[c].group_count; i++, group++) {
            struct hg_lod_group *g = &f->groups[group];
            *g = b->groups[o->group_from[group]];
            g->chunk = c;
            for (uint32_t k = 0; k < g->cluster_count; k++) {
                struct hg_lod_cluster *to = &f->clusters[cluster + k];
                *to = b->clusters[g->first_cluster + k];
                to->group = group;
                if (to->made_from != HG_LOD_NONE)
                    to->made_from = o->group_to[to->made_from];
            }
            g->first_cluster = cluster;
            cluster += g->cluster_count;
        }
    }
}

static void fill_head(const struct build *b, struct hg_lod_file *f, uint32_t root_chunks)
{
    struct hg_lod *l = &f->lod;
    f->format = b->mesh.format;
    l->cluster_count = b->cluster_count;
    l->group_count = b->built_groups;
    l->chunk_count = b->chunk_count;
    l->root_chunk_count = root_chunks;
    l->level_count = b->level;
    l->flags = b->mesh.format.flags;
    l->quantum = b->mesh.format.quantum;
    l->source_error = l->quantum * 0.8660255f;
    l->source_triangles = b->mesh.triangle_count;
    l->stored_triangles = b->report.stored_triangles;
    for (uint32_t i = 0; i < b->mesh.position_count; i++) {
        for (int k = 0; k < 3; k++) {
            const float v = (float)b->mesh.lattice[i][k] * l->quantum;
            l->min[k] = i == 0 ? v : fminf(l->min[k], v);
            l->max[k] = i == 0 ? v : fmaxf(l->max[k], v);
        }
    }
}

static enum hg_status assemble(struct build *b, uint32_t root_chunks, struct hg_writer *out)
{
    struct hg_lod_file f = {0};
    struct order o = {0};
    struct hg_writer bytes = {0};
    enum hg_status status = find_order(b, &o);
    f.clusters = hg_calloc(b->cluster_count, sizeof *f.clusters);
    f.groups = hg_calloc(b->built_groups, sizeof *f.groups);
    f.chunks = hg_calloc(b->chunk_count, sizeof *f.chunks);
    if (f.clusters == NULL || f.groups == NULL || f.chunks == NULL)
        status = HG_E_NOMEM;
    if (status == HG_OK) {
        fill_head(b, &f, root_chunks);
        reorder(b, &o, &f, &bytes);
        hg_writer_finish(&b->bytes);
        status = bytes.failed ? HG_E_NOMEM : hg_lod_write(&f, bytes.data, bytes.size, out);
    }
    hg_writer_finish(&bytes);
    hg_free(o.group_from);
    hg_free(o.group_to);
    hg_free(o.chunk_from);
    hg_free(f.clusters);
    hg_free(f.groups);
    hg_free(f.chunks);
    return status;
}

// ---- all of it ----------------------------------------------------------------------------------

static enum hg_status begin(struct build *b, const struct hg_mesh_part *part)
{
    uint64_t start = hg_clock_now_ns();
    enum hg_status status = hg_lod_weld(part, b->params, &b->budget, &b->mesh, b->err);
    if (status == HG_OK)
        status = hg_lod_find_pieces(&b->mesh, &b->budget);
    b->report.weld_ns = hg_clock_now_ns() - start;
    const uint32_t n = b->mesh.triangle_count;
    if (status != HG_OK)
        return status;
    b->total = n * 2ull + 1;
    const uint64_t positions = b->mesh.position_count;
    uint32_t *starts = NULL, count = 0, bound = hg_lod_cut_bound(n) + 1;
    if ((status = hg_lod_take(&b->budget, positions, 1, &b->locked)) != HG_OK ||
        (status = hg_lod_take(&b->budget, positions, 1, &b->open)) != HG_OK ||
        (status = hg_lod_take(&b->budget, positions, 4, &b->owner)) != HG_OK ||
        (status = hg_lod_take(&b->budget, bound, 4, &starts)) != HG_OK)
        return status;
    const uint64_t scratch = b->budget.used + n * 28ull; // of the cut
    if (b->budget.limit > 0 && scratch > b->budget.limit)
        status = HG_E_LIMIT;
    b->budget.peak = scratch > b->budget.peak ? scratch : b->budget.peak;
    start = hg_clock_now_ns();
    if (status == HG_OK)
        status = hg_lod_cut(&b->mesh, b->mesh.triangles, n, starts, &count, NULL, b->params->jobs);
    if (status == HG_OK && count > 0)
        status = hg_lod_first_pieces(&b->mesh, starts, count, &b->pool);
    b->report.cluster_ns = hg_clock_now_ns() - start;
    hg_lod_give(&b->budget, &starts, bound, 4);
    return status;
}

static void finish(struct build *b)
{
    drop_jobs(b);
    for (uint32_t i = 0; i < b->pool.count; i++)
        hg_lod_product_unref(b->pool.items[i].product);
    hg_free(b->pool.items);
    const uint64_t positions = b->mesh.position_count;
    hg_lod_give(&b->budget, &b->locked, positions, 1);
    hg_lod_give(&b->budget, &b->open, positions, 1);
    hg_lod_give(&b->budget, &b->owner, positions, 4);
    hg_lod_mesh_finish(&b->mesh, &b->budget);
    hg_free(b->group_of);
    hg_free(b->members);
    hg_free(b->first);
    hg_free(b->clusters);
    hg_free(b->groups);
    hg_free(b->chunks);
    hg_writer_finish(&b->bytes);
}

static void fill_report(struct build *b, const struct hg_writer *out, uint64_t start)
{
    struct hg_lod_report *r = &b->report;
    r->source_triangles = b->mesh.triangle_count;
    r->file_bytes = out->size;
    r->peak_bytes = b->budget.peak + out->size * 2;
    r->clusters = b->cluster_count;
    r->groups = b->built_groups;
    r->levels = b->level;
    r->chunks = b->chunk_count;
    r->quantum = b->mesh.format.quantum;
    r->total_ns = hg_clock_now_ns() - start;
}

enum hg_status hg_lod_bake(const struct hg_mesh_part *part, const struct hg_lod_params *params,
    uint8_t **data, size_t *size, struct hg_lod_report *report, struct hg_error *err)
{
    *data = NULL;
    *size = 0;
    if (report != NULL)
        memset(report, 0, sizeof *report);
    struct build b = {
        .params = params, .err = err, .budget = {.limit = params->memory_limit_bytes}};
    struct hg_writer out = {0};
    const uint64_t start = hg_clock_now_ns();
    uint32_t root_chunks = 0;
    enum hg_status status = begin(&b, part);
    for (bool more = true; status == HG_OK && more;)
        status = build_level(&b, &more);
    if (status == HG_OK)
        status = build_roots(&b, &root_chunks);
    if (status == HG_OK)
        status = assemble(&b, root_chunks, &out);
    if (status == HG_OK) {
        b.done = b.total;
        status = tell(&b);
    }
    if (status == HG_OK) {
        fill_report(&b, &out, start);
        *data = out.data;
        *size = out.size;
        if (report != NULL)
            *report = b.report;
    } else {
        hg_writer_finish(&out);
        status = fail(&b, status);
    }
    finish(&b);
    return status;
}

bool hg_lod_can_bake(const struct hg_mesh_part *part, uint32_t target_count)
{
    return part->topology == HG_TOPOLOGY_TRIANGLES && part->joints == NULL &&
           (part->targets == NULL || target_count == 0);
}

// ---- key ----------------------------------------------------------------------------------------

static void hash_array(struct hg_sha256 *h, const float *values, uint64_t count)
{
    const uint8_t present = values != NULL;
    hg_sha256_update(h, &present, 1);
    if (present)
        hg_sha256_update(h, values, (size_t)count * sizeof *values);
}

enum hg_status hg_lod_key(
    const struct hg_mesh_part *part, const struct hg_lod_params *params, uint8_t key[32])
{
    struct hg_sha256 *h = hg_sha256_create();
    memset(key, 0, 32);
    if (h == NULL)
        return HG_E_NOMEM;
    const uint32_t numbers[] = {HG_LOD_VERSION, (uint32_t)part->topology, part->vertex_count,
        part->index_count, part->joint_sets};
    const float floats[] = {
        params->quantum, params->normal_weight, params->color_weight, params->uv_weight};
    const uint64_t n = part->vertex_count;
    hg_sha256_update(h, numbers, sizeof numbers);
    hg_sha256_update(h, floats, sizeof floats);
    hg_sha256_update(h, part->indices, (size_t)part->index_count * 4);
    hash_array(h, part->positions, n * 3);
    hash_array(h, part->normals, n * 3);
    hash_array(h, part->tangents, n * 4);
    hash_array(h, part->uv[0], n * 2);
    hash_array(h, part->uv[1], n * 2);
    hash_array(h, part->colors, n * 4);
    hg_sha256_end(h, key);
    return HG_OK;
}
