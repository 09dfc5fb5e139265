// optimise.c - lists and tables, and one function after the other: entry points first, then those
// that are still called.
#include "renderer/gpu/optimise.h"

#include <string.h>

#include "base/alloc.h"
#include "renderer/gpu/optimise_internal.h"

static const size_t sizes[LIST_COUNT] = {
    [LIST_VALUES] = sizeof(struct opt_value),
    [LIST_INSTRUCTIONS] = sizeof(struct opt_instruction),
    [LIST_OPERANDS] = sizeof(struct opt_operand),
    [LIST_BLOCKS] = sizeof(struct opt_block),
    [LIST_EDGES] = sizeof(struct opt_edge),
    [LIST_PLACES] = sizeof(struct opt_place),
    [LIST_LEAVES] = sizeof(struct opt_leaf),
    [LIST_WRITES] = sizeof(struct opt_write),
    [LIST_LOOPS] = sizeof(struct opt_loop),
    [LIST_STORES] = sizeof(struct opt_store),
};

static size_t size_of(enum opt_list list)
{
    return sizes[list] ? sizes[list] : sizeof(uint32_t);
}

uint32_t opt_add(struct opt *o, enum opt_list list, uint32_t count)
{
    const size_t first = o->lists[list].count, size = size_of(list);
    if (o->failed || first + count >= UINT32_MAX ||
        hg_grow(&o->lists[list].items, &o->lists[list].capacity, first + count, size)) {
        o->failed = true;
        return 0;
    }
    memset((char *)o->lists[list].items + first * size, 0, count * size);
    o->lists[list].count = first + count;
    return (uint32_t)first;
}

static size_t slot_of(const struct opt_table *table, uint64_t key)
{
    const uint64_t hash = key * 0x9e3779b97f4a7c15ull;
    size_t slot = (size_t)(hash ^ hash >> 32) & (table->capacity - 1);
    while (table->keys[slot] != 0 && table->keys[slot] != key)
        slot = (slot + 1) & (table->capacity - 1);
    return slot;
}

static bool grow(struct opt_table *table)
{
    if (4 * (table->count + 1) <= 3 * table->capacity)
        return true;
    struct opt_table larger = {.capacity = table->capacity ? 2 * table->capacity : 1024};
    larger.keys = hg_calloc(larger.capacity, sizeof *larger.keys);
    larger.values = hg_calloc(larger.capacity, sizeof *larger.values);
    larger.count = table->count;
    const bool done = larger.keys != NULL && larger.values != NULL;
    for (size_t k = 0; k < table->capacity && done; k++) {
        if (table->keys[k] == 0)
            continue;
        const size_t slot = slot_of(&larger, table->keys[k]);
        larger.keys[slot] = table->keys[k];
        larger.values[slot] = table->values[k];
    }
    struct opt_table *left = done ? table : &larger;
    hg_free(left->keys);
    hg_free(left->values);
    if (done)
        *table = larger;
    return done;
}

uint32_t *opt_find(struct opt *o, struct opt_table *table, uint64_t key)
{
    if (o->failed || !grow(table)) {
        o->failed = true;
        return NULL;
    }
    const size_t slot = slot_of(table, key);
    if (table->keys[slot] == 0) {
        table->keys[slot] = key;
        table->count++;
    }
    return &table->values[slot];
}

uint32_t opt_look(const struct opt_table *table, uint64_t key)
{
    return table->capacity > 0 ? table->values[slot_of(table, key)] : 0;
}

struct opt_id *opt_id(struct opt *o, uint32_t id)
{
    if (id == 0 || id >= o->bound + OPT_MOST_NEW) {
        o->failed = true;
        id = 0;
    }
    return &o->ids[id];
}

struct opt_type *opt_type(struct opt *o, uint32_t id)
{
    if (id >= o->bound)
        o->failed = true;
    return &o->types[id < o->bound ? id : 0];
}

static void queue_entry_points(struct opt *o)
{
    for (const uint32_t *i = o->words + HG_SPIRV_HEADER_WORDS; i < o->words + o->first_function;
         i += hg_spirv_length(i)) {
        if (hg_spirv_op(i) != SpvOpEntryPoint || hg_spirv_length(i) < 3)
            continue;
        const uint32_t function = opt_id(o, i[2])->function;
        o->failed |= function == 0;
        if (function != 0)
            o->functions[function - 1].queued = true;
    }
}

static void run(struct opt *o)
{
    opt_read_module(o);
    if (!o->failed)
        queue_entry_points(o);
    // A function stands anywhere: those that are called may lie before those that call them.
    bool again = true;
    while (again && !o->failed) {
        again = false;
        for (uint32_t k = 0; k < o->function_count && !o->failed; k++) {
            struct opt_function *f = &o->functions[k];
            if (!f->queued || f->written)
                continue;
            f->written = again = true;
            opt_write_function(o, f);
            opt_put_function(o, f);
        }
    }
}

static bool begin(struct opt *o, const uint32_t *words, size_t count)
{
    *o = (struct opt){.words = words,
        .count = count,
        .bound = words[3],
        .next_id = words[3],
        .last_id = words[3] + OPT_MOST_NEW};
    o->ids = hg_calloc(o->bound + OPT_MOST_NEW, sizeof *o->ids);
    o->types = hg_calloc(o->bound, sizeof *o->types);
    o->functions = hg_calloc(o->bound, sizeof *o->functions);
    o->failed = o->ids == NULL || o->types == NULL || o->functions == NULL;
    for (enum opt_list list = 0; list < LIST_COUNT; list++)
        opt_add(o, list, 1); // what 0 stands for
    return !o->failed;
}

bool hg_spirv_optimise(const uint32_t *words, size_t size_bytes, struct hg_spirv *out)
{
    *out = (struct hg_spirv){0};
    const size_t count = size_bytes / sizeof *words;
    struct opt o;
    if (count < HG_SPIRV_HEADER_WORDS || words[0] != SpvMagicNumber || words[3] == 0 ||
        words[3] > HG_SPIRV_MOST_IDS || count > UINT32_MAX)
        return false;
    if (begin(&o, words, count))
        run(&o);
    const bool done = !o.failed && opt_put_module(&o, out);
    for (enum opt_list list = 0; list < LIST_COUNT; list++)
        hg_free(o.lists[list].items);
    hg_free(o.ids);
    hg_free(o.types);
    hg_free(o.functions);
    hg_free(o.defs.keys);
    hg_free(o.defs.values);
    hg_free(o.known.keys);
    hg_free(o.known.values);
    return done;
}
