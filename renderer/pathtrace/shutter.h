// shutter.h - the scene and the camera of a view at other times than its pose.
// Floor 4. Thread: the render thread.
#ifndef HG_RENDERER_PATHTRACE_SHUTTER_H
#define HG_RENDERER_PATHTRACE_SHUTTER_H

#include "renderer/frame/state.h"
#include "renderer/light/lights.h"

// Camera of a node whose world matrix is up to date: along its -z, +y up.
void hg_shutter_look_along(const struct hg_node *node, float eye[3], float target[3], float up[3]);

// Whether anything that the view shows can move in time.
bool hg_shutter_moves(const struct hg_view_state *view);

// Brings the view's geometry to its pose `frames` later (or before), deformations included, until
// the next hg_scene_gpu_sync; the scene itself is then as it was. *camera: of that time. `who`: see
// hg_scene_gpu_pose. HG_E_NOMEM, HG_E_LIMIT, device errors.
enum hg_status hg_shutter_pose(struct hg_view_state *view, const void *who, double frames,
    struct hg_gpu_camera *camera, struct hg_error *err) HG_MUST_CHECK;
// The punctual lights of that time. HG_E_NOMEM.
enum hg_status hg_shutter_lights(struct hg_view_state *view, double frames,
    struct hg_light_set *lights, struct hg_error *err) HG_MUST_CHECK;

// Into how many parts of time, a power of two up to `most`, the time between two poses is to be cut
// so that motion is nearly a straight line in each: what turns, and what moves in curves or jumps,
// asks for more. HG_E_NOMEM.
enum hg_status hg_shutter_parts(struct hg_view_state *view, double open, double close,
    uint32_t most, uint32_t *parts, struct hg_error *err) HG_MUST_CHECK;

#endif
