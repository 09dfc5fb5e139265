// Runs of unlit tiles, to be drawn as rectangles. One invocation per row. Their order is by chance,
// and does not matter: they do not overlap.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/unlit_tiles.glsl"

layout(local_size_x = 8) in;

void main()
{
    uint row = gl_GlobalInvocationID.x;
    if (row >= unlit.rows)
        return;
    uint first = 0u, x = 0u, count = 0u;
    bool before = false;
    do {
        bool now = x < unlit.columns && unlit.cells.v[row * unlit.columns + x] != 0u;
        if (now && !before)
            first = x;
        if (before && !now) {
            uint at = atomicAdd(unlit.head.v.vertex_count, 6u) / 6u;
            unlit.runs.v[at] = uvec2(first | x << 16u, row);
            count += x - first;
        }
        before = now;
    } while (++x <= unlit.columns);
    atomicAdd(unlit.head.v.unlit, count);
}
