// gi_view.h - a view and the probes of its scene (renderer/gi/gi.h).
// Floor 4. Thread: the render thread.
//
// A view at rest is drawn with the settled field once that is complete. A view in motion uses the
// settled field while that is of the scene as it is, else the dynamic field.
#ifndef HG_RENDERER_FRAME_LIGHT_GI_VIEW_H
#define HG_RENDERER_FRAME_LIGHT_GI_VIEW_H

#include "renderer/frame/state.h"

// Number of the view among those of its scene, by which renderer/gi knows its camera.
uint64_t hg_gi_view_id(const struct hg_view_state *view);
// Whether the settled field is complete for the scene as it is and for the camera.
bool hg_gi_view_has_settled(const struct hg_view_state *view);
// How far indirect light has come; pictures of different stages do not add up.
enum hg_gi_view_stage {
    HG_GI_VIEW_DYNAMIC, // off, or the dynamic field
    HG_GI_VIEW_SETTLED, // the settled field, and light is still to be gathered
    HG_GI_VIEW_DONE,    // as settled pictures have it
};
enum hg_gi_view_stage hg_gi_view_stage(const struct hg_view_state *view);
// Probe rays of the next picture in motion, as long as any are needed.
uint32_t hg_gi_view_rays(const struct hg_view_state *view);
// Nothing is missing of what a settled picture has; also when there is no indirect light.
bool hg_gi_view_is_done(const struct hg_view_state *view);
// After the sync, before culling. rests: what is drawn next is to stay; *waits: indirect light is
// not complete, and nothing is drawn in this step. A picture that is displayed is drawn once more
// with the settled field before light is gathered.
enum hg_status hg_gi_view_step(
    struct hg_view_state *view, bool rests, bool *waits, struct hg_error *err) HG_MUST_CHECK;

#endif
