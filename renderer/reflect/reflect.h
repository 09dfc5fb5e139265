// reflect.h - reflections of a picture in motion: rays from a sixteenth of its pixels.
// Floor 2 (reflect). Thread: the render thread; rays are shaded on jobs.
//
// Each texel of probe light (shaders/shared/gi.h) sends a ray into the lobe of its surface, where
// that is rough one of sixteen. What that meets has its radiance from the cache, else it is shaded;
// sums over the lobe are filtered over neighbours and over pictures before they are divided by the
// sum of weights (ratio estimator: Heitz, Hill and McGuire 2018, "Combining Analytic Direct
// Illumination and Stochastic Shadows"). The result takes the place of what the field of probes
// says about the mirror direction; shading does not know which it is.
// docs/internals/reflections.md.
//
// Layers, lowest first:
//   texel cache mirror_planes
//   filter picture
//   glass
//   work
//   rays hits
//   reflect
#ifndef HG_RENDERER_REFLECT_REFLECT_H
#define HG_RENDERER_REFLECT_REFLECT_H

#include "renderer/reflect/picture.h"

struct hg_reflect; // of one view

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

void hg_reflect_stats(const struct hg_reflect *reflect, struct hg_reflect_stats *out);

#endif
