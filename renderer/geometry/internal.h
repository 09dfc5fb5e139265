// internal.h - what the files of renderer/geometry/ share. Private to this room.
#ifndef HG_RENDERER_GEOMETRY_INTERNAL_H
#define HG_RENDERER_GEOMETRY_INTERNAL_H

#include "renderer/geometry/baker.h"
#include "renderer/geometry/cluster_mesh.h"
#include "renderer/geometry/meshlets.h"
#include "renderer/geometry/geometry.h"
#include "renderer/geometry/numbered.h"
#include "renderer/geometry/pack.h"
#include "renderer/geometry/posed.h"
#include "renderer/geometry/proxy.h"

struct hg_box {
    float min[3], max[3]; // empty: min > max
};

// --- box.c ---
struct hg_box hg_box_empty(void);
bool hg_box_is_empty(const struct hg_box *box);
void hg_box_add_point(struct hg_box *box, const float p[3]);
void hg_box_add(struct hg_box *box, const struct hg_box *other);
// Box of the box under a column-major affine matrix (double), a little larger than exact.
struct hg_box hg_box_transform(const struct hg_box *box, const double matrix[16]);
// c = a * b, column-major; c may be a.
void hg_matrix_multiply(const double a[16], const double b[16], double c[16]);
void hg_matrix_from_float(const float m[16], double out[16]);
double hg_matrix_determinant3(const double m[16]);
void hg_matrix_store4x3(const double m[16], struct hg_mat4x3 *out);

// --- table.c: an array on the device, of which only what differs is written ---
struct hg_table {
    const char *name;
    struct hg_gpu_buffer buffer;
    uint8_t *shadow; // what the device has
    size_t capacity; // bytes of shadow
    uint64_t size_bytes;
};
void hg_table_finish(struct hg_gpu *gpu, struct hg_table *table);
// Adds the bytes written to *written. On failure the table is empty, so that all is written next.
enum hg_status hg_table_write(struct hg_gpu *gpu, struct hg_table *table, const void *data,
    uint64_t size_bytes, uint64_t *written, struct hg_error *err) HG_MUST_CHECK;

// --- meshes.c: parts that do not change ---
struct hg_part_entry {
    struct hg_pack_layout layout;
    struct hg_gpu_buffer buffer;
    uint32_t vertex_count, index_count, primitive_count, joint_sets;
    struct hg_box bounds;       // rest pose, of what is shown
    struct hg_box own_bounds;   // of the part, also where a proxy reaches beyond
    struct hg_box *joint_boxes; // [joint_box_count] of the vertices that a joint moves
    struct hg_box *morph_boxes; // [target_count] of the deltas
    uint32_t joint_box_count;
    struct hg_gpu_morph *morphs;     // [target_count], weight 0
    uint32_t index;                  // in the part list of the device
    struct hg_meshlet_list meshlets; // of triangles
    const uint32_t *indices;         // in the order of the device; on it, or `host_indices`
    uint32_t *host_indices;
    // The list of numbered.h, on the device behind the other streams. Only its indices stay here.
    struct hg_numbered numbered;
    const uint32_t *numbered_indices;            // once it is on the device; NULL: there is none
    uint64_t numbered_at, numbered_positions_at; // bytes
    struct hg_posed_levels posed;                // of skinned and morphed ones
    struct hg_cluster_mesh *clusters; // levels of detail: then there are no streams of its own
    struct hg_mesh_part *proxy; // what the streams hold until there are levels; NULL: the part
    bool baking, unbaked;       // unbaked: it has a proxy and gets no levels
};

// Primitives of all levels: what a visibility buffer may name.
static inline uint32_t hg_part_primitives(const struct hg_part_entry *part)
{
    return part->primitive_count + part->posed.index_count / 3;
}

struct hg_mesh_entry {
    uint64_t id, revision;
    struct hg_part_entry *parts;
    uint32_t part_count, target_count;
    uint64_t bytes;             // of all parts
    const struct hg_mesh *mesh; // set by every sync
    bool is_new;                // not part of the lists before this sync
};
struct hg_mesh_entry_limits {
    uint32_t number_below;   // parts of fewer triangles have a numbered list too
    uint32_t meshlets_below; // others get meshlets when they are uploaded
};
// Lists of them are by id. NULL: it is not there.
void hg_mesh_entry_sort(struct hg_mesh_entry *list, uint32_t count);
struct hg_mesh_entry *hg_mesh_entry_find(struct hg_mesh_entry *list, uint32_t count, uint64_t id);
// Sizes and bounds, nothing on the device yet.
enum hg_status hg_mesh_entry_init(struct hg_mesh_entry *entry, const struct hg_mesh *mesh,
    const struct hg_mesh_entry_limits *limits, struct hg_error *err) HG_MUST_CHECK;
// A part that is not on the device yet is shown by a proxy of at most `triangles`. HG_E_NOMEM.
enum hg_status hg_mesh_entry_set_proxy(
    struct hg_mesh_entry *entry, uint32_t index, uint32_t triangles) HG_MUST_CHECK;
// A part that is shown by a proxy is shown as it is; a failure leaves it so. Sets err.
enum hg_status hg_mesh_entry_drop_proxy(struct hg_gpu *gpu, struct hg_mesh_entry *entry,
    uint32_t index, uint64_t *written, struct hg_error *err) HG_MUST_CHECK;
// What is not on the device yet.
enum hg_status hg_mesh_entry_upload(struct hg_gpu *gpu, struct hg_mesh_entry *entry,
    const struct hg_mesh *mesh, uint64_t *written, struct hg_error *err) HG_MUST_CHECK;
void hg_mesh_entry_finish(
    struct hg_gpu *gpu, struct hg_cluster_pool *pool, struct hg_mesh_entry *entry);

// --- baked.c ---
// Queues parts of many triangles for baking; brings finished ones into their entries (true when
// there were some). Waits for all of them, at most until that time of hg_clock_now_ns.
void hg_baked_queue(struct hg_geometry *g, struct hg_mesh_entry *meshes, uint32_t count);
// Gives proxies to parts that are being baked and are not on the device yet, of a size that fits.
//   used_bytes   what all takes as it is
// HG_E_NOMEM.
enum hg_status hg_baked_show_proxies(struct hg_geometry *g, struct hg_mesh_entry *meshes,
    uint32_t count, uint64_t used_bytes) HG_MUST_CHECK;
// Bytes of parts that have a proxy until they would be baked, and could not be; and of the proxies.
uint64_t hg_baked_lost_bytes(
    const struct hg_mesh_entry *meshes, uint32_t count, uint64_t *proxy_bytes);
// Shows them as they are: there is room now.
enum hg_status hg_baked_drop_proxies(struct hg_geometry *g, struct hg_mesh_entry *meshes,
    uint32_t count, uint64_t *written, struct hg_error *err) HG_MUST_CHECK;
// Triangles from which parts are baked; UINT32_MAX: none are.
uint32_t hg_baked_from(const struct hg_geometry *g);
// The triangle of a part nearest to a point of the space that `world` leads to; 0 when it has none.
uint32_t hg_baked_nearest(
    const struct hg_mesh_part *part, const struct hg_mat4x3 *world, const float point[3]);
bool hg_baked_collect(
    struct hg_geometry *g, struct hg_mesh_entry *meshes, uint32_t count, uint64_t until_ns);

// --- geometry.c: keeps the largest sum of what is in use; before anything is given back ---
void hg_geometry_note_peak(struct hg_geometry *g);

// --- deform.c: one part of one skinned or morphed node ---
struct hg_deform_entry {
    uint64_t node, mesh, mesh_revision;
    uint32_t part;
    uint32_t joint_count, target_count, vertex_count;
    const struct hg_part_entry *source; // set by every sync
    struct hg_gpu_buffer output;        // positions, then vertices
    struct hg_gpu_buffer params;        // hg_gpu_deform, matrices, morph list
    uint64_t vertices_offset, matrices_offset, morphs_offset, params_bytes, output_bytes;
    uint8_t *pose;        // what params holds, params_bytes
    double anchor[3];     // world position that the output is relative to (skinned), else 0
    struct hg_box bounds; // of the output, relative to the anchor or in object space
    float level_errors[HG_POSED_LEVELS]; // of the source's levels in this pose, as the output
    bool changed;                        // the device has not run it for this pose
    uint32_t index;                      // in the part list of the device
    const struct hg_node *node_object;   // set by every sync
    bool is_new;
};
bool hg_deform_is_needed(const struct hg_node *node);
void hg_deform_init(struct hg_deform_entry *entry, const struct hg_node *node, uint32_t part,
    const struct hg_mesh_entry *mesh);
uint64_t hg_deform_bytes(const struct hg_deform_entry *entry);
// Allocates on first use, and writes the pose where it differs.
enum hg_status hg_deform_update(struct hg_gpu *gpu, struct hg_deform_entry *entry,
    const struct hg_node *node, uint64_t *written, struct hg_error *err) HG_MUST_CHECK;
void hg_deform_finish(struct hg_gpu *gpu, struct hg_deform_entry *entry);

// --- materials.c ---
// False when it has textures of more than one shape.
bool hg_material_pack(const struct hg_material *material, const struct hg_textures *textures,
    struct hg_gpu_material *out);
// The second record, of materials with hg_material_features (geometry.h).
void hg_material_pack_lobes(const struct hg_material *material, const struct hg_textures *textures,
    struct hg_gpu_lobes *out);

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
};

static inline enum hg_draw_class hg_draw_class_of(uint32_t flags)
{
    return flags & HG_DRAW_BLEND  ? HG_DRAW_CLASS_BLEND
           : flags & HG_DRAW_MASK ? HG_DRAW_CLASS_MASK
                                  : HG_DRAW_CLASS_OPAQUE;
}

// --- facets.c ---
struct hg_facets {
    struct hg_gpu_buffer buffer;
    struct hg_table first;      // [draws]
    uint32_t *firsts;           // what it will hold
    uint64_t *keys, *next_keys; // [draws] what the buffer holds, 0 = nothing; what it will
    struct hg_facet_job *jobs;
    size_t first_capacity, key_capacity, next_capacity, job_capacity;
    uint32_t job_count;
    uint64_t revision; // of the geometry at the last sync
    bool wanted;
};
void hg_facets_finish(struct hg_gpu *gpu, struct hg_facets *facets);

struct hg_geometry {
    struct hg_gpu *gpu;
    struct hg_geometry_params params;
    double origin[3];
    struct hg_mesh_entry *meshes; // by id
    uint32_t mesh_count;
    struct hg_deform_entry *deforms; // by node id, part
    size_t deform_capacity;
    uint32_t deform_count;
    uint32_t *changed; // indices of deforms to run
    size_t changed_capacity;
    uint32_t changed_count;
    struct hg_draw_entry *draws; // in draw order
    uint32_t draw_count;
    struct hg_facets facets;
    struct hg_table draw_table, instance_table, part_table, material_table, lobe_table;
    uint32_t instance_count, part_count, material_count;
    uint64_t signature; // of the scene at the last sync, 0 = none
    uint64_t shape_signature;
    uint64_t revision, shape_revision;
    struct hg_cluster_pool *pool; // NULL: parts are not baked
    struct hg_baker *baker;
    uint64_t bit_layout; // changes when bits of histories mean something else
    uint32_t bit_count;
    bool one_shape;  // of the textures of each material
    bool deform_all; // see moment.h
    struct hg_box bounds;
    struct hg_geometry_stats stats;
};

#endif
