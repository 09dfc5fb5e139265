// Draw and primitive of the nearest surface.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/item.glsl"

layout(location = 0) flat in uvec2 in_draw;
layout(location = 0) out uvec2 out_visibility;

void main()
{
    uvec2 id = hg_item_id(in_draw, gl_PrimitiveID);
    if (hg_item_loses(id, gl_FragCoord) || hg_item_clipped(gl_FragCoord))
        discard;
    out_visibility = id;
}
