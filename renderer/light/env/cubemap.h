// cubemap.h - a cube map of float radiance with mip levels, made from an equirectangular image.
// Floor 2 (light). Thread: one at a time while it is made, then any number of readers.
//
// Faces in Vulkan's order +x -x +y -y +z -z, texel (0, 0) top left as in the specification's table
// of cube face coordinates. Every face of every level carries a border of one texel taken from its
// neighbours, so that bilinear reads never see a seam.
#ifndef HG_RENDERER_LIGHT_ENV_CUBEMAP_H
#define HG_RENDERER_LIGHT_ENV_CUBEMAP_H

#include "base/jobs.h"
#include "renderer/image/image.h"
#include "renderer/math/vec.h"

#define HG_CUBEMAP_MAX_LEVELS 13

struct hg_cubemap {
    uint32_t size, levels;               // px of level 0, a power of two; down to 1 px
    hg_v4 *faces[HG_CUBEMAP_MAX_LEVELS]; // [6 * (s + 2)^2] of level l, s = size >> l
};

// Unit direction through a point of a face, x and y in -1..1 with y down.
void hg_cubemap_direction(uint32_t face, float x, float y, float out[3]);

// Level 0 by bilinear resampling (supersampled where the image is finer), then 2x2 means.
// image: RGBA32F equirectangular. size: power of two, 1..4096. HG_E_NOMEM.
enum hg_status hg_cubemap_create(struct hg_cubemap *cube, const struct hg_image *image,
    uint32_t size, struct hg_jobs *jobs) HG_MUST_CHECK;
void hg_cubemap_finish(struct hg_cubemap *cube); // accepts a zeroed one

// Levels above `level` from it once more, after it was changed in place (border included).
void hg_cubemap_shrink_from(struct hg_cubemap *cube, uint32_t level, struct hg_jobs *jobs);
// Inner texel of a face.
hg_v4 *hg_cubemap_texel(
    const struct hg_cubemap *cube, uint32_t level, uint32_t face, uint32_t x, uint32_t y);
// Solid angle of a texel of a face with s x s texels, steradians (Jacobian of the gnomonic
// projection at its centre).
float hg_cubemap_texel_solid_angle(uint32_t s, uint32_t x, uint32_t y);

// Trilinear radiance along a direction (any length > 0), lod clamped to the levels.
hg_v4 hg_cubemap_sample(const struct hg_cubemap *cube, const float dir[3], float lod);

#endif
