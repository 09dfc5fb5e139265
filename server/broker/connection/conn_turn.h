// conn_turn.h - the time of the loop, shared by those to whom connections belong.
// Floor 6 (broker). Thread: the loop.
//
// A party is all connections with one token; of those whose session is not open, or that have no
// token, all of one network (on this machine: of one user). In one round of the loop the
// connections of a party together have HG_TURN_NS or HG_TURN_MESSAGES, whichever ends first. Those
// that have more to do, or an event after that, wait for the next round in the order in which they
// came. So an event of a client waits for one turn of each other party, however many connections
// these have; and no time is left unused, since a round after which connections wait is followed by
// the next one at once.
//
// Source: deficit round robin over flows (Shreedhar and Varghese 1995, "Efficient Fair Queuing
// Using Deficit Round Robin"), with a party as the flow and without the deficit: a turn ends after
// the message that exceeds it, which ROUND_NS of a connection bounds.
#ifndef HG_BROKER_CONN_TURN_H
#define HG_BROKER_CONN_TURN_H

#include <stdbool.h>
#include <stdint.h>

#include "base/status.h"

enum {
    HG_TURN_KEY_BYTES = 64,
    HG_TURN_NS = 1000000,   // of a party in one round
    HG_TURN_MESSAGES = 128, // the same
    HG_TURN_TRIES = 1024,   // waiting connections of a party that are looked at in one round
    HG_TURN_BUCKETS = 1024,
};

struct hg_party {
    struct hg_party *chain;       // of its bucket
    struct hg_party *prev, *next; // of those with connections that wait
    uint8_t key[HG_TURN_KEY_BYTES];
    uint32_t connections;
    uint32_t waiting;
    struct hg_turn *first, *last; // that wait; in their order
    uint64_t round;               // of which the following are
    uint64_t used_ns;
    uint32_t messages;
};

// Of a connection. Zero-initialised but for the first two members.
struct hg_turn {
    struct hg_turns *turns;
    void *owner;
    struct hg_party *party;
    struct hg_turn *prev, *next; // of those of the party that wait, while it is paused
    uint32_t missed;             // events that came when the party's turn was over
    bool paused;                 // nothing is read from it
    bool deferred; // it has had its turn in this round; the rest of what was read comes in the next
};

// Zero-initialised = empty.
struct hg_turns {
    struct hg_party *buckets[HG_TURN_BUCKETS];
    struct hg_party *first, *last; // with connections that wait; whose turn is next first
    uint32_t parties;              // of these
    uint32_t waiting;              // connections, in all
    uint64_t round;
    bool more; // the next round is to come at once
};

// Makes it one of the party with that key. HG_E_NOMEM: it stays where it was.
enum hg_status hg_turn_join(
    struct hg_turn *turn, const uint8_t key[HG_TURN_KEY_BYTES]) HG_MUST_CHECK;
void hg_turn_leave(struct hg_turn *turn); // accepts one that has joined none

// It is paused: behind all others of its party that are. Only what has joined one can be.
void hg_turn_pause(struct hg_turn *turn);
void hg_turn_unpause(struct hg_turn *turn); // accepts one that is not

// The party has had its turn in this round.
bool hg_turn_is_over(const struct hg_turn *turn);
// What the connection took of it.
void hg_turn_spend(struct hg_turn *turn, uint64_t ns, uint32_t messages);
// Begins a round: gives a turn to each party with connections that wait, while there is time for
// it; the others come first in the next round. `resume` unpauses a connection where it may, and may
// end any of them; they are freed later.
void hg_turns_give(struct hg_turns *turns, void (*resume)(void *owner));

#endif
