// The film as a picture: means of pixels, in tiles that have samples; others keep what is there.
#version 460
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference2 : require

#include "shared/path.h"

layout(push_constant, scalar) uniform hg_push
{
    hg_path_floats film;
    hg_path_words samples; // of each tile
    uint width, height;    // px
    uint columns;          // of tiles
} push;

layout(location = 0) out vec4 out_color;

void main()
{
    uvec2 pixel = uvec2(gl_FragCoord.xy), tile = pixel / HG_PATH_TILE_SIDE;
    uint samples = push.samples.v[tile.y * push.columns + tile.x];
    if (samples == 0u)
        discard;
    uint at = pixel.y * push.width + pixel.x, pixels = push.width * push.height;
    vec4 sum = vec4(push.film.v[at], push.film.v[pixels + at], push.film.v[2u * pixels + at],
        push.film.v[3u * pixels + at]);
    out_color = sum / float(samples);
}
