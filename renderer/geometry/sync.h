// sync.h - the lists of one sync of a scene, from nodes to tables of the device. Private to sync.c
// and draw_tables.c.
#ifndef HG_RENDERER_GEOMETRY_SYNC_H
#define HG_RENDERER_GEOMETRY_SYNC_H

#include "renderer/geometry/geometry_state.h"

struct hg_material_index {
    uint64_t id;
    uint32_t index;
};

struct hg_sync_materials {
    struct hg_gpu_material *items; // [0] is the default material
    struct hg_material_index *ids; // of the others
    uint32_t count;
    struct hg_gpu_lobes *lobes; // of the materials that have some
    uint32_t lobe_count;
    bool one_shape; // of the textures of each material
};

struct hg_sync {
    struct hg_geometry *g;
    const struct hg_scene *scene;
    const struct hg_textures *textures;
    struct hg_mesh_entry *meshes; // the new list by id; entries that stay share their memory with g
    uint32_t mesh_count;
    struct hg_deform_list deforms; // likewise
    struct hg_sync_materials materials;
    struct hg_gpu_instance *instances;
    uint32_t instance_count, instance_limit;
    struct hg_draw_entry *draws;
    uint32_t draw_count, draw_limit;
    struct hg_gpu_part *parts;
    uint32_t part_count;
    struct hg_gpu_draw *gpu_draws;
    struct hg_box bounds;
    struct hg_history_bits bits;
    uint64_t material; // signature of the materials: of masks
    uint64_t written, triangles, used_bytes;
    uint32_t uploads;
    bool looks;         // at arrays of meshes, which may be spilled
    bool drops_proxies; // of parts that get no levels: there is room for them
};

// In a list by node id and part. NULL: it is not there.
struct hg_deform_entry *hg_sync_find_deform(
    const struct hg_deform_list *list, uint64_t node, uint32_t part);

// --- moved_casters.c ---
// Compares the draws of a sync with those before it, which are still the geometry's.
void hg_moved_casters_note(struct hg_sync *sync);

// --- draw_tables.c: parts, materials, instances and draws ---
// Fills the tables from the lists; the meshes are on the device. HG_E_NOMEM.
enum hg_status hg_draw_tables_make(struct hg_sync *sync, struct hg_error *err) HG_MUST_CHECK;
// Writes what differs. HG_E_NOMEM, device errors.
enum hg_status hg_draw_tables_write(struct hg_sync *sync, struct hg_error *err) HG_MUST_CHECK;
void hg_draw_tables_finish(struct hg_sync *sync);

#endif
