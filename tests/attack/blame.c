// blame.c - files and views that end workers: who is blamed, and for how long.
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/sha256.h"
#include "tests/system/daemon.h"

static void begin(struct daemon *d)
{
    daemon_init_tokens(d);
    daemon_option(d, "restart-delay", "0.01");
    daemon_option(d, "crash-limit", "100");
    daemon_start(d);
}

static void enter(struct peer *p, struct daemon *d, const char *token)
{
    peer_enter(p, d, token);
    peer_scene(p, "");
}

// Takes a tripwire away.
static void disarm(const struct daemon *d, const char *name)
{
    char path[TEST_FOLDER_MAX + 32];
    snprintf(path, sizeof path, "%s/%s", d->folder, name);
    assert_int_equal(unlink(path), 0);
}

static struct hgp_asset_load load_of(const struct peer *p, const char *path)
{
    return (struct hgp_asset_load){.asset = p->first_id, .path = hgp_str_make(path)};
}

static void begin_both(struct daemon *d, struct peer *honest, struct peer *hostile)
{
    begin(d);
    enter(honest, d, "edit-token-1");
    peer_view(honest, 1, 8, 8);
    enter(hostile, d, "admin-token-1");
}

// A file that ended a worker twice is refused, also in another session, and nobody else's is.
static void files_are_quarantined(void **state)
{
    (void)state;
    struct daemon d;
    struct peer honest, hostile;
    begin_both(&d, &honest, &hostile);
    struct hgp_asset_load poison = load_of(&hostile, "poison"), good = load_of(&hostile, "good");
    daemon_write(&d, "kill.asset_load", "");
    peer_refused(&hostile, HGP_T_asset_load, &poison, HG_E_WORKER);
    disarm(&d, "kill.asset_load");
    peer_close(&hostile);
    enter(&hostile, &d, "admin-token-1");
    poison.asset = good.asset = hostile.first_id;
    peer_refused(&hostile, HGP_T_asset_load, &poison, HG_E_WORKER);
    assert_true(peer_says(&hostile, "quarantine"));
    peer_call(&hostile, HGP_T_asset_load, &good, HGP_T_asset_loaded);
    // An administrator sees it, and may let it in again.
    peer_call(&hostile, HGP_T_quarantine_query, &(struct hgp_quarantine_query){0}, HGP_T_json);
    const struct hgp_str *json = &hostile.m.json.text;
    assert_non_null(memmem(json->data, json->size, "\"file\":\"poison\",\"deaths\":2", 26));
    peer_refused(&hostile, HGP_T_quarantine_clear,
        &(struct hgp_quarantine_clear){.key = hgp_str_make("no-such-key")}, HG_E_NOTFOUND);
    peer_call(&hostile, HGP_T_quarantine_clear, &(struct hgp_quarantine_clear){0}, HGP_T_ok);
    poison.asset++;
    peer_call(&hostile, HGP_T_asset_load, &poison, HGP_T_asset_loaded);
    // Another tenant may load what it likes under that name.
    struct hgp_asset_load own = load_of(&honest, "poison");
    peer_call(&honest, HGP_T_asset_load, &own, HGP_T_asset_loaded);
    peer_call(&honest, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    peer_close(&hostile);
    peer_close(&honest);
    daemon_finish(&d);
}

// Disconnecting leaves a trace: the file is tried alone when it comes again, and blamed at once.
static void leaving_does_not_help(void **state)
{
    (void)state;
    struct daemon d;
    struct peer honest, hostile;
    begin_both(&d, &honest, &hostile);
    struct hgp_asset_load poison = load_of(&hostile, "poison");
    pid_t worker = daemon_worker(&d, 0);
    daemon_write(&d, "die.asset_load", "");
    peer_tell(&hostile, HGP_T_asset_load, &poison);
    peer_close(&hostile);
    daemon_worker(&d, worker);
    enter(&hostile, &d, "admin-token-1");
    poison.asset = hostile.first_id;
    daemon_write(&d, "die.asset_load", "");
    peer_refused(&hostile, HGP_T_asset_load, &poison, HG_E_WORKER);
    peer_refused(&hostile, HGP_T_asset_load, &poison, HG_E_WORKER);
    assert_true(peer_says(&hostile, "quarantine"));
    peer_call(&honest, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    peer_close(&hostile);
    peer_close(&honest);
    daemon_finish(&d);
}

// A subscription is a suspect like a request.
static void subscriptions_are_blamed(void **state)
{
    (void)state;
    struct daemon d;
    struct peer honest, hostile;
    begin_both(&d, &honest, &hostile);
    peer_view(&hostile, 1, 8, 8);
    daemon_write(&d, "kill.subscribe", "");
    peer_tell(&hostile, HGP_T_subscribe, &(struct hgp_subscribe){.view = 1, .credit_frames = 10});
    daemon_wait_log(&d, "it is not tried again"); // the request that made it
    disarm(&d, "kill.subscribe");
    peer_call(&honest, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    peer_close(&hostile);
    peer_close(&honest);
    daemon_finish(&d);
}

// A suspect subscription that its client stops does not hold the other sessions up.
static void stopped_suspects_hold_nobody_up(void **state)
{
    (void)state;
    struct daemon d;
    struct peer honest, hostile;
    daemon_init_tokens(&d);
    daemon_option(&d, "restart-delay", "1"); // time to stop it in
    daemon_start(&d);
    enter(&honest, &d, "edit-token-1");
    peer_view(&honest, 1, 8, 8);
    enter(&hostile, &d, "admin-token-1");
    peer_view(&hostile, 1, 8, 8);
    peer_call(&hostile, HGP_T_subscribe, &(struct hgp_subscribe){.view = 1, .credit_frames = 10},
        HGP_T_ok);
    assert_int_equal(kill(daemon_worker(&d, 0), SIGKILL), 0);
    daemon_wait_log(&d, "it is replaced");
    peer_tell(&hostile, HGP_T_subscribe, &(struct hgp_subscribe){.view = 1, .credit_frames = 0});
    peer_call(&honest, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    peer_call(&hostile, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    peer_close(&hostile);
    peer_close(&honest);
    daemon_finish(&d);
}

// The worker says what it hangs in: that is given up after one death, and nothing else is tried
// alone.
static void what_hangs_is_blamed_at_once(void **state)
{
    (void)state;
    struct daemon d;
    struct peer honest, hostile;
    daemon_init_tokens(&d);
    daemon_option(&d, "hang-timeout", "0.5");
    daemon_option(&d, "restart-delay", "0.01");
    daemon_start(&d);
    enter(&honest, &d, "edit-token-1");
    peer_call(&honest, HGP_T_view_set,
        &(struct hgp_view_set){.view = 1, .has_seed = true, .seed = 1000}, HGP_T_ok); // ms
    enter(&hostile, &d, "admin-token-1");
    struct hgp_asset_load poison = load_of(&hostile, "poison");
    daemon_write(&d, "stuck.asset_load", "");
    uint32_t asked =
        peer_send(&honest, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1});
    peer_refused(&hostile, HGP_T_asset_load, &poison, HG_E_WORKER);
    peer_refused(&hostile, HGP_T_asset_load, &poison, HG_E_WORKER);
    assert_true(peer_says(&hostile, "quarantine"));
    peer_answer(&honest, asked, HGP_T_frame);
    char *log = daemon_read(&d, "log");
    char *first = strstr(log, "hang-timeout");
    assert_non_null(first);
    assert_null(strstr(first + 1, "hang-timeout"));
    free(log);
    peer_close(&hostile);
    peer_close(&honest);
    daemon_finish(&d);
}

// Fresh requests wait while suspects are tried: none of them is taken for the guilty one.
static void innocents_are_not_blamed(void **state)
{
    (void)state;
    struct daemon d;
    struct peer honest, hostile;
    uint32_t asked[20];
    begin_both(&d, &honest, &hostile);
    struct hgp_asset_load poison = load_of(&hostile, "poison");
    daemon_write(&d, "kill.asset_load", "");
    uint32_t load = peer_send(&hostile, HGP_T_asset_load, &poison);
    for (int i = 0; i < 20; i++) {
        asked[i] = peer_send(&honest, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1});
        usleep(5000);
    }
    peer_error(&hostile, load, HG_E_WORKER);
    disarm(&d, "kill.asset_load");
    for (int i = 0; i < 20; i++)
        peer_answer(&honest, asked[i], HGP_T_frame);
    peer_close(&hostile);
    peer_close(&honest);
    daemon_finish(&d);
}

static struct hgp_asset_file file_of(struct peer *p, const char *uri, const char *text)
{
    const uint32_t size = (uint32_t)strlen(text);
    struct hgp_upload content = {.total = size, .data = {(const uint8_t *)text, size}};
    struct hgp_asset_file file = {.uri = hgp_str_make(uri)};
    assert_int_equal(hg_sha256(text, size, content.hash), HG_OK);
    peer_call(p, HGP_T_upload, &content, HGP_T_ok);
    memcpy(file.hash, content.hash, 32);
    return file;
}

// Each file of a load is known: others beside it change nothing.
static void junk_beside_a_file_does_not_help(void **state)
{
    (void)state;
    struct daemon d;
    struct peer honest, hostile;
    begin_both(&d, &honest, &hostile);
    struct hgp_asset_file files[] = {file_of(&hostile, "junk.png", "junk"),
        file_of(&hostile, "poison.glb", "poison"), file_of(&hostile, "good.glb", "good")};
    struct hgp_asset_load load = {.asset = hostile.first_id, .files = {&files[1], 1}};
    daemon_write(&d, "kill.asset_load", "");
    peer_refused(&hostile, HGP_T_asset_load, &load, HG_E_WORKER);
    disarm(&d, "kill.asset_load");
    load.files.items = files; // with a file before it
    load.files.count = 2;
    peer_refused(&hostile, HGP_T_asset_load, &load, HG_E_WORKER);
    assert_true(peer_says(&hostile, "quarantine"));
    load.files.items = &files[2];
    load.files.count = 1;
    peer_call(&hostile, HGP_T_asset_load, &load, HGP_T_asset_loaded);
    peer_call(&honest, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    peer_close(&hostile);
    peer_close(&honest);
    daemon_finish(&d);
}

static struct hgp_mesh_set mesh_of(struct peer *p, struct hgp_mesh_part *part, uint32_t number)
{
    return (struct hgp_mesh_set){.mesh = p->first_id + number, .parts = {part, 1}};
}

// Meshes, textures and comparisons are known by their data, queries by their scene, in whatever
// session they come.
static void data_and_queries_are_quarantined(void **state)
{
    (void)state;
    struct daemon d;
    struct peer honest, hostile;
    static const float poison[] = {1, 2, 3}, good[] = {1, 2, 4};
    struct hgp_mesh_part part = {
        .mode = HGP_primitive_mode_POINTS, .positions = {(const uint8_t *)poison, sizeof poison}};
    const struct hgp_info_query query = {0};
    begin_both(&d, &honest, &hostile);
    struct hgp_mesh_set mesh = mesh_of(&hostile, &part, 0);
    daemon_write(&d, "kill.mesh_set", "");
    peer_refused(&hostile, HGP_T_mesh_set, &mesh, HG_E_WORKER);
    disarm(&d, "kill.mesh_set");
    peer_close(&hostile);
    peer_enter(&hostile, &d, "admin-token-1");
    peer_scene(&hostile, "hall");
    mesh = mesh_of(&hostile, &part, 5); // under another id
    peer_refused(&hostile, HGP_T_mesh_set, &mesh, HG_E_WORKER);
    assert_true(peer_says(&hostile, "quarantine"));
    mesh = mesh_of(&honest, &part, 0); // of another tenant
    peer_call(&honest, HGP_T_mesh_set, &mesh, HGP_T_ok);
    part.positions.data = (const uint8_t *)good; // as large
    mesh = mesh_of(&hostile, &part, 5);
    peer_call(&hostile, HGP_T_mesh_set, &mesh, HGP_T_ok);
    daemon_write(&d, "kill.info_query", "");
    peer_refused(&hostile, HGP_T_info_query, &query, HG_E_WORKER);
    disarm(&d, "kill.info_query");
    peer_close(&hostile);
    peer_enter(&hostile, &d, "admin-token-1");
    peer_scene(&hostile, "hall");
    peer_refused(&hostile, HGP_T_info_query, &query, HG_E_WORKER);
    assert_true(peer_says(&hostile, "quarantine"));
    peer_close(&hostile);
    enter(&hostile, &d, "admin-token-1"); // another scene
    peer_call(&hostile, HGP_T_info_query, &query, HGP_T_json);
    peer_call(&honest, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    peer_close(&hostile);
    peer_close(&honest);
    daemon_finish(&d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(files_are_quarantined),
        cmocka_unit_test(leaving_does_not_help),
        cmocka_unit_test(subscriptions_are_blamed),
        cmocka_unit_test(stopped_suspects_hold_nobody_up),
        cmocka_unit_test(what_hangs_is_blamed_at_once),
        cmocka_unit_test(innocents_are_not_blamed),
        cmocka_unit_test(junk_beside_a_file_does_not_help),
        cmocka_unit_test(data_and_queries_are_quarantined),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
