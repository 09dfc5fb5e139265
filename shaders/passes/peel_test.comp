// Whether the nearest layer of blended surfaces holds anything: sets a word where it does.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "shared/pass_io.h"

layout(local_size_x = 64) in;

HG_DEPTH_IO(HG_IO_DECLARE) // 0 = nothing

layout(buffer_reference, scalar) writeonly buffer hg_word_ref
{
    uint v;
};
layout(push_constant, scalar) uniform hg_push
{
    hg_word_ref target;
    uint width, height;
} push;

// One thread takes two rows of two pixels after another, four texels at a time.
void main()
{
    uint row = gl_GlobalInvocationID.x * 2u;
    if (row >= push.height)
        return;
    vec2 inv_size = 1.0 / vec2(push.width, push.height);
    float nearest = 0.0;
    uint x = 0u;
    do {
        vec4 d = textureGather(hg_depth, vec2(float(x) + 1.0, float(row) + 1.0) * inv_size);
        nearest = max(nearest, max(max(d.x, d.y), max(d.z, d.w)));
        x += 2u;
    } while (x < push.width);
    if (nearest > 0.0)
        push.target.v = 1u;
}
