// spirv.c - constant folding of integer operations, and kinds of instructions.
#include "renderer/gpu/spirv.h"

#define SPV_ENABLE_UTILITY_CODE
#include <spirv/unified1/spirv.h>
// The header has it inline only, which in C is no definition.
extern void SpvHasResultAndType(SpvOp opcode, bool *has_result, bool *has_result_type);

#include "base/alloc.h"

bool hg_spirv_fold(uint32_t op, uint32_t a, uint32_t b, uint32_t *out)
{
    const int32_t x = (int32_t)a, y = (int32_t)b;
    switch (op) {
    case SpvOpIAdd:
        *out = a + b;
        return true;
    case SpvOpISub:
        *out = a - b;
        return true;
    case SpvOpIMul:
        *out = a * b;
        return true;
    case SpvOpUDiv:
        *out = b != 0 ? a / b : 0;
        return b != 0;
    case SpvOpUMod:
        *out = b != 0 ? a % b : 0;
        return b != 0;
    case SpvOpShiftLeftLogical:
        *out = b < 32 ? a << b : 0;
        return b < 32;
    case SpvOpShiftRightLogical:
        *out = b < 32 ? a >> b : 0;
        return b < 32;
    case SpvOpBitwiseAnd:
    case SpvOpLogicalAnd:
        *out = a & b;
        return true;
    case SpvOpBitwiseOr:
    case SpvOpLogicalOr:
        *out = a | b;
        return true;
    case SpvOpBitwiseXor:
        *out = a ^ b;
        return true;
    case SpvOpIEqual:
    case SpvOpLogicalEqual:
        *out = a == b;
        return true;
    case SpvOpINotEqual:
    case SpvOpLogicalNotEqual:
        *out = a != b;
        return true;
    case SpvOpULessThan:
        *out = a < b;
        return true;
    case SpvOpULessThanEqual:
        *out = a <= b;
        return true;
    case SpvOpUGreaterThan:
        *out = a > b;
        return true;
    case SpvOpUGreaterThanEqual:
        *out = a >= b;
        return true;
    case SpvOpSLessThan:
        *out = x < y;
        return true;
    case SpvOpSLessThanEqual:
        *out = x <= y;
        return true;
    case SpvOpSGreaterThan:
        *out = x > y;
        return true;
    case SpvOpSGreaterThanEqual:
        *out = x >= y;
        return true;
    default:
        return false;
    }
}

bool hg_spirv_is_note(uint32_t op)
{
    return op == SpvOpName || op == SpvOpMemberName || op == SpvOpLine || op == SpvOpNoLine ||
           op == SpvOpSource || op == SpvOpSourceContinued || op == SpvOpSourceExtension ||
           op == SpvOpString || op == SpvOpModuleProcessed;
}

bool hg_spirv_is_decoration(uint32_t op)
{
    return op == SpvOpDecorate || op == SpvOpMemberDecorate || op == SpvOpDecorateId ||
           op == SpvOpDecorateString || op == SpvOpMemberDecorateString ||
           op == SpvOpDecorationGroup || op == SpvOpGroupDecorate || op == SpvOpGroupMemberDecorate;
}

void hg_spirv_free(struct hg_spirv *spirv)
{
    hg_free(spirv->words);
    *spirv = (struct hg_spirv){0};
}
