// listed.h - lists of indices that are made for one frame. Floor 2 (geometry). Private to the room.
// Thread: one at a time; writing is spread over jobs.
#ifndef HG_RENDERER_GEOMETRY_LISTED_H
#define HG_RENDERER_GEOMETRY_LISTED_H

#include "renderer/geometry/sieve.h"

#define HG_LISTED_ALL UINT32_MAX

// Consecutive primitives that a list takes from a part.
struct hg_listed {
    const uint32_t *indices; // of the part
    uint32_t first, count;   // primitives of it
    uint32_t corners;        // of each
    uint64_t to;             // place in the list, indices
    uint32_t ids, base;      // place in the list of ids, HG_CLUSTER_NONE: none; added
    uint32_t sieve;          // that they go through; HG_LISTED_ALL: none
    const float *positions;  // with a sieve
    uint32_t kept;           // primitives that came through, once it is written
    bool backwards;
};

struct hg_listing { // zeroed = empty; keeps its memory
    struct hg_listed *items;
    size_t capacity;
    uint32_t count;
    struct hg_sieve *sieves;
    size_t sieve_capacity;
    uint32_t sieve_count;
    uint64_t index_count; // that there must be room for
    uint32_t id_count;
};

void hg_listing_reset(struct hg_listing *listing);
void hg_listing_finish(struct hg_listing *listing);
// Places `item` behind what there is: `to`, and `ids` unless it is HG_CLUSTER_NONE. HG_E_NOMEM.
enum hg_status hg_listing_add(
    struct hg_listing *listing, const struct hg_listed *item) HG_MUST_CHECK;
// A sieve for items to come; *index: its number. HG_E_NOMEM.
enum hg_status hg_listing_add_sieve(
    struct hg_listing *listing, const struct hg_sieve *sieve, uint32_t *index) HG_MUST_CHECK;
// Writes all items. jobs may be NULL.
void hg_listing_write(
    struct hg_listing *listing, struct hg_jobs *jobs, uint32_t *indices, uint32_t *ids);
// Moves what was kept of `count` consecutive items together, to the place of the first. Returns how
// many primitives that is.
uint32_t hg_listing_pack(
    const struct hg_listing *listing, uint32_t first, uint32_t count, uint32_t *indices);

#endif
