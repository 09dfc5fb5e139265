// recovery.c - replay, attach, send again; whose fault a death was.
//
// Scenes are played one after the other, each on a channel of its own that may use all ids; when
// every edit has been answered, the scene's sessions are attached, their views restored, and what
// was under way is sent again in its order. A death during a scene's replay is blamed on that
// scene, a death while a suspect runs alone on that suspect (trial.h).
#include "server/broker/workers/recovery.h"

#include <stdio.h>

#include "base/clock.h"
#include "base/log.h"
#include "server/broker/session/session.h"
#include "server/broker/session/session_answer.h"
#include "server/broker/session/session_request.h"
#include "server/broker/session/session_upload.h"
#include "server/broker/session/session_view.h"
#include "server/broker/workers/trial.h"

enum { REPLAY_DEATHS = 2 };
static const uint64_t rebuild_ns = 4000000; // of a round of the loop: clients wait meanwhile

// ---- sessions -----------------------------------------------------------------------------------

// The journal holds the edits of open batches, too: a session with one open comes first, so that it
// is open again before any session has a view of the scene.
static void attach_all(struct hg_shared_scene *scene)
{
    scene->in_worker = true;
    scene->link->feed.pump = true; // suspects wait for the last scene
    for (int open = 1; open >= 0; open--)
        for (struct hg_session *it = scene->people.first; it; it = it->share.next)
            if (!it->attached && (it->batch_open || !open))
                hg_session_request_attach(it);
}

// ---- scenes -------------------------------------------------------------------------------------

static enum hg_status play_entry(void *user, struct hg_packet *packet)
{
    struct hg_link *link = user;
    link->replay.waiting++;
    hg_link_send_packet(
        link, hg_shared_scene_channel(link->replay.scene), hg_link_next_id(link), packet);
    return HG_OK;
}

static void begin_replay(struct hg_link *link, struct hg_shared_scene *scene)
{
    link->replay = (struct hg_link_replay){.scene = scene, .start_ns = link->loop->now_ns};
    hg_link_send(link, hg_shared_scene_channel(scene), 0, HGP_T_session_attach,
        &(struct hgp_session_attach){.role = HGP_role_EDIT,
            .scene = hgp_str_make(scene->key),
            .first_id = 1,
            .id_count = UINT32_MAX,
            .max_pixels = 1,
            .replay = true});
    scene->on_channel = true;
    enum hg_status status = hg_journal_play(scene->journal, play_entry, link);
    if (status)
        hg_log_write(HG_LOG_ERROR, HG_LOG_JOURNAL, status, 0,
            "scene '%s' cannot be replayed completely", scene->key);
    hg_link_send(link, hg_shared_scene_channel(scene), 0, HGP_T_replay_end,
        &(struct hgp_replay_end){.revision = scene->revision});
}

static void end_replay(struct hg_link *link)
{
    struct hg_shared_scene *scene = link->replay.scene;
    hg_info(JOURNAL, "scene '%s' is back after %.0f ms: %llu edits, %u refused", scene->key,
        (double)(hg_clock_now_ns() - link->replay.start_ns) * 1e-6,
        (unsigned long long)hg_journal_get_stats(scene->journal).entries, link->replay.failed);
    link->replay.scene = NULL;
    attach_all(scene);
    if (!scene->kept_until_ns)
        hg_shared_scene_leave_channel(scene);
}

static void rebuild(struct hg_link *link)
{
    struct hg_session_table *table = link->owner;
    const uint64_t end_ns = hg_clock_now_ns() + rebuild_ns;
    for (struct hg_shared_scene *it = table->scenes.first, *next; it; it = next) {
        next = it->next;
        if (link->state != HG_LINK_UP || link->replay.scene)
            return; // goes on when it is up, or the replay is over
        if (it->in_worker || it->link != link)
            continue;
        if (hg_clock_now_ns() >= end_ns) {
            link->feed.rebuild_goes_on = true;
            return;
        }
        if (!hg_journal_get_stats(it->journal).entries && !it->kept_until_ns) {
            attach_all(it);
            continue;
        }
        begin_replay(link, it);
        if (!link->replay.waiting)
            end_replay(link);
    }
    link->feed.rebuild = link->state != HG_LINK_UP || link->replay.scene;
    link->feed.pump |= !link->feed.rebuild; // suspects may have waited for it
}

void hg_recovery_continue(struct hg_link *link)
{
    struct hg_session_table *table = link->owner;
    link->feed.rebuild_goes_on = false;
    if (link->feed.rebuild)
        rebuild(link);
    hg_trial_check_time(link);
    if (link->feed.pump) {
        link->feed.pump = false;
        hg_session_request_pump_all(table, link);
    }
}

static void take_replay_answer(
    struct hg_link *link, const struct hg_packet *packet, const union hgp_any *m)
{
    uint16_t type = packet->header.type;
    if (!link->replay.scene ||
        packet->header.channel != hg_shared_scene_channel(link->replay.scene) ||
        !packet->header.request || type == HGP_T_progress || type == HGP_T_notice ||
        type == HGP_T_frame_part)
        return;
    if (type == HGP_T_error) {
        link->replay.failed++;
        hg_warn(JOURNAL, "scene '%s': an edit is refused now: %.*s: %.*s", link->replay.scene->key,
            (int)m->error.what.size, m->error.what.data, (int)m->error.reason.size,
            m->error.reason.data);
    }
    if (link->replay.waiting && --link->replay.waiting == 0)
        end_replay(link);
}

// ---- death --------------------------------------------------------------------------------------

static void give_up_scene(struct hg_session_table *table, struct hg_shared_scene *scene)
{
    const char *last_words = scene->link->farewell.words;
    struct hg_error err = {0};
    hg_error_set(&err, HG_E_WORKER, "scene", NULL,
        "the worker died %u times while this scene was built again; it was given up%s%s",
        scene->deaths, last_words[0] ? ": " : "", last_words);
    hg_fault(JOURNAL, HG_E_WORKER, "scene '%s': %s", scene->key, err.reason);
    for (struct hg_session *it = table->first; it; it = it->next) {
        if (it->scene != scene)
            continue;
        hg_session_request_fail_all(it, &err);
        if (it->conn)
            hg_conn_close(it->conn, &err, "the scene was lost");
    }
}

static void give_up_request(struct hg_session *s, struct hg_request *request)
{
    const char *name = hgp_find(request->packet->header.type)->name;
    const char *last_words = s->scene->link->farewell.words;
    struct hg_error err = {0};
    hg_error_set(&err, HG_E_WORKER, name, NULL,
        "the worker died %d times at this request; it is not tried again%s%s", request->deaths,
        last_words[0] ? ": " : "", last_words);
    hg_log_write(HG_LOG_WARN, HG_LOG_SESSION, HG_E_WORKER, s->number, "%s: %s", name, err.reason);
    if (s->conn) { // what was quarantined for it stays so
        hg_outq_hold(&s->conn->out, hg_state_log_position(s->table->scenes.log));
        hg_conn_fail(s->conn, request->client_id, &err);
    }
    hg_session_request_drop(s, request);
    s->table->ended |= !s->conn; // whose last edit this may have been
    if (++s->load.poisons < HG_SESSION_POISONS || !s->conn)
        return;
    hg_error_set(&err, HG_E_WORKER, "session", NULL,
        "requests of this session made the worker die again and again");
    hg_session_request_fail_all(s, &err);
    hg_conn_close(s->conn, &err, "the session is closed");
}

// Comes before all that the next worker answers.
static void notify_client(struct hg_session *s)
{
    if (s->conn && s->attached)
        hg_conn_send(s->conn, 0, HGP_T_notice,
            &(struct hgp_notice){.code = HG_E_WORKER,
                .what = hgp_str_make("worker"),
                .reason = hgp_str_make("it ended and is replaced; work in progress starts again")});
}

static void give_up_subscription(struct hg_session *s, struct hg_session_view *view)
{
    char place[32];
    struct hg_error err = {0};
    snprintf(place, sizeof place, "view %u", view->number);
    hg_error_set(&err, HG_E_WORKER, "subscribe", place,
        "the worker died again while it made frames of this view; it is no longer subscribed");
    hg_log_write(HG_LOG_WARN, HG_LOG_SESSION, HG_E_WORKER, s->number, "%s: %s", place, err.reason);
    if (s->conn)
        hg_conn_fail(s->conn, 0, &err);
    view->subscribed = view->resubscribe = false;
    view->credit = 0;
    hg_session_view_clear(s, view);
}

static void requeue_views(struct hg_session *s)
{
    for (struct hg_session_view *it = s->views; it; it = it->next) {
        if (hg_trial_blames_view(s, it))
            give_up_subscription(s, it);
        it->granted = 0;
        it->number_base = it->last_number;
    }
}

static void requeue(struct hg_session *s)
{
    struct hg_request *next;
    notify_client(s);
    s->attached = false;
    requeue_views(s);
    for (struct hg_request *it = s->first; it; it = next) {
        next = it->next;
        bool blamed = hg_trial_blames(s, it);
        hg_session_request_lost(s, it);
        if (!blamed)
            continue;
        give_up_request(s, it);
        if (!s->first)
            break; // the session was closed, nothing is left
    }
    hg_session_upload_verified(s, NULL);
}

// Too many deaths in too short a time: the daemon stays, the scenes of this worker do not.
static void end_all_sessions(struct hg_link *link)
{
    struct hg_session_table *table = link->owner;
    struct hg_error err = {0};
    hg_error_set(&err, HG_E_WORKER, "worker", NULL,
        "the worker died %u times within a minute (crash-limit); all scenes were given up",
        hg_link_recent_deaths(link));
    hg_fault(WORKER, HG_E_WORKER, "%s", err.reason);
    for (struct hg_session *it = table->first; it; it = it->next) {
        if (!it->scene || it->scene->link != link)
            continue;
        hg_session_request_fail_all(it, &err);
        if (it->conn)
            hg_conn_close(it->conn, &err, "the worker keeps dying");
    }
}

static void take_death(struct hg_link *link)
{
    struct hg_session_table *table = link->owner;
    struct hg_shared_scene *replaying = link->replay.scene;
    link->replay.scene = NULL;
    hg_trial_accuse(link);
    link->feed.rebuild = true;
    for (struct hg_shared_scene *it = table->scenes.first; it; it = it->next)
        if (it->link == link)
            it->in_worker = it->on_channel = false;
    for (struct hg_session *it = table->first; it; it = it->next)
        if (it->scene && it->scene->link == link)
            requeue(it);
    hg_trial_end(table, link);
    if (replaying && ++replaying->deaths >= REPLAY_DEATHS)
        give_up_scene(table, replaying);
    if (hg_link_recent_deaths(link) > link->options->crash_limit)
        end_all_sessions(link);
}

// ---- the link's events --------------------------------------------------------------------------

static void take_message(struct hg_link *link, struct hg_packet *packet, union hgp_any *m)
{
    uint32_t channel = packet->header.channel;
    if (channel & HG_SCENE_REPLAY_CHANNEL) {
        take_replay_answer(link, packet, m);
        return;
    }
    // A worker may only report on its own scenes.
    struct hg_session *session = hg_session_find(link->owner, channel);
    if (session && session->attached && session->scene->link == link)
        hg_session_answer(session, packet, m);
}

const struct hg_link_events hg_recovery_events = {
    .ready = hg_recovery_continue,
    .died = take_death,
    .message = take_message,
};
