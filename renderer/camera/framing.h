// framing.h - where a camera has to be so that a set of points fills its picture.
// Floor 1. Pure: any thread. World space, metres, +Y up.
#ifndef HG_RENDERER_CAMERA_FRAMING_H
#define HG_RENDERER_CAMERA_FRAMING_H

#include <stdbool.h>

// The view that a scene without a camera is shown from: a three-quarter view.
#define HG_FRAMING_AZIMUTH_RAD   0.6108652381980153 // 35 degrees
#define HG_FRAMING_ELEVATION_RAD 0.4363323129985824 // 25 degrees
#define HG_FRAMING_MARGIN        0.12

// The direction of view and the lens. Azimuth 0 sees the front (from +Z), 90 degrees the right side
// (from +X); elevation 90 degrees looks straight down, with -Z at the picture's top at azimuth 0.
struct hg_framing_lens {
    double azimuth_rad, elevation_rad;
    bool orthographic;
    double vfov_rad; // perspective, vertical, in 0..pi
    double aspect;   // width / height, > 0
    double margin;   // share of the picture's height or width that stays free, 0 <= margin < 1
};

// Supports of the points so far in the directions of the frustum's sides.
struct hg_framing {
    double right[3], up[3], back[3]; // axes of the camera
    double slope[2];                 // of the sides against `back`; 0 = orthographic
    double most[2][2];               // [axis][side]
    double nearest, farthest;        // along `back`, of the points
    double aspect, fill;             // fill: 1 - margin
    bool any, turns;
    double axis[2]; // x and z of the axis that points turn about
};

struct hg_framed {
    float eye[3], target[3], up[3]; // up: +Y, or the limit of neighbouring views at the poles
    float half_height;              // orthographic
};

// Begins without points; then they are added one by one, in world space, metres.
void hg_framing_begin(struct hg_framing *framing, const struct hg_framing_lens *lens);
void hg_framing_add(struct hg_framing *framing, const float point[3]);
// The circle that a point describes about a vertical axis through `axis`.
void hg_framing_add_ring(struct hg_framing *framing, const float axis[3], const float point[3]);
// The nearest camera in that direction that has all points in its picture, with the points' extent
// in its middle; one of the two dimensions is filled up to the margin. The target lies halfway
// between the nearest and the farthest point, or on the axis of rings. Without points: a cube of 2
// m around the origin.
void hg_framing_finish(struct hg_framing *framing, struct hg_framed *out);

#endif
