#include "server/broker/session/session_ticket.h"

#include <fnmatch.h>
#include <openssl/crypto.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "base/json.h"
#include "server/broker/session/session_allow.h"
#include "server/broker/session/session_audit.h"
#include "server/broker/session/session_end.h"
#include "server/broker/session/session_list.h"
#include "server/broker/session/session_rules.h"

enum { VALID_S = 3600 };

static uint32_t count_sessions(
    const struct hg_session_table *table, const struct hg_join_ticket *ticket)
{
    uint32_t count = 0;
    for (const struct hg_session *it = table->first; it; it = it->next)
        count += it->resume.has_token &&
                 memcmp(it->resume.token, ticket->hash, sizeof ticket->hash) == 0;
    return count;
}

// Made with the session's token, or by the daemon's own user.
static bool may_see(const struct hg_session *s, const struct hg_join_ticket *ticket)
{
    if (s->role == HGP_role_ADMIN)
        return true;
    return !s->scope.is_ticket && s->resume.has_token && ticket->has_issuer_key &&
           memcmp(s->resume.token, ticket->issuer_key, sizeof ticket->issuer_key) == 0;
}

// ---- make ---------------------------------------------------------------------------------------

static bool is_own(const struct hg_session *s, const struct hg_join_ticket *ticket)
{
    return ticket->has_issuer_key == s->resume.has_token &&
           memcmp(ticket->issuer_key, s->resume.token, sizeof ticket->issuer_key) == 0;
}

// How long until one of the tenant's, or of the session's own token, ends by itself, at most an
// hour.
static uint32_t retry_ms(const struct hg_session *s, bool own, uint64_t now_s)
{
    uint64_t least_s = VALID_S;
    for (uint32_t i = 0; i < s->table->tickets->count; i++) {
        const struct hg_join_ticket *it = &s->table->tickets->items[i];
        if ((own ? is_own(s, it) : strcmp(it->tenant, s->tenant) == 0) && it->until_s > now_s &&
            it->until_s - now_s < least_s)
            least_s = it->until_s - now_s;
    }
    return (uint32_t)least_s * 1000;
}

static uint32_t count_own(const struct hg_session *s)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < s->table->tickets->count; i++)
        count += is_own(s, &s->table->tickets->items[i]);
    return count;
}

static enum hg_status check_count(const struct hg_session *s, struct hg_error *err)
{
    const uint32_t most = s->table->options->max_tickets;
    const bool own = hg_join_tickets_of(s->table->tickets, s->tenant) < most;
    if (!own)
        hg_error_set(err, HG_E_LIMIT, "join_make", NULL,
            "this tenant has %u join tickets, as many as it may (max-tickets); revoke some", most);
    else if (s->scope.max_tickets && count_own(s) >= s->scope.max_tickets)
        hg_error_set(err, HG_E_LIMIT, "join_make", NULL,
            "this token has %u join tickets, as many as its line allows (tickets=); revoke some",
            s->scope.max_tickets);
    else
        return HG_OK;
    return hg_error_limit(
        err, own ? "tickets" : "max-tickets", retry_ms(s, own, (uint64_t)time(NULL)));
}

static enum hg_status check_make(const struct hg_session *s, const struct hg_join_ticket *like,
    uint32_t role, struct hg_error *err)
{
    if (s->scope.is_ticket)
        return hg_error_set(
            err, HG_E_PERM, "join_make", NULL, "a session of a join ticket makes none itself");
    if (s->role < HGP_role_EDIT && !s->scope.max_tickets)
        return hg_error_set(err, HG_E_PERM, "join_make", NULL,
            "needs the role EDIT, or tickets=COUNT in the token's line");
    if (role != HGP_role_VIEW && role != HGP_role_EDIT)
        return hg_error_set(err, HG_E_INVAL, "join_make", "role", "a ticket has VIEW or EDIT");
    if (role > s->role)
        return hg_error_set(err, HG_E_PERM, "join_make", "role",
            "a ticket has at most the role of the one that makes it, here %s",
            hgp_enum_name("role", s->role));
    if (!like->scene[0])
        return hg_error_set(
            err, HG_E_INVAL, "join_make", "scene", "name a scene, or open one that has a name");
    if (s->scope.scenes[0] && fnmatch(s->scope.scenes, like->scene, 0) != 0)
        return hg_error_set(err, HG_E_PERM, "join_make", "scene",
            "this token may open scenes named '%s' only", s->scope.scenes);
    return check_count(s, err);
}

static void take_text(char *out, size_t size, struct hgp_str text)
{
    snprintf(out, size, "%.*s", (int)text.size, text.size ? text.data : "");
}

static void fill(
    const struct hg_session *s, const struct hgp_join_make *m, struct hg_join_ticket *out)
{
    *out = (struct hg_join_ticket){.role = m->has_role ? m->role : HGP_role_VIEW,
        .uses = m->has_uses ? m->uses : 1,
        .weight = s->scope.weight,
        .max_rate = s->scope.max_rate,
        .max_pixels = s->scope.max_pixels,
        .has_issuer_key = s->resume.has_token,
        .until_s = (uint64_t)time(NULL) + (m->has_valid_s ? m->valid_s : VALID_S)};
    memcpy(out->issuer_key, s->resume.token, sizeof out->issuer_key);
    snprintf(out->tenant, sizeof out->tenant, "%s", s->tenant);
    snprintf(out->issuer, sizeof out->issuer, "%s", s->name);
    snprintf(out->roots, sizeof out->roots, "%s", s->scope.roots);
    if (m->has_scene)
        take_text(out->scene, sizeof out->scene, m->scene);
    else
        snprintf(out->scene, sizeof out->scene, "%s", s->scene ? s->scene->name : "");
    take_text(out->label, sizeof out->label, m->has_label ? m->label : hgp_str_make("guest"));
}

static void audit(const struct hg_session *s, const char *event, enum hg_status status,
    const struct hg_join_ticket *it)
{
    char detail[400];
    snprintf(detail, sizeof detail, "ticket %u for '%s', role %s, %u uses, scene '%s'", it->number,
        it->label, hgp_enum_name("role", it->role) ? hgp_enum_name("role", it->role) : "none",
        it->uses, it->scene);
    hg_session_audit(s, event, status, detail);
}

void hg_session_ticket_make(struct hg_session *s, uint32_t request, const struct hgp_join_make *m)
{
    struct hg_error err = {0};
    struct hg_join_ticket it;
    char secret[HG_JOIN_SECRET] = "";
    uint64_t at = 0;
    fill(s, m, &it);
    enum hg_status status = hg_session_allow_act(s, "join_make", &err);
    if (!status)
        status = hg_session_rules_may_change(s->table, "join_make", &err);
    if (!status)
        status = check_make(s, &it, it.role, &err);
    if (!status &&
        (status = hg_join_ticket_make(s->table->tickets, s->table->scenes.log, &it, secret, &at)))
        hg_error_set(&err, status, "join_make", NULL, "no memory or random numbers for a ticket");
    audit(s, "join_make", status, &it);
    if (status) {
        hg_conn_fail(s->conn, request, &err);
        return;
    }
    hg_outq_hold(&s->conn->out, at);
    if (request)
        hg_conn_send(s->conn, request, HGP_T_join_ticket,
            &(struct hgp_join_ticket){.ticket = it.number,
                .secret = hgp_str_make(secret),
                .scene = hgp_str_make(it.scene),
                .role = it.role,
                .uses = it.uses,
                .valid_s = m->has_valid_s ? m->valid_s : VALID_S});
    OPENSSL_cleanse(secret, sizeof secret);
}

// ---- list ---------------------------------------------------------------------------------------

static void put_ticket(struct hg_writer *w, const struct hg_session_table *table,
    const struct hg_join_ticket *it, uint64_t now_s)
{
    hg_json_put_number(w, "{\"ticket\":", it->number);
    hg_json_put_text(w, ",\"label\":", it->label);
    hg_json_put_text(w, ",\"scene\":", it->scene);
    hg_json_put_text(w, ",\"role\":", hgp_enum_name("role", it->role));
    hg_json_put_number(w, ",\"uses\":", it->uses);
    hg_json_put_number(w, ",\"used\":", it->used);
    hg_json_put_number(w, ",\"valid_s\":", it->until_s > now_s ? it->until_s - now_s : 0);
    hg_json_put_number(w, ",\"sessions\":", count_sessions(table, it));
    hg_json_put_text(w, ",\"issuer\":", it->issuer);
    hg_json_put_text(w, ",\"tenant\":", it->tenant);
    hg_json_put(w, "}");
}

void hg_session_ticket_list(struct hg_session *s, uint32_t request)
{
    struct hg_writer w = {.limit_bytes = 16 << 20};
    const struct hg_join_tickets *all = s->table->tickets;
    const char *separator = "{\"tickets\":[";
    for (uint32_t i = 0; i < all->count; i++) {
        if (!may_see(s, &all->items[i]))
            continue;
        hg_json_put(&w, "%s", separator);
        put_ticket(&w, s->table, &all->items[i], (uint64_t)time(NULL));
        separator = ",";
    }
    hg_json_put(&w, "%s", separator[0] == '{' ? "{\"tickets\":[]}" : "]}");
    hg_session_list_answer(s, request, &w, "join_query");
}

// ---- revoke -------------------------------------------------------------------------------------

// Ends its sessions, but for the one that asks.
static uint64_t revoke(struct hg_session_table *table, const struct hg_session *asker,
    struct hg_join_ticket *ticket, const char *reason)
{
    struct hg_error err = {0};
    const uint32_t number = ticket->number;
    uint8_t hash[32];
    memcpy(hash, ticket->hash, sizeof hash);
    hg_error_set(&err, HG_E_AUTH, "session", NULL, "%s", reason);
    for (struct hg_session *it = table->first, *next; it; it = next) {
        next = it->next;
        if (it == asker || !it->resume.has_token || memcmp(it->resume.token, hash, 32) != 0)
            continue;
        hg_session_audit(it, "revoke", HG_E_AUTH, reason);
        hg_session_end_now(it, &err, "the join ticket was revoked");
    }
    return hg_join_ticket_remove(table->tickets, table->scenes.log, number);
}

void hg_session_ticket_revoke(
    struct hg_session *s, uint32_t request, const struct hgp_join_revoke *m)
{
    struct hg_join_tickets *all = s->table->tickets;
    struct hg_error err = {0};
    uint32_t count = 0;
    uint64_t at = 0;
    for (uint32_t i = all->count; i-- > 0;) {
        struct hg_join_ticket *it = &all->items[i];
        if ((m->ticket && it->number != m->ticket) || !may_see(s, it))
            continue;
        audit(s, "join_revoke", HG_OK, it);
        at = revoke(s->table, s, it, "its join ticket was revoked");
        count++;
    }
    if (!count && m->ticket) {
        hg_error_set(&err, HG_E_NOTFOUND, "join_revoke", "ticket",
            "there is no ticket %llu that this session may revoke", (unsigned long long)m->ticket);
        hg_session_audit(s, "join_revoke", err.status, err.reason);
        hg_conn_fail(s->conn, request, &err);
        return;
    }
    hg_outq_hold(&s->conn->out, at);
    if (request)
        hg_conn_send(s->conn, request, HGP_T_ok, &(struct hgp_ok){0});
}

// ---- in time ------------------------------------------------------------------------------------

// A ticket is never worth more than the token that made it is now.
static bool has_issuer(
    const struct hg_join_ticket *it, const struct hg_tokens *tokens, uint64_t now_s)
{
    if (!it->has_issuer_key)
        return true;
    const struct hg_token *issuer = hg_tokens_find(tokens, it->issuer_key, (int64_t)now_s);
    return issuer && issuer->role >= it->role && strcmp(issuer->tenant, it->tenant) == 0 &&
           (issuer->role >= HGP_role_EDIT || issuer->scope.max_tickets) &&
           (!issuer->scope.scenes[0] || fnmatch(issuer->scope.scenes, it->scene, 0) == 0);
}

void hg_session_ticket_check(
    struct hg_session_table *table, const struct hg_tokens *tokens, uint64_t now_s)
{
    struct hg_join_tickets *all = table->tickets;
    for (uint32_t i = all->count; i-- > 0;) {
        struct hg_join_ticket *it = &all->items[i];
        if (!has_issuer(it, tokens, now_s))
            revoke(
                table, NULL, it, "the token that its join ticket was made with is not what it was");
        else if (!hg_join_ticket_is_good(it, now_s) && !count_sessions(table, it))
            hg_join_ticket_remove(all, table->scenes.log, it->number);
    }
}
