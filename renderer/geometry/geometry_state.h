// geometry_state.h - the geometry of a scene as its own files fill it and as culling reads it.
// Floor 2 (geometry). Thread: the render thread.
#ifndef HG_RENDERER_GEOMETRY_GEOMETRY_STATE_H
#define HG_RENDERER_GEOMETRY_GEOMETRY_STATE_H

#include "renderer/deform/deform.h"
#include "renderer/geometry/geometry.h"
#include "renderer/geometry/lod_intake.h"
#include "renderer/geometry/triangle_cache.h"
#include "renderer/lod/build_queue.h"
#include "renderer/math/matrix.h"
#include "renderer/mesh/gpu_array.h"
#include "renderer/mesh/mesh_entry.h"

// --- draw_tables.c (sync.h) ---
struct hg_draw_entry {
    uint64_t order; // sort key
    struct hg_gpu_draw gpu;
    struct hg_box bounds; // relative to the origin
    const struct hg_part_entry *part;
    const struct hg_node *node;
    const struct hg_material *material;
    uint32_t mesh_part, instance; // of the node
    bool skinned, deformed;
    const struct hg_deform_entry *deform; // until the next sync; NULL: not deformed
    uint32_t first_bit;                   // of its groups of meshlets in histories
    uint64_t caster;                      // hash of what its shadow follows from; 0: it throws none
};

static inline enum hg_draw_class hg_draw_class_of(uint32_t flags)
{
    return flags & HG_DRAW_BLEND  ? HG_DRAW_CLASS_BLEND
           : flags & HG_DRAW_MASK ? HG_DRAW_CLASS_MASK
                                  : HG_DRAW_CLASS_OPAQUE;
}

struct hg_deform_list {
    struct hg_deform_entry *items; // by node id, part
    size_t capacity;
    uint32_t count;
};

// Deforms to run before the next frame.
struct hg_deform_changes {
    uint32_t *items; // indices of deforms
    size_t capacity;
    uint32_t count;
};

// Where shadows changed with the newest commit (moved_casters.c).
#define HG_MOVED_MOST 64
struct hg_moved_casters {
    uint64_t since, revision; // shape revisions before and after
    struct hg_box boxes[HG_MOVED_MOST];
    uint32_t count; // more than HG_MOVED_MOST: anywhere
};

// What shaders read, and copies of it on the host.
struct hg_geometry_tables {
    struct hg_gpu_array draws, instances, parts, materials, lobes;
    uint32_t instance_count, part_count, material_count;
};

// Bits of the groups of meshlets of all draws, in histories.
struct hg_history_bits {
    uint64_t layout; // changes when bits mean something else
    uint32_t count;
};

// Keeps the largest sum of what is in use; called before anything is given back.
void hg_geometry_note_peak(struct hg_geometry *g);

struct hg_geometry {
    struct hg_gpu *gpu;
    struct hg_geometry_params params;
    double origin[3];
    struct hg_mesh_entry *meshes; // by id
    uint32_t mesh_count;
    struct hg_deform_list deforms;
    struct hg_deform_changes changed;
    struct hg_moved_casters moved;
    struct hg_draw_entry *draws; // in draw order
    uint32_t draw_count;
    struct hg_triangle_cache facets;
    struct hg_geometry_tables tables;
    uint64_t signature; // of the scene at the last sync, 0 = none
    uint64_t shape_signature;
    uint64_t revision, shape_revision;
    struct hg_cluster_pool *pool; // NULL: parts are not baked
    struct hg_lod_build_queue *baker;
    struct hg_history_bits bits;
    bool one_shape;  // of the textures of each material
    bool deform_all; // see pose_snapshot.h
    struct hg_box bounds;
    struct hg_geometry_stats stats;
};

static inline const struct hg_gpu_instance *hg_geometry_instances(const struct hg_geometry *g)
{
    return (const struct hg_gpu_instance *)(const void *)g->tables.instances.shadow;
}

#endif
