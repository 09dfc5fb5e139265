// texel.h - one texel of the reflections of a picture: the surface that mirrors, and sums over its
// lobe. Floor 2, private to renderer/reflect. Pure, inline.
#ifndef HG_RENDERER_REFLECT_TEXEL_H
#define HG_RENDERER_REFLECT_TEXEL_H

#include "renderer/host_shading/lobe.h"

struct hg_reflect_texel {
    float position[3], normal[3]; // shading normal; relative to the geometry's origin
    float view[3];                // towards the eye, unit
    float roughness, f0, depth;   // depth: metres along the view direction; 0: no surface
    float length;                 // of the ray, metres; far where it met nothing
    bool mirrors;                 // there is a surface; all others are not looked at
    bool sends;                   // a ray of its own in this picture
};

// Sums: radiance of surfaces, what is seen of the environment, weights; the rest is padding.
typedef float hg_reflect_sums __attribute__((vector_size(32), aligned(16)));
enum { HG_REFLECT_RED, HG_REFLECT_GREEN, HG_REFLECT_BLUE, HG_REFLECT_OPEN, HG_REFLECT_WEIGHT };

// Falls from 1 at `near` to 0 at `far`; both as comparisons, which the compiler turns into one
// instruction each, and fmaxf into a call.
static inline float hg_reflect_fall(float near, float far, float x)
{
    const float width = far - near > 1e-6f ? far - near : 1e-6f;
    float t = (x - near) * (1 / width);
    t = t > 0 ? t : 0;
    t = t < 1 ? t : 1;
    return 1 - t * t * (3 - 2 * t);
}

// Distances from a plane, of the depth, at which surfaces are others.
#define HG_REFLECT_APART        0.01f
#define HG_REFLECT_LEAST_COSINE 0.8f // between normals of one surface: the 32nd power is 8e-4

// How much two texels may be of one surface: by the cosine between their normals, the distance from
// the plane, where `room` is too far, and the difference in roughness.
static inline float hg_reflect_alike(float cosine, float off, float room, float rougher)
{
    float n = cosine > HG_REFLECT_LEAST_COSINE ? cosine : 0, near = 1 - off / room;
    n *= n;
    n *= n;
    n *= n;
    n *= n;
    n *= n; // the 32nd power
    near = near > 0 ? near : 0;
    return n * near * hg_reflect_fall(0.01f, 0.1f, rougher);
}

// The same of a texel and what another one is.
static inline float hg_reflect_same(const struct hg_reflect_texel *p, const float position[3],
    const float normal[3], float roughness)
{
    const float cosine = hg_dot3(p->normal, normal), room = HG_REFLECT_APART * p->depth;
    float d[3];
    hg_sub3(position, p->position, d);
    const float off = fabsf(hg_dot3(d, p->normal));
    return cosine > HG_REFLECT_LEAST_COSINE && off < room
               ? hg_reflect_alike(cosine, off, room, fabsf(p->roughness - roughness))
               : 0;
}

#endif
