#include "server/broker/session/session_end.h"

#include "server/broker/session/session_audit.h"
#include "server/broker/session/session_record.h"
#include "server/broker/session/session_request.h"

// Edits stay under way.
static void fail_requests(struct hg_session *s, const struct hg_error *err)
{
    for (struct hg_request *it = s->first, *next; it; it = next) {
        next = it->next;
        if (hg_journal_wants(it->packet->header.type))
            continue;
        if (s->conn && it->client_id)
            hg_conn_fail(s->conn, it->client_id, err);
        hg_session_request_drop(s, it);
    }
}

uint64_t hg_session_end_now(struct hg_session *s, const struct hg_error *err, const char *reason)
{
    hg_session_record_end(s);
    s->resume.has_ticket = false;
    fail_requests(s, err);
    if (s->conn)
        hg_conn_close(s->conn, err, reason);
    if (s->resume.parked_ns) {
        hg_session_audit(s, "logout", err->status, err->reason);
        s->resume.parked_ns = 0;
        s->table->ended = true;
    }
    return hg_state_log_position(s->table->scenes.log);
}

void hg_session_leave_now(struct hg_session *s, const struct hg_error *err, const char *reason)
{
    if (!s->resume.has_ticket || !s->table->options->resume_timeout_ns) {
        hg_session_end_now(s, err, reason);
        return;
    }
    fail_requests(s, err);
    s->resume.waits = true;
    hg_conn_close(s->conn, err, reason);
}

static void check_idle(struct hg_session *s, uint64_t now_ns)
{
    const struct hg_options *o = s->table->options;
    struct hg_session_pace *pace = &s->pace;
    struct hg_error err = {0};
    if (!s->conn || s->conn->state != HG_CONN_OPEN)
        return;
    if (!pace->active_ns || s->load.count) // what it waits for is as good as what it does
        pace->active_ns = now_ns;
    const uint64_t idle_ns = now_ns - pace->active_ns;
    const uint64_t most_ns = o->session_idle_timeout_ns;
    if (idle_ns >= most_ns) {
        hg_error_set(&err, HG_E_TIMEOUT, "session", NULL,
            "its client did nothing for %.0f s (session-idle-timeout)", (double)most_ns * 1e-9);
        hg_session_audit(s, "idle", HG_E_TIMEOUT, NULL);
        hg_session_end_now(s, &err, "idle for too long");
    } else if (!pace->warned && idle_ns + o->session_idle_warning_ns >= most_ns) {
        pace->warned = true;
        hg_conn_send(s->conn, 0, HGP_T_idle_warning,
            &(struct hgp_idle_warning){.remaining_ms = (uint32_t)((most_ns - idle_ns) / 1000000)});
    }
}

void hg_session_end_idle(struct hg_session_table *table)
{
    const uint64_t now_ns = table->loop->now_ns;
    for (struct hg_session *it = table->first, *next; it; it = next) {
        next = it->next;
        if (table->options->session_idle_timeout_ns)
            check_idle(it, now_ns);
    }
}
