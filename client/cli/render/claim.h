// claim.h - OUT.claim: which process makes a file, when several make the frames of one series.
// Floor 6 (client). One thread uses a set of claims; another one renews the claim that is held.
//
// A claim is a file with its owner's name, locked (flock) and renewed every few seconds. Of this
// machine's processes the lock tells which are dead; of other machines', whose locks may not be
// seen here, that nothing was renewed for HG_CLI_CLAIM_LEASE_S of this machine's clock. An empty
// claim is of a process that died before it wrote its name, unless it gets it within
// HG_CLI_CLAIM_EMPTY_S.
#ifndef HG_CLIENT_CLI_RENDER_CLAIM_H
#define HG_CLIENT_CLI_RENDER_CLAIM_H

#include <pthread.h>

#include "base/status.h"

enum {
    HG_CLI_CLAIM_RENEW_S = 5,
    HG_CLI_CLAIM_LEASE_S = 60,
    HG_CLI_CLAIM_EMPTY_S = 5,
    HG_CLI_CLAIM_NAME_BYTES = 4200, // of OUT.claim
    HG_CLI_CLAIM_OWNER_BYTES = 160, // "HOST PID NONCE BOOT\n"
};

// A claim of another process, as it was seen; zeroed: not yet.
struct hg_cli_claim_seen {
    int64_t renewed_ns; // time of the file
    uint64_t since_ns;  // CLOCK_MONOTONIC, from when on it is that
};

struct hg_cli_claims {
    char self[HG_CLI_CLAIM_OWNER_BYTES]; // what own claims hold
    char path[HG_CLI_CLAIM_NAME_BYTES];  // of the one that is held
    int fd;                              // -1: none is; guarded by lock, with is_ending
    bool is_ending;
    pthread_mutex_t lock;
    pthread_cond_t wake;
    pthread_t renewer;
};

// Starts the thread that renews. HG_E_NOMEM.
enum hg_status hg_cli_claims_init(struct hg_cli_claims *c, struct hg_error *err) HG_MUST_CHECK;
void hg_cli_claims_finish(struct hg_cli_claims *c); // releases; accepts what init has refused

// Claims the file `output`; none is held yet. *held false: another process has it, and `owner`
// (HG_CLI_CLAIM_OWNER_BYTES) names it, as "HOST, process PID". `seen` is kept for the next try.
// HG_E_INVAL: OUT.claim is a folder.
enum hg_status hg_cli_claim_take(struct hg_cli_claims *c, const char *output,
    struct hg_cli_claim_seen *seen, bool *held, char *owner, struct hg_error *err) HG_MUST_CHECK;
// Removes the claim that is held, if there is one.
void hg_cli_claim_release(struct hg_cli_claims *c);

#endif
