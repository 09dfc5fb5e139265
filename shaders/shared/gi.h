// gi.h - the field of irradiance probes as shaders read it. Floor 0, shared by C and GLSL.
//
// Probes stand on grids: one over the whole scene, and finer ones around what the camera sees. Of each there are octahedral tables (lib/octahedral.glsl, texel centres, no
// border): irradiance over pi, moments of the distance to what rays met, and what reflections need.
// The words of a grid: [count] places, [count][IRRADIANCE_TEXELS] irradiance as RGB9E5,
// [count][MOMENT_TEXELS] mean and variance as halves, in units of `spacing` and its square,
// [count][IRRADIANCE_TEXELS][2] irradiance from surfaces alone as RGB9E5, and the share of the
// cosine-weighted directions that see the environment as float,
// [count][IRRADIANCE_TEXELS] irradiance without what emitters send straight, as RGB9E5.
//
// Gathered light, RGBA32UI at the size of the picture, of the first opaque surface about each pixel's
// middle: light that scatters (irradiance over pi) and mean radiance under the specular lobe, both
// RGB9E5, without what directional lights, and lamps without a size, bring directly, and the former without the
// environment's own light; the shading normal (lib/octahedral.glsl) in twice 8 bits, and the square root of the share of
// directional lights that is seen in 8; depth along the view direction in metres as a float whose last
// bits (HG_GATHERED_SHARE_MASK) are the square root of the share of the environment's irradiance that is seen, 0:
// there is no surface.
//
// Where lamps without a size cast shadows, as many rows follow: the square root of the share of their light that
// arrives, in 8 bits for each HG_GATHERED_LAMP. Lamps beyond the first HG_GATHERED_LAMPS share numbers.
//
// Probe light, RGBA32UI at a quarter of the picture's sides, rounded up (lib/probe_light.glsl): irradiance over pi
// and what reflections need of surfaces, both RGB9E5; normal in twice HG_PROBE_LIGHT_NORMAL_BITS, a share of the
// environment's irradiance on the pixel's own normal that is to be added (renderer/irradiance) in
// HG_PROBE_LIGHT_SKY_BITS, and the share of the environment that reflections see in 8; depth whose last bits
// (HG_PROBE_LIGHT_OPEN_MASK) are the share of the cosine lobe that nothing near occludes. Of the surface in the
// middle of 4 x 4 px.
#ifndef HG_SHADERS_SHARED_GI_H
#define HG_SHADERS_SHARED_GI_H

#include "shared/geometry.h"
#include "shared/types.h"

#define HG_PROBE_IRRADIANCE_SIDE   8
#define HG_PROBE_IRRADIANCE_TEXELS 64
#define HG_PROBE_MOMENT_SIDE       16
#define HG_PROBE_MOMENT_TEXELS     256
// Of a place, from its lowest bit on: offset from the grid in units of spacing, 5 bits per axis over -0.5..0.5; normal
// of the wall next to the probe, octahedral, 5 bits per axis over -1..1, and how far the probe is from it, 5 bits over
// 0..1 spacings, 31: there is none; awake; asleep inside of something. A wall hides all that is behind its plane within the cells
// around the probe. 0 has a code in both ranges.
#define HG_PROBE_OFFSET_STEPS 30
#define HG_PROBE_WALL_STEPS   30
#define HG_PROBE_WALL_NONE    31u
#define HG_PROBE_BITS         5
#define HG_PROBE_BITS_MASK    31u
#define HG_PROBE_WALL_SLACK   0.02f // spacings behind its plane that are not hidden: what rounding moves it by
#define HG_PROBE_AWAKE        0x40000000u
#define HG_PROBE_INSIDE       0x80000000u
#define HG_PROBE_MOVED        0.02f // offset, in spacings, from which on debug views say so
#define HG_PROBE_GRIDS        7 // that a field has at most
#define HG_PROBE_BEYOND       1.25f // spacings beyond its outermost probes that the light of a finer grid
                                    // reaches; over the last one the next coarser grid comes in
#define HG_PROBE_SURE         1e5f // weight of a grid's probes, times this, above which no coarser one is asked
// What a point is lifted off its surface by before probes are looked at, in spacings: along the
// normal and towards the eye.
#define HG_PROBE_BIAS_NORMAL 0.15f
#define HG_PROBE_BIAS_VIEW   0.10f
#define HG_GATHERED_SHARE_MASK 0xfffu
#define HG_GATHERED_LAMPS 16u
#define HG_GATHERED_LAMP(id) ((id) % HG_GATHERED_LAMPS) // id: of the scene's lights
#define HG_PROBE_LIGHT_OPEN_MASK 0xffu
#define HG_PROBE_LIGHT_NORMAL_BITS 9
#define HG_PROBE_LIGHT_NORMAL_MOST 511u
#define HG_PROBE_LIGHT_SKY_SHIFT 18
#define HG_PROBE_LIGHT_SKY_BITS  6
#define HG_PROBE_LIGHT_SKY_MOST  63u
// How far things occlude for pictures in motion, in spacings: what stands closer to a point is between
// it and where probes are asked for it.
#define HG_GTAO_REACH 1.0f
#define HG_PROBE_LIGHT_PX    4 // of the picture along a side of a texel

struct hg_gpu_probe_grid {
    HG_PTR(hg_word_stream) words;
    HG_VEC3 origin_ws; // of the first probe's cell corner, relative to the geometry's origin
    float spacing;     // metres
    HG_UINT counts[3];
    HG_UINT count;
};
HG_SHARED_SIZE(hg_gpu_probe_grid, 40);

struct hg_gpu_probes {
    HG_STRUCT(hg_gpu_probe_grid) grids[HG_PROBE_GRIDS]; // from coarse to fine
    HG_UINT count; // 0: there is no field
    HG_UINT zero;
};
HG_SHARED_SIZE(hg_gpu_probes, 288);

#endif
