// gi.h - the field of irradiance probes as shaders read it. Floor 0, shared by C and GLSL.
//
// Probes stand on a grid. Of each there are octahedral tables (lib/octahedral.glsl, texel centres, no
// border): irradiance over pi, moments of the distance to what rays met, and what reflections need.
// The words: [count] places, [count][IRRADIANCE_TEXELS] irradiance as RGB9E5,
// [count][MOMENT_TEXELS] mean and variance as halves, in units of `spacing` and its square,
// [count][IRRADIANCE_TEXELS][2] irradiance from surfaces alone as RGB9E5, and the share of the
// cosine-weighted directions that see the environment as float.
//
// Gathered light, RGBA32UI at the size of the picture, of the first opaque surface about each pixel's
// middle: light that scatters (irradiance over pi) and mean radiance under the specular lobe, both
// RGB9E5 and without what lights and a sky's sun bring directly; the shading normal (lib/octahedral.glsl);
// depth along the view direction in metres as a float, 0: there is no surface.
#ifndef HG_SHADERS_SHARED_GI_H
#define HG_SHADERS_SHARED_GI_H

#include "shared/geometry.h"
#include "shared/types.h"

#define HG_PROBE_IRRADIANCE_SIDE   8
#define HG_PROBE_IRRADIANCE_TEXELS 64
#define HG_PROBE_MOMENT_SIDE       16
#define HG_PROBE_MOMENT_TEXELS     256
// Of a place: offset from the grid in units of spacing, 10 bits per axis over -0.5..0.5; awake.
#define HG_PROBE_OFFSET_STEPS 1023
#define HG_PROBE_AWAKE        0x40000000u
// What a point is lifted off its surface by before probes are looked at, in spacings: along the
// normal and towards the eye.
#define HG_PROBE_BIAS_NORMAL 0.15f
#define HG_PROBE_BIAS_VIEW   0.10f

struct hg_gpu_probes {
    HG_PTR(hg_word_stream) words;
    HG_VEC3 origin_ws; // of the first probe's cell corner, relative to the geometry's origin
    float spacing;     // metres
    HG_UINT counts[3];
    HG_UINT count; // 0: there is no field
};
HG_SHARED_SIZE(hg_gpu_probes, 40);

#endif
