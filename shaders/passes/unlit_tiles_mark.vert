// Rectangles over the runs of unlit tiles, two triangles each.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/unlit_tiles.glsl"

void main()
{
    uvec2 run = unlit.runs.v[gl_VertexIndex / 6];
    uint corner = gl_VertexIndex % 6, right = 0x32u >> corner & 1u, down = 0x2cu >> corner & 1u;
    uvec2 cell = uvec2(right != 0u ? run.x >> 16u : run.x & 0xffffu, run.y + down);
    vec2 at = vec2(cell * uint(HG_UNLIT_TILES_CELL_PX)) / vec2(unlit.width, unlit.height);
    gl_Position = vec4(at * 2.0 - 1.0, 0.0, 1.0);
}
