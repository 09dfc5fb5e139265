// discs.h - points as small discs: polygons of a few triangles that everything else draws, shades,
// picks and traces like any other surface. Floor 2 (geometry). Pure: any thread.
//
// A disc is a regular polygon of the area of its circle, with the normal of the surface around the
// point; all its corners have the point's attributes.
#ifndef HG_RENDERER_LOD_DISCS_H
#define HG_RENDERER_LOD_DISCS_H

#include "renderer/lod/point_tree.h"

#define HG_DISC_SIDES_MAX 16u
#define HG_DISC_REACH     1.2534f // of corners, in radii, at most

// Triangles of a polygon.
static inline uint32_t hg_disc_triangles(uint32_t sides)
{
    return sides - 2;
}

// Sides of the discs of a cloud: rounder ones where there are few points to look at.
uint32_t hg_disc_sides(uint32_t points);
// Whether a count of sides is one that is used (4, 6, 8, 16).
bool hg_disc_sides_ok(uint32_t sides);
// Two unit directions across a unit normal.
void hg_disc_basis(const float normal[3], float u[3], float v[3]);
// corners [sides * 3] around `at`, counter-clockwise about the unit normal.
void hg_disc_corners(
    const float at[3], const float normal[3], float radius, uint32_t sides, float *corners);
// indices [hg_disc_triangles(sides) * 3] of corners first, first + 1, ...
void hg_disc_indices(uint32_t first, uint32_t sides, uint32_t *indices);

// Whether a part is points that are drawn as discs: neither skinned nor morphed.
bool hg_discs_can_build(const struct hg_mesh_part *part, uint32_t target_count);
// Whether a part of points is lit: it has normals, or neither normals nor colours (then they are
// estimated). Colours without normals are shown as they are (glTF 2.0, 3.7.2.1).
bool hg_discs_are_lit(const struct hg_mesh_part *part);
// A part of triangles with the discs of at most `most` points, evenly taken in the order of the
// part; materials and variants are not copied. To be freed with hg_discs_free. HG_E_LIMIT (more
// than 2^32 corners), HG_E_NOMEM.
enum hg_status hg_discs_build(
    const struct hg_mesh_part *points, uint32_t most, struct hg_mesh_part **out) HG_MUST_CHECK;
// The number of the point whose disc a triangle belongs to, for a part of all discs.
uint32_t hg_discs_point(const struct hg_mesh_part *discs, uint32_t triangle);
void hg_discs_free(struct hg_mesh_part *discs); // accepts NULL
// Bytes that the discs of all points take on the device, more or less.
uint64_t hg_discs_bytes(const struct hg_mesh_part *points);

#endif
