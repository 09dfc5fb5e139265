// lod_build_queue.c - what is queued for levels of detail: each part once, and as fast however many
// there are.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "base/cond.h"
#include "renderer/lod/build_queue.h"
#include "renderer/scene/asset.h"
#include "tests/unit/lod_meshes.h"

static struct hg_mesh *mesh_of(uint32_t parts)
{
    struct hg_mesh *mesh = hg_calloc(1, sizeof *mesh);
    assert_non_null(mesh);
    mesh->part_count = parts;
    mesh->parts = hg_calloc(parts, sizeof *mesh->parts);
    assert_non_null(mesh->parts);
    for (uint32_t i = 0; i < parts; i++)
        mesh->parts[i] = lod_soup(1);
    return mesh;
}

static void free_mesh(struct hg_mesh *mesh)
{
    for (uint32_t i = 0; i < mesh->part_count; i++)
        lod_part_finish(&mesh->parts[i]);
    hg_free(mesh->parts);
    hg_free(mesh);
}

static double own_seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + (double)t.tv_nsec * 1e-9;
}

// Seconds of this thread until all parts are queued.
static double queue_all(struct hg_jobs *jobs, const struct hg_mesh *mesh)
{
    struct hg_lod_build_queue *baker;
    assert_int_equal(hg_lod_build_queue_create(NULL, jobs, &baker, NULL), HG_OK);
    const double start = own_seconds();
    for (uint32_t i = 0; i < mesh->part_count; i++)
        assert_int_equal(hg_lod_build_queue_add(baker, mesh, 7, 1, i), HG_OK);
    const double seconds = own_seconds() - start;
    assert_int_equal(hg_lod_build_queue_pending(baker), mesh->part_count);
    hg_lod_build_queue_destroy(baker);
    return seconds;
}

static void test_many_parts(void **state)
{
    (void)state;
    enum { FEW = 5000, MANY = 8 * FEW };
    struct hg_jobs *jobs = hg_jobs_create(1);
    struct hg_mesh *few = mesh_of(FEW), *many = mesh_of(MANY);
    assert_non_null(jobs);
    double seconds[2] = {1e9, 1e9};
    for (int i = 0; i < 4; i++)
        seconds[0] = fmin(seconds[0], queue_all(jobs, few));
    for (int i = 0; i < 4; i++)
        seconds[1] = fmin(seconds[1], queue_all(jobs, many));
    print_message(
        "%d parts %.2f ms, %d parts %.2f ms\n", FEW, seconds[0] * 1e3, MANY, seconds[1] * 1e3);
    assert_true(seconds[1] < 28.0 * seconds[0]); // 8 times as many; each looked at by each: 64
    free_mesh(few);
    free_mesh(many);
    hg_jobs_destroy(jobs);
}

// Parts are told apart by all of mesh, revision and number, and come out once.
static void test_each_once(void **state)
{
    (void)state;
    enum { PARTS = 300, KINDS = 4 };
    static uint8_t seen[KINDS][PARTS];
    struct hg_jobs *jobs = hg_jobs_create(1);
    struct hg_mesh *mesh = mesh_of(PARTS);
    struct hg_lod_build_queue *baker;
    struct hg_lod_built baked;
    assert_non_null(jobs);
    assert_int_equal(hg_lod_build_queue_create(NULL, jobs, &baker, NULL), HG_OK);
    for (uint32_t kind = 0; kind < KINDS; kind++)
        for (uint32_t i = 0; i < PARTS; i++)
            assert_int_equal(hg_lod_build_queue_add(baker, mesh, 1 + kind / 2, kind % 2, i), HG_OK);
    assert_int_equal(hg_lod_build_queue_pending(baker), KINDS * PARTS);
    for (uint32_t i = 0; i < PARTS; i++)
        assert_int_equal(hg_lod_build_queue_add(baker, mesh, 2, 1, i), HG_OK);
    assert_int_equal(hg_lod_build_queue_pending(baker), KINDS * PARTS);
    for (uint32_t left = KINDS * PARTS; left > 0; left--) {
        assert_true(hg_lod_build_queue_take(baker, HG_COND_FOREVER, &baked));
        assert_int_equal(hg_lod_build_queue_pending(baker), left - 1);
        seen[(baked.mesh - 1) * 2 + baked.revision][baked.part]++;
        hg_lod_stored_close(&baked.stored);
        hg_free(baked.data);
    }
    for (uint32_t kind = 0; kind < KINDS; kind++)
        for (uint32_t i = 0; i < PARTS; i++)
            assert_int_equal(seen[kind][i], 1);
    assert_false(hg_lod_build_queue_take(baker, HG_COND_FOREVER, &baked));
    assert_int_equal(
        hg_lod_build_queue_add(baker, mesh, 2, 1, 0), HG_OK); // again, once it was taken
    assert_int_equal(hg_lod_build_queue_pending(baker), 1);
    hg_lod_build_queue_destroy(baker);
    free_mesh(mesh);
    hg_jobs_destroy(jobs);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_many_parts), cmocka_unit_test(test_each_once)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
