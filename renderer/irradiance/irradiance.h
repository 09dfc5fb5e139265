// irradiance.h - diffuse light of pictures in motion, and what rough surfaces mirror, gathered by
// rays from what the camera sees. Floor 2. Thread: the render thread; rays are shaded on jobs.
//
// The field of probes is interpolated over metres, so it is wrong where surfaces or edges of
// sunlight lie between probes. Some thousand rays of each picture correct it. They go from texels
// of probe light (shaders/shared/gi.h), over the cosine or the specular lobe (directions.h); their
// hits are lit by shadow rays and by the field, whose error averages out over a hemisphere. Cells
// on surfaces (cells.h) keep the results over pictures, for all cameras of a scene:
//   diffuse    light of surfaces and probe light of the same places, whose quotient is the factor
//   on
//              probe light; and the share of the environment that rays see, which its irradiance is
//              multiplied by (ratio estimators)
//   specular   what rough surfaces mirror, by the direction to the eye
// The fewer samples a cell has, the more probe light counts as it is.
// docs/internals/irradiance.md.
#ifndef HG_RENDERER_IRRADIANCE_IRRADIANCE_H
#define HG_RENDERER_IRRADIANCE_IRRADIANCE_H

#include "renderer/gi/gi.h"
#include "renderer/host_shading/texels.h"

struct hg_irradiance; // of one scene

uint64_t hg_irradiance_bytes(void); // that one takes
// HG_E_NOMEM, device errors. Borrows both.
enum hg_status hg_irradiance_create(struct hg_gpu *gpu, struct hg_jobs *jobs,
    struct hg_irradiance **out, struct hg_error *err) HG_MUST_CHECK;
void hg_irradiance_destroy(struct hg_irradiance *irradiance); // accepts NULL

struct hg_irradiance_picture {
    struct hg_host_texels texels;
    double origin[3];          // of the geometry; another one: nothing is known
    uint64_t light;            // revision of the scene and its lights
    uint32_t doublings;        // of the updates of a dynamic field since the last change
    const uint32_t *looked_up; // [rows][columns][4] probe light
    const uint32_t *mirrors;   // [rows][columns][2] shaders/shared/reflect.h
    const struct hg_lighting_sources *sources;
    struct hg_gi_world world;
    float share;         // of the rays of full quality, 0 .. 1; 0 = 1
    bool diffuse, lobes; // what of it the picture takes
};
// Changes probe light in `words`, [rows][columns][4]: its irradiance, and what rough surfaces
// mirror. No batch is open. Device errors.
enum hg_status hg_irradiance_run(struct hg_irradiance *irradiance,
    const struct hg_irradiance_picture *picture, uint32_t *words,
    struct hg_error *err) HG_MUST_CHECK;

struct hg_irradiance_stats { // of the newest picture
    uint32_t rays, shadow_rays, misses, cells;
    uint64_t ns, cpu_ns; // cpu: of all threads of the process meanwhile
    uint64_t bytes;
};
void hg_irradiance_stats(const struct hg_irradiance *irradiance, struct hg_irradiance_stats *out);

#endif
