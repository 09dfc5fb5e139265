// test_view_decode.c - frames to pixels: each encoding, and data that is not what the frame says.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <turbojpeg.h>
#include <zstd.h>

#include "client/view/decode.h"
#include "client/view/session.h"

enum { WIDTH = 24, HEIGHT = 16, BYTES = WIDTH * HEIGHT * 4 };

static void paint(uint8_t pixels[BYTES])
{
    for (int i = 0; i < BYTES; i++)
        pixels[i] = (uint8_t)(i % 4 == 3 ? 255 : i / 4 % WIDTH * 8);
}

static struct hgp_frame frame_of(enum hgp_encoding encoding, const void *data, size_t size)
{
    return (struct hgp_frame){
        .width = WIDTH, .height = HEIGHT, .encoding = encoding, .data = {data, (uint32_t)size}};
}

static void test_raw(void **state)
{
    (void)state;
    uint8_t pixels[BYTES];
    struct hg_view_decoder d = {0};
    struct hg_view_pixels out = {0};
    struct hg_error err;
    paint(pixels);
    struct hgp_frame frame = frame_of(HGP_encoding_RAW_RGBA8, pixels, BYTES);
    assert_int_equal(hg_view_decode(&d, &frame, &out, &err), HG_OK);
    assert_int_equal(out.width, WIDTH);
    assert_memory_equal(out.data, pixels, BYTES);
    frame.data.size--;
    assert_int_equal(hg_view_decode(&d, &frame, &out, &err), HG_E_FORMAT);
    assert_int_equal(out.width, 0);
    hg_view_pixels_finish(&out);
    hg_view_decoder_finish(&d);
}

static void test_zstd(void **state)
{
    (void)state;
    uint8_t pixels[BYTES], packed[2 * BYTES];
    struct hg_view_decoder d = {0};
    struct hg_view_pixels out = {0};
    struct hg_error err;
    paint(pixels);
    const size_t size = ZSTD_compress(packed, sizeof packed, pixels, BYTES, 1);
    struct hgp_frame frame = frame_of(HGP_encoding_ZSTD_RGBA8, packed, size);
    assert_int_equal(hg_view_decode(&d, &frame, &out, &err), HG_OK);
    assert_memory_equal(out.data, pixels, BYTES);
    frame.width *= 2; // more pixels than there are
    assert_int_equal(hg_view_decode(&d, &frame, &out, &err), HG_E_FORMAT);
    frame.width /= 4; // fewer: what is too much is not written anywhere
    assert_int_equal(hg_view_decode(&d, &frame, &out, &err), HG_E_FORMAT);
    for (uint32_t cut = 0; cut < size; cut++) {
        frame = frame_of(HGP_encoding_ZSTD_RGBA8, packed, cut);
        assert_int_equal(hg_view_decode(&d, &frame, &out, &err), HG_E_FORMAT);
    }
    hg_view_pixels_finish(&out);
    hg_view_decoder_finish(&d);
}

static void test_jpeg(void **state)
{
    (void)state;
    uint8_t pixels[BYTES];
    unsigned char *file = NULL;
    unsigned long size = 0;
    struct hg_view_decoder d = {0};
    struct hg_view_pixels out = {0};
    struct hg_error err;
    paint(pixels);
    tjhandle jpeg = tjInitCompress();
    assert_int_equal(
        tjCompress2(jpeg, pixels, WIDTH, 0, HEIGHT, TJPF_RGBA, &file, &size, TJSAMP_444, 95, 0), 0);
    struct hgp_frame frame = frame_of(HGP_encoding_JPEG, file, size);
    assert_int_equal(hg_view_decode(&d, &frame, &out, &err), HG_OK);
    for (int i = 0; i < BYTES; i++)
        assert_true(abs(out.data[i] - pixels[i]) <= 6);
    frame.height--; // the file is larger than the frame says: no room is written past
    assert_int_equal(hg_view_decode(&d, &frame, &out, &err), HG_E_FORMAT);
    frame = frame_of(HGP_encoding_JPEG, "no JPEG", 7);
    assert_int_equal(hg_view_decode(&d, &frame, &out, &err), HG_E_FORMAT);
    tjFree(file);
    tjDestroy(jpeg);
    hg_view_pixels_finish(&out);
    hg_view_decoder_finish(&d);
}

static void test_others(void **state)
{
    (void)state;
    struct hg_view_decoder d = {0};
    struct hg_view_pixels out = {0};
    struct hg_error err;
    const struct hgp_frame frame = frame_of(HGP_encoding_EXR_HALF, "", 0);
    assert_int_equal(hg_view_decode(&d, &frame, &out, &err), HG_E_UNSUPPORTED);
    hg_view_pixels_finish(&out);
    hg_view_decoder_finish(&d);
}

// What statistics say of the server's controller.
static void test_flow_is_read(void **state)
{
    (void)state;
    static const char text[] =
        "{\"frame\":{},\"flow\":{\"target_fps\":30.0,\"target_ms\":28.5,\"rate_mbit_s\":4.5,"
        "\"rtt_ms\":20.25,\"delay_ms\":61.0,\"quality\":71,\"bitrate\":4200000,\"under_way\":2,"
        "\"bytes_under_way\":5000000000,\"held\":7}} behind";
    struct hg_view_flow flow;
    assert_true(hg_view_read_flow(text, sizeof text - 1 - strlen(" behind"), &flow));
    assert_true(flow.is_known && flow.target_fps == 30 && flow.target_ms == 28.5);
    assert_true(flow.rate_mbit_s == 4.5 && flow.rtt_ms == 20.25 && flow.delay_ms == 61);
    assert_int_equal(flow.quality, 71);
    assert_int_equal(flow.bitrate, 4200000);
    assert_int_equal(flow.under_way, 2);
    assert_true(flow.bytes_under_way == UINT64_C(5000000000));
    assert_int_equal(flow.held, 7);
    static const char *const others[] = {"{}", "{\"flow\":3}", "[", ""};
    for (size_t i = 0; i < sizeof others / sizeof *others; i++) {
        assert_false(hg_view_read_flow(others[i], strlen(others[i]), &flow));
        assert_false(flow.is_known);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_flow_is_read),
        cmocka_unit_test(test_raw), cmocka_unit_test(test_zstd), cmocka_unit_test(test_jpeg),
        cmocka_unit_test(test_others)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
