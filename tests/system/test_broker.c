// test_broker.c - heliod with a fake worker: handshake, rules of the wire, scenes, quotas, uploads.
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/clock.h"
#include "base/sha256.h"
#include "tests/system/daemon.h"

// ---- handshake ----------------------------------------------------------------------------------

static void opens_for_own_user(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    daemon_begin(&d);
    peer_open(&p, &d);
    assert_int_equal(p.m.welcome.role, HGP_role_ADMIN);
    peer_call(&p, HGP_T_ping, &(struct hgp_ping){.nonce = 42}, HGP_T_pong);
    assert_int_equal(p.m.pong.nonce, 42);
    peer_close(&p);
    daemon_finish(&d);
}

static void half_handshakes_end(void **state)
{
    (void)state;
    struct daemon d;
    struct peer silent, half, slow, other;
    daemon_init(&d);
    daemon_option(&d, "handshake-timeout", "3"); // the good ones need some of it, too
    daemon_start(&d);
    peer_connect(&silent, &d, false);
    peer_connect(&half, &d, false);
    peer_raw(&half, HGP_PREFACE, 4);
    peer_connect(&slow, &d, false);
    peer_raw(&slow, HGP_PREFACE "\x10", HGP_PREFACE_BYTES + 1);
    peer_open(&other, &d);
    peer_end(&silent);
    peer_end(&half);
    assert_true(peer_next(&slow)); // it spoke HGP, so it is told
    assert_int_equal(slow.header.type, HGP_T_error);
    assert_int_equal(slow.m.error.code, HG_E_TIMEOUT);
    peer_end(&slow);
    peer_call(&other, HGP_T_ping, &(struct hgp_ping){.nonce = 1}, HGP_T_pong);
    peer_close(&silent);
    peer_close(&half);
    peer_close(&slow);
    peer_close(&other);
    daemon_finish(&d);
}

static void wrong_preface_and_version(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    daemon_begin(&d);
    peer_connect(&p, &d, false);
    peer_raw(&p, "\x16\x03\x01\x02\x00\x01", 6); // TLS where none is spoken
    assert_false(peer_next(&p)); // closed without an answer
    peer_close(&p);
    peer_connect(&p, &d, false);
    peer_raw(&p, HGP_PREFACE, HGP_PREFACE_BYTES);
    peer_tell(&p, HGP_T_hello, &(struct hgp_hello){.version_min = 7, .version_max = 9});
    assert_true(peer_next(&p));
    assert_int_equal(p.m.error.code, HG_E_VERSION);
    peer_end(&p);
    peer_close(&p);
    daemon_finish(&d);
}

static void tokens_decide(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    daemon_init_tokens(&d);
    daemon_start(&d);
    assert_true(d.port > 0);
    peer_connect(&p, &d, true);
    peer_hello(&p);
    assert_true(p.m.welcome.auth_required);
    peer_auth(&p, "view-token-1");
    assert_true(peer_next(&p));
    assert_int_equal(p.header.type, HGP_T_auth_ok);
    assert_int_equal(p.m.auth_ok.role, HGP_role_VIEW);
    assert_memory_equal(p.m.auth_ok.name.data, "anna", 4);
    // The role: a viewer may open a scene, not change it, not list sessions.
    peer_scene(&p, "shared");
    peer_refused(&p, HGP_T_node_set, &(struct hgp_node_set){.node = 1}, HG_E_PERM);
    peer_refused(&p, HGP_T_sessions_query, &(struct hgp_sessions_query){0}, HG_E_PERM);
    peer_close(&p);
    for (int i = 0; i < 2; i++) {
        peer_connect(&p, &d, true);
        peer_hello(&p);
        peer_auth(&p, i ? "view-token-" : "view-token-2");
        assert_true(peer_next(&p));
        assert_int_equal(p.header.type, HGP_T_error);
        assert_int_equal(p.m.error.code, HG_E_AUTH);
        peer_end(&p);
        peer_close(&p);
    }
    daemon_finish(&d);
}

static void unix_can_require_tokens(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    daemon_init_tokens(&d);
    daemon_option(&d, "require-token", NULL);
    daemon_start(&d);
    peer_connect(&p, &d, false);
    peer_hello(&p);
    assert_true(p.m.welcome.auth_required);
    // Nothing but auth is understood now.
    peer_send(&p, HGP_T_scene_open, &(struct hgp_scene_open){0});
    assert_true(peer_next(&p));
    assert_int_equal(p.m.error.code, HG_E_STATE);
    peer_end(&p);
    peer_close(&p);
    daemon_finish(&d);
}

// ---- rules of the wire --------------------------------------------------------------------------

static void oversized_messages(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    uint8_t header[HGP_HEADER_BYTES];
    daemon_init_tokens(&d);
    daemon_option(&d, "max-message", "2");
    daemon_start(&d);
    peer_connect(&p, &d, true);
    peer_hello(&p);
    hgp_header_encode(
        &(struct hgp_header){.length = HGP_LIMIT_BEFORE_AUTH + 1, .type = HGP_T_auth}, header);
    peer_raw(&p, header, sizeof header);
    assert_true(peer_next(&p)); // at once, before any payload
    assert_int_equal(p.m.error.code, HG_E_LIMIT);
    peer_end(&p);
    peer_close(&p);
    peer_open(&p, &d);
    assert_int_equal(p.m.welcome.max_message_bytes, 2 << 20);
    hgp_header_encode(
        &(struct hgp_header){.length = (2 << 20) + 1, .type = HGP_T_upload, .request = 5}, header);
    peer_raw(&p, header, sizeof header);
    assert_true(peer_next(&p));
    assert_int_equal(p.m.error.code, HG_E_LIMIT);
    peer_end(&p);
    peer_close(&p);
    daemon_finish(&d);
}

static void send_header(struct peer *p, struct hgp_header h, const void *payload)
{
    uint8_t header[HGP_HEADER_BYTES];
    hgp_header_encode(&h, header);
    peer_raw(p, header, sizeof header);
    peer_raw(p, payload, h.length);
}

static void unknown_and_broken_messages(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    daemon_begin(&d);
    peer_open(&p, &d);
    send_header(&p, (struct hgp_header){.type = 0x7777, .request = 8, .length = 3}, "abc");
    peer_error(&p, 8, HG_E_UNSUPPORTED);
    send_header(&p,
        (struct hgp_header){.type = 0x7777, .flags = HGP_FLAG_OPTIONAL, .request = 9, .length = 3},
        "abc");
    peer_call(&p, HGP_T_ping, &(struct hgp_ping){.nonce = 2}, HGP_T_pong); // 9 was skipped
    // A payload that ends early: the request fails with the place, the connection stays.
    send_header(&p, (struct hgp_header){.type = HGP_T_ping, .request = 10, .length = 3}, "abc");
    peer_error(&p, 10, HG_E_TRUNCATED);
    assert_memory_equal(p.m.error.what.data, "ping", 4);
    assert_true(p.m.error.where.size > 0);
    // Wrong direction ends the connection.
    peer_send(&p, HGP_T_ok, &(struct hgp_ok){.revision = 1});
    assert_true(peer_next(&p));
    assert_int_equal(p.m.error.code, HG_E_STATE);
    peer_end(&p);
    peer_close(&p);
    // So does a header that cannot be believed, and a message of the inner link.
    peer_open(&p, &d);
    send_header(&p, (struct hgp_header){.type = HGP_T_ping, .flags = 0x10}, "");
    assert_true(peer_next(&p));
    assert_int_equal(p.m.error.code, HG_E_FORMAT);
    peer_end(&p);
    peer_close(&p);
    peer_open(&p, &d);
    peer_send(&p, HGP_T_session_detach, &(struct hgp_session_detach){0});
    assert_true(peer_next(&p));
    assert_int_equal(p.m.error.code, HG_E_STATE);
    peer_end(&p);
    peer_close(&p);
    daemon_finish(&d);
}

// ---- scenes and frames --------------------------------------------------------------------------

static void relays_edits_and_frames(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    daemon_begin(&d);
    peer_open(&p, &d);
    peer_refused(&p, HGP_T_node_set, &(struct hgp_node_set){.node = 1}, HG_E_STATE); // no scene
    peer_scene(&p, "");
    assert_false(p.m.scene_opened.existed);
    peer_call(&p, HGP_T_node_set, &(struct hgp_node_set){.node = p.first_id}, HGP_T_ok);
    assert_int_equal(p.m.ok.revision, 1);
    peer_refused(&p, HGP_T_asset_load, &(struct hgp_asset_load){.asset = 4000000000u}, HG_E_INVAL);
    peer_call(&p, HGP_T_asset_load,
        &(struct hgp_asset_load){.asset = p.first_id, .path = hgp_str_make("demo:")},
        HGP_T_asset_loaded);
    peer_refused(&p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 3}, HG_E_NOTFOUND);
    peer_view(&p, 3, 64, 32);
    peer_tell(&p, HGP_T_view_camera, &(struct hgp_view_camera){.view = 3, .input_seq = 77});
    peer_call(&p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 3, .settled = true},
        HGP_T_frame);
    assert_int_equal(p.m.frame.input_seq, 77);
    assert_int_equal(p.m.frame.data.size, 64 * 32 * 4);
    peer_refused(
        &p, HGP_T_bake, &(struct hgp_bake){.options = hgp_str_make("{}")}, HG_E_UNSUPPORTED);
    // A request without an id that fails is told as a notice.
    peer_tell(&p, HGP_T_node_set,
        &(struct hgp_node_set){.node = p.first_id, .has_parent = true, .parent = 999});
    assert_true(peer_next(&p));
    assert_int_equal(p.header.type, HGP_T_notice);
    assert_int_equal(p.m.notice.code, HG_E_NOTFOUND);
    peer_call(&p, HGP_T_scene_close, &(struct hgp_scene_close){0}, HGP_T_ok);
    peer_scene(&p, "other");
    peer_close(&p);
    daemon_finish(&d);
}

static void shares_scenes(void **state)
{
    (void)state;
    struct daemon d;
    struct peer a, b;
    uint8_t seen[32];
    daemon_begin(&d);
    peer_open_scene(&a, &d, "hall");
    peer_call(&a, HGP_T_node_set, &(struct hgp_node_set){.node = a.first_id}, HGP_T_ok);
    peer_open_scene(&b, &d, "hall");
    assert_true(b.m.scene_opened.existed);
    assert_int_equal(b.m.scene_opened.revision, 1);
    assert_true(b.first_id != a.first_id);
    peer_view(&a, 1, 8, 8);
    peer_view(&b, 1, 8, 8);
    peer_call(&a, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    memcpy(seen, a.m.frame.data.data, 32);
    peer_call(&b, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    assert_memory_equal(seen, b.m.frame.data.data, 32);
    // An edit of one, sent without waiting, is in the scene although its session ends at once.
    peer_tell(&b, HGP_T_node_set, &(struct hgp_node_set){.node = b.first_id});
    peer_close(&b);
    uint64_t deadline_ns = hg_clock_now_ns() + 60000000000u;
    do {
        assert_true(hg_clock_now_ns() < deadline_ns);
        peer_call(&a, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1}, HGP_T_frame);
    } while (memcmp(seen, a.m.frame.data.data, 32) == 0);
    peer_call(&a, HGP_T_sessions_query, &(struct hgp_sessions_query){0}, HGP_T_json);
    assert_non_null(memmem(a.m.json.text.data, a.m.json.text.size, "\"name\":\"hall\"", 13));
    peer_close(&a);
    daemon_finish(&d);
}

// The worker holds frames of this view for a minute. One that is cancelled is answered at once and
// counts no more; sessions cancel their own only.
static void frames_are_cancelled(void **state)
{
    (void)state;
    struct daemon d;
    struct peer a, b;
    daemon_init(&d);
    daemon_option(&d, "max-frame-requests", "2");
    daemon_start(&d);
    peer_open_scene(&a, &d, "hall");
    peer_open_scene(&b, &d, "hall");
    const struct hgp_view_set slow = {.view = 3, .has_seed = true, .seed = 60000};
    const struct hgp_frame_request frame = {.view = 3};
    peer_call(&a, HGP_T_view_set, &slow, HGP_T_ok);
    peer_call(&b, HGP_T_view_set, &slow, HGP_T_ok);
    const uint32_t first = peer_send(&a, HGP_T_frame_request, &frame);
    const uint32_t second = peer_send(&a, HGP_T_frame_request, &frame);
    peer_refused(&a, HGP_T_frame_request, &frame, HG_E_BUSY);
    struct hgp_frame_cancel cancel = {.view = 3, .request = first};
    peer_call(&b, HGP_T_frame_cancel, &cancel, HGP_T_ok);
    peer_refused(&a, HGP_T_frame_request, &frame, HG_E_BUSY); // both are still under way
    for (int i = 0; i < 2; i++) { // the second time nothing is left to cancel
        peer_tell(&a, HGP_T_frame_cancel, &cancel);
        if (i == 0)
            peer_error(&a, first, HG_E_CANCELLED);
    }
    cancel.request = peer_send(&a, HGP_T_frame_request, &frame);
    peer_tell(&a, HGP_T_frame_cancel, &cancel);
    peer_error(&a, cancel.request, HG_E_CANCELLED);
    cancel.request = second;
    peer_tell(&a, HGP_T_frame_cancel, &cancel);
    peer_error(&a, second, HG_E_CANCELLED);
    cancel.view = 4;
    peer_refused(&a, HGP_T_frame_cancel, &cancel, HG_E_NOTFOUND);
    peer_close(&b);
    peer_close(&a);
    daemon_finish(&d);
}

// ---- quotas -------------------------------------------------------------------------------------

static void quotas_are_explained(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p, q, r;
    daemon_init(&d);
    daemon_option(&d, "max-views", "2");
    daemon_option(&d, "max-pixels", "10000");
    daemon_option(&d, "max-sessions", "2");
    daemon_option(&d, "max-connections", "3");
    daemon_option(&d, "max-upload", "1");
    daemon_option(&d, "max-frame-requests", "2");
    daemon_start(&d);
    peer_open_view(&p, &d, 50, 100);
    peer_refused(&p, HGP_T_view_set,
        &(struct hgp_view_set){
            .view = 2, .has_width = true, .width = 100, .has_height = true, .height = 51},
        HG_E_LIMIT);
    assert_non_null(memmem(p.m.error.reason.data, p.m.error.reason.size, "max-pixels", 10));
    peer_view(&p, 2, 100, 50);
    peer_refused(&p, HGP_T_view_set,
        &(struct hgp_view_set){
            .view = 3, .has_width = true, .width = 1, .has_height = true, .height = 1},
        HG_E_LIMIT);
    peer_call(&p, HGP_T_view_close, &(struct hgp_view_close){.view = 1}, HGP_T_ok);
    peer_view(&p, 3, 1, 1);
    // Uploads: 1 MiB in all.
    peer_refused(&p, HGP_T_upload, &(struct hgp_upload){.total = (1 << 20) + 1}, HG_E_LIMIT);
    assert_string_equal(p.limit, "max-upload");
    assert_int_equal(p.retry_after_ms, 0);
    // Frame requests under way.
    peer_call(&p, HGP_T_view_set, &(struct hgp_view_set){.view = 3, .has_seed = true, .seed = 3000},
        HGP_T_ok);
    uint32_t first = peer_send(&p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 3});
    uint32_t second = peer_send(&p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 3});
    peer_refused(&p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 3}, HG_E_BUSY);
    peer_answer(&p, first, HGP_T_frame);
    peer_answer(&p, second, HGP_T_frame);
    // Sessions and connections.
    peer_open(&q, &d);
    peer_connect(&r, &d, false);
    peer_raw(&r, HGP_PREFACE, HGP_PREFACE_BYTES);
    peer_tell(&r, HGP_T_hello, &(struct hgp_hello){.version_min = 1, .version_max = 1});
    assert_true(peer_next(&r));
    assert_int_equal(r.m.error.code, HG_E_LIMIT);
    peer_end(&r);
    peer_close(&r);
    peer_close(&q);
    peer_close(&p);
    daemon_finish(&d);
}

// Where the system allows few open files, clients are refused before there are none left.
static void open_files_limit_connections(void **state)
{
    (void)state;
    enum { FILES = 64, ROOM = FILES / 2 };
    struct daemon d;
    struct peer peers[ROOM], last;
    daemon_begin(&d);
    const struct rlimit few = {FILES, FILES};
    assert_int_equal(prlimit(d.pid, RLIMIT_NOFILE, &few, NULL), 0);
    daemon_signal(&d, SIGHUP);
    daemon_wait_log(&d, "has room for 32 connections");
    for (int i = 0; i < ROOM; i++)
        peer_open(&peers[i], &d);
    peer_connect(&last, &d, false);
    peer_raw(&last, HGP_PREFACE, HGP_PREFACE_BYTES);
    peer_tell(&last, HGP_T_hello, &(struct hgp_hello){.version_min = 1, .version_max = 1});
    assert_true(peer_next(&last));
    assert_int_equal(last.m.error.code, HG_E_LIMIT);
    assert_string_equal(last.limit, "max-connections");
    peer_close(&last);
    for (int i = 0; i < ROOM; i++)
        peer_close(&peers[i]);
    daemon_finish(&d);
}

// One part of a file of so many bytes to be verified.
static struct hgp_image_query part_of(uint64_t size, uint64_t offset, uint32_t bytes)
{
    static const uint8_t data[1 << 20];
    return (struct hgp_image_query){.data = {data, bytes},
        .has_offset = true,
        .offset = offset,
        .has_size = true,
        .size = size};
}

// What the worker has of a file counts as an upload, and all sessions' together as the store, until
// the worker has told of it.
static void verified_files_are_uploads(void **state)
{
    (void)state;
    enum { MIB = 1 << 20, MOST = 600000 };
    struct daemon d;
    struct peer p, q;
    const struct hgp_image_query first = part_of(MOST, 0, 1), last = part_of(MOST, 1, MOST - 1);
    const struct hgp_image_query whole = part_of(MIB, 0, MIB), above = part_of(MIB + 1, 0, 1);
    const struct hgp_upload upload = {.total = MOST};
    daemon_init(&d);
    daemon_option(&d, "max-upload", "1");
    daemon_option(&d, "upload-store", "1");
    daemon_start(&d);
    peer_open_scene(&p, &d, "");
    peer_open_scene(&q, &d, "");
    peer_refused(&p, HGP_T_image_query, &above, HG_E_LIMIT);
    assert_non_null(memmem(p.m.error.reason.data, p.m.error.reason.size, "max-upload", 10));
    peer_call(&p, HGP_T_image_query, &first, HGP_T_ok);
    peer_refused(&p, HGP_T_upload, &upload, HG_E_LIMIT);
    assert_string_equal(p.limit, "max-upload");
    assert_true(p.retry_after_ms > 0);
    peer_refused(&q, HGP_T_image_query, &first, HG_E_LIMIT);
    assert_string_equal(q.limit, "upload-store");
    assert_true(q.retry_after_ms > 0);
    assert_non_null(memmem(q.m.error.reason.data, q.m.error.reason.size, "upload-store", 12));
    peer_call(&p, HGP_T_image_query, &first, HGP_T_ok); // begun again: in place of the first
    peer_call(&p, HGP_T_image_query, &last, HGP_T_json);
    peer_call(&q, HGP_T_image_query, &first, HGP_T_ok);
    peer_refused(&p, HGP_T_image_query, &first, HG_E_LIMIT);
    peer_call(&q, HGP_T_scene_close, &(struct hgp_scene_close){0}, HGP_T_ok);
    for (int i = 0; i < 3; i++) // as often as one likes
        peer_call(&p, HGP_T_image_query, &whole, HGP_T_json);
    peer_close(&q);
    peer_close(&p);
    daemon_finish(&d);
}

static void part_refused(struct peer *p, const struct hgp_image_query *part, const char *reason)
{
    peer_refused(p, HGP_T_image_query, part, HG_E_INVAL);
    const struct hgp_str *why = &p->m.error.reason;
    assert_non_null(memmem(why->data, why->size, reason, strlen(reason)));
}

// What was counted at the first part is what the others may make of it.
static void verified_files_stay_as_large_as_they_began(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    const struct hgp_image_query first = part_of(2, 0, 1), last = part_of(2, 1, 1);
    const struct hgp_image_query grown = part_of(UINT64_C(5) << 30, 1, 1);
    const struct hgp_image_query beyond = part_of(2, 1, 2), more = part_of(1, 0, 2);
    daemon_init(&d);
    daemon_option(&d, "max-upload", "1");
    daemon_start(&d);
    peer_open_scene(&p, &d, "");
    part_refused(&p, &last, "is 2, and was 0 ");
    part_refused(&p, &more, "2 bytes at offset 0 exceed the file size of 1");
    peer_call(&p, HGP_T_image_query, &first, HGP_T_ok);
    part_refused(&p, &grown, "is 5368709120, and was 2 ");
    part_refused(&p, &beyond, "2 bytes at offset 1 exceed the file size of 2");
    peer_call(&p, HGP_T_image_query, &last, HGP_T_json);
    part_refused(&p, &last, "is 2, and was 0 ");
    peer_close(&p);
    daemon_finish(&d);
}

static void journals_are_limited(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    enum { SIZE = 600000 };
    uint8_t *points = calloc(SIZE, 1);
    struct hgp_mesh_part part = {.positions = {points, SIZE}};
    daemon_init(&d);
    daemon_option(&d, "journal-limit", "1");
    daemon_start(&d);
    peer_open_scene(&p, &d, "");
    struct hgp_mesh_set mesh = {.mesh = p.first_id, .parts = {&part, 1}};
    peer_call(&p, HGP_T_mesh_set, &mesh, HGP_T_ok);
    mesh.mesh++;
    peer_refused(&p, HGP_T_mesh_set, &mesh, HG_E_LIMIT);
    assert_non_null(memmem(p.m.error.reason.data, p.m.error.reason.size, "journal-limit", 13));
    // What was refused is not in the scene; removing makes room.
    peer_refused(&p, HGP_T_object_remove,
        &(struct hgp_object_remove){.kind = HGP_object_kind_MESH, .object = mesh.mesh},
        HG_E_NOTFOUND);
    peer_call(&p, HGP_T_object_remove,
        &(struct hgp_object_remove){.kind = HGP_object_kind_MESH, .object = p.first_id}, HGP_T_ok);
    peer_call(&p, HGP_T_mesh_set, &mesh, HGP_T_ok);
    free(points);
    peer_close(&p);
    daemon_finish(&d);
}

// ---- uploads ------------------------------------------------------------------------------------

static struct hgp_upload piece(const uint8_t *data, size_t total, size_t offset, size_t size)
{
    struct hgp_upload m = {
        .total = total, .offset = offset, .data = {data + offset, (uint32_t)size}};
    assert_int_equal(hg_sha256(data, total, m.hash), HG_OK);
    return m;
}

static void uploads_are_kept_once(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p, q;
    enum { SIZE = 300000, PIECE = 100000 };
    uint8_t *data = calloc(SIZE, 1);
    data[SIZE - 1] = 7;
    daemon_begin(&d);
    peer_open(&p, &d);
    struct hgp_upload m = piece(data, SIZE, 0, PIECE);
    assert_false(peer_has_upload(&p, m.hash));
    peer_tell(&p, HGP_T_upload, &m);
    m = piece(data, SIZE, PIECE, PIECE);
    peer_tell(&p, HGP_T_upload, &m);
    m = piece(data, SIZE, 2 * PIECE, PIECE);
    peer_call(&p, HGP_T_upload, &m, HGP_T_ok);
    peer_open(&q, &d);
    assert_true(peer_has_upload(&q, m.hash)); // for every session
    char hex[HG_SHA256_HEX], name[128];
    hg_sha256_hex(m.hash, hex);
    snprintf(name, sizeof name, "cache/uploads/%s", hex);
    assert_int_equal(daemon_file_size(&d, name), SIZE);
    // Sending it again is harmless.
    m = piece(data, SIZE, 0, SIZE);
    peer_call(&q, HGP_T_upload, &m, HGP_T_ok);
    // A load names it; an unknown one is refused by place.
    peer_scene(&q, "");
    struct hgp_asset_file file = {.uri = hgp_str_make("a.glb")};
    memcpy(file.hash, m.hash, 32);
    peer_call(&q, HGP_T_asset_load,
        &(struct hgp_asset_load){.asset = q.first_id, .files = {&file, 1}}, HGP_T_asset_loaded);
    file.hash[0] ^= 1;
    peer_refused(&q, HGP_T_asset_load,
        &(struct hgp_asset_load){.asset = q.first_id + 1, .files = {&file, 1}}, HG_E_NOTFOUND);
    // Wrong hash, wrong order: refused, and nothing is left behind.
    data[0] = 1;
    m = piece(data, SIZE, 0, SIZE);
    m.hash[5] ^= 1;
    peer_refused(&p, HGP_T_upload, &m, HG_E_HASH);
    assert_false(peer_has_upload(&p, m.hash));
    m = piece(data, SIZE, PIECE, PIECE);
    peer_refused(&p, HGP_T_upload, &m, HG_E_STATE);
    assert_false(peer_has_upload(&p, m.hash));
    assert_false(daemon_has_file(&d, "cache/uploads/.incoming.2"));
    // Nothing at all is a content, too.
    struct hgp_upload empty = {0};
    assert_int_equal(hg_sha256("", 0, empty.hash), HG_OK);
    peer_call(&p, HGP_T_upload, &empty, HGP_T_ok);
    assert_true(peer_has_upload(&p, empty.hash));
    free(data);
    peer_close(&p);
    peer_close(&q);
    daemon_finish(&d);
}

// ---- a full disk --------------------------------------------------------------------------------

static void full_disk_on_upload(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    enum { SIZE = 3 << 20, PIECE = 1 << 20 };
    struct rlimit old, small = {.rlim_cur = 2 << 20};
    uint8_t *data = calloc(SIZE, 1);
    daemon_init(&d);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &old), 0);
    small.rlim_max = old.rlim_max;
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0); // inherited by the daemon
    daemon_start(&d);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &old), 0);
    peer_open(&p, &d);
    for (int at = 0; at < 2; at++) {
        struct hgp_upload m = piece(data, SIZE, (size_t)at * PIECE, PIECE);
        peer_tell(&p, HGP_T_upload, &m);
    }
    struct hgp_upload m = piece(data, SIZE, 2 * PIECE, PIECE);
    peer_refused(&p, HGP_T_upload, &m, HG_E_NOSPACE);
    assert_false(peer_has_upload(&p, m.hash));
    assert_false(daemon_has_file(&d, "cache/uploads/.incoming.1")); // nothing is left behind
    // What fits is taken.
    m = piece(data, PIECE, 0, PIECE);
    peer_call(&p, HGP_T_upload, &m, HGP_T_ok);
    free(data);
    peer_close(&p);
    daemon_finish(&d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(opens_for_own_user),
        cmocka_unit_test(half_handshakes_end),
        cmocka_unit_test(wrong_preface_and_version),
        cmocka_unit_test(tokens_decide),
        cmocka_unit_test(unix_can_require_tokens),
        cmocka_unit_test(oversized_messages),
        cmocka_unit_test(unknown_and_broken_messages),
        cmocka_unit_test(relays_edits_and_frames),
        cmocka_unit_test(shares_scenes),
        cmocka_unit_test(frames_are_cancelled),
        cmocka_unit_test(quotas_are_explained),
        cmocka_unit_test(open_files_limit_connections),
        cmocka_unit_test(verified_files_are_uploads),
        cmocka_unit_test(verified_files_stay_as_large_as_they_began),
        cmocka_unit_test(journals_are_limited),
        cmocka_unit_test(uploads_are_kept_once),
        cmocka_unit_test(full_disk_on_upload),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
