// meter.h - automatic exposure of a view: the picture that is metered.
// Floor 4. Thread: the render thread.
//
// One value for a scene, its environment and a camera: it is metered on a path-traced picture of
// HG_METER_SIDE_PX along the longer side with a seed of its own, of the whole frame and without
// background, whatever mode, size, samples and seed the view has. The path tracer of the view makes
// it (path.h, `aside`), so ray structures are built once.
#ifndef HG_RENDERER_FRAME_EXPOSURE_METER_H
#define HG_RENDERER_FRAME_EXPOSURE_METER_H

#include "renderer/frame/state.h"

#define HG_METER_SIDE_PX 64
#define HG_METER_SPLIT   4 // a metered pixel is the mean of so many by so many, of one sample each
#define HG_METER_BOUNCES 6

// ev: the exposure, or what is added to the metered one, which is that of the last metering.
void hg_meter_set(struct hg_view_state *view, bool automatic, float ev);
// Stops of the picture that is shown.
float hg_meter_ev(const struct hg_view_state *view);
// Moves the exposure that is shown towards the metered one, by the time since the last step. rests:
// nothing else is left to do and steps may follow at once, so each counts as one frame. The picture
// is not touched: it is linear until it is read.
void hg_meter_adapt(struct hg_view_state *view, bool rests);
// What is shown has not arrived at what was metered yet.
bool hg_meter_is_adapting(const struct hg_view_state *view);
// The camera changes to *next. A cut (a large turn) makes the next metered value count at once.
void hg_meter_note_camera(struct hg_view_state *view, const struct hg_view_camera_state *next);
// Whether the view waits for a value of what it shows now. False: its exposure is stated, or
// metered.
bool hg_meter_is_due(const struct hg_view_state *view);
// Whether the last value metered at rest is of the scene as it is now.
bool hg_meter_is_of_scene(const struct hg_view_state *view);
// Whether a metering for what the view shows now has begun.
bool hg_meter_has_begun(const struct hg_view_state *view);
// One slice of metering, of a synced scene. It replaces the film of the view, which restarts
// afterwards. What cannot be path-traced, for lack of memory, is shown with exposure 0, and the log
// says so.
enum hg_status hg_meter_step(struct hg_view_state *view, const struct hg_draw_request *draw,
    struct hg_error *err) HG_MUST_CHECK;
// Frees the path tracer of a final real-time picture once that is metered. Others keep theirs, with
// its ray structures, for the next picture that is metered.
void hg_meter_let_go(struct hg_view_state *view);
// Shared with motion_meter.h: a size of the view's shape with that longer side, the light of an
// updated sky's sun in stops, and a metered value, which the view then adapts to or takes.
void hg_meter_size(
    const struct hg_view_settings *settings, double side_px, uint32_t *width, uint32_t *height);
double hg_meter_sun_stops(const struct hg_scene *scene);
void hg_meter_take(struct hg_view_state *view, float ev);

#endif
