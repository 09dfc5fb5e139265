// clipping.h - clipping planes along x, y and z of a viewer: where each of them is, which side is
// shown, and how solids are closed. The browser viewer (client/web/looks.js) has the same ones.
// Floor 6 (client). Pure; metres, world space.
#ifndef HG_CLIENT_VIEW_CLIPPING_H
#define HG_CLIENT_VIEW_CLIPPING_H

#include <stdbool.h>
#include <stddef.h>

#include "protocol/hgp.h"

enum { HG_CLIPPING_AXES = 3 };

struct hg_clipping_axis {
    bool is_on, is_flipped; // flipped: what is above it along its axis is shown, else what is below
    double share;           // where it is in the box, 0 = at the least coordinate, 1 = at the most
};

struct hg_clipping {
    struct hg_clipping_axis axes[HG_CLIPPING_AXES];
    enum hgp_cap_style caps;
    bool has_box; // false: the scene is empty, and nothing can be cut
    float min[3], max[3];
};

// As view_clip takes them.
struct hg_clipping_list {
    struct hgp_clip_plane items[HG_CLIPPING_AXES];
    uint32_t count;
    enum hgp_cap_style caps;
};

// Another scene: planes stand in the middle of its box and are off. Boxes that are not finite or
// inside out are none.
void hg_clipping_reset(struct hg_clipping *c, bool has_box, const float min[3], const float max[3]);
double hg_clipping_position(const struct hg_clipping *c, int axis);
void hg_clipping_set_share(struct hg_clipping *c, int axis, double share); // switches it on
void hg_clipping_next_caps(struct hg_clipping *c, bool back);
const char *hg_clipping_caps_name(const struct hg_clipping *c);
void hg_clipping_planes(const struct hg_clipping *c, struct hg_clipping_list *out);
// "x", "x, z": axes with planes; empty: none.
void hg_clipping_text(const struct hg_clipping *c, char *text, size_t size);

#endif
