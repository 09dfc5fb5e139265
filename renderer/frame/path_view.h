// path_view.h - what a view asks of the path tracer, and what it does for it.
// Floor 4. Thread: the render thread.
#ifndef HG_RENDERER_FRAME_PATH_VIEW_H
#define HG_RENDERER_FRAME_PATH_VIEW_H

#include "renderer/frame/state.h"

// One slice of work, made on first use in view->path. draw: whether it waits (HG_DRAW_WAIT).
// begins: what was there counts no longer.
enum hg_status hg_path_view_step(struct hg_view_state *view, const struct hg_draw_request *draw,
    bool begins, struct hg_error *err) HG_MUST_CHECK;
// The view asks for other times than that of the pose, and something moves.
bool hg_path_view_needs_time(const struct hg_view_state *view);
// Brings what is there to targets.accumulated.
enum hg_status hg_path_view_show(struct hg_view_state *view, struct hg_error *err) HG_MUST_CHECK;
// The film that the view's planes are read from. HG_E_STATE: there is none of what is asked for
// now.
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
