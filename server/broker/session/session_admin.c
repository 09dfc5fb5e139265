#include "server/broker/session/session_admin.h"

#include <stdio.h>
#include <string.h>
#include <time.h>

#include "base/log.h"
#include "server/broker/session/session_audit.h"
#include "server/broker/session/session_end.h"
#include "server/broker/session/session_list.h"

enum {
    WAITING_BYTES = 64 << 10,
    LEAST_INTERVAL_MS = 100,
    DRAIN_REASON_BYTES = 256,
    AUDITED_BYTES = 300
};

static void answer(struct hg_session *s, uint32_t request, const struct hg_error *err)
{
    if (err->status)
        hg_conn_fail(s->conn, request, err);
    else if (request)
        hg_conn_send(s->conn, request, HGP_T_ok, &(struct hgp_ok){0});
}

// As much of a text as the audit log has of it.
static struct hgp_str audited(struct hgp_str text)
{
    return hgp_str_fit(
        text.size ? text.data : "", text.size < AUDITED_BYTES ? text.size : AUDITED_BYTES);
}

// ---- message ------------------------------------------------------------------------------------

void hg_session_admin_message(
    struct hg_session *s, uint32_t request, const struct hgp_message_send *m)
{
    struct hg_error err = {0};
    const uint64_t number = m->has_session ? m->session : 0;
    const struct hgp_str scene = m->has_scene ? m->scene : (struct hgp_str){0};
    struct hg_packet *packet = hg_packet_encode(
        HGP_T_message, &(struct hgp_message){.from = hgp_str_make(s->name), .text = m->text});
    uint32_t count = 0;
    for (struct hg_session *it = s->table->first; it && packet; it = it->next) {
        const bool meant = number       ? it->number == number
                           : scene.size ? it->scene && strlen(it->scene->name) == scene.size &&
                                              memcmp(it->scene->name, scene.data, scene.size) == 0
                                        : it != s;
        if (!meant || !it->conn || it->conn->state != HG_CONN_OPEN)
            continue;
        hg_conn_send_packet(it->conn, 0, hg_packet_ref(packet));
        count++;
    }
    hg_packet_unref(packet);
    if (!packet)
        hg_error_set(&err, HG_E_NOMEM, "message_send", NULL, "no memory for a message");
    else if (!count && (number || scene.size))
        hg_error_set(&err, HG_E_NOTFOUND, "message_send", number ? "session" : "scene",
            "no session that is meant has a client");
    char detail[400];
    snprintf(detail, sizeof detail, "to %u sessions: %.*s", count, (int)audited(m->text).size,
        m->text.size ? m->text.data : "");
    hg_session_audit(s, "message", err.status, detail);
    answer(s, request, &err);
}

// ---- kick ---------------------------------------------------------------------------------------

static struct hg_session *find(const struct hg_session_table *table, uint64_t number)
{
    struct hg_session *it = table->first;
    while (it && it->number != number)
        it = it->next;
    return it;
}

static bool shares_token(const struct hg_session *a, const uint8_t hash[32])
{
    return a->resume.has_token && memcmp(a->resume.token, hash, 32) == 0;
}

static enum hg_status block(
    struct hg_session *s, const struct hg_session *kicked, uint32_t block_s, struct hg_error *err)
{
    if (!kicked->resume.has_token)
        return hg_error_set(err, HG_E_INVAL, "kick", "block_s",
            "the daemon's own user has no token that could be blocked");
    if (shares_token(s, kicked->resume.token))
        return hg_error_set(
            err, HG_E_INVAL, "kick", "block_s", "that is the token of this very session");
    hg_block_add(s->table->blocks, s->table->scenes.log, kicked->resume.token,
        (uint64_t)time(NULL) + block_s);
    return HG_OK;
}

static void end_all(
    struct hg_session *s, struct hg_session *kicked, bool blocked, const struct hg_error *why)
{
    uint8_t hash[32];
    memcpy(hash, kicked->resume.token, sizeof hash);
    hg_session_end_now(kicked, why, "ended by an administrator");
    for (struct hg_session *it = blocked ? s->table->first : NULL, *next; it; it = next) {
        next = it->next;
        if (it != kicked && shares_token(it, hash))
            hg_session_end_now(it, why, "ended by an administrator");
    }
}

void hg_session_admin_kick(struct hg_session *s, uint32_t request, const struct hgp_kick *m)
{
    struct hg_error err = {0}, why = {0};
    struct hg_session *kicked = find(s->table, m->session);
    const uint32_t block_s = m->has_block_s ? m->block_s : 0;
    char detail[400];
    if (!kicked || (!kicked->conn && !kicked->resume.parked_ns))
        hg_error_set(&err, HG_E_NOTFOUND, "kick", "session", "there is no session %llu",
            (unsigned long long)m->session);
    else if (kicked == s)
        hg_error_set(&err, HG_E_INVAL, "kick", "session", "that is this very session");
    else if (block_s)
        (void)block(s, kicked, block_s, &err);
    char blocked[32] = "";
    if (block_s)
        snprintf(blocked, sizeof blocked, ", blocked for %u s", block_s);
    snprintf(detail, sizeof detail, "session %llu%s%s%s%s%.*s", (unsigned long long)m->session,
        kicked ? " of " : "", kicked ? kicked->name : "", blocked, m->reason.size ? ": " : "",
        (int)audited(m->reason).size, m->reason.size ? m->reason.data : "");
    hg_session_audit(s, "kick", err.status, detail);
    if (!err.status) {
        hg_error_set(&why, HG_E_PERM, "session", NULL, "an administrator has ended it%s%.*s",
            m->reason.size ? ": " : "", (int)m->reason.size, m->reason.size ? m->reason.data : "");
        end_all(s, kicked, block_s > 0, &why);
        hg_outq_hold(&s->conn->out, hg_state_log_position(s->table->scenes.log));
    }
    answer(s, request, &err);
}

// ---- drain --------------------------------------------------------------------------------------

static void tell_all(const struct hg_session_table *table, enum hgp_type type, const void *message)
{
    struct hg_packet *packet = hg_packet_encode(type, message);
    for (struct hg_session *it = table->first; it && packet; it = it->next)
        if (it->conn && it->conn->state == HG_CONN_OPEN)
            hg_conn_send_packet(it->conn, 0, hg_packet_ref(packet));
    hg_packet_unref(packet);
}

static void cancel(struct hg_session_table *table)
{
    if (table->drain.due_ns)
        tell_all(table, HGP_T_drain_cancelled, &(struct hgp_drain_cancelled){0});
    table->drain = (struct hg_session_drain){0};
}

// What becomes of the daemon is said with the reason, which is cut to leave room for it.
static void announce_drain(const struct hg_session_table *table, const struct hgp_drain_set *m)
{
    const char *fate =
        table->drain.stay ? "the daemon stays, for administrators alone" : "the daemon stops";
    const char *given = m->reason.size ? m->reason.data : "";
    char reason[DRAIN_REASON_BYTES + 1];
    size_t size = sizeof reason - sizeof " ()" - strlen(fate);
    if (size > m->reason.size)
        size = m->reason.size;
    while (size && size < m->reason.size && (given[size] & 0xc0) == 0x80)
        size--; // to the end of a character
    snprintf(reason, sizeof reason, size ? "%.*s (%s)" : "%.*s%s", (int)size, given, fate);
    tell_all(table, HGP_T_drain,
        &(struct hgp_drain){.deadline_ms = m->deadline_ms, .reason = hgp_str_make(reason)});
}

static void begin(struct hg_session_table *table, const struct hgp_drain_set *m)
{
    table->drain = (struct hg_session_drain){
        .due_ns = table->loop->now_ns + m->deadline_ms * UINT64_C(1000000),
        .stay = m->has_stay && m->stay};
    announce_drain(table, m);
}

void hg_session_admin_drain(struct hg_session *s, uint32_t request, const struct hgp_drain_set *m)
{
    struct hg_session_table *table = s->table;
    struct hg_error err = {0};
    char detail[400];
    if (table->draining)
        hg_error_set(&err, HG_E_STATE, "drain_set", NULL, "the daemon is ending already");
    const bool cancels = m->has_cancel && m->cancel, stays = m->has_stay && m->stay;
    if (cancels)
        snprintf(detail, sizeof detail, "cancelled");
    else
        snprintf(detail, sizeof detail, "at most %.1f s%s%s%.*s", m->deadline_ms * 1e-3,
            stays ? ", stays for administrators" : "", m->reason.size ? ": " : "",
            (int)audited(m->reason).size, m->reason.size ? m->reason.data : "");
    hg_session_audit(s, "drain", err.status, detail);
    if (!err.status) {
        hg_info(MAIN, "drain by session %llu (%s) of %s: %s", (unsigned long long)s->number,
            s->name, s->conn->peer.name, detail);
        if (cancels)
            cancel(table);
        else
            begin(table, m);
    }
    answer(s, request, &err);
}

static bool has_others(const struct hg_session_table *table)
{
    for (const struct hg_session *it = table->first; it; it = it->next)
        if (it->conn && it->role != HGP_role_ADMIN)
            return true;
    return false;
}

static void end_others(struct hg_session_table *table)
{
    struct hg_error err = {0};
    hg_error_set(&err, HG_E_CANCELLED, "session", NULL, "the daemon was drained");
    for (struct hg_session *it = table->first, *next; it; it = next) {
        next = it->next;
        if (it->conn && it->role != HGP_role_ADMIN)
            hg_session_leave_now(it, &err, "the daemon was drained");
    }
}

bool hg_session_admin_drained(struct hg_session_table *table)
{
    struct hg_session_drain *drain = &table->drain;
    if (!drain->due_ns || drain->over || table->draining)
        return false;
    if (table->loop->now_ns < drain->due_ns && has_others(table))
        return false;
    drain->over = true;
    if (drain->stay)
        end_others(table);
    return !drain->stay;
}

// ---- statistics ---------------------------------------------------------------------------------

void hg_session_admin_watch(
    struct hg_session *s, uint32_t request, const struct hgp_sessions_watch *m)
{
    struct hg_error err = {0};
    if (m->interval_ms && m->interval_ms < LEAST_INTERVAL_MS)
        hg_error_set(&err, HG_E_INVAL, "sessions_watch", "interval_ms", "at least %d, or 0 to stop",
            LEAST_INTERVAL_MS);
    else
        s->pace.statistics_ns = m->interval_ms * UINT64_C(1000000);
    hg_session_audit(s, "sessions_watch", err.status, NULL);
    answer(s, request, &err);
}

static void tell_statistics(struct hg_session *s)
{
    struct hg_writer w = {.limit_bytes = 16 << 20};
    s->pace.told_ns = s->table->loop->now_ns;
    hg_session_list_write(&w, s->table);
    if (!w.failed)
        hg_conn_send(s->conn, 0, HGP_T_statistics,
            &(struct hgp_statistics){.text = {(const char *)w.data, (uint32_t)w.size}});
    hg_writer_finish(&w);
}

void hg_session_admin_tick(struct hg_session_table *table)
{
    const uint64_t now_ns = table->loop->now_ns;
    for (struct hg_session *it = table->first; it; it = it->next)
        if (it->pace.statistics_ns && it->conn && it->conn->state == HG_CONN_OPEN &&
            now_ns - it->pace.told_ns >= it->pace.statistics_ns &&
            it->conn->out.bytes < WAITING_BYTES)
            tell_statistics(it);
}
