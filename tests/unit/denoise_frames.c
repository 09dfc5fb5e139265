// denoise_frames.c - the denoiser over the frames of an animation: less flicker, no lag, a history
// that survives a file.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "tests/support/check.h"
#include "tests/unit/denoise_pictures.h"

// A camera at eye_x looks at what stands 3 m away, 0.03 m a pixel there.
static struct hg_denoise_camera camera_at(const struct picture *p, double eye_x)
{
    return (struct hg_denoise_camera){.eye = {eye_x},
        .forward = {0, 0, -1},
        .across = {-0.005 * p->width, 0.005 * p->height, -1},
        .x = {0.01},
        .y = {0, -0.01}};
}

static uint32_t moved_px; // what is seen goes left by so much

static struct point lit_from_right(uint32_t x, uint32_t y)
{
    struct point p = point_wall(1.0f);
    (void)y;
    p.irradiance = x + moved_px < 60 ? 0.5f : 2.0f; // a shadow's edge
    return p;
}

struct film {
    struct picture last, before; // frames
};

static void film_finish(struct film *film)
{
    picture_finish(&film->last);
    picture_finish(&film->before);
}

// Mean difference of the last two frames where both show the same, relative.
static double flicker_of(const struct film *film, uint32_t step_px)
{
    const struct picture *a = &film->before, *b = &film->last;
    double sum = 0.0;
    for (uint32_t y = 0; y < b->height; y++)
        for (uint32_t x = 0; x + step_px < b->width; x++)
            sum +=
                fabs((double)(picture_out(b, x, y, 0) / picture_out(a, x + step_px, y, 0)) - 1.0);
    return sum / ((double)b->height * (b->width - step_px));
}

// Frames of 4 samples.
static struct film play(int frames, uint32_t step_px, bool with_history, point_at *scene)
{
    struct film film = {0};
    struct hg_denoise *history = hg_denoise_create();
    assert_non_null(history);
    moved_px = 0;
    for (int i = 0; i < frames; i++, moved_px += step_px) {
        picture_finish(&film.before);
        film.before = film.last;
        film.last = picture_make_seeded(112, 64, 4, scene, 77u + 1000u * (uint32_t)i);
        film.last.input.camera = camera_at(&film.last, 0.03 * moved_px);
        film.last.input.history = with_history ? history : NULL;
        hg_denoise_next(history);
        picture_denoise(&film.last, 2);
    }
    hg_denoise_destroy(history);
    return film;
}

static void test_flicker(void **state)
{
    (void)state;
    for (uint32_t step_px = 0; step_px < 8; step_px += 7) {
        struct film still = play(8, step_px, false, lit_from_right);
        struct film animation = play(8, step_px, true, lit_from_right);
        const double a = flicker_of(&still, step_px), b = flicker_of(&animation, step_px);
        moved_px -= step_px; // of the last frame
        const double ea = picture_error(&still.last, lit_from_right, false);
        const double eb = picture_error(&animation.last, lit_from_right, false);
        print_message("%u px a frame: flicker %.4f, %.4f with history; error %.4f, %.4f\n", step_px,
            a, b, ea, eb);
        assert_true(b < 0.5 * a);
        assert_true(eb < 1.05 * ea); // shadows do not lag
        film_finish(&still);
        film_finish(&animation);
    }
}

// Stripes of light in a mirror that stands still, 3 m behind it.
static struct point striped(uint32_t x, uint32_t y)
{
    struct point p = point_mirror(x, y);
    p.seen = 0.5f;
    p.behind = 3.0f;
    p.mirrored = (x + moved_px) / 10 % 2 ? 0.5f : 2.0f;
    return p;
}

// Error of the last of 8 frames whose stripes go left by so much; told_px: what the frames say.
static double striped_error(uint32_t step_px, int told_px, bool with_history)
{
    enum { WIDTH = 112, HEIGHT = 64, SAMPLES = 4 };
    struct hg_denoise *history = hg_denoise_create();
    float *moved = calloc((size_t)HG_PATH_MOVED_WORDS * WIDTH * HEIGHT, sizeof *moved);
    double error = 0.0;
    assert_true(history && moved);
    for (size_t i = 0; i < WIDTH * HEIGHT; i++) // 0.06 m a pixel
        moved[HG_PATH_MOVED_SEEN * WIDTH * HEIGHT + i] = SAMPLES * 0.06f * (float)told_px;
    for (uint32_t i = 0; i < 8; i++) {
        moved_px = i * step_px;
        struct picture p = picture_make_seeded(WIDTH, HEIGHT, SAMPLES, striped, 77u + 1000u * i);
        p.input.camera = camera_at(&p, 0.0);
        p.input.moved = moved;
        p.input.history = with_history ? history : NULL;
        hg_denoise_next(history);
        picture_denoise(&p, 2);
        error = picture_mirror_error(&p, striped, false);
        picture_finish(&p);
    }
    hg_denoise_destroy(history);
    free(moved);
    return error;
}

// What is seen in a mirror that stands still is found where it was, not where the mirror is.
static void test_images_move(void **state)
{
    (void)state;
    const double frame = striped_error(3, 3, false), told = striped_error(3, 3, true);
    const double still = striped_error(3, 0, true), wrong = striped_error(3, -3, true);
    print_message(
        "stripes in a mirror: error %.4f, with history %.4f; not told %.4f, wrongly %.4f\n", frame,
        told, still, wrong);
    assert_true(told < 0.87 * frame && told < 0.7 * still && told < 0.7 * wrong);
}

static float lamp;

static struct point lamplit(uint32_t x, uint32_t y)
{
    struct point p = point_wall(1.0f);
    (void)x;
    (void)y;
    p.irradiance = lamp;
    return p;
}

// A lamp that goes on is on at once.
static void test_change(void **state)
{
    (void)state;
    struct hg_denoise *history = hg_denoise_create();
    assert_non_null(history);
    for (uint32_t i = 0; i < 10; i++) {
        lamp = i < 8 ? 1.0f : 1.6f;
        struct picture p = picture_make_seeded(96, 64, 8, lamplit, 5u + i);
        p.input.camera = camera_at(&p, 0.0);
        p.input.history = history;
        hg_denoise_next(history);
        picture_denoise(&p, 2);
        double mean = 0.0;
        for (uint32_t k = 0; k < 96 * 64; k++)
            mean += (double)p.out[k] / (96.0 * 64.0);
        print_message("frame %u: %.3f of %.3f\n", i, mean / 0.5, (double)lamp);
        assert_true(fabs(mean / (0.5 * (double)lamp) - 1.0) < 0.05);
        picture_finish(&p);
    }
    hg_denoise_destroy(history);
}

// A history that went through a file is what it was, to the bit.
static void test_saved(void **state)
{
    (void)state;
    struct hg_error err = {0};
    struct hg_denoise *history = hg_denoise_create(), *loaded;
    struct hg_refbuf *file;
    assert_non_null(history);
    struct picture a = picture_make_seeded(64, 48, 4, point_polished, 3),
                   b = picture_make_seeded(64, 48, 4, point_polished, 4);
    struct picture c = picture_make_seeded(64, 48, 4, point_polished, 4);
    struct picture *const all[] = {&a, &b, &c};
    for (size_t i = 0; i < 3; i++)
        all[i]->input.camera = camera_at(all[i], 0.02 * (double)(i > 0));
    a.input.history = b.input.history = history;
    picture_denoise(&a, 2);
    test_ok(hg_denoise_save(history, &file, &err), &err);
    test_ok(hg_denoise_load(file->data, file->size, &loaded, &err), &err);
    assert_int_equal(
        hg_denoise_load(file->data, file->size - 1, &c.input.history, &err), HG_E_INVAL);
    c.input.history = loaded;
    hg_denoise_next(history);
    hg_denoise_next(loaded);
    picture_denoise(&b, 2);
    picture_denoise(&c, 2);
    assert_memory_equal(b.out, c.out, 64 * 48 * HG_DENOISE_LIGHT * sizeof(float));
    hg_refbuf_unref(file);
    for (size_t i = 0; i < 3; i++)
        picture_finish(all[i]);
    hg_denoise_destroy(history);
    hg_denoise_destroy(loaded);
}

// A picture that is run again with a history takes its own place, and another size none.
static void test_again(void **state)
{
    (void)state;
    struct hg_denoise *history = hg_denoise_create();
    assert_non_null(history);
    struct picture a = picture_make(64, 48, 4, point_noisy_wall),
                   b = picture_make(64, 48, 4, point_noisy_wall);
    struct picture small = picture_make(20, 30, 4, point_noisy_wall);
    struct picture *const all[] = {&a, &b, &small};
    for (size_t i = 0; i < 3; i++) {
        all[i]->input.camera = camera_at(all[i], 0.0);
        all[i]->input.history = history;
    }
    picture_denoise(&small, 2);
    hg_denoise_next(history);
    picture_denoise(&a, 2);
    picture_denoise(&b, 3);
    assert_memory_equal(a.out, b.out, 64 * 48 * HG_DENOISE_LIGHT * sizeof(float));
    picture_finish(&a);
    picture_finish(&b);
    picture_finish(&small);
    hg_denoise_destroy(history);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_flicker),
        cmocka_unit_test(test_images_move),
        cmocka_unit_test(test_change),
        cmocka_unit_test(test_saved),
        cmocka_unit_test(test_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
