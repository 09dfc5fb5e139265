// navigate.h - camera controls of viewers: orbit, fly and walk, from movements of the pointer, keys
// and sticks to an eye and a target. The browser viewer has the same controls (docs/client.md).
//
// Floor 6 (client). Pure; one thread at a time. Metres, radians, +Y up. Angles as everywhere:
// yaw 0 looks along -Z, a positive yaw turns to the right; pitch is above the horizon.
//
//   orbit  the pointer turns the eye around the target, the wheel goes nearer to it
//   fly    the pointer turns the view about the eye, keys move along the line of sight
//   walk   as fly, but keys move in the horizontal plane: the height of the eye stays
#ifndef HG_CLIENT_VIEW_NAVIGATE_H
#define HG_CLIENT_VIEW_NAVIGATE_H

#include "protocol/hgp.h"

enum hg_navigate_style { HG_NAVIGATE_ORBIT, HG_NAVIGATE_FLY, HG_NAVIGATE_WALK };

struct hg_navigate {
    enum hg_navigate_style style;
    double eye[3];
    double yaw, pitch;  // pitch within HG_NAVIGATE_PITCH_MAX
    double distance;    // from eye to target, > 0
    double size;        // radius of the scene, > 0: sets the speed of keys and sticks
    double vfov_rad;    // PERSPECTIVE
    double half_height; // ORTHOGRAPHIC, > 0: zooming changes it, too
    enum hgp_camera_kind kind;
};

#define HG_NAVIGATE_PITCH_MAX 1.5690 // a tenth of a degree before straight up and down

// Movements of a moment: of keys -1, 0 or 1, of sticks anything between.
struct hg_navigate_wish {
    double right, up, forward; // move
    double turn, tilt;         // look: to the right, up
    double fast;               // factor of the speed, 1 = normal
};

// Looks from `eye` at `target`, with the lens of `camera` (may be NULL: 45 degrees). Points that
// coincide, or are not finite, leave the view as it was. `size` <= 0 keeps the scene's.
void hg_navigate_look(struct hg_navigate *n, const float eye[3], const float target[3],
    const struct hgp_view_camera *camera);
void hg_navigate_set_size(struct hg_navigate *n, double radius);

// The pointer went by (dx, dy) px, down and right positive, in a picture of `height` px.
// Orbit: a height is half a turn; fly and walk: a height is the field of view.
void hg_navigate_drag(struct hg_navigate *n, double dx, double dy, double height);
// Moves eye and target so that what is as far away as the target stays under the pointer.
void hg_navigate_pan(struct hg_navigate *n, double dx, double dy, double height);
// Steps of the wheel, forward positive. Orbit: a step is a tenth of the distance; fly and walk: a
// step forward.
void hg_navigate_wheel(struct hg_navigate *n, double steps);
// Keys and sticks for `seconds` (at most a quarter is taken: a stall makes no leap). Returns
// whether the camera changed.
bool hg_navigate_move(struct hg_navigate *n, const struct hg_navigate_wish *wish, double seconds);
// Turns about `point` from now on (it comes to the middle of the picture), at its distance.
void hg_navigate_centre(struct hg_navigate *n, const float point[3]);

// eye, target, up and lens of `camera`; its other members stay.
void hg_navigate_camera(const struct hg_navigate *n, struct hgp_view_camera *camera);

// A stick's axis, -32768 to 32767, as -1 to 1: nothing within a dead zone of an eighth, then
// squared, so that small movements are fine.
double hg_navigate_axis(int value);

#endif
