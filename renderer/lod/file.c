// file.c - the file of a baked hierarchy: header, packed tables, chunks. Little-endian.
//
// Header (HEADER_BYTES): magic, version, sizes, counts, format, box; its CRC-32 last. Tables:
// clusters, groups and chunks as arrays of one field each, packed by zstd. Offsets, first indices
// and links are not stored but follow from counts and order.
#include <float.h>
#include <math.h>
#include <string.h>
#include <zstd.h>

#include "base/alloc.h"
#include "base/checked.h"
#include "base/spill.h"
#include "renderer/lod/internal.h"

#define MAGIC         0x444f4c47485f4748ull // "HG_HGLOD"
#define HEADER_BYTES  136u
#define CLUSTER_BYTES 37u // 7 floats, 4 bytes of cone, u32, u8
#define GROUP_BYTES   32u // 5 floats, 3 u32
#define CHUNK_BYTES   20u // 5 u32
#define TABLES_LEVEL  3
#define TABLES_RATIO  64u // tables are at most this many times the file
#define FORMAT_FLAGS                                                                               \
    (HG_DRAW_NORMALS | HG_DRAW_TANGENTS | HG_DRAW_UV1 | HG_DRAW_COLOR8 | HG_DRAW_COLOR16 |         \
        HG_DRAW_DISCS)

static uint64_t tables_size(const struct hg_lod *l)
{
    return (uint64_t)l->cluster_count * CLUSTER_BYTES + (uint64_t)l->group_count * GROUP_BYTES +
           (uint64_t)l->chunk_count * CHUNK_BYTES;
}

// ---- writing ------------------------------------------------------------------------------------

#define EACH(w, type, items, n, field)                                                             \
    for (uint32_t i_ = 0; i_ < (n); i_++)                                                          \
    hg_write_##type(w, (items)[i_].field)

static void write_clusters(struct hg_writer *w, const struct hg_lod_file *f)
{
    const uint32_t n = f->lod.cluster_count;
    const struct hg_lod_cluster *c = f->clusters;
    for (int k = 0; k < 3; k++)
        EACH(w, f32, c, n, center[k]);
    for (int k = 0; k < 3; k++)
        EACH(w, f32, c, n, extent[k]);
    EACH(w, f32, c, n, radius);
    for (uint32_t i = 0; i < n; i++) {
        for (int k = 0; k < 3; k++)
            hg_write_u8(w, (uint8_t)(int8_t)lrintf(c[i].cone_axis[k] * 127.0f));
        hg_write_u8(w, (uint8_t)lrintf(c[i].cone_cutoff * 255.0f));
    }
    EACH(w, u32, c, n, made_from);
    for (uint32_t i = 0; i < n; i++)
        hg_write_u8(w, (uint8_t)c[i].triangle_count);
}

static void write_groups(struct hg_writer *w, const struct hg_lod_file *f)
{
    const uint32_t n = f->lod.group_count;
    const struct hg_lod_group *g = f->groups;
    for (int k = 0; k < 3; k++)
        EACH(w, f32, g, n, center[k]);
    EACH(w, f32, g, n, radius);
    EACH(w, f32, g, n, error);
    EACH(w, u32, g, n, cluster_count);
    EACH(w, u32, g, n, level);
    EACH(w, u32, g, n, chunk);
}

static void write_chunks(struct hg_writer *w, const struct hg_lod_file *f)
{
    const uint32_t n = f->lod.chunk_count;
    const struct hg_lod_chunk *c = f->chunks;
    EACH(w, u32, c, n, bytes);
    EACH(w, u32, c, n, crc);
    EACH(w, u32, c, n, vertex_count);
    EACH(w, u32, c, n, index_count);
    EACH(w, u32, c, n, group_count);
}

static void write_header(struct hg_writer *w, const struct hg_lod_file *f, uint64_t packed,
    uint32_t crc, uint64_t chunks)
{
    const struct hg_lod *l = &f->lod;
    const size_t first = w->size;
    hg_write_u64(w, MAGIC);
    hg_write_u32(w, HG_LOD_VERSION);
    hg_write_u32(w, crc);
    hg_write_u64(w, HEADER_BYTES + packed + chunks);
    hg_write_u64(w, packed);
    const uint32_t counts[] = {l->cluster_count, l->group_count, l->chunk_count,
        l->root_chunk_count, l->level_count, l->flags, f->format.uv >= 0, 0};
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++)
        hg_write_u32(w, counts[i]);
    hg_write_u64(w, l->source_triangles);
    hg_write_u64(w, l->stored_triangles);
    hg_write_f32(w, l->quantum);
    hg_write_f32(w, f->format.uv_quantum);
    hg_write_f32(w, l->source_error);
    for (int k = 0; k < 3; k++)
        hg_write_f32(w, l->min[k]);
    for (int k = 0; k < 3; k++)
        hg_write_f32(w, l->max[k]);
    while (!w->failed && w->size - first < HEADER_BYTES - 4)
        hg_write_u32(w, 0);
    if (!w->failed)
        hg_write_u32(w, hg_lod_crc(w->data + first, HEADER_BYTES - 4));
}

enum hg_status hg_lod_write(
    const struct hg_lod_file *f, const uint8_t *chunks, size_t size, struct hg_writer *out)
{
    struct hg_writer tables = {0};
    hg_writer_spill(&tables, (size_t)tables_size(&f->lod));
    write_clusters(&tables, f);
    write_groups(&tables, f);
    write_chunks(&tables, f);
    const size_t bound = ZSTD_compressBound(tables.size);
    uint8_t *packed = tables.failed ? NULL : hg_spill_scratch(bound, 1);
    size_t n = 0;
    if (packed != NULL)
        n = ZSTD_compress(packed, bound, tables.data, tables.size, TABLES_LEVEL);
    if (packed != NULL && !ZSTD_isError(n)) {
        write_header(out, f, n, hg_lod_crc(packed, n), size);
        hg_write_bytes(out, packed, n);
        hg_write_bytes(out, chunks, size);
    }
    const bool ok = packed != NULL && !ZSTD_isError(n) && !out->failed;
    hg_free(packed);
    hg_writer_finish(&tables);
    return ok ? HG_OK : HG_E_NOMEM;
}

// ---- tables -------------------------------------------------------------------------------------

#define EACH_IN(r, type, items, n, field)                                                          \
    for (uint32_t i_ = 0; i_ < (n); i_++)                                                          \
    (items)[i_].field = hg_read_##type(r)

static void read_clusters(struct hg_reader *r, struct hg_lod_file *f)
{
    const uint32_t n = f->lod.cluster_count;
    struct hg_lod_cluster *c = f->clusters;
    for (int k = 0; k < 3; k++)
        EACH_IN(r, f32, c, n, center[k]);
    for (int k = 0; k < 3; k++)
        EACH_IN(r, f32, c, n, extent[k]);
    EACH_IN(r, f32, c, n, radius);
    for (uint32_t i = 0; i < n; i++) {
        int8_t q[3];
        for (int k = 0; k < 3; k++)
            q[k] = (int8_t)hg_read_u8(r);
        hg_lod_cone_axis(q, c[i].cone_axis);
        c[i].cone_cutoff = (float)hg_read_u8(r) / 255.0f;
    }
    EACH_IN(r, u32, c, n, made_from);
    EACH_IN(r, u8, c, n, triangle_count);
}

static void read_groups(struct hg_reader *r, struct hg_lod_file *f)
{
    const uint32_t n = f->lod.group_count;
    struct hg_lod_group *g = f->groups;
    for (int k = 0; k < 3; k++)
        EACH_IN(r, f32, g, n, center[k]);
    EACH_IN(r, f32, g, n, radius);
    EACH_IN(r, f32, g, n, error);
    EACH_IN(r, u32, g, n, cluster_count);
    EACH_IN(r, u32, g, n, level);
    EACH_IN(r, u32, g, n, chunk);
}

static void read_chunks(struct hg_reader *r, struct hg_lod_file *f)
{
    const uint32_t n = f->lod.chunk_count;
    struct hg_lod_chunk *c = f->chunks;
    EACH_IN(r, u32, c, n, bytes);
    EACH_IN(r, u32, c, n, crc);
    EACH_IN(r, u32, c, n, vertex_count);
    EACH_IN(r, u32, c, n, index_count);
    EACH_IN(r, u32, c, n, group_count);
}

static bool finite_all(const float *v, int count)
{
    for (int i = 0; i < count; i++)
        if (!isfinite(v[i]))
            return false;
    return true;
}

// Ranges of clusters per group and of groups per chunk from their counts.
static bool set_ranges(struct hg_lod_file *f)
{
    uint32_t group = 0, cluster = 0;
    uint64_t triangles = 0;
    for (uint32_t i = 0; i < f->lod.chunk_count; i++) {
        struct hg_lod_chunk *c = &f->chunks[i];
        uint32_t index = 0;
        if (c->group_count == 0 || c->group_count > f->lod.group_count - group)
            return false;
        c->first_group = group;
        for (; group < c->first_group + c->group_count; group++) {
            struct hg_lod_group *g = &f->groups[group];
            if (g->chunk != i || g->cluster_count == 0 ||
                g->cluster_count > HG_LOD_GROUP_CLUSTERS ||
                g->cluster_count > f->lod.cluster_count - cluster)
                return false;
            g->first_cluster = cluster;
            for (; cluster < g->first_cluster + g->cluster_count; cluster++) {
                f->clusters[cluster].group = group;
                f->clusters[cluster].first_index = index;
                index += f->clusters[cluster].triangle_count * 3;
            }
        }
        if (index != c->index_count)
            return false;
        triangles += index / 3;
    }
    return group == f->lod.group_count && cluster == f->lod.cluster_count &&
           triangles == f->lod.stored_triangles;
}

static bool check_chunks(const struct hg_lod_file *f)
{
    uint64_t offset = 0;
    for (uint32_t i = 0; i < f->lod.chunk_count; i++) {
        const struct hg_lod_chunk *c = &f->chunks[i];
        const uint64_t vertex = 12 + sizeof(struct hg_gpu_vertex) + f->format.extra_words * 4ull;
        if (c->index_count * 4ull + c->vertex_count * vertex > HG_LOD_CHUNK_BYTES ||
            c->index_count == 0 || c->vertex_count == 0 || c->vertex_count > c->index_count)
            return false;
        struct hg_lod_layout l;
        uint32_t points, sides;
        hg_lod_layout_of(&f->format, c, &l);
        if (l.total_bytes > HG_LOD_CHUNK_BYTES ||
            (f->format.radius >= 0 && !hg_lod_disc_counts(c, &points, &sides)))
            return false;
        f->chunks[i].offset = offset;
        offset += c->bytes;
    }
    return true;
}

static bool inside(const struct hg_lod_group *inner, const struct hg_lod_group *outer)
{
    double d2 = 0.0;
    for (int k = 0; k < 3; k++) {
        const double d = (double)inner->center[k] - (double)outer->center[k];
        d2 += d * d;
    }
    return sqrt(d2) + (double)inner->radius <= (double)outer->radius * (1.0 + 1e-6);
}

// Whatever passes can be traversed: no cycles, errors and spheres grow, roots hold what is
// terminal.
static bool check_groups(const struct hg_lod_file *f)
{
    for (uint32_t i = 0; i < f->lod.group_count; i++) {
        const struct hg_lod_group *g = &f->groups[i];
        if (!finite_all(g->center, 3) || !(g->radius >= 0.0f) || !isfinite(g->radius) ||
            !(g->error >= 0.0f) || !isfinite(g->error) || g->level >= f->lod.level_count)
            return false;
        if (g->error == FLT_MAX && g->chunk >= f->lod.root_chunk_count)
            return false;
    }
    for (uint32_t i = 0; i < f->lod.cluster_count; i++) {
        const struct hg_lod_cluster *c = &f->clusters[i];
        if (!finite_all(c->center, 3) || !finite_all(c->extent, 3) || !isfinite(c->radius) ||
            !(c->radius >= 0.0f) || c->triangle_count == 0 ||
            c->triangle_count > HG_LOD_CLUSTER_TRIANGLES)
            return false;
        if (c->made_from == HG_LOD_NONE)
            continue;
        const struct hg_lod_group *group = &f->groups[c->group];
        if (c->made_from >= f->lod.group_count || c->made_from <= c->group)
            return false;
        const struct hg_lod_group *from = &f->groups[c->made_from];
        if (from->error > group->error || from->error == FLT_MAX || !inside(from, group))
            return false;
    }
    return true;
}

enum hg_status hg_lod_read_tables(
    struct hg_lod_file *f, const uint8_t *tables, size_t size, struct hg_error *err)
{
    struct hg_lod *l = &f->lod;
    if (size != tables_size(l))
        return hg_error_set(err, HG_E_FORMAT, "cluster file", "tables", "their size is wrong");
    f->clusters = hg_calloc(l->cluster_count, sizeof *f->clusters);
    f->groups = hg_calloc(l->group_count, sizeof *f->groups);
    f->chunks = hg_calloc(l->chunk_count, sizeof *f->chunks);
    l->clusters = f->clusters;
    l->groups = f->groups;
    l->chunks = f->chunks;
    if (f->clusters == NULL || f->groups == NULL || f->chunks == NULL)
        return hg_error_set(err, HG_E_NOMEM, "cluster file", NULL, "no memory");
    struct hg_reader r = hg_reader_make(tables, size);
    read_clusters(&r, f);
    read_groups(&r, f);
    read_chunks(&r, f);
    if (r.failed || !set_ranges(f) || !check_chunks(f) || !check_groups(f))
        return hg_error_set(
            err, HG_E_FORMAT, "cluster file", "tables", "they contradict themselves");
    if (hg_lod_link(f) != HG_OK)
        return hg_error_set(err, HG_E_NOMEM, "cluster file", NULL, "no memory");
    return HG_OK;
}

// ---- opening ------------------------------------------------------------------------------------

// The whole lattice can be told in floats.
static bool step_ok(float step)
{
    return step > 0.0f && step <= FLT_MAX / (2.0f * HG_LOD_LATTICE_MAX);
}

struct head {
    uint32_t tables_crc;
    uint64_t file_bytes, packed_bytes;
};

static enum hg_status read_header(
    struct hg_reader *r, struct hg_lod_file *f, struct head *h, struct hg_error *err)
{
    struct hg_lod *l = &f->lod;
    if (r->size < HEADER_BYTES)
        return hg_error_set(
            err, HG_E_TRUNCATED, "cluster file", "byte 0", "it has %zu bytes", r->size);
    if (hg_read_u64(r) != MAGIC)
        return hg_error_set(err, HG_E_FORMAT, "cluster file", "byte 0", "not a cluster file");
    const uint32_t version = hg_read_u32(r);
    if (version != HG_LOD_VERSION)
        return hg_error_set(err, HG_E_VERSION, "cluster file", "byte 8", "version %u", version);
    struct hg_reader end = hg_reader_make(r->data + HEADER_BYTES - 4, 4);
    if (hg_read_u32(&end) != hg_lod_crc(r->data, HEADER_BYTES - 4))
        return hg_error_set(err, HG_E_HASH, "cluster file", "header", "its checksum is wrong");
    h->tables_crc = hg_read_u32(r);
    h->file_bytes = hg_read_u64(r);
    h->packed_bytes = hg_read_u64(r);
    uint32_t has_uv = 0, spare = 0;
    uint32_t *const counts[] = {&l->cluster_count, &l->group_count, &l->chunk_count,
        &l->root_chunk_count, &l->level_count, &l->flags, &has_uv, &spare};
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++)
        *counts[i] = hg_read_u32(r);
    l->source_triangles = hg_read_u64(r);
    l->stored_triangles = hg_read_u64(r);
    l->quantum = hg_read_f32(r);
    f->format.quantum = l->quantum;
    f->format.uv_quantum = hg_read_f32(r);
    l->source_error = hg_read_f32(r);
    for (int k = 0; k < 3; k++)
        l->min[k] = hg_read_f32(r);
    for (int k = 0; k < 3; k++)
        l->max[k] = hg_read_f32(r);
    r->pos = HEADER_BYTES;
    if (l->flags & ~FORMAT_FLAGS || has_uv > 1 ||
        (l->flags & HG_DRAW_COLOR8 && l->flags & HG_DRAW_COLOR16) || !step_ok(l->quantum) ||
        !step_ok(f->format.uv_quantum) || !finite_all(&l->source_error, 1) ||
        !finite_all(l->min, 3) || !finite_all(l->max, 3))
        return hg_error_set(err, HG_E_FORMAT, "cluster file", "header", "a value makes no sense");
    hg_lod_format_set(&f->format, l->flags, has_uv != 0);
    l->extra_words = f->format.extra_words;
    return HG_OK;
}

static enum hg_status read_all(struct hg_lod_file *f, bool head_only, struct hg_error *err)
{
    struct hg_lod *l = &f->lod;
    struct hg_reader r = hg_reader_make(l->data, l->size);
    struct head h = {0};
    enum hg_status status = read_header(&r, f, &h, err);
    if (status != HG_OK)
        return status;
    if (!head_only && l->size < h.file_bytes)
        return hg_error_set(err, HG_E_TRUNCATED, "cluster file", NULL, "%zu of %llu bytes", l->size,
            (unsigned long long)h.file_bytes);
    const uint64_t tables = tables_size(l);
    if ((!head_only && l->size != h.file_bytes) || l->size > h.file_bytes ||
        !hg_range_ok(HEADER_BYTES, h.packed_bytes, l->size) || tables > l->size * TABLES_RATIO)
        return hg_error_set(
            err, HG_E_FORMAT, "cluster file", "header", "sizes contradict each other");
    const uint8_t *packed = hg_read_bytes(&r, (size_t)h.packed_bytes);
    if (packed == NULL || hg_lod_crc(packed, (size_t)h.packed_bytes) != h.tables_crc)
        return hg_error_set(err, HG_E_HASH, "cluster file", "tables", "their checksum is wrong");
    uint8_t *raw = hg_calloc((size_t)tables, 1);
    if (raw == NULL)
        return hg_error_set(err, HG_E_NOMEM, "cluster file", NULL, "no memory");
    const size_t n = ZSTD_decompress(raw, (size_t)tables, packed, (size_t)h.packed_bytes);
    if (n != tables)
        status = hg_error_set(err, HG_E_FORMAT, "cluster file", "tables", "they do not unpack");
    else
        status = hg_lod_read_tables(f, raw, n, err);
    hg_free(raw);
    uint64_t offset = HEADER_BYTES + h.packed_bytes;
    for (uint32_t i = 0; status == HG_OK && i < l->chunk_count; i++) {
        f->chunks[i].offset = offset;
        offset += f->chunks[i].bytes;
    }
    if (status == HG_OK && offset != h.file_bytes)
        status = hg_error_set(err, HG_E_FORMAT, "cluster file", "tables", "chunks do not fill it");
    return status;
}

static enum hg_status open_file(
    const uint8_t *data, size_t size, bool head_only, struct hg_lod **out, struct hg_error *err)
{
    *out = NULL;
    struct hg_lod_file *f = hg_calloc(1, sizeof *f);
    if (f == NULL)
        return hg_error_set(err, HG_E_NOMEM, "cluster file", NULL, "no memory");
    f->lod.data = data;
    f->lod.size = size;
    const enum hg_status status = read_all(f, head_only, err);
    if (status == HG_OK)
        *out = &f->lod;
    else
        hg_lod_close(&f->lod);
    return status;
}

enum hg_status hg_lod_open(
    const uint8_t *data, size_t size, struct hg_lod **out, struct hg_error *err)
{
    return open_file(data, size, false, out, err);
}

enum hg_status hg_lod_open_head(
    const uint8_t *head, size_t size, struct hg_lod **out, struct hg_error *err)
{
    return open_file(head, size, true, out, err);
}

void hg_lod_close(struct hg_lod *lod)
{
    struct hg_lod_file *f = (struct hg_lod_file *)(void *)lod;
    if (f == NULL)
        return;
    hg_free(f->clusters);
    hg_free(f->groups);
    hg_free(f->nodes);
    hg_free(f->chunks);
    hg_free(f->parents);
    hg_free(f);
}
