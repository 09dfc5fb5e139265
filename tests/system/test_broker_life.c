// test_broker_life.c - heliod with a fake worker over time: start, flow control, drain, reload, the
// service manager.
#include <dirent.h>
#include <netinet/in.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/clock.h"
#include "tests/system/daemon.h"

// ---- flow control -------------------------------------------------------------------------------

// The pictures of a view that nothing changes.
struct pictures {
    uint64_t number;
    uint8_t digest[32]; // of all that it shows
};

// The next one, the same as before.
static void check_picture(struct peer *p, struct pictures *seen)
{
    assert_int_equal(p->header.type, HGP_T_frame);
    assert_int_equal(p->m.frame.width, 64);
    assert_int_equal(p->m.frame.data.size, 64 * 64 * 4);
    if (seen->number) {
        assert_int_equal(p->m.frame.number, seen->number + 1);
        assert_memory_equal(p->m.frame.data.data, seen->digest, sizeof seen->digest);
    }
    seen->number = p->m.frame.number;
    memcpy(seen->digest, p->m.frame.data.data, sizeof seen->digest);
}

// All frames of a subscription, each of them once.
static void check_subscribed(struct peer *p, uint32_t count)
{
    struct pictures seen = {0};
    peer_tell(p, HGP_T_subscribe, &(struct hgp_subscribe){.view = 1, .credit_frames = count});
    for (uint32_t i = 0; i < count; i++) {
        assert_true(peer_next(p));
        check_picture(p, &seen);
    }
}

static void slow_reader_harms_nobody(void **state)
{
    (void)state;
    struct daemon d;
    struct peer slow, fast, other;
    struct pictures seen = {0};
    daemon_init(&d);
    daemon_option(&d, "output-limit", "4");
    daemon_option(&d, "peer-timeout", "2");
    daemon_start(&d);
    peer_open_scene(&slow, &d, "hall");
    peer_view(&slow, 1, 1024, 1024); // 4 MiB a frame
    peer_open_scene(&fast, &d, "hall");
    peer_view(&fast, 1, 64, 64);
    peer_open_scene(&other, &d, "hall");
    peer_view(&other, 1, 64, 64);
    peer_call(&fast, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    check_picture(&fast, &seen);
    uint64_t before = daemon_rss_bytes(&d);
    // All the credit of the world, and it never reads.
    peer_send(&slow, HGP_T_subscribe, &(struct hgp_subscribe){.view = 1, .credit_frames = 1024});
    uint64_t worst_ns = 0, most = 0;
    uint64_t start_ns = hg_clock_now_ns();
    for (int i = 0; i < 200; i++) {
        uint64_t sent_ns = hg_clock_now_ns();
        peer_call(&fast, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
        check_picture(&fast, &seen);
        uint64_t took_ns = hg_clock_now_ns() - sent_ns, rss = daemon_rss_bytes(&d);
        worst_ns = took_ns > worst_ns ? took_ns : worst_ns;
        most = rss > most ? rss : most;
    }
    print_message("200 frames beside a slow reader: %.0f ms, worst %.1f ms, memory +%.1f MiB\n",
        (double)(hg_clock_now_ns() - start_ns) * 1e-6, (double)worst_ns * 1e-6,
        (double)(most - before) / 1048576.0);
    check_subscribed(&other, 200);
    // output-limit + the window of frames (3 of 4 MiB) + what was being received.
    assert_true(most < before + daemon_allowed((4 + 3 * 4 + 8) * 1048576ull));
    // It is closed in the end; the fast one goes on.
    daemon_wait_log(&d, "peer-timeout");
    peer_call(&fast, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    check_picture(&fast, &seen);
    peer_close(&slow);
    peer_close(&other);
    peer_close(&fast);
    daemon_finish(&d);
}

static void credit_is_kept(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    daemon_init(&d);
    daemon_option(&d, "frame-window", "2");
    daemon_start(&d);
    peer_open_view(&p, &d, 16, 16);
    peer_tell(&p, HGP_T_subscribe, &(struct hgp_subscribe){.view = 1, .credit_frames = 5});
    for (int i = 0; i < 5; i++) {
        assert_true(peer_next(&p));
        assert_int_equal(p.header.type, HGP_T_frame);
        assert_int_equal(p.header.request, 0);
    }
    assert_false(peer_next_within(&p, 150)); // no sixth
    peer_tell(&p, HGP_T_credit, &(struct hgp_credit){.view = 1, .frames = 2});
    for (int i = 0; i < 2; i++) {
        assert_true(peer_next(&p));
        assert_int_equal(p.header.type, HGP_T_frame);
    }
    assert_false(peer_next_within(&p, 150));
    // Stopped is stopped, whatever credit still comes; subscribing again shows a picture again.
    peer_call(&p, HGP_T_subscribe, &(struct hgp_subscribe){.view = 1}, HGP_T_ok);
    peer_tell(&p, HGP_T_credit, &(struct hgp_credit){.view = 1, .frames = 2});
    assert_false(peer_next_within(&p, 150));
    peer_tell(&p, HGP_T_subscribe, &(struct hgp_subscribe){.view = 1, .credit_frames = 1});
    assert_true(peer_next(&p));
    assert_int_equal(p.header.type, HGP_T_frame);
    assert_false(peer_next_within(&p, 150));
    peer_close(&p);
    daemon_finish(&d);
}

static void fast_writer_is_slowed(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    daemon_init(&d);
    daemon_option(&d, "max-requests", "8");
    daemon_option(&d, "max-rate", "2000");
    daemon_start(&d);
    peer_open_scene(&p, &d, "");
    uint32_t first = 0, last = 0;
    for (uint32_t i = 0; i < 1000; i++) {
        last = peer_send(&p, HGP_T_node_set, &(struct hgp_node_set){.node = p.first_id + i});
        first = first ? first : last;
    }
    for (uint32_t request = first; request <= last; request++)
        peer_answer(&p, request, HGP_T_ok); // all answered, in order, none refused
    assert_int_equal(p.m.ok.revision, 1000);
    peer_close(&p);
    daemon_finish(&d);
}

// ---- drain and reload ---------------------------------------------------------------------------

static void drains_under_load(void **state)
{
    (void)state;
    struct daemon d;
    struct peer busy, idle;
    daemon_begin(&d);
    peer_open_view(&busy, &d, 64, 64);
    peer_call(&busy, HGP_T_view_set,
        &(struct hgp_view_set){.view = 1, .has_seed = true, .seed = 4000}, HGP_T_ok);
    peer_open(&idle, &d);
    peer_call(&idle, HGP_T_ping, &(struct hgp_ping){.nonce = 3}, HGP_T_pong);
    uint32_t request =
        peer_send(&busy, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1});
    peer_call(&busy, HGP_T_ping, &(struct hgp_ping){.nonce = 4}, HGP_T_pong); // it is under way
    daemon_signal(&d, SIGTERM);
    assert_true(peer_next(&idle));
    assert_int_equal(idle.header.type, HGP_T_drain);
    assert_true(peer_next(&idle));
    assert_int_equal(idle.header.type, HGP_T_bye);
    peer_end(&idle);
    assert_true(peer_next(&busy));
    assert_int_equal(busy.header.type, HGP_T_drain);
    peer_refused(&busy, HGP_T_view_set, &(struct hgp_view_set){.view = 2}, HG_E_STATE);
    peer_answer(&busy, request, HGP_T_frame); // finished, not cut off
    assert_true(peer_next(&busy));
    assert_int_equal(busy.header.type, HGP_T_bye);
    peer_close(&busy);
    peer_close(&idle);
    assert_int_equal(daemon_wait(&d), 0);
    assert_false(daemon_has_file(&d, "sock"));
    daemon_finish(&d);
}

static void drain_has_a_deadline(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    daemon_init(&d);
    daemon_option(&d, "drain-timeout", "0.2");
    daemon_start(&d);
    peer_open_view(&p, &d, 64, 64);
    peer_call(&p, HGP_T_view_set,
        &(struct hgp_view_set){.view = 1, .has_seed = true, .seed = 60000}, HGP_T_ok);
    uint32_t request = peer_send(&p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1});
    peer_call(&p, HGP_T_ping, &(struct hgp_ping){.nonce = 4}, HGP_T_pong);
    daemon_signal(&d, SIGTERM);
    peer_error(&p, request, HG_E_CANCELLED);
    peer_end(&p);
    peer_close(&p);
    assert_int_equal(daemon_wait(&d), 0);
    daemon_finish(&d);
}

static void second_signal_ends_at_once(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    daemon_begin(&d);
    peer_open_view(&p, &d, 64, 64);
    peer_call(&p, HGP_T_view_set,
        &(struct hgp_view_set){.view = 1, .has_seed = true, .seed = 60000}, HGP_T_ok);
    peer_send(&p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1});
    peer_call(&p, HGP_T_ping, &(struct hgp_ping){.nonce = 4}, HGP_T_pong);
    daemon_signal(&d, SIGTERM);
    daemon_wait_log(&d, "draining");
    daemon_signal(&d, SIGTERM);
    assert_int_equal(daemon_wait(&d), 0);
    peer_close(&p);
    daemon_finish(&d);
}

static void reloads_tokens_and_options(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p, old;
    char path[160];
    const char *const success = "heliod_config_last_reload_success_timestamp_seconds";
    daemon_init_tokens(&d);
    daemon_write(&d, "config", "max-views = 3\n");
    snprintf(path, sizeof path, "%s/config", d.folder);
    daemon_option(&d, "config", path);
    snprintf(path, sizeof path, "%s/audit", d.folder);
    daemon_option(&d, "audit", path);
    daemon_start(&d);
    const double begun_s = daemon_metric(&d, success);
    assert_true(begun_s > 1e9);
    peer_open_scene(&old, &d, "");
    daemon_write(&d, "tokens", "new-token-22 edit carl\n");
    daemon_write(&d, "config", "max-views = 1\n");
    daemon_signal(&d, SIGHUP);
    daemon_wait_log(&d, "reloaded: 1 tokens");
    peer_connect(&p, &d, true);
    peer_hello(&p);
    peer_auth(&p, "new-token-22");
    assert_true(peer_next(&p));
    assert_int_equal(p.header.type, HGP_T_auth_ok);
    peer_close(&p);
    peer_view(&old, 1, 8, 8);
    peer_refused(&old, HGP_T_view_set, &(struct hgp_view_set){.view = 2}, HG_E_LIMIT);
    // A bad file changes nothing and says where it is bad.
    daemon_write(&d, "tokens", "other-token edit\nshort admin\n");
    daemon_signal(&d, SIGHUP);
    daemon_wait_log(&d, "reload refused");
    daemon_wait_log(&d, "line 2");
    assert_true(daemon_metric(&d, "heliod_config_last_reload_successful") == 0);
    assert_true(daemon_metric(&d, success) >= begun_s);
    char *audit = daemon_read(&d, "audit"), *line = strstr(audit, "\"result\":\"invalid\"");
    assert_non_null(line); // it names the file
    assert_non_null(strstr(line, "/tokens: line 2: "));
    free(audit);
    peer_connect(&p, &d, true);
    peer_hello(&p);
    peer_auth(&p, "new-token-22");
    assert_true(peer_next(&p));
    assert_int_equal(p.header.type, HGP_T_auth_ok);
    peer_close(&p);
    peer_close(&old);
    daemon_write(&d, "tokens", "other-token edit\nthird-token view\n");
    daemon_signal(&d, SIGHUP);
    daemon_wait_log(&d, "reloaded: 2 tokens");
    assert_true(daemon_metric(&d, "heliod_config_last_reload_successful") == 1);
    daemon_finish(&d);
}

// ---- start --------------------------------------------------------------------------------------

static void refuses_bad_starts(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    daemon_init(&d);
    daemon_option(&d, "listen", "tcp:127.0.0.1:0");
    assert_int_equal(daemon_run(&d), 2); // tcp without tokens
    daemon_finish(&d);
    daemon_init(&d);
    daemon_write(&d, "config", "# fine\nmax-views = many\n");
    char path[160];
    snprintf(path, sizeof path, "%s/config", d.folder);
    daemon_option(&d, "config", path);
    daemon_option(&d, "check-config", NULL);
    assert_int_equal(daemon_run(&d), 2);
    char *text = daemon_read(&d, "log");
    assert_non_null(strstr(text, "line 2"));
    free(text);
    daemon_write(&d, "config", "# fine\nmax-views = 5\n");
    assert_int_equal(daemon_run(&d), 0);
    daemon_finish(&d);
    daemon_init(&d);
    daemon_option(&d, "worker", "/nonexistent/worker");
    assert_int_equal(daemon_run(&d), 4);
    daemon_finish(&d);
    daemon_init(&d);
    daemon_option(&d, "asset-root", "/nonexistent/scenes");
    assert_int_equal(daemon_run(&d), 4); // may be mounted later
    daemon_option(&d, "check-config", NULL);
    assert_int_equal(daemon_run(&d), 2);
    daemon_finish(&d);
    // A socket that is served is left alone; one of a dead daemon is replaced.
    daemon_begin(&d);
    struct daemon second = d;
    second.pid = 0;
    assert_int_equal(daemon_run(&second), 4);
    peer_open(&p, &d);
    peer_close(&p);
    daemon_signal(&d, SIGKILL);
    daemon_reap(&d);
    assert_true(daemon_has_file(&d, "sock"));
    daemon_start(&d);
    peer_open(&p, &d);
    peer_close(&p);
    daemon_finish(&d);
}

static void passes_device_info_on(void **state)
{
    (void)state;
    struct daemon d;
    daemon_init(&d);
    daemon_option(&d, "device-info", NULL);
    assert_int_equal(daemon_run(&d), 7);
    char *text = daemon_read(&d, "out");
    assert_string_equal(text, "{\"name\":\"fake\"}\n");
    free(text);
    daemon_finish(&d);
}

// ---- the service manager
// --------------------------------------------------------------------------

static int datagram_socket(struct daemon *d, char *path, size_t size)
{
    struct sockaddr_un sun = {.sun_family = AF_UNIX};
    struct timeval patience = {.tv_sec = 60};
    snprintf(path, size, "%s/notify", d->folder);
    snprintf(sun.sun_path, sizeof sun.sun_path, "%s", path);
    int fd = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    assert_true(fd >= 0);
    setsockopt(fd, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    assert_int_equal(bind(fd, (struct sockaddr *)&sun, sizeof sun), 0);
    return fd;
}

static void expect_notice(int fd, const char *wanted)
{
    char text[600];
    do {
        ssize_t n = recv(fd, text, sizeof text - 1, 0);
        if (n < 0)
            fail_msg("the service manager is never told %s", wanted);
        text[n] = 0;
    } while (!strstr(text, wanted));
}

static void talks_to_the_service_manager(void **state)
{
    (void)state;
    struct daemon d;
    char path[100];
    daemon_init(&d);
    daemon_write(&d, "config", "max-views = 5\n");
    snprintf(path, sizeof path, "%s/config", d.folder);
    daemon_option(&d, "config", path);
    int fd = datagram_socket(&d, path, sizeof path);
    setenv("NOTIFY_SOCKET", path, 1);
    setenv("WATCHDOG_USEC", "400000", 1);
    daemon_start(&d);
    expect_notice(fd, "READY=1");
    expect_notice(fd, "WATCHDOG=1");
    expect_notice(fd, "WATCHDOG=1");
    daemon_signal(&d, SIGHUP);
    expect_notice(fd, "RELOADING=1\nMONOTONIC_USEC=");
    expect_notice(fd, "READY=1\nSTATUS=accepting clients");
    daemon_write(&d, "config", "max-views = many\n");
    daemon_signal(&d, SIGHUP);
    expect_notice(fd, "READY=1\nSTATUS=reload refused: ");
    daemon_signal(&d, SIGTERM);
    expect_notice(fd, "STOPPING=1");
    assert_int_equal(daemon_wait(&d), 0);
    unsetenv("NOTIFY_SOCKET");
    unsetenv("WATCHDOG_USEC");
    close(fd);
    daemon_finish(&d);
}

static void takes_passed_sockets(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    struct sockaddr_in sin = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof sin;
    daemon_init_tokens(&d);
    int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    assert_int_equal(bind(fd, (struct sockaddr *)&sin, sizeof sin), 0);
    assert_int_equal(listen(fd, 8), 0);
    assert_int_equal(getsockname(fd, (struct sockaddr *)&sin, &size), 0);
    d.passed_fd = fd;
    daemon_start(&d);
    d.port = ntohs(sin.sin_port);
    peer_connect(&p, &d, true);
    peer_hello(&p);
    peer_auth(&p, "edit-token-1");
    assert_true(peer_next(&p));
    assert_int_equal(p.header.type, HGP_T_auth_ok);
    peer_close(&p);
    close(fd);
    daemon_finish(&d);
}

// A child of the daemon by the name of its process; 0 = none.
static pid_t find_child(const struct daemon *d, const char *name)
{
    char path[64], line[256], wanted[64];
    pid_t found = 0;
    DIR *folder = opendir("/proc");
    assert_non_null(folder);
    snprintf(wanted, sizeof wanted, "(%s)", name);
    for (struct dirent *it; (it = readdir(folder));) {
        int parent = 0;
        const int pid = atoi(it->d_name);
        snprintf(path, sizeof path, "/proc/%d/stat", pid);
        FILE *file = pid > 0 ? fopen(path, "r") : NULL;
        const bool read = file && fgets(line, sizeof line, file);
        if (file)
            fclose(file);
        const char *end = read ? strrchr(line, ')') : NULL;
        if (end && strstr(line, wanted) && sscanf(end, ") %*c %d", &parent) == 1 &&
            parent == d->pid)
            found = pid;
    }
    closedir(folder);
    return found;
}

// Without what starts workers a daemon is of no use: a service manager has to see a failure.
static void ends_without_its_launcher(void **state)
{
    (void)state;
    struct daemon d;
    daemon_begin(&d);
    const pid_t launcher = find_child(&d, "heliod-launch");
    assert_true(launcher > 0);
    assert_int_equal(kill(launcher, SIGKILL), 0);
    assert_int_equal(daemon_wait(&d), 5);
    daemon_finish(&d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(slow_reader_harms_nobody),
        cmocka_unit_test(credit_is_kept),
        cmocka_unit_test(fast_writer_is_slowed),
        cmocka_unit_test(drains_under_load),
        cmocka_unit_test(drain_has_a_deadline),
        cmocka_unit_test(second_signal_ends_at_once),
        cmocka_unit_test(reloads_tokens_and_options),
        cmocka_unit_test(refuses_bad_starts),
        cmocka_unit_test(passes_device_info_on),
        cmocka_unit_test(talks_to_the_service_manager),
        cmocka_unit_test(takes_passed_sockets),
        cmocka_unit_test(ends_without_its_launcher),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
