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
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/refbuf.h"
#include "base/spill.h"

#define MIB ((size_t)1 << 20)

static char folder[64];
static int file = -1; // of the newest array, while `keeps_file`
static bool keeps_file;

// In place of the library's, which goes through this call as well.
int posix_fallocate(int fd, off_t offset, off_t size)
{
    if (keeps_file)
        file = dup(fd);
    return fallocate(fd, 0, offset, size) == 0 ? 0 : errno;
}

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
    hg_spill_begin(NULL);
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
    hg_spill_begin(NULL);
    for (uint32_t i = 0; i < ARRAYS; i++) {
        arrays[i] = hg_spill_calloc(size, 1);
        assert_non_null(arrays[i]);
        fill(arrays[i], size, i);
    }
    hg_spill_end();
    assert_true(resident_file_bytes() < before + 8 * MIB);
    hg_spill_begin(NULL);
    hg_spill_begin(NULL);
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

static void tell(void *user, const struct hg_spill_loss *loss)
{
    char text[256];
    const int n = snprintf(text, sizeof text, "%s|%s|%llu|%llu", loss->folder, loss->what,
        (unsigned long long)loss->offset, (unsigned long long)loss->bytes);
    _exit(write(*(int *)user, text, (size_t)n) == n ? 42 : 1);
}

// Looks at byte `offset` of an array whose file has lost all from MIB on.
static int look_at_lost(size_t offset, int out)
{
    keeps_file = true;
    hg_spill_begin("a name");
    const volatile uint8_t *array = hg_spill_calloc(4 * MIB, 1);
    hg_spill_end();
    if (array == NULL || file < 0 || ftruncate(file, (off_t)MIB) != 0)
        return 2;
    hg_spill_watch(tell, &out);
    return array[offset];
}

// How a process ends that looks there, and what was told.
static int end_of_looking(size_t offset, char *text, size_t size)
{
    int ends[2], how;
    assert_int_equal(pipe(ends), 0);
    const pid_t child = fork();
    if (child == 0)
        _exit(look_at_lost(offset, ends[1]));
    close(ends[1]);
    const ssize_t n = read(ends[0], text, size - 1);
    close(ends[0]);
    text[n > 0 ? n : 0] = 0;
    assert_int_equal(waitpid(child, &how, 0), child);
    return how;
}

static void test_lost_pages_are_told(void **state)
{
    (void)state;
    char text[256], expected[256];
    int how = end_of_looking(MIB - 1, text, sizeof text); // what is there is there
    assert_true(WIFEXITED(how) && WEXITSTATUS(how) == 0);
    assert_string_equal(text, "");
    how = end_of_looking(2 * MIB + 5, text, sizeof text);
    assert_true(WIFEXITED(how) && WEXITSTATUS(how) == 42);
    snprintf(expected, sizeof expected, "%s|a name|%zu|%zu", folder, 2 * MIB + 5, 4 * MIB);
    assert_string_equal(text, expected);
}

// SIGBUS that has nothing to do with arrays ends the process as it did.
static void test_other_signals_stay(void **state)
{
    (void)state;
    int how, none = -1;
    const pid_t child = fork();
    if (child == 0) {
        signal(SIGBUS, SIG_DFL);
        hg_spill_watch(tell, &none);
        raise(SIGBUS);
        _exit(0);
    }
    assert_int_equal(waitpid(child, &how, 0), child);
    assert_true(WIFSIGNALED(how) && WTERMSIG(how) == SIGBUS);
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
        cmocka_unit_test_setup_teardown(test_lost_pages_are_told, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_other_signals_stay, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
