// item.glsl - what fragments of the visibility pass know of the draw they belong to.
#ifndef HG_LIB_ITEM_GLSL
#define HG_LIB_ITEM_GLSL

#include "lib/frame.glsl"
#include "shared/cluster.h"

layout(constant_id = 3) const uint hg_item = 0u; // HG_ITEM_*
#define HG_ITEM_MAPPED 1u // primitives are those of a list
#define HG_ITEM_LATE   2u // second phase
#define HG_ITEM_NUMBERED 4u // the first corner of a triangle is its number

layout(push_constant, scalar) uniform hg_push
{
    hg_gpu_item item;
};

#define HG_ITEM_CLIPPED 8u // the planes of the frame block cut it

// Metres along the view direction. at: gl_FragCoord; w of clip space is the depth in perspective.
float hg_item_view_depth(vec4 at)
{
    return hg_frame.camera.orthographic != 0u
        ? (hg_frame.camera.proj[3].z - at.z) / hg_frame.camera.proj[2].z
        : 1.0 / at.w;
}

// A fragment that a clipping plane leaves out. at: gl_FragCoord.
bool hg_item_clipped(vec4 at)
{
    if ((hg_item & HG_ITEM_CLIPPED) == 0u)
        return false;
    vec3 across = hg_frame.camera.ray_origin_ws + at.x * hg_frame.camera.ray_x_ws +
        at.y * hg_frame.camera.ray_y_ws;
    float depth = hg_item_view_depth(at);
    vec3 p = hg_frame.camera.orthographic != 0u ? across + hg_frame.camera.forward_ws * depth
                                                : hg_frame.camera.eye_ws + across * depth;
    bool clipped = false;
    for (uint i = 0u; i < min(hg_frame.clip_count, uint(HG_CLIP_PLANES)); i++)
        clipped = clipped ||
            dot(hg_frame.clip_planes[i].xyz, p) + hg_frame.clip_planes[i].w < 0.0;
    return clipped;
}

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
