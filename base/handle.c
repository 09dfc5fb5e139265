#include "base/handle.h"

#include "base/alloc.h"

enum hg_status hg_handle_add(struct hg_handles *table, void *object, uint64_t *out)
{
    *out = 0;
    if (table->used >= (table->limit ? table->limit : UINT32_MAX / 2))
        return HG_E_LIMIT;
    uint32_t index;
    if (table->first_free) {
        index = table->first_free - 1;
        table->first_free = table->slots[index].next_free;
    } else {
        if (hg_grow(&table->slots, &table->capacity, (size_t)table->count + 1, sizeof *table->slots))
            return HG_E_NOMEM;
        index = table->count++;
        table->slots[index].generation = 1;
    }
    table->slots[index].object = object;
    table->used++;
    *out = (uint64_t)table->slots[index].generation << 32 | (index + 1);
    return HG_OK;
}

static struct hg_handle_slot *find_slot(const struct hg_handles *table, uint64_t handle)
{
    uint32_t index = (uint32_t)handle;
    if (index == 0 || index > table->count)
        return NULL;
    struct hg_handle_slot *slot = &table->slots[index - 1];
    return slot->object && slot->generation == handle >> 32 ? slot : NULL;
}

void *hg_handle_find(const struct hg_handles *table, uint64_t handle)
{
    struct hg_handle_slot *slot = find_slot(table, handle);
    return slot ? slot->object : NULL;
}

void *hg_handle_remove(struct hg_handles *table, uint64_t handle)
{
    struct hg_handle_slot *slot = find_slot(table, handle);
    if (!slot)
        return NULL;
    void *object = slot->object;
    slot->object = NULL;
    table->used--;
    if (++slot->generation != 0) { // a slot whose generations are used up is retired
        slot->next_free = table->first_free;
        table->first_free = (uint32_t)handle;
    }
    return object;
}

void *hg_handle_next(const struct hg_handles *table, uint32_t *cursor, uint64_t *handle)
{
    while (*cursor < table->count) {
        uint32_t index = (*cursor)++;
        if (table->slots[index].object) {
            if (handle)
                *handle = (uint64_t)table->slots[index].generation << 32 | (index + 1);
            return table->slots[index].object;
        }
    }
    return NULL;
}

void hg_handles_finish(struct hg_handles *table)
{
    hg_free(table->slots);
    *table = (struct hg_handles){.limit = table->limit};
}
