// The program helio as a node of a farm, against fake peers: daemons that pace and drain.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <string.h>

#include "tests/unit/client/cli_harness.h"

// Frames that have taken the pixels of a second are asked for again when the daemon has more.
static void test_paced_frames(void **state)
{
    (void)state;
    expect_run(0, "\"stage\":\"waiting for max-pixel-rate\"", "paced=3",
        "$HELIO render s.gltf -o pa-#.png --frames 1-2 --progress json");
    expect_file("pa-2.png", "frame");
    static const char script[] = "load s.gltf\nframe pb.png\n";
    harness_write(&h, "paced.hs", script, strlen(script));
    expect_run(0, NULL, "paced=2", "$HELIO run paced.hs");
    expect_file("pb.png", "frame");
}

// A daemon that stops during one frame has films of the next ones kept, too.
static void test_drain_over_frames(void **state)
{
    (void)state;
    expect_run(7, "no answer", "drain=4000",
        "$HELIO render s.gltf -o dr-#.png --frames 1-2 --mode path --timeout 4");
    expect_file("dr-1.png", "frame");
    expect_file("dr-2.png.checkpoint", "HGCK");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_paced_frames),
        cmocka_unit_test(test_drain_over_frames),
    };
    return cmocka_run_group_tests(tests, cli_setup, cli_teardown);
}
