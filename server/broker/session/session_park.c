#include "server/broker/session/session_park.h"

#include <openssl/crypto.h>
#include <openssl/rand.h>
#include <string.h>

#include "base/sha256.h"
#include "server/broker/session/session_audit.h"
#include "server/broker/session/session_record.h"
#include "server/broker/session/session_request.h"
#include "server/broker/session/session_share.h"
#include "server/broker/session/session_upload.h"
#include "server/broker/session/session_view.h"

// ---- tickets ------------------------------------------------------------------------------------

enum hg_status hg_session_new_ticket(struct hg_session *s, uint8_t secret[32], struct hg_error *err)
{
    uint8_t hash[32];
    if (RAND_bytes(secret, 32) != 1)
        return hg_error_set(err, HG_E_INTERNAL, "ticket", NULL, "no random numbers");
    if (hg_sha256(secret, 32, hash))
        return hg_error_set(err, HG_E_NOMEM, "ticket", NULL, "no memory for a ticket");
    memcpy(s->resume.ticket, hash, sizeof hash);
    s->resume.has_ticket = true;
    return HG_OK;
}

uint32_t hg_session_valid_s(const struct hg_session_table *table)
{
    return (uint32_t)(table->options->resume_timeout_ns / 1000000000u);
}

struct hg_session *hg_session_find_ticket(
    const struct hg_session_table *table, const uint8_t hash[32])
{
    struct hg_session *found = NULL;
    for (struct hg_session *it = table->first; it; it = it->next)
        if (it->resume.has_ticket && CRYPTO_memcmp(it->resume.ticket, hash, 32) == 0)
            found = it;
    return found;
}

// ---- who is kept --------------------------------------------------------------------------------

static bool shares_token(const struct hg_session *a, const struct hg_session *b)
{
    return a->resume.has_token == b->resume.has_token &&
           memcmp(a->resume.token, b->resume.token, sizeof a->resume.token) == 0;
}

static void end(struct hg_session *s, enum hg_status status, const char *reason)
{
    hg_session_audit(s, "logout", status, reason);
    s->resume.parked_ns = 0;
    s->table->ended = true;
}

// What breaks one connection, a proxy or a switch, breaks those beside it: that many come back.
static const uint64_t grace_ns = 30000000000u;

// Whom a limit counts.
struct whom {
    const struct hg_session *like; // those of its token; NULL: all
    uint64_t until_ns;             // those who were parked until then
};

// How many are parked, and the first of them.
static uint32_t count(
    const struct hg_session_table *table, struct whom whom, struct hg_session **oldest)
{
    uint32_t n = 0;
    *oldest = NULL;
    for (struct hg_session *it = table->first; it; it = it->next) {
        if (!it->resume.parked_ns || it->resume.parked_ns > whom.until_ns ||
            (whom.like && !shares_token(it, whom.like)))
            continue;
        n++;
        if (!*oldest || it->resume.parked_ns < (*oldest)->resume.parked_ns)
            *oldest = it;
    }
    return n;
}

uint32_t hg_session_count_parked(const struct hg_session_table *table)
{
    struct hg_session *oldest;
    return count(table, (struct whom){NULL, UINT64_MAX}, &oldest);
}

static void keep_within(struct hg_session_table *table, struct whom whom, uint32_t most)
{
    struct hg_session *oldest;
    while (count(table, whom, &oldest) > most)
        end(oldest, HG_E_LIMIT, "more sessions wait for their clients than are kept (max-parked)");
}

// max-parked of a token; those of the last half minute are above it as many as it may have open,
// unless they take the places of others.
static void limit_parked(const struct hg_session *s)
{
    struct hg_session_table *table = s->table;
    const struct hg_options *o = table->options;
    const uint64_t now_ns = table->loop->now_ns;
    const uint32_t open = s->scope.max_sessions ? s->scope.max_sessions : o->max_sessions_per_token;
    const bool crowded = hg_session_count_parked(table) > o->max_sessions;
    const bool at_once = !crowded && o->max_parked;
    const uint64_t until_ns = !at_once ? UINT64_MAX : now_ns > grace_ns ? now_ns - grace_ns : 0;
    keep_within(table, (struct whom){s, until_ns}, o->max_parked);
    keep_within(table, (struct whom){s, UINT64_MAX}, open > o->max_parked ? open : o->max_parked);
    keep_within(table, (struct whom){NULL, UINT64_MAX}, o->max_sessions);
}

void hg_session_check_parked(struct hg_session_table *table)
{
    for (struct hg_session *it = table->first; it; it = it->next)
        if (it->resume.parked_ns &&
            table->loop->now_ns - it->resume.parked_ns >= table->options->resume_timeout_ns)
            end(it, HG_E_TIMEOUT, "the session was not resumed within resume-timeout");
}

// ---- parking ------------------------------------------------------------------------------------

static void drop_requests(struct hg_session *s)
{
    for (struct hg_request *it = s->first, *next; it; it = next) {
        next = it->next;
        if (!hg_journal_wants(it->packet->header.type))
            hg_session_request_drop(s, it);
    }
}

// The worker forgets the view, the broker keeps what makes it again.
static void park_view(struct hg_session *s, struct hg_session_view *view)
{
    struct hg_link *link = s->scene->link;
    hg_session_view_clear(s, view);
    if (s->attached)
        hg_link_send(link, s->number, hg_link_next_id(link), HGP_T_view_close,
            &(struct hgp_view_close){.view = view->number});
    view->granted = 0;
    view->resubscribe = false;
    view->number_base = view->last_number;
    view->credit = view->first_credit;
}

bool hg_session_is_kept(const struct hg_session *s)
{
    return s->resume.has_ticket && s->table->options->resume_timeout_ns && !s->table->draining;
}

void hg_session_park(struct hg_session *s)
{
    struct hg_session_table *table = s->table;
    drop_requests(s);
    hg_session_upload_verified(s, NULL);
    for (struct hg_session_view *it = s->views, *next; it; it = next) {
        next = it->next;
        park_view(s, it);
        if (!it->accepted)
            hg_session_view_remove(s, it);
    }
    s->resume.parked_ns = table->loop->now_ns;
    if (s->scene)
        hg_session_share_leave(s, true);
    limit_parked(s);
}

void hg_session_unpark(struct hg_session *s, struct hg_conn *conn)
{
    s->resume.parked_ns = 0;
    s->conn = conn;
    conn->session = s;
    conn->number = s->number;
}
