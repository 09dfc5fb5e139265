// waiting_pixels.c - rectangles about pixels that wait: they hold all of them, and little else.
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "renderer/frame/streaming/waiting_pixels.h"
#include "shaders/shared/sample_blocks.h"
#include "shaders/shared/texture.h"

enum { WIDTH = 1280, HEIGHT = 720, SAMPLES = 32, REACHED = 9 };

static uint32_t progress[HEIGHT * WIDTH];
static uint32_t random_state = 1;

static uint32_t random_below(uint32_t n)
{
    random_state = random_state * 1664525u + 1013904223u;
    return (uint32_t)((uint64_t)(random_state >> 8) * n >> 24);
}

static struct hg_waiting_pixels all_at(uint32_t samples)
{
    for (uint32_t i = 0; i < WIDTH * HEIGHT; i++)
        progress[i] = samples;
    return (struct hg_waiting_pixels){.progress = progress, .width = WIDTH, .samples = SAMPLES};
}

static void wait_at(uint32_t x, uint32_t y, uint32_t samples)
{
    // A run in the upper bits is no part of the number.
    progress[y * WIDTH + x] = samples | 77u << HG_PROGRESS_RUN_SHIFT;
}

static uint64_t pixels_of(VkRect2D rect)
{
    return (uint64_t)rect.extent.width * rect.extent.height;
}

static bool holds(VkRect2D rect, uint32_t x, uint32_t y)
{
    return x >= (uint32_t)rect.offset.x && x < (uint32_t)rect.offset.x + rect.extent.width &&
           y >= (uint32_t)rect.offset.y && y < (uint32_t)rect.offset.y + rect.extent.height;
}

// All of `rect` that waits is in one of the rectangles, which lie within it.
static uint64_t check_rects(
    const struct hg_waiting_pixels *w, VkRect2D rect, const VkRect2D *rects, uint32_t count)
{
    uint64_t sum = 0;
    assert_in_range(count, 1, HG_WAITING_MOST_RECTS);
    for (uint32_t i = 0; i < count; i++) {
        const VkOffset2D at = rects[i].offset;
        assert_true(holds(rect, (uint32_t)at.x, (uint32_t)at.y));
        assert_true(holds(rect, (uint32_t)at.x + rects[i].extent.width - 1,
            (uint32_t)at.y + rects[i].extent.height - 1));
        sum += pixels_of(rects[i]);
    }
    for (uint32_t y = (uint32_t)rect.offset.y; y < (uint32_t)rect.offset.y + rect.extent.height;
         y++)
        for (uint32_t x = (uint32_t)rect.offset.x; x < (uint32_t)rect.offset.x + rect.extent.width;
             x++) {
            bool held = (w->progress[y * WIDTH + x] & HG_PROGRESS_SAMPLES_MASK) >= REACHED;
            for (uint32_t i = 0; i < count && !held; i++)
                held = holds(rects[i], x, y);
            assert_true(held);
        }
    return sum;
}

static const VkRect2D whole = {{0, 0}, {WIDTH, HEIGHT}};

static void test_few(void **state)
{
    const struct hg_waiting_pixels w = all_at(REACHED);
    VkRect2D rects[HG_WAITING_MOST_RECTS];
    (void)state;
    wait_at(0, 0, 3);
    wait_at(WIDTH - 1, HEIGHT - 1, 5);
    wait_at(700, 300, 8);
    wait_at(710, 310, 8);
    const uint32_t count = hg_waiting_pixels_rects(&w, whole, REACHED, rects);
    // Two corners and one place, of which each takes a cell or a few.
    assert_true(check_rects(&w, whole, rects, count) < pixels_of(whole) / 20);
    assert_int_equal(hg_waiting_pixels_least(&w, whole), 3);
    uint32_t least = SAMPLES;
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t here = hg_waiting_pixels_least(&w, rects[i]);
        least = here < least ? here : least;
    }
    assert_int_equal(least, 3);
}

// Clusters in any places, more than there may be rectangles, in a part of the picture.
static void test_clusters(void **state)
{
    const VkRect2D part = {{96, 48}, {1100, 600}};
    VkRect2D rects[HG_WAITING_MOST_RECTS];
    (void)state;
    uint32_t apart = 0;
    for (uint32_t round = 0; round < 20; round++) {
        const struct hg_waiting_pixels w = all_at(REACHED);
        for (uint32_t k = 0; k < 1 + round; k++) {
            const uint32_t x = 96 + random_below(1090), y = 48 + random_below(590);
            for (uint32_t i = 0; i < 40; i++)
                wait_at(x + random_below(10), y + random_below(10), random_below(REACHED));
        }
        const uint32_t count = hg_waiting_pixels_rects(&w, part, REACHED, rects);
        if (count == 0)
            continue;
        apart++;
        assert_true(check_rects(&w, part, rects, count) <= pixels_of(part) / 2);
    }
    assert_true(apart >= 5);
}

static void test_many(void **state)
{
    const struct hg_waiting_pixels w = all_at(REACHED);
    VkRect2D rects[HG_WAITING_MOST_RECTS];
    (void)state;
    for (uint32_t i = 0; i < 2000; i++)
        wait_at(random_below(WIDTH), random_below(HEIGHT), REACHED - 1);
    assert_int_equal(hg_waiting_pixels_rects(&w, whole, REACHED, rects), 0);
}

// Pixels with samples enough wait for none.
static void test_enough(void **state)
{
    struct hg_waiting_pixels w = all_at(REACHED);
    VkRect2D rects[HG_WAITING_MOST_RECTS];
    static uint32_t counts[(HEIGHT / HG_SAMPLE_BLOCK_HEIGHT) * (WIDTH / HG_SAMPLE_BLOCK_WIDTH)];
    (void)state;
    w.columns = WIDTH / HG_SAMPLE_BLOCK_WIDTH;
    w.counts = counts;
    for (uint32_t i = 0; i < sizeof counts / sizeof *counts; i++)
        counts[i] = 8;
    wait_at(40, 40, 8);
    wait_at(900, 500, 7);
    const uint32_t count = hg_waiting_pixels_rects(&w, whole, REACHED, rects);
    assert_int_equal(count, 1);
    assert_true(holds(rects[0], 900, 500) && !holds(rects[0], 40, 40));
    assert_int_equal(hg_waiting_pixels_least(&w, whole), 7);
    wait_at(900, 500, 8);
    assert_int_equal(hg_waiting_pixels_least(&w, whole), SAMPLES);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_few),
        cmocka_unit_test(test_clusters),
        cmocka_unit_test(test_many),
        cmocka_unit_test(test_enough),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
