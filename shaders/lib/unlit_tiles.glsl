// unlit_tiles.glsl - push constants of the passes that find unlit tiles, and where the pyramid's levels are.
#ifndef HG_LIB_UNLIT_TILES_GLSL
#define HG_LIB_UNLIT_TILES_GLSL

#include "shared/unlit_tiles.h"

layout(push_constant, scalar) uniform hg_push
{
    hg_gpu_unlit unlit;
};

// Squares along a side of a level.
uint hg_unlit_tiles_side(uint level)
{
    return unlit.atlas_px / (uint(HG_UNLIT_TILES_TEXELS) << level);
}

// First word of a level: 1 + 1/4 + ... of the first one's squares.
uint hg_unlit_tiles_first(uint level)
{
    uint squares = hg_unlit_tiles_side(0u) * hg_unlit_tiles_side(0u);
    return level == 0u ? 0u : (squares - (squares >> (2u * level))) / 3u * 4u;
}

#endif
