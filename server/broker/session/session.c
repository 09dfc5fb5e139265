#include "server/broker/session/session.h"

#include <fnmatch.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "server/broker/list.h"
#include "server/broker/session/session_admin.h"
#include "server/broker/session/session_allow.h"
#include "server/broker/session/session_annotation.h"
#include "server/broker/session/session_audit.h"
#include "server/broker/session/session_camera.h"
#include "server/broker/session/session_list.h"
#include "server/broker/session/session_look.h"
#include "server/broker/session/session_park.h"
#include "server/broker/session/session_record.h"
#include "server/broker/session/session_request.h"
#include "server/broker/session/session_rules.h"
#include "server/broker/session/session_share.h"
#include "server/broker/session/session_ticket.h"
#include "server/broker/session/session_upload.h"
#include "server/broker/session/session_view.h"

// ---- messages the broker answers ----------------------------------------------------------------

static void subscribe(struct hg_session *s, const struct hgp_subscribe *m)
{
    struct hg_session_view *view = hg_session_view_find(s, m->view);
    view->credit = view->first_credit = m->credit_frames;
    view->subscribed = m->credit_frames > 0;
    view->resubscribe = false;
    if (!view->subscribed)
        hg_session_view_clear(s, view); // a suspect that is stopped need not be tried
    hg_session_record_view(s, view);
}

// Scenes without a name are the session's own.
static bool may_open(const struct hg_session *s, struct hgp_str name)
{
    char text[129];
    snprintf(text, sizeof text, "%.*s", (int)name.size, name.data ? name.data : "");
    if (s->scope.is_ticket) // a name, not a pattern
        return strcmp(s->scope.scenes, text) == 0;
    return !name.size || !s->scope.scenes[0] || fnmatch(s->scope.scenes, text, 0) == 0;
}

static void open_scene(struct hg_session *s, uint32_t request, const struct hgp_scene_open *m)
{
    struct hg_error err = {0};
    struct hg_session_table *table = s->table;
    bool existed = false;
    uint32_t first_id = 0;
    struct hg_shared_scene *scene = NULL;
    if (s->scene)
        hg_error_set(&err, HG_E_STATE, "scene_open", NULL, "close the open scene first");
    else if (table->draining)
        hg_error_set(&err, HG_E_STATE, "scene_open", NULL, "the daemon is shutting down");
    else if (hg_session_allow_begin(table, s->role, "scene_open", &err))
        ; // err says why
    else if (!may_open(s, m->name))
        hg_error_set(&err, HG_E_PERM, "scene_open", "name",
            "this token may open scenes named '%s' only", s->scope.scenes);
    else if (!hg_shared_scene_find(&table->scenes, s->tenant, m->name) &&
             hg_session_rules_may_change(table, "scene_open", &err))
        ; // err says why
    else if (s->scope.is_ticket && s->role < HGP_role_EDIT &&
             !hg_shared_scene_find(&table->scenes, s->tenant, m->name))
        hg_error_set(&err, HG_E_NOTFOUND, "scene_open", "name",
            "the scene is not open now, and this join ticket may only look");
    else if (hg_shared_scene_join(&table->scenes,
                 &(struct hg_scene_wish){s->tenant, m->name, s->number, s->scope.weight}, &scene,
                 &existed, &err))
        ; // err says why
    else if (!(first_id = hg_shared_scene_claim_ids(scene))) {
        hg_shared_scene_leave(&table->scenes, scene);
        hg_error_set(&err, HG_E_LIMIT, "scene_open", NULL,
            "objects of this scene have ids of %u sessions, and no ids are left",
            (unsigned)HG_SCENE_RANGES);
        hg_error_limit(&err, "id-ranges", 0);
    }
    char name[129];
    snprintf(name, sizeof name, "%.*s", (int)m->name.size, m->name.size ? m->name.data : "");
    hg_session_audit(s, "scene_open", err.status, name);
    if (err.status) {
        hg_conn_fail(s->conn, request, &err);
        return;
    }
    s->first_id = first_id;
    hg_session_share_enter(s, scene);
    hg_outq_hold(&s->conn->out, scene->logged);
    hg_session_record(s);
    if (scene->in_worker)
        hg_session_request_attach(s);
    hg_conn_send(s->conn, request, HGP_T_scene_opened,
        &(struct hgp_scene_opened){.revision = scene->revision,
            .existed = existed,
            .first_id = s->first_id,
            .id_count = HG_SCENE_ID_RANGE});
}

static bool has_edits(const struct hg_session *s)
{
    for (const struct hg_request *it = s->first; it; it = it->next)
        if (hg_journal_wants(it->packet->header.type))
            return true;
    return false;
}

// Edits under way may still make objects with ids of the session.
static void leave_scene(struct hg_session *s, bool edits_under_way, bool is_end)
{
    struct hg_shared_scene *scene = s->scene;
    if (scene)
        hg_session_share_leave(s, false);
    while (s->first)
        hg_session_request_drop(s, s->first);
    while (s->views)
        hg_session_view_remove(s, s->views);
    if (s->attached)
        hg_link_send(
            scene->link, s->number, 0, HGP_T_session_detach, &(struct hgp_session_detach){0});
    s->attached = s->batch_open = false;
    s->bytes.verified = 0;
    hg_session_share_unlink(s);
    if (!is_end)
        hg_session_record(s); // before that of the scene's end
    if (scene && !edits_under_way)
        hg_shared_scene_release_ids(scene, s->first_id);
    if (scene)
        hg_shared_scene_leave(&s->table->scenes, scene);
}

static void close_scene(struct hg_session *s, uint32_t request)
{
    struct hg_error err = {0};
    if (!s->scene) {
        hg_error_set(&err, HG_E_STATE, "scene_close", NULL, "no scene is open");
        hg_conn_fail(s->conn, request, &err);
        return;
    }
    hg_error_set(&err, HG_E_CANCELLED, "scene_close", NULL, "the scene was closed");
    bool edits_under_way = has_edits(s);
    hg_session_request_fail_all(s, &err);
    leave_scene(s, edits_under_way, false);
    if (request)
        hg_conn_send(s->conn, request, HGP_T_ok, &(struct hgp_ok){0});
}

static void add_credit(struct hg_session *s, const struct hgp_credit *m)
{
    struct hg_session_view *view = hg_session_view_find(s, m->view);
    if (!view->subscribed)
        return; // stopped
    view->credit += view->credit < UINT32_MAX - 1024 ? m->frames : 0;
    hg_session_view_grant_all(s);
}

// The client has a frame: the worker is told, with the time.
static void take(struct hg_session *s, const struct hgp_taken *m)
{
    struct hg_session_view *view = hg_session_view_find(s, m->view);
    if (view->subscribed && s->attached && m->number > view->number_base)
        hg_link_send(s->scene->link, s->number, 0, HGP_T_delivered,
            &(struct hgp_delivered){.view = m->view,
                .number = m->number - view->number_base,
                .at_ns = hg_clock_now_ns(),
                .has_begun_ns = m->has_begun_ns,
                .begun_ns = m->begun_ns,
                .has_received_ns = m->has_received_ns,
                .received_ns = m->received_ns,
                .has_rtt_ns = m->has_rtt_ns,
                .rtt_ns = m->rtt_ns});
    add_credit(s, &(struct hgp_credit){.view = m->view, .frames = 1});
}

// With the time when it came. Of views that follow the shared camera only its holder's count.
static void relay_camera(
    struct hg_session *s, struct hg_packet *packet, const struct hgp_view_camera *m)
{
    struct hgp_view_camera stamped = *m;
    struct hg_session_view *view = hg_session_view_find(s, m->view);
    struct hg_error err = {0};
    if (hg_session_camera_may_move(s, view, &err)) {
        if (packet->header.request)
            hg_conn_fail(s->conn, packet->header.request, &err);
        return; // it may have been sent before its client knew
    }
    stamped.has_received_ns = true;
    stamped.received_ns = hg_clock_now_ns();
    struct hg_packet *with = hg_packet_encode(HGP_T_view_camera, &stamped);
    if (with)
        with->header.request = packet->header.request;
    hg_session_request_relay(s, with ? with : packet);
    if (view->follow.on)
        hg_session_camera_moved(s, view, packet);
    hg_packet_unref(with);
}

static void relay_checked(struct hg_session *s, struct hg_packet *packet, const union hgp_any *m)
{
    struct hg_error err = {0};
    if (hg_session_rules_check(s, packet, m, &err)) {
        hg_conn_fail(s->conn, packet->header.request, &err);
        return;
    }
    if (packet->header.type == HGP_T_credit) {
        add_credit(s, &m->credit);
        return;
    }
    if (packet->header.type == HGP_T_taken) {
        take(s, &m->taken);
        return;
    }
    if (packet->header.type == HGP_T_frame_cancel) {
        hg_session_request_cancel(s, &m->frame_cancel);
        if (packet->header.request)
            hg_conn_send(s->conn, packet->header.request, HGP_T_ok, &(struct hgp_ok){0});
        return;
    }
    if (packet->header.type == HGP_T_subscribe)
        subscribe(s, &m->subscribe);
    struct hg_packet *translated = hg_session_look_translate(s, packet, m);
    if (!translated) {
        hg_error_set(&err, HG_E_NOMEM, "request", NULL, "no memory for the request");
        hg_conn_fail(s->conn, packet->header.request, &err);
        return;
    }
    if (packet->header.type == HGP_T_view_camera)
        relay_camera(s, translated, &m->view_camera);
    else
        hg_session_request_relay(s, translated);
    hg_packet_unref(translated);
}

static void clear_quarantine(
    struct hg_session *s, uint32_t request, const struct hgp_quarantine_clear *m)
{
    struct hg_error err = {0};
    char detail[80];
    uint32_t count =
        hg_quarantine_clear(s->table->quarantine, m->key.size ? m->key.data : "", m->key.size);
    if (!count && m->key.size)
        hg_error_set(&err, HG_E_NOTFOUND, "quarantine_clear", "key", "no file's key begins so");
    snprintf(detail, sizeof detail, "%u files", count);
    hg_session_audit(s, "quarantine_clear", err.status, detail);
    hg_outq_hold(&s->conn->out, hg_state_log_position(s->table->scenes.log));
    if (err.status)
        hg_conn_fail(s->conn, request, &err);
    else if (request)
        hg_conn_send(s->conn, request, HGP_T_ok, &(struct hgp_ok){0});
}

// Of people in a scene.
static bool take_shared(
    struct hg_session *s, uint32_t request, uint16_t type, const union hgp_any *m)
{
    switch (type) {
    case HGP_T_scene_watch:
        hg_session_share_watch(s, request, &m->scene_watch);
        return true;
    case HGP_T_participant_set:
        hg_session_share_participant(s, request, &m->participant_set);
        return true;
    case HGP_T_cursor_set:
        hg_session_share_cursor(s, request, &m->cursor_set);
        return true;
    case HGP_T_camera_request:
        hg_session_camera_request(s, request);
        return true;
    case HGP_T_camera_take:
        hg_session_camera_take(s, request);
        return true;
    case HGP_T_camera_give:
        hg_session_camera_give(s, request, &m->camera_give);
        return true;
    case HGP_T_camera_lock:
        hg_session_camera_lock(s, request, &m->camera_lock);
        return true;
    case HGP_T_camera_follow:
        hg_session_camera_follow(s, request, &m->camera_follow);
        return true;
    case HGP_T_annotation_set:
        hg_session_annotation_set(s, request, &m->annotation_set);
        return true;
    case HGP_T_annotation_remove:
        hg_session_annotation_remove(s, request, &m->annotation_remove);
        return true;
    case HGP_T_annotations_query:
        hg_session_annotation_tell(s, request);
        return true;
    default:
        return false;
    }
}

// Of tickets, and of administrators.
static bool take_admin(
    struct hg_session *s, uint32_t request, uint16_t type, const union hgp_any *m)
{
    switch (type) {
    case HGP_T_join_make:
        hg_session_ticket_make(s, request, &m->join_make);
        return true;
    case HGP_T_join_query:
        hg_session_ticket_list(s, request);
        return true;
    case HGP_T_join_revoke:
        hg_session_ticket_revoke(s, request, &m->join_revoke);
        return true;
    case HGP_T_message_send:
        hg_session_admin_message(s, request, &m->message_send);
        return true;
    case HGP_T_kick:
        hg_session_admin_kick(s, request, &m->kick);
        return true;
    case HGP_T_drain_set:
        hg_session_admin_drain(s, request, &m->drain_set);
        return true;
    case HGP_T_sessions_watch:
        hg_session_admin_watch(s, request, &m->sessions_watch);
        return true;
    default:
        return false;
    }
}

void hg_session_message(struct hg_session *s, struct hg_packet *packet, const union hgp_any *m)
{
    uint32_t request = packet->header.request;
    if (packet->header.type != HGP_T_credit) {
        s->pace.active_ns = s->table->loop->now_ns;
        s->pace.warned = false;
    }
    if (take_shared(s, request, packet->header.type, m) ||
        take_admin(s, request, packet->header.type, m))
        return;
    switch (packet->header.type) {
    case HGP_T_scene_open:
        open_scene(s, request, &m->scene_open);
        return;
    case HGP_T_scene_close:
        close_scene(s, request);
        return;
    case HGP_T_upload_query:
        hg_session_upload_query(s, request, &m->upload_query);
        return;
    case HGP_T_upload:
        hg_session_upload(s, packet, &m->upload);
        return;
    case HGP_T_sessions_query:
        hg_session_audit(s, "sessions_query", HG_OK, NULL);
        hg_session_list(s, request);
        return;
    case HGP_T_quarantine_query:
        hg_session_audit(s, "quarantine_query", HG_OK, NULL);
        hg_session_list_quarantine(s, request);
        return;
    case HGP_T_quarantine_clear:
        clear_quarantine(s, request, &m->quarantine_clear);
        return;
    default:
        relay_checked(s, packet, m);
    }
}

// ---- life ---------------------------------------------------------------------------------------

struct hg_session *hg_session_create(
    struct hg_session_table *table, uint32_t number, enum hgp_role role, struct hgp_str name)
{
    struct hg_session *s = hg_calloc(1, sizeof *s);
    if (!s)
        return NULL;
    s->table = table;
    s->number = number & (HG_SCENE_REPLAY_CHANNEL - 1);
    s->role = role;
    snprintf(s->name, sizeof s->name, "%.*s", (int)name.size, name.size ? name.data : "");
    HG_LIST_ADD(table->first, s);
    struct hg_session **bucket = &table->buckets[s->number % HG_SESSION_BUCKETS];
    s->same_bucket = *bucket;
    *bucket = s;
    table->count++;
    return s;
}

void hg_session_destroy(struct hg_session *s)
{
    hg_session_record_end(s);
    leave_scene(s, has_edits(s), true);
    hg_pixel_account_unref(&s->table->pixels, s->pace.account);
    HG_LIST_REMOVE(s->table->first, s);
    struct hg_session **bucket = &s->table->buckets[s->number % HG_SESSION_BUCKETS];
    while (*bucket != s)
        bucket = &(*bucket)->same_bucket;
    *bucket = s->same_bucket;
    s->table->count--;
    hg_free(s->failed);
    hg_free(s);
}

void hg_session_end_if_idle(struct hg_session *s)
{
    struct hg_request *next;
    if (s->resume.parked_ns)
        return;
    for (struct hg_request *it = s->first; it; it = next) {
        next = it->next;
        if (!hg_journal_wants(it->packet->header.type))
            hg_session_request_drop(s, it);
    }
    if (!s->first || !s->scene || s->scene->sessions == 1)
        hg_session_destroy(s);
}

void hg_session_end(struct hg_session *s)
{
    s->conn = NULL;
    hg_session_upload_abort_all(s);
    hg_session_end_if_idle(s);
}

void hg_session_lost(struct hg_session *s)
{
    const bool is_kept = hg_session_is_kept(s);
    hg_session_audit(s, is_kept ? "park" : "logout", HG_OK, NULL); // while it has its peer
    s->conn = NULL;
    s->resume.waits = false;
    hg_session_upload_abort_all(s);
    if (is_kept)
        hg_session_park(s);
    else
        hg_session_end_if_idle(s);
}

void hg_session_bury(struct hg_session_table *table)
{
    if (!table->ended)
        return;
    table->ended = false;
    for (struct hg_session *it = table->first, *next; it; it = next) {
        next = it->next;
        if (!it->conn && !it->first && !it->resume.parked_ns)
            hg_session_destroy(it);
    }
}
