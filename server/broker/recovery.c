// recovery.c - brings scenes and sessions into a worker: a new one, or the successor of a dead one.
//
// Scenes are played one after the other, each on a channel of its own that may use all ids; when
// every edit has been answered, the scene's sessions are attached, their views restored, and what
// was under way is sent again in its order. A death during a scene's replay is blamed on that
// scene, a death while a suspect request runs alone on that request.
#include <stdio.h>

#include "base/clock.h"
#include "server/broker/broker.h"

enum { REPLAY_DEATHS = 2 };

static uint32_t replay_channel(const struct hg_shared_scene *scene)
{
    return HG_REPLAY_CHANNEL | scene->number;
}

// ---- sessions -----------------------------------------------------------------------------------

static void restore_view(struct hg_session *s, struct hg_session_view *view)
{
    struct hg_broker *b = s->broker;
    if (!view->accepted)
        return; // its view_set is still under way
    hg_link_send_packet(b, s->number, hg_link_next_id(b), hg_packet_ref(view->params));
    if (view->camera)
        hg_link_send_packet(b, s->number, hg_link_next_id(b), hg_packet_ref(view->camera));
    if (view->subscribed)
        hg_link_send(b, s->number, hg_link_next_id(b), HGP_T_subscribe,
            &(struct hgp_subscribe){
                .view = view->number, .credit_frames = hg_session_view_take_window(s, view)});
}

void hg_recovery_attach(struct hg_session *s)
{
    struct hg_broker *b = s->broker;
    bool restore = s->scene->revision > 0 || s->views;
    hg_link_send(b, s->number, 0, HGP_T_session_attach,
        &(struct hgp_session_attach){.session = s->number,
            .role = s->role,
            .scene = hgp_str_make(s->scene->key),
            .first_id = s->first_id,
            .id_count = HG_SCENE_ID_RANGE,
            .max_pixels = b->options.max_pixels,
            .replay = restore});
    if (s->batch_open) // before there is a view that could show half of it
        hg_link_send(
            b, s->number, hg_link_next_id(b), HGP_T_batch_begin, &(struct hgp_batch_begin){0});
    for (struct hg_session_view *it = s->views; it; it = it->next)
        restore_view(s, it);
    if (restore)
        hg_link_send(b, s->number, 0, HGP_T_replay_end,
            &(struct hgp_replay_end){.revision = s->scene->revision});
    s->attached = true;
    hg_session_pump(s);
}

// The journal holds the edits of open batches, too: who has one open comes first, so that it is
// open again before anybody has a view of the scene.
static void attach_all(struct hg_broker *b, struct hg_shared_scene *scene)
{
    scene->in_worker = true;
    for (int open = 1; open >= 0; open--)
        for (struct hg_session *it = b->sessions; it; it = it->next)
            if (it->scene == scene && !it->attached && (it->batch_open || !open))
                hg_recovery_attach(it);
}

// ---- scenes -------------------------------------------------------------------------------------

static enum hg_status play_entry(void *user, struct hg_packet *packet)
{
    struct hg_broker *b = user;
    b->link.replay_waiting++;
    hg_link_send_packet(b, replay_channel(b->link.replaying), hg_link_next_id(b), packet);
    return HG_OK;
}

static void begin_replay(struct hg_broker *b, struct hg_shared_scene *scene)
{
    struct hg_link *link = &b->link;
    link->replaying = scene;
    link->replay_waiting = link->replay_failed = 0;
    link->replay_start_ns = b->loop.now_ns;
    hg_link_send(b, replay_channel(scene), 0, HGP_T_session_attach,
        &(struct hgp_session_attach){.role = HGP_role_EDIT,
            .scene = hgp_str_make(scene->key),
            .first_id = 1,
            .id_count = UINT32_MAX,
            .max_pixels = 1,
            .replay = true});
    enum hg_status status = hg_journal_play(scene->journal, play_entry, b);
    if (status)
        hg_log_write(HG_LOG_ERROR, HG_LOG_JOURNAL, status, 0,
            "scene '%s' cannot be replayed completely", scene->key);
    hg_link_send(b, replay_channel(scene), 0, HGP_T_replay_end,
        &(struct hgp_replay_end){.revision = scene->revision});
}

static void end_replay(struct hg_broker *b)
{
    struct hg_link *link = &b->link;
    struct hg_shared_scene *scene = link->replaying;
    hg_info(JOURNAL, "scene '%s' is back after %.0f ms: %llu edits, %u refused", scene->key,
        (double)(hg_clock_now_ns() - link->replay_start_ns) * 1e-6,
        (unsigned long long)hg_journal_get_stats(scene->journal).entries, link->replay_failed);
    link->replaying = NULL;
    attach_all(b, scene);
    hg_link_send(
        b, replay_channel(scene), 0, HGP_T_session_detach, &(struct hgp_session_detach){0});
}

void hg_recovery_continue(struct hg_broker *b)
{
    struct hg_link *link = &b->link;
    for (struct hg_shared_scene *it = b->scenes, *next;
         it && link->state == HG_LINK_UP && !link->replaying; it = next) {
        next = it->next;
        if (it->in_worker)
            continue;
        if (!hg_journal_get_stats(it->journal).entries) {
            attach_all(b, it);
            continue;
        }
        begin_replay(b, it);
        if (!link->replay_waiting)
            end_replay(b);
    }
    if (link->pump) {
        link->pump = false;
        for (struct hg_session *it = b->sessions; it; it = it->next)
            hg_session_pump(it);
    }
}

void hg_recovery_answer(struct hg_broker *b, struct hg_packet *packet, const union hgp_any *m)
{
    struct hg_link *link = &b->link;
    uint16_t type = packet->header.type;
    if (!link->replaying || packet->header.channel != replay_channel(link->replaying) ||
        !packet->header.request || type == HGP_T_progress || type == HGP_T_notice ||
        type == HGP_T_frame_part)
        return;
    if (type == HGP_T_error) {
        link->replay_failed++;
        hg_warn(JOURNAL, "scene '%s': an edit is refused now: %.*s: %.*s", link->replaying->key,
            (int)m->error.what.size, m->error.what.data, (int)m->error.reason.size,
            m->error.reason.data);
    }
    if (link->replay_waiting && --link->replay_waiting == 0)
        end_replay(b);
}

void hg_recovery_scene_gone(struct hg_broker *b, struct hg_shared_scene *scene)
{
    if (b->link.replaying != scene)
        return;
    hg_link_send(
        b, replay_channel(scene), 0, HGP_T_session_detach, &(struct hgp_session_detach){0});
    b->link.replaying = NULL;
}

// ---- death --------------------------------------------------------------------------------------

static void give_up_scene(struct hg_broker *b, struct hg_shared_scene *scene)
{
    struct hg_error err = {0};
    hg_error_set(&err, HG_E_WORKER, "scene", NULL,
        "the worker died %u times while this scene was built again; it was given up%s%s",
        scene->deaths, b->link.last_words[0] ? ": " : "", b->link.last_words);
    hg_fault(JOURNAL, HG_E_WORKER, "scene '%s': %s", scene->key, err.reason);
    for (struct hg_session *it = b->sessions; it; it = it->next) {
        if (it->scene != scene)
            continue;
        hg_session_fail_all(it, &err);
        if (it->conn)
            hg_conn_close(it->conn, &err, "the scene was lost");
    }
}

static void give_up_request(struct hg_session *s, struct hg_request *request)
{
    const char *name = hgp_find(request->packet->header.type)->name;
    const char *last_words = s->broker->link.last_words;
    struct hg_error err = {0};
    hg_error_set(&err, HG_E_WORKER, name, NULL,
        "the worker died %d times at this request; it is not tried again%s%s", HG_REQUEST_TRIES,
        last_words[0] ? ": " : "", last_words);
    hg_log_write(HG_LOG_WARN, HG_LOG_SESSION, HG_E_WORKER, s->number, "%s: %s", name, err.reason);
    if (s->conn)
        hg_conn_fail(s->conn, request->client_id, &err);
    hg_session_drop_request(s, request);
    s->broker->closing |= !s->conn; // whose last edit this may have been
    if (++s->poisons < HG_POISON_LIMIT || !s->conn)
        return;
    hg_error_set(&err, HG_E_WORKER, "session", NULL,
        "requests of this session made the worker die again and again");
    hg_session_fail_all(s, &err);
    hg_conn_close(s->conn, &err, "the session is closed");
}

// Comes before all that the next worker answers.
static void tell_client(struct hg_session *s)
{
    if (s->conn && s->attached)
        hg_conn_send(s->conn, 0, HGP_T_notice,
            &(struct hgp_notice){.code = HG_E_WORKER,
                .what = hgp_str_make("worker"),
                .reason = hgp_str_make("it ended and is replaced; what it was at begins anew")});
}

static void requeue(struct hg_session *s)
{
    struct hg_request *next;
    tell_client(s);
    s->attached = false;
    for (struct hg_session_view *it = s->views; it; it = it->next) {
        it->granted = 0;
        it->number_base = it->last_number;
    }
    for (struct hg_request *it = s->first; it; it = next) {
        next = it->next;
        bool was_sent = it->sent && it->link_id;
        it->sent = false;
        it->link_id = 0;
        it->deaths = (uint8_t)(it->deaths + was_sent);
        if (it->deaths >= HG_REQUEST_TRIES) {
            give_up_request(s, it);
            if (!s->first)
                break; // the session was closed, nothing is left
        }
    }
    hg_session_verified(s, NULL);
}

void hg_recovery_worker_died(struct hg_broker *b)
{
    struct hg_link *link = &b->link;
    struct hg_shared_scene *replaying = link->replaying;
    link->replaying = NULL;
    link->suspect_session = NULL;
    for (struct hg_shared_scene *it = b->scenes; it; it = it->next)
        it->in_worker = false;
    for (struct hg_session *it = b->sessions; it; it = it->next)
        requeue(it);
    if (replaying && ++replaying->deaths >= REPLAY_DEATHS)
        give_up_scene(b, replaying);
}

void hg_recovery_request_done(struct hg_broker *b, const struct hg_request *request)
{
    struct hg_link *link = &b->link;
    if (!link->suspect_session || link->suspect_id != request->link_id || !request->sent)
        return;
    link->suspect_session = NULL;
    link->pump = true; // others may have waited for it
}
