// emitters_tree.c - the tree of lights (renderer/light/emitters/light_tree.h): the same for any
// number of threads, of bounded depth, and built only when something changed.
#include "tests/analytic/emitters_rig.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/light/emitters/light_tree.h"
#include "tests/support/check.h"

static struct hg_light_item random_item(uint32_t *random)
{
    struct hg_light_item item = {.cos_o = 1, .power = 1 + rig_random(random)};
    float length = 0;
    for (int a = 0; a < 3; a++) {
        item.min[a] = 10 * rig_random(random);
        item.max[a] = item.min[a] + 0.1f * rig_random(random);
        item.axis[a] = rig_random(random) - 0.5f;
        length += item.axis[a] * item.axis[a];
    }
    for (int a = 0; a < 3; a++)
        item.axis[a] /= sqrtf(length);
    return item;
}

static void expect_same_tree(const struct hg_light_item *items, uint32_t count)
{
    struct hg_light_tree trees[2];
    for (unsigned i = 0; i < 2; i++) {
        struct hg_jobs *jobs = hg_jobs_create(i == 0 ? 1 : 4);
        assert_non_null(jobs);
        test_ok(hg_light_tree_build(items, count, jobs, &trees[i]), NULL);
        hg_jobs_destroy(jobs);
    }
    assert_int_equal(trees[0].leaf_count, count);
    assert_int_equal(trees[0].node_count, 2 * count - 1);
    assert_true(trees[0].depth <= HG_EMITTER_MAX_DEPTH);
    assert_memory_equal(
        trees[0].nodes, trees[1].nodes, trees[0].node_count * sizeof *trees[0].nodes);
    assert_memory_equal(trees[0].trails, trees[1].trails, count * sizeof *trees[0].trails);
    // Every trail leads to its leaf.
    for (uint32_t i = 0; i < count; i++) {
        uint32_t at = 0, step = 0;
        for (; (trees[0].nodes[at].child & HG_EMITTER_IS_LEAF) == 0; step++)
            at = trees[0].nodes[at].child + (trees[0].trails[i] >> step & 1);
        assert_int_equal(trees[0].nodes[at].child & ~HG_EMITTER_IS_LEAF, i);
    }
    hg_light_tree_finish(&trees[0]);
    hg_light_tree_finish(&trees[1]);
}

// The same bytes for any number of threads; bounded depth where all lights lie in one place, or
// each twice as far away as the one before.
static void test_tree(void **state)
{
    (void)state;
    const uint32_t count = 50000;
    uint32_t random = 3;
    struct hg_light_item *items = hg_calloc(count, sizeof *items);
    assert_non_null(items);
    for (uint32_t i = 0; i < count; i++)
        items[i] = random_item(&random);
    expect_same_tree(items, count);
    for (uint32_t i = 0; i < count; i++)
        items[i] = items[0];
    expect_same_tree(items, count);
    for (uint32_t i = 0; i < count; i++) {
        items[i] = items[0];
        items[i].min[0] = items[i].max[0] = ldexpf(1, (int)(i % 120));
    }
    expect_same_tree(items, count);
    hg_free(items);
}

// Nothing is built while nothing changes.
static void test_kept(void **state)
{
    (void)state;
    static struct rig r;
    const float center[3] = {0, 1, 0};
    rig_open(&r);
    struct mesh *m = rig_add_ceiling(&r, center, 1, 0.5f, 4, 3);
    struct hg_light *light = rig_add_light(&r, HG_LIGHT_POINT, 0, 2, 0, 1);
    rig_set_image(&r, 64, 0, 1);
    struct hg_emitters_stats stats = rig_sync(&r);
    assert_true(stats.builds == 1 && stats.warps == 1);
    stats = rig_sync(&r);
    assert_true(stats.builds == 1 && stats.warps == 1);
    light->intensity = 2;
    stats = rig_sync(&r);
    assert_true(stats.builds == 2 && stats.warps == 1);
    m->material.emissive[1] = 4;
    stats = rig_sync(&r);
    assert_true(stats.builds == 3 && stats.warps == 1);
    m->piece.world[9] = 1;
    stats = rig_sync(&r);
    assert_true(stats.builds == 4 && stats.warps == 1);
    rig_set_image(&r, 64, 0, 2);
    stats = rig_sync(&r);
    assert_true(stats.builds == 4 && stats.warps == 2);
    rig_close(&r);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_tree),
        cmocka_unit_test(test_kept),
    };
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, rig_setup, rig_teardown);
}
