// clip.glsl - the part of a ray that clipping planes let through.
//
// Include lib/frame.glsl first. What all planes let through is convex: a ray enters it once, through
// the plane of its last entry, and leaves it once.
#ifndef HG_LIB_CLIP_GLSL
#define HG_LIB_CLIP_GLSL

#include "lib/frame.glsl"

#define HG_CLIP_NO_PLANE 0xffffffffu

// Narrows [t_min, t_max]. Returns the plane that the ray enters through, HG_CLIP_NO_PLANE: it begins
// inside. Where nothing is left t_max < t_min.
uint hg_clip_ray(vec3 origin, vec3 direction, inout float t_min, inout float t_max)
{
    uint entered = HG_CLIP_NO_PLANE;
    for (uint i = 0u; i < min(hg_frame.clip_count, uint(HG_CLIP_PLANES)); i++) {
        vec4 plane = hg_frame.clip_planes[i];
        float at = dot(plane.xyz, origin) + plane.w, along = dot(plane.xyz, direction);
        float t = along != 0.0 ? -at / along : 0.0;
        if (along > 0.0 && t > t_min) {
            t_min = t;
            entered = i;
        }
        if (along < 0.0)
            t_max = min(t_max, t);
        if (along == 0.0 && at < 0.0)
            t_max = -1.0;
    }
    return entered;
}

#endif
