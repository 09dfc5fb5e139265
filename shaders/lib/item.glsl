// item.glsl - what fragments of the visibility pass know of the draw they belong to.
#ifndef HG_LIB_ITEM_GLSL
#define HG_LIB_ITEM_GLSL

#include "shared/cluster.h"

layout(constant_id = 3) const uint hg_item = 0u; // HG_ITEM_*
#define HG_ITEM_MAPPED 1u // primitives are those of a list
#define HG_ITEM_LATE   2u // second phase
#define HG_ITEM_NUMBERED 4u // the first corner of a triangle is its number

layout(push_constant, scalar) uniform hg_push
{
    hg_gpu_item item;
};

// in_draw: draw and first corner.
uvec2 hg_item_id(uvec2 in_draw, uint primitive)
{
    if ((hg_item & HG_ITEM_NUMBERED) != 0u)
        return uvec2(in_draw.x + 1u, in_draw.y);
    return uvec2(in_draw.x + 1u,
        (hg_item & HG_ITEM_MAPPED) != 0u ? item.primitives.v[primitive] : primitive);
}

// Of surfaces at the same depth the first in draw order is seen, as if all were drawn in order.
bool hg_item_loses(uvec2 id, vec4 at)
{
    if ((hg_item & HG_ITEM_LATE) == 0u)
        return false;
    uint pixel = uint(at.y) * item.width + uint(at.x);
    if (at.z != item.depth.v[pixel])
        return false;
    uvec2 seen = item.seen.v[pixel];
    return seen.x != 0u && (id.x > seen.x || (id.x == seen.x && id.y > seen.y));
}

#endif
