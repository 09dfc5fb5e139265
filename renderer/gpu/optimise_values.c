// optimise_values.c - values: constants, results, and composites as the parts they are made of;
// what is computed once already is not computed again.
#include "renderer/gpu/optimise_internal.h"

#include <string.h>

uint32_t opt_resolve(const struct opt *o, uint32_t value)
{
    while (opt_value_at(o, value)->forward != 0)
        value = opt_value_at(o, value)->forward;
    return value;
}

uint32_t opt_type_of(const struct opt *o, uint32_t value)
{
    return opt_value_at(o, opt_resolve(o, value))->type;
}

static uint32_t value_new(struct opt *o, enum opt_value_kind kind, uint32_t type, uint32_t at)
{
    const uint32_t value = opt_add(o, LIST_VALUES, 1);
    *opt_value_at(o, value) = (struct opt_value){.kind = kind, .type = type, .at = at};
    return value;
}

// --- constants -----------------------------------------------------------------------------------

static uint32_t *number_entry(struct opt *o, uint32_t type, uint32_t number)
{
    return opt_find(o, &o->defs, 1ull << 63 | (uint64_t)type << 32 | number);
}

// Constants with the same number are one value.
static void share_number(struct opt *o, struct opt_id *constant)
{
    uint32_t *entry = number_entry(o, constant->def[1], constant->number);
    if (entry == NULL)
        return;
    if (*entry == 0)
        *entry = constant->value;
    constant->value = *entry;
}

uint32_t opt_global(struct opt *o, uint32_t id)
{
    struct opt_id *entry = opt_id(o, id);
    if (entry->value == 0) {
        bool result = false, type = false;
        if (entry->def != NULL)
            SpvHasResultAndType((SpvOp)hg_spirv_op(entry->def), &result, &type);
        entry->value = value_new(o, VALUE_GLOBAL, type ? entry->def[1] : 0, id);
        if (entry->known)
            share_number(o, entry);
    }
    return entry->value;
}

// A constant that the module did not have. words: without the first and the result.
static uint32_t add_constant(struct opt *o, uint32_t op, uint32_t type, const uint32_t *number)
{
    const uint32_t length = number != NULL ? 4 : 3;
    if (o->next_id == o->bound + OPT_MOST_NEW) {
        o->failed = true;
        return 0;
    }
    const uint32_t id = o->next_id++, at = opt_add(o, LIST_ADDED, length);
    uint32_t *words = opt_word_at(o, at);
    if (at != 0) {
        words[0] = length << 16 | op;
        words[1] = type;
        words[2] = id;
        if (number != NULL)
            words[3] = *number;
    }
    return o->ids[id].value = value_new(o, VALUE_GLOBAL, type, id);
}

uint32_t opt_undef(struct opt *o, uint32_t type)
{
    struct opt_type *t = opt_type(o, type);
    if (t->undef == 0)
        t->undef = add_constant(o, SpvOpUndef, type, NULL);
    return t->undef;
}

static uint32_t null_of(struct opt *o, uint32_t type)
{
    struct opt_type *t = opt_type(o, type);
    if (t->null == 0)
        t->null = add_constant(o, SpvOpConstantNull, type, NULL);
    return t->null;
}

uint32_t opt_number(struct opt *o, uint32_t type, uint32_t number)
{
    uint32_t *entry = number_entry(o, type, number);
    if (entry == NULL || *entry != 0)
        return entry == NULL ? 0 : *entry;
    uint32_t value;
    if (opt_type(o, type)->op == SpvOpTypeBool)
        value = add_constant(o, number ? SpvOpConstantTrue : SpvOpConstantFalse, type, NULL);
    else
        value = add_constant(o, SpvOpConstant, type, &number);
    struct opt_id *id = opt_id(o, opt_value_at(o, value)->at);
    id->known = true;
    id->number = number;
    return *entry = value;
}

bool opt_is_known(const struct opt *o, uint32_t value, uint32_t *number)
{
    const struct opt_value *v = opt_value_at(o, opt_resolve(o, value));
    if (v->kind != VALUE_GLOBAL || !o->ids[v->at].known)
        return false;
    *number = o->ids[v->at].number;
    return true;
}

// --- composites ----------------------------------------------------------------------------------

uint32_t opt_tuple(struct opt *o, uint32_t type, const uint32_t *parts, uint32_t count)
{
    const uint32_t at = count ? opt_add(o, LIST_CHILDREN, count) : 0;
    if (at != 0)
        memcpy(opt_child_at(o, at), parts, count * sizeof *parts);
    return value_new(o, VALUE_TUPLE, type, at);
}

static bool is_vector(struct opt *o, uint32_t type)
{
    return opt_type(o, type)->op == SpvOpTypeVector;
}

static uint32_t part_of_global(struct opt *o, const struct opt_value *v, uint32_t part)
{
    const uint32_t type = opt_part_type(o, v->type, part), *def = o->ids[v->at].def;
    const uint32_t op = def != NULL ? hg_spirv_op(def) : 0;
    if (op == SpvOpConstantComposite && part + 3 < hg_spirv_length(def))
        return opt_global(o, def[3 + part]);
    if (op == SpvOpConstantNull || v->at == opt_value_at(o, opt_type(o, v->type)->null)->at)
        return null_of(o, type);
    if (op == SpvOpUndef || v->at == opt_value_at(o, opt_type(o, v->type)->undef)->at)
        return opt_undef(o, type);
    return 0;
}

static uint32_t extract(struct opt *o, uint32_t value, uint32_t part)
{
    const struct opt_value v = *opt_value_at(o, value);
    const uint32_t i = opt_begin(o, SpvOpCompositeExtract, opt_part_type(o, v.type, part), 0);
    const struct opt_instruction from = *opt_instruction_at(o, v.kind == VALUE_RESULT ? v.at : 0);
    if (from.op != SpvOpCompositeExtract)
        opt_operand(o, OPERAND_VALUE, value);
    for (uint32_t k = 0; from.op == SpvOpCompositeExtract && k < from.count; k++) {
        const struct opt_operand operand = *opt_operand_at(o, from.first + k);
        opt_operand(o, operand.kind, operand.word);
    }
    opt_operand(o, OPERAND_WORD, part);
    return opt_finish(o, i, true, true);
}

static uint32_t part_of_construct(
    struct opt *o, const struct opt_instruction *i, uint32_t type, uint32_t part)
{
    if (!is_vector(o, type))
        return part < i->count ? opt_operand_at(o, i->first + part)->word : 0;
    for (uint32_t k = 0; k < i->count; k++) { // of scalars and shorter vectors
        const uint32_t from = opt_operand_at(o, i->first + k)->word,
                       from_type = opt_type_of(o, from);
        const uint32_t size = is_vector(o, from_type) ? opt_part_count(o, from_type) : 1;
        if (part < size)
            return is_vector(o, from_type) ? opt_part(o, from, part) : from;
        part -= size;
    }
    return 0;
}

static uint32_t part_of_shuffle(struct opt *o, const struct opt_instruction *i, uint32_t part)
{
    const uint32_t a = opt_operand_at(o, i->first)->word, b = opt_operand_at(o, i->first + 1)->word;
    const uint32_t from = opt_operand_at(o, i->first + 2 + part)->word;
    const uint32_t size = opt_part_count(o, opt_type_of(o, a));
    if (from == UINT32_MAX)
        return opt_undef(o, opt_part_type(o, opt_type_of(o, a), 0));
    return from < size ? opt_part(o, a, from) : opt_part(o, b, from - size);
}

static uint32_t part_of_result(struct opt *o, uint32_t value, uint32_t part)
{
    const struct opt_value v = *opt_value_at(o, value);
    const struct opt_instruction i = *opt_instruction_at(o, v.at);
    switch (i.op) {
    case SpvOpCompositeConstruct:
        return part_of_construct(o, &i, v.type, part);
    case SpvOpVectorShuffle:
        return part_of_shuffle(o, &i, part);
    case SpvOpCompositeInsert:
        if (opt_operand_at(o, i.first + 2)->word != part)
            return opt_part(o, opt_operand_at(o, i.first + 1)->word, part);
        return i.count == 3 ? opt_operand_at(o, i.first)->word : extract(o, value, part);
    default:
        return extract(o, value, part);
    }
}

uint32_t opt_part(struct opt *o, uint32_t value, uint32_t part)
{
    value = opt_resolve(o, value);
    const struct opt_value v = *opt_value_at(o, value);
    if (o->failed || part >= opt_part_count(o, v.type)) {
        o->failed = true;
        return 0;
    }
    uint32_t found = 0;
    if (v.kind == VALUE_TUPLE)
        found = *opt_child_at(o, v.at + part);
    else if (v.kind == VALUE_GLOBAL)
        found = part_of_global(o, &v, part);
    else if (v.kind == VALUE_RESULT)
        found = part_of_result(o, value, part);
    if (found == 0 && v.kind == VALUE_GLOBAL) // of a parameter, or an operation
        found = extract(o, value, part);
    o->failed |= found == 0;
    return found;
}

// The value whose parts these are in their order, or 0.
static uint32_t taken_apart(struct opt *o, const uint32_t *parts, uint32_t count, uint32_t type)
{
    uint32_t from = 0;
    for (uint32_t k = 0; k < count; k++) {
        const struct opt_value *v = opt_value_at(o, opt_resolve(o, parts[k]));
        const struct opt_instruction *i = opt_instruction_at(o, v->at);
        if (v->kind != VALUE_RESULT || i->op != SpvOpCompositeExtract || i->count != 2 ||
            opt_operand_at(o, i->first + 1)->word != k)
            return 0;
        const uint32_t whole = opt_resolve(o, opt_operand_at(o, i->first)->word);
        if ((k > 0 && whole != from) || opt_type_of(o, whole) != type)
            return 0;
        from = whole;
    }
    return opt_part_count(o, type) == count ? from : 0;
}

uint32_t opt_whole(struct opt *o, uint32_t value)
{
    value = opt_resolve(o, value);
    const struct opt_value v = *opt_value_at(o, value);
    o->failed |= v.kind == VALUE_PLACE || v.kind == VALUE_NONE;
    if (v.kind != VALUE_TUPLE || o->failed)
        return value;
    uint32_t parts[OPT_MOST_LEAVES];
    const uint32_t count = opt_part_count(o, v.type);
    if (count > OPT_MOST_LEAVES) {
        o->failed = true;
        return 0;
    }
    for (uint32_t k = 0; k < count; k++)
        parts[k] = opt_whole(o, *opt_child_at(o, v.at + k));
    uint32_t whole = taken_apart(o, parts, count, v.type);
    if (whole == 0) {
        const uint32_t i = opt_begin(o, SpvOpCompositeConstruct, v.type, 0);
        for (uint32_t k = 0; k < count; k++)
            opt_operand(o, OPERAND_VALUE, parts[k]);
        whole = opt_finish(o, i, true, true);
    }
    return whole;
}

uint32_t opt_retype(struct opt *o, uint32_t value, uint32_t type)
{
    if (opt_type_of(o, value) == type)
        return value;
    uint32_t parts[OPT_MOST_LEAVES];
    const uint32_t count = opt_part_count(o, type), op = opt_type(o, type)->op;
    if ((op != SpvOpTypeStruct && op != SpvOpTypeArray) || count > OPT_MOST_LEAVES || o->failed) {
        o->failed = true;
        return 0;
    }
    for (uint32_t k = 0; k < count; k++)
        parts[k] = opt_retype(o, opt_part(o, value, k), opt_part_type(o, type, k));
    return opt_tuple(o, type, parts, count);
}

static bool is_apart(struct opt *o, uint32_t type)
{
    const struct opt_type *t = opt_type(o, type);
    return t->leaves > 0 && (t->op == SpvOpTypeStruct || t->op == SpvOpTypeArray);
}

uint32_t opt_flatten(struct opt *o, uint32_t value, uint32_t *leaves)
{
    const uint32_t type = opt_type_of(o, value);
    if (!is_apart(o, type)) {
        leaves[0] = opt_whole(o, value);
        return 1;
    }
    uint32_t count = 0;
    for (uint32_t k = 0; k < opt_part_count(o, type) && !o->failed; k++)
        count += opt_flatten(o, opt_part(o, value, k), leaves + count);
    return count;
}

uint32_t opt_unflatten(struct opt *o, uint32_t type, const uint32_t *leaves, uint32_t *at)
{
    if (!is_apart(o, type))
        return leaves[(*at)++];
    uint32_t parts[OPT_MOST_LEAVES];
    const uint32_t count = opt_part_count(o, type);
    for (uint32_t k = 0; k < count; k++)
        parts[k] = opt_unflatten(o, opt_part_type(o, type, k), leaves, at);
    return opt_tuple(o, type, parts, count);
}

// --- what can be told ----------------------------------------------------------------------------

static uint32_t fold_one(struct opt *o, uint32_t op, uint32_t type, uint32_t a)
{
    uint32_t number;
    if (!opt_is_known(o, a, &number))
        return 0;
    switch (op) {
    case SpvOpLogicalNot:
        return opt_number(o, type, !number);
    case SpvOpNot:
        return opt_number(o, type, ~number);
    case SpvOpSNegate:
        return opt_number(o, type, 0u - number);
    default:
        return 0;
    }
}

static uint32_t fold_two(struct opt *o, uint32_t op, uint32_t type, const uint32_t *values)
{
    uint32_t a, b, number;
    const bool a_known = opt_is_known(o, values[0], &a), b_known = opt_is_known(o, values[1], &b);
    if (a_known && b_known && hg_spirv_fold(op, a, b, &number))
        return opt_number(o, type, number);
    if ((op != SpvOpLogicalAnd && op != SpvOpLogicalOr) || (!a_known && !b_known))
        return 0;
    const uint32_t known = a_known ? a : b, other = values[a_known];
    return known == (op == SpvOpLogicalOr) ? opt_number(o, type, known) : opt_resolve(o, other);
}

uint32_t opt_fold(struct opt *o, uint32_t op, uint32_t type, const uint32_t *values, uint32_t count)
{
    uint32_t number;
    if (op == SpvOpSelect && count == 3) {
        if (opt_is_known(o, values[0], &number))
            return opt_resolve(o, values[number ? 1 : 2]);
        return opt_resolve(o, values[1]) == opt_resolve(o, values[2]) ? opt_resolve(o, values[1])
                                                                      : 0;
    }
    if (!opt_is_short(o, type) || count == 0 || count > 2 ||
        !opt_is_short(o, opt_type_of(o, values[0])))
        return 0;
    return count == 1 ? fold_one(o, op, type, values[0]) : fold_two(o, op, type, values);
}

// --- instructions --------------------------------------------------------------------------------

uint32_t opt_begin(struct opt *o, uint32_t op, uint32_t type, uint32_t source)
{
    const uint32_t i = opt_add(o, LIST_INSTRUCTIONS, 1);
    *opt_instruction_at(o, i) = (struct opt_instruction){.op = op,
        .type = type,
        .source = source,
        .first = (uint32_t)opt_count(o, LIST_OPERANDS),
        .block = o->current};
    return i;
}

void opt_operand(struct opt *o, enum opt_operand_kind kind, uint32_t word)
{
    const uint32_t at = opt_add(o, LIST_OPERANDS, 1);
    if (kind == OPERAND_VALUE)
        word = opt_resolve(o, word);
    *opt_operand_at(o, at) = (struct opt_operand){word, kind};
}

bool opt_dominates(const struct opt *o, uint32_t a, uint32_t b)
{
    while (opt_block_at(o, b)->order > opt_block_at(o, a)->order)
        b = opt_block_at(o, b)->idom;
    return a == b;
}

static uint64_t mix(uint64_t hash, uint64_t word)
{
    hash = (hash ^ word) * 0x9e3779b97f4a7c15ull;
    return hash ^ hash >> 29;
}

static uint64_t key_of(const struct opt *o, const struct opt_instruction *i)
{
    uint64_t hash = mix(mix(1, i->op), i->type);
    for (uint32_t k = 0; k < i->count; k++)
        hash = mix(hash, opt_operand_at(o, i->first + k)->word);
    return hash | 1;
}

static bool is_same(
    const struct opt *o, const struct opt_instruction *a, const struct opt_instruction *b)
{
    return a->op == b->op && a->type == b->type && a->count == b->count &&
           memcmp(opt_operand_at(o, a->first), opt_operand_at(o, b->first),
               a->count * sizeof(struct opt_operand)) == 0;
}

static void append(struct opt *o, uint32_t instruction)
{
    struct opt_block *block = opt_block_at(o, o->current);
    if (block->last != 0)
        opt_instruction_at(o, block->last)->next = instruction;
    else
        block->first = instruction;
    block->last = instruction;
}

uint32_t opt_finish(struct opt *o, uint32_t instruction, bool removable, bool pure)
{
    struct opt_instruction *i = opt_instruction_at(o, instruction);
    i->count = (uint32_t)opt_count(o, LIST_OPERANDS) - i->first;
    i->removable = removable;
    o->failed |= o->current == 0;
    if (o->failed)
        return 0;
    if (pure && !(i->source != 0 && o->ids[i->source].decorated)) {
        uint32_t *known = opt_find(o, &o->known, key_of(o, i));
        if (known == NULL)
            return 0;
        const struct opt_instruction *before = opt_instruction_at(o, *known);
        if (*known != 0 && is_same(o, before, i) && opt_dominates(o, before->block, o->current)) {
            o->lists[LIST_OPERANDS].count = i->first; // it is not needed
            o->lists[LIST_INSTRUCTIONS].count--;
            return opt_resolve(o, before->value);
        }
        *known = instruction;
    }
    if (i->type != 0) {
        const uint32_t value = value_new(o, VALUE_RESULT, i->type, instruction);
        opt_instruction_at(o, instruction)->value = value;
    }
    append(o, instruction);
    return opt_instruction_at(o, instruction)->value;
}
