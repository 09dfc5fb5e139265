// bake.c - a part to the bytes of its hierarchy: weld, cut, then level after level group,
// simplify, encode what was grouped and go on with what was made from it.
#include <float.h>
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "base/sha256.h"
#include "base/spill.h"
#include "renderer/lod/build.h"

#define LEVELS_MAX  64u
#define BYTES_GUESS ((size_t)8) // of chunks, per triangle

void hg_lod_build_each(const struct hg_lod_build *b, size_t count, hg_jobs_fn *fn, void *user)
{
    if (b->params->jobs != NULL) {
        hg_jobs_for(b->params->jobs, count, fn, user);
        return;
    }
    for (size_t i = 0; i < count; i++)
        fn(user, i);
}

static enum hg_status fail(struct hg_lod_build *b, enum hg_status status)
{
    if (b->err != NULL && b->err->status == status)
        return status; // said already
    return hg_error_set(b->err, status, "cluster bake", NULL,
        status == HG_E_LIMIT ? "it passes the memory limit" : "no memory");
}

enum hg_status hg_lod_build_tell(struct hg_lod_build *b)
{
    if (b->params->progress == NULL || b->params->progress(b->params->progress_user,
                                           b->done < b->total ? b->done : b->total, b->total))
        return HG_OK;
    return hg_error_set(b->err, HG_E_CANCELLED, "cluster bake", NULL, "cancelled");
}

// ---- the surface of a level ---------------------------------------------------------------------

static enum hg_status reserve(struct hg_lod_build *b)
{
    const size_t n = b->surface.pool.count;
    size_t c[3] = {b->surface.capacity, b->surface.capacity, b->surface.capacity};
    if (hg_grow(&b->surface.group_of, &c[0], n + 1, 4) != HG_OK ||
        hg_grow(&b->surface.members, &c[1], n + 1, 4) != HG_OK ||
        hg_grow(&b->surface.first, &c[2], n + 1, 4) != HG_OK)
        return HG_E_NOMEM;
    b->surface.capacity = c[0] < c[1] ? c[0] : c[1];
    b->surface.capacity = c[2] < b->surface.capacity ? c[2] : b->surface.capacity;
    return HG_OK;
}

static enum hg_status partition(struct hg_lod_build *b, uint8_t *open)
{
    const uint32_t n = b->surface.pool.count;
    struct hg_lod_pool pool = {.count = n};
    const uint32_t **triangles = hg_calloc(n, sizeof *triangles);
    uint32_t *counts = hg_calloc((size_t)n * 2, sizeof *counts);
    float(*center)[3] = hg_calloc(n, sizeof *center);
    enum hg_status status = HG_E_NOMEM;
    if (triangles != NULL && counts != NULL && center != NULL) {
        for (uint32_t i = 0; i < n; i++) {
            triangles[i] = b->surface.pool.items[i].triangles;
            counts[i] = b->surface.pool.items[i].info.triangle_count;
            counts[n + i] = b->surface.pool.items[i].vertex_count;
            memcpy(center[i], b->surface.pool.items[i].info.center, sizeof center[i]);
        }
        pool.triangles = triangles;
        pool.triangle_count = counts;
        pool.vertex_count = counts + n;
        pool.center = (const float(*)[3])center;
        status =
            hg_lod_partition(&b->mesh, &pool, b->surface.group_of, &b->surface.group_count, open);
    }
    hg_free(triangles);
    hg_free(counts);
    hg_free(center);
    return status;
}

// Members of each group, in the order of the pool.
static void sort_members(struct hg_lod_build *b)
{
    memset(b->surface.first, 0, ((size_t)b->surface.group_count + 1) * 4);
    for (uint32_t i = 0; i < b->surface.pool.count; i++)
        b->surface.first[b->surface.group_of[i] + 1]++;
    for (uint32_t g = 0; g < b->surface.group_count; g++)
        b->surface.first[g + 1] += b->surface.first[g];
    for (uint32_t i = 0; i < b->surface.pool.count; i++)
        b->surface.members[b->surface.first[b->surface.group_of[i]]++] = i;
    for (uint32_t g = b->surface.group_count; g > 0; g--)
        b->surface.first[g] = b->surface.first[g - 1];
    b->surface.first[0] = 0;
}

// Positions that more than one group has must stay where they are. Owners of this level are told
// from older ones, of which all are less than `owner_base`.
static void lock_borders(struct hg_lod_build *b)
{
    const struct hg_lod_mesh *m = &b->mesh;
    for (uint32_t i = 0; i < b->surface.pool.count; i++) {
        const struct hg_lod_piece *p = &b->surface.pool.items[i];
        const uint32_t group = b->borders.owner_base + b->surface.group_of[i];
        for (uint32_t k = 0; k < p->info.triangle_count * 3; k++) {
            const uint32_t at = m->position_of[p->triangles[k]], owner = b->borders.owner[at];
            if (owner == group)
                continue;
            b->borders.locked[at] = owner >= b->borders.owner_base;
            b->borders.owner[at] = group;
        }
    }
    b->borders.owner_base += b->surface.group_count;
}

// ---- simplification -----------------------------------------------------------------------------

static void run_group(void *user, size_t index)
{
    struct hg_lod_group_job *jobs = user;
    hg_lod_group_run(&jobs[index]);
}

static enum hg_status account(struct hg_lod_build *b, const struct hg_lod_group_job *job)
{
    if (job->product == NULL)
        return HG_OK;
    b->budget.used += job->product->triangle_count * 12ull +
                      job->product->sample_count * sizeof(struct hg_lod_sample);
    if (b->budget.used > b->budget.peak)
        b->budget.peak = b->budget.used;
    return b->budget.limit > 0 && b->budget.used > b->budget.limit ? HG_E_LIMIT : HG_OK;
}

static enum hg_status simplify(struct hg_lod_build *b)
{
    const struct hg_lod_params *p = b->params;
    const struct hg_lod_weights weights = {
        p->normal_weight == 0.0f ? 0.35f : fmaxf(p->normal_weight, 0.0f),
        p->color_weight == 0.0f ? 0.25f : fmaxf(p->color_weight, 0.0f),
        p->uv_weight == 0.0f ? 0.5f : fmaxf(p->uv_weight, 0.0f)};
    // Coarse levels have few clusters, so they can afford more samples each.
    const uint32_t samples = b->level < 12 ? 64 + 48 * b->level : 640;
    for (uint32_t g = 0; g < b->surface.group_count; g++)
        b->surface.jobs[g] = (struct hg_lod_group_job){.samples_per_piece = samples,
            .mesh = &b->mesh,
            .locked = b->borders.locked,
            .open = b->borders.open,
            .weights = weights,
            .pieces = b->surface.pool.items,
            .members = b->surface.members + b->surface.first[g],
            .member_count = b->surface.first[g + 1] - b->surface.first[g]};
    for (uint32_t g = 0; g < b->surface.group_count; g += HG_LOD_BATCH) {
        const uint32_t n =
            b->surface.group_count - g < HG_LOD_BATCH ? b->surface.group_count - g : HG_LOD_BATCH;
        hg_lod_build_each(b, n, run_group, b->surface.jobs + g);
        for (uint32_t i = 0; i < n; i++) {
            const struct hg_lod_group_job *job = &b->surface.jobs[g + i];
            enum hg_status status = job->status != HG_OK ? job->status : account(b, job);
            if (status != HG_OK)
                return status;
            b->done += job->triangle_count;
        }
        const enum hg_status status = hg_lod_build_tell(b);
        if (status != HG_OK)
            return status;
    }
    return HG_OK;
}

// ---- finished groups ----------------------------------------------------------------------------

// Sphere and error of a group: at least those of everything it is made of.
static void finish_group(const struct hg_lod_build *b, const struct hg_lod_group_job *job,
    bool terminal, struct hg_lod_group *out)
{
    struct hg_lod_sphere spheres[HG_LOD_GROUP_CLUSTERS * 2];
    uint32_t n = 0;
    float error = job->error + b->mesh.format.quantum * 0.8660255f;
    for (uint32_t i = 0; i < job->member_count; i++) {
        const struct hg_lod_cluster *c = &b->surface.pool.items[job->members[i]].info;
        memcpy(spheres[n].center, c->center, sizeof c->center);
        spheres[n++].radius = c->radius;
        if (c->made_from == HG_LOD_NONE)
            continue;
        const struct hg_lod_group *from = &b->built.groups[c->made_from];
        memcpy(spheres[n].center, from->center, sizeof from->center);
        spheres[n++].radius = from->radius;
        error = fmaxf(error, from->error * 1.0001f);
    }
    const struct hg_lod_sphere s = hg_lod_sphere_around(spheres, n);
    memcpy(out->center, s.center, sizeof s.center);
    out->radius = s.radius;
    out->error = terminal ? FLT_MAX : fminf(error, 0.5f * FLT_MAX);
    out->first_cluster = b->built.cluster_count;
    out->cluster_count = job->member_count;
    out->level = b->level;
}

// Adds group and clusters to what is finished; numbers those made from it.
static enum hg_status add_group(struct hg_lod_build *b, struct hg_lod_group_job *job, bool terminal)
{
    if (hg_grow(&b->built.groups, &b->built.group_capacity, b->built.group_count + 1ull,
            sizeof *b->built.groups) ||
        hg_grow(&b->built.clusters, &b->built.cluster_capacity,
            (size_t)b->built.cluster_count + job->member_count, sizeof *b->built.clusters))
        return HG_E_NOMEM;
    struct hg_lod_group *group = &b->built.groups[b->built.group_count];
    memset(group, 0, sizeof *group);
    finish_group(b, job, terminal, group);
    for (uint32_t i = 0; i < job->member_count; i++) {
        struct hg_lod_cluster *c = &b->built.clusters[b->built.cluster_count++];
        *c = b->surface.pool.items[job->members[i]].info;
        c->group = b->built.group_count;
        b->report.stored_triangles += c->triangle_count;
        b->report.terminal_clusters += terminal;
    }
    for (uint32_t i = 0; i < job->made_count; i++)
        job->made[i].info.made_from = b->built.group_count;
    if (!terminal)
        b->report.root_error = fmaxf(b->report.root_error, group->error);
    b->built.group_count++;
    return HG_OK;
}

// ---- levels -------------------------------------------------------------------------------------

static void release_member(struct hg_lod_build *b, struct hg_lod_piece *piece)
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
static enum hg_status next_pool(struct hg_lod_build *b)
{
    struct hg_lod_pieces next = {0};
    uint64_t count = 0;
    for (uint32_t g = 0; g < b->surface.group_count; g++)
        count += b->surface.jobs[g].product != NULL ? b->surface.jobs[g].made_count
                                                    : b->surface.jobs[g].member_count;
    if (hg_grow(&next.items, &next.capacity, count, sizeof *next.items) != HG_OK)
        return HG_E_NOMEM;
    for (uint32_t g = 0; g < b->surface.group_count; g++) {
        struct hg_lod_group_job *job = &b->surface.jobs[g];
        for (uint32_t i = 0; job->product != NULL && i < job->made_count; i++)
            next.items[next.count++] = job->made[i];
        for (uint32_t i = 0; i < job->member_count; i++) {
            if (job->product != NULL)
                release_member(b, &b->surface.pool.items[job->members[i]]);
            else
                next.items[next.count++] = b->surface.pool.items[job->members[i]];
        }
        job->product = NULL;
        hg_free(job->made);
        job->made = NULL;
    }
    hg_free(b->surface.pool.items);
    b->surface.pool = next;
    return HG_OK;
}

static enum hg_status group_pool(struct hg_lod_build *b, uint8_t *open)
{
    const uint64_t start = hg_clock_now_ns();
    enum hg_status status = reserve(b);
    if (status == HG_OK)
        status = partition(b, open);
    if (status == HG_OK)
        sort_members(b);
    b->surface.jobs =
        status == HG_OK ? hg_calloc(b->surface.group_count, sizeof *b->surface.jobs) : NULL;
    if (status == HG_OK && b->surface.jobs == NULL)
        status = HG_E_NOMEM;
    b->report.group_ns += hg_clock_now_ns() - start;
    return status;
}

// Groups of this level have been encoded, so its vertices may become those of the next. (What is
// held still waits for that: the levels that share the last chunk share their normals.)
static void turn_normals(struct hg_lod_build *b)
{
    struct hg_lod_mesh *m = &b->mesh;
    for (uint32_t g = 0; !b->held.active && g < b->surface.group_count; g++) {
        const struct hg_lod_group_job *job = &b->surface.jobs[g];
        for (uint32_t i = 0; i < job->mean_count; i++)
            m->words[(size_t)job->means[i].vertex * m->format.words + (uint32_t)m->format.normal] =
                job->means[i].word;
    }
}

static void drop_jobs(struct hg_lod_build *b)
{
    for (uint32_t g = 0; b->surface.jobs != NULL && g < b->surface.group_count; g++) {
        struct hg_lod_group_job *job = &b->surface.jobs[g];
        if (job->product != NULL) {
            job->product->users = 1;
            hg_lod_product_unref(job->product);
        }
        hg_free(job->made);
        hg_free(job->means);
    }
    hg_free(b->surface.jobs);
    b->surface.jobs = NULL;
}

// Once all that is left would fit into one chunk, groups wait for the coarser ones: they share it.
static void choose_holding(struct hg_lod_build *b)
{
    uint64_t bytes = 0;
    for (uint32_t g = 0; g < b->surface.group_count; g++)
        bytes += hg_lod_group_bytes(b, &b->surface.jobs[g]);
    b->held.active = b->held.active || bytes <= HG_LOD_CHUNK_BYTES;
}

// Adds the groups that were simplified (or all, as terminal ones) and encodes or holds them.
static enum hg_status keep_groups(struct hg_lod_build *b, bool terminal, uint32_t *kept)
{
    uint32_t *list = hg_calloc(b->surface.group_count, sizeof *list);
    const uint32_t first = b->built.group_count;
    enum hg_status status = list != NULL ? HG_OK : HG_E_NOMEM;
    *kept = 0;
    choose_holding(b);
    for (uint32_t g = 0; status == HG_OK && g < b->surface.group_count; g++) {
        struct hg_lod_group_job *job = &b->surface.jobs[g];
        if (!terminal && job->product == NULL)
            continue;
        job->triangle_count = 0;
        for (uint32_t i = 0; i < job->member_count; i++)
            job->triangle_count += b->surface.pool.items[job->members[i]].info.triangle_count;
        status = add_group(b, job, terminal);
        if (status == HG_OK && b->held.active)
            status = hg_lod_hold_group(b, job);
        list[(*kept)++] = g;
    }
    if (status == HG_OK && *kept > 0 && !b->held.active)
        status = hg_lod_encode_groups(b, list, *kept, first);
    hg_free(list);
    return status;
}

// One level up. *more is false when the rest of the pool is as coarse as it gets.
static enum hg_status build_level(struct hg_lod_build *b, bool *more)
{
    *more = false;
    if (b->surface.pool.count <= 1 || b->level + 1 >= LEVELS_MAX)
        return HG_OK;
    enum hg_status status = group_pool(b, b->level == 0 ? b->borders.open : NULL);
    const uint64_t start = hg_clock_now_ns();
    if (status == HG_OK && b->level == 0)
        status = hg_lod_first_samples(&b->mesh, b->borders.open, &b->surface.pool);
    if (status == HG_OK && b->level == 0)
        b->budget.used +=
            b->surface.pool.items[0].product->sample_count * sizeof(struct hg_lod_sample);
    if (status == HG_OK) {
        lock_borders(b);
        status = simplify(b);
        b->report.simplify_ns += hg_clock_now_ns() - start;
    }
    uint32_t kept = 0;
    if (status == HG_OK)
        status = keep_groups(b, false, &kept);
    if (status == HG_OK)
        turn_normals(b);
    if (status == HG_OK && kept > 0)
        status = next_pool(b);
    drop_jobs(b);
    *more = kept > 0;
    b->level += kept > 0;
    return status;
}

static enum hg_status build_roots(struct hg_lod_build *b, uint32_t *root_chunks)
{
    uint32_t kept = 0;
    const uint32_t first = b->built.chunk_count;
    *root_chunks = 0;
    if (b->surface.pool.count == 0)
        return HG_OK;
    enum hg_status status = group_pool(b, NULL);
    for (uint32_t g = 0; status == HG_OK && g < b->surface.group_count; g++) {
        b->surface.jobs[g].members = b->surface.members + b->surface.first[g];
        b->surface.jobs[g].member_count = b->surface.first[g + 1] - b->surface.first[g];
    }
    if (status == HG_OK)
        status = keep_groups(b, true, &kept);
    drop_jobs(b);
    b->level++;
    b->held.first_chunk = b->built.chunk_count;
    *root_chunks = b->built.chunk_count - first;
    return status == HG_OK && b->held.active ? hg_lod_encode_held(b, root_chunks) : status;
}

// ---- all of it ----------------------------------------------------------------------------------

static enum hg_status cut_mesh(struct hg_lod_build *b, struct hg_lod_cut *out)
{
    const uint32_t n = b->mesh.triangle_count;
    const uint64_t scratch = b->budget.used + n * 28ull; // of the cut
    if (b->budget.limit > 0 && scratch > b->budget.limit)
        return HG_E_LIMIT;
    b->budget.peak = scratch > b->budget.peak ? scratch : b->budget.peak;
    enum hg_status status = hg_lod_cut(&b->mesh, b->mesh.triangles, n, out, b->params->jobs);
    if (status == HG_OK)
        status = hg_lod_mesh_reorder(&b->mesh, &b->budget);
    return status == HG_OK ? hg_lod_find_pieces(&b->mesh, &b->budget) : status;
}

static enum hg_status begin(struct hg_lod_build *b, const struct hg_mesh_part *part)
{
    uint64_t start = hg_clock_now_ns();
    enum hg_status status = hg_lod_weld(part, b->params, &b->budget, &b->mesh, b->err);
    b->report.weld_ns = hg_clock_now_ns() - start;
    if (status != HG_OK)
        return status;
    b->total = b->mesh.triangle_count * 2ull + 1;
    b->borders.owner_base = 1;
    hg_writer_spill(&b->built.bytes, b->mesh.triangle_count * BYTES_GUESS);
    struct hg_lod_cut cut = {0};
    const uint32_t bound = hg_lod_cut_bound(b->mesh.triangle_count) + 1;
    status = hg_lod_take(&b->budget, bound, 4, &cut.starts);
    start = hg_clock_now_ns();
    if (status == HG_OK)
        status = cut_mesh(b, &cut);
    if (status == HG_OK && cut.count > 0)
        status = hg_lod_first_pieces(&b->mesh, cut.starts, cut.count, &b->surface.pool);
    b->report.cluster_ns = hg_clock_now_ns() - start;
    hg_lod_give(&b->budget, &cut.starts, bound, 4);
    const uint64_t positions = b->mesh.position_count;
    if (status != HG_OK ||
        (status = hg_lod_take(&b->budget, positions, 1, &b->borders.locked)) != HG_OK ||
        (status = hg_lod_take(&b->budget, positions, 1, &b->borders.open)) != HG_OK)
        return status;
    return hg_lod_take(&b->budget, positions, 4, &b->borders.owner);
}

static void finish(struct hg_lod_build *b)
{
    drop_jobs(b);
    for (uint32_t i = 0; i < b->surface.pool.count; i++)
        hg_lod_product_unref(b->surface.pool.items[i].product);
    hg_free(b->surface.pool.items);
    const uint64_t positions = b->mesh.position_count;
    hg_lod_give(&b->budget, &b->borders.locked, positions, 1);
    hg_lod_give(&b->budget, &b->borders.open, positions, 1);
    hg_lod_give(&b->budget, &b->borders.owner, positions, 4);
    hg_lod_mesh_finish(&b->mesh, &b->budget);
    hg_free(b->surface.group_of);
    hg_free(b->surface.members);
    hg_free(b->surface.first);
    hg_free(b->built.clusters);
    hg_free(b->built.groups);
    hg_free(b->built.chunks);
    hg_lod_drop_held(b);
    hg_writer_finish(&b->built.bytes);
}

static void fill_report(struct hg_lod_build *b, const struct hg_writer *out, uint64_t start)
{
    struct hg_lod_report *r = &b->report;
    r->source_triangles = b->mesh.triangle_count;
    r->file_bytes = out->size;
    r->peak_bytes = b->budget.peak + out->size * 2;
    r->clusters = b->built.cluster_count;
    r->groups = b->built.group_count;
    r->levels = b->level;
    r->chunks = b->built.chunk_count;
    r->quantum = b->mesh.format.quantum;
    r->total_ns = hg_clock_now_ns() - start;
}

static enum hg_status build_triangles(
    struct hg_lod_build *b, const struct hg_mesh_part *part, uint32_t *root_chunks)
{
    enum hg_status status = begin(b, part);
    for (bool more = true; status == HG_OK && more;)
        status = build_level(b, &more);
    return status == HG_OK ? build_roots(b, root_chunks) : status;
}

enum hg_status hg_lod_bake(const struct hg_mesh_part *part, const struct hg_lod_params *params,
    uint8_t **data, size_t *size, struct hg_lod_report *report, struct hg_error *err)
{
    *data = NULL;
    *size = 0;
    if (report != NULL)
        memset(report, 0, sizeof *report);
    struct hg_lod_build b = {
        .params = params, .err = err, .budget = {.limit = params->memory_limit_bytes}};
    struct hg_writer out = {0};
    const uint64_t start = hg_clock_now_ns();
    uint32_t root_chunks = 0;
    hg_spill_begin(NULL);
    enum hg_status status = part->topology == HG_TOPOLOGY_POINTS
                                ? hg_lod_build_points(&b, part, &root_chunks)
                                : build_triangles(&b, part, &root_chunks);
    if (status == HG_OK)
        status = hg_lod_assemble(&b, root_chunks, &out);
    if (status == HG_OK) {
        b.done = b.total;
        status = hg_lod_build_tell(&b);
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
    hg_spill_end();
    return status;
}

bool hg_lod_can_bake(const struct hg_mesh_part *part, uint32_t target_count)
{
    return part->topology != HG_TOPOLOGY_LINES && part->joints == NULL &&
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
    const float floats[] = {params->quantum, params->normal_weight, params->color_weight,
        params->uv_weight, part->point_scale, part->point_diameter};
    const bool points = part->topology == HG_TOPOLOGY_POINTS;
    const uint64_t n = part->vertex_count;
    hg_spill_begin(NULL);
    hg_sha256_update(h, numbers, sizeof numbers);
    hg_sha256_update(h, floats, sizeof floats - (points ? 0 : 2 * sizeof *floats));
    hg_sha256_update(h, part->indices, (size_t)part->index_count * 4);
    hash_array(h, part->positions, n * 3);
    hash_array(h, part->normals, n * 3);
    hash_array(h, part->tangents, n * 4);
    hash_array(h, part->uv[0], n * 2);
    hash_array(h, part->uv[1], n * 2);
    hash_array(h, part->colors, n * 4);
    hg_sha256_end(h, key);
    hg_spill_end();
    return HG_OK;
}
