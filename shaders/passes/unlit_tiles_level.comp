// A level of the pyramid over the shadow atlas: the farthest caster in each square. hg_texels: the
// first level, of texels, else of the squares of the level below. One invocation per square.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

layout(constant_id = 0) const bool hg_texels = false;

#include "lib/unlit_tiles.glsl"
#include "shared/bindings.h"

layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 0, binding = HG_BIND_SHADOW) uniform sampler2D hg_atlas;

float of_texels(uvec2 square)
{
    float inv_size = 1.0 / float(unlit.atlas_px), least = 1.0;
    uvec2 first = square * uint(HG_UNLIT_TILES_TEXELS);
    uint i = 0u;
    do {
        uvec2 at = first + 2u * uvec2(i % uint(HG_UNLIT_TILES_TEXELS / 2), i / uint(HG_UNLIT_TILES_TEXELS / 2));
        vec4 d = textureGather(hg_atlas, (vec2(at) + 1.0) * inv_size);
        least = min(least, min(min(d.x, d.y), min(d.z, d.w)));
    } while (++i < uint(HG_UNLIT_TILES_TEXELS * HG_UNLIT_TILES_TEXELS / 4));
    return least;
}

float of_squares(uvec2 square)
{
    uint side = hg_unlit_tiles_side(unlit.level - 1u);
    uint at = hg_unlit_tiles_first(unlit.level - 1u) + 2u * square.y * side + 2u * square.x;
    return min(min(unlit.levels.v[at], unlit.levels.v[at + 1u]),
        min(unlit.levels.v[at + side], unlit.levels.v[at + side + 1u]));
}

void main()
{
    if (any(greaterThanEqual(gl_GlobalInvocationID.xy, uvec2(unlit.side))))
        return;
    uvec2 square = uvec2(unlit.first_x, unlit.first_y) + gl_GlobalInvocationID.xy;
    float least;
    if (hg_texels)
        least = of_texels(square);
    else
        least = of_squares(square);
    unlit.levels.v[hg_unlit_tiles_first(unlit.level) + square.y * hg_unlit_tiles_side(unlit.level) + square.x] = least;
}
