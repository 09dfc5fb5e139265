// cuts.h - clipping planes along x, y and z of a viewer: where each of them is, which side is
// shown, and how solids are closed. The browser viewer (client/web/looks.js) has the same ones.
// Floor 6 (client). Pure; metres, world space.
#ifndef HG_CLIENT_VIEW_CUTS_H
#define HG_CLIENT_VIEW_CUTS_H

#include <stdbool.h>
#include <stddef.h>

#include "protocol/hgp.h"

enum { HG_CUTS_AXES = 3 };

struct hg_cut {
    bool is_on, is_flipped; // flipped: what is above it along its axis is shown, else what is below
    double share;           // where it is in the box, 0 = at the least coordinate, 1 = at the most
};

struct hg_cuts {
    struct hg_cut axes[HG_CUTS_AXES];
    enum hgp_cap_style caps;
    bool has_box; // false: the scene is empty, and nothing can be cut
    float min[3], max[3];
};

// As view_clip takes them.
struct hg_cut_planes {
    struct hgp_clip_plane items[HG_CUTS_AXES];
    uint32_t count;
    enum hgp_cap_style caps;
};

// Another scene: planes stand in the middle of its box and are off. Boxes that are not finite or
// inside out are none.
void hg_cuts_reset(struct hg_cuts *c, bool has_box, const float min[3], const float max[3]);
double hg_cuts_place(const struct hg_cuts *c, int axis);
void hg_cuts_set_share(struct hg_cuts *c, int axis, double share); // switches it on
void hg_cuts_next_caps(struct hg_cuts *c, bool back);
const char *hg_cuts_caps_name(const struct hg_cuts *c);
void hg_cuts_planes(const struct hg_cuts *c, struct hg_cut_planes *out);
// "x", "x, z": axes with planes; empty: none.
void hg_cuts_text(const struct hg_cuts *c, char *text, size_t size);

#endif
