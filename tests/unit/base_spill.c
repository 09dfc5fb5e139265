// spill.h: contents, sharing, growth, pages that go, files that leave nothing, folders that do not
// do. Files are made below the working folder: a folder for temporary files may be in memory.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include <dirent.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/refbuf.h"
#include "base/spill.h"

#define MIB ((size_t)1 << 20)

static char folder[64];

static int set_up(void **state)
{
    (void)state;
    snprintf(folder, sizeof folder, "spill-XXXXXX");
    if (mkdtemp(folder) == NULL)
        return -1;
    hg_spill_set_folder(folder);
    return 0;
}

// Nothing may lie in the folder.
static int tear_down(void **state)
{
    (void)state;
    hg_spill_set_folder(NULL);
    return rmdir(folder);
}

static struct hg_spill_stats stats(void)
{
    struct hg_spill_stats s;
    hg_spill_stats(&s);
    return s;
}

static void fill(uint8_t *data, size_t size, uint32_t seed)
{
    for (size_t i = 0; i < size; i++)
        data[i] = (uint8_t)((i * 2654435761u + seed) >> 13);
}

static bool is_filled(const uint8_t *data, size_t size, uint32_t seed)
{
    for (size_t i = 0; i < size; i++)
        if (data[i] != (uint8_t)((i * 2654435761u + seed) >> 13))
            return false;
    return true;
}

static size_t resident_file_bytes(void)
{
    unsigned long shared = 0;
    FILE *f = fopen("/proc/self/statm", "r");
    assert_non_null(f);
    assert_int_equal(fscanf(f, "%*u %*u %lu", &shared), 1);
    fclose(f);
    return shared * (size_t)sysconf(_SC_PAGESIZE);
}

static void test_small_arrays_are_in_memory(void **state)
{
    (void)state;
    uint8_t *small = hg_spill_calloc(HG_SPILL_FROM_BYTES - 1, 1);
    assert_non_null(small);
    assert_int_equal(stats().arrays, 0);
    assert_false(hg_spill_share(small));
    assert_false(hg_spill_share(NULL));
    hg_free(small);
    assert_null(hg_spill_calloc(SIZE_MAX / 2, 3));
}

static void test_contents(void **state)
{
    (void)state;
    const size_t sizes[] = {HG_SPILL_FROM_BYTES, 3 * MIB + 5, MIB};
    uint8_t *arrays[3];
    for (int i = 0; i < 3; i++) {
        arrays[i] = hg_spill_calloc(sizes[i], 1);
        assert_non_null(arrays[i]);
        for (size_t k = 0; k < sizes[i]; k++)
            assert_int_equal(arrays[i][k], 0);
        fill(arrays[i], sizes[i], (uint32_t)i);
    }
    assert_int_equal(stats().arrays, 3);
    assert_int_equal(stats().bytes, sizes[0] + sizes[1] + sizes[2]);
    hg_spill_begin();
    hg_spill_end();
    hg_free(arrays[1]);
    assert_int_equal(stats().arrays, 2);
    assert_true(is_filled(arrays[0], sizes[0], 0));
    assert_true(is_filled(arrays[2], sizes[2], 2));
    hg_free(arrays[2]);
    hg_free(arrays[0]);
    assert_int_equal(stats().bytes, 0);
}

static void test_growing(void **state)
{
    (void)state;
    uint8_t *array = hg_spill_calloc(MIB, 1);
    assert_non_null(array);
    fill(array, MIB, 7);
    array = hg_realloc(array, 5 * MIB, 1);
    assert_non_null(array);
    assert_int_equal(stats().bytes, 5 * MIB);
    assert_true(is_filled(array, MIB, 7));
    array = hg_realloc(array, 100, 1);
    assert_non_null(array);
    assert_int_equal(stats().bytes, 0);
    assert_true(is_filled(array, 100, 7));
    hg_free(array);
}

static void test_sharing(void **state)
{
    (void)state;
    uint8_t *array = hg_spill_calloc(MIB, 1);
    assert_non_null(array);
    fill(array, MIB, 3);
    assert_true(hg_spill_share(array));
    assert_int_equal(stats().bytes, MIB);
    hg_free(array);
    assert_true(is_filled(array, MIB, 3));
    hg_free(array);
    assert_int_equal(stats().arrays, 0);
}

static void test_refbuf(void **state)
{
    (void)state;
    struct hg_refbuf *buf = hg_refbuf_create_spilled(2 * MIB);
    assert_non_null(buf);
    assert_int_equal(stats().arrays, 1);
    assert_int_equal((uintptr_t)buf->data % 64, 0);
    hg_refbuf_unref(buf);
    assert_int_equal(stats().arrays, 0);
}

// 160 MiB are written and read again: nothing of it is resident afterwards, and all is there.
static void test_pages_go(void **state)
{
    (void)state;
    enum { ARRAYS = 5 };
    const size_t size = 32 * MIB, before = resident_file_bytes();
    uint8_t *arrays[ARRAYS];
    hg_spill_begin();
    for (uint32_t i = 0; i < ARRAYS; i++) {
        arrays[i] = hg_spill_calloc(size, 1);
        assert_non_null(arrays[i]);
        fill(arrays[i], size, i);
    }
    hg_spill_end();
    assert_true(resident_file_bytes() < before + 8 * MIB);
    hg_spill_begin();
    hg_spill_begin();
    for (uint32_t i = 0; i < ARRAYS; i++)
        assert_true(is_filled(arrays[i], size, i));
    hg_spill_end();
    hg_spill_end();
    assert_true(resident_file_bytes() < before + 8 * MIB);
    for (uint32_t i = 0; i < ARRAYS; i++)
        hg_free(arrays[i]);
    assert_true(stats().peak_bytes >= ARRAYS * size);
}

static void test_folder_is_made(void **state)
{
    (void)state;
    assert_int_equal(rmdir(folder), 0);
    uint8_t *array = hg_spill_calloc(MIB, 1);
    assert_non_null(array);
    assert_int_equal(stats().arrays, 1);
    hg_free(array);
}

// In memory then, and counted.
static void expect_refused(void)
{
    const uint64_t before = stats().refused_bytes;
    uint8_t *array = hg_spill_calloc(MIB, 1);
    assert_non_null(array);
    assert_int_equal(stats().arrays, 0);
    assert_int_equal(stats().refused_bytes, before + MIB);
    fill(array, MIB, 1);
    array = hg_realloc(array, 2 * MIB, 1);
    assert_non_null(array);
    assert_true(is_filled(array, MIB, 1));
    hg_free(array);
}

static void test_no_folder(void **state)
{
    (void)state;
    char missing[128];
    snprintf(missing, sizeof missing, "%s/not/there", folder);
    hg_spill_set_folder(missing);
    expect_refused();
    hg_spill_set_folder("/proc/self/statm");
    expect_refused();
}

static void test_folder_in_memory(void **state)
{
    (void)state;
    hg_spill_set_folder("/dev/shm");
    expect_refused();
}

// Files may not become so large: as a full disk, found when the blocks are reserved.
static void test_full_disk(void **state)
{
    (void)state;
    struct rlimit old, none;
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &old), 0);
    none = old;
    none.rlim_cur = MIB / 2;
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &none), 0);
    expect_refused();
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &old), 0);
    uint8_t *array = hg_spill_calloc(MIB, 1); // there is room again
    assert_non_null(array);
    assert_int_equal(stats().arrays, 1);
    hg_free(array);
}

static void test_failing_allocations(void **state)
{
    (void)state;
    hg_alloc_fail_at(1);
    assert_null(hg_spill_calloc(MIB, 1));
    hg_alloc_fail_at(2);
    uint8_t *array = hg_spill_calloc(MIB, 1);
    assert_non_null(array);
    assert_null(hg_realloc(array, 2 * MIB, 1));
    hg_alloc_fail_at(0);
    assert_int_equal(stats().bytes, MIB);
    hg_free(array);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_small_arrays_are_in_memory, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_contents, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_growing, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_sharing, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_refbuf, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_pages_go, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_folder_is_made, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_no_folder, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_folder_in_memory, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_full_disk, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_failing_allocations, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
