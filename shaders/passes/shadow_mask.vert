// Depth of casters with holes. gl_InstanceIndex is the draw.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/frame.glsl"
#include "lib/vertex.glsl"
#include "lib/shadow.glsl"

layout(location = 0) out vec4 out_uv; // both sets
layout(location = 1) out float out_alpha;
layout(location = 2) flat out uvec2 out_draw; // and its material

void main()
{
    hg_gpu_draw d = hg_draw_at(gl_InstanceIndex);
    out_uv.xy = hg_push.vertices.v[gl_VertexIndex].uv;
    out_uv.zw = (d.flags & HG_DRAW_UV1) != 0u
        ? hg_fetch_uv1(hg_push.extra, d.flags, gl_VertexIndex)
        : vec2(0.0);
    out_alpha = (d.flags & (HG_DRAW_COLOR8 | HG_DRAW_COLOR16)) != 0u
        ? hg_fetch_color(hg_push.extra, d.flags, gl_VertexIndex).w
        : 1.0;
    out_draw = uvec2(gl_InstanceIndex, d.material);
    gl_Position = hg_shadow_position(gl_InstanceIndex, gl_VertexIndex);
    gl_PointSize = 1.0;
}
