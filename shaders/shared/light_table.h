// light_table.h - tables of photometric profiles and of images of lights, as words. Floor 0, shared by
// C and GLSL. Made by renderer/scene/light_table.h, read there and by lib/light_table.glsl.
#ifndef HG_SHADERS_SHARED_LIGHT_TABLE_H
#define HG_SHADERS_SHARED_LIGHT_TABLE_H

#define HG_LIGHT_NO_TABLE 0xffffffffu // of hg_gpu_light.profile and image

// The frame of a light: x its axis, y up, z against its direction. u of images that are projected runs
// to the right and v down, as seen from the light; on surfaces as seen by who faces them.
//
// A profile: word 0 is thetas | phis << 16, then floats [phis][thetas]: theta evenly from 0 (along -z) to
// pi, phi evenly from 0 (at +x) over +y round to 2 pi; one phi: the profile is round.
#define HG_LIGHT_PROFILE_HEAD 1

// An image: word 0 is width | height << 16, word 1 levels | wrap_s << 8 | wrap_t << 16 (enum hg_wrap),
// then the levels, each half as wide and high as the one before down to 1 x 1, rows from the top, two
// words a texel: 2 x 16-bit float red and green, and blue.
#define HG_LIGHT_IMAGE_HEAD 2
#define HG_LIGHT_WRAP_REPEAT 0
#define HG_LIGHT_WRAP_CLAMP  1
#define HG_LIGHT_WRAP_MIRROR 2

#define HG_LIGHT_LEAST_COS 0.0872f // of the half angle that the image of a spot light spans: 85 degrees

#endif
