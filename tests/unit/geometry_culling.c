// geometry_culling.c - culling on the host never drops a draw that is on the screen. Pictures:
// cull_views.c.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/log.h"
#include "geometry_device.h"
#include "renderer/math/frustum.h"
#include "renderer/cull/culling.h"

static bool draw_is_listed(const struct hg_culling *v, uint32_t set, uint32_t draw)
{
    const struct hg_culling_set *s = hg_culling_set(v, set);
    for (uint32_t i = 0; i < s->item_count; i++) {
        const struct hg_culling_item *item = hg_culling_item(v, s->first_item + i);
        if (draw - item->first_draw < item->draw_count)
            return true;
    }
    return false;
}

// Culling never drops a draw that has a corner on the screen, and does drop what is outside.
static void test_culling(void **state)
{
    struct geo *f = *state;
    struct hg_scene *scene;
    struct hg_geometry *g;
    geo_check(f, hg_scene_create(&scene));
    geo_check(f, hg_geometry_create(f->gpu, NULL, &g, &f->err));
    struct hg_mesh *mesh = geo_add_mesh(f, scene, 1);
    for (uint64_t i = 0; i < 400; i++) {
        struct hg_node *node = geo_add_node(f, scene, i + 1, mesh);
        for (int c = 0; c < 3; c++) {
            node->translation[c] = (float)geo_random(f, -60, 60);
            node->scale[c] = (float)geo_random(f, 0.1, 2);
        }
    }
    geo_sync(f, g, scene);
    struct hg_culling *v;
    geo_check(f, hg_culling_create(f->gpu, &v, &f->err));
    const struct hg_culling_view off = {.plane_count = 0};
    geo_check(f, hg_culling_add(v, g, &off, NULL, &f->err));
    assert_int_equal(hg_culling_set(v, 0)->item_count, 1); // instances of one part are one item
    assert_int_equal(hg_culling_item(v, 0)->draw_count, 400);
    const double eye[3] = {0, 0, 0}, target[3] = {1, 0.2, 0.4}, origin[3] = {0};
    const struct geo_eye e = geo_look_at(eye, target, false);
    struct hg_gpu_camera camera = {0};
    geo_fill_camera(&e, origin, &camera);
    struct hg_culling_view cull = {.both_sides = true};
    cull.plane_count = hg_frustum_planes(camera.view_proj.m, cull.planes);
    assert_int_equal(cull.plane_count, 5); // the far plane is at infinity
    geo_check(f, hg_culling_add(v, g, &cull, NULL, &f->err));
    uint32_t must = 0;
    for (uint32_t d = 0; d < g->draw_count; d++) {
        bool on_screen = false;
        for (uint32_t t = 0; t < TRIANGLES && !on_screen; t++) {
            double p[3][3], pixel[2];
            uint32_t index[3];
            geo_corners(g->draws[d].node, t, p, index);
            for (int k = 0; k < 3; k++)
                on_screen = on_screen || geo_project(&e, p[k], pixel);
        }
        must += on_screen;
        if (on_screen)
            assert_true(draw_is_listed(v, 1, d));
    }
    uint32_t listed = 0;
    for (uint32_t d = 0; d < g->draw_count; d++)
        listed += draw_is_listed(v, 1, d);
    print_message("%u draws have corners on the screen, %u are drawn, of 400\n", must, listed);
    assert_true(must > 10 && listed < 200);
    hg_culling_destroy(v);
    hg_geometry_destroy(g);
    hg_scene_destroy(scene);
}

int main(void)
{
    hg_log_set_sink(hg_log_sink_logfmt, (void *)(intptr_t)2);
    hg_log_set_level(HG_LOG_WARN);
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_culling)};
    return cmocka_run_group_tests(tests, geo_setup, geo_teardown);
}
