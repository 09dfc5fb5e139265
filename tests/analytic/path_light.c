// path_light.c - path-traced pictures of a white plane (and of the inside of a box) under lights of
// every kind, against closed forms and sums over all lights: what the integrator makes of light
// sampling, rays, surfaces and the film together.
//
// The plane is a Lambert surface (KHR_materials_specular 0): radiance = irradiance / pi. Lights
// hang above the camera, so that nothing else is seen and nothing is in the way.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "tests/analytic/rig.h"

enum { SIDE = 64, BLOCK = 16 };

static struct rig_camera camera = {.eye = {1, 4, 2.5},
    .target = {0, 0, 0},
    .vfov_rad = 0.8,
    .width = SIDE,
    .height = SIDE,
    .samples = 64,
    .mode = HG_MODE_PATH,
    .max_bounces = 1};

static struct hg_material *lambert(struct rig *rig, float white, float emission)
{
    struct hg_material *m = rig_material(rig);
    m->specular.factor = 0;
    m->specular.is_set = true;
    for (int c = 0; c < 3; c++) {
        m->base_color[c] = white;
        m->emissive[c] = emission;
    }
    return m;
}

static void add_plane(struct rig *rig)
{
    rig_scene(rig);
    rig_plane(rig, lambert(rig, 1, 0));
}

// Irradiance on the plane at a point.
typedef double irradiance_fn(const void *user, const double p[3]);

// Blocks of pixels within `noise` of what is expected, the whole picture within `bias`.
static void check(struct rig *rig, const char *name, irradiance_fn *irradiance, const void *user,
    double noise, double bias)
{
    struct hg_refbuf *pixels = rig_render(rig, &camera);
    const float *rgba = (const float *)(const void *)pixels->data;
    double got = 0, expected = 0, worst = 0;
    for (int b = 0; b < SIDE / BLOCK * (SIDE / BLOCK); b++) {
        double block_got = 0, block_expected = 0;
        for (int i = 0; i < BLOCK * BLOCK; i++) {
            const int x = b % (SIDE / BLOCK) * BLOCK + i % BLOCK;
            const int y = b / (SIDE / BLOCK) * BLOCK + i / BLOCK;
            double d[3], p[3];
            rig_ray(&camera, x + 0.5, y + 0.5, d);
            for (int a = 0; a < 3; a++)
                p[a] = camera.eye[a] - d[a] * camera.eye[1] / d[1];
            block_got += (double)rgba[(y * SIDE + x) * 4 + 1];
            block_expected += irradiance(user, p) / M_PI;
        }
        worst = fmax(worst, fabs(block_got / block_expected - 1));
        got += block_got;
        expected += block_expected;
    }
    hg_refbuf_unref(pixels);
    print_message("%s: mean %.5f, expected %.5f (%+.3f %%), worst block %.3f %%\n", name,
        got / (SIDE * SIDE), expected / (SIDE * SIDE), (got / expected - 1) * 100, worst * 100);
    assert_true(worst <= noise);
    assert_true(fabs(got / expected - 1) <= bias);
}

// --- surfaces that shine -------------------------------------------------------------------------

struct polygon {
    double corners[4][3], radiance;
};

// Lambert 1760; Arvo 1995, "Analytic Methods for Simulated Light Transport", eq. 2.12, with the
// normal straight up.
static double polygon_irradiance(const void *user, const double p[3])
{
    const struct polygon *q = user;
    double sum = 0;
    for (int i = 0; i < 4; i++) {
        double a[3], b[3], la = 0, lb = 0, dot = 0, c[3], lc = 0;
        for (int k = 0; k < 3; k++) {
            a[k] = q->corners[i][k] - p[k];
            b[k] = q->corners[(i + 1) % 4][k] - p[k];
            la += a[k] * a[k];
            lb += b[k] * b[k];
            dot += a[k] * b[k];
        }
        for (int k = 0; k < 3; k++) {
            c[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
            lc += c[k] * c[k];
        }
        sum += acos(dot / sqrt(la * lb)) * c[1] / sqrt(lc);
    }
    return q->radiance * fabs(sum) / 2;
}

static const float ceiling[4][3] = {{-2, 6, -1}, {2, 6, -1}, {2, 6, 1}, {-2, 6, 1}};

static struct polygon polygon_of(const float corners[4][3], double radiance)
{
    struct polygon q = {.radiance = radiance};
    for (int i = 0; i < 12; i++)
        q.corners[i / 3][i % 3] = (double)corners[i / 3][i % 3];
    return q;
}

static void test_rectangle(void **state)
{
    struct rig *rig = *state;
    const struct polygon q = polygon_of(ceiling, 10);
    add_plane(rig);
    rig_quad(rig, lambert(rig, 0, 10), ceiling);
    check(rig, "rectangle", polygon_irradiance, &q, 0.01, 0.002);
}

// A square of its texture emits: u 1/4 .. 1/2, v 1/2 .. 3/4.
static void test_textured_rectangle(void **state)
{
    struct rig *rig = *state;
    enum { TEXELS = 512 };
    static const float lit[4][3] = {{-1, 6, 0}, {0, 6, 0}, {0, 6, 0.5f}, {-1, 6, 0.5f}};
    const struct polygon q = polygon_of(lit, 100);
    add_plane(rig);
    struct hg_material *m = lambert(rig, 0, 100);
    struct hg_object *object;
    assert_int_equal(hg_scene_add(rig->scene, HG_OBJECT_TEXTURE, rig->next_id++, &object), HG_OK);
    struct hg_texture *t = (struct hg_texture *)object;
    t->image = hg_calloc(1, sizeof *t->image);
    assert_non_null(t->image);
    t->image->refs = 1;
    t->image->label = hg_strdup("square");
    t->image->pixels_srgb = true;
    assert_int_equal(
        hg_image_create(TEXELS, TEXELS, HG_PIXEL_RGBA8, NULL, &t->image->pixels), HG_OK);
    for (uint32_t i = 0; i < TEXELS * TEXELS; i++) {
        const bool on = 4 * (i % TEXELS) / TEXELS == 1 && 4 * (i / TEXELS) / TEXELS == 2;
        memset((uint8_t *)t->image->pixels.pixels + (size_t)i * 4, on ? 255 : 0, 4);
    }
    m->slots[HG_SLOT_EMISSIVE].texture = t;
    rig_quad(rig, m, ceiling);
    check(rig, "textured rectangle", polygon_irradiance, &q, 0.03, 0.005);
}

static double sphere_irradiance(const void *user, const double p[3])
{
    const double *sphere = user; // centre, radius, radiance
    double d2 = 0;
    for (int a = 0; a < 3; a++)
        d2 += (sphere[a] - p[a]) * (sphere[a] - p[a]);
    return M_PI * sphere[4] * sphere[3] * sphere[3] / d2 * (sphere[1] - p[1]) / sqrt(d2);
}

// 0.1 % by the corners of the mesh, which is too small to have levels of detail.
static void test_sphere(void **state)
{
    struct rig *rig = *state;
    const double sphere[5] = {0.5, 6, -0.5, 0.75, 20};
    const float center[3] = {0.5f, 6, -0.5f};
    add_plane(rig);
    rig_sphere(rig, lambert(rig, 0, 20), center, 0.75f, 48);
    check(rig, "sphere", sphere_irradiance, sphere, 0.01, 0.004);
}

// Inside a closed box whose walls shine with 1 and reflect one half, everything is 2.
static void test_box(void **state)
{
    struct rig *rig = *state;
    static const float c[8][3] = {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1}, {-1, -1, 1},
        {1, -1, 1}, {1, 1, 1}, {-1, 1, 1}};
    static const int walls[6][4] = {
        {0, 1, 2, 3}, {5, 4, 7, 6}, {4, 0, 3, 7}, {1, 5, 6, 2}, {4, 5, 1, 0}, {3, 2, 6, 7}};
    struct rig_camera inside = camera;
    rig_scene(rig);
    struct hg_material *m = lambert(rig, 0.5f, 1);
    for (int w = 0; w < 6; w++) {
        float corners[4][3];
        for (int i = 0; i < 12; i++)
            corners[i / 3][i % 3] = c[walls[w][i / 3]][i % 3];
        rig_quad(rig, m, corners);
    }
    inside.eye[0] = inside.eye[1] = inside.eye[2] = 0;
    inside.target[2] = -1;
    inside.max_bounces = 40;
    inside.samples = 32;
    struct hg_refbuf *pixels = rig_render(rig, &inside);
    const float *rgba = (const float *)(const void *)pixels->data;
    double mean = 0;
    for (int i = 0; i < SIDE * SIDE; i++)
        mean += (double)rgba[i * 4 + 1] / (SIDE * SIDE);
    hg_refbuf_unref(pixels);
    print_message("box: %.5f, expected 2\n", mean);
    assert_true(fabs(mean / 2 - 1) < 0.003);
}

// --- punctual lights -----------------------------------------------------------------------------

struct lamp {
    unsigned kind;
    double at[3], intensity, range;
};
struct lamps {
    struct lamp *items;
    int count;
};

// All shine straight down; cones of 0.3 .. 0.6 radians.
static double lamps_irradiance(const void *user, const double p[3])
{
    const struct lamps *lamps = user;
    double sum = 0;
    for (int i = 0; i < lamps->count; i++) {
        const struct lamp *l = &lamps->items[i];
        if (l->kind == HG_LIGHT_DIRECTIONAL) {
            sum += l->intensity;
            continue;
        }
        double d2 = 0;
        for (int a = 0; a < 3; a++)
            d2 += (l->at[a] - p[a]) * (l->at[a] - p[a]);
        const double cosine = (l->at[1] - p[1]) / sqrt(d2);
        double e = l->intensity / d2 * cosine;
        if (l->range > 0)
            e *= fmax(0, 1 - d2 * d2 / pow(l->range, 4));
        const double t = (cosine - cos(0.6)) / (cos(0.3) - cos(0.6));
        if (l->kind == HG_LIGHT_SPOT)
            e *= pow(fmax(0, fmin(1, t)), 2);
        sum += e;
    }
    return sum;
}

static void add_lamps(struct rig *rig, const struct lamps *lamps)
{
    const double down[3] = {0, -1, 0};
    for (int i = 0; i < lamps->count; i++) {
        const struct lamp *l = &lamps->items[i];
        struct hg_light *light = rig_light(rig, l->kind, l->at, down);
        light->casts_shadow = true;
        light->intensity = (float)l->intensity;
        light->range = (float)l->range;
    }
}

static double fraction(uint32_t *random)
{
    *random = *random * 1664525u + 1013904223u;
    return (double)(*random >> 8) * 0x1p-24;
}

static void test_lamps(void **state)
{
    struct rig *rig = *state;
    struct lamp few[3] = {{HG_LIGHT_DIRECTIONAL, {0, 5, 0}, 2, 0},
        {HG_LIGHT_POINT, {1, 5, -1}, 60, 20}, {HG_LIGHT_SPOT, {0, 5, 0}, 80, 0}};
    for (int i = 0; i < 2; i++) {
        const struct lamps one = {&few[i], 1};
        add_plane(rig);
        add_lamps(rig, &one);
        check(rig, i == 0 ? "directional" : "point", lamps_irradiance, &one, 1e-3, 1e-3);
    }
    const struct lamps three = {few, 3};
    add_plane(rig);
    add_lamps(rig, &three);
    check(rig, "three lamps", lamps_irradiance, &three, 0.01, 0.002);
}

static void test_many_lamps(void **state)
{
    struct rig *rig = *state;
    enum { COUNT = 2000 };
    static struct lamp items[COUNT];
    const struct lamps lamps = {items, COUNT};
    uint32_t random = 5;
    for (int i = 0; i < COUNT; i++) {
        const double x = fraction(&random), y = fraction(&random), z = fraction(&random);
        items[i] = (struct lamp){i % 3 == 0 ? HG_LIGHT_SPOT : HG_LIGHT_POINT,
            {16 * x - 8, 5 + 3 * y, 16 * z - 8}, 0.1 + fraction(&random), i % 2 ? 12 : 0};
    }
    add_plane(rig);
    add_lamps(rig, &lamps);
    check(rig, "2000 lamps", lamps_irradiance, &lamps, 0.03, 0.005);
}

// --- surfaces on the way -------------------------------------------------------------------------

// A black plate of one alpha across everything at a height.
static void add_plate(struct rig *rig, float y, enum hg_alpha_mode mode, float alpha)
{
    const float corners[4][3] = {{-9, y, 9}, {9, y, 9}, {9, y, -9}, {-9, y, -9}};
    struct hg_material *m = lambert(rig, 0, 0);
    m->alpha_mode = mode;
    m->alpha_cutoff = 0.5f;
    m->base_color[3] = alpha;
    m->double_sided = true;
    rig_quad(rig, m, corners);
}

static double dimmed_lamp(const void *user, const double p[3])
{
    return 0.35 * lamps_irradiance(user, p);
}

static double seen_through(const void *user, const double p[3])
{
    return 0.75 * 0.75 * polygon_irradiance(user, p);
}

// Blended plates let 1 - alpha through, each of them, to lights that are asked and to those that
// are run into; before the camera too. Masked ones hide all or nothing.
static void test_plates(void **state)
{
    struct rig *rig = *state;
    struct lamp one = {HG_LIGHT_POINT, {1, 5.5, -1}, 60, 0};
    const struct lamps lamps = {&one, 1};
    add_plane(rig);
    add_lamps(rig, &lamps);
    add_plate(rig, 5, HG_ALPHA_BLEND, 0.5f);
    add_plate(rig, 4.9f, HG_ALPHA_BLEND, 0.3f);
    add_plate(rig, 4.8f, HG_ALPHA_MASK, 0.49f);
    check(rig, "lamp behind two plates", dimmed_lamp, &lamps, 1e-3, 1e-3);

    const struct polygon whole = polygon_of(ceiling, 10);
    add_plane(rig);
    rig_quad(rig, lambert(rig, 0, 10), ceiling);
    add_plate(rig, 3, HG_ALPHA_BLEND, 0.25f);
    check(rig, "seen and lit through a plate", seen_through, &whole, 0.025, 0.005);

    static const float cover[4][3] = {
        {-3, 5.999f, -2}, {0, 5.999f, -2}, {0, 5.999f, 2}, {-3, 5.999f, 2}};
    static const float rest[4][3] = {{0, 6, -1}, {2, 6, -1}, {2, 6, 1}, {0, 6, 1}};
    const struct polygon half = polygon_of(rest, 10);
    add_plane(rig);
    rig_quad(rig, lambert(rig, 0, 10), ceiling);
    struct hg_material *m = lambert(rig, 0, 0);
    m->alpha_mode = HG_ALPHA_MASK;
    m->alpha_cutoff = 0.5f;
    m->base_color[3] = 0.51f;
    m->double_sided = true;
    rig_quad(rig, m, cover);
    camera.samples = 256; // its edges are noisier than all else here
    check(rig, "half of a lamp behind a mask", polygon_irradiance, &half, 0.02, 0.005);
    camera.samples = 64;
}

// --- environments --------------------------------------------------------------------------------

static double constant(const void *user, const double p[3])
{
    (void)p;
    return *(const double *)user;
}

// A plane under a sky of one colour shows that colour.
static void test_constant_environment(void **state)
{
    struct rig *rig = *state;
    const double expected = 0.5 * M_PI;
    add_plane(rig);
    struct hg_environment *env = &rig->scene->environment;
    env->kind = HG_ENV_COLOR;
    env->intensity = 1;
    for (int c = 0; c < 3; c++)
        env->color[c] = 0.5f;
    check(rig, "constant environment", constant, &expected, 1e-3, 1e-3);
}

// A sun of 3 x 3 texels that gives most of the light.
static void test_sun_in_image(void **state)
{
    struct rig *rig = *state;
    enum { WIDTH = 512 };
    add_plane(rig);
    struct hg_environment *env = &rig->scene->environment;
    assert_int_equal(hg_image_create(WIDTH, WIDTH / 2, HG_PIXEL_RGBA32F, NULL, &env->image), HG_OK);
    env->kind = HG_ENV_IMAGE;
    env->intensity = 1;
    env->revision++;
    float *texels = (float *)env->image.pixels;
    double expected = 0;
    for (int i = 0; i < WIDTH * WIDTH / 2; i++) {
        const int x = i % WIDTH, y = i / WIDTH;
        const double value = abs(x - 170) < 2 && abs(y - 60) < 2 ? 8000 : 0.2;
        const double top = M_PI * y / (WIDTH / 2), bottom = M_PI * (y + 1) / (WIDTH / 2);
        for (int c = 0; c < 4; c++)
            texels[i * 4 + c] = (float)value;
        if (y < WIDTH / 4) // integral of cos sin over the texel
            expected += value * 2 * M_PI / WIDTH * (cos(2 * top) - cos(2 * bottom)) / 4;
    }
    check(rig, "sun in an image", constant, &expected, 0.02, 0.005);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rectangle),
        cmocka_unit_test(test_textured_rectangle),
        cmocka_unit_test(test_sphere),
        cmocka_unit_test(test_box),
        cmocka_unit_test(test_lamps),
        cmocka_unit_test(test_many_lamps),
        cmocka_unit_test(test_plates),
        cmocka_unit_test(test_constant_environment),
        cmocka_unit_test(test_sun_in_image),
    };
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
