// polygons.h - triangles of polygons, concave and not quite plane ones included.
// Floor 2, private to scene/. One thread per cutter.
#ifndef HG_RENDERER_SCENE_FORMATS_MESH_POLYGONS_H
#define HG_RENDERER_SCENE_FORMATS_MESH_POLYGONS_H

#include "base/status.h"
#include "renderer/scene/formats/mesh/mesh_file.h"

// Working memory, kept from polygon to polygon. Zeroed but for item sizes: hg_polygons_begin.
struct hg_polygons {
    struct hg_mesh_array corners;   // double[2]: the polygon in its plane
    struct hg_mesh_array links;     // uint32_t[2]: before and after
    struct hg_mesh_array triangles; // uint32_t[3] numbers of corners, 0 .. count - 1: the result
    uint64_t work_left;             // comparisons, in this file
    bool gave_up;                   // and polygons were cut as if they were convex
};

void hg_polygons_begin(struct hg_polygons *p);
void hg_polygons_finish(struct hg_mesh_file *f, struct hg_polygons *p);

// Fills p->triangles with count - 2 triangles that turn as the polygon does. xyz [count * 3] are
// its corners. Convex ones are fans from corner 0; others are cut by ear clipping in the plane of
// Newell's normal (Meisters 1975, "Polygons Have Ears"; D. Eberly, "Triangulation by Ear
// Clipping"), O(count * concave corners) out of the work that a file may take. HG_E_LIMIT,
// HG_E_NOMEM.
enum hg_status hg_polygons_cut(
    struct hg_mesh_file *f, struct hg_polygons *p, const double *xyz, uint32_t count) HG_MUST_CHECK;

#endif
