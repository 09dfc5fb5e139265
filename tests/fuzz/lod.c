// Cluster files: tables, links and chunks of hostile bytes. Checksums are put right first, so that
// what lies behind them is reached.
#include <float.h>
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/lod/internal.h"
#include "tests/fuzz/fuzz.h"

enum { HEADER_BYTES = 136, CHUNKS_TRIED = 4 };

static void put32(uint8_t *to, uint32_t v)
{
    for (int i = 0; i < 4; i++)
        to[i] = (uint8_t)(v >> (8 * i));
}

// Header: tables' checksum at byte 12, file size at 16, packed size of the tables at 24.
static void repair(uint8_t *file, size_t size)
{
    if (size < HEADER_BYTES)
        return;
    struct hg_reader r = hg_reader_make(file + 24, 8);
    const uint64_t packed = hg_read_u64(&r);
    if (packed <= size - HEADER_BYTES)
        put32(file + 12, hg_lod_crc(file + HEADER_BYTES, (size_t)packed));
    put32(file + 16, (uint32_t)size);
    put32(file + 20, 0);
    put32(file + HEADER_BYTES - 4, hg_lod_crc(file, HEADER_BYTES - 4));
}

// What lod.h promises of every hierarchy that opens.
static void check(const struct hg_lod *l)
{
    for (uint32_t i = 0; i < l->cluster_count; i++) {
        const struct hg_lod_cluster *c = &l->clusters[i];
        FUZZ_CHECK(c->group < l->group_count && c->triangle_count >= 1 &&
                   c->triangle_count <= HG_LOD_CLUSTER_TRIANGLES);
        const struct hg_lod_group *g = &l->groups[c->group];
        FUZZ_CHECK(g->chunk < l->chunk_count);
        FUZZ_CHECK(c->first_index + c->triangle_count * 3 <= l->chunks[g->chunk].index_count);
        FUZZ_CHECK(c->made_from == HG_LOD_NONE ||
                   (c->made_from < l->group_count && l->groups[c->made_from].error <= g->error));
    }
    for (uint32_t i = 0; i < l->group_count; i++) {
        const struct hg_lod_group *g = &l->groups[i];
        FUZZ_CHECK(g->first_cluster + g->cluster_count <= l->cluster_count);
        FUZZ_CHECK(g->first_parent + g->parent_count <= l->parent_count);
        FUZZ_CHECK(g->error < FLT_MAX || g->chunk < l->root_chunk_count);
        for (uint32_t k = 0; k < g->parent_count; k++)
            FUZZ_CHECK(l->parents[g->first_parent + k] < i);
    }
    for (uint32_t i = 0; i < l->node_count; i++) {
        const struct hg_lod_node *n = &l->nodes[i];
        FUZZ_CHECK(n->first + n->count <= (n->is_leaf ? l->group_count : l->node_count));
        FUZZ_CHECK(n->is_leaf || n->first > i);
    }
}

static void decode(const struct hg_lod_format *format, const struct hg_lod_chunk *chunk,
    const uint8_t *data, size_t n)
{
    struct hg_lod_layout layout;
    struct hg_error err = {0};
    hg_lod_layout_of(format, chunk, &layout);
    FUZZ_CHECK(layout.total_bytes <= HG_LOD_CHUNK_BYTES);
    uint8_t *dst = hg_calloc(1, layout.total_bytes);
    if (dst == NULL)
        return;
    if (hg_lod_decode_payload(format, chunk, data, n, dst, &err) == HG_OK) {
        const uint32_t *indices = (const uint32_t *)(const void *)(dst + layout.indices);
        const float *positions = (const float *)(const void *)(dst + layout.positions);
        for (uint32_t i = 0; i < chunk->index_count; i++)
            FUZZ_CHECK(indices[i] < chunk->vertex_count);
        for (uint32_t i = 0; i < chunk->vertex_count * 3; i++)
            FUZZ_CHECK(isfinite(positions[i]));
    }
    hg_free(dst);
}

static void open_file(uint8_t *file, size_t size)
{
    struct hg_lod *lod = NULL;
    struct hg_error err = {0};
    repair(file, size);
    if (hg_lod_open(file, size, &lod, &err) != HG_OK) {
        FUZZ_CHECK(lod == NULL && err.reason[0]);
        return;
    }
    check(lod);
    const struct hg_lod_file *f = (const struct hg_lod_file *)(const void *)lod;
    for (uint32_t i = 0; i < lod->chunk_count && i < CHUNKS_TRIED; i++)
        decode(&f->format, &lod->chunks[i], file + lod->chunks[i].offset, lod->chunks[i].bytes);
    hg_lod_close(lod);
}

// Unpacked tables behind 16 bytes of counts.
static void open_tables(const uint8_t *data, size_t size)
{
    struct hg_reader r = hg_reader_make(data, size);
    struct hg_lod_file *f = hg_calloc(1, sizeof *f);
    struct hg_error err = {0};
    if (f == NULL)
        return;
    f->lod.cluster_count = hg_read_u16(&r);
    f->lod.group_count = hg_read_u16(&r);
    f->lod.chunk_count = hg_read_u16(&r);
    f->lod.root_chunk_count = hg_read_u16(&r);
    f->lod.level_count = hg_read_u16(&r);
    f->lod.stored_triangles = hg_read_u32(&r);
    hg_lod_format_set(&f->format, hg_read_u16(&r) & (HG_DRAW_NORMALS | HG_DRAW_UV1), true);
    if (!r.failed && hg_lod_read_tables(f, data + r.pos, size - r.pos, &err) == HG_OK)
        check(&f->lod);
    hg_lod_close(&f->lod);
}

// A payload behind its counts and format.
static void open_payload(const uint8_t *data, size_t size)
{
    struct hg_reader r = hg_reader_make(data, size);
    struct hg_lod_format format = {.quantum = 0.125f, .uv_quantum = 0x1p-12f};
    const uint32_t flags = hg_read_u16(&r);
    struct hg_lod_chunk chunk = {.vertex_count = hg_read_u16(&r) % 1000u + 1,
        .index_count = (hg_read_u16(&r) % 1000u + 1) * 3};
    hg_lod_format_set(&format,
        flags & (HG_DRAW_NORMALS | HG_DRAW_TANGENTS | HG_DRAW_UV1 |
                    (flags & 1 ? HG_DRAW_COLOR8 : HG_DRAW_COLOR16)),
        (flags & 2) != 0);
    if (!r.failed)
        decode(&format, &chunk, data + r.pos, size - r.pos);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size < 1)
        return 0;
    uint8_t *copy = hg_calloc(1, size - 1);
    if (copy == NULL)
        return 0;
    memcpy(copy, data + 1, size - 1);
    if (data[0] % 3 == 0)
        open_file(copy, size - 1);
    else if (data[0] % 3 == 1)
        open_tables(copy, size - 1);
    else
        open_payload(copy, size - 1);
    hg_free(copy);
    return 0;
}
