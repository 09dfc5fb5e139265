// frame.h - what every pass of one frame knows. Floor 0, shared by C and GLSL.
//
// One uniform block, global name `hg_frame` in GLSL (lib/frame.glsl). Each room embeds its struct
// here by value and fills it with its own hg_<room>_fill(). Pass arguments travel in push constants.
#ifndef HG_SHADERS_SHARED_FRAME_H
#define HG_SHADERS_SHARED_FRAME_H

#include "shared/blend.h"
#include "shared/geometry.h"
#include "shared/gi.h"
#include "shared/light.h"
#include "shared/mirror.h"
#include "shared/texture.h"
#include "shared/types.h"

#define HG_BACKGROUND_MODE_ENV   0
#define HG_BACKGROUND_MODE_NONE  1 // transparent
#define HG_BACKGROUND_MODE_COLOR 2
#define HG_BACKGROUND_MODE_BLUR  3 // the environment out of focus
#define HG_BACKGROUND_MODE_DISPLAY 4 // transparent until exposure and tone curve, then a colour
#define HG_BACKGROUND_IS_CLEAR(mode) \
    ((mode) == HG_BACKGROUND_MODE_NONE || (mode) == HG_BACKGROUND_MODE_DISPLAY)

// Right-handed, y up. Clip space of Vulkan: x right, y down, depth 1 at the near plane and 0 at the
// far plane or infinity (reversed). "vs" looks along -z.
struct hg_gpu_camera {
    HG_MAT4 view;          // world to view
    HG_MAT4 proj;          // view to clip, jittered
    HG_MAT4 view_proj;     // proj * view
    HG_MAT4 inv_view_proj; // clip to world
    HG_MAT4 inv_view;      // view to world
    HG_VEC3 eye_ws;
    HG_UINT orthographic; // 0 or 1
    HG_VEC3 forward_ws;   // unit, where the camera looks
    HG_FLOAT near;        // metres
    HG_VEC3 ray_origin_ws; // through the centre of pixel (x + 0.5, y + 0.5) goes the ray
    HG_FLOAT far;          // metres; 0 = infinite
    HG_VEC3 ray_x_ws;      // perspective: direction = ray_origin + px * ray_x + py * ray_y, from the
    HG_FLOAT pixel_angle;  // eye, not unit, view depth 1 (jitter included);
    HG_VEC3 ray_y_ws;      // orthographic: start = ray_origin + px * ray_x + py * ray_y, direction
    HG_FLOAT pixel_size;   // forward. pixel_angle: radians, pixel_size: metres (orthographic)
};
HG_SHARED_SIZE(hg_gpu_camera, 400);

// Only the last shadow map of a directional light, the one of the whole scene, is up to date.
#define HG_FRAME_COARSE_SHADOWS 1u
// The first light is the sun of a sky, whose disc counts: its shadows have penumbrae.
#define HG_FRAME_SUN_DISC       2u
// Ambient occlusion by the depth of the picture, in the light of probes (lib/gtao.glsl).
#define HG_FRAME_OCCLUSION      4u
// Colours, and alpha masks, are filtered over the share of a pixel that one of its samples stands for.
#define HG_FRAME_FINE           8u
// Every second pixel of a row is shaded, into a picture half as wide (checkerboard.h).
#define HG_FRAME_CHECKERBOARD   0x100u
// The only sample of a picture in motion, which those before add to.
#define HG_FRAME_MOTION         0x200u

#define HG_FRAME_TONEMAP_ACES        0
#define HG_FRAME_TONEMAP_AGX         1
#define HG_FRAME_TONEMAP_PBR_NEUTRAL 2
#define HG_FRAME_TONEMAP_LINEAR      3

#define HG_CLIP_PLANES 6

// 16-byte multiples keep the block tidy; pointers first within each struct.
struct hg_gpu_frame {
    HG_STRUCT(hg_gpu_camera) camera;
    HG_UINT width, height; // px
    HG_VEC2 jitter_px;     // of this sample, -0.5..0.5 about the pixel centre (0 in picks)
    HG_UINT sample_index;  // of the accumulation, from 0
    HG_UINT sample_count;  // that will be accumulated
    HG_UINT seed;
    HG_UINT background_mode;  // HG_BACKGROUND_MODE_*
    HG_VEC3 background_color; // linear
    HG_FLOAT exposure;        // linear factor, 2^EV
    HG_UINT tonemap;          // HG_FRAME_TONEMAP_*
    HG_UINT flags;            // HG_FRAME_*
    HG_VEC2 inv_size;         // 1 / width, 1 / height
    HG_VEC3 ground_up;        // unit: a ground that catches shadows lies across; zero: there is none
    HG_FLOAT ground_height;   // of its points along ground_up, relative to the origin
    HG_STRUCT(hg_gpu_lighting) lighting;
    HG_STRUCT(hg_gpu_textures) textures;
    HG_STRUCT(hg_gpu_geometry) geometry;
    HG_STRUCT(hg_gpu_blend_lists) blend;
    HG_STRUCT(hg_gpu_probes) probes; // HG_FEATURE2_PROBES
    HG_VEC4 mirrors[HG_MIRROR_PLANES]; // HG_FEATURE2_MIRRORS: dot(xyz, p) = w; zero: no plane
    HG_VEC4 clip_planes[HG_CLIP_PLANES]; // shown: dot(xyz, p) + w >= 0 of the first clip_count
    HG_UINT clip_count, reserved;
};
HG_SHARED_SIZE(hg_gpu_frame, 1280);

#endif
