// geometry_sync.c - what a sync uploads, budgets, and faults in the midst of it.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "base/cond.h"
#include "base/log.h"
#include "geometry_device.h"
#include "lod_meshes.h"
#include "renderer/mesh/gpu_array.h"
#include "renderer/scene/asset.h"
#include "tests/support/check.h"

static void test_only_what_changed(void **state)
{
    struct geo *f = *state;
    struct geo_scene s = geo_make_scene(f);
    struct hg_geometry_stats stats;
    geo_sync(f, s.geometry, s.scene);
    hg_geometry_stats(s.geometry, &stats);
    assert_int_equal(stats.parts_uploaded, 1);
    assert_int_equal(stats.triangles_total, 2 * TRIANGLES);
    const uint64_t first = stats.uploaded_bytes, shape = hg_geometry_shape_revision(s.geometry);
    geo_sync(f, s.geometry, s.scene);
    hg_geometry_stats(s.geometry, &stats);
    assert_int_equal(stats.uploaded_bytes, 0);
    assert_int_equal(hg_geometry_shape_revision(s.geometry), shape);
    s.nodes[0]->translation[1] = 0.5f; // a moved node: one piece of the instance table
    hg_scene_touch(s.scene, &s.nodes[0]->head);
    geo_sync(f, s.geometry, s.scene);
    hg_geometry_stats(s.geometry, &stats);
    assert_int_equal(stats.parts_uploaded, 0);
    assert_in_range(stats.uploaded_bytes, 1, 1024);
    assert_int_equal(hg_geometry_shape_revision(s.geometry), shape + 1);
    s.mesh->parts[0].positions[0] += 1.0f; // an edited mesh: its part
    hg_scene_touch(s.scene, &s.mesh->head);
    geo_sync(f, s.geometry, s.scene);
    hg_geometry_stats(s.geometry, &stats);
    assert_int_equal(stats.parts_uploaded, 1);
    assert_true(stats.uploaded_bytes < first);
    geo_destroy_scene(&s);
}

static void check_array(struct hg_gpu *gpu, const struct hg_gpu_array *array, const uint8_t *data)
{
    struct hg_error err = {0};
    struct hg_gpu_buffer back;
    struct hg_gpu_cmd *cmd;
    test_ok(
        hg_gpu_buffer_create(gpu, HG_GPU_BUFFER_READBACK, array->size_bytes, "back", &back, &err),
        &err);
    test_ok(hg_gpu_begin(gpu, &cmd, &err), &err);
    const VkBufferCopy copy = {0, 0, array->size_bytes};
    vkCmdCopyBuffer(hg_gpu_cmd_handle(cmd), array->buffer.handle, back.handle, 1, &copy);
    test_ok(hg_gpu_submit_and_wait(gpu, cmd, &err), &err);
    assert_memory_equal(back.mapped, data, array->size_bytes);
    hg_gpu_buffer_destroy(gpu, &back);
}

// What an array had before it grew is in the buffer that it has then, though drivers give that the
// handle of the one before (validation layers do not: the device has none). Two that grow in turn
// do not find their old memory again.
static void test_arrays_that_grow(void **state)
{
    enum { STEPS = 40, STEP_BYTES = 3000 };
    static uint8_t data[STEPS * STEP_BYTES];
    struct hg_gpu_array arrays[2] = {{.name = "grows"}, {.name = "grows in turn"}};
    struct hg_error err = {0};
    struct hg_gpu *gpu;
    uint64_t written = 0;
    (void)state;
    for (size_t i = 0; i < sizeof data; i++)
        data[i] = (uint8_t)(1 + i % 255);
    test_ok(hg_gpu_create(&(struct hg_gpu_params){0}, &gpu, &err), &err);
    for (uint64_t n = 1; n <= STEPS; n++)
        for (int i = 0; i < 2; i++) {
            test_ok(
                hg_gpu_array_write(gpu, &arrays[i], data, n * STEP_BYTES, &written, &err), &err);
            check_array(gpu, &arrays[i], data);
        }
    for (int i = 0; i < 2; i++)
        hg_gpu_array_finish(gpu, &arrays[i]);
    hg_gpu_destroy(gpu);
}

// A budget that is exactly enough works; one mesh more is refused before memory is taken; what was
// shown before stays.
static void test_budget(void **state)
{
    struct geo *f = *state;
    struct geo_scene s = geo_make_scene(f);
    geo_sync(f, s.geometry, s.scene);
    struct hg_geometry_stats stats;
    struct hg_gpu_memory_stats before, after;
    hg_geometry_stats(s.geometry, &stats);
    struct hg_geometry *tight;
    const struct hg_geometry_params params = {.budget_bytes = stats.used_bytes};
    geo_check(f, hg_geometry_create(f->gpu, &params, &tight, &f->err));
    geo_check(f, hg_geometry_sync(tight, s.scene, NULL, &f->err)); // exactly enough
    geo_add_node(f, s.scene, 3, geo_add_mesh(f, s.scene, 2));
    hg_scene_publish(s.scene);
    hg_scene_update(s.scene);
    hg_gpu_memory_stats(f->gpu, &before);
    assert_int_equal(hg_geometry_sync(tight, s.scene, NULL, &f->err), HG_E_LIMIT);
    hg_gpu_memory_stats(f->gpu, &after);
    assert_int_equal(before.used_bytes, after.used_bytes);
    assert_non_null(strstr(f->err.what, "geometry budget"));
    assert_int_equal(tight->draw_count, 2);
    hg_geometry_destroy(tight);
    geo_destroy_scene(&s);
}

// A part of 20,000 triangles that is given to hierarchies and refused: node 3, mesh 2.
static void add_unbakable(struct geo *f, struct hg_scene *scene)
{
    struct hg_mesh *mesh = geo_add_mesh(f, scene, 2);
    struct hg_mesh_part *part = &mesh->parts[0];
    uint32_t *indices = hg_calloc(60000, sizeof *indices);
    assert_non_null(indices);
    for (uint32_t i = 0; i < 60000; i++)
        indices[i] = part->indices[i % part->index_count];
    hg_free(part->indices);
    part->indices = indices;
    part->index_count = 60000;
    part->positions[0] = 1e37f; // farther than hierarchies reach
    geo_add_node(f, scene, 3, mesh);
    hg_scene_publish(scene);
    hg_scene_update(scene);
}

// A part above the budget is shown by a proxy until it is baked; one that cannot be baked is
// refused then: what is left of it in few triangles must not be taken for it.
static void test_proxy_of_unbaked(void **state)
{
    struct geo *f = *state;
    struct geo_scene s = geo_make_scene(f);
    struct hg_jobs *jobs = hg_jobs_create(1);
    assert_non_null(jobs);
    add_unbakable(f, s.scene);
    const struct hg_geometry_params params = {
        .budget_bytes = 200000, .jobs = jobs, .bake_from = 1000};
    struct hg_geometry *tight;
    struct hg_geometry_stats stats;
    geo_check(f, hg_geometry_create(f->gpu, &params, &tight, &f->err));
    geo_check(f, hg_geometry_sync(tight, s.scene, NULL, &f->err));
    hg_geometry_stats(tight, &stats);
    assert_int_equal(stats.proxies, 1);
    assert_true(stats.peak_bytes <= 200000);
    assert_true(hg_geometry_poll(tight, HG_COND_FOREVER));
    for (int i = 0; i < 2; i++) {
        assert_int_equal(hg_geometry_sync(tight, s.scene, NULL, &f->err), HG_E_LIMIT);
        assert_non_null(strstr(f->err.reason, "levels of detail"));
    }
    hg_geometry_destroy(tight);
    hg_jobs_destroy(jobs);
    geo_destroy_scene(&s);
}

// A torus of 40,000 triangles, node and mesh 2.
static void add_torus(struct geo *f, struct hg_scene *scene)
{
    struct hg_mesh *mesh = geo_add_mesh(f, scene, 2);
    hg_mesh_part_finish(&mesh->parts[0], 0);
    mesh->parts[0] = lod_torus(200, 100, 1.0f);
    geo_add_node(f, scene, 3, mesh);
    hg_scene_publish(scene);
    hg_scene_update(scene);
}

// What it takes when all that was queued is there.
static struct hg_geometry_stats baked(struct geo *f, struct hg_geometry *g, struct hg_scene *scene)
{
    struct hg_geometry_stats stats;
    geo_check(f, hg_geometry_sync(g, scene, NULL, &f->err));
    while (hg_geometry_baking(g) > 0)
        (void)hg_geometry_poll(g, HG_COND_FOREVER);
    geo_check(f, hg_geometry_sync(g, scene, NULL, &f->err));
    hg_geometry_stats(g, &stats);
    assert_int_equal(stats.proxies, 0);
    return stats;
}

// Parts above the budget are queued before anything of theirs is on the device. When that fails
// they are not baked twice, and in the end there is what there would have been.
static void test_faults_of_queued(void **state)
{
    struct geo *f = *state;
    struct geo_scene s = geo_make_scene(f);
    struct hg_jobs *jobs = hg_jobs_create(1);
    const struct hg_geometry_params params = {
        .budget_bytes = 500000, .jobs = jobs, .bake_from = 1000};
    struct hg_geometry_stats whole = {0}, stats;
    assert_non_null(jobs);
    add_torus(f, s.scene);
    uint32_t queued = 0;
    bool failed = false;
    for (uint64_t n = 0; n < 2 || failed; n++) {
        struct hg_geometry *g;
        geo_check(f, hg_geometry_create(f->gpu, &params, &g, &f->err));
        hg_gpu_fail_at(n, VK_ERROR_OUT_OF_DEVICE_MEMORY);
        const enum hg_status status = hg_geometry_sync(g, s.scene, NULL, &f->err);
        hg_gpu_fail_at(0, VK_SUCCESS);
        failed = status != HG_OK;
        if (failed)
            queued += hg_geometry_baking(g) > 0;
        stats = baked(f, g, s.scene);
        whole = n == 0 ? stats : whole;
        assert_int_equal(stats.used_bytes, whole.used_bytes);
        assert_int_equal(stats.chunks.root_bytes, whole.chunks.root_bytes);
        hg_geometry_destroy(g);
    }
    assert_true(queued > 2);
    hg_jobs_destroy(jobs);
    geo_destroy_scene(&s);
}

// Of few triangles and many vertices: it is never baked.
static void set_points(struct hg_scene *scene, struct hg_mesh *mesh, uint32_t vertices)
{
    hg_mesh_part_finish(&mesh->parts[0], 0);
    mesh->parts[0] = lod_part(vertices, 30);
    for (uint32_t i = 0; i < 30; i++)
        mesh->parts[0].indices[i] = i;
    hg_scene_touch(scene, &mesh->head);
    hg_scene_publish(scene);
    hg_scene_update(scene);
}

// A part that was refused comes as it is when something else goes, also when the device has no
// memory for it at first.
static void test_room_for_unbaked(void **state)
{
    struct geo *f = *state;
    struct geo_scene s = geo_make_scene(f);
    struct hg_jobs *jobs = hg_jobs_create(1);
    struct hg_geometry_params params = {.jobs = jobs, .bake_from = 1000};
    struct hg_geometry_stats whole, stats;
    struct hg_geometry *g;
    assert_non_null(jobs);
    struct hg_mesh *points = geo_add_mesh(f, s.scene, 4);
    set_points(s.scene, points, 40);
    geo_add_node(f, s.scene, 5, points);
    add_unbakable(f, s.scene);
    geo_check(f, hg_geometry_create(f->gpu, &params, &g, &f->err));
    whole = baked(f, g, s.scene);
    hg_geometry_destroy(g);
    params.budget_bytes = whole.used_bytes;
    set_points(s.scene, points, 4000);
    geo_check(f, hg_geometry_create(f->gpu, &params, &g, &f->err));
    geo_check(f, hg_geometry_sync(g, s.scene, NULL, &f->err));
    hg_geometry_stats(g, &stats);
    assert_int_equal(stats.proxies, 1);
    assert_true(hg_geometry_poll(g, HG_COND_FOREVER));
    assert_int_equal(hg_geometry_sync(g, s.scene, NULL, &f->err), HG_E_LIMIT);
    set_points(s.scene, points, 40);
    enum hg_status status = HG_E_NOMEM;
    uint32_t failures = 0;
    for (uint64_t n = 1; status != HG_OK && n < 20; n++) {
        hg_gpu_fail_at(n, VK_ERROR_OUT_OF_DEVICE_MEMORY);
        status = hg_geometry_sync(g, s.scene, NULL, &f->err);
        hg_gpu_fail_at(0, VK_SUCCESS);
        failures += status != HG_OK;
    }
    assert_int_equal(status, HG_OK);
    assert_true(failures > 1);
    hg_geometry_stats(g, &stats);
    assert_int_equal(stats.proxies, 0);
    assert_int_equal(stats.triangles_total, whole.triangles_total);
    assert_int_equal(stats.used_bytes, whole.used_bytes);
    set_points(s.scene, points, 41); // and stays
    geo_check(f, hg_geometry_sync(g, s.scene, NULL, &f->err));
    hg_geometry_destroy(g);
    hg_jobs_destroy(jobs);
    geo_destroy_scene(&s);
}

// Levels that came in while a sync was refused count as what they are afterwards.
static void test_refused_after_levels(void **state)
{
    struct geo *f = *state;
    struct geo_scene s = geo_make_scene(f);
    struct hg_jobs *jobs = hg_jobs_create(1);
    const struct hg_geometry_params params = {
        .budget_bytes = 2000000, .jobs = jobs, .bake_from = 1000};
    struct hg_geometry *g;
    assert_non_null(jobs);
    struct hg_mesh *points = geo_add_mesh(f, s.scene, 4);
    set_points(s.scene, points, 40);
    geo_add_node(f, s.scene, 5, points);
    add_torus(f, s.scene);
    geo_check(f, hg_geometry_create(f->gpu, &params, &g, &f->err));
    const struct hg_geometry_stats whole = baked(f, g, s.scene);
    hg_geometry_destroy(g);
    geo_check(f, hg_geometry_create(f->gpu, &params, &g, &f->err));
    geo_check(f, hg_geometry_sync(g, s.scene, NULL, &f->err));
    assert_int_equal(hg_geometry_baking(g), 1); // and shown as it is
    set_points(s.scene, points, 100000);
    assert_int_equal(hg_geometry_sync(g, s.scene, NULL, &f->err), HG_E_LIMIT);
    assert_int_equal(hg_geometry_baking(g), 0);
    set_points(s.scene, points, 40);
    const struct hg_geometry_stats stats = baked(f, g, s.scene);
    assert_int_equal(stats.used_bytes, whole.used_bytes);
    hg_geometry_destroy(g);
    hg_jobs_destroy(jobs);
    geo_destroy_scene(&s);
}

// Small triangles without neighbours: mesh 2, node 3.
static void add_soup(struct geo *f, struct hg_scene *scene)
{
    struct hg_mesh *mesh = geo_add_mesh(f, scene, 2);
    hg_mesh_part_finish(&mesh->parts[0], 0);
    mesh->parts[0] = lod_soup(20000);
    const struct hg_mesh_part *part = &mesh->parts[0];
    for (uint32_t i = 0; i < part->vertex_count * 3; i++) {
        const float origin = part->positions[i / 9 * 9 + i % 3];
        part->positions[i] = origin + (part->positions[i] - origin) * 1e-2f;
    }
    geo_add_node(f, scene, 3, mesh);
    hg_scene_publish(scene);
    hg_scene_update(scene);
}

static const struct hg_part_entry *part_of(const struct hg_geometry *g, uint64_t mesh)
{
    return &hg_mesh_entry_find(g->meshes, g->mesh_count, mesh)->parts[0];
}

static bool holds(const struct hg_box *box, const float *p)
{
    bool inside = true;
    for (int k = 0; k < 3; k++)
        inside = inside && p[k] >= box->min[k] && p[k] <= box->max[k];
    return inside;
}

// Triangles of a proxy that grew beyond the part are in its bounds; when it goes, so do they.
static void test_bounds_of_proxies(void **state)
{
    struct geo *f = *state;
    struct geo_scene s = geo_make_scene(f);
    struct hg_jobs *jobs = hg_jobs_create(1);
    struct hg_geometry_params params = {.jobs = jobs, .bake_from = 1000};
    struct hg_geometry_stats stats;
    struct hg_geometry *g;
    struct hg_box own, whole;
    assert_non_null(jobs);
    add_soup(f, s.scene);
    geo_check(f, hg_geometry_create(f->gpu, &params, &g, &f->err));
    geo_check(f, hg_geometry_sync(g, s.scene, NULL, &f->err));
    own = part_of(g, 2)->bounds;
    baked(f, g, s.scene);
    whole = part_of(g, 2)->bounds;
    hg_geometry_destroy(g);
    params.budget_bytes = 1200000;
    geo_check(f, hg_geometry_create(f->gpu, &params, &g, &f->err));
    geo_check(f, hg_geometry_sync(g, s.scene, NULL, &f->err));
    hg_geometry_stats(g, &stats);
    assert_int_equal(stats.proxies, 1);
    const struct hg_part_entry *part = part_of(g, 2);
    uint32_t beyond = 0, outside = 0;
    for (uint32_t v = 0; v < part->proxy->vertex_count; v++) {
        beyond += !holds(&own, part->proxy->positions + (size_t)v * 3);
        outside += !holds(&part->bounds, part->proxy->positions + (size_t)v * 3);
    }
    assert_true(beyond > 0);
    assert_int_equal(outside, 0);
    baked(f, g, s.scene);
    assert_memory_equal(&part_of(g, 2)->bounds, &whole, sizeof whole);
    hg_geometry_destroy(g);
    hg_jobs_destroy(jobs);
    geo_destroy_scene(&s);
}

// Every allocation and every Vulkan call fails once: a status, what was shown stays, and the next
// sync succeeds.
static void test_faults(void **state)
{
    struct geo *f = *state;
    struct geo_scene s = geo_make_scene(f);
    geo_sync(f, s.geometry, s.scene);
    uint32_t failures = 0;
    for (int kind = 0; kind < 2; kind++) {
        enum hg_status status = HG_E_NOMEM;
        for (uint64_t n = 1; status != HG_OK && n < 200; n++) {
            s.mesh->parts[0].positions[0] += 1.0f;
            hg_scene_touch(s.scene, &s.mesh->head);
            hg_scene_publish(s.scene);
            hg_scene_update(s.scene);
            if (kind == 0)
                hg_alloc_fail_at(n);
            else
                hg_gpu_fail_at(n, VK_ERROR_OUT_OF_DEVICE_MEMORY);
            status = hg_geometry_sync(s.geometry, s.scene, NULL, &f->err);
            hg_alloc_fail_at(0);
            hg_gpu_fail_at(0, VK_SUCCESS);
            failures += status != HG_OK;
            assert_true(status == HG_OK || status == HG_E_NOMEM);
            assert_int_equal(s.geometry->draw_count, 2);
            struct hg_draw_info info;
            assert_true(hg_geometry_draw_info(s.geometry, 1, &info));
        }
        assert_int_equal(status, HG_OK);
        geo_sync(f, s.geometry, s.scene);
    }
    assert_true(failures > 8);
    geo_destroy_scene(&s);
}

int main(void)
{
    hg_log_set_sink(hg_log_sink_logfmt, (void *)(intptr_t)2);
    hg_log_set_level(HG_LOG_WARN);
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_only_what_changed),
        cmocka_unit_test(test_arrays_that_grow), cmocka_unit_test(test_budget),
        cmocka_unit_test(test_proxy_of_unbaked), cmocka_unit_test(test_faults_of_queued),
        cmocka_unit_test(test_refused_after_levels), cmocka_unit_test(test_room_for_unbaked),
        cmocka_unit_test(test_bounds_of_proxies), cmocka_unit_test(test_faults)};
    return cmocka_run_group_tests(tests, geo_setup, geo_teardown);
}
