#include "renderer/camera/framing.h"

#include <float.h>
#include <math.h>

#include "base/vec3d.h"

// At the poles `up` is the limit that it has beside them, so this covers every direction.
static void set_axes(struct hg_framing *f, double azimuth, double elevation)
{
    const double sa = sin(azimuth), ca = cos(azimuth), se = sin(elevation), ce = cos(elevation);
    const double right[3] = {ca, 0, -sa}, up[3] = {-se * sa, ce, -se * ca};
    const double back[3] = {ce * sa, se, ce * ca};
    for (int i = 0; i < 3; i++) {
        f->right[i] = right[i];
        f->up[i] = up[i];
        f->back[i] = back[i];
    }
}

void hg_framing_begin(struct hg_framing *f, const struct hg_framing_lens *lens)
{
    *f = (struct hg_framing){.aspect = lens->aspect, .fill = 1 - lens->margin};
    set_axes(f, lens->azimuth_rad, lens->elevation_rad);
    if (!lens->orthographic) {
        f->slope[1] = tan(lens->vfov_rad / 2) * f->fill;
        f->slope[0] = f->slope[1] * lens->aspect;
    }
    for (int i = 0; i < 2; i++)
        f->most[i][0] = f->most[i][1] = -DBL_MAX;
    f->nearest = -DBL_MAX;
    f->farthest = DBL_MAX;
}

void hg_framing_add(struct hg_framing *f, const float point[3])
{
    const double p[3] = {(double)point[0], (double)point[1], (double)point[2]};
    const double b = hg_dot3d(p, f->back), axis[2] = {hg_dot3d(p, f->right), hg_dot3d(p, f->up)};
    for (int i = 0; i < 2; i++) {
        f->most[i][0] = fmax(f->most[i][0], f->slope[i] * b - axis[i]);
        f->most[i][1] = fmax(f->most[i][1], f->slope[i] * b + axis[i]);
    }
    f->nearest = fmax(f->nearest, b);
    f->farthest = fmin(f->farthest, b);
    f->any = true;
}

void hg_framing_add_ring(struct hg_framing *f, const float axis[3], const float point[3])
{
    const double radius =
        hypot((double)point[0] - (double)axis[0], (double)point[2] - (double)axis[2]);
    const double center[3] = {(double)axis[0], (double)point[1], (double)axis[2]};
    const double b = hg_dot3d(center, f->back),
                 at[2] = {hg_dot3d(center, f->right), hg_dot3d(center, f->up)};
    const double level = hypot(f->back[0], f->back[2]); // cosine of the elevation
    for (int side = 0; side < 2; side++) {
        const double sign = side ? 1 : -1;
        // The greatest value on the circle of slope * back +- axis, whose horizontal parts are at a
        // right angle for `right` and along one line for `up`.
        const double across = radius * hypot(1, f->slope[0] * level);
        const double along = radius * fabs(f->slope[1] * level - sign * f->back[1]);
        f->most[0][side] = fmax(f->most[0][side], f->slope[0] * b + sign * at[0] + across);
        f->most[1][side] = fmax(f->most[1][side], f->slope[1] * b + sign * at[1] + along);
    }
    f->nearest = fmax(f->nearest, b + radius * level);
    f->farthest = fmin(f->farthest, b - radius * level);
    f->axis[0] = center[0];
    f->axis[1] = center[2];
    f->any = f->turns = true;
}

static void add_unit_cube(struct hg_framing *f)
{
    for (int corner = 0; corner < 8; corner++) {
        float p[3];
        for (int i = 0; i < 3; i++)
            p[i] = corner >> i & 1 ? 1 : -1;
        hg_framing_add(f, p);
    }
}

// How far along `back` the eye is. A side's plane through the eye touches the points when
// slope * eye_back +- eye_axis is their support; both sides of an axis together give its distance.
static double eye_distance(const struct hg_framing *f, double half)
{
    const double reach = f->nearest - f->farthest;
    double distance = -DBL_MAX;
    for (int i = 0; i < 2 && f->slope[i] > 0; i++)
        distance = fmax(distance, (f->most[i][0] + f->most[i][1]) / (2 * f->slope[i]));
    if (f->slope[0] == 0) // orthographic: any place in front of everything
        distance = f->nearest + reach + half;
    double gap = fmax(0.02 * reach, 1e-6 * half);
    if (!(reach > 0) && !(half > 0))
        gap = 1; // a single point
    return fmax(distance, f->nearest + gap);
}

// From the eye along the line of sight.
static double target_depth(const struct hg_framing *f, const double at[2], double distance)
{
    const double level = f->back[0] * f->back[0] + f->back[2] * f->back[2];
    double ahead = 0; // of the axis, horizontally
    if (!f->turns || level < 1e-6)
        return distance - (f->nearest + f->farthest) / 2;
    for (int i = 0; i < 3; i += 2) {
        const double eye = f->right[i] * at[0] + f->up[i] * at[1] + f->back[i] * distance;
        ahead += f->back[i] * (eye - f->axis[i / 2]);
    }
    return ahead / level;
}

void hg_framing_finish(struct hg_framing *f, struct hg_framed *out)
{
    if (!f->any)
        add_unit_cube(f);
    double at[2], half[2];
    for (int i = 0; i < 2; i++) {
        at[i] = (f->most[i][1] - f->most[i][0]) / 2;
        half[i] = (f->most[i][0] + f->most[i][1]) / 2 - f->slope[i] * f->farthest;
    }
    const double distance = eye_distance(f, fmax(fmax(half[0], half[1]), 0));
    const double depth = target_depth(f, at, distance);
    const double half_height = fmax(half[1], half[0] / f->aspect) / f->fill;
    const bool is_pole = hypot(f->back[0], f->back[2]) < 1e-6;
    for (int i = 0; i < 3; i++) {
        const double eye = f->right[i] * at[0] + f->up[i] * at[1] + f->back[i] * distance;
        out->eye[i] = (float)eye;
        out->target[i] = (float)(eye - f->back[i] * depth);
        out->up[i] = is_pole ? (float)f->up[i] : i == 1;
    }
    out->half_height = half_height > 0 ? (float)half_height : 1;
}
