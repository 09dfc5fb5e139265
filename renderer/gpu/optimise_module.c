// optimise_module.c - types, constants and functions of a module, and which local variables can
// become values.
// Source: SPIR-V 1.6, sections 2.11 (structured control flow), 3.42 (instructions).
#include <string.h>

#include "renderer/gpu/optimise_internal.h"

#define MOST_NESTED 64

// --- types and constants -------------------------------------------------------------------------

uint32_t opt_part_type(struct opt *o, uint32_t type, uint32_t part)
{
    const struct opt_type *t = opt_type(o, type);
    if (t->op == SpvOpTypeStruct)
        return part < t->count ? t->members[part] : 0;
    return t->op == SpvOpTypeVector || t->op == SpvOpTypeMatrix || t->op == SpvOpTypeArray
               ? t->element
               : 0;
}

uint32_t opt_part_count(struct opt *o, uint32_t type)
{
    const struct opt_type *t = opt_type(o, type);
    return t->op == SpvOpTypePointer ? 0 : t->count;
}

static void count_leaves(struct opt *o, struct opt_type *t)
{
    uint32_t sum = 0;
    const uint32_t parts = t->op == SpvOpTypeStruct || t->op == SpvOpTypeArray ? t->count : 0;
    for (uint32_t k = 0; k < parts; k++) {
        const uint32_t part = t->op == SpvOpTypeStruct ? t->members[k] : t->element;
        const uint32_t leaves = opt_type(o, part)->leaves;
        if (leaves == 0 || sum + leaves > OPT_MOST_LEAVES)
            return;
        sum += leaves;
    }
    t->leaves = sum;
}

static void read_array(struct opt *o, const uint32_t *i, struct opt_type *t)
{
    const struct opt_id *length = opt_id(o, i[3]);
    t->element = i[2];
    t->count = length->known ? length->number : 0;
    count_leaves(o, t);
}

static void read_type(struct opt *o, const uint32_t *i)
{
    struct opt_type *t = opt_type(o, i[1]);
    t->op = hg_spirv_op(i);
    switch (t->op) {
    case SpvOpTypeBool:
    case SpvOpTypeInt:
    case SpvOpTypeFloat:
        t->leaves = 1;
        if (t->op == SpvOpTypeInt && i[2] == 32)
            o->int_type = i[1];
        break;
    case SpvOpTypeVector:
    case SpvOpTypeMatrix:
        t->element = i[2];
        t->count = i[3];
        t->leaves = 1;
        break;
    case SpvOpTypeArray:
        read_array(o, i, t);
        break;
    case SpvOpTypeStruct:
        t->members = i + 2;
        t->count = hg_spirv_length(i) - 2;
        count_leaves(o, t);
        break;
    case SpvOpTypePointer:
        t->count = i[2];
        t->element = i[3];
        t->leaves = i[2] == SpvStorageClassPhysicalStorageBuffer;
        break;
    default:
        break;
    }
}

bool opt_is_short(struct opt *o, uint32_t type)
{
    const struct opt_type *t = opt_type(o, type);
    const uint32_t *def = opt_id(o, type)->def;
    return t->op == SpvOpTypeBool || (t->op == SpvOpTypeInt && def != NULL && def[2] == 32);
}

static void read_constant(struct opt *o, const uint32_t *i)
{
    const uint32_t op = hg_spirv_op(i);
    struct opt_id *id = opt_id(o, i[2]);
    id->known = opt_is_short(o, i[1]) && (op != SpvOpConstant || hg_spirv_length(i) == 4);
    id->number = op == SpvOpConstant ? i[3] : op == SpvOpConstantTrue;
}

static void read_global(struct opt *o, const uint32_t *i)
{
    const uint32_t op = hg_spirv_op(i), length = hg_spirv_length(i);
    if (op >= SpvOpTypeVoid && op < SpvOpTypeForwardPointer)
        read_type(o, i);
    else if (op == SpvOpTypeForwardPointer && length == 3)
        opt_type(o, i[1])->leaves = i[2] == SpvStorageClassPhysicalStorageBuffer;
    else if (op == SpvOpConstantTrue || op == SpvOpConstantFalse || op == SpvOpConstant)
        read_constant(o, i);
    else if (op == SpvOpDecorate)
        opt_id(o, i[1])->decorated = true;
    else if (op == SpvOpExtInstImport && length > 3 && memcmp(i + 2, "GLSL.std.450", 13) == 0)
        o->extended = i[1];
    o->failed |= (op >= SpvOpSpecConstantTrue && op <= SpvOpSpecConstantOp) ||
                 (hg_spirv_is_decoration(op) && op != SpvOpDecorate && op != SpvOpMemberDecorate);
}

// --- instructions --------------------------------------------------------------------------------

static bool is_arithmetic(uint32_t op)
{
    return (op >= SpvOpConvertFToU && op <= SpvOpBitcast) ||
           (op >= SpvOpSNegate && op <= SpvOpSMulExtended) ||
           (op >= SpvOpAny && op <= SpvOpFUnordGreaterThanEqual) ||
           (op >= SpvOpShiftRightLogical && op <= SpvOpBitCount);
}

static bool is_composite(uint32_t op)
{
    return op == SpvOpVectorExtractDynamic || op == SpvOpVectorInsertDynamic ||
           op == SpvOpCompositeConstruct || op == SpvOpTranspose || op == SpvOpSampledImage ||
           op == SpvOpImage || op == SpvOpAccessChain || op == SpvOpInBoundsAccessChain ||
           op == SpvOpConvertUToAccelerationStructureKHR;
}

static bool is_effect(uint32_t op)
{
    return (op >= SpvOpAtomicLoad && op <= SpvOpAtomicXor) || op == SpvOpControlBarrier ||
           op == SpvOpMemoryBarrier || op == SpvOpDemoteToHelperInvocation ||
           (op >= SpvOpRayQueryInitializeKHR && op <= SpvOpRayQueryGetIntersectionTypeKHR) ||
           (op >= SpvOpRayQueryGetRayTMinKHR && op <= SpvOpRayQueryGetIntersectionWorldToObjectKHR);
}

static struct opt_shape image_shape(uint32_t op)
{
    switch (op) {
    case SpvOpImageSampleExplicitLod:
    case SpvOpImageFetch:
        return (struct opt_shape){true, true, true, 2, 1};
    case SpvOpImageSampleImplicitLod: // of pixels beside it: not shared
    case SpvOpImageRead:
        return (struct opt_shape){true, true, false, 2, 1};
    case SpvOpImageSampleDrefExplicitLod:
    case SpvOpImageGather:
    case SpvOpImageDrefGather:
        return (struct opt_shape){true, true, true, 3, 1};
    case SpvOpImageSampleDrefImplicitLod:
        return (struct opt_shape){true, true, false, 3, 1};
    case SpvOpImageWrite:
        return (struct opt_shape){true, false, false, 3, 1};
    case SpvOpImageQuerySizeLod:
    case SpvOpImageQuerySize:
        return (struct opt_shape){true, true, true, 0, 0};
    default:
        return (struct opt_shape){0};
    }
}

// Storage that nothing writes to while the shader runs.
static bool is_read_only(uint32_t storage)
{
    return storage == SpvStorageClassUniform || storage == SpvStorageClassUniformConstant ||
           storage == SpvStorageClassInput || storage == SpvStorageClassPushConstant;
}

static struct opt_shape load_shape(const struct opt *o, const uint32_t *i)
{
    const uint32_t *pointer = i[3] < o->bound ? o->ids[i[3]].def : NULL;
    const struct opt_type *type =
        pointer != NULL && pointer[1] < o->bound ? &o->types[pointer[1]] : NULL;
    const bool pure = type != NULL && type->op == SpvOpTypePointer && is_read_only(type->count) &&
                      hg_spirv_length(i) == 4;
    return (struct opt_shape){true, true, pure, 1, UINT32_MAX};
}

static struct opt_shape extended_shape(const struct opt *o, const uint32_t *i)
{
    const uint32_t modf = 35, frexp = 51; // they write through a pointer
    if (hg_spirv_length(i) < 5 || i[3] != o->extended || i[4] == modf || i[4] == frexp)
        return (struct opt_shape){0};
    return (struct opt_shape){true, true, true, 1, 1};
}

struct opt_shape opt_shape_of(const struct opt *o, const uint32_t *i)
{
    const uint32_t op = hg_spirv_op(i), rest = UINT32_MAX;
    if (is_arithmetic(op) || is_composite(op))
        return (struct opt_shape){true, true, true, 0, 0};
    if (is_effect(op))
        return (struct opt_shape){true, false, false, 0, 0};
    switch (op) {
    case SpvOpCompositeExtract:
        return (struct opt_shape){true, true, true, 1, rest};
    case SpvOpCompositeInsert:
    case SpvOpVectorShuffle:
        return (struct opt_shape){true, true, true, 2, rest};
    case SpvOpExtInst:
        return extended_shape(o, i);
    case SpvOpLoad:
        return load_shape(o, i);
    case SpvOpStore:
        return (struct opt_shape){true, false, false, 2, rest};
    case SpvOpArrayLength:
        return (struct opt_shape){true, true, false, 1, 1};
    case SpvOpDPdx:
    case SpvOpDPdy:
    case SpvOpFwidth:
    case SpvOpIsHelperInvocationEXT:
        return (struct opt_shape){true, true, false, 0, 0};
    default:
        return image_shape(op);
    }
}

// --- functions -----------------------------------------------------------------------------------

struct nest { // loops and switches around an instruction
    struct {
        uint32_t merge, continues;
        bool continuing;
    } items[MOST_NESTED];
    uint32_t count;
};

static void open_construct(struct opt *o, struct nest *nest, uint32_t merge, uint32_t continues)
{
    if (nest->count == MOST_NESTED) {
        o->failed = true;
        return;
    }
    nest->items[nest->count].merge = merge;
    nest->items[nest->count].continues = continues;
    nest->items[nest->count++].continuing = false;
}

static void close_constructs(struct nest *nest, uint32_t label)
{
    for (uint32_t k = 0; k < nest->count; k++) {
        if (nest->items[k].merge == label)
            nest->count = k;
        else if (nest->items[k].continues == label)
            nest->items[k].continuing = true;
    }
}

static bool is_continuing(const struct nest *nest)
{
    bool any = false;
    for (uint32_t k = 0; k < nest->count; k++)
        any |= nest->items[k].continuing;
    return any;
}

static bool ends_block(uint32_t op)
{
    return (op >= SpvOpBranch && op <= SpvOpUnreachable) || op == SpvOpTerminateInvocation ||
           op == SpvOpFunctionEnd;
}

// The block of an instruction is the head of a loop.
static bool is_header(const uint32_t *i)
{
    while (!ends_block(hg_spirv_op(i)) && hg_spirv_op(i) != SpvOpLoopMerge)
        i += hg_spirv_length(i);
    return hg_spirv_op(i) == SpvOpLoopMerge;
}

static void keep_in_memory(struct opt *o, uint32_t root)
{
    if (root != 0)
        opt_id(o, root)->memory = true;
}

static void note_store(struct opt *o, const uint32_t *i, uint32_t root)
{
    if (root != 0)
        *opt_store_at(o, opt_add(o, LIST_STORES, 1)) = (struct opt_store){i, root};
}

static void analyse_root(struct opt *o, const uint32_t *i)
{
    const struct opt_type *pointer = opt_type(o, i[1]);
    if (pointer->op != SpvOpTypePointer || pointer->count != SpvStorageClassFunction)
        return;
    struct opt_id *id = opt_id(o, i[2]);
    id->root = i[2];
    id->memory = opt_type(o, pointer->element)->leaves == 0;
}

// Only indices into vectors may be values that are not known.
static void analyse_chain(struct opt *o, const uint32_t *i)
{
    const uint32_t root = opt_id(o, i[3])->root;
    if (root == 0)
        return;
    opt_id(o, i[2])->root = root;
    const uint32_t *base = opt_id(o, i[3])->def;
    uint32_t type = base == NULL ? 0 : opt_type(o, base[1])->element;
    for (uint32_t k = 4; k < hg_spirv_length(i) && type != 0; k++) {
        const struct opt_id *index = opt_id(o, i[k]);
        const bool is_vector = opt_type(o, type)->op == SpvOpTypeVector;
        if (!is_vector && (!index->known || index->number >= opt_part_count(o, type)))
            keep_in_memory(o, root);
        type = opt_part_type(o, type, index->number);
    }
    if (type == 0)
        keep_in_memory(o, root);
}

static void analyse_call(struct opt *o, const uint32_t *i, const struct nest *nest)
{
    const struct opt_function *callee = &o->functions[opt_id(o, i[3])->function - 1];
    const bool kept =
        callee->deep || (callee->block_count > 1 && (is_continuing(nest) || is_header(i)));
    opt_id(o, i[2])->kept = kept;
    const uint32_t *parameter = callee->begin + hg_spirv_length(callee->begin);
    for (uint32_t k = 4; k < hg_spirv_length(i); k++, parameter += hg_spirv_length(parameter)) {
        const uint32_t root = opt_id(o, i[k])->root;
        if (kept || hg_spirv_op(parameter) != SpvOpFunctionParameter ||
            opt_id(o, parameter[2])->memory)
            keep_in_memory(o, root);
        note_store(o, i, root);
    }
}

static void analyse_other(struct opt *o, const uint32_t *i)
{
    bool result, type;
    SpvHasResultAndType((SpvOp)hg_spirv_op(i), &result, &type);
    const struct opt_shape shape = opt_shape_of(o, i);
    const uint32_t skip = 1 + (uint32_t)result + (uint32_t)type;
    for (uint32_t k = skip; k < hg_spirv_length(i); k++)
        if (i[k] < o->bound &&
            (k - skip < shape.literal || k - skip - shape.literal >= shape.literal_count))
            keep_in_memory(o, o->ids[i[k]].root);
}

static void analyse_flow(
    struct opt *o, struct opt_function *f, const uint32_t *i, struct nest *nest)
{
    const uint32_t *next = i + hg_spirv_length(i);
    switch (hg_spirv_op(i)) {
    case SpvOpLabel:
        close_constructs(nest, i[1]);
        f->block_count++;
        break;
    case SpvOpLoopMerge:
        open_construct(o, nest, i[1], i[2]);
        break;
    case SpvOpSelectionMerge:
        if (hg_spirv_op(next) == SpvOpSwitch)
            open_construct(o, nest, i[1], 0);
        break;
    case SpvOpReturn:
    case SpvOpReturnValue:
        f->deep |= nest->count > 0;
        f->return_count++;
        f->straight = f->return_count == 1 && hg_spirv_op(next) == SpvOpFunctionEnd;
        break;
    default:
        break;
    }
}

static void analyse(struct opt *o, struct opt_function *f);

static void analyse_callees(struct opt *o, const struct opt_function *f)
{
    for (const uint32_t *i = f->begin; i < f->end; i += hg_spirv_length(i)) {
        if (hg_spirv_op(i) != SpvOpFunctionCall)
            continue;
        const uint32_t callee = opt_id(o, i[3])->function;
        o->failed |= callee == 0;
        if (callee != 0)
            analyse(o, &o->functions[callee - 1]);
    }
}

static void analyse(struct opt *o, struct opt_function *f)
{
    if (f->analysed || o->failed)
        return;
    f->analysed = true; // no function calls itself, even through others
    analyse_callees(o, f);
    f->stores = (uint32_t)opt_count(o, LIST_STORES);
    struct nest nest = {.count = 0};
    for (const uint32_t *i = f->begin; i < f->end && !o->failed; i += hg_spirv_length(i)) {
        switch (hg_spirv_op(i)) {
        case SpvOpVariable:
        case SpvOpFunctionParameter:
            analyse_root(o, i);
            break;
        case SpvOpLoad:
            break;
        case SpvOpStore:
            note_store(o, i, opt_id(o, i[1])->root);
            break;
        case SpvOpAccessChain:
        case SpvOpInBoundsAccessChain:
            analyse_chain(o, i);
            break;
        case SpvOpFunctionCall:
            analyse_call(o, i, &nest);
            break;
        default:
            analyse_flow(o, f, i, &nest);
            analyse_other(o, i);
        }
    }
    f->store_count = (uint32_t)opt_count(o, LIST_STORES) - f->stores;
}

// --- the module ----------------------------------------------------------------------------------

// Words that are read without another look.
static uint32_t least_length(uint32_t op)
{
    switch (op) {
    case SpvOpFunction:
    case SpvOpVectorShuffle:
        return 5;
    case SpvOpTypeArray:
    case SpvOpTypeVector:
    case SpvOpTypeMatrix:
    case SpvOpTypePointer:
    case SpvOpConstant:
    case SpvOpLoad:
    case SpvOpAccessChain:
    case SpvOpInBoundsAccessChain:
    case SpvOpFunctionCall:
    case SpvOpVariable:
    case SpvOpLoopMerge:
    case SpvOpBranchConditional:
    case SpvOpCopyObject:
    case SpvOpCopyLogical:
        return 4;
    case SpvOpStore:
    case SpvOpFunctionParameter:
    case SpvOpTypeInt:
    case SpvOpSwitch:
    case SpvOpPhi:
        return 3;
    default:
        break;
    }
    bool result, type;
    SpvHasResultAndType((SpvOp)op, &result, &type);
    const bool more = hg_spirv_is_decoration(op) || op == SpvOpBranch ||
                      op == SpvOpSelectionMerge || op == SpvOpReturnValue;
    return 1 + (uint32_t)result + (uint32_t)type + more;
}

static void read_function(struct opt *o, const uint32_t *i, struct opt_function *f)
{
    switch (hg_spirv_op(i)) {
    case SpvOpFunction:
        *f = (struct opt_function){.id = i[2], .begin = i};
        opt_id(o, i[2])->function = (uint32_t)(f - o->functions) + 1;
        break;
    case SpvOpLabel:
        f->entry = f->entry == NULL ? i : f->entry;
        break;
    case SpvOpFunctionEnd:
        f->end = i;
        o->failed |= f->begin == NULL || f->entry == NULL;
        o->function_count++;
        break;
    default:
        break;
    }
}

// Where each id is made, and where functions begin and end.
static void read_instructions(struct opt *o)
{
    o->first_function = o->count;
    for (size_t at = HG_SPIRV_HEADER_WORDS; at < o->count && !o->failed;
         at += hg_spirv_length(o->words + at)) {
        const uint32_t *i = o->words + at, op = hg_spirv_op(i), length = hg_spirv_length(i);
        bool result, type;
        o->failed |= length > o->count - at || length < least_length(op);
        if (o->failed)
            return;
        SpvHasResultAndType((SpvOp)op, &result, &type);
        if (result)
            opt_id(o, i[type ? 2 : 1])->def = i;
        if (op == SpvOpFunction && o->first_function == o->count)
            o->first_function = at;
        if (at < o->first_function)
            read_global(o, i);
        else
            read_function(o, i, &o->functions[o->function_count]);
    }
}

void opt_read_module(struct opt *o)
{
    read_instructions(o);
    for (uint32_t k = 0; k < o->function_count && !o->failed; k++)
        analyse(o, &o->functions[k]);
}
