// The same places as test_texture.comp, through an ordinary image and sampler.
#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

layout(local_size_x = 64) in;
layout(set = 0, binding = 0) uniform sampler2D plain;

struct place {
    vec2 uv, ddx, ddy;
};
layout(buffer_reference, scalar) readonly buffer places_ref
{
    place v[];
};
layout(buffer_reference, scalar) writeonly buffer texels_ref
{
    vec4 v[];
};
layout(push_constant, scalar) uniform hg_push
{
    places_ref places;
    texels_ref texels;
    uint count, texture;
};

void main()
{
    uint i = gl_GlobalInvocationID.x;
    if (i >= count)
        return;
    place p = places.v[i];
    texels.v[i] = textureGrad(plain, p.uv, p.ddx, p.ddy);
}
