// environment.h - image-based light, prefiltered for the shaders of lib/environment.glsl.
// Floor 2 (light). Thread: one call at a time per object; work is spread over `jobs`. Results are
// the same bytes on every run and for every number of threads.
//
// Radiance in, radiance out: rotation and intensity are applied by the shader.
#ifndef HG_RENDERER_LIGHT_ENV_ENVIRONMENT_H
#define HG_RENDERER_LIGHT_ENV_ENVIRONMENT_H

#include "base/jobs.h"
#include "renderer/image/image.h"
#include "base/store/store.h"
#include "shaders/shared/light.h"

#define HG_ENVIRONMENT_LEVELS   7 // of perceptual roughness 0..1, see hg_environment_roughness
#define HG_ENVIRONMENT_PITCH    (HG_IRRADIANCE_SIZE + 2)
#define HG_ENVIRONMENT_MIN_FACE 256
#define HG_ENVIRONMENT_MAX_FACE 1024

struct hg_environment_map {
    uint32_t face_size;                        // px of level 0
    uint16_t *specular[HG_ENVIRONMENT_LEVELS]; // [6 * s * s * 4] halves, s = face_size >> level
    struct hg_vec4 *irradiance; // [pitch * pitch] irradiance / pi, octahedral, border of one
};

// Perceptual roughness of a level: the inverse of hg_environment_lod in lib/environment.glsl.
float hg_environment_roughness(uint32_t level);

// Side of the mirror level for a source of this width: half of it as a power of two, so that a
// mirror is as sharp as the image, within MIN_FACE..MAX_FACE.
uint32_t hg_environment_face_size(uint32_t image_width);

void hg_environment_map_finish(struct hg_environment_map *map); // accepts a zeroed one

// The same through the store (NULL: none) by `key`, the content's SHA-256. What is missing or
// damaged is made again; a store that cannot be written is only a warning. *cached (may be NULL):
// it came from the store.
enum hg_status hg_environment_map_load(struct hg_environment_map *map, const struct hg_image *image,
    const uint8_t key[32], struct hg_store *store, struct hg_jobs *jobs,
    bool *cached) HG_MUST_CHECK;

#endif
