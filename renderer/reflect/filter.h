// filter.h - reflections of neighbours and of the pictures before.
// Floor 2, private to renderer/reflect. Pure but for the jobs.
//
// Both work on the sums of the ratio estimator, which is divided last. Source: Hirvonen et al.
// 2019, "Accurate Real-Time Specular Reflections with Radiance Caching", section 4.
#ifndef HG_RENDERER_REFLECT_FILTER_H
#define HG_RENDERER_REFLECT_FILTER_H

#include "base/jobs.h"
#include "renderer/reflect/texel.h"
#include "shaders/shared/frame.h"

struct hg_reflect_image {
    uint32_t columns, rows;
    const struct hg_reflect_texel *texels; // [rows][columns]
    const uint32_t *counts;                // [rows] texels that mirror; sums of others are not kept
    struct hg_jobs *jobs;
};

// Edge-avoiding a-trous, two iterations of 3 x 3 texels. sums and spare: [rows][columns]; they
// are swapped, and the result is in *sums.
void hg_reflect_filter_spatial(
    const struct hg_reflect_image *image, hg_reflect_sums **sums, hg_reflect_sums **spare);

struct hg_reflect_history { // of one picture; zeroed: none
    uint32_t columns, rows;
    struct hg_gpu_camera camera;
    uint32_t width, height; // px
    struct hg_reflect_texel *texels;
    hg_reflect_sums *sums;
};
// Blends what the mirror images were in the picture before into the sums, which are then [rows]
// [columns] of now. now: the camera, width and height of the history that comes after.
void hg_reflect_filter_temporal(const struct hg_reflect_image *image,
    const struct hg_reflect_history *before, hg_reflect_sums **sums, hg_reflect_sums **spare);

// Where the mirror image is that a texel shows: of what its ray met, as a thin lens of the
// surface's curvature has it (1 / metres, convex positive).
void hg_reflect_image_position(const struct hg_reflect_texel *texel, float curvature, float out[3]);

#endif
