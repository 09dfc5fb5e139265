// alpha_mask.glsl - fragments of surfaces with holes: masked ones, and layers of blended ones. The pass
// defines HG_PRIMITIVE, the number of the triangle as it comes.
#ifndef HG_LIB_ALPHA_MASK_GLSL
#define HG_LIB_ALPHA_MASK_GLSL

#include "lib/frame.glsl"
#include "lib/vertex.glsl"
#include "lib/triangle_cache.glsl"
#include "lib/texture.glsl"
#include "lib/material.glsl"
#include "lib/item.glsl"
#include "shared/pass_io.h"

layout(constant_id = 0) const uint hg_variant = 1u; // 1 mask, 2 first layer, 3 next layer

HG_ALPHA_MASK_IO(HG_IO_DECLARE)

layout(location = 0) flat in uvec2 in_draw;
layout(location = 0) out uvec2 out_visibility;

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    if (hg_variant != 1u) {
        // Reversed depth: in front of the opaque scene is larger, behind the last layer smaller.
        if (gl_FragCoord.z <= texelFetch(hg_opaque_depth, pixel, 0).x)
            discard;
        if (hg_variant == 3u && gl_FragCoord.z >= texelFetch(hg_previous_depth, pixel, 0).x)
            discard;
    }
    uvec2 id = hg_item_id(in_draw, HG_PRIMITIVE);
    if (hg_item_loses(id, gl_FragCoord))
        discard;
    hg_texture_counts = hg_progress_waits(pixel);
    hg_vertex v = hg_fetch_surface(in_draw.x, id.y, gl_FragCoord.xy);
    float alpha = hg_material_alpha(v.material, v);
    if (HG_HAS(HG_FEATURE_STREAM))
        hg_progress_spoil(pixel);
    // A blended surface that an 8-bit image cannot show takes no layer.
    float least = hg_variant == 1u ? HG_MATERIAL_AT(v.material, alpha_cutoff) : 0.5 / 255.0;
    if (alpha < least)
        discard;
    out_visibility = id;
}

#endif
