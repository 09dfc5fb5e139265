// tenants.c - a worker for each tenant: what one of them does to its own reaches no other.
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/sha256.h"
#include "tests/attack/tenant_rig.h"

static void begin(struct daemon *d, const char *most)
{
    tenant_rig_init(d);
    daemon_option(d, "max-workers", most);
    daemon_option(d, "crash-limit", "2");
    daemon_start(d);
}

static void show(struct peer *p)
{
    peer_call(p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
}

// Each has a worker, and the spare waits; a worker that dies takes nobody else with it.
static void deaths_stay_with_their_tenant(void **state)
{
    (void)state;
    struct daemon d;
    struct peer anna, bert;
    begin(&d, "4");
    pid_t first = tenant_await_worker(&d, "", 0);
    tenant_enter(&anna, &d, "anna-token-1", "hall");
    assert_int_equal(tenant_await_worker(&d, "anna", 0), first); // the spare, without a start
    pid_t second = tenant_await_worker(&d, "", first);
    tenant_enter(&bert, &d, "bert-token-1", "hall");
    assert_false(bert.m.scene_opened.existed); // another scene, of the same name
    assert_int_equal(tenant_await_worker(&d, "bert", 0), second);
    peer_view(&anna, 1, 8, 8);
    peer_view(&bert, 1, 8, 8);
    for (int i = 0; i < 3; i++) { // more often than crash-limit allows
        pid_t pid = tenant_await_worker(&d, "anna", 0);
        kill(pid, SIGKILL);
        show(&bert);
        assert_int_equal(tenant_worker(&d, "bert"), second);
        if (i < 2)
            tenant_await_worker(&d, "anna", pid);
    }
    daemon_wait_log(&d, "crash-limit");
    show(&bert);
    assert_int_equal(tenant_worker(&d, "bert"), second);
    peer_close(&anna);
    peer_close(&bert);
    daemon_finish(&d);
}

static void scenes_belong_to_tenants(void **state)
{
    (void)state;
    struct daemon d;
    struct peer anna, other, guest, nameless;
    begin(&d, "4");
    tenant_enter(&anna, &d, "anna-token-1", "show");
    tenant_enter(&other, &d, "anna-token-2", "show"); // of the same name, so of the same tenant
    assert_true(other.m.scene_opened.existed);
    tenant_enter(&guest, &d, "guest-token-1", "show"); // by grant: its line says so
    assert_true(guest.m.scene_opened.existed);
    tenant_enter(&nameless, &d, "nameless-token", "show");
    assert_false(nameless.m.scene_opened.existed);
    peer_close(&anna);
    peer_close(&other);
    peer_close(&guest);
    peer_close(&nameless);
    daemon_finish(&d);
}

// A hash is not a key: who knows it neither loads the content nor learns that it is there.
static void uploads_belong_to_tenants(void **state)
{
    (void)state;
    struct daemon d;
    struct peer anna, bert;
    struct hgp_upload secret = {.total = 6, .data = {(const uint8_t *)"secret", 6}};
    struct hgp_content content;
    begin(&d, "4");
    tenant_enter(&anna, &d, "anna-token-1", "hall");
    tenant_enter(&bert, &d, "bert-token-1", "hall");
    assert_int_equal(hg_sha256("secret", 6, secret.hash), HG_OK);
    memcpy(content.hash, secret.hash, 32);
    const struct hgp_upload_query query = {.contents = {&content, 1}};
    struct hgp_asset_file file = {.uri = hgp_str_make("a.glb")};
    memcpy(file.hash, secret.hash, 32);
    struct hgp_asset_load load = {.asset = anna.first_id, .files = {&file, 1}};
    peer_call(&anna, HGP_T_upload, &secret, HGP_T_ok);
    peer_call(&anna, HGP_T_upload_query, &query, HGP_T_upload_have);
    assert_true(anna.m.upload_have.have.items[0].value);
    peer_call(&anna, HGP_T_asset_load, &load, HGP_T_asset_loaded);
    load.asset = bert.first_id;
    peer_call(&bert, HGP_T_upload_query, &query, HGP_T_upload_have);
    assert_false(bert.m.upload_have.have.items[0].value);
    peer_refused(&bert, HGP_T_asset_load, &load, HG_E_NOTFOUND);
    peer_call(&bert, HGP_T_upload, &secret, HGP_T_ok); // whoever has it may use it
    peer_call(&bert, HGP_T_asset_load, &load, HGP_T_asset_loaded);
    peer_close(&anna);
    peer_close(&bert);
    daemon_finish(&d);
}

static void workers_are_limited_and_given_back(void **state)
{
    (void)state;
    struct daemon d;
    struct peer anna, bert;
    begin(&d, "1");
    pid_t first = tenant_await_worker(&d, "", 0);
    tenant_enter(&anna, &d, "anna-token-1", "hall");
    tenant_enter(&bert, &d, "bert-token-1", NULL);
    peer_refused(
        &bert, HGP_T_scene_open, &(struct hgp_scene_open){.name = hgp_str_make("x")}, HG_E_LIMIT);
    assert_true(peer_says(&bert, "max-workers"));
    peer_call(&anna, HGP_T_scene_close, &(struct hgp_scene_close){0}, HGP_T_ok);
    peer_scene(&bert, "x"); // anna's is idle, and its place is bert's now, in a process of its own
    assert_true(tenant_await_worker(&d, "bert", 0) != first);
    assert_int_equal(tenant_worker(&d, "anna"), 0);
    peer_close(&anna);
    peer_close(&bert);
    daemon_finish(&d);
}

static void idle_workers_are_stopped(void **state)
{
    (void)state;
    struct daemon d;
    struct peer anna;
    daemon_init_tokens(&d);
    daemon_option(&d, "isolation", "tenant");
    daemon_option(&d, "worker-idle", "0.2");
    daemon_start(&d);
    tenant_enter(&anna, &d, "view-token-1", "hall");
    pid_t pid = tenant_await_worker(&d, "anna", 0);
    peer_call(&anna, HGP_T_scene_close, &(struct hgp_scene_close){0}, HGP_T_ok);
    daemon_wait_log(&d, "worker-idle");
    assert_int_equal(tenant_worker(&d, "anna"), 0);
    peer_scene(&anna, "hall"); // and comes back when there is a scene
    assert_true(tenant_await_worker(&d, "anna", 0) != pid);
    peer_close(&anna);
    daemon_finish(&d);
}

// Another daemon that is told the same cache folder, as two `helio serve` of one user are.
static pid_t start_beside(const struct daemon *d, const char *number)
{
    char program[600], listen[300], cache[300], worker[600], port[300], log[300];
    const char *build = getenv("HELIO_BUILD_DIR");
    snprintf(program, sizeof program, "%s/bin/heliod", build);
    snprintf(listen, sizeof listen, "unix:%s/sock%s", d->folder, number);
    snprintf(cache, sizeof cache, "%s/cache", d->folder);
    snprintf(worker, sizeof worker, "%s/tests/fake_worker", build);
    snprintf(port, sizeof port, "%s/port%s", d->folder, number);
    snprintf(log, sizeof log, "%s/log%s", d->folder, number);
    const pid_t pid = fork();
    if (pid == 0) {
        (void)!freopen(log, "w", stderr);
        prctl(PR_SET_PDEATHSIG, SIGKILL);
        execl(program, program, "--listen", listen, "--cache-dir", cache, "--worker", worker,
            "--sandbox", "off", "--port-file", port, NULL);
        _exit(127);
    }
    snprintf(port, sizeof port, "port%s", number);
    for (int i = 0; !daemon_has_file((struct daemon *)d, port); i++) {
        assert_true(i < 12000 && waitpid(pid, NULL, WNOHANG) == 0);
        usleep(5000);
    }
    return pid;
}

static void stop_beside(pid_t pid)
{
    int status;
    assert_int_equal(kill(pid, SIGTERM), 0);
    assert_int_equal(waitpid(pid, &status, 0), pid);
    assert_int_equal(status, 0);
}

static void daemons_take_nothing_of_each_other(void **state)
{
    (void)state;
    struct daemon d;
    struct peer anna;
    struct hgp_upload mine = {.total = 4, .data = {(const uint8_t *)"mine", 4}};
    assert_int_equal(hg_sha256("mine", 4, mine.hash), HG_OK);
    begin(&d, "4");
    tenant_enter(&anna, &d, "anna-token-1", "hall"); // in the first place, the spare's
    peer_call(&anna, HGP_T_upload, &mine, HGP_T_ok);
    assert_true(daemon_has_file(&d, "cache/workers/0/owner"));
    const pid_t second = start_beside(&d, "2"), third = start_beside(&d, "3");
    assert_true(daemon_has_file(&d, "cache/daemons/2/workers/0/cache"));
    assert_true(daemon_has_file(&d, "cache/daemons/3/uploads"));
    assert_true(daemon_has_file(&d, "cache/workers/0/owner"));
    stop_beside(second);
    stop_beside(third);
    assert_true(daemon_has_file(&d, "cache/workers/0/owner"));
    assert_true(peer_has_upload(&anna, mine.hash));
    peer_close(&anna);
    daemon_finish(&d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(deaths_stay_with_their_tenant),
        cmocka_unit_test(scenes_belong_to_tenants),
        cmocka_unit_test(uploads_belong_to_tenants),
        cmocka_unit_test(workers_are_limited_and_given_back),
        cmocka_unit_test(idle_workers_are_stopped),
        cmocka_unit_test(daemons_take_nothing_of_each_other),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
