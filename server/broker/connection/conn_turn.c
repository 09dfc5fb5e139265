#include "server/broker/connection/conn_turn.h"

#include <string.h>

#include "base/alloc.h"
#include "base/clock.h"

static const uint64_t give_ns = 8000000; // of one round, to all parties; then events are looked at

// ---- parties ------------------------------------------------------------------------------------

// FNV-1a, as in peer_table.c.
static struct hg_party **bucket_of(struct hg_turns *turns, const uint8_t key[HG_TURN_KEY_BYTES])
{
    uint64_t hash = 14695981039346656037u;
    for (size_t i = 0; i < HG_TURN_KEY_BYTES; i++)
        hash = (hash ^ key[i]) * 1099511628211u;
    return &turns->buckets[(hash ^ hash >> 32) % HG_TURN_BUCKETS];
}

static struct hg_party *find_party(struct hg_turns *turns, const uint8_t key[HG_TURN_KEY_BYTES])
{
    struct hg_party **bucket = bucket_of(turns, key), *party = *bucket;
    while (party && memcmp(party->key, key, sizeof party->key) != 0)
        party = party->chain;
    if (party)
        return party;
    party = hg_calloc(1, sizeof *party);
    if (!party)
        return NULL;
    memcpy(party->key, key, sizeof party->key);
    party->chain = *bucket;
    *bucket = party;
    return party;
}

static void release_party(struct hg_turns *turns, struct hg_party *party)
{
    struct hg_party **link = bucket_of(turns, party->key);
    if (--party->connections)
        return;
    while (*link != party)
        link = &(*link)->chain;
    *link = party->chain;
    hg_free(party);
}

enum hg_status hg_turn_join(struct hg_turn *turn, const uint8_t key[HG_TURN_KEY_BYTES])
{
    const bool paused = turn->paused;
    struct hg_party *party = find_party(turn->turns, key);
    if (!party)
        return HG_E_NOMEM;
    party->connections++;
    hg_turn_leave(turn);
    turn->party = party;
    if (paused)
        hg_turn_pause(turn);
    return HG_OK;
}

void hg_turn_leave(struct hg_turn *turn)
{
    hg_turn_unpause(turn);
    if (turn->party)
        release_party(turn->turns, turn->party);
    turn->party = NULL;
}

// ---- those that wait ----------------------------------------------------------------------------

static void link_party(struct hg_turns *turns, struct hg_party *party)
{
    party->prev = turns->last;
    party->next = NULL;
    *(turns->last ? &turns->last->next : &turns->first) = party;
    turns->last = party;
    turns->parties++;
}

static void unlink_party(struct hg_turns *turns, struct hg_party *party)
{
    *(party->prev ? &party->prev->next : &turns->first) = party->next;
    *(party->next ? &party->next->prev : &turns->last) = party->prev;
    party->prev = party->next = NULL;
    turns->parties--;
}

static void append(struct hg_party *party, struct hg_turn *turn)
{
    turn->prev = party->last;
    turn->next = NULL;
    *(party->last ? &party->last->next : &party->first) = turn;
    party->last = turn;
}

static void take_out(struct hg_party *party, struct hg_turn *turn)
{
    *(turn->prev ? &turn->prev->next : &party->first) = turn->next;
    *(turn->next ? &turn->next->prev : &party->last) = turn->prev;
    turn->prev = turn->next = NULL;
}

void hg_turn_pause(struct hg_turn *turn)
{
    struct hg_party *party = turn->party;
    struct hg_turns *turns = turn->turns;
    if (turn->paused || !party)
        return;
    turn->paused = true;
    append(party, turn);
    turns->waiting++;
    if (!party->waiting++)
        link_party(turns, party);
}

void hg_turn_unpause(struct hg_turn *turn)
{
    struct hg_party *party = turn->party;
    struct hg_turns *turns = turn->turns;
    if (!turn->paused)
        return;
    turn->paused = false;
    take_out(party, turn);
    turns->waiting--;
    if (!--party->waiting)
        unlink_party(turns, party);
}

// ---- turns --------------------------------------------------------------------------------------

static bool is_over(const struct hg_turns *turns, const struct hg_party *party)
{
    return party->round == turns->round &&
           (party->used_ns >= HG_TURN_NS || party->messages >= HG_TURN_MESSAGES);
}

static void spend(
    const struct hg_turns *turns, struct hg_party *party, uint64_t ns, uint32_t messages)
{
    if (party->round != turns->round) {
        party->round = turns->round;
        party->used_ns = 0;
        party->messages = 0;
    }
    party->used_ns += ns;
    party->messages += messages;
}

bool hg_turn_is_over(const struct hg_turn *turn)
{
    return turn->party && is_over(turn->turns, turn->party);
}

void hg_turn_spend(struct hg_turn *turn, uint64_t ns, uint32_t messages)
{
    if (turn->party)
        spend(turn->turns, turn->party, ns, messages);
}

// Those that pause again, or may not go on yet, are behind the others afterwards. Where none may go
// on there is no hurry.
static void give(struct hg_turns *turns, struct hg_party *party, void (*resume)(void *owner))
{
    uint64_t begin_ns = hg_clock_now_ns();
    const uint32_t tries = party->waiting < HG_TURN_TRIES ? party->waiting : HG_TURN_TRIES;
    bool went_on = false;
    for (uint32_t i = 0; i < tries && party->first; i++) {
        struct hg_turn *turn = party->first;
        if (is_over(turns, party)) {
            turns->more |= went_on;
            return;
        }
        take_out(party, turn);
        append(party, turn);
        resume(turn->owner);
        const uint64_t now_ns = hg_clock_now_ns();
        went_on |= !turn->paused || turn->deferred;
        spend(turns, party, now_ns - begin_ns, 0);
        begin_ns = now_ns;
    }
}

void hg_turns_give(struct hg_turns *turns, void (*resume)(void *owner))
{
    const uint64_t end_ns = hg_clock_now_ns() + give_ns;
    turns->more = false;
    turns->round++;
    for (uint32_t left = turns->parties; left && turns->first; left--) {
        struct hg_party *party = turns->first;
        if (hg_clock_now_ns() >= end_ns) {
            turns->more = true;
            return;
        }
        unlink_party(turns, party);
        link_party(turns, party);
        party->connections++; // its last one may go
        give(turns, party, resume);
        release_party(turns, party);
    }
}
