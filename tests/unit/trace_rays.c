// trace_rays.c - rays of a scene: who shares structures, what a move builds, and which waves are
// refused, for each backend.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "trace_rig.h"

#include "base/alloc.h"
#include "renderer/trace/rays.h"

enum { NODES = 12, TRIANGLES = 300, RAYS = 40000 };

static enum hg_trace_backend backend;

static struct hg_rays *open_rays(struct rig *r)
{
    const struct hg_rays_params params = {.jobs = r->jobs};
    struct hg_rays *rays;
    rig_check(r, hg_rays_create(r->gpu, r->geometry, &params, &rays, &r->err));
    return rays;
}

static struct hg_node *soups(struct rig *r)
{
    struct hg_node *last = NULL;
    for (int i = 0; i < NODES; i++) {
        const float at[16] = {0.5f, 0, 0, 0, 0, 0.5f, 0, 0, 0, 0, 0.5f, 0,
            (float)(i % 4) * 0.4f - 0.6f, (float)(i / 4) * 0.5f - 0.5f, 0.1f * (float)i - 0.5f, 1};
        last = rig_node(r, rig_soup(r, TRIANGLES, 0.3), at);
    }
    return last;
}

static void move(struct rig *r, struct hg_node *node, float by)
{
    node->matrix[12] += by;
    hg_scene_touch(r->scene, &node->head);
    rig_pose(r);
}

static struct hg_trace_wave wave_of(struct rig *r, uint32_t count)
{
    return (struct hg_trace_wave){
        .rays = &r->rays, .hits = &r->hits, .blocked = &r->blocked, .count = count};
}

// --- references ----------------------------------------------------------------------------------

static void sharing(void **state)
{
    (void)state;
    struct rig *r = rig_open(backend);
    struct hg_rays_scene *a = NULL, *b = NULL, *c = NULL;
    struct hg_rays_stats stats;
    soups(r);
    rig_pose(r);
    struct hg_rays *rays = open_rays(r);
    struct hg_rays_key key = hg_rays_default_key(rays, backend, true), other = key;
    rig_check(r, hg_rays_ref(rays, &key, &a, &r->err));
    rig_check(r, hg_rays_ref(rays, &key, &b, &r->err));
    assert_ptr_equal(a, b);
    rig_check(r, hg_rays_sync(a, &r->err));
    struct hg_trace *trace = hg_rays_trace(a);
    other.lens.eye[0] = 1.0f;
    rig_check(r, hg_rays_ref(rays, &other, &b, &r->err)); // there is another reference: another one
    assert_ptr_not_equal(a, b);
    hg_rays_stats(rays, &stats);
    assert_int_equal(stats.scenes, 2);
    assert_int_equal(stats.references, 2);
    other.lens.eye[0] = 2.0f;
    struct hg_rays_scene *const alone = b;
    rig_check(r, hg_rays_ref(rays, &other, &b, &r->err)); // no other reference: it goes along
    assert_ptr_equal(b, alone);
    other.owner = r;
    rig_check(r, hg_rays_ref(rays, &other, &c, &r->err));
    assert_ptr_not_equal(b, c);
    hg_rays_unref(c);
    hg_rays_unref(b);
    hg_rays_stats(rays, &stats);
    assert_int_equal(stats.scenes, 1);
    assert_ptr_equal(hg_rays_trace(a), trace);
    hg_rays_unref(a);
    hg_rays_destroy(rays);
    rig_close(r);
}

// Of a scene that moves about in its bounds, the default level of detail stays.
static void default_key(void **state)
{
    (void)state;
    struct rig *r = rig_open(backend);
    struct hg_node *node = soups(r);
    rig_pose(r);
    struct hg_rays *rays = open_rays(r);
    const struct hg_rays_key key = hg_rays_default_key(rays, backend, false);
    assert_true(key.lens.resident && !key.exact && key.owner == NULL);
    move(r, node, 0.05f);
    assert_true(hg_rays_default_key(rays, backend, false).lens.px_scale == key.lens.px_scale);
    move(r, node, 50.0f);
    assert_true(hg_rays_default_key(rays, backend, false).lens.px_scale < key.lens.px_scale);
    hg_rays_destroy(rays);
    rig_close(r);
}

// --- moves ---------------------------------------------------------------------------------------

// Hits of the service are those of trying every triangle, and of structures rebuilt.
static void compare(struct rig *r, struct hg_rays_scene *scene)
{
    enum { COUNT = 1500 };
    struct hg_trace *const own = r->trace;
    rig_fill_rays(r, COUNT);
    struct hg_gpu_hit *rebuilt = hg_calloc(COUNT, sizeof *rebuilt);
    assert_non_null(rebuilt);
    memcpy(rebuilt, rig_closest(r, COUNT, false), COUNT * sizeof *rebuilt);
    r->trace = hg_rays_trace(scene);
    assert_in_range(rig_compare(r, COUNT, false), 0, 6);
    assert_in_range(rig_compare(r, COUNT, true), 0, 6);
    const struct hg_gpu_hit *hits = rig_closest(r, COUNT, false);
    uint32_t others = 0;
    for (uint32_t i = 0; i < COUNT; i++)
        others += hits[i].draw != rebuilt[i].draw || hits[i].primitive != rebuilt[i].primitive;
    assert_in_range(others, 0, 2);
    hg_free(rebuilt);
    r->trace = own;
}

static void moves(void **state)
{
    (void)state;
    struct rig *r = rig_open(backend);
    struct hg_node *node = soups(r);
    struct hg_rays_scene *scene = NULL;
    struct hg_trace_stats stats;
    rig_sync(r);
    struct hg_rays *rays = open_rays(r);
    const struct hg_rays_key key = hg_rays_default_key(rays, backend, true);
    rig_check(r, hg_rays_ref(rays, &key, &scene, &r->err));
    rig_check(r, hg_rays_sync(scene, &r->err));
    hg_trace_stats(hg_rays_trace(scene), &stats);
    assert_int_equal(stats.built_triangles, NODES * TRIANGLES);
    assert_int_equal(stats.instances, 0);
    for (int i = 0; i < 4; i++) {
        move(r, node, 0.05f);
        rig_sync(r);
        rig_check(r, hg_rays_sync(scene, &r->err));
        hg_trace_stats(hg_rays_trace(scene), &stats);
        // The first move takes it out of what stands still; from then on it alone is built.
        assert_int_equal(stats.built_triangles, (i == 0 ? NODES : 1) * TRIANGLES);
        assert_int_equal(stats.instances, 1);
        compare(r, scene);
    }
    hg_trace_stats(r->trace, &stats); // exact ones
    assert_int_equal(stats.built_triangles, NODES * TRIANGLES);
    rig_node(r, rig_soup(r, 100, 0.3), NULL); // what comes is built alone as well
    rig_sync(r);
    rig_check(r, hg_rays_sync(scene, &r->err));
    hg_trace_stats(hg_rays_trace(scene), &stats);
    assert_int_equal(stats.built_triangles, 100);
    compare(r, scene);
    hg_rays_unref(scene);
    hg_rays_destroy(rays);
    rig_close(r);
}

// When more is apart than stands still, and all stands still, it is one structure again.
static void settles(void **state)
{
    (void)state;
    struct rig *r = rig_open(backend);
    struct hg_node *nodes[NODES], *last;
    struct hg_rays_scene *scene = NULL;
    struct hg_trace_stats stats;
    for (int i = 0; i < NODES; i++) {
        const float at[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.1f * (float)i, 0, 0, 1};
        nodes[i] = rig_node(r, rig_soup(r, TRIANGLES, 0.3), at);
    }
    rig_sync(r);
    struct hg_rays *rays = open_rays(r);
    const struct hg_rays_key key = hg_rays_default_key(rays, backend, true);
    rig_check(r, hg_rays_ref(rays, &key, &scene, &r->err));
    rig_check(r, hg_rays_sync(scene, &r->err));
    for (int i = 0; i < NODES / 2; i++)
        move(r, nodes[i], 0.2f);
    rig_check(r, hg_rays_sync(scene, &r->err));
    hg_trace_stats(hg_rays_trace(scene), &stats);
    assert_int_equal(stats.instances, NODES / 2);
    last = rig_node(r, rig_soup(r, 10, 0.3), NULL); // it comes, and nothing moves
    rig_sync(r);
    rig_check(r, hg_rays_sync(scene, &r->err));
    hg_trace_stats(hg_rays_trace(scene), &stats);
    assert_int_equal(stats.instances, NODES / 2 + 1);
    rig_check(r, hg_scene_remove(r->scene, HG_OBJECT_NODE, last->head.id, &r->err));
    rig_sync(r);
    rig_check(r, hg_rays_sync(scene, &r->err));
    hg_trace_stats(hg_rays_trace(scene), &stats);
    assert_int_equal(stats.instances, 0);
    assert_int_equal(stats.built_triangles, NODES * TRIANGLES);
    compare(r, scene);
    hg_rays_unref(scene);
    hg_rays_destroy(rays);
    rig_close(r);
}

// Before there are structures, and of waves that are not in their buffers.
static void refused(void **state)
{
    (void)state;
    struct rig *r = rig_open(backend);
    struct hg_rays_scene *scene = NULL;
    soups(r);
    rig_pose(r);
    struct hg_rays *rays = open_rays(r);
    const struct hg_rays_key key = hg_rays_default_key(rays, backend, true);
    rig_check(r, hg_rays_ref(rays, &key, &scene, &r->err));
    rig_fill_rays(r, 16);
    struct hg_trace_wave wave = wave_of(r, 16);
    assert_int_equal(hg_trace_closest(hg_rays_trace(scene), &wave, &r->err), HG_E_STATE);
    rig_check(r, hg_rays_sync(scene, &r->err));
    wave.count = 1u << 20;
    assert_int_equal(hg_trace_closest(hg_rays_trace(scene), &wave, &r->err), HG_E_INVAL);
    hg_rays_unref(scene);
    hg_rays_destroy(rays);
    rig_close(r);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(sharing), cmocka_unit_test(default_key),
        cmocka_unit_test(moves), cmocka_unit_test(settles), cmocka_unit_test(refused)};
    backend = rig_backend(argc, argv);
    if (backend == HG_TRACE_AUTO)
        return 2;
    if (backend == HG_TRACE_KHR && !rig_has_ray_query()) {
        printf("no ray queries on this device: trace_hits tests that they are refused\n");
        return 0;
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
