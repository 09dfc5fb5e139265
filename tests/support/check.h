// check.h - ends a test with the reason when a call failed.
#ifndef HG_TESTS_SUPPORT_CHECK_H
#define HG_TESTS_SUPPORT_CHECK_H

#include "base/status.h"

// err may be NULL: the status alone is named.
void test_ok(enum hg_status status, const struct hg_error *err);

#endif
