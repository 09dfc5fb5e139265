// test_view_streams.c - the viewer's decoders of frames that depend on each other, on what the
// worker's encoders make: tiles and video. Colours, lost frames, damaged data, other sizes.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "client/view/decode.h"
#include "server/worker/encode/encode_av1.h"
#include "server/worker/encode/encode_openh264.h"
#include "server/worker/encode/encode_tiles.h"

enum { WIDTH = 193, HEIGHT = 131, BYTES = 4 * WIDTH * HEIGHT, PATCH = 32 };

static const struct codec {
    const char *name;
    enum hgp_encoding encoding;
    int off; // of 255: by how much colours of patches may be off
    enum hg_status (*open)(const struct encode_request *, void **, struct hg_error *);
    enum hg_status (*encode)(
        void *, const struct encode_request *, struct encode_output *, struct hg_error *);
    void (*close)(void *);
} codecs[] = {
    {"tiles", HGP_encoding_TILES, 0, hg_tiles_open, hg_tiles_encode, hg_tiles_close},
    {"tiles of JPEG", HGP_encoding_TILES_JPEG, 4, hg_tiles_open, hg_tiles_encode_jpeg,
        hg_tiles_close},
#ifdef HG_HAVE_OPENH264
    {"H.264", HGP_encoding_H264, 3, hg_openh264_open, hg_openh264_encode, hg_openh264_close},
#endif
#ifdef HG_HAVE_AOM
    {"AV1", HGP_encoding_AV1, 5, hg_av1_open, hg_av1_encode, hg_av1_close},
#endif
};

#define FOR_CODECS(it)                                                                             \
    for (const struct codec *it = codecs; it < codecs + sizeof codecs / sizeof *codecs; it++)

struct rig {
    const struct codec *codec;
    struct encode_request request;
    struct encode_output out;
    void *encoder;
    struct hg_view_decoder decoder;
    struct hg_view_pixels pixels;
    uint64_t number;
};

static void begin(struct rig *r, const struct codec *codec)
{
    struct hg_error err = {0};
    *r = (struct rig){.codec = codec};
    r->request.frame.width = WIDTH;
    r->request.frame.height = HEIGHT;
    r->request.frame.encoding = codec->encoding;
    r->request.quality = 95;
    r->request.pixels = hg_refbuf_create(BYTES);
    assert_int_equal(codec->open(&r->request, &r->encoder, &err), HG_OK);
}

static void end(struct rig *r)
{
    r->codec->close(r->encoder);
    hg_refbuf_unref(r->request.pixels);
    hg_writer_finish(&r->out.data);
    hg_view_decoder_finish(&r->decoder);
    hg_view_pixels_finish(&r->pixels);
}

// Patches of one colour; the one of the frame's number changes. Tiles keep the pixels of the frame
// before by reference, so each frame has its own.
static void draw(struct rig *r)
{
    hg_refbuf_unref(r->request.pixels);
    r->request.pixels = hg_refbuf_create(BYTES);
    uint8_t *p = r->request.pixels->data;
    for (uint32_t y = 0; y < HEIGHT; y++)
        for (uint32_t x = 0; x < WIDTH; x++, p += 4) {
            const uint32_t patch = y / PATCH * 7 + x / PATCH,
                           n = patch + (patch <= r->number ? 11 : 0);
            p[0] = (uint8_t)(n * 83 + 20);
            p[1] = (uint8_t)(n * 151 + 90);
            p[2] = (uint8_t)(n * 47 + 160);
            p[3] = 255;
        }
}

static struct hgp_frame encode(struct rig *r)
{
    struct hg_error err = {0};
    r->number++;
    draw(r);
    hg_writer_finish(&r->out.data);
    r->out = (struct encode_output){0};
    assert_int_equal(r->codec->encode(r->encoder, &r->request, &r->out, &err), HG_OK);
    return (struct hgp_frame){.view = 1,
        .number = r->number,
        .width = WIDTH,
        .height = HEIGHT,
        .encoding = r->codec->encoding,
        .has_depends = r->out.depends,
        .depends = 1,
        .data = {r->out.data.data, (uint32_t)r->out.data.size}};
}

static enum hg_status decode(struct rig *r, const struct hgp_frame *frame)
{
    struct hg_error err = {0};
    return hg_view_decode(&r->decoder, frame, &r->pixels, &err);
}

static void decode_whole(struct rig *r, const struct hgp_frame *frame)
{
    struct hg_error err = {0};
    if (hg_view_decode(&r->decoder, frame, &r->pixels, &err))
        fail_msg("%s, frame %u: %s", r->codec->name, (unsigned)r->number, err.reason);
}

// The middles of the patches.
static void check(const struct rig *r)
{
    assert_int_equal(r->pixels.width, WIDTH);
    assert_int_equal(r->pixels.height, HEIGHT);
    for (uint32_t y = PATCH / 2; y < HEIGHT; y += PATCH)
        for (uint32_t x = PATCH / 2; x < WIDTH; x += PATCH) {
            const size_t at = 4 * ((size_t)y * WIDTH + x);
            for (int i = 0; i < 4; i++)
                if (abs(r->pixels.data[at + i] - r->request.pixels->data[at + i]) > r->codec->off)
                    fail_msg("%s, frame %u, %u, %u: channel %d is %u instead of %u", r->codec->name,
                        (unsigned)r->number, x, y, i, r->pixels.data[at + i],
                        r->request.pixels->data[at + i]);
        }
    if (!r->codec->off)
        assert_memory_equal(r->pixels.data, r->request.pixels->data, BYTES);
}

static void test_pictures(void **state)
{
    (void)state;
    FOR_CODECS(codec)
    {
        struct rig r;
        begin(&r, codec);
        for (uint32_t n = 0; n < 8; n++) {
            const struct hgp_frame frame = encode(&r);
            assert_int_equal(frame.has_depends, n > 0);
            decode_whole(&r, &frame);
            check(&r);
        }
        end(&r);
    }
}

// After a frame that did not come nothing is shown before the next key frame.
static void test_lost_frames(void **state)
{
    (void)state;
    FOR_CODECS(codec)
    {
        struct rig r;
        begin(&r, codec);
        struct hgp_frame frame = encode(&r);
        decode_whole(&r, &frame);
        encode(&r); // lost
        for (int i = 0; i < 2; i++) {
            frame = encode(&r);
            assert_int_equal(decode(&r, &frame), HG_E_FORMAT);
            assert_int_equal(r.pixels.width, 0);
        }
        r.request.key_frame = true;
        frame = encode(&r);
        assert_false(frame.has_depends);
        decode_whole(&r, &frame);
        check(&r);
        r.request.key_frame = false;
        frame = encode(&r);
        decode_whole(&r, &frame);
        check(&r);
        end(&r);
    }
}

// Frames that say another size than their data has, and data that is cut or changed: refused or
// shown, and a key frame after them is whole again.
static void test_damaged_frames(void **state)
{
    (void)state;
    FOR_CODECS(codec)
    {
        struct rig r;
        begin(&r, codec);
        r.request.key_frame = true;
        struct hgp_frame frame = encode(&r);
        uint8_t *const copy = malloc(frame.data.size);
        assert_non_null(copy);
        frame.width *= 2;
        assert_true(decode(&r, &frame) != HG_OK || codec->encoding == HGP_encoding_TILES ||
                    codec->encoding == HGP_encoding_TILES_JPEG); // tiles lie in the left half
        frame.width = 16;
        assert_true(decode(&r, &frame) != HG_OK || codec->encoding == HGP_encoding_H264);
        frame.width = WIDTH;
        for (uint32_t i = 0; i < 300; i++) {
            struct hgp_frame bad = frame;
            memcpy(copy, frame.data.data, frame.data.size);
            bad.data.data = copy;
            if (i % 2)
                bad.data.size = (uint32_t)((uint64_t)frame.data.size * i / 300);
            else
                copy[(uint64_t)i * 7919 % frame.data.size] ^= (uint8_t)(1 + i % 255);
            if (decode(&r, &bad))
                assert_int_equal(r.pixels.width, 0);
        }
        decode_whole(&r, &frame);
        check(&r);
        free(copy);
        end(&r);
    }
}

// All the encodings that are offered to the server, the last one without any state.
static void test_offers(void **state)
{
    (void)state;
    uint8_t list[HG_VIEW_CODECS_MAX];
    const size_t count = hg_view_codecs(list);
    assert_in_range(count, 3, HG_VIEW_CODECS_MAX);
    assert_int_equal(list[count - 1], HGP_encoding_JPEG);
    FOR_CODECS(codec)
    assert_true(codec->encoding == HGP_encoding_TILES || memchr(list, codec->encoding, count));
    for (size_t i = 0; i < count; i++)
        assert_int_equal(hg_view_is_stream(list[i]),
            list[i] != HGP_encoding_JPEG && list[i] != HGP_encoding_JPEG_444);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_pictures),
        cmocka_unit_test(test_lost_frames), cmocka_unit_test(test_damaged_frames),
        cmocka_unit_test(test_offers)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
