#include "server/broker/session/resume.h"

#include <openssl/crypto.h>
#include <string.h>

#include "base/log.h"
#include "base/sha256.h"
#include "server/broker/session/session.h"
#include "server/broker/session/session_audit.h"
#include "server/broker/session/session_park.h"
#include "server/broker/session/session_record.h"
#include "server/broker/session/session_request.h"
#include "server/broker/session/session_share.h"
#include "server/broker/session/session_upload.h"
#include "server/broker/workers/worker_pool.h"

enum { SECRET_BYTES = 32 };

void hg_resume_keep(struct hg_session *s, uint32_t request)
{
    struct hg_error err = {0};
    uint8_t secret[SECRET_BYTES];
    if (!s->table->options->resume_timeout_ns)
        hg_error_set(&err, HG_E_UNSUPPORTED, "keep", NULL,
            "sessions are not kept by this daemon (resume-timeout)");
    else if (!hg_session_new_ticket(s, secret, &err)) {
        hg_session_record_all(s);
        hg_outq_hold_kept(&s->conn->out, hg_state_log_position(s->table->scenes.log));
    }
    if (err.status)
        hg_conn_fail(s->conn, request, &err);
    else if (request)
        hg_conn_send(s->conn, request, HGP_T_ticket,
            &(struct hgp_ticket){
                .secret = {secret, sizeof secret}, .valid_s = hg_session_valid_s(s->table)});
    OPENSSL_cleanse(secret, sizeof secret);
}

// The session of the ticket, if this client may have it.
static struct hg_session *find(const struct hg_session *asker, const struct hgp_resume *m)
{
    uint8_t hash[32];
    if (hg_sha256(m->secret.size ? m->secret.data : (const uint8_t *)"", m->secret.size, hash))
        return NULL;
    struct hg_session *s = hg_session_find_ticket(asker->table, hash);
    bool may = s && s != asker && s->role == asker->role && strcmp(s->tenant, asker->tenant) == 0 &&
               s->resume.has_token == asker->resume.has_token &&
               memcmp(s->resume.token, asker->resume.token, sizeof s->resume.token) == 0 &&
               (s->conn || s->resume.parked_ns);
    return may ? s : NULL;
}

// The connection that it had may be dead without the daemon knowing.
static void take_from_client(struct hg_session *s)
{
    struct hg_conn *conn = s->conn;
    if (!conn)
        return;
    s->conn = NULL;
    conn->session = NULL;
    hg_session_upload_abort_all(s);
    if (hg_session_is_kept(s))
        hg_session_park(s);
    hg_conn_kill(conn, "its session was resumed on another connection");
}

static void answer(struct hg_session *s, uint32_t request, const uint8_t secret[SECRET_BYTES])
{
    const struct hg_shared_scene *scene = s->scene;
    hg_conn_send(s->conn, request, HGP_T_resumed,
        &(struct hgp_resumed){.session = s->number,
            .secret = {secret, SECRET_BYTES},
            .valid_s = hg_session_valid_s(s->table),
            .revision = scene ? scene->revision : 0,
            .first_id = scene ? s->first_id : 0,
            .id_count = scene ? HG_SCENE_ID_RANGE : 0});
}

void hg_resume(struct hg_conn *conn, uint32_t request, const struct hgp_resume *m)
{
    struct hg_session *asker = conn->session, *s = find(asker, m);
    struct hg_error err = {0};
    uint8_t secret[SECRET_BYTES];
    if (asker->scene)
        hg_error_set(&err, HG_E_STATE, "resume", NULL, "close the open scene first");
    else if (!s)
        hg_error_set(&err, HG_E_AUTH, "resume", "secret",
            "no session is kept for this ticket and this token");
    else if (hg_session_new_ticket(s, secret, &err) == HG_OK)
        take_from_client(s);
    if (err.status) {
        hg_session_audit(asker, "resume", err.status, NULL);
        hg_conn_fail(conn, request, &err);
        return;
    }
    s->scope = asker->scope;
    if (s->scene)
        hg_worker_pool_weigh(s->table->pool, s->scene->link, s->scope.weight);
    hg_session_unpark(s, conn);
    hg_session_audit(s, "resume", HG_OK, NULL); // now that it has a peer
    hg_info(SESSION, "session %llu (%s) goes on from %s, in place of session %llu",
        (unsigned long long)s->number, s->name, conn->peer.name, (unsigned long long)asker->number);
    hg_session_destroy(asker);
    hg_session_record(s);
    answer(s, request, secret); // before all frames
    OPENSSL_cleanse(secret, sizeof secret);
    hg_session_share_resume(s);
    if (s->attached) {
        hg_session_request_tell_tenant(s);
        hg_session_request_restore(s);
    }
}
