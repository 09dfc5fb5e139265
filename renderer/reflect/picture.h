// picture.h - inputs and statistics of the reflections of one picture.
// Floor 2 (reflect).
#ifndef HG_RENDERER_REFLECT_PICTURE_H
#define HG_RENDERER_REFLECT_PICTURE_H

#include "renderer/gi/gi.h"
#include "renderer/reflect/cache.h"
#include "shaders/shared/frame.h"
#include "shaders/shared/reflect.h"

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
    float share;      // of the texels that would send rays at full quality: 1, 0.5, 0.25; 0 = 1
    uint32_t samples; // rays of a texel; 0 = 1
    bool dense;       // every texel sends rays, however rough it is
};

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
    uint64_t ray_ns;                     // of ns, in which rays were cast and shaded
    uint64_t bytes;                      // of all that is kept, without the cache
};
#endif
