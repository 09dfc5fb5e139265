// mesh.h - meshes of the benchmarks' scenes. Private to renderer/bench.
#ifndef HG_RENDERER_BENCH_MESH_H
#define HG_RENDERER_BENCH_MESH_H

#include "renderer/bench/scene.h"

// Smooth noise of one cell per unit, 0..1.
float hg_bench_noise(uint32_t seed, float x, float y);

// Parts of scene.c.
enum hg_status hg_bench_scene_begin(struct hg_bench_scene *scene, uint32_t tiles) HG_MUST_CHECK;
// A new object of the scene; out_ptr points to a pointer of its kind.
enum hg_status hg_bench_scene_add(
    struct hg_bench_scene *scene, enum hg_object_kind kind, void *out_ptr) HG_MUST_CHECK;
void hg_bench_scene_sky(struct hg_bench_scene *scene); // lights it and publishes

// A square in the plane z = 0 around the origin, uv (0, 0) at its upper left.
enum hg_status hg_bench_mesh_quad(struct hg_bench_scene *scene, float side_m,
    struct hg_material *material, struct hg_mesh **out) HG_MUST_CHECK;

// A box from its low to its high corner, seen from outside.
enum hg_status hg_bench_mesh_box(struct hg_bench_scene *scene, const float box[2][3],
    struct hg_material *material, struct hg_mesh **out) HG_MUST_CHECK;

// A grid of cells x cells over a square of side_m from the origin to +x and +z. height: metres at a
// place 0..1, from many threads.
struct hg_bench_grid {
    uint32_t cells;
    float side_m;
    float (*height)(const void *user, float u, float v);
    const void *user;
};
enum hg_status hg_bench_mesh_grid(struct hg_bench_scene *scene, const struct hg_bench_grid *grid,
    struct hg_material *material, struct hg_jobs *jobs, struct hg_mesh **out) HG_MUST_CHECK;
// A lumpy ball of radius 1 on the ground, 4 rings^2 triangles.
enum hg_status hg_bench_mesh_ball(struct hg_bench_scene *scene, uint32_t rings,
    struct hg_material *material, struct hg_mesh **out) HG_MUST_CHECK;

// Leaves about one triangle in `thin` of each part.
enum hg_status hg_bench_mesh_decimate(struct hg_mesh *mesh, uint32_t thin) HG_MUST_CHECK;

#endif
