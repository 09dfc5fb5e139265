// test_real_restarts.c - a new program, a killed daemon, killed workers and killed loaders, with
// real workers of two tenants: the same sessions, views and pictures afterwards, in homes and with
// weights as before.
//
// HELIO_KILLS=100 in the environment kills so many workers or loaders instead of 3; an argument
// names one test.
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/clock.h"
#include "tests/attack/loading.h"
#include "tests/attack/tenant_rig.h"

enum { SIDE = 32, FRAME_BYTES = SIDE * SIDE * 4, TENANTS = 2, HEAVY = 3 };

struct tenant_client {
    struct peer peer;
    const char *token, *name;
    float color[4];
    uint8_t before[FRAME_BYTES];
    uint64_t number, revision;
    uint8_t ticket[32];
    pid_t worker;
};

static void begin(struct daemon *d, struct tenant_client clients[TENANTS])
{
    char worker[512], path[TEST_FOLDER_MAX + 16];
    const char *build = getenv("HELIO_BUILD_DIR");
    assert_non_null(build);
    snprintf(worker, sizeof worker, "%s/libexec/helio-worker", build);
    setenv("HELIO_TEST_WORKER", worker, 1);
    tenant_rig_init(d);
    daemon_write(d, "tokens",
        "anna-token-1 edit anna weight=300\nbert-token-1 edit bert\nadmin-token-1 admin\n");
    snprintf(path, sizeof path, "%s/state", d->folder);
    daemon_option(d, "state-dir", path);
    daemon_option(d, "asset-root", d->folder);
    daemon_option(d, "seed-shaders", "false");
    daemon_option(d, "restart-delay", "0"); // doubles with each death
    daemon_option(d, "crash-limit", "1000");
    daemon_start(d);
    clients[0] = (struct tenant_client){
        .token = "anna-token-1", .name = "anna", .color = {0.9f, 0.1f, 0.1f, 1}};
    clients[1] = (struct tenant_client){
        .token = "bert-token-1", .name = "bert", .color = {0.1f, 0.1f, 0.9f, 1}};
}

static void build_scene(struct tenant_client *c)
{
    static const float corners[9] = {-1, -1, 0, 1, -1, 0, 0, 1, 0};
    struct peer *p = &c->peer;
    const uint32_t n = p->first_id;
    struct hgp_material_set paint = {.material = n,
        .has_base_color = true,
        .has_unlit = true,
        .unlit = true,
        .has_double_sided = true,
        .double_sided = true};
    struct hgp_mesh_part part = {.mode = HGP_primitive_mode_TRIANGLES,
        .material = n,
        .positions = {(const uint8_t *)corners, sizeof corners}};
    memcpy(paint.base_color, c->color, sizeof paint.base_color);
    peer_call(p, HGP_T_material_set, &paint, HGP_T_ok);
    peer_call(p, HGP_T_mesh_set, &(struct hgp_mesh_set){.mesh = n, .parts = {&part, 1}}, HGP_T_ok);
    peer_call(p, HGP_T_node_set, &(struct hgp_node_set){.node = n, .has_mesh = true, .mesh = n},
        HGP_T_ok);
    peer_call(p, HGP_T_view_set,
        &(struct hgp_view_set){.view = 1,
            .has_width = true,
            .width = SIDE,
            .has_height = true,
            .height = SIDE,
            .has_samples = true,
            .samples = 4,
            .has_gi = true,
            .gi = HGP_gi_NONE,
            .has_exposure_mode = true,
            .exposure_mode = HGP_exposure_mode_FIXED,
            .has_still_encoding = true,
            .still_encoding = HGP_encoding_RAW_RGBA8},
        HGP_T_ok);
    peer_tell(p, HGP_T_view_camera,
        &(struct hgp_view_camera){
            .view = 1, .input_seq = 7, .has_eye = true, .eye = {0, 0, 3}, .has_target = true});
}

static void take(struct tenant_client *c, uint8_t out[FRAME_BYTES])
{
    struct peer *p = &c->peer;
    peer_call(p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1, .settled = true},
        HGP_T_frame);
    assert_true(p->m.frame.settled);
    assert_int_equal(p->m.frame.data.size, FRAME_BYTES);
    assert_int_equal(p->m.frame.input_seq, 7);
    assert_true(p->m.frame.number >= c->number);
    c->number = p->m.frame.number;
    memcpy(out, p->m.frame.data.data, FRAME_BYTES);
}

static void open_client(struct tenant_client *c, struct daemon *d)
{
    tenant_enter(&c->peer, d, c->token, "hall");
    build_scene(c);
    take(c, c->before);
    c->revision = c->peer.m.frame.scene_revision;
    c->worker = tenant_worker(d, c->name);
    assert_true(c->worker > 0);
    const uint8_t *middle = c->before + (SIDE / 2 * SIDE + SIDE / 2) * 4;
    assert_true((middle[0] > middle[2]) == (c->color[0] > c->color[2]));
}

// The same picture of the same state, and the next edit makes the next revision.
static void check(struct tenant_client *c)
{
    uint8_t now[FRAME_BYTES];
    take(c, now);
    const uint64_t number = c->number;
    assert_memory_equal(now, c->before, FRAME_BYTES);
    assert_int_equal(c->peer.m.frame.scene_revision, c->revision);
    peer_call(&c->peer, HGP_T_node_set,
        &(struct hgp_node_set){
            .node = c->peer.first_id, .has_translation = true, .translation = {5, 0, 0}},
        HGP_T_ok);
    assert_int_equal(c->peer.m.ok.revision, c->revision + 1);
    take(c, now);
    assert_memory_not_equal(now, c->before, FRAME_BYTES);
    assert_true(c->number > number);
}

static double limit_of(pid_t pid)
{
    struct rlimit limit;
    assert_int_equal(prlimit(pid, RLIMIT_DATA, NULL, &limit), 0);
    return (double)limit.rlim_cur;
}

// Memory is shared out by weight.
static void await_weights(struct daemon *d)
{
    const uint64_t deadline_ns = hg_clock_now_ns() + 60000000000u;
    const pid_t anna = tenant_await_worker(d, "anna", 0), bert = tenant_await_worker(d, "bert", 0);
    for (double ratio = 0; ratio < HEAVY - 0.01 || ratio > HEAVY + 0.01;) {
        assert_true(hg_clock_now_ns() < deadline_ns);
        usleep(20000);
        ratio = limit_of(anna) / limit_of(bert);
    }
}

static void a_new_program_goes_on(void **state)
{
    (void)state;
    static struct tenant_client clients[TENANTS];
    struct daemon d;
    begin(&d, clients);
    for (int i = 0; i < TENANTS; i++)
        open_client(&clients[i], &d);
    await_weights(&d);
    daemon_signal(&d, SIGUSR2);
    daemon_wait_log(&d, "took over");
    for (int i = 0; i < TENANTS; i++) {
        check(&clients[i]);
        assert_int_equal(tenant_worker(&d, clients[i].name), clients[i].worker);
        // What is asked for from here on has the token's weight, too.
        peer_call(&clients[i].peer, HGP_T_scene_close, &(struct hgp_scene_close){0}, HGP_T_ok);
        peer_scene(&clients[i].peer, "yard");
    }
    usleep(200000); // shares are looked at every 50 ms
    await_weights(&d);
    for (int i = 0; i < TENANTS; i++)
        peer_close(&clients[i].peer);
    daemon_finish(&d);
}

static void a_killed_daemon_goes_on(void **state)
{
    (void)state;
    static struct tenant_client clients[TENANTS];
    struct daemon d;
    begin(&d, clients);
    for (int i = 0; i < TENANTS; i++) {
        open_client(&clients[i], &d);
        peer_call(&clients[i].peer, HGP_T_keep, &(struct hgp_keep){0}, HGP_T_ticket);
        memcpy(clients[i].ticket, clients[i].peer.m.ticket.secret.data, 32);
    }
    usleep(1500000); // cameras are recorded once a second
    daemon_signal(&d, SIGKILL);
    daemon_reap(&d);
    for (int i = 0; i < TENANTS; i++)
        peer_close(&clients[i].peer);
    daemon_start(&d);
    for (int i = 0; i < TENANTS; i++) {
        struct tenant_client *c = &clients[i];
        const uint32_t first_id = c->peer.first_id;
        const uint64_t session = c->peer.session;
        struct hgp_resume resume = {.secret = {c->ticket, sizeof c->ticket}};
        tenant_enter(&c->peer, &d, c->token, NULL);
        peer_call(&c->peer, HGP_T_resume, &resume, HGP_T_resumed);
        assert_int_equal(c->peer.m.resumed.session, session);
        assert_int_equal(c->peer.m.resumed.first_id, first_id);
        c->peer.first_id = first_id;
        check(c);
        assert_int_not_equal(tenant_worker(&d, c->name), c->worker);
    }
    await_weights(&d);
    for (int i = 0; i < TENANTS; i++)
        peer_close(&clients[i].peer);
    daemon_finish(&d);
}

// ---- killed workers -----------------------------------------------------------------------------

static int count_kills(void)
{
    const char *text = getenv("HELIO_KILLS");
    return text ? atoi(text) : 3;
}

// An edit that changes what the picture shows, or the one before it back.
static void move_away(struct tenant_client *c, bool away)
{
    peer_call(&c->peer, HGP_T_node_set,
        &(struct hgp_node_set){.node = c->peer.first_id,
            .has_translation = true,
            .translation = {away ? 5.0f : 0, 0, 0}},
        HGP_T_ok);
    assert_int_equal(c->peer.m.ok.revision, ++c->revision);
}

static int compare_times(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// The worker of the first tenant dies right after an edit was answered; its client has the picture
// with that edit from the next one. times: milliseconds until then, and of processor time of the
// new worker.
static void kill_worker(
    struct daemon *d, struct tenant_client *c, const uint8_t *wanted, double times[2])
{
    uint8_t now[FRAME_BYTES];
    const pid_t worker = tenant_worker(d, c->name);
    assert_true(worker > 0);
    const uint64_t start_ns = hg_clock_now_ns();
    assert_int_equal(kill(worker, SIGKILL), 0);
    take(c, now);
    const uint64_t took_ns = hg_clock_now_ns() - start_ns;
    assert_memory_equal(now, wanted, FRAME_BYTES);
    assert_int_equal(c->peer.m.frame.scene_revision, c->revision);
    c->worker = tenant_worker(d, c->name);
    assert_int_not_equal(c->worker, worker);
    times[0] = (double)took_ns * 1e-6;
    times[1] = 1000 * daemon_cpu_s(c->worker);
}

static void killed_workers_lose_nothing(void **state)
{
    (void)state;
    static struct tenant_client clients[TENANTS];
    static uint8_t away[FRAME_BYTES], now[FRAME_BYTES];
    struct daemon d;
    const int kills = count_kills();
    double times[2], *took_ms = calloc((size_t)kills, sizeof *took_ms),
                     *processor = calloc((size_t)kills, sizeof *processor);
    assert_true(took_ms && processor && kills > 0);
    begin(&d, clients);
    for (int i = 0; i < TENANTS; i++)
        open_client(&clients[i], &d);
    move_away(&clients[0], true);
    take(&clients[0], away);
    assert_memory_not_equal(away, clients[0].before, FRAME_BYTES);
    for (int i = 0; i < kills; i++) {
        move_away(&clients[0], i % 2);
        kill_worker(&d, &clients[0], i % 2 ? away : clients[0].before, times);
        took_ms[i] = times[0];
        processor[i] = times[1];
        take(&clients[1], now);
        assert_memory_equal(now, clients[1].before, FRAME_BYTES);
    }
    qsort(took_ms, (size_t)kills, sizeof *took_ms, compare_times);
    qsort(processor, (size_t)kills, sizeof *processor, compare_times);
    print_message("%d kills of workers: nothing lost; next frame after %.0f ms (median), %.0f at "
                  "most; the new one took %.0f ms of processor time for it (median)\n",
        kills, took_ms[kills / 2], took_ms[kills - 1], processor[kills / 2]);
    free(took_ms);
    free(processor);
    assert_int_equal(tenant_worker(&d, clients[1].name), clients[1].worker);
    for (int i = 0; i < TENANTS; i++)
        peer_close(&clients[i].peer);
    daemon_finish(&d);
}

// ---- killed loaders -----------------------------------------------------------------------------

// The loader that reads for a worker, once there is one.
static pid_t await_loader(pid_t worker)
{
    const uint64_t deadline_ns = hg_clock_now_ns() + 60000000000u;
    pid_t spawner, loader;
    while (!loading_count(worker, &spawner) || !loading_count(spawner, &loader)) {
        assert_true(hg_clock_now_ns() < deadline_ns);
        usleep(2000);
    }
    return loader;
}

// The file is refused; worker, scene and session go on, and the other tenant's.
static void kill_loader(struct tenant_client *c, uint32_t asset)
{
    const struct hgp_asset_load load = {.asset = asset, .path = hgp_str_make("slow.dae")};
    const uint32_t request = peer_send(&c->peer, HGP_T_asset_load, &load);
    assert_int_equal(kill(await_loader(c->worker), SIGKILL), 0);
    peer_error(&c->peer, request, HG_E_LIMIT);
    assert_true(peer_says(&c->peer, "was killed"));
    const struct hgp_str *what = &c->peer.m.error.what;
    assert_non_null(memmem(what->data, what->size, "slow.dae", 8));
}

static void killed_loaders_take_nothing_along(void **state)
{
    (void)state;
    static struct tenant_client clients[TENANTS];
    struct daemon d;
    char path[TEST_FOLDER_MAX + 16];
    uint8_t now[FRAME_BYTES];
    const int kills = count_kills();
    begin(&d, clients);
    snprintf(path, sizeof path, "%s/slow.dae", d.folder);
    loading_write_slow(path);
    for (int i = 0; i < TENANTS; i++)
        open_client(&clients[i], &d);
    for (int i = 0; i < kills; i++) {
        kill_loader(&clients[0], clients[0].peer.first_id + (uint32_t)i);
        for (int k = 0; k < TENANTS; k++) {
            take(&clients[k], now);
            assert_memory_equal(now, clients[k].before, FRAME_BYTES);
        }
    }
    print_message("%d kills of loaders: nothing lost\n", kills);
    for (int i = 0; i < TENANTS; i++) {
        check(&clients[i]);
        assert_int_equal(tenant_worker(&d, clients[i].name), clients[i].worker);
        peer_close(&clients[i].peer);
    }
    daemon_finish(&d);
}

int main(int argc, char **argv)
{
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_new_program_goes_on),
        cmocka_unit_test(a_killed_daemon_goes_on),
        cmocka_unit_test(killed_workers_lose_nothing),
        cmocka_unit_test(killed_loaders_take_nothing_along),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
