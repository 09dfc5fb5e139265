#include "renderer/scene/mesh_tools.h"

enum hg_topology hg_mode_topology(enum hg_primitive_mode mode)
{
    if (mode == HG_MODE_POINTS)
        return HG_TOPOLOGY_POINTS;
    return mode < HG_MODE_TRIANGLES ? HG_TOPOLOGY_LINES : HG_TOPOLOGY_TRIANGLES;
}

uint64_t hg_mode_list_count(enum hg_primitive_mode mode, uint32_t count)
{
    switch (mode) {
    case HG_MODE_POINTS:
        return count;
    case HG_MODE_LINES:
        return count & ~1u;
    case HG_MODE_LINE_LOOP:
        return count < 2 ? 0 : (uint64_t)count * 2;
    case HG_MODE_LINE_STRIP:
        return count < 2 ? 0 : ((uint64_t)count - 1) * 2;
    case HG_MODE_TRIANGLES:
        return count - count % 3;
    case HG_MODE_TRIANGLE_STRIP:
    case HG_MODE_TRIANGLE_FAN:
        return count < 3 ? 0 : ((uint64_t)count - 2) * 3;
    }
    return 0;
}

// Which corner (0 .. count - 1) the i-th index of the list is.
static uint32_t corner(enum hg_primitive_mode mode, uint32_t count, uint64_t i)
{
    uint32_t primitive, k;
    switch (mode) {
    case HG_MODE_LINE_LOOP:
    case HG_MODE_LINE_STRIP:
        return (uint32_t)((i / 2 + i % 2) % count);
    case HG_MODE_TRIANGLE_STRIP: // glTF 2.0, 3.7.2.1: {v[i], v[i + (1 + i % 2)], v[i + (2 - i %
                                 // 2)]}
        primitive = (uint32_t)(i / 3);
        k = (uint32_t)(i % 3);
        if (k == 0)
            return primitive;
        return primitive + (k == 1 ? 1 + primitive % 2 : 2 - primitive % 2);
    case HG_MODE_TRIANGLE_FAN: // {v[i + 1], v[i + 2], v[0]}
        primitive = (uint32_t)(i / 3);
        k = (uint32_t)(i % 3);
        return k == 2 ? 0 : primitive + 1 + k;
    default:
        return (uint32_t)i;
    }
}

void hg_mode_expand(enum hg_primitive_mode mode, const uint32_t *in, uint32_t count, uint32_t *out)
{
    uint64_t n = hg_mode_list_count(mode, count);
    for (uint64_t i = 0; i < n; i++) {
        uint32_t c = corner(mode, count, i);
        out[i] = in ? in[c] : c;
    }
}
