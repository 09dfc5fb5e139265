// mesh_entry.h - mesh parts on the device: parts that do not change.
// Floor 2 (mesh). Thread: the render thread.
#ifndef HG_RENDERER_MESH_MESH_ENTRY_H
#define HG_RENDERER_MESH_MESH_ENTRY_H

#include "renderer/cluster/cluster_mesh.h"
#include "renderer/lod/discs.h"
#include "renderer/lod/proxy_mesh.h"
#include "renderer/lod/skinned_lod.h"
#include "renderer/lod/vertex_pack.h"
#include "renderer/math/box.h"
#include "renderer/mesh/meshlets.h"
#include "renderer/mesh/provoking_vertex.h"
#include "shaders/shared/geometry.h"

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
    // The list of provoking_vertex.h, on the device behind the other streams. Only its indices stay
    // here.
    struct hg_provoking numbered;
    const uint32_t *numbered_indices;            // once it is on the device; NULL: there is none
    struct {
        uint64_t indices, positions; // bytes
    } numbered_at;
    struct hg_skinned_lod_levels posed;          // of skinned and morphed ones
    struct hg_cluster_mesh *clusters; // levels of detail: then there are no streams of its own
    struct hg_mesh_part *proxy; // what the streams hold until there are levels; NULL: the part
    struct hg_mesh_part *discs; // what they hold of a part of points; NULL: it has none, or levels
    bool baking, unbaked;       // unbaked: it has a proxy and gets no levels
};

// Bytes of the part as it is, without levels or proxy.
uint64_t hg_part_whole_bytes(const struct hg_mesh_part *part);
// Primitives of the source by which parts are large or small: triangles, lines, points.
static inline uint32_t hg_part_source_primitives(const struct hg_mesh_part *part)
{
    return part->index_count / (part->topology == HG_TOPOLOGY_POINTS     ? 1
                                   : part->topology == HG_TOPOLOGY_LINES ? 2
                                                                         : 3);
}

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
    uint32_t meshlets_below; // others get meshlets when they are uploaded, and points a proxy
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

#endif
