// optimise_walk.c - through a function and what it calls, instruction by instruction, in the order
// of its blocks: all edges but those back to the head of a loop lead forwards.
//
// What a called function returns early becomes the end of a switch with one case around its blocks.
// Source: SPIR-V 1.6, section 2.11 (structured control flow).
#include "renderer/gpu/optimise_internal.h"

#include <stdlib.h>

#define MOST_OPERANDS     320
#define MOST_DEPTH        64
#define MOST_INSTRUCTIONS (1u << 20)

struct instance { // of a function: as it is called in one place, or as it is written
    struct opt_function *f;
    bool is_root;
    uint32_t exit;    // block after it, or 0: it returns at its end
    uint32_t returns; // the last of them
    uint32_t value;   // what it returns at its end
    bool is_back;     // it has returned at its end
    uint32_t label;   // of the block in the module
    const uint32_t *merge;
};

static void walk(struct opt *o, struct instance *in);

// --- operands ------------------------------------------------------------------------------------

static uint32_t value_of(struct opt *o, uint32_t id)
{
    const struct opt_id *entry = opt_id(o, id);
    if (entry->value != 0)
        return opt_resolve(o, entry->value);
    o->failed |= entry->def == NULL || entry->def >= o->words + o->first_function;
    return o->failed ? 0 : opt_global(o, id);
}

static void set_value(struct opt *o, uint32_t id, uint32_t value)
{
    opt_id(o, id)->value = value;
    o->failed |= value == 0;
}

static uint32_t block_of(struct opt *o, uint32_t label)
{
    struct opt_id *id = opt_id(o, label);
    if (id->block == 0)
        id->block = opt_block_new(o);
    return id->block;
}

static bool is_place(const struct opt *o, uint32_t value)
{
    return opt_value_at(o, value)->kind == VALUE_PLACE;
}

// An instruction as it is, with values for ids.
static void copy(struct opt *o, const uint32_t *i)
{
    const struct opt_shape shape = opt_shape_of(o, i);
    bool result, type;
    SpvHasResultAndType((SpvOp)hg_spirv_op(i), &result, &type);
    const uint32_t skip = 1 + (uint32_t)result + (uint32_t)type, count = hg_spirv_length(i) - skip;
    uint32_t words[MOST_OPERANDS];
    o->failed |= !shape.known || count > MOST_OPERANDS;
    const bool literals = shape.literal_count > 0;
    for (uint32_t k = 0; k < count && !o->failed; k++) {
        const bool literal =
            literals && k >= shape.literal && k - shape.literal < shape.literal_count;
        words[k] = literal ? i[skip + k] : opt_whole(o, value_of(o, i[skip + k]));
    }
    const uint32_t result_type = type ? i[1] : 0;
    uint32_t value = 0;
    if (result && !literals && !o->failed)
        value = opt_fold(o, hg_spirv_op(i), result_type, words, count);
    if (value == 0 && !o->failed) {
        const uint32_t made =
            opt_begin(o, hg_spirv_op(i), result_type, result ? i[type ? 2 : 1] : 0);
        for (uint32_t k = 0; k < count; k++) {
            const bool literal =
                literals && k >= shape.literal && k - shape.literal < shape.literal_count;
            opt_operand(o, literal ? OPERAND_WORD : OPERAND_VALUE, words[k]);
        }
        value = opt_finish(o, made, shape.removable, shape.pure);
    }
    if (result)
        set_value(o, i[type ? 2 : 1], value);
}

// --- variables -----------------------------------------------------------------------------------

static void walk_variable(struct opt *o, const uint32_t *i)
{
    const uint32_t type = opt_type(o, i[1])->element;
    const uint32_t start = hg_spirv_length(i) > 4 ? value_of(o, i[4]) : 0;
    if (!opt_id(o, i[2])->memory) {
        const struct opt_place place = {
            .leaf = opt_variable(o, type), .leaf_count = opt_slots(o, type)};
        const uint32_t value = opt_place(o, &place, type);
        set_value(o, i[2], value);
        if (start != 0)
            opt_place_write(o, opt_value_at(o, value)->at, start);
        return;
    }
    const uint32_t made = opt_begin(o, SpvOpVariable, i[1], i[2]);
    opt_operand(o, OPERAND_WORD, i[3]);
    const uint32_t value = opt_add(o, LIST_VALUES, 1);
    *opt_value_at(o, value) = (struct opt_value){VALUE_RESULT, i[1], made, 0};
    struct opt_instruction *variable = opt_instruction_at(o, made);
    variable->count = 1;
    variable->value = value;
    variable->removable = true;
    *opt_local_at(o, opt_add(o, LIST_LOCALS, 1)) = made;
    set_value(o, i[2], value);
    if (start != 0) {
        const uint32_t store = opt_begin(o, SpvOpStore, 0, 0);
        opt_operand(o, OPERAND_VALUE, value);
        opt_operand(o, OPERAND_VALUE, start);
        opt_finish(o, store, false, false);
    }
}

// Leaves in front of a part.
static uint32_t leaves_before(struct opt *o, uint32_t type, uint32_t part)
{
    uint32_t sum = 0;
    for (uint32_t k = 0; k < part; k++)
        sum += opt_slots(o, opt_part_type(o, type, k));
    return sum;
}

static void walk_chain(struct opt *o, const uint32_t *i)
{
    const uint32_t base = value_of(o, i[3]);
    if (!is_place(o, base)) {
        copy(o, i);
        return;
    }
    struct opt_place place = *opt_place_at(o, opt_value_at(o, base)->at);
    uint32_t type = opt_value_at(o, base)->type;
    for (uint32_t k = 4; k < hg_spirv_length(i) && !o->failed; k++) {
        const uint32_t index = value_of(o, i[k]), op = opt_type(o, type)->op;
        uint32_t number = 0;
        const bool known = opt_is_known(o, index, &number);
        if (op == SpvOpTypeVector || op == SpvOpTypeMatrix) {
            o->failed |= place.inner_count == 2;
            place.inner[place.inner_count == 2 ? 0 : place.inner_count++] = index;
            type = opt_part_type(o, type, 0);
            continue;
        }
        o->failed |= !known || number >= opt_part_count(o, type);
        if (o->failed)
            return;
        place.leaf += leaves_before(o, type, number);
        type = opt_part_type(o, type, number);
        place.leaf_count = opt_slots(o, type);
    }
    set_value(o, i[2], opt_place(o, &place, type));
}

static void walk_load(struct opt *o, const uint32_t *i)
{
    const uint32_t pointer = value_of(o, i[3]);
    o->failed |= is_place(o, pointer) && opt_value_at(o, pointer)->type != i[1];
    if (o->failed)
        return;
    if (is_place(o, pointer))
        set_value(o, i[2], opt_place_read(o, opt_value_at(o, pointer)->at, i[1]));
    else
        copy(o, i);
}

static void walk_store(struct opt *o, const uint32_t *i)
{
    const uint32_t pointer = value_of(o, i[1]);
    if (!is_place(o, pointer)) {
        copy(o, i);
        return;
    }
    const uint32_t value = value_of(o, i[2]);
    o->failed |= opt_value_at(o, pointer)->type != opt_type_of(o, value);
    if (!o->failed)
        opt_place_write(o, opt_value_at(o, pointer)->at, value);
}

// --- composites ----------------------------------------------------------------------------------

static bool is_apart(struct opt *o, uint32_t type)
{
    const uint32_t op = opt_type(o, type)->op;
    return op == SpvOpTypeStruct || op == SpvOpTypeArray;
}

static void walk_construct(struct opt *o, const uint32_t *i)
{
    uint32_t parts[MOST_OPERANDS];
    const uint32_t count = hg_spirv_length(i) - 3;
    if (!is_apart(o, i[1])) {
        copy(o, i);
        return;
    }
    o->failed |= count > MOST_OPERANDS || count != opt_part_count(o, i[1]);
    for (uint32_t k = 0; k < count && !o->failed; k++)
        parts[k] = value_of(o, i[3 + k]);
    if (!o->failed)
        set_value(o, i[2], opt_tuple(o, i[1], parts, count));
}

static void walk_extract(struct opt *o, const uint32_t *i)
{
    uint32_t value = value_of(o, i[3]);
    for (uint32_t k = 4; k < hg_spirv_length(i) && !o->failed; k++)
        value = opt_part(o, value, i[k]);
    set_value(o, i[2], value);
}

// The composite with what lies at the end of a path replaced.
static uint32_t insert(
    struct opt *o, uint32_t whole, const uint32_t *path, uint32_t length, uint32_t value)
{
    const uint32_t type = opt_type_of(o, whole), count = opt_part_count(o, type);
    uint32_t parts[MOST_OPERANDS];
    o->failed |= length == 0 || count > MOST_OPERANDS || *path >= count;
    if (o->failed)
        return 0;
    if (!is_apart(o, type)) {
        const uint32_t made = opt_begin(o, SpvOpCompositeInsert, type, 0);
        opt_operand(o, OPERAND_VALUE, value);
        opt_operand(o, OPERAND_VALUE, whole);
        for (uint32_t k = 0; k < length; k++)
            opt_operand(o, OPERAND_WORD, path[k]);
        return opt_finish(o, made, true, true);
    }
    for (uint32_t k = 0; k < count && !o->failed; k++)
        if (k != *path || length > 1)
            parts[k] = opt_part(o, whole, k);
    parts[*path] = length > 1 ? insert(o, parts[*path], path + 1, length - 1, value) : value;
    return opt_tuple(o, type, parts, count);
}

// --- flow ----------------------------------------------------------------------------------------

static void put_merge(struct opt *o, const uint32_t *merge)
{
    if (merge == NULL)
        return;
    const bool loop = hg_spirv_op(merge) == SpvOpLoopMerge;
    const uint32_t end = block_of(o, merge[1]), again = loop ? block_of(o, merge[2]) : 0;
    opt_block_at(o, o->current)->heads = opt_block_at(o, end)->declared = true;
    if (loop) {
        opt_block_at(o, again)->declared = true;
        opt_block_at(o, again)->continues = o->current;
    }
    const uint32_t made = opt_begin(o, hg_spirv_op(merge), 0, 0);
    opt_operand(o, OPERAND_BLOCK, end);
    if (loop)
        opt_operand(o, OPERAND_BLOCK, again);
    for (uint32_t k = loop ? 3 : 2; k < hg_spirv_length(merge); k++)
        opt_operand(o, OPERAND_WORD, merge[k]);
    opt_finish(o, made, false, false);
}

// A way from the current block, whose last instruction is there.
static void go(struct opt *o, uint32_t block)
{
    const bool back = opt_block_at(o, block)->order != 0;
    opt_edge(o, o->current, block);
    if (back)
        opt_loop_close(o, block);
}

static void put_branch(struct opt *o, uint32_t block)
{
    const uint32_t made = opt_begin(o, SpvOpBranch, 0, 0);
    opt_operand(o, OPERAND_BLOCK, block);
    opt_finish(o, made, false, false);
    go(o, block);
    o->current = 0;
}

static void walk_conditional(struct opt *o, const uint32_t *i, const uint32_t *merge)
{
    const uint32_t condition = value_of(o, i[1]);
    uint32_t number;
    if (merge != NULL && hg_spirv_op(merge) == SpvOpSelectionMerge &&
        opt_is_known(o, condition, &number)) {
        put_branch(o, block_of(o, i[number ? 2 : 3]));
        return;
    }
    put_merge(o, merge);
    const uint32_t yes = block_of(o, i[2]), no = block_of(o, i[3]);
    const uint32_t made = opt_begin(o, SpvOpBranchConditional, 0, 0);
    opt_operand(o, OPERAND_VALUE, condition);
    opt_operand(o, OPERAND_BLOCK, yes);
    opt_operand(o, OPERAND_BLOCK, no);
    opt_finish(o, made, false, false);
    go(o, yes);
    if (no != yes)
        go(o, no);
    o->current = 0;
}

static void walk_switch(struct opt *o, const uint32_t *i, const uint32_t *merge)
{
    const uint32_t selector = value_of(o, i[1]), length = hg_spirv_length(i);
    const struct opt_id *type = opt_id(o, opt_type_of(o, selector));
    o->failed |= type->def == NULL || hg_spirv_op(type->def) != SpvOpTypeInt || type->def[2] != 32;
    put_merge(o, merge);
    for (uint32_t k = 2; k < length; k += 2)
        block_of(o, i[k]);
    const uint32_t made = opt_begin(o, SpvOpSwitch, 0, 0);
    opt_operand(o, OPERAND_VALUE, selector);
    for (uint32_t k = 2; k < length; k++) {
        if (k % 2 == 0)
            opt_operand(o, OPERAND_BLOCK, block_of(o, i[k]));
        else
            opt_operand(o, OPERAND_WORD, i[k]);
    }
    opt_finish(o, made, false, false);
    for (uint32_t k = 2; k < length && !o->failed; k += 2)
        opt_edge(o, o->current, block_of(o, i[k]));
    o->current = 0;
}

static void put_end(struct opt *o, uint32_t op, uint32_t value)
{
    const uint32_t made = opt_begin(o, op, 0, 0);
    if (value != 0)
        opt_operand(o, OPERAND_VALUE, value);
    opt_finish(o, made, false, false);
    o->current = 0;
}

static void walk_return(struct opt *o, struct instance *in, const uint32_t *i)
{
    const uint32_t value = hg_spirv_op(i) == SpvOpReturnValue ? value_of(o, i[1]) : 0;
    if (in->is_root) {
        put_end(o, hg_spirv_op(i), value ? opt_whole(o, value) : 0);
        return;
    }
    in->is_back = true;
    in->value = value;
    if (in->exit == 0)
        return;
    uint32_t leaves[OPT_MOST_LEAVES], at = 0;
    const uint32_t count = value ? opt_flatten(o, value, leaves) : 0;
    if (count > 0)
        at = opt_add(o, LIST_CHILDREN, count);
    for (uint32_t k = 0; k < count && at != 0; k++)
        *opt_child_at(o, at + k) = leaves[k];
    const uint32_t record = opt_add(o, LIST_RETURNS, 3);
    *opt_return_at(o, record) = o->current;
    *opt_return_at(o, record + 1) = at;
    *opt_return_at(o, record + 2) = in->returns;
    in->returns = record;
    put_branch(o, in->exit);
}

static void walk_phi(struct opt *o, const uint32_t *i)
{
    const struct opt_block block = *opt_block_at(o, o->current);
    const uint32_t phi = opt_phi(o, o->current, i[1]), first = opt_phi_room(o, phi);
    uint32_t found = 0;
    o->failed |= block.loop != 0 || block.edge_count == 0 || first == 0;
    for (uint32_t k = 3; k + 1 < hg_spirv_length(i) && !o->failed; k += 2)
        for (uint32_t edge = 0; edge < block.edge_count; edge++) {
            const uint32_t end = opt_id(o, i[k + 1])->end;
            if (end == 0 || opt_operand_at(o, first + 2 * edge + 1)->word != end)
                continue;
            const uint32_t value = value_of(o, i[k]), kind = opt_value_at(o, value)->kind;
            o->failed |= kind != VALUE_GLOBAL && kind != VALUE_RESULT;
            opt_operand_at(o, first + 2 * edge)->word = value;
            found++;
        }
    o->failed |= found != block.edge_count;
    if (o->failed)
        return;
    opt_phi_close(o, phi);
    set_value(o, i[2], opt_resolve(o, opt_instruction_at(o, phi)->value));
}

// --- calls ---------------------------------------------------------------------------------------

static uint32_t returned_in(const struct opt *o, const struct instance *in, uint32_t block)
{
    uint32_t record = in->returns;
    while (record != 0 && *opt_return_at(o, record) != block)
        record = *opt_return_at(o, record + 2);
    return record != 0 ? *opt_return_at(o, record + 1) : 0;
}

// The value after a function that returns in several places.
static uint32_t join(struct opt *o, const struct instance *in, uint32_t type)
{
    uint32_t leaves[OPT_MOST_LEAVES], at = 0;
    for (uint32_t k = 0; k < opt_slots(o, type) && !o->failed; k++) {
        const uint32_t any = *opt_return_at(o, in->returns + 1);
        const uint32_t phi = opt_phi(o, o->current, opt_type_of(o, *opt_child_at(o, any + k)));
        const uint32_t first = opt_phi_room(o, phi), count = opt_instruction_at(o, phi)->count;
        for (uint32_t n = 0; n < count; n += 2) {
            const uint32_t from = returned_in(o, in, opt_operand_at(o, first + n + 1)->word);
            o->failed |= from == 0;
            opt_operand_at(o, first + n)->word = *opt_child_at(o, from + k);
        }
        opt_phi_close(o, phi);
        leaves[k] = opt_resolve(o, opt_instruction_at(o, phi)->value);
    }
    return o->failed ? 0 : opt_unflatten(o, type, leaves, &at);
}

// What the blocks of a function that returns early are put into.
static void open_switch(struct opt *o, uint32_t exit)
{
    const uint32_t body = opt_block_new(o);
    o->failed |= o->int_type == 0;
    const uint32_t selector = o->failed ? 0 : opt_number(o, o->int_type, 0);
    opt_block_at(o, o->current)->heads = opt_block_at(o, exit)->declared = true;
    const uint32_t merge = opt_begin(o, SpvOpSelectionMerge, 0, 0);
    opt_operand(o, OPERAND_BLOCK, exit);
    opt_operand(o, OPERAND_WORD, 0);
    opt_finish(o, merge, false, false);
    const uint32_t made = opt_begin(o, SpvOpSwitch, 0, 0);
    opt_operand(o, OPERAND_VALUE, selector);
    opt_operand(o, OPERAND_BLOCK, body);
    opt_finish(o, made, false, false);
    opt_edge(o, o->current, body);
    opt_enter(o, body);
}

static uint32_t expand(struct opt *o, struct opt_function *f, uint32_t type)
{
    struct instance in = {.f = f};
    if (!f->straight && f->return_count > 0) {
        in.exit = opt_block_new(o);
        open_switch(o, in.exit);
    }
    walk(o, &in);
    if (!in.is_back || o->failed)
        o->current = 0;
    o->failed |= in.value != 0 && opt_type_of(o, in.value) != type;
    if (in.exit == 0 || o->failed)
        return in.value;
    opt_enter(o, in.exit);
    if (!in.is_back)
        put_end(o, SpvOpUnreachable, 0);
    return in.value != 0 && !o->failed ? join(o, &in, type) : 0;
}

static void keep_call(struct opt *o, const uint32_t *i)
{
    uint32_t words[MOST_OPERANDS];
    const uint32_t count = hg_spirv_length(i) - 4;
    o->failed |= count > MOST_OPERANDS;
    for (uint32_t k = 0; k < count && !o->failed; k++)
        words[k] = opt_whole(o, value_of(o, i[4 + k]));
    const uint32_t function = opt_global(o, i[3]);
    const uint32_t made = opt_begin(o, SpvOpFunctionCall, i[1], i[2]);
    opt_operand(o, OPERAND_VALUE, function);
    for (uint32_t k = 0; k < count && !o->failed; k++)
        opt_operand(o, OPERAND_VALUE, words[k]);
    set_value(o, i[2], opt_finish(o, made, false, false));
    o->functions[opt_id(o, i[3])->function - 1].queued = true;
}

static void walk_call(struct opt *o, const uint32_t *i)
{
    struct opt_function *callee = &o->functions[opt_id(o, i[3])->function - 1];
    if (opt_id(o, i[2])->kept) {
        keep_call(o, i);
        return;
    }
    uint32_t k = 4;
    for (const uint32_t *p = callee->begin + hg_spirv_length(callee->begin);
         hg_spirv_op(p) == SpvOpFunctionParameter; p += hg_spirv_length(p), k++) {
        o->failed |= k >= hg_spirv_length(i);
        if (!o->failed)
            set_value(o, p[2], value_of(o, i[k]));
    }
    o->failed |= ++o->depth > MOST_DEPTH || opt_count(o, LIST_INSTRUCTIONS) > MOST_INSTRUCTIONS;
    if (!o->failed)
        opt_id(o, i[2])->value = expand(o, callee, i[1]);
    o->depth--;
}

// --- blocks --------------------------------------------------------------------------------------

static const uint32_t *loop_merge_of(const uint32_t *label)
{
    const uint32_t *i = label + hg_spirv_length(label);
    for (; hg_spirv_op(i) != SpvOpLabel && hg_spirv_op(i) != SpvOpFunctionEnd;
         i += hg_spirv_length(i))
        if (hg_spirv_op(i) == SpvOpLoopMerge)
            return i;
    return NULL;
}

static int compare(const void *a, const void *b)
{
    const uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

// Variables that blocks from `from` to `to` may write.
static void find_modified(
    struct opt *o, const struct opt_function *f, const uint32_t *from, const uint32_t *to)
{
    const uint32_t loop = opt_block_at(o, o->current)->loop;
    const uint32_t first = (uint32_t)opt_count(o, LIST_MODIFIED);
    for (uint32_t k = f->stores; k < f->stores + f->store_count; k++) {
        const struct opt_store store = *opt_store_at(o, k);
        if (store.at < from || store.at >= to)
            continue;
        const uint32_t pointer = opt_id(o, store.root)->value;
        if (pointer == 0 || !is_place(o, pointer))
            continue;
        const uint32_t leaf = opt_place_at(o, opt_value_at(o, pointer)->at)->leaf;
        *opt_modified_at(o, opt_add(o, LIST_MODIFIED, 1)) = opt_leaf_at(o, leaf)->variable;
    }
    const uint32_t count = (uint32_t)opt_count(o, LIST_MODIFIED) - first;
    if (count > 0)
        qsort(opt_modified_at(o, first), count, sizeof(uint32_t), compare);
    opt_loop_at(o, loop)->modified = first;
    opt_loop_at(o, loop)->modified_count = count;
}

static void walk_label(struct opt *o, struct instance *in, const uint32_t *i)
{
    const uint32_t block = opt_id(o, i[1])->block;
    in->label = i[1];
    in->merge = NULL;
    o->current = 0;
    if (block == 0) // nothing leads here, nothing ends here
        return;
    opt_enter(o, block);
    const struct opt_block b = *opt_block_at(o, block);
    const uint32_t *loop = loop_merge_of(i);
    if (b.edge_count == 0 && b.continues != 0) {
        put_branch(o, b.continues);
    } else if (b.edge_count == 0) {
        put_end(o, SpvOpUnreachable, 0);
    } else if (loop != NULL) {
        const uint32_t *end = opt_id(o, loop[1])->def;
        o->failed |= end == NULL || end < i || end >= in->f->end;
        opt_loop_open(o, block);
        find_modified(o, in->f, i, end);
    }
}

static void walk_flow(struct opt *o, struct instance *in, const uint32_t *i)
{
    const uint32_t op = hg_spirv_op(i);
    opt_id(o, in->label)->end = o->current;
    switch (op) {
    case SpvOpBranch:
        put_merge(o, in->merge);
        put_branch(o, block_of(o, i[1]));
        break;
    case SpvOpBranchConditional:
        walk_conditional(o, i, in->merge);
        break;
    case SpvOpSwitch:
        walk_switch(o, i, in->merge);
        break;
    case SpvOpReturn:
    case SpvOpReturnValue:
        walk_return(o, in, i);
        break;
    case SpvOpKill:
    case SpvOpUnreachable:
    case SpvOpTerminateInvocation:
        put_end(o, op, 0);
        break;
    case SpvOpSelectionMerge:
    case SpvOpLoopMerge:
        in->merge = i;
        break;
    default:
        copy(o, i);
    }
}

static void walk_instruction(struct opt *o, struct instance *in, const uint32_t *i)
{
    switch (hg_spirv_op(i)) {
    case SpvOpVariable:
        walk_variable(o, i);
        break;
    case SpvOpAccessChain:
    case SpvOpInBoundsAccessChain:
        walk_chain(o, i);
        break;
    case SpvOpLoad:
        walk_load(o, i);
        break;
    case SpvOpStore:
        walk_store(o, i);
        break;
    case SpvOpCompositeConstruct:
        walk_construct(o, i);
        break;
    case SpvOpCompositeExtract:
        walk_extract(o, i);
        break;
    case SpvOpCompositeInsert:
        set_value(o, i[2],
            insert(o, value_of(o, i[4]), i + 5, hg_spirv_length(i) - 5, value_of(o, i[3])));
        break;
    case SpvOpCopyObject:
        set_value(o, i[2], value_of(o, i[3]));
        break;
    case SpvOpCopyLogical:
        set_value(o, i[2], opt_retype(o, value_of(o, i[3]), i[1]));
        break;
    case SpvOpUndef:
        set_value(o, i[2], opt_undef(o, i[1]));
        break;
    case SpvOpPhi:
        walk_phi(o, i);
        break;
    case SpvOpFunctionCall:
        walk_call(o, i);
        break;
    default:
        walk_flow(o, in, i);
    }
}

static void walk(struct opt *o, struct instance *in)
{
    const struct opt_function *f = in->f;
    for (const uint32_t *i = f->entry; i < f->end; i += hg_spirv_length(i))
        if (hg_spirv_op(i) == SpvOpLabel)
            opt_id(o, i[1])->block = opt_id(o, i[1])->end = 0;
    in->label = f->entry[1];
    opt_id(o, in->label)->block = o->current;
    for (const uint32_t *i = f->entry + 2; i < f->end && !o->failed; i += hg_spirv_length(i)) {
        if (hg_spirv_op(i) == SpvOpLabel)
            walk_label(o, in, i);
        else if (o->current != 0 && !hg_spirv_is_note(hg_spirv_op(i)))
            walk_instruction(o, in, i);
    }
}

void opt_write_function(struct opt *o, struct opt_function *f)
{
    o->first_order = (uint32_t)opt_count(o, LIST_ORDER);
    o->lists[LIST_LOCALS].count = 1;
    const uint32_t *i = f->begin + hg_spirv_length(f->begin);
    for (; hg_spirv_op(i) == SpvOpFunctionParameter; i += hg_spirv_length(i)) {
        opt_id(o, i[2])->value = 0;
        opt_id(o, i[2])->kept = true;
        opt_global(o, i[2]);
    }
    struct instance in = {.f = f, .is_root = true};
    opt_enter(o, opt_block_new(o));
    if (!o->failed)
        walk(o, &in);
}
