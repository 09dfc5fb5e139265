// proxy_mesh.h - a part in few triangles, in no time: what is shown of a part that is too large for
// the budget until its levels of detail are there. Floor 2 (geometry). Thread: any.
#ifndef HG_RENDERER_LOD_PROXY_MESH_H
#define HG_RENDERER_LOD_PROXY_MESH_H

#include "renderer/scene/scene.h"

// At most `triangles` (at least 1) that look like the part from afar: vertices of a cell of a grid
// become one at their mean (Rossignac and Borrel 1993, "Multi-resolution 3D approximations for
// rendering complex scenes"). Where that leaves next to nothing (leaves, grass), some of the
// triangles, as much larger as there are fewer of them (Cook et al. 2007, "Stochastic
// simplification of aggregate detail"): these may reach beyond the part.
//   part   static triangles
//   out    to be freed with hg_proxy_free; has neither skin nor targets, material or variants
// HG_E_NOMEM.
enum hg_status hg_proxy_build(
    const struct hg_mesh_part *part, uint32_t triangles, struct hg_mesh_part **out) HG_MUST_CHECK;
void hg_proxy_free(struct hg_mesh_part *proxy); // accepts NULL

#endif
