// irradiance_cells.c - the hash grid of gathered light: which surfaces share a cell, what lies
// between cells, what new, old and outdated cells know.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "renderer/irradiance/cells.h"

#define FINEST 0.25f // metres; a level of 0 has such cubes

static struct hg_irradiance_cells cells;

static int set_up(void **state)
{
    (void)state;
    return hg_irradiance_cells_init(&cells, FINEST) == HG_OK ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    hg_irradiance_cells_finish(&cells);
    return 0;
}

static struct hg_irradiance_point at(float x, float y, float z, int level)
{
    return (struct hg_irradiance_point){{x, y, z}, {0, 1, 0}, level, NULL};
}

static bool find(const struct hg_irradiance_point *point, struct hg_irradiance_place *place)
{
    const struct hg_irradiance_query query = hg_irradiance_query(&cells, point);
    return hg_irradiance_ask(&cells, &query, place);
}

// HG_IRRADIANCE_NONE: there is no room.
static uint32_t ask(const struct hg_irradiance_point *point)
{
    struct hg_irradiance_place place;
    return find(point, &place) ? place.cell : HG_IRRADIANCE_NONE;
}

// So many samples of light and of half as much without.
static void fill(const struct hg_irradiance_point *point, float light, int samples)
{
    const struct hg_irradiance_sums sample = {
        .gathered = {light, 2 * light, 3 * light}, .without = {light / 2, light, 3 * light / 2}};
    for (int i = 0; i < samples; i++) {
        struct hg_irradiance_place place;
        assert_true(find(point, &place));
        hg_irradiance_add(&cells, &place, &sample);
    }
}

static struct hg_irradiance_sums look(const struct hg_irradiance_point *point)
{
    struct hg_irradiance_lookups lookups = {0};
    struct hg_irradiance_sums sums;
    hg_irradiance_look_up(&cells, point, &lookups, &sums);
    return sums;
}

static void test_levels(void **state)
{
    (void)state;
    assert_int_equal(hg_irradiance_level(&cells, 0), 0);
    assert_int_equal(hg_irradiance_level(&cells, FINEST), 0);
    assert_int_equal(hg_irradiance_level(&cells, 2 * FINEST), 1);
    assert_int_equal(hg_irradiance_level(&cells, 40 * FINEST), 5);
    assert_int_equal(hg_irradiance_level(&cells, 1e30f), HG_IRRADIANCE_LEVELS - 1);
}

// A cube is for one side of surfaces, one level and one place, on both sides of the origin.
static void test_who_shares(void **state)
{
    (void)state;
    struct hg_irradiance_point points[6] = {at(0.1f, 0.1f, 0.1f, 0), at(0.2f, 0.05f, 0.2f, 0),
        at(-0.1f, 0.1f, 0.1f, 0), at(0.1f, 0.1f, 0.1f, 3), at(0.1f, 0.1f, 0.1f, 0),
        at(0.1f, 0.1f, 0.1f, 0)};
    uint32_t asked[6];
    points[4].normal[1] = -1;
    points[5] = (struct hg_irradiance_point){{0.1f, 0.1f, 0.1f}, {0.8f, 0.6f, 0}, 0, NULL};
    for (int i = 0; i < 6; i++)
        asked[i] = ask(&points[i]);
    assert_int_equal(asked[0], asked[1]);
    for (int i = 2; i < 6; i++)
        for (int k = 1; k < i; k++)
            assert_int_not_equal(asked[i], asked[k]);
    assert_int_equal(cells.count, 2 * 5); // each has a larger one
    hg_irradiance_cells_clear(&cells);
    assert_int_equal(cells.count, 0);
}

// Each point of a cell's sequence is taken once, and again from the first one on in another light.
static void test_turns(void **state)
{
    (void)state;
    const struct hg_irradiance_point p = at(0.1f, 0.1f, 0.1f, 0);
    const uint32_t cell = ask(&p);
    for (uint32_t i = 0; i < 3; i++) {
        const struct hg_irradiance_turn turn = hg_irradiance_take_turn(&cells, cell);
        assert_int_equal(turn.number, i);
        assert_true(turn.key == cells.cells[cell].key);
    }
    cells.light++;
    assert_int_equal(ask(&p), cell);
    assert_int_equal(hg_irradiance_take_turn(&cells, cell).number, 0);
    hg_irradiance_cells_clear(&cells);
}

static void test_between(void **state)
{
    (void)state;
    const struct hg_irradiance_point a = at(0.5f, 0.5f, 0.5f, 2), b = at(1.5f, 0.5f, 0.5f, 2);
    const struct hg_irradiance_point nothing = at(5, 5, 5, 2);
    struct hg_irradiance_place place;
    fill(&a, 1, 100);
    fill(&b, 3, 100);
    assert_true(find(&a, &place));
    const struct hg_irradiance_sums *both = &cells.cells[place.larger].sums;
    const float around = both->gathered[0] / both->samples, counts = look(&a).samples - 100;
    assert_true(around > 1 && around < 3 && counts > 0 && counts < 100);
    for (int i = 0; i <= 4; i++) { // linear from one middle to the other, beside what is around
        const float f = (float)i / 4;
        const struct hg_irradiance_point p = at(0.5f + f, 0.5f, 0.5f, 2);
        const struct hg_irradiance_sums s = look(&p);
        const float want = 100 * (1 + 2 * f) + counts * around;
        assert_float_equal(s.samples, 100 + counts, 1e-2);
        assert_float_equal(s.gathered[0], want, 1e-2);
        assert_float_equal(s.gathered[2], 3 * want, 3e-2);
        assert_float_equal(s.without[1], want, 1e-2);
    }
    assert_true(look(&nothing).samples == 0);
    // One after the other along a line, with what the one before has found.
    struct hg_irradiance_lookups lookups = {0};
    for (int i = 0; i <= 60; i++) {
        const struct hg_irradiance_point p = at(-1 + 0.1f * (float)i, 0.5f, 0.4f, 2);
        const struct hg_irradiance_sums alone = look(&p);
        struct hg_irradiance_sums next;
        hg_irradiance_look_up(&cells, &p, &lookups, &next);
        assert_memory_equal(&next, &alone, sizeof next);
    }
    hg_irradiance_cells_clear(&cells);
}

// A new cell begins with what a larger one, or a smaller one, has there, as few samples.
static void test_new_cells(void **state)
{
    (void)state;
    const struct hg_irradiance_point large = at(0.5f, 0.5f, 0.5f, 2),
                                     small = at(0.3f, 0.3f, 0.3f, 1);
    const struct hg_irradiance_point smallest = at(0.3f, 0.3f, 0.3f, 0);
    fill(&large, 2, 100);
    const uint32_t cell = ask(&small);
    const struct hg_irradiance_sums *s = &cells.cells[cell].sums;
    assert_true(s->samples > 0 && s->samples < 100);
    assert_float_equal(s->gathered[0] / s->samples, 2, 1e-5);
    const uint32_t next = ask(&smallest);
    assert_float_equal(
        cells.cells[next].sums.gathered[1] / cells.cells[next].sums.samples, 4, 1e-5);
    hg_irradiance_cells_clear(&cells);
    fill(&small, 5, 8);
    const uint32_t up = ask(&large);
    assert_float_equal(cells.cells[up].sums.gathered[0] / cells.cells[up].sums.samples, 5, 1e-5);
    hg_irradiance_cells_clear(&cells);
}

// Where light has changed, what was gathered before counts as few samples, for lookups as well.
static void test_another_light(void **state)
{
    (void)state;
    const struct hg_irradiance_point p = at(0.5f, 0.5f, 0.5f, 2);
    fill(&p, 1, 200);
    const float before = look(&p).samples;
    cells.light++;
    const struct hg_irradiance_sums outdated = look(&p);
    assert_true(before > 150 && outdated.samples < 10); // 4 of either cell
    assert_float_equal(outdated.gathered[0] / outdated.samples, 1, 1e-5);
    fill(&p, 3, 30);
    const struct hg_irradiance_sums after = look(&p);
    assert_true(after.gathered[0] / after.samples > 2.7f);
    hg_irradiance_cells_clear(&cells);
}

// What is around a place counts beside its own cell, and alone where there is none.
static void test_larger(void **state)
{
    (void)state;
    const struct hg_irradiance_point known = at(0.1f, 0.1f, 0.1f, 0),
                                     other = at(0.8f, 0.1f, 0.8f, 0), far = at(9, 0.1f, 9, 0);
    fill(&known, 2, 100);
    const struct hg_irradiance_sums s = look(&other);
    assert_true(s.samples > 0 && s.samples < 100);
    assert_float_equal(s.gathered[0] / s.samples, 2, 1e-4);
    assert_true(look(&far).samples == 0);
    fill(&other, 6, 200);
    const struct hg_irradiance_sums own = look(&other);
    assert_true(own.samples > s.samples && own.gathered[0] / own.samples > 5);
    hg_irradiance_cells_clear(&cells);
}

// What rough surfaces mirror has cells by where the eye is; it is no diffuse light, and eyes on
// other sides do not disturb each other.
static void test_views(void **state)
{
    (void)state;
    const float eyes[3][3] = {{4, 3, 0.5f}, {4.2f, 3, 0.6f}, {-4, 3, 0.5f}};
    const struct hg_irradiance_point diffuse = at(0.5f, 0.5f, 0.5f, 2);
    struct hg_irradiance_point seen[3];
    for (int i = 0; i < 3; i++) {
        seen[i] = diffuse;
        seen[i].eye = eyes[i];
    }
    fill(&diffuse, 1, 100);
    assert_true(look(&seen[0]).samples == 0);
    fill(&seen[0], 5, 100);
    assert_int_equal(ask(&seen[0]), ask(&seen[1]));
    const float low[3] = {4, 1.2f, 0.5f}; // on the same side, but 25 degrees lower
    struct hg_irradiance_point lower = diffuse;
    lower.eye = low;
    assert_int_not_equal(ask(&lower), ask(&seen[0]));
    const uint32_t opposite = ask(&seen[2]);
    assert_int_not_equal(opposite, ask(&seen[0]));
    assert_int_not_equal(opposite, ask(&diffuse));
    // It begins with what was seen from the first side, as few samples.
    const struct hg_irradiance_sums *s = &cells.cells[opposite].sums;
    assert_true(s->samples > 0 && s->samples < 100);
    assert_float_equal(s->gathered[0] / s->samples, 5, 1e-4);
    fill(&seen[2], 9, 600);
    const struct hg_irradiance_sums a = look(&seen[0]), b = look(&seen[2]), c = look(&diffuse);
    assert_float_equal(a.gathered[0] / a.samples, 5, 1e-4);
    assert_true(b.gathered[0] / b.samples > 8.5f);
    assert_float_equal(c.gathered[0] / c.samples, 1, 1e-4);
    hg_irradiance_cells_clear(&cells);
}

// Means follow: they are never of more than some hundred samples.
static void test_follows(void **state)
{
    (void)state;
    const struct hg_irradiance_point p = at(0.5f, 0.5f, 0.5f, 2);
    fill(&p, 1, 5000);
    fill(&p, 2, 1000);
    const struct hg_irradiance_sums s = look(&p);
    assert_true(s.samples <= 256.01f);
    assert_float_equal(s.gathered[0] / s.samples, 2, 0.05);
    hg_irradiance_cells_clear(&cells);
}

// Many more places than cells: the table stays as large as it is; what is in use is not taken away,
// what was not asked for any more makes room.
static void test_full(void **state)
{
    (void)state;
    uint32_t none = 0;
    for (uint32_t i = 0; i < 2 * HG_IRRADIANCE_CELLS; i++) {
        const struct hg_irradiance_point p = at((float)(i % 1024), 0, (float)(i / 1024), 0);
        none += ask(&p) == HG_IRRADIANCE_NONE;
    }
    assert_true(cells.count <= HG_IRRADIANCE_CELLS && cells.count > HG_IRRADIANCE_CELLS / 2);
    assert_true(none >= HG_IRRADIANCE_CELLS && none < 2 * HG_IRRADIANCE_CELLS);
    cells.picture += 1000;
    for (uint32_t i = 0; i < HG_IRRADIANCE_CELLS / 16; i++) {
        const struct hg_irradiance_point p = at(-1 - (float)(i % 256), 8, (float)(i / 256), 0);
        assert_true(ask(&p) != HG_IRRADIANCE_NONE);
    }
    hg_irradiance_cells_clear(&cells);
}

// Places that are no numbers, or far away, have a cell like all others.
static void test_far(void **state)
{
    (void)state;
    const float places[4] = {1e9f, -1e30f, INFINITY, NAN};
    for (int i = 0; i < 4; i++) {
        const struct hg_irradiance_point p = at(places[i], places[i], 0, 0);
        struct hg_irradiance_sums s = look(&p);
        (void)s;
        assert_true(ask(&p) != HG_IRRADIANCE_NONE);
    }
    hg_irradiance_cells_clear(&cells);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_levels),
        cmocka_unit_test(test_who_shares), cmocka_unit_test(test_turns),
        cmocka_unit_test(test_between), cmocka_unit_test(test_new_cells),
        cmocka_unit_test(test_another_light), cmocka_unit_test(test_larger),
        cmocka_unit_test(test_views), cmocka_unit_test(test_follows), cmocka_unit_test(test_full),
        cmocka_unit_test(test_far)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
