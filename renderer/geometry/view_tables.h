// view_tables.h - draws and materials as one view shows them: some hidden, tinted, seen through or
// with the materials of another variant.
// Floor 2 (geometry). Thread: the render thread.
//
// A view without any of that has no tables and uses those of the scene. One with them has its own
// list of draws (16 bytes each) and of materials (240 bytes each: those of the scene, then one for
// each distinct change of one); parts, instances, vertices and textures are the scene's.
#ifndef HG_RENDERER_GEOMETRY_VIEW_TABLES_H
#define HG_RENDERER_GEOMETRY_VIEW_TABLES_H

#include "renderer/geometry/geometry.h"
#include "renderer/mesh/gpu_array.h"

// How a view shows one draw.
struct hg_draw_look {
    bool hidden;
    float tint[4]; // linear colour, and strength 0..1 with which it takes the base colour's place
    float alpha;   // times the material's; below 1: what is behind it is seen
    bool has_material;
    const struct hg_material *material; // with has_material: in place of the scene's; NULL: default
};

struct hg_view_tables {        // zeroed = none
    struct hg_gpu_draw *draws; // [draw_count] as on the device
    size_t draw_capacity;
    uint32_t draw_count, material_count;
    bool sees_through; // some surface that the scene draws as opaque is blended
    struct hg_gpu_array draw_array, material_array;
};

// Says how draws are shown; out has the look of the scene.
struct hg_draw_looks {
    void (*look)(void *user, const struct hg_draw_info *draw, struct hg_draw_look *out);
    void *user;
};

// Makes the tables for the geometry as it was synced last. HG_E_NOMEM, device errors.
enum hg_status hg_view_tables_make(struct hg_view_tables *tables,
    const struct hg_geometry *geometry, const struct hg_scene *scene,
    const struct hg_draw_looks *looks, struct hg_error *err) HG_MUST_CHECK;
// In place of the scene's, in what hg_geometry_fill has filled.
void hg_view_tables_fill(const struct hg_view_tables *tables, struct hg_gpu_geometry *out);
// Base colour of a draw's material without its texture, as the view shows it; linear.
void hg_view_tables_base_color(const struct hg_view_tables *tables,
    const struct hg_geometry *geometry, uint32_t draw, float color[3]);
uint64_t hg_view_tables_bytes(const struct hg_view_tables *tables); // on the device
void hg_view_tables_finish(struct hg_gpu *gpu, struct hg_view_tables *tables);

#endif
