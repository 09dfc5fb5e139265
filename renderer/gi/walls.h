// walls.h - what is next to a probe: a plane that hides all that is behind it.
// Floor 2, for renderer/gi. Thread: any; pure functions.
//
// Means of distances (Chebyshev's inequality, field.h) cannot tell a probe close before a wall
// without thickness from one close behind it where the wall is seen at grazing angles, or ends:
// their lobes are wider than that. Outside it may be a thousand times brighter than inside.
#ifndef HG_RENDERER_GI_WALLS_H
#define HG_RENDERER_GI_WALLS_H

#include <stdbool.h>
#include <stdint.h>

#include "shaders/shared/gi.h"

// What a ray brought.
struct hg_gi_ray {
    float direction[3]; // unit
    float distance;     // metres; FLT_MAX: it left the scene
    float normal[3];    // geometric, of what it met, on its side
    float light[3];
    float even[3];    // of the environment that way, met or not (environment.h)
    float emitted[3]; // of light what an emitter sent (hg_host_material)
    bool back; // the back of a surface that has one side: what begins there lies inside of it
};

// The wall next to a probe, as the device has it (shared/gi.h).
#define HG_GI_NO_WALL (HG_PROBE_WALL_NONE << (2 * HG_PROBE_BITS))
struct hg_gi_wall {
    uint32_t code;
    float normal[3]; // geometric, on the probe's side
    float distance;  // of the probe, spacings
};

// The plane of the nearest thing that a probe's rays met is a wall where none of them has met
// anything behind it that lookups would read the probe for: a chair's leg is none. nearest: NULL:
// there is no wall.
void hg_gi_wall_find(const struct hg_gi_ray *nearest, const struct hg_gi_ray *rays, uint32_t count,
    float spacing, struct hg_gi_wall *out);
// from: the probe to a point, metres.
bool hg_gi_wall_hides(const struct hg_gi_wall *wall, const float from[3], float spacing);

#endif
