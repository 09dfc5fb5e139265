// encode.c - a chunk as bytes: triangles by meshoptimizer's index codec, vertices as
// differences from what their triangles predict, one plane of bytes per component, each packed by
// zstd.
// Of a file of points a chunk has no triangles: points are coded one after the other, and decoding
// makes discs of them.
//
// Payload: u32 bytes of the index codec, u32 bytes of escapes, then the planes: indices, position
// x y z, components, escapes. A plane is u32 size (bit 31: stored as it is) and that many bytes. A
// difference z (zigzag) below 192 is one byte; below 192 + 62 * 256 it is 192 + high bits, the low
// byte among the escapes; else 254 and four bytes among the escapes, lowest first.
#include <meshoptimizer.h>
#include <string.h>
#include <zstd.h>

#include "base/alloc.h"
#include "renderer/lod/discs.h"
#include "renderer/lod/internal.h"

#define PACK_LEVEL 1

struct encoder {
    const struct hg_lod_mesh *mesh;
    uint32_t index_count, vertex_count, word_count;
    uint32_t *indices;  // [index_count] into the chunk's vertices
    uint32_t *vertices; // [vertex_count] of the mesh
    int32_t (*lattice)[3];
    uint32_t *words;
    int64_t (*normals)[3];
    struct hg_lod_visit *visits;
    int32_t *values; // [vertex_count] of the component being coded
    uint8_t *seen, *plane;
    struct hg_writer escapes, packed; // packed: scratch of zstd
    uint8_t *codec;
    size_t codec_size;
    ZSTD_CCtx *zstd;
    uint32_t *table; // mesh vertex to chunk vertex
    uint32_t table_mask;
};

// ---- vertices of the chunk ----------------------------------------------------------------------

static uint32_t *slot_of(struct encoder *e, uint32_t vertex, bool *found)
{
    uint32_t slot = vertex * 0x9e3779b1u;
    slot = (slot ^ slot >> 15) & e->table_mask;
    while (e->table[slot] != 0 && e->vertices[e->table[slot] - 1] != vertex)
        slot = (slot + 1) & e->table_mask;
    *found = e->table[slot] != 0;
    return &e->table[slot];
}

struct cluster_order {
    uint32_t vertices[HG_LOD_CLUSTER_TRIANGLES * 3], vertex_count; // distinct
    uint32_t indices[HG_LOD_CLUSTER_TRIANGLES * 3];                // into `vertices`
};

// Triangles of one cluster in an order in which neighbours follow each other.
static void order_cluster(const uint32_t *in, uint32_t count, struct cluster_order *out)
{
    uint16_t table[1024] = {0};
    uint32_t local[HG_LOD_CLUSTER_TRIANGLES * 3], n = 0;
    for (uint32_t i = 0; i < count * 3; i++) {
        uint32_t slot = in[i] * 0x9e3779b1u >> 22;
        while (table[slot] != 0 && out->vertices[table[slot] - 1] != in[i])
            slot = (slot + 1) & 1023;
        if (table[slot] == 0) {
            out->vertices[n] = in[i];
            table[slot] = (uint16_t)++n;
        }
        local[i] = table[slot] - 1u;
    }
    out->vertex_count = n;
    meshopt_optimizeVertexCacheFifo(out->indices, local, (size_t)count * 3, n, 16);
}

// Numbers vertices in the order of their first use.
static void number(struct encoder *e, const struct cluster_order *order, uint32_t index_count)
{
    uint32_t numbers[HG_LOD_CLUSTER_TRIANGLES * 3];
    memset(numbers, 0xff, order->vertex_count * sizeof *numbers);
    for (uint32_t i = 0; i < index_count; i++) {
        uint32_t *to = &numbers[order->indices[i]];
        if (*to == HG_LOD_NONE) {
            bool found;
            uint32_t *slot = slot_of(e, order->vertices[order->indices[i]], &found);
            if (!found) {
                e->vertices[e->vertex_count] = order->vertices[order->indices[i]];
                *slot = ++e->vertex_count;
            }
            *to = *slot - 1;
        }
        e->indices[e->index_count++] = *to;
    }
}

// The codec turns corners of triangles round; the vertices follow the turned ones.
static enum hg_status code_indices(struct encoder *e)
{
    const size_t bound = meshopt_encodeIndexBufferBound(e->index_count, e->vertex_count);
    e->codec = hg_calloc(bound, 1);
    if (e->codec == NULL)
        return HG_E_NOMEM;
    e->codec_size = meshopt_encodeIndexBuffer(e->codec, bound, e->indices, e->index_count);
    if (e->codec_size == 0 ||
        meshopt_decodeIndexBuffer(e->indices, e->index_count, 4, e->codec, e->codec_size) != 0)
        return HG_E_INTERNAL;
    return HG_OK;
}

static void fetch_vertices(struct encoder *e)
{
    const struct hg_lod_mesh *m = e->mesh;
    for (uint32_t i = 0; i < e->vertex_count; i++) {
        memcpy(e->lattice[i], m->lattice[m->position_of[e->vertices[i]]], sizeof e->lattice[i]);
        memcpy(e->words + (size_t)i * e->word_count,
            m->words + (size_t)e->vertices[i] * e->word_count, e->word_count * 4);
    }
}

// ---- planes -------------------------------------------------------------------------------------

static inline uint8_t code_difference(struct encoder *e, int32_t value, int32_t predicted)
{
    const int32_t d = (int32_t)((uint32_t)value - (uint32_t)predicted);
    const uint32_t z = (uint32_t)d << 1 ^ (uint32_t)(d >> 31);
    if (z < 192)
        return (uint8_t)z;
    if (z - 192 < 62 * 256) {
        hg_write_u8(&e->escapes, (uint8_t)(z - 192));
        return (uint8_t)(192 + ((z - 192) >> 8));
    }
    hg_write_u32(&e->escapes, z);
    return 254;
}

static enum hg_status pack_plane(
    struct encoder *e, const uint8_t *data, size_t size, struct hg_writer *out)
{
    const size_t bound = ZSTD_compressBound(size);
    if (hg_grow(&e->packed.data, &e->packed.capacity, bound, 1) != HG_OK)
        return HG_E_NOMEM;
    const size_t n =
        ZSTD_compressCCtx(e->zstd, e->packed.data, e->packed.capacity, data, size, PACK_LEVEL);
    const bool stored = ZSTD_isError(n) || n >= size;
    const size_t bytes = stored ? size : n;
    hg_write_u32(out, (uint32_t)bytes | (stored ? 0x80000000u : 0u));
    hg_write_bytes(out, stored ? data : e->packed.data, bytes);
    return out->failed ? HG_E_NOMEM : HG_OK;
}

// The differences of e->values from what hg_lod_predict_lattice says.
static void code_lattice(struct encoder *e)
{
    const int32_t *values = e->values;
    for (uint32_t i = 0; i < e->vertex_count; i++) {
        const struct hg_lod_visit *v = &e->visits[i];
        e->plane[i] = code_difference(e, values[v->vertex], hg_lod_predict_lattice(v, values));
    }
}

static enum hg_status pack_positions(struct encoder *e, struct hg_writer *out)
{
    enum hg_status status = HG_OK;
    for (int axis = 0; axis < 3 && status == HG_OK; axis++) {
        for (uint32_t i = 0; i < e->vertex_count; i++)
            e->values[i] = e->lattice[i][axis];
        code_lattice(e);
        status = pack_plane(e, e->plane, e->vertex_count, out);
    }
    return status;
}

static enum hg_status pack_components(struct encoder *e, struct hg_writer *out)
{
    const struct hg_lod_format *f = &e->mesh->format;
    struct hg_lod_component components[HG_LOD_PLANES];
    const uint32_t n = hg_lod_components(f, components);
    enum hg_status status = HG_OK;
    for (uint32_t k = 0; k < n && status == HG_OK; k++) {
        const struct hg_lod_component *c = &components[k];
        for (uint32_t i = 0; i < e->vertex_count; i++)
            e->values[i] = hg_lod_component_get(c, e->words + (size_t)i * e->word_count);
        if (c->kind == HG_LOD_LATTICE) {
            code_lattice(e);
        } else {
            for (uint32_t i = 0; i < e->vertex_count; i++) {
                const struct hg_lod_visit *v = &e->visits[i];
                e->plane[i] = code_difference(e, e->values[v->vertex],
                    hg_lod_predict(c, v, e->values, (const int64_t(*)[3])e->normals));
            }
        }
        status = pack_plane(e, e->plane, e->vertex_count, out);
    }
    return status;
}

static enum hg_status pack_all(struct encoder *e, struct hg_writer *out)
{
    hg_write_u32(out, (uint32_t)e->codec_size);
    const size_t escapes_at = out->size;
    hg_write_u32(out, 0);
    enum hg_status status = pack_plane(e, e->codec, e->codec_size, out);
    if (status == HG_OK)
        status = pack_positions(e, out);
    if (status == HG_OK)
        status = pack_components(e, out);
    if (status != HG_OK || e->escapes.failed || out->failed)
        return HG_E_NOMEM;
    hg_write_patch_u32(out, escapes_at, (uint32_t)e->escapes.size);
    return pack_plane(e, e->escapes.data, e->escapes.size, out);
}

// ---- all of it ----------------------------------------------------------------------------------

static enum hg_status take(struct encoder *e, uint32_t index_count)
{
    uint32_t table = 64;
    while (table < index_count * 2)
        table *= 2;
    e->table_mask = table - 1;
    e->table = hg_calloc(table, 4);
    e->indices = hg_calloc(index_count, 4);
    e->vertices = hg_calloc(index_count, 4);
    e->zstd = ZSTD_createCCtx();
    return e->table && e->indices && e->vertices && e->zstd ? HG_OK : HG_E_NOMEM;
}

static enum hg_status take_vertices(struct encoder *e)
{
    const size_t n = e->vertex_count;
    e->lattice = hg_calloc(n, sizeof *e->lattice);
    e->words = hg_calloc(n * e->word_count + 1, 4);
    e->normals = hg_calloc(n, sizeof *e->normals);
    e->visits = hg_calloc(n, sizeof *e->visits);
    e->values = hg_calloc(n, sizeof *e->values);
    e->seen = hg_calloc(n, 1);
    e->plane = hg_calloc(n, 1);
    return e->lattice && e->words && e->normals && e->visits && e->values && e->seen && e->plane
               ? HG_OK
               : HG_E_NOMEM;
}

static void finish(struct encoder *e)
{
    void *arrays[] = {e->table, e->indices, e->vertices, e->lattice, e->words, e->normals,
        e->visits, e->values, e->seen, e->plane, e->codec, e->packed.data};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        hg_free(arrays[i]);
    hg_writer_finish(&e->escapes);
    ZSTD_freeCCtx(e->zstd);
}

static enum hg_status encode(struct encoder *e, struct hg_writer *out)
{
    enum hg_status status = code_indices(e);
    if (status == HG_OK)
        status = take_vertices(e);
    if (status != HG_OK)
        return status;
    fetch_vertices(e);
    hg_lod_visits(e->indices, e->index_count, e->vertex_count, e->visits, e->seen);
    hg_lod_sum_normals(
        e->indices, e->index_count, (const int32_t(*)[3])e->lattice, e->vertex_count, e->normals);
    return pack_all(e, out);
}

enum hg_status hg_lod_encode(const struct hg_lod_mesh *mesh, const uint32_t *triangles,
    const uint32_t *cluster_triangles, uint32_t cluster_count, struct hg_writer *out,
    struct hg_lod_chunk *chunk)
{
    struct encoder e = {.mesh = mesh, .word_count = mesh->format.words};
    uint32_t count = 0;
    for (uint32_t i = 0; i < cluster_count; i++)
        count += cluster_triangles[i] * 3;
    enum hg_status status = take(&e, count);
    if (status == HG_OK) {
        struct cluster_order sorted;
        for (uint32_t i = 0; i < cluster_count; i++) {
            order_cluster(triangles, cluster_triangles[i], &sorted);
            number(&e, &sorted, cluster_triangles[i] * 3);
            triangles += cluster_triangles[i] * 3;
        }
        const size_t first = out->size;
        status = encode(&e, out);
        chunk->bytes = (uint32_t)(out->size - first);
        chunk->crc = status == HG_OK ? hg_lod_crc(out->data + first, chunk->bytes) : 0;
        chunk->vertex_count = e.vertex_count;
        chunk->index_count = e.index_count;
    }
    finish(&e);
    return status;
}

static enum hg_status encode_points(
    struct encoder *e, const struct hg_lod_points *points, struct hg_writer *out)
{
    enum hg_status status = take_vertices(e);
    if (status != HG_OK)
        return status;
    memcpy(e->lattice, points->lattice, points->count * sizeof *e->lattice);
    memcpy(e->words, points->words, (size_t)points->count * e->word_count * 4);
    hg_lod_point_visits(points->count, e->visits);
    hg_free(e->normals);
    e->normals = NULL;
    return pack_all(e, out);
}

enum hg_status hg_lod_encode_points(const struct hg_lod_mesh *mesh,
    const struct hg_lod_points *points, struct hg_writer *out, struct hg_lod_chunk *chunk)
{
    struct encoder e = {
        .mesh = mesh, .word_count = mesh->format.words, .vertex_count = points->count};
    const size_t first = out->size;
    e.zstd = ZSTD_createCCtx();
    const enum hg_status status = e.zstd != NULL ? encode_points(&e, points, out) : HG_E_NOMEM;
    chunk->bytes = (uint32_t)(out->size - first);
    chunk->crc = status == HG_OK ? hg_lod_crc(out->data + first, chunk->bytes) : 0;
    chunk->vertex_count = points->count * points->sides;
    chunk->index_count = points->count * hg_disc_triangles(points->sides) * 3;
    finish(&e);
    return status;
}
