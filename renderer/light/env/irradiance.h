// irradiance.h - diffuse light of an environment.
// Floor 2 (light). Pure; the same bytes on every run and for every number of threads.
#ifndef HG_RENDERER_LIGHT_ENV_IRRADIANCE_H
#define HG_RENDERER_LIGHT_ENV_IRRADIANCE_H

#include "base/jobs.h"
#include "renderer/image/image.h"
#include "shaders/shared/light.h"

// Irradiance over pi for the octahedral directions of lib/environment.glsl.
//   image  RGBA32F equirectangular radiance
//   out    [(HG_IRRADIANCE_SIZE + 2)^2], border included
// The image is summed into 64 x 32 cells that keep their vector moment, so that a cell's share is
// exact for every normal except where the horizon cuts through the cell. HG_E_NOMEM.
// A map and not nine harmonics (Ramamoorthi and Hanrahan 2001): see docs/internals/light.md.
enum hg_status hg_irradiance_fill(
    const struct hg_image *image, struct hg_jobs *jobs, struct hg_vec4 *out) HG_MUST_CHECK;

#endif
