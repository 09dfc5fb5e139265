// helio bench against a stand-in of helio-bench.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "tests/unit/client/cli_harness.h"

static void test_bench(void **state)
{
    (void)state;
    expect_run(0, "{\"ok\":1}", "", "$HELIO bench realtime");
    expect_run(0, "\"done\":2,\"total\":2", "", "$HELIO bench realtime --progress json");
    expect_run(0, NULL, "", "$HELIO bench realtime --json bench.json");
    expect_file("bench.json", "{\"ok\":1}");
    // Names of files that are there become absolute.
    expect_run(0, "/s.gltf\"", "", "$HELIO bench echo --options '{\"scene\":\"s.gltf\"}'");
    expect_run(2, "no benchmark of that name", "", "$HELIO bench nothing");
    expect_run(2, "is not a JSON object", "", "$HELIO bench realtime --options []");
    expect_run(2, "is not a folder", "", "$HELIO bench realtime --asset-root s.gltf");
    expect_run(7, "ended with exit code 0", "", "$HELIO bench silent --json none.json");
    expect_run(7, "was killed by signal 9", "", "$HELIO bench killed --json none.json");
    expect_run(7, "cannot start", "", "HELIO_BENCH=/nonexistent $HELIO bench realtime");
    expect_run(7, "something unexpected", "", "HELIO_BENCH=/bin/echo $HELIO bench realtime");
    expect_no_file("none.json");
    expect_run(7, "no answer in time", "", "$HELIO bench hangs --timeout 2");
    expect_file("stopped", "\n");
    harness_write(&h, "stopped", "", 0);
    // In the foreground: one signal. A second one, to the group, would kill at once.
    expect_run(
        8, "interrupted", "", "timeout --foreground --preserve-status -s INT 2 $HELIO bench hangs");
    expect_file("stopped", "\n");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_bench),
    };
    return cmocka_run_group_tests(tests, cli_setup, cli_teardown);
}
