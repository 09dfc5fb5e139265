// gtao.c - ambient occlusion from depth against closed forms: planes, a wall on a floor, a corner.
#include <math.h>

#include "tests/analytic/probe.h"

enum { POINTS = 6 };

static void run(
    struct probe *probe, float height, const struct hg_vec4 in[POINTS], struct hg_vec4 out[POINTS])
{
    struct hg_vec4 source[POINTS + 1] = {{height, 0, 0, 0}};
    const struct probe_dispatch dispatch = {.shader = "gtao.comp", .count = POINTS};
    for (int i = 0; i < POINTS; i++)
        source[i + 1] = in[i];
    probe_run_shader(probe, &dispatch, source, POINTS + 1, out, POINTS);
}

// Of a plane nothing is occluded, wherever it is seen, and the mean direction is its normal.
static void test_plane(void **state)
{
    static const struct hg_vec4 in[POINTS] = {{0, -1, -2, 0.5f}, {1, -1, -2.5f, 0.5f},
        {-0.5f, -1, -1.5f, 0.2f}, {0, -1, -3, 1}, {2, -1, -3, 0.5f}, {-2, -1, -2.2f, 1}};
    struct hg_vec4 out[POINTS];
    run(*state, 0, in, out);
    for (int i = 0; i < POINTS; i++) {
        probe_near(out[i].w, 1, 0.03);
        probe_near(out[i].y, 1, 0.01);
    }
}

// Before a wall of height h, at the distance d, a part of (1 - d / sqrt(d^2 + h^2)) / 2 is hidden
// (form factor of a long wall); a half where they meet. What is hidden bends the direction away
// from the wall.
static void test_wall(void **state)
{
    static const float distance[POINTS] = {0.03f, 0.1f, 0.2f, 0.3f, 0.5f, 0.8f};
    static const float height = 0.3f;
    struct hg_vec4 in[POINTS], out[POINTS];
    for (int i = 0; i < POINTS; i++)
        in[i] = (struct hg_vec4){0.05f * (float)i, -1, -4 + distance[i], 3};
    run(*state, height, in, out);
    for (int i = 0; i < POINTS; i++) {
        const double d = (double)distance[i], h = (double)height;
        probe_near(out[i].w, 0.5 + 0.5 * d / sqrt(d * d + h * h), 0.02);
        assert_true(out[i].z > 0.01f && out[i].y > 0.6f && fabsf(out[i].x) < 0.1f);
    }
}

// What is farther away than the radius does not count; what is within its half does wholly.
static void test_radius(void **state)
{
    static const float radius[POINTS] = {0.05f, 0.08f, 0.1f, 1, 2, 3};
    struct hg_vec4 in[POINTS], out[POINTS];
    for (int i = 0; i < POINTS; i++)
        in[i] = (struct hg_vec4){0, -1, -3.9f, radius[i]};
    run(*state, 0.3f, in, out);
    for (int i = 0; i < 3; i++)
        probe_near(out[i].w, 1, 0.01);
    for (int i = 3; i < POINTS; i++)
        probe_near(out[i].w, 0.5 + 0.5 * 0.1 / sqrt(0.01 + 0.09), 0.02);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_plane), cmocka_unit_test(test_wall), cmocka_unit_test(test_radius)};
    return cmocka_run_group_tests(tests, probe_setup, probe_teardown);
}
