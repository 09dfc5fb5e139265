// listed.c - see listed.h.
#include "renderer/geometry/listed.h"

#include <string.h>

#include "base/alloc.h"

#define ITEMS_PER_JOB 32

struct write {
    struct hg_listing *listing;
    uint32_t *indices, *ids;
};

void hg_listing_reset(struct hg_listing *l)
{
    l->count = l->sieve_count = l->id_count = 0;
    l->index_count = 0;
}

void hg_listing_finish(struct hg_listing *l)
{
    hg_free(l->items);
    hg_free(l->sieves);
    memset(l, 0, sizeof *l);
}

enum hg_status hg_listing_add(struct hg_listing *l, const struct hg_listed *item)
{
    const enum hg_status status = hg_grow(&l->items, &l->capacity, l->count + 1, sizeof *l->items);
    if (status != HG_OK)
        return status;
    struct hg_listed *to = &l->items[l->count++];
    *to = *item;
    to->to = l->index_count;
    l->index_count += (uint64_t)item->count * item->corners;
    if (item->ids == HG_CLUSTER_NONE)
        return HG_OK;
    to->ids = l->id_count;
    l->id_count += item->count;
    return HG_OK;
}

enum hg_status hg_listing_add_sieve(
    struct hg_listing *l, const struct hg_sieve *sieve, uint32_t *index)
{
    const enum hg_status status =
        hg_grow(&l->sieves, &l->sieve_capacity, l->sieve_count + 1, sizeof *l->sieves);
    *index = HG_LISTED_ALL;
    if (status != HG_OK)
        return status;
    *index = l->sieve_count++;
    l->sieves[*index] = *sieve;
    return HG_OK;
}

static void turn_around(uint32_t *indices, uint32_t *ids, uint32_t count, uint32_t corners)
{
    for (uint32_t low = 0, high = count; low + 1 < high--; low++) {
        if (ids != NULL) {
            const uint32_t id = ids[low];
            ids[low] = ids[high];
            ids[high] = id;
        }
        for (uint32_t k = 0; k < corners; k++) {
            const uint32_t index = indices[low * corners + k];
            indices[low * corners + k] = indices[high * corners + k];
            indices[high * corners + k] = index;
        }
    }
}

static void write_item(const struct write *w, struct hg_listed *item)
{
    const uint32_t *from = item->indices + (size_t)item->first * item->corners;
    uint32_t *to = w->indices + item->to;
    uint32_t *ids = item->ids != HG_CLUSTER_NONE ? w->ids + item->ids : NULL;
    item->kept = item->count;
    if (item->sieve != HG_LISTED_ALL)
        item->kept =
            hg_sieve_list(&w->listing->sieves[item->sieve], item->positions, from, item->count, to);
    else
        memcpy(to, from, (size_t)item->count * item->corners * 4);
    for (uint32_t k = 0; ids != NULL && k < item->count; k++)
        ids[k] = item->base + item->first + k;
    if (item->backwards)
        turn_around(to, ids, item->kept, item->corners);
}

static void write_items(void *user, size_t job)
{
    const struct write *w = user;
    const size_t first = job * ITEMS_PER_JOB;
    const size_t end =
        first + ITEMS_PER_JOB < w->listing->count ? first + ITEMS_PER_JOB : w->listing->count;
    for (size_t i = first; i < end; i++)
        write_item(w, &w->listing->items[i]);
}

void hg_listing_write(struct hg_listing *l, struct hg_jobs *jobs, uint32_t *indices, uint32_t *ids)
{
    struct write w = {l, indices, ids};
    const size_t count = ((size_t)l->count + ITEMS_PER_JOB - 1) / ITEMS_PER_JOB;
    if (count > 1 && jobs != NULL)
        hg_jobs_for(jobs, count, write_items, &w);
    else
        for (size_t i = 0; i < count; i++)
            write_items(&w, i);
}

uint32_t hg_listing_pack(
    const struct hg_listing *l, uint32_t first, uint32_t count, uint32_t *indices)
{
    uint32_t kept = 0;
    uint32_t *to = count > 0 ? indices + l->items[first].to : indices;
    for (uint32_t i = first; i < first + count; i++) {
        const struct hg_listed *item = &l->items[i];
        const size_t words = (size_t)item->kept * item->corners;
        if (words > 0 && to != indices + item->to)
            memmove(to, indices + item->to, words * 4);
        to += words;
        kept += item->kept;
    }
    return kept;
}
