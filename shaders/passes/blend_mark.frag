// Marks the pixels with lists in a depth buffer: 1 with more than one node, 0.5 with one.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/blend.glsl"

layout(push_constant, scalar) uniform hg_push
{
    hg_blend_reports reports;
    uvec2 first; // pixel of the area
    uint report;
} push;

void main()
{
    uvec2 pixel = uvec2(gl_FragCoord.xy);
    if (pixel == push.first) {
        atomicMax(push.reports.v[push.report].nodes, hg_frame.blend.nodes.v[0].next);
        atomicAdd(push.reports.v[push.report].fragments, hg_frame.blend.nodes.v[0].draw);
    }
    uint head = hg_blend_head(pixel);
    if (head == 0u)
        discard;
    gl_FragDepth = hg_frame.blend.nodes.v[head].next != 0u ? 1.0 : 0.5;
}
