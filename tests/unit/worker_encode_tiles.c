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
#include "server/worker/encode/encode_tiles.h"

// ---- a client -----------------------------------------------------------------------------------

struct place {
    uint32_t x, y, width, height; // px
};

// The parts of a frame's data.
struct parts {
    uint32_t atlas_width, atlas_height, jpeg_bytes, jpeg_count, exact_count, unpacked_bytes;
    const uint8_t *jpeg;
    uint8_t *unpacked;
};

static struct parts take_apart(const struct hg_writer *data)
{
    struct hg_reader r = hg_reader_make(data->data, data->size);
    struct parts p = {.atlas_width = hg_read_u16(&r), .atlas_height = hg_read_u16(&r)};
    p.jpeg_bytes = hg_read_u32(&r);
    p.jpeg_count = hg_read_u32(&r);
    p.exact_count = hg_read_u32(&r);
    p.unpacked_bytes = hg_read_u32(&r);
    p.jpeg = hg_read_bytes(&r, p.jpeg_bytes);
    assert_non_null(p.jpeg);
    p.unpacked = malloc(p.unpacked_bytes + 1);
    uLongf got = p.unpacked_bytes;
    if (p.unpacked_bytes)
        assert_int_equal(
            uncompress(p.unpacked, &got, r.data + r.pos, (uLong)(r.size - r.pos)), Z_OK);
    else
        assert_int_equal(r.pos, r.size);
    assert_int_equal(got, p.unpacked_bytes);
    return p;
}

static struct place read_place(struct hg_reader *table, uint32_t width, uint32_t height)
{
    const struct place p = {
        hg_read_u16(table), hg_read_u16(table), hg_read_u16(table), hg_read_u16(table)};
    assert_true(p.width > 0 && p.height > 0 && p.x + p.width <= width && p.y + p.height <= height);
    return p;
}

static void show_jpeg(
    const struct parts *p, struct hg_reader *table, struct place picture_at, uint8_t *picture)
{
    const uint32_t stride_px = picture_at.width;
    const struct place at = read_place(table, picture_at.width, picture_at.height);
    const uint32_t from_x = hg_read_u16(table), from_y = hg_read_u16(table);
    struct hg_image image;
    struct hg_error err = {0};
    const struct hg_image_bytes bytes = {p->jpeg, p->jpeg_bytes, "tiles.jpg"};
    assert_int_equal(hg_image_read_memory(&bytes, HG_PIXEL_RGBA8, NULL, &image, &err), HG_OK);
    assert_int_equal(image.width, p->atlas_width);
    assert_int_equal(image.height, p->atlas_height);
    assert_true(from_x + at.width <= image.width && from_y + at.height <= image.height);
    for (uint32_t row = 0; row < at.height; row++)
        memcpy(picture + 4 * ((size_t)(at.y + row) * stride_px + at.x),
            (const uint8_t *)image.pixels + 4 * ((size_t)(from_y + row) * image.width + from_x),
            4 * (size_t)at.width);
    hg_image_finish(&image);
}

static void show_exact(struct place at, const uint8_t *from, uint32_t stride_px, uint8_t *picture)
{
    for (uint32_t y = 0; y < at.height; y++)
        for (size_t i = 0; i < 4 * (size_t)at.width; i++) {
            uint8_t *to = picture + 4 * ((size_t)(at.y + y) * stride_px + at.x) + i;
            const uint8_t predicted = i >= 4 ? to[-4] : y ? *(to - 4 * (size_t)stride_px) : 0;
            *to = (uint8_t)(predicted + *from++);
        }
}

// Puts a frame's data into the picture; returns the pixels that it covers.
static uint64_t show(
    const struct hg_writer *data, uint32_t width, uint32_t height, uint8_t *picture)
{
    struct parts p = take_apart(data);
    struct hg_reader table = hg_reader_make(p.unpacked, p.unpacked_bytes);
    uint64_t covered = 0;
    for (uint32_t i = 0; i < p.jpeg_count; i++) {
        struct hg_reader ahead = table;
        const struct place at = read_place(&ahead, width, height);
        covered += (uint64_t)at.width * at.height;
        show_jpeg(&p, &table, (struct place){0, 0, width, height}, picture);
    }
    struct hg_reader pixels = table;
    hg_read_bytes(&pixels, 8 * (size_t)p.exact_count);
    for (uint32_t i = 0; i < p.exact_count; i++) {
        const struct place at = read_place(&table, width, height);
        const uint8_t *from = hg_read_bytes(&pixels, 4 * (size_t)at.width * at.height);
        assert_non_null(from);
        covered += (uint64_t)at.width * at.height;
        show_exact(at, from, width, picture);
    }
    assert_int_equal(pixels.pos, p.unpacked_bytes);
    assert_false(table.failed);
    free(p.unpacked);
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

static void take(struct stage *s, struct hg_refbuf *next)
{
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
        assert_true(s.out.lossy || is_exact(&s));
        if (n % 7 == 6) {
            send(&s, false);
            assert_true(is_exact(&s) && !s.out.lossy);
            assert_int_equal(send(&s, true), 0); // nothing has changed
        }
        edit(&s);
    }
    end(&s);
}

static void brighten(struct stage *s, int levels)
{
    struct hg_refbuf *next = hg_refbuf_create(s->request.pixels->size);
    for (size_t i = 0; i < next->size; i++)
        next->data[i] = (uint8_t)(s->request.pixels->data[i] + (i % 4 < 3 ? levels : 0));
    take(s, next);
}

// Light that changes by a level is not sent, but neither forgotten: not when it goes on changing,
// and not when the picture is to be exact.
static void test_slow_light_is_sent_at_last(void **state)
{
    (void)state;
    struct stage s;
    begin(&s, 96, 80);
    for (size_t i = 0; i < s.request.pixels->size; i++)
        if (i % 4 < 3)
            s.request.pixels->data[i] = (uint8_t)(60 + s.request.pixels->data[i] % 8);
    send(&s, false);
    uint64_t sent = 0;
    for (uint32_t n = 0; n < 10; n++) {
        brighten(&s, 1);
        const uint64_t covered = send(&s, true);
        assert_true(s.out.lossy);
        assert_int_equal(covered, n % 2 ? 96 * 80 : 0);
        sent += covered;
    }
    assert_int_equal(sent, 5 * 96 * 80);
    send(&s, false);
    assert_true(is_exact(&s) && !s.out.lossy);
    brighten(&s, 1);
    assert_int_equal(send(&s, true), 0);
    assert_true(s.out.lossy);
    send(&s, false);
    assert_true(is_exact(&s) && !s.out.lossy);
    end(&s);
}

// Of two halves, of which the right one has contrast: what covers it is sent when it changes by
// `right` levels, what covers the even one by 2.
static void check_contrast(uint8_t quality, int right)
{
    struct stage s;
    const uint64_t half = 48 * 80;
    int off = 0;
    begin(&s, 96, 80);
    s.request.quality = quality;
    for (size_t i = 0; i < s.request.pixels->size; i++)
        if (i % 4 < 3)
            s.request.pixels->data[i] = (uint8_t)(i / 4 % 96 < 48 ? 100 : i / 4 % 2 ? 60 : 220);
    send(&s, true);
    for (int n = 0; n < 2 * right; n++) {
        brighten(&s, 1);
        off = off + 1 == right ? 0 : off + 1;
        assert_int_equal(send(&s, true), (n % 2 ? half : 0) + (off == 0 ? half : 0));
    }
    send(&s, false);
    assert_true(is_exact(&s));
    end(&s);
}

static void test_contrast_hides_light(void **state)
{
    (void)state;
    check_contrast(50, 5);
    check_contrast(80, 5);
    check_contrast(90, 4);
    check_contrast(95, 3);
    check_contrast(100, 2);
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

// A picture of which two places, on the grid of tiles, have one colour each.
static struct hg_refbuf *with_two_changes(const struct stage *s)
{
    struct hg_refbuf *next = hg_refbuf_create(s->request.pixels->size);
    memcpy(next->data, s->request.pixels->data, next->size);
    for (uint32_t y = 0; y < s->height; y++)
        for (uint32_t x = 0; x < s->width; x++) {
            uint8_t *to = next->data + 4 * ((size_t)y * s->width + x);
            if (x >= 80 && x < 200 && y >= 40 && y < 112)
                memcpy(to, "\xe0\x20\x20\xff", 4);
            else if (x >= 272 && y >= 176)
                memcpy(to, "\x20\x30\xe0\xff", 4);
        }
    return next;
}

// Colours of one place do not get into the other, though they lie beside each other in the file,
// and nothing gets across the picture's border.
static void test_places_keep_their_colours(void **state)
{
    (void)state;
    struct stage s;
    begin(&s, 333, 211);
    send(&s, false);
    take(&s, with_two_changes(&s));
    send(&s, true);
    assert_true(s.out.lossy);
    int most = 0;
    for (size_t i = 0; i < s.request.pixels->size; i++) {
        const int off = abs(s.picture[i] - s.request.pixels->data[i]);
        most = off > most ? off : most;
    }
    assert_in_range(most, 0, 4);
    end(&s);
}

// A picture that was sent, with loss, in `full` bytes, and another with the same pixels.
static struct hg_refbuf *begin_edit(struct stage *s, size_t *full)
{
    begin(s, 1280, 720);
    send(s, true);
    *full = s->out.data.size;
    struct hg_refbuf *next = hg_refbuf_create(s->request.pixels->size);
    memcpy(next->data, s->request.pixels->data, next->size);
    return next;
}

// An edit of one object against full pictures.
static void test_an_edit_costs_a_tenth(void **state)
{
    (void)state;
    struct stage s;
    size_t full;
    struct hg_refbuf *next = begin_edit(&s, &full);
    for (uint32_t y = 300; y < 400; y++)
        for (uint32_t x = 600; x < 760; x++)
            next->data[4 * (y * 1280 + x)] ^= 64;
    take(&s, next);
    send(&s, true);
    print_message("full %zu bytes, edit of 160x100 px %zu bytes\n", full, s.out.data.size);
    assert_true(s.out.data.size * 20 < full);
    end(&s);
}

// Many small places cost little more than their pixels: no file each.
static void test_small_places_are_cheap(void **state)
{
    (void)state;
    struct stage s;
    size_t full;
    struct hg_refbuf *next = begin_edit(&s, &full);
    for (uint32_t i = 0; i < 30; i++)
        next->data[4 * (size_t)(24 * i * 1280 + 40 * i)] ^= 64;
    take(&s, next);
    const uint64_t covered = send(&s, true);
    print_message(
        "30 places, %u pixels: %zu bytes of %zu\n", (unsigned)covered, s.out.data.size, full);
    assert_int_equal(covered, 30 * HG_TILE_PX * HG_TILE_PX);
    assert_true(s.out.data.size * 40 < full);
    end(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_exact_after_any_edits),
        cmocka_unit_test(test_exact_after_loss),
        cmocka_unit_test(test_slow_light_is_sent_at_last),
        cmocka_unit_test(test_contrast_hides_light),
        cmocka_unit_test(test_alpha_is_kept),
        cmocka_unit_test(test_places_keep_their_colours),
        cmocka_unit_test(test_an_edit_costs_a_tenth),
        cmocka_unit_test(test_small_places_are_cheap),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
