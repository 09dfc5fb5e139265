// frame.glsl - the frame's uniform block and the pass's push constants.
// Include first; a pass that needs other push constants defines HG_NO_PUSH before.
#ifndef HG_LIB_FRAME_GLSL
#define HG_LIB_FRAME_GLSL

#include "shared/bindings.h"
#include "shared/frame.h"

layout(set = 0, binding = HG_BIND_FRAME, scalar) uniform hg_frame_block
{
#ifdef HG_FRAME_FLAT
    hg_gpu_frame hg_frame_uniform;
};
hg_gpu_frame hg_frame; // a copy: see lib/flat.glsl
#else
    hg_gpu_frame hg_frame;
};
#endif

#ifdef HG_FRAME_FLAT
#define HG_FRAME_SAMPLES hg_frame_uniform.sample_count
#else
#define HG_FRAME_SAMPLES hg_frame.sample_count
#endif

// Scale of the steps of pixels in textures whose filtered values are no means of what a pixel shows: masks by a
// threshold; colours of metal, which are multiplied by how metallic it is. As lib/path.glsl's footprint: the mean of samples is
// filtered by the pixel. Source: Pharr, Jakob and Humphreys, "Physically Based Rendering", 4th ed., section 10.1.3.
float hg_frame_footprint()
{
    bool fine = (hg_frame.flags & HG_FRAME_FINE) != 0u;
    return fine ? max(inversesqrt(float(HG_FRAME_SAMPLES)), 0.125) : 1.0;
}

// Random bits from integers: one round of PCG on three words.
// Source: Jarzynski and Olano 2020, "Hash Functions for GPU Rendering", pcg3d.
uvec3 hg_hash3(uvec3 v)
{
    v = v * 1664525u + 1013904223u;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v ^= v >> 16u;
    v.x += v.y * v.z;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    return v;
}

// Three floats in [0, 1), fixed by pixel, sample and seed.
vec3 hg_random3(uvec2 pixel, uint salt)
{
    uvec3 h = hg_hash3(uvec3(pixel, hg_frame.sample_index * 16u + salt + hg_frame.seed * 65536u));
    return vec3(h >> 8u) * (1.0 / 16777216.0);
}

#endif
