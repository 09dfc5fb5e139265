// tenant_rig.h - a daemon that gives each tenant a worker, and tokens of some tenants.
#ifndef HG_TESTS_ATTACK_TENANT_RIG_H
#define HG_TESTS_ATTACK_TENANT_RIG_H

#include "tests/system/daemon.h"

// Tokens: anna-token-1 and -2, bert-token-1, guest-token-1 (views anna's scenes show*),
// nameless-token, admin-token-1. Add options before daemon_start.
void tenant_rig_init(struct daemon *d);
// Opens a session, and a scene of that name unless it is NULL.
void tenant_enter(struct peer *p, struct daemon *d, const char *token, const char *scene);
// The worker of a tenant, "" = the spare; 0: it has none that is up.
pid_t tenant_worker(struct daemon *d, const char *tenant);
// Once it is up, and is another one.
pid_t tenant_await_worker(struct daemon *d, const char *tenant, pid_t other_than);

// An honest client of another tenant than the attacker's, with a scene of its own.
struct neighbour {
    struct peer peer;
    uint8_t picture[32]; // of its scene, as it was before the attack
};

// With a token over tcp, as the daemon's own user without one.
void neighbour_open(struct neighbour *n, struct daemon *d, const char *token);
// A ping and a frame are answered, and no other message has come: no error, no notice. The picture
// is the one from before the attack.
void neighbour_is_served(struct neighbour *n);
// neighbour_is_served; then its next edit is accepted, which its picture shows, and it disconnects.
void neighbour_close(struct neighbour *n);

#endif
