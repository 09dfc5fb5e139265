// navigate.c - camera controls. Pure.
#include "client/view/navigate.h"

#include <math.h>

static const double pi = 3.14159265358979323846;

static const double distance_min = 1e-6, distance_max = 1e9;
static const double wheel_step = 0.9;     // of the distance that stays
static const double scene_per_s = 0.6;    // radii of the scene that keys move in a second
static const double turn_rad_per_s = 1.6; // of keys and sticks
static const double zoom_per_s = 0.4;     // of the distance that stays after a second

static double clamp(double x, double low, double high)
{
    return x < low ? low : x > high ? high : x;
}

static void set_pitch(struct hg_navigate *n, double pitch)
{
    n->pitch = clamp(pitch, -HG_NAVIGATE_PITCH_MAX, HG_NAVIGATE_PITCH_MAX);
}

static void set_yaw(struct hg_navigate *n, double yaw)
{
    n->yaw = remainder(yaw, 2 * pi);
}

static void axes(const struct hg_navigate *n, double forward[3], double right[3], double up[3])
{
    const double c = cos(n->pitch), s = sin(n->pitch);
    forward[0] = c * sin(n->yaw);
    forward[1] = s;
    forward[2] = -c * cos(n->yaw);
    right[0] = cos(n->yaw);
    right[1] = 0;
    right[2] = sin(n->yaw);
    up[0] = -s * sin(n->yaw);
    up[1] = c;
    up[2] = s * cos(n->yaw);
}

static void add(double to[3], const double v[3], double factor)
{
    for (int i = 0; i < 3; i++)
        to[i] += v[i] * factor;
}

static void target_of(const struct hg_navigate *n, double target[3])
{
    double forward[3], right[3], up[3];
    axes(n, forward, right, up);
    for (int i = 0; i < 3; i++)
        target[i] = n->eye[i] + forward[i] * n->distance;
}

// Stands where `target` is in the middle at the same distance.
static void stand_before(struct hg_navigate *n, const double target[3])
{
    double forward[3], right[3], up[3];
    axes(n, forward, right, up);
    for (int i = 0; i < 3; i++)
        n->eye[i] = target[i] - forward[i] * n->distance;
}

void hg_navigate_look(struct hg_navigate *n, const float eye[3], const float target[3],
    const struct hgp_view_camera *camera)
{
    double d[3], length = 0;
    for (int i = 0; i < 3; i++) {
        d[i] = (double)target[i] - eye[i];
        length += d[i] * d[i];
    }
    length = sqrt(length);
    if (!isfinite(length) || length < distance_min)
        return;
    for (int i = 0; i < 3; i++)
        n->eye[i] = eye[i];
    n->distance = length;
    if (hypot(d[0], d[2]) > 1e-6 * length) // else straight up or down: the yaw stays
        set_yaw(n, atan2(d[0], -d[2]));
    else if (camera && camera->has_up)
        set_yaw(n,
            d[1] < 0 ? atan2(camera->up[0], -camera->up[2]) : atan2(-camera->up[0], camera->up[2]));
    set_pitch(n, asin(clamp(d[1] / length, -1, 1)));
    n->kind = camera && camera->has_kind ? camera->kind : HGP_camera_kind_PERSPECTIVE;
    n->vfov_rad = camera && camera->has_vfov_rad ? camera->vfov_rad : pi / 4;
    n->half_height = camera && camera->has_half_height && camera->half_height > 0
                         ? camera->half_height
                         : length * tan(n->vfov_rad / 2);
    if (!(n->size > 0))
        n->size = length;
}

void hg_navigate_set_size(struct hg_navigate *n, double radius)
{
    if (isfinite(radius) && radius > 0)
        n->size = radius;
}

void hg_navigate_drag(struct hg_navigate *n, double dx, double dy, double height)
{
    if (!(height > 0))
        return;
    if (n->style != HG_NAVIGATE_ORBIT) {
        set_yaw(n, n->yaw + dx / height * n->vfov_rad);
        set_pitch(n, n->pitch - dy / height * n->vfov_rad);
        return;
    }
    double target[3];
    target_of(n, target);
    set_yaw(n, n->yaw + dx / height * pi);
    set_pitch(n, n->pitch - dy / height * pi);
    stand_before(n, target);
}

// Metres that a pixel is wide where the target is.
static double pixel_size(const struct hg_navigate *n, double height)
{
    const double half = n->kind == HGP_camera_kind_ORTHOGRAPHIC
                            ? n->half_height
                            : n->distance * tan(n->vfov_rad / 2);
    return 2 * half / height;
}

void hg_navigate_pan(struct hg_navigate *n, double dx, double dy, double height)
{
    double forward[3], right[3], up[3];
    if (!(height > 0))
        return;
    axes(n, forward, right, up);
    add(n->eye, right, -dx * pixel_size(n, height));
    add(n->eye, up, dy * pixel_size(n, height));
}

// Nearer to the target, which stays.
static void zoom(struct hg_navigate *n, double factor)
{
    double target[3];
    target_of(n, target);
    n->distance = clamp(n->distance * factor, distance_min, distance_max);
    n->half_height = clamp(n->half_height * factor, distance_min, distance_max);
    stand_before(n, target);
}

static void step(struct hg_navigate *n, double right_m, double up_m, double forward_m)
{
    double forward[3], right[3], up[3];
    axes(n, forward, right, up);
    if (n->style == HG_NAVIGATE_WALK) {
        forward[0] = sin(n->yaw);
        forward[1] = 0;
        forward[2] = -cos(n->yaw);
    }
    if (n->style != HG_NAVIGATE_ORBIT) {
        up[0] = up[2] = 0;
        up[1] = 1;
    }
    add(n->eye, right, right_m);
    add(n->eye, up, up_m);
    add(n->eye, forward, forward_m);
}

void hg_navigate_wheel(struct hg_navigate *n, double steps)
{
    if (n->style == HG_NAVIGATE_ORBIT)
        zoom(n, pow(wheel_step, clamp(steps, -100, 100)));
    else
        step(n, 0, 0, steps * n->size * 0.05);
}

static void turn(struct hg_navigate *n, double yaw, double pitch)
{
    double target[3];
    target_of(n, target);
    set_yaw(n, n->yaw + yaw);
    set_pitch(n, n->pitch + pitch);
    if (n->style == HG_NAVIGATE_ORBIT)
        stand_before(n, target);
}

bool hg_navigate_move(struct hg_navigate *n, const struct hg_navigate_wish *wish, double seconds)
{
    const double t = clamp(seconds, 0, 0.25);
    const double way = t * n->size * scene_per_s * (wish->fast > 0 ? wish->fast : 1);
    const double look = t * turn_rad_per_s;
    const bool moves = wish->right != 0 || wish->up != 0 || wish->forward != 0;
    if (!(t > 0) || (!moves && wish->turn == 0 && wish->tilt == 0))
        return false;
    if (n->style == HG_NAVIGATE_ORBIT) {
        // The eye goes where the key points: around the target.
        turn(n, -wish->turn * look, -wish->tilt * look);
        if (wish->forward != 0)
            zoom(n, pow(zoom_per_s, t * wish->forward * (wish->fast > 0 ? wish->fast : 1)));
        step(n, wish->right * way, wish->up * way, 0);
        return true;
    }
    turn(n, wish->turn * look, wish->tilt * look);
    step(n, wish->right * way, wish->up * way, wish->forward * way);
    return true;
}

void hg_navigate_centre(struct hg_navigate *n, const float point[3])
{
    double target[3], way = 0;
    for (int i = 0; i < 3; i++) {
        if (!isfinite(point[i]))
            return;
        target[i] = point[i];
        way += (target[i] - n->eye[i]) * (target[i] - n->eye[i]);
    }
    n->distance = clamp(sqrt(way), distance_min, distance_max);
    stand_before(n, target);
}

void hg_navigate_camera(const struct hg_navigate *n, struct hgp_view_camera *camera)
{
    double target[3];
    target_of(n, target);
    camera->has_camera = false;
    camera->camera = 0;
    camera->has_eye = camera->has_target = camera->has_up = true;
    for (int i = 0; i < 3; i++) {
        camera->eye[i] = (float)n->eye[i];
        camera->target[i] = (float)target[i];
        camera->up[i] = i == 1;
    }
    camera->has_kind = camera->has_vfov_rad = true;
    camera->kind = n->kind;
    camera->vfov_rad = (float)n->vfov_rad;
    camera->has_half_height = n->kind == HGP_camera_kind_ORTHOGRAPHIC;
    camera->half_height = (float)n->half_height;
}

double hg_navigate_axis(int value)
{
    const double zone = 0.125, x = clamp(value / 32767.0, -1, 1);
    const double beyond = (fabs(x) - zone) / (1 - zone);
    return beyond <= 0 ? 0 : copysign(beyond * beyond, x);
}
