// form_factors.c - a Cornell box against the radiosity solution from closed form factors.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "tests/analytic/rig.h"

#define PI 3.14159265358979

// The unit cube's faces are cut into N x N patches of equal size. Face 0 and 1 lie at x = 0 and 1,
// 2 and 3 at y = 0 and 1, 4 and 5 at z = 0 and 1.
enum { N = 8, FACE = N * N, PATCHES = 6 * FACE, LIGHT = N / 4 };

static const double white = 0.75, emitted = 5;

struct span {
    double low, high;
};

// --- form factors --------------------------------------------------------------------------------

typedef double corner_fn(double x, double y, double across, double along, double distance);

// Howell, "A Catalog of Radiation Heat Transfer Configuration Factors", C-13: parallel rectangles.
static double parallel(double x, double y, double across, double along, double distance)
{
    const double dx = x - across, dy = y - along, z2 = distance * distance;
    const double a = sqrt(dx * dx + z2), b = sqrt(dy * dy + z2);
    return dy * a * atan(dy / a) + dx * b * atan(dx / b) - z2 / 2 * log(dx * dx + dy * dy + z2);
}

// The same, C-15: perpendicular ones, x and `across` away from the line where their planes meet.
static double perpendicular(double x, double y, double across, double along, double distance)
{
    const double r2 = x * x + across * across, d = y - along, r = sqrt(r2), t = r2 + d * d;
    (void)distance;
    return (r > 0 ? d * r * atan(d / r) : 0) - (t > 0 ? 0.25 * (r2 - d * d) * log(t) : 0);
}

static double form_factor(corner_fn *corner, struct span x, struct span y, struct span across,
    struct span along, double distance)
{
    double sum = 0;
    for (int i = 0; i < 16; i++) {
        const int odd = (i ^ i >> 1 ^ i >> 2 ^ i >> 3) & 1;
        sum += (odd ? -1 : 1) * corner(i & 1 ? x.high : x.low, i & 2 ? y.high : y.low,
                                    i & 4 ? across.high : across.low,
                                    i & 8 ? along.high : along.low, distance);
    }
    return sum / (2 * PI * (x.high - x.low) * (y.high - y.low));
}

// Extent of a patch along an axis that is not its face's.
static struct span extent(int patch, int axis)
{
    const int face = patch / FACE / 2, at = patch % FACE;
    const int first = face == 0 ? 1 : 0;
    const int cell = axis == first ? at % N : at / N;
    return (struct span){(double)cell / N, (double)(cell + 1) / N};
}

// Away from a face at 0 or 1.
static struct span from_face(struct span s, int side)
{
    return side ? (struct span){1 - s.high, 1 - s.low} : s;
}

// Share of what leaves patch `a` that arrives at `b`.
static double between(int a, int b)
{
    const int face_a = a / FACE, face_b = b / FACE, axis_a = face_a / 2, axis_b = face_b / 2;
    if (face_a == face_b)
        return 0;
    if (axis_a == axis_b) {
        const int u = axis_a == 0 ? 1 : 0, w = axis_a == 2 ? 1 : 2;
        return form_factor(parallel, extent(a, u), extent(a, w), extent(b, u), extent(b, w), 1);
    }
    const int edge = 3 - axis_a - axis_b;
    return form_factor(perpendicular, from_face(extent(a, axis_b), face_b % 2), extent(a, edge),
        from_face(extent(b, axis_a), face_a % 2), extent(b, edge), 0);
}

// --- radiosity -----------------------------------------------------------------------------------

static bool is_light(int patch)
{
    const int x = patch % FACE % N, z = patch % FACE / N;
    return patch / FACE == 3 && abs(2 * x - N + 1) < 2 * LIGHT && abs(2 * z - N + 1) < 2 * LIGHT;
}

static double albedo(int patch, int channel)
{
    static const double red[2] = {0.6, 0.05}, green[2] = {0.1, 0.5};
    if (is_light(patch))
        return 0;
    return patch / FACE == 0 ? red[channel] : patch / FACE == 1 ? green[channel] : white;
}

// Mean radiance of each face: B = E + albedo F B, patches of constant radiosity.
static void solve(const double *factors, int channel, double mean[6])
{
    double b[PATCHES] = {0};
    for (int round = 0; round < 60; round++)
        for (int i = 0; i < PATCHES; i++) {
            double in = 0;
            for (int k = 0; k < PATCHES; k++)
                in += factors[i * PATCHES + k] * b[k];
            b[i] = (is_light(i) ? emitted : 0) + albedo(i, channel) * in;
        }
    for (int f = 0; f < 6; f++) {
        mean[f] = 0;
        for (int i = 0; i < FACE; i++)
            mean[f] += b[f * FACE + i] / FACE;
    }
}

static double *make_factors(void)
{
    double *factors = hg_calloc((size_t)PATCHES * PATCHES, sizeof *factors);
    assert_non_null(factors);
    for (int i = 0; i < PATCHES; i++) {
        double sum = 0;
        for (int k = 0; k < PATCHES; k++)
            sum += factors[i * PATCHES + k] = between(i, k);
        assert_true(fabs(sum - 1) < 1e-9); // the box is closed
    }
    return factors;
}

// --- the same box, path-traced -------------------------------------------------------------------

static struct hg_material *lambert(struct rig *rig, double red, double green)
{
    struct hg_material *m = rig_material(rig);
    m->specular.factor = 0;
    m->specular.is_set = true;
    m->base_color[0] = (float)red;
    m->base_color[1] = m->base_color[2] = (float)green;
    return m;
}

static void ceiling(struct rig *rig, struct hg_material *m, float x0, float x1, float z0, float z1)
{
    const float corners[4][3] = {{x0, 1, z0}, {x1, 1, z0}, {x1, 1, z1}, {x0, 1, z1}};
    rig_quad(rig, m, corners);
}

static void build(struct rig *rig)
{
    static const float left[4][3] = {{0, 0, 1}, {0, 0, 0}, {0, 1, 0}, {0, 1, 1}};
    static const float right[4][3] = {{1, 0, 0}, {1, 0, 1}, {1, 1, 1}, {1, 1, 0}};
    static const float ground[4][3] = {{0, 0, 1}, {1, 0, 1}, {1, 0, 0}, {0, 0, 0}};
    static const float back[4][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
    static const float front[4][3] = {{1, 0, 1}, {0, 0, 1}, {0, 1, 1}, {1, 1, 1}};
    const float low = 0.5f - (float)LIGHT / N, high = 1 - low;
    rig_scene(rig);
    struct hg_material *paint = lambert(rig, white, white), *light = lambert(rig, 0, 0);
    for (int i = 0; i < 3; i++)
        light->emissive[i] = (float)emitted;
    rig_quad(rig, lambert(rig, albedo(0, 0), albedo(0, 1)), left);
    rig_quad(rig, lambert(rig, albedo(FACE, 0), albedo(FACE, 1)), right);
    rig_quad(rig, paint, ground);
    rig_quad(rig, paint, back);
    rig_quad(rig, paint, front);
    ceiling(rig, light, low, high, low, high);
    ceiling(rig, paint, 0, 1, 0, low);
    ceiling(rig, paint, 0, 1, high, 1);
    ceiling(rig, paint, 0, low, low, high);
    ceiling(rig, paint, high, 1, low, high);
}

// Mean radiance of a face, from a camera that sees just that face: a plane across the axis has the
// same area in every pixel.
static void photograph(struct rig *rig, int face, double mean[2])
{
    enum { SIDE = 64 };
    const double away = 0.999;
    struct rig_camera camera = {.eye = {0.5, 0.5, 0.5},
        .target = {0.5, 0.5, 0.5},
        .vfov_rad = 2 * atan(0.5 / away),
        .width = SIDE,
        .height = SIDE,
        .samples = 64,
        .mode = HG_MODE_PATH,
        .max_bounces = 64};
    const int axis = face / 2;
    camera.target[axis] = face % 2;
    camera.eye[axis] = face % 2 ? 1 - away : away;
    struct hg_refbuf *pixels = rig_render(rig, &camera);
    const float *at = (const float *)(const void *)pixels->data;
    mean[0] = mean[1] = 0;
    for (int i = 0; i < SIDE * SIDE; i++)
        for (int c = 0; c < 2; c++)
            mean[c] += (double)at[i * 4 + c] / (SIDE * SIDE);
    hg_refbuf_unref(pixels);
}

static void test_cornell_box(void **state)
{
    static const char *const names[6] = {"left", "right", "floor", "ceiling", "back", "front"};
    struct rig *rig = *state;
    double *factors = make_factors(), expected[2][6];
    int bad = 0;
    // Parallel and perpendicular squares that share an edge: 0.19982, 0.20004.
    double whole = 0;
    for (int i = 0; i < FACE; i++)
        for (int k = 0; k < FACE; k++)
            whole += factors[i * PATCHES + FACE + k] / FACE;
    assert_true(fabs(whole - 0.1998249) < 1e-6);
    for (int c = 0; c < 2; c++)
        solve(factors, c, expected[c]);
    hg_free(factors);
    build(rig);
    for (int face = 0; face < 6; face++) {
        double seen[2];
        if (face == 3 || face == 5) // the light is seen directly; front is as back
            continue;
        photograph(rig, face, seen);
        for (int c = 0; c < 2; c++) {
            const double off = seen[c] / expected[c][face] - 1;
            print_message("Cornell box, %s, %s: %.5f, %.5f expected (%+.3f %%)\n", names[face],
                c ? "green" : "red", seen[c], expected[c][face], off * 100);
            bad += !(fabs(off) < 0.005);
        }
    }
    assert_int_equal(bad, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_cornell_box)};
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
