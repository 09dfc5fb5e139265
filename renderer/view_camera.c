// view_camera.c - the cameras of views: their ranges and defaults.
#include <math.h>
#include <string.h>

#include "renderer/pathtrace/shutter.h"
#include "renderer/internal.h"

static enum hg_status out_of_range(struct hg_error *err, const char *field)
{
    return hg_renderer_out_of_range(err, "camera", field);
}

static bool is_finite3(const float v[3])
{
    return isfinite(v[0]) && isfinite(v[1]) && isfinite(v[2]);
}

static enum hg_status check_camera(const struct hg_view_camera *c, struct hg_error *err)
{
    if (!is_finite3(c->eye))
        return out_of_range(err, "eye");
    if (!is_finite3(c->target) || memcmp(c->eye, c->target, sizeof c->eye) == 0)
        return out_of_range(err, "target");
    if (!is_finite3(c->up))
        return out_of_range(err, "up");
    if (!(c->vfov_rad >= 0.0f && c->vfov_rad < (float)M_PI))
        return out_of_range(err, "vfov_rad");
    if (!(c->half_height >= 0.0f) || !isfinite(c->half_height))
        return out_of_range(err, "half_height");
    if (!isfinite(c->near) || (!c->orthographic && c->near < 0.0f))
        return out_of_range(err, "near");
    if (!isfinite(c->far) || c->far < 0.0f || (c->far > 0.0f && c->far <= c->near))
        return out_of_range(err, "far");
    if (!(c->lens_radius >= 0.0f && c->lens_radius <= 1e6f))
        return out_of_range(err, "lens_radius");
    if (!(c->focus_distance >= 0.0f) || !isfinite(c->focus_distance))
        return out_of_range(err, "focus_distance");
    if (c->moves && !is_finite3(c->next_eye))
        return out_of_range(err, "next_eye");
    if (c->moves && (!is_finite3(c->next_target) ||
                        memcmp(c->next_eye, c->next_target, sizeof c->next_eye) == 0))
        return out_of_range(err, "next_target");
    if (c->moves && !is_finite3(c->next_up))
        return out_of_range(err, "next_up");
    return HG_OK;
}

// node: that it was taken from, or 0.
static enum hg_status set_camera(
    struct hg_view *view, const struct hg_view_camera *c, uint64_t node, struct hg_error *err)
{
    enum hg_status status = check_camera(c, err);
    if (status != HG_OK)
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
