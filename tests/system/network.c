// network.c - a viewer behind a slow network: real daemon, worker and client, with a shaping proxy
// between them. What is asserted holds whatever the machine's speed: nothing older than what was
// shown, the newest pose in the end, bounded queues, and the exact picture at rest.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "client/cli/viewer.h"
#include "tests/support/shaper.h"
#include "tests/system/daemon.h"

enum {
    WIDTH = 640,
    HEIGHT = 360,
    LARGE_WIDTH = 2560,
    LARGE_HEIGHT = 1440,
    MOST_UNDER_WAY = 32,
    WARM_FRAMES = 5
};
enum { COLUMNS = 64, ROWS = 36, CORNERS = 6 }; // of the picture's pattern
#define MS        UINT64_C(1000000)
#define SECOND_NS UINT64_C(1000000000)
#define WAIT_NS   (120 * SECOND_NS)
#define MBIT      125000.0 // bytes a second

struct rig {
    struct shaper shaper;
    struct hg_viewer viewer;
    char url[64];
};

static void check(enum hg_status status, const struct hg_error *err)
{
    if (status)
        fail_msg("%s %s: %s", err->what, err->where, err->reason);
}

static struct daemon shared; // one start for all tests

static int start_daemon(void **state)
{
    char worker[4096];
    (void)state;
    snprintf(worker, sizeof worker, "%s/libexec/helio-worker", getenv("HELIO_BUILD_DIR"));
    setenv("HELIO_TEST_WORKER", worker, 1);
    daemon_init(&shared);
    daemon_option(&shared, "seed-shaders", "false");
    daemon_start(&shared);
    return 0;
}

static int stop_daemon(void **state)
{
    (void)state;
    daemon_finish(&shared);
    return 0;
}

// Rectangles of random colours, so that frames have some size.
static enum hg_status build_pattern(struct hg_viewer *v, struct hg_error *err)
{
    enum { VERTICES = COLUMNS * ROWS * CORNERS };
    static float positions[VERTICES][3], colors[VERTICES][4];
    static const float corners[CORNERS][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 0}, {1, 1}, {0, 1}};
    const uint32_t n = v->scene.first_id;
    uint32_t random_bits = 1;
    for (int i = 0; i < VERTICES; i++) {
        const int cell = i / CORNERS;
        random_bits = i % CORNERS ? random_bits : random_bits * 1664525 + 1013904223;
        positions[i][0] = ((float)(cell % COLUMNS) + corners[i % CORNERS][0]) / ROWS;
        positions[i][1] = ((float)(cell / COLUMNS) + corners[i % CORNERS][1]) / ROWS;
        for (int k = 0; k < 4; k++)
            colors[i][k] = k == 3 ? 1.0f : (float)(random_bits >> (8 * k + 4) & 255) / 255;
    }
    struct hgp_mesh_part part = {.mode = HGP_primitive_mode_TRIANGLES,
        .material = n,
        .positions = {(const uint8_t *)positions, sizeof positions},
        .colors = {(const uint8_t *)colors, sizeof colors}};
    const struct hgp_material_set paint = {.material = n,
        .has_unlit = true,
        .unlit = true,
        .has_double_sided = true,
        .double_sided = true};
    const struct hgp_mesh_set mesh = {.mesh = n, .parts = {&part, 1}};
    const struct hgp_node_set node = {.node = n, .has_mesh = true, .mesh = n};
    enum hg_status status = helio_call(v->h, HGP_T_material_set, &paint, NULL, err);
    if (!status)
        status = helio_call(v->h, HGP_T_mesh_set, &mesh, NULL, err);
    return status ? status : helio_call(v->h, HGP_T_node_set, &node, NULL, err);
}

static struct rig *begin_of(uint32_t width, uint32_t height, const struct shaper_options *options)
{
    struct rig *rig = calloc(1, sizeof *rig);
    char path[TEST_FOLDER_MAX + 8];
    struct hg_error err = {0};
    snprintf(path, sizeof path, "%s/sock", shared.folder);
    assert_true(shaper_start(&rig->shaper, path, options));
    snprintf(rig->url, sizeof rig->url, "tcp:127.0.0.1:%d", rig->shaper.port);
    rig->viewer.options = (struct hg_viewer_options){.url = rig->url,
        .build = build_pattern,
        .plain = true,
        .width = width,
        .height = height,
        .poses = 300,
        .poses_per_s = 60,
        .target_fps = 30,
        .encoding = HGP_encoding_JPEG,
        .timeout_ns = WAIT_NS};
    check(hg_viewer_open(&rig->viewer, &err), &err);
    check(hg_viewer_await(&rig->viewer, false, WAIT_NS, &err), &err);
    const uint64_t until_ns = hg_clock_now_ns() + WAIT_NS; // pipelines of pictures in motion
    while (rig->viewer.sample_count < WARM_FRAMES && hg_clock_now_ns() < until_ns)
        check(hg_viewer_run(&rig->viewer, hg_clock_now_ns() + 20 * MS, true, &err), &err);
    return rig;
}

static struct rig *begin(const struct shaper_options *options)
{
    return begin_of(WIDTH, HEIGHT, options);
}

static void end(struct rig *rig)
{
    hg_viewer_close(&rig->viewer);
    shaper_stop(&rig->shaper);
    free(rig);
}

static void move(struct rig *rig, uint64_t ns)
{
    struct hg_error err = {0};
    check(hg_viewer_run(&rig->viewer, hg_clock_now_ns() + ns, true, &err), &err);
    assert_int_equal(rig->viewer.stale, 0);
}

static uint64_t flow(struct rig *rig, const char *key)
{
    struct hg_error err = {0};
    char *text = NULL;
    check(helio_query_json(rig->viewer.h, HGP_T_stats_query, HG_VIEWER_VIEW, &text, &err), &err);
    json_t *root = json_loads(text, 0, NULL), *o = json_object_get(root, "flow");
    assert_true(json_is_integer(json_object_get(o, key)));
    const uint64_t value = (uint64_t)json_integer_value(json_object_get(o, key));
    json_decref(root);
    helio_text_free(text);
    return value;
}

// The newest pose is shown; then its picture comes without loss, the same as on request.
static void rest(struct rig *rig)
{
    struct hg_viewer *v = &rig->viewer;
    struct hg_error err = {0};
    struct helio_message *frame;
    check(hg_viewer_await(v, false, WAIT_NS, &err), &err);
    assert_int_equal(v->shown_seq, v->seq);
    check(hg_viewer_await(v, true, WAIT_NS, &err), &err);
    const struct hgp_frame_request request = {.view = HG_VIEWER_VIEW,
        .settled = true,
        .has_encoding = true,
        .encoding = HGP_encoding_ZSTD_RGBA8};
    check(helio_frame(v->h, &request, &frame, &err), &err);
    assert_true(frame->body->frame.has_hash);
    assert_memory_equal(frame->body->frame.hash, v->hash, sizeof v->hash);
    assert_int_equal(frame->body->frame.input_seq, v->seq);
    helio_message_free(frame);
    assert_int_equal(v->stale, 0);
}

static void test_a_rate_that_falls_and_rises(void **state)
{
    (void)state;
    struct rig *rig =
        begin(&(struct shaper_options){.rate = 20 * MBIT, .delay_ns = 5 * MS, .jitter_ns = 2 * MS});
    move(rig, SECOND_NS);
    const uint64_t rss = daemon_rss_bytes(&shared);
    shaper_set_rate(&rig->shaper, MBIT);
    move(rig, 2 * SECOND_NS);
    assert_true(flow(rig, "bytes_under_way") < 256 << 10); // a quarter of what comes in 8 s
    assert_true(daemon_rss_bytes(&shared) < rss + daemon_allowed(16 << 20));
    shaper_set_rate(&rig->shaper, 20 * MBIT);
    move(rig, SECOND_NS);
    rest(rig);
    end(rig);
}

static void test_a_long_round_trip(void **state)
{
    (void)state;
    struct rig *rig = begin(&(struct shaper_options){.rate = 20 * MBIT, .delay_ns = 150 * MS});
    assert_true(rig->viewer.rtt_ns >= 300 * MS);
    move(rig, 2 * SECOND_NS);
    assert_true(flow(rig, "under_way") <= MOST_UNDER_WAY);
    rest(rig);
    end(rig);
}

static void test_stalls(void **state)
{
    (void)state;
    struct rig *rig = begin(&(struct shaper_options){.rate = 20 * MBIT, .delay_ns = 5 * MS});
    move(rig, SECOND_NS / 2);
    const uint64_t held = flow(rig, "held"), sent = flow(rig, "sent");
    for (int i = 0; i < 2; i++) {
        shaper_set_rate(&rig->shaper, 0);
        move(rig, SECOND_NS);
        shaper_set_rate(&rig->shaper, -1);
        move(rig, SECOND_NS / 4);
    }
    assert_true(flow(rig, "held") > held); // the picture froze; no queue formed
    assert_true(flow(rig, "under_way") <= MOST_UNDER_WAY);
    assert_true(flow(rig, "sent") > sent);
    rest(rig);
    end(rig);
}

// What the client says while a picture is drawn is not late when it is heard afterwards: pictures
// that take longer than a frame may be late are sent, not drawn in vain.
static void test_large_pictures_are_sent(void **state)
{
    (void)state;
    struct rig *rig = begin_of(LARGE_WIDTH, LARGE_HEIGHT, &(struct shaper_options){0});
    move(rig, SECOND_NS);
    const uint64_t held = flow(rig, "held"), sent = flow(rig, "sent");
    move(rig, 4 * SECOND_NS);
    assert_true(flow(rig, "sent") - sent >= 4);
    assert_true(4 * (flow(rig, "held") - held) <= flow(rig, "sent") - sent);
    rest(rig);
    end(rig);
}

static void test_a_hidden_view_costs_nothing(void **state)
{
    (void)state;
    struct hg_error err = {0};
    struct rig *rig = begin(&(struct shaper_options){0});
    move(rig, SECOND_NS / 4);
    rest(rig);
    check(hg_viewer_hide(&rig->viewer, true, &err), &err);
    const uint64_t sent = flow(rig, "sent"), shown = rig->viewer.shown_seq;
    move(rig, SECOND_NS / 2);
    assert_int_equal(flow(rig, "sent"), sent);
    assert_int_equal(rig->viewer.shown_seq, shown);
    check(hg_viewer_hide(&rig->viewer, false, &err), &err);
    rest(rig);
    end(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_rate_that_falls_and_rises),
        cmocka_unit_test(test_a_long_round_trip),
        cmocka_unit_test(test_stalls),
        cmocka_unit_test(test_large_pictures_are_sent),
        cmocka_unit_test(test_a_hidden_view_costs_nothing),
    };
    return cmocka_run_group_tests(tests, start_daemon, stop_daemon);
}
