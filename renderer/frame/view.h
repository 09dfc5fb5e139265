// view.h - one viewer of a scene.
// Floor 4. Thread: the render thread. Declared to callers in renderer/renderer.h.
#ifndef HG_RENDERER_FRAME_VIEW_H
#define HG_RENDERER_FRAME_VIEW_H

#include "base/refbuf.h"
#include "renderer/frame/state.h"

enum hg_status hg_view_state_init(struct hg_view_state *view, struct hg_frame_context *context,
    struct hg_scene *scene, struct hg_error *err) HG_MUST_CHECK;
void hg_view_state_finish(struct hg_view_state *view); // accepts a zeroed one

// HG_E_LIMIT when images of that size cannot be created; the old settings stay.
enum hg_status hg_view_state_set(struct hg_view_state *view,
    const struct hg_view_settings *settings, struct hg_error *err) HG_MUST_CHECK;
// The object that settings.look points to has changed.
void hg_view_state_note_look(struct hg_view_state *view);
// A new camera; the next step shows it.
void hg_view_state_look(struct hg_view_state *view, const struct hg_view_camera_state *camera);

// One slice: up to max_samples samples, in one batch. In motion (max_samples 1 and something has
// changed) stale shadow cascades are not drawn: the map of the whole scene stands in for them until
// the view rests, then accumulation starts with all of them. A sample in motion is written as RGBA8
// pixels at once where no other format is read (phase DIRECT, phase.h). Device errors, HG_E_NOMEM,
// HG_E_LIMIT.
enum hg_status hg_view_state_step(
    struct hg_view_state *view, uint32_t max_samples, struct hg_error *err) HG_MUST_CHECK;
// Whether nothing is left to do but to adapt the exposure.
bool hg_view_state_only_adapts(const struct hg_view_state *view);
bool hg_view_state_settled(const struct hg_view_state *view);
// Whether the planes of the newest real-time picture are there to be read.
bool hg_view_state_has_planes(const struct hg_view_state *view);
// Whether pixels of that format can be read; of a picture in motion only those of view->formats.
bool hg_view_state_has_pixels(const struct hg_view_state *view, uint32_t format);
// Copies or converts the result of the newest step; renders nothing. HG_E_STATE: see has_pixels.
// format index as in `pixels`; size in bytes of *out: width * height * bytes per pixel. lends:
// where nothing has to be copied it is not (hg_view_lend_pixels).
enum hg_status hg_view_state_read(struct hg_view_state *view, uint32_t format, bool lends,
    struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;
struct hg_gpu_pick;
// The surface point at the centre of pixel (x, y) of the whole picture, y downwards. Device errors.
enum hg_status hg_view_state_pick(struct hg_view_state *view, uint32_t x, uint32_t y,
    struct hg_gpu_pick *out, struct hg_error *err) HG_MUST_CHECK;
// The surface points of a rectangle inside of the picture. `row` is called for each of its rows,
// from the top, y counted from there. Triangles are numbered as on the device.
enum hg_status hg_view_state_surfaces(struct hg_view_state *view, VkRect2D pixels,
    void (*row)(void *user, uint32_t y, const struct hg_gpu_pick *pixels), void *user,
    struct hg_error *err) HG_MUST_CHECK;
// The surface points at the centres of a grid of equal cells over the whole picture, at most as
// many as it has pixels. Costs as much as a picture of that size.
enum hg_status hg_view_state_grid(struct hg_view_state *view, VkExtent2D cells,
    void (*row)(void *user, uint32_t y, const struct hg_gpu_pick *cells), void *user,
    struct hg_error *err) HG_MUST_CHECK;

#endif
