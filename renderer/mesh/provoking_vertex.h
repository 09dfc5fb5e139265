// provoking_vertex.h - triangles whose first corner tells which one they are.
// Floor 2 (geometry). Pure: any thread.
//
// A rasteriser in software that is asked for gl_PrimitiveID takes the corners of all triangles
// apart before it draws them. So on such devices the visibility pass draws parts from a list of
// corners of its own, in which the first corner of triangle i is vertex i: the flat value of the
// first corner is the number of the triangle. Most triangles can have a corner for themselves, as
// closed surfaces have twice as many triangles as vertices and few are shared by as many as have
// none left: corners that are missing are copied, with the same position, so that neighbours still
// meet.
#ifndef HG_RENDERER_MESH_PROVOKING_VERTEX_H
#define HG_RENDERER_MESH_PROVOKING_VERTEX_H

#include "renderer/scene/scene.h"

struct hg_provoking {      // zeroed = none
    uint32_t *indices;     // [triangles * 3], winding as in the part
    uint32_t *sources;     // [vertex_count] vertex of the part
    uint32_t vertex_count; // >= triangles
};

// Of a part of triangles in `order` (NULL: as they are). HG_E_NOMEM, HG_E_LIMIT (more vertices than
// 32 bits count). Cost O(n).
enum hg_status hg_provoking_build(
    const struct hg_mesh_part *part, const uint32_t *order, struct hg_provoking *out) HG_MUST_CHECK;
void hg_provoking_finish(struct hg_provoking *list);

#endif
