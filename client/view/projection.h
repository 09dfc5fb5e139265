// projection.h - where things are in the window: the picture in it, the pixel of the picture under
// the pointer, points and segments of the scene in the picture. Floor 6 (client). Pure. Metres in
// the scene, px in window and picture, y down.
#ifndef HG_CLIENT_VIEW_PROJECTION_H
#define HG_CLIENT_VIEW_PROJECTION_H

#include <stdbool.h>

#include "protocol/hgp.h"

struct hg_projection_rect {
    int x, y, width, height;
};

// A picture in a window of another size: as large as fits, in the middle. Sizes are above 0.
struct hg_projection_rect hg_projection_picture(
    int width, int height, int window_width, int window_height);
// The pixel of a picture of width x height, shown in `rect`, that is at a place of the window.
// False: the place is beside the picture.
bool hg_projection_pixel(
    const struct hg_projection_rect *rect, int width, int height, int x, int y, uint32_t pixel[2]);

// A camera, and the rectangle of the window that its picture fills.
struct hg_projection_view {
    double eye[3], right[3], up[3], forward[3];
    double tangent;     // of half the vertical field of view; 0 = ORTHOGRAPHIC
    double half_height; // ORTHOGRAPHIC, metres
    struct hg_projection_rect rect;
};

// False: the camera has no eye and target that differ.
bool hg_projection_look(struct hg_projection_view *view, const struct hgp_view_camera *camera,
    const struct hg_projection_rect *rect);
// Where a point is seen, and its depth along the view, metres. False: it is behind the eye.
bool hg_projection_point(
    const struct hg_projection_view *view, const double point[3], double at[3]);
// Ends of a segment as seen; what is behind the eye is cut off. False: all of it.
bool hg_projection_segment(const struct hg_projection_view *view, const double a[3],
    const double b[3], double from[2], double to[2]);

#endif
