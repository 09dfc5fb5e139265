// overlay.h - what is laid over the pixels of a view when they are read: caps of what clipping
// planes cut, and the outline of what is selected. Floor 4. Thread: the render thread.
//
// Pictures in motion, settled ones and path-traced ones have the same overlay, because it depends
// on the state of the view alone. Caps cover their pixels with four samples at rest and one in
// motion; in display colours, that is after exposure and tone curve (linear pixels have the same
// colours without the curve of sRGB). Outlines are two pixels wide, outside of what is seen of
// selected surfaces.
#ifndef HG_RENDERER_FRAME_LOOK_OVERLAY_H
#define HG_RENDERER_FRAME_LOOK_OVERLAY_H

#include "renderer/frame/state.h"

// The view has something to lay over its pixels.
bool hg_overlay_is_wanted(const struct hg_view_state *view);
// Lays it over pixels of the view's region: format as index into targets.pixels. The overlay is
// made when the state is another one. HG_E_NOMEM, HG_E_LIMIT (caps.h), device errors.
enum hg_status hg_overlay_apply(struct hg_view_state *view, uint32_t format, uint8_t *pixels,
    struct hg_error *err) HG_MUST_CHECK;

#endif
