// helio run against a fake worker and a fake daemon: expectations, reports, several scripts.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <string.h>

#include "tests/unit/client/cli_harness.h"

static void write_text(const char *name, const char *text)
{
    harness_write(&h, name, text, strlen(text));
}

static void write_script(const char *text)
{
    write_text("t.hs", text);
}

static void test_run(void **state)
{
    (void)state;
    write_script("load s.gltf\nset size 64x64\ncamera orbit 0,90,2\nframe one.png\n"
                 "expect psnr one.png >= 40\nexpect stat frame.render_ms == 1.5\n"
                 "expect pick 1 1 node 1:0\nexpect pick 20 1 nothing\n"
                 "expect pick 1 1 node eye\n");
    expect_run(1, "t.hs:9: expected: expect pick 1 1 node eye; seen: node 1:0", "",
        "$HELIO run t.hs --junit r.xml");
    expect_file("one.png", "frame 1 as PNG8");
    expect_file("r.xml", "tests=\"5\" failures=\"1\" errors=\"0\"");
    write_script("load ${SCENE}\nwait settled\nexpect stat frame.nothing > 1\n"
                 "expect psnr gone.png > 1\n"
                 "expect hash abcd000000000000000000000000000000000000000000000000000000000000\n");
    expect_run(1, "t.hs:3: expected: expect stat frame.nothing > 1; seen: no such key", "",
        "$HELIO run t.hs -D SCENE=s.gltf");
    assert_non_null(strstr(h.output, "3 expectations, 2 failed"));
    expect_run(
        2, "t.hs:1: the variable 'SCENE' is not defined", "", "$HELIO run t.hs --junit q.xml");
    expect_file("q.xml", "errors=\"1\"");
    write_script("load gone.gltf\nframe b.bmp\n"); // before the first line runs
    expect_run(2, "t.hs:2: b.bmp: the name ends in none of", "", "$HELIO run t.hs");
    write_script("load gone.gltf\nframe none/b.png\n");
    expect_run(2, "t.hs:2: none/b.png: its folder", "", "$HELIO run t.hs");
    write_script("load s.gltf\nset node eys visible off\n");
    expect_run(2, "no node of that name; did you mean 'eye'?", "", "$HELIO run t.hs");
    write_script("load s.gltf\ncamera node nose\n");
    expect_run(2, "camera node: no camera 'nose'; the scene has 0 'eye'", "", "$HELIO run t.hs");
    write_script("load gone.gltf\n");
    expect_run(3, "t.hs:1: load gone.gltf", "", "$HELIO run t.hs --junit p.xml");
    expect_file("p.xml", "<error message=");
    write_script("load s.gltf\nwait settled\nexpect stat a == 1\n");
    expect_run(7, "was killed by signal 9", "die=frame_request", "$HELIO run t.hs");
    expect_run(3, "gone.hs", "", "$HELIO run gone.hs");
    harness_serve(&h, "log=logr");
    write_script("load any.gltf as 3\nset variant red as 3\ntime 2\nwait settled\n");
    expect_run(0, "0 expectations, 0 failed", "", "$HELIO run t.hs --connect unix:sock");
    expect_file("logr", "variant_set\nanimation_set time=2\n");
    write_script("connect unix:sock\nload any.gltf\nexpect hash "
                 "abcd000000000000000000000000000000000000000000000000000000000000\n");
    expect_run(0, "1 expectation, 0 failed", "", "$HELIO run t.hs");
}

// Several scripts, the standard input, includes, shared scenes; what never ran is skipped.
static void test_run_many(void **state)
{
    (void)state;
    write_text("part.hs", "wait settled\nexpect stat frame.settled == true\n");
    write_text("a.hs", "load s.gltf\ninclude part.hs\n");
    write_text("broken.hs", "load gone.gltf\nexpect pick 1 1 nothing\n");
    expect_run(0, "a.hs: 1 expectation, 0 failed", "", "$HELIO run a.hs");
    expect_run(3, "a.hs: 1 expectation, 0 failed", "", "$HELIO run broken.hs a.hs --junit m.xml");
    assert_non_null(strstr(h.output, "broken.hs: 1 expectation, 0 failed, 1 skipped"));
    expect_file(
        "m.xml", "name=\"broken.hs\" tests=\"2\" failures=\"0\" errors=\"1\" skipped=\"1\"");
    expect_file("m.xml", "<skipped/>");
    expect_file("m.xml", "name=\"a.hs\" tests=\"1\" failures=\"0\" errors=\"0\" skipped=\"0\"");
    expect_run(0, "-: 1 expectation, 0 failed", "", "$HELIO run - <a.hs");
    expect_run(2, "is one script", "", "$HELIO run - - <a.hs");
    write_text("wrong.hs", "fly\n");
    expect_run(2, "wrong.hs:1: unknown command 'fly'", "", "$HELIO run a.hs wrong.hs");
    assert_null(strstr(h.output, "expectation")); // found before the first script runs
    harness_serve(&h, "log=logs");
    write_script("scene show\nload s.gltf\nscene other\nwait settled\n");
    expect_run(0, NULL, "", "$HELIO run t.hs --connect unix:sock");
    expect_file("logs", "scene_open show");
    expect_file("logs", "scene_close");
    expect_file("logs", "scene_open other");
}

// Documented keys of frames and of the client, booleans and texts.
static void test_run_stats(void **state)
{
    (void)state;
    write_script("load s.gltf\nwait settled\nexpect stat frame.missing_pages == 0\n"
                 "expect stat frame.settled == yes\nexpect stat client.embedded == true\n"
                 "expect stat client.version != none\nexpect stat client.total_ms > 0\n"
                 "expect stat frame.total_ms > 0\nexpect stat client.version == none\n");
    expect_run(1, "expect stat client.version == none; seen: 0.", "", "$HELIO run t.hs");
    assert_non_null(strstr(h.output, "7 expectations, 1 failed"));
}

static void test_run_references(void **state)
{
    (void)state;
    write_text("ref.png", "an old one");
    write_script("load s.gltf\nwait settled\nexpect psnr ref.png >= 30\n"
                 "expect psnr new.png >= 30 mask s.gltf\n");
    expect_run(
        1, "ref.png >= 30; seen: 20", "", "$HELIO run t.hs --report pages --junit pages.xml");
    expect_file("pages/index.html", "0001-difference.png");
    expect_file("pages/0001-picture.png", "frame 1");
    expect_file("pages/0001-reference.png", "an old one");
    expect_file("pages/0001-difference.png", "diff");
    expect_file("pages.xml", "[[ATTACHMENT|pages/0001-picture.png]]");
    expect_no_file("pages/0002-reference.png"); // there is none
    expect_file("ref.png", "an old one");
    expect_run(0, "2 references replaced", "", "$HELIO run t.hs --update-references");
    expect_file("ref.png", "frame 1");
    expect_file("new.png", "frame 1");
    expect_run(7, "was killed", "die=frame_request", "$HELIO run t.hs --update-references");
    expect_file("ref.png", "frame 1");
    expect_run(2, "cannot be made", "", "$HELIO run t.hs --report gone/pages");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_run),
        cmocka_unit_test(test_run_many),
        cmocka_unit_test(test_run_stats),
        cmocka_unit_test(test_run_references),
    };
    return cmocka_run_group_tests(tests, cli_setup, cli_teardown);
}
