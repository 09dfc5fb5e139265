// uploads.c - attacks on the store of uploads: announcements, many small files, uploads that stop.
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/sha256.h"
#include "tests/system/daemon.h"

static struct hgp_upload content_of(const void *data, uint32_t size)
{
    struct hgp_upload m = {.total = size, .data = {data, size}};
    assert_int_equal(hg_sha256(data, size, m.hash), HG_OK);
    return m;
}

static void announcements_evict_nothing(void **state)
{
    (void)state;
    struct daemon d;
    struct peer honest, hostile;
    struct hgp_upload mine = content_of("mine", 4);
    daemon_init_tokens(&d);
    daemon_option(&d, "upload-store", "16");
    daemon_start(&d);
    peer_enter(&honest, &d, "edit-token-1");
    peer_call(&honest, HGP_T_upload, &mine, HGP_T_ok);
    peer_enter(&hostile, &d, "admin-token-1");
    for (uint8_t i = 0; i < 16; i++) { // all of the store, sixteen times
        struct hgp_upload huge = {
            .total = 16 << 20, .hash = {i}, .data = {(const uint8_t *)"x", 1}};
        peer_tell(&hostile, HGP_T_upload, &huge);
    }
    peer_call(&hostile, HGP_T_ping, &(struct hgp_ping){.nonce = 1}, HGP_T_pong);
    assert_true(peer_has_upload(&honest, mine.hash));
    mine = content_of("more", 4); // and it is not full
    peer_call(&honest, HGP_T_upload, &mine, HGP_T_ok);
    peer_close(&hostile);
    peer_close(&honest);
    daemon_finish(&d);
}

enum { MIB = 1 << 20 };

// A content of a MiB, and of nothing else that this number names.
static struct hgp_upload mebibyte(int number)
{
    static int data[MIB / sizeof(int) - 1024]; // and its blocks
    data[0] = number;
    return content_of(data, sizeof data);
}

// Whoever fills the store loses what is its own, and not what others have of their part.
static void floods_evict_nothing_of_others(void **state)
{
    (void)state;
    struct daemon d;
    struct peer honest, hostile;
    struct hgp_upload mine[3];
    daemon_init_tokens(&d);
    daemon_option(&d, "upload-store", "16");
    daemon_start(&d);
    peer_enter(&honest, &d, "edit-token-1");
    for (int i = 0; i < 3; i++) {
        mine[i] = mebibyte(i);
        peer_call(&honest, HGP_T_upload, &mine[i], HGP_T_ok);
    }
    peer_enter(&hostile, &d, "admin-token-1");
    for (int i = 0; i < 24; i++) {
        struct hgp_upload more = mebibyte(100 + i);
        peer_call(&hostile, HGP_T_upload, &more, HGP_T_ok);
    }
    for (int i = 0; i < 3; i++)
        assert_true(peer_has_upload(&honest, mine[i].hash));
    peer_close(&hostile);
    peer_close(&honest);
    daemon_finish(&d);
}

static uint32_t send_load(struct peer *p, uint32_t number, const uint8_t hash[32])
{
    struct hgp_asset_file file = {.uri = hgp_str_make("a.glb")};
    memcpy(file.hash, hash, 32);
    return peer_send(p, HGP_T_asset_load,
        &(struct hgp_asset_load){.asset = p->first_id + number, .files = {&file, 1}});
}

// What scenes use cannot be evicted: a tenant has its share of that, also of loads under way.
static void uses_leave_room_for_others(void **state)
{
    (void)state;
    enum { LOADS = 14 };
    struct daemon d;
    struct peer honest, hostile;
    uint8_t hashes[LOADS][32];
    uint32_t loaded = 0, requests[LOADS];
    daemon_init_tokens(&d);
    daemon_option(&d, "upload-store", "16");
    daemon_start(&d);
    peer_enter(&hostile, &d, "admin-token-1");
    peer_scene(&hostile, "");
    for (int i = 0; i < LOADS; i++) {
        struct hgp_upload content = mebibyte(100 + i);
        memcpy(hashes[i], content.hash, 32);
        peer_call(&hostile, HGP_T_upload, &content, HGP_T_ok);
    }
    for (uint32_t i = 0; i < LOADS; i++)
        requests[i] = send_load(&hostile, i, hashes[i]);
    for (int i = 0; i < LOADS; i++) {
        do
            assert_true(peer_next(&hostile));
        while (hostile.header.request < requests[0]);
        if (hostile.header.type == HGP_T_asset_loaded)
            loaded++;
        else
            assert_true(peer_says(&hostile, "upload-store"));
    }
    assert_int_equal(loaded, 8); // half of it
    peer_enter(&honest, &d, "edit-token-1");
    peer_scene(&honest, "");
    for (int i = 0; i < 5; i++) { // a third
        struct hgp_upload content = mebibyte(i);
        peer_call(&honest, HGP_T_upload, &content, HGP_T_ok);
        peer_answer(&honest, send_load(&honest, (uint32_t)i, content.hash), HGP_T_asset_loaded);
    }
    peer_close(&hostile);
    peer_close(&honest);
    daemon_finish(&d);
}

static void quotas_survive_reconnecting(void **state)
{
    (void)state;
    struct daemon d;
    struct peer honest, hostile;
    struct hgp_upload mine = content_of("mine", 4), first = content_of("first", 5);
    daemon_init_tokens(&d);
    daemon_option(&d, "max-upload-files", "50");
    daemon_start(&d);
    peer_enter(&honest, &d, "edit-token-1");
    peer_call(&honest, HGP_T_upload, &mine, HGP_T_ok);
    for (int round = 0; round < 4; round++) {
        peer_enter(&hostile, &d, "admin-token-1");
        if (!round)
            peer_call(&hostile, HGP_T_upload, &first, HGP_T_ok);
        for (int i = 0; i < 20; i++) {
            int data = 1000 * round + i;
            struct hgp_upload small = content_of(&data, sizeof data);
            peer_call(&hostile, HGP_T_upload, &small, HGP_T_ok);
        }
        peer_close(&hostile);
    }
    assert_true(peer_has_upload(&honest, mine.hash));
    assert_false(peer_has_upload(&honest, first.hash)); // it went when its owner's quota was full
    peer_close(&honest);
    daemon_finish(&d);
}

static void uploads_that_stop_are_given_up(void **state)
{
    (void)state;
    struct daemon d;
    struct peer p;
    struct hgp_upload half = {.total = 2, .hash = {1}, .data = {(const uint8_t *)"x", 1}};
    daemon_init(&d);
    daemon_option(&d, "upload-timeout", "0.5");
    daemon_start(&d);
    peer_open(&p, &d);
    peer_tell(&p, HGP_T_upload, &half);
    assert_true(peer_next(&p));
    assert_int_equal(p.header.type, HGP_T_notice);
    assert_int_equal(p.m.notice.code, HG_E_TIMEOUT);
    while (daemon_has_file(&d, "cache/uploads/.incoming.1")) // the test's time limit ends this
        usleep(1000);
    half.offset = 1; // the rest learns why
    peer_refused(&p, HGP_T_upload, &half, HG_E_TIMEOUT);
    peer_close(&p);
    daemon_finish(&d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(announcements_evict_nothing),
        cmocka_unit_test(floods_evict_nothing_of_others),
        cmocka_unit_test(uses_leave_room_for_others),
        cmocka_unit_test(quotas_survive_reconnecting),
        cmocka_unit_test(uploads_that_stop_are_given_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
