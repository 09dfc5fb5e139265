// optimise_write.c - what something asks for, with new ids, as words.
#include "renderer/gpu/optimise_internal.h"

#include <string.h>

#include "base/alloc.h"

// --- what is asked for ---------------------------------------------------------------------------

static void mark_instruction(struct opt *o, uint32_t at)
{
    struct opt_instruction *i = opt_instruction_at(o, at);
    if (i->live)
        return;
    i->live = true;
    *opt_work_at(o, opt_add(o, LIST_WORK, 1)) = at;
}

static void mark_operands(struct opt *o, uint32_t at)
{
    const struct opt_instruction i = *opt_instruction_at(o, at);
    for (uint32_t k = 0; k < i.count; k++) {
        struct opt_operand *operand = opt_operand_at(o, i.first + k);
        if (operand->kind != OPERAND_VALUE)
            continue;
        operand->word = opt_resolve(o, operand->word);
        const struct opt_value *v = opt_value_at(o, operand->word);
        if (v->kind == VALUE_RESULT)
            mark_instruction(o, v->at);
        else
            o->failed |= v->kind != VALUE_GLOBAL;
    }
}

static void mark(struct opt *o)
{
    o->lists[LIST_WORK].count = 1;
    for (uint32_t k = o->first_order; k < opt_count(o, LIST_ORDER); k++) {
        const struct opt_block *block = opt_block_at(o, *opt_order_at(o, k));
        for (uint32_t at = block->first; at != 0; at = opt_instruction_at(o, at)->next)
            if (!opt_instruction_at(o, at)->removable)
                mark_instruction(o, at);
    }
    while (opt_count(o, LIST_WORK) > 1 && !o->failed)
        mark_operands(o, *opt_work_at(o, (uint32_t)--o->lists[LIST_WORK].count));
}

// Phis whose operands have turned out to be one value, until there is none left.
static void close_phis(struct opt *o)
{
    bool again = true;
    while (again && !o->failed) {
        again = false;
        for (uint32_t k = o->first_order; k < opt_count(o, LIST_ORDER); k++) {
            const uint32_t block = *opt_order_at(o, k);
            for (uint32_t phi = opt_block_at(o, block)->phis; phi != 0;
                 phi = opt_instruction_at(o, phi)->next) {
                const uint32_t value = opt_instruction_at(o, phi)->value;
                if (opt_value_at(o, value)->forward != 0)
                    continue;
                opt_phi_close(o, phi);
                again |= opt_value_at(o, value)->forward != 0;
            }
        }
    }
}

// --- words ---------------------------------------------------------------------------------------

static void put_words(struct opt *o, const uint32_t *words, uint32_t count)
{
    const uint32_t at = opt_add(o, LIST_OUT, count);
    if (at != 0)
        memcpy(opt_out_at(o, at), words, count * sizeof *words);
}

static void name_instruction(struct opt *o, uint32_t at)
{
    struct opt_instruction *i = opt_instruction_at(o, at);
    if (!i->live || i->value == 0 || opt_value_at(o, i->value)->forward != 0)
        return;
    i->id = o->last_id++;
    if (i->source == 0 || !o->ids[i->source].decorated)
        return;
    const uint32_t clone = opt_add(o, LIST_CLONES, 2);
    *opt_clone_at(o, clone) = opt_instruction_at(o, at)->source;
    *opt_clone_at(o, clone + 1) = opt_instruction_at(o, at)->id;
}

// The block goes on where the one in front of it ends, and nowhere else.
static bool is_joined(const struct opt *o, uint32_t order)
{
    if (order == o->first_order)
        return false;
    const uint32_t before = *opt_order_at(o, order - 1);
    const struct opt_block *b = opt_block_at(o, *opt_order_at(o, order));
    return b->edge_count == 1 && opt_edge_at(o, b->edges)->from == before && !b->declared &&
           !opt_block_at(o, before)->heads &&
           opt_instruction_at(o, opt_block_at(o, before)->last)->op == SpvOpBranch;
}

static void name_all(struct opt *o)
{
    for (uint32_t k = 1; k < opt_count(o, LIST_LOCALS); k++)
        name_instruction(o, *opt_local_at(o, k));
    for (uint32_t k = o->first_order; k < opt_count(o, LIST_ORDER); k++) {
        struct opt_block *block = opt_block_at(o, *opt_order_at(o, k));
        block->id = is_joined(o, k) ? opt_block_at(o, *opt_order_at(o, k - 1))->id : o->last_id++;
        for (uint32_t at = block->phis; at != 0; at = opt_instruction_at(o, at)->next)
            name_instruction(o, at);
        for (uint32_t at = block->first; at != 0; at = opt_instruction_at(o, at)->next)
            name_instruction(o, at);
    }
}

static uint32_t id_of(const struct opt *o, const struct opt_operand *operand)
{
    if (operand->kind == OPERAND_WORD)
        return operand->word;
    if (operand->kind == OPERAND_BLOCK)
        return opt_block_at(o, operand->word)->id;
    const struct opt_value *v = opt_value_at(o, operand->word);
    return v->kind == VALUE_GLOBAL ? v->at : opt_instruction_at(o, v->at)->id;
}

static void put_instruction(struct opt *o, uint32_t at)
{
    const struct opt_instruction i = *opt_instruction_at(o, at);
    if (!i.live || (i.value != 0 && opt_value_at(o, i.value)->forward != 0))
        return;
    const uint32_t length = 1 + (i.type ? 2 : 0) + i.count;
    const uint32_t out = opt_add(o, LIST_OUT, length);
    o->failed |= length > 0xffff;
    if (out == 0 || o->failed)
        return;
    uint32_t *words = opt_out_at(o, out);
    *words++ = length << 16 | i.op;
    if (i.type != 0) {
        *words++ = i.type;
        *words++ = i.id;
    }
    for (uint32_t k = 0; k < i.count; k++) {
        *words = id_of(o, opt_operand_at(o, i.first + k));
        o->failed |= opt_operand_at(o, i.first + k)->kind != OPERAND_WORD && *words == 0;
        words++;
    }
}

static void put_block(struct opt *o, uint32_t order)
{
    const struct opt_block block = *opt_block_at(o, *opt_order_at(o, order));
    if (!is_joined(o, order))
        put_words(o, (const uint32_t[]){2u << 16 | SpvOpLabel, block.id}, 2);
    for (uint32_t k = 1; order == o->first_order && k < opt_count(o, LIST_LOCALS); k++)
        put_instruction(o, *opt_local_at(o, k));
    for (uint32_t at = block.phis; at != 0; at = opt_instruction_at(o, at)->next)
        put_instruction(o, at);
    const bool goes_on = order + 1 < opt_count(o, LIST_ORDER) && is_joined(o, order + 1);
    for (uint32_t at = block.first; at != 0; at = opt_instruction_at(o, at)->next)
        if (!goes_on || at != block.last)
            put_instruction(o, at);
}

void opt_put_function(struct opt *o, const struct opt_function *f)
{
    close_phis(o);
    mark(o);
    if (o->failed)
        return;
    name_all(o);
    put_words(o, f->begin, (uint32_t)(f->entry - f->begin));
    for (uint32_t k = o->first_order; k < opt_count(o, LIST_ORDER) && !o->failed; k++)
        put_block(o, k);
    put_words(o, f->end, hg_spirv_length(f->end));
}

// --- the module ----------------------------------------------------------------------------------

static void append(uint32_t *words, size_t *count, const uint32_t *more, size_t more_count)
{
    if (more_count > 0)
        memcpy(words + *count, more, more_count * sizeof *more);
    *count += more_count;
}

// Of ids in functions only those of parameters stay.
static bool is_dropped(const struct opt *o, const uint32_t *i)
{
    if (!hg_spirv_is_decoration(hg_spirv_op(i)) || i[1] >= o->bound)
        return false;
    const struct opt_id *id = &o->ids[i[1]];
    return id->def != NULL && id->def >= o->words + o->first_function && !id->kept &&
           id->function == 0;
}

static size_t clone_words(const struct opt *o, const uint32_t *i, uint32_t *words)
{
    size_t count = 0;
    const uint32_t length = hg_spirv_length(i);
    for (uint32_t k = 1; hg_spirv_op(i) == SpvOpDecorate && k + 1 < opt_count(o, LIST_CLONES);
         k += 2) {
        if (*opt_clone_at(o, k) != i[1])
            continue;
        if (words != NULL) {
            memcpy(words + count, i, length * sizeof *i);
            words[count + 1] = *opt_clone_at(o, k + 1);
        }
        count += length;
    }
    return count;
}

static void put_globals(const struct opt *o, uint32_t *words, size_t *count)
{
    for (const uint32_t *i = o->words + HG_SPIRV_HEADER_WORDS; i < o->words + o->first_function;
         i += hg_spirv_length(i)) {
        if (!is_dropped(o, i))
            append(words, count, i, hg_spirv_length(i));
        *count += clone_words(o, i, words + *count);
    }
}

bool opt_put_module(struct opt *o, struct hg_spirv *out)
{
    size_t size = o->first_function + opt_count(o, LIST_ADDED) + opt_count(o, LIST_OUT), count = 0;
    for (const uint32_t *i = o->words + HG_SPIRV_HEADER_WORDS; i < o->words + o->first_function;
         i += hg_spirv_length(i))
        size += clone_words(o, i, NULL);
    uint32_t *words = hg_calloc(size, sizeof *words);
    if (words == NULL)
        return false;
    append(words, &count, o->words, HG_SPIRV_HEADER_WORDS);
    words[3] = o->last_id;
    put_globals(o, words, &count);
    append(words, &count, opt_word_at(o, 1), opt_count(o, LIST_ADDED) - 1);
    append(words, &count, opt_out_at(o, 1), opt_count(o, LIST_OUT) - 1);
    *out = (struct hg_spirv){words, count * sizeof *words};
    return true;
}
