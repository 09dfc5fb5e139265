#include "tests/support/check.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

void test_ok(enum hg_status status, const struct hg_error *err)
{
    char text[1024] = "";
    if (status == HG_OK)
        return;
    if (err)
        hg_error_format(err, text, sizeof text);
    fail_msg("%s: %s", hg_status_name(status), text);
}
