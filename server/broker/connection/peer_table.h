// peer_table.h - what is known of peers by where they come from: connections, wrong tokens.
// Floor 6 (broker). Thread: the loop.
//
// A key is a source (an IPv4 address, the /64 network of an IPv6 address, a uid: what one host or
// user can have at will) or a network (IPv4 /24, IPv6 /48). An entry lives while it has
// connections, and for a minute after the newest wrong token; of those without connections at most
// HG_PEER_TABLE_IDLE are kept, the newest, so that memory is bounded by the connections.
#ifndef HG_BROKER_PEER_TABLE_H
#define HG_BROKER_PEER_TABLE_H

#include <stdint.h>

#include "base/status.h"

enum { HG_PEER_KEY_BYTES = 64, HG_PEER_TABLE_BUCKETS = 4096, HG_PEER_TABLE_IDLE = 4096 };

struct hg_peer_entry {
    struct hg_peer_entry *chain;       // of its bucket
    struct hg_peer_entry *prev, *next; // of those without connections, newest failure first
    char key[HG_PEER_KEY_BYTES];
    uint32_t connections;
    uint32_t failures;  // wrong tokens within the minute that began at window_ns
    uint64_t window_ns; // 0 with failures 0
};

// Zero-initialised = empty.
struct hg_peer_table {
    struct hg_peer_entry *buckets[HG_PEER_TABLE_BUCKETS];
    struct hg_peer_entry *idle, *idle_last;
    uint32_t idle_count;
    uint64_t failures;                   // of all, since the start
    uint64_t minute_failures, minute_ns; // of all, within the minute that began at minute_ns
};

// One connection more from there. NULL: no memory.
struct hg_peer_entry *hg_peer_table_join(
    struct hg_peer_table *table, const char *key) HG_MUST_CHECK;
// One less; the entry may be gone afterwards. Accepts NULL.
void hg_peer_table_leave(struct hg_peer_table *table, struct hg_peer_entry *entry, uint64_t now_ns);
// A wrong token came from that source, in that network, which have connections; NULL: from none.
void hg_peer_table_count_failure(struct hg_peer_table *table, struct hg_peer_entry *source,
    struct hg_peer_entry *network, uint64_t now_ns);
// Wrong tokens of this minute, from everywhere.
uint64_t hg_peer_table_all_failures(const struct hg_peer_table *table, uint64_t now_ns);
// Wrong tokens of this minute.
uint32_t hg_peer_entry_failures(const struct hg_peer_entry *entry, uint64_t now_ns);
void hg_peer_table_finish(struct hg_peer_table *table);

#endif
