// temporal_view.h - pictures of a moving view that are made of several (renderer/temporal).
// Floor 4. Thread: the render thread.
//
// Only pictures of phase DIRECT are; settled ones do not depend on anything here. The history
// depends on the sequence of such pictures alone. What is asked of the device besides a picture
// goes to buffers.motion: depth, then, if something moved by itself, the visibility buffer, then
// where posed surfaces were.
#ifndef HG_RENDERER_FRAME_TEMPORAL_VIEW_H
#define HG_RENDERER_FRAME_TEMPORAL_VIEW_H

#include "renderer/camera/camera.h"
#include "renderer/frame/targets.h"
#include "renderer/geometry/motion_table.h"
#include "renderer/geometry/pose_snapshot.h"
#include "renderer/temporal/temporal.h"

struct hg_view_state;
struct hg_draw;
struct hg_draw_request;

// From one picture in motion to the next.
struct hg_temporal_view {
    struct hg_temporal *history;   // NULL = none
    struct hg_view_targets targets; // of pictures that are drawn smaller; made when first needed
    uint8_t *pixels;               // [height][width][4] of the newest picture
    struct hg_camera_setup camera; // of the picture before, relative to `origin`, without jitter
    double origin[3];
    struct hg_motion_table places;
    struct hg_pose_snapshot *pose; // posed vertices of the picture before; NULL: not known
    VkRect2D posed;                // pixels of the next picture that may show some; empty: none do
    uint64_t settings; // revision that the history is of
    uint64_t scene;    // revision of the poses in it
    VkExtent2D drawn;  // size of the newest picture; zero: of none yet
    uint32_t moment;   // number of the newest picture, from 1
    struct hg_temporal_stats stats;
    float *motion; // vectors of the newest picture, as of hg_temporal_motion; NULL unless an
                   // override keeps them
};

// Before the geometry; accepts a zeroed one.
void hg_temporal_view_finish(struct hg_gpu *gpu, struct hg_temporal_view *temporal);
void hg_temporal_view_forget(struct hg_temporal_view *temporal);
// Before a picture in motion is culled, of a synced scene: where its sample lies, and what is to be
// read back. Leaves the request as it is where the settings want no such pictures.
void hg_temporal_view_begin(struct hg_view_state *view, struct hg_draw_request *request);
// Then, if it is drawn smaller: what it is drawn to, and with which light. HG_E_NOMEM, device
// errors.
enum hg_status hg_temporal_view_targets(
    struct hg_view_state *view, struct hg_draw *draw, struct hg_error *err) HG_MUST_CHECK;
// After the batch: `readback` has the picture. HG_E_NOMEM.
enum hg_status hg_temporal_view_resolve(
    struct hg_view_state *view, struct hg_draw *draw, struct hg_error *err) HG_MUST_CHECK;
// Then the debug view of shadow pages in place of the picture.
void hg_temporal_view_show_pages(struct hg_view_state *view, const struct hg_draw *draw);

#endif
