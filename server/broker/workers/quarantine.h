// quarantine.h - files that ended workers: who loaded what, how often, and what is refused until
// when. Floor 6 (broker). Thread: the loop.
//
// A file, or another thing that a request brings (suspect.h), is known by tenant and key. One that
// was under way when a worker died is suspected for an hour, in whatever session or connection it
// comes again: it is tried alone. If the worker dies again it is quarantined, for HG_QUARANTINE_S
// at first and twice as long each further time, up to a day. Of more than HG_QUARANTINE_ENTRIES, or
// HG_QUARANTINE_OF_TENANT of one tenant, those are forgotten that were seen longest ago.
#ifndef HG_BROKER_QUARANTINE_H
#define HG_BROKER_QUARANTINE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "server/broker/state/state_record.h"

enum { HG_QUARANTINE_ENTRIES = 512, HG_QUARANTINE_OF_TENANT = 128, HG_QUARANTINE_S = 600 };

struct hg_quarantine_entry {
    char tenant[129]; // "" = unused
    uint8_t key[32];
    char what[160];    // for people: name of the file
    uint32_t deaths;   // since it was last loaded well
    uint64_t seen_ns;  // the newest death
    uint64_t until_ns; // refused until then; 0 = suspected only
};

// Zero-initialised = empty.
struct hg_quarantine {
    struct hg_state_log *log; // NULL: forgotten with the daemon
    uint32_t used;
    struct hg_quarantine_entry entries[HG_QUARANTINE_ENTRIES];
};

// NULL: it is neither suspected nor refused.
const struct hg_quarantine_entry *hg_quarantine_find(
    const struct hg_quarantine *q, const char *tenant, const uint8_t key[32], uint64_t now_ns);
// Whether an entry of the tenant has this name.
bool hg_quarantine_has(const struct hg_quarantine *q, const char *tenant, const char *what);
bool hg_quarantine_refuses(const struct hg_quarantine_entry *entry, uint64_t now_ns);
// A worker died while the file was loaded; alone: nothing else ran, so it is refused from now on.
void hg_quarantine_note(
    struct hg_quarantine *q, const struct hg_quarantine_entry *file, bool alone, uint64_t now_ns);
// Forgets those whose key begins with these hexadecimal digits; returns how many.
uint32_t hg_quarantine_clear(struct hg_quarantine *q, const char *digits, size_t length);
// The file was loaded well: it is forgotten.
void hg_quarantine_forget(struct hg_quarantine *q, const char *tenant, const uint8_t key[32]);
// The state log: one of its records of a file, the end of one, and all that is known as records.
void hg_quarantine_restore(
    struct hg_quarantine *q, const struct hg_state_suspect *file, uint64_t now_ns);
void hg_quarantine_restore_end(struct hg_quarantine *q, const struct hg_state_suspect *file);
void hg_quarantine_write(const struct hg_quarantine *q, uint64_t now_ns);

#endif
