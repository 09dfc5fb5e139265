// gi_view.h - a view and the probes of its scene (renderer/gi/gi.h).
// Floor 4. Thread: the render thread.
//
// A view at rest is drawn with the field of rest, once that is complete; one in motion with it as
// well as long as the scene is what it is of, else with the moving field.
#ifndef HG_RENDERER_FRAME_GI_VIEW_H
#define HG_RENDERER_FRAME_GI_VIEW_H

#include "renderer/frame/state.h"

// Pictures have light from probes, and those are not refused for want of memory.
bool hg_gi_view_is_on(const struct hg_view_state *view);
// The view among those of its scene, as renderer/gi knows it.
uint64_t hg_gi_view_id(const struct hg_view_state *view);
// The field of rest is that of the scene as it is, and of the camera.
bool hg_gi_view_has_rest(const struct hg_view_state *view);
// How far indirect light has come; pictures of different stages do not add up.
enum hg_gi_view_stage {
    HG_GI_VIEW_MOVES, // off, or the moving field
    HG_GI_VIEW_FIELD, // the field of rest, and light is still to be gathered
    HG_GI_VIEW_DONE,  // as settled pictures have it
};
enum hg_gi_view_stage hg_gi_view_stage(const struct hg_view_state *view);
// Probe rays of the next picture in motion, as long as any are needed.
uint32_t hg_gi_view_rays(const struct hg_view_state *view);
// Nothing is missing of what a settled picture has; also when there is no indirect light.
bool hg_gi_view_is_done(const struct hg_view_state *view);
// After the sync, before culling. rests: what is drawn next is to stay; *waits: indirect light is
// not complete, and nothing is drawn in this step. A picture that is displayed is drawn once more
// with the field of rest before light is gathered.
enum hg_status hg_gi_view_step(
    struct hg_view_state *view, bool rests, bool *waits, struct hg_error *err) HG_MUST_CHECK;

#endif
