// test_worker_death.c - the worker dies, hangs, or is poisoned: the client sees a pause, nothing
// else, or is told which request was to blame.
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/clock.h"
#include "base/sha256.h"
#include "tests/fault/built_scene.h"
#include "tests/system/daemon.h"

static void start(struct daemon *d)
{
    daemon_init(d);
    daemon_option(d, "restart-delay", "0.01");
    daemon_start(d);
}

static void same_frame_after(struct daemon *d, struct peer *p, const char *wire)
{
    struct hgp_frame before, after;
    uint8_t digest_before[32], digest_after[32];
    pid_t worker = daemon_worker(d, 0);
    built_scene_frame(p, &before, digest_before);
    daemon_write(d, wire, "");
    built_scene_frame(p, &after, digest_after);
    assert_true(daemon_worker(d, worker) != worker);
    assert_memory_equal(digest_before, digest_after, 32);
    assert_int_equal(before.scene_revision, after.scene_revision);
    assert_int_equal(before.input_seq, after.input_seq);
    assert_true(after.number > before.number);
}

static void killed_in_a_frame(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    start(&d);
    peer_open_scene(&p, &d, "");
    built_scene_make(&p);
    same_frame_after(&d, &p, "die.frame_request");
    char *log = daemon_read(&d, "log");
    assert_null(strstr(log, "an edit is refused now"));
    free(log);
    // The journal is compacted: 40 moves are one entry.
    peer_call(&p, HGP_T_sessions_query, &(struct hgp_sessions_query){0}, HGP_T_json);
    const char *entries = memmem(p.m.json.text.data, p.m.json.text.size, "journal_entries\":", 17);
    assert_non_null(entries);
    assert_true(atoi(entries + 17) < 20);
    peer_close(&p);
    daemon_finish(&d);
}

static void killed_from_outside_with_subscription(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    start(&d);
    peer_open_scene(&p, &d, "shared");
    built_scene_make(&p);
    pid_t worker = daemon_worker(&d, 0);
    peer_call(
        &p, HGP_T_subscribe, &(struct hgp_subscribe){.view = 1, .credit_frames = 8}, HGP_T_ok);
    uint64_t number = 0;
    uint8_t digest[32] = {0};
    bool killed = false, told = false;
    for (int i = 0; i < 60; i++) {
        assert_true(peer_next(&p));
        if (p.header.type == HGP_T_notice) {
            assert_true(killed && !told);
            assert_int_equal(p.m.notice.code, HG_E_WORKER);
            told = true;
            assert_true(peer_next(&p));
        }
        assert_int_equal(p.header.type, HGP_T_frame);
        assert_true(p.m.frame.number > number); // increases across workers
        number = p.m.frame.number;
        if (i)
            assert_memory_equal(digest, p.m.frame.data.data, 32);
        memcpy(digest, p.m.frame.data.data, 32);
        peer_tell(&p, HGP_T_credit, &(struct hgp_credit){.view = 1, .frames = 1});
        if (i == 20) {
            kill(worker, SIGKILL);
            killed = true;
        }
    }
    assert_true(killed && told && daemon_worker(&d, worker) != worker);
    peer_close(&p);
    daemon_finish(&d);
}

static void hung_loop_is_replaced(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    daemon_init(&d);
    daemon_option(&d, "worker-timeout", "3"); // pulses come every 0.1 s
    daemon_option(&d, "restart-delay", "0.01");
    daemon_start(&d);
    peer_open_scene(&p, &d, "");
    built_scene_make(&p);
    same_frame_after(&d, &p, "hang.frame_request");
    daemon_wait_log(&d, "worker-timeout");
    peer_close(&p);
    daemon_finish(&d);
}

// The machine stands still for longer than a worker may be silent (it was overloaded, or is virtual
// and was stopped): the daemon comes back first, and gives the worker time to be heard.
static void standstill_of_all_is_no_silence(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    struct hgp_frame frame;
    uint8_t digest[32];
    daemon_init(&d);
    daemon_option(&d, "worker-timeout", "1"); // pulses come every 0.1 s
    daemon_start(&d);
    peer_open_scene(&p, &d, "");
    built_scene_make(&p);
    const pid_t worker = daemon_worker(&d, 0);
    daemon_signal(&d, SIGSTOP);
    kill(worker, SIGSTOP);
    hg_clock_sleep_ns(2000000000u);
    daemon_signal(&d, SIGCONT);
    for (int i = 0; i < 3; i++) { // rounds of the daemon
        peer_call(&p, HGP_T_sessions_query, &(struct hgp_sessions_query){0}, HGP_T_json);
        hg_clock_sleep_ns(50000000u);
    }
    kill(worker, SIGCONT);
    built_scene_frame(&p, &frame, digest);
    assert_int_equal(daemon_worker(&d, 0), worker);
    peer_close(&p);
    daemon_finish(&d);
}

static void endless_step_is_replaced(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    daemon_init(&d);
    daemon_option(&d, "hang-timeout", "0.5");
    daemon_option(&d, "restart-delay", "0.01");
    daemon_start(&d);
    peer_open_scene(&p, &d, "");
    built_scene_make(&p);
    // Its pulses go on, but say that one step does not end. The frame came; the next one does too.
    pid_t worker = daemon_worker(&d, 0);
    struct hgp_frame before, after;
    uint8_t digest_before[32], digest_after[32];
    daemon_write(&d, "busy.frame_request", "");
    built_scene_frame(&p, &before, digest_before);
    daemon_worker(&d, worker);
    built_scene_frame(&p, &after, digest_after);
    assert_memory_equal(digest_before, digest_after, 32);
    peer_close(&p);
    daemon_finish(&d);
}

static void edits_under_way_happen_once(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    start(&d);
    peer_open_scene(&p, &d, "");
    // 200 edits in one go; the worker dies at the 3rd light, of which there is one in ten.
    uint32_t first = p.next_request;
    daemon_write(&d, "die.light_set", "");
    for (uint32_t i = 0; i < 200; i++) {
        if (i % 10 == 9)
            peer_send(&p, HGP_T_light_set, &(struct hgp_light_set){.light = p.first_id + i});
        else
            peer_send(&p, HGP_T_node_set, &(struct hgp_node_set){.node = p.first_id + i});
    }
    for (uint32_t i = 0; i < 200; i++) {
        peer_answer(&p, first + i, HGP_T_ok);
        assert_int_equal(p.m.ok.revision, i + 1); // none lost, none twice
    }
    peer_close(&p);
    daemon_finish(&d);
}

static void poison_is_given_up(void **state)
{
    (void)state;
    struct daemon d;
    struct peer bad, good;
    start(&d);
    peer_open_scene(&good, &d, "");
    built_scene_make(&good);
    struct hgp_frame frame;
    uint8_t digest_before[32], digest_after[32];
    built_scene_frame(&good, &frame, digest_before);
    peer_call(&good, HGP_T_view_set,
        &(struct hgp_view_set){.view = 1, .has_seed = true, .seed = 100}, HGP_T_ok);
    built_scene_frame(&good, &frame, digest_before);
    daemon_write(&d, "kill.variant_set", "");
    peer_open_scene(&bad, &d, "");
    uint32_t waiting =
        peer_send(&good, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1});
    uint32_t poison =
        peer_send(&bad, HGP_T_variant_set, &(struct hgp_variant_set){.asset = bad.first_id});
    uint32_t after = peer_send(&bad, HGP_T_node_set, &(struct hgp_node_set){.node = bad.first_id});
    peer_error(&bad, poison, HG_E_WORKER);
    peer_answer(&bad, after, HGP_T_ok); // what came behind it is not lost
    peer_answer(&good, waiting, HGP_T_frame);
    memcpy(digest_after, good.m.frame.data.data, 32);
    assert_memory_equal(digest_before, digest_after, 32);
    assert_int_equal(daemon_file_size(&d, "count.variant_set"), 2); // twice, never a third time
    peer_close(&bad);
    peer_close(&good);
    daemon_finish(&d);
}

static void crash_loop_ends_sessions_not_the_daemon(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    daemon_init(&d);
    daemon_option(&d, "restart-delay", "0.01");
    daemon_option(&d, "crash-limit", "3");
    daemon_start(&d);
    peer_open_scene(&p, &d, "");
    peer_call(&p, HGP_T_node_set, &(struct hgp_node_set){.node = p.first_id}, HGP_T_ok);
    daemon_write(&d, "kill.start", "");
    kill(daemon_worker(&d, 0), SIGKILL);
    bool told = false;
    while (peer_next(&p))
        told |= p.header.type == HGP_T_error && p.m.error.code == HG_E_WORKER;
    assert_true(told);
    peer_close(&p);
    peer_open(&p, &d); // the daemon lives
    peer_call(&p, HGP_T_ping, &(struct hgp_ping){.nonce = 1}, HGP_T_pong);
    peer_close(&p);
    daemon_finish(&d);
}

static void lethal_scene_is_given_up_alone(void **state)
{
    (void)state;
    struct daemon d;
    struct peer bad, good;
    start(&d);
    peer_open_scene(&good, &d, "");
    peer_call(&good, HGP_T_node_set, &(struct hgp_node_set){.node = good.first_id}, HGP_T_ok);
    peer_open_scene(&bad, &d, "");
    peer_call(&bad, HGP_T_light_set, &(struct hgp_light_set){.light = bad.first_id}, HGP_T_ok);
    daemon_write(&d, "kill.light_set", ""); // from now on this scene cannot be built
    kill(daemon_worker(&d, 0), SIGKILL);
    peer_end(&bad);
    peer_call(&good, HGP_T_node_set, &(struct hgp_node_set){.node = good.first_id + 1}, HGP_T_ok);
    assert_int_equal(good.m.ok.revision, 2);
    peer_close(&bad);
    peer_close(&good);
    daemon_finish(&d);
}

static void two_sessions_keep_their_scene(void **state)
{
    (void)state;
    struct daemon d;
    struct peer a, b;
    struct hgp_frame frame;
    uint8_t digest_a[32], digest_b[32];
    start(&d);
    peer_open_scene(&a, &d, "hall");
    peer_open_scene(&b, &d, "hall");
    built_scene_make(&a);
    built_scene_make(&b);
    uint64_t revision = b.m.ok.revision; // of its last view_set: all edits of both
    pid_t worker = daemon_worker(&d, 0);
    kill(worker, SIGKILL);
    built_scene_frame(&a, &frame, digest_a);
    built_scene_frame(&b, &frame, digest_b);
    assert_int_equal(frame.scene_revision, revision);
    worker = daemon_worker(&d, worker);
    uint8_t again[32];
    kill(worker, SIGKILL);
    built_scene_frame(&b, &frame, again);
    assert_memory_equal(digest_b, again, 32);
    // A batch that was open stays open: its end is no error.
    peer_call(&a, HGP_T_batch_begin, &(struct hgp_batch_begin){0}, HGP_T_ok);
    kill(daemon_worker(&d, worker), SIGKILL);
    peer_call(&a, HGP_T_batch_end, &(struct hgp_batch_end){0}, HGP_T_ok);
    peer_close(&a);
    peer_close(&b);
    daemon_finish(&d);
}

static void killed_while_loading(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    start(&d);
    peer_open_scene(&p, &d, "");
    uint32_t load = peer_send(&p, HGP_T_asset_load,
        &(struct hgp_asset_load){.asset = p.first_id, .path = hgp_str_make("slow=300")});
    // Everything behind it waits, views and cameras included.
    uint32_t view = peer_send(&p, HGP_T_view_set,
        &(struct hgp_view_set){
            .view = 1, .has_width = true, .width = 8, .has_height = true, .height = 8});
    for (uint32_t i = 1; i <= 1000; i++)
        peer_tell(&p, HGP_T_view_camera, &(struct hgp_view_camera){.view = 1, .input_seq = i});
    uint32_t frame = peer_send(&p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1});
    assert_true(peer_next(&p)); // progress of the load
    assert_int_equal(p.header.type, HGP_T_progress);
    kill(daemon_worker(&d, 0), SIGKILL);
    peer_answer(&p, load, HGP_T_asset_loaded);
    peer_answer(&p, view, HGP_T_ok);
    peer_answer(&p, frame, HGP_T_frame);
    assert_int_equal(p.m.frame.input_seq, 1000);
    peer_close(&p);
    daemon_finish(&d);
}

// Nothing is waited for: a view is closed and made again before the first answer comes.
static void views_closed_and_made_again(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    struct hgp_frame frame;
    uint8_t before[32], after[32];
    start(&d);
    peer_open_scene(&p, &d, "");
    struct hgp_view_set m = {
        .view = 1, .has_width = true, .width = 8, .has_height = true, .height = 8};
    peer_send(&p, HGP_T_view_set, &m);
    peer_tell(&p, HGP_T_view_camera, &(struct hgp_view_camera){.view = 1, .input_seq = 5});
    peer_send(&p, HGP_T_view_close, &(struct hgp_view_close){.view = 1});
    m.width = 16;
    peer_send(&p, HGP_T_view_set, &m);
    built_scene_frame(&p, &frame, before);
    assert_int_equal(frame.width, 16);
    assert_int_equal(frame.input_seq, 0); // the camera went with the first view
    kill(daemon_worker(&d, 0), SIGKILL);
    built_scene_frame(&p, &frame, after);
    assert_memory_equal(before, after, 32);
    peer_call(&p, HGP_T_view_close, &(struct hgp_view_close){.view = 1}, HGP_T_ok);
    peer_refused(&p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HG_E_NOTFOUND);
    peer_close(&p);
    daemon_finish(&d);
}

static void send_overrides(struct peer *p, uint32_t count, bool clear, bool refused)
{
    static struct hgp_node_override items[4096];
    struct hgp_view_overrides m = {.view = 1, .has_clear = true, .clear = clear};
    for (uint32_t i = 0; i < count; i++)
        items[i] = (struct hgp_node_override){.node = i + 1, .set = 1, .hidden = true};
    m.overrides.items = items;
    m.overrides.count = count;
    if (refused)
        peer_refused(p, HGP_T_view_overrides, &m, HG_E_LIMIT);
    else
        peer_call(p, HGP_T_view_overrides, &m, HGP_T_ok);
}

// How a view shows the scene is in a new worker as it was, and takes a limited room in the daemon.
static void looks_of_views(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    struct hgp_frame frame;
    uint8_t plain[32], before[32], after[32];
    struct hgp_clip_plane plane = {.normal = {0, 0, 1}, .distance = 1};
    struct hgp_view_clip clip = {.view = 1};
    clip.planes.items = &plane;
    clip.planes.count = 1;
    start(&d);
    peer_open_scene(&p, &d, "");
    peer_refused(&p, HGP_T_view_clip, &clip, HG_E_NOTFOUND);
    peer_call(&p, HGP_T_view_set,
        &(struct hgp_view_set){
            .view = 1, .has_width = true, .width = 8, .has_height = true, .height = 8},
        HGP_T_ok);
    built_scene_frame(&p, &frame, plain);
    peer_call(&p, HGP_T_view_clip, &clip, HGP_T_ok);
    plane.distance = 2;
    peer_call(&p, HGP_T_view_clip, &clip, HGP_T_ok);
    send_overrides(&p, 3, false, false);
    send_overrides(&p, 2, false, false);
    built_scene_frame(&p, &frame, before);
    assert_memory_not_equal(plain, before, 32);
    kill(daemon_worker(&d, 0), SIGKILL);
    built_scene_frame(&p, &frame, after);
    assert_memory_equal(before, after, 32);
    for (int i = 0; i < 33; i++) // of 126,992 bytes each, in 4 MiB
        send_overrides(&p, 4096, false, false);
    send_overrides(&p, 4096, false, true);
    send_overrides(&p, 4096, true, false); // in place of all before
    send_overrides(&p, 4096, false, false);
    peer_close(&p);
    daemon_finish(&d);
}

// A client that sent edits and left is represented until they are in the scene, even when the
// worker dies over them; then nothing of its session stays.
static void edits_of_a_client_that_left(void **state)
{
    (void)state;
    struct daemon d;
    struct peer a, b;
    struct hgp_frame frame;
    uint8_t before[32], after[32];
    daemon_init(&d);
    daemon_option(&d, "worker-timeout", "3"); // pulses come every 0.1 s
    daemon_option(&d, "restart-delay", "0.01");
    daemon_start(&d);
    peer_open_scene(&a, &d, "hall");
    peer_call(&a, HGP_T_view_set,
        &(struct hgp_view_set){
            .view = 1, .has_width = true, .width = 8, .has_height = true, .height = 8},
        HGP_T_ok);
    built_scene_frame(&a, &frame, before);
    peer_open_scene(&b, &d, "hall");
    daemon_write(&d, "hang.node_set", "");
    peer_tell(&b, HGP_T_node_set, &(struct hgp_node_set){.node = b.first_id});
    peer_tell(&b, HGP_T_node_set, &(struct hgp_node_set){.node = b.first_id + 1});
    peer_close(&b);
    daemon_wait_log(&d, "worker-timeout");
    do
        built_scene_frame(&a, &frame, after);
    while (frame.scene_revision < 2);
    assert_true(memcmp(before, after, 32) != 0);
    peer_call(&a, HGP_T_sessions_query, &(struct hgp_sessions_query){0}, HGP_T_json);
    assert_non_null(memmem(a.m.json.text.data, a.m.json.text.size, "\"sessions\":1,", 13));
    assert_null(memmem(a.m.json.text.data, a.m.json.text.size, "\"peer\":\"\"", 9));
    // One whose edit is poison goes, too.
    peer_open_scene(&b, &d, "hall");
    daemon_write(&d, "kill.variant_set", "");
    peer_tell(&b, HGP_T_variant_set, &(struct hgp_variant_set){.asset = b.first_id});
    peer_close(&b);
    daemon_wait_log(&d, "it is not tried again");
    built_scene_frame(&a, &frame, before);
    assert_memory_equal(before, after, 32);
    peer_call(&a, HGP_T_sessions_query, &(struct hgp_sessions_query){0}, HGP_T_json);
    assert_non_null(memmem(a.m.json.text.data, a.m.json.text.size, "\"sessions\":1,", 13));
    peer_close(&a);
    daemon_finish(&d);
}

// What a worker had of a file to be verified went with it, and counts no more.
static void files_that_were_verified(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p, q;
    char wire[TEST_FOLDER_MAX + 32];
    const struct hgp_bytes one = {(const uint8_t *)"x", 1};
    const struct hgp_image_query first = {
        .data = one, .has_offset = true, .has_size = true, .size = 600000};
    struct hgp_image_query next = first;
    next.offset = 1;
    daemon_init(&d);
    daemon_option(&d, "restart-delay", "0.01");
    daemon_option(&d, "upload-store", "1");
    daemon_start(&d);
    peer_open_scene(&p, &d, "");
    peer_open_scene(&q, &d, "");
    peer_call(&p, HGP_T_image_query, &first, HGP_T_ok);
    peer_refused(&q, HGP_T_image_query, &first, HG_E_LIMIT);
    const pid_t worker = daemon_worker(&d, 0);
    kill(worker, SIGKILL); // between two parts
    daemon_worker(&d, worker);
    peer_call(&q, HGP_T_image_query, &first, HGP_T_ok);
    peer_refused(&p, HGP_T_image_query, &next, HG_E_INVAL);
    daemon_write(&d, "kill.image_query", "");
    peer_refused(&q, HGP_T_image_query, &first, HG_E_WORKER); // given up
    snprintf(wire, sizeof wire, "%s/kill.image_query", d.folder);
    assert_int_equal(unlink(wire), 0);
    peer_refused(&p, HGP_T_image_query, &first, HG_E_WORKER); // in quarantine
    peer_call(&p, HGP_T_quarantine_clear, &(struct hgp_quarantine_clear){0}, HGP_T_ok);
    peer_call(&p, HGP_T_image_query, &first, HGP_T_ok);
    daemon_write(&d, "die.image_query", "");
    peer_call(&p, HGP_T_image_query, &first, HGP_T_ok); // asked again, and still counts
    peer_refused(&q, HGP_T_image_query, &first, HG_E_LIMIT);
    peer_close(&q);
    peer_close(&p);
    daemon_finish(&d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(killed_in_a_frame),
        cmocka_unit_test(killed_from_outside_with_subscription),
        cmocka_unit_test(hung_loop_is_replaced),
        cmocka_unit_test(standstill_of_all_is_no_silence),
        cmocka_unit_test(endless_step_is_replaced),
        cmocka_unit_test(edits_under_way_happen_once),
        cmocka_unit_test(poison_is_given_up),
        cmocka_unit_test(crash_loop_ends_sessions_not_the_daemon),
        cmocka_unit_test(lethal_scene_is_given_up_alone),
        cmocka_unit_test(two_sessions_keep_their_scene),
        cmocka_unit_test(killed_while_loading),
        cmocka_unit_test(looks_of_views),
        cmocka_unit_test(views_closed_and_made_again),
        cmocka_unit_test(edits_of_a_client_that_left),
        cmocka_unit_test(files_that_were_verified),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
