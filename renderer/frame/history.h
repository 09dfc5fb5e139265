// history.h - the frame before, for passes that look back: camera, jitter, and where all nodes,
// skins and morphs were (shaders/shared/history.h). Floor 4. Thread: the render thread.
//
// Stored while `wanted`: the code that declares a pass which reads it sets that, and an override.
#ifndef HG_RENDERER_FRAME_HISTORY_H
#define HG_RENDERER_FRAME_HISTORY_H

#include "renderer/camera/camera.h"
#include "renderer/geometry/pose_snapshot.h"
#include "shaders/shared/history.h"

struct hg_draw;

struct hg_frame_history {
    bool wanted;
    bool has_camera;
    struct hg_camera_setup camera; // of the last sample, relative to `origin`
    double origin[3];
    struct hg_pose_snapshot *pose; // NULL = none
};

void hg_frame_history_finish(struct hg_frame_history *history); // before the geometry
// Invalidates the history: a new scene, an error.
void hg_frame_history_forget(struct hg_frame_history *history);
// After a batch that drew the newest frame: it is the one before from now on. No batch is open.
enum hg_status hg_frame_history_note(
    const struct hg_draw *draw, struct hg_error *err) HG_MUST_CHECK;
// For the frame that is drawn now.
void hg_frame_history_fill(const struct hg_draw *draw, struct hg_gpu_history *out);

#endif
