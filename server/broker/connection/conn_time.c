#include "server/broker/connection/conn_time.h"

#include <stdio.h>

#include "base/alloc.h"
#include "server/broker/metrics/counters.h"

enum { RESTED_BEFORE_TRIM = 64 };
static const uint64_t trim_after_ns = 5000000000; // where fewer have rested
static const uint64_t rest_ns = 2000000000;

static void check_idle(struct hg_conn *conn, uint64_t now_ns)
{
    const struct hg_options *o = conn->table->options;
    uint64_t silent_ns = now_ns - conn->received_ns;
    if (conn->peer.is_local || conn->turn.paused)
        return;
    if (o->idle_timeout_ns && silent_ns > o->idle_timeout_ns) {
        hg_count(HG_COUNT_REFUSED_IDLE);
        hg_conn_kill(conn, "silent for too long (idle-timeout)");
    } else if (silent_ns > o->idle_ping_ns && !conn->ping_ns) {
        conn->ping_ns = now_ns;
        hg_conn_send_urgent(conn, 0, HGP_T_ping, &(struct hgp_ping){.nonce = now_ns});
    }
}

// Once, before what is held: else its client would see a picture that stands still, and no reason.
static void warn_of_held(struct hg_conn *conn)
{
    const struct hg_outq *q = &conn->out;
    char reason[200];
    if (!q->reached || !q->reached->status) {
        conn->warned = false;
    } else if (!conn->warned && conn->state == HG_CONN_OPEN && hg_outq_is_stopped(q)) {
        conn->warned = true;
        snprintf(reason, sizeof reason,
            "the daemon's state cannot be written: %s; the answer to the newest edit, and all that "
            "comes behind it, waits until that is over",
            hg_status_text(q->reached->status));
        hg_conn_send_urgent(conn, 0, HGP_T_notice,
            &(struct hgp_notice){.code = (uint16_t)q->reached->status,
                .what = hgp_str_make("state-dir"),
                .reason = hgp_str_make(reason)});
    }
}

static void check_time(struct hg_conn *conn, uint64_t now_ns)
{
    const struct hg_options *o = conn->table->options;
    if (conn->state == HG_CONN_CLOSING) {
        if (now_ns > conn->deadline_ns)
            hg_conn_kill(conn, "did not take its last messages");
        return;
    }
    if (conn->slot.why && now_ns > conn->deadline_ns) {
        hg_conn_kill(conn, conn->slot.why->reason);
        return;
    }
    if (conn->state < HG_CONN_OPEN && now_ns > conn->deadline_ns) {
        struct hg_error err = {0};
        if (conn->state == HG_CONN_PREFACE && hg_transport_refuse(&conn->transport, NULL)) {
            hg_count(HG_COUNT_REFUSED_HANDSHAKE_TIMEOUT);
            hg_conn_close_transport(conn);
            hg_conn_update(conn);
            return;
        }
        if (!conn->transport.served)
            hg_count(HG_COUNT_REFUSED_HANDSHAKE_TIMEOUT);
        hg_error_set(&err, HG_E_TIMEOUT, "handshake", NULL, "was not finished in time");
        if (conn->state == HG_CONN_PREFACE)
            hg_conn_kill(conn, "sent no preface in time");
        else
            hg_conn_close(conn, &err, "handshake");
        return;
    }
    warn_of_held(conn);
    hg_outq_excuse(&conn->out, now_ns);
    if (conn->out.head && now_ns > conn->out.progress_ns + o->peer_timeout_ns) {
        hg_count(HG_COUNT_REFUSED_PEER_TIMEOUT);
        hg_conn_kill(conn, "takes nothing of what waits for it (peer-timeout)");
        return;
    }
    if (!hg_outq_is_drained(&conn->out, now_ns, o->peer_timeout_ns, o->min_drain * 1024.)) {
        hg_count(HG_COUNT_REFUSED_MIN_DRAIN);
        hg_conn_kill(conn, "takes too little of what waits for it (min-drain)");
        return;
    }
    if (conn->auth.due_ns && now_ns >= conn->auth.due_ns) {
        conn->auth.due_ns = 0;
        conn->table->events->due(conn);
    }
    if (now_ns - conn->received_ns > rest_ns)
        conn->table->rested += hgp_framer_rest(&conn->in);
    if (conn->state == HG_CONN_OPEN)
        check_idle(conn, now_ns);
}

void hg_conn_check_times(struct hg_conn_table *table)
{
    uint64_t now_ns = table->loop->now_ns;
    for (struct hg_conn *it = table->first, *next; it; it = next) {
        next = it->next;
        check_time(it, now_ns);
    }
    hgp_chunk_pool_trim(&table->chunks);
    // The heap keeps what was freed in its middle.
    if (table->rested >= RESTED_BEFORE_TRIM ||
        (table->rested > 0 && now_ns - table->trimmed_ns >= trim_after_ns)) {
        hg_alloc_trim();
        table->rested = 0;
        table->trimmed_ns = now_ns;
    }
}
