// handle.h: generations, limits, iteration.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "base/handle.h"

static int objects[1000];

static void test_find_and_remove(void **state)
{
    (void)state;
    struct hg_handles table = {0};
    uint64_t a, b;
    assert_null(hg_handle_find(&table, 0));
    assert_null(hg_handle_find(&table, 1));
    assert_int_equal(hg_handle_add(&table, &objects[0], &a), HG_OK);
    assert_int_equal(hg_handle_add(&table, &objects[1], &b), HG_OK);
    assert_true(a != 0 && b != 0 && a != b);
    assert_ptr_equal(hg_handle_find(&table, a), &objects[0]);
    assert_ptr_equal(hg_handle_find(&table, b), &objects[1]);
    assert_ptr_equal(hg_handle_remove(&table, a), &objects[0]);
    assert_null(hg_handle_remove(&table, a));
    assert_null(hg_handle_find(&table, a));
    assert_ptr_equal(hg_handle_find(&table, b), &objects[1]);
    hg_handles_finish(&table);
    assert_null(hg_handle_find(&table, b));
    hg_handles_finish(&table);
}

static void test_freed_handle_never_finds_the_next(void **state)
{
    (void)state;
    struct hg_handles table = {0};
    uint64_t old[100];
    for (int i = 0; i < 100; i++) {
        assert_int_equal(hg_handle_add(&table, &objects[i], &old[i]), HG_OK);
        assert_int_equal((uint32_t)old[i], (uint32_t)old[0]); // the slot is used again
        for (int n = 0; n < i; n++)
            assert_null(hg_handle_find(&table, old[n]));
        assert_ptr_equal(hg_handle_remove(&table, old[i]), &objects[i]);
    }
    assert_int_equal(table.count, 1);
    hg_handles_finish(&table);
}

static void test_foreign_handles(void **state)
{
    (void)state;
    struct hg_handles table = {0};
    uint64_t handle;
    assert_int_equal(hg_handle_add(&table, &objects[0], &handle), HG_OK);
    assert_null(hg_handle_find(&table, handle + 1));
    assert_null(hg_handle_find(&table, handle + (UINT64_C(1) << 32)));
    assert_null(hg_handle_find(&table, handle & UINT32_MAX));
    assert_null(hg_handle_find(&table, UINT64_MAX));
    assert_null(hg_handle_remove(&table, handle + 1));
    assert_ptr_equal(hg_handle_find(&table, handle), &objects[0]);
    hg_handles_finish(&table);
}

// A slot whose generations are used up is never used again.
static void test_generations_end(void **state)
{
    (void)state;
    struct hg_handles table = {0};
    uint64_t handle, next;
    assert_int_equal(hg_handle_add(&table, &objects[0], &handle), HG_OK);
    assert_ptr_equal(hg_handle_remove(&table, handle), &objects[0]);
    table.slots[0].generation = UINT32_MAX;
    assert_int_equal(hg_handle_add(&table, &objects[1], &handle), HG_OK);
    assert_int_equal((uint32_t)handle, 1);
    assert_int_equal(handle >> 32, UINT32_MAX);
    assert_ptr_equal(hg_handle_remove(&table, handle), &objects[1]);
    assert_int_equal(hg_handle_add(&table, &objects[2], &next), HG_OK);
    assert_int_equal((uint32_t)next, 2);
    assert_null(hg_handle_find(&table, handle));
    hg_handles_finish(&table);
}

static void test_limits(void **state)
{
    (void)state;
    struct hg_handles table = {.limit = 2};
    uint64_t a, b, c = 5;
    assert_int_equal(hg_handle_add(&table, &objects[0], &a), HG_OK);
    assert_int_equal(hg_handle_add(&table, &objects[1], &b), HG_OK);
    assert_int_equal(hg_handle_add(&table, &objects[2], &c), HG_E_LIMIT);
    assert_int_equal(c, 0);
    assert_non_null(hg_handle_remove(&table, a));
    assert_int_equal(hg_handle_add(&table, &objects[2], &c), HG_OK);
    hg_handles_finish(&table);
    assert_int_equal(table.limit, 2);
    hg_alloc_fail_at(1);
    assert_int_equal(hg_handle_add(&table, &objects[0], &a), HG_E_NOMEM);
    hg_alloc_fail_at(0);
    assert_int_equal(a, 0);
    assert_int_equal(hg_handle_add(&table, &objects[0], &a), HG_OK);
    hg_handles_finish(&table);
}

static void test_iteration(void **state)
{
    (void)state;
    struct hg_handles table = {0};
    uint64_t handles[1000];
    for (int i = 0; i < 1000; i++)
        assert_int_equal(hg_handle_add(&table, &objects[i], &handles[i]), HG_OK);
    for (int i = 0; i < 1000; i += 3)
        assert_non_null(hg_handle_remove(&table, handles[i]));
    uint32_t cursor = 0;
    uint64_t handle;
    int seen = 0;
    for (void *object; (object = hg_handle_next(&table, &cursor, &handle)); seen++) {
        assert_ptr_equal(hg_handle_find(&table, handle), object);
        assert_int_not_equal(((int *)object - objects) % 3, 0);
    }
    assert_int_equal(seen, 666);
    assert_int_equal(table.used, 666);
    // Removing while iterating is allowed.
    cursor = 0;
    while (hg_handle_next(&table, &cursor, &handle))
        assert_non_null(hg_handle_remove(&table, handle));
    assert_int_equal(table.used, 0);
    hg_handles_finish(&table);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_find_and_remove),
        cmocka_unit_test(test_freed_handle_never_finds_the_next),
        cmocka_unit_test(test_foreign_handles),
        cmocka_unit_test(test_generations_end),
        cmocka_unit_test(test_limits),
        cmocka_unit_test(test_iteration),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
