// motion_blur.h - times of a picture: the frames before and after, the shutter intervals.
// Private to the room. Floor 3.5. Thread: the render thread.
#ifndef HG_RENDERER_PATHTRACE_MOTION_BLUR_H
#define HG_RENDERER_PATHTRACE_MOTION_BLUR_H

#include "renderer/geometry/pose_snapshot.h"
#include "renderer/light/lights.h"
#include "renderer/pathtrace/path.h"
#include "shaders/shared/path.h"

struct hg_motion_blur {
    struct hg_pose_snapshot *kept[HG_PATH_MOMENTS];     // created on first use
    struct hg_gpu_path_moment moments[HG_PATH_MOMENTS]; // for the block
    uint32_t parts;                // shutter intervals, a power of two; a pass samples one of them
    uint32_t part;                 // the interval that is posed
    struct hg_light_set lights[2]; // at the start and the end of the interval
};

void hg_motion_blur_destroy(struct hg_motion_blur *blur);
// Makes pose snapshots of the other times, before ray geometry is built. Afterwards the geometry
// may be in another pose than the scene. Resets path->options.
enum hg_status hg_motion_blur_begin(struct hg_path *path, struct hg_error *err) HG_MUST_CHECK;
// The pass samples another shutter interval than the one that is posed.
bool hg_motion_blur_passes(const struct hg_motion_blur *blur, uint32_t pass);
// Poses that interval; ray geometry must be rebuilt or refitted afterwards.
enum hg_status hg_motion_blur_open(struct hg_path *path, struct hg_error *err) HG_MUST_CHECK;

#endif
