// glass_region.h - the part of a picture that transmissive surfaces may cover.
// Floor 4. Thread: the render thread.
#ifndef HG_RENDERER_FRAME_LIGHT_GLASS_REGION_H
#define HG_RENDERER_FRAME_LIGHT_GLASS_REGION_H

#include "renderer/frame/state.h"

// The least rectangle that the boxes of all draws whose materials transmit are seen in; width 0:
// the camera sees none. A function of the scene and the camera alone.
struct hg_picture_region hg_glass_region(const struct hg_view_state *view);

#endif
