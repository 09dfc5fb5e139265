// gi_walls.c - what is next to a probe hides what lies behind it, if it is a wall.
#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "renderer/gi/walls.h"
#include "renderer/math/vec.h"

enum { RAYS = 64 };

// A plane by its normal and its distance from the probe at the origin, as far as `radius` around
// the foot of the perpendicular; metres.
struct disc {
    float normal[3], distance, radius;
};

// Rays from the origin to all sides (spherical Fibonacci points). Returns the nearest hit.
static const struct hg_gi_ray *cast(
    const struct disc *discs, int count, struct hg_gi_ray rays[RAYS])
{
    const struct hg_gi_ray *nearest = NULL;
    for (int i = 0; i < RAYS; i++) {
        struct hg_gi_ray *ray = &rays[i];
        const float z = 1 - (2 * (float)i + 1) / RAYS, turn = 2.3999632f * (float)i;
        *ray = (struct hg_gi_ray){.distance = FLT_MAX,
            .direction = {sqrtf(1 - z * z) * cosf(turn), sqrtf(1 - z * z) * sinf(turn), z}};
        for (int k = 0; k < count; k++) {
            const struct disc *d = &discs[k];
            const float towards = -hg_dot3(d->normal, ray->direction);
            const float t = d->distance / towards;
            if (!(towards > 0) || t >= ray->distance ||
                t * t - d->distance * d->distance > d->radius * d->radius)
                continue;
            ray->distance = t;
            hg_copy3(d->normal, ray->normal);
        }
        if (ray->distance < FLT_MAX && (nearest == NULL || ray->distance < nearest->distance))
            nearest = ray;
    }
    return nearest;
}

static struct hg_gi_wall wall_of(const struct disc *discs, int count, float spacing)
{
    struct hg_gi_ray rays[RAYS];
    struct hg_gi_wall wall;
    const struct hg_gi_ray *nearest = cast(discs, count, rays);
    hg_gi_wall_find(nearest, rays, RAYS, spacing, &wall);
    return wall;
}

static void test_wall(void **state)
{
    (void)state;
    static const float axes[6][3] = {
        {1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}};
    for (int i = 0; i < 6; i++) {
        struct disc d = {.distance = 0.6f, .radius = 100};
        hg_copy3(axes[i], d.normal);
        const struct hg_gi_wall wall = wall_of(&d, 1, 2);
        assert_true(fabsf(hg_dot3(wall.normal, d.normal) - 1) < 1e-6f); // axes are exact
        assert_true(fabsf(wall.distance - 0.3f) <= 0.5f / HG_PROBE_WALL_STEPS + 1e-6f);
        float before[3], behind[3];
        for (int a = 0; a < 3; a++) { // also far to a side
            before[a] = -0.5f * axes[i][a] + 1.5f * axes[(i + 2) % 6][a];
            behind[a] = -0.75f * axes[i][a] + 1.5f * axes[(i + 2) % 6][a];
        }
        assert_false(hg_gi_wall_hides(&wall, before, 2));
        assert_true(hg_gi_wall_hides(&wall, behind, 2));
    }
}

// Any direction: by rounding less than 7 degrees off, which points before the wall, lifted by 0.15
// spacings, are not hidden by.
static void test_directions(void **state)
{
    (void)state;
    struct hg_gi_ray rays[RAYS];
    float worst = 1;
    cast(NULL, 0, rays);
    for (int i = 0; i < RAYS; i++) {
        struct disc d = {.distance = 0.2f, .radius = 100};
        hg_copy3(rays[i].direction, d.normal);
        const struct hg_gi_wall wall = wall_of(&d, 1, 1);
        assert_true(wall.code != HG_GI_NO_WALL && wall.code >> (3 * HG_PROBE_BITS) == 0);
        worst = fminf(worst, hg_dot3(wall.normal, d.normal));
    }
    print_message("at most %.2f degrees off\n", (double)acosf(worst) * 180 / HG_PI);
    assert_true(worst > 0.9925f);
}

static void test_no_wall(void **state)
{
    (void)state;
    const float behind[3] = {-0.9f, 0, 0};
    // A small thing, behind which there is more; beyond the reach of lookups that does not count.
    struct disc leg[2] = {{{1, 0, 0}, 0.2f, 0.1f}, {{1, 0, 0}, 1, 100}};
    struct hg_gi_wall wall = wall_of(leg, 2, 1);
    assert_true(wall.code == HG_GI_NO_WALL && !hg_gi_wall_hides(&wall, behind, 1));
    leg[0].radius = 1; // rays that pass it meet what is 2.2 spacings away and more
    wall = wall_of(leg, 2, 0.45f);
    assert_true(wall.code != HG_GI_NO_WALL);
    const struct disc far = {{1, 0, 0}, 1.1f, 100}; // than a spacing
    assert_true(wall_of(&far, 1, 1).code == HG_GI_NO_WALL);
    assert_true(wall_of(NULL, 0, 1).code == HG_GI_NO_WALL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_wall),
        cmocka_unit_test(test_directions), cmocka_unit_test(test_no_wall)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
