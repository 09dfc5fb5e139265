// auth.h - access tokens: the file of them, what each allows.
// Floor 6 (broker). Thread: the loop. Tokens are kept as SHA-256 only and compared in constant
// time.
#ifndef HG_BROKER_AUTH_H
#define HG_BROKER_AUTH_H

#include "protocol/hgp.h"

enum { HG_TOKEN_MIN = 8, HG_TOKEN_MAX = 256 };               // characters
enum { HG_TOKEN_WEIGHT = 100, HG_TOKEN_WEIGHT_MAX = 10000 }; // usual, largest

// What a token allows besides its role.
struct hg_token_scope {
    int64_t expires_s;     // seconds since 1970 (UTC); 0 = never
    uint32_t max_sessions; // open at a time; 0 = as max-sessions-per-token says
    uint32_t weight;       // of its tenant, 1 to 10000; 0 = 100
    uint32_t max_rate;     // messages per second of a session; 0 = as max-rate says
    uint32_t max_pixels;   // of frames per second, all its sessions; 0 = as max-pixel-rate says
    uint32_t max_tickets;  // join tickets that it may have; 0 = as its role says
    bool is_ticket;        // of a join ticket: `scenes` is the name of the only scene
    char scenes[129];      // pattern (fnmatch) of the names of scenes that may be opened; "" = all
    char roots[512]; // absolute folders, ':' between them, below which it reads; "" = all roots
};

struct hg_token {
    uint8_t hash[32];
    enum hgp_role role;
    unsigned line; // of the file
    char name[129];
    char tenant[129]; // whose scenes and worker it gets
    struct hg_token_scope scope;
};

struct hg_tokens {
    struct hg_token *items;
    size_t count, capacity;
    bool exposed;   // group or others may read the file
    uint32_t plain; // tokens that stand in the file as they are, not as hashes
};

// Reads lines of
//   TOKEN ROLE [NAME] [tenant=NAME] [expires=DATE] [scenes=PATTERN] [roots=FOLDER[:FOLDER...]]
//   [sessions=COUNT] [rate=COUNT] [weight=COUNT] [pixels=COUNT] [tickets=COUNT]
// where TOKEN is `subject:` and the common name of a client's certificate, `sha256:` and 64
// hexadecimal digits, or the token itself; DATE is YYYY-MM-DD or YYYY-MM-DDThh:mm:ssZ. HG_E_INVAL:
// err->what = the file, err->where = "line N". HG_E_NOTFOUND, HG_E_PERM, HG_E_IO, HG_E_LIMIT,
// HG_E_NOMEM. *out is empty on failure.
enum hg_status hg_tokens_read(
    const char *path, struct hg_tokens *out, struct hg_error *err) HG_MUST_CHECK;
// The hash under which a token is looked for. HG_E_NOMEM.
enum hg_status hg_token_hash(struct hgp_str token, uint8_t out[32]) HG_MUST_CHECK;
// The hash of the client whose certificate has that common name. HG_E_NOMEM.
enum hg_status hg_token_subject_hash(const char *subject, uint8_t out[32]) HG_MUST_CHECK;
// NULL when unknown or expired at `now_s`. Takes the same time wherever and whether it is found.
const struct hg_token *hg_tokens_find(
    const struct hg_tokens *tokens, const uint8_t hash[32], int64_t now_s);
void hg_tokens_finish(struct hg_tokens *tokens);

#endif
