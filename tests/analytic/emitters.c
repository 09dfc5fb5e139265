// emitters.c - next-event sampling (lib/emitters.glsl, renderer/light/emitters/emitters.h) against
// closed forms and sums over all lights, on the device. Scenes have nothing that could be in the
// way.
#include "tests/analytic/emitters_rig.h"

#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/light/lights.h"
#include "tests/support/check.h"

// --- estimates -----------------------------------------------------------------------------------

// One light alone is exact: every sample has the same value.
static void test_one_light(void **state)
{
    (void)state;
    static struct rig r;
    const float p[3] = {0.3f, 0, 0.2f};
    for (unsigned kind = 0; kind < 3; kind++) {
        rig_open(&r);
        struct hg_light *light = rig_add_light(&r, kind, 0, 2, 0, 5);
        light->range = kind == HG_LIGHT_SPOT ? 10 : 0;
        rig_sync(&r);
        const struct estimate e = rig_estimate(&r, p, up);
        rig_expect(kind == 0   ? "directional"
                   : kind == 1 ? "point"
                               : "spot",
            e, rig_all_lights(&r, p, up), 1e-3);
        // Beside the cone of a spot, and below the horizon, nothing is chosen.
        const float aside[3] = {30, 0, 0}, down[3] = {0, -1, 0};
        if (kind == HG_LIGHT_SPOT)
            assert_true(rig_estimate(&r, aside, up).mean == 0.0);
        assert_true(rig_estimate(&r, p, down).mean == 0.0);
        rig_close(&r);
    }
}

static void test_many_lights(void **state)
{
    (void)state;
    static struct rig r;
    rig_open(&r);
    rig_add_lights(&r, 300, 20, 0);
    rig_add_light(&r, HG_LIGHT_DIRECTIONAL, 0, 0, 0, 0.5f);
    rig_add_light(&r, HG_LIGHT_DIRECTIONAL, 0, 0, 0, 1);
    rig_sync(&r);
    const float places[3][3] = {{0, 0, 0}, {9, 0.2f, -4}, {60, 0, 60}};
    for (int i = 0; i < 3; i++)
        rig_expect("302 lights", rig_estimate(&r, places[i], up), rig_all_lights(&r, places[i], up),
            0.005);
    rig_close(&r);

    rig_open(&r); // more than are weighed one by one
    for (int i = 0; i < 40; i++)
        rig_add_light(&r, HG_LIGHT_DIRECTIONAL, 0, 0, 0, 0.1f * (float)(i + 1));
    rig_sync(&r);
    rig_expect("40 suns", rig_estimate(&r, places[0], up), rig_all_lights(&r, places[0], up), 1e-3);
    rig_close(&r);
}

// A rectangle overhead, near and far, whole and in many pieces, from in front and from the side.
static void test_rectangle(void **state)
{
    (void)state;
    static struct rig r;
    const float center[3] = {0, 1, 0};
    const float places[4][3] = {{0, 0, 0}, {0.9f, 0, 0.4f}, {5, 0, 2}, {0.2f, 0.7f, 0}};
    const double corners[4][3] = {{-1, 1, -0.5}, {1, 1, -0.5}, {1, 1, 0.5}, {-1, 1, 0.5}};
    for (uint32_t squares = 1; squares <= 32; squares *= 32) {
        rig_open(&r);
        rig_add_ceiling(&r, center, 1, 0.5f, squares, 3);
        rig_sync(&r);
        for (int i = 0; i < 4; i++)
            rig_expect("rectangle", rig_estimate(&r, places[i], up),
                3 * rig_polygon(corners, 4, places[i], up), 0.01);
        const float side[3] = {1, 0, 0}, left[3] = {-3, 0, 0}, above[3] = {0, 2, 0};
        rig_expect("rectangle, from the side", rig_estimate(&r, left, side),
            3 * rig_polygon(corners, 4, left, side), 0.01);
        const float down[3] = {0, -1, 0};
        assert_true(rig_estimate(&r, above, down).mean == 0.0); // its back
        rig_close(&r);
    }
}

static void test_both_sides(void **state)
{
    (void)state;
    static struct rig r;
    const float center[3] = {0, 1, 0}, above[3] = {0.3f, 2, 0}, below[3] = {0.3f, 0, 0};
    const float down[3] = {0, -1, 0};
    const double corners[4][3] = {{-1, 1, -0.5}, {1, 1, -0.5}, {1, 1, 0.5}, {-1, 1, 0.5}};
    rig_open(&r);
    struct mesh *m = rig_add_ceiling(&r, center, 1, 0.5f, 4, 3);
    m->piece.flags = HG_DRAW_DOUBLE_SIDED;
    rig_sync(&r);
    rig_expect("double-sided, above", rig_estimate(&r, above, down),
        3 * rig_polygon(corners, 4, above, down), 0.01);
    rig_expect("double-sided, below", rig_estimate(&r, below, up),
        3 * rig_polygon(corners, 4, below, up), 0.01);
    m->piece.flags = HG_DRAW_MIRRORED; // turned round: what was the back
    rig_sync(&r);
    rig_expect(
        "mirrored", rig_estimate(&r, above, down), 3 * rig_polygon(corners, 4, above, down), 0.01);
    assert_true(rig_estimate(&r, below, up).mean == 0.0);
    rig_close(&r);
}

// A sphere's light is that of a point (E = L pi r^2 / d^2), but for the corners of the mesh.
static void test_sphere(void **state)
{
    (void)state;
    static struct rig r;
    const float center[3] = {0, 2, 0}, places[2][3] = {{0, 0, 0}, {1.5f, 0, 0}};
    rig_open(&r);
    rig_add_sphere(&r, center, 0.5f, 48, 2);
    const struct hg_emitters_stats stats = rig_sync(&r);
    assert_int_equal(stats.leaves, 2 * 48 * 96 - 2 * 96); // less the degenerate ones at the poles
    for (int i = 0; i < 2; i++) {
        const struct estimate e = rig_estimate(&r, places[i], up);
        const double dx = (double)places[i][0], d2 = dx * dx + 4;
        rig_expect("sphere", e, rig_all_triangles(&r, places[i], up), 0.005);
        probe_near(e.mean, 2 * PI * 0.25 / d2 * 2 / sqrt(d2), 0.01 * e.mean);
    }
    rig_close(&r);
}

// Leaves of many triangles, when the budget is small, give the same light.
static void test_runs(void **state)
{
    (void)state;
    static struct rig r;
    const float center[3] = {0, 2, 0}, p[3] = {0.5f, 0, 0};
    const uint64_t budgets[3] = {400000, 100000, 24000};
    for (int i = 0; i < 3; i++) {
        rig_open(&r);
        r.budget_bytes = budgets[i];
        rig_add_sphere(&r, center, 0.5f, 48, 2);
        rig_add_light(&r, HG_LIGHT_POINT, 1, 1, 1, 1);
        const struct hg_emitters_stats stats = rig_sync(&r);
        print_message("%u triangles per leaf, %u leaves, %llu of %llu bytes\n", stats.run,
            stats.leaves, (unsigned long long)stats.bytes, (unsigned long long)budgets[i]);
        assert_true(stats.run > 1 && stats.left_out == 0);
        rig_expect("runs", rig_estimate(&r, p, up),
            rig_all_triangles(&r, p, up) + rig_all_lights(&r, p, up), 0.01);
        rig_close(&r);
    }
}

// What does not fit at all is left out, never in part: its density is 0.
static void test_left_out(void **state)
{
    (void)state;
    static struct rig r;
    const float center[3] = {0, 2, 0}, p[3] = {0.5f, 0, 0};
    rig_open(&r);
    r.budget_bytes = 1;
    rig_add_sphere(&r, center, 0.5f, 48, 2);
    const struct hg_emitters_stats stats = rig_sync(&r);
    assert_int_equal(stats.left_out, 2 * 48 * 96);
    assert_int_equal(stats.leaves, 0);
    assert_true(rig_estimate(&r, p, up).mean == 0.0);
    rig_close(&r);
}

// --- textures ------------------------------------------------------------------------------------

// A square of the texture emits, the rest is black: u 1/4 .. 1/2, v 1/2 .. 3/4.
static struct hg_texture *add_texture(struct rig *r, uint32_t side)
{
    struct hg_texture *t = rig_add(r, HG_OBJECT_TEXTURE);
    t->image = hg_calloc(1, sizeof *t->image);
    assert_non_null(t->image);
    t->image->refs = 1;
    t->image->label = hg_strdup("square");
    t->image->pixels_srgb = true;
    test_ok(hg_image_create(side, side, HG_PIXEL_RGBA8, NULL, &t->image->pixels), NULL);
    for (uint32_t i = 0; i < side * side; i++) {
        const uint32_t x = 4 * (i % side) / side, y = 4 * (i / side) / side;
        memset((uint8_t *)t->image->pixels.pixels + (size_t)i * 4, x == 1 && y == 2 ? 255 : 0, 4);
    }
    return t;
}

static void *copy(const void *data, size_t bytes)
{
    void *out = hg_calloc(1, bytes);
    assert_non_null(out);
    return memcpy(out, data, bytes);
}

// The ceiling as an object of the scene.
static void add_textured_node(struct rig *r, const struct mesh *m, uint32_t squares, uint32_t side)
{
    struct hg_mesh *mesh = rig_add(r, HG_OBJECT_MESH);
    struct hg_node *node = rig_add(r, HG_OBJECT_NODE);
    struct hg_material *material = rig_add(r, HG_OBJECT_MATERIAL);
    struct hg_mesh_part *part = hg_calloc(1, sizeof *part);
    assert_non_null(part);
    *part = (struct hg_mesh_part){.topology = HG_TOPOLOGY_TRIANGLES,
        .vertex_count = m->vertices,
        .index_count = m->triangles * 3,
        .indices = copy(m->indices, m->triangles * 12),
        .positions = copy(m->positions, m->vertices * 12),
        .normals = hg_calloc(m->vertices, 12),
        .uv = {hg_calloc(m->vertices, 8), NULL},
        .material = material,
        .bounds_min = {-1, 1, -0.5f},
        .bounds_max = {1, 1, 0.5f}};
    assert_true(part->normals && part->uv[0]);
    for (uint32_t i = 0; i < m->vertices; i++) {
        part->normals[i * 3 + 1] = -1;
        part->uv[0][i * 2] = (float)(i % (squares + 1)) / (float)squares;
        part->uv[0][i * 2 + 1] = (float)(i / (squares + 1)) / (float)squares;
    }
    for (int c = 0; c < 3; c++)
        material->emissive[c] = 3;
    material->slots[HG_SLOT_EMISSIVE].texture = add_texture(r, side);
    mesh->parts = part;
    mesh->part_count = 1;
    node->mesh = mesh;
}

static struct hg_emitters_stats sync_rooms(struct rig *r)
{
    struct hg_error err = {0};
    struct hg_emitters_stats stats;
    struct hg_ray_geometry *ray_geometry = NULL;
    const struct hg_textures_params textures = {.budget_bytes = 64 << 20};
    const struct hg_geometry_params geometry = {0};
    const struct hg_ray_geometry_lens lens = {.px_scale = 500, .near = 0.1f};
    probe_sync(&r->probe);
    hg_scene_publish(r->probe.scene);
    test_ok(hg_textures_create(r->probe.gpu, &textures, &r->textures, &err), &err);
    test_ok(hg_textures_sync(r->textures, r->probe.scene, r->probe.jobs, &err), &err);
    test_ok(hg_textures_load_all(r->textures, &err), &err);
    test_ok(hg_geometry_create(r->probe.gpu, &geometry, &r->geometry, &err), &err);
    test_ok(hg_geometry_sync(r->geometry, r->probe.scene, r->textures, &err), &err);
    test_ok(hg_ray_geometry_make(r->geometry, &lens, r->probe.jobs, &ray_geometry, &err), &err);
    test_ok(hg_emitters_create(r->probe.gpu, r->probe.jobs, NULL, &r->emitters, &err), &err);
    test_ok(
        hg_emitters_sync(r->emitters, r->geometry, ray_geometry, r->probe.scene, r->textures, &err),
        &err);
    hg_emitters_fill(r->emitters, &r->block);
    hg_emitters_stats(r->emitters, &stats);
    hg_ray_geometry_free(ray_geometry);
    return stats;
}

// What a texture leaves black is hardly ever chosen, and the light is that of the rest.
static void test_textured(void **state)
{
    (void)state;
    static struct rig r;
    const float center[3] = {0, 1, 0}, p[3] = {0.3f, 0, 0.1f};
    const double lit[4][3] = {{-0.5, 1, 0}, {0, 1, 0}, {0, 1, 0.25}, {-0.5, 1, 0.25}};
    const uint32_t squares[2] = {1, 32}, sides[2] = {64, 1024};
    for (int i = 0; i < 2; i++) {
        rig_open(&r);
        struct mesh *m = rig_add_ceiling(&r, center, 1, 0.5f, squares[i], 3);
        add_textured_node(&r, m, squares[i], sides[i]);
        const struct hg_emitters_stats stats = sync_rooms(&r);
        const struct estimate e = rig_estimate(&r, p, up);
        print_message("%u of %llu triangles\n", stats.leaves, (unsigned long long)stats.triangles);
        rig_expect("textured", e, 3 * rig_polygon(lit, 4, p, up), 0.01);
        // A sixteenth of them emit, and their neighbours may.
        assert_true(i == 0 || (stats.leaves >= 128 && stats.leaves < 256));
        assert_true(i == 0 || e.sigma < 0.7 * e.mean);
        rig_close(&r);
    }
}

// --- environments --------------------------------------------------------------------------------

static double brute_environment(const struct rig *r, const float n[3])
{
    const struct hg_environment *env = &r->probe.scene->environment;
    const uint32_t width = env->image.width, height = env->image.height;
    double sum = 0;
    for (uint32_t y = 0; y < height; y++)
        for (uint32_t x = 0; x < width; x++) {
            const double theta = PI * (y + 0.5) / height, phi = 2 * PI * ((x + 0.5) / width - 0.5);
            const double d[3] = {sin(theta) * cos(phi), cos(theta), sin(theta) * sin(phi)};
            const double turn = (double)env->rotation_rad;
            const double w[3] = {
                d[0] * cos(turn) + d[2] * sin(turn), d[1], d[2] * cos(turn) - d[0] * sin(turn)};
            const double facing = w[0] * (double)n[0] + w[1] * (double)n[1] + w[2] * (double)n[2];
            const double angle =
                2 * PI / width * (cos(PI * y / height) - cos(PI * (y + 1) / height));
            sum += fmax(0, facing) * angle *
                   (double)((const float *)env->image.pixels)[((size_t)y * width + x) * 4 + 1];
        }
    return sum * (double)env->intensity;
}

// A sun of a few texels that is half of the light; grids as fine as the image, finer and coarser.
static void test_environment(void **state)
{
    (void)state;
    static struct rig r;
    const float origin[3] = {0, 0, 0}, aslant[3] = {0.6f, 0, -0.8f};
    const uint32_t widths[4] = {1024, 600, 4096, 64};
    const float suns[4] = {20000, 4000, 60000, 0};
    for (int i = 0; i < 4; i++) {
        rig_open(&r);
        rig_set_image(&r, widths[i], suns[i], 0.3f);
        const struct hg_emitters_stats stats = rig_sync(&r);
        print_message(
            "environment of %u texels: %.1f ms\n", widths[i], (double)stats.warp_ns * 1e-6);
        rig_expect("environment", rig_estimate(&r, origin, up), brute_environment(&r, up), 0.005);
        rig_expect("environment, aslant", rig_estimate(&r, origin, aslant),
            brute_environment(&r, aslant), 0.02);
        rig_close(&r);
    }
}

static void test_constant_environment(void **state)
{
    (void)state;
    static struct rig r;
    const float p[3] = {1, 2, 3};
    rig_open(&r);
    struct hg_environment *env = &r.probe.scene->environment;
    env->kind = HG_ENV_COLOR;
    env->intensity = 2;
    for (int c = 0; c < 3; c++)
        env->color[c] = 0.25f;
    rig_sync(&r);
    rig_expect("constant environment", rig_estimate(&r, p, up), 0.5 * PI, 1e-3);
    rig_expect(
        "constant environment, both sides", rig_estimate(&r, p, everywhere), 0.5 * 4 * PI, 1e-3);
    rig_close(&r);
}

static void test_sky(void **state)
{
    (void)state;
    static struct rig r;
    const float p[3] = {0, 0, 0};
    rig_open(&r);
    struct hg_environment *env = &r.probe.scene->environment;
    env->kind = HG_ENV_SKY;
    env->intensity = 1;
    env->turbidity = 2;
    env->sun_direction[0] = 0.6f;
    env->sun_direction[1] = 0.8f;
    rig_sync(&r);
    const struct estimate with_disc = rig_estimate(&r, p, up);
    print_message("sky: %.3f, noise of the mean %.3f\n", with_disc.mean, with_disc.error);
    assert_true(with_disc.bad == 0.0 && with_disc.error < 0.01 * with_disc.mean);
    assert_true(with_disc.mean > 2 && with_disc.mean < 4); // about 0.8 * 3.2 lux and the sky's half
    // A directional light stands for the disc.
    struct hg_light *sun = rig_add_light(&r, HG_LIGHT_DIRECTIONAL, 0, 0, 0, 1);
    rig_sync(&r);
    const struct estimate without = rig_estimate(&r, p, up);
    assert_true(without.mean - 1 < 0.5 * with_disc.mean);
    sun->intensity = 0;
    rig_close(&r);
}

// Everything at once.
static void test_all_kinds(void **state)
{
    (void)state;
    static struct rig r;
    const float center[3] = {0, 1, 0}, p[3] = {0.3f, 0, 0.1f};
    rig_open(&r);
    rig_add_ceiling(&r, center, 0.2f, 0.2f, 4, 5);
    rig_add_lights(&r, 50, 6, 3);
    rig_add_light(&r, HG_LIGHT_DIRECTIONAL, 0, 0, 0, 0.5f);
    rig_set_image(&r, 512, 3000, 0.2f);
    rig_sync(&r);
    const double expected =
        rig_all_triangles(&r, p, up) + rig_all_lights(&r, p, up) + brute_environment(&r, up);
    rig_expect("all kinds", rig_estimate(&r, p, up), expected, 0.01);
    rig_close(&r);
}

// --- many lights ---------------------------------------------------------------------------------

// Ten thousand lights: far less noise than a light at random, for little more work than ten need.
static void test_ten_thousand(void **state)
{
    (void)state;
    static struct rig r;
    const float p[3] = {3, 0, -2};
    struct estimate few, many, uniform;
    rig_open(&r);
    rig_add_lights(&r, 10, 20, 0);
    rig_sync(&r);
    few = rig_estimate(&r, p, up);
    rig_expect("10 lights", few, rig_all_lights(&r, p, up), 0.01);
    rig_close(&r);
    rig_open(&r);
    rig_add_lights(&r, 10000, 200, 0);
    const struct hg_emitters_stats stats = rig_sync(&r);
    many = rig_estimate(&r, p, up);
    uniform = rig_estimate_as(&r, OP_UNIFORM, p, up, 4096);
    rig_expect("10000 lights", many, rig_all_lights(&r, p, up), 0.01);
    print_message(
        "10000 lights: tree of depth %u built in %.1f ms; variance %.4g, of uniform choice "
        "%.4g (%.0f times); %.1f nodes per sample, %.1f for ten lights\n",
        stats.depth, (double)stats.build_ns * 1e-6, many.sigma * many.sigma,
        uniform.sigma * uniform.sigma, pow(uniform.sigma / many.sigma, 2), many.work, few.work);
    assert_true(uniform.sigma * uniform.sigma > 50 * many.sigma * many.sigma);
    assert_true(many.work < 5 * few.work);
    rig_close(&r);
}

// --- hostile scenes ------------------------------------------------------------------------------

static void test_hostile(void **state)
{
    (void)state;
    static struct rig r;
    const float center[3] = {0, 1, 0}, p[3] = {0.3f, 0, 0.1f};
    rig_open(&r);
    struct mesh *good = rig_add_ceiling(&r, center, 1, 0.5f, 4, 3);
    // No area, NaN, infinite, too large, and an index that is out of range.
    struct mesh *bad = rig_add_mesh(&r, 8, 6, 3);
    const float wild[8][3] = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {NAN, 0, 0}, {INFINITY, 1, 0},
        {3e38f, 3e38f, 0}, {-3e38f, 3e38f, 3e38f}, {1e-30f, 1e-30f, 0}};
    const uint32_t index[18] = {0, 1, 2, 0, 1, 3, 0, 1, 4, 0, 5, 6, 0, 0, 0, 0, 7, 7};
    memcpy(bad->positions, wild, sizeof wild);
    memcpy(bad->indices, index, sizeof index);
    struct mesh *flat = rig_add_ceiling(&r, center, 1, 0.5f, 2, 3); // a singular matrix
    flat->piece.world[0] = flat->piece.world[4] = flat->piece.world[8] = 0;
    struct mesh *black = rig_add_ceiling(&r, center, 1, 0.5f, 2, 0);
    black->material.emissive[0] = NAN;
    struct hg_light *light = rig_add_light(&r, HG_LIGHT_POINT, 0, 2, 0, 0);
    light = rig_add_light(&r, HG_LIGHT_POINT, NAN, 2, 0, 1);
    light = rig_add_light(&r, HG_LIGHT_SPOT, 0, 2, 0, INFINITY);
    light = rig_add_light(&r, HG_LIGHT_DIRECTIONAL, 0, 2, 0, NAN);
    light->color[0] = NAN;
    struct hg_emitters_stats stats = rig_sync(&r);
    assert_int_equal(stats.leaves, 32);
    const struct estimate e = rig_estimate(&r, p, up);
    const double corners[4][3] = {{-1, 1, -0.5}, {1, 1, -0.5}, {1, 1, 0.5}, {-1, 1, 0.5}};
    rig_expect("hostile", e, 3 * rig_polygon(corners, 4, p, up), 0.01);
    // On the light, in its plane, far away.
    const float places[4][3] = {{0, 1, 0}, {5, 1, 0}, {1e20f, 0, 0}, {-1, 1, -0.5f}};
    for (int i = 0; i < 4; i++)
        assert_true(rig_estimate_as(&r, OP_ESTIMATE, places[i], up, 64).bad == 0.0);
    assert_non_null(good);

    // No emitters.
    rig_close(&r);
    rig_open(&r);
    stats = rig_sync(&r);
    assert_int_equal(stats.leaves, 0);
    assert_true(rig_estimate_as(&r, OP_ESTIMATE, p, up, 64).mean == 0.0);
    rig_close(&r);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_one_light),
        cmocka_unit_test(test_many_lights),
        cmocka_unit_test(test_rectangle),
        cmocka_unit_test(test_both_sides),
        cmocka_unit_test(test_sphere),
        cmocka_unit_test(test_runs),
        cmocka_unit_test(test_left_out),
        cmocka_unit_test(test_textured),
        cmocka_unit_test(test_environment),
        cmocka_unit_test(test_constant_environment),
        cmocka_unit_test(test_sky),
        cmocka_unit_test(test_all_kinds),
        cmocka_unit_test(test_ten_thousand),
        cmocka_unit_test(test_hostile),
    };
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, rig_setup, rig_teardown);
}
