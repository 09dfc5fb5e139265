// Alpha test of casters with holes.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/frame.glsl"
#include "lib/vertex.glsl"
#include "lib/texture.glsl"
#include "lib/material.glsl"

layout(location = 0) in vec4 in_uv;
layout(location = 1) in float in_alpha;
layout(location = 2) flat in uint in_material;

void main()
{
    hg_vertex v;
    v.uv0 = in_uv.xy;
    v.uv0_dx = dFdx(in_uv.xy);
    v.uv0_dy = dFdy(in_uv.xy);
    v.uv1 = in_uv.zw;
    v.uv1_dx = dFdx(in_uv.zw);
    v.uv1_dy = dFdy(in_uv.zw);
    v.color = vec4(1.0, 1.0, 1.0, in_alpha);
    float alpha = hg_material_alpha(in_material, v);
    if (HG_HAS(HG_FEATURE_STREAM) && hg_texture_coarser != 0u) {
        atomicAdd(HG_TEXTURES.feedback.v[HG_FEEDBACK_SHADOWS], 1u); // this map has to be drawn again
        if (hg_textures_exact())
            discard; // on top of what is there now
    }
    if (alpha < HG_MATERIAL_AT(in_material, alpha_cutoff))
        discard;
}
