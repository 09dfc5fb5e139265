// trace_ray_geometry.c - baked parts, poses and motion, as rays see them, for each backend.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>

#include "trace_rig.h"

#include "base/alloc.h"
#include "base/cond.h"

static enum hg_trace_backend backend;

// A sphere of side * side * 4 triangles; radius 1.
static struct hg_mesh *ball(struct rig *r, uint32_t side)
{
    const uint32_t round = side * 2, vertices = (side + 1) * round;
    float *positions = hg_calloc(vertices * 3ull, sizeof *positions);
    uint32_t *indices = hg_calloc(side * round * 6ull, sizeof *indices), n = 0;
    assert_non_null(positions);
    assert_non_null(indices);
    for (uint32_t i = 0; i <= side; i++)
        for (uint32_t k = 0; k < round; k++) {
            const double a = M_PI * i / side, b = 2.0 * M_PI * k / round;
            float *p = positions + (i * round + k) * 3;
            p[0] = (float)(sin(a) * cos(b));
            p[1] = i == 0 ? 1.0f : i == side ? -1.0f : (float)cos(a);
            p[2] = (float)(sin(a) * sin(b));
            if (i == 0 || i == side)
                p[0] = p[2] = 0.0f;
        }
    for (uint32_t i = 0; i < side; i++)
        for (uint32_t k = 0; k < round; k++) {
            const uint32_t a = i * round + k, b = i * round + (k + 1) % round;
            const uint32_t c = a + round, d = b + round;
            const uint32_t two[6] = {a, c, d, a, d, b};
            memcpy(indices + n, two, sizeof two);
            n += 6;
        }
    struct hg_mesh *mesh = rig_mesh(r, positions, vertices, indices, n);
    hg_free(positions);
    hg_free(indices);
    return mesh;
}

static struct rig *open_baked(uint64_t budget_bytes)
{
    struct rig *r = rig_open(backend);
    const struct hg_geometry_params params = {
        .jobs = r->jobs, .bake_from = 1000, .budget_bytes = budget_bytes};
    hg_geometry_destroy(r->geometry);
    rig_check(r, hg_geometry_create(r->gpu, &params, &r->geometry, &r->err));
    return r;
}

static void bake_all(struct rig *r)
{
    rig_pose(r);
    while (hg_geometry_baking(r->geometry) > 0)
        if (hg_geometry_poll(r->geometry, HG_COND_FOREVER))
            rig_pose(r);
    assert_true(hg_geometry_has_levels(r->geometry));
}

static const struct hg_ray_geometry_lens fine = {
    .px_scale = 500.0f, .near = 0.01f, .eye = {0, 0, 4}};
static const struct hg_ray_geometry_lens coarse = {
    .px_scale = 500.0f, .near = 0.01f, .eye = {0, 0, 4}, .error_px = 4.0f};

static uint64_t triangles_of(const struct hg_ray_geometry *ray_geometry)
{
    uint64_t sum = 0;
    for (uint32_t i = 0; i < hg_ray_geometry_count(ray_geometry); i++)
        sum += hg_ray_geometry_pieces(ray_geometry)[i].triangle_count;
    return sum;
}

static void fill_inside(struct rig *r, uint32_t count)
{
    struct hg_gpu_ray *rays = rig_rays(r, count);
    for (uint32_t i = 0; i < count; i++) {
        rays[i] = (struct hg_gpu_ray){.t_max = 1e30f, .mask = HG_RAY_ALL, .time = 1.0f};
        for (int c = 0; c < 3; c++) {
            (&rays[i].origin_ws.x)[c] = (float)rig_random(r, -0.1, 0.1);
            (&rays[i].direction_ws.x)[c] = (float)rig_random(r, -1.0, 1.0);
        }
    }
}

// How far the hits are from the unit sphere at most; every ray must hit.
static double farthest(struct rig *r, uint32_t count)
{
    const struct hg_gpu_hit *hits = rig_closest(r, count, false);
    const struct hg_gpu_ray *rays = r->rays.mapped;
    double most = 0.0;
    for (uint32_t i = 0; i < count; i++) {
        double length2 = 0.0;
        assert_true(hits[i].draw == 0);
        for (int c = 0; c < 3; c++) {
            const double x =
                (&rays[i].origin_ws.x)[c] + (double)hits[i].t * (&rays[i].direction_ws.x)[c];
            length2 += x * x;
        }
        most = fmax(most, fabs(sqrt(length2) - 1.0));
    }
    return most;
}

// Levels of detail have no cracks, and no more error than was asked for.
static void levels(void **state)
{
    (void)state;
    enum { COUNT = 20000 };
    struct rig *r = open_baked(0);
    rig_node(r, ball(r, 90), NULL);
    bake_all(r);
    rig_trace(r, &fine, 0);
    const uint64_t all = triangles_of(r->ray_geometry);
    assert_in_range(all, 90 * 180 * 2 - 800, 90 * 180 * 2);
    fill_inside(r, COUNT);
    assert_true(farthest(r, COUNT) < 1.5e-3);
    rig_trace(r, &coarse, 0);
    assert_true(triangles_of(r->ray_geometry) * 4 < all);
    fill_inside(r, COUNT);
    assert_true(farthest(r, COUNT) < 4.0 * 3.0 / 500.0 * 1.5);
    rig_close(r);
}

// The same pieces whatever was looked at before and whatever the budget; too little is refused.
static void same_for_a_lens(void **state)
{
    (void)state;
    uint64_t keys[2][4096];
    uint32_t count[2] = {0};
    for (int small = 0; small < 2; small++) {
        struct rig *r = open_baked(small ? 2u << 20 : 0);
        rig_node(r, ball(r, 60), NULL);
        const float far[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, -60, 1};
        rig_node(r, ball(r, 60), far);
        bake_all(r);
        if (small) {
            const struct hg_ray_geometry_lens other = {
                .px_scale = 300.0f, .near = 0.01f, .eye = {0, 0, -57}, .error_px = 2.0f};
            rig_check(
                r, hg_ray_geometry_make(r->geometry, &other, r->jobs, &r->ray_geometry, &r->err));
        }
        rig_check(
            r, hg_ray_geometry_make(r->geometry, &coarse, r->jobs, &r->ray_geometry, &r->err));
        count[small] = hg_ray_geometry_count(r->ray_geometry);
        assert_in_range(count[small], 2, 4096);
        for (uint32_t i = 0; i < count[small]; i++)
            keys[small][i] = hg_ray_geometry_pieces(r->ray_geometry)[i].key;
        const uint64_t revision = hg_ray_geometry_revision(r->ray_geometry);
        rig_check(
            r, hg_ray_geometry_make(r->geometry, &coarse, r->jobs, &r->ray_geometry, &r->err));
        assert_true(hg_ray_geometry_revision(r->ray_geometry) == revision);
        rig_close(r);
    }
    assert_int_equal(count[0], count[1]);
    assert_memory_equal(keys[0], keys[1], count[0] * sizeof keys[0][0]);
}

// What is not there is asked for, and coarser levels stand in until it comes.
static void resident(void **state)
{
    (void)state;
    enum { COUNT = 5000, MOST_FRAMES = 20000 };
    struct rig *r = open_baked(0);
    struct hg_ray_geometry_lens lens = fine;
    rig_node(r, ball(r, 90), NULL);
    bake_all(r);
    lens.resident = true;
    rig_trace(r, &lens, 0);
    assert_true(hg_ray_geometry_missing(r->ray_geometry) > 0);
    const uint64_t before = triangles_of(r->ray_geometry);
    fill_inside(r, COUNT);
    assert_true(farthest(r, COUNT) < 0.5);
    for (int i = 0; i < MOST_FRAMES && hg_ray_geometry_missing(r->ray_geometry) > 0; i++) {
        (void)hg_cluster_pool_tick(r->geometry->pool);
        rig_trace(r, &lens, 0);
        nanosleep(&(struct timespec){.tv_nsec = 1000000}, NULL);
    }
    assert_int_equal(hg_ray_geometry_missing(r->ray_geometry), 0);
    const uint64_t after = triangles_of(r->ray_geometry);
    assert_true(after > 2 * before);
    rig_trace(r, &fine, 0);
    assert_int_equal(triangles_of(r->ray_geometry), after);
    assert_int_equal(hg_ray_geometry_missing(r->ray_geometry), 0);
    rig_close(r);
}

static void too_small(void **state)
{
    (void)state;
    struct rig *r = open_baked(1u << 20);
    for (int i = 0; i < 4; i++)
        rig_node(r, ball(r, 80), NULL);
    bake_all(r);
    assert_int_equal(
        hg_ray_geometry_make(r->geometry, &fine, r->jobs, &r->ray_geometry, &r->err), HG_E_LIMIT);
    assert_int_equal(hg_ray_geometry_count(r->ray_geometry), 0);
    rig_close(r);
}

// --- poses and motion ----------------------------------------------------------------------------

// A square in the plane z = 0 whose one target moves it by 1 along z.
static struct hg_node *lift(struct rig *r)
{
    const float quad[] = {-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0};
    const float up[] = {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1};
    const uint32_t indices[] = {0, 1, 2, 0, 2, 3};
    struct hg_mesh *mesh = rig_mesh(r, quad, 4, indices, 6);
    mesh->target_count = 1;
    mesh->parts->targets = hg_calloc(1, sizeof *mesh->parts->targets);
    assert_non_null(mesh->parts->targets);
    mesh->parts->targets->positions = hg_calloc(1, sizeof up);
    assert_non_null(mesh->parts->targets->positions);
    memcpy(mesh->parts->targets->positions, up, sizeof up);
    struct hg_node *node = rig_node(r, mesh, NULL);
    node->weights = hg_calloc(1, sizeof *node->weights);
    assert_non_null(node->weights);
    return node;
}

static void expect(struct rig *r, float time, float distance)
{
    struct hg_gpu_ray *rays = rig_rays(r, 4);
    for (uint32_t i = 0; i < 4; i++)
        rays[i] = (struct hg_gpu_ray){.origin_ws = {0.25f, 0.1f, 3.0f},
            .direction_ws = {0, 0, -1},
            .t_max = 1e30f,
            .time = time,
            .mask = HG_RAY_ALL};
    for (int coherent = 0; coherent < 2; coherent++) {
        const struct hg_gpu_hit *hits = rig_closest(r, 4, coherent != 0);
        const uint32_t *blocked = rig_blocked(r, 4, coherent != 0);
        if (hits[3].draw == HG_HIT_NONE || fabsf(hits[3].t - distance) > 1e-5f || blocked[3] != 1)
            fail_msg("at time %g: %g, should be %g", (double)time,
                hits[3].draw == HG_HIT_NONE ? -1.0 : (double)hits[3].t, (double)distance);
    }
}

static void poses(void **state)
{
    (void)state;
    struct rig *r = rig_open(backend);
    struct hg_node *node = lift(r);
    for (int i = 1; i < 70; i++) { // more than a tree is refitted
        node->weights[0] = 0.01f * (float)i;
        hg_scene_touch(r->scene, &node->head);
        rig_sync(r);
        expect(r, 0.5f, 3.0f - 0.01f * (float)i);
    }
    rig_close(r);
}

static void motion(void **state)
{
    (void)state;
    struct rig *r = rig_open(backend);
    struct hg_ray_geometry_lens lens = fine;
    struct hg_node *node = lift(r);
    lens.motion = true;
    node->weights[0] = 0.5f;
    rig_pose(r);
    rig_check(r, hg_ray_geometry_open_shutter(r->geometry, &r->ray_geometry, &r->err));
    node->weights[0] = 1.0f; // the surface moves by half a metre, then the node by another
    hg_scene_touch(r->scene, &node->head);
    rig_pose(r);
    rig_trace(r, &lens, 0);
    expect(r, 0.0f, 2.5f);
    expect(r, 1.0f, 2.0f);
    expect(r, 0.25f, 2.375f);
    node->translation[2] = 0.5f;
    hg_scene_touch(r->scene, &node->head);
    rig_pose(r);
    rig_trace(r, &lens, 0);
    expect(r, 0.0f, 2.5f);
    expect(r, 1.0f, 1.5f);
    expect(r, 0.5f, 2.0f);
    lens.motion = false; // and without: everything is where it is at the end
    rig_trace(r, &lens, 0);
    expect(r, 0.0f, 1.5f);
    rig_close(r);
}

int main(int argc, char **argv)
{
    backend = rig_backend(argc, argv);
    if (backend == HG_TRACE_AUTO)
        return 2;
    if (backend == HG_TRACE_KHR && !rig_has_ray_query()) {
        printf("no ray queries on this device: motion goes through what it has instead\n");
        backend = HG_TRACE_AUTO;
    }
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(levels),
        cmocka_unit_test(same_for_a_lens),
        cmocka_unit_test(resident),
        cmocka_unit_test(too_small),
        cmocka_unit_test(poses),
        cmocka_unit_test(motion),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
