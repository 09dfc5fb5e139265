// mirror_planes.h - the planes that mirror most in a picture, by what its pixels show.
// Floor 2. Pure; any thread.
//
// Surfaces of texels of probe light (shaders/shared/gi.h, reflect.h) that are smooth and have no
// normal map are points of planes. Of some of them, spread over the picture, the plane is taken
// that holds most of the others, weighed by what they reflect to the eye, and fitted to all of
// these by least squares (Fischler and Bolles 1981, "Random Sample Consensus", with samples that
// are the same for the same picture). So a mirror may be tessellated, cut up by what stands before
// it, or move.
#ifndef HG_RENDERER_REFLECT_MIRROR_PLANES_H
#define HG_RENDERER_REFLECT_MIRROR_PLANES_H

#include <stddef.h>
#include <stdint.h>

#include "base/status.h"
#include "shaders/shared/frame.h"

#define HG_MIRROR_LEAST 4e-3f // of a picture that is white all over: what the least plane reflects

struct hg_mirror_plane {
    float normal[3], offset; // dot(normal, p) = offset; the eye is in front
};

static inline const float *hg_mirror_axes(const struct hg_vec3 *v)
{
    return (const float *)(const void *)v;
}

struct hg_mirror_texels {
    const struct hg_gpu_camera *camera;    // perspective
    uint32_t columns, rows, width, height; // texels, px
    const uint32_t *light, *surfaces;      // [rows][columns][4], [2]
};

struct hg_mirror_points { // scratch memory; zeroed: none
    struct hg_mirror_point *items;
    size_t capacity;
    uint32_t count;
};
void hg_mirror_points_finish(struct hg_mirror_points *points);
uint64_t hg_mirror_points_bytes(const struct hg_mirror_points *points);

// The number of planes, best first. of: [rows][columns] number + 1 of the plane that a texel is of,
// 0: none. HG_E_NOMEM.
enum hg_status hg_mirror_planes_find(const struct hg_mirror_texels *texels,
    struct hg_mirror_points *scratch, uint8_t *of, struct hg_mirror_plane out[HG_MIRROR_PLANES],
    uint32_t *count) HG_MUST_CHECK;

#endif
