// Tiles: whatever is edited, the picture that a client puts together is the renderer's.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "renderer/image/image.h"
#include "server/worker/encode_tiles.h"

// ---- a client -----------------------------------------------------------------------------------

static void undo_left(uint8_t *row, uint32_t width)
{
    for (size_t i = 4; i < 4 * (size_t)width; i++)
        row[i] = (uint8_t)(row[i] + row[i - 4]);
}

struct place {
    uint32_t x, y, width, height; // px
};

static void show_jpeg(
    const uint8_t *file, uint32_t size, struct place at, uint32_t stride_px, uint8_t *picture)
{
    struct hg_image image;
    struct hg_error err = {0};
    const struct hg_image_bytes bytes = {file, size, "tile.jpg"};
    assert_int_equal(hg_image_read_memory(&bytes, HG_PIXEL_RGBA8, NULL, &image, &err), HG_OK);
    assert_int_equal(image.width, at.width);
    assert_int_equal(image.height, at.height);
    for (uint32_t row = 0; row < at.height; row++)
        memcpy(picture + 4 * ((size_t)(at.y + row) * stride_px + at.x),
            (const uint8_t *)image.pixels + 4 * (size_t)row * at.width, 4 * (size_t)at.width);
    hg_image_finish(&image);
}

// Puts a frame's data into the picture; returns the pixels that it covers.
static uint64_t show(
    const struct hg_writer *data, uint32_t width, uint32_t height, uint8_t *picture)
{
    struct hg_reader heads = hg_reader_make(data->data, data->size);
    const uint32_t count = hg_read_u32(&heads);
    const uint8_t *content = data->data + 4 + 12 * (size_t)count, *end = data->data + data->size;
    uint64_t covered = 0;
    uLongf exact_bytes = 4 * (uLongf)width * height;
    uint8_t *exact = malloc(exact_bytes), *from = exact;
    const uint8_t *jpeg = content;
    for (uint32_t i = 0; i < count; i++) // JPEG files come first
        content += data->data[4 + 12 * i + 8] | data->data[4 + 12 * i + 9] << 8 |
                   data->data[4 + 12 * i + 10] << 16;
    if (content < end)
        assert_int_equal(uncompress(exact, &exact_bytes, content, (uLong)(end - content)), Z_OK);
    else
        exact_bytes = 0;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t x = hg_read_u16(&heads), y = hg_read_u16(&heads), w = hg_read_u16(&heads),
                       h = hg_read_u16(&heads), size = hg_read_u32(&heads);
        assert_true(w > 0 && h > 0 && x + w <= width && y + h <= height);
        covered += (uint64_t)w * h;
        if (size) {
            show_jpeg(jpeg, size, (struct place){x, y, w, h}, width, picture);
            jpeg += size;
            continue;
        }
        for (uint32_t row = 0; row < h; row++, from += 4 * (size_t)w) {
            undo_left(from, w);
            memcpy(picture + 4 * ((size_t)(y + row) * width + x), from, 4 * (size_t)w);
        }
    }
    assert_int_equal(from - exact, exact_bytes);
    free(exact);
    return covered;
}

// ---- pictures -----------------------------------------------------------------------------------

static uint32_t seed = 1;

static uint32_t random_u32(void)
{
    seed = seed * 1664525u + 1013904223u;
    return seed >> 8;
}

struct stage {
    struct encode_request request;
    struct encode_output out;
    void *state;
    uint8_t *picture; // the client's
    uint32_t width, height;
};

static void begin(struct stage *s, uint32_t width, uint32_t height)
{
    struct hg_error err = {0};
    *s = (struct stage){.width = width, .height = height};
    s->request.frame.width = width;
    s->request.frame.height = height;
    s->request.quality = 80;
    s->picture = calloc(4 * (size_t)width, height);
    s->request.pixels = hg_refbuf_create(4 * (size_t)width * height);
    for (size_t i = 0; i < s->request.pixels->size; i++)
        s->request.pixels->data[i] =
            (uint8_t)(i % 4 == 3 ? 255 : i / (4 * (size_t)width) + i + random_u32() % 4);
    assert_int_equal(hg_tiles_open(&s->request, &s->state, &err), HG_OK);
}

static void end(struct stage *s)
{
    hg_tiles_close(s->state);
    hg_refbuf_unref(s->request.pixels);
    hg_writer_finish(&s->out.data);
    free(s->picture);
}

static uint64_t send(struct stage *s, bool jpeg)
{
    struct hg_error err = {0};
    hg_writer_finish(&s->out.data);
    s->out = (struct encode_output){0};
    assert_int_equal(
        (jpeg ? hg_tiles_encode_jpeg : hg_tiles_encode)(s->state, &s->request, &s->out, &err),
        HG_OK);
    return show(&s->out.data, s->width, s->height, s->picture);
}

static bool is_exact(const struct stage *s)
{
    return memcmp(s->picture, s->request.pixels->data, s->request.pixels->size) == 0;
}

// Frames are immutable: an edit makes another one.
static void edit(struct stage *s)
{
    struct hg_refbuf *next = hg_refbuf_create(s->request.pixels->size);
    memcpy(next->data, s->request.pixels->data, next->size);
    const uint32_t x = random_u32() % s->width, y = random_u32() % s->height,
                   w = 1 + random_u32() % (s->width - x), h = 1 + random_u32() % (s->height - y);
    const bool flat = random_u32() % 2, clear = random_u32() % 4 == 0;
    for (uint32_t row = y; row < y + h; row++)
        for (uint32_t column = x; column < x + w; column++) {
            uint8_t *p = next->data + 4 * ((size_t)row * s->width + column);
            for (int i = 0; i < 3; i++)
                p[i] = flat ? (uint8_t)(50 * i) : (uint8_t)(p[i] + random_u32() % 9);
            p[3] = clear ? 128 : 255;
        }
    hg_refbuf_unref(s->request.pixels);
    s->request.pixels = next;
}

// ---- tests --------------------------------------------------------------------------------------

static void test_exact_after_any_edits(void **state)
{
    (void)state;
    static const uint32_t sizes[][2] = {{1, 1}, {64, 64}, {65, 1}, {200, 130}, {63, 257}};
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++) {
        struct stage s;
        begin(&s, sizes[k][0], sizes[k][1]);
        for (uint32_t n = 0; n < 40; n++) {
            s.request.key_frame = n % 17 == 5;
            const uint64_t covered = send(&s, false);
            assert_true(is_exact(&s));
            assert_false(s.out.lossy);
            assert_int_equal(s.out.depends, n > 0 && !s.request.key_frame);
            if (!s.out.depends)
                assert_int_equal(covered, (uint64_t)s.width * s.height);
            if (n % 3)
                edit(&s);
        }
        end(&s);
    }
}

// In motion with loss, then exact: only what was sent with loss is sent again.
static void test_exact_after_loss(void **state)
{
    (void)state;
    struct stage s;
    begin(&s, 300, 200);
    for (uint32_t n = 0; n < 30; n++) {
        send(&s, true);
        assert_int_equal(s.out.lossy, !is_exact(&s));
        if (n % 7 == 6) {
            send(&s, false);
            assert_true(is_exact(&s) && !s.out.lossy);
            assert_int_equal(send(&s, true), 0); // nothing has changed
        }
        edit(&s);
    }
    end(&s);
}

// Of alpha nothing is lost, as JPEG has none.
static void test_alpha_is_kept(void **state)
{
    (void)state;
    struct stage s;
    begin(&s, 128, 64);
    for (size_t i = 3; i < s.request.pixels->size; i += 4)
        s.request.pixels->data[i] = (uint8_t)(i / 4 % 128 < 64 ? 255 : i);
    send(&s, true);
    for (size_t i = 3; i < s.request.pixels->size; i += 4)
        assert_int_equal(s.picture[i], s.request.pixels->data[i]);
    end(&s);
}

// An edit of one object against full pictures.
static void test_an_edit_costs_a_tenth(void **state)
{
    (void)state;
    struct stage s;
    begin(&s, 1280, 720);
    send(&s, true);
    const size_t full = s.out.data.size;
    struct hg_refbuf *next = hg_refbuf_create(s.request.pixels->size);
    memcpy(next->data, s.request.pixels->data, next->size);
    for (uint32_t y = 300; y < 400; y++)
        for (uint32_t x = 600; x < 760; x++)
            next->data[4 * (y * 1280 + x)] ^= 64;
    hg_refbuf_unref(s.request.pixels);
    s.request.pixels = next;
    send(&s, true);
    print_message("full %zu bytes, edit of 160x100 px %zu bytes\n", full, s.out.data.size);
    assert_true(s.out.data.size * 10 < full);
    end(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_exact_after_any_edits),
        cmocka_unit_test(test_exact_after_loss),
        cmocka_unit_test(test_alpha_is_kept),
        cmocka_unit_test(test_an_edit_costs_a_tenth),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
