// slots.h - which connections get a slot: limits in all, by address, by network; slots kept for the
// daemon's own user; early drop of those that open.
// Floor 6 (broker). Thread: the loop.
#ifndef HG_BROKER_SLOTS_H
#define HG_BROKER_SLOTS_H

#include "server/broker/options.h"
#include "server/broker/connection/peer_table.h"
#include "server/broker/transport/transport.h"

enum { HG_SLOTS_REFUSED = 64 };

// Zero-initialised but for the options = no connections.
struct hg_slots {
    const struct hg_options *options;
    struct hg_peer_table peers;
    uint32_t count;
    uint32_t opening; // of these, those that hg_slots_set_opening is true of
    uint32_t refused; // besides, those that are still to be answered
    uint64_t random;  // state of the early drop
    uint32_t files;   // connections that the limit of open files has room for; 0 = not measured
};

// Raises the limit of open files to what the system allows.
void hg_slots_raise_files(void);
// Finds `files`, which holds beside max-connections, and warns where it is less.
void hg_slots_measure_files(struct hg_slots *slots);

// Of one connection.
struct hg_slot {
    struct hg_peer_entry *source, *network; // NULL: not counted
    bool own;                               // of the daemon's own user on this machine
    bool opening;
    bool refused;                 // it has none any more
    const struct hg_refusal *why; // of the owner: is still to be said; NULL: nothing is
};

// Counts a connection. HG_E_NOMEM; hg_slots_leave takes it back in any case.
enum hg_status hg_slots_take(
    struct hg_slots *slots, const struct hg_peer *peer, struct hg_slot *slot) HG_MUST_CHECK;
// Why a connection may not stay.
struct hg_refusal {
    const char *limit, *reason;
    uint32_t retry_after_ms;
};

// Of a counted connection; NULL: it may stay.
const struct hg_refusal *hg_slots_refusal(struct hg_slots *slots, const struct hg_slot *slot);
// A counted connection is above a limit, and would be less so without this other one.
bool hg_slots_would_gain(
    const struct hg_slots *slots, const struct hg_slot *slot, const struct hg_slot *other);
// Whether its session is still to be opened: at first it is.
void hg_slots_set_opening(struct hg_slots *slots, struct hg_slot *slot, bool opening);
// It is refused and still to be answered: for as long as that takes it keeps no slot of others, and
// raises no probability of an early drop. False: too many are being answered.
bool hg_slots_refuse(struct hg_slots *slots, struct hg_slot *slot, uint64_t now_ns);
void hg_slots_leave(struct hg_slots *slots, struct hg_slot *slot, uint64_t now_ns);
// Of `most` slots so many are kept for the privileged: at most a quarter.
uint32_t hg_slots_kept(uint32_t most, uint32_t reserved);

#endif
