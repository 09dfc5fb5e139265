// libhelio against a fake worker and a fake daemon: blocking, non-blocking, hostile peers.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <dirent.h>
#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/clock.h"
#include "client/include/helio/helio.h"
#include "tests/unit/client/harness.h"

static struct harness h;
static char url[128];

#define SECOND UINT64_C(1000000000)

static struct helio *connect_good(const struct helio_options *options)
{
    struct helio *c;
    struct hg_error err = {0};
    if (helio_connect(options, &c, &err))
        fail_msg("%s: %s: %s", err.what, err.where, err.reason);
    return c;
}

static void test_blocking(void **state)
{
    (void)state;
    harness_serve(&h, "stray=1 dribble=1");
    struct helio *c = connect_good(&(struct helio_options){.url = url});
    struct helio_info info;
    helio_get_info(c, &info);
    assert_int_equal(info.state, HELIO_OPEN);
    assert_int_equal(info.session, 7);
    assert_string_equal(info.server, "fake/1");
    struct hg_error err = {0};
    struct hgp_scene_opened scene;
    assert_int_equal(helio_scene_open(c, "", &scene, &err), HG_OK);
    assert_int_equal(scene.id_count, 1000);
    struct hgp_asset_loaded loaded;
    assert_int_equal(helio_load(c, 4, "x.glb", &loaded, &err), HG_OK);
    assert_int_equal(loaded.asset, 4);
    struct helio_message *frame;
    struct hgp_frame_request request = {.view = 1, .settled = true};
    assert_int_equal(helio_frame(c, &request, &frame, &err), HG_OK);
    assert_int_equal(frame->body->frame.data.size, strlen("frame 1 as RAW_RGBA8\n"));
    helio_message_free(frame);
    char *text;
    assert_int_equal(helio_query_json(c, HGP_T_stats_query, 0, &text, &err), HG_OK);
    assert_non_null(strstr(text, "fake"));
    helio_text_free(text);
    uint64_t rtt;
    assert_int_equal(helio_ping(c, &rtt, &err), HG_OK);
    assert_true(rtt > 0);
    // the stray notices of request 0 waited here
    struct helio_message *m;
    int strays = 0;
    while (helio_next(c, &m, &err) == HG_OK) {
        assert_int_equal(m->type, HGP_T_notice);
        strays++;
        helio_message_free(m);
    }
    assert_true(strays >= 5);
    helio_destroy(c);
}

static void test_send_refusals(void **state)
{
    (void)state;
    harness_serve(&h, "");
    struct helio *c = connect_good(&(struct helio_options){.url = url});
    struct hg_error err = {0};
    uint32_t request = 9;
    // not a client's message; a field out of range; larger than the peer takes
    assert_int_equal(
        helio_send(c, HGP_T_frame, &(struct hgp_frame){0}, &request, &err), HG_E_INVAL);
    assert_int_equal(request, 0);
    assert_int_equal(helio_send(c, HGP_T_hello, &(struct hgp_hello){0}, NULL, &err), HG_E_INVAL);
    assert_int_equal(helio_send(c, (enum hgp_type)0x7777, &request, NULL, &err), HG_E_INVAL);
    struct hgp_view_set view = {.view = 1, .has_width = true, .width = 20000};
    assert_int_equal(helio_call(c, HGP_T_view_set, &view, NULL, &err), HG_E_INVAL);
    assert_string_equal(err.where, "width");
    static uint8_t big[2 << 20];
    struct hgp_compare compare = {.a = {big, sizeof big}, .b = {big, 1}};
    assert_int_equal(helio_call(c, HGP_T_compare, &compare, NULL, &err), HG_E_LIMIT);
    uint64_t rtt;
    assert_int_equal(helio_ping(c, &rtt, &err), HG_OK); // the connection has not suffered
    assert_int_equal(
        helio_call_for(c, HGP_T_ping, &(struct hgp_ping){0}, HGP_T_ok, NULL, &err), HG_E_FORMAT);
    helio_destroy(c);
}

// Everything through fd, want-write and process, never a blocking call.
static void drive(struct helio *c, bool (*done)(struct helio *c))
{
    uint64_t end = hg_clock_now_ns() + 60 * SECOND;
    struct hg_error err = {0};
    while (!done(c)) {
        struct pollfd p = {
            .fd = helio_fd(c), .events = (short)(POLLIN | (helio_want_write(c) ? POLLOUT : 0))};
        assert_true(poll(&p, 1, 1000) >= 0);
        assert_int_equal(helio_process(c, &err), HG_OK);
        assert_true(hg_clock_now_ns() < end);
    }
}

static bool is_open(struct helio *c)
{
    struct helio_info info;
    helio_get_info(c, &info);
    return info.state == HELIO_OPEN;
}

static uint32_t wanted;
static struct helio_message *found;

static bool is_answered(struct helio *c)
{
    struct helio_message *m;
    while (!found && helio_next(c, &m, NULL) == HG_OK) {
        if (m->request == wanted && m->type != HGP_T_progress && m->type != HGP_T_notice)
            found = m;
        else
            helio_message_free(m);
    }
    return found != NULL;
}

static void test_non_blocking(void **state)
{
    (void)state;
    harness_serve(&h, "dribble=1 stray=1");
    struct helio *c;
    struct hg_error err = {0};
    assert_int_equal(helio_start(&(struct helio_options){.url = url}, &c, &err), HG_OK);
    assert_int_equal(
        helio_send(c, HGP_T_scene_close, &(struct hgp_scene_close){0}, NULL, &err), HG_E_STATE);
    drive(c, is_open);
    struct hgp_frame_request request = {
        .view = 1, .has_encoding = true, .encoding = HGP_encoding_PNG8};
    for (int i = 0; i < 3; i++) {
        found = NULL;
        assert_int_equal(helio_send(c, HGP_T_frame_request, &request, &wanted, &err), HG_OK);
        drive(c, is_answered);
        assert_int_equal(found->type, HGP_T_frame);
        helio_message_free(found);
    }
    struct helio_message *m;
    while (helio_next(c, &m, NULL) == HG_OK)
        helio_message_free(m);
    assert_int_equal(helio_next(c, &m, NULL), HG_E_AGAIN);
    kill(h.server_pid, 0);
    helio_destroy(c);
}

// A peer that does not read: sending says AGAIN instead of blocking or growing without end.
static void test_back_pressure(void **state)
{
    (void)state;
    int pair[2];
    char path[128];
    snprintf(path, sizeof path, "%s/slow", h.folder);
    struct sockaddr_un sa = {.sun_family = AF_UNIX};
    snprintf(sa.sun_path, sizeof sa.sun_path, "%.100s", path);
    pair[0] = socket(AF_UNIX, SOCK_STREAM, 0);
    assert_int_equal(bind(pair[0], (struct sockaddr *)&sa, sizeof sa), 0);
    assert_int_equal(listen(pair[0], 1), 0);
    char slow_url[140];
    snprintf(slow_url, sizeof slow_url, "unix:%s", path);
    struct helio *c;
    struct hg_error err = {0};
    assert_int_equal(helio_start(&(struct helio_options){.url = slow_url}, &c, &err), HG_OK);
    pair[1] = accept(pair[0], NULL, NULL);
    struct hg_writer w = {0};
    struct hgp_welcome welcome = {.version = 1, .max_message_bytes = 1u << 30};
    assert_int_equal(
        hgp_encode(&w, 1, (struct hgp_envelope){HGP_T_welcome, 0, 0}, &welcome, NULL), HG_OK);
    assert_int_equal(send(pair[1], w.data, w.size, 0), (ssize_t)w.size);
    hg_writer_finish(&w);
    drive(c, is_open);
    // 8 MiB wait at most; what the system holds besides is not the client's.
    int buffer = 0;
    socklen_t length = sizeof buffer;
    assert_int_equal(getsockopt(helio_fd(c), SOL_SOCKET, SO_SNDBUF, &buffer, &length), 0);
    static uint8_t bytes[1 << 20];
    struct hgp_upload piece = {.total = 1 << 30, .data = {bytes, sizeof bytes}};
    const int most = 12 + buffer / (int)sizeof bytes;
    int sent = 0;
    enum hg_status status;
    while ((status = helio_send(c, HGP_T_upload, &piece, NULL, &err)) == HG_OK && sent <= most) {
        sent++;
        assert_int_equal(helio_process(c, &err), HG_OK);
    }
    assert_int_equal(status, HG_E_AGAIN);
    assert_true(sent >= 8 && sent <= most);
    assert_true(helio_want_write(c));
    helio_set_timeout(c, SECOND / 20);
    assert_int_equal(helio_flush(c, &err), HG_E_TIMEOUT);
    helio_destroy(c);
    close(pair[0]);
    close(pair[1]);
}

static void test_worker(void **state)
{
    (void)state;
    struct helio *c = connect_good(&(struct helio_options){0});
    struct helio_info info;
    struct hg_error err = {0};
    struct hgp_scene_opened scene;
    helio_get_info(c, &info);
    assert_true(info.worker_pid > 0);
    assert_string_equal(info.device, "{}");
    assert_int_equal(helio_scene_open(c, "", &scene, &err), HG_OK);
    assert_int_equal(scene.first_id, 1);
    assert_int_equal(helio_scene_open(c, "shared", &scene, &err), HG_E_UNSUPPORTED);
    assert_int_equal(helio_scene_open(c, "", &scene, &err), HG_E_STATE);
    const struct hgp_scene_close leave = {0};
    assert_int_equal(helio_call_for(c, HGP_T_scene_close, &leave, HGP_T_ok, NULL, &err), HG_OK);
    assert_int_equal(helio_scene_open(c, "", &scene, &err), HG_OK);
    kill(info.worker_pid, SIGKILL);
    uint64_t rtt;
    assert_int_equal(helio_ping(c, &rtt, &err), HG_E_WORKER);
    assert_non_null(strstr(err.reason, "signal 9"));
    assert_int_equal(helio_ping(c, &rtt, &err), HG_E_WORKER); // it stays so
    assert_int_equal(helio_fd(c), -1);
    helio_destroy(c);
    // destroying a connection ends its worker
    c = connect_good(&(struct helio_options){0});
    helio_get_info(c, &info);
    helio_destroy(c);
    assert_true(kill(info.worker_pid, 0) && errno == ESRCH);
}

// A program that never takes messages may work with a worker for as long as it likes.
static void test_signs_of_life(void **state)
{
    (void)state;
    setenv("FAKE", "alive=100", 1);
    struct helio *c = connect_good(&(struct helio_options){0});
    struct helio_message *m;
    struct hg_error err = {0};
    uint64_t rtt;
    for (int i = 0; i < 4; i++) // more of them than the queue holds
        if (helio_ping(c, &rtt, &err))
            fail_msg("%s: %s", err.what, err.reason);
    assert_int_equal(helio_next(c, &m, &err), HG_E_AGAIN);
    helio_destroy(c);
    unsetenv("FAKE");
}

static void count(void *user)
{
    ++*(int *)user;
}

// Progress is reported at least once a second, also while keep-alives arrive.
static void test_ticks(void **state)
{
    (void)state;
    int ticks = 0;
    uint64_t rtt;
    struct hg_error err = {0};
    setenv("FAKE", "alive=8 beat=200", 1);
    struct helio *c = connect_good(&(struct helio_options){0});
    helio_set_handlers(c, &(struct helio_handlers){.user = &ticks, .tick = count});
    assert_int_equal(helio_ping(c, &rtt, &err), HG_OK);
    assert_true(ticks > 0);
    helio_destroy(c);
    unsetenv("FAKE");
}

static void test_tokens(void **state)
{
    (void)state;
    harness_serve(&h, "token=secret");
    struct helio *c;
    struct hg_error err = {0};
    assert_int_equal(helio_connect(&(struct helio_options){.url = url}, &c, &err), HG_E_AUTH);
    assert_null(c);
    assert_int_equal(
        helio_connect(&(struct helio_options){.url = url, .token = "x"}, &c, &err), HG_E_AUTH);
    c = connect_good(&(struct helio_options){.url = url, .token = "secret"});
    struct helio_info info;
    helio_get_info(c, &info);
    assert_int_equal(info.role, HGP_role_EDIT);
    helio_destroy(c);
}

static void *interrupt_later(void *user)
{
    hg_clock_sleep_ns(SECOND / 20);
    helio_interrupt(user);
    return NULL;
}

static void test_interrupt_and_timeout(void **state)
{
    (void)state;
    harness_serve(&h, "silent=ping");
    struct helio *c = connect_good(&(struct helio_options){.url = url});
    struct hg_error err = {0};
    uint64_t rtt;
    pthread_t thread;
    assert_int_equal(pthread_create(&thread, NULL, interrupt_later, c), 0);
    assert_int_equal(helio_ping(c, &rtt, &err), HG_E_CANCELLED);
    pthread_join(thread, NULL);
    helio_set_timeout(c, SECOND / 20);
    assert_int_equal(helio_ping(c, &rtt, &err), HG_E_TIMEOUT);
    helio_destroy(c);
    harness_serve(&h, "silent=hello");
    assert_int_equal(
        helio_connect(&(struct helio_options){.url = url, .timeout_ns = SECOND / 20}, &c, &err),
        HG_E_TIMEOUT);
}

// A frame that a call gave up is not rendered to its end.
static void test_cancelled_frames(void **state)
{
    (void)state;
    harness_serve(&h, "silent=frame_request log=cancelled");
    struct helio *c = connect_good(&(struct helio_options){.url = url});
    const struct hgp_frame_request request = {.view = 7, .settled = true};
    struct helio_message *m;
    struct hg_error err = {0};
    char expected[64];
    uint32_t id;
    uint64_t rtt;
    helio_set_timeout(c, SECOND / 20);
    assert_int_equal(helio_frame(c, &request, &m, &err), HG_E_TIMEOUT);
    helio_set_timeout(c, 60 * SECOND);
    assert_int_equal(helio_ping(c, &rtt, &err), HG_OK); // the peer has read all before it
    assert_int_equal(helio_next(c, &m, &err), HG_E_AGAIN);
    assert_int_equal(helio_send(c, HGP_T_ping, &(struct hgp_ping){0}, &id, &err), HG_OK);
    // Three requests ago: the cancel and the ping lie between.
    snprintf(expected, sizeof expected, "frame_cancel view=7 request=%u\n", id - 3);
    assert_true(harness_read(&h, "cancelled"));
    assert_non_null(strstr(h.output, expected));
    helio_destroy(c);
}

// What comes for a call that is over already is for no one.
static void test_late_answers(void **state)
{
    (void)state;
    harness_serve(&h, "late=ping");
    struct helio *c = connect_good(&(struct helio_options){.url = url});
    struct helio_message *m;
    struct hgp_scene_opened scene;
    struct hg_error err = {0};
    uint64_t rtt;
    for (int i = 0; i < 3; i++) {
        helio_interrupt(c);
        assert_int_equal(helio_ping(c, &rtt, &err), HG_E_CANCELLED);
        assert_int_equal(helio_scene_open(c, "", &scene, &err), HG_OK);
        assert_int_equal(helio_next(c, &m, &err), HG_E_AGAIN);
    }
    helio_destroy(c);
}

static void note(void *user, const struct hgp_notice *notice)
{
    *(int *)user = notice->code;
}

// A message that wants no answer and is refused: a worker's session goes on, as a daemon's does.
static void test_refused_without_a_request(void **state)
{
    (void)state;
    int code = 0;
    uint64_t rtt;
    struct hg_error err = {0};
    struct hgp_view_camera camera = {.view = 1, .has_camera = true, .camera = 7};
    setenv("FAKE", "fail=view_camera:8", 1);
    struct helio *c = connect_good(&(struct helio_options){0});
    helio_set_handlers(c, &(struct helio_handlers){.user = &code, .notice = note});
    assert_int_equal(helio_send(c, HGP_T_view_camera, &camera, NULL, &err), HG_OK);
    if (helio_ping(c, &rtt, &err))
        fail_msg("%s: %s", err.what, err.reason);
    assert_int_equal(code, HG_E_NOTFOUND);
    helio_destroy(c);
    unsetenv("FAKE");
}

// ---- hostile peers -----------------------------------------------------------------------------

// Talks to a peer that sends exactly these bytes and closes. Nothing may crash or hang.
static void face(const uint8_t *data, size_t size)
{
    char path[160];
    snprintf(path, sizeof path, "%s/hostile", h.folder);
    harness_write(&h, "hostile", data, size);
    struct helio *c = NULL;
    struct hg_error err = {0};
    enum hg_status status =
        helio_connect(&(struct helio_options){.url = url, .timeout_ns = 60 * SECOND}, &c, &err);
    struct helio_message *m;
    if (status == HG_OK) {
        struct hgp_frame_request request = {.view = 1};
        helio_set_timeout(c, 60 * SECOND);
        status = helio_frame(c, &request, &m, &err);
        if (status == HG_OK)
            helio_message_free(m);
        while (helio_next(c, &m, &err) == HG_OK)
            helio_message_free(m);
    }
    if (status != HG_OK)
        assert_true(err.status == status && err.reason[0]);
    assert_int_not_equal(status, HG_E_TIMEOUT);
    helio_destroy(c);
}

// welcome, then what a server could send in answer to request 1.
static size_t good_conversation(uint8_t *out, size_t room)
{
    struct hg_writer w = {0};
    struct hgp_text capability = {.value = hgp_str_make("x")};
    struct hgp_welcome welcome = {.version = 1,
        .server = hgp_str_make("s"),
        .role = 2,
        .max_message_bytes = 65536,
        .capabilities = {&capability, 1}};
    struct hgp_notice notice = {.reason = hgp_str_make("why")};
    struct hgp_stage_time stage = {.name = hgp_str_make("a"), .ns = 1};
    struct hgp_frame frame = {.view = 1,
        .width = 1,
        .height = 1,
        .stages = {&stage, 1},
        .has_hash = true,
        .data = {(const uint8_t *)"1234", 4}};
    struct hgp_node_entry node = {.node = 1, .name = hgp_str_make("n")};
    struct hgp_nodes nodes = {.total = 1, .nodes = {&node, 1}};
    assert_int_equal(
        hgp_encode(&w, 1, (struct hgp_envelope){HGP_T_welcome, 0, 0}, &welcome, NULL), HG_OK);
    assert_int_equal(
        hgp_encode(&w, 1, (struct hgp_envelope){HGP_T_notice, 1, 0}, &notice, NULL), HG_OK);
    assert_int_equal(
        hgp_encode(&w, 1, (struct hgp_envelope){HGP_T_nodes, 9, 0}, &nodes, NULL), HG_OK);
    assert_int_equal(
        hgp_encode(&w, 1, (struct hgp_envelope){HGP_T_ping, 0, 0}, &(struct hgp_ping){0}, NULL),
        HG_OK);
    assert_int_equal(
        hgp_encode(&w, 1, (struct hgp_envelope){HGP_T_frame, 1, 0}, &frame, NULL), HG_OK);
    assert_true(w.size < room);
    memcpy(out, w.data, w.size);
    size_t size = w.size;
    hg_writer_finish(&w);
    return size;
}

static void serve_hostile(void)
{
    char fake[128];
    snprintf(fake, sizeof fake, "file=%s/hostile", h.folder);
    harness_serve(&h, fake);
}

static void test_every_prefix(void **state)
{
    (void)state;
    uint8_t bytes[1024];
    size_t size = good_conversation(bytes, sizeof bytes);
    serve_hostile();
    for (size_t n = 0; n <= size; n++)
        face(bytes, n);
}

static void test_mutations(void **state)
{
    (void)state;
    uint8_t good[1024], bytes[1024];
    size_t size = good_conversation(good, sizeof good);
    uint32_t seed = 1;
    serve_hostile();
    for (int round = 0; round < 600; round++) {
        memcpy(bytes, good, size);
        for (int i = 0; i <= round % 4; i++) {
            seed = seed * 1664525u + 1013904223u;
            bytes[(seed >> 8) % size] = (uint8_t)(seed >> 24);
        }
        face(bytes, size);
    }
}

// The fuzz corpus of server messages, behind a good welcome.
static void test_corpus(void **state)
{
    (void)state;
    char folder[512];
    snprintf(folder, sizeof folder, "%s/tests/fuzz/corpus/hgp_s2c", getenv("HELIO_SOURCE_DIR"));
    DIR *dir = opendir(folder);
    if (!dir)
        fail_msg("%s is missing", folder);
    int files = 0;
    serve_hostile();
    for (struct dirent *e; (e = readdir(dir));) {
        char path[1024];
        static uint8_t bytes[65536];
        snprintf(path, sizeof path, "%s/%.255s", folder, e->d_name);
        FILE *in = e->d_name[0] == '.' ? NULL : fopen(path, "rb");
        if (!in)
            continue;
        struct hg_writer w = {0};
        struct hgp_welcome welcome = {.version = 1, .max_message_bytes = 65536};
        assert_int_equal(
            hgp_encode(&w, 1, (struct hgp_envelope){HGP_T_welcome, 0, 0}, &welcome, NULL), HG_OK);
        memcpy(bytes, w.data, w.size);
        size_t n = w.size + fread(bytes + w.size, 1, sizeof bytes - w.size, in);
        hg_writer_finish(&w);
        fclose(in);
        face(bytes, n);
        files++;
    }
    closedir(dir);
    assert_true(files > 10);
}

// Connecting and one call with the n-th allocation failing, until none is left to fail.
static void test_allocation_failures(void **state)
{
    (void)state;
    harness_serve(&h, "");
    enum hg_status status = HG_E_NOMEM;
    int rounds = 0;
    for (uint64_t n = 1; status != HG_OK; n++, rounds++) {
        struct helio *c = NULL;
        struct hg_error err = {0};
        uint64_t rtt;
        hg_alloc_fail_at(n);
        status =
            helio_connect(&(struct helio_options){.url = url, .timeout_ns = 60 * SECOND}, &c, &err);
        if (!status)
            status = helio_ping(c, &rtt, &err);
        hg_alloc_fail_at(0);
        assert_true(status == HG_OK || status == HG_E_NOMEM);
        helio_destroy(c);
        assert_true(n < 1000);
    }
    assert_true(rounds > 3);
}

static int setup(void **state)
{
    (void)state;
    harness_begin(&h);
    snprintf(url, sizeof url, "unix:%s/sock", h.folder);
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
        cmocka_unit_test(test_blocking),
        cmocka_unit_test(test_send_refusals),
        cmocka_unit_test(test_non_blocking),
        cmocka_unit_test(test_back_pressure),
        cmocka_unit_test(test_worker),
        cmocka_unit_test(test_signs_of_life),
        cmocka_unit_test(test_ticks),
        cmocka_unit_test(test_tokens),
        cmocka_unit_test(test_interrupt_and_timeout),
        cmocka_unit_test(test_cancelled_frames),
        cmocka_unit_test(test_late_answers),
        cmocka_unit_test(test_refused_without_a_request),
        cmocka_unit_test(test_every_prefix),
        cmocka_unit_test(test_mutations),
        cmocka_unit_test(test_corpus),
        cmocka_unit_test(test_allocation_failures),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
