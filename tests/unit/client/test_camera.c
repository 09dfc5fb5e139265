// Orbit and fit cameras against values computed by hand.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>

#include "client/include/helio/helio.h"

static void assert_near(const float got[3], double x, double y, double z)
{
    assert_true(fabs(got[0] - x) < 1e-6 * fmax(1, fabs(x)));
    assert_true(fabs(got[1] - y) < 1e-6 * fmax(1, fabs(y)));
    assert_true(fabs(got[2] - z) < 1e-6 * fmax(1, fabs(z)));
}

static void test_orbit(void **state)
{
    (void)state;
    struct hgp_view_camera c = {0};
    const double origin[3] = {0, 0, 0}, target[3] = {1, 2, 3};
    helio_camera_orbit(0, 90, 1, origin, &c); // on +Z, level
    assert_near(c.eye, 0, 0, 1);
    assert_near(c.target, 0, 0, 0);
    assert_near(c.up, 0, 1, 0);
    helio_camera_orbit(90, 90, 2, origin, &c); // on +X
    assert_near(c.eye, 2, 0, 0);
    helio_camera_orbit(-90, 90, 2, target, &c); // on -X of the target
    assert_near(c.eye, -1, 2, 3);
    assert_near(c.target, 1, 2, 3);
    // sin 60 = 0.8660254037844386, sin 30 = 0.5, cos 60 = 0.5, cos 30 = 0.8660254037844386
    helio_camera_orbit(30, 60, 5, origin, &c);
    assert_near(c.eye, 2.165063509461097, 2.5, 3.75);
    // sin 75 = 0.9659258262890683, cos 75 = 0.2588190451025207
    helio_camera_orbit(0, 75, 12, origin, &c);
    assert_near(c.eye, 0, 3.105828541230249, 11.59110991546882);
}

static void test_orbit_radius_zero(void **state)
{
    (void)state;
    struct hgp_view_camera c = {0};
    const double target[3] = {0, 1, 0};
    helio_camera_orbit(90, 90, 0, target, &c); // stands at the target, looks to -X
    assert_near(c.eye, 0, 1, 0);
    assert_near(c.target, -1, 1, 0);
}

static void test_orbit_poles(void **state)
{
    (void)state;
    struct hgp_view_camera c = {0};
    const double origin[3] = {0, 0, 0};
    helio_camera_orbit(0, 0, 4, origin, &c); // from straight above: the picture's top is -Z
    assert_near(c.eye, 0, 4, 0);
    assert_near(c.up, 0, 0, -1);
    helio_camera_orbit(90, 180, 4, origin, &c); // from straight below
    assert_near(c.eye, 0, -4, 0);
    assert_near(c.up, 1, 0, 0);
    helio_camera_orbit(0, 0.001, 4, origin, &c); // beside the pole nothing jumps
    assert_near(c.up, 0, 1, 0);
}

static void test_named_views(void **state)
{
    (void)state;
    double azimuth = 7, elevation = 7;
    assert_false(helio_view_angles("side", &azimuth, &elevation));
    assert_true(azimuth == 7 && elevation == 7);
    assert_true(helio_view_angles("left", &azimuth, &elevation));
    assert_true(azimuth == -90 && elevation == 0);
    assert_true(helio_view_angles("bottom", &azimuth, &elevation));
    assert_true(azimuth == 0 && elevation == -90);
    // Isometric: the three axes have the same length in the picture.
    assert_true(helio_view_angles("iso", &azimuth, &elevation));
    assert_true(azimuth == 45);
    assert_true(fabs(tan(elevation * 3.14159265358979323846 / 180) - sqrt(0.5)) < 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_orbit),
        cmocka_unit_test(test_orbit_radius_zero),
        cmocka_unit_test(test_orbit_poles),
        cmocka_unit_test(test_named_views),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
