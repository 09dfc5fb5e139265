// shadow_pages.c - the page table of a sun's virtual shadow map: what is asked for is held, at the
// resolution of the picture, and drawn once; casters that move stale their pages alone; the pool is
// never exceeded.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "renderer/camera/camera.h"
#include "renderer/light/shadow/shadow_pages.h"
#include "renderer/light/shadow/shadow_plan.h"

enum { WIDTH = 960, HEIGHT = 540, MOST_PICTURES = 64 };

// A plane of 2 km across, seen from 2 m above it.
struct ground {
    struct hg_shadow_pages *pages;
    struct hg_shadow_pool *held;
    struct hg_shadow_map maps[HG_SHADOW_FRESH_PAGES];
    struct hg_gpu_shadow whole, pool;
    struct hg_gpu_camera camera;
    float depth[HEIGHT][WIDTH];
    uint32_t fresh;
};

static void look(struct ground *g, double x, double turn)
{
    const struct hg_camera_setup setup = {.eye = {x, 2, 0},
        .target = {x + 10 * sin(turn), 1, -10 * cos(turn)},
        .up = {0, 1, 0},
        .vfov_rad = 1,
        .near = 0.1f,
        .width = WIDTH,
        .height = HEIGHT};
    hg_camera_fill(&setup, &g->camera);
    const struct hg_gpu_camera *c = &g->camera;
    for (uint32_t v = 0; v < HEIGHT; v++)
        for (uint32_t u = 0; u < WIDTH; u++) {
            const float way = c->ray_origin_ws.y + ((float)u + 0.5f) * c->ray_x_ws.y +
                              ((float)v + 0.5f) * c->ray_y_ws.y;
            const float far = way < 0 ? -2 / way : INFINITY; // view depth
            g->depth[v][u] = far < 900 ? c->proj.m[14] / far - c->proj.m[10] : 0;
        }
}

static int open_ground(void **state)
{
    struct ground *g = calloc(1, sizeof *g);
    g->pages = calloc(1, sizeof *g->pages);
    g->pages->view = g;
    g->held = calloc(1, sizeof *g->held);
    g->pool = (struct hg_gpu_shadow){.size_px = HG_SHADOW_POOL_SIDE_PX, .rect_px = {2048, 0}};
    // Light from straight above; 1 m a texel.
    g->whole = (struct hg_gpu_shadow){.origin_ws = {0, 100, 0},
        .right_ws = {1, 0, 0},
        .up_ws = {0, 0, 1},
        .forward_ws = {0, -1, 0},
        .depth_scale = 1.0f / 200,
        .texel_size = 1,
        .scale = 1.0f / 1024,
        .size_px = 2048,
        .extent = 0.99f};
    look(g, 0, 0);
    *state = g;
    return 0;
}

static int close_ground(void **state)
{
    struct ground *g = *state;
    free(g->pages);
    free(g->held);
    free(g);
    return 0;
}

static void draw_maps(struct ground *g)
{
    for (uint32_t i = 0; i < g->fresh; i++)
        g->maps[i].stale = false;
}

// A picture; the maps of the one before are drawn.
static const struct hg_shadow_page_stats *draw(struct ground *g)
{
    const struct hg_shadow_depth depth = {&g->depth[0][0], WIDTH, HEIGHT};
    draw_maps(g);
    hg_shadow_pool_begin(g->held, &g->pool, &g->whole);
    hg_shadow_pages_begin(g->pages, g->held, &g->camera);
    g->fresh = hg_shadow_pages_plan(g->pages, g->maps);
    hg_shadow_pages_see(g->pages, &g->camera, &depth);
    return &g->pages->stats;
}

// Pictures until no page is due; returns how many were drawn in all.
static uint32_t rest(struct ground *g)
{
    uint32_t drawn = draw(g)->drawn;
    for (int i = 0; i < MOST_PICTURES; i++) {
        const struct hg_shadow_page_stats *s = draw(g);
        drawn += s->drawn;
        assert_true(s->drawn <= HG_SHADOW_FRESH_PAGES);
        assert_true(s->held <= s->room);
        if (s->drawn == 0)
            return drawn;
    }
    fail_msg("pages are drawn for ever");
    return 0;
}

static float view_depth_at(const struct ground *g, uint32_t u, uint32_t v)
{
    return g->camera.proj.m[14] / (g->depth[v][u] + g->camera.proj.m[10]);
}

static void position_at(const struct ground *g, uint32_t u, uint32_t v, float out[3])
{
    const struct hg_gpu_camera *c = &g->camera;
    const float *o = (const float *)&c->ray_origin_ws, *x = (const float *)&c->ray_x_ws,
                *y = (const float *)&c->ray_y_ws, *eye = (const float *)&c->eye_ws;
    for (int i = 0; i < 3; i++)
        out[i] = eye[i] + view_depth_at(g, u, v) *
                              (o[i] + ((float)u + 0.5f) * x[i] + ((float)v + 0.5f) * y[i]);
}

// Near and far, a texel is one to two pixels; the page's map holds the point, in a place of its
// own.
static void test_resolution(void **state)
{
    struct ground *g = *state;
    const uint32_t drawn = rest(g);
    float nearest = INFINITY, farthest = 0, finest = INFINITY, coarsest = 0;
    uint32_t paged = 0, all = 0;
    for (uint32_t v = 0; v < HEIGHT; v++)
        for (uint32_t u = 0; u < WIDTH; u++) {
            struct hg_shadow_page_found f;
            float p[3];
            if (!(g->depth[v][u] > 0))
                continue;
            position_at(g, u, v, p);
            const float z = view_depth_at(g, u, v), pixel = z * g->camera.pixel_angle;
            all++;
            if (pixel > 0.25f || !hg_shadow_pages_find(g->pages, p, z, &f) ||
                f.page.level != f.wanted)
                continue; // the whole map's texels are not much larger; or narrow pages far away
            const float texel = hg_shadow_page_texel(&g->whole, f.page.level);
            assert_true(texel >= pixel * 0.999f && texel <= pixel * 2.001f);
            paged++;
            nearest = fminf(nearest, z);
            farthest = fmaxf(farthest, z);
            finest = fminf(finest, texel);
            coarsest = fmaxf(coarsest, texel);
        }
    print_message("%u pages; %u of %u pixels, %.2f to %.0f m away, texels %.4f to %.3f m\n", drawn,
        paged, all, (double)nearest, (double)farthest, (double)finest, (double)coarsest);
    assert_true(paged > all * 9 / 10);
    assert_true(farthest > nearest * 20 && coarsest > finest * 15);
}

// A view that rests draws nothing again, and all it asks for is held.
static void test_kept(void **state)
{
    struct ground *g = *state;
    assert_true(rest(g) > 20);
    const struct hg_shadow_page_stats *s = draw(g);
    assert_int_equal(s->drawn, 0);
    assert_int_equal(s->hits, s->asked);
    look(g, 0.02, 0); // a step
    draw(g);
    s = draw(g);
    assert_true(s->hits * 10 > s->asked * 8);
}

static bool overlap(const struct hg_gpu_shadow *a, const struct hg_gpu_shadow *b)
{
    return fabsf(a->rect_px.x - b->rect_px.x) < HG_SHADOW_PAGE_PX &&
           fabsf(a->rect_px.y - b->rect_px.y) < HG_SHADOW_PAGE_PX;
}

// What is to be drawn is the page's part of the plane, in a place of the pool that is its own.
static void test_maps(void **state)
{
    struct ground *g = *state;
    draw(g);
    draw(g);
    assert_int_equal(g->fresh, HG_SHADOW_FRESH_PAGES);
    for (uint32_t i = 0; i < g->fresh; i++) {
        const struct hg_shadow_map *m = &g->maps[i];
        const struct hg_shadow_page *page = &g->held->pages[g->held->due.order[i]];
        const float side = HG_SHADOW_PAGE_INNER_PX * hg_shadow_page_texel(&g->whole, page->level);
        // The corner of the page is the inner corner of the map: x of clip space.
        const float x = (float)page->x * side + g->whole.origin_ws.x;
        const float clip = m->view_proj[0] * x + m->view_proj[12];
        assert_float_equal(clip, -(float)HG_SHADOW_PAGE_INNER_PX / HG_SHADOW_PAGE_PX, 1e-3);
        assert_true(m->stale && m->gpu.size_px == HG_SHADOW_PAGE_PX);
        assert_true(m->gpu.rect_px.x >= g->pool.rect_px.x);
        assert_true(m->gpu.rect_px.y + HG_SHADOW_PAGE_PX <= HG_SHADOW_POOL_SIDE_PX);
        for (uint32_t k = 0; k < i; k++)
            assert_false(overlap(&m->gpu, &g->maps[k].gpu));
    }
}

// A box that moves stales the pages above it and no others.
static void test_touched(void **state)
{
    struct ground *g = *state;
    rest(g);
    const struct hg_box box = {{-0.3f, 0, -4.2f}, {0.3f, 1, -3.8f}};
    hg_shadow_pool_touch(g->held, &box);
    const struct hg_shadow_page_stats *s = draw(g);
    assert_true(s->drawn > 0 && s->drawn < s->asked / 4);
    for (uint32_t i = 0; i < g->fresh; i++) {
        const struct hg_shadow_page *page = &g->held->pages[g->held->due.order[i]];
        const float side = HG_SHADOW_PAGE_INNER_PX * hg_shadow_page_texel(&g->whole, page->level);
        const float at[2] = {((float)page->x + 0.5f) * side, ((float)page->y + 0.5f) * side};
        assert_true(fabsf(at[0]) < 0.3f + 0.6f * side && fabsf(at[1] + 4) < 0.2f + 0.6f * side);
    }
    assert_int_equal(draw(g)->drawn, 0);
}

// Maps that were not drawn as asked are due again.
static void test_not_drawn(void **state)
{
    struct ground *g = *state;
    draw(g);
    draw(g);
    const uint32_t held = g->pages->stats.held;
    assert_int_equal(held, HG_SHADOW_FRESH_PAGES);
    hg_shadow_pool_note(g->held); // all are stale
    g->fresh = 0;
    const struct hg_shadow_page_stats *s = draw(g);
    assert_int_equal(s->hits, 0);
    assert_int_equal(s->drawn, HG_SHADOW_FRESH_PAGES);
}

// Turning about: the pool is never exceeded, and what goes is what was out of sight for longest.
static void test_eviction(void **state)
{
    struct ground *g = *state;
    g->pool.size_px = 8 * HG_SHADOW_PAGE_PX;
    uint32_t evicted = 0;
    for (int i = 0; i < 200; i++) {
        look(g, 0, 0.03 * i);
        const struct hg_shadow_page_stats *s = draw(g);
        evicted += s->evicted;
        assert_int_equal(s->room, 64);
        assert_true(s->held <= s->room);
        assert_true(s->hits + s->drawn <= s->asked);
    }
    assert_true(evicted > 64);
    // What is asked for is not what makes room.
    rest(g);
    const uint32_t hits = draw(g)->hits;
    assert_true(draw(g)->hits >= hits);
}

// Of another sun nothing is left, and without a pool nothing is held.
static void test_forgotten(void **state)
{
    struct ground *g = *state;
    rest(g);
    g->whole.right_ws = (struct hg_vec3){0.8f, 0, 0.6f};
    g->whole.up_ws = (struct hg_vec3){-0.6f, 0, 0.8f};
    const struct hg_shadow_page_stats *s = draw(g);
    assert_int_equal(s->hits, 0);
    rest(g);
    hg_shadow_pages_begin(g->pages, NULL, &g->camera);
    g->fresh = hg_shadow_pages_plan(g->pages, g->maps);
    assert_int_equal(g->fresh, 0);
    assert_int_equal(g->pages->stats.held, 0);
    const float p[3] = {0, 0, -4};
    struct hg_shadow_page_found f;
    assert_false(hg_shadow_pages_find(g->pages, p, 4, &f));
}

// Another view of the same pool, from about the same place, draws nothing of its own.
static void test_shared(void **state)
{
    struct ground *g = *state, *other;
    rest(g);
    assert_int_equal(open_ground((void **)&other), 0);
    struct hg_shadow_pool *const own = other->held;
    other->held = g->held;
    const uint32_t drawn = rest(other);
    assert_int_equal(drawn, 0);
    assert_true(other->pages->stats.asked > 20);
    assert_int_equal(other->pages->stats.hits, other->pages->stats.asked);
    look(other, 600, 2); // far away: what each holds stays
    assert_true(rest(other) > 20);
    assert_int_equal(rest(g), 0);
    assert_int_equal(rest(other), 0);
    other->held = own;
    close_ground((void **)&other);
}

// Two views that want more than there is come to equal parts, which stay.
static void test_parts(void **state)
{
    struct ground *g = *state, *other;
    assert_int_equal(open_ground((void **)&other), 0);
    struct hg_shadow_pool *const own = other->held;
    other->held = g->held;
    look(other, 600, 2);
    g->pool.size_px = other->pool.size_px = 4 * HG_SHADOW_PAGE_PX;
    uint32_t drawn = 0;
    for (int i = 0; i < 24; i++) {
        draw(g);
        draw_maps(g);
        draw(other);
        draw_maps(other);
        drawn += i >= 20 ? g->fresh + other->fresh : 0;
    }
    assert_true(g->pages->stats.asked > 16 && other->pages->stats.asked > 16);
    print_message("%u and %u of 16 pages, %u drawn in the last pictures\n", g->pages->stats.hits,
        other->pages->stats.hits, drawn);
    assert_in_range(g->pages->stats.hits, 7, 9);
    assert_in_range(other->pages->stats.hits, 7, 9);
    assert_int_equal(drawn, 0);
    other->held = own;
    close_ground((void **)&other);
}

// Depth that is no number, and cameras far away, ask for nothing that does not exist.
static void test_hostile(void **state)
{
    struct ground *g = *state;
    draw(g);
    for (uint32_t u = 0; u < WIDTH; u++)
        for (uint32_t v = 0; v < HEIGHT; v++)
            g->depth[v][u] = (u + v) % 3 == 0 ? NAN : (u + v) % 3 == 1 ? INFINITY : 1e-30f;
    draw(g);
    assert_true(draw(g)->asked <= HG_SHADOW_PAGE_WORDS);
    const struct hg_box box = {{NAN, NAN, NAN}, {NAN, NAN, NAN}};
    look(g, 0, 0);
    rest(g);
    hg_shadow_pool_touch(g->held, &box); // it could be anywhere
    assert_int_equal(draw(g)->hits, 0);
}

#define GROUND_TEST(name) cmocka_unit_test_setup_teardown(name, open_ground, close_ground)

int main(void)
{
    const struct CMUnitTest tests[] = {GROUND_TEST(test_resolution), GROUND_TEST(test_kept),
        GROUND_TEST(test_maps), GROUND_TEST(test_touched), GROUND_TEST(test_not_drawn),
        GROUND_TEST(test_eviction), GROUND_TEST(test_forgotten), GROUND_TEST(test_shared),
        GROUND_TEST(test_parts), GROUND_TEST(test_hostile)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
