// view_pixels.h - the pixels of a view that are read.
// Floor 4, private to the files of views. Thread: the render thread.
#ifndef HG_RENDERER_FRAME_VIEW_PIXELS_H
#define HG_RENDERER_FRAME_VIEW_PIXELS_H

#include "renderer/frame/state.h"

// The image of a format (as index into targets.pixels) and room for it in `readback`.
enum hg_status hg_view_make_pixels(const struct hg_draw *draw, struct hg_gpu_readback *readback,
    uint32_t format, struct hg_error *err) HG_MUST_CHECK;
// The picture in motion to the readback of the view.
void hg_view_record_copy(const struct hg_draw *draw, struct hg_gpu_cmd *cmd);
// Destroys what hg_view_state_grid draws to.
void hg_view_forget_grid(struct hg_view_state *view);

#endif
