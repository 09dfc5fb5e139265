// deform.h - one part of one skinned or morphed node: its pose, and its vertices in that pose.
// Floor 2 (deform). Thread: the render thread. The work is done by passes/skin.comp.
#ifndef HG_RENDERER_DEFORM_DEFORM_H
#define HG_RENDERER_DEFORM_DEFORM_H

#include "renderer/mesh/mesh_entry.h"

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
    float level_errors[HG_SKINNED_LOD_LEVELS]; // of the source's levels in this pose, as the output
    bool mirrored;                             // by its joints: winding is reversed
    bool changed;                              // the device has not run it for this pose
    uint32_t index;                            // in the part list of the device
    const struct hg_node *node_object;         // set by every sync
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

#endif
