// view_fit.h - cameras that show the scene: those that a client asks for, and that of a view which
// was given none.
// Floor 6, private to server/worker. Thread: the render thread.
#ifndef HG_SERVER_WORKER_VIEW_VIEW_FIT_H
#define HG_SERVER_WORKER_VIEW_VIEW_FIT_H

#include "renderer/scene/scene.h"
#include "server/worker/request.h"

void hg_handle_view_fit(const struct request *r);

// Eye, target, up and lens of a view that a client has set none of: the whole scene in its rest
// pose, from the default direction. HG_E_NOMEM.
enum hg_status hg_view_fit_fill(const struct session *session, const struct view_slot *view,
    struct hg_view_camera *camera, struct hg_error *err) HG_MUST_CHECK;

// Tells the client of a request that a camera of the scene, which it has chosen, sees no geometry.
// The scene has been updated.
void hg_view_fit_note_blind(
    const struct request *r, const struct view_slot *view, uint64_t camera_node);

// A camera of the scene as view_fitted has it. The scene has been updated; out->revision stays.
void hg_view_fit_describe(const struct hg_node *node, struct hgp_view_fitted *out);

// Before a step and before the view's camera is read: brings a camera that depends on the scene up
// to date. That is one of a node, whose pose may have changed, and the default one: the scene's
// first camera that sees geometry, else the whole scene fitted; both by the rest pose of what is
// animated, so that an animation does not move the camera. A view whose node was removed, or has no
// camera any more, has the default one from then on.
enum hg_status hg_view_fit_follow(
    const struct session *session, struct view_slot *view, struct hg_error *err) HG_MUST_CHECK;

#endif
