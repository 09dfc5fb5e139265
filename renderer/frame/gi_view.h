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
// The field of rest is that of the scene as it is.
bool hg_gi_view_has_rest(const struct hg_view_state *view);
// As far as probes go the picture is that of rest.
bool hg_gi_view_is_done(const struct hg_view_state *view);
// After the sync, before culling. rests: what is drawn next is to stay; *waits: its field is not
// complete, and nothing is drawn in this step.
enum hg_status hg_gi_view_step(
    struct hg_view_state *view, bool rests, bool *waits, struct hg_error *err) HG_MUST_CHECK;

#endif
