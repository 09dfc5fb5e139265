// test_takeover.c - SIGUSR2: a new program in the same process, without a session noticing.
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/clock.h"
#include "base/slice.h"
#include "tests/system/daemon.h"

enum { SESSIONS = 10, WINDOW = 16, TAKEOVERS = 5 };

struct client {
    struct peer peer;
    uint64_t sent, answered, frame;
    uint64_t taken_ns, longest_ns; // the newest message, and the longest time without one
};

static void open_client(struct client *c, struct daemon *d, int number)
{
    char name[16] = "";
    if (number % 2)
        snprintf(name, sizeof name, "scene%d", number % 4);
    *c = (struct client){0};
    if (number % 3 == 0)
        peer_enter(&c->peer, d, "edit-token-1");
    else
        peer_open(&c->peer, d);
    peer_scene(&c->peer, name);
    peer_view(&c->peer, 1, 16, 16);
    peer_tell(&c->peer, HGP_T_subscribe, &(struct hgp_subscribe){.view = 1, .credit_frames = 4});
}

static void send_edit(struct client *c)
{
    uint64_t i = ++c->sent;
    peer_send(&c->peer, HGP_T_node_set,
        &(struct hgp_node_set){.node = c->peer.first_id + i % 8,
            .has_translation = true,
            .translation = {(float)i, 0, 0}});
}

// Answers come in their order and frames with rising numbers.
static void take(struct client *c)
{
    if (!peer_next(&c->peer))
        fail_msg("a session was dropped");
    uint64_t now_ns = hg_clock_now_ns();
    if (c->taken_ns && now_ns - c->taken_ns > c->longest_ns)
        c->longest_ns = now_ns - c->taken_ns;
    c->taken_ns = now_ns;
    if (c->peer.header.type == HGP_T_frame) {
        assert_true(c->peer.m.frame.number > c->frame);
        c->frame = c->peer.m.frame.number;
        peer_tell(&c->peer, HGP_T_credit, &(struct hgp_credit){.view = 1, .frames = 1});
        return;
    }
    assert_int_equal(c->peer.header.type, HGP_T_ok);
    assert_int_equal(c->peer.header.request, c->peer.next_request - (c->sent - c->answered));
    c->answered++;
}

static void run(struct client *c, uint64_t until_ns)
{
    while (hg_clock_now_ns() < until_ns) {
        while (c->sent < c->answered + WINDOW)
            send_edit(c);
        take(c);
    }
}

static int count(struct daemon *d, const char *text)
{
    int found = 0;
    char *log = daemon_read(d, "log");
    for (const char *at = log; (at = strstr(at, text)); at++)
        found++;
    free(log);
    return found;
}

static void wait_count(struct daemon *d, const char *text, int wanted)
{
    for (int i = 0; count(d, text) < wanted; i++) {
        if (i > 4000)
            fail_msg("not %d times in the log: %s\n%s", wanted, text, daemon_read(d, "log"));
        usleep(5000);
    }
}

static void sessions_go_on(bool with_state)
{
    struct daemon d;
    struct client clients[SESSIONS];
    char path[TEST_FOLDER_MAX + 16];
    daemon_init_tokens(&d);
    snprintf(path, sizeof path, "%s/state", d.folder);
    if (with_state)
        daemon_option(&d, "state-dir", path);
    daemon_option(&d, "log", "info");
    daemon_option(&d, "shared-workers", "2");
    daemon_start(&d);
    for (int i = 0; i < SESSIONS; i++)
        open_client(&clients[i], &d, i);
    wait_count(&d, " ready after", 2);
    double longest_ms = 0;
    for (int i = 0; i < TAKEOVERS; i++) {
        for (int k = 0; k < SESSIONS; k++)
            clients[k].taken_ns = 0;
        daemon_signal(&d, SIGUSR2);
        for (int round = 0; count(&d, "took over 10 sessions") <= i; round++) {
            assert_true(round < 2000);
            for (int k = 0; k < SESSIONS; k++)
                run(&clients[k], hg_clock_now_ns() + 1000000);
        }
    }
    for (int i = 0; i < SESSIONS; i++)
        if ((double)clients[i].longest_ns * 1e-6 > longest_ms)
            longest_ms = (double)clients[i].longest_ns * 1e-6;
    print_message(
        "%d takeovers with %d sessions: without a message for %.0f ms at most (each client "
        "is looked at every %d ms)\n",
        TAKEOVERS, SESSIONS, longest_ms, SESSIONS);
    for (int i = 0; i < SESSIONS; i++)
        while (clients[i].answered < clients[i].sent)
            take(&clients[i]);
    assert_int_equal(count(&d, " started"), 2); // the same workers
    struct client late;
    open_client(&late, &d, 3); // and others come in
    run(&late, hg_clock_now_ns() + 10000000);
    peer_close(&late.peer);
    for (int i = 0; i < SESSIONS; i++) {
        assert_true(clients[i].frame > 0);
        peer_close(&clients[i].peer);
    }
    daemon_signal(&d, SIGTERM);
    assert_int_equal(daemon_wait(&d), 0);
    assert_false(daemon_has_file(&d, "sock"));
    daemon_finish(&d);
}

static void ten_sessions_in_full_flight(void **state)
{
    (void)state;
    sessions_go_on(false);
}

static void ten_sessions_with_a_state_folder(void **state)
{
    (void)state;
    sessions_go_on(true);
}

// Half a message in, a large answer half out.
static void streams_are_cut_nowhere(void **state)
{
    (void)state;
    struct daemon d;
    struct peer half, slow;
    daemon_init(&d);
    daemon_option(&d, "log", "info");
    daemon_start(&d);
    peer_open_scene(&half, &d, "");
    peer_open_view(&slow, &d, 1024, 1024);
    static uint8_t points[1200000];
    struct hgp_mesh_part part = {
        .mode = HGP_primitive_mode_POINTS, .positions = {points, sizeof points}};
    const size_t cuts[] = {7, 16, 100, 70000, 1100000};
    uint32_t large = peer_send(&slow, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1});
    for (int i = 0; i < 5; i++) {
        struct hg_writer w = {0};
        uint32_t request = half.next_request++;
        assert_int_equal(
            hgp_encode(&w, 1, (struct hgp_envelope){HGP_T_mesh_set, request, 0},
                &(struct hgp_mesh_set){.mesh = half.first_id, .parts = {&part, 1}}, NULL),
            HG_OK);
        peer_raw(&half, w.data, cuts[i]);
        usleep(50000); // so that it is read
        daemon_signal(&d, SIGUSR2);
        wait_count(&d, "took over 2 sessions", i + 1);
        peer_raw(&half, w.data + cuts[i], w.size - cuts[i]);
        hg_writer_finish(&w);
        peer_answer(&half, request, HGP_T_ok);
        assert_int_equal(half.m.ok.revision, i + 1);
    }
    peer_answer(&slow, large, HGP_T_frame);
    assert_int_equal(slow.m.frame.data.size, 1024 * 1024 * 4);
    peer_close(&half);
    peer_close(&slow);
    daemon_finish(&d);
}

// A worker that dies afterwards is replaced, its scenes are played again: the journal is there.
static void what_is_known_goes_along(void **state)
{
    (void)state;
    struct daemon d;
    struct client c;
    struct hgp_frame_request request = {.view = 1};
    struct hgp_clip_plane plane = {.normal = {1, 0, 0}, .distance = 3};
    struct hgp_view_clip clip = {.view = 1, .planes = {&plane, 1}};
    uint8_t before[32];
    daemon_init_tokens(&d);
    daemon_option(&d, "restart-delay", "0.01");
    daemon_start(&d);
    open_client(&c, &d, 0);
    run(&c, hg_clock_now_ns() + 20000000);
    while (c.answered < c.sent)
        take(&c);
    peer_call(&c.peer, HGP_T_subscribe, &(struct hgp_subscribe){.view = 1}, HGP_T_ok);
    peer_call(&c.peer, HGP_T_view_clip, &clip, HGP_T_ok);
    peer_call(&c.peer, HGP_T_frame_request, &request, HGP_T_frame);
    memcpy(before, c.peer.m.frame.data.data, 32);
    pid_t worker = daemon_worker(&d, 0);
    daemon_signal(&d, SIGUSR2);
    wait_count(&d, "took over 1 sessions", 1);
    daemon_write(&d, "die.frame_request", "");
    peer_call(&c.peer, HGP_T_frame_request, &request, HGP_T_frame);
    assert_memory_equal(before, c.peer.m.frame.data.data, 32);
    assert_true(daemon_worker(&d, worker) != worker);
    daemon_write(&d, "tokens", "another-token edit\n"); // its token is revoked
    daemon_signal(&d, SIGHUP);
    while (peer_next(&c.peer))
        ;
    peer_close(&c.peer);
    daemon_finish(&d);
}

// Nothing changes where the new program cannot run, or requests do not end.
static void takes_over_only_when_it_can(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    char path[TEST_FOLDER_MAX + 16];
    daemon_init(&d);
    daemon_write(&d, "config", "max-sessions = 100\ndrain-timeout = 0.2\n");
    snprintf(path, sizeof path, "%s/config", d.folder);
    daemon_option(&d, "config", path);
    daemon_start(&d);
    peer_open_view(&p, &d, 16, 16);
    daemon_write(&d, "config", "max-sessions = none\n");
    daemon_signal(&d, SIGUSR2);
    daemon_wait_log(&d, "its --check-config fails");
    peer_call(&p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    daemon_write(&d, "config", "max-sessions = 100\ndrain-timeout = 0.2\n");
    uint32_t slow = peer_send(&p, HGP_T_asset_load,
        &(struct hgp_asset_load){.asset = p.first_id, .path = hgp_str_make("slow=1500")});
    peer_call(&p, HGP_T_ping, &(struct hgp_ping){.nonce = 1}, HGP_T_pong);
    daemon_signal(&d, SIGUSR2);
    daemon_wait_log(&d, "edits or workers are still busy");
    peer_answer(&p, slow, HGP_T_asset_loaded);
    peer_call(&p, HGP_T_view_set, &(struct hgp_view_set){.view = 1, .has_seed = true, .seed = 5000},
        HGP_T_ok);
    slow = peer_send(&p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1});
    peer_call(&p, HGP_T_ping, &(struct hgp_ping){.nonce = 1}, HGP_T_pong);
    daemon_signal(&d, SIGUSR2);
    peer_error(&p, slow, HG_E_CANCELLED); // it may be asked for again
    daemon_wait_log(&d, "took over 1 sessions");
    peer_call(&p, HGP_T_view_set, &(struct hgp_view_set){.view = 1, .has_seed = true, .seed = 0},
        HGP_T_ok);
    peer_call(&p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    peer_close(&p);
    daemon_finish(&d);
}

// Clients do not wait for a takeover that the disk forbids.
static void takes_over_with_a_disk_only(void **state)
{
    (void)state;
    static const uint8_t points[300000];
    struct hgp_mesh_part part = {
        .mode = HGP_primitive_mode_POINTS, .positions = {points, sizeof points}};
    struct daemon d;
    struct peer p, other;
    char folder[TEST_FOLDER_MAX + 16];
    daemon_init(&d);
    snprintf(folder, sizeof folder, "%s/state", d.folder);
    daemon_option(&d, "state-dir", folder);
    daemon_start(&d);
    peer_open_scene(&p, &d, "kept");
    peer_open_view(&other, &d, 16, 16);
    const struct rlimit full = {sizeof points, RLIM_INFINITY},
                        enough = {RLIM_INFINITY, RLIM_INFINITY};
    assert_int_equal(prlimit(d.pid, RLIMIT_FSIZE, &full, NULL), 0);
    peer_send(&p, HGP_T_mesh_set, &(struct hgp_mesh_set){.mesh = p.first_id, .parts = {&part, 1}});
    daemon_wait_log(&d, "cannot be rewritten");
    daemon_signal(&d, SIGUSR2);
    daemon_wait_log(&d, "everything goes on: the state log cannot be written (state-dir): ");
    char *log = daemon_read(&d, "log");
    assert_null(strstr(log, "as soon as nothing is under way")); // nobody had to wait
    free(log);
    peer_call(&other, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    assert_int_equal(prlimit(d.pid, RLIMIT_FSIZE, &enough, NULL), 0);
    daemon_wait_log(&d, "is complete again");
    daemon_signal(&d, SIGUSR2);
    daemon_wait_log(&d, "took over 2 sessions");
    peer_call(&other, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    peer_close(&p);
    peer_close(&other);
    daemon_finish(&d);
}

// The only process of its own that is not a worker.
static pid_t launcher_of(const struct daemon *d)
{
    char path[64];
    int child, found = 0;
    snprintf(path, sizeof path, "/proc/%d/task/%d/children", (int)d->pid, (int)d->pid);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    while (fscanf(file, "%d", &child) == 1 && !found)
        found = child; // the first that was made
    fclose(file);
    return found;
}

static void user_namespace(pid_t pid, char out[64])
{
    char path[64];
    snprintf(path, sizeof path, "/proc/%d/ns/user", (int)pid);
    const ssize_t size = readlink(path, out, 63);
    assert_true(size > 0);
    out[size] = 0;
}

static bool is_confined(pid_t pid)
{
    char ours[64], its[64];
    user_namespace(getpid(), ours);
    user_namespace(pid, its);
    return strcmp(ours, its) != 0;
}

static bool has_loader_cpu(pid_t pid, int seconds)
{
    char path[64], text[16384], wanted[40];
    const int length = snprintf(wanted, sizeof wanted, "--loader-cpu%c%d", 0, seconds);
    snprintf(path, sizeof path, "/proc/%d/cmdline", (int)pid);
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    const size_t size = fread(text, 1, sizeof text, file);
    fclose(file);
    return memmem(text, size, wanted, (size_t)length + 1) != NULL;
}

// How long a process may run at a time; 0: the kernel does not say. struct sched_attr, version 0.
static uint64_t slice_ns(pid_t pid)
{
    uint64_t attributes[6] = {0};
    assert_int_equal(syscall(SYS_sched_getattr, pid, attributes, sizeof attributes, 0), 0);
    return attributes[3];
}

// The loop runs before those that compute, and its workers compute.
static void expect_slices(struct daemon *d, pid_t worker)
{
    const uint64_t usual_ns = slice_ns(0);
    if (usual_ns)
        assert_int_equal(slice_ns(d->pid), HG_SLICE_SHORT_NS);
    assert_int_equal(slice_ns(worker), usual_ns);
}

// Those that start afterwards are as confined as those before, by the process that started these,
// and have the options of now.
static void workers_start_as_before(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    char path[TEST_FOLDER_MAX + 16];
    daemon_init(&d);
    daemon_write(&d, "config", "loader-cpu = 7\n");
    snprintf(path, sizeof path, "%s/config", d.folder);
    daemon_option(&d, "config", path);
    daemon_option(&d, "sandbox", "best-effort");
    daemon_option(&d, "restart-delay", "0.01");
    daemon_start(&d);
    peer_open_scene(&p, &d, "");
    pid_t worker = daemon_worker(&d, 0);
    const pid_t launcher = launcher_of(&d);
    const bool confined = is_confined(worker);
    assert_true(has_loader_cpu(worker, 7));
    expect_slices(&d, worker);
    daemon_write(&d, "config", "loader-cpu = 8\n");
    for (int i = 0; i < 2; i++) {
        daemon_signal(&d, SIGUSR2);
        wait_count(&d, "took over 1 sessions", i + 1);
        assert_int_equal(kill(worker, SIGKILL), 0);
        worker = daemon_worker(&d, worker);
        assert_int_equal(is_confined(worker), confined);
        assert_true(has_loader_cpu(worker, 8));
        expect_slices(&d, worker);
        assert_int_equal(launcher_of(&d), launcher);
    }
    print_message("workers %s namespaces of their own\n", confined ? "have" : "may have no");
    // Without it no worker can start: a service manager starts all anew.
    assert_int_equal(kill(launcher, SIGKILL), 0);
    assert_int_not_equal(daemon_wait(&d), 0);
    peer_close(&p);
    daemon_finish(&d);
}

// Another heliod that is told the same cache folder, and has state: it is refused.
static void expect_locked(struct daemon *d)
{
    char command[1200], who[40];
    snprintf(command, sizeof command,
        "timeout 60 %s/bin/heliod --listen unix:%s/second --cache-dir %s/cache --state-dir "
        "%s/second-state 2>%s/second.log",
        getenv("HELIO_BUILD_DIR"), d->folder, d->folder, d->folder, d->folder);
    assert_int_equal(WEXITSTATUS(system(command)), 4);
    snprintf(who, sizeof who, "(process %d)", (int)d->pid);
    char *log = daemon_read(d, "second.log");
    assert_non_null(strstr(log, "--cache-dir: another heliod uses this folder"));
    assert_non_null(strstr(log, who));
    free(log);
}

// What workers were started as they stay, and where: both modes of isolation, the folder.
static void workers_stay_what_they_are(void **state)
{
    (void)state;
    struct daemon d;
    struct peer anna, bert;
    char path[TEST_FOLDER_MAX + 16];
    daemon_init_tokens(&d);
    daemon_write(&d, "config", "isolation = shared\n");
    snprintf(path, sizeof path, "--config=%s/config", d.folder);
    for (int i = 0; i < d.arg_count; i++)
        if (strcmp(d.args[i], "--isolation=shared") == 0) {
            free(d.args[i]);
            d.args[i] = strdup(path);
        }
    daemon_start(&d);
    peer_enter(&anna, &d, "edit-token-1");
    peer_scene(&anna, "hall");
    const pid_t worker = daemon_worker(&d, 0);
    expect_locked(&d);
    daemon_write(&d, "config", "isolation = tenant\ncache-limit = 100\n");
    for (int i = 0; i < 2; i++) {
        daemon_signal(&d, SIGUSR2);
        wait_count(&d, "isolation stays shared", i + 1);
        wait_count(&d, "took over 1 sessions", i + 1);
    }
    expect_locked(&d);
    peer_enter(&bert, &d, "view-token-1"); // another tenant, for which a spare would be
    peer_scene(&bert, "hall");
    assert_true(bert.m.scene_opened.existed);
    assert_int_equal(daemon_worker(&d, 0), worker);
    daemon_signal(&d, SIGHUP);
    daemon_wait_log(&d, "a restart is needed for: isolation");
    peer_close(&anna);
    peer_close(&bert);
    daemon_finish(&d);
}

int main(int argc, char **argv)
{
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ten_sessions_in_full_flight),
        cmocka_unit_test(ten_sessions_with_a_state_folder),
        cmocka_unit_test(streams_are_cut_nowhere),
        cmocka_unit_test(what_is_known_goes_along),
        cmocka_unit_test(takes_over_only_when_it_can),
        cmocka_unit_test(takes_over_with_a_disk_only),
        cmocka_unit_test(workers_start_as_before),
        cmocka_unit_test(workers_stay_what_they_are),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
