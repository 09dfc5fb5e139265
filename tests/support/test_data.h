// test_data.h - files that tests need and the project does not hold (docs/testing.md says where
// they come from): below $HELIO_TEST_DATA, or else ../shared/data beside the source tree.
//
// A missing file fails the test where $HELIO_TEST_DATA is set or CI=true; elsewhere the test is
// skipped and prints a line that the summary of the suite repeats.
#ifndef HG_TESTS_SUPPORT_TEST_DATA_H
#define HG_TESTS_SUPPORT_TEST_DATA_H

#include <stdbool.h>
#include <stddef.h>

// Exit code of a test program of which nothing could run (ctest: SKIP_RETURN_CODE).
#define TEST_SKIPPED 77

// True where missing test data is a failure.
bool test_data_is_required(void);

// The path of a file or folder of the test data; NULL, with a line on stdout, when it is missing.
// Valid until the fourth call after this one.
const char *test_data_find(const char *relative);

// The same in a cmocka test, which ends (skipped or failed) when it is missing. Call it before
// anything is opened.
const char *test_data(const char *relative);

// The exit code of a program: `failed` of its `count` cmocka tests failed, some were skipped.
int test_data_exit(int failed, size_t count);

// cmocka_run_group_tests for programs in which tests may be skipped.
#define test_run_group(tests, setup, teardown)                                                     \
    test_data_exit(                                                                                \
        cmocka_run_group_tests(tests, setup, teardown), sizeof(tests) / sizeof((tests)[0]))

#endif
