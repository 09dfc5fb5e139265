// test_recording.c - files of recordings: what is read is what was written, every cut is refused.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/bytes.h"
#include "base/file.h"
#include "client/cli/run/recording.h"

static char path[64];

static int make_path(void **state)
{
    (void)state;
    snprintf(path, sizeof path, "/tmp/hg_recording_XXXXXX");
    const int fd = mkstemp(path);
    return fd < 0 ? -1 : close(fd);
}

static int remove_path(void **state)
{
    (void)state;
    return unlink(path);
}

static void put_record(
    struct hg_writer *w, enum hg_record_kind kind, uint64_t time_ns, const struct hg_writer *body)
{
    hg_write_u8(w, (uint8_t)kind);
    hg_write_u64(w, time_ns);
    hg_write_u32(w, (uint32_t)body->size);
    hg_write_bytes(w, body->data, body->size);
}

// A scene, a camera and a settled frame.
static void make(struct hg_writer *w)
{
    struct hg_writer body = {0};
    const uint8_t hash[32] = {1, 2, 3};
    const struct hgp_view_camera camera = {.view = 3, .input_seq = 9, .has_eye = true, .eye[1] = 5};
    hg_write_bytes(w, "HGPREC\x1a\x01", 8);
    hg_write_u32(&body, 7);
    hg_write_u32(&body, 100);
    hg_write_bytes(&body, "hall", 4);
    put_record(w, HG_RECORD_SCENE, 0, &body);
    body.size = 0;
    assert_int_equal(
        hgp_encode(&body, 1, (struct hgp_envelope){HGP_T_view_camera, 4, 0}, &camera, NULL), HG_OK);
    put_record(w, HG_RECORD_SENT, 1000, &body);
    body.size = 0;
    hg_write_u32(&body, 3);
    hg_write_u64(&body, 9);
    hg_write_u64(&body, 2);
    hg_write_bytes(&body, hash, sizeof hash);
    put_record(w, HG_RECORD_SETTLED, 2000, &body);
    hg_writer_finish(&body);
}

static void save(const void *data, size_t size)
{
    assert_int_equal(hg_file_write_atomic(path, data, size, NULL), HG_OK);
}

static void test_read(void **state)
{
    (void)state;
    struct hg_writer w = {0};
    struct hg_recording r;
    struct hg_record record;
    struct hg_error err = {0};
    union hgp_any message = {0};
    make(&w);
    save(w.data, w.size);
    assert_int_equal(hg_recording_open(path, &r, &err), HG_OK);
    for (int round = 0; round < 2; round++) {
        assert_int_equal(hg_recording_next(&r, &record, &err), HG_OK);
        assert_int_equal(record.kind, HG_RECORD_SCENE);
        assert_int_equal(record.scene.first_id, 7);
        assert_memory_equal(record.scene.name.data, "hall", 4);
        assert_int_equal(hg_recording_next(&r, &record, &err), HG_OK);
        assert_int_equal(record.kind, HG_RECORD_SENT);
        assert_int_equal(record.time_ns, 1000);
        assert_int_equal(record.sent.header.type, HGP_T_view_camera);
        assert_int_equal(hgp_decode(1, record.sent.header.type,
                             hg_reader_make(record.sent.payload, record.sent.header.length), NULL,
                             &message, NULL),
            HG_OK);
        assert_int_equal(message.view_camera.input_seq, 9);
        assert_int_equal(hg_recording_next(&r, &record, &err), HG_OK);
        assert_int_equal(record.settled.view, 3);
        assert_int_equal(record.settled.hash[2], 3);
        assert_int_equal(hg_recording_next(&r, &record, &err), HG_E_CLOSED);
        hg_recording_rewind(&r);
    }
    hg_recording_close(&r);
    hg_writer_finish(&w);
}

// Reads to the end or to the first record that is refused.
static enum hg_status read_all(struct hg_error *err)
{
    struct hg_recording r;
    struct hg_record record;
    enum hg_status status = hg_recording_open(path, &r, err);
    while (!status)
        status = hg_recording_next(&r, &record, err);
    hg_recording_close(&r);
    return status;
}

static void test_every_cut_is_refused(void **state)
{
    (void)state;
    struct hg_writer w = {0};
    make(&w);
    const size_t scene_end = 8 + 13 + 12, sent_end = w.size - 13 - 52;
    for (size_t size = 0; size < w.size; size++) {
        struct hg_error err = {0};
        const bool whole = size == 8 || size == scene_end || size == sent_end;
        save(w.data, size);
        assert_int_equal(read_all(&err), whole ? HG_E_CLOSED : HG_E_FORMAT);
        if (!whole && size > 8)
            assert_non_null(strstr(err.where, "byte "));
    }
    hg_writer_finish(&w);
}

static void test_bent_bytes_do_no_harm(void **state)
{
    (void)state;
    struct hg_writer w = {0};
    make(&w);
    for (size_t i = 0; i < w.size; i++)
        for (int bit = 0; bit < 8; bit += 3) {
            w.data[i] ^= (uint8_t)(1 << bit);
            save(w.data, w.size);
            const enum hg_status status = read_all(NULL);
            assert_true(status == HG_E_CLOSED || status == HG_E_FORMAT);
            assert_true(i >= 8 || status == HG_E_FORMAT);
            w.data[i] ^= (uint8_t)(1 << bit);
        }
    hg_writer_finish(&w);
}

static void test_missing(void **state)
{
    (void)state;
    struct hg_recording r;
    struct hg_cli_recorder *recorder;
    struct hg_error err = {0};
    assert_int_equal(hg_recording_open("/nonexistent/a.rec", &r, &err), HG_E_NOTFOUND);
    assert_int_equal(hg_cli_recorder_create("/nonexistent/a.rec", &recorder, &err), HG_E_NOTFOUND);
    assert_null(recorder);
    assert_int_equal(hg_cli_recorder_finish(NULL, &err), HG_OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_read, make_path, remove_path),
        cmocka_unit_test_setup_teardown(test_every_cut_is_refused, make_path, remove_path),
        cmocka_unit_test_setup_teardown(test_bent_bytes_do_no_harm, make_path, remove_path),
        cmocka_unit_test(test_missing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
