// path.h - waves of light paths. Floor 0, shared by C and GLSL (scalar layout).
//
// A wave is one sample of each pixel of some tiles. Slot i of a wave is pixel i % HG_PATH_TILE_PX of
// its tile i / HG_PATH_TILE_PX, in Morton order, so that neighbours in memory are neighbours in the
// picture. All that is known of a path is stored by slot: rays, hits and words of state, word k of
// slot i at k * capacity + i.
#ifndef HG_SHADERS_SHARED_PATH_H
#define HG_SHADERS_SHARED_PATH_H

#include "shared/emitters.h"
#include "shared/geometry.h"
#include "shared/ray.h"
#include "shared/types.h"

#define HG_PATH_TILE_SIDE 16
#define HG_PATH_TILE_PX   256
#define HG_PATH_GROUP     64 // paths per workgroup

// hg_gpu_path.status: what happens to a path next
#define HG_PATH_DONE  0u
#define HG_PATH_LIVE  1u // its ray is to be followed
#define HG_PATH_WAITS 2u // for texture pages: nothing was written, it is shaded again
#define HG_PATH_FINE  3u // it does not end here: nothing was written, another kernel shades it
// and bits for paths of any kind:
#define HG_PATH_SHADOW 4u // it has a shadow ray
#define HG_PATH_SUN    8u // and one to a directional light (HG_PATH_SUNS_APART), or a lamp (HG_PATH_LAMPS)
#define HG_PATH_STATUS_MASK 3u
#define HG_PATH_ALPHA_MASK_SHIFT 8    // masked and blended surfaces that the shadow ray has passed
#define HG_PATH_MOST_ALPHA_MASKS  256u // then it is blocked

// Words of state.
#define HG_PATH_THROUGHPUT 0  // rgb
#define HG_PATH_PENDING    3  // rgb: what the shadow ray brings if nothing is in its way
#define HG_PATH_PDF        6  // solid angle density of the ray's direction; 0 = no other way to it
#define HG_PATH_FLAGS      7  // HG_PATH_FLAG_*
#define HG_PATH_CONE       8  // bfloat16 width (metres), spread (radians) of the ray's footprint
#define HG_PATH_NORMAL     9  // of the surface that the ray left, octahedral
#define HG_PATH_MEDIA      10 // two words: materials of the media around, innermost first, 16 bits
// Behind the words of the film, where the planes of lobes are asked for (hg_gpu_path.split): share
// of the light by way of the first surface that its diffuse lobe reflects, rgb; below 0: all was let
// through. Of the path, then of the shadow rays from the first surface. Then the groups of the lights
// that shadow rays go to, 8 bits each.
#define HG_PATH_SPLIT_PATH  0
#define HG_PATH_SPLIT_ASKED 3
#define HG_PATH_SPLIT_SUN    6 // from the first surface of a gathering path: 1 + the HG_GATHERED_LAMP, 0: a directional light
#define HG_PATH_SPLIT_GROUPS 9
#define HG_PATH_SPLIT_WORDS  10
// Behind those, with HG_PATH_FOLLOWS: the way of a path with HG_PATH_FOLLOWED.
#define HG_PATH_SEEN_TINT   0 // rgb: of what it came by behind the first surface
#define HG_PATH_SEEN_DEPTH  3 // of the image of what the ray left: metres along the view direction
#define HG_PATH_SEEN_COSINE 4 // metres of that per metre of way
#define HG_PATH_SEEN_WORDS  5
#define HG_PATH_PENDING_SUN 12 // rgb: of the ray to a directional light
#define HG_PATH_OUT        15 // from here on what the film adds up, one word per channel
#define HG_PATH_WORDS      15 // before that

// HG_PATH_FLAGS
#define HG_PATH_STEPS_MASK    0x000003ffu // rays so far, those behind masked surfaces included
#define HG_PATH_BOUNCE_SHIFT  10
#define HG_PATH_BOUNCE_MASK   0x000001ffu
#define HG_PATH_FOLLOWED      0x00100000u // all it came by is smooth: what it meets is seen in that
#define HG_PATH_SEEN          0x00200000u // a surface was found: what the camera sees is noted
#define HG_PATH_CHANNEL_SHIFT 23 // 2 bits: 1 + the channel that is left since dispersion, or 0
#define HG_PATH_BOTH_SIDES    0x00400000u // light from both sides of the surface it left counts
#define HG_PATH_WIDE          0x02000000u // it left a rough surface: what it meets may be shaded coarsely
#define HG_PATH_ASKS_SKY      0x04000000u // of a gathering path: its shadow ray is for the environment
#define HG_PATH_ASKS_LAMP         0x08000000u // of a gathering path: its shadow ray is for a lamp without a size
#define HG_PATH_CATCHES           0x00080000u // its shadow ray tests the light of a shadow catcher
#define HG_PATH_LOBE_DIFFUSE      0u
#define HG_PATH_LOBE_SPECULAR     1u
#define HG_PATH_LOBE_TRANSMISSION 2u
#define HG_PATH_MOST_STEPS        1000u // of one path

// Channels of the film, [channel][height][width] floats, sums over samples. Planes follow in the
// order of HG_PLANE_* as asked for; hg_gpu_path.planes says where (HG_PATH_NO_PLANE: nowhere).
#define HG_PATH_FILM_COLOR   0 // rgb, coverage
#define HG_PATH_FILM_SQUARES 4 // of luminance
#define HG_PATH_FILM_WORDS   5
#define HG_PATH_NO_PLANE     0xffffffffu

#define HG_PATH_PLANE_ALBEDO           1 // same values as enum hg_plane of renderer.h
#define HG_PATH_PLANE_NORMAL           2
#define HG_PATH_PLANE_GEOMETRIC_NORMAL 3
#define HG_PATH_PLANE_DEPTH            4
#define HG_PATH_PLANE_POSITION         5
#define HG_PATH_PLANE_EMISSION         6
#define HG_PATH_PLANE_DIRECT           7  // + HG_PATH_LOBE_*
#define HG_PATH_PLANE_INDIRECT         10 // + HG_PATH_LOBE_*
#define HG_PATH_PLANE_MOTION           13
#define HG_PATH_PLANE_OBJECT           14
#define HG_PATH_PLANE_MATERIAL         15
#define HG_PATH_PLANE_HITS             16 // not one of them: samples that hit something
#define HG_PATH_PLANE_DRAWS            18 // draw + 1, for the lists of names (hg_gpu_path.lists)
#define HG_PATH_PLANE_GROUPS           20 // 3 channels for each group of lights
#define HG_PATH_PLANE_CATCHER          21 // not one of them: HG_PATH_CATCHER_*
#define HG_PATH_PLANE_MOVED            22 // of pictures of a series: HG_PATH_MOVED_*
#define HG_PATH_PLANE_LAMPS            23 // of gathering paths: HG_PATH_LAMPS_*
#define HG_PATH_PLANE_GUIDE            24 // denoiser inputs: HG_PATH_GUIDE_*
#define HG_PATH_PLANE_COUNT            25

// Channels of HG_PATH_PLANE_MOVED.
#define HG_PATH_MOVED_BY    0 // xyz: to where the surface was when the picture before was made, metres
#define HG_PATH_MOVED_WHAT  3 // of the first sample: as HG_PATH_PLANE_OBJECT
#define HG_PATH_MOVED_SEEN  4 // xyz: of the image of what is seen in it, of samples that SEEN but not SEEN_OWN counts
#define HG_PATH_MOVED_WORDS 7

// HG_PATH_PLANE_LAMPS has a channel for each HG_GATHERED_LAMP of shared/gi.h: samples whose first surface asked for
// such a lamp, and HG_PATH_LAMP_SEEN for each sixteenth of its light that arrived there.
#define HG_PATH_LAMP_SEEN       1024.0f // more than the samples that light is gathered with
#define HG_PATH_LAMP_SHIFT      28 // in the flags: which one

// Channels of HG_PATH_PLANE_GUIDE, always the last of the film, of the pixel's own samples alone.
// Their sums over the first half of the samples (HG_PATH_IS_FIRST_HALF) follow behind, then
// HG_PATH_SHOWN_*.
#define HG_PATH_GUIDE_DIRECT     0 // rgb: light that the first surface scattered, once
#define HG_PATH_GUIDE_INDIRECT   3 // rgb: that came to it by way of other surfaces
#define HG_PATH_GUIDE_SPECULAR   6 // rgb: specular light, reflected or transmitted
#define HG_PATH_GUIDE_ALBEDO     9 // rgb: what scattered light was multiplied by, about
#define HG_PATH_GUIDE_REFLECTION 12 // rgb: what the other was
#define HG_PATH_GUIDE_NORMAL     15
#define HG_PATH_GUIDE_DEPTH      18 // natural logarithm of metres along the view direction
#define HG_PATH_GUIDE_ROUGHNESS  19
#define HG_PATH_GUIDE_HITS       20 // 1 for samples that hit something
// Of what is seen in the first surface, where a smooth lobe of it was followed; else of that surface.
// Sums over samples that know (SEEN): scattering lobes of surfaces that have smooth ones do not.
#define HG_PATH_GUIDE_SEEN_ALBEDO 21 // rgb: besides REFLECTION; of the first surface 1
#define HG_PATH_GUIDE_SEEN_DEPTH  24 // as DEPTH, of the image in a plane mirror
#define HG_PATH_GUIDE_SEEN_OWN    25 // 1 where it is that of the first surface
#define HG_PATH_GUIDE_SEEN        26 // 1
#define HG_PATH_GUIDE_CHANNELS    27
#define HG_PATH_GUIDE_LIGHT       9 // of these are light; gathering paths have halves of them alone, and no SHOWN
// Of gathering paths, in place of what is SEEN: light of the environment that the first surface scatters, had
// it met nothing on its way there, and as it did come there (part of DIRECT). rgb
#define HG_PATH_GUIDE_OPEN_SKY 21
#define HG_PATH_GUIDE_SEEN_SKY 24
// Of gathering paths, in place of INDIRECT, which is in their DIRECT: light of directional lights that cast shadows on
// a white surface, luminance, had it met nothing, and as it arrived.
#define HG_PATH_GUIDE_OPEN_SUN 3
#define HG_PATH_GUIDE_SEEN_SUN 4
// Added to their ROUGHNESS where the surface has sheen or lets light through diffusely; more than a sum of that.
#define HG_PATH_GUIDE_CLOTH    1024.0f

// What the guide knows as pixels show it: sums over all samples that count for them, as the colour's.
#define HG_PATH_SHOWN_LIGHT      0 // rgb: DIRECT, INDIRECT and SPECULAR together
#define HG_PATH_SHOWN_ALBEDO     3
#define HG_PATH_SHOWN_REFLECTION 6
#define HG_PATH_SHOWN_HITS       9
#define HG_PATH_SHOWN_CHANNELS   10

// Samples that count for the first of two halves, whose difference says how noisy a pixel is: every
// second one at first, then every second four, so that each half is well distributed.
#define HG_PATH_IS_FIRST_HALF(sample) (((sample) < 8u ? (sample) : (sample) >> 2u) % 2u == 0u)

// Sums over samples that a shadow catcher is seen by. Their shadow is what it misses of the light.
#define HG_PATH_CATCHER_LIT     0 // light that arrived, of a white surface, luminance
#define HG_PATH_CATCHER_UNLIT   1 // light that would have without anything between
#define HG_PATH_CATCHER_SAMPLES 2
#define HG_PATH_CATCHER_BEHIND  3 // rgb: background
#define HG_PATH_CATCHER_WORDS   6

// Hits that a gathering path may end at: from this bounce on. By pairs of samples and by pixels in turn; the first
// two bits of a slot are those of its pixel.
#define HG_PATH_ENDS_FROM(sample, x, y) (1u + ((((sample) >> 1u) + (x) + (y)) & 1u))

// Words of hg_gpu_path.draw_marks and light_groups.
#define HG_PATH_MOST_GROUPS  16
#define HG_PATH_GROUP_MASK   0xffu
#define HG_PATH_MARK_CATCHER 0x80000000u
#define HG_PATH_MARK_PLACED  0x40000000u // rays meet it in its own space

#define HG_PATH_DRAWS_LENGTH 8 // names of a pixel in a list; HG_PLANE_DRAWS_LENGTH

#define HG_PATH_FILTER_STEPS 512 // of the table of filter offsets

#ifndef __STDC__
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer hg_path_words {
    uint v[];
};
layout(buffer_reference, scalar, buffer_reference_align = 4) buffer hg_path_floats {
    float v[];
};
#endif

// hg_gpu_path.moments; the geometry's own tables show HG_PATH_CLOSING, or the pose.
#define HG_PATH_OPENING  0 // of the shutter, or of the part of its time that this wave has
#define HG_PATH_CLOSING  1
#define HG_PATH_PREVIOUS 2 // a frame before the pose
#define HG_PATH_NOW      3 // the pose
#define HG_PATH_NEXT     4 // a frame after
#define HG_PATH_SHOWN    5 // of the picture before, in a series
#define HG_PATH_MOMENTS  6

// A time: where things are, and the camera (as in hg_gpu_camera).
struct hg_gpu_path_moment {
    HG_STRUCT(hg_gpu_pose_snapshot) scene; // not of HG_PATH_CLOSING
    HG_VEC3 eye_ws;
    HG_VEC3 forward_ws;
    HG_VEC3 ray_origin_ws, ray_x_ws, ray_y_ws;
    HG_UINT reserved;
};
HG_SHARED_SIZE(hg_gpu_path_moment, 80);

// What kernels may be asked for, a specialisation constant.
#define HG_PATH_BLURS  0x1u // something moves while the shutter is open
#define HG_PATH_MOTION 0x2u // the planes, where something moves between frames
#define HG_PATH_SPLIT   0x4u // light by what lobes reflect
#define HG_PATH_GROUPS  0x8u // light by groups
#define HG_PATH_CATCHER 0x10u // there are shadow catchers
#define HG_PATH_FOLLOWS    0x20u // the guide has features seen in smooth surfaces
#define HG_PATH_PLACED 0x40u // some draws are marked so
#define HG_PATH_GATHERS 0x80u // final gathering for a real-time picture (hg_gpu_path.gather)
#define HG_PATH_GLASS 0x100u // with GATHERS: to transmissive surfaces that the camera sees first, and to none else
#define HG_PATH_LAMPS 0x200u // of these there is HG_PATH_PLANE_LAMPS
#define HG_PATH_SURFACES   0x2000000u // first hits only, by the rules of the real-time mode
#define HG_PATH_SUNS_APART 0x200000u // a ray to a directional light besides one to the others
#define HG_PATH_SPLATS 0x1000000u // samples count for neighbours as well
#define HG_PATH_FIRST  0x800000u // of shading: paths are as they left the camera, state is not read
#define HG_PATH_PLANES 0x400000u // any besides colour; and HG_EMITTER_KIND_* of the lights

// With HG_PATH_GATHERS paths leave the first opaque surface, bring what real-time pictures do not draw
// themselves (all but directional lights, and lamps without a size: of these how much arrives), and end in the field of irradiance probes
// (shared/gi.h) at the first hit that a rough lobe found from at least `reach` away, in spacings of the probes there,
// or after max_bounces.
struct hg_gpu_path_gather {
    float reach;        // spacings
    HG_UINT lamps_from; // the first sample that tells of lamps alone
};

// Uniform block HG_BIND_PATH.
struct hg_gpu_path {
    HG_PTR(hg_ray_list) rays;        // [capacity]
    HG_PTR(hg_ray_list) shadow_rays; // [2][capacity] the second ones to directional lights
    HG_PTR(hg_hit_list) hits;        // [capacity]
    HG_PTR(hg_hit_list) shadow_hits; // [capacity], of masked and blended surfaces
    HG_PTR(hg_path_words) blocked;   // [capacity]
    HG_PTR(hg_path_words) status;    // [capacity]
    HG_PTR(hg_path_floats) state;    // [words][capacity]
    HG_PTR(hg_path_words) tiles;     // [tile_count] column | row << 16, in tiles
    HG_PTR(hg_path_words) tile_samples; // [tile_count] index of the sample of each tile
    HG_PTR(hg_path_floats) film;     // [channels][height][width]
    // Samples of the pass until they are added, [channels - 1][rows of tiles * 16][columns * 16]: a row
    // of tiles has the place of its number modulo ring_rows.
    HG_PTR(hg_path_floats) ring;
    HG_PTR(hg_path_words) traced;    // [tiles of the picture] samples of it that were in the ring
    HG_PTR(hg_path_words) draw_marks;   // [draws] group of what it emits, HG_PATH_MARK_*
    HG_PTR(hg_path_words) light_groups; // [lights] by hg_gpu_light.id
    HG_PTR(hg_path_words) names;        // [lists][draws] the first draw that has the same name
    HG_STRUCT(hg_gpu_emitters) emitters;
    HG_STRUCT(hg_gpu_path_moment) moments[HG_PATH_MOMENTS];
    HG_UINT capacity, channels;      // of the film
    HG_UINT sample_bits;             // the sequence has 2^sample_bits points per pixel
    HG_UINT max_bounces;
    HG_VEC3 lens_x_ws; // metres: half axes of the lens, 0 = a pinhole
    float focus_distance;
    HG_VEC3 lens_y_ws;
    float clamp_indirect; // 0 = off
    HG_UINT has_alpha_mask; // 1: there are masked or blended surfaces
    HG_UINT estimators; // HG_PATH_USE_*
    HG_UINT split;      // first word of HG_PATH_SPLIT_*
    HG_UINT columns, ring_rows; // of tiles
    // Lists of the names that a pixel's samples met, pairs (first draw of the name + 1, samples): the
    // first channel of the film that they have, 2 HG_PATH_DRAWS_LENGTH each.
    HG_UINT lists, list_count;
    HG_UINT name_draws; // in a row of names
    float footprint;     // of textures, as a share of what a pixel or a lobe covers
    HG_STRUCT(hg_gpu_path_gather) gather;
    HG_UINT branch_bits; // each surface that the camera sees gets 2^n paths for a sample
    // HG_PATH_SPLATS: where in its pixel each sample of the pass is, px from the middle, and how much
    // of the sample to the left, of its own, to the right (above, ...) a pixel takes.
    HG_VEC3 splat_x, splat_y;
    float splat_offset[2];
    HG_UINT planes[HG_PATH_PLANE_COUNT]; // first channel of each
    float filter_px[HG_PATH_FILTER_STEPS + 1]; // offsets at equal steps of the filter's integral
};

#define HG_PATH_USE_EMITTERS 1u // rays to lights
#define HG_PATH_USE_SURFACES 2u // light that paths run into; both: weighted

struct hg_gpu_path_push {
    HG_PTR(hg_path_words) list; // [count] slots
    HG_UINT count;
    HG_UINT block; // 0: see lib/path.glsl
    HG_UINT second; // 1: of rays to lights, those to directional ones
    HG_UINT branch; // of what the camera sees
};

// The shadow table has the binding of the path block: paths use no shadow maps.
#define HG_BIND_PATH 19 // HG_BIND_HISTORY: paths have none

#endif
