// gather_view.h - light that is gathered per pixel for a picture at rest
// (renderer/gather/gather.h). Floor 4. Thread: the render thread.
//
// Once the settled field is complete, paths from every pixel bring what surfaces around it send
// back (hg_path_request.gather), and end in that field. What they brought is filtered once, and all
// samples of the picture are shaded with it. It is a function of the scene, the settings and the
// camera.
#ifndef HG_RENDERER_FRAME_LIGHT_GATHER_VIEW_H
#define HG_RENDERER_FRAME_LIGHT_GATHER_VIEW_H

#include "renderer/frame/state.h"

// Identifies the present state of the view; settled field and gathered light are valid for one.
struct hg_gather_key hg_gather_view_key(const struct hg_view_state *view);
void hg_gather_view_finish(struct hg_view_state *view);
// Whether light was gathered for the present state of the view.
bool hg_gather_view_is_done(const struct hg_view_state *view);
// One slice of gathering, between batches, once the settled field is complete. HG_E_LIMIT,
// HG_E_NOMEM, HG_E_UNSUPPORTED: the view cannot gather; device errors.
enum hg_status hg_gather_view_step(struct hg_view_state *view, struct hg_error *err) HG_MUST_CHECK;

#endif
