// auth.h - access tokens, and penalties for guessing them.
// Floor 6 (broker). Thread: the loop. Tokens are kept as SHA-256 only and compared in constant
// time.
#ifndef HG_BROKER_AUTH_H
#define HG_BROKER_AUTH_H

#include "protocol/hgp.h"

struct hg_token {
    uint8_t hash[32];
    enum hgp_role role;
    char name[129];
};

struct hg_tokens {
    struct hg_token *items;
    size_t count, capacity;
    bool exposed; // group or others may read the file
};

// Reads `TOKEN ROLE [NAME]` lines. HG_E_INVAL: err->what = the file, err->where = "line N".
// HG_E_NOTFOUND, HG_E_PERM, HG_E_IO, HG_E_LIMIT, HG_E_NOMEM. *out is empty on failure.
enum hg_status hg_tokens_read(
    const char *path, struct hg_tokens *out, struct hg_error *err) HG_MUST_CHECK;
// NULL when unknown. Takes the same time wherever and whether the token is found.
const struct hg_token *hg_tokens_find(const struct hg_tokens *tokens, struct hgp_str token);
void hg_tokens_finish(struct hg_tokens *tokens);

// Failures by peer address, the newest 128 addresses.
enum { HG_GUARD_ENTRIES = 128 };

struct hg_guard {
    struct hg_guard_entry {
        char address[64];
        uint32_t failures;
        uint64_t window_ns; // start of the minute that is counted
    } entries[HG_GUARD_ENTRIES];
};

// True while the address has used up its failures of this minute.
bool hg_guard_is_blocked(
    const struct hg_guard *guard, const char *address, uint32_t limit, uint64_t now_ns);
void hg_guard_count_failure(struct hg_guard *guard, const char *address, uint64_t now_ns);

#endif
