#include "server/broker/connection/slots.h"

#include <sys/resource.h>

#include "base/clock.h"
#include "base/log.h"
#include "server/broker/metrics/counters.h"

// Of the daemon itself, and of each worker.
enum { OTHER_FILES = 64 + HG_SLOTS_REFUSED, WORKER_FILES = 4, MOST_FILES = 1 << 17 };

void hg_slots_raise_files(void)
{
    struct rlimit limit;
    if (getrlimit(RLIMIT_NOFILE, &limit) == 0 && limit.rlim_cur < limit.rlim_max) {
        limit.rlim_cur = limit.rlim_max < MOST_FILES ? limit.rlim_max : MOST_FILES;
        setrlimit(RLIMIT_NOFILE, &limit);
    }
}

void hg_slots_measure_files(struct hg_slots *slots)
{
    const struct hg_options *o = slots->options;
    struct rlimit limit;
    if (getrlimit(RLIMIT_NOFILE, &limit) != 0)
        return;
    const rlim_t most = limit.rlim_cur < MOST_FILES ? limit.rlim_cur : MOST_FILES;
    const rlim_t others = OTHER_FILES + WORKER_FILES * (rlim_t)(o->max_workers + 1);
    slots->files = (uint32_t)(most > 2 * others ? most - others : most / 2);
    if (slots->files < o->max_connections)
        hg_warn(NET,
            "the limit of open files (LimitNOFILE, ulimit -Hn), %u, has room for %u connections, "
            "not for max-connections %u",
            (uint32_t)most, slots->files, o->max_connections);
}

enum hg_status hg_slots_take(
    struct hg_slots *slots, const struct hg_peer *peer, struct hg_slot *slot)
{
    *slot = (struct hg_slot){.own = peer->is_local && peer->same_user, .opening = true};
    slots->count++;
    slots->opening++;
    if (slot->own)
        return HG_OK;
    slot->source = hg_peer_table_join(&slots->peers, peer->source);
    if (peer->network[0])
        slot->network = hg_peer_table_join(&slots->peers, peer->network);
    return slot->source && (slot->network || !peer->network[0]) ? HG_OK : HG_E_NOMEM;
}

void hg_slots_set_opening(struct hg_slots *slots, struct hg_slot *slot, bool opening)
{
    if (slot->refused)
        return;
    slots->opening -= slot->opening;
    slots->opening += opening;
    slot->opening = opening;
}

bool hg_slots_refuse(struct hg_slots *slots, struct hg_slot *slot, uint64_t now_ns)
{
    if (slots->refused >= HG_SLOTS_REFUSED)
        return false;
    hg_slots_leave(slots, slot, now_ns);
    slots->refused++;
    slot->refused = true;
    return true;
}

void hg_slots_leave(struct hg_slots *slots, struct hg_slot *slot, uint64_t now_ns)
{
    if (slot->refused) {
        slots->refused--;
        slot->refused = false;
        return;
    }
    hg_slots_set_opening(slots, slot, false);
    slots->count--;
    hg_peer_table_leave(&slots->peers, slot->source, now_ns);
    hg_peer_table_leave(&slots->peers, slot->network, now_ns);
    *slot = (struct hg_slot){0};
}

// ---- refusals -----------------------------------------------------------------------------------

// Xorshift (Marsaglia 2003), from 0 to 1.
static double draw(struct hg_slots *slots)
{
    uint64_t x = slots->random ? slots->random : hg_clock_now_ns() | 1;
    x ^= x << 13;
    x ^= x >> 7;
    x ^= x << 17;
    slots->random = x;
    return (double)(x >> 11) * 0x1p-53;
}

// From half of max-handshakes on newcomers are refused at random, with a probability that rises to
// 1 there: who floods cannot keep all others out, as they could with a plain limit.
static bool is_dropped_early(struct hg_slots *slots)
{
    double most = slots->options->max_handshakes, from = most / 2;
    double excess = ((double)slots->opening - 1 - from) / (most - from);
    return excess > 0 && draw(slots) < excess;
}

uint32_t hg_slots_kept(uint32_t most, uint32_t reserved)
{
    return reserved < most / 4 ? reserved : most / 4;
}

// Others have to end first, or to log in.
enum { RETRY_MS = 10000, RETRY_HANDSHAKE_MS = 2000 };

static const struct hg_refusal
    no_slot = {"max-connections",
        "the daemon has as many connections as it takes (max-connections, or what its limit of "
        "open "
        "files has room for)",
        RETRY_MS},
    no_free_slot = {"max-connections",
        "the daemon has as many connections as it takes (max-connections, or what its limit of "
        "open "
        "files has room for); the last are kept for its own user (reserved-connections)",
        RETRY_MS},
    no_slot_of_address = {"max-per-address",
        "this address has as many connections as one may have (max-per-address)", RETRY_MS},
    no_slot_of_network = {"max-per-network",
        "this network has as many connections as one may have (max-per-network)", RETRY_MS},
    no_handshake = {"max-handshakes",
        "too many connections are opening at this moment (max-handshakes)", RETRY_HANDSHAKE_MS};

static const struct hg_refusal *because(enum hg_counter counter, const struct hg_refusal *refusal)
{
    hg_count(counter);
    return refusal;
}

static uint32_t most_connections(const struct hg_slots *slots)
{
    const uint32_t most = slots->options->max_connections;
    return slots->files && slots->files < most ? slots->files : most;
}

static bool is_address_full(const struct hg_slots *slots, const struct hg_slot *slot)
{
    return slot->source && slot->source->connections > slots->options->max_per_address;
}

static bool is_network_full(const struct hg_slots *slots, const struct hg_slot *slot)
{
    return slot->network && slot->network->connections > slots->options->max_per_network;
}

bool hg_slots_would_gain(
    const struct hg_slots *slots, const struct hg_slot *slot, const struct hg_slot *other)
{
    const uint32_t most = most_connections(slots);
    const uint32_t kept = slot->own ? 0 : hg_slots_kept(most, slots->options->reserved_connections);
    if (other->refused)
        return false;
    return slots->count > most - kept ||
           (is_address_full(slots, slot) && other->source == slot->source) ||
           (is_network_full(slots, slot) && other->network == slot->network);
}

const struct hg_refusal *hg_slots_refusal(struct hg_slots *slots, const struct hg_slot *slot)
{
    const uint32_t most = most_connections(slots);
    if (slots->count > most)
        return because(HG_COUNT_REFUSED_CONNECTIONS, &no_slot);
    if (slot->own)
        return NULL;
    if (slots->count > most - hg_slots_kept(most, slots->options->reserved_connections))
        return because(HG_COUNT_REFUSED_CONNECTIONS, &no_free_slot);
    if (is_address_full(slots, slot))
        return because(HG_COUNT_REFUSED_ADDRESS, &no_slot_of_address);
    if (is_network_full(slots, slot))
        return because(HG_COUNT_REFUSED_NETWORK, &no_slot_of_network);
    if (is_dropped_early(slots))
        return because(HG_COUNT_REFUSED_HANDSHAKES, &no_handshake);
    return NULL;
}
