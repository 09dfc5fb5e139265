// view_camera.c - the cameras of views: their ranges and defaults.
#include <math.h>
#include <string.h>

#include "renderer/pathtrace/shutter.h"
#include "renderer/internal.h"

// ---- ranges -------------------------------------------------------------------------------------

static enum hg_status refuse(
    struct hg_error *err, const char *field, double value, const char *allowed)
{
    return hg_error_set(err, HG_E_INVAL, "camera", field, "%.9g is not %s", value, allowed);
}

static enum hg_status check_finite3(const float v[3], const char *field, struct hg_error *err)
{
    for (int i = 0; i < 3; i++)
        if (!isfinite(v[i]))
            return refuse(err, field, (double)v[i], "a finite number");
    return HG_OK;
}

// An `up` along the line of sight is replaced (hg_camera_fill); without a line of sight there is no
// picture.
static enum hg_status check_sight(
    const float eye[3], const float target[3], const char *field, struct hg_error *err)
{
    if (eye[0] != target[0] || eye[1] != target[1] || eye[2] != target[2])
        return HG_OK;
    return hg_error_set(err, HG_E_INVAL, "camera", field,
        "%g, %g, %g is where the eye is: the camera looks nowhere", (double)target[0],
        (double)target[1], (double)target[2]);
}

static enum hg_status check_pose(const struct hg_view_camera *c, struct hg_error *err)
{
    enum hg_status status = check_finite3(c->eye, "eye", err);
    if (!status)
        status = check_finite3(c->target, "target", err);
    if (!status)
        status = check_finite3(c->up, "up", err);
    if (!status)
        status = check_sight(c->eye, c->target, "target", err);
    if (status || !c->moves)
        return status;
    status = check_finite3(c->next_eye, "next_eye", err);
    if (!status)
        status = check_finite3(c->next_target, "next_target", err);
    if (!status)
        status = check_finite3(c->next_up, "next_up", err);
    return status ? status : check_sight(c->next_eye, c->next_target, "next_target", err);
}

static enum hg_status check_lens(const struct hg_view_camera *c, struct hg_error *err)
{
    if (!(c->vfov_rad >= 0.0f && c->vfov_rad < (float)M_PI))
        return refuse(err, "vfov_rad", (double)c->vfov_rad, "in 0 to pi");
    if (!(c->half_height >= 0.0f) || !isfinite(c->half_height))
        return refuse(err, "half_height", (double)c->half_height, "0 or more");
    if (!isfinite(c->near) || (!c->orthographic && c->near < 0.0f))
        return refuse(err, "near", (double)c->near, "0 or more");
    if (!isfinite(c->far) || c->far < 0.0f || (c->far > 0.0f && c->far <= c->near))
        return refuse(err, "far", (double)c->far, "0 or more than near");
    if (!(c->lens_radius >= 0.0f && c->lens_radius <= 1e6f))
        return refuse(err, "lens_radius", (double)c->lens_radius, "in 0 to 1e6");
    if (!(c->focus_distance >= 0.0f) || !isfinite(c->focus_distance))
        return refuse(err, "focus_distance", (double)c->focus_distance, "0 or more");
    return HG_OK;
}

// ---- cameras ------------------------------------------------------------------------------------

// node: that it was taken from, or 0.
static enum hg_status set_camera(
    struct hg_view *view, const struct hg_view_camera *c, uint64_t node, struct hg_error *err)
{
    enum hg_status status = check_pose(c, err);
    if (!status)
        status = check_lens(c, err);
    if (status)
        return status;
    struct hg_view_camera_state s;
    memset(&s, 0, sizeof s); // compared as bytes
    const bool has_up = c->up[0] != 0 || c->up[1] != 0 || c->up[2] != 0;
    for (int i = 0; i < 3; i++) {
        s.eye[i] = c->eye[i];
        s.target[i] = c->target[i];
        s.up[i] = has_up ? c->up[i] : i == 1;
    }
    s.orthographic = c->orthographic;
    s.vfov_rad = c->vfov_rad > 0 ? c->vfov_rad : HG_CAMERA_DEFAULT_VFOV_RAD;
    s.half_height = c->half_height > 0 ? c->half_height : 1.0f;
    s.near = c->near;
    s.far = c->far;
    s.lens_radius = c->lens_radius;
    s.focus_distance = c->focus_distance;
    s.input_seq = c->input_seq;
    s.node = node;
    s.moves = c->moves;
    const bool has_next_up = c->next_up[0] != 0 || c->next_up[1] != 0 || c->next_up[2] != 0;
    for (int i = 0; i < 3 && c->moves; i++) {
        s.next_eye[i] = c->next_eye[i];
        s.next_target[i] = c->next_target[i];
        s.next_up[i] = has_next_up ? c->next_up[i] : s.up[i];
    }
    hg_view_state_look(&view->state, &s);
    return HG_OK;
}

enum hg_status hg_view_set_camera(
    struct hg_view *view, const struct hg_view_camera *camera, struct hg_error *err)
{
    static const struct hg_camera_optics none;
    const enum hg_status status = set_camera(view, camera, 0, err);
    return status != HG_OK ? status : hg_view_set_optics(view, &none, err);
}

enum hg_status hg_view_set_camera_node(
    struct hg_view *view, uint64_t node_id, const struct hg_view_camera *with, struct hg_error *err)
{
    struct hg_scene *scene = view->state.scene_gpu->scene;
    const struct hg_node *node =
        (const struct hg_node *)hg_scene_find(scene, HG_OBJECT_NODE, node_id);
    if (node == NULL || node->camera == NULL)
        return hg_error_set(err, HG_E_NOTFOUND, "camera", "node", "no such node with a camera");
    const struct hg_camera *camera = node->camera;
    const float distance =
        with->focus_distance > 0.0f ? with->focus_distance : camera->optics.focus_distance;
    if (with->lens_radius > 0.0f && !(distance > 0.0f))
        return hg_error_set(err, HG_E_INVAL, "camera", "focus_distance",
            "a camera of the scene looks at no point: its lens needs a distance");
    hg_scene_update(scene);
    struct hg_view_camera c = {.orthographic = camera->kind == HG_CAMERA_ORTHOGRAPHIC,
        .vfov_rad = camera->vfov_rad,
        .half_height = camera->half_height,
        .near = camera->near,
        .far = camera->far,
        .lens_radius = with->lens_radius,
        .focus_distance = distance,
        .input_seq = with->input_seq};
    hg_shutter_look_along(node, c.eye, c.target, c.up);
    const enum hg_status status = set_camera(view, &c, node_id, err);
    return status != HG_OK ? status : hg_view_set_optics(view, &camera->optics, err);
}
