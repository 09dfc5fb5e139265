#include "tests/support/test_data.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

static size_t skipped;

static const char *set_root(void)
{
    const char *root = getenv("HELIO_TEST_DATA");
    return root && root[0] ? root : NULL;
}

bool test_data_is_required(void)
{
    const char *ci = getenv("CI");
    return set_root() != NULL || (ci && strcmp(ci, "true") == 0);
}

const char *test_data_find(const char *relative)
{
    static char paths[4][4096];
    static unsigned next;
    const char *root = set_root();
    char *path = paths[next++ % 4];
    snprintf(path, sizeof paths[0], "%s/%s", root ? root : TEST_DATA_DEFAULT, relative);
    if (access(path, R_OK) == 0)
        return path;
    printf(
        "%s: test data is missing: %s\n", test_data_is_required() ? "FAILED" : "SKIPPED", relative);
    fflush(stdout);
    return NULL;
}

const char *test_data(const char *relative)
{
    const char *path = test_data_find(relative);
    if (path)
        return path;
    if (test_data_is_required())
        fail_msg("test data is missing: %s", relative);
    skipped++;
    skip();
    return NULL;
}

int test_data_exit(int failed, size_t count)
{
    if (failed)
        return failed;
    return skipped > 0 && skipped >= count ? TEST_SKIPPED : 0;
}
