// Depth of every second pixel of a row, others in the next row and in the next picture: what a
// checkerboard is shaded by (lib/shade.glsl).
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require

#include "shared/checkerboard.h"
#include "shared/pass_io.h"

HG_DEPTH_IO(HG_IO_DECLARE)
layout(push_constant, scalar) uniform hg_push
{
    hg_gpu_checkerboard push;
};

void main()
{
    uvec2 at = uvec2(gl_FragCoord.xy);
    gl_FragDepth = texelFetch(hg_depth, ivec2(HG_CHECKERBOARD_COLUMN(at, push.number, push.width), at.y), 0).x;
}
