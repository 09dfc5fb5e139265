// motion_blur.h - times of a picture: the frames before and after, the parts of the shutter's time.
// Private to the room. Floor 3.5. Thread: the render thread.
#ifndef HG_RENDERER_PATHTRACE_MOTION_BLUR_H
#define HG_RENDERER_PATHTRACE_MOTION_BLUR_H

#include "renderer/geometry/pose_snapshot.h"
#include "renderer/light/lights.h"
#include "renderer/pathtrace/path.h"
#include "shaders/shared/path.h"

struct hg_motion_blur {
    struct hg_pose_snapshot *kept[HG_PATH_MOMENTS];     // made when first asked for
    struct hg_gpu_path_moment moments[HG_PATH_MOMENTS]; // for the block
    uint32_t parts;                // of the shutter's time: a power of two. A pass has one of them
    uint32_t part;                 // what is posed
    struct hg_light_set lights[2]; // when that part of the time begins, when it ends
};

void hg_motion_blur_destroy(struct hg_motion_blur *blur);
// Where things are at other times than the pose, before ray geometry is made; the geometry may be
// posed otherwise than the scene afterwards. Sets all of path->options anew.
enum hg_status hg_motion_blur_begin(struct hg_path *path, struct hg_error *err) HG_MUST_CHECK;
// The part of the shutter's time of that pass is another one than is posed.
bool hg_motion_blur_passes(const struct hg_motion_blur *blur, uint32_t pass);
// Poses it: ray geometry has to be made anew.
enum hg_status hg_motion_blur_open(struct hg_path *path, struct hg_error *err) HG_MUST_CHECK;

#endif
