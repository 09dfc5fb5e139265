// Writes value + index into a buffer by address: exercises compute, push constants and
// specialisation in the tests of the device room.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference : require

#include "lib/frame.glsl"

layout(local_size_x = 64) in;
layout(constant_id = 0) const uint hg_step = 1u;

layout(buffer_reference, scalar) buffer hg_words_ref
{
    uint words[];
};
layout(push_constant, scalar) uniform hg_push
{
    hg_words_ref target;
    uint count, value;
} push;

void main()
{
    uint i = gl_GlobalInvocationID.x;
    if (i < push.count)
        push.target.words[i] = push.value + i * hg_step + hg_frame.width;
}
