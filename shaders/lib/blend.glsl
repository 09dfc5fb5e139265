// blend.glsl - lists of the blended fragments of pixels (shared/blend.h).
#ifndef HG_LIB_BLEND_GLSL
#define HG_LIB_BLEND_GLSL

#include "lib/frame.glsl"

// First node of a pixel's list; 0: it has none. Nor has what lies beyond the picture, where helper
// invocations look: there the next allocation's bytes would lead anywhere.
uint hg_blend_head(uvec2 pixel)
{
    bool inside = pixel.x < hg_frame.width && pixel.y < hg_frame.height;
    uint head = hg_frame.blend.heads.v[inside ? pixel.y * hg_frame.width + pixel.x : 0u];
    return inside ? head : 0u;
}

#endif
