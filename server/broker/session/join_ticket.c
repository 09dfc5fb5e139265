#include "server/broker/session/join_ticket.h"

#include <openssl/crypto.h>
#include <openssl/rand.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "base/sha256.h"

enum { SECRET_BYTES = 32 };
static const char prefix[] = "hj-";

// Base64 for URLs (RFC 4648, 5), without padding.
static void put_base64(const uint8_t *data, size_t size, char *out)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
    uint32_t bits = 0;
    int have = 0;
    for (size_t i = 0; i < size; i++) {
        bits = bits << 8 | data[i];
        for (have += 8; have >= 6; have -= 6)
            *out++ = digits[bits >> (have - 6) & 63];
    }
    if (have)
        *out++ = digits[bits << (6 - have) & 63];
    *out = 0;
}

static uint64_t record(struct hg_state_log *log, const struct hg_join_ticket *it)
{
    struct hg_state_ticket m = {.number = it->number,
        .uses = it->uses,
        .used = it->used,
        .until_s = it->until_s,
        .weight = it->weight,
        .max_rate = it->max_rate,
        .max_pixels = it->max_pixels,
        .role = (uint8_t)it->role,
        .has_issuer_key = it->has_issuer_key,
        .tenant = hgp_str_make(it->tenant),
        .issuer = hgp_str_make(it->issuer),
        .scene = hgp_str_make(it->scene),
        .label = hgp_str_make(it->label),
        .roots = hgp_str_make(it->roots)};
    memcpy(m.hash, it->hash, sizeof m.hash);
    memcpy(m.issuer_key, it->issuer_key, sizeof m.issuer_key);
    return hg_state_put_ticket(log, &m);
}

static struct hg_join_ticket *add(struct hg_join_tickets *all, const struct hg_join_ticket *like)
{
    if (hg_grow(&all->items, &all->capacity, (size_t)all->count + 1, sizeof *all->items))
        return NULL;
    all->items[all->count] = *like;
    return &all->items[all->count++];
}

enum hg_status hg_join_ticket_make(struct hg_join_tickets *all, struct hg_state_log *log,
    struct hg_join_ticket *like, char secret[HG_JOIN_SECRET], uint64_t *at)
{
    uint8_t random[SECRET_BYTES];
    struct hg_join_ticket it = *like;
    if (RAND_bytes(random, sizeof random) != 1)
        return HG_E_INTERNAL;
    snprintf(secret, HG_JOIN_SECRET, "%s", prefix);
    put_base64(random, sizeof random, secret + sizeof prefix - 1);
    OPENSSL_cleanse(random, sizeof random);
    it.number = all->last_number + 1;
    enum hg_status status = hg_sha256(secret, strlen(secret), it.hash);
    if (!status && !add(all, &it))
        status = HG_E_NOMEM;
    if (status)
        return status;
    all->last_number = it.number;
    *like = it;
    *at = record(log, &it);
    return HG_OK;
}

struct hg_join_ticket *hg_join_ticket_find(
    const struct hg_join_tickets *all, const uint8_t hash[32])
{
    struct hg_join_ticket *found = NULL;
    for (uint32_t i = 0; i < all->count; i++)
        if (CRYPTO_memcmp(hash, all->items[i].hash, 32) == 0)
            found = &all->items[i];
    return found;
}

static struct hg_join_ticket *find_by_number(const struct hg_join_tickets *all, uint64_t number)
{
    for (uint32_t i = 0; i < all->count; i++)
        if (all->items[i].number == number)
            return &all->items[i];
    return NULL;
}

bool hg_join_ticket_is_good(const struct hg_join_ticket *ticket, uint64_t now_s)
{
    return ticket->used < ticket->uses && now_s < ticket->until_s;
}

uint64_t hg_join_ticket_use(struct hg_join_ticket *ticket, struct hg_state_log *log)
{
    ticket->used++;
    return record(log, ticket);
}

uint64_t hg_join_ticket_remove(
    struct hg_join_tickets *all, struct hg_state_log *log, uint32_t number)
{
    struct hg_join_ticket *it = find_by_number(all, number);
    if (!it)
        return 0;
    size_t behind = all->count - 1 - (size_t)(it - all->items);
    memmove(it, it + 1, behind * sizeof *it);
    all->count--;
    return hg_state_put_ticket_end(log, number);
}

void hg_join_ticket_as_token(const struct hg_join_ticket *ticket, struct hg_token *out)
{
    *out = (struct hg_token){.role = ticket->role,
        .scope = {.weight = ticket->weight,
            .max_rate = ticket->max_rate,
            .max_pixels = ticket->max_pixels,
            .is_ticket = true}};
    memcpy(out->hash, ticket->hash, sizeof out->hash);
    snprintf(out->name, sizeof out->name, "%s", ticket->label);
    snprintf(out->tenant, sizeof out->tenant, "%s", ticket->tenant);
    snprintf(out->scope.scenes, sizeof out->scope.scenes, "%s", ticket->scene);
    snprintf(out->scope.roots, sizeof out->scope.roots, "%s", ticket->roots);
}

uint32_t hg_join_tickets_of(const struct hg_join_tickets *all, const char *tenant)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < all->count; i++)
        count += strcmp(all->items[i].tenant, tenant) == 0;
    return count;
}

void hg_join_tickets_record_all(const struct hg_join_tickets *all, struct hg_state_log *log)
{
    for (uint32_t i = 0; i < all->count; i++)
        record(log, &all->items[i]);
    if (all->last_number && !find_by_number(all, all->last_number))
        hg_state_put_ticket_end(log, all->last_number); // numbers are not given again
}

static void take_text(char *out, size_t size, struct hgp_str text)
{
    snprintf(out, size, "%.*s", (int)text.size, text.size ? text.data : "");
}

enum hg_status hg_join_ticket_restore(
    struct hg_join_tickets *all, const struct hg_state_ticket *record)
{
    struct hg_join_ticket it = {.number = record->number,
        .uses = record->uses,
        .used = record->used,
        .until_s = record->until_s,
        .weight = record->weight,
        .max_rate = record->max_rate,
        .max_pixels = record->max_pixels,
        .role = (enum hgp_role)record->role,
        .has_issuer_key = record->has_issuer_key};
    memcpy(it.hash, record->hash, sizeof it.hash);
    memcpy(it.issuer_key, record->issuer_key, sizeof it.issuer_key);
    take_text(it.tenant, sizeof it.tenant, record->tenant);
    take_text(it.issuer, sizeof it.issuer, record->issuer);
    take_text(it.scene, sizeof it.scene, record->scene);
    take_text(it.label, sizeof it.label, record->label);
    take_text(it.roots, sizeof it.roots, record->roots);
    struct hg_join_ticket *old = find_by_number(all, it.number);
    if (all->last_number < it.number)
        all->last_number = it.number;
    if (old)
        *old = it;
    return old || add(all, &it) ? HG_OK : HG_E_NOMEM;
}

void hg_join_tickets_finish(struct hg_join_tickets *all)
{
    hg_free(all->items);
    *all = (struct hg_join_tickets){0};
}
