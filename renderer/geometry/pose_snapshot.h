// pose_snapshot.h - where everything is at one time, kept on the device while the scene moves on.
// Floor 2 (geometry). Thread: the render thread.
//
// A moment holds the matrices of all instances and what deformed parts have come to (positions,
// normals and tangents), by the numbers that instances and parts have then. These numbers stay the
// same as long as only poses change and hg_geometry_deform_all was said.
#ifndef HG_RENDERER_GEOMETRY_POSE_SNAPSHOT_H
#define HG_RENDERER_GEOMETRY_POSE_SNAPSHOT_H

#include "renderer/geometry/geometry.h"

struct hg_pose_snapshot;

// From the next sync on parts with morph targets are deformed also while all their weights are 0.
// True: this is new, and the geometry has to be synced.
bool hg_geometry_deform_all(struct hg_geometry *geometry);

// What the geometry shows now; deformations have run (hg_geometry_deforms_done), no batch is open.
// *moment: NULL, or one whose place it takes. HG_E_NOMEM, device errors; then it is not to be used.
enum hg_status hg_pose_snapshot_take(struct hg_geometry *geometry, struct hg_pose_snapshot **moment,
    struct hg_error *err) HG_MUST_CHECK;
void hg_pose_snapshot_free(struct hg_pose_snapshot *moment); // before the geometry; accepts NULL
void hg_pose_snapshot_fill(const struct hg_pose_snapshot *moment, struct hg_gpu_pose_snapshot *out);

#endif
