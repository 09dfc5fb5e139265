// Video encoders, seen by an independent decoder (libavcodec): every frame comes out at once, looks
// as it should, and has the colours that the stream's own description gives it.
#include <malloc.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <libavcodec/avcodec.h>

#include "base/alloc.h"
#include "server/worker/encode/encode_av1.h"
#include "server/worker/encode/encode_openh264.h"
#include "server/worker/encode/encode_x264.h"
#include "server/worker/encode/encoder.h"
#include "server/worker/encode/h264.h"
#include "server/worker/encode/yuv.h"

static const struct codec {
    const char *name;
    enum hgp_encoding encoding;
    enum AVCodecID decoder;
    const char *string; // how `codec` of key frames begins
    enum hg_status (*open)(const struct encode_request *, void **, struct hg_error *);
    enum hg_status (*encode)(
        void *, const struct encode_request *, struct encode_output *, struct hg_error *);
    void (*close)(void *);
} codecs[] = {
#ifdef HG_HAVE_OPENH264
    {"openh264", HGP_encoding_H264, AV_CODEC_ID_H264, "avc1.64", hg_openh264_open,
        hg_openh264_encode, hg_openh264_close},
#endif
#ifdef HG_HAVE_X264
    {"x264", HGP_encoding_H264, AV_CODEC_ID_H264, "avc1.64", hg_x264_open, hg_x264_encode,
        hg_x264_close},
    {"x264 4:4:4", HGP_encoding_H264_444, AV_CODEC_ID_H264, "avc1.f4", hg_x264_open, hg_x264_encode,
        hg_x264_close},
#endif
#ifdef HG_HAVE_AOM
    {"av1", HGP_encoding_AV1, AV_CODEC_ID_AV1, "av01.0.", hg_av1_open, hg_av1_encode, hg_av1_close},
#endif
    {0},
};

// ---- rig ----------------------------------------------------------------------------------------

struct rig {
    const struct codec *codec;
    struct encode_request request;
    struct encode_output out;
    void *state;
    AVCodecContext *decoder;
    AVFrame *frame;
};

static void open_decoder(struct rig *r)
{
    const AVCodec *decoder = r->codec->decoder == AV_CODEC_ID_AV1
                                 ? avcodec_find_decoder_by_name("libdav1d")
                                 : avcodec_find_decoder(r->codec->decoder);
    assert_non_null(decoder);
    avcodec_free_context(&r->decoder);
    r->decoder = avcodec_alloc_context3(decoder);
    r->decoder->thread_count = 1;
    r->decoder->flags |= AV_CODEC_FLAG_LOW_DELAY;
    assert_int_equal(avcodec_open2(r->decoder, decoder, NULL), 0);
}

static void begin(struct rig *r, const struct codec *codec, uint32_t width, uint32_t height)
{
    struct hg_error err = {0};
    av_log_set_level(AV_LOG_ERROR);
    *r = (struct rig){.codec = codec};
    r->request.frame.width = width;
    r->request.frame.height = height;
    r->request.frame.encoding = codec->encoding;
    r->request.quality = 90;
    r->request.pixels = hg_refbuf_create(4 * (size_t)width * height);
    r->frame = av_frame_alloc();
    open_decoder(r);
    if (codec->open(&r->request, &r->state, &err))
        fail_msg("%s: %s", codec->name, err.reason);
}

static void end(struct rig *r)
{
    r->codec->close(r->state);
    hg_refbuf_unref(r->request.pixels);
    hg_writer_finish(&r->out.data);
    avcodec_free_context(&r->decoder);
    av_frame_free(&r->frame);
}

static void encode(struct rig *r)
{
    struct hg_error err = {0};
    hg_writer_finish(&r->out.data);
    r->out = (struct encode_output){0};
    if (r->codec->encode(r->state, &r->request, &r->out, &err))
        fail_msg("%s: %s", r->codec->name, err.reason);
    assert_false(r->out.data.failed);
    assert_true(r->out.data.size > 0);
    assert_int_equal(r->out.depends, r->out.codec[0] == 0);
}

// One access unit in, one picture out.
static void decode(struct rig *r)
{
    AVPacket *packet = av_packet_alloc();
    assert_int_equal(av_new_packet(packet, (int)r->out.data.size), 0);
    memcpy(packet->data, r->out.data.data, r->out.data.size);
    assert_int_equal(avcodec_send_packet(r->decoder, packet), 0);
    assert_int_equal(avcodec_receive_frame(r->decoder, r->frame), 0);
    av_packet_free(&packet);
}

// A gradient that moves, and patches of one colour below it.
static void draw(struct rig *r, uint32_t n)
{
    const uint32_t width = r->request.frame.width, height = r->request.frame.height;
    uint8_t *p = r->request.pixels->data;
    for (uint32_t y = 0; y < height; y++)
        for (uint32_t x = 0; x < width; x++, p += 4) {
            const uint32_t patch = x / 32;
            const bool flat = y >= 32;
            p[0] = (uint8_t)(flat ? patch * 83 + 20 : 128 + 100 * sin((x + 2.0 * n) * 0.07));
            p[1] = (uint8_t)(flat ? patch * 151 + 90 : 128 + 100 * cos((y + 1.0 * n) * 0.09));
            p[2] = (uint8_t)(flat ? patch * 47 + 160 : (x + y + n) & 127);
            p[3] = 255;
        }
}

// Display values of a decoded pixel, by the matrix and range that the stream states.
static void rgb_at(const AVFrame *f, uint32_t x, uint32_t y, double rgb[3])
{
    const bool half = f->format == AV_PIX_FMT_YUV420P;
    const size_t cx = half ? x / 2 : x, cy = half ? y / 2 : y;
    const double luma = (f->data[0][y * (size_t)f->linesize[0] + x] - 16) / 219.0,
                 cb = (f->data[1][cy * (size_t)f->linesize[1] + cx] - 128) / 224.0,
                 cr = (f->data[2][cy * (size_t)f->linesize[2] + cx] - 128) / 224.0;
    rgb[0] = 255 * (luma + 1.5748 * cr);
    rgb[1] = 255 * (luma - 0.2126 * 1.5748 / 0.7152 * cr - 0.0722 * 1.8556 / 0.7152 * cb);
    rgb[2] = 255 * (luma + 1.8556 * cb);
}

static double psnr_of_luma(const struct rig *r)
{
    const uint32_t width = r->request.frame.width, height = r->request.frame.height;
    double sum = 0;
    for (uint32_t y = 0; y < height; y++)
        for (uint32_t x = 0; x < width; x++) {
            const uint8_t *p = r->request.pixels->data + 4 * ((size_t)y * width + x);
            const double luma = 16 + 219.0 / 255 * (0.2126 * p[0] + 0.7152 * p[1] + 0.0722 * p[2]);
            const double d = r->frame->data[0][y * (size_t)r->frame->linesize[0] + x] - luma;
            sum += d * d;
        }
    return 10 * log10(255.0 * 255.0 / (sum / ((double)width * height) + 1e-9));
}

// ---- tests --------------------------------------------------------------------------------------

static void check_description(const struct rig *r)
{
    const AVFrame *f = r->frame;
    assert_int_equal(f->colorspace, AVCOL_SPC_BT709);
    assert_int_equal(f->color_primaries, AVCOL_PRI_BT709);
    assert_int_equal(f->color_trc, AVCOL_TRC_IEC61966_2_1);
    assert_int_equal(f->color_range, AVCOL_RANGE_MPEG);
    assert_int_equal(f->format,
        r->codec->encoding == HGP_encoding_H264_444 ? AV_PIX_FMT_YUV444P : AV_PIX_FMT_YUV420P);
    assert_true((uint32_t)f->width >= r->request.frame.width);
    assert_true((uint32_t)f->height >= r->request.frame.height);
}

// The middles of the patches, within 2 of 255.
static void check_patches(const struct rig *r)
{
    const uint32_t width = r->request.frame.width;
    for (uint32_t x = 16; x < width; x += 32) {
        const uint8_t *p = r->request.pixels->data + 4 * ((size_t)48 * width + x);
        double rgb[3];
        rgb_at(r->frame, x, 48, rgb);
        for (int i = 0; i < 3; i++)
            if (fabs(fmin(fmax(rgb[i], 0), 255) - p[i]) > 2)
                fail_msg("%s: patch at %u: channel %d is %.1f instead of %u", r->codec->name, x, i,
                    rgb[i], p[i]);
    }
}

static void test_pictures(void **state)
{
    (void)state;
    for (const struct codec *codec = codecs; codec->name; codec++) {
        struct rig r;
        begin(&r, codec, 257, 65); // an odd size
        for (uint32_t n = 0; n < 12; n++) {
            draw(&r, n);
            encode(&r);
            decode(&r);
            assert_int_equal(r.out.depends, n > 0);
            if (n == 0)
                assert_memory_equal(r.out.codec, codec->string, strlen(codec->string));
            check_description(&r);
            check_patches(&r);
            const double psnr = psnr_of_luma(&r);
            if (psnr < 36)
                fail_msg("%s: frame %u has %.1f dB", codec->name, n, psnr);
        }
        end(&r);
    }
}

// Columns of one pixel in colours of the same luma keep them, where chroma is not subsampled.
static void test_full_chroma(void **state)
{
    (void)state;
    static const uint8_t colours[2][4] = {{220, 90, 90, 255}, {40, 143, 143, 255}};
    for (const struct codec *codec = codecs; codec->name; codec++) {
        struct rig r;
        double worst = 0;
        begin(&r, codec, 64, 64);
        r.request.quality = 100;
        for (uint32_t i = 0; i < 64 * 64; i++)
            memcpy(r.request.pixels->data + 4 * (size_t)i, colours[i & 1], 4);
        encode(&r);
        decode(&r);
        for (uint32_t i = 0; i < 64 * 64; i++) {
            double rgb[3];
            rgb_at(r.frame, i % 64, i / 64, rgb);
            for (int c = 0; c < 3; c++)
                worst = fmax(worst, fabs(rgb[c] - colours[i & 1][c]));
        }
        if (codec->encoding == HGP_encoding_H264_444 ? worst > 12 : worst < 60)
            fail_msg("%s: columns are off by up to %.1f", codec->name, worst);
        end(&r);
    }
}

// A decoder that begins with a key frame needs none before it.
static void test_key_frames_on_request(void **state)
{
    (void)state;
    for (const struct codec *codec = codecs; codec->name; codec++) {
        struct rig r;
        begin(&r, codec, 128, 64);
        for (uint32_t n = 0; n < 10; n++) {
            draw(&r, n);
            r.request.key_frame = n == 6;
            encode(&r);
            assert_int_equal(r.out.depends, n != 0 && n != 6);
            if (n == 6)
                open_decoder(&r);
            if (n >= 6)
                decode(&r);
        }
        assert_true(psnr_of_luma(&r) > 36);
        end(&r);
    }
}

// Quality changes from frame to frame without a key frame, and bytes follow it.
static void test_quality(void **state)
{
    (void)state;
    for (const struct codec *codec = codecs; codec->name; codec++) {
        struct rig r;
        size_t bytes[3] = {0};
        begin(&r, codec, 256, 128);
        for (uint32_t n = 0; n < 24; n++) {
            draw(&r, 3 * n);
            r.request.quality = n / 8 == 1 ? 15 : 90;
            encode(&r);
            decode(&r);
            assert_int_equal(r.out.depends, n > 0);
            bytes[n / 8] += n % 8 >= 3 ? r.out.data.size : 0;
        }
        if (bytes[1] * 2 > bytes[0] || bytes[1] * 2 > bytes[2])
            fail_msg("%s: %zu, %zu, %zu bytes", codec->name, bytes[0], bytes[1], bytes[2]);
        end(&r);
    }
}

static void test_sizes(void **state)
{
    (void)state;
    static const uint32_t sizes[][2] = {{1, 1}, {2, 3}, {17, 33}, {15, 200}, {64, 64}, {641, 3}};
    for (const struct codec *codec = codecs; codec->name; codec++)
        for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
            struct rig r;
            begin(&r, codec, sizes[i][0], sizes[i][1]);
            for (uint32_t n = 0; n < 3; n++) {
                draw(&r, n);
                encode(&r);
                decode(&r);
                check_description(&r);
            }
            end(&r);
        }
}

static void test_allocations_that_fail(void **state)
{
    (void)state;
    for (const struct codec *codec = codecs; codec->name; codec++) {
        struct encode_request request = {
            .quality = 80, .frame = {.width = 64, .height = 64, .encoding = codec->encoding}};
        enum hg_status status = HG_E_NOMEM;
        for (uint64_t n = 1; status; n++) {
            struct hg_error err = {0};
            void *encoder = NULL;
            hg_alloc_fail_at(n);
            status = codec->open(&request, &encoder, &err);
            hg_alloc_fail_at(0);
            assert_int_equal(encoder != NULL, status == HG_OK);
            assert_true(n < 10);
            if (status == HG_OK)
                codec->close(encoder);
            else
                assert_int_equal(status, HG_E_NOMEM);
        }
    }
}

// A thousand frames take as much memory as a hundred.
static void test_memory_does_not_grow(void **state)
{
    (void)state;
    for (const struct codec *codec = codecs; codec->name; codec++) {
        struct rig r;
        size_t early = 0;
        begin(&r, codec, 64, 64);
        for (uint32_t n = 0; n < 1000; n++) {
            draw(&r, n);
            r.request.quality = (uint8_t)(20 + n % 70);
            r.request.key_frame = n % 50 == 49;
            encode(&r);
            if (n == 200)
                early = mallinfo2().uordblks;
        }
        const size_t late = mallinfo2().uordblks;
        if (late > early + (256 << 10))
            fail_msg("%s: %zu bytes after 200 frames, %zu after 1000", codec->name, early, late);
        end(&r);
    }
}

// Every colour of a coarse cube, in both samplings, against the formula.
static void test_matrix(void **state)
{
    (void)state;
    for (int full = 0; full < 2; full++) {
        struct hg_yuv yuv;
        assert_int_equal(hg_yuv_create(3, 3, 2, full, &yuv), HG_OK);
        for (uint32_t c = 0; c < 16 * 16 * 16; c++) {
            const double r = 17 * (c & 15), g = 17 * (c >> 4 & 15), b = 17 * (c >> 8);
            uint8_t rgba[36];
            for (int i = 0; i < 9; i++) {
                rgba[4 * i] = (uint8_t)r;
                rgba[4 * i + 1] = (uint8_t)g;
                rgba[4 * i + 2] = (uint8_t)b;
                rgba[4 * i + 3] = (uint8_t)(28 * i);
            }
            hg_yuv_convert(&yuv, rgba, 3, 3);
            const double y = (0.2126 * r + 0.7152 * g + 0.0722 * b) / 255;
            const double expected[3] = {16 + 219 * y, 128 + 224 * (b / 255 - y) / 1.8556,
                128 + 224 * (r / 255 - y) / 1.5748};
            for (int plane = 0; plane < 3; plane++) {
                const uint32_t rows = plane && !full ? yuv.height / 2 : yuv.height;
                for (uint32_t i = 0; i < rows * yuv.strides[plane]; i++)
                    assert_true(fabs(yuv.planes[plane][i] - expected[plane]) <= 0.55);
            }
        }
        hg_yuv_finish(&yuv);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_matrix),
        cmocka_unit_test(test_pictures),
        cmocka_unit_test(test_full_chroma),
        cmocka_unit_test(test_key_frames_on_request),
        cmocka_unit_test(test_quality),
        cmocka_unit_test(test_sizes),
        cmocka_unit_test(test_allocations_that_fail),
        cmocka_unit_test(test_memory_does_not_grow),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
