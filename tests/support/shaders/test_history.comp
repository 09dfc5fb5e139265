// Where one point was seen a frame ago, and where one instance stood: lib/history.glsl in tests.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/frame.glsl"
#include "lib/tables.glsl"
#include "lib/history.glsl"

layout(local_size_x = 1) in;

layout(buffer_reference, scalar) writeonly buffer hg_result_ref
{
    vec4 clip;
    vec3 place;
    uint flags;
};
layout(push_constant, scalar) uniform hg_push
{
    hg_result_ref target;
    uint instance, reserved;
    vec3 point;
} push;

void main()
{
    push.target.clip = hg_previous_clip(push.point);
    push.target.place = hg_previous_world(push.instance)[3];
    push.target.flags = hg_history.flags;
}
