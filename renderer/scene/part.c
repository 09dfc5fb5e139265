// Vertex arrays of one mesh part.
#include <string.h>

#include "base/alloc.h"
#include "base/spill.h"
#include "renderer/scene/asset.h"
#include "renderer/scene/xform.h"

void hg_mesh_part_finish(struct hg_mesh_part *part, uint32_t target_count)
{
    for (uint32_t t = 0; part->targets && t < target_count; t++) {
        hg_free(part->targets[t].positions);
        hg_free(part->targets[t].normals);
        hg_free(part->targets[t].tangents);
    }
    hg_free(part->targets);
    hg_free(part->indices);
    hg_free(part->positions);
    hg_free(part->normals);
    hg_free(part->tangents);
    hg_free(part->uv[0]);
    hg_free(part->uv[1]);
    hg_free(part->colors);
    hg_free(part->joints);
    hg_free(part->weights);
    hg_free(part->variants);
    memset(part, 0, sizeof *part);
}

void hg_mesh_part_update_bounds(struct hg_mesh_part *part, uint32_t target_count)
{
    hg_bounds_clear(part->bounds_min, part->bounds_max);
    for (uint32_t v = 0; v < part->vertex_count; v++) {
        const float *p = part->positions + (size_t)v * 3;
        float low[3], high[3];
        memcpy(low, p, sizeof low);
        memcpy(high, p, sizeof high);
        for (uint32_t t = 0; part->targets && t < target_count; t++) {
            const float *delta = part->targets[t].positions;
            for (int i = 0; delta && i < 3; i++) {
                float d = delta[(size_t)v * 3 + i];
                *(d < 0 ? &low[i] : &high[i]) += d;
            }
        }
        hg_bounds_add(part->bounds_min, part->bounds_max, low);
        hg_bounds_add(part->bounds_min, part->bounds_max, high);
    }
    if (part->vertex_count == 0) {
        memset(part->bounds_min, 0, sizeof part->bounds_min);
        memset(part->bounds_max, 0, sizeof part->bounds_max);
    }
}

// Replaces *array by gathered copies of its elements.
static bool gather(void *array_ptr, size_t element_bytes, const uint32_t *source, uint32_t count)
{
    uint8_t *old;
    memcpy(&old, array_ptr, sizeof old);
    if (!old)
        return true;
    uint8_t *fresh = hg_spill_calloc(count, element_bytes);
    if (!fresh)
        return false;
    for (uint32_t i = 0; i < count; i++)
        memcpy(fresh + i * element_bytes, old + source[i] * element_bytes, element_bytes);
    hg_free(old);
    memcpy(array_ptr, &fresh, sizeof fresh);
    return true;
}

enum hg_status hg_mesh_part_remap(
    struct hg_mesh_part *part, uint32_t target_count, const uint32_t *source, uint32_t count)
{
    size_t f = sizeof(float);
    bool ok = gather(&part->positions, 3 * f, source, count) &&
              gather(&part->normals, 3 * f, source, count) &&
              gather(&part->tangents, 4 * f, source, count) &&
              gather(&part->uv[0], 2 * f, source, count) &&
              gather(&part->uv[1], 2 * f, source, count) &&
              gather(&part->colors, 4 * f, source, count) &&
              gather(&part->joints, 4 * part->joint_sets * sizeof(uint16_t), source, count) &&
              gather(&part->weights, 4 * part->joint_sets * f, source, count);
    for (uint32_t t = 0; ok && part->targets && t < target_count; t++)
        ok = gather(&part->targets[t].positions, 3 * f, source, count) &&
             gather(&part->targets[t].normals, 3 * f, source, count) &&
             gather(&part->targets[t].tangents, 3 * f, source, count);
    if (!ok)
        return HG_E_NOMEM;
    part->vertex_count = count;
    return HG_OK;
}
