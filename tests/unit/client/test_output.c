// The program helio against a fake worker: where its outputs go, and what it says about them.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tests/unit/client/harness.h"

static struct harness h;

// The command's exit code, and what it must (not) have written to its streams.
static void expect_run(int code, const char *text, const char * not, const char *command)
{
    int got = harness_run(&h, "%s", command);
    if (got != code)
        fail_msg("%s: exit %d instead of %d: %s", command, got, code, h.output);
    if (text && !strstr(h.output, text))
        fail_msg("%s: '%s' is not in: %s", command, text, h.output);
    if (not &&strstr(h.output, not ))
        fail_msg("%s: '%s' is in: %s", command, not, h.output);
}

static void expect_file(const char *name, const char *text)
{
    if (!harness_read(&h, name))
        fail_msg("%s is missing", name);
    if (!strstr(h.output, text))
        fail_msg("%s: '%s' is not in: %s", name, text, h.output);
}

// ---- streams -----------------------------------------------------------------------------------

static void test_standard_output(void **state)
{
    (void)state;
    expect_run(0, NULL, NULL, "$HELIO render s.gltf -o - 2>said >a.png");
    expect_file("a.png", "frame 1 as PNG8");
    expect_run(0, NULL, NULL, "$HELIO render s.gltf -o exr:- --exr float 2>said | cat >a.exr");
    expect_file("a.exr", "frame 1 as EXR_FLOAT");
    expect_run(0, NULL, NULL, "$HELIO render s.gltf -o jpg:/dev/stdout 2>said | cat >a.jpg");
    expect_file("a.jpg", "frame 1 as JPEG");
    expect_run(0, NULL, NULL, "$HELIO render s.gltf -o png:noending 2>said");
    expect_file("noending", "frame 1 as PNG8");
    expect_run(0, NULL, NULL, "$HELIO render s.gltf -o b.png --stats - 2>said | cat >b.json");
    expect_file("b.json", "\"client\"");
    assert_int_equal(h.output[0], '{');
    // what was in a file before stays: it is open, not replaced
    expect_run(0, NULL, NULL, "{ echo before; $HELIO render s.gltf -o -; } 2>said >c.txt");
    expect_file("c.txt", "before\n");
    assert_non_null(strstr(h.output, "frame 1 as PNG8"));
    // Frames come one after the other.
    expect_run(0, NULL, NULL, "$HELIO render s.gltf -o - --frames 1-3 2>said | cat >d.txt");
    expect_file("d.txt", "frame 3 ");
    assert_non_null(strstr(h.output, "frame 1 "));
    expect_run(2, "--stats: is the file of --output", NULL,
        "$HELIO render s.gltf -o - --stats /dev/stdout");
    expect_run(2, "--skip-existing: needs a file", NULL,
        "$HELIO render s.gltf -o - --frames 1-3 --skip-existing");
    expect_run(2, "png:NAME", NULL, "$HELIO render s.gltf -o /dev/stdout");
    expect_run(2, "/dev/fd/77: cannot write to it", NULL, "$HELIO render s.gltf -o png:/dev/fd/77");
}

static void test_pipes_and_links(void **state)
{
    (void)state;
    expect_run(0, NULL, NULL,
        "mkfifo pipe; cat pipe >e.png & $HELIO render s.gltf -o png:pipe 2>said; code=$?; wait; "
        "test -p pipe && exit $code");
    expect_file("e.png", "frame 1 as PNG8");
    expect_run(0, NULL, NULL,
        "mkdir -p other; ln -s other/f.png f.png; $HELIO render s.gltf -o f.png --stats /dev/null "
        "2>said && test -L f.png && test -c /dev/null");
    expect_file("other/f.png", "frame 1 as PNG8");
    expect_run(2, "its folder 'gone' does not exist", NULL,
        "ln -s gone/g.png g.png; $HELIO render s.gltf -o g.png");
    // Nothing is left beside a stream.
    expect_run(8, NULL, NULL,
        "rm -f logc; export FAKE='silent=frame_request log=logc'; "
        "$HELIO render s.gltf -o png:pipe --mode path & p=$!; "
        "until grep -qs frame_request logc; do sleep 0.05; kill -0 $p || break; done; "
        "kill -TERM $p; wait $p; code=$?; ls; exit $code");
    assert_null(strstr(h.output, "checkpoint"));
}

static void test_other_commands(void **state)
{
    (void)state;
    expect_run(0, NULL, NULL, "$HELIO bench realtime --json - 2>said | cat >r.json");
    expect_file("r.json", "{\"ok\":1}");
    expect_run(0, NULL, NULL, "$HELIO bake s.gltf -o baked --stats - 2>said | cat >k.json");
    expect_file("k.json", "\"packs\"");
    // The value and the summary give way to what is asked for.
    expect_run(0, NULL, NULL, "$HELIO compare s.gltf t.txt --diff - 2>said >diff.png");
    expect_file("diff.png", "diff");
    assert_null(strstr(h.output, "psnr"));
    expect_file("said", "psnr 20");
    static const char script[] = "load s.gltf\nframe exr:x\nexpect stat frame.render_ms == 1.5\n";
    harness_write(&h, "t.hs", script, strlen(script));
    expect_run(0, NULL, NULL, "$HELIO run t.hs --junit - 2>said >junit.xml");
    expect_file("junit.xml", "</testsuites>");
    assert_null(strstr(h.output, "expectation,"));
    expect_file("said", "1 expectation, 0 failed");
    expect_file("x", "frame 1 as EXR_HALF");
}

// A mistyped folder is not an empty cache; one that nothing used yet is.
static void test_cache_folder(void **state)
{
    (void)state;
    expect_run(2, "--cache-dir: typo: there is no such folder", "entries",
        "$HELIO cache --cache-dir typo");
    expect_run(2, "--cache-dir: s.gltf is no folder", "entries",
        "$HELIO cache --cache-dir s.gltf --clear");
    expect_run(0, "fresh/store is missing: nothing was cached here yet", NULL,
        "mkdir fresh; $HELIO cache --cache-dir fresh");
    assert_non_null(strstr(h.output, "0 entries"));
    expect_run(0, "0 entries", NULL, "XDG_CACHE_HOME=$PWD/none $HELIO cache");
}

// A folder in a frame's place is there the next time, too: nothing is rendered, and no queue tries
// again. Neither when it comes in the middle.
static void test_folder_in_series(void **state)
{
    (void)state;
    expect_run(2, "fo-3.png: is a folder", "written",
        "mkdir fo-3.png; $HELIO render s.gltf -o fo-#.png --frames 1-4; code=$?; "
        "test ! -e fo-1.png && exit $code");
    expect_run(2, "fm-2.png: is a folder\nhelio: 1 frame is written", NULL,
        "FAKE=folder=fm-2.png $HELIO render s.gltf -o fm-#.png --frames 1-2");
    expect_run(2, "fs-2.png: is a folder\nhelio: 1 frame is written", NULL,
        "FAKE=folder=fs-2.png $HELIO render s.gltf -o fs-#.png --frames 1-2 --skip-existing");
}

// ulimit -f 1: files of 512 or 1024 bytes. The signal of that limit is not the end.
static void test_file_size_limit(void **state)
{
    (void)state;
#ifndef __SANITIZE_THREAD__ // its start-up writes a file of its own and dies of the limit
    expect_run(6, "full.png: cannot write: File too large", NULL,
        "export FAKE=large=1; ulimit -f 1; $HELIO render s.gltf -o full.png; code=$?; "
        "test ! -e full.png && exit $code");
#endif
}

// ---- what is said ------------------------------------------------------------------------------

static void test_summary(void **state)
{
    (void)state;
    expect_run(
        0, "helio: wrote a.png (64 x 32) in ", NULL, "$HELIO render s.gltf -o a.png --size 64x32");
    expect_run(0, "helio: wrote 3 frames, n-4.png to n-8.png, in ", NULL,
        "$HELIO render s.gltf -o n-#.png --frames 4-8:2");
    expect_run(0, "helio: wrote 1 of 3 frames, n-4.png to n-8.png, in ", NULL,
        "rm n-6.png; $HELIO render s.gltf -o n-#.png --frames 4-8:2 --skip-existing");
    assert_non_null(strstr(h.output, "; 2 were there already\n"));
    expect_run(0, NULL, NULL, "$HELIO render s.gltf -o a.png -q");
    assert_string_equal(h.output, "");
    expect_run(3, "helio: ", "wrote", "$HELIO render gone.gltf -o a.png -q");
}

static void test_warnings(void **state)
{
    (void)state;
    expect_run(0, "warning: fake.gltf: /extensionsUsed/0: unknown ?[31mextension\n", "more",
        "$HELIO render s.gltf -o a.png");
    expect_run(0, "extension; and 10 more, which -v lists\n", NULL,
        "FAKE=warnings=11 $HELIO render s.gltf -o a.png");
    const char *first = strstr(h.output, "warning: ");
    assert_non_null(first);
    assert_null(strstr(first + 1, "warning: "));
    expect_run(0, NULL, NULL,
        "test $(FAKE=warnings=11 $HELIO render s.gltf -o a.png -v 2>&1 | grep -c ^warning:) = 11");
    // Those of the picture are said when it is there, with all of them in mind.
    expect_run(0, "warning: fake.gltf: an image was lost\n", "more",
        "FAKE='warnings=1 lost=1' $HELIO render s.gltf -o a.png");
}

static double number(const json_t *event, const char *key)
{
    const json_t *value = json_object_get(event, key);
    if (!json_is_number(value))
        fail_msg("'%s' is missing or no number", key);
    return json_number_value(value);
}

static const char *event_name(const json_t *event)
{
    const char *name = json_string_value(json_object_get(event, "event"));
    return name ? name : "";
}

// Runs the command; an array of the objects on its error stream, which holds nothing else.
static json_t *json_stream(int code, const char *command)
{
    json_t *events = json_array();
    expect_run(code, NULL, NULL, command);
    for (char *line = strtok(h.output, "\n"); line; line = strtok(NULL, "\n")) {
        json_t *event = json_loads(line, 0, NULL);
        if (!json_is_object(event))
            fail_msg("%s: not JSON: %s", command, line);
        json_array_append_new(events, event);
    }
    assert_true(json_array_size(events) > 0);
    const json_t *end = json_array_get(events, json_array_size(events) - 1);
    assert_string_equal(event_name(end), "end");
    assert_int_equal(number(end, "exit"), code);
    return events;
}

static uint32_t count_events(json_t *events, const char *name)
{
    size_t i;
    json_t *event;
    uint32_t n = 0;
    json_array_foreach(events, i, event) n += strcmp(event_name(event), name) == 0;
    return n;
}

static void test_json_stream(void **state)
{
    (void)state;
    size_t i;
    json_t *event;
    double share = 0;
    uint32_t written = 0;
    json_t *events = json_stream(
        0, "FAKE=warnings=2 $HELIO render s.gltf -o j-#.png --frames 4-8:2 --progress json 2>&1");
    json_array_foreach(events, i, event)
    {
        if (strcmp(event_name(event), "written") == 0) {
            char name[16];
            snprintf(name, sizeof name, "j-%u.png", 4 + 2 * written++);
            assert_string_equal(json_string_value(json_object_get(event, "path")), name);
            assert_int_equal(number(event, "frame"), 2 + 2 * written);
            assert_int_equal(number(event, "index"), written);
            assert_int_equal(number(event, "of"), 3);
            assert_true(number(event, "took_s") > 0);
        }
        if (json_object_get(event, "share")) {
            assert_true(number(event, "share") >= share);
            share = number(event, "share");
        }
    }
    assert_int_equal(written, 3);
    assert_true(share == 1);
    assert_int_equal(count_events(events, "warning"), 2);
    const json_t *end = json_array_get(events, json_array_size(events) - 1);
    assert_int_equal(number(end, "written"), 3);
    assert_int_equal(number(end, "warnings"), 2);
    json_decref(events);
    events = json_stream(0, "$HELIO render s.gltf -o j-#.png --frames 4-8:2 --skip-existing "
                            "--progress json 2>&1");
    assert_int_equal(count_events(events, "skipped"), 3);
    json_decref(events);
    events = json_stream(7, "FAKE=die=frame_request $HELIO render s.gltf -o j.png "
                            "--progress json 2>&1");
    assert_int_equal(count_events(events, "error"), 1);
    json_decref(events);
    events = json_stream(3, "$HELIO render gone.gltf -o j.png --progress json 2>&1");
    json_decref(events);
    json_decref(json_stream(0, "$HELIO bake s.gltf -o baked --progress json 2>&1 >out.json"));
    json_decref(json_stream(1, "printf 'load s.gltf\\nexpect pick 1 1 nothing\\n' >u.hs; "
                               "$HELIO run u.hs --progress json 2>&1 >out.txt"));
}

static int setup(void **state)
{
    (void)state;
    harness_begin(&h);
    harness_write(&h, "s.gltf", "{}", 2);
    harness_write(&h, "t.txt", "other", 5);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    harness_end(&h);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_standard_output),
        cmocka_unit_test(test_pipes_and_links),
        cmocka_unit_test(test_other_commands),
        cmocka_unit_test(test_cache_folder),
        cmocka_unit_test(test_folder_in_series),
        cmocka_unit_test(test_file_size_limit),
        cmocka_unit_test(test_summary),
        cmocka_unit_test(test_warnings),
        cmocka_unit_test(test_json_stream),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
