// path_media.c - what lies between a surface and a light, path-traced: volumes that absorb, panes,
// surfaces that let light through and hold an alpha that does not count, lights that nothing
// shades, volumes within volumes.
//
// A white Lambert plane is seen from above, as in path_light.c: radiance = irradiance / pi.
#include <math.h>
#include <string.h>

#include "renderer/internal.h"
#include "shaders/shared/path.h"
#include "tests/analytic/path_rig.h"

enum { SIDE = 48, BLOCK = 12 };

static const double water = 0.3; // absorption per metre

static const struct rig_camera camera = {.eye = {1, 4, 2.5},
    .target = {0, 0, 0},
    .vfov_rad = 0.8,
    .width = SIDE,
    .height = SIDE,
    .samples = 64,
    .mode = HG_MODE_PATH,
    .max_bounces = 3};

static void add_plane(struct rig *rig)
{
    rig_scene(rig);
    path_rig_floor(rig, path_rig_lambert(rig, 1), 9);
}

static struct hg_material *clear_glass(struct rig *rig, float ior)
{
    struct hg_material *m = rig_material(rig);
    m->roughness = 0;
    m->transmission = 1;
    m->ior = ior;
    m->has_ior = true;
    m->double_sided = true;
    return m;
}

// A horizontal rectangle that faces down.
static void add_ceiling(struct rig *rig, struct hg_material *m, float y, float half)
{
    const float corners[4][3] = {
        {-half, y, -half}, {half, y, -half}, {half, y, half}, {-half, y, half}};
    rig_quad(rig, m, corners);
}

static struct hg_light *add_lamp(struct rig *rig, const double at[3], float intensity)
{
    static const double down[3] = {0, -1, 0};
    struct hg_light *light = rig_light(rig, HG_LIGHT_POINT, at, down);
    light->intensity = intensity;
    light->casts_shadow = true;
    return light;
}

static double mean_of(const struct hg_refbuf *pixels)
{
    const float *rgba = (const float *)(const void *)pixels->data;
    double sum = 0;
    for (int i = 0; i < SIDE * SIDE; i++)
        sum += (double)rgba[i * 4 + 1];
    return sum / (SIDE * SIDE);
}

// The device walks rays ten times slower than Embree, and what it may get wrong there (a hit that
// is missing, or of the wrong side) is much: a third of the samples, bounds of twice the width,
// since noise falls with the root of their number.
static bool on_device(const struct rig *rig)
{
    return rig_trace(rig, HG_VIEW_TRACE_AUTO) != HG_VIEW_TRACE_AUTO;
}

static double render_mean(struct rig *rig, const struct rig_camera *c)
{
    struct rig_camera fewer = *c;
    fewer.samples /= on_device(rig) ? 3 : 1;
    struct hg_refbuf *pixels = rig_render(rig, &fewer);
    const double mean = mean_of(pixels);
    hg_refbuf_unref(pixels);
    return mean;
}

typedef double radiance_fn(const double p[3]);

// Mean over the picture of what a point of the plane shows.
static double expected_mean(radiance_fn *radiance)
{
    double sum = 0;
    for (int i = 0; i < SIDE * SIDE; i++) {
        double d[3], p[3];
        rig_ray(&camera, i % SIDE + 0.5, i / SIDE + 0.5, d);
        for (int a = 0; a < 3; a++)
            p[a] = camera.eye[a] - d[a] * camera.eye[1] / d[1];
        sum += radiance(p);
    }
    return sum / (SIDE * SIDE);
}

static void expect(
    const struct rig *rig, const char *name, double got, double expected, double tolerance)
{
    print_message(
        "%s: %.5f, %.5f expected (%+.3f %%)\n", name, got, expected, (got / expected - 1) * 100);
    assert_true(fabs(got / expected - 1) <= tolerance * (on_device(rig) ? 2 : 1));
}

static double distance_to(const double a[3], const double b[3])
{
    double d2 = 0;
    for (int i = 0; i < 3; i++)
        d2 += (a[i] - b[i]) * (a[i] - b[i]);
    return sqrt(d2);
}

// --- volumes -------------------------------------------------------------------------------------

enum { DEPTH = 3 }; // of the water; the camera is above

static void add_water(struct rig *rig)
{
    struct hg_material *m = clear_glass(rig, 1);
    m->double_sided = false;
    m->volume.thickness = 1;
    m->volume.attenuation_distance = 1;
    for (int c = 0; c < 3; c++)
        m->volume.attenuation_color[c] = (float)exp(-water);
    path_rig_box(rig, m, (const float[3]){-20, -1, -20}, (const float[3]){20, DEPTH, 20});
}

static double left_on_the_way_up(const double p[3])
{
    return exp(-water * distance_to(camera.eye, p) * DEPTH / camera.eye[1]);
}

static const double sunk[3] = {0.5, 2, -0.5};

static double sunk_lamp(const double p[3])
{
    const double d = distance_to(sunk, p);
    return 20 / (d * d) * (sunk[1] / d) * exp(-water * d) / M_PI * left_on_the_way_up(p);
}

// A square lamp of radiance 5 beside what is seen: a grid of small ones.
static double sunk_square(const double p[3])
{
    enum { GRID = 24 };
    double sum = 0;
    for (int i = 0; i < GRID * GRID; i++) {
        const double at[3] = {
            2.0 * (i % GRID + 0.5) / GRID - 4, 2, 2.0 * (i / GRID + 0.5) / GRID - 1};
        const double d = distance_to(at, p), cosine = at[1] / d;
        sum += 5 * cosine * cosine / (d * d) * exp(-water * d) * 4 / (GRID * GRID);
    }
    return sum / M_PI * left_on_the_way_up(p);
}

// Lights in a volume are dimmed on their way, however they are found.
static void test_light_in_volume(void **state)
{
    struct rig *rig = *state;
    add_plane(rig);
    add_water(rig);
    add_lamp(rig, sunk, 20);
    expect(rig, "lamp in a volume", render_mean(rig, &camera), expected_mean(sunk_lamp), 0.002);

    static const char *const names[] = {"", "square, asked", "square, run into", "square, both"};
    const double expected = expected_mean(sunk_square);
    for (uint32_t use = 1; use <= 3; use++) {
        add_plane(rig);
        add_water(rig);
        struct hg_material *m = path_rig_lambert(rig, 0);
        m->emissive[0] = m->emissive[1] = m->emissive[2] = 5;
        const float corners[4][3] = {{-4, 2, -1}, {-2, 2, -1}, {-2, 2, 1}, {-4, 2, 1}};
        rig_quad(rig, m, corners);
        rig->renderer->context.overrides.path_estimators = use;
        struct rig_camera c = camera;
        c.samples = use == HG_PATH_USE_SURFACES ? 512 : 64;
        const double got = render_mean(rig, &c);
        rig->renderer->context.overrides.path_estimators = 0;
        expect(rig, names[use], got, expected, 0.005);
    }
}

static double reflectance(double a, double b)
{
    return (a - b) * (a - b) / ((a + b) * (a + b));
}

static double of_interface(double a, double b)
{
    const double r = reflectance(a, b);
    return r / (1 - r);
}

// Light straight through what lies between z = -1 and 1, from a wall of radiance 1.
static double straight_through(struct rig *rig)
{
    const float wall[4][3] = {{-9, -9, -3}, {9, -9, -3}, {9, 9, -3}, {-9, 9, -3}};
    const struct rig_camera along = {.eye = {0, 0, 4},
        .vfov_rad = 0.02,
        .width = SIDE,
        .height = SIDE,
        .samples = 160,
        .mode = HG_MODE_PATH,
        .max_bounces = 64};
    struct hg_material *light = path_rig_lambert(rig, 0);
    light->emissive[0] = light->emissive[1] = light->emissive[2] = 1;
    rig_quad(rig, light, wall);
    return render_mean(rig, &along);
}

static void add_slab(struct rig *rig, float ior, float half, float from, float to)
{
    struct hg_material *m = clear_glass(rig, ior);
    m->double_sided = false;
    m->volume.thickness = 1;
    path_rig_box(rig, m, (const float[3]){-half, -half, from}, (const float[3]){half, half, to});
}

// Slabs in a row let 1 / (1 + sum of R / (1 - R)) through, all orders of reflection between their
// interfaces. Of a slab within another two interfaces are those of the two. Where two overlap, what
// is entered last is around until it is left: one interface between them, here or there, which for
// light that goes to and fro is no more the same: R^2 of 0.001.
static void test_nested_slabs(void **state)
{
    struct rig *rig = *state;
    rig_scene(rig);
    add_slab(rig, 1.4f, 3, -1, 1);
    add_slab(rig, 2, 2.5f, -0.5f, 0.5f);
    double sum = 2 * of_interface(1, 1.4) + 2 * of_interface(1.4, 2);
    expect(rig, "slab within a slab", straight_through(rig), 1 / (1 + sum), 0.003);

    rig_scene(rig);
    add_slab(rig, 1.4f, 3, -0.2f, 1);
    add_slab(rig, 2, 2.5f, -1, 0.2f);
    sum = of_interface(1, 1.4) + of_interface(1.4, 2) + of_interface(2, 1);
    expect(rig, "slabs that overlap", straight_through(rig), 1 / (1 + sum), 0.005);

    rig_scene(rig); // one more than a path keeps
    sum = 0;
    for (int i = 0; i < 5; i++) {
        const float z = 1 - 0.15f * (float)i;
        add_slab(rig, 1.2f + 0.2f * (float)i, 3 - 0.1f * (float)i, -z, z);
        sum += 2 * of_interface(i == 0 ? 1 : 1 + 0.2 * i, 1.2 + 0.2 * i);
    }
    expect(rig, "five slabs", straight_through(rig), 1 / (1 + sum), 0.003);
}

// Of two volumes of one glass, one within the other, the inner one is not seen, also when the glass
// disperses and the path has one colour left.
static void test_volume_of_the_same_glass(void **state)
{
    struct rig *rig = *state;
    static const float center[3] = {0, 1, 0};
    struct hg_refbuf *pixels[3];
    struct rig_camera c = camera;
    c.max_bounces = 8;
    c.samples = 64;
    for (int i = 0; i < 3; i++) { // without, with, with another glass
        rig_scene(rig);
        for (int stripe = -12; stripe < 12; stripe += 2) {
            const float x = (float)stripe * 0.25f;
            const float corners[4][3] = {
                {x, 0, 9}, {x + 0.25f, 0, 9}, {x + 0.25f, 0, -9}, {x, 0, -9}};
            struct hg_material *m = path_rig_lambert(rig, 0);
            m->emissive[0] = m->emissive[1] = m->emissive[2] = 1;
            rig_quad(rig, m, corners);
        }
        for (int k = 0; k < (i > 0 ? 2 : 1); k++) {
            struct hg_material *m = clear_glass(rig, i == 2 && k == 1 ? 1.2f : 1.6f);
            m->double_sided = false;
            m->volume.thickness = 1;
            m->dispersion = 3;
            rig_sphere(rig, m, center, k == 0 ? 0.9f : 0.6f, 48);
        }
        pixels[i] = rig_render(rig, &c);
    }
    double worst[2] = {0, 0};
    for (int i = 0; i < SIDE / BLOCK * (SIDE / BLOCK) * 3; i++)
        for (int with = 1; with < 3; with++) {
            double sum[2] = {0, 0};
            for (int k = 0; k < BLOCK * BLOCK; k++) {
                const int x = i / 3 % (SIDE / BLOCK) * BLOCK + k % BLOCK;
                const int y = i / 3 / (SIDE / BLOCK) * BLOCK + k / BLOCK;
                for (int which = 0; which < 2; which++)
                    sum[which] += (double)((const float *)(const void *)pixels[which ? with : 0]
                                               ->data)[(y * SIDE + x) * 4 + i % 3];
            }
            worst[with - 1] = fmax(worst[with - 1], fabs(sum[1] - sum[0]) / (BLOCK * BLOCK));
        }
    for (int i = 0; i < 3; i++)
        hg_refbuf_unref(pixels[i]);
    print_message("inner volume: %.4f of 1, of another glass %.4f\n", worst[0], worst[1]);
    assert_true(worst[0] < 0.02); // 0.27 with the index that all colours share
    assert_true(worst[1] > 0.05);
}

// --- panes ---------------------------------------------------------------------------------------

static const double above[3] = {0.5, 3.5, -0.5};

static double tinted_lamp(const double p[3])
{
    const double d = distance_to(above, p);
    return 0.5 * 20 / (d * d) * (above[1] / d) / M_PI;
}

// Nothing but its ray finds a lamp: smooth panes let it through, tinted; a pane that reflects takes
// as much of a lamp as of a sphere that emits as much, which paths run into.
static void test_lamp_behind_pane(void **state)
{
    struct rig *rig = *state;
    add_plane(rig);
    struct hg_material *tinted = clear_glass(rig, 1);
    tinted->base_color[0] = tinted->base_color[1] = tinted->base_color[2] = 0.5f;
    add_ceiling(rig, tinted, 1.5f, 9);
    add_lamp(rig, above, 20);
    struct rig_camera below = camera; // the pane
    below.eye[1] = 1.2;
    below.target[0] = 0.6;
    below.target[2] = 1;
    double sum = 0;
    for (int i = 0; i < SIDE * SIDE; i++) {
        double d[3], p[3];
        rig_ray(&below, i % SIDE + 0.5, i / SIDE + 0.5, d);
        for (int a = 0; a < 3; a++)
            p[a] = below.eye[a] - d[a] * below.eye[1] / d[1];
        sum += tinted_lamp(p);
    }
    expect(rig, "lamp behind a tinted pane", render_mean(rig, &below), sum / (SIDE * SIDE), 0.002);

    double mean[2];
    for (int sphere = 0; sphere < 2; sphere++) {
        const float at[3] = {0.5f, 3.5f, -0.5f}, radius = 0.5f;
        add_plane(rig);
        add_ceiling(rig, clear_glass(rig, 1.8f), 1.5f, 9);
        if (sphere) {
            struct hg_material *m = path_rig_lambert(rig, 0);
            m->emissive[0] = m->emissive[1] = m->emissive[2] = 20 / ((float)M_PI * radius * radius);
            rig_sphere(rig, m, at, radius, 48);
        } else {
            add_lamp(rig, above, 20);
        }
        struct rig_camera c = below;
        c.samples = sphere ? 320 : 32;
        c.max_bounces = 2; // no light from the plane by way of the pane
        mean[sphere] = render_mean(rig, &c);
    }
    expect(rig, "lamp behind a pane, sphere", mean[0], mean[1], 0.015);
}

// The alpha of what is opaque does not count, on no way.
static void test_alpha_of_opaque_glass(void **state)
{
    struct rig *rig = *state;
    struct hg_refbuf *pixels[2];
    for (int i = 0; i < 2; i++) {
        add_plane(rig);
        struct hg_material *pane = clear_glass(rig, 1.5f), *m = path_rig_lambert(rig, 0);
        pane->roughness = 0.4f;
        pane->base_color[3] = i ? 0.1f : 1;
        add_ceiling(rig, pane, 1.5f, 9);
        m->emissive[0] = m->emissive[1] = m->emissive[2] = 5;
        add_ceiling(rig, m, 3.5f, 1);
        struct rig_camera c = camera;
        c.samples = 16;
        pixels[i] = rig_render(rig, &c);
    }
    assert_memory_equal(pixels[0]->data, pixels[1]->data, pixels[0]->size);
    hg_refbuf_unref(pixels[0]);
    hg_refbuf_unref(pixels[1]);
}

// --- shadows -------------------------------------------------------------------------------------

static double whole_lamp(const double p[3])
{
    return 2 * tinted_lamp(p);
}

// A light without shadows shines through everything, one with them does not.
static void test_light_without_shadows(void **state)
{
    struct rig *rig = *state;
    for (int holes = 0; holes < 2; holes++) {
        double mean[2];
        for (int casts = 0; casts < 2; casts++) {
            add_plane(rig);
            struct hg_material *black = path_rig_lambert(rig, 0);
            black->double_sided = true;
            const float small[4][3] = {
                {-0.3f, 3, -1.3f}, {1.3f, 3, -1.3f}, {1.3f, 3, 0.3f}, {-0.3f, 3, 0.3f}};
            rig_quad(rig, black, small);
            if (holes) { // rays to lights go another way
                struct hg_material *blended = path_rig_lambert(rig, 0);
                blended->alpha_mode = HG_ALPHA_BLEND;
                blended->base_color[3] = 0;
                add_ceiling(rig, blended, 2.9f, 1);
            }
            add_lamp(rig, above, 20)->casts_shadow = casts != 0;
            struct rig_camera c = camera;
            c.samples = 16;
            c.eye[0] = 0.9;
            mean[casts] = render_mean(rig, &c);
        }
        print_message("without shadows %.5f, with %.5f\n", mean[0], mean[1]);
        assert_true(mean[0] > 2 * mean[1]);
    }
    add_plane(rig);
    add_ceiling(rig, path_rig_lambert(rig, 0), 3.4f, 0.05f); // hides the lamp from all of the plane
    add_lamp(rig, above, 20)->casts_shadow = false;
    expect(rig, "lamp that nothing shades", render_mean(rig, &camera), expected_mean(whole_lamp),
        0.002);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_light_in_volume),
        cmocka_unit_test(test_nested_slabs),
        cmocka_unit_test(test_volume_of_the_same_glass),
        cmocka_unit_test(test_lamp_behind_pane),
        cmocka_unit_test(test_alpha_of_opaque_glass),
        cmocka_unit_test(test_light_without_shadows),
    };
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
