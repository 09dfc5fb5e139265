// The program helio as a node of a farm, against fake peers: daemons that pace and drain, frames
// that several commands share, and the claims that they share them by.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/clock.h"
#include "client/cli/render/claim.h"
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
    assert_non_null(strstr(h.output, "helio: the session ends in 4 s: new disks\n"));
    assert_non_null(strstr(h.output, "helio: the administrator ann says: at noon\n"));
    expect_file("dr-1.png", "frame");
    expect_file("dr-2.png.checkpoint", "HGCK");
}

// All that are named, as with -F of Nuke and -f of Blender.
static void test_frames_given_twice(void **state)
{
    (void)state;
    expect_run(0, "helio: wrote 3 frames, ", NULL,
        "$HELIO render s.gltf -o tw-#.png --frames 1-2 --frames 5,2");
    expect_file("tw-1.png", "frame");
    expect_file("tw-5.png", "frame");
}

// Requests for formats with a frame rate carry that of the series.
static void test_frame_rates(void **state)
{
    (void)state;
    static const char *const rates[][2] = {{"", " rate=24/1"}, {"--fps 23.976", " rate=24000/1001"},
        {"--fps 29.97", " rate=30000/1001"}, {"--fps 12.5", " rate=12500/1000"}};
    char command[200];
    for (size_t i = 0; i < sizeof rates / sizeof *rates; i++) {
        snprintf(command, sizeof command,
            "rm -f logr; $HELIO render s.gltf -o ra-#.exr --frames 1 %s; grep frame_request logr",
            rates[i][0]);
        expect_run(0, rates[i][1], "log=logr", command);
    }
    expect_run(1, NULL, "log=logr",
        "rm -f logr; $HELIO render s.gltf -o ra.exr; $HELIO render s.gltf -o ra-#.png --frames 1; "
        "grep rate= logr");
}

// ---- shared frames -----------------------------------------------------------------------------

// A command that holds the claim of frame 1 of "NAME-#.png" and gets no frame; its process is $p.
#define HOLD(name)                                                                                 \
    "rm -f log" name "; FAKE='silent=frame_request log=log" name "' $HELIO render s.gltf -o " name \
    "-#.png --frames 1-3 --claim & p=$!; "                                                         \
    "until grep -qs frame_request log" name "; do kill -0 $p || exit 99; sleep 0.02; done; "

static void test_shared_frames(void **state)
{
    (void)state;
    expect_run(0, "8\n", "log=logs beat=2 alive=2",
        "one() { $HELIO render s.gltf -o sh-#.png --frames 1-8 --claim; }; "
        "one & a=$!; one & b=$!; one && wait $a && wait $b && grep -c frame_request logs");
    expect_file("sh-8.png", "frame");
    expect_run(2, "No such file", NULL, "ls sh-*.claim");
    expect_run(
        0, "wrote 0 of 8 frames", NULL, "$HELIO render s.gltf -o sh-#.png --frames 1-8 --claim");
}

static void test_claim_of_dead_process(void **state)
{
    (void)state;
    expect_run(0, "helio: wrote 3 frames, ", NULL,
        HOLD("de") "kill -KILL $p; wait $p; test -s de-1.png.claim || exit 98; "
                   "$HELIO render s.gltf -o de-#.png --frames 1-3 --claim");
    expect_file("de-1.png", "frame");
    expect_no_file("de-1.png.claim");
}

// The frames that are free are rendered meanwhile, and that of the other one when it dies.
static void test_claim_of_living_process(void **state)
{
    (void)state;
    expect_run(0, "helio: wrote 3 frames, ", NULL,
        HOLD("li") "$HELIO render s.gltf -o li-#.png --frames 1-3 --claim 2>saidli & q=$!; "
                   "until grep -q waiting saidli; do kill -0 $q || exit 98; sleep 0.02; done; "
                   "test -e li-3.png || exit 97; test -e li-1.png && exit 96; kill -KILL $p; "
                   "wait $q; code=$?; cat saidli; exit $code");
    assert_non_null(strstr(h.output, "waiting for 1 frame that other commands have claimed"));
    expect_file("li-1.png", "frame");
    expect_no_file("li-1.png.claim");
}

static void test_stopped_while_sharing(void **state)
{
    (void)state;
    expect_run(8, NULL, NULL, HOLD("st") "kill -TERM $p; wait $p");
    expect_no_file("st-1.png.claim"); // nothing is left of a command that was stopped
    harness_write(&h, "ot-2.png.claim", "elsewhere 5 0 other-boot\n", 25);
    expect_run(8, "(frame 2: elsewhere, process 5)", NULL,
        "$HELIO render s.gltf -o ot-#.png --frames 1-3 --claim 2>said & p=$!; "
        "until grep -q waiting said; do kill -0 $p || break; sleep 0.02; done; "
        "kill -TERM $p; wait $p; code=$?; cat said; exit $code");
    assert_non_null(strstr(h.output, "2 frames are written; the same command goes on"));
    expect_file("ot-2.png.claim", "elsewhere"); // of another machine, which may live
    expect_file("ot-3.png", "frame");
}

static void test_claim_usage(void **state)
{
    (void)state;
    expect_run(2, "--claim: needs --frames", NULL, "$HELIO render s.gltf -o a.png --claim");
    expect_run(2, "--claim: needs a file", NULL, "$HELIO render s.gltf -o - --frames 1-2 --claim");
    expect_run(2, "fc-1.png.claim: is a folder", NULL,
        "mkdir fc-1.png.claim; $HELIO render s.gltf -o fc-#.png --frames 1-2 --claim");
    expect_run(2, "--claim: frames of --denoise depend", NULL,
        "$HELIO render s.gltf -o a#.exr --mode path --denoise --frames 1-2 --claim");
}

// ---- leases ------------------------------------------------------------------------------------

// What another machine has claimed is taken over when it was not renewed for the length of a lease.
static void test_lease(void **state)
{
    (void)state;
    char output[256], path[300], owner[HG_CLI_CLAIM_OWNER_BYTES];
    struct hg_cli_claims c;
    struct hg_cli_claim_seen seen = {0};
    struct hg_error err = {0};
    bool held;
    snprintf(output, sizeof output, "%s/lease.png", h.folder);
    snprintf(path, sizeof path, "%s.claim", output);
    harness_write(&h, "lease.png.claim", "elsewhere 5 0 other-boot\n", 25);
    assert_int_equal(hg_cli_claims_init(&c, &err), HG_OK);
    assert_int_equal(hg_cli_claim_take(&c, output, &seen, &held, owner, &err), HG_OK);
    assert_false(held);
    assert_string_equal(owner, "elsewhere, process 5");
    seen.since_ns -= (HG_CLI_CLAIM_LEASE_S + 1) * UINT64_C(1000000000);
    const struct timespec renewed[2] = {{.tv_sec = 7}, {.tv_sec = 7}};
    assert_int_equal(utimensat(AT_FDCWD, path, renewed, 0), 0); // it lives: a lease begins
    assert_int_equal(hg_cli_claim_take(&c, output, &seen, &held, owner, &err), HG_OK);
    assert_false(held);
    seen.since_ns -= (HG_CLI_CLAIM_LEASE_S + 1) * UINT64_C(1000000000);
    assert_int_equal(hg_cli_claim_take(&c, output, &seen, &held, owner, &err), HG_OK);
    assert_true(held);
    expect_file("lease.png.claim", c.self);
    // One that another machine has taken over from this one is not removed.
    harness_write(&h, "lease.png.claim", "elsewhere 6 0 other-boot\n", 25);
    hg_cli_claim_release(&c);
    expect_file("lease.png.claim", "elsewhere 6");
    hg_cli_claims_finish(&c);
}

// An empty claim is of a process that died before it wrote its name: its lock is free, and it stays
// so.
static void test_empty_claim(void **state)
{
    (void)state;
    char output[256], path[300], owner[HG_CLI_CLAIM_OWNER_BYTES];
    struct hg_cli_claims c;
    struct hg_cli_claim_seen seen = {0};
    struct hg_error err = {0};
    bool held;
    snprintf(output, sizeof output, "%s/empty.png", h.folder);
    snprintf(path, sizeof path, "%s.claim", output);
    harness_write(&h, "empty.png.claim", "", 0);
    assert_int_equal(hg_cli_claims_init(&c, &err), HG_OK);
    assert_int_equal(hg_cli_claim_take(&c, output, &seen, &held, owner, &err), HG_OK);
    assert_false(held); // it may be about to be written
    const uint64_t later_ns = (HG_CLI_CLAIM_EMPTY_S + 1) * UINT64_C(1000000000);
    const int writer = open(path, O_RDWR | O_CLOEXEC);
    assert_int_equal(flock(writer, LOCK_EX), 0);
    seen.since_ns -= later_ns;
    assert_int_equal(hg_cli_claim_take(&c, output, &seen, &held, owner, &err), HG_OK);
    assert_false(held); // its process lives
    close(writer);
    assert_int_equal(hg_cli_claim_take(&c, output, &seen, &held, owner, &err), HG_OK);
    assert_true(held);
    expect_file("empty.png.claim", c.self);
    hg_cli_claims_finish(&c);
    expect_no_file("empty.png.claim");
}

// Of this machine's processes the lock counts, not the time: it is held as long as they live.
static void test_own_lock(void **state)
{
    (void)state;
    char output[256], owner[HG_CLI_CLAIM_OWNER_BYTES];
    struct hg_cli_claims a, b;
    struct hg_cli_claim_seen seen = {0};
    struct hg_error err = {0};
    bool held;
    snprintf(output, sizeof output, "%s/lock.png", h.folder);
    assert_int_equal(hg_cli_claims_init(&a, &err), HG_OK);
    assert_int_equal(hg_cli_claims_init(&b, &err), HG_OK);
    assert_int_equal(hg_cli_claim_take(&a, output, &seen, &held, owner, &err), HG_OK);
    assert_true(held);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(hg_cli_claim_take(&b, output, &seen, &held, owner, &err), HG_OK);
        assert_false(held);
        seen.since_ns = 1;
    }
    hg_cli_claim_release(&a);
    expect_no_file("lock.png.claim");
    assert_int_equal(hg_cli_claim_take(&b, output, &seen, &held, owner, &err), HG_OK);
    assert_true(held);
    hg_cli_claims_finish(&a);
    hg_cli_claims_finish(&b);
    expect_no_file("lock.png.claim");
}

// ---- baking ------------------------------------------------------------------------------------

static void test_bake_without_room(void **state)
{
    (void)state;
    expect_run(6, "2 of the scene's packs and files are not there", "absent=1",
        "$HELIO bake s.gltf -o baked");
    expect_run(3, "gone.gltf", NULL, "$HELIO bake gone.gltf -o unmade");
    expect_run(1, NULL, NULL, "test -e unmade");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_paced_frames),
        cmocka_unit_test(test_drain_over_frames),
        cmocka_unit_test(test_frames_given_twice),
        cmocka_unit_test(test_frame_rates),
        cmocka_unit_test(test_shared_frames),
        cmocka_unit_test(test_claim_of_dead_process),
        cmocka_unit_test(test_claim_of_living_process),
        cmocka_unit_test(test_stopped_while_sharing),
        cmocka_unit_test(test_claim_usage),
        cmocka_unit_test(test_bake_without_room),
        cmocka_unit_test(test_lease),
        cmocka_unit_test(test_empty_claim),
        cmocka_unit_test(test_own_lock),
    };
    return cmocka_run_group_tests(tests, cli_setup, cli_teardown);
}
