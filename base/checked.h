// checked.h - size arithmetic that cannot wrap.
// Floor 0. Each returns false (and leaves *out 0) on overflow.
#ifndef HG_BASE_CHECKED_H
#define HG_BASE_CHECKED_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

static inline bool hg_add_size(size_t a, size_t b, size_t *out)
{
    if (!__builtin_add_overflow(a, b, out))
        return true;
    *out = 0;
    return false;
}

static inline bool hg_mul_size(size_t a, size_t b, size_t *out)
{
    if (!__builtin_mul_overflow(a, b, out))
        return true;
    *out = 0;
    return false;
}

static inline bool hg_add_u64(uint64_t a, uint64_t b, uint64_t *out)
{
    if (!__builtin_add_overflow(a, b, out))
        return true;
    *out = 0;
    return false;
}

static inline bool hg_mul_u64(uint64_t a, uint64_t b, uint64_t *out)
{
    if (!__builtin_mul_overflow(a, b, out))
        return true;
    *out = 0;
    return false;
}

// True when [offset, offset + length) lies inside [0, total). Never wraps.
static inline bool hg_range_ok(uint64_t offset, uint64_t length, uint64_t total)
{
    return offset <= total && length <= total - offset;
}

// Rounds up to a power-of-two alignment; false on overflow.
static inline bool hg_align_size(size_t value, size_t align, size_t *out)
{
    if (!hg_add_size(value, align - 1, out))
        return false;
    *out &= ~(align - 1);
    return true;
}

#endif
