// glass_view.h - clear glass of pictures in motion (renderer/reflect/glass.h).
// Floor 4. Thread: the render thread.
//
// A picture of phase DIRECT with reflections pauses once more where transmissive surfaces are
// drawn: the host reads back the opaque scene behind them, sends rays through the glass, and layers
// are shaded with what these brought. Without memory layers show what they know by themselves.
#ifndef HG_RENDERER_FRAME_LIGHT_GLASS_VIEW_H
#define HG_RENDERER_FRAME_LIGHT_GLASS_VIEW_H

#include "renderer/gpu/gpu.h"
#include "renderer/reflect/glass.h"

struct hg_draw;

// From one picture in motion to the next.
struct hg_glass_view {
    struct hg_glass *glass;    // NULL = none yet
    struct hg_gpu_image rays;  // what they brought
    struct hg_gpu_buffer back; // the opaque scene, read back
    uint32_t *words;           // of `rays`
    bool is_on;                // of the next picture
};

void hg_glass_view_finish(struct hg_gpu *gpu, struct hg_glass_view *view);

#endif
