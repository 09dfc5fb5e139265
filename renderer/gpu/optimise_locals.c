// optimise_locals.c - local variables as values: what each block leaves in them, and phis where
// blocks meet that leave different ones.
// Source: Braun et al., "Simple and efficient construction of static single assignment form", 2013;
// structured control flow tells which variables a loop writes before its end is seen, and blocks
// are numbered in an order in which what lies between a block and its dominator is what may have
// written.
#include "renderer/gpu/optimise_internal.h"

#include <stdlib.h>

// --- blocks --------------------------------------------------------------------------------------

uint32_t opt_block_new(struct opt *o)
{
    return opt_add(o, LIST_BLOCKS, 1);
}

void opt_edge(struct opt *o, uint32_t from, uint32_t to)
{
    uint32_t *link = &opt_block_at(o, to)->edges;
    for (; *link != 0; link = &opt_edge_at(o, *link)->next)
        if (opt_edge_at(o, *link)->from == from)
            return;
    const uint32_t edge = opt_add(o, LIST_EDGES, 1);
    link = &opt_block_at(o, to)->edges;
    while (*link != 0)
        link = &opt_edge_at(o, *link)->next;
    *link = edge;
    opt_edge_at(o, edge)->from = from;
    opt_block_at(o, to)->edge_count++;
}

static uint32_t order_of(const struct opt *o, uint32_t block)
{
    return opt_block_at(o, block)->order;
}

static uint32_t common_dominator(const struct opt *o, uint32_t a, uint32_t b)
{
    while (a != b) {
        if (order_of(o, a) > order_of(o, b))
            a = opt_block_at(o, a)->idom;
        else
            b = opt_block_at(o, b)->idom;
    }
    return a;
}

void opt_enter(struct opt *o, uint32_t block)
{
    struct opt_block *b = opt_block_at(o, block);
    o->failed |= b->order != 0 || block == 0;
    if (o->failed)
        return;
    uint32_t idom = 0;
    for (uint32_t edge = b->edges; edge != 0; edge = opt_edge_at(o, edge)->next) {
        const uint32_t from = opt_edge_at(o, edge)->from;
        idom = idom == 0 ? from : common_dominator(o, idom, from);
    }
    b->idom = idom;
    const uint32_t order = opt_add(o, LIST_ORDER, 1);
    *opt_order_at(o, order) = block;
    b->order = order;
    o->current = block;
}

// --- leaves --------------------------------------------------------------------------------------

static void add_leaves(struct opt *o, uint32_t type, uint32_t variable, uint32_t *at)
{
    const struct opt_type *t = opt_type(o, type);
    if (t->op != SpvOpTypeStruct && t->op != SpvOpTypeArray) {
        *opt_leaf_at(o, (*at)++) = (struct opt_leaf){.type = type, .variable = variable};
        return;
    }
    for (uint32_t k = 0; k < t->count; k++)
        add_leaves(o, opt_part_type(o, type, k), variable, at);
}

uint32_t opt_variable(struct opt *o, uint32_t type)
{
    uint32_t first = opt_add(o, LIST_LEAVES, opt_slots(o, type)), at = first;
    if (first != 0)
        add_leaves(o, type, first, &at);
    return first;
}

static uint64_t key_of(uint32_t leaf, uint32_t block)
{
    return (uint64_t)leaf << 32 | block;
}

static uint32_t *definition(struct opt *o, uint32_t leaf, uint32_t block)
{
    uint32_t *value = opt_find(o, &o->defs, key_of(leaf, block));
    return value != NULL ? value : &o->unused;
}

void opt_leaf_write(struct opt *o, uint32_t leaf, uint32_t value)
{
    const uint32_t order = order_of(o, o->current);
    *definition(o, leaf, o->current) = value;
    if (opt_write_at(o, opt_leaf_at(o, leaf)->writes)->order == order)
        return;
    const uint32_t write = opt_add(o, LIST_WRITES, 1);
    *opt_write_at(o, write) = (struct opt_write){order, opt_leaf_at(o, leaf)->writes};
    opt_leaf_at(o, leaf)->writes = write;
}

// Whether a block with first <= order <= last writes it.
static bool is_written(const struct opt *o, uint32_t leaf, uint32_t first, uint32_t last)
{
    uint32_t write = opt_leaf_at(o, leaf)->writes;
    while (write != 0 && opt_write_at(o, write)->order > last)
        write = opt_write_at(o, write)->before;
    return write != 0 && opt_write_at(o, write)->order >= first;
}

// --- phis ----------------------------------------------------------------------------------------

uint32_t opt_phi(struct opt *o, uint32_t block, uint32_t type)
{
    const uint32_t phi = opt_add(o, LIST_INSTRUCTIONS, 1), value = opt_add(o, LIST_VALUES, 1);
    *opt_value_at(o, value) = (struct opt_value){.kind = VALUE_RESULT, .type = type, .at = phi};
    *opt_instruction_at(o, phi) = (struct opt_instruction){.op = SpvOpPhi,
        .type = type,
        .value = value,
        .block = block,
        .removable = true,
        .next = opt_block_at(o, block)->phis};
    opt_block_at(o, block)->phis = phi;
    return phi;
}

uint32_t opt_phi_room(struct opt *o, uint32_t phi)
{
    const uint32_t block = opt_instruction_at(o, phi)->block;
    const uint32_t count = 2 * opt_block_at(o, block)->edge_count;
    const uint32_t first = opt_add(o, LIST_OPERANDS, count);
    struct opt_instruction *i = opt_instruction_at(o, phi);
    i->first = first;
    i->count = first != 0 ? count : 0;
    uint32_t at = first;
    for (uint32_t edge = opt_block_at(o, block)->edges; edge != 0 && first != 0;
         edge = opt_edge_at(o, edge)->next) {
        *opt_operand_at(o, at++) = (struct opt_operand){0, OPERAND_VALUE};
        *opt_operand_at(o, at++) = (struct opt_operand){opt_edge_at(o, edge)->from, OPERAND_BLOCK};
    }
    return first;
}

void opt_phi_close(struct opt *o, uint32_t phi)
{
    const struct opt_instruction i = *opt_instruction_at(o, phi);
    uint32_t same = 0;
    for (uint32_t k = 0; k < i.count; k += 2) {
        const uint32_t value = opt_resolve(o, opt_operand_at(o, i.first + k)->word);
        if (value == same || value == i.value)
            continue;
        if (same != 0 || opt_value_at(o, i.value)->forward != 0)
            return;
        same = value;
    }
    if (opt_value_at(o, i.value)->forward == 0)
        opt_value_at(o, i.value)->forward = same != 0 ? same : opt_undef(o, i.type);
}

static void fill(struct opt *o, uint32_t phi, uint32_t leaf)
{
    const uint32_t first = opt_phi_room(o, phi), count = opt_instruction_at(o, phi)->count;
    for (uint32_t k = 0; k < count && !o->failed; k += 2) {
        const uint32_t from = opt_operand_at(o, first + k + 1)->word;
        const uint32_t value = opt_leaf_read(o, leaf, from);
        opt_operand_at(o, first + k)->word = value;
    }
    opt_phi_close(o, phi);
}

// --- reading -------------------------------------------------------------------------------------

static bool is_modified(const struct opt *o, const struct opt_loop *loop, uint32_t variable)
{
    uint32_t low = 0, high = loop->modified_count;
    while (low < high) {
        const uint32_t middle = (low + high) / 2;
        if (*opt_modified_at(o, loop->modified + middle) < variable)
            low = middle + 1;
        else
            high = middle;
    }
    return low < loop->modified_count && *opt_modified_at(o, loop->modified + low) == variable;
}

// The block whose end holds what this one begins with, or 0: a phi is needed.
static uint32_t block_before(const struct opt *o, uint32_t leaf, uint32_t block)
{
    const struct opt_block *b = opt_block_at(o, block);
    if (b->loop != 0) {
        const struct opt_loop *loop = opt_loop_at(o, b->loop);
        const bool written = loop->is_closed ? is_written(o, leaf, b->order, loop->last)
                                             : is_modified(o, loop, opt_leaf_at(o, leaf)->variable);
        return written ? 0 : loop->before;
    }
    if (b->edge_count == 1)
        return opt_edge_at(o, b->edges)->from;
    return is_written(o, leaf, order_of(o, b->idom) + 1, b->order - 1) ? 0 : b->idom;
}

static uint32_t phi_of(struct opt *o, uint32_t leaf, uint32_t block)
{
    const uint32_t phi = opt_phi(o, block, opt_leaf_at(o, leaf)->type);
    *definition(o, leaf, block) = opt_instruction_at(o, phi)->value;
    const uint32_t loop = opt_block_at(o, block)->loop;
    if (loop != 0 && !opt_loop_at(o, loop)->is_closed) {
        const uint32_t at = opt_add(o, LIST_WAITING, 3);
        *opt_waiting_at(o, at) = phi;
        *opt_waiting_at(o, at + 1) = leaf;
        *opt_waiting_at(o, at + 2) = opt_loop_at(o, loop)->waiting;
        opt_loop_at(o, loop)->waiting = at;
    } else {
        fill(o, phi, leaf);
    }
    return opt_instruction_at(o, phi)->value;
}

uint32_t opt_leaf_read(struct opt *o, uint32_t leaf, uint32_t block)
{
    const uint32_t begin = block;
    uint32_t value = 0;
    while (value == 0 && !o->failed) {
        value = opt_look(&o->defs, key_of(leaf, block));
        if (value != 0)
            break;
        if (opt_block_at(o, block)->edge_count == 0) {
            value = opt_undef(o, opt_leaf_at(o, leaf)->type);
            break;
        }
        const uint32_t before = block_before(o, leaf, block);
        if (before == 0)
            value = phi_of(o, leaf, block);
        block = before;
    }
    if (block != begin && value != 0)
        *definition(o, leaf, begin) = value;
    return opt_resolve(o, value);
}

// --- loops ---------------------------------------------------------------------------------------

void opt_loop_open(struct opt *o, uint32_t header)
{
    struct opt_block *b = opt_block_at(o, header);
    o->failed |= b->edge_count != 1;
    const uint32_t before = b->edges ? opt_edge_at(o, b->edges)->from : 0;
    const uint32_t loop = opt_add(o, LIST_LOOPS, 1);
    opt_loop_at(o, loop)->before = before;
    opt_block_at(o, header)->loop = loop;
}

// The edge back is there.
void opt_loop_close(struct opt *o, uint32_t header)
{
    const uint32_t at = opt_block_at(o, header)->loop;
    struct opt_loop *loop = opt_loop_at(o, at);
    o->failed |= at == 0 || loop->is_closed;
    loop->is_closed = true;
    loop->last = (uint32_t)opt_count(o, LIST_ORDER) - 1;
    for (uint32_t wait = loop->waiting; wait != 0 && !o->failed;
         wait = *opt_waiting_at(o, wait + 2))
        fill(o, *opt_waiting_at(o, wait), *opt_waiting_at(o, wait + 1));
}

// --- places --------------------------------------------------------------------------------------

uint32_t opt_place(struct opt *o, const struct opt_place *place, uint32_t type)
{
    const uint32_t at = opt_add(o, LIST_PLACES, 1), value = opt_add(o, LIST_VALUES, 1);
    *opt_place_at(o, at) = *place;
    *opt_value_at(o, value) = (struct opt_value){.kind = VALUE_PLACE, .type = type, .at = at};
    return value;
}

uint32_t opt_place_read(struct opt *o, uint32_t place, uint32_t type)
{
    const struct opt_place p = *opt_place_at(o, place);
    uint32_t leaves[OPT_MOST_LEAVES], at = 0, number;
    for (uint32_t k = 0; k < p.leaf_count; k++)
        leaves[k] = opt_leaf_read(o, p.leaf + k, o->current);
    if (p.inner_count == 0)
        return opt_unflatten(o, type, leaves, &at);
    uint32_t value = leaves[0];
    for (uint32_t k = 0; k < p.inner_count && !o->failed; k++) {
        if (opt_is_known(o, p.inner[k], &number)) {
            value = opt_part(o, value, number);
            continue;
        }
        const uint32_t part = opt_part_type(o, opt_type_of(o, value), 0);
        const uint32_t i = opt_begin(o, SpvOpVectorExtractDynamic, part, 0);
        opt_operand(o, OPERAND_VALUE, value);
        opt_operand(o, OPERAND_VALUE, p.inner[k]);
        value = opt_finish(o, i, true, true);
    }
    return value;
}

// The composite with one part replaced.
static uint32_t insert(struct opt *o, uint32_t whole, uint32_t index, uint32_t part)
{
    uint32_t number;
    const bool known = opt_is_known(o, index, &number);
    const uint32_t op = known ? SpvOpCompositeInsert : SpvOpVectorInsertDynamic;
    const uint32_t i = opt_begin(o, op, opt_type_of(o, whole), 0);
    opt_operand(o, OPERAND_VALUE, known ? part : whole);
    opt_operand(o, OPERAND_VALUE, known ? whole : part);
    opt_operand(o, known ? OPERAND_WORD : OPERAND_VALUE, known ? number : index);
    return opt_finish(o, i, true, true);
}

void opt_place_write(struct opt *o, uint32_t place, uint32_t value)
{
    const struct opt_place p = *opt_place_at(o, place);
    uint32_t leaves[OPT_MOST_LEAVES], number;
    if (p.inner_count > 0) {
        const uint32_t whole = opt_leaf_read(o, p.leaf, o->current);
        value = opt_whole(o, value);
        if (p.inner_count == 2) { // a part of a matrix' column
            o->failed |= !opt_is_known(o, p.inner[0], &number);
            value = o->failed ? 0 : insert(o, opt_part(o, whole, number), p.inner[1], value);
        }
        opt_leaf_write(o, p.leaf, o->failed ? 0 : insert(o, whole, p.inner[0], value));
        return;
    }
    o->failed |= opt_slots(o, opt_type_of(o, value)) != p.leaf_count;
    if (o->failed)
        return;
    opt_flatten(o, value, leaves);
    for (uint32_t k = 0; k < p.leaf_count; k++)
        opt_leaf_write(o, p.leaf + k, leaves[k]);
}
