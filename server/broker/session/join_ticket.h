// join_ticket.h - join tickets: who may log in without a token of their own, to which scene.
// Floor 6 (broker). Thread: the loop. A ticket is 32 random bytes as text; its SHA-256 is kept.
// Times are those of the wall clock, in seconds since 1970.
#ifndef HG_BROKER_JOIN_TICKET_H
#define HG_BROKER_JOIN_TICKET_H

#include "server/broker/connection/auth.h"
#include "server/broker/state/state_record.h"

enum { HG_JOIN_SECRET = 48 }; // characters with the 0 at the end

struct hg_join_ticket {
    uint32_t number;
    uint8_t hash[32];
    char tenant[129], issuer[129], scene[129], label[65];
    uint8_t issuer_key[32]; // hash of the token that made it
    bool has_issuer_key;    // false: the daemon's own user
    enum hgp_role role;     // VIEW or EDIT
    uint32_t uses, used;
    uint32_t weight, max_rate, max_pixels; // of the issuer's scope
    char roots[512];                       // likewise
    uint64_t until_s;
};

// Zero-initialised but for the log = none.
struct hg_join_tickets {
    struct hg_join_ticket *items; // by number
    size_t capacity;
    uint32_t count, last_number;
};

// Makes one like `like` with a new number, hash and secret. HG_E_NOMEM, HG_E_INTERNAL (no random
// numbers). *at: the log's position.
enum hg_status hg_join_ticket_make(struct hg_join_tickets *all, struct hg_state_log *log,
    struct hg_join_ticket *like, char secret[HG_JOIN_SECRET], uint64_t *at) HG_MUST_CHECK;
// NULL: there is none. Takes the same time wherever it is found.
struct hg_join_ticket *hg_join_ticket_find(
    const struct hg_join_tickets *all, const uint8_t hash[32]);
// Whether it lets another session in.
bool hg_join_ticket_is_good(const struct hg_join_ticket *ticket, uint64_t now_s);
// Counts a use. Returns the log's position.
uint64_t hg_join_ticket_use(struct hg_join_ticket *ticket, struct hg_state_log *log);
uint64_t hg_join_ticket_remove(
    struct hg_join_tickets *all, struct hg_state_log *log, uint32_t number);
// As if it were a token.
void hg_join_ticket_as_token(const struct hg_join_ticket *ticket, struct hg_token *out);
uint32_t hg_join_tickets_of(const struct hg_join_tickets *all, const char *tenant);
void hg_join_tickets_record_all(const struct hg_join_tickets *all, struct hg_state_log *log);
// One that a record has; it replaces one of its number. HG_E_NOMEM.
enum hg_status hg_join_ticket_restore(
    struct hg_join_tickets *all, const struct hg_state_ticket *record) HG_MUST_CHECK;
void hg_join_tickets_finish(struct hg_join_tickets *all);

#endif
