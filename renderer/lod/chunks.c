// chunks.c - finished groups into chunks, and these into a file. The groups of a level share
// chunks with their neighbours; the coarse levels, once all of one fits into a chunk, wait for each
// other and share chunks too, so a small part is one chunk and not one per level.
#include <float.h>
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "base/spill.h"
#include "base/clock.h"
#include "renderer/lod/build.h"

// ---- chunks -------------------------------------------------------------------------------------

struct chunk_job {
    const struct hg_lod_build *build;
    const uint32_t *groups; // [group_count] numbers of jobs
    uint32_t group_count;
    struct hg_writer bytes;
    struct hg_lod_chunk chunk;
    enum hg_status status;
};

static void encode_chunk(void *user, size_t index)
{
    struct chunk_job *job = (struct chunk_job *)user + index;
    const struct hg_lod_build *b = job->build;
    uint32_t clusters = 0, triangles = 0, at = 0;
    for (uint32_t g = 0; g < job->group_count; g++) {
        clusters += b->surface.jobs[job->groups[g]].member_count;
        triangles += b->surface.jobs[job->groups[g]].triangle_count;
    }
    uint32_t *list = hg_calloc(triangles, 12), *counts = hg_calloc(clusters, 4);
    job->status = HG_E_NOMEM;
    if (list != NULL && counts != NULL) {
        clusters = 0;
        for (uint32_t g = 0; g < job->group_count; g++) {
            const struct hg_lod_group_job *group = &b->surface.jobs[job->groups[g]];
            for (uint32_t i = 0; i < group->member_count; i++) {
                const struct hg_lod_piece *p = &b->surface.pool.items[group->members[i]];
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

uint32_t hg_lod_group_bytes(const struct hg_lod_build *b, const struct hg_lod_group_job *job)
{
    const uint32_t vertex =
        12 + (uint32_t)sizeof(struct hg_gpu_vertex) + b->mesh.format.extra_words * 4;
    uint32_t bytes = 64;
    for (uint32_t i = 0; i < job->member_count; i++) {
        const struct hg_lod_piece *p = &b->surface.pool.items[job->members[i]];
        bytes += p->info.triangle_count * 12 + p->vertex_count * vertex;
    }
    return bytes;
}

// Groups in a row share a chunk while they fit.
static uint32_t plan_chunks(
    const struct hg_lod_build *b, const uint32_t *groups, uint32_t count, struct chunk_job *out)
{
    uint32_t n = 0, bytes = 0;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t size = hg_lod_group_bytes(b, &b->surface.jobs[groups[i]]);
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

// Takes over an encoded chunk of groups [first_group, first_group + chunk.group_count).
static enum hg_status keep_chunk(struct hg_lod_build *b, struct hg_lod_chunk *chunk,
    const struct hg_writer *bytes, uint32_t first_group)
{
    if (hg_grow(&b->built.chunks, &b->built.chunk_capacity, b->built.chunk_count + 1ull,
            sizeof *b->built.chunks) != HG_OK)
        return HG_E_NOMEM;
    chunk->offset = b->built.bytes.size;
    chunk->first_group = first_group;
    for (uint32_t g = 0; g < chunk->group_count; g++)
        b->built.groups[first_group + g].chunk = b->built.chunk_count;
    b->built.chunks[b->built.chunk_count++] = *chunk;
    hg_write_bytes(&b->built.bytes, bytes->data, bytes->size);
    struct hg_lod_layout layout;
    hg_lod_layout_of(&b->mesh.format, chunk, &layout);
    b->report.decoded_bytes += layout.total_bytes;
    return b->built.bytes.failed ? HG_E_NOMEM : HG_OK;
}

enum hg_status hg_lod_encode_groups(
    struct hg_lod_build *b, const uint32_t *groups, uint32_t count, uint32_t first_group)
{
    const uint64_t start = hg_clock_now_ns();
    struct chunk_job *jobs = hg_calloc(count, sizeof *jobs);
    if (jobs == NULL)
        return HG_E_NOMEM;
    const uint32_t n = plan_chunks(b, groups, count, jobs);
    enum hg_status status = HG_OK;
    for (uint32_t c = 0; c < n && status == HG_OK; c += HG_LOD_BATCH) {
        const uint32_t some = n - c < HG_LOD_BATCH ? n - c : HG_LOD_BATCH;
        hg_lod_build_each(b, some, encode_chunk, jobs + c);
        for (uint32_t i = c; i < c + some; i++) {
            if (status == HG_OK)
                status = jobs[i].status;
            if (status == HG_OK)
                status = keep_chunk(b, &jobs[i].chunk, &jobs[i].bytes, first_group);
            first_group += jobs[i].group_count;
            hg_writer_finish(&jobs[i].bytes);
        }
        if (status == HG_OK)
            status = hg_lod_build_tell(b);
    }
    hg_free(jobs);
    b->report.encode_ns += hg_clock_now_ns() - start;
    return status;
}

// ---- chunks of several levels -------------------------------------------------------------------

enum hg_status hg_lod_hold_group(struct hg_lod_build *b, const struct hg_lod_group_job *job)
{
    if (hg_grow(&b->held.groups, &b->held.capacity, b->held.count + 1ull, sizeof *b->held.groups) !=
        HG_OK)
        return HG_E_NOMEM;
    struct hg_lod_held *h = &b->held.groups[b->held.count];
    const size_t words = (size_t)job->triangle_count * 3 + job->member_count;
    *h = (struct hg_lod_held){.triangles = hg_calloc(words, 4),
        .triangle_count = job->triangle_count,
        .cluster_count = job->member_count};
    if (h->triangles == NULL)
        return HG_E_NOMEM;
    b->held.count++;
    uint32_t *to = h->triangles, *counts = to + (size_t)job->triangle_count * 3;
    for (uint32_t i = 0; i < job->member_count; i++) {
        const struct hg_lod_piece *p = &b->surface.pool.items[job->members[i]];
        memcpy(to, p->triangles, p->info.triangle_count * 12ull);
        to += (size_t)p->info.triangle_count * 3;
        counts[i] = p->info.triangle_count;
    }
    return HG_OK;
}

void hg_lod_drop_held(struct hg_lod_build *b)
{
    for (uint32_t i = 0; i < b->held.count; i++)
        hg_free(b->held.groups[i].triangles);
    hg_free(b->held.groups);
    b->held.groups = NULL;
    b->held.count = 0;
}

struct filling {                  // of a chunk with held groups
    uint32_t *table, mask, stamp; // vertices by hash: number + 1, stamp of the chunk
    uint32_t *order;              // [held_count] held groups from coarse to fine
    struct hg_lod_chunk chunk;    // counts
};

// Vertices of a group that the chunk does not have yet; they are noted.
static uint32_t note_vertices(struct filling *f, const struct hg_lod_held *h)
{
    uint32_t fresh = 0;
    for (uint32_t i = 0; i < h->triangle_count * 3; i++) {
        const uint32_t v = h->triangles[i];
        uint32_t slot = v * 0x9e3779b1u;
        slot = (slot ^ slot >> 15) & f->mask;
        while (f->table[slot * 2 + 1] == f->stamp && f->table[slot * 2] != v)
            slot = (slot + 1) & f->mask;
        fresh += f->table[slot * 2 + 1] != f->stamp;
        f->table[slot * 2] = v;
        f->table[slot * 2 + 1] = f->stamp;
    }
    return fresh;
}

// How many held groups from `first` on in the order fit into one chunk.
static uint32_t fill_chunk(const struct hg_lod_build *b, struct filling *f, uint32_t first)
{
    f->stamp++;
    f->chunk = (struct hg_lod_chunk){0};
    for (uint32_t i = first; i < b->held.count; i++) {
        const struct hg_lod_held *h = &b->held.groups[f->order[i]];
        struct hg_lod_layout layout;
        f->chunk.vertex_count += note_vertices(f, h);
        f->chunk.index_count += h->triangle_count * 3;
        hg_lod_layout_of(&b->mesh.format, &f->chunk, &layout);
        if (i > first && layout.total_bytes > HG_LOD_CHUNK_BYTES)
            return i - first;
    }
    return b->held.count - first;
}

static enum hg_status encode_held_chunk(
    struct hg_lod_build *b, const uint32_t *order, uint32_t count, uint32_t first_group)
{
    struct hg_lod_chunk chunk = {.group_count = count};
    struct hg_writer bytes = {0};
    uint32_t triangles = 0, clusters = 0;
    for (uint32_t i = 0; i < count; i++) {
        triangles += b->held.groups[order[i]].triangle_count;
        clusters += b->held.groups[order[i]].cluster_count;
    }
    uint32_t *list = hg_calloc((size_t)triangles * 3 + clusters, 4);
    if (list == NULL)
        return HG_E_NOMEM;
    uint32_t *to = list, *counts = list + (size_t)triangles * 3;
    for (uint32_t i = 0; i < count; i++) {
        const struct hg_lod_held *h = &b->held.groups[order[i]];
        memcpy(to, h->triangles, h->triangle_count * 12ull);
        memcpy(counts, h->triangles + (size_t)h->triangle_count * 3, h->cluster_count * 4ull);
        to += (size_t)h->triangle_count * 3;
        counts += h->cluster_count;
    }
    enum hg_status status =
        hg_lod_encode(&b->mesh, list, list + (size_t)triangles * 3, clusters, &bytes, &chunk);
    if (status == HG_OK)
        status = keep_chunk(b, &chunk, &bytes, first_group);
    hg_writer_finish(&bytes);
    hg_free(list);
    return status;
}

// Held groups are the last that were built, fine to coarse. Numbers them in the order of `order`.
static enum hg_status renumber_held(struct hg_lod_build *b, const uint32_t *order)
{
    const uint32_t first = b->built.group_count - b->held.count;
    struct hg_lod_group *old = hg_calloc(b->held.count, sizeof *old);
    uint32_t *to = hg_calloc(b->held.count, sizeof *to);
    if (old != NULL && to != NULL) {
        memcpy(old, b->built.groups + first, b->held.count * sizeof *old);
        for (uint32_t i = 0; i < b->held.count; i++) {
            b->built.groups[first + i] = old[order[i]];
            to[order[i]] = first + i;
        }
        for (uint32_t c = old[0].first_cluster; c < b->built.cluster_count; c++) {
            struct hg_lod_cluster *cluster = &b->built.clusters[c];
            cluster->group = to[cluster->group - first];
            if (cluster->made_from != HG_LOD_NONE && cluster->made_from >= first)
                cluster->made_from = to[cluster->made_from - first];
        }
    }
    const bool ok = old != NULL && to != NULL;
    hg_free(old);
    hg_free(to);
    return ok ? HG_OK : HG_E_NOMEM;
}

// Levels from the last that was held to the first, groups of a level as they were built.
static void order_held(const struct hg_lod_build *b, uint32_t *order)
{
    const struct hg_lod_group *groups = b->built.groups + (b->built.group_count - b->held.count);
    uint32_t n = 0;
    for (uint32_t end = b->held.count; end > 0;) {
        uint32_t first = end - 1;
        while (first > 0 && groups[first - 1].level == groups[end - 1].level)
            first--;
        for (uint32_t i = first; i < end; i++)
            order[n++] = i;
        end = first;
    }
}

static enum hg_status begin_filling(const struct hg_lod_build *b, struct filling *f)
{
    uint64_t indices = 0, size = 64;
    for (uint32_t i = 0; i < b->held.count; i++)
        indices += b->held.groups[i].triangle_count * 3ull;
    const uint64_t most = HG_LOD_CHUNK_BYTES / 4 * 2; // a chunk's, and those of a group too many
    while (size < 2 * (indices < most ? indices : most))
        size *= 2;
    f->mask = (uint32_t)size - 1;
    f->table = hg_calloc(size, 8);
    f->order = hg_calloc(b->held.count, sizeof *f->order);
    return f->table != NULL && f->order != NULL ? HG_OK : HG_E_NOMEM;
}

enum hg_status hg_lod_encode_held(struct hg_lod_build *b, uint32_t *root_chunks)
{
    const uint64_t start = hg_clock_now_ns();
    const uint32_t first = b->built.group_count - b->held.count;
    struct filling f = {0};
    enum hg_status status = begin_filling(b, &f);
    if (status == HG_OK) {
        order_held(b, f.order);
        status = renumber_held(b, f.order);
    }
    for (uint32_t i = 0; status == HG_OK && i < b->held.count;) {
        const uint32_t count = fill_chunk(b, &f, i);
        *root_chunks += b->built.groups[first + i].error == FLT_MAX;
        status = encode_held_chunk(b, f.order + i, count, first + i);
        i += count;
    }
    if (status == HG_OK)
        status = hg_lod_build_tell(b);
    hg_free(f.table);
    hg_free(f.order);
    b->report.encode_ns += hg_clock_now_ns() - start;
    return status;
}

// ---- from the order of building to the order of the file ----------------------------------------

// Levels were built from fine to coarse; `from` says which old group or chunk a new one is.
struct order {
    uint32_t *group_from, *group_to, *chunk_from;
};

static void place_chunk(const struct hg_lod_build *b, struct order *o, uint32_t chunk,
    uint32_t *chunks, uint32_t *groups)
{
    o->chunk_from[(*chunks)++] = chunk;
    for (uint32_t g = 0; g < b->built.chunks[chunk].group_count; g++) {
        o->group_to[b->built.chunks[chunk].first_group + g] = *groups;
        o->group_from[(*groups)++] = b->built.chunks[chunk].first_group + g;
    }
}

static enum hg_status find_order(const struct hg_lod_build *b, struct order *o)
{
    o->group_from = hg_calloc(b->built.group_count, 4);
    o->group_to = hg_calloc(b->built.group_count, 4);
    o->chunk_from = hg_calloc(b->built.chunk_count, 4);
    if (o->group_from == NULL || o->group_to == NULL || o->chunk_from == NULL)
        return HG_E_NOMEM;
    uint32_t groups = 0, chunks = 0;
    for (uint32_t c = b->held.first_chunk; c < b->built.chunk_count; c++)
        place_chunk(b, o, c, &chunks, &groups);
    for (uint32_t end = b->held.first_chunk; end > 0;) {
        uint32_t first = end - 1;
        const uint32_t level = b->built.groups[b->built.chunks[first].first_group].level;
        while (first > 0 && b->built.groups[b->built.chunks[first - 1].first_group].level == level)
            first--;
        for (uint32_t c = first; c < end; c++)
            place_chunk(b, o, c, &chunks, &groups);
        end = first;
    }
    return HG_OK;
}

static void reorder(const struct hg_lod_build *b, const struct order *o, struct hg_lod_file *f,
    struct hg_writer *bytes)
{
    uint32_t cluster = 0, group = 0;
    for (uint32_t c = 0; c < b->built.chunk_count; c++) {
        f->chunks[c] = b->built.chunks[o->chunk_from[c]];
        hg_write_bytes(bytes, b->built.bytes.data + f->chunks[c].offset, f->chunks[c].bytes);
        for (uint32_t i = 0; i < f->chunks[c].group_count; i++, group++) {
            struct hg_lod_group *g = &f->groups[group];
            *g = b->built.groups[o->group_from[group]];
            g->chunk = c;
            for (uint32_t k = 0; k < g->cluster_count; k++) {
                struct hg_lod_cluster *to = &f->clusters[cluster + k];
                *to = b->built.clusters[g->first_cluster + k];
                to->group = group;
                if (to->made_from != HG_LOD_NONE)
                    to->made_from = o->group_to[to->made_from];
            }
            g->first_cluster = cluster;
            cluster += g->cluster_count;
        }
    }
}

static void fill_head(const struct hg_lod_build *b, struct hg_lod_file *f, uint32_t root_chunks)
{
    struct hg_lod *l = &f->lod;
    f->format = b->mesh.format;
    l->cluster_count = b->built.cluster_count;
    l->group_count = b->built.group_count;
    l->chunk_count = b->built.chunk_count;
    l->root_chunk_count = root_chunks;
    l->level_count = b->level;
    l->flags = b->mesh.format.flags;
    l->quantum = b->mesh.format.quantum;
    l->source_error = l->quantum * 0.8660255f;
    l->source_triangles = b->mesh.triangle_count;
    l->stored_triangles = b->report.stored_triangles;
    if (b->mesh.format.radius >= 0) {
        memcpy(l->min, b->min, sizeof l->min);
        memcpy(l->max, b->max, sizeof l->max);
    }
    for (uint32_t i = 0; i < b->mesh.position_count; i++) {
        for (int k = 0; k < 3; k++) {
            const float v = (float)b->mesh.lattice[i][k] * l->quantum;
            l->min[k] = i == 0 ? v : fminf(l->min[k], v);
            l->max[k] = i == 0 ? v : fmaxf(l->max[k], v);
        }
    }
}

enum hg_status hg_lod_assemble(struct hg_lod_build *b, uint32_t root_chunks, struct hg_writer *out)
{
    struct hg_lod_file f = {0};
    struct order o = {0};
    struct hg_writer bytes = {0};
    enum hg_status status = find_order(b, &o);
    f.clusters = hg_spill_scratch(b->built.cluster_count, sizeof *f.clusters);
    f.groups = hg_spill_scratch(b->built.group_count, sizeof *f.groups);
    f.chunks = hg_spill_scratch(b->built.chunk_count, sizeof *f.chunks);
    if (f.clusters == NULL || f.groups == NULL || f.chunks == NULL)
        status = HG_E_NOMEM;
    if (status == HG_OK) {
        fill_head(b, &f, root_chunks);
        hg_writer_spill(&bytes, b->built.bytes.size);
        hg_writer_spill(out, b->built.bytes.size + b->built.bytes.size / 4);
        reorder(b, &o, &f, &bytes);
        hg_writer_finish(&b->built.bytes);
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
