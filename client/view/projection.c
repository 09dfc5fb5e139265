// projection.c - places in the window, the picture and the scene. Pure.
#include "client/view/projection.h"

#include <math.h>
#include <string.h>

#include "base/vec3d.h"

static const double near_share = 1e-3; // of the farther end's depth, where a segment is cut

struct hg_projection_rect hg_projection_picture(
    int width, int height, int window_width, int window_height)
{
    struct hg_projection_rect r = {0, 0, window_width, window_height};
    if ((int64_t)width * window_height > (int64_t)height * window_width)
        r.height = (int)((int64_t)height * window_width / width);
    else
        r.width = (int)((int64_t)width * window_height / height);
    r.x = (window_width - r.width) / 2;
    r.y = (window_height - r.height) / 2;
    return r;
}

bool hg_projection_pixel(
    const struct hg_projection_rect *rect, int width, int height, int x, int y, uint32_t pixel[2])
{
    const int64_t dx = x - rect->x, dy = y - rect->y;
    if (dx < 0 || dy < 0 || dx >= rect->width || dy >= rect->height)
        return false;
    pixel[0] = (uint32_t)(dx * width / rect->width);
    pixel[1] = (uint32_t)(dy * height / rect->height);
    return true;
}

bool hg_projection_look(struct hg_projection_view *view, const struct hgp_view_camera *camera,
    const struct hg_projection_rect *rect)
{
    double up[3];
    *view = (struct hg_projection_view){.rect = *rect};
    for (int i = 0; i < 3; i++) {
        view->eye[i] = camera->eye[i];
        view->forward[i] = (double)camera->target[i] - camera->eye[i];
        up[i] = camera->has_up ? camera->up[i] : i == 1;
    }
    if (!hg_normalize3d(view->forward))
        return false;
    hg_cross3d(view->forward, up, view->right);
    if (!hg_normalize3d(view->right)) { // straight up or down: any direction to the right
        const double other[3] = {0, 0, view->forward[1] < 0 ? -1 : 1};
        hg_cross3d(view->forward, other, view->right);
        if (!hg_normalize3d(view->right))
            return false;
    }
    hg_cross3d(view->right, view->forward, view->up);
    const bool flat = camera->has_kind && camera->kind == HGP_camera_kind_ORTHOGRAPHIC;
    const double vfov = camera->has_vfov_rad ? camera->vfov_rad : 3.14159265358979323846 / 4;
    view->tangent = flat ? 0 : tan(vfov / 2);
    view->half_height = camera->has_half_height ? camera->half_height : 1;
    return true;
}

bool hg_projection_point(const struct hg_projection_view *view, const double point[3], double at[3])
{
    double d[3];
    for (int i = 0; i < 3; i++)
        d[i] = point[i] - view->eye[i];
    at[2] = hg_dot3d(d, view->forward);
    if (!(at[2] > 1e-9))
        return false;
    const double half = view->tangent > 0 ? at[2] * view->tangent : view->half_height;
    const double px = view->rect.height / 2.0 / half;
    at[0] = view->rect.x + view->rect.width / 2.0 + hg_dot3d(d, view->right) * px;
    at[1] = view->rect.y + view->rect.height / 2.0 - hg_dot3d(d, view->up) * px;
    return isfinite(at[0]) && isfinite(at[1]);
}

// The end behind the eye moves along the segment to where it is just before it.
static void cut(double behind[3], const double seen[3], double behind_depth, double seen_depth)
{
    const double depth = seen_depth * near_share;
    const double t = (depth - behind_depth) / (seen_depth - behind_depth);
    for (int i = 0; i < 3; i++)
        behind[i] += (seen[i] - behind[i]) * t;
}

bool hg_projection_segment(const struct hg_projection_view *view, const double a[3],
    const double b[3], double from[2], double to[2])
{
    double ends[2][3], at[2][3], depth[2];
    for (int i = 0; i < 3; i++) {
        ends[0][i] = a[i] - view->eye[i];
        ends[1][i] = b[i] - view->eye[i];
    }
    for (int i = 0; i < 2; i++)
        depth[i] = hg_dot3d(ends[i], view->forward);
    memcpy(ends[0], a, sizeof ends[0]);
    memcpy(ends[1], b, sizeof ends[1]);
    for (int i = 0; i < 2; i++)
        if (depth[i] <= depth[1 - i] * near_share && depth[1 - i] > 0)
            cut(ends[i], ends[1 - i], depth[i], depth[1 - i]);
    for (int i = 0; i < 2; i++)
        if (!hg_projection_point(view, ends[i], at[i]))
            return false;
    memcpy(from, at[0], 2 * sizeof *from);
    memcpy(to, at[1], 2 * sizeof *to);
    return true;
}
