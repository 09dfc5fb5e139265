#include "server/worker/view/view_fit.h"

#include <string.h>

#include "base/log.h"
#include "renderer/camera/camera.h"
#include "renderer/camera/framing.h"
#include "renderer/scene/extent.h"

static double aspect_of(const struct view_slot *view)
{
    const struct hg_view_params p = hg_view_params_filled(&view->settings.params);
    return (double)p.width / (double)p.height;
}

static void add_point(void *framing, const float point[3])
{
    hg_framing_add(framing, point);
}

// Points on their way around a vertical axis.
struct turntable {
    struct hg_framing *framing;
    float axis[3];
};

static void add_ring(void *user, const float point[3])
{
    const struct turntable *t = user;
    hg_framing_add_ring(t->framing, t->axis, point);
}

static void add_geometry(
    const struct hg_scene *scene, const struct hg_node *top, bool turns, struct hg_framing *framing)
{
    struct turntable t = {.framing = framing};
    float min[3], max[3];
    if (!turns || !hg_scene_bounds(scene, top, min, max)) {
        hg_extent_visit_points(scene, top, add_point, framing);
        return;
    }
    for (int i = 0; i < 3; i++)
        t.axis[i] = 0.5f * min[i] + 0.5f * max[i];
    hg_extent_visit_points(scene, top, add_ring, &t);
}

// The scene has been updated.
static void fit(const struct hg_scene *scene, const struct hg_node *top, double aspect,
    const struct hgp_view_fit *m, struct hgp_view_fitted *out)
{
    struct hg_framing framing;
    struct hg_framed framed;
    out->kind = m->has_kind ? m->kind : HGP_camera_kind_PERSPECTIVE;
    out->vfov_rad = m->has_vfov_rad ? m->vfov_rad : HG_CAMERA_DEFAULT_VFOV_RAD;
    const struct hg_framing_lens lens = {
        .azimuth_rad = m->has_azimuth_rad ? (double)m->azimuth_rad : HG_FRAMING_AZIMUTH_RAD,
        .elevation_rad = m->has_elevation_rad ? (double)m->elevation_rad : HG_FRAMING_ELEVATION_RAD,
        .orthographic = out->kind == HGP_camera_kind_ORTHOGRAPHIC,
        .vfov_rad = (double)out->vfov_rad,
        .aspect = aspect,
        .margin = m->has_margin ? (double)m->margin : HG_FRAMING_MARGIN};
    hg_framing_begin(&framing, &lens);
    add_geometry(scene, top, m->has_turntable && m->turntable, &framing);
    out->empty = !framing.any;
    hg_framing_finish(&framing, &framed);
    memcpy(out->eye, framed.eye, sizeof out->eye);
    memcpy(out->target, framed.target, sizeof out->target);
    memcpy(out->up, framed.up, sizeof out->up);
    out->half_height = framed.half_height;
}

// ---- cameras of the scene
// ------------------------------------------------------------------------

static void send_blind(const struct request *r, const struct hg_node *node, const char *fault)
{
    struct hgp_notice notice = {.code = HG_E_INVAL,
        .what = hgp_str_fit(node->head.name, 256),
        .where = hgp_str_make("camera"),
        .reason = hgp_str_make(fault)};
    if (!notice.what.size)
        notice.what = hgp_str_make("camera without a name");
    hg_reply_notice(r->to, &notice);
}

// The first camera that sees geometry; NULL: none does. The others before it are reported to the
// request, if there is one.
static const struct hg_node *find_camera(
    const struct hg_scene *scene, double aspect, const struct request *r)
{
    const struct hg_object_list *nodes = &scene->objects[HG_OBJECT_NODE];
    for (uint32_t i = 0; i < nodes->count; i++) {
        const struct hg_node *node = (const struct hg_node *)nodes->items[i];
        const char *fault = node->camera ? hg_extent_camera_fault(scene, node, aspect) : NULL;
        if (node->camera && !fault)
            return node;
        if (fault && r)
            send_blind(r, node, fault);
    }
    return NULL;
}

void hg_view_fit_note_blind(const struct request *r, const struct view_slot *view, uint64_t id)
{
    const struct hg_scene *scene = r->session->scene->scene;
    const struct hg_node *node = (const struct hg_node *)hg_scene_find(scene, HG_OBJECT_NODE, id);
    const char *fault =
        node && node->camera ? hg_extent_camera_fault(scene, node, aspect_of(view)) : NULL;
    if (fault && r->to.request)
        send_blind(r, node, fault);
}

void hg_view_fit_describe(const struct hg_node *node, struct hgp_view_fitted *out)
{
    const struct hg_camera *c = node->camera;
    out->camera = node->head.id;
    for (int i = 0; i < 3; i++) {
        out->eye[i] = node->world[12 + i];
        out->target[i] = node->world[12 + i] - node->world[8 + i];
        out->up[i] = node->world[4 + i];
    }
    out->kind = c->kind == HG_CAMERA_ORTHOGRAPHIC ? HGP_camera_kind_ORTHOGRAPHIC
                                                  : HGP_camera_kind_PERSPECTIVE;
    out->vfov_rad = c->vfov_rad > 0 ? c->vfov_rad : HG_CAMERA_DEFAULT_VFOV_RAD;
    out->half_height = c->half_height > 0 ? c->half_height : 1;
}

void hg_handle_view_fit(const struct request *r)
{
    const struct hgp_view_fit *m = &r->message->view_fit;
    struct hg_scene *scene = r->session->scene->scene;
    const struct view_slot *view = hg_request_view(r, m->view);
    if (!view)
        return;
    const uint64_t id = m->has_node ? m->node : 0;
    const struct hg_object *top = id ? hg_scene_find(scene, HG_OBJECT_NODE, id) : NULL;
    if (id && !top) {
        struct hg_error err = {0};
        hg_error_set(
            &err, HG_E_NOTFOUND, "view_fit", "node", "no node %llu", (unsigned long long)id);
        hg_reply_error(r->to, &err);
        return;
    }
    struct hgp_view_fitted answer = {.revision = scene->revision};
    hg_scene_update(scene);
    const double aspect = aspect_of(view);
    const struct hg_node *camera =
        m->has_cameras && m->cameras ? find_camera(scene, aspect, r) : NULL;
    if (camera)
        hg_view_fit_describe(camera, &answer);
    else
        fit(scene, (const struct hg_node *)top, aspect, m, &answer);
    hg_reply_send(r->to, HGP_T_view_fitted, &answer);
}

// ---- the view's own camera
// -----------------------------------------------------------------------

// The scene in its rest pose, until end_rest: what a view shows by default does not depend on the
// time of an animation.
static enum hg_status begin_rest(
    struct hg_scene *scene, struct hg_pose_kept *kept, struct hg_error *err)
{
    if (hg_scene_pose_rest(scene, kept))
        return hg_error_set(err, HG_E_NOMEM, "view", "camera", "no memory to fit it");
    hg_scene_update(scene);
    return HG_OK;
}

static void end_rest(struct hg_scene *scene, struct hg_pose_kept *kept)
{
    hg_scene_pose_restore(scene, kept);
    hg_scene_update(scene);
}

static void fill(
    const struct hg_scene *scene, const struct view_slot *view, struct hg_view_camera *camera)
{
    struct hgp_view_fitted found = {0};
    fit(scene, NULL, aspect_of(view), &(struct hgp_view_fit){0}, &found);
    memcpy(camera->eye, found.eye, sizeof camera->eye);
    memcpy(camera->target, found.target, sizeof camera->target);
    memcpy(camera->up, found.up, sizeof camera->up);
    camera->vfov_rad = found.vfov_rad;
}

enum hg_status hg_view_fit_fill(const struct session *session, const struct view_slot *view,
    struct hg_view_camera *camera, struct hg_error *err)
{
    struct hg_scene *scene = session->scene->scene;
    struct hg_pose_kept kept = {0};
    const enum hg_status status = begin_rest(scene, &kept, err);
    if (status)
        return status;
    fill(scene, view, camera);
    end_rest(scene, &kept);
    return HG_OK;
}

// The first camera of the scene that sees geometry, else the whole scene.
static enum hg_status choose_camera(
    struct hg_scene *scene, struct view_slot *view, struct hg_error *err)
{
    struct hg_pose_kept kept = {0};
    const enum hg_status status = begin_rest(scene, &kept, err);
    if (status)
        return status;
    const struct hg_node *node = find_camera(scene, aspect_of(view), NULL);
    view->settings.camera_node = node ? node->head.id : 0;
    if (!node)
        fill(scene, view, &view->settings.camera);
    end_rest(scene, &kept);
    return HG_OK;
}

// Through which a view looks; false: it was removed, or has no camera any more.
static bool is_camera(const struct hg_scene *scene, uint64_t id)
{
    const struct hg_node *node = (const struct hg_node *)hg_scene_find(scene, HG_OBJECT_NODE, id);
    return node && node->camera;
}

enum hg_status hg_view_fit_follow(
    const struct session *session, struct view_slot *view, struct hg_error *err)
{
    struct view_settings *set = &view->settings;
    struct hg_scene *scene = session->scene->scene;
    if (set->camera_revision == scene->revision || (set->camera_given && !set->camera_node))
        return HG_OK;
    hg_scene_update(scene);
    if (set->camera_given && !is_camera(scene, set->camera_node)) {
        hg_info(SESSION, "view %u: its camera was removed: it shows the scene", view->number);
        set->camera_given = false;
    }
    const enum hg_status status = set->camera_given ? HG_OK : choose_camera(scene, view, err);
    if (status)
        return status;
    set->camera_revision = scene->revision;
    return set->camera_node
               ? hg_view_set_camera_node(view->view, set->camera_node, &set->camera, err)
               : hg_view_set_camera(view->view, &set->camera, err);
}
