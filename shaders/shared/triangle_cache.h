// triangle_cache.h - triangles as shading reads them: one record per triangle of every draw, in world space.
// Floor 0, shared by C and GLSL (scalar layout).
//
// Weights of the second and third corner are linear in the position: b_i = g_i . (p - p0). With the
// plane of the triangle (its normal is along g1 x g2) a ray gives the point, and everything else
// follows from the weights. Six texels replace the 24 words and the three indices that a triangle's
// vertices take, and the transforms of its corners. Made by passes/triangle_cache.comp, on CPU devices only.
#ifndef HG_SHADERS_SHARED_TRIANGLE_CACHE_H
#define HG_SHADERS_SHARED_TRIANGLE_CACHE_H

#include "shared/types.h"

#define HG_TRIANGLE_CACHE_TEXELS 6 // of four words
#define HG_TRIANGLE_CACHE_GROUP  64

struct hg_gpu_facet {
    HG_VEC3 g1; // 1 / metres
    float x;    // p0, relative to the origin of the geometry room
    HG_VEC3 g2;
    float y;
    HG_VEC2 uv;
    HG_UINT reserved;
    float z;
    HG_VEC2 uv1, uv2;    // of the corners 1 and 2, less uv
    HG_UINT normals[3];  // octahedral, as in hg_gpu_vertex, world space
    HG_UINT tangents[3]; // parts without tangents: thrice the direction of growing u
    HG_UINT unused[2];
};
HG_SHARED_SIZE(hg_gpu_facet, HG_TRIANGLE_CACHE_TEXELS * 16);

#ifndef __STDC__
layout(buffer_reference, scalar, buffer_reference_align = 16) writeonly buffer hg_triangle_cache_list
{
    hg_gpu_facet v[];
};
#endif

struct hg_gpu_facet_push {
    HG_PTR(hg_triangle_cache_list) facets;
    HG_UINT draw, first, count; // first: where in the list
    HG_UINT reserved;
};
HG_SHARED_SIZE(hg_gpu_facet_push, 24);

#endif
