// irradiance.h - diffuse light of pictures in motion, and what rough surfaces mirror, gathered by
// rays from what the camera sees. Floor 2. Thread: the render thread; rays are shaded on jobs.
//
// The field of probes is interpolated over metres; what stands nearer to a surface than probes do,
// and sunlight that ends between them, it gets wrong. So some thousand rays of each picture go from
// texels of probe light (shaders/shared/gi.h), over the cosine or the specular lobe (directions.h).
// What they meet is lit by shadow rays and the field, far from the texel in the mean, where the
// field is right. Cells on surfaces (cells.h) keep what came, over pictures and for all cameras of
// a scene: diffuse light beside what probe light had there, whose quotient probe light is
// multiplied by (ratio estimator), and what rough surfaces mirror by where the eye is. The fewer
// samples there are, the more is left as it was.
// docs/internals/irradiance.md.
#ifndef HG_RENDERER_IRRADIANCE_IRRADIANCE_H
#define HG_RENDERER_IRRADIANCE_IRRADIANCE_H

#include "renderer/gi/gi.h"
#include "renderer/gi/texels.h"

struct hg_irradiance; // of one scene

uint64_t hg_irradiance_bytes(void); // that one takes
// HG_E_NOMEM, device errors. Borrows both.
enum hg_status hg_irradiance_create(struct hg_gpu *gpu, struct hg_jobs *jobs,
    struct hg_irradiance **out, struct hg_error *err) HG_MUST_CHECK;
void hg_irradiance_destroy(struct hg_irradiance *irradiance); // accepts NULL

struct hg_irradiance_picture {
    struct hg_gi_texels texels;
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
