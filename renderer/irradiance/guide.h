// guide.h - the directions that light comes from, as rays found them, and directions chosen by
// that (path guiding). Floor 2, private to renderer/irradiance. Thread: the render thread.
//
// In the shade most light comes from few directions: a sunlit piece of floor, an opening to the
// sky. Rays over the cosine find them by chance, so what new cells know is noise. A guide keeps the
// mean luminance of 8 x 8 directions, the squares of an octahedral map, for a cube a few times as
// wide as a cell. Rays that follow it go where luminance times cosine is large; others go over the
// cosine, so that nothing is missed.
// Sources: Jensen 1995, "Importance Driven Path Tracing using the Photon Map"; Cigolle et al. 2014,
// "A Survey of Efficient Representations for Independent Unit Vectors" (octahedral maps).
#ifndef HG_RENDERER_IRRADIANCE_GUIDE_H
#define HG_RENDERER_IRRADIANCE_GUIDE_H

#include <stdbool.h>
#include <stdint.h>

#include "base/status.h"

enum {
    HG_GUIDE_SIDE = 8,
    HG_GUIDE_BINS = HG_GUIDE_SIDE * HG_GUIDE_SIDE,
    HG_GUIDES = 4096,
    HG_GUIDE_FEW = 16 // rays, below which a guide says nothing
};

struct hg_irradiance_guide {
    uint64_t key;                                        // of a cube (cells.h); 0: empty
    uint32_t used, light;                                // as of a cell
    float luminance[HG_GUIDE_BINS], rays[HG_GUIDE_BINS]; // sums over rays, and their number
    float all;                                           // rays
};

struct hg_irradiance_guides {           // zeroed: none
    struct hg_irradiance_guide *guides; // [HG_GUIDES]
    float middle[3][HG_GUIDE_BINS];     // of a bin, unit
    float solid[HG_GUIDE_BINS];         // solid angle of a bin, relative
    struct hg_irradiance_guide *last;   // asked for in the picture; NULL: none
};

uint64_t hg_irradiance_guides_bytes(void); // that they take
// HG_E_NOMEM.
enum hg_status hg_irradiance_guides_init(struct hg_irradiance_guides *guides) HG_MUST_CHECK;
void hg_irradiance_guides_finish(struct hg_irradiance_guides *guides);
void hg_irradiance_guides_clear(struct hg_irradiance_guides *guides);

// That of a cube, made if there is none; stays where it is during the picture. What it knows of
// another light than `light` counts as little from then on. NULL: there is no room.
struct hg_irradiance_guide *hg_irradiance_guide_ask(
    struct hg_irradiance_guides *guides, uint64_t key, uint32_t picture, uint32_t light);
// What came from a direction (unit).
void hg_irradiance_guide_add(
    struct hg_irradiance_guide *guide, const float way[3], float luminance);

// Of directions at a surface.
struct hg_irradiance_distribution {
    float sums[HG_GUIDE_BINS + 1]; // of the bins before, 0 .. 1
};
// By luminance times cosine. False: too little is known, or nothing shines.
bool hg_irradiance_guide_distribution(const struct hg_irradiance_guides *guides,
    const struct hg_irradiance_guide *guide, const float normal[3],
    struct hg_irradiance_distribution *out);
// xi: in [0, 1).
void hg_irradiance_distribution_take(
    const struct hg_irradiance_distribution *d, const float xi[2], float way[3]);
// Per steradian.
float hg_irradiance_distribution_density(
    const struct hg_irradiance_distribution *d, const float way[3]);

#endif
