// glass.h - what clear glass of a picture in motion refracts and mirrors, by rays of the host.
// Floor 2 (reflect). Thread: the render thread; rays are made and shaded on jobs.
//
// A texel whose ray meets clear glass first (struct hg_host_glass) sends two rays from there: one
// on through the glass, bent at each of its surfaces by Snell's law, and one mirrored. Each goes on
// through glass until it meets something else, or leaves the scene. Where a surface between lets
// only a part of the light through the rest is not followed: it counts as bright as what is seen,
// which is exact where light is the same from everywhere. Total reflection is followed. What they
// meet is looked up in the picture of the opaque scene where that shows it (screen hits), else it
// is lit as what reflections meet is. Shading weighs both by the first surface
// (shaders/lib/glass.glsl). Sources: Whitted 1980, "An Improved Illumination Model for Shaded
// Display"; Wyman 2005, "An Approximate Image-Space Approach for Interactive Refraction" (lookups
// in the picture of the scene behind).
#ifndef HG_RENDERER_REFLECT_GLASS_H
#define HG_RENDERER_REFLECT_GLASS_H

#include "base/jobs.h"
#include "renderer/gi/gi.h"
#include "shaders/shared/frame.h"
#include "shaders/shared/glass.h"

struct hg_glass; // of one view

// HG_E_NOMEM. Borrows both.
enum hg_status hg_glass_create(struct hg_gpu *gpu, struct hg_jobs *jobs, struct hg_glass **out,
    struct hg_error *err) HG_MUST_CHECK;
void hg_glass_destroy(struct hg_glass *glass); // accepts NULL

struct hg_glass_picture {
    const struct hg_gpu_camera *camera; // perspective; relative to the origin of the world
    uint32_t width, height;             // px
    uint32_t columns, rows;             // texels; both divide the picture evenly, but for rounding
    // [height][width][4] the opaque scene: radiance, and how deep it lies, metres, >= FAR where
    // there is none; or minus that. NULL: nothing is looked up.
    const float *behind;
    bool shows_sky; // where there is none `behind` has the environment
    const struct hg_lighting_sources *sources;
    struct hg_gi_world world;
};
#define HG_GLASS_FAR_M 1e29f

// Words of the texels, shaders/shared/glass.h, to out [rows][columns][4]. No batch is open.
// HG_E_NOMEM, device errors.
enum hg_status hg_glass_run(struct hg_glass *glass, const struct hg_glass_picture *picture,
    uint32_t *out, struct hg_error *err) HG_MUST_CHECK;

struct hg_glass_stats { // of the newest picture
    uint32_t texels;    // that show clear glass
    uint32_t rays, shadow_rays;
    uint32_t on_screen, sky, lit; // ends of rays; lit: of the others, those that were lit
    uint64_t ns, cpu_ns, bytes;
};
void hg_glass_stats(const struct hg_glass *glass, struct hg_glass_stats *out); // NULL: zeroed

#endif
