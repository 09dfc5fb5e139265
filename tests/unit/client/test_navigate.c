// test_navigate.c - the controls of viewers: what they must keep, and closed forms.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "client/view/navigate.h"

static const double pi = 3.14159265358979323846;
static const double height = 720;

static struct hg_navigate stand(enum hg_navigate_style style)
{
    struct hg_navigate n = {.style = style};
    const float eye[3] = {0, 0, 4}, target[3] = {0, 0, 0};
    hg_navigate_look(&n, eye, target, NULL);
    hg_navigate_set_size(&n, 2);
    return n;
}

static void seen(const struct hg_navigate *n, double eye[3], double target[3])
{
    struct hgp_view_camera camera = {0};
    hg_navigate_camera(n, &camera);
    assert_true(camera.has_eye && camera.has_target && camera.has_up && !camera.has_camera);
    for (int i = 0; i < 3; i++) {
        eye[i] = camera.eye[i];
        target[i] = camera.target[i];
    }
}

static void assert_near3(const double a[3], double x, double y, double z)
{
    const double b[3] = {x, y, z};
    for (int i = 0; i < 3; i++)
        if (fabs(a[i] - b[i]) > 1e-5)
            fail_msg("component %d is %.9g, not %.9g", i, a[i], b[i]);
}

static double distance(const double a[3], const double b[3])
{
    return sqrt(pow(a[0] - b[0], 2) + pow(a[1] - b[1], 2) + pow(a[2] - b[2], 2));
}

static void test_look(void **state)
{
    (void)state;
    double eye[3], target[3];
    struct hg_navigate n = stand(HG_NAVIGATE_ORBIT);
    seen(&n, eye, target);
    assert_near3(eye, 0, 0, 4);
    assert_near3(target, 0, 0, 0);
    const float other_eye[3] = {3, 5, -2}, other_target[3] = {-1, 4, 7};
    hg_navigate_look(&n, other_eye, other_target, NULL);
    seen(&n, eye, target);
    assert_near3(eye, 3, 5, -2);
    assert_near3(target, -1, 4, 7);
    // What is no direction changes nothing.
    const float nan_eye[3] = {NAN, 0, 0};
    hg_navigate_look(&n, other_eye, other_eye, NULL);
    hg_navigate_look(&n, nan_eye, other_eye, NULL);
    seen(&n, eye, target);
    assert_near3(eye, 3, 5, -2);
    assert_near3(target, -1, 4, 7);
}

static void test_straight_down_keeps_the_picture_upright(void **state)
{
    (void)state;
    double eye[3], target[3];
    struct hg_navigate n = {0};
    const float above[3] = {0, 9, 0}, origin[3] = {0, 0, 0};
    const struct hgp_view_camera camera = {.has_up = true, .up = {1, 0, 0}};
    hg_navigate_look(&n, above, origin, &camera);
    seen(&n, eye, target);
    assert_near3(eye, 0, 9, 0);
    // The line of sight leans a thousandth towards what was up.
    assert_true(target[0] - eye[0] > 1e-3 && fabs(target[2] - eye[2]) < 1e-5);
}

static void test_orbit_turns_about_the_target(void **state)
{
    (void)state;
    double eye[3], target[3];
    struct hg_navigate n = stand(HG_NAVIGATE_ORBIT);
    hg_navigate_drag(&n, height / 2, 0, height); // a quarter turn: the scene goes to the right
    seen(&n, eye, target);
    assert_near3(eye, -4, 0, 0);
    assert_near3(target, 0, 0, 0);
    hg_navigate_drag(&n, -height / 2, 0, height);
    hg_navigate_drag(&n, 0, height / 6, height); // 30 degrees up
    seen(&n, eye, target);
    assert_near3(eye, 0, 2, 4 * cos(pi / 6));
    assert_near3(target, 0, 0, 0);
    for (int i = 0; i < 1000; i++) { // never over the pole, never away
        hg_navigate_drag(&n, 13.7, 91, height);
        seen(&n, eye, target);
        assert_true(fabs(distance(eye, target) - 4) < 1e-4);
        assert_true(distance(target, (double[3]){0, 0, 0}) < 1e-4);
    }
    assert_true(eye[1] < 4 && eye[1] > 3.99);
}

static void test_wheel(void **state)
{
    (void)state;
    double eye[3], target[3];
    struct hg_navigate n = stand(HG_NAVIGATE_ORBIT);
    hg_navigate_wheel(&n, 1);
    seen(&n, eye, target);
    assert_near3(eye, 0, 0, 3.6);
    hg_navigate_wheel(&n, -1);
    seen(&n, eye, target);
    assert_near3(eye, 0, 0, 4);
    hg_navigate_wheel(&n, 1e9); // as near as it gets: still a direction
    seen(&n, eye, target);
    assert_true(eye[2] > 0 && eye[2] < 1e-3);
    n = stand(HG_NAVIGATE_FLY);
    hg_navigate_wheel(&n, 2); // a tenth of the scene's radius each
    seen(&n, eye, target);
    assert_near3(eye, 0, 0, 4 - 2 * 2 * 0.05);
    assert_true(fabs(distance(eye, target) - 4) < 1e-5);
}

static void test_pan_follows_the_pointer(void **state)
{
    (void)state;
    double eye[3], target[3];
    struct hg_navigate n = stand(HG_NAVIGATE_ORBIT);
    // The picture shows 2 * 4 * tan(22.5 degrees) m of the plane of the target.
    const double metres = 2 * 4 * tan(pi / 8) / height;
    hg_navigate_pan(&n, 100, 50, height);
    seen(&n, eye, target);
    assert_near3(target, -100 * metres, 50 * metres, 0);
    assert_near3(eye, -100 * metres, 50 * metres, 4);
}

static void test_fly_looks_around(void **state)
{
    (void)state;
    double eye[3], target[3];
    struct hg_navigate n = stand(HG_NAVIGATE_FLY);
    hg_navigate_drag(&n, height, 0, height); // a height of the picture = the field of view
    seen(&n, eye, target);
    assert_near3(eye, 0, 0, 4);
    assert_near3(target, 4 * sin(pi / 4), 0, 4 - 4 * cos(pi / 4));
    hg_navigate_drag(&n, 0, -1e6, height);
    seen(&n, eye, target);
    assert_near3(eye, 0, 0, 4);
    assert_true(target[1] > 3.9999 && target[1] <= 4);
}

static void test_moves(void **state)
{
    (void)state;
    double eye[3], target[3];
    const struct hg_navigate_wish none = {0}, forward = {.forward = 1, .fast = 1};
    struct hg_navigate n = stand(HG_NAVIGATE_FLY);
    assert_false(hg_navigate_move(&n, &none, 0.1));
    assert_false(hg_navigate_move(&n, &forward, 0));
    hg_navigate_drag(&n, 0, -height, height); // 45 degrees up
    assert_true(hg_navigate_move(&n, &forward, 0.1));
    const double way = 0.1 * 2 * 0.6;
    seen(&n, eye, target);
    assert_near3(eye, 0, way * sin(pi / 4), 4 - way * cos(pi / 4));
    n.style = HG_NAVIGATE_WALK;
    assert_true(hg_navigate_move(&n, &forward, 0.1)); // the height stays
    const double before = eye[1];
    seen(&n, eye, target);
    assert_near3(eye, 0, before, 4 - way * cos(pi / 4) - way);
    assert_true(hg_navigate_move(&n, &forward, 60)); // a stall is no leap
    const double was = eye[2];
    seen(&n, eye, target);
    assert_true(fabs(was - eye[2] - 2.5 * way) < 1e-5);
}

static void test_orbit_by_keys(void **state)
{
    (void)state;
    double eye[3], target[3];
    struct hg_navigate n = stand(HG_NAVIGATE_ORBIT);
    assert_true(hg_navigate_move(&n, &(struct hg_navigate_wish){.turn = 1}, 0.25));
    seen(&n, eye, target);
    assert_near3(target, 0, 0, 0);
    assert_near3(eye, 4 * sin(0.4), 0, 4 * cos(0.4)); // to the right, 1.6 rad a second
    assert_true(hg_navigate_move(&n, &(struct hg_navigate_wish){.forward = 1}, 0.25));
    seen(&n, eye, target);
    assert_true(fabs(distance(eye, target) - 4 * pow(0.4, 0.25)) < 1e-5);
}

static void test_centre(void **state)
{
    (void)state;
    double eye[3], target[3];
    struct hg_navigate n = stand(HG_NAVIGATE_ORBIT);
    const float point[3] = {3, 0, 0}, far[3] = {INFINITY, 0, 0};
    hg_navigate_centre(&n, point);
    seen(&n, eye, target);
    assert_near3(target, 3, 0, 0);
    assert_near3(eye, 3, 0, 5);
    hg_navigate_centre(&n, far);
    seen(&n, eye, target);
    assert_near3(target, 3, 0, 0);
}

static void test_orthographic(void **state)
{
    (void)state;
    struct hg_navigate n = {0};
    const float eye[3] = {0, 0, 9}, target[3] = {0, 0, 0};
    const struct hgp_view_camera camera = {.has_kind = true,
        .kind = HGP_camera_kind_ORTHOGRAPHIC,
        .has_half_height = true,
        .half_height = 3};
    struct hgp_view_camera out = {0};
    hg_navigate_look(&n, eye, target, &camera);
    hg_navigate_wheel(&n, 1);
    hg_navigate_pan(&n, height, 0, height); // a height = 2 half heights
    hg_navigate_camera(&n, &out);
    assert_int_equal(out.kind, HGP_camera_kind_ORTHOGRAPHIC);
    assert_true(fabs((double)out.half_height - 2.7) < 1e-5);
    assert_true(fabs((double)out.target[0] + 5.4) < 1e-5);
}

static void test_axis(void **state)
{
    (void)state;
    assert_true(hg_navigate_axis(0) == 0 && hg_navigate_axis(4000) == 0);
    assert_true(hg_navigate_axis(-4000) == 0);
    assert_true(hg_navigate_axis(32767) == 1 && hg_navigate_axis(-32768) == -1);
    assert_true(hg_navigate_axis(20000) > 0 && hg_navigate_axis(20000) < 20000 / 32767.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_look),
        cmocka_unit_test(test_straight_down_keeps_the_picture_upright),
        cmocka_unit_test(test_orbit_turns_about_the_target),
        cmocka_unit_test(test_wheel),
        cmocka_unit_test(test_pan_follows_the_pointer),
        cmocka_unit_test(test_fly_looks_around),
        cmocka_unit_test(test_moves),
        cmocka_unit_test(test_orbit_by_keys),
        cmocka_unit_test(test_centre),
        cmocka_unit_test(test_orthographic),
        cmocka_unit_test(test_axis),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
