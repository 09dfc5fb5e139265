#include "server/broker/workers/quarantine.h"

#include <stdio.h>
#include <string.h>

#include "base/clock.h"
#include "base/log.h"
#include "base/sha256.h"

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

bool hg_quarantine_has(const struct hg_quarantine *q, const char *tenant, const char *what)
{
    for (uint32_t i = 0; q->used && i < HG_QUARANTINE_ENTRIES; i++)
        if (q->entries[i].tenant[0] && strcmp(q->entries[i].what, what) == 0 &&
            strcmp(q->entries[i].tenant, tenant) == 0)
            return true;
    return false;
}

// An unused one, else the one seen longest ago: of the tenant, when it has as many as one may have.
static struct hg_quarantine_entry *take(struct hg_quarantine *q, const char *tenant)
{
    struct hg_quarantine_entry *unused = NULL, *oldest = NULL, *own = NULL;
    uint32_t count = 0;
    for (uint32_t i = 0; i < HG_QUARANTINE_ENTRIES; i++) {
        struct hg_quarantine_entry *it = &q->entries[i];
        if (!it->tenant[0]) {
            unused = it;
            continue;
        }
        oldest = !oldest || it->seen_ns < oldest->seen_ns ? it : oldest;
        if (strcmp(it->tenant, tenant) != 0)
            continue;
        own = !own || it->seen_ns < own->seen_ns ? it : own;
        count++;
    }
    if (count >= HG_QUARANTINE_OF_TENANT)
        return own;
    q->used += unused != NULL;
    return unused ? unused : oldest;
}

static uint64_t sentence_ns(uint32_t times)
{
    uint64_t ns = HG_QUARANTINE_S * second_ns;
    for (uint32_t i = 1; i < times && ns < longest_ns; i++)
        ns *= 2;
    return ns < longest_ns ? ns : longest_ns;
}

static void sentence(struct hg_quarantine_entry *entry, uint64_t now_ns)
{
    uint64_t ns = sentence_ns(entry->deaths > 1 ? entry->deaths - 1 : 1);
    entry->until_ns = now_ns + ns;
    hg_warn(SESSION, "quarantined for %llu s: %s of %s, at which a worker died %u times",
        (unsigned long long)(ns / second_ns), entry->what, entry->tenant, entry->deaths);
}

// Of the loop's clock, which does not survive a restart, and of the wall clock.
static uint64_t wall_s(uint64_t time_ns, uint64_t now_ns)
{
    uint64_t wall_ns = hg_clock_wall_ns();
    return (time_ns < now_ns ? wall_ns - (now_ns - time_ns) : wall_ns + (time_ns - now_ns)) /
           second_ns;
}

static uint64_t loop_ns(uint64_t time_s, uint64_t now_ns)
{
    uint64_t wall = hg_clock_wall_ns() / second_ns;
    if (time_s >= wall)
        return now_ns +
               (time_s - wall < longest_ns / second_ns ? (time_s - wall) * second_ns : longest_ns);
    uint64_t ago = wall - time_s;
    return ago < now_ns / second_ns ? now_ns - ago * second_ns : 1;
}

static void write_entry(
    const struct hg_quarantine *q, const struct hg_quarantine_entry *entry, uint64_t now_ns)
{
    struct hg_state_suspect file = {.tenant = hgp_str_make(entry->tenant),
        .what = hgp_str_make(entry->what),
        .deaths = entry->deaths,
        .seen_s = wall_s(entry->seen_ns, now_ns),
        .until_s = entry->until_ns ? wall_s(entry->until_ns, now_ns) : 0};
    memcpy(file.key, entry->key, sizeof file.key);
    hg_state_put_suspect(q->log, &file);
}

static void drop(struct hg_quarantine *q, struct hg_quarantine_entry *entry)
{
    hg_state_put_suspect_end(q->log, entry->tenant, entry->key);
    *entry = (struct hg_quarantine_entry){0};
    q->used--;
}

void hg_quarantine_note(
    struct hg_quarantine *q, const struct hg_quarantine_entry *file, bool alone, uint64_t now_ns)
{
    struct hg_quarantine_entry *entry = find(q, file->tenant, file->key);
    if (!entry) {
        entry = take(q, file->tenant);
        *entry = *file;
        entry->deaths = 0;
        entry->until_ns = 0;
    } else if (!is_known(entry, now_ns)) {
        entry->deaths = 0;
    }
    entry->deaths++;
    entry->seen_ns = now_ns;
    if (alone)
        sentence(entry, now_ns);
    write_entry(q, entry, now_ns);
}

uint32_t hg_quarantine_clear(struct hg_quarantine *q, const char *digits, size_t length)
{
    uint32_t count = 0;
    char hex[HG_SHA256_HEX];
    for (uint32_t i = 0; i < HG_QUARANTINE_ENTRIES && length < sizeof hex; i++) {
        hg_sha256_hex(q->entries[i].key, hex);
        if (!q->entries[i].tenant[0] || strncmp(hex, digits, length) != 0)
            continue;
        drop(q, &q->entries[i]);
        count++;
    }
    return count;
}

void hg_quarantine_forget(struct hg_quarantine *q, const char *tenant, const uint8_t key[32])
{
    struct hg_quarantine_entry *entry = find(q, tenant, key);
    if (entry)
        drop(q, entry);
}

void hg_quarantine_restore(
    struct hg_quarantine *q, const struct hg_state_suspect *file, uint64_t now_ns)
{
    struct hg_quarantine_entry like = {.deaths = file->deaths,
        .seen_ns = loop_ns(file->seen_s, now_ns),
        .until_ns = file->until_s ? loop_ns(file->until_s, now_ns) : 0};
    memcpy(like.key, file->key, sizeof like.key);
    snprintf(like.tenant, sizeof like.tenant, "%.*s", (int)file->tenant.size, file->tenant.data);
    snprintf(like.what, sizeof like.what, "%.*s", (int)file->what.size, file->what.data);
    if (like.seen_ns > now_ns) // the clock was set back
        like.seen_ns = now_ns;
    struct hg_quarantine_entry *entry = find(q, like.tenant, like.key);
    *(entry ? entry : take(q, like.tenant)) = like;
}

void hg_quarantine_restore_end(struct hg_quarantine *q, const struct hg_state_suspect *file)
{
    char tenant[129];
    snprintf(tenant, sizeof tenant, "%.*s", (int)file->tenant.size, file->tenant.data);
    struct hg_quarantine_entry *entry = find(q, tenant, file->key);
    if (!entry)
        return;
    *entry = (struct hg_quarantine_entry){0};
    q->used--;
}

void hg_quarantine_write(const struct hg_quarantine *q, uint64_t now_ns)
{
    for (uint32_t i = 0; i < HG_QUARANTINE_ENTRIES; i++)
        if (q->entries[i].tenant[0] && is_known(&q->entries[i], now_ns))
            write_entry(q, &q->entries[i], now_ns);
}
