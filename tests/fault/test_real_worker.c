// test_real_worker.c - kill -9 and SIGSTOP of the real worker: the frames that follow are, byte for
// byte, those of an undisturbed run.
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>

#include <cmocka.h>

#include "base/clock.h"
#include "tests/system/daemon.h"

enum { WIDTH = 96, HEIGHT = 54, FRAME_BYTES = WIDTH * HEIGHT * 4, SAMPLES = 160 };

struct picture {
    uint8_t data[FRAME_BYTES], hash[32];
    uint64_t revision, number, input_seq;
    uint32_t samples;
};

static void start(struct daemon *d)
{
    char worker[512];
    const char *build = getenv("HELIO_BUILD_DIR");
    assert_non_null(build);
    snprintf(worker, sizeof worker, "%s/libexec/helio-worker", build);
    setenv("HELIO_TEST_WORKER", worker, 1);
    daemon_init(d);
    daemon_option(d, "worker-timeout", "5");
    daemon_option(d, "restart-delay", "0.01");
    daemon_option(d, "asset-root", TEST_MODELS);
    daemon_start(d);
}

// An asset, and objects of the client's own that hang on it and were edited since.
static void build_scene(struct peer *p)
{
    static const float triangle[9] = {0, 0, 0, 2, 0, 0, 0, 2, 0};
    uint32_t n = p->first_id;
    struct hgp_mesh_part part = {.mode = HGP_primitive_mode_TRIANGLES,
        .positions = {(const uint8_t *)triangle, sizeof triangle}};
    peer_call(p, HGP_T_asset_load,
        &(struct hgp_asset_load){.asset = n, .path = hgp_str_make(TEST_MODELS "/knot/knot.gltf")},
        HGP_T_asset_loaded);
    peer_call(p, HGP_T_mesh_set, &(struct hgp_mesh_set){.mesh = n, .parts = {&part, 1}}, HGP_T_ok);
    peer_call(p, HGP_T_node_set, &(struct hgp_node_set){.node = n, .has_mesh = true, .mesh = n},
        HGP_T_ok);
    peer_call(p, HGP_T_material_set,
        &(struct hgp_material_set){.material = n,
            .has_base_color = true,
            .base_color = {1, 0.1f, 0.1f, 1},
            .has_double_sided = true,
            .double_sided = true},
        HGP_T_ok);
    part.material = n;
    peer_call(p, HGP_T_mesh_set, &(struct hgp_mesh_set){.mesh = n, .parts = {&part, 1}}, HGP_T_ok);
    peer_call(p, HGP_T_node_set,
        &(struct hgp_node_set){.node = n + 1, .has_translation = true, .translation = {0, 1, 0}},
        HGP_T_ok);
    peer_call(p, HGP_T_node_set,
        &(struct hgp_node_set){.node = n, .has_parent = true, .parent = n + 1}, HGP_T_ok);
    for (int i = 0; i < 10; i++)
        peer_call(p, HGP_T_node_set,
            &(struct hgp_node_set){
                .node = n + 1, .has_translation = true, .translation = {0, 1 + 0.1f * (float)i, 0}},
            HGP_T_ok);
    peer_call(p, HGP_T_environment_set,
        &(struct hgp_environment_set){.has_intensity = true, .intensity = 0.8f}, HGP_T_ok);
    peer_call(p, HGP_T_view_set,
        &(struct hgp_view_set){.view = 1,
            .has_width = true,
            .width = WIDTH,
            .has_height = true,
            .height = HEIGHT,
            .has_samples = true,
            .samples = SAMPLES,
            .has_gi = true,
            .gi = HGP_gi_NONE,
            .has_exposure_mode = true,
            .exposure_mode = HGP_exposure_mode_FIXED,
            .has_still_encoding = true,
            .still_encoding = HGP_encoding_RAW_RGBA8},
        HGP_T_ok);
}

static void look(struct peer *p, uint64_t input_seq, float x)
{
    peer_tell(p, HGP_T_view_camera,
        &(struct hgp_view_camera){.view = 1,
            .input_seq = input_seq,
            .has_eye = true,
            .eye = {x, 3, 8},
            .has_target = true,
            .target = {0, 1, 0}});
}

static void keep(const struct peer *p, struct picture *out)
{
    const struct hgp_frame *m = &p->m.frame;
    assert_true(m->settled && m->lossless && m->has_hash);
    assert_int_equal(m->data.size, FRAME_BYTES);
    memcpy(out->data, m->data.data, FRAME_BYTES);
    memcpy(out->hash, m->hash, 32);
    out->revision = m->scene_revision;
    out->number = m->number;
    out->input_seq = m->input_seq;
    out->samples = m->samples;
}

static uint32_t ask(struct peer *p)
{
    return peer_send(
        p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1, .settled = true});
}

static void take(struct peer *p, struct picture *out)
{
    peer_answer(p, ask(p), HGP_T_frame);
    keep(p, out);
}

static void same(const struct picture *a, const struct picture *b)
{
    assert_memory_equal(a->data, b->data, FRAME_BYTES);
    assert_memory_equal(a->hash, b->hash, 32);
    assert_int_equal(a->revision, b->revision);
    assert_int_equal(a->samples, b->samples);
    assert_true(b->number > a->number);
}

// Asks for a frame and sends the signal as soon as the worker reports that it is at it.
static void disturbed_take(struct daemon *d, struct peer *p, int number, struct picture *out)
{
    pid_t worker = daemon_worker(d, 0);
    uint32_t request = ask(p);
    assert_true(peer_next(p));
    if (p->header.type != HGP_T_progress)
        fail_msg("the frame was too quick to be disturbed (message %u)", p->header.type);
    uint64_t start_ns = hg_clock_now_ns();
    assert_int_equal(kill(worker, number), 0);
    peer_answer(p, request, HGP_T_frame);
    keep(p, out);
    print_message(
        "frame %.2f s after signal %d\n", (double)(hg_clock_now_ns() - start_ns) * 1e-9, number);
    assert_true(daemon_worker(d, worker) != worker);
}

static void frames_survive(void **state)
{
    (void)state;
    static struct picture first, other, again;
    struct daemon d;
    struct peer p;
    start(&d);
    peer_open_scene(&p, &d, "");
    build_scene(&p);
    look(&p, 1, 0);
    take(&p, &first);
    look(&p, 2, 4);
    take(&p, &other);
    assert_true(memcmp(first.data, other.data, FRAME_BYTES) != 0); // the camera matters
    look(&p, 3, 0);
    disturbed_take(&d, &p, SIGKILL, &again);
    same(&first, &again);
    assert_int_equal(again.input_seq, 3);
    look(&p, 4, 4);
    disturbed_take(&d, &p, SIGSTOP, &again); // it hangs: worker-timeout
    same(&other, &again);
    // The scene goes on where it was: an edit is the next revision.
    peer_call(&p, HGP_T_node_set,
        &(struct hgp_node_set){.node = p.first_id, .has_visible = true, .visible = false},
        HGP_T_ok);
    assert_int_equal(p.m.ok.revision, first.revision + 1);
    char *log = daemon_read(&d, "log");
    assert_null(strstr(log, "an edit is refused now"));
    free(log);
    peer_close(&p);
    daemon_finish(&d);
}

static void loads_survive(void **state)
{
    (void)state;
    static struct picture calm, disturbed;
    struct daemon d;
    struct peer a, b;
    start(&d);
    peer_open_scene(&a, &d, "");
    build_scene(&a);
    look(&a, 1, 1);
    take(&a, &calm);
    peer_open_scene(&b, &d, "");
    uint32_t load = peer_send(&b, HGP_T_asset_load,
        &(struct hgp_asset_load){
            .asset = b.first_id, .path = hgp_str_make("demo:")}); // takes a while
    kill(daemon_worker(&d, 0), SIGKILL);
    peer_answer(&b, load, HGP_T_asset_loaded);
    take(&a, &disturbed); // the other scene came back, too
    same(&calm, &disturbed);
    peer_close(&a);
    peer_close(&b);
    daemon_finish(&d);
}

static void paint(struct peer *p, uint32_t material, float red, float green, float blue)
{
    peer_call(p, HGP_T_material_set,
        &(struct hgp_material_set){.material = material,
            .has_base_color = true,
            .base_color = {red, green, blue, 1},
            .has_unlit = true,
            .unlit = true,
            .has_double_sided = true,
            .double_sided = true},
        HGP_T_ok);
}

// A triangle in one colour that covers the middle of what `viewer` looks at.
static void build_triangle(struct peer *owner, struct peer *viewer)
{
    static const float corners[9] = {-9, -9, 0, 9, -9, 0, 0, 9, 0};
    uint32_t n = owner->first_id;
    struct hgp_mesh_part part = {.mode = HGP_primitive_mode_TRIANGLES,
        .material = n,
        .positions = {(const uint8_t *)corners, sizeof corners}};
    paint(owner, n, 0, 1, 0);
    peer_call(
        owner, HGP_T_mesh_set, &(struct hgp_mesh_set){.mesh = n, .parts = {&part, 1}}, HGP_T_ok);
    peer_call(owner, HGP_T_node_set, &(struct hgp_node_set){.node = n, .has_mesh = true, .mesh = n},
        HGP_T_ok);
    peer_call(viewer, HGP_T_view_set,
        &(struct hgp_view_set){.view = 1,
            .has_width = true,
            .width = WIDTH,
            .has_height = true,
            .height = HEIGHT,
            .has_samples = true,
            .samples = 1,
            .has_exposure_mode = true,
            .exposure_mode = HGP_exposure_mode_FIXED,
            .has_tonemap = true,
            .tonemap = HGP_tonemap_LINEAR},
        HGP_T_ok);
    look(viewer, 1, 0);
}

// The middle of a frame: 'r', 'g' or 'b'.
static char middle(const struct peer *p)
{
    assert_int_equal(p->m.frame.data.size, FRAME_BYTES);
    const uint8_t *c = p->m.frame.data.data + ((size_t)HEIGHT / 2 * WIDTH + WIDTH / 2) * 4;
    return c[0] > 128 ? 'r' : c[1] > 128 ? 'g' : 'b';
}

static uint32_t ask_raw(struct peer *p)
{
    return peer_send(p, HGP_T_frame_request,
        &(struct hgp_frame_request){
            .view = 1, .has_encoding = true, .encoding = HGP_encoding_RAW_RGBA8});
}

// The worker dies inside a batch: no client sees the first half of it without the second.
static void batches_stay_whole(void **state)
{
    (void)state;
    struct daemon d;
    struct peer a, b;
    start(&d);
    peer_open(&a, &d);
    peer_open(&b, &d);
    peer_scene(&a, "shared");
    peer_scene(&b, "shared");
    build_triangle(&a, &b);
    peer_answer(&b, ask_raw(&b), HGP_T_frame);
    assert_int_equal(middle(&b), 'g');
    const uint64_t before = b.m.frame.scene_revision;
    for (uint32_t view = 1; view <= 8; view++) // to be restored before the edits go on
        peer_call(&a, HGP_T_view_set,
            &(struct hgp_view_set){
                .view = view, .has_width = true, .width = 1024, .has_height = true, .height = 1024},
            HGP_T_ok);
    peer_call(&a, HGP_T_batch_begin, &(struct hgp_batch_begin){0}, HGP_T_ok);
    paint(&a, a.first_id, 1, 0, 0);
    pid_t worker = daemon_worker(&d, 0);
    assert_int_equal(kill(worker, SIGKILL), 0);
    uint32_t request = ask_raw(&b);
    daemon_wait_log(&d, "is back after");
    assert_true(peer_next(&b));
    assert_int_equal(b.header.type, HGP_T_notice);
    assert_int_equal(b.m.notice.code, HG_E_WORKER);
    if (peer_next_within(&b, 500)) { // nothing is due before the batch ends
        assert_int_equal(b.header.type, HGP_T_frame);
        assert_int_not_equal(middle(&b), 'r');
        request = ask_raw(&b);
    }
    paint(&a, a.first_id, 0, 0, 1);
    peer_call(&a, HGP_T_batch_end, &(struct hgp_batch_end){0}, HGP_T_ok);
    assert_true(a.m.ok.revision > before);
    peer_answer(&b, request, HGP_T_frame);
    assert_int_not_equal(middle(&b), 'r');
    peer_answer(&b, ask_raw(&b), HGP_T_frame);
    assert_int_equal(middle(&b), 'b');
    assert_true(b.m.frame.scene_revision > before);
    peer_close(&a);
    peer_close(&b);
    daemon_finish(&d);
}

enum { LAND_SIDE = 400, LAND_BYTES = LAND_SIDE * LAND_SIDE * 12 };

// Waves of 320,000 triangles, as mesh and node n.
static void build_land(struct peer *p)
{
    const uint32_t n = p->first_id, cells = LAND_SIDE - 1;
    float *positions = malloc(LAND_BYTES), *at = positions;
    uint32_t *indices = malloc((size_t)cells * cells * 24), *index = indices;
    assert_true(positions != NULL && indices != NULL);
    for (uint32_t z = 0; z < LAND_SIDE; z++)
        for (uint32_t x = 0; x < LAND_SIDE; x++, at += 3) {
            at[0] = (float)x / 40 - 5;
            at[1] = 0.3f *
                    (float)((x * 7 + z * 3) % 100 > 50 ? 100 - (x * 7 + z * 3) % 100
                                                       : (x * 7 + z * 3) % 100) /
                    50;
            at[2] = (float)z / 40 - 5;
        }
    for (uint32_t z = 0; z < cells; z++)
        for (uint32_t x = 0; x < cells; x++) {
            const uint32_t a = z * LAND_SIDE + x, b = a + LAND_SIDE;
            const uint32_t two[6] = {a, b, a + 1, a + 1, b, b + 1};
            memcpy(index, two, sizeof two);
            index += 6;
        }
    struct hgp_mesh_part part = {.mode = HGP_primitive_mode_TRIANGLES,
        .positions = {(const uint8_t *)positions, LAND_BYTES},
        .indices = {(const uint8_t *)indices, cells * cells * 24}};
    peer_call(p, HGP_T_mesh_set, &(struct hgp_mesh_set){.mesh = n, .parts = {&part, 1}}, HGP_T_ok);
    peer_call(p, HGP_T_node_set, &(struct hgp_node_set){.node = n, .has_mesh = true, .mesh = n},
        HGP_T_ok);
    peer_call(p, HGP_T_view_set,
        &(struct hgp_view_set){.view = 1,
            .has_width = true,
            .width = WIDTH,
            .has_height = true,
            .height = HEIGHT,
            .has_samples = true,
            .samples = 4,
            .has_exposure_mode = true,
            .exposure_mode = HGP_exposure_mode_FIXED,
            .has_still_encoding = true,
            .still_encoding = HGP_encoding_RAW_RGBA8},
        HGP_T_ok);
    free(positions);
    free(indices);
}

static struct hgp_picked pick_middle(struct peer *p)
{
    peer_call(p, HGP_T_pick, &(struct hgp_pick){.view = 1, .x = WIDTH / 2, .y = HEIGHT / 2},
        HGP_T_picked);
    return p->m.picked;
}

// The disk loses what is spilled: the worker says what and where, the next one keeps arrays in
// memory, and no request or picture is lost.
static void lost_disks_are_survived(void **state)
{
    (void)state;
    static struct picture calm, after;
    struct daemon d;
    struct peer a, b;
    char library[512], cache[512];
    const char *build = getenv("HELIO_BUILD_DIR");
    assert_non_null(build);
    snprintf(library, sizeof library, "%s/tests/liblost_disk.so", build);
    snprintf(
        cache, sizeof cache, "%s/tests/lost-disk-cache", build); // not in memory, as /tmp may be
    const char *asan = getenv("ASAN_OPTIONS");
    char options[600], usual[512];
    snprintf(usual, sizeof usual, "%s", asan != NULL ? asan : "");
    snprintf(options, sizeof options, "%s:verify_asan_link_order=0", usual);
    setenv("ASAN_OPTIONS", options, 1);
    setenv("LD_PRELOAD", library, 1);
    setenv("HELIO_TEST_CACHE", cache, 1);
    start(&d);
    unsetenv("LD_PRELOAD");
    setenv("ASAN_OPTIONS", usual, 1);
    unsetenv("HELIO_TEST_CACHE");
    peer_open_scene(&a, &d, "");
    build_land(&a);
    look(&a, 1, 0);
    take(&a, &calm);
    const struct hgp_picked before = pick_middle(&a);
    assert_true(before.hit);
    peer_open_scene(&b, &d, "");
    build_scene(&b);
    pid_t worker = daemon_worker(&d, 0);
    for (int round = 0; round < 2; round++) {
        assert_int_equal(kill(worker, SIGUSR1), 0);
        hg_clock_sleep_ns(100000000);
        assert_int_equal(pick_middle(&a).triangle, before.triangle);
        take(&a, &after);
        assert_memory_equal(calm.data, after.data, FRAME_BYTES);
        if (round == 0)
            worker = daemon_worker(&d, worker); // another one
    }
    assert_int_equal(daemon_worker(&d, 0), worker);
    look(&b, 1, 0);
    take(&b, &after);
    char *log = daemon_read(&d, "log"), what[32];
    snprintf(what, sizeof what, "(mesh %llu)", (unsigned long long)a.first_id);
    assert_non_null(strstr(log, cache));
    assert_non_null(strstr(log, "cannot be read back"));
    assert_non_null(strstr(log, what));
    free(log);
    peer_close(&a);
    peer_close(&b);
    daemon_finish(&d);
    assert_true(test_folder_remove(cache));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_survive),
        cmocka_unit_test(loads_survive),
        cmocka_unit_test(batches_stay_whole),
        cmocka_unit_test(lost_disks_are_survived),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
