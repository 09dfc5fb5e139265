// layout_apart.c - see layout_apart.h.
#include "renderer/trace/layout_apart.h"

#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "base/hash.h"
#include "renderer/trace/layout.h"

struct entry { // a place of a flat body
    uint64_t hash;
    bool stays; // in the flat structure
};

struct split {
    struct entry *places; // [place_count]
    uint64_t *hashes;     // [count] of those of flat bodies, ascending
    uint32_t count;
};

static int by_value(const void *a, const void *b)
{
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return x < y ? -1 : x > y;
}

static bool holds(const uint64_t *hashes, uint32_t count, uint64_t hash)
{
    return count > 0 && bsearch(&hash, hashes, count, sizeof hash, by_value) != NULL;
}

// Hash of a placement: body, matrix and input addresses.
static uint64_t hash_place(const struct hg_trace_layout *l, const struct hg_trace_place *place)
{
    uint64_t h = hg_hash_mix(7, place->key);
    h = hg_hash_mix(h, (uint64_t)place->draw << 32 | place->mask);
    h = hg_hash_mix_bytes(h, l->pieces[place->first_piece].world, 12 * sizeof(float));
    for (uint32_t k = 0; k < place->piece_count; k++) {
        const struct hg_ray_geometry_piece *piece = hg_trace_piece(l, place, k);
        h = hg_hash_mix(hg_hash_mix(h, (uintptr_t)piece->positions), (uintptr_t)piece->indices);
    }
    return h;
}

static void list_places(const struct hg_trace_layout *l, struct split *s)
{
    for (uint32_t i = 0; i < l->body_count; i++) {
        const struct hg_trace_body *body = &l->bodies[i];
        for (uint32_t p = 0; body->flat && p < body->place_count; p++) {
            const uint32_t at = body->first_place + p;
            s->places[at].hash = hash_place(l, &l->places[at]);
            s->hashes[s->count++] = s->places[at].hash;
        }
    }
    if (s->count > 0)
        qsort(s->hashes, s->count, sizeof *s->hashes, by_value);
}

// Deformed bodies are rebuilt or refitted at each sync anyway.
static bool stays(
    const struct hg_trace_layout *l, const struct hg_trace_body *body, const struct entry *place)
{
    return body->deforms || holds(l->moved.flat, l->moved.flat_count, place->hash);
}

// False: too many triangles are split off while nothing moves.
static bool choose(const struct hg_trace_layout *l, struct split *s)
{
    uint64_t flat = 0, apart = 0;
    bool still = true;
    for (uint32_t i = 0; i < l->body_count; i++) {
        const struct hg_trace_body *body = &l->bodies[i];
        for (uint32_t p = 0; body->flat && p < body->place_count; p++) {
            struct entry *place = &s->places[body->first_place + p];
            place->stays = stays(l, body, place);
            *(place->stays ? &flat : &apart) += body->triangles;
            still = still && holds(l->moved.before, l->moved.before_count, place->hash);
        }
    }
    return flat > 0 && !(still && apart > flat / 2);
}

// Brings the places of a body that stay to its beginning; the rest get bodies of their own.
static enum hg_status split_body(struct hg_trace_layout *l, struct split *s, uint32_t index)
{
    const struct hg_trace_body from = l->bodies[index];
    uint32_t kept = 0;
    for (uint32_t p = 0; p < from.place_count; p++) {
        const uint32_t at = from.first_place + p, to = from.first_place + kept;
        if (!s->places[at].stays)
            continue;
        const struct hg_trace_place place = l->places[at];
        const struct entry entry = s->places[at];
        l->places[at] = l->places[to];
        s->places[at] = s->places[to];
        l->places[to] = place;
        s->places[to] = entry;
        kept++;
    }
    l->bodies[index].place_count = kept;
    for (uint32_t p = kept; p < from.place_count; p++) {
        if (hg_grow(&l->bodies, &l->body_capacity, l->body_count + 1, sizeof *l->bodies) != HG_OK)
            return HG_E_NOMEM;
        struct hg_trace_body *body = &l->bodies[l->body_count++];
        *body = from;
        body->key = s->places[from.first_place + p].hash;
        body->first_place = from.first_place + p;
        body->place_count = 1;
        body->flat = false;
        body->in_world = true;
    }
    return HG_OK;
}

static void keep_flat(struct hg_trace_layout *l, struct split *s)
{
    uint32_t count = 0;
    for (uint32_t i = 0; i < l->body_count; i++) {
        const struct hg_trace_body *body = &l->bodies[i];
        for (uint32_t p = 0; body->flat && p < body->place_count; p++)
            l->moved.flat[count++] = s->places[body->first_place + p].hash;
    }
    l->moved.flat_count = count;
    if (count > 0)
        qsort(l->moved.flat, count, sizeof *l->moved.flat, by_value);
}

static enum hg_status split(struct hg_trace_layout *l, struct split *s)
{
    const uint32_t bodies = l->body_count;
    enum hg_status status = HG_OK;
    list_places(l, s);
    const bool apart = choose(l, s);
    for (uint32_t i = 0; i < bodies && apart && status == HG_OK; i++) {
        if (l->bodies[i].flat)
            status = split_body(l, s, i);
    }
    uint64_t *flat = status == HG_OK ? hg_calloc((size_t)s->count + 1, sizeof *flat) : NULL;
    if (flat == NULL)
        return HG_E_NOMEM;
    hg_free(l->moved.flat);
    l->moved.flat = flat;
    keep_flat(l, s);
    hg_free(l->moved.before);
    l->moved.before = s->hashes;
    l->moved.before_count = s->count;
    s->hashes = NULL;
    return HG_OK;
}

enum hg_status hg_trace_apart_split(struct hg_trace_layout *l)
{
    struct split s = {.places = hg_calloc((size_t)l->place_count + 1, sizeof *s.places),
        .hashes = hg_calloc((size_t)l->place_count + 1, sizeof *s.hashes)};
    const enum hg_status status = s.places != NULL && s.hashes != NULL ? split(l, &s) : HG_E_NOMEM;
    hg_free(s.places);
    hg_free(s.hashes);
    return status;
}

void hg_trace_apart_finish(struct hg_trace_apart *apart)
{
    hg_free(apart->flat);
    hg_free(apart->before);
    *apart = (struct hg_trace_apart){0};
}
