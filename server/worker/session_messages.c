#include "server/worker/session_messages.h"

#include "base/clock.h"
#include "base/log.h"

static void attach(const struct request *r)
{
    const struct hgp_session_attach *m = &r->message->session_attach;
    struct hg_error err = {0};
    struct session *session;
    if (hg_worker_session_create(r->s, r->to.channel, m, &session, &err)) {
        hg_reply_error(r->to, &err);
        return;
    }
    hg_log_write(HG_LOG_INFO, HG_LOG_SESSION, HG_OK, m->session, "attached to scene '%s'%s",
        session->scene->key, m->replay ? " for replay" : "");
    hg_reply_ok(r->to, session->scene->scene->revision);
}

void hg_worker_session_message_detach(struct render_state *s, struct session *session)
{
    hg_worker_session_close_batch(session);
    while (session->views)
        hg_view_slot_destroy(s, session, session->views);
    hg_worker_session_destroy(s, session);
}

static void end_replay(struct session *session, uint64_t revision)
{
    struct hg_scene *scene = session->scene->scene;
    session->restoring = false;
    if (scene->revision < revision)
        scene->revision = revision;
}

// The broker opens scenes; on a private link the session has its own.
static void answer_scene(const struct request *r)
{
    hg_reply_send(r->to, HGP_T_scene_opened,
        &(struct hgp_scene_opened){.revision = r->session->scene->scene->revision,
            .first_id = r->session->first_id,
            .id_count = r->session->id_count});
}

bool hg_worker_session_message_handle(const struct request *r, uint16_t type)
{
    switch (type) {
    case HGP_T_session_attach:
        attach(r);
        return true;
    case HGP_T_session_tenant:
        if (r->session &&
            hg_worker_session_set_tenant(r->s, r->session, &r->message->session_tenant))
            hg_warn(SESSION, "no memory for the turns of a tenant");
        return true;
    case HGP_T_session_detach:
        if (r->session)
            hg_worker_session_message_detach(r->s, r->session);
        return true;
    case HGP_T_replay_end:
        if (r->session)
            end_replay(r->session, r->message->replay_end.revision);
        return true;
    case HGP_T_ping:
        hg_reply_send(r->to, HGP_T_pong, &(struct hgp_pong){.nonce = r->message->ping.nonce});
        return true;
    case HGP_T_clock_query:
        hg_reply_send(r->to, HGP_T_clock, &(struct hgp_clock){.time_ns = hg_clock_now_ns()});
        return true;
    case HGP_T_pong:
        return true;
    case HGP_T_scene_open:
        if (r->session)
            answer_scene(r);
        return r->session != NULL;
    default:
        return false;
    }
}
