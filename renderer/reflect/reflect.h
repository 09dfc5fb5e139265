// reflect.h - reflections of a picture in motion: rays from a sixteenth of its pixels.
// Floor 2 (reflect). Thread: the render thread; rays are shaded on jobs.
//
// Each texel of probe light (shaders/shared/gi.h) sends a ray into the lobe of its surface, where
// that is rough one of four. What that meets has its radiance from the cache, else it is shaded;
// sums over the lobe are filtered over neighbours and over pictures before they are divided by the
// sum of weights (ratio estimator: Heitz, Hill and McGuire 2018, "Combining Analytic Direct
// Illumination and Stochastic Shadows"). The result takes the place of what the field of probes
// says about the mirror direction; shading does not know which it is.
// docs/internals/reflections.md.
//
// Layers, lowest first:
//   lobe
//   texel cache
//   light filter
//   reflect
#ifndef HG_RENDERER_REFLECT_REFLECT_H
#define HG_RENDERER_REFLECT_REFLECT_H

#include "base/jobs.h"
#include "renderer/gi/gi.h"
#include "renderer/reflect/cache.h"
#include "shaders/shared/frame.h"
#include "shaders/shared/reflect.h"

struct hg_reflect; // of one view

struct hg_reflect_picture {
    const struct hg_gpu_camera *camera; // relative to origin
    double origin[3];                   // of the geometry
    uint32_t width, height;             // px
    const uint32_t *light;              // [rows][columns][4] probe light: HG_PROBE_LIGHT_PX
    const uint32_t *mirrors;            // [rows][columns][2] shared/reflect.h
    const struct hg_lighting_sources *sources;
    struct hg_gi_world world;
    struct hg_radiance_cache *cache; // in line with the world; NULL: what rays meet is shaded
    bool continues;                  // what was reflected before may be seen again
    uint32_t samples;                // rays of a texel; 0 = 1
    bool dense;                      // every texel sends rays, however rough it is
};

// HG_E_NOMEM. Borrows both.
enum hg_status hg_reflect_create(struct hg_gpu *gpu, struct hg_jobs *jobs, struct hg_reflect **out,
    struct hg_error *err) HG_MUST_CHECK;
void hg_reflect_destroy(struct hg_reflect *reflect); // accepts NULL

// Writes probe light with reflections in it to out, [rows][columns][4]. No batch is open.
// HG_E_NOMEM, device errors.
enum hg_status hg_reflect_run(struct hg_reflect *reflect, const struct hg_reflect_picture *picture,
    uint32_t *out, struct hg_error *err) HG_MUST_CHECK;
// How each texel of the newest picture came about (enum hg_reflect_source), [rows][columns].
const uint8_t *hg_reflect_sources(const struct hg_reflect *reflect);

enum hg_reflect_source {
    HG_REFLECT_NOTHING, // no surface
    HG_REFLECT_ROUGH,   // no ray in this picture: those of neighbours and pictures before
    HG_REFLECT_SKY,     // the ray left the scene
    HG_REFLECT_CACHED,
    HG_REFLECT_SHADED,
    HG_REFLECT_LATE, // over the budget: what was there before
    HG_REFLECT_SOURCES,
};

struct hg_reflect_stats { // of the newest picture
    uint32_t texels, counts[HG_REFLECT_SOURCES];
    uint32_t captured, lit, shadow_rays; // of the cache; of both
    uint64_t ns, cpu_ns;                 // cpu: of all threads of the process meanwhile
    uint64_t bytes;                      // of all that is kept, without the cache
};
void hg_reflect_stats(const struct hg_reflect *reflect, struct hg_reflect_stats *out);

#endif
