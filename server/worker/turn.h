// turn.h - start-time fair queueing.
// Floor 6, private to server/worker. Thread: the one that owns the structs.
//
// Each participant has a virtual time, which grows by the service it gets over its weight. The one
// with the least start time is served next, so all that are backlogged get shares by their weights,
// whatever a single service takes. One that was idle starts at the present virtual time: it has
// saved nothing up, and does not wait behind those that used more. Source:
// Goyal, Vin and Cheng 1996, "Start-time Fair Queueing".
#ifndef HG_SERVER_WORKER_TURN_H
#define HG_SERVER_WORKER_TURN_H

#include <stdint.h>

enum { HG_TURN_WEIGHT = 100 }; // the usual one

// Of all that share. Zero-initialised.
struct turn_clock {
    uint64_t now; // when the newest service began
};

// Of one that shares. Zero-initialised = it was never served.
struct turn {
    uint64_t end; // of its newest service
};

// Virtual start time of the next service; the least of all is served next.
static inline uint64_t hg_turn_start(const struct turn_clock *clock, const struct turn *turn)
{
    return turn->end > clock->now ? turn->end : clock->now;
}

// What a service of `ns` costs one of that weight (at least 1).
static inline uint64_t hg_turn_cost(uint64_t ns, uint32_t weight)
{
    return ns * HG_TURN_WEIGHT / weight;
}

// Notes a service. cost: its time by weight (hg_turn_cost).
static inline void hg_turn_serve(struct turn_clock *clock, struct turn *turn, uint64_t cost)
{
    clock->now = hg_turn_start(clock, turn);
    turn->end = clock->now + cost;
}

#endif
