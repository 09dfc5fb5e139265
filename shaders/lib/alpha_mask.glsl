// alpha_mask.glsl - fragments of surfaces with holes: masked ones, and blended ones. The pass defines
// HG_PRIMITIVE, the number of the triangle as it comes; HG_COLLECT: it appends blended fragments to the
// lists of their pixels and writes no attachment.
#ifndef HG_LIB_ALPHA_MASK_GLSL
#define HG_LIB_ALPHA_MASK_GLSL

bool hg_alpha_stochastic = false;
#define HG_TEXTURE_STOCHASTIC hg_alpha_stochastic

#include "lib/frame.glsl"
#include "lib/vertex.glsl"
#include "lib/triangle_cache.glsl"
#include "lib/texture.glsl"
#include "lib/material.glsl"
#include "lib/item.glsl"
#include "shared/pass_io.h"

// 1 mask, 2 nearest layer, 3 where a blended surface hides all behind it, 4 collect, 5 stochastic
layout(constant_id = 0) const uint hg_variant = 1u;

layout(location = 0) flat in uvec2 in_draw;
#ifdef HG_COLLECT
layout(early_fragment_tests) in; // lists hold what lies in front of the opaque scene
#else
HG_ALPHA_MASK_IO(HG_IO_DECLARE)
layout(location = 0) out uvec2 out_visibility;
#endif

#ifdef HG_COLLECT
void collect(uvec2 pixel, uvec2 id)
{
    uint at = 1u + atomicAdd(hg_frame.blend.nodes.v[0].next, 1u);
    if (at >= hg_frame.blend.capacity)
        return;
    hg_frame.blend.nodes.v[at].draw = id.x;
    hg_frame.blend.nodes.v[at].primitive = id.y;
    hg_frame.blend.nodes.v[at].depth = gl_FragCoord.z;
    hg_frame.blend.nodes.v[at].next =
        atomicExchange(hg_frame.blend.heads.v[pixel.y * hg_frame.width + pixel.x], at);
}
#endif

// Alpha as shading finds it (lib/shade.glsl).
float shaded_alpha(hg_vertex v)
{
    float alpha = HG_MATERIAL_AT(v.material, base_color.w) * v.color.w;
    hg_alpha_stochastic = true;
    hg_texture_xi = hg_random3(uvec2(gl_FragCoord.xy), 1u).xy;
    if (hg_frame.sample_index == 0u)
        hg_texture_most_taps = 1.0;
    if (HG_HAS(HG_FEATURE_TEXTURES))
        alpha *= hg_material_sample(v.material, HG_MATERIAL_BASE_COLOR, true, v).w;
    return alpha;
}

// Threshold of stochastic transparency: a surface covers a pixel with the probability of its alpha,
// whatever others do, so that the mean over pixels is that of blending.
float stochastic(uvec2 pixel, uvec2 id)
{
    return float(hg_hash3(uvec3(pixel.x | pixel.y << 16u, id)).x >> 8u) * (1.0 / 16777216.0);
}

void main()
{
    ivec2 pixel = ivec2(gl_FragCoord.xy);
#ifndef HG_COLLECT
    // Reversed depth: in front of the opaque scene is larger.
    if (hg_variant == 2u && gl_FragCoord.z <= texelFetch(hg_opaque_depth, pixel, 0).x)
        discard;
#endif
    uvec2 id = hg_item_id(in_draw, HG_PRIMITIVE);
    if (hg_item_loses(id, gl_FragCoord) || hg_item_clipped(gl_FragCoord))
        discard;
    hg_texture_counts = hg_progress_waits(pixel);
    hg_vertex v = hg_fetch_surface(in_draw.x, id.y, gl_FragCoord.xy);
    if (hg_variant == 1u)
        hg_texture_share = hg_frame_footprint();
    float alpha = hg_material_alpha(v.material, v);
    // A blended surface that an 8-bit image cannot show takes no layer.
    float least = hg_variant == 1u ? HG_MATERIAL_AT(v.material, alpha_cutoff) : 0.5 / 255.0;
    bool seen = alpha >= least;
    if (hg_variant == 5u)
        seen = seen && alpha > stochastic(uvec2(pixel), id);
    if (hg_variant == 3u)
        seen = seen && shaded_alpha(v) >= 1.0;
    if (HG_HAS(HG_FEATURE_STREAM))
        hg_progress_spoil(pixel);
#ifdef HG_COLLECT
    if (((pixel.x | pixel.y) & (HG_BLEND_COUNTED - 1)) == 0)
        atomicAdd(hg_frame.blend.nodes.v[0].draw, 1u);
    if (seen)
        collect(uvec2(pixel), id);
#else
    if (!seen)
        discard;
    out_visibility = id;
#endif
}

#endif
