// Every option of every command: its good values, its bad values, and the message that names it.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "client/cli/options.h"
#include "client/cli/suggest.h"

struct sample {
    const char *good, *bad; // bad NULL: every text is good
};

static struct sample sample_of(const struct hg_cli_option_row *row)
{
    static char choice[HG_CLI_CHOICES_BYTES], number[32];
    switch (row->kind) {
    case HG_CLI_KIND_U32:
        return (struct sample){"1", "-1"};
    case HG_CLI_KIND_F64:
        snprintf(number, sizeof number, "%g", row->low > 1 ? row->low : 1.0);
        return (struct sample){number, "1e999"};
    case HG_CLI_KIND_SIZE:
        return (struct sample){"640x480", "640"};
    case HG_CLI_KIND_REGION:
        return (struct sample){"8,0,64,32", "0,0,0,1"};
    case HG_CLI_KIND_VEC3:
        return (struct sample){"-1,2.5,3e1", "1,2"};
    case HG_CLI_KIND_FRAMES:
        return (struct sample){"1-10:2", "1,"};
    case HG_CLI_KIND_BACKGROUND:
        return (struct sample){"0.1,0.2,0.3", "reddish"};
    case HG_CLI_KIND_SUN:
        return (struct sample){"90,30,4", "90"};
    case HG_CLI_KIND_EXPOSURE:
        return (struct sample){"auto+1", "auto1"};
    case HG_CLI_KIND_CHOICE:
        hg_cli_option_choices(row, choice);
        choice[strcspn(choice, "|")] = 0;
        return (struct sample){choice, "nonsense"};
    default:
        return (struct sample){"text", NULL};
    }
}

static enum hg_status parse(int argc, const char **argv, struct hg_error *err)
{
    static struct hg_cli_options options;
    *err = (struct hg_error){0};
    return hg_cli_parse(argc, argv, &options, err);
}

static int base_argv(const struct hg_cli_command_row *command, const char **argv)
{
    int argc = 0;
    argv[argc++] = "helio";
    argv[argc++] = command->name;
    for (uint32_t i = 0; i < command->least; i++)
        argv[argc++] = "argument";
    return argc;
}

static void check_option(
    const struct hg_cli_command_row *command, const struct hg_cli_option_row *row)
{
    char name[64], joined[256];
    const char *argv[8];
    struct hg_error err;
    struct sample sample = sample_of(row);
    snprintf(name, sizeof name, "--%s", row->name);
    int argc = base_argv(command, argv);
    argv[argc] = name;
    if (row->kind == HG_CLI_KIND_FLAG) {
        assert_int_equal(parse(argc + 1, argv, &err), HG_OK);
        snprintf(joined, sizeof joined, "%s=1", name);
        argv[argc] = joined;
        assert_int_equal(parse(argc + 1, argv, &err), HG_E_INVAL);
        assert_non_null(strstr(err.what, name));
        return;
    }
    assert_int_equal(parse(argc + 1, argv, &err), HG_E_INVAL); // no value
    assert_string_equal(err.what, name);
    argv[argc + 1] = sample.good;
    assert_int_equal(parse(argc + 2, argv, &err), HG_OK);
    argv[argc + 1] = "";
    assert_int_equal(parse(argc + 2, argv, &err), HG_E_INVAL);
    assert_string_equal(err.what, name);
    if (!sample.bad)
        return;
    argv[argc + 1] = sample.bad;
    assert_int_equal(parse(argc + 2, argv, &err), HG_E_INVAL);
    assert_string_equal(err.what, name);
    assert_true(err.reason[0]);
    snprintf(joined, sizeof joined, "%s=%s", name, sample.good);
    argv[argc] = joined;
    assert_int_equal(parse(argc + 1, argv, &err), HG_OK);
    snprintf(joined, sizeof joined, "%s=%s", name, sample.bad);
    assert_int_equal(parse(argc + 1, argv, &err), HG_E_INVAL);
    assert_string_equal(err.what, name);
}

static void test_every_option(void **state)
{
    (void)state;
    int checked = 0;
    for (int c = 0; c < HG_CLI_COMMAND_COUNT; c++)
        for (uint32_t i = 0; i < hg_cli_option_count; i++)
            if (hg_cli_option_rows[i].commands & hg_cli_commands[c].command) {
                check_option(&hg_cli_commands[c], &hg_cli_option_rows[i]);
                checked++;
            }
    assert_true(checked > 60);
}

static void test_unknown(void **state)
{
    (void)state;
    struct hg_error err;
    assert_int_equal(parse(2, (const char *[]){"helio", "look"}, &err), HG_E_INVAL);
    assert_string_equal(err.what, "look");
    assert_int_equal(parse(1, (const char *[]){"helio"}, &err), HG_E_INVAL);
    assert_int_equal(parse(2, (const char *[]){"helio", "render"}, &err), HG_E_INVAL);
    assert_int_equal(parse(4, (const char *[]){"helio", "render", "a", "b"}, &err), HG_E_INVAL);
    assert_string_equal(err.what, "b");
    assert_int_equal(
        parse(4, (const char *[]){"helio", "render", "a", "--nope"}, &err), HG_E_INVAL);
    assert_string_equal(err.what, "--nope");
    assert_int_equal(parse(4, (const char *[]){"helio", "render", "a", "-z"}, &err), HG_E_INVAL);
    // an option of another command
    assert_int_equal(
        parse(5, (const char *[]){"helio", "info", "a", "--size", "1x1"}, &err), HG_E_INVAL);
    assert_string_equal(err.what, "--size");
}

static void expect_reason(int argc, const char **argv, const char *text)
{
    struct hg_error err;
    assert_int_equal(parse(argc, argv, &err), HG_E_INVAL);
    if (!strstr(err.reason, text))
        fail_msg("'%s' is not in: %s", text, err.reason);
}

static void test_suggestions(void **state)
{
    (void)state;
    assert_int_equal(hg_suggest_distance("kitten", 6, "sitting", 7), 3);
    assert_int_equal(hg_suggest_distance("form", 4, "from", 4), 1); // one swap
    assert_int_equal(hg_suggest_distance("", 0, "abc", 3), 3);
    assert_int_equal(hg_suggest_distance("ABC", 3, "abc", 3), 0);
    static const char *const commands[][2] = {{"rendr", "helio render?"}, {"bnech", "helio bench?"},
        {"comp", "helio compare?"}, {"INFO", "helio info?"},
        {"scene.glb", "helio render SCENE -o OUT"}};
    for (size_t i = 0; i < sizeof commands / sizeof *commands; i++)
        expect_reason(2, (const char *[]){"helio", commands[i][0]}, commands[i][1]);
    static const char *const options[][2] = {{"--tonmap", "did you mean --tonemap?"},
        {"--env-rot=3", "did you mean --env-rotation?"}, {"--width=3", "did you mean --size?"},
        {"--hdri", "did you mean --env?"}, {"--sise", "did you mean --size?"},
        {"--metric", "it is one of helio compare"}, {"--nonsense", "--help lists all of them"},
        {"-z", "--help lists all of them"}};
    for (size_t i = 0; i < sizeof options / sizeof *options; i++)
        expect_reason(4, (const char *[]){"helio", "render", "a", options[i][0]}, options[i][1]);
    expect_reason(5, (const char *[]){"helio", "render", "a", "--mode", "Pth"}, "mean 'path'?");
    expect_reason(5, (const char *[]){"helio", "render", "a", "--mode", "Realtime"}, "'realtime'?");
    struct hg_error err;
    assert_int_equal(
        parse(5, (const char *[]){"helio", "render", "a", "--mode", "x"}, &err), HG_E_INVAL);
    assert_null(strstr(err.reason, "did you mean"));
}

// Every option is in one group; those of path mode are in theirs.
static void test_groups(void **state)
{
    (void)state;
    uint32_t seen[HG_CLI_GROUP_COUNT] = {0};
    for (uint32_t i = 0; i < hg_cli_option_count; i++) {
        const struct hg_cli_option_row *row = &hg_cli_option_rows[i];
        if (!row->commands)
            continue;
        const enum hg_cli_group group = hg_cli_option_group(i);
        assert_true(group < HG_CLI_GROUP_COUNT);
        seen[group]++;
        if (row->param && row->param->path_only)
            assert_int_equal(group, HG_CLI_GROUP_PATH);
        if (strcmp(row->name, "orbit") == 0)
            assert_int_equal(group, HG_CLI_GROUP_CAMERA);
    }
    for (int g = 0; g < HG_CLI_GROUP_COUNT; g++)
        assert_true(seen[g] > 0 && hg_cli_group_titles[g][0]);
}

static void expect_frames(const char *text, const char *list)
{
    static struct hg_frame_ranges ranges;
    ranges.count = 0;
    char seen[256];
    int32_t *numbers;
    uint32_t count;
    assert_int_equal(hg_frame_ranges_parse("--frames", text, &ranges, NULL), HG_OK);
    assert_int_equal(hg_frame_ranges_list(&ranges, &numbers, &count, NULL), HG_OK);
    size_t used = 0;
    for (uint32_t i = 0; i < count && used < sizeof seen; i++)
        used += (size_t)snprintf(seen + used, sizeof seen - used, "%d ", numbers[i]);
    assert_string_equal(seen, list);
    hg_free(numbers);
}

static void test_frame_lists(void **state)
{
    (void)state;
    expect_frames("1,3,5-9x2,-2", "1 3 5 7 9 -2 ");
    expect_frames("7", "7 ");
    expect_frames("-3--1", "-3 -2 -1 ");
    expect_frames("-1-1", "-1 0 1 ");
    expect_frames("2..4, 8..9", "2 3 4 8 9 ");
    expect_frames("5-1", "5 4 3 2 1 ");
    expect_frames("10-0x4", "10 6 2 ");
    expect_frames("1-10:4", "1 5 9 ");
    expect_frames("1-4,3-6,3,2", "1 2 3 4 5 6 "); // each once
    expect_frames("4-4x9", "4 ");
    static const struct {
        const char *text, *reason;
    } bad[] = {{"1,,2", "character 3: a frame number"}, {"1-", "character 3: a frame number"},
        {"1-3x0", "character 5: the step is 0"}, {"1-3x-1", "character 5: a step is expected"},
        {"1 2", "character 3: a comma or the end"}, {"1,2,", "character 5: a frame number"},
        {"1-3-5", "character 4: a comma or the end"}, {"a", "character 1: a frame number"},
        {"1,123456789", "character 3: the number has more than 8 digits"},
        {"0-999999,7-8", "character 10: this makes more than 1000000 frames"}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        struct hg_frame_ranges ranges = {0};
        struct hg_error err = {0};
        assert_int_equal(hg_frame_ranges_parse("--frames", bad[i].text, &ranges, &err), HG_E_INVAL);
        if (!strstr(err.reason, bad[i].reason))
            fail_msg("'%s' is not in: %s", bad[i].reason, err.reason);
    }
    static struct hg_frame_ranges both; // of an option that is given twice
    struct hg_error err = {0};
    assert_int_equal(hg_frame_ranges_parse("--frames", "1-2", &both, &err), HG_OK);
    assert_int_equal(hg_frame_ranges_parse("--frames", "5", &both, &err), HG_OK);
    assert_int_equal(both.count, 2);
    assert_int_equal(both.items[0].last, 2);
    assert_int_equal(both.items[1].first, 5);
    assert_int_equal(hg_frame_ranges_parse("--frames", "0-999998", &both, &err), HG_E_INVAL);
    static const int32_t rest[] = {3, 5, 7, 9, 20, 21, 22, 30, 12, -2, -1, 0};
    char text[64];
    hg_frame_list_text(rest, 12, text, sizeof text);
    assert_string_equal(text, "3-9x2,20-22,30,12,-2-0");
    hg_frame_list_text(rest, 12, text, 20);
    assert_string_equal(text, "3-9x2,20-22,30,...");
}

static void test_values(void **state)
{
    (void)state;
    struct hg_cli_options o;
    const char *argv[] = {"helio", "render", "--orbit", "-60,90,124", "s.glb", "-oout.png",
        "--size=16384x1", "--frames", "3-9:3", "--background", "none", "--asset-root", "a",
        "--asset-root", "b", "--exposure", "-1.5", "--seed", "4294967295"};
    assert_int_equal(hg_cli_parse(sizeof argv / sizeof *argv, argv, &o, NULL), HG_OK);
    assert_string_equal(o.args[0], "s.glb");
    assert_string_equal(o.output, "out.png");
    assert_true(o.orbit.v[0] == -60 && o.orbit.v[1] == 90 && o.orbit.v[2] == 124);
    assert_int_equal(o.size.width, 16384);
    assert_int_equal(o.size.height, 1);
    assert_true(
        o.frames.items[0].first == 3 && o.frames.items[0].last == 9 && o.frames.items[0].step == 3);
    assert_int_equal(o.background.kind, HG_CLI_BACKGROUND_NONE);
    assert_int_equal(o.asset_root.count, 2);
    assert_string_equal(o.asset_root.items[1], "b");
    assert_true(o.has_exposure && !o.exposure.automatic && o.exposure.ev == -1.5);
    assert_int_equal(o.seed, 4294967295u);
    assert_false(o.has_at);
    const char *dashes[] = {"helio", "info", "--", "--odd.glb"};
    assert_int_equal(hg_cli_parse(4, dashes, &o, NULL), HG_OK);
    assert_string_equal(o.args[0], "--odd.glb");
}

static void test_exposure(void **state)
{
    (void)state;
    static const struct {
        const char *text;
        struct hg_cli_exposure wanted;
    } rows[] = {{"auto", {true, false, 0}}, {"auto+1.5", {true, false, 1.5}},
        {"auto-2", {true, false, -2}}, {"0", {false, false, 0}}, {"-8.25", {false, false, -8.25}},
        {"camera", {false, true, 0}}, {"camera-1", {false, true, -1}}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct hg_cli_options o;
        const char *argv[] = {"helio", "render", "s", "-o", "o.png", "--exposure", rows[i].text};
        assert_int_equal(hg_cli_parse(7, argv, &o, NULL), HG_OK);
        assert_true(o.has_exposure);
        assert_int_equal(o.exposure.automatic, rows[i].wanted.automatic);
        assert_int_equal(o.exposure.camera, rows[i].wanted.camera);
        assert_true(o.exposure.ev == rows[i].wanted.ev);
    }
}

static void test_bad_values(void **state)
{
    (void)state;
    static const char *const bad[][2] = {{"--size", "0x10"}, {"--size", "10x"}, {"--size", "x10"},
        {"--size", "16385x1"}, {"--size", "1x1x1"}, {"--size", "-1x1"}, {"--frames", "1-3:0"},
        {"--frames", "1-3:-1"}, {"--frames", "a"}, {"--orbit", "1,2,3,4"}, {"--orbit", "1,,3"},
        {"--orbit", "1,2,nan"}, {"--orbit", "1,2,0x10"}, {"--fov", "0"}, {"--fov", "180"},
        {"--background", "1,2,-3"}, {"--seed", "4294967296"}, {"--samples", "0"},
        {"--samples", "1.5"}, {"--exposure", "33"}, {"--exposure", "1 "}, {"--exposure", "auto1"},
        {"--exposure", "camera1"}, {"--f-number", "0"}, {"--iso", "0"}, {"--exposure", "auto+"},
        {"--exposure", "auto+33"}, {"--exposure", "aut"}, {"--mode", "Realtime"},
        {"--tonemap", "aces|agx"}, {"--tonemap", "ace"}, {"--jpeg-quality", "101"},
        {"--region", "1,2,3"}, {"--region", "1,2,3,4.5"}, {"--region", "-1,2,3,4"}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        struct hg_error err;
        const char *argv[] = {"helio", "render", "s", "-o", "o.png", bad[i][0], bad[i][1]};
        if (parse(7, argv, &err) != HG_E_INVAL)
            fail_msg("%s %s was taken", bad[i][0], bad[i][1]);
        assert_string_equal(err.what, bad[i][0]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_option),
        cmocka_unit_test(test_unknown),
        cmocka_unit_test(test_suggestions),
        cmocka_unit_test(test_groups),
        cmocka_unit_test(test_frame_lists),
        cmocka_unit_test(test_values),
        cmocka_unit_test(test_exposure),
        cmocka_unit_test(test_bad_values),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
