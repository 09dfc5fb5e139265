// test_broker_workers.c - more than one worker behind one broker: scenes are spread over them, and
// what happens to one does not reach the sessions of another.
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/clock.h"
#include "tests/system/daemon.h"

enum { WORKERS = 2, SLOW_MS = 700, STEP_NS = 2000000, PATIENCE = 5000 };

static void begin(struct daemon *d, const char *crash_limit)
{
    daemon_init(d);
    daemon_option(d, "restart-delay", "0.01");
    daemon_option(d, "crash-limit", crash_limit);
    daemon_option(d, "shared-workers", "2");
    daemon_start(d);
}

static void end(struct daemon *d)
{
    daemon_signal(d, SIGTERM);
    assert_int_equal(daemon_wait(d), 0);
    daemon_finish(d);
}

// The processes behind the broker, 0 = down or starting.
static void list_workers(struct peer *p, pid_t pids[WORKERS])
{
    peer_call(p, HGP_T_sessions_query, &(struct hgp_sessions_query){0}, HGP_T_json);
    char *text = strndup(p->m.json.text.data, p->m.json.text.size);
    assert_non_null(text);
    const char *at = strstr(text, "\"workers\":[");
    assert_non_null(at);
    for (int i = 0; i < WORKERS; i++) {
        char state[16];
        int pid;
        at = strstr(at, "{\"state\":");
        assert_non_null(at);
        assert_int_equal(sscanf(at, "{\"state\":\"%15[a-z]\",\"pid\":%d", state, &pid), 2);
        pids[i] = strcmp(state, "up") == 0 ? pid : 0;
        at++;
    }
    free(text);
}

// Until all are up, and none of them is `gone`.
static void await_workers(struct peer *p, pid_t gone, pid_t pids[WORKERS])
{
    for (int tries = 0;; tries++) {
        bool good = true;
        list_workers(p, pids);
        for (int i = 0; i < WORKERS; i++)
            good &= pids[i] && pids[i] != gone;
        if (good)
            return;
        assert_true(tries < PATIENCE);
        hg_clock_sleep_ns(STEP_NS);
    }
}

// A scene with something in it, and a view.
static void open_scene(struct peer *p, struct daemon *d, const char *name, uint32_t delay_ms)
{
    peer_open_scene(p, d, name);
    peer_call(p, HGP_T_node_set,
        &(struct hgp_node_set){
            .node = p->first_id, .has_translation = true, .translation = {(float)delay_ms, 2, 3}},
        HGP_T_ok);
    peer_call(p, HGP_T_view_set,
        &(struct hgp_view_set){.view = 1,
            .has_width = true,
            .width = 8,
            .has_height = true,
            .height = 8,
            .has_seed = true,
            .seed = delay_ms},
        HGP_T_ok);
}

static void take_frame(struct peer *p, uint8_t hash[32])
{
    assert_int_equal(p->header.type, HGP_T_frame);
    assert_true(p->m.frame.data.size >= 32);
    memcpy(hash, p->m.frame.data.data, 32);
}

static void show(struct peer *p, uint8_t hash[32])
{
    peer_call(p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    take_frame(p, hash);
}

static void expect_notice(struct peer *p)
{
    assert_true(peer_next(p));
    assert_int_equal(p->header.type, HGP_T_notice);
    assert_int_equal(p->m.notice.code, HG_E_WORKER);
}

// Sessions of one scene share a worker; those of another scene have another one.
static void a_death_stays_in_its_worker(void **state)
{
    (void)state;
    struct daemon d;
    struct peer a, a2, b, admin;
    pid_t before[WORKERS], after[WORKERS];
    uint8_t a_hash[32], b_hash[32], hash[32];
    begin(&d, "6");
    peer_open(&admin, &d);
    await_workers(&admin, 0, before);
    open_scene(&a, &d, "one", 0);
    open_scene(&b, &d, "two", SLOW_MS);
    open_scene(&a2, &d, "one", 0);
    show(&a, a_hash);
    show(&b, b_hash);
    assert_memory_not_equal(a_hash, b_hash, 32);

    size_t asked = daemon_file_size(&d, "count.frame_request");
    uint32_t request = peer_send(&b, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1});
    while (daemon_file_size(&d, "count.frame_request") == asked)
        hg_clock_sleep_ns(STEP_NS);
    kill(before[0], SIGKILL);
    expect_notice(&a);
    expect_notice(&a2);
    show(&a, hash); // from its journal, in a new worker
    assert_memory_equal(hash, a_hash, 32);

    // The request that was under way in the other worker is answered, and was asked once.
    assert_true(peer_next(&b));
    assert_int_equal(b.header.request, request);
    take_frame(&b, hash);
    assert_memory_equal(hash, b_hash, 32);
    assert_int_equal(daemon_file_size(&d, "count.frame_request"), asked + 2);
    await_workers(&admin, before[0], after);
    assert_int_equal(after[1], before[1]);

    kill(after[1], SIGKILL); // and the other way round
    expect_notice(&b);
    show(&a, hash);
    assert_memory_equal(hash, a_hash, 32);
    show(&b, hash);
    assert_memory_equal(hash, b_hash, 32);
    peer_close(&a);
    peer_close(&a2);
    peer_close(&b);
    peer_close(&admin);
    end(&d);
}

// A worker that keeps dying takes its own scenes with it, and no others.
static void crash_limits_are_of_one_worker(void **state)
{
    (void)state;
    struct daemon d;
    struct peer a, b, admin;
    pid_t pids[WORKERS];
    uint8_t b_hash[32], hash[32];
    begin(&d, "2");
    peer_open(&admin, &d);
    await_workers(&admin, 0, pids);
    pid_t other = pids[1];
    open_scene(&a, &d, "one", 0);
    open_scene(&b, &d, "two", 0);
    show(&b, b_hash);
    for (int i = 0; i < 3; i++) {
        pid_t victim = pids[0];
        kill(victim, SIGKILL);
        await_workers(&admin, victim, pids);
    }
    peer_end(&a);
    show(&b, hash);
    assert_memory_equal(hash, b_hash, 32);
    assert_int_equal(pids[1], other);
    // The first one has no scene any more: it gets the next.
    peer_close(&a);
    open_scene(&a, &d, "three", 0);
    kill(pids[1], SIGKILL);
    expect_notice(&b);
    show(&a, hash);
    peer_close(&a);
    peer_close(&b);
    peer_close(&admin);
    end(&d);
}

// The daemon finds the link closed, and the signal that the process has ended behind it.
static void kill_while_stopped(struct daemon *d, pid_t victim)
{
    char path[40], stat[200] = "";
    snprintf(path, sizeof path, "/proc/%d/stat", (int)victim);
    kill(d->pid, SIGSTOP);
    kill(victim, SIGKILL);
    for (int tries = 0; !strstr(stat, ") Z"); tries++) {
        FILE *file = fopen(path, "re");
        assert_non_null(file);
        assert_non_null(fgets(stat, sizeof stat, file));
        fclose(file);
        assert_true(tries < PATIENCE);
        hg_clock_sleep_ns(STEP_NS);
    }
    kill(d->pid, SIGCONT);
}

// A counter that fell when a worker is stopped would look like a restart, and like new deaths.
static void deaths_stay_counted(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    char killed[64];
    daemon_init_tokens(&d);
    daemon_option(&d, "isolation", "tenant");
    daemon_option(&d, "restart-delay", "0.01");
    daemon_option(&d, "worker-idle", "0");
    daemon_start(&d);
    peer_enter(&p, &d, "edit-token-1");
    peer_scene(&p, "hall");
    char *log = daemon_read(&d, "log");
    const char *line = strstr(log, "\"worker "); // the first one, which was the spare
    const pid_t victim = line ? (pid_t)atoi(line + 8) : 0;
    assert_true(victim > 1);
    free(log);
    kill_while_stopped(&d, victim);
    for (int tries = 0; daemon_metric(&d, "heliod_worker_deaths_total") != 1; tries++) {
        assert_true(tries < PATIENCE);
        hg_clock_sleep_ns(STEP_NS);
    }
    snprintf(killed, sizeof killed, "worker %d was killed by signal 9", (int)victim);
    daemon_wait_log(&d, killed); // although its link was seen to end first
    peer_close(&p);
    daemon_wait_log(&d, "of bert is stopped");
    assert_true(daemon_metric(&d, "heliod_worker_deaths_total") == 1);
    end(&d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_death_stays_in_its_worker),
        cmocka_unit_test(crash_limits_are_of_one_worker),
        cmocka_unit_test(deaths_stay_counted),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
