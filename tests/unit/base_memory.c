// alloc.h, arena.h, checked.h, refbuf.h: limits, overflow, the failing allocation.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "base/arena.h"
#include "base/checked.h"
#include "base/refbuf.h"

// ---- checked.h ---------------------------------------------------------------------------------

static void test_checked_sums(void **state)
{
    (void)state;
    size_t out = 7;
    assert_true(hg_add_size(SIZE_MAX - 1, 1, &out));
    assert_true(out == SIZE_MAX);
    assert_false(hg_add_size(SIZE_MAX, 1, &out));
    assert_int_equal(out, 0);
    assert_true(hg_mul_size(SIZE_MAX / 2, 2, &out));
    assert_true(out == SIZE_MAX - 1);
    out = 7;
    assert_false(hg_mul_size(SIZE_MAX / 2 + 1, 2, &out));
    assert_int_equal(out, 0);
    assert_true(hg_mul_size(0, SIZE_MAX, &out));
    assert_int_equal(out, 0);
    uint64_t wide = 7;
    assert_true(hg_add_u64(UINT64_MAX, 0, &wide));
    assert_true(wide == UINT64_MAX);
    assert_false(hg_add_u64(UINT64_MAX, UINT64_MAX, &wide));
    assert_true(wide == 0);
    wide = 7;
    assert_false(hg_mul_u64(UINT64_C(1) << 32, UINT64_C(1) << 32, &wide));
    assert_true(wide == 0);
    assert_true(hg_mul_u64(UINT32_MAX, UINT32_MAX, &wide));
    assert_true(wide == UINT64_C(0xfffffffe00000001));
}

static void test_checked_ranges(void **state)
{
    (void)state;
    assert_true(hg_range_ok(0, 0, 0));
    assert_true(hg_range_ok(10, 0, 10));
    assert_true(hg_range_ok(4, 6, 10));
    assert_false(hg_range_ok(4, 7, 10));
    assert_false(hg_range_ok(11, 0, 10));
    assert_false(hg_range_ok(UINT64_MAX, 2, 10)); // would wrap to 1
    assert_false(hg_range_ok(2, UINT64_MAX, 10));
    assert_true(hg_range_ok(0, UINT64_MAX, UINT64_MAX));
}

static void test_checked_alignment(void **state)
{
    (void)state;
    size_t out;
    assert_true(hg_align_size(0, 16, &out) && out == 0);
    assert_true(hg_align_size(1, 16, &out) && out == 16);
    assert_true(hg_align_size(16, 16, &out) && out == 16);
    assert_true(hg_align_size(17, 1, &out) && out == 17);
    assert_true(hg_align_size(SIZE_MAX - 15, 16, &out));
    assert_true(out == SIZE_MAX - 15);
    out = 7;
    assert_false(hg_align_size(SIZE_MAX - 14, 16, &out));
    assert_int_equal(out, 0);
}

// ---- alloc.h -----------------------------------------------------------------------------------

static bool is_zero(const void *data, size_t size)
{
    for (size_t i = 0; i < size; i++)
        if (((const unsigned char *)data)[i])
            return false;
    return true;
}

static void test_alloc_shapes(void **state)
{
    (void)state;
    assert_null(hg_calloc(SIZE_MAX / 2, 3));
    assert_null(hg_calloc(1, (size_t)PTRDIFF_MAX + 1));
    void *a = hg_calloc(0, 8), *b = hg_calloc(8, 0);
    assert_non_null(a);
    assert_non_null(b);
    assert_ptr_not_equal(a, b);
    hg_free(a);
    hg_free(b);
    for (size_t align = sizeof(void *); align <= 4096; align *= 2) {
        unsigned char *p = hg_calloc_aligned(align, 2 * align);
        assert_non_null(p);
        assert_int_equal((uintptr_t)p % align, 0);
        assert_true(is_zero(p, 2 * align));
        hg_free(p);
    }
    hg_free(NULL);
}

static void test_realloc_failure_keeps_the_block(void **state)
{
    (void)state;
    char *text = hg_strdup("keep");
    assert_non_null(text);
    assert_null(hg_realloc(text, SIZE_MAX, 2));
    assert_string_equal(text, "keep");
    hg_alloc_fail_at(1);
    assert_null(hg_realloc(text, 100, 1));
    hg_alloc_fail_at(0);
    assert_string_equal(text, "keep");
    text = hg_realloc(text, 100, 1);
    assert_string_equal(text, "keep");
    hg_free(text);
}

static void test_strings(void **state)
{
    (void)state;
    char *a = hg_strndup("abcdef", 3), *b = hg_strndup("ab", 100), *c = hg_strndup("x", 0);
    assert_string_equal(a, "abc");
    assert_string_equal(b, "ab");
    assert_string_equal(c, "");
    hg_free(a);
    hg_free(b);
    hg_free(c);
}

static void test_grow(void **state)
{
    (void)state;
    uint32_t *items = NULL;
    size_t capacity = 0, moves = 0;
    for (uint32_t i = 0; i < 10000; i++) {
        size_t before = capacity;
        assert_int_equal(hg_grow(&items, &capacity, i + 1, sizeof *items), HG_OK);
        assert_true(capacity > i);
        moves += capacity != before;
        items[i] = i;
    }
    assert_true(moves < 30); // geometric
    for (uint32_t i = 0; i < 10000; i++)
        assert_int_equal(items[i], i);
    uint32_t *old = items;
    size_t old_capacity = capacity;
    assert_int_equal(hg_grow(&items, &capacity, SIZE_MAX, sizeof *items), HG_E_NOMEM);
    assert_int_equal(hg_grow(&items, &capacity, SIZE_MAX / 8, sizeof *items), HG_E_NOMEM);
    hg_alloc_fail_at(1);
    assert_int_equal(hg_grow(&items, &capacity, capacity + 1, sizeof *items), HG_E_NOMEM);
    hg_alloc_fail_at(0);
    assert_ptr_equal(items, old);
    assert_int_equal(capacity, old_capacity);
    hg_free(items);
}

static void test_fail_at(void **state)
{
    (void)state;
    hg_alloc_fail_at(3);
    for (int i = 1; i <= 5; i++) {
        void *p = hg_calloc(1, 1);
        assert_int_equal(p == NULL, i == 3); // once, and not again
        hg_free(p);
    }
    assert_int_equal(hg_alloc_count(), 5);
    hg_alloc_fail_at(0);
    assert_int_equal(hg_alloc_count(), 0);
    void *p = hg_calloc(1, 1);
    assert_non_null(p);
    hg_free(p);
}

// ---- arena.h -----------------------------------------------------------------------------------

static void test_arena_limit(void **state)
{
    (void)state;
    struct hg_arena arena = {.limit_bytes = 64};
    assert_non_null(hg_arena_alloc(&arena, 1, 1)); // 16 with its padding
    assert_int_equal(arena.used_bytes, 16);
    assert_null(hg_arena_alloc(&arena, 1, 49));
    assert_int_equal(arena.used_bytes, 16);
    assert_non_null(hg_arena_alloc(&arena, 3, 16));
    assert_int_equal(arena.used_bytes, 64);
    assert_null(hg_arena_alloc(&arena, 0, 1));
    hg_arena_finish(&arena);
    assert_int_equal(arena.used_bytes, 0);
    assert_int_equal(arena.limit_bytes, 64);
    assert_non_null(hg_arena_alloc(&arena, 1, 64)); // usable again
    hg_arena_finish(&arena);
    hg_arena_finish(&arena);
}

static void test_arena_overflow(void **state)
{
    (void)state;
    struct hg_arena arena = {0};
    assert_null(hg_arena_alloc(&arena, SIZE_MAX, 2));
    assert_null(hg_arena_alloc(&arena, 1, SIZE_MAX));
    assert_null(hg_arena_alloc(&arena, 1, SIZE_MAX - 32));
    assert_null(hg_arena_strndup(&arena, "x", SIZE_MAX));
    assert_int_equal(arena.used_bytes, 0);
    hg_alloc_fail_at(1);
    assert_null(hg_arena_alloc(&arena, 1, 1));
    hg_alloc_fail_at(0);
    assert_int_equal(arena.used_bytes, 0);
    hg_arena_finish(&arena);
}

// Blocks of all sizes, each filled with its own number, none touched by another.
static void test_arena_blocks(void **state)
{
    (void)state;
    enum { COUNT = 400 };
    struct hg_arena arena = {0};
    unsigned char *blocks[COUNT];
    size_t sizes[COUNT];
    for (size_t i = 0; i < COUNT; i++) {
        sizes[i] = i % 50 == 7 ? 100000 + i : i * 37 % 4000;
        blocks[i] = hg_arena_alloc(&arena, sizes[i], 1);
        assert_non_null(blocks[i]);
        assert_int_equal((uintptr_t)blocks[i] % 16, 0);
        assert_true(is_zero(blocks[i], sizes[i]));
        memset(blocks[i], (int)(i & 255), sizes[i]);
    }
    for (size_t i = 0; i < COUNT; i++)
        for (size_t n = 0; n < sizes[i]; n++)
            assert_int_equal(blocks[i][n], i & 255);
    char *text = hg_arena_strndup(&arena, "hello", 4);
    assert_string_equal(text, "hell");
    hg_arena_finish(&arena);
}

// ---- refbuf.h ----------------------------------------------------------------------------------

static void test_refbuf(void **state)
{
    (void)state;
    struct hg_refbuf *buf = hg_refbuf_create(100);
    assert_non_null(buf);
    assert_int_equal((uintptr_t)buf->data % 64, 0);
    assert_int_equal(buf->size, 100);
    assert_true(is_zero(buf->data, 100));
    assert_ptr_equal(hg_refbuf_ref(buf), buf);
    hg_refbuf_unref(buf);
    buf->data[99] = 1; // still alive
    hg_refbuf_unref(buf);
    hg_refbuf_unref(NULL);
    assert_null(hg_refbuf_create(SIZE_MAX));
    assert_null(hg_refbuf_create(SIZE_MAX - 100));
    buf = hg_refbuf_create(0);
    assert_non_null(buf);
    hg_refbuf_unref(buf);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_checked_sums),
        cmocka_unit_test(test_checked_ranges),
        cmocka_unit_test(test_checked_alignment),
        cmocka_unit_test(test_alloc_shapes),
        cmocka_unit_test(test_realloc_failure_keeps_the_block),
        cmocka_unit_test(test_strings),
        cmocka_unit_test(test_grow),
        cmocka_unit_test(test_fail_at),
        cmocka_unit_test(test_arena_limit),
        cmocka_unit_test(test_arena_overflow),
        cmocka_unit_test(test_arena_blocks),
        cmocka_unit_test(test_refbuf),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
