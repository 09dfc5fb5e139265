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

// Every corner of the box lies inside the picture, and at least one near its edge.
static void check_fit(const float min[3], const float max[3], double vfov_rad, double aspect)
{
    struct hgp_view_camera c = {0};
    helio_camera_fit(min, max, vfov_rad, aspect, &c);
    double f[3], r[3], u[3], most = 0, length = 0;
    for (int i = 0; i < 3; i++)
        f[i] = (double)c.target[i] - (double)c.eye[i];
    length = sqrt(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
    for (int i = 0; i < 3; i++)
        f[i] /= length;
    double n = sqrt(f[2] * f[2] + f[0] * f[0]); // r = f x (0,1,0)
    r[0] = -f[2] / n, r[1] = 0, r[2] = f[0] / n;
    u[0] = r[1] * f[2] - r[2] * f[1];
    u[1] = r[2] * f[0] - r[0] * f[2];
    u[2] = r[0] * f[1] - r[1] * f[0];
    assert_true(c.eye[1] >= c.target[1] && c.eye[2] >= c.target[2]);
    for (int corner = 0; corner < 8; corner++) {
        double x = 0, y = 0, z = 0;
        for (int i = 0; i < 3; i++) {
            double d = (double)(corner >> i & 1 ? max[i] : min[i]) - (double)c.eye[i];
            x += d * r[i];
            y += d * u[i];
            z += d * f[i];
        }
        assert_true(z > 0);
        double nx = fabs(x / z / tan(vfov_rad / 2) / aspect), ny = fabs(y / z / tan(vfov_rad / 2));
        assert_true(nx < 1 && ny < 1);
        most = fmax(most, fmax(nx, ny));
    }
    assert_true(most > 0.9 || length <= 1.001);
}

static void test_fit(void **state)
{
    (void)state;
    const double fov = 45 * 3.14159265358979323846 / 180;
    check_fit((float[3]){-1, -1, -1}, (float[3]){1, 1, 1}, fov, 16.0 / 9);
    check_fit((float[3]){-1, -1, -1}, (float[3]){1, 1, 1}, fov, 0.25);
    check_fit((float[3]){-100, 0, -1}, (float[3]){100, 1, 1}, fov, 1);
    check_fit((float[3]){0, 0, -50}, (float[3]){1, 300, 80}, 2.0, 1.5);
    check_fit((float[3]){5, 5, 5}, (float[3]){5, 5, 5}, fov, 1); // a point
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_orbit),
        cmocka_unit_test(test_orbit_radius_zero),
        cmocka_unit_test(test_orbit_poles),
        cmocka_unit_test(test_fit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
