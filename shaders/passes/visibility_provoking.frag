// visibility.frag for numbered triangles: drivers take triangles apart for shaders that know of
// gl_PrimitiveID at all.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/item.glsl"

layout(location = 0) flat in uvec2 in_draw;
layout(location = 0) out uvec2 out_visibility;

void main()
{
    uvec2 id = hg_item_id(in_draw, 0u);
    if (hg_item_loses(id, gl_FragCoord) || hg_item_clipped(gl_FragCoord))
        discard;
    out_visibility = id;
}
