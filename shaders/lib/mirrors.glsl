// mirrors.glsl - planar mirrors of a picture in motion (shared/mirror.h): their pixels have the mirrored scene in place
// of what probes and rays say about the mirror direction.
//
// Declare hg_mirrored and include lib/probes.glsl first; after its light was looked up.
#ifndef HG_LIB_MIRRORS_GLSL
#define HG_LIB_MIRRORS_GLSL

#include "shared/mirror.h"

// depth: metres along the view direction; n: shading normal; roughness: perceptual.
void hg_mirrors_look(vec2 pixel, vec3 position_ws, float depth, vec3 n, float roughness)
{
    bool on = false;
    for (int i = 0; i < HG_MIRROR_PLANES; i++) {
        vec4 plane = hg_frame.mirrors[i];
        bool near = abs(dot(plane.xyz, position_ws) - plane.w) < HG_MIRROR_APART * depth;
        on = on || (near && dot(plane.xyz, n) > HG_MIRROR_LEAST_COSINE);
    }
    ivec2 size = textureSize(hg_mirrored, 0), last = size - 1;
    vec2 at = pixel * (vec2(size) / vec2(hg_frame.width, hg_frame.height)) - 0.5;
    vec2 low = floor(at), f = at - low;
    vec4 sum = vec4(0.0);
    for (int i = 0; i < 4; i++) {
        ivec2 off = ivec2(i & 1, i >> 1);
        vec2 w = mix(1.0 - f, f, vec2(off));
        sum += w.x * w.y * texelFetch(hg_mirrored, clamp(ivec2(low) + off, ivec2(0), last), 0);
    }
    float share = 1.0 - smoothstep(HG_MIRROR_SMOOTH, HG_MIRROR_ROUGH, roughness);
    share = on && sum.a > 0.25 ? share : 0.0;
    hg_probes_surfaces = mix(hg_probes_surfaces, sum.rgb / max(sum.a, 0.25), share);
    hg_probes_sky *= 1.0 - share;
}

#endif
