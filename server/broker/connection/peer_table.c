#include "server/broker/connection/peer_table.h"

#include <stdio.h>
#include <string.h>

#include "base/alloc.h"

static const uint64_t minute_ns = 60000000000u;

// FNV-1a. Keys are short, and an attacker who fills one bucket pays with an address for each.
static struct hg_peer_entry **bucket_of(struct hg_peer_table *table, const char *key)
{
    uint64_t hash = 14695981039346656037u;
    for (; *key; key++)
        hash = (hash ^ (uint8_t)*key) * 1099511628211u;
    return &table->buckets[(hash ^ hash >> 32) % HG_PEER_TABLE_BUCKETS];
}

// ---- entries without connections ----------------------------------------------------------------

static void unlink_idle(struct hg_peer_table *table, struct hg_peer_entry *entry)
{
    *(entry->prev ? &entry->prev->next : &table->idle) = entry->next;
    *(entry->next ? &entry->next->prev : &table->idle_last) = entry->prev;
    entry->prev = entry->next = NULL;
    table->idle_count--;
}

static void link_idle(struct hg_peer_table *table, struct hg_peer_entry *entry)
{
    entry->next = table->idle;
    *(table->idle ? &table->idle->prev : &table->idle_last) = entry;
    table->idle = entry;
    table->idle_count++;
}

static void remove_entry(struct hg_peer_table *table, struct hg_peer_entry *entry)
{
    struct hg_peer_entry **link = bucket_of(table, entry->key);
    while (*link != entry)
        link = &(*link)->chain;
    *link = entry->chain;
    hg_free(entry);
}

// ---- connections --------------------------------------------------------------------------------

struct hg_peer_entry *hg_peer_table_join(struct hg_peer_table *table, const char *key)
{
    struct hg_peer_entry **bucket = bucket_of(table, key), *entry = *bucket;
    while (entry && strcmp(entry->key, key) != 0)
        entry = entry->chain;
    if (entry && !entry->connections)
        unlink_idle(table, entry);
    if (!entry) {
        entry = hg_calloc(1, sizeof *entry);
        if (!entry)
            return NULL;
        snprintf(entry->key, sizeof entry->key, "%s", key);
        entry->chain = *bucket;
        *bucket = entry;
    }
    entry->connections++;
    return entry;
}

void hg_peer_table_leave(struct hg_peer_table *table, struct hg_peer_entry *entry, uint64_t now_ns)
{
    if (!entry || --entry->connections)
        return;
    if (!hg_peer_entry_failures(entry, now_ns)) {
        remove_entry(table, entry);
        return;
    }
    link_idle(table, entry);
    while (table->idle_last && (table->idle_count > HG_PEER_TABLE_IDLE ||
                                   !hg_peer_entry_failures(table->idle_last, now_ns))) {
        struct hg_peer_entry *oldest = table->idle_last;
        unlink_idle(table, oldest);
        remove_entry(table, oldest);
    }
}

// ---- wrong tokens -------------------------------------------------------------------------------

uint32_t hg_peer_entry_failures(const struct hg_peer_entry *entry, uint64_t now_ns)
{
    return now_ns - entry->window_ns < minute_ns ? entry->failures : 0;
}

uint64_t hg_peer_table_all_failures(const struct hg_peer_table *table, uint64_t now_ns)
{
    return now_ns - table->minute_ns < minute_ns ? table->minute_failures : 0;
}

static void count_failure(struct hg_peer_entry *entry, uint64_t now_ns)
{
    if (!entry)
        return; // the daemon's own user
    if (!hg_peer_entry_failures(entry, now_ns)) {
        entry->failures = 0;
        entry->window_ns = now_ns;
    }
    entry->failures++;
}

void hg_peer_table_count_failure(struct hg_peer_table *table, struct hg_peer_entry *source,
    struct hg_peer_entry *network, uint64_t now_ns)
{
    table->failures++;
    if (!hg_peer_table_all_failures(table, now_ns)) {
        table->minute_failures = 0;
        table->minute_ns = now_ns;
    }
    table->minute_failures++;
    count_failure(source, now_ns);
    count_failure(network, now_ns);
}

void hg_peer_table_finish(struct hg_peer_table *table)
{
    for (uint32_t i = 0; i < HG_PEER_TABLE_BUCKETS; i++)
        while (table->buckets[i]) {
            struct hg_peer_entry *entry = table->buckets[i];
            table->buckets[i] = entry->chain;
            hg_free(entry);
        }
    *table = (struct hg_peer_table){0};
}
