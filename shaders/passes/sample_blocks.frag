// Depth of pixels that have samples enough: neither a surface nor background to passes that shade by depth.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "shared/sample_blocks.h"

layout(push_constant, scalar) uniform hg_push
{
    hg_gpu_sample_blocks push;
};

void main()
{
    uvec2 block = HG_SAMPLE_BLOCK_OF(gl_FragCoord.xy);
    if (push.number < push.counts.v[block.y * push.columns + block.x])
        discard;
    gl_FragDepth = uintBitsToFloat(HG_SAMPLE_BLOCK_DEPTH_BITS);
}
