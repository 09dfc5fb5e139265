// Appends every fragment of what clipping planes cut to a list, for the host to find out which points
// of the planes lie inside of solids (renderer/frame/look/caps.c).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/item.glsl"

layout(location = 0) flat in uvec2 in_draw;

void main()
{
    hg_word_buffer list = hg_word_buffer(item.depth);
    uint at = atomicAdd(list.v[0], 1u);
    if (at >= item.reserved)
        return;
    at = (at + 1u) * 4u;
    uvec2 pixel = uvec2(gl_FragCoord.xy);
    list.v[at] = pixel.x | pixel.y << 16u;
    list.v[at + 1u] = (in_draw.x + 1u) | (gl_FrontFacing ? 0x80000000u : 0u);
    list.v[at + 2u] = floatBitsToUint(hg_item_view_depth(gl_FragCoord));
}
