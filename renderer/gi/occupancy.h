// occupancy.h - which probes of a grid lookups from surfaces can read.
// Floor 2, private to renderer/gi. Thread: the render thread.
#ifndef HG_RENDERER_GI_OCCUPANCY_H
#define HG_RENDERER_GI_OCCUPANCY_H

#include "renderer/gi/field.h"
#include "renderer/host_shading/surfaces.h"

// Sets field->needed of the corners of all cells that surfaces are in or near enough to for the
// lookup's bias (HG_PROBE_BIAS_*); conservative, the same for equal geometry. All of them where
// draws have no triangles (lines, points), and where it would take too long to tell.
void hg_gi_occupy(struct hg_gi_field *field, const struct hg_host_surfaces *surfaces);

#endif
