// A colour from push constants, for the tests of the device room.
#version 460
#extension GL_EXT_scalar_block_layout : require

layout(push_constant, scalar) uniform hg_push
{
    vec4 color;
} push;

layout(location = 0) out vec4 out_color;

void main()
{
    out_color = push.color;
}
