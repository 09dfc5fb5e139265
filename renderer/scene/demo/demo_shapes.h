// demo_shapes.h - shapes of the demo scene: grids, lathes, bevelled boxes, rings, arches.
// Floor 2, private to the demo. One thread per shape. Positions in metres, UVs in metres too, so
// that every surface shows a texture at its real size; failures stick to `failed`.
#ifndef HG_RENDERER_SCENE_DEMO_DEMO_SHAPES_H
#define HG_RENDERER_SCENE_DEMO_DEMO_SHAPES_H

#include "renderer/scene/scene.h"

struct hg_shape {
    float *positions, *normals, *uv; // [vertex_count * 3, 3, 2]
    uint32_t *indices;
    size_t position_capacity, normal_capacity, uv_capacity, index_capacity;
    uint32_t vertex_count, index_count;
    bool failed; // out of memory
};

void hg_shape_finish(struct hg_shape *shape);
// Moves the arrays into a part (bounds and tangents are the caller's).
enum hg_status hg_shape_to_part(struct hg_shape *shape, struct hg_mesh_part *part) HG_MUST_CHECK;

// A point of a surface over (s, t) in 0..1 x 0..1 and its UV.
typedef void hg_surface_fn(const void *user, float s, float t, float position[3], float uv[2]);
// Samples columns x rows quads; normals by central differences, pointing along dP/ds x dP/dt.
void hg_shape_add_grid(struct hg_shape *shape, uint32_t columns, uint32_t rows,
    hg_surface_fn *surface, const void *user);

// Box with rounded edges, centred.
void hg_shape_add_box(
    struct hg_shape *shape, const float center[3], const float size[3], float bevel);

struct hg_lathe {
    const float (*profile)[2]; // [count] radius, height; from the bottom up: normals point out
    uint32_t count, segments;
    uint32_t flutes;   // 0 = round
    float flute_depth; // share of the radius
    float center[3];
};
// Surface of revolution about +Y. A repeated profile point is a crease.
void hg_shape_add_lathe(struct hg_shape *shape, const struct hg_lathe *lathe);

void hg_shape_add_sphere(
    struct hg_shape *shape, const float center[3], float radius, uint32_t segments);
// Ring about +Y.
void hg_shape_add_torus(
    struct hg_shape *shape, const float center[3], float radius, float tube, uint32_t segments);
// Straight tube between two points, with round ends.
void hg_shape_add_rod(struct hg_shape *shape, const float a[3], const float b[3], float radius);

struct hg_arch {
    float bay, radius, spring, top, depth; // width of the bay, of the opening; heights; thickness
    float band;                            // thickness of the moulding around the opening
};
// One bay of an arcade in the xy plane, centred on x = 0 and z = 0.
void hg_shape_add_arch(struct hg_shape *shape, const struct hg_arch *arch);

#endif
