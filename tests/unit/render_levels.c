// render_levels.c - pictures of baked meshes do not depend on how much memory geometry gets, nor on
// what was looked at before; moving pictures say how coarse they are.

#include "base/alloc.h"
#include "base/log.h"
#include "renderer/internal.h"
#include "tests/support/folder.h"
#include "tests/support/test_data.h"
#include "tests/unit/render_levels_rig.h"

#define MIB (1ull << 20)

static struct hg_geometry_stats geometry_stats(const struct rig *rig)
{
    struct hg_view_report report;
    hg_view_get_report(rig->view, &report);
    return report.geometry;
}

static struct hg_frame_info settle(struct rig *rig, uint32_t samples)
{
    struct hg_frame_info info = {0};
    int steps = 0;
    while (!info.settled && steps < 4000) {
        info = rig_step(rig, samples);
        steps++;
    }
    assert_true(info.settled);
    assert_int_equal(info.missing_clusters, 0);
    assert_true(info.error_px == LEVELS_ERROR_PX);
    const struct hg_geometry_stats s = geometry_stats(rig);
    print_message("budget %.1f MiB: %d steps, peak %.1f MiB, chunks %llu resident, %llu evicted\n",
        (double)s.budget_bytes / (double)MIB, steps, (double)s.peak_bytes / (double)MIB,
        (unsigned long long)s.chunks.resident, (unsigned long long)s.chunks.evicted);
    return info;
}

// --- tests ---------------------------------------------------------------------------------------

#define PICKS 24

static struct hg_refbuf *unlimited;
static struct hg_pick picks[PICKS];

static void pick_all(struct rig *rig, struct hg_pick *out)
{
    for (uint32_t i = 0; i < PICKS; i++)
        test_ok(hg_view_pick(rig->view, 90 + i % 6 * 28, 100 + i / 6 * 30, &out[i], &rig->err),
            &rig->err);
}

static int setup(void **state)
{
    (void)state;
    struct rig rig;
    assert_true(test_folder_make(levels_cache_dir, "render-levels"));
    levels_open(&rig, 0);
    levels_look(&rig, 0, 0.3f);
    const struct hg_frame_info info = settle(&rig, 16);
    assert_true(info.triangles_drawn > 50000);
    assert_true(geometry_stats(&rig).chunks.used_bytes > 8 * MIB);
    unlimited = rig_pixels(&rig, HG_PIXEL_RGBA32F);
    pick_all(&rig, picks);
    rig_close(&rig);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    hg_refbuf_unref(unlimited);
    return test_folder_remove(levels_cache_dir) ? 0 : -1;
}

static uint32_t mesh_parts_baking(struct rig *rig)
{
    struct hg_baking baking;
    hg_view_baking(rig->view, &baking);
    return baking.mesh_parts;
}

// With an empty cache: who looks gets pictures of the whole mesh meanwhile, in both modes, also
// with steps of many samples; who wants the result gets control back at once, and nothing half
// made.
// Where the whole mesh is above the budget, pictures of a proxy say that they lack something.
static void test_baking_holds_nobody_up(void **state)
{
    (void)state;
    char filled[TEST_FOLDER_MAX];
    struct rig rig;
    for (int i = 0; i < 4; i++) {
        memcpy(filled, levels_cache_dir, sizeof filled);
        assert_true(test_folder_make(levels_cache_dir, "render-levels-empty"));
        levels_open(&rig, i == 3 ? 3 * MIB : 0);
        const struct hg_view_params path = {.width = LEVELS_VIEW_PX,
            .height = LEVELS_VIEW_PX,
            .samples = 1,
            .error_px = LEVELS_ERROR_PX,
            .mode = HG_MODE_PATH};
        if (i == 2)
            test_ok(hg_view_set_params(rig.view, &path, &rig.err), &rig.err);
        levels_look(&rig, 0, 0.3f);
        hg_view_set_final(rig.view, i == 1);
        struct hg_frame_info info = rig_step(&rig, 16);
        assert_false(info.settled);
        assert_true(mesh_parts_baking(&rig) > 0);
        assert_int_equal(info.number > 0, i != 1);
        assert_true(i == 1 || i == 3 || info.triangles_drawn > 200000);
        assert_true(i != 3 || (info.missing_clusters > 0 && info.triangles_drawn > 10000));
        info = rig_settle(&rig, 16);
        assert_int_equal(mesh_parts_baking(&rig), 0);
        assert_int_equal(info.missing_clusters, 0);
        assert_true(i != 3 || geometry_stats(&rig).peak_bytes <= 3 * MIB);
        assert_int_equal(info.samples, i == 2 ? 1 : LEVELS_SAMPLES);
        if (i != 2) {
            struct hg_refbuf *picture = rig_pixels(&rig, HG_PIXEL_RGBA32F);
            rig_assert_same(unlimited, picture);
            hg_refbuf_unref(picture);
        }
        rig_close(&rig);
        assert_true(test_folder_remove(levels_cache_dir));
        memcpy(levels_cache_dir, filled, sizeof filled);
    }
}

// What settles in a fraction of the memory, in parts, is what settles without a limit: for those
// who watch, for those who take several samples at once, and for those who only want the result.
static void test_budgets_do_not_show(void **state)
{
    (void)state;
    static const uint64_t budgets[] = {3 * MIB, 6 * MIB, 12 * MIB};
    for (uint32_t i = 0; i < 3; i++) {
        for (uint32_t way = 0; way < (i == 0 ? 3u : 1u); way++) {
            struct rig rig;
            levels_open(&rig, budgets[i]);
            hg_view_set_final(rig.view, way == 2);
            levels_look(&rig, 0, 0.3f);
            settle(&rig, way == 1 ? 1 : 16);
            struct hg_refbuf *small = rig_pixels(&rig, HG_PIXEL_RGBA32F);
            rig_assert_same(unlimited, small);
            hg_refbuf_unref(small);
            assert_true(geometry_stats(&rig).peak_bytes <= budgets[i]);
            rig_close(&rig);
        }
    }
}

// A flight before changes nothing; the budget holds all the time.
static void test_history_does_not_show(void **state)
{
    (void)state;
    struct rig rig;
    levels_open(&rig, 4 * MIB);
    for (int i = 0; i < 40; i++) {
        levels_look(&rig, 0.1f * sinf((float)i), 0.15f + 0.05f * (float)(i % 7));
        rig_step(&rig, 1);
        assert_true(geometry_stats(&rig).peak_bytes <= 4 * MIB);
    }
    levels_look(&rig, 0, 0.3f);
    settle(&rig, 2);
    struct hg_refbuf *after = rig_pixels(&rig, HG_PIXEL_RGBA32F);
    rig_assert_same(unlimited, after);
    hg_refbuf_unref(after);
    assert_true(geometry_stats(&rig).peak_bytes <= 4 * MIB);
    rig_close(&rig);
}

// A pick says the same of the picture, whatever of it is in memory.
static void test_picks(void **state)
{
    (void)state;
    struct rig rig;
    struct hg_pick small[PICKS];
    uint32_t hits = 0;
    levels_open(&rig, 3 * MIB);
    levels_look(&rig, 0, 0.3f);
    settle(&rig, 16);
    pick_all(&rig, small);
    for (uint32_t i = 0; i < PICKS; i++) {
        assert_int_equal(small[i].hit, picks[i].hit);
        assert_int_equal(small[i].node, picks[i].node);
        assert_int_equal(small[i].triangle, picks[i].triangle);
        assert_memory_equal(small[i].position, picks[i].position, sizeof picks[i].position);
        assert_memory_equal(small[i].normal, picks[i].normal, sizeof picks[i].normal);
        hits += picks[i].hit && picks[i].node == 2;
    }
    assert_true(hits > PICKS / 4);
    rig_close(&rig);
}

// Triangles of picks are those of the source: where one was hit, its plane is within a pixel.
static void test_picks_name_the_source(void **state)
{
    (void)state;
    struct rig rig;
    uint32_t hits = 0;
    levels_open(&rig, 0);
    levels_look(&rig, 0, 0.3f);
    settle(&rig, 16);
    const struct hg_mesh_part *part = NULL;
    for (uint32_t i = 0; i < rig.scene->objects[HG_OBJECT_NODE].count; i++) {
        const struct hg_node *n =
            (const struct hg_node *)rig.scene->objects[HG_OBJECT_NODE].items[i];
        part = n->head.id == 2 ? &n->mesh->parts[0] : part;
    }
    assert_non_null(part);
    for (uint32_t i = 0; i < PICKS; i++) {
        if (!picks[i].hit || picks[i].node != 2)
            continue;
        assert_true(picks[i].triangle < part->index_count / 3);
        float least = 1e9f; // of the three instances
        for (int k = 0; k < 3; k++) {
            float distance2 = 0.0f;
            for (int c = 0; c < 3; c++) {
                float middle = 0.0f;
                for (uint32_t v = 0; v < 3; v++)
                    middle += part->positions[part->indices[picks[i].triangle * 3 + v] * 3 +
                                              (uint32_t)c] /
                              3.0f;
                const float shift[3][3] = {
                    {0, 0.098f, 0}, {-0.15f, 0.098f, -0.2f}, {0.12f, 0.098f, -0.4f}};
                const float gap = picks[i].position[c] - shift[k][c] - middle;
                distance2 += gap * gap;
            }
            least = fminf(least, sqrtf(distance2));
        }
        assert_true(least < 0.002f); // edges are some 1.5 mm long, a pixel 0.8 mm
        hits++;
    }
    assert_true(hits > 3);
    rig_close(&rig);
}

// In motion the error rises evenly until the budget holds what is asked for, and stays for 150
// frames; what is in view stays resident (nothing is read again and again).
static void test_motion_is_steady(void **state)
{
    (void)state;
    struct rig rig;
    struct hg_frame_info info = {0};
    float least = 1e9f, most = 0.0f;
    uint32_t missing = 0, steady = 0;
    levels_open(&rig, 4 * MIB);
    levels_look(&rig, 0, 0.3f);
    rig_step(&rig, 16);                              // baked
    for (int i = 0; i < 4000 && steady < 150; i++) { // however long chunks take to be read
        levels_look(&rig, 0.0001f * (float)(i % 2 + 1), 0.3f);
        info = rig_step(&rig, 1);
        least = fminf(least, info.error_px);
        most = fmaxf(most, info.error_px);
        missing += info.missing_clusters > 0;
        steady++;
        if (least <= LEVELS_ERROR_PX || most > least * 1.6f || missing > 50) {
            least = 1e9f;
            most = 0.0f;
            missing = steady = 0;
        }
    }
    const struct hg_geometry_stats s = geometry_stats(&rig);
    print_message("error %.2f to %.2f px, %u of 150 frames miss something, %llu evicted\n",
        (double)least, (double)most, missing, (unsigned long long)s.chunks.evicted);
    assert_int_equal(steady, 150);
    assert_true(s.peak_bytes <= 4 * MIB);
    rig_close(&rig);
}

// --- far below what a picture needs --------------------------------------------------------------

struct far_run {
    uint64_t budget_bytes;
    bool final, flown; // flown: other views were shown before
};

static struct hg_frame_info settle_far(
    struct rig *rig, const struct far_run *run, int *steps, struct hg_refbuf **out)
{
    const struct hg_view_params view = {
        .width = 32, .height = 32, .samples = 4, .seed = 5, .error_px = 0.01f};
    struct hg_frame_info info = {0};
    levels_without_sun = true;
    levels_open(rig, run->budget_bytes);
    levels_without_sun = false;
    hg_view_set_final(rig->view, run->final);
    for (int i = 0; i < 24 && run->flown; i++) {
        levels_look(rig, 0.1f * sinf((float)i), 0.15f + 0.6f * (float)(i % 7));
        rig_step(rig, 1);
    }
    test_ok(hg_view_set_params(rig->view, &view, &rig->err), &rig->err);
    levels_look(rig, 0, 4.0f); // the statue is some pixels wide
    for (*steps = 0; !info.settled && *steps < 4000; ++*steps)
        info = rig_step(rig, 16);
    assert_true(info.settled);
    assert_int_equal(info.missing_clusters, 0);
    const uint64_t peak_bytes = geometry_stats(rig).peak_bytes;
    assert_true(run->budget_bytes == 0 || peak_bytes <= run->budget_bytes);
    *out = rig_pixels(rig, HG_PIXEL_RGBA32F);
    print_message("budget %llu KiB, %s%s: %d steps, error %.3f px, peak %llu KiB\n",
        (unsigned long long)run->budget_bytes >> 10, run->final ? "final" : "watched",
        run->flown ? " after a flight" : "", *steps, (double)info.error_px,
        (unsigned long long)peak_bytes >> 10);
    return info;
}

static void settle_runs(const struct far_run *runs, int count, struct hg_frame_info *info,
    int *steps, struct hg_refbuf **pictures)
{
    for (int i = 0; i < count; i++) {
        struct rig rig;
        info[i] = settle_far(&rig, &runs[i], &steps[i], &pictures[i]);
        assert_true(
            runs[i].budget_bytes == 0 || geometry_stats(&rig).peak_bytes <= runs[i].budget_bytes);
        rig_close(&rig);
    }
    levels_without_sun = false;
}

// What was shown before keeps nothing in memory that the picture could not be made beside: a fifth
// of what it needs at once is enough for every pixel, and areas stay large.
static void test_far_below_needs(void **state)
{
    (void)state;
    static const struct far_run runs[] = {{0, false, false}, {MIB, false, false},
        {MIB, false, true}, {MIB, true, false}, {MIB, true, true}};
    struct hg_frame_info info[5];
    struct hg_refbuf *pictures[5];
    int steps[5];
    settle_runs(runs, 5, info, steps, pictures);
    for (int i = 0; i < 5; i++) {
        assert_true(info[i].error_px == 0.01f);
        assert_true(steps[i] <= 8);
        rig_assert_same(pictures[0], pictures[i]);
    }
    for (int i = 0; i < 5; i++)
        hg_refbuf_unref(pictures[i]);
}

// Within a hundredth of a pixel a single one needs more chunks than the budget holds: the picture
// settles, coarser where it must be, within the budget, and says so. It is hardly another one, and
// the same whatever was shown before.
static void test_pixel_over_budget(void **state)
{
    (void)state;
    static const struct far_run runs[] = {{0, false, false}, {5 * MIB / 16, false, false},
        {5 * MIB / 16, false, true}, {5 * MIB / 16, true, false}, {5 * MIB / 16, true, true}};
    struct hg_refbuf *pictures[5];
    struct hg_frame_info info[5];
    int steps[5];
    settle_runs(runs, 5, info, steps, pictures);
    assert_true(info[0].error_px == 0.01f);
    assert_true(info[1].error_px > 0.01f && info[1].error_px < 2.0f);
    for (int i = 2; i < 5; i++) {
        assert_true(info[1].error_px == info[i].error_px);
        rig_assert_same(pictures[1], pictures[i]);
    }
    const double apart = rig_difference(pictures[0], pictures[1]);
    print_message("the pictures differ by %.5f\n", apart);
    assert_true(apart < 0.01);
    for (int i = 0; i < 5; i++)
        hg_refbuf_unref(pictures[i]);
}

// Shadow maps are made of shares of the geometry: where a few chunks fit, the picture is that of
// all the memory there is. The work is bounded: a few batches for each share and pixel.
static void test_shadows_in_shares(void **state)
{
    (void)state;
    static const uint64_t budgets[] = {0, MIB / 2, MIB, 2 * MIB};
    struct hg_refbuf *pictures[4];
    for (int i = 0; i < 4; i++) {
        const struct hg_view_params view = {
            .width = 64, .height = 64, .samples = 2, .seed = 5, .error_px = 1.0f};
        struct rig rig;
        struct hg_frame_info info = {0};
        int steps = 0;
        levels_open(&rig, budgets[i]);
        hg_view_set_final(rig.view, i == 2);
        test_ok(hg_view_set_params(rig.view, &view, &rig.err), &rig.err);
        levels_look(&rig, 0, 0.8f);
        for (; !info.settled && steps < 1000; steps++)
            info = rig_step(&rig, 16);
        print_message("budget %llu KiB: %d steps, error %.3f px, peak %llu KiB\n",
            (unsigned long long)budgets[i] >> 10, steps, (double)info.error_px,
            (unsigned long long)geometry_stats(&rig).peak_bytes >> 10);
        assert_true(info.settled);
        assert_int_equal(info.missing_clusters, 0);
        assert_true(info.error_px == 1.0f);
        // The coarsest level is above the least budget for a moment.
        assert_true(i == 0 || geometry_stats(&rig).peak_bytes <= budgets[i] + MIB / 8);
        pictures[i] = rig_pixels(&rig, HG_PIXEL_RGBA32F);
        rig_assert_same(pictures[0], pictures[i]);
        rig_close(&rig);
    }
    for (int i = 0; i < 4; i++)
        hg_refbuf_unref(pictures[i]);
}

int main(void)
{
    hg_log_set_sink(hg_log_sink_logfmt, (void *)(intptr_t)2);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_baking_holds_nobody_up),
        cmocka_unit_test(test_budgets_do_not_show),
        cmocka_unit_test(test_history_does_not_show),
        cmocka_unit_test(test_picks),
        cmocka_unit_test(test_picks_name_the_source),
        cmocka_unit_test(test_motion_is_steady),
        cmocka_unit_test(test_far_below_needs),
        cmocka_unit_test(test_pixel_over_budget),
        cmocka_unit_test(test_shadows_in_shares),
    };
    return test_run_group(tests, setup, teardown);
}
