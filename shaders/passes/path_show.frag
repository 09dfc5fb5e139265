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
    uint catcher;          // first channel of HG_PATH_CATCHER_*, HG_PATH_NO_PLANE
    uint transparent;      // 1: nothing is behind the scene
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
    if (push.catcher != HG_PATH_NO_PLANE) {
        uint first = push.catcher * pixels + at;
        float lit = push.film.v[first], unlit = push.film.v[first + pixels];
        float count = push.film.v[first + HG_PATH_CATCHER_SAMPLES * pixels];
        float share = unlit > 0.0 ? min(lit / unlit, 1.0) : 1.0;
        for (uint c = 0u; c < 3u; c++)
            sum[c] += share * push.film.v[first + (HG_PATH_CATCHER_BEHIND + c) * pixels];
        sum.a += count * (push.transparent != 0u ? 1.0 - share : 1.0);
    }
    out_color = sum / float(samples);
}
