#include "server/broker/session/block_list.h"

#include <string.h>

uint64_t hg_block_until(const struct hg_block_list *list, const uint8_t hash[32], uint64_t now_s)
{
    uint64_t until_s = 0;
    for (int i = 0; i < HG_BLOCKS; i++)
        if (list->items[i].until_s > now_s && memcmp(list->items[i].hash, hash, 32) == 0)
            until_s = list->items[i].until_s;
    return until_s;
}

// That of the same hash, else the one that ends first: unused ones ended in 1970.
static struct hg_block *find_place(struct hg_block_list *list, const uint8_t hash[32])
{
    struct hg_block *best = &list->items[0];
    for (int i = 0; i < HG_BLOCKS; i++) {
        struct hg_block *it = &list->items[i];
        if (it->until_s && memcmp(it->hash, hash, 32) == 0)
            return it;
        if (it->until_s < best->until_s)
            best = it;
    }
    return best;
}

static uint64_t record(struct hg_state_log *log, const struct hg_block *block)
{
    struct hg_state_block m = {.until_s = block->until_s};
    memcpy(m.hash, block->hash, sizeof m.hash);
    return hg_state_put_block(log, &m);
}

uint64_t hg_block_add(
    struct hg_block_list *list, struct hg_state_log *log, const uint8_t hash[32], uint64_t until_s)
{
    struct hg_block *place = find_place(list, hash);
    memcpy(place->hash, hash, sizeof place->hash);
    place->until_s = until_s;
    return record(log, place);
}

void hg_block_record_all(const struct hg_block_list *list, struct hg_state_log *log)
{
    for (int i = 0; i < HG_BLOCKS; i++)
        if (list->items[i].until_s)
            record(log, &list->items[i]);
}
