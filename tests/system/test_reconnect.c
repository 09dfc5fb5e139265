// test_reconnect.c - libhelio goes on with its session when the connection is lost, or the daemon.
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
#include "client/include/helio/helio.h"
#include "tests/system/daemon.h"

static struct helio *enter(struct daemon *d, uint64_t patience_ns, struct hgp_scene_opened *scene)
{
    struct helio *h;
    struct hg_error err = {0};
    char url[128];
    snprintf(url, sizeof url, "unix:%s/sock", d->folder);
    if (helio_connect(&(struct helio_options){.url = url, .reconnect_ns = patience_ns}, &h, &err))
        fail_msg("%s", err.reason);
    assert_int_equal(helio_scene_open(h, "", scene, &err), HG_OK);
    struct hgp_view_set view = {
        .view = 1, .has_width = true, .width = 16, .has_height = true, .height = 16};
    assert_int_equal(helio_call_for(h, HGP_T_view_set, &view, HGP_T_ok, NULL, &err), HG_OK);
    return h;
}

static void move(struct helio *h, uint32_t node, float x)
{
    struct hg_error err = {0};
    struct hgp_node_set m = {.node = node, .has_translation = true, .translation = {x, 0, 0}};
    if (helio_call_for(h, HGP_T_node_set, &m, HGP_T_ok, NULL, &err))
        fail_msg("%s", err.reason);
}

static void shoot(struct helio *h, uint8_t digest[32])
{
    struct helio_message *frame;
    struct hg_error err = {0};
    if (helio_frame(h, &(struct hgp_frame_request){.view = 1, .settled = true}, &frame, &err))
        fail_msg("%s", err.reason);
    memcpy(digest, frame->body->frame.data.data, 32);
    helio_message_free(frame);
}

static uint32_t reconnects(const struct helio *h)
{
    struct helio_info info;
    helio_get_info(h, &info);
    return info.reconnects;
}

static void init(struct daemon *d)
{
    char path[TEST_FOLDER_MAX + 16];
    daemon_init(d);
    snprintf(path, sizeof path, "%s/state", d->folder);
    daemon_option(d, "state-dir", path);
    daemon_option(d, "restart-delay", "0.01");
}

static void restart(struct daemon *d, bool orderly)
{
    daemon_signal(d, orderly ? SIGTERM : SIGKILL);
    if (orderly) {
        char path[TEST_FOLDER_MAX + 16];
        assert_int_equal(daemon_wait(d), 0);
        snprintf(path, sizeof path, "%s/port", d->folder);
        unlink(path);
    } else {
        daemon_reap(d);
    }
    free(d->args[--d->arg_count]); // port-file, which is added again
    daemon_start(d);
}

// Calls neither fail nor are lost, whatever happens between or below them.
static void calls_go_on(void **state)
{
    (void)state;
    struct daemon d;
    struct hgp_scene_opened scene;
    uint8_t before[32], after[32];
    init(&d);
    daemon_start(&d);
    struct helio *h = enter(&d, 60000000000u, &scene);
    move(h, scene.first_id, 1);
    shoot(h, before);
    shutdown(helio_fd(h), SHUT_RDWR);
    shoot(h, after);
    assert_memory_equal(before, after, 32);
    assert_int_equal(reconnects(h), 1);
    for (int i = 0; i < 2; i++) {
        restart(&d, i == 1);
        shoot(h, after);
        assert_memory_equal(before, after, 32);
        move(h, scene.first_id, 2); // the ids are its own as before
        move(h, scene.first_id, 1);
    }
    assert_int_equal(reconnects(h), 3);
    daemon_write(&d, "hang.frame_request", ""); // under way when the daemon ends
    pid_t successor = fork();
    if (successor == 0) {
        while (daemon_has_file(&d, "hang.frame_request"))
            usleep(1000);
        kill(d.pid, SIGKILL);
        usleep(100000); // until its lock is free
        d.args[d.arg_count] = NULL;
        execv(d.args[0], d.args);
        _exit(1);
    }
    shoot(h, after);
    assert_memory_equal(before, after, 32);
    assert_int_equal(reconnects(h), 4);
    helio_destroy(h);
    daemon_reap(&d);
    d.pid = successor;
    daemon_finish(&d);
}

static void what_may_have_been_done_is_told(void **state)
{
    (void)state;
    struct daemon d;
    struct hgp_scene_opened scene;
    struct hgp_asset_loaded loaded;
    struct hg_error err = {0};
    uint8_t digest[32];
    init(&d);
    daemon_start(&d);
    struct helio *h = enter(&d, 60000000000u, &scene);
    int fd = dup(helio_fd(h));
    pid_t child = fork();
    if (child == 0) {
        while (!daemon_has_file(&d, "count.asset_load"))
            usleep(1000);
        _exit(shutdown(fd, SHUT_RDWR));
    }
    close(fd);
    assert_int_equal(helio_load(h, scene.first_id, "slow=300", &loaded, &err), HG_E_CLOSED);
    assert_non_null(strstr(err.reason, "may have been done"));
    shoot(h, digest);
    assert_int_equal(reconnects(h), 1);
    helio_destroy(h);
    daemon_finish(&d);
}

static void patience_ends(void **state)
{
    (void)state;
    struct daemon d;
    struct hgp_scene_opened scene;
    struct helio_message *frame;
    struct hg_error err = {0};
    init(&d);
    daemon_start(&d);
    struct helio *h = enter(&d, 300000000u, &scene), *without = enter(&d, 0, &scene);
    daemon_signal(&d, SIGKILL);
    daemon_reap(&d);
    struct hgp_frame_request request = {.view = 1};
    uint64_t start_ns = hg_clock_now_ns();
    assert_int_equal(helio_frame(without, &request, &frame, &err), HG_E_CLOSED);
    assert_int_equal(helio_frame(h, &request, &frame, &err), HG_E_CLOSED);
    assert_true(hg_clock_now_ns() - start_ns >= 300000000u);
    assert_non_null(strstr(err.reason, "could not be made again"));
    helio_destroy(h);
    helio_destroy(without);
    daemon_finish(&d);
}

// A certificate for localhost in the folder, signed by itself.
static void make_certificate(struct daemon *d)
{
    char command[3 * TEST_FOLDER_MAX + 300], path[TEST_FOLDER_MAX + 16];
    snprintf(command, sizeof command,
        "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 30 "
        "-subj /CN=localhost -addext subjectAltName=DNS:localhost -keyout %s/key.pem "
        "-out %s/cert.pem 2>%s/openssl",
        d->folder, d->folder, d->folder);
    assert_int_equal(system(command), 0);
    snprintf(path, sizeof path, "%s/cert.pem", d->folder);
    daemon_option(d, "tls-cert", path);
    snprintf(path, sizeof path, "%s/key.pem", d->folder);
    daemon_option(d, "tls-key", path);
}

static struct helio *enter_over(struct daemon *d, const char *scheme, bool secure)
{
    struct helio *h;
    struct hg_error err = {0};
    char url[128], ca[TEST_FOLDER_MAX + 16];
    char *ports = daemon_read(d, "port");
    const char *port = secure ? strchr(ports, '\n') + 1 : ports;
    snprintf(url, sizeof url, "%slocalhost:%d", scheme, atoi(port));
    free(ports);
    snprintf(ca, sizeof ca, "%s/cert.pem", d->folder);
    const struct helio_options options = {
        .url = url, .token = "edit-token-1", .tls_ca = ca, .reconnect_ns = UINT64_C(60000000000)};
    if (helio_connect(&options, &h, &err))
        fail_msg("%s: %s", url, err.reason);
    return h;
}

// SIGUSR2: sockets are handed over, and with them WebSockets; TLS is not, its clients resume.
static void goes_on_in_a_new_program_over(const char *scheme, bool secure)
{
    struct daemon d;
    struct hg_error err = {0};
    struct hgp_scene_opened scene;
    uint8_t before[32], after[32];
    daemon_init_tokens(&d);
    daemon_option(&d, "listen", "tls:127.0.0.1:0");
    make_certificate(&d);
    daemon_start(&d);
    struct helio *h = enter_over(&d, scheme, secure);
    assert_int_equal(helio_scene_open(h, "", &scene, &err), HG_OK);
    struct hgp_view_set view = {
        .view = 1, .has_width = true, .width = 16, .has_height = true, .height = 16};
    assert_int_equal(helio_call_for(h, HGP_T_view_set, &view, HGP_T_ok, NULL, &err), HG_OK);
    move(h, scene.first_id, 3);
    shoot(h, before);
    daemon_signal(&d, SIGUSR2);
    daemon_wait_log(&d, "took over");
    shoot(h, after);
    assert_memory_equal(before, after, sizeof before);
    move(h, scene.first_id, 4);
    shoot(h, after);
    assert_memory_not_equal(before, after, sizeof before);
    assert_int_equal(reconnects(h), secure ? 1 : 0);
    helio_destroy(h);
    daemon_finish(&d);
}

static void new_programs_take_over_streams(void **state)
{
    (void)state;
    goes_on_in_a_new_program_over("ws://", false);
    goes_on_in_a_new_program_over("tls:", true);
    goes_on_in_a_new_program_over("wss://", true);
}

int main(int argc, char **argv)
{
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(calls_go_on),
        cmocka_unit_test(what_may_have_been_done_is_told),
        cmocka_unit_test(patience_ends),
        cmocka_unit_test(new_programs_take_over_streams),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
