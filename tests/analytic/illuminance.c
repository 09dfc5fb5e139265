// illuminance.c - whole frames of a lit plane, linear pixels, against radiance computed by hand:
// lux of a directional light, candela over the square of the distance, the cone of a spot, range
// windows, sums over clusters, lights on hidden nodes.
#include <math.h>
#include <string.h>

#include "tests/analytic/rig.h"

enum { SIDE = 96 };

static const struct rig_camera camera = {.eye = {1, 4, 2.5},
    .target = {0, 0, 0},
    .vfov_rad = 0.8,
    .width = SIDE,
    .height = SIDE,
    .samples = 1}; // in the middle of each pixel

// --- the surface: white, roughness 1, reflectance 0.04 at normal incidence
// ------------------------

// GGX with alpha 1: D = 1 / pi, V = 1 / (2 (n.l + n.v)). Albedos of V D n.l by the midpoint rule,
// of the part that Schlick's (1 - v.h)^5 takes (b) and of the rest (a).
enum { STEPS = 96, MUS = 128 };
static double albedo_a[MUS + 1], albedo_b[MUS + 1], average_a, average_b;

static double half_dot(const double v[3], const double l[3])
{
    return sqrt((1 + v[0] * l[0] + v[1] * l[1] + v[2] * l[2]) / 2);
}

static void integrate(double mu, double *a, double *b)
{
    const double v[3] = {sqrt(1 - mu * mu), 0, mu};
    *a = *b = 0;
    for (int i = 0; i < STEPS; i++)
        for (int k = 0; k < STEPS; k++) {
            double z = (i + 0.5) / STEPS, phi = M_PI * (k + 0.5) / STEPS, s = sqrt(1 - z * z);
            const double l[3] = {s * cos(phi), s * sin(phi), z};
            double weight = 2 * M_PI / STEPS / STEPS / M_PI / (2 * (z + mu)) * z;
            double schlick = pow(1 - half_dot(v, l), 5);
            *a += weight * (1 - schlick);
            *b += weight * schlick;
        }
}

static int make_albedo(void)
{
    for (int i = 0; i <= MUS; i++)
        integrate(fmax((double)i / MUS, 1e-3), &albedo_a[i], &albedo_b[i]);
    for (int i = 0; i <= MUS; i++) { // 2 mu d mu, trapezoids
        double weight = 2.0 * i / MUS / MUS * (i == MUS ? 0.5 : 1);
        average_a += weight * albedo_a[i];
        average_b += weight * albedo_b[i];
    }
    return 0;
}

static void albedo(double mu, double *a, double *b)
{
    double x = fmin(mu, 1) * MUS;
    int i = x >= MUS ? MUS - 1 : (int)x;
    *a = albedo_a[i] + (albedo_a[i + 1] - albedo_a[i]) * (x - i);
    *b = albedo_b[i] + (albedo_b[i + 1] - albedo_b[i]) * (x - i);
}

// Single scattering of glTF 2.0, the light that bounces on (Kulla and Conty 2017), and white
// diffuse light from what the two leave over: see docs/internals/light.md, "BRDF".
static double brdf(const double v[3], const double l[3])
{
    const double f0 = 0.04, nv = v[1], nl = l[1], e_avg = average_a + average_b;
    double a, b, fresnel = f0 + (1 - f0) * pow(1 - half_dot(v, l), 5);
    double single = fresnel / M_PI / (2 * (nl + nv));
    double f_avg = f0 + (1 - f0) / 21, f_ms = f_avg * f_avg * e_avg / (1 - f_avg * (1 - e_avg));
    albedo(nv, &a, &b);
    double miss_v = 1 - a - b, e_v = f0 * a + b + f_ms * miss_v;
    albedo(nl, &a, &b);
    double miss_l = 1 - a - b, e_l = f0 * a + b + f_ms * miss_l;
    double e_d = f0 * average_a + average_b + f_ms * (1 - e_avg);
    double multiple = f_ms * miss_v * miss_l / (1 - e_avg) / M_PI;
    return single + multiple + (1 - e_v) * (1 - e_l) / (1 - e_d) / M_PI;
}

// --- the lights: illuminance at a point of the plane, on a surface that faces the light
// -----------

struct lamp {
    unsigned kind;
    double at[3], direction[3], intensity, range, inner, outer;
};

static double length(const double v[3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static double lux(const struct lamp *lamp, const double p[3], double l[3])
{
    double d[3], k = lamp->kind == HG_LIGHT_DIRECTIONAL ? 0 : 1, cosine = 0;
    for (int i = 0; i < 3; i++)
        d[i] = k > 0 ? lamp->at[i] - p[i] : -lamp->direction[i];
    double r = length(d);
    for (int i = 0; i < 3; i++) {
        l[i] = d[i] / r;
        cosine -= l[i] * lamp->direction[i] / length(lamp->direction);
    }
    if (lamp->kind == HG_LIGHT_DIRECTIONAL)
        return lamp->intensity;
    double e = lamp->intensity / (r * r);
    if (lamp->range > 0)
        e *= fmax(1 - pow(r / lamp->range, 4), 0);
    if (lamp->kind == HG_LIGHT_POINT)
        return e;
    double inner = cos(lamp->inner), outer = cos(lamp->outer);
    double t = fmin(fmax((cosine - outer) / (inner - outer), 0), 1);
    return e * t * t;
}

static struct hg_light *add(struct rig *rig, const struct lamp *lamp)
{
    struct hg_light *light = rig_light(rig, lamp->kind, lamp->at, lamp->direction);
    light->intensity = (float)lamp->intensity;
    light->range = (float)lamp->range;
    light->inner_cone_rad = (float)lamp->inner;
    light->outer_cone_rad = (float)lamp->outer;
    return light;
}

// --- frames
// ---------------------------------------------------------------------------------------

static void add_plane(struct rig *rig)
{
    rig_scene(rig);
    rig_plane(rig, rig_material(rig));
}

// Every pixel within 0.05 % of the sum over the lamps, or of the brightest where they hardly reach.
static void check(struct rig *rig, const struct lamp *lamps, int count, const char *name)
{
    struct hg_refbuf *pixels = rig_render(rig, &camera);
    const float *seen = (const float *)pixels->data;
    static double expected[SIDE * SIDE];
    double peak = 0, worst = 0, mean = 0;
    for (int i = 0; i < SIDE * SIDE; i++) {
        double d[3], p[3], v[3], l[3];
        rig_ray(&camera, i % SIDE + 0.5, i / SIDE + 0.5, d);
        for (int a = 0; a < 3; a++) {
            p[a] = camera.eye[a] - d[a] * camera.eye[1] / d[1];
            v[a] = -d[a];
        }
        expected[i] = 0;
        for (int k = 0; k < count; k++) {
            double e = lux(&lamps[k], p, l);
            expected[i] += l[1] > 0 ? e * l[1] * brdf(v, l) : 0;
        }
        peak = fmax(peak, expected[i]);
    }
    for (int i = 0; i < SIDE * SIDE; i++) {
        double error = fabs((double)seen[i * 4 + 1] - expected[i]);
        assert_true(seen[i * 4 + 3] == 1);
        worst = fmax(worst, error / fmax(expected[i], 0.02 * peak));
        mean += expected[i] / SIDE / SIDE;
    }
    print_message("%s: mean %.5f, worst deviation %.5f\n", name, mean, worst);
    assert_true(peak > 0 && worst < 0.0005);
    hg_refbuf_unref(pixels);
}

static const struct lamp sun = {
    HG_LIGHT_DIRECTIONAL, {0, 0, 0}, {-0.5, -1, -0.25}, 2.5, 0, 0.3, 0.6};
static const struct lamp bulb = {HG_LIGHT_POINT, {0.7, 1.5, -0.4}, {0, -1, 0}, 12, 0, 0.3, 0.6};
static const struct lamp ranged = {HG_LIGHT_POINT, {-0.5, 0.8, 0.3}, {0, -1, 0}, 3, 1.7, 0.3, 0.6};
static const struct lamp spot = {HG_LIGHT_SPOT, {-0.8, 2, 0.9}, {0.4, -1, -0.3}, 20, 0, 0.12, 0.5};

static void test_each_kind(void **state)
{
    struct rig *rig = *state;
    const struct lamp *const lamps[] = {&sun, &bulb, &ranged, &spot};
    const char *const names[] = {"directional", "point", "point with a range", "spot"};
    for (int i = 0; i < 4; i++) {
        add_plane(rig);
        add(rig, lamps[i]);
        check(rig, lamps[i], 1, names[i]);
    }
}

// A plane shadows nothing, itself included.
static void test_shadows_leave_a_bare_plane_alone(void **state)
{
    struct rig *rig = *state;
    const struct lamp all[3] = {sun, bulb, spot};
    add_plane(rig);
    for (int i = 0; i < 3; i++)
        add(rig, &all[i])->casts_shadow = true;
    check(rig, all, 3, "three kinds with shadows");
}

static void test_many_lights(void **state)
{
    enum { COUNT = 40 };
    struct rig *rig = *state;
    struct lamp lamps[COUNT];
    add_plane(rig);
    for (int i = 0; i < COUNT; i++) {
        double turn = i * 2.399963, r = 0.35 * sqrt(i); // golden angle
        lamps[i] = i % 2 ? ranged : spot;
        lamps[i].range = 2.5;
        lamps[i].at[0] = r * cos(turn);
        lamps[i].at[1] = 0.5 + 0.03 * i;
        lamps[i].at[2] = r * sin(turn);
        add(rig, &lamps[i]);
    }
    check(rig, lamps, COUNT, "forty ranged lights in clusters");
}

// Hidden by itself or with its parent: no light, and a scene without any other is black.
static void test_hidden_lights_do_not_shine(void **state)
{
    struct rig *rig = *state;
    add_plane(rig);
    add(rig, &sun);
    struct lamp upright = bulb; // its node is not turned
    memcpy(upright.direction, (double[3]){0, 0, -1}, sizeof upright.direction);
    struct hg_light *light = add(rig, &upright);
    rig_node_of(rig, light)->visible = false;
    struct hg_light *child = add(rig, &spot);
    child->casts_shadow = true;
    test_ok(hg_scene_set_parent(rig->scene, rig_node_of(rig, child), rig_node_of(rig, light)),
        &(struct hg_error){0});
    check(rig, &sun, 1, "a sun beside hidden lights");
    rig_node_of(rig, light)->visible = true; // seen again, both
    const struct lamp moved = {HG_LIGHT_SPOT,
        {spot.at[0] + bulb.at[0], spot.at[1] + bulb.at[1], spot.at[2] + bulb.at[2]},
        {0.4, -1, -0.3}, 20, 0, 0.12, 0.5};
    const struct lamp all[3] = {sun, bulb, moved};
    hg_scene_touch(rig->scene, &rig_node_of(rig, light)->head);
    check(rig, all, 3, "the same lights, seen");
}

static int setup(void **state)
{
    static struct rig rig;
    rig_init(&rig);
    *state = &rig;
    return make_albedo();
}

static int teardown(void **state)
{
    rig_finish(*state);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_each_kind),
        cmocka_unit_test(test_shadows_leave_a_bare_plane_alone),
        cmocka_unit_test(test_many_lights),
        cmocka_unit_test(test_hidden_lights_do_not_shine),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
