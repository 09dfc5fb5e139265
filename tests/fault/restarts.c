// restarts.c - kill -9 of the daemon, of workers, a full disk: what was answered is there again.
//
// HELIO_KILLS=1000 in the environment kills so many times instead of 20.
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/clock.h"
#include "base/sha256.h"
#include "tests/fault/built_scene.h"

static void init(struct daemon *d)
{
    char path[TEST_FOLDER_MAX + 16];
    daemon_init(d);
    snprintf(path, sizeof path, "%s/state", d->folder);
    daemon_option(d, "state-dir", path);
    daemon_option(d, "restart-delay", "0.01");
}

static void kill_and_start(struct daemon *d)
{
    daemon_signal(d, SIGKILL);
    daemon_reap(d);
    d->arg_count--; // port-file, which is added again
    free(d->args[d->arg_count]);
    daemon_start(d);
}

// Into a scene that is there already.
static void rejoin(struct peer *p, struct daemon *d, const char *name)
{
    peer_open(p, d);
    peer_call(p, HGP_T_scene_open, &(struct hgp_scene_open){.name = hgp_str_make(name)},
        HGP_T_scene_opened);
    assert_true(p->m.scene_opened.existed);
    p->first_id = p->m.scene_opened.first_id;
}

static void scenes_survive(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p, lone;
    struct hgp_frame before, after;
    uint8_t digest_before[32], digest_after[32];
    init(&d);
    daemon_start(&d);
    peer_open_scene(&p, &d, "kept");
    built_scene_make(&p);
    built_scene_frame(&p, &before, digest_before);
    peer_open_scene(&lone, &d, ""); // nobody can open it again
    peer_call(&lone, HGP_T_node_set, &(struct hgp_node_set){.node = lone.first_id}, HGP_T_ok);
    uint32_t first_id = p.first_id;
    for (int i = 0; i < 3; i++) {
        kill_and_start(&d);
        peer_close(&p);
        rejoin(&p, &d, "kept");
        assert_true(p.first_id != first_id); // there are objects in the old range
        built_scene_view(&p);
        built_scene_frame(&p, &after, digest_after);
        assert_memory_equal(digest_before, digest_after, 32);
        assert_int_equal(before.scene_revision, after.scene_revision);
    }
    char *log = daemon_read(&d, "log");
    assert_null(strstr(log, "an edit is refused now"));
    free(log);
    peer_call(&p, HGP_T_sessions_query, &(struct hgp_sessions_query){0}, HGP_T_json);
    assert_null(memmem(p.m.json.text.data, p.m.json.text.size, "private", 7));
    peer_close(&lone);
    peer_close(&p);
    daemon_finish(&d);
}

// An orderly end keeps them, too; one that everybody has left is gone.
static void scenes_survive_a_drain(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p, left;
    init(&d);
    daemon_option(&d, "resume-timeout", "3");
    daemon_start(&d);
    peer_open_scene(&p, &d, "kept");
    peer_call(&p, HGP_T_node_set, &(struct hgp_node_set){.node = p.first_id}, HGP_T_ok);
    peer_open_scene(&left, &d, "left");
    peer_call(&left, HGP_T_scene_close, &(struct hgp_scene_close){0}, HGP_T_ok);
    daemon_signal(&d, SIGTERM);
    assert_int_equal(daemon_wait(&d), 0);
    char path[TEST_FOLDER_MAX + 16];
    snprintf(path, sizeof path, "%s/port", d.folder);
    unlink(path);
    daemon_start(&d);
    peer_close(&left);
    peer_open(&left, &d);
    peer_call(&left, HGP_T_scene_open, &(struct hgp_scene_open){.name = hgp_str_make("left")},
        HGP_T_scene_opened);
    assert_false(left.m.scene_opened.existed);
    peer_close(&p);
    rejoin(&p, &d, "kept");
    assert_int_equal(p.m.scene_opened.revision, 1);
    peer_call(&p, HGP_T_scene_close, &(struct hgp_scene_close){0}, HGP_T_ok);
    daemon_wait_log(&d, "scene '1:kept' dropped"); // resume-timeout has come
    peer_close(&left);
    peer_close(&p);
    daemon_finish(&d);
}

// ---- kills under load ---------------------------------------------------------------------------

enum { CLIENTS = 4, NODES = 16, WINDOW = 32 };

// Edit number i, from 1 on, moves node i % NODES of its scene.
struct editor {
    struct peer peer;
    char scene[16];
    uint32_t base;           // first id of the session that made the scene
    uint64_t sent, answered; // edits
    uint32_t oldest;         // request that is not answered
};

static void send_edit(struct editor *e)
{
    uint64_t i = ++e->sent;
    peer_send(&e->peer, HGP_T_node_set,
        &(struct hgp_node_set){
            .node = e->base + i % NODES, .has_translation = true, .translation = {(float)i, 0, 0}});
}

// False: the daemon is gone.
static bool take_answer(struct editor *e)
{
    if (!peer_next_within(&e->peer, 20000))
        return false;
    if (e->peer.header.type == HGP_T_notice)
        return true; // a worker is replaced
    assert_int_equal(e->peer.header.type, HGP_T_ok);
    assert_int_equal(e->peer.m.ok.revision, ++e->answered);
    return true;
}

static void run_editor(struct editor *e, uint64_t until_ns)
{
    while (hg_clock_now_ns() < until_ns) {
        while (e->sent < e->answered + WINDOW)
            send_edit(e);
        assert_true(take_answer(e));
    }
}

// The picture of a scene with the first `revision` edits.
static void right_digest(
    struct daemon *d, const struct editor *e, uint64_t revision, uint8_t out[32])
{
    struct peer p;
    struct hgp_frame frame;
    peer_open_scene(&p, d, "");
    for (uint64_t i = revision > NODES ? revision - NODES + 1 : 1; i <= revision; i++)
        peer_call(&p, HGP_T_node_set,
            &(struct hgp_node_set){.node = p.first_id + i % NODES,
                .has_translation = true,
                .translation = {(float)i, 0, 0}},
            HGP_T_ok);
    assert_int_equal(p.first_id, e->base);
    peer_view(&p, 1, 16, 16);
    built_scene_frame(&p, &frame, out);
    peer_close(&p);
}

static void check_editor(struct daemon *d, struct editor *e)
{
    uint8_t right[32], got[32];
    struct hgp_frame frame;
    peer_close(&e->peer);
    rejoin(&e->peer, d, e->scene);
    uint64_t revision = e->peer.m.scene_opened.revision;
    if (revision < e->answered || revision > e->sent)
        fail_msg("%s: %llu edits were answered and %llu sent, %llu are there", e->scene,
            (unsigned long long)e->answered, (unsigned long long)e->sent,
            (unsigned long long)revision);
    peer_view(&e->peer, 1, 16, 16);
    built_scene_frame(&e->peer, &frame, got);
    right_digest(d, e, revision, right);
    assert_memory_equal(got, right, 32);
    assert_int_equal(frame.scene_revision, revision);
    e->sent = e->answered = revision;
}

static int compare(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

// From the kill to a picture in a scene that was there.
static double time_to_frame_ms(struct daemon *d, struct editor *e)
{
    uint64_t start_ns = hg_clock_now_ns();
    struct hgp_frame frame;
    uint8_t digest[32];
    kill_and_start(d);
    peer_close(&e->peer);
    rejoin(&e->peer, d, e->scene);
    peer_view(&e->peer, 1, 16, 16);
    built_scene_frame(&e->peer, &frame, digest);
    return (double)(hg_clock_now_ns() - start_ns) * 1e-6;
}

static void no_answered_edit_is_lost(void **state)
{
    (void)state;
    struct daemon d;
    struct editor editors[CLIENTS] = {0};
    const char *text = getenv("HELIO_KILLS");
    int kills = text ? atoi(text) : 20;
    double *times_ms = calloc((size_t)kills + 1, sizeof *times_ms);
    uint64_t answered = 0;
    init(&d);
    daemon_option(&d, "log", "info");
    daemon_option(&d, "crash-limit", "1000");
    daemon_start(&d);
    for (int i = 0; i < CLIENTS; i++) {
        struct editor *e = &editors[i];
        snprintf(e->scene, sizeof e->scene, "load%d", i);
        peer_open_scene(&e->peer, &d, e->scene);
        e->base = e->peer.first_id;
    }
    for (int i = 0; i < kills; i++) {
        for (int k = 0; k < CLIENTS; k++)
            run_editor(&editors[k], hg_clock_now_ns() + (uint64_t)(1 + (i * 7 + k) % 13) * 1000000);
        for (int k = 0; k < CLIENTS; k++) // and some under way
            while (editors[k].sent < editors[k].answered + WINDOW)
                send_edit(&editors[k]);
        if (i % 4 == 3) {
            pid_t worker = daemon_worker(&d, 0);
            kill(worker, SIGKILL);
        }
        hg_clock_sleep_ns((uint64_t)(i % 5) * 300000);
        times_ms[i] = time_to_frame_ms(&d, &editors[i % CLIENTS]);
        for (int k = 0; k < CLIENTS; k++) {
            answered += editors[k].answered;
            check_editor(&d, &editors[k]);
        }
    }
    qsort(times_ms, (size_t)kills, sizeof *times_ms, compare);
    print_message(
        "%d kills: nothing lost; from the kill to the next frame %.0f ms (median), %.0f at "
        "worst; the state log has %zu bytes\n",
        kills, times_ms[kills / 2], times_ms[kills - 1], daemon_file_size(&d, "state/state.log"));
    assert_true(answered > 0);
    for (int k = 0; k < CLIENTS; k++)
        peer_close(&editors[k].peer);
    free(times_ms);
    daemon_finish(&d);
}

// ---- limits -------------------------------------------------------------------------------------

static void one_daemon_at_a_time(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    char command[1024];
    init(&d);
    daemon_start(&d);
    snprintf(command, sizeof command,
        "timeout 20 %s/bin/heliod --listen unix:%s/second --cache-dir %s/cache --state-dir "
        "%s/state "
        "2>%s/second.log",
        getenv("HELIO_BUILD_DIR"), d.folder, d.folder, d.folder, d.folder);
    assert_int_equal(WEXITSTATUS(system(command)), 4);
    char *log = daemon_read(&d, "second.log");
    assert_non_null(strstr(log, "another heliod uses this folder"));
    free(log);
    peer_open_scene(&p, &d, "kept");
    peer_call(&p, HGP_T_node_set, &(struct hgp_node_set){.node = p.first_id}, HGP_T_ok);
    peer_close(&p);
    daemon_finish(&d);
}

static void set_file_limit(struct daemon *d, rlim_t bytes)
{
    struct rlimit limit;
    assert_int_equal(prlimit(d->pid, RLIMIT_FSIZE, NULL, &limit), 0);
    limit.rlim_cur = bytes;
    assert_int_equal(prlimit(d->pid, RLIMIT_FSIZE, &limit, NULL), 0);
}

static void set_mesh(struct peer *p, uint32_t number, enum hgp_type answer)
{
    static uint8_t points[1 << 20];
    struct hgp_mesh_part part = {
        .mode = HGP_primitive_mode_POINTS, .positions = {points, sizeof points / 12 * 12}};
    peer_send(p, HGP_T_mesh_set,
        &(struct hgp_mesh_set){.mesh = p->first_id + number, .parts = {&part, 1}});
    if (!answer)
        return;
    if (answer == HGP_T_error)
        peer_error(p, p->next_request - 1, HG_E_NOSPACE);
    else
        peer_answer(p, p->next_request - 1, answer);
}

static void fill_disk(struct daemon *d, const char *how)
{
    init(d);
    daemon_option(d, "state-failure", how);
    daemon_option(d, "log", "info");
    daemon_start(d);
}

// Edits are refused, the one on its way is answered when there is room again; the others go on.
static void full_disk_refuses(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p, other;
    fill_disk(&d, "refuse");
    peer_open_scene(&p, &d, "kept");
    for (uint32_t i = 0; i < 3; i++)
        set_mesh(&p, i, HGP_T_ok);
    peer_open_scene(&other, &d, "other");
    peer_view(&other, 1, 16, 16);
    set_file_limit(&d, 4 << 20);
    uint32_t waits = peer_send(&p, HGP_T_node_set, &(struct hgp_node_set){.node = p.first_id});
    peer_answer(&p, waits, HGP_T_ok); // small
    static uint8_t points[3 << 19];
    struct hgp_mesh_part part = {
        .mode = HGP_primitive_mode_POINTS, .positions = {points, sizeof points / 12 * 12}};
    waits = peer_send(
        &p, HGP_T_mesh_set, &(struct hgp_mesh_set){.mesh = p.first_id + 3, .parts = {&part, 1}});
    assert_true(peer_next(&p)); // before the answer, which waits
    assert_int_equal(p.header.type, HGP_T_notice);
    assert_int_equal(p.m.notice.code, HG_E_NOSPACE);
    assert_memory_equal(p.m.notice.what.data, "state-dir", 9);
    assert_false(peer_next_within(&p, 300));
    daemon_wait_log(&d, "edits are not answered");
    set_mesh(&other, 0, HGP_T_error);
    peer_refused(
        &other, HGP_T_node_set, &(struct hgp_node_set){.node = other.first_id}, HG_E_NOSPACE);
    peer_call(&other, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    set_file_limit(&d, RLIM_INFINITY);
    peer_answer(&p, waits, HGP_T_ok);
    daemon_wait_log(&d, "is complete again");
    set_mesh(&other, 0, HGP_T_ok);
    kill_and_start(&d);
    peer_close(&p);
    peer_close(&other);
    rejoin(&p, &d, "kept");
    assert_int_equal(p.m.scene_opened.revision, 5);
    rejoin(&other, &d, "other");
    assert_int_equal(other.m.scene_opened.revision, 1);
    peer_close(&p);
    peer_close(&other);
    daemon_finish(&d);
}

// Of a session that a client keeps only what it edits waits for the disk: it is shown pictures,
// also when its view changes, joins scenes that are there, and leaves them.
static void full_disk_shows_kept_sessions_pictures(void **state)
{
    (void)state;
    struct daemon d;
    struct peer owner, viewer;
    fill_disk(&d, "refuse");
    peer_open_scene(&owner, &d, "kept");
    peer_open(&viewer, &d);
    peer_call(&viewer, HGP_T_keep, &(struct hgp_keep){0}, HGP_T_ticket);
    set_file_limit(&d, 64 << 10);
    set_mesh(&owner, 0, 0);
    daemon_wait_log(&d, "cannot be rewritten");
    const struct hgp_scene_open open = {.name = hgp_str_make("kept")};
    peer_call(&viewer, HGP_T_scene_open, &open, HGP_T_scene_opened);
    viewer.first_id = viewer.m.scene_opened.first_id;
    for (uint32_t i = 1; i < 4; i++) {
        peer_view(&viewer, i, 16, 16);
        peer_call(
            &viewer, HGP_T_frame_request, &(struct hgp_frame_request){.view = i}, HGP_T_frame);
        usleep(400000); // between them the log is tried again
    }
    peer_refused(
        &viewer, HGP_T_node_set, &(struct hgp_node_set){.node = viewer.first_id}, HG_E_NOSPACE);
    peer_call(&viewer, HGP_T_scene_close, &(struct hgp_scene_close){0}, HGP_T_ok);
    const struct hgp_scene_open fresh = {.name = hgp_str_make("fresh")};
    peer_refused(&viewer, HGP_T_scene_open, &fresh, HG_E_NOSPACE);
    set_file_limit(&d, RLIM_INFINITY);
    daemon_wait_log(&d, "is complete again");
    peer_call(&viewer, HGP_T_scene_open, &fresh, HGP_T_scene_opened);
    peer_close(&viewer);
    peer_close(&owner);
    daemon_finish(&d);
}

static void full_disk_goes_on(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    fill_disk(&d, "continue");
    peer_open_scene(&p, &d, "kept");
    set_mesh(&p, 0, HGP_T_ok);
    set_file_limit(&d, 3 << 20);
    for (uint32_t i = 1; i < 6; i++)
        set_mesh(&p, i, HGP_T_ok);
    daemon_wait_log(&d, "nothing survives the daemon");
    set_file_limit(&d, RLIM_INFINITY);
    daemon_wait_log(&d, "is complete again");
    kill_and_start(&d);
    peer_close(&p);
    rejoin(&p, &d, "kept");
    assert_int_equal(p.m.scene_opened.revision, 6); // the snapshot has all of them
    peer_close(&p);
    daemon_finish(&d);
}

// ---- what else survives -------------------------------------------------------------------------

static void quarantine_survives(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    init(&d);
    daemon_start(&d);
    peer_open_scene(&p, &d, "kept");
    daemon_write(&d, "kill.asset_load", "");
    struct hgp_asset_load load = {.asset = p.first_id, .path = hgp_str_make("poison")};
    peer_refused(&p, HGP_T_asset_load, &load, HG_E_WORKER);
    char path[TEST_FOLDER_MAX + 32];
    snprintf(path, sizeof path, "%s/kill.asset_load", d.folder);
    unlink(path);
    peer_close(&p);
    kill_and_start(&d);
    peer_open_scene(&p, &d, "another");
    load.asset = p.first_id;
    peer_refused(&p, HGP_T_asset_load, &load, HG_E_WORKER);
    peer_call(&p, HGP_T_quarantine_clear, &(struct hgp_quarantine_clear){0}, HGP_T_ok);
    kill_and_start(&d);
    peer_close(&p);
    peer_open_scene(&p, &d, "a third");
    load.asset = p.first_id;
    peer_call(&p, HGP_T_asset_load, &load, HGP_T_asset_loaded);
    peer_close(&p);
    daemon_finish(&d);
}

// Contents that a tenant has sent are still its own, and are on the disk before their answer.
static void uploads_and_audit_survive(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    uint8_t hash[32];
    init(&d);
    daemon_start(&d);
    peer_open_scene(&p, &d, "kept");
    assert_int_equal(hg_sha256("content", 7, hash), HG_OK);
    struct hgp_upload upload = {.total = 7, .data = {(const uint8_t *)"content", 7}};
    memcpy(upload.hash, hash, 32);
    peer_call(&p, HGP_T_upload, &upload, HGP_T_ok);
    struct hgp_asset_file file = {.uri = hgp_str_make("a.glb")};
    memcpy(file.hash, hash, 32);
    peer_call(&p, HGP_T_asset_load,
        &(struct hgp_asset_load){.asset = p.first_id, .files = {&file, 1}}, HGP_T_asset_loaded);
    kill_and_start(&d);
    peer_close(&p);
    rejoin(&p, &d, "kept");
    assert_true(peer_has_upload(&p, hash));
    char *audit = daemon_read(&d, "state/audit.log");
    assert_non_null(strstr(audit, "\"event\":\"upload\""));
    free(audit);
    peer_close(&p);
    daemon_finish(&d);
}

static void start_with_bad_disk(struct daemon *d)
{
    char library[512], options[600], usual[512], flag[TEST_FOLDER_MAX + 16];
    const char *build = getenv("HELIO_BUILD_DIR"), *asan = getenv("ASAN_OPTIONS");
    assert_non_null(build);
    snprintf(library, sizeof library, "%s/tests/libbad_sync.so", build);
    snprintf(flag, sizeof flag, "%s/bad", d->folder);
    snprintf(usual, sizeof usual, "%s", asan ? asan : "");
    snprintf(options, sizeof options, "%s:verify_asan_link_order=0", usual);
    setenv("ASAN_OPTIONS", options, 1);
    setenv("LD_PRELOAD", library, 1);
    setenv("HELIO_SYNC_FAILS", flag, 1);
    daemon_start(d);
    unsetenv("LD_PRELOAD");
    setenv("ASAN_OPTIONS", usual, 1);
}

// What cannot be synced is refused and not kept; sent again, it is taken once the disk takes it.
static void contents_that_cannot_be_synced(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    char flag[TEST_FOLDER_MAX + 16];
    struct hgp_upload upload = {.total = 7, .data = {(const uint8_t *)"content", 7}};
    init(&d);
    start_with_bad_disk(&d);
    peer_open(&p, &d);
    assert_int_equal(hg_sha256("content", 7, upload.hash), HG_OK);
    daemon_write(&d, "bad", "");
    for (int i = 0; i < 2; i++) {
        peer_refused(&p, HGP_T_upload, &upload, HG_E_IO);
        assert_false(peer_has_upload(&p, upload.hash));
    }
    snprintf(flag, sizeof flag, "%s/bad", d.folder);
    assert_int_equal(unlink(flag), 0);
    peer_call(&p, HGP_T_upload, &upload, HGP_T_ok);
    assert_true(peer_has_upload(&p, upload.hash));
    peer_close(&p);
    daemon_finish(&d);
}

int main(int argc, char **argv)
{
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(scenes_survive),
        cmocka_unit_test(scenes_survive_a_drain),
        cmocka_unit_test(no_answered_edit_is_lost),
        cmocka_unit_test(one_daemon_at_a_time),
        cmocka_unit_test(full_disk_refuses),
        cmocka_unit_test(full_disk_shows_kept_sessions_pictures),
        cmocka_unit_test(full_disk_goes_on),
        cmocka_unit_test(quarantine_survives),
        cmocka_unit_test(uploads_and_audit_survive),
        cmocka_unit_test(contents_that_cannot_be_synced),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
