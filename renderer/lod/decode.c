// decode.c - the bytes of a chunk to the streams that shaders read. See encode.c for the
// format. Every count is checked before memory is taken or written.
#include <meshoptimizer.h>
#include <string.h>
#include <zstd.h>

#include "base/alloc.h"
#include "base/bytes.h"
#include "renderer/lod/discs.h"
#include "renderer/lod/internal.h"
#include "renderer/lod/vertex_pack.h"

struct decoder {
    const struct hg_lod_format *format;
    uint32_t index_count, vertex_count; // as encoded: of points no indices, and no discs
    uint32_t sides;                     // of the discs of points; 0: triangles
    struct hg_reader in;
    uint32_t *indices;
    int32_t (*lattice)[3];
    uint32_t *words;
    int64_t (*normals)[3];
    struct hg_lod_visit *visits;
    int32_t *values; // [vertex_count] of the component being decoded
    uint8_t *seen, *planes, *codec, *escapes;
    uint32_t codec_size, escape_size, plane_count;
    size_t escape_at;
    ZSTD_DCtx *zstd;
    struct hg_lod_component components[HG_LOD_PLANES];
    void *memory;
};

static uint32_t round16(uint32_t bytes)
{
    return (bytes + 15u) & ~15u;
}

void hg_lod_layout_of(
    const struct hg_lod_format *format, const struct hg_lod_chunk *chunk, struct hg_lod_layout *out)
{
    out->indices = 0;
    out->positions = round16(chunk->index_count * 4);
    out->vertices = out->positions + round16(chunk->vertex_count * 12);
    out->extra = out->vertices + chunk->vertex_count * (uint32_t)sizeof(struct hg_gpu_vertex);
    out->total_bytes = out->extra + round16(chunk->vertex_count * format->extra_words * 4);
}

// ---- unpacking ----------------------------------------------------------------------------------

static bool unpack_plane(struct decoder *d, uint8_t *out, size_t size)
{
    const uint32_t head = hg_read_u32(&d->in), bytes = head & 0x7fffffffu;
    const uint8_t *data = hg_read_bytes(&d->in, bytes);
    if (d->in.failed)
        return false;
    if (head >> 31) {
        if (bytes == size)
            memcpy(out, data, size);
        return bytes == size;
    }
    return ZSTD_decompressDCtx(d->zstd, out, size, data, bytes) == size;
}

static bool unpack_all(struct decoder *d)
{
    bool ok = unpack_plane(d, d->codec, d->codec_size);
    for (uint32_t k = 0; ok && k < d->plane_count + 3; k++)
        ok = unpack_plane(d, d->planes + (size_t)k * d->vertex_count, d->vertex_count);
    return ok && unpack_plane(d, d->escapes, d->escape_size) && d->in.pos == d->in.size;
}

static inline int32_t next_difference(struct decoder *d, uint8_t code)
{
    uint32_t z = code;
    if (code >= 254) {
        if (d->escape_size - d->escape_at < 4) {
            d->in.failed = true;
            return 0;
        }
        const uint8_t *e = d->escapes + d->escape_at;
        z = (uint32_t)e[0] | (uint32_t)e[1] << 8 | (uint32_t)e[2] << 16 | (uint32_t)e[3] << 24;
        d->escape_at += 4;
    } else if (code >= 192) {
        if (d->escape_at >= d->escape_size) {
            d->in.failed = true;
            return 0;
        }
        z = 192 + ((uint32_t)(code - 192) << 8) + d->escapes[d->escape_at++];
    }
    return (int32_t)(z >> 1 ^ (0 - (z & 1)));
}

static bool decode_indices(struct decoder *d)
{
    if (d->sides > 0) {
        hg_lod_point_visits(d->vertex_count, d->visits);
        return d->codec_size == 0;
    }
    if (meshopt_decodeIndexBuffer(d->indices, d->index_count, 4, d->codec, d->codec_size) != 0)
        return false;
    for (uint32_t i = 0; i < d->index_count; i++)
        if (d->indices[i] >= d->vertex_count)
            return false;
    return hg_lod_visits(d->indices, d->index_count, d->vertex_count, d->visits, d->seen) ==
           d->vertex_count;
}

// The values of vertices that are predicted by hg_lod_predict_lattice. Returns false when one lies
// beyond the lattice.
static bool decode_lattice(struct decoder *d, const uint8_t *plane)
{
    int32_t *values = d->values;
    uint32_t beyond = 0;
    for (uint32_t i = 0; i < d->vertex_count; i++) {
        const struct hg_lod_visit *v = &d->visits[i];
        const int32_t p = (int32_t)((uint32_t)hg_lod_predict_lattice(v, values) +
                                    (uint32_t)next_difference(d, plane[i]));
        beyond |= (uint32_t)p + HG_LOD_LATTICE_MAX > 2u * HG_LOD_LATTICE_MAX;
        values[v->vertex] = p;
    }
    return beyond == 0;
}

static bool decode_positions(struct decoder *d)
{
    for (int axis = 0; axis < 3; axis++) {
        if (!decode_lattice(d, d->planes + (size_t)axis * d->vertex_count))
            return false;
        for (uint32_t i = 0; i < d->vertex_count; i++)
            d->lattice[i][axis] = d->values[i];
    }
    return !d->in.failed;
}

static bool in_range(const struct hg_lod_component *c, int32_t v)
{
    switch (c->kind) {
    case HG_LOD_NORMAL:
        return v >= -HG_LOD_NORMAL_STEPS && v <= HG_LOD_NORMAL_STEPS;
    case HG_LOD_TANGENT:
        return c->index == 0 ? v >= -HG_LOD_TANGENT_STEPS && v <= HG_LOD_TANGENT_STEPS
                             : v >= -2 * HG_LOD_TANGENT_STEPS && v <= 2 * HG_LOD_TANGENT_STEPS + 1;
    case HG_LOD_BYTES:
        return v >= 0 && v <= 255;
    case HG_LOD_SHORTS:
        return v >= 0 && v <= 65535;
    case HG_LOD_LATTICE:
        break;
    }
    return v >= -HG_LOD_LATTICE_MAX && v <= HG_LOD_LATTICE_MAX;
}

static bool decode_predicted(
    struct decoder *d, const struct hg_lod_component *c, const uint8_t *plane)
{
    for (uint32_t i = 0; i < d->vertex_count; i++) {
        const struct hg_lod_visit *v = &d->visits[i];
        const int32_t at =
            hg_lod_predict(c, v, d->values, d->sides > 0 ? NULL : (const int64_t(*)[3])d->normals);
        const int32_t value = (int32_t)((uint32_t)at + (uint32_t)next_difference(d, plane[i]));
        if (!in_range(c, value))
            return false;
        d->values[v->vertex] = value;
    }
    return true;
}

static bool decode_components(struct decoder *d)
{
    const struct hg_lod_format *f = d->format;
    if (f->normal >= 0 && d->sides == 0)
        hg_lod_sum_normals(d->indices, d->index_count, (const int32_t(*)[3])d->lattice,
            d->vertex_count, d->normals);
    for (uint32_t k = 0; k < d->plane_count; k++) {
        const struct hg_lod_component *c = &d->components[k];
        const uint8_t *plane = d->planes + (size_t)(k + 3) * d->vertex_count;
        if (c->kind == HG_LOD_LATTICE ? !decode_lattice(d, plane) : !decode_predicted(d, c, plane))
            return false;
        for (uint32_t i = 0; i < d->vertex_count; i++)
            hg_lod_component_set(c, d->words + (size_t)i * f->words, d->values[i]);
    }
    return !d->in.failed && d->escape_at == d->escape_size;
}

// ---- streams ------------------------------------------------------------------------------------

static uint32_t widen(int32_t v, int32_t from, int32_t to)
{
    return (uint32_t)((v * to + (v < 0 ? -from / 2 : from / 2)) / from);
}

static struct hg_gpu_vertex make_vertex(const struct hg_lod_format *f, const uint32_t *words)
{
    struct hg_gpu_vertex v = {0};
    if (f->normal >= 0) {
        const uint32_t w = words[f->normal];
        v.normal = (widen((int16_t)w, HG_LOD_NORMAL_STEPS, 32767) & 0xffffu) |
                   widen((int16_t)(w >> 16), HG_LOD_NORMAL_STEPS, 32767) << 16;
    }
    if (f->tangent >= 0) {
        const uint32_t w = words[f->tangent];
        const int32_t y = (int32_t)(w >> 16 & 0x7fffu);
        v.tangent = (widen((int16_t)w, HG_LOD_TANGENT_STEPS, 32767) & 0xffffu) |
                    (widen(y >= 0x4000 ? y - 0x8000 : y, HG_LOD_TANGENT_STEPS, 16383) & 0x7fffu)
                        << 16 |
                    (w & 0x80000000u);
    }
    if (f->uv >= 0) {
        v.uv.x = (float)(int32_t)words[f->uv] * f->uv_quantum;
        v.uv.y = (float)(int32_t)words[f->uv + 1] * f->uv_quantum;
    }
    return v;
}

static void write_extra(const struct decoder *d, uint8_t *dst)
{
    const struct hg_lod_format *f = d->format;
    for (uint32_t i = 0; i < d->vertex_count; i++) {
        const uint32_t *words = d->words + (size_t)i * f->words;
        if (f->uv1 >= 0) {
            const float uv[2] = {(float)(int32_t)words[f->uv1] * f->uv_quantum,
                (float)(int32_t)words[f->uv1 + 1] * f->uv_quantum};
            memcpy(dst, uv, 8);
            dst += 8;
        }
        const size_t bytes = f->flags & HG_DRAW_COLOR16 ? 8 : f->flags & HG_DRAW_COLOR8 ? 4 : 0;
        if (bytes > 0)
            memcpy(dst, words + f->color, bytes);
        dst += bytes;
    }
}

static void write_streams(const struct decoder *d, const struct hg_lod_chunk *chunk, uint8_t *dst)
{
    struct hg_lod_layout l;
    hg_lod_layout_of(d->format, chunk, &l);
    memcpy(dst + l.indices, d->indices, (size_t)d->index_count * 4);
    memset(dst + d->index_count * 4, 0, l.positions - d->index_count * 4);
    for (uint32_t i = 0; i < d->vertex_count; i++) {
        float p[3];
        for (int k = 0; k < 3; k++)
            p[k] = (float)d->lattice[i][k] * d->format->quantum;
        memcpy(dst + l.positions + (size_t)i * 12, p, 12);
    }
    const uint32_t end = l.positions + d->vertex_count * 12;
    memset(dst + end, 0, l.vertices - end);
    for (uint32_t i = 0; i < d->vertex_count; i++) {
        const struct hg_gpu_vertex v =
            make_vertex(d->format, d->words + (size_t)i * d->format->words);
        memcpy(dst + l.vertices + (size_t)i * sizeof v, &v, sizeof v);
    }
    if (d->format->extra_words > 0) {
        const uint32_t used = l.extra + d->vertex_count * d->format->extra_words * 4;
        write_extra(d, dst + l.extra);
        memset(dst + used, 0, l.total_bytes - used);
    }
}

// ---- discs --------------------------------------------------------------------------------------

// Where the streams of discs are written, disc by disc.
struct disc_streams {
    uint8_t *indices, *positions, *vertices, *extra;
    uint32_t sides, extra_bytes; // per vertex
};

static void write_disc(const struct decoder *d, uint32_t point, const struct disc_streams *to)
{
    const struct hg_lod_format *f = d->format;
    const uint32_t *words = d->words + (size_t)point * f->words;
    const struct hg_gpu_vertex v = make_vertex(f, words);
    const size_t first = (size_t)point * to->sides, triangles = hg_disc_triangles(to->sides);
    float at[3], normal[3], corners[HG_DISC_SIDES_MAX * 3];
    uint32_t indices[(HG_DISC_SIDES_MAX - 2) * 3];
    for (int k = 0; k < 3; k++)
        at[k] = (float)d->lattice[point][k] * f->quantum;
    hg_unpack_normal(v.normal, normal);
    const float radius = (float)(int32_t)words[f->radius] * (f->quantum / HG_LOD_RADIUS_STEPS);
    hg_disc_corners(at, normal, radius, to->sides, corners);
    hg_disc_indices((uint32_t)first, to->sides, indices);
    memcpy(to->indices + point * triangles * 12, indices, triangles * 12);
    memcpy(to->positions + first * 12, corners, to->sides * 12ul);
    for (size_t i = first; i < first + to->sides; i++) {
        memcpy(to->vertices + i * sizeof v, &v, sizeof v);
        memcpy(to->extra + i * to->extra_bytes, words + (f->color >= 0 ? f->color : 0),
            to->extra_bytes);
    }
}

static void write_discs(const struct decoder *d, const struct hg_lod_chunk *chunk, uint8_t *dst)
{
    struct hg_lod_layout l;
    hg_lod_layout_of(d->format, chunk, &l);
    const struct disc_streams to = {dst + l.indices, dst + l.positions, dst + l.vertices,
        dst + l.extra, d->sides, d->format->extra_words * 4};
    const uint32_t indices = chunk->index_count * 4, extra = chunk->vertex_count * to.extra_bytes;
    const uint32_t positions = l.positions + chunk->vertex_count * 12;
    memset(dst + indices, 0, l.positions - indices);
    memset(dst + positions, 0, l.vertices - positions);
    memset(dst + l.extra + extra, 0, l.total_bytes - l.extra - extra);
    for (uint32_t i = 0; i < d->vertex_count; i++)
        write_disc(d, i, &to);
}

// ---- all of it ----------------------------------------------------------------------------------

// Sizes are bounded by those of a decoded chunk, so they cannot overflow.
static enum hg_status take(struct decoder *d)
{
    const size_t n = d->vertex_count, planes = (size_t)d->plane_count + 3;
    const size_t bytes =
        n * (sizeof *d->normals + 16 + sizeof *d->visits + 1 + planes + d->format->words * 4) +
        d->index_count * 4ull + d->codec_size + d->escape_size + 64;
    uint8_t *at = hg_calloc(1, bytes);
    d->memory = at;
    d->zstd = ZSTD_createDCtx();
    if (at == NULL || d->zstd == NULL)
        return HG_E_NOMEM;
    d->normals = (int64_t(*)[3])(void *)at;
    d->lattice = (int32_t(*)[3])(void *)(at += n * sizeof *d->normals);
    d->values = (int32_t *)(void *)(at += n * 12);
    d->visits = (struct hg_lod_visit *)(void *)(at += n * 4);
    d->words = (uint32_t *)(void *)(at += n * sizeof *d->visits);
    d->indices = (uint32_t *)(void *)(at += n * d->format->words * 4);
    d->seen = at += (size_t)d->index_count * 4;
    d->planes = at += n;
    d->codec = at += n * planes;
    d->escapes = at + d->codec_size;
    return HG_OK;
}

static bool sizes_ok(struct decoder *d)
{
    d->codec_size = hg_read_u32(&d->in);
    d->escape_size = hg_read_u32(&d->in);
    return !d->in.failed && d->codec_size <= d->index_count * 8ull + 64 &&
           d->escape_size <= d->vertex_count * 4ull * (d->plane_count + 3);
}

enum hg_status hg_lod_decode_payload(const struct hg_lod_format *format,
    const struct hg_lod_chunk *chunk, const uint8_t *encoded, size_t size, uint8_t *dst,
    struct hg_error *err)
{
    struct decoder d = {.format = format,
        .index_count = chunk->index_count,
        .vertex_count = chunk->vertex_count,
        .in = hg_reader_make(encoded, size)};
    d.plane_count = hg_lod_components(format, d.components);
    enum hg_status status = HG_E_FORMAT;
    const bool discs = (format->flags & HG_DRAW_DISCS) != 0;
    if (discs && !hg_lod_disc_counts(chunk, &d.vertex_count, &d.sides))
        return hg_error_set(
            err, status, "cluster chunk", NULL, "its counts are not those of discs");
    d.index_count = discs ? 0 : d.index_count;
    if (sizes_ok(&d) && (status = take(&d)) == HG_OK) {
        const bool ok =
            unpack_all(&d) && decode_indices(&d) && decode_positions(&d) && decode_components(&d);
        if (ok && discs)
            write_discs(&d, chunk, dst);
        else if (ok)
            write_streams(&d, chunk, dst);
        status = ok ? HG_OK : HG_E_FORMAT;
    }
    hg_free(d.memory);
    ZSTD_freeDCtx(d.zstd);
    if (status == HG_E_FORMAT)
        return hg_error_set(err, status, "cluster chunk", NULL, "the bytes make no sense");
    return status;
}

void hg_lod_chunk_layout(const struct hg_lod *lod, uint32_t chunk, struct hg_lod_layout *out)
{
    const struct hg_lod_file *file = (const struct hg_lod_file *)(const void *)lod;
    hg_lod_layout_of(&file->format, &lod->chunks[chunk], out);
}

enum hg_status hg_lod_decode(const struct hg_lod *lod, uint32_t chunk, const uint8_t *encoded,
    size_t size, uint8_t *dst, struct hg_error *err)
{
    const struct hg_lod_file *file = (const struct hg_lod_file *)(const void *)lod;
    const struct hg_lod_chunk *c = &lod->chunks[chunk];
    if (size != c->bytes)
        return hg_error_set(err, HG_E_TRUNCATED, "cluster chunk", NULL,
            "chunk %u has %zu bytes instead of %u", chunk, size, c->bytes);
    if (hg_lod_crc(encoded, size) != c->crc)
        return hg_error_set(
            err, HG_E_HASH, "cluster chunk", NULL, "the checksum of chunk %u is wrong", chunk);
    return hg_lod_decode_payload(&file->format, c, encoded, size, dst, err);
}
