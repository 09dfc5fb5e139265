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
// What settings.look points to is another one now.
void hg_view_state_note_look(struct hg_view_state *view);
void hg_view_state_look(struct hg_view_state *view, const struct hg_view_camera_state *camera);

// One slice: up to max_samples samples, in one batch. In motion (max_samples 1 and something has
// changed) cascades that would have to be drawn again are left out: the map of the whole scene
// serves until the view rests, then accumulation starts with all of them. Such a sample that will
// not be the last one becomes RGBA8 pixels at once, where no other pixels are read.
enum hg_status hg_view_state_step(
    struct hg_view_state *view, uint32_t max_samples, struct hg_error *err) HG_MUST_CHECK;
// Nothing is left to do but to adapt the exposure.
bool hg_view_state_only_adapts(const struct hg_view_state *view);
bool hg_view_state_settled(const struct hg_view_state *view);
// Of the real-time picture that was drawn last.
bool hg_view_state_has_planes(const struct hg_view_state *view);
// Pixels of that format can be read: of a picture in motion those that were said in view->formats.
bool hg_view_state_has_pixels(const struct hg_view_state *view, uint32_t format);
// Copies or converts the result of the newest step; renders nothing. HG_E_STATE: see has_pixels.
// format index as in `pixels`; size in bytes of *out: width * height * bytes per pixel. lends:
// where nothing has to be copied it is not (hg_view_lend_pixels).
enum hg_status hg_view_state_read(struct hg_view_state *view, uint32_t format, bool lends,
    struct hg_refbuf **out, struct hg_error *err) HG_MUST_CHECK;
struct hg_gpu_pick;
enum hg_status hg_view_state_pick(struct hg_view_state *view, uint32_t x, uint32_t y,
    struct hg_gpu_pick *out, struct hg_error *err) HG_MUST_CHECK;
// The same for a rectangle inside of the picture: `row` gets its rows from the top, y counted from
// there; triangles are as the device counts them.
enum hg_status hg_view_state_surfaces(struct hg_view_state *view, VkRect2D pixels,
    void (*row)(void *user, uint32_t y, const struct hg_gpu_pick *pixels), void *user,
    struct hg_error *err) HG_MUST_CHECK;
// The same for the centres of so many equal cells of the whole picture, at most its pixels: costs
// as much as a picture of that size.
enum hg_status hg_view_state_grid(struct hg_view_state *view, VkExtent2D cells,
    void (*row)(void *user, uint32_t y, const struct hg_gpu_pick *cells), void *user,
    struct hg_error *err) HG_MUST_CHECK;

#endif
