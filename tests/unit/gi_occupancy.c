// gi_occupancy.c - probes that lookups from surfaces read are needed, and not many others.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "renderer/gi/occupancy.h"
#include "renderer/math/vec.h"
#include "tests/support/check.h"

enum { TRIANGLES = 200, LOOKUPS = 400 };

static uint32_t random_state = 1;

static float random_in(float low, float high)
{
    random_state = random_state * 1664525u + 1013904223u;
    return low + (high - low) * (float)(random_state >> 8) * (1.0f / 16777216.0f);
}

struct scene {
    float positions[TRIANGLES * 9];
    uint32_t indices[TRIANGLES * 3], first_pieces[3];
    struct hg_ray_geometry_piece piece;
    struct hg_host_surfaces surfaces;
    struct hg_gi_field field;
};

static void scene_init(struct scene *s, uint32_t triangles)
{
    for (uint32_t i = 0; i < triangles * 3; i++)
        s->indices[i] = i;
    s->piece = (struct hg_ray_geometry_piece){.triangle_count = triangles,
        .vertex_count = triangles * 3,
        .positions = s->positions,
        .indices = s->indices,
        .world = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    s->first_pieces[0] = 0;
    s->first_pieces[1] = 1;
    s->surfaces = (struct hg_host_surfaces){
        .pieces = &s->piece, .piece_count = 1, .first_pieces = s->first_pieces, .draw_count = 1};
}

static void place(struct scene *s, const float min[3], const float max[3])
{
    s->field = (struct hg_gi_field){0};
    struct hg_gi_field grid = {0};
    hg_gi_field_grid(&grid, min, max);
    assert_int_equal(hg_gi_field_place_grid(&s->field, &grid), HG_OK);
    hg_gi_occupy(&s->field, &s->surfaces);
}

static uint32_t count_needed(const struct hg_gi_field *f)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < f->count; i++)
        n += f->needed[i];
    return n;
}

// As hg_gi_field_irradiance chooses its eight probes, for a point that was lifted already.
static void check_lookup(const struct hg_gi_field *f, const float lifted[3])
{
    uint32_t base[3];
    for (int a = 0; a < 3; a++) {
        const float at = floorf((lifted[a] - f->origin[a]) / f->spacing);
        const float most = f->counts[a] > 1 ? (float)(f->counts[a] - 2) : 0;
        base[a] = (uint32_t)hg_clampf(at, 0, most);
    }
    for (uint32_t i = 0; i < 8; i++) {
        uint32_t cell[3];
        for (int a = 0; a < 3; a++) {
            cell[a] = base[a] + (i >> a & 1);
            cell[a] = cell[a] < f->counts[a] ? cell[a] : f->counts[a] - 1;
        }
        assert_true(f->needed[(cell[2] * f->counts[1] + cell[1]) * f->counts[0] + cell[0]]);
    }
}

// A random place on a triangle, as far off as the bias of lookups takes it, and in any direction.
static void look_at(const struct scene *s, uint32_t triangle)
{
    const float *v = s->positions + (size_t)triangle * 9;
    float a = random_in(0, 1), b = random_in(0, 1), lifted[3], off[3];
    if (a + b > 1) {
        a = 1 - a;
        b = 1 - b;
    }
    for (int k = 0; k < 3; k++)
        off[k] = random_in(-1, 1);
    hg_normalize3(off);
    for (int k = 0; k < 3; k++)
        lifted[k] = v[k] + a * (v[3 + k] - v[k]) + b * (v[6 + k] - v[k]) +
                    off[k] * (HG_PROBE_BIAS_NORMAL + HG_PROBE_BIAS_VIEW) * s->field.spacing;
    check_lookup(&s->field, lifted);
}

static void put_triangles(struct scene *s, uint32_t count, float size, float spread)
{
    for (uint32_t t = 0; t < count; t++) {
        const float at[3] = {
            random_in(-spread, spread), random_in(-spread, spread), random_in(-spread, spread)};
        for (int i = 0; i < 9; i++)
            s->positions[t * 9 + (uint32_t)i] = at[i % 3] + random_in(-size, size);
    }
}

static void test_all_that_lookups_read(void **state)
{
    (void)state;
    static const float sizes[] = {0.01f, 0.3f, 2, 10};
    static struct scene s;
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++) {
        const uint32_t count = k < 2 ? TRIANGLES : 6;
        const float low[3] = {-10, -4, -10}, high[3] = {10, 4, 10};
        put_triangles(&s, count, sizes[k], 4);
        scene_init(&s, count);
        place(&s, low, high);
        for (uint32_t i = 0; i < LOOKUPS; i++)
            look_at(&s, i % count);
        assert_true(k > 0 || count_needed(&s.field) < s.field.count);
        hg_gi_field_finish(&s.field, NULL);
    }
}

// The faces of a box: its inside is as empty as a room's.
static void test_middle_of_a_room(void **state)
{
    (void)state;
    static struct scene s;
    const float low[3] = {-5, -5, -5}, high[3] = {5, 5, 5};
    for (uint32_t face = 0; face < 6; face++) {
        const uint32_t axis = face / 2, u = (axis + 1) % 3, v = (axis + 2) % 3;
        static const float corners[6][2] = {{-5, -5}, {5, -5}, {5, 5}, {-5, -5}, {5, 5}, {-5, 5}};
        for (uint32_t i = 0; i < 6; i++) {
            float *at = s.positions + face * 18 + i * 3;
            at[axis] = face & 1 ? 5 : -5;
            at[u] = corners[i][0];
            at[v] = corners[i][1];
        }
    }
    scene_init(&s, 12);
    place(&s, low, high);
    const uint32_t needed = count_needed(&s.field), x = s.field.counts[0];
    assert_int_equal(s.field.counts[1], x);
    assert_int_equal(
        s.field.count - needed, (x - 4) * (x - 4) * (x - 4)); // two layers, by symmetry
    hg_gi_field_finish(&s.field, NULL);
}

// What has no triangles, and numbers that are none.
static void test_when_in_doubt(void **state)
{
    (void)state;
    static struct scene s;
    const float low[3] = {-10, -10, -10}, high[3] = {10, 10, 10};
    put_triangles(&s, 1, 0.1f, 0);
    scene_init(&s, 1);
    s.first_pieces[2] = 1; // a draw of lines
    s.surfaces.draw_count = 2;
    place(&s, low, high);
    assert_int_equal(count_needed(&s.field), s.field.count);
    hg_gi_field_finish(&s.field, NULL);
    s.surfaces.draw_count = 1;
    s.positions[3] = NAN;
    s.positions[7] = INFINITY;
    place(&s, low, high);
    assert_true(count_needed(&s.field) > 0);
    hg_gi_field_finish(&s.field, NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_all_that_lookups_read),
        cmocka_unit_test(test_middle_of_a_room),
        cmocka_unit_test(test_when_in_doubt),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
