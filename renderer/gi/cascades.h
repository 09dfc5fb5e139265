// cascades.h - where grids of probes finer than that of the whole scene stand: around what a camera
// sees.
// Floor 2, private to renderer/gi. Pure.
//
// The finest grid holds most of the surfaces of the picture; each coarser one has four times its
// spacing, up to that of the whole scene (as clipmaps: Losasso and Hoppe 2004, "Geometry Clipmaps";
// for irradiance probes Majercik et al. 2021). There are none where that one is fine enough.
#ifndef HG_RENDERER_GI_CASCADES_H
#define HG_RENDERER_GI_CASCADES_H

#include "renderer/gi/field.h"

#define HG_GI_FINER      (HG_PROBE_GRIDS - 1) // grids besides that of the whole scene
#define HG_GI_EYE_SIDE   16 // rays along a side of the picture that tell what is seen
#define HG_GI_EYE_SEEN   (HG_GI_EYE_SIDE * HG_GI_EYE_SIDE)
#define HG_GI_EYE_AROUND 128 // and in all directions: what light in the picture comes from

#define HG_GI_BOX_STEPS   16
#define HG_GI_FINE_OCTAVE 32

// A grid whose spacing is that of the coarsest one divided by two to the power of fineness /
// HG_GI_FINE_OCTAVE.
struct hg_gi_box {
    uint32_t fineness;
    uint32_t counts[3]; // of probes
    int32_t first[3];   // where the first one stands, from that of the coarsest grid on, in
                        // 1 / HG_GI_BOX_STEPS of its own spacing
};

struct hg_gi_placement { // zeroed: none
    uint32_t count;
    struct hg_gi_box boxes[HG_GI_FINER]; // from coarse to fine
};

struct hg_gi_points { // of surfaces that rays from the eye met
    float seen[HG_GI_EYE_SEEN][3], around[HG_GI_EYE_AROUND][3];
    uint32_t seen_count, around_count;
};
// before: what the placement was so far, which stays as far as it serves, and moves in whole
// spacings; NULL: it follows from the points alone.
void hg_gi_placement_find(const struct hg_gi_field *coarsest, const struct hg_gi_points *points,
    const struct hg_gi_placement *before, struct hg_gi_placement *out);
// The grid of a box: counts, count, origin, spacing and salt.
void hg_gi_box_grid(
    const struct hg_gi_box *box, const struct hg_gi_field *coarsest, struct hg_gi_field *out);
// Probes of `field`, a grid of `box`, become those of `from` (of another box with the same spacing)
// that stand in the same places, unless `is_new` says false of them; it is cleared there. is_new:
// [count].
void hg_gi_box_take(struct hg_gi_field *field, const struct hg_gi_box *box,
    const struct hg_gi_field *from, const struct hg_gi_box *from_box, bool *is_new);

#endif
