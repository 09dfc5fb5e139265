#include "server/broker/connection/conn_admission.h"

enum { FIRST_BYTES_NS = 1000000000 }; // that one that is refused has time to say something

static const char too_many[] = "too many connections";

// In the language of its client, or in HGP.
static void say(struct hg_conn *conn, const struct hg_refusal *refusal)
{
    struct hg_error err = {0};
    conn->slot.why = NULL;
    if (hg_transport_refuse(&conn->transport, refusal->reason)) {
        hg_conn_close_transport(conn);
        hg_conn_update(conn);
        return;
    }
    hg_error_set(&err, HG_E_LIMIT, "connection", NULL, "%s; try again later", refusal->reason);
    hg_error_limit(&err, refusal->limit, refusal->retry_after_ms);
    hg_conn_close(conn, &err, too_many);
    if (conn->state != HG_CONN_DEAD && hg_outq_flush(&conn->out, &conn->transport) == HG_OK)
        hg_conn_kill(conn, too_many);
}

static struct hg_conn *find_silent(const struct hg_conn_table *table)
{
    struct hg_conn *oldest = NULL;
    for (struct hg_conn *it = table->first; it; it = it->next)
        if (it->slot.why && (!oldest || it->deadline_ns < oldest->deadline_ns))
            oldest = it;
    return oldest;
}

// A place among the refused that are still to be answered. Where there is none, the one that has
// been silent for longest gives its own. False: all are being answered.
static bool take_place(struct hg_conn *conn)
{
    struct hg_conn_table *table = conn->table;
    if (hg_slots_refuse(&table->slots, &conn->slot, table->loop->now_ns))
        return true;
    struct hg_conn *silent = find_silent(table);
    if (!silent)
        return false;
    hg_conn_kill(silent, silent->slot.why->reason);
    return hg_slots_refuse(&table->slots, &conn->slot, table->loop->now_ns);
}

static void turn_away(struct hg_conn *conn, const struct hg_refusal *refusal)
{
    const bool waits = hg_detect_hold(&conn->transport);
    if (!waits)
        say(conn, refusal);
    if (conn->state == HG_CONN_DEAD)
        return;
    if (!take_place(conn)) {
        hg_conn_kill(conn, too_many);
    } else if (waits) {
        conn->slot.why = refusal;
        conn->deadline_ns = conn->table->loop->now_ns + FIRST_BYTES_NS;
    }
}

// Browsers keep connections for requests that may never come: the one that waits longest gives way
// to a newcomer for which there would be no slot.
static void make_room(const struct hg_conn *conn)
{
    struct hg_conn *oldest;
    do {
        oldest = NULL;
        for (struct hg_conn *it = conn->table->first; it; it = it->next)
            if (hg_conn_is_between(it) && (!oldest || it->received_ns < oldest->received_ns) &&
                hg_slots_would_gain(&conn->table->slots, &conn->slot, &it->slot))
                oldest = it;
        if (oldest)
            hg_conn_kill(oldest, "gives way to a new one");
    } while (oldest);
}

void hg_conn_admit(struct hg_conn *conn)
{
    make_room(conn);
    const struct hg_refusal *refusal = hg_slots_refusal(&conn->table->slots, &conn->slot);
    if (refusal)
        turn_away(conn, refusal);
}

void hg_conn_answer_refusal(struct hg_conn *conn, enum hg_status status)
{
    if (status && status != HG_E_AGAIN)
        hg_conn_kill(conn, conn->slot.why->reason);
    else if (conn->transport.class != &hg_transport_detect)
        say(conn, conn->slot.why);
}
