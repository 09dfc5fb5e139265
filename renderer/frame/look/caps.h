// caps.h - caps: the faces that close solids where clipping planes cut them open.
// Floor 4. Thread: the render thread.
//
// What all planes let through is convex, so the line of sight of a pixel enters it at one point of
// one plane, and in front of that nothing is seen. If the point lies inside of a solid the pixel
// shows its cap. Inside: all surfaces along the line are collected, whatever hides them
// (hg_visibility_collect_cuts), and walked from the point on. The first way out of a solid that
// the walk did not come into behind the point is the way out of the innermost solid around it.
// Solids are counted by node, so those that lie inside of, or reach into, one another each count
// for themselves; a node whose surfaces do not close on that line, as many fronts as backs, is no
// solid there. Cost: a pass over what is cut, and its fragments.
#ifndef HG_RENDERER_FRAME_LOOK_CAPS_H
#define HG_RENDERER_FRAME_LOOK_CAPS_H

#include "renderer/frame/batch/batch.h"

struct hg_cap {
    uint32_t draw_plus_one; // whose cap it is; 0: none
    uint32_t plane;
    float depth; // metres along the view direction
};

// Caps at the pixels of a rectangle, row by row, through the jitter of the draw's request; in the
// state that draw->frame is filled with then. Uses buffers.pick and draw->culling. HG_E_LIMIT: more
// than 16 million fragments of what is cut. HG_E_NOMEM, device errors.
enum hg_status hg_caps_find(
    struct hg_draw *draw, VkRect2D pixels, struct hg_cap *out, struct hg_error *err) HG_MUST_CHECK;
// Display colour of a cap at a pixel, linear, 0..1.
void hg_caps_color(
    const struct hg_draw *draw, const struct hg_cap *cap, uint32_t x, uint32_t y, float color[3]);
// Where the cap is, relative to the geometry's origin, and its normal, towards the eye.
void hg_caps_place(const struct hg_draw *draw, const struct hg_cap *cap, uint32_t x, uint32_t y,
    float position[3], float normal[3]);

#endif
