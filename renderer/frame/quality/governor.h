// governor.h - the quality governor (quality.h) of a view: what its pictures in motion are drawn
// with. Floor 4. Thread: the render thread.
#ifndef HG_RENDERER_FRAME_QUALITY_GOVERNOR_H
#define HG_RENDERER_FRAME_QUALITY_GOVERNOR_H

#include "renderer/frame/state.h"

// Of the next picture in motion; full quality once the view has come to rest.
struct hg_quality_choice hg_governor_choice(const struct hg_view_state *view);
// After a step in motion: where its time went.
void hg_governor_note(struct hg_view_state *view);

#endif
