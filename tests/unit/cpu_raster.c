// cpu_raster.c - triangles that the host draws: all kernels give the same bytes, on any number
// of threads, and so do phases; shared edges cover each pixel once.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "renderer/cpu_raster/raster.h"

#define WIDTH     310
#define HEIGHT    270
#define PIXELS    (WIDTH * HEIGHT)
#define RUNS      60
#define TRIANGLES 100
#define VERTICES  2000 // runs reach further than what a kernel takes at once

struct world {
    float positions[VERTICES * 3];
    uint32_t indices[RUNS][TRIANGLES * 3];
    struct hg_raster_run runs[RUNS];
    struct hg_mat4x3 matrix;
    struct hg_raster_view view;
};

struct picture {
    uint32_t ids[PIXELS * 2];
    float depth[PIXELS];
    uint8_t marks[RUNS];
};

static uint32_t random_state = 5;

static float random_in(float low, float high)
{
    random_state = random_state * 1664525u + 1013904223u;
    return low + (high - low) * (float)(random_state >> 8) * 0x1p-24f;
}

// Pixels are metres, y down, at any depth; w is 4 everywhere.
static void look(struct world *w)
{
    memset(w, 0, sizeof *w);
    w->view.width = WIDTH;
    w->view.height = HEIGHT;
    w->view.view_proj[0] = 8.0f / WIDTH;
    w->view.view_proj[5] = 8.0f / HEIGHT;
    w->view.view_proj[10] = 0.01f;
    w->view.clip[0] = w->view.clip[1] = -4.0f;
    w->view.clip[2] = 2.0f;
    w->view.clip[3] = 4.0f;
    w->matrix.m[0] = w->matrix.m[4] = w->matrix.m[8] = 1.0f;
}

// Boxes of what the indices say.
static void measure(struct world *w)
{
    for (uint32_t r = 0; r < RUNS; r++) {
        float low[3] = {1e9f, 1e9f, 1e9f}, high[3] = {-1e9f, -1e9f, -1e9f};
        for (uint32_t i = 0; i < TRIANGLES * 3; i++)
            for (int d = 0; d < 3; d++) {
                const float at = w->positions[w->indices[r][i] * 3 + (uint32_t)d];
                low[d] = fminf(low[d], at);
                high[d] = fmaxf(high[d], at);
            }
        struct hg_raster_run *run = &w->runs[r];
        *run = (struct hg_raster_run){.positions = w->positions,
            .indices = w->indices[r],
            .world = &w->matrix,
            .count = TRIANGLES - r % 7,
            .draw = r / 3,
            .number = r * 1000,
            .both_sides = r % 3 == 0,
            .mirrored = r % 3 == 1};
        for (int d = 0; d < 3; d++) {
            run->center[d] = 0.5f * (low[d] + high[d]);
            run->extent[d] = 0.5f * (high[d] - low[d]) + 1e-3f;
        }
    }
}

// Triangles of all sizes, slivers and points among them, many at the same depth, some outside.
static void scatter(struct world *w)
{
    static const float sizes[] = {0.3f, 1.0f, 3.0f, 12.0f, 70.0f, 300.0f, 1500.0f};
    look(w);
    for (uint32_t v = 0; v < VERTICES; v++) {
        float *p = w->positions + v * 3;
        const float size = sizes[v / 3 % 7];
        const float *first = w->positions + v / 3 * 9;
        p[0] = v % 3 == 0 ? random_in(-40, WIDTH + 40) : first[0] + random_in(-size, size);
        p[1] = v % 3 == 0 ? random_in(-40, HEIGHT + 40) : first[1] + random_in(-size, size);
        p[2] = v % 2 == 0 ? 10.0f : random_in(-50, 50);
        if (v % 11 == 0) { // on the grid that corners are snapped to, and on centres
            p[0] = floorf(p[0]) + 0.5f;
            p[1] = floorf(p[1] * 4.0f) / 4.0f;
        }
    }
    for (uint32_t r = 0; r < RUNS; r++)
        for (uint32_t t = 0; t < TRIANGLES; t++) {
            const bool near = r % 2 == 0;
            const uint32_t first = near ? (r * 20 + t * 3 % 360) % (VERTICES - 2) / 3 * 3
                                        : (uint32_t)random_in(0, VERTICES / 3 - 1) * 3;
            for (uint32_t k = 0; k < 3; k++)
                w->indices[r][t * 3 + k] = first + k;
            if (t % 13 == 0)
                w->indices[r][t * 3 + 2] = (first + 7) % VERTICES;
        }
    measure(w);
}

static void draw(const struct world *w, bool portable, unsigned threads, struct picture *out)
{
    struct hg_raster *raster = hg_raster_create(portable);
    struct hg_jobs *jobs = threads > 0 ? hg_jobs_create(threads) : NULL;
    assert_non_null(raster);
    memset(out, 0xcd, sizeof *out);
    memset(out->marks, 0, sizeof out->marks);
    const struct hg_raster_target target = {out->ids, out->depth};
    const struct hg_raster_runs runs = {w->runs, RUNS, out->marks};
    assert_int_equal(hg_raster_draw(raster, &w->view, &runs, &target, jobs), HG_OK);
    hg_jobs_destroy(jobs);
    hg_raster_destroy(raster);
}

static void test_all_alike(void **state)
{
    (void)state;
    static struct world w;
    static struct picture plain, other;
    for (int round = 0; round < 8; round++) {
        scatter(&w);
        draw(&w, true, 0, &plain);
        uint32_t covered = 0;
        for (uint32_t i = 0; i < PIXELS; i++)
            covered += plain.ids[i * 2] != 0;
        assert_in_range(covered, PIXELS / 2, PIXELS);
        for (unsigned threads = 0; threads < 4; threads++) {
            draw(&w, false, threads, &other);
            assert_memory_equal(&plain, &other, sizeof plain);
        }
        for (uint32_t r = 0; r < RUNS; r++)
            w.runs[r].late = r % 4 != (uint32_t)round % 4;
        for (int portable = 0; portable < 2; portable++) {
            draw(&w, portable == 1, 2, &other);
            assert_memory_equal(plain.ids, other.ids, sizeof plain.ids);
            assert_memory_equal(plain.depth, other.depth, sizeof plain.depth);
        }
    }
}

// A sheet of triangles has neither holes nor pixels that two of them cover: at one depth the first
// is seen, so whatever is drawn in the opposite order shows the same ids.
static void test_sheet(void **state)
{
    (void)state;
    static struct world w;
    static struct picture forth, back;
    look(&w);
    const uint32_t side = 43; // vertices per row; RUNS * TRIANGLES / 2 = 3000 cells
    for (uint32_t v = 0; v < VERTICES; v++) {
        w.positions[v * 3] = 20.0f + 6.0f * (float)(v % side) + random_in(-1.2f, 1.2f);
        w.positions[v * 3 + 1] = 10.0f + 5.0f * (float)(v / side) + random_in(-1.0f, 1.0f);
        w.positions[v * 3 + 2] = 5.0f;
    }
    uint32_t cells = 0;
    for (uint32_t r = 0; r < RUNS; r++)
        for (uint32_t t = 0; t < TRIANGLES; t++) {
            const uint32_t cell = cells++ / 2 % ((side - 1) * 45),
                           first = cell / (side - 1) * side + cell % (side - 1);
            const uint32_t corners[2][3] = {
                {first, first + side, first + 1}, {first + 1, first + side, first + side + 1}};
            memcpy(&w.indices[r][t * 3], corners[cells % 2], 12);
        }
    measure(&w);
    for (uint32_t r = 0; r < RUNS; r++) {
        w.runs[r].both_sides = true;
        w.runs[r].count = TRIANGLES;
        w.runs[r].draw = 0;
        w.runs[r].number = r * TRIANGLES;
    }
    draw(&w, false, 0, &forth);
    for (uint32_t y = 30; y < 200; y++)
        for (uint32_t x = 40; x < 250; x++)
            assert_int_equal(forth.ids[(y * WIDTH + x) * 2], 1);
    for (uint32_t r = 0; r < RUNS / 2; r++) { // only the first of each cell's triangles are there
        const struct hg_raster_run last = w.runs[RUNS - 1 - r];
        w.runs[RUNS - 1 - r] = w.runs[r];
        w.runs[r] = last;
    }
    draw(&w, true, 0, &back);
    uint32_t other = 0;
    for (uint32_t i = 0; i < PIXELS; i++) {
        const uint32_t a = forth.ids[i * 2 + 1] / 2, b = back.ids[i * 2 + 1] / 2;
        other += forth.ids[i * 2] != back.ids[i * 2] ||
                 (forth.ids[i * 2] != 0 && a % ((side - 1) * 45) != b % ((side - 1) * 45));
        other += forth.ids[i * 2 + 1] % 2 != back.ids[i * 2 + 1] % 2;
    }
    assert_int_equal(other, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_all_alike), cmocka_unit_test(test_sheet)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
