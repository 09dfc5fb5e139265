// vertex_pack.c - see vertex_pack.h.
#include <math.h>
#include <string.h>

#include "base/checked.h"
#include "renderer/lod/vertex_pack.h"

static float sign_of(float v)
{
    return v < 0.0f ? -1.0f : 1.0f;
}

static void octahedral_encode(const float v[3], float e[2])
{
    const float sum = fabsf(v[0]) + fabsf(v[1]) + fabsf(v[2]);
    const float scale = sum > 0.0f ? 1.0f / sum : 0.0f;
    const float x = v[0] * scale, y = v[1] * scale;
    e[0] = v[2] >= 0.0f ? x : (1.0f - fabsf(y)) * sign_of(x);
    e[1] = v[2] >= 0.0f ? y : (1.0f - fabsf(x)) * sign_of(y);
}

static void octahedral_decode(const float e[2], float v[3])
{
    v[0] = e[0];
    v[1] = e[1];
    v[2] = 1.0f - fabsf(e[0]) - fabsf(e[1]);
    const float fold = v[2] < 0.0f ? -v[2] : 0.0f;
    v[0] += v[0] >= 0.0f ? -fold : fold;
    v[1] += v[1] >= 0.0f ? -fold : fold;
    const float length = sqrtf(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int i = 0; i < 3; i++)
        v[i] /= length;
}

// Best of the four lattice points around the exact coordinates.
static void quantise(const float v[3], int x_max, int y_max, int out[2])
{
    float e[2];
    octahedral_encode(v, e);
    const int x0 = (int)floorf(e[0] * (float)x_max), y0 = (int)floorf(e[1] * (float)y_max);
    float best = 8.0f; // squared distance: a cosine of floats cannot tell the candidates apart
    for (int i = 0; i < 4; i++) {
        const int x = x0 + (i & 1), y = y0 + (i >> 1);
        if (x > x_max || y > y_max)
            continue;
        const float at[2] = {(float)x / (float)x_max, (float)y / (float)y_max};
        float d[3];
        octahedral_decode(at, d);
        float gap = 0.0f;
        for (int k = 0; k < 3; k++)
            gap += (d[k] - v[k]) * (d[k] - v[k]);
        if (gap < best) {
            best = gap;
            out[0] = x;
            out[1] = y;
        }
    }
}

uint32_t hg_pack_normal(const float normal[3])
{
    int q[2] = {0, 0};
    quantise(normal, 32767, 32767, q);
    return ((uint32_t)q[0] & 0xffffu) | ((uint32_t)q[1] & 0xffffu) << 16;
}

uint32_t hg_pack_tangent(const float tangent[4])
{
    int q[2] = {0, 0};
    quantise(tangent, 32767, 16383, q);
    return ((uint32_t)q[0] & 0xffffu) | ((uint32_t)q[1] & 0x7fffu) << 16 |
           (tangent[3] < 0.0f ? 0x80000000u : 0u);
}

void hg_unpack_normal(uint32_t word, float normal[3])
{
    const float e[2] = {(float)(int16_t)word / 32767.0f, (float)(int16_t)(word >> 16) / 32767.0f};
    octahedral_decode(e, normal);
}

void hg_unpack_tangent(uint32_t word, float tangent[4])
{
    const int y = (int)(word >> 16 & 0x7fffu);
    const float e[2] = {
        (float)(int16_t)word / 32767.0f, (float)(y >= 0x4000 ? y - 0x8000 : y) / 16383.0f};
    octahedral_decode(e, tangent);
    tangent[3] = word >> 31 ? -1.0f : 1.0f;
}

// RGBA8 is enough when every value is a multiple of 1/255, as colours of byte files are.
static bool colors_fit_8(const struct hg_mesh_part *part)
{
    for (size_t i = 0; i < (size_t)part->vertex_count * 4; i++) {
        const float v = part->colors[i] * 255.0f;
        if (!(v >= 0.0f && v <= 255.0f) || fabsf(v - rintf(v)) > 1e-3f)
            return false;
    }
    return true;
}

static bool place(uint64_t *cursor, uint64_t count, uint64_t bytes, uint64_t *offset)
{
    uint64_t size, end;
    *offset = *cursor;
    if (!hg_mul_u64(count, bytes, &size) || !hg_add_u64(*cursor, size, &end) ||
        !hg_add_u64(end, 255, &end))
        return false;
    *cursor = end & ~255ull;
    return true;
}

static uint32_t target_streams(const struct hg_mesh_part *part, uint32_t target)
{
    const struct hg_morph_target *t = &part->targets[target];
    return (t->positions != NULL) + (t->normals != NULL) + (t->tangents != NULL);
}

enum hg_status hg_pack_layout_of(
    const struct hg_mesh_part *part, uint32_t target_count, struct hg_pack_layout *out)
{
    memset(out, 0, sizeof *out);
    struct hg_pack_layout l = {0};
    l.flags = (part->topology == HG_TOPOLOGY_LINES       ? HG_DRAW_LINES
                  : part->topology == HG_TOPOLOGY_POINTS ? HG_DRAW_POINTS
                                                         : 0u) |
              (part->normals != NULL ? HG_DRAW_NORMALS : 0u) |
              (part->tangents != NULL ? HG_DRAW_TANGENTS : 0u);
    if (part->uv[1] != NULL)
        l.flags |= HG_DRAW_UV1;
    if (part->colors != NULL)
        l.flags |= colors_fit_8(part) ? HG_DRAW_COLOR8 : HG_DRAW_COLOR16;
    l.extra_words = (l.flags & HG_DRAW_UV1 ? 2u : 0u) + (l.flags & HG_DRAW_COLOR8 ? 1u : 0u) +
                    (l.flags & HG_DRAW_COLOR16 ? 2u : 0u);
    uint64_t streams = 0, cursor = 0;
    for (uint32_t i = 0; part->targets != NULL && i < target_count; i++)
        streams += target_streams(part, i);
    const uint64_t n = part->vertex_count, joints = part->joints != NULL ? part->joint_sets : 0;
    // Offsets into the targets are 32-bit floats counts.
    if (streams * n > UINT32_MAX / 3)
        return HG_E_LIMIT;
    if (!place(&cursor, part->index_count, 4, &l.indices) || !place(&cursor, n, 12, &l.positions) ||
        !place(&cursor, n, sizeof(struct hg_gpu_vertex), &l.vertices) ||
        !place(&cursor, n, l.extra_words * 4ull, &l.extra) ||
        !place(&cursor, n, joints * 8, &l.joints) || !place(&cursor, n, joints * 16, &l.weights) ||
        !place(&cursor, n, streams * 12, &l.targets))
        return HG_E_LIMIT;
    l.total_bytes = cursor;
    *out = l;
    return HG_OK;
}

static void pack_vertices(const struct hg_mesh_part *part, struct hg_gpu_vertex *dst)
{
    for (size_t i = 0; i < part->vertex_count; i++) {
        struct hg_gpu_vertex v = {0};
        if (part->normals != NULL)
            v.normal = hg_pack_normal(part->normals + i * 3);
        if (part->tangents != NULL)
            v.tangent = hg_pack_tangent(part->tangents + i * 4);
        if (part->uv[0] != NULL)
            v.uv = (struct hg_vec2){part->uv[0][i * 2], part->uv[0][i * 2 + 1]};
        dst[i] = v;
    }
}

static uint32_t unorm(float v, float scale)
{
    return !(v > 0.0f) ? 0 : v >= 1.0f ? (uint32_t)scale : (uint32_t)(v * scale + 0.5f);
}

static void pack_extra(
    const struct hg_mesh_part *part, const struct hg_pack_layout *l, uint32_t *dst)
{
    for (size_t i = 0; i < part->vertex_count; i++) {
        if (l->flags & HG_DRAW_UV1) {
            memcpy(dst, part->uv[1] + i * 2, 8);
            dst += 2;
        }
        const float *c = part->colors != NULL ? part->colors + i * 4 : NULL;
        if (l->flags & HG_DRAW_COLOR8) {
            *dst++ = unorm(c[0], 255.0f) | unorm(c[1], 255.0f) << 8 | unorm(c[2], 255.0f) << 16 |
                     unorm(c[3], 255.0f) << 24;
        } else if (l->flags & HG_DRAW_COLOR16) {
            *dst++ = unorm(c[0], 65535.0f) | unorm(c[1], 65535.0f) << 16;
            *dst++ = unorm(c[2], 65535.0f) | unorm(c[3], 65535.0f) << 16;
        }
    }
}

static uint8_t *put(uint8_t *dst, const float *values, size_t bytes)
{
    if (values == NULL)
        return dst;
    memcpy(dst, values, bytes);
    return dst + bytes;
}

static void pack_indices(const struct hg_mesh_part *part, const uint32_t *order, uint32_t *dst)
{
    if (order == NULL) {
        memcpy(dst, part->indices, (size_t)part->index_count * 4);
        return;
    }
    for (size_t i = 0; i < part->index_count / 3; i++)
        memcpy(dst + i * 3, part->indices + (size_t)order[i] * 3, 12);
}

void hg_pack_part(const struct hg_mesh_part *part, uint32_t target_count, const uint32_t *order,
    const struct hg_pack_layout *l, uint8_t *dst)
{
    const size_t n = part->vertex_count;
    memset(dst, 0, l->total_bytes);
    pack_indices(part, order, (uint32_t *)(void *)(dst + l->indices));
    memcpy(dst + l->positions, part->positions, n * 12);
    pack_vertices(part, (struct hg_gpu_vertex *)(void *)(dst + l->vertices));
    if (l->extra_words > 0)
        pack_extra(part, l, (uint32_t *)(void *)(dst + l->extra));
    if (part->joints != NULL && part->joint_sets > 0) {
        memcpy(dst + l->joints, part->joints, n * part->joint_sets * 8);
        memcpy(dst + l->weights, part->weights, n * part->joint_sets * 16);
    }
    uint8_t *at = dst + l->targets;
    for (uint32_t i = 0; part->targets != NULL && i < target_count; i++) {
        at = put(at, part->targets[i].positions, n * 12);
        at = put(at, part->targets[i].normals, n * 12);
        at = put(at, part->targets[i].tangents, n * 12);
    }
}

struct hg_gpu_morph hg_pack_morph(const struct hg_mesh_part *part, uint32_t target)
{
    uint32_t at = 0;
    const uint32_t step = part->vertex_count * 3;
    for (uint32_t i = 0; i < target; i++)
        at += target_streams(part, i) * step;
    const struct hg_morph_target *t = &part->targets[target];
    struct hg_gpu_morph m = {0.0f, HG_DEFORM_ABSENT, HG_DEFORM_ABSENT, HG_DEFORM_ABSENT};
    if (t->positions != NULL) {
        m.positions = at;
        at += step;
    }
    if (t->normals != NULL) {
        m.normals = at;
        at += step;
    }
    if (t->tangents != NULL)
        m.tangents = at;
    return m;
}
