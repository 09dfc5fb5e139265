#include "server/broker/quarantine.h"

#include <stdio.h>
#include <string.h>

#include "base/log.h"

static const uint64_t suspicion_ns = 3600000000000u, second_ns = 1000000000u;
static const uint64_t longest_ns = 86400000000000u;

static bool is_known(const struct hg_quarantine_entry *entry, uint64_t now_ns)
{
    return now_ns < entry->until_ns || now_ns - entry->seen_ns < suspicion_ns;
}

static struct hg_quarantine_entry *find(
    struct hg_quarantine *q, const char *tenant, const uint8_t key[32])
{
    for (uint32_t i = 0; i < HG_QUARANTINE_ENTRIES; i++)
        if (q->entries[i].tenant[0] && memcmp(q->entries[i].key, key, 32) == 0 &&
            strcmp(q->entries[i].tenant, tenant) == 0)
            return &q->entries[i];
    return NULL;
}

const struct hg_quarantine_entry *hg_quarantine_find(
    const struct hg_quarantine *q, const char *tenant, const uint8_t key[32], uint64_t now_ns)
{
    const struct hg_quarantine_entry *entry = find((struct hg_quarantine *)q, tenant, key);
    return entry && is_known(entry, now_ns) ? entry : NULL;
}

bool hg_quarantine_refuses(const struct hg_quarantine_entry *entry, uint64_t now_ns)
{
    return now_ns < entry->until_ns;
}

// An unused one, else the one seen longest ago.
static struct hg_quarantine_entry *take(struct hg_quarantine *q)
{
    struct hg_quarantine_entry *oldest = &q->entries[0];
    for (uint32_t i = 0; i < HG_QUARANTINE_ENTRIES; i++) {
        if (!q->entries[i].tenant[0])
            return &q->entries[i];
        if (q->entries[i].seen_ns < oldest->seen_ns)
            oldest = &q->entries[i];
    }
    return oldest;
}

static uint64_t sentence_ns(uint32_t times)
{
    uint64_t ns = HG_QUARANTINE_S * second_ns;
    for (uint32_t i = 1; i < times && ns < longest_ns; i++)
        ns *= 2;
    return ns < longest_ns ? ns : longest_ns;
}

void hg_quarantine_note(
    struct hg_quarantine *q, const struct hg_quarantine_entry *file, bool alone, uint64_t now_ns)
{
    struct hg_quarantine_entry *entry = find(q, file->tenant, file->key);
    if (!entry) {
        entry = take(q);
        *entry = *file;
        entry->deaths = 0;
        entry->until_ns = 0;
    } else if (!is_known(entry, now_ns)) {
        entry->deaths = 0;
    }
    entry->deaths++;
    entry->seen_ns = now_ns;
    if (!alone)
        return;
    uint64_t ns = sentence_ns(entry->deaths > 1 ? entry->deaths - 1 : 1);
    entry->until_ns = now_ns + ns;
    hg_warn(SESSION, "quarantined for %llu s: %s of %s, at which a worker died %u times",
        (unsigned long long)(ns / second_ns), entry->what, entry->tenant, entry->deaths);
}

void hg_quarantine_forget(struct hg_quarantine *q, const char *tenant, const uint8_t key[32])
{
    struct hg_quarantine_entry *entry = find(q, tenant, key);
    if (entry)
        *entry = (struct hg_quarantine_entry){0};
}
