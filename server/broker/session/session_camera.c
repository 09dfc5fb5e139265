#include "server/broker/session/session_camera.h"

#include <string.h>

#include "base/alloc.h"
#include "server/broker/session/session_allow.h"
#include "server/broker/session/session_audit.h"
#include "server/broker/session/session_record.h"
#include "server/broker/session/session_view.h"

enum { WAITING = 4096 };
static const uint64_t pose_interval_ns = 15000000; // between poses that watchers are told at once

// ---- who has it ---------------------------------------------------------------------------------

static struct hg_session *find_in(const struct hg_shared_scene *scene, uint64_t number)
{
    struct hg_session *it = scene->people.first;
    while (it && it->number != number)
        it = it->share.next;
    return it;
}

// The session that waits longest. NULL: none does.
static struct hg_session *next_in_line(const struct hg_shared_scene *scene)
{
    struct hg_session *best = NULL;
    for (struct hg_session *it = scene->people.first; it; it = it->share.next)
        if (it->conn && it->share.asked_ns && (!best || it->share.asked_ns < best->share.asked_ns))
            best = it;
    return best;
}

// s NULL: no session.
static void set_holder(struct hg_session_table *table, struct hg_shared_scene *scene,
    struct hg_session *s, enum hgp_camera_change change)
{
    struct hg_scene_camera *camera = &scene->people.camera;
    camera->holder = s ? s->number : 0;
    camera->since_ns = camera->moved_ns = table->loop->now_ns;
    camera->change = change;
    camera->due = true;
    if (s)
        s->share.asked_ns = 0;
}

// To the one that waits longest, if it is not locked.
static void pass_on(
    struct hg_session_table *table, struct hg_shared_scene *scene, enum hgp_camera_change change)
{
    struct hg_session *next = scene->people.camera.locked ? NULL : next_in_line(scene);
    set_holder(table, scene, next, change);
}

static void answer(struct hg_session *s, uint32_t request, const struct hg_error *err)
{
    if (err->status)
        hg_conn_fail(s->conn, request, err);
    else if (request)
        hg_conn_send(s->conn, request, HGP_T_ok, &(struct hgp_ok){.revision = s->scene->revision});
}

// What all of these messages need.
static bool may_ask(struct hg_session *s, const char *what, struct hg_error *err)
{
    if (!s->scene)
        hg_error_set(err, HG_E_STATE, what, NULL, "open a scene first (scene_open)");
    return s->scene && hg_session_allow_act(s, what, err) == HG_OK;
}

static bool is_locked_for(const struct hg_session *s, const char *what, struct hg_error *err)
{
    if (!s->scene->people.camera.locked || s->role == HGP_role_ADMIN)
        return false;
    hg_error_set(err, HG_E_PERM, what, NULL, "an administrator has locked the shared camera");
    return true;
}

void hg_session_camera_request(struct hg_session *s, uint32_t request)
{
    struct hg_error err = {0};
    if (may_ask(s, "camera_request", &err)) {
        struct hg_scene_camera *camera = &s->scene->people.camera;
        if (!camera->holder && !camera->locked) {
            set_holder(s->table, s->scene, s, HGP_camera_change_REQUESTED);
        } else if (camera->holder != s->number && !s->share.asked_ns) {
            s->share.asked_ns = s->table->loop->now_ns;
            camera->change = HGP_camera_change_WAITING;
            camera->due = true;
        }
    }
    answer(s, request, &err);
}

void hg_session_camera_take(struct hg_session *s, uint32_t request)
{
    struct hg_error err = {0};
    if (may_ask(s, "camera_take", &err) && !is_locked_for(s, "camera_take", &err)) {
        if (s->scene->people.camera.holder != s->number)
            set_holder(s->table, s->scene, s, HGP_camera_change_TAKEN);
        hg_session_audit(s, "camera_take", HG_OK, s->scene->name);
    }
    answer(s, request, &err);
}

void hg_session_camera_give(struct hg_session *s, uint32_t request, const struct hgp_camera_give *m)
{
    struct hg_error err = {0};
    const uint64_t number = m->has_session ? m->session : 0;
    if (may_ask(s, "camera_give", &err) && !is_locked_for(s, "camera_give", &err)) {
        struct hg_scene_camera *camera = &s->scene->people.camera;
        struct hg_session *to = number ? find_in(s->scene, number) : NULL;
        if (!number && s->share.asked_ns) { // it no longer waits
            s->share.asked_ns = 0;
            camera->change = HGP_camera_change_WAITING;
            camera->due = true;
        } else if (camera->holder != s->number && s->role != HGP_role_ADMIN) {
            hg_error_set(&err, HG_E_PERM, "camera_give", NULL, "this session does not have it");
        } else if (number && (!to || !to->conn)) {
            hg_error_set(&err, HG_E_NOTFOUND, "camera_give", "session",
                "no such session has this scene open");
        } else if (to) {
            set_holder(s->table, s->scene, to, HGP_camera_change_GIVEN);
        } else {
            pass_on(s->table, s->scene, HGP_camera_change_RELEASED);
        }
    }
    answer(s, request, &err);
}

void hg_session_camera_lock(struct hg_session *s, uint32_t request, const struct hgp_camera_lock *m)
{
    struct hg_error err = {0};
    if (may_ask(s, "camera_lock", &err)) {
        struct hg_scene_camera *camera = &s->scene->people.camera;
        camera->locked = m->locked;
        camera->change = HGP_camera_change_LOCK;
        camera->moved_ns = s->table->loop->now_ns; // unlocked, its holder has time again
        camera->due = true;
        if (!camera->locked && !camera->holder)
            pass_on(s->table, s->scene, HGP_camera_change_LOCK);
        hg_session_audit(s, m->locked ? "camera_lock" : "camera_unlock", HG_OK, s->scene->name);
    }
    answer(s, request, &err);
}

void hg_session_camera_leave(struct hg_session *s)
{
    struct hg_scene_camera *camera = &s->scene->people.camera;
    camera->due |= s->share.asked_ns != 0;
    s->share.asked_ns = 0;
    if (camera->holder == s->number)
        pass_on(s->table, s->scene, HGP_camera_change_LEFT);
}

// ---- the pose -----------------------------------------------------------------------------------

// All that a camera has and the views of others may have otherwise.
static void complete(struct hgp_view_camera *m)
{
    static const float up[3] = {0, 1, 0};
    if (!m->has_up)
        memcpy(m->up, up, sizeof m->up);
    m->kind = m->has_kind ? m->kind : HGP_camera_kind_PERSPECTIVE;
    m->vfov_rad = m->has_vfov_rad ? m->vfov_rad : 0.78539816f;
    m->half_height = m->has_half_height ? m->half_height : 1;
    m->has_up = m->has_kind = m->has_vfov_rad = m->has_half_height = true;
    m->has_far = m->has_lens_radius = m->has_focus_distance = true; // 0 where they were not
    m->has_received_ns = false;
    m->has_next_eye = m->has_next_target = m->has_next_up = false; // of the holder's own frames
}

static enum hg_status decode_camera(const struct hg_packet *packet, struct hgp_view_camera *out)
{
    return hgp_decode(HGP_VERSION_MAX, HGP_T_view_camera,
        hg_reader_make(packet->payload, packet->header.length), NULL, out, NULL);
}

// The pose as the camera of a view. NULL: no memory.
static struct hg_packet *pose_for(const struct hg_scene_camera *camera, uint32_t view)
{
    struct hgp_view_camera m;
    if (decode_camera(camera->pose, &m))
        return NULL;
    m.view = view;
    return hg_packet_encode(HGP_T_view_camera, &m);
}

// To the worker, where nothing is in front of it; else it stays due.
static void bring(struct hg_session *s, struct hg_session_view *view)
{
    struct hg_link *link = s->scene->link;
    if (!view->accepted || !s->attached || !hg_link_has_room(link) || link->trial.waiting)
        return;
    view->follow.due = false;
    hg_link_send_packet(link, s->number, hg_link_next_id(link), hg_packet_ref(view->camera));
}

static void give_pose(struct hg_session *s, struct hg_session_view *view)
{
    struct hg_packet *pose = pose_for(&s->scene->people.camera, view->number);
    if (!pose)
        return; // no memory: the next pose will do
    hg_packet_unref(view->camera);
    view->camera = pose;
    view->unrecorded = view->follow.due = true;
    bring(s, view);
}

static void give_all(const struct hg_shared_scene *scene, const struct hg_session_view *except)
{
    for (struct hg_session *s = scene->people.first; s; s = s->share.next)
        for (struct hg_session_view *it = s->views; it; it = it->next)
            if (it->follow.on && it != except)
                give_pose(s, it);
}

static struct hg_packet *encode_moved(const struct hg_scene_camera *camera)
{
    struct hgp_view_camera m;
    if (decode_camera(camera->pose, &m))
        return NULL;
    struct hgp_camera_moved out = {.session = camera->mover,
        .input_seq = m.input_seq,
        .has_camera = m.has_camera && m.camera,
        .camera = m.camera,
        .has_eye = m.has_eye,
        .has_target = m.has_target,
        .has_up = m.has_up,
        .has_kind = m.has_kind,
        .kind = m.kind,
        .has_vfov_rad = m.has_vfov_rad,
        .vfov_rad = m.vfov_rad,
        .has_half_height = m.has_half_height,
        .half_height = m.half_height,
        .has_near = m.has_near,
        .near = m.near,
        .has_far = m.has_far,
        .far = m.far};
    memcpy(out.eye, m.eye, sizeof out.eye);
    memcpy(out.target, m.target, sizeof out.target);
    memcpy(out.up, m.up, sizeof out.up);
    return hg_packet_encode(HGP_T_camera_moved, &out);
}

static void tell_pose(struct hg_session_table *table, struct hg_shared_scene *scene)
{
    struct hg_packet *packet = encode_moved(&scene->people.camera);
    scene->people.camera.pose_due = packet == NULL;
    scene->people.camera.sent_ns = table->loop->now_ns;
    for (struct hg_session *it = scene->people.first; it && packet; it = it->share.next)
        if (it->conn && it->share.watch.camera && !hg_conn_is_slow(it->conn))
            hg_conn_send_packet(it->conn, 0, hg_packet_ref(packet));
    hg_packet_unref(packet);
}

// view NULL: of none of the session's.
static void take_pose(struct hg_session *s, struct hg_session_view *view, struct hg_packet *packet)
{
    struct hg_scene_camera *camera = &s->scene->people.camera;
    const uint64_t now_ns = s->table->loop->now_ns;
    struct hgp_view_camera m;
    if (hg_session_view_merge(&camera->pose, packet) || decode_camera(camera->pose, &m))
        return; // no memory: the next one will do
    complete(&m);
    struct hg_packet *whole = hg_packet_encode(HGP_T_view_camera, &m);
    if (!whole)
        return;
    hg_packet_unref(camera->pose);
    camera->pose = whole;
    camera->mover = s->number;
    camera->pose_due = true;
    give_all(s->scene, view);
    if (now_ns - camera->sent_ns >= pose_interval_ns)
        tell_pose(s->table, s->scene);
}

void hg_session_camera_moved(
    struct hg_session *s, struct hg_session_view *view, struct hg_packet *packet)
{
    s->scene->people.camera.moved_ns = s->table->loop->now_ns;
    take_pose(s, view, packet);
}

enum hg_status hg_session_camera_may_move(
    const struct hg_session *s, const struct hg_session_view *view, struct hg_error *err)
{
    const struct hg_scene_camera *camera = &s->scene->people.camera;
    if (!view->follow.on || camera->holder == s->number)
        return HG_OK;
    if (camera->holder)
        return hg_error_set(err, HG_E_PERM, "view_camera", "view",
            "view %u follows the shared camera, which session %u has", view->number,
            camera->holder);
    return hg_error_set(err, HG_E_PERM, "view_camera", "view",
        "view %u follows the shared camera; ask for that first (camera_request)", view->number);
}

void hg_session_camera_accepted(struct hg_session *s, struct hg_session_view *view)
{
    if (view->follow.on && view->follow.due && view->camera)
        bring(s, view);
}

void hg_session_camera_follow(
    struct hg_session *s, uint32_t request, const struct hgp_camera_follow *m)
{
    struct hg_error err = {0};
    struct hg_session_view *view = s->scene ? hg_session_view_find(s, m->view) : NULL;
    if (may_ask(s, "camera_follow", &err) && !view)
        hg_error_set(
            &err, HG_E_NOTFOUND, "camera_follow", "view", "this session has no view %u", m->view);
    if (!err.status) {
        const struct hg_scene_camera *camera = &s->scene->people.camera;
        view->follow = (struct hg_session_follow){.on = m->follow};
        if (m->follow && camera->pose)
            give_pose(s, view);
        else if (m->follow && view->camera && camera->holder == s->number)
            take_pose(s, view, view->camera);
        hg_session_record_view(s, view);
    }
    answer(s, request, &err);
}

// ---- telling ------------------------------------------------------------------------------------

static struct hg_packet *encode_state(const struct hg_shared_scene *scene)
{
    const struct hg_scene_camera *camera = &scene->people.camera;
    struct hgp_waiting_session *list = hg_calloc(WAITING, sizeof *list);
    uint64_t *asked_ns = hg_calloc(WAITING, sizeof *asked_ns);
    uint32_t count = 0;
    struct hg_packet *packet = NULL;
    for (struct hg_session *it = scene->people.first; it && list && asked_ns; it = it->share.next) {
        if (!it->share.asked_ns || count == WAITING)
            continue;
        uint32_t at = count++;
        for (; at > 0 && asked_ns[at - 1] > it->share.asked_ns; at--) {
            asked_ns[at] = asked_ns[at - 1];
            list[at] = list[at - 1];
        }
        asked_ns[at] = it->share.asked_ns;
        list[at].session = it->number;
    }
    if (list && asked_ns)
        packet = hg_packet_encode(
            HGP_T_camera_state, &(struct hgp_camera_state){.holder = camera->holder,
                                    .locked = camera->locked,
                                    .change = camera->change,
                                    .waiting = {list, count}});
    hg_free(list);
    hg_free(asked_ns);
    return packet;
}

void hg_session_camera_tell(struct hg_session *s)
{
    struct hg_packet *packet = encode_state(s->scene);
    if (packet)
        hg_conn_send_packet(s->conn, 0, packet);
    else
        s->scene->people.camera.due = true;
    packet = s->scene->people.camera.pose ? encode_moved(&s->scene->people.camera) : NULL;
    if (packet)
        hg_conn_send_packet(s->conn, 0, packet);
}

static void tell_all(struct hg_shared_scene *scene)
{
    struct hg_packet *packet = encode_state(scene);
    scene->people.camera.due = packet == NULL;
    for (struct hg_session *it = scene->people.first; it && packet; it = it->share.next)
        if (it->conn && it->share.watch.camera)
            hg_conn_send_packet(it->conn, 0, hg_packet_ref(packet));
    hg_packet_unref(packet);
}

static void check_turn(struct hg_session_table *table, struct hg_shared_scene *scene)
{
    const struct hg_scene_camera *camera = &scene->people.camera;
    const struct hg_options *o = table->options;
    const uint64_t now_ns = table->loop->now_ns;
    if (!camera->holder || camera->locked)
        return;
    const struct hg_session *next = next_in_line(scene);
    if (o->camera_timeout_ns && now_ns - camera->moved_ns >= o->camera_timeout_ns)
        pass_on(table, scene, HGP_camera_change_INACTIVE);
    else if (next && o->camera_turn_ns && now_ns - camera->since_ns >= o->camera_turn_ns &&
             now_ns - next->share.asked_ns >= o->camera_turn_ns)
        pass_on(table, scene, HGP_camera_change_TURN_OVER);
}

void hg_session_camera_tick(struct hg_session_table *table, struct hg_shared_scene *scene)
{
    struct hg_scene_camera *camera = &scene->people.camera;
    check_turn(table, scene);
    if (camera->due)
        tell_all(scene);
    if (camera->pose_due && camera->pose)
        tell_pose(table, scene);
    for (struct hg_session *s = camera->pose ? scene->people.first : NULL; s; s = s->share.next)
        for (struct hg_session_view *it = s->views; it; it = it->next)
            if (it->follow.due && it->camera)
                bring(s, it);
}
