// test_inspect.c - what a viewer's panels and measuring do without a window: nodes folded and
// scrolled, clipping planes, places in window, picture and scene, distances.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "client/view/clipping.h"
#include "client/view/projection.h"
#include "client/view/measure.h"
#include "client/view/tree.h"

static const double pi = 3.14159265358979323846;

// ---- nodes -------------------------------------------------------------------------------------

struct listed {
    uint64_t node, parent;
    const char *name;
};

static enum hg_status make(
    struct hg_tree *t, const struct listed *list, size_t count, struct hg_error *err)
{
    enum hg_status status = HG_OK;
    *t = (struct hg_tree){.total = (uint32_t)count};
    for (size_t i = 0; i < count && !status; i++) {
        const struct hgp_node_entry entry = {.node = list[i].node,
            .parent = list[i].parent,
            .visible = true,
            .name = {list[i].name, (uint32_t)strlen(list[i].name)}};
        status = hg_tree_add(t, &entry, err);
    }
    return status ? status : hg_tree_link(t, err);
}

// The rows as text: two blanks a level.
static void assert_rows(const struct hg_tree *t, const char *wanted)
{
    char text[512] = "";
    for (uint32_t i = 0; i < t->row_count; i++) {
        for (uint32_t d = 0; d < t->rows[i].depth; d++)
            strcat(text, "  ");
        strcat(text, hg_tree_name(t, t->rows[i].node));
        strcat(text, "\n");
    }
    assert_string_equal(text, wanted);
}

// A child may come before its parent.
static const struct listed house[] = {{7, 5, "door"}, {1, 0, "house"}, {5, 1, "wall"},
    {6, 1, "roof"}, {8, 5, "window"}, {9, 8, "pane"}};
enum { HOUSE = sizeof house / sizeof *house };

static void test_fold(void **state)
{
    (void)state;
    struct hg_tree t;
    assert_int_equal(make(&t, house, HOUSE, NULL), HG_OK);
    // The chain of single nodes is open: the house, not what has siblings.
    assert_rows(&t, "house\n  wall\n  roof\n");
    hg_tree_set_open(&t, hg_tree_find(&t, 5), true);
    assert_rows(&t, "house\n  wall\n    door\n    window\n  roof\n");
    hg_tree_set_open(&t, hg_tree_find(&t, 8), true);
    assert_rows(&t, "house\n  wall\n    door\n    window\n      pane\n  roof\n");
    hg_tree_set_open(&t, hg_tree_find(&t, 5), false);
    assert_rows(&t, "house\n  wall\n  roof\n");
    assert_int_equal(hg_tree_row_of(&t, 9), HG_TREE_NONE);
    assert_int_equal(hg_tree_find(&t, 10), HG_TREE_NONE);
    t.nodes[hg_tree_find(&t, 5)].visible = false;
    assert_true(hg_tree_is_hidden(&t, hg_tree_find(&t, 9)));
    assert_false(hg_tree_is_hidden(&t, hg_tree_find(&t, 6)));
    hg_tree_finish(&t);
}

static void test_filter(void **state)
{
    (void)state;
    struct hg_tree t, fresh;
    assert_int_equal(make(&t, house, HOUSE, NULL), HG_OK);
    hg_tree_set_filter(&t, "DO"); // what is above stays, unfolded or not
    assert_rows(&t, "house\n  wall\n    door\n    window\n");
    assert_int_equal(t.matches, 2);
    hg_tree_set_filter(&t, "window");
    assert_rows(&t, "house\n  wall\n    window\n");
    assert_int_equal(make(&fresh, house, HOUSE, NULL), HG_OK);
    hg_tree_carry(&fresh, &t); // of an edited scene
    assert_rows(&fresh, "house\n  wall\n    window\n");
    assert_int_equal(fresh.matches, 1);
    hg_tree_set_filter(&t, "none of them");
    assert_rows(&t, "");
    assert_int_equal(t.matches, 0);
    assert_false(hg_tree_move(&t, 1, 10));
    hg_tree_set_filter(&t, "");
    assert_rows(&t, "house\n  wall\n  roof\n");
    hg_tree_finish(&fresh);
    hg_tree_finish(&t);
    hg_tree_set_filter(&t, "x"); // before nodes are listed
    assert_rows(&t, "");
}

static void test_reveal_and_move(void **state)
{
    (void)state;
    struct hg_tree t;
    assert_int_equal(make(&t, house, HOUSE, NULL), HG_OK);
    hg_tree_reveal(&t, 9, 2);
    assert_rows(&t, "house\n  wall\n    door\n    window\n      pane\n  roof\n");
    assert_int_equal(t.selected, 9);
    assert_int_equal(t.top, 3); // row 4 is the last of two in sight
    assert_true(hg_tree_move(&t, -3, 2));
    assert_int_equal(t.selected, 5);
    assert_int_equal(t.top, 1);
    assert_true(hg_tree_move(&t, 100, 2));
    assert_int_equal(t.selected, 6);
    assert_int_equal(t.top, 4);
    assert_true(hg_tree_move(&t, -100, 2));
    assert_int_equal(t.selected, 1);
    assert_int_equal(t.top, 0);
    hg_tree_scroll(&t, 100, 4);
    assert_int_equal(t.top, 2);
    hg_tree_scroll(&t, -100, 4);
    assert_int_equal(t.top, 0);
    t.selected = 0;
    assert_true(hg_tree_move(&t, 1, 2));
    assert_int_equal(t.selected, 1);
    hg_tree_finish(&t);
    assert_int_equal(make(&t, NULL, 0, NULL), HG_OK);
    assert_false(hg_tree_move(&t, 1, 2));
    hg_tree_finish(&t);
}

static void test_carry(void **state)
{
    (void)state;
    struct hg_tree before, t;
    const struct listed other[] = {
        {20, 0, "new"}, {1, 0, "house"}, {5, 1, "wall"}, {7, 5, "door"}, {21, 20, "\x01\x7f"}};
    assert_int_equal(make(&before, house, HOUSE, NULL), HG_OK);
    hg_tree_reveal(&before, 7, 1);
    assert_int_equal(before.top, 2);
    assert_int_equal(make(&t, other, 5, NULL), HG_OK);
    hg_tree_carry(&t, &before);
    assert_rows(&t, "new\nhouse\n  wall\n    door\n");
    assert_int_equal(t.selected, 7);
    assert_int_equal(t.top, 2);
    assert_string_equal(hg_tree_name(&t, hg_tree_find(&t, 21)), "??");
    hg_tree_finish(&before);
    hg_tree_finish(&t);
}

// What no honest server lists.
static void test_bad_lists(void **state)
{
    (void)state;
    struct hg_tree t;
    const struct listed bad[] = {{1, 2, "a"}, {2, 1, "b"}, {3, 3, "self"}, {4, 99, "orphan"},
        {4, 0, "twin"}, {6, 1, "below"}, {7, 0, ""}};
    assert_int_equal(make(&t, bad, 7, NULL), HG_OK);
    assert_rows(&t, "self\norphan\ntwin\nnode 7\n");
    hg_tree_reveal(&t, 6, 3);
    assert_int_equal(hg_tree_row_of(&t, 6), HG_TREE_NONE);
    assert_false(hg_tree_is_hidden(&t, hg_tree_find(&t, 6)));
    hg_tree_finish(&t);
}

static void test_memory(void **state)
{
    (void)state;
    struct hg_tree t;
    for (uint64_t n = 1;; n++) {
        struct hg_error err = {0};
        hg_alloc_fail_at(n);
        const enum hg_status status = make(&t, house, HOUSE, &err);
        hg_alloc_fail_at(0);
        assert_false(hg_tree_move(&t, 1, 1) && status);
        hg_tree_finish(&t);
        if (!status) {
            assert_true(n > 3); // names, nodes, places and rows
            return;
        }
        assert_int_equal(status, HG_E_NOMEM);
        assert_string_equal(err.what, "scene tree");
    }
}

// ---- clipping planes ---------------------------------------------------------------------------

static bool is_shown(const struct hg_clipping_list *planes, float x, float y, float z)
{
    for (uint32_t i = 0; i < planes->count; i++) {
        const struct hgp_clip_plane *p = &planes->items[i];
        if (p->normal[0] * x + p->normal[1] * y + p->normal[2] * z < p->distance)
            return false;
    }
    return true;
}

static void test_cuts(void **state)
{
    (void)state;
    struct hg_clipping c = {.caps = HGP_cap_style_HATCH};
    struct hg_clipping_list planes;
    char text[16];
    const float min[3] = {-2, 10, 0}, max[3] = {2, 30, 8};
    hg_clipping_reset(&c, true, min, max);
    assert_int_equal(c.caps, HGP_cap_style_HATCH);
    hg_clipping_planes(&c, &planes);
    assert_int_equal(planes.count, 0);
    hg_clipping_set_share(&c, 0, 0.75);
    hg_clipping_set_share(&c, 2, 0.25);
    assert_float_equal(hg_clipping_position(&c, 0), 1, 1e-9);
    assert_float_equal(hg_clipping_position(&c, 2), 2, 1e-9);
    c.axes[2].is_flipped = true;
    hg_clipping_planes(&c, &planes);
    assert_int_equal(planes.count, 2);
    assert_true(is_shown(&planes, 0.9F, 20, 2.1F));
    assert_false(is_shown(&planes, 1.1F, 20, 2.1F));
    assert_false(is_shown(&planes, 0.9F, 20, 1.9F));
    hg_clipping_text(&c, text, sizeof text);
    assert_string_equal(text, "x, z");
    hg_clipping_set_share(&c, 1, 7);
    assert_float_equal(hg_clipping_position(&c, 1), 30, 1e-9);
    hg_clipping_set_share(&c, 1, (double)NAN);
    assert_float_equal(hg_clipping_position(&c, 1), 10, 1e-9);
    const float inside_out[3] = {-3, 10, 0};
    hg_clipping_reset(&c, true, min, inside_out);
    c.axes[0].is_on = true;
    hg_clipping_planes(&c, &planes);
    assert_int_equal(planes.count, 0);
    hg_clipping_text(&c, text, sizeof text);
    assert_string_equal(text, "");
}

static void test_caps(void **state)
{
    (void)state;
    struct hg_clipping c = {0};
    const char *seen[4];
    for (int i = 0; i < 4; i++) {
        seen[i] = hg_clipping_caps_name(&c);
        for (int k = 0; k < i; k++)
            assert_string_not_equal(seen[i], seen[k]);
        hg_clipping_next_caps(&c, false);
    }
    assert_int_equal(c.caps, HGP_cap_style_MATERIAL);
    hg_clipping_next_caps(&c, true);
    assert_string_equal(hg_clipping_caps_name(&c), seen[3]);
}

// ---- places ------------------------------------------------------------------------------------

static void test_pixels(void **state)
{
    (void)state;
    uint32_t pixel[2];
    // A picture of 200 x 100 in a window of 400 x 400: twice as large, 100 px from the top.
    const struct hg_projection_rect r = hg_projection_picture(200, 100, 400, 400);
    assert_int_equal(r.x, 0);
    assert_int_equal(r.y, 100);
    assert_int_equal(r.width, 400);
    assert_int_equal(r.height, 200);
    assert_true(hg_projection_pixel(&r, 200, 100, 399, 100, pixel));
    assert_int_equal(pixel[0], 199);
    assert_int_equal(pixel[1], 0);
    assert_true(hg_projection_pixel(&r, 200, 100, 3, 299, pixel));
    assert_int_equal(pixel[0], 1);
    assert_int_equal(pixel[1], 99);
    assert_false(hg_projection_pixel(&r, 200, 100, 3, 300, pixel));
    assert_false(hg_projection_pixel(&r, 200, 100, 3, 99, pixel));
    assert_false(hg_projection_pixel(&r, 200, 100, -1, 150, pixel));
    const struct hg_projection_rect tall = hg_projection_picture(100, 400, 400, 200);
    assert_int_equal(tall.width, 50);
    assert_int_equal(tall.x, 175);
}

static struct hg_projection_view look(enum hgp_camera_kind kind)
{
    const struct hg_projection_rect rect = {10, 20, 200, 100};
    const struct hgp_view_camera camera = {.eye = {0, 0, 5},
        .target = {0, 0, 0},
        .has_kind = true,
        .kind = kind,
        .has_vfov_rad = true,
        .vfov_rad = (float)(pi / 2),
        .has_half_height = true,
        .half_height = 2};
    struct hg_projection_view view;
    assert_true(hg_projection_look(&view, &camera, &rect));
    return view;
}

static void test_points(void **state)
{
    (void)state;
    double at[3];
    struct hg_projection_view view = look(HGP_camera_kind_PERSPECTIVE);
    // Half the height is 50 px, and 4 m at a depth of 4 m.
    assert_true(hg_projection_point(&view, (const double[]){2, 1, 1}, at));
    assert_float_equal(at[0], 110 + 25, 1e-4);
    assert_float_equal(at[1], 70 - 12.5, 1e-4);
    assert_float_equal(at[2], 4, 1e-6);
    assert_false(hg_projection_point(&view, (const double[]){0, 0, 5.5}, at));
    view = look(HGP_camera_kind_ORTHOGRAPHIC);
    assert_true(hg_projection_point(&view, (const double[]){2, 1, -100}, at));
    assert_float_equal(at[0], 110 + 50, 1e-4);
    assert_float_equal(at[1], 70 - 25, 1e-4);
    struct hgp_view_camera down = {.eye = {0, 3, 0}, .target = {0, 0, 0}};
    const struct hg_projection_rect rect = {0, 0, 10, 10};
    assert_true(hg_projection_look(&view, &down, &rect)); // along the up direction
    assert_true(hg_projection_point(&view, (const double[]){0, 0, 0}, at));
    assert_float_equal(at[0], 5, 1e-6);
    memcpy(down.eye, down.target, sizeof down.eye);
    assert_false(hg_projection_look(&view, &down, &rect));
}

static void test_segments(void **state)
{
    (void)state;
    double from[2], to[2];
    const struct hg_projection_view view = look(HGP_camera_kind_PERSPECTIVE);
    const double seen[3] = {1, 0, 1}, behind[3] = {1, 0, 9};
    assert_true(hg_projection_segment(&view, seen, (const double[]){-1, 0, 1}, from, to));
    assert_float_equal(from[0], 122.5, 1e-4);
    assert_float_equal(to[0], 97.5, 1e-4);
    // Parallel to the line of sight: what is cut off lies in the direction away from the middle.
    assert_true(hg_projection_segment(&view, seen, behind, from, to));
    assert_float_equal(from[0], 122.5, 1e-4);
    assert_true(to[0] > 1000);
    assert_float_equal(to[1], 70, 1e-4);
    assert_true(hg_projection_segment(&view, behind, seen, from, to));
    assert_float_equal(to[0], 122.5, 1e-4);
    assert_false(hg_projection_segment(&view, behind, (const double[]){2, 0, 9}, from, to));
}

// ---- distances ---------------------------------------------------------------------------------

static void test_ruler(void **state)
{
    (void)state;
    struct hg_measure r = {0};
    const float a[3] = {1, 2, 3}, b[3] = {1, 5, 7}, up[3] = {0, 1, 0}, right[3] = {2, 0, 0};
    const float none[3] = {0};
    hg_measure_add(&r, a, up);
    assert_float_equal(hg_measure_distance(&r), 0, 0);
    hg_measure_add(&r, b, right);
    assert_float_equal(hg_measure_distance(&r), 5, 1e-9);
    assert_float_equal(hg_measure_angle_deg(&r), 90, 1e-9);
    hg_measure_add(&r, b, up);
    assert_int_equal(r.count, 1);
    hg_measure_add(&r, b, none);
    assert_float_equal(hg_measure_distance(&r), 0, 0);
    assert_float_equal(hg_measure_angle_deg(&r), 0, 0);
}

static void test_lengths(void **state)
{
    (void)state;
    static const struct {
        double metres;
        const char *text;
    } rows[] = {{0, "0.000 m"}, {2, "2.000 m"}, {-1.5, "-1.500 m"}, {0.25, "25.00 cm"},
        {0.0125, "1.25 cm"}, {0.0004, "0.400 mm"}, {12345, "12.345 km"}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        char text[32];
        hg_measure_text(rows[i].metres, text, sizeof text);
        assert_string_equal(text, rows[i].text);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_fold),
        cmocka_unit_test(test_filter),
        cmocka_unit_test(test_reveal_and_move),
        cmocka_unit_test(test_carry),
        cmocka_unit_test(test_bad_lists),
        cmocka_unit_test(test_memory),
        cmocka_unit_test(test_cuts),
        cmocka_unit_test(test_caps),
        cmocka_unit_test(test_pixels),
        cmocka_unit_test(test_points),
        cmocka_unit_test(test_segments),
        cmocka_unit_test(test_ruler),
        cmocka_unit_test(test_lengths),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
