// shutter.h - the scene and a camera at other times than the scene's pose.
// Floor 3.5. Thread: the render thread.
#ifndef HG_RENDERER_PATHTRACE_SHUTTER_H
#define HG_RENDERER_PATHTRACE_SHUTTER_H

#include "renderer/light/lights.h"
#include "renderer/scene_gpu/scene_gpu.h"

// The scene that is posed, and the camera.
struct hg_shutter {
    struct hg_gpu *gpu;
    struct hg_scene_gpu *scene_gpu;
    const struct hg_view_camera_state *camera;
    uint32_t width, height; // px
    float frame_s;          // from one frame to the next
    const void *who;        // identifies the caller: hg_scene_gpu_pose
};

// Camera of a node whose world matrix is current: looks along -z, +y up.
void hg_shutter_look_along(const struct hg_node *node, float eye[3], float target[3], float up[3]);

// Poses the geometry `frames` later (or earlier), deformations included, until the next
// hg_scene_gpu_sync; the scene itself is unchanged afterwards. *camera: at that time. HG_E_NOMEM,
// HG_E_LIMIT, device errors.
enum hg_status hg_shutter_pose(const struct hg_shutter *shutter, double frames,
    struct hg_gpu_camera *camera, struct hg_error *err) HG_MUST_CHECK;
// The punctual lights of that time. HG_E_NOMEM.
enum hg_status hg_shutter_lights(const struct hg_shutter *shutter, double frames,
    struct hg_light_set *lights, struct hg_error *err) HG_MUST_CHECK;

struct hg_shutter_span {
    double open, close; // frames from the pose
    uint32_t most;      // parts, a power of two
};
// Number of shutter intervals, a power of two, so that motion is nearly linear within each:
// rotation and curved or discontinuous motion need more. HG_E_NOMEM.
enum hg_status hg_shutter_parts(const struct hg_shutter *shutter,
    const struct hg_shutter_span *span, uint32_t *parts, struct hg_error *err) HG_MUST_CHECK;

#endif
