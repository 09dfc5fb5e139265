// specialise.c - constants, then branches, then calls, then what is left of them.
//
// Blocks come in an order in which all edges but those back to the head of a loop lead forwards, so
// one walk from front to back finds what is reached and which values are known.
// Source: SPIR-V 1.6, sections 2.2.5, 2.11 (structured control flow), 2.16.1.
#include "renderer/gpu/specialise.h"

#include <stdlib.h>
#include <string.h>

#define SPV_ENABLE_UTILITY_CODE
#include <spirv/unified1/spirv.h>

#include "base/alloc.h"

#define NOTHING      0xffffffffu

enum kind { KIND_OTHER, KIND_BOOL, KIND_INT };

// What is known of an id.
struct id {
    uint32_t type;
    uint32_t spec;      // number of the specialisation constant, or NOTHING
    uint32_t value;     // when known
    uint32_t goes_to;   // of a block: the one way that is left, or 0
    uint32_t continues; // of a block: the loop it is the continue block of, or 0
    uint32_t function;  // of a function: where its first word is, or 0
    uint8_t kind;       // of a type
    bool known;
    bool seen;     // block: the walk has come by
    bool reached;  // block: some way leads there; function: it is called
    bool declared; // block: a merge or continue block of what is reached
    bool defined;  // in what is written
};

struct walk {
    const uint32_t *words;
    size_t count, first_function;
    const uint32_t *values;
    uint32_t value_count, bound;
    struct id *ids;
    uint32_t *out;
    size_t out_count; // room for all of `count`
    uint32_t *calls;  // functions that are called, in the order they were found
    uint32_t call_count;
    bool failed; // something that is not known here
};

// An id that must be below the bound.
static struct id *id_at(struct walk *w, uint32_t id)
{
    if (id == 0 || id >= w->bound) {
        w->failed = true;
        id = 0;
    }
    return &w->ids[id];
}

// Its result, or NULL.
static struct id *result_of(struct walk *w, const uint32_t *i)
{
    bool result, type;
    SpvHasResultAndType(hg_spirv_op(i), &result, &type);
    if (!result)
        return NULL;
    const uint32_t at = type ? 2 : 1;
    if (at >= hg_spirv_length(i)) {
        w->failed = true;
        return NULL;
    }
    struct id *r = id_at(w, i[at]);
    if (type)
        r->type = i[1];
    return r;
}

// --- values --------------------------------------------------------------------------------------

// One known side may be enough.
static bool half_known(uint32_t op, const struct id *a, const struct id *b, uint32_t *out)
{
    const uint32_t deciding = op == SpvOpLogicalOr;
    if (op != SpvOpLogicalAnd && op != SpvOpLogicalOr)
        return false;
    *out = deciding;
    return (a->known && a->value == deciding) || (b->known && b->value == deciding);
}

// Operands of an operation that can be told, or 0.
static uint32_t arity(uint32_t op)
{
    uint32_t unused;
    if (op == SpvOpLogicalNot || op == SpvOpNot || op == SpvOpSNegate)
        return 1;
    return op == SpvOpSelect ? 3 : hg_spirv_fold(op, 1, 1, &unused) ? 2 : 0;
}

// The value of an operation on `count` ids, if it can be told.
static bool evaluate(
    struct walk *w, uint32_t op, const uint32_t *operands, uint32_t count, uint32_t *out)
{
    if (count == 0 || count != arity(op))
        return false;
    const struct id *a = id_at(w, operands[0]), *b = id_at(w, operands[count > 1]);
    if (count == 1) {
        *out = op == SpvOpLogicalNot ? !a->value : op == SpvOpNot ? ~a->value : 0u - a->value;
        return a->known;
    }
    if (count == 3) {
        const struct id *chosen = id_at(w, operands[a->value != 0 ? 1 : 2]);
        *out = chosen->value;
        return a->known && chosen->known;
    }
    return a->known && b->known ? hg_spirv_fold(op, a->value, b->value, out)
                                : half_known(op, a, b, out);
}

static bool is_scalar(struct walk *w, uint32_t type)
{
    return id_at(w, type)->kind != KIND_OTHER;
}

// --- writing -------------------------------------------------------------------------------------

static void put(struct walk *w, const uint32_t *words, uint32_t count)
{
    if (count > w->count - w->out_count) { // functions within functions
        w->failed = true;
        return;
    }
    memcpy(w->out + w->out_count, words, count * sizeof *words);
    w->out_count += count;
}

static void put_instruction(struct walk *w, const uint32_t *i)
{
    struct id *result = result_of(w, i);
    if (result != NULL)
        result->defined = true;
    put(w, i, hg_spirv_length(i));
}

// --- in front of the functions -------------------------------------------------------------------

static bool is_spec_decoration(const uint32_t *i)
{
    return hg_spirv_op(i) == SpvOpDecorate && hg_spirv_length(i) == 4 &&
           i[2] == SpvDecorationSpecId;
}

static void note_decoration(struct walk *w, const uint32_t *i)
{
    if (is_spec_decoration(i))
        id_at(w, i[1])->spec = i[3];
    w->failed |= hg_spirv_op(i) == SpvOpDecorationGroup || hg_spirv_op(i) == SpvOpGroupDecorate ||
                 hg_spirv_op(i) == SpvOpGroupMemberDecorate;
}

static void note_type(struct walk *w, const uint32_t *i)
{
    if (hg_spirv_op(i) == SpvOpTypeBool)
        id_at(w, i[1])->kind = KIND_BOOL;
    if (hg_spirv_op(i) == SpvOpTypeInt && hg_spirv_length(i) == 4 && i[2] == 32)
        id_at(w, i[1])->kind = KIND_INT;
}

static void know(struct id *id, uint32_t value)
{
    id->known = true;
    id->value = value;
}

// A constant with its value, as an ordinary one.
static void put_constant(struct walk *w, uint32_t type, uint32_t result, uint32_t value)
{
    if (id_at(w, type)->kind == KIND_BOOL) {
        const uint32_t op = value != 0 ? SpvOpConstantTrue : SpvOpConstantFalse;
        put_instruction(w, (const uint32_t[]){3u << 16 | op, type, result});
    } else {
        put_instruction(w, (const uint32_t[]){4u << 16 | SpvOpConstant, type, result, value});
    }
}

static uint32_t given(const struct walk *w, const struct id *id, uint32_t otherwise)
{
    return id->spec < w->value_count ? w->values[id->spec] : otherwise;
}

static void constant(struct walk *w, const uint32_t *i)
{
    const uint32_t op = hg_spirv_op(i), length = hg_spirv_length(i);
    struct id *result = result_of(w, i);
    if (result == NULL)
        return;
    const bool scalar = is_scalar(w, i[1]),
               truth = op == SpvOpConstantTrue || op == SpvOpSpecConstantTrue;
    uint32_t value = truth;
    switch (op) {
    case SpvOpSpecConstantTrue:
    case SpvOpSpecConstantFalse:
        value = given(w, result, truth) != 0;
        put_constant(w, i[1], i[2], value);
        break;
    case SpvOpSpecConstant:
        value = length > 3 ? given(w, result, i[3]) : 0;
        w->failed |= length != 4;
        put_constant(w, i[1], i[2], value);
        break;
    case SpvOpSpecConstantOp:
        w->failed |= length < 4 || !scalar || !evaluate(w, i[3], i + 4, length - 4, &value);
        put_constant(w, i[1], i[2], value);
        break;
    case SpvOpSpecConstantComposite: // of what are constants by now
        put_instruction(w, i);
        if (!w->failed)
            w->out[w->out_count - length] = length << 16 | SpvOpConstantComposite;
        return;
    case SpvOpConstant:
        value = length > 3 ? i[3] : 0;
        put_instruction(w, i);
        break;
    default:
        put_instruction(w, i);
    }
    if (scalar)
        know(result, value);
}

static bool is_constant(uint32_t op)
{
    return (op >= SpvOpConstantTrue && op <= SpvOpConstant) ||
           (op >= SpvOpSpecConstantTrue && op <= SpvOpSpecConstantOp);
}

// --- the walk through a function -----------------------------------------------------------------

static void reach(struct walk *w, uint32_t block)
{
    id_at(w, block)->reached = true;
}

// Whether a way leads from one block to the other, as far as is known.
static bool is_edge(struct walk *w, uint32_t from, uint32_t to)
{
    const struct id *f = id_at(w, from);
    return !f->seen || (f->reached && (f->goes_to == 0 || f->goes_to == to));
}

static void note_phi(struct walk *w, const uint32_t *i, uint32_t block)
{
    const struct id *one = NULL;
    for (uint32_t k = 3; k + 1 < hg_spirv_length(i); k += 2) {
        if (!is_edge(w, i[k + 1], block))
            continue;
        const struct id *from = id_at(w, i[k]);
        if (!from->known || (one != NULL && one->value != from->value))
            return;
        one = from;
    }
    if (one != NULL)
        know(id_at(w, i[2]), one->value);
}

static void note_branch(struct walk *w, const uint32_t *i, const uint32_t *merge, uint32_t block)
{
    if (hg_spirv_length(i) < 4) {
        w->failed = true;
        return;
    }
    const struct id *condition = id_at(w, i[1]);
    if (condition->known && merge != NULL && hg_spirv_op(merge) == SpvOpSelectionMerge) {
        id_at(w, block)->goes_to = i[condition->value != 0 ? 2 : 3];
        reach(w, id_at(w, block)->goes_to);
        return;
    }
    reach(w, i[2]);
    reach(w, i[3]);
    if (merge != NULL)
        id_at(w, merge[1])->declared = true;
}

static void note_switch(struct walk *w, const uint32_t *i, const uint32_t *merge)
{
    w->failed |= hg_spirv_length(i) < 3 || id_at(w, id_at(w, i[1])->type)->kind != KIND_INT;
    for (uint32_t k = 2; k < hg_spirv_length(i); k += 2)
        reach(w, i[k]);
    if (merge != NULL)
        id_at(w, merge[1])->declared = true;
}

static void note_loop(struct walk *w, const uint32_t *i, uint32_t block)
{
    if (hg_spirv_length(i) < 4) {
        w->failed = true;
        return;
    }
    id_at(w, i[1])->declared = true;
    struct id *again = id_at(w, i[2]);
    again->declared = true;
    again->continues = block;
}

static void note_call(struct walk *w, uint32_t function)
{
    struct id *f = id_at(w, function);
    if (!f->reached)
        w->calls[w->call_count++] = function;
    f->reached = true;
}

// One instruction of a block that is reached. *merge: what the block's last one ends, or NULL.
static void note_instruction(
    struct walk *w, const uint32_t *i, const uint32_t **merge, uint32_t block)
{
    struct id *result = result_of(w, i);
    const uint32_t length = hg_spirv_length(i);
    if (w->failed)
        return;
    switch (hg_spirv_op(i)) {
    case SpvOpPhi:
        note_phi(w, i, block);
        return;
    case SpvOpSelectionMerge:
        *merge = i;
        return;
    case SpvOpLoopMerge:
        *merge = i;
        note_loop(w, i, block);
        return;
    case SpvOpBranch:
        reach(w, i[1]);
        return;
    case SpvOpBranchConditional:
        note_branch(w, i, *merge, block);
        return;
    case SpvOpSwitch:
        note_switch(w, i, *merge);
        return;
    case SpvOpFunctionCall:
        note_call(w, length > 3 ? i[3] : 0);
        return;
    default:
        break;
    }
    uint32_t value;
    if (result != NULL && length > 3 && arity(hg_spirv_op(i)) > 0 && is_scalar(w, i[1]) &&
        evaluate(w, hg_spirv_op(i), i + 3, length - 3, &value))
        know(result, value);
}

static void note_function(struct walk *w, size_t at)
{
    uint32_t block = 0;
    const uint32_t *merge = NULL;
    for (const uint32_t *i = w->words + at; !w->failed && hg_spirv_op(i) != SpvOpFunctionEnd;
         i += hg_spirv_length(i)) {
        if (hg_spirv_op(i) == SpvOpLabel) {
            if (block == 0)
                reach(w, i[1]);
            block = i[1];
            merge = NULL;
            id_at(w, block)->seen = true;
        } else if (block != 0 && id_at(w, block)->reached) {
            note_instruction(w, i, &merge, block);
        }
    }
}

// --- what is left of a function ------------------------------------------------------------------

static void put_phi(struct walk *w, const uint32_t *i, uint32_t block)
{
    const size_t at = w->out_count;
    put_instruction(w, i);
    if (w->failed)
        return;
    w->out_count = at + 3;
    for (uint32_t k = 3; k + 1 < hg_spirv_length(i); k += 2)
        if (is_edge(w, i[k + 1], block))
            put(w, i + k, 2);
    w->out[at] = (uint32_t)(w->out_count - at) << 16 | SpvOpPhi;
}

// A block that is named as the end of something but that no way leads to.
static void put_unreachable(struct walk *w, const uint32_t *label, const struct id *block)
{
    put_instruction(w, label);
    if (block->continues != 0)
        put(w, (const uint32_t[]){2u << 16 | SpvOpBranch, block->continues}, 2);
    else
        put(w, (const uint32_t[]){1u << 16 | SpvOpUnreachable}, 1);
}

static void put_in_block(struct walk *w, const uint32_t *i, uint32_t block)
{
    const uint32_t op = hg_spirv_op(i), goes_to = id_at(w, block)->goes_to;
    if (op == SpvOpPhi)
        put_phi(w, i, block);
    else if (op == SpvOpBranchConditional && goes_to != 0)
        put(w, (const uint32_t[]){2u << 16 | SpvOpBranch, goes_to}, 2);
    else if ((op != SpvOpSelectionMerge || goes_to == 0) && !hg_spirv_is_note(op))
        put_instruction(w, i);
}

static void put_function(struct walk *w, size_t at)
{
    uint32_t block = 0;
    for (const uint32_t *i = w->words + at; !w->failed; i += hg_spirv_length(i)) {
        const uint32_t op = hg_spirv_op(i);
        if (op == SpvOpLabel) {
            block = i[1];
            if (!id_at(w, block)->reached && id_at(w, block)->declared)
                put_unreachable(w, i, id_at(w, block));
        }
        if ((op == SpvOpFunctionEnd || block == 0) && !hg_spirv_is_note(op))
            put_instruction(w, i);
        else if (block != 0 && id_at(w, block)->reached)
            put_in_block(w, i, block);
        if (op == SpvOpFunctionEnd)
            return;
    }
}

// --- the module ----------------------------------------------------------------------------------

// Words that are read without another look.
static uint32_t least_length(uint32_t op)
{
    if (op == SpvOpFunction)
        return 5;
    const bool two = op == SpvOpLabel || op == SpvOpBranch || op == SpvOpSelectionMerge ||
                     op == SpvOpTypeBool || hg_spirv_is_decoration(op);
    return two ? 2 : 1;
}

// Lengths are right, functions end, and where they begin.
static bool check(struct walk *w)
{
    bool inside = false;
    w->first_function = w->count;
    for (size_t at = HG_SPIRV_HEADER_WORDS; at < w->count; at += hg_spirv_length(w->words + at)) {
        const uint32_t *i = w->words + at;
        const uint32_t op = hg_spirv_op(i), length = hg_spirv_length(i);
        if (length < least_length(op) || length > w->count - at)
            return false;
        if (op == SpvOpFunction) {
            id_at(w, i[2])->function = (uint32_t)at;
            w->first_function = w->first_function < at ? w->first_function : at;
            inside = true;
        }
        inside = inside && op != SpvOpFunctionEnd;
    }
    return !inside && !w->failed;
}

static void note_globals(struct walk *w)
{
    for (const uint32_t *i = w->words + HG_SPIRV_HEADER_WORDS;
         i < w->words + w->first_function && !w->failed; i += hg_spirv_length(i)) {
        if (hg_spirv_is_decoration(hg_spirv_op(i)))
            note_decoration(w, i);
        else if (hg_spirv_op(i) == SpvOpEntryPoint && hg_spirv_length(i) > 2)
            note_call(w, i[2]);
    }
}

// Decorations of what is not there any more are dropped when all has been written.
static void put_globals(struct walk *w)
{
    for (const uint32_t *i = w->words + HG_SPIRV_HEADER_WORDS;
         i < w->words + w->first_function && !w->failed; i += hg_spirv_length(i)) {
        note_type(w, i);
        if (is_constant(hg_spirv_op(i)))
            constant(w, i);
        else if (!hg_spirv_is_note(hg_spirv_op(i)) && !is_spec_decoration(i))
            put_instruction(w, i);
    }
}

static void drop_decorations(struct walk *w)
{
    size_t to = HG_SPIRV_HEADER_WORDS;
    for (size_t at = HG_SPIRV_HEADER_WORDS; at < w->out_count;) {
        const uint32_t *i = w->out + at, length = hg_spirv_length(i);
        if (!hg_spirv_is_decoration(hg_spirv_op(i)) || id_at(w, i[1])->defined) {
            memmove(w->out + to, i, length * sizeof *i);
            to += length;
        }
        at += length;
    }
    w->out_count = to;
}

static void run(struct walk *w)
{
    put(w, w->words, HG_SPIRV_HEADER_WORDS);
    note_globals(w);
    put_globals(w);
    for (uint32_t n = 0; n < w->call_count && !w->failed; n++) {
        const struct id *f = id_at(w, w->calls[n]);
        w->failed |= f->function == 0;
        if (!w->failed)
            note_function(w, f->function);
    }
    for (size_t at = w->first_function; at < w->count && !w->failed;
         at += hg_spirv_length(w->words + at)) {
        const uint32_t *i = w->words + at;
        if (hg_spirv_op(i) == SpvOpFunction && id_at(w, i[2])->reached)
            put_function(w, at);
    }
    drop_decorations(w);
}

bool hg_spirv_specialise(const uint32_t *words, size_t size_bytes, const uint32_t *values,
    uint32_t value_count, struct hg_spirv *out)
{
    *out = (struct hg_spirv){0};
    const size_t count = size_bytes / sizeof *words;
    if (count < HG_SPIRV_HEADER_WORDS || words[0] != SpvMagicNumber || words[3] == 0 ||
        words[3] > HG_SPIRV_MOST_IDS || count > UINT32_MAX)
        return false;
    // An unreachable block takes no more room than what was there, a constant's value no more than
    // its operation.
    struct walk w = {.words = words,
        .count = count,
        .values = values,
        .value_count = value_count,
        .bound = words[3]};
    w.ids = hg_calloc(w.bound, sizeof *w.ids);
    w.out = hg_calloc(count, sizeof *w.out);
    w.calls = hg_calloc(w.bound, sizeof *w.calls);
    w.failed = w.ids == NULL || w.out == NULL || w.calls == NULL;
    for (uint32_t i = 0; i < w.bound && !w.failed; i++)
        w.ids[i].spec = NOTHING;
    if (!w.failed && check(&w))
        run(&w);
    else
        w.failed = true;
    hg_free(w.ids);
    hg_free(w.calls);
    if (w.failed) {
        hg_free(w.out);
        return false;
    }
    *out = (struct hg_spirv){w.out, w.out_count * sizeof *w.out};
    return true;
}
