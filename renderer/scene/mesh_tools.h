// mesh_tools.h - what loaders do to vertex arrays: lists from strips, normals, tangents.
// Floor 2, private to scene/. Any thread; each call works on its own part.
#ifndef HG_RENDERER_SCENE_MESH_TOOLS_H
#define HG_RENDERER_SCENE_MESH_TOOLS_H

#include "renderer/scene/scene.h"

// Primitive modes by their glTF numbers.
enum hg_primitive_mode {
    HG_MODE_POINTS,
    HG_MODE_LINES,
    HG_MODE_LINE_LOOP,
    HG_MODE_LINE_STRIP,
    HG_MODE_TRIANGLES,
    HG_MODE_TRIANGLE_STRIP,
    HG_MODE_TRIANGLE_FAN
};

// Lists that a mode is expanded to: points, lines or triangles.
enum hg_topology hg_mode_topology(enum hg_primitive_mode mode);
// Number of list indices that `count` indices of a mode expand to (incomplete ends are dropped).
uint64_t hg_mode_list_count(enum hg_primitive_mode mode, uint32_t count);
// Writes them; in NULL = 0, 1, 2, ... Strips keep the winding of their first triangle.
void hg_mode_expand(enum hg_primitive_mode mode, const uint32_t *in, uint32_t count, uint32_t *out);

// Flat normals for a triangle part without normals: every corner becomes its own vertex; morph
// targets get the change of the face normal. HG_E_NOMEM.
enum hg_status hg_part_make_flat_normals(
    struct hg_mesh_part *part, uint32_t target_count) HG_MUST_CHECK;

// Gives vertices whose normal has no length the mean of their triangles, weighted by areas, and +z
// where there is none. HG_E_NOMEM.
enum hg_status hg_part_fill_normals(struct hg_mesh_part *part) HG_MUST_CHECK;

// Smooth normals for a triangle part without normals and morph targets, with creases: triangles
// that share an edge are one surface where their planes meet at no more than HG_CREASE_DEG, and
// every vertex is split by surface. `smoothing` [index_count / 3], NULL: none; the surfaces are
// then those of equal numbers, whatever the angle, and 0 is flat. A normal is the mean of its
// triangles weighted by their angles there (Thuermer and Wuethrich 1998, "Computing Vertex Normals
// from Polygonal Facets"). Vertices are one where positions are equal, so that seams of colours and
// UVs do not show. HG_E_NOMEM. Cost O(n log k), k the most triangles at one vertex.
enum { HG_CREASE_DEG = 40 }; // a cylinder of 10 sides is round, a hexagonal nut is not
enum hg_status hg_part_make_crease_normals(
    struct hg_mesh_part *part, const uint32_t *smoothing) HG_MUST_CHECK;

// Normal deltas [vertex_count * 3] of a morph target of a triangle part with normals, from its
// position deltas: the change of the mean of the triangles around each vertex, weighted by their
// areas; vertices of one position and normal are one. HG_E_NOMEM. Cost O(n log n).
enum hg_status hg_part_make_target_normals(
    const struct hg_mesh_part *part, const float *positions, float *normals) HG_MUST_CHECK;

// Tangents as MikkTSpace makes them (Mikkelsen 2008, "Simulation of Wrinkled Surfaces Revisited"),
// from the positions, normals and uv[uv_set] of a triangle part; vertices are split where corners
// disagree. Needs that UV set. HG_E_NOMEM. Cost O(n).
enum hg_status hg_part_make_tangents(
    struct hg_mesh_part *part, uint32_t target_count, uint32_t uv_set) HG_MUST_CHECK;

#endif
