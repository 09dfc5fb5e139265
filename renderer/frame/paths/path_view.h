// path_view.h - connects a view and the path tracer.
// Floor 4. Thread: the render thread.
#ifndef HG_RENDERER_FRAME_PATHS_PATH_VIEW_H
#define HG_RENDERER_FRAME_PATHS_PATH_VIEW_H

#include "renderer/frame/state.h"

// One slice of work on view->path, which is made on first use; nothing of the real-time picture
// changes. draw: whether it waits (HG_DRAW_WAIT). begins: the film restarts. *changes: how often
// the film changed.
enum hg_status hg_path_view_step(struct hg_view_state *view, const struct hg_draw_request *draw,
    bool begins, uint64_t *changes, struct hg_error *err) HG_MUST_CHECK;
// A path with the callbacks of this view, where there is none yet. HG_E_NOMEM.
enum hg_status hg_path_view_create(
    struct hg_view_state *view, struct hg_path **path, struct hg_error *err) HG_MUST_CHECK;
// The same of the picture that is metered (view->exposure.metering), whose film takes the place of
// the view's.
enum hg_status hg_path_view_meter(struct hg_view_state *view, const struct hg_draw_request *draw,
    bool begins, struct hg_error *err) HG_MUST_CHECK;
// The camera that its paths start from: with the lens of a sensor and an f-number.
struct hg_view_camera_state hg_path_view_camera(const struct hg_view_state *view);
// The view needs other times than that of the pose, and something moves.
bool hg_path_view_needs_time(const struct hg_view_state *view);
// Writes the film to targets.accumulated.
enum hg_status hg_path_view_show(struct hg_view_state *view, struct hg_error *err) HG_MUST_CHECK;
// The film that the view's planes are read from. HG_E_STATE: there is none for the current state.
enum hg_status hg_path_view_film(
    const struct hg_view_state *view, struct hg_path **out, struct hg_error *err) HG_MUST_CHECK;

// Checkpoints and histories (renderer.h). Load: takes effect with the next step.
enum hg_status hg_path_view_save(
    struct hg_view_state *view, struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_path_view_load(struct hg_view_state *view, const void *data, uint64_t size_bytes,
    struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_path_view_history_save(
    struct hg_view_state *view, struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;
enum hg_status hg_path_view_history_load(struct hg_view_state *view, const void *data,
    uint64_t size_bytes, struct hg_error *err) HG_MUST_CHECK;

#endif
