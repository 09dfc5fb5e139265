#include <string.h>

#include "base/alloc.h"
#include "base/spill.h"
#include "renderer/scene/asset.h"
#include "renderer/scene/mesh_tools.h"
#include "renderer/scene/xform.h"

static void face_normal(const float p[3][3], float n[3])
{
    float a[3], b[3];
    for (int i = 0; i < 3; i++) {
        a[i] = p[1][i] - p[0][i];
        b[i] = p[2][i] - p[0][i];
    }
    hg_cross3(a, b, n);
    if (!hg_normalize3(n)) { // degenerate: covers no pixel, any unit vector does
        n[0] = n[1] = 0;
        n[2] = 1;
    }
}

static void load_face(const float *positions, const float *delta, uint32_t face, float p[3][3])
{
    memcpy(p, positions + (size_t)face * 9, 9 * sizeof(float));
    for (int i = 0; delta && i < 9; i++)
        p[i / 3][i % 3] += delta[(size_t)face * 9 + i];
}

static enum hg_status make_target_normals(struct hg_mesh_part *part, struct hg_morph_target *target)
{
    if (!target->positions || target->normals)
        return HG_OK;
    target->normals = hg_spill_calloc(part->vertex_count, 3 * sizeof(float));
    if (!target->normals)
        return HG_E_NOMEM;
    for (uint32_t face = 0; face < part->vertex_count / 3; face++) {
        float p[3][3], n[3];
        load_face(part->positions, target->positions, face, p);
        face_normal(p, n);
        for (int c = 0; c < 9; c++)
            target->normals[(size_t)face * 9 + c] = n[c % 3] - part->normals[(size_t)face * 9 + c];
    }
    return HG_OK;
}

enum hg_status hg_part_make_flat_normals(struct hg_mesh_part *part, uint32_t target_count)
{
    uint32_t count = part->index_count;
    enum hg_status status = hg_mesh_part_remap(part, target_count, part->indices, count);
    if (status)
        return status;
    part->normals = hg_spill_calloc(count, 3 * sizeof(float));
    if (!part->normals)
        return HG_E_NOMEM;
    for (uint32_t i = 0; i < count; i++)
        part->indices[i] = i;
    for (uint32_t face = 0; face < count / 3; face++) {
        float p[3][3], n[3];
        load_face(part->positions, NULL, face, p);
        face_normal(p, n);
        for (int c = 0; c < 3; c++)
            memcpy(part->normals + (size_t)face * 9 + c * 3, n, sizeof n);
    }
    for (uint32_t t = 0; !status && part->targets && t < target_count; t++)
        status = make_target_normals(part, &part->targets[t]);
    return status;
}

static void add_face(struct hg_mesh_part *part, const uint32_t corners[3], const bool *lacks)
{
    float a[3], b[3], n[3];
    for (int i = 0; i < 3; i++) {
        const float from = part->positions[(size_t)corners[0] * 3 + i];
        a[i] = part->positions[(size_t)corners[1] * 3 + i] - from;
        b[i] = part->positions[(size_t)corners[2] * 3 + i] - from;
    }
    hg_cross3(a, b, n);
    for (int k = 0; k < 3; k++)
        for (int i = 0; i < 3 && lacks[corners[k]]; i++)
            part->normals[(size_t)corners[k] * 3 + i] += n[i];
}

enum hg_status hg_part_fill_normals(struct hg_mesh_part *part)
{
    bool *lacks = hg_calloc(part->vertex_count, sizeof *lacks), any = false;
    if (!lacks)
        return HG_E_NOMEM;
    for (uint32_t v = 0; v < part->vertex_count; v++) {
        const float *n = part->normals + (size_t)v * 3;
        lacks[v] = hg_dot3(n, n) == 0;
        any |= lacks[v];
    }
    for (uint32_t i = 0;
         any && part->topology == HG_TOPOLOGY_TRIANGLES && i + 2 < part->index_count; i += 3)
        add_face(part, part->indices + i, lacks);
    for (uint32_t v = 0; any && v < part->vertex_count; v++)
        if (lacks[v] && !hg_normalize3(part->normals + (size_t)v * 3)) {
            const float up[3] = {0, 0, 1};
            memcpy(part->normals + (size_t)v * 3, up, sizeof up);
        }
    hg_free(lacks);
    return HG_OK;
}
