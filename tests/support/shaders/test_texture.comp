// Samples textures through the page table at given places: the tests of the texture room.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "lib/frame.glsl"
layout(constant_id = 3) const uint hg_test_anisotropy = 1u;
#define HG_TEXTURE_ANISOTROPY hg_test_anisotropy
#include "lib/texture.glsl"

layout(local_size_x = 64) in;

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
    texels.v[i] = hg_texture_sample(texture, p.uv, p.ddx, p.ddy);
}
