#include "tests/support/folder.h"

#include <errno.h>
#include <ftw.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

bool test_folder_make(char path[TEST_FOLDER_MAX], const char *purpose)
{
    const char *base = getenv("TMPDIR");
    if (!base || base[0] != '/')
        base = "/tmp";
    if (snprintf(path, TEST_FOLDER_MAX, "%s/helio-%s-XXXXXX", base, purpose) >= TEST_FOLDER_MAX) {
        base = "/tmp"; // names of sockets have room for no more
        snprintf(path, TEST_FOLDER_MAX, "%s/helio-%s-XXXXXX", base, purpose);
    }
    if (mkdtemp(path))
        return true;
    fprintf(stderr, "%s: no folder can be made there: %s\n", base, strerror(errno));
    path[0] = 0;
    return false;
}

static int remove_one(const char *path, const struct stat *info, int kind, struct FTW *walk)
{
    (void)info, (void)kind, (void)walk;
    return remove(path);
}

bool test_folder_remove(const char *path)
{
    if (!path[0])
        return true;
    nftw(path, remove_one, 16, FTW_DEPTH | FTW_PHYS); // ends early when others remove too
    return access(path, F_OK) != 0;
}

void test_file_write(const char *path, const void *data, size_t size)
{
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(data, 1, size, file), size);
    assert_int_equal(fclose(file), 0);
}

void test_text_write(const char *folder, const char *name, const char *text)
{
    char path[512];
    assert_in_range(snprintf(path, sizeof path, "%s/%s", folder, name), 0, sizeof path - 1);
    test_file_write(path, text, strlen(text));
}
