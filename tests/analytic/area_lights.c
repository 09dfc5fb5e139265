// area_lights.c - lights with a size over a white plane, path-traced, against closed forms and
// integrals over their surface: by rays to lights, by light that paths run into, and by both. What
// mirrors and cameras see of them.
#include <math.h>
#include <string.h>

#include "renderer/internal.h"
#include "shaders/shared/path.h"
#include "tests/analytic/rig.h"

enum { SIDE = 32, SQUARE = 24, SLAT_COLUMNS = 128, BLOCK = 16, STEPS = 48 };

static struct rig_camera camera = {.eye = {1, 4, 2.5},
    .target = {0, 0, 0},
    .vfov_rad = 0.8,
    .width = SIDE,
    .height = SIDE,
    .samples = 256,
    .mode = HG_MODE_PATH,
    .max_bounces = 1};

static void add_plane(struct rig *rig, float metallic, float roughness)
{
    rig_scene(rig);
    struct hg_material *m = rig_material(rig);
    m->specular.factor = 0;
    m->specular.is_set = metallic == 0;
    m->metallic = metallic;
    m->roughness = roughness;
    rig_plane(rig, m);
}

// A light, and the frame of its node: x along the width, z against its direction.
struct shape {
    const char *name;
    unsigned kind;
    double at[3], direction[3], radius, width, height;
};

static struct hg_light *add_shape(struct rig *rig, const struct shape *s, double axes[3][3])
{
    struct hg_light *light = rig_light(rig, s->kind, s->at, s->direction);
    light->intensity = 60;
    light->radius = (float)s->radius;
    light->width = (float)s->width;
    light->height = (float)s->height;
    light->casts_shadow = true;
    const float *q = rig_node_of(rig, light)->rotation;
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    const double m[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)},
        {2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)},
        {2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)}};
    memcpy(axes, m, sizeof m);
    return light;
}

// A point of the surface, u and v in 0..1, its normal, and the area for each of the steps.
static double surface_point(
    const struct shape *s, double axes[3][3], double u, double v, double at[3], double normal[3])
{
    double x = 0, y = 0, z = 0, n[3] = {0, 0, -1}, area = 0;
    if (s->kind == HG_LIGHT_RECTANGLE) {
        x = (u - 0.5) * s->width;
        y = (v - 0.5) * s->height;
        area = s->width * s->height;
    } else if (s->kind == HG_LIGHT_DISC) {
        x = s->radius * sqrt(u) * cos(2 * M_PI * v);
        y = s->radius * sqrt(u) * sin(2 * M_PI * v);
        area = M_PI * s->radius * s->radius;
    } else if (s->kind == HG_LIGHT_TUBE) {
        n[0] = 0;
        n[1] = cos(2 * M_PI * v);
        n[2] = sin(2 * M_PI * v);
        x = (u - 0.5) * s->width;
        y = s->radius * n[1];
        z = s->radius * n[2];
        area = 2 * M_PI * s->radius * s->width;
    }
    for (int a = 0; a < 3; a++) {
        at[a] = s->at[a] + axes[0][a] * x + axes[1][a] * y + axes[2][a] * z;
        normal[a] = axes[0][a] * n[0] + axes[1][a] * n[1] + axes[2][a] * n[2];
    }
    return area / (STEPS * STEPS);
}

static double radiance_of(const struct shape *s)
{
    return 60 / (s->kind == HG_LIGHT_RECTANGLE ? s->width * s->height
                    : s->kind == HG_LIGHT_TUBE ? 2 * s->radius * s->width
                                               : M_PI * s->radius * s->radius);
}

// Places all over the surface, and their normals.
struct surface {
    double at[STEPS * STEPS][3], normal[STEPS * STEPS][3], area;
};

static void cover(const struct shape *s, double axes[3][3], struct surface *out)
{
    for (int i = 0; i < STEPS * STEPS; i++) {
        const double u = (i / STEPS + 0.5) / STEPS, v = (i % STEPS + 0.5) / STEPS;
        out->area = surface_point(s, axes, u, v, out->at[i], out->normal[i]);
    }
}

// On the plane. That of a sphere, all of which is above, is that of a point in its middle.
static double irradiance(const struct shape *s, const struct surface *surface, const double p[3])
{
    double sum = 0;
    if (s->kind == HG_LIGHT_POINT) {
        const double d[3] = {s->at[0] - p[0], s->at[1] - p[1], s->at[2] - p[2]};
        return 60 * d[1] / pow(d[0] * d[0] + d[1] * d[1] + d[2] * d[2], 1.5);
    }
    for (int i = 0; i < STEPS * STEPS; i++) {
        const double *at = surface->at[i], *n = surface->normal[i];
        double d2 = 0, cosine = 0;
        for (int a = 0; a < 3; a++) {
            d2 += (at[a] - p[a]) * (at[a] - p[a]);
            cosine += n[a] * (p[a] - at[a]);
        }
        const double facing = at[1] - p[1];
        if (cosine > 0 && facing > 0)
            sum += surface->area * cosine * facing / (d2 * d2);
    }
    return radiance_of(s) * sum;
}

static void on_plane(double x, double y, double p[3])
{
    double d[3];
    rig_ray(&camera, x, y, d);
    for (int a = 0; a < 3; a++)
        p[a] = camera.eye[a] - d[a] * camera.eye[1] / d[1];
}

// Blocks of pixels within `noise`, the mean within `bias`.
static void check(
    struct rig *rig, const struct shape *s, double axes[3][3], double noise, double bias)
{
    static struct surface surface;
    struct hg_refbuf *pixels = rig_render(rig, &camera);
    const float *rgba = (const float *)(const void *)pixels->data;
    double got = 0, expected = 0, worst = 0;
    cover(s, axes, &surface);
    for (int b = 0; b < SIDE / BLOCK * (SIDE / BLOCK); b++) {
        double block_got = 0, block_expected = 0;
        for (int i = 0; i < BLOCK * BLOCK; i++) {
            const int x = b % (SIDE / BLOCK) * BLOCK + i % BLOCK;
            const int y = b / (SIDE / BLOCK) * BLOCK + i / BLOCK;
            double p[3];
            block_got += (double)rgba[(y * SIDE + x) * 4 + 1];
            on_plane(x + 0.5, y + 0.5, p);
            block_expected += irradiance(s, &surface, p) / M_PI;
        }
        worst = fmax(worst, fabs(block_got / block_expected - 1));
        got += block_got;
        expected += block_expected;
    }
    hg_refbuf_unref(pixels);
    print_message("%s, estimators %u: mean %.5f, expected %.5f (%+.3f %%), worst block %.3f %%\n",
        s->name, rig->renderer->context.overrides.path_estimators, got / (SIDE * SIDE),
        expected / (SIDE * SIDE), (got / expected - 1) * 100, worst * 100);
    assert_true(worst <= noise);
    assert_true(fabs(got / expected - 1) <= bias);
}

static const struct shape shapes[] = {
    {"sphere", HG_LIGHT_POINT, {0, 5, 0}, {0, -1, 0}, 0.7, 0, 0},
    {"rectangle", HG_LIGHT_RECTANGLE, {1, 5, -1}, {-0.05, -1, 0.02}, 0, 8, 5},
    {"disc", HG_LIGHT_DISC, {-1, 4.5, 0}, {0.4, -1, 0.1}, 0.8, 0, 0},
    {"tube", HG_LIGHT_TUBE, {0, 5, -1}, {0.1, -1, 0.4}, 0.2, 3, 0},
};

// Rays to lights leave hardly any noise (blocks are off by 0.1 % with 256 samples).
static void test_shapes(void **state)
{
    struct rig *rig = *state;
    const struct rig_camera before = camera;
    for (size_t i = 0; i < sizeof shapes / sizeof shapes[0]; i++) {
        double axes[3][3];
        add_plane(rig, 0, 1);
        add_shape(rig, &shapes[i], axes);
        for (uint32_t use = 0; use < 3; use++) {
            const bool met = use == HG_PATH_USE_SURFACES;
            rig->renderer->context.overrides.path_estimators = use;
            camera.samples = met ? 256 : 64;
            check(rig, &shapes[i], axes, met ? 0.04 : 0.005, met ? 0.015 : 0.003);
            rig->renderer->context.overrides.path_estimators = 0;
        }
    }
    camera = before;
}

// Far away it is the point light of the same intensity, whatever the shape; a disc and a rectangle
// give what the cosine leaves of it.
static void test_far(void **state)
{
    struct rig *rig = *state;
    const struct rig_camera before = camera;
    camera.samples = 32; // of 1,024 px: what all see is nearly the same
    static const unsigned kinds[] = {
        HG_LIGHT_POINT, HG_LIGHT_SPOT, HG_LIGHT_RECTANGLE, HG_LIGHT_DISC, HG_LIGHT_TUBE};
    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++) {
        double mean[2];
        for (int sized = 0; sized < 2; sized++) {
            const double at[3] = {0, 30, 0}, down[3] = {0, -1, 0};
            add_plane(rig, 0, 1);
            struct hg_light *light = rig_light(rig,
                sized    ? kinds[i]
                : i == 1 ? HG_LIGHT_SPOT
                         : HG_LIGHT_POINT,
                at, down);
            light->intensity = 900 * 3;
            light->radius = sized ? 0.05f : 0;
            light->width = light->height = 0.1f;
            struct hg_refbuf *pixels = rig_render(rig, &camera);
            const float *rgba = (const float *)(const void *)pixels->data;
            mean[sized] = 0;
            for (int k = 0; k < SIDE * SIDE; k++)
                mean[sized] += (double)rgba[4 * k + 1] / (SIDE * SIDE);
            hg_refbuf_unref(pixels);
        }
        print_message("kind %u far away: %.5f, a point %.5f\n", kinds[i], mean[1], mean[0]);
        // The cosine at the light, over the 1.5 m around the middle.
        assert_true(fabs(mean[1] / mean[0] - 1) < 0.004);
    }
    camera = before;
}

// A directional light is as bright with a disc, and its penumbra as wide as the disc.
static void test_sun(void **state)
{
    struct rig *rig = *state;
    const double at[3] = {0, 5, 0}, slanted[3] = {0.5, -1, 0};
    static const double diameters[] = {0, 0.2};
    const struct rig_camera before = camera;
    double mean[2];
    camera.samples = 32;
    for (int i = 0; i < 2; i++) {
        add_plane(rig, 0, 1);
        struct hg_light *sun = rig_light(rig, HG_LIGHT_DIRECTIONAL, at, slanted);
        sun->intensity = 3;
        sun->casts_shadow = true;
        sun->angular_diameter_rad = (float)diameters[i];
        struct hg_refbuf *pixels = rig_render(rig, &camera);
        const float *rgba = (const float *)(const void *)pixels->data;
        mean[i] = 0;
        for (int k = 0; k < SIDE * SIDE; k++)
            mean[i] += (double)rgba[4 * k + 1] / (SIDE * SIDE);
        hg_refbuf_unref(pixels);
    }
    camera = before;
    print_message("sun: %.5f, with a disc %.5f\n", mean[0], mean[1]);
    assert_true(fabs(mean[1] / mean[0] - 1) < 0.002);
}

// A mirror shows the surface in its radiance; the camera sees nothing of it, nor does it hide
// anything.
static void test_seen(void **state)
{
    struct rig *rig = *state;
    const struct shape lamp = {"rectangle", HG_LIGHT_RECTANGLE, {0, 6, -3}, {0, -1, 0}, 0, 1, 1};
    double axes[3][3];
    const struct rig_camera low = {.eye = {0, 2, 3},
        .target = {0, 0, 3 - 2 * 6.0 / 8},
        .vfov_rad = 0.2,
        .width = SIDE,
        .height = SIDE,
        .samples = 16,
        .mode = HG_MODE_PATH,
        .max_bounces = 2};
    add_plane(rig, 1, 0);
    add_shape(rig, &lamp, axes);
    struct hg_refbuf *pixels = rig_render(rig, &low);
    const float *rgba = (const float *)(const void *)pixels->data;
    const double middle = (double)rgba[(SIDE / 2 * SIDE + SIDE / 2) * 4 + 1];
    print_message("mirrored: %.4f, the surface has %.4f\n", middle, radiance_of(&lamp));
    assert_true(fabs(middle / radiance_of(&lamp) - 1) < 0.01);
    hg_refbuf_unref(pixels);

    struct rig_camera up = low;
    up.target[1] = 2 + (6 - 2); // through the lamp's middle, from below
    up.target[2] = -3;
    pixels = rig_render(rig, &up);
    rgba = (const float *)(const void *)pixels->data;
    for (int i = 0; i < SIDE * SIDE; i++)
        assert_true(rgba[4 * i + 1] == 0);
    hg_refbuf_unref(pixels);
}

// Real time without rays: the outline of the surface is integrated in closed form. Rounds are
// polygons of twelve corners.
static void test_realtime(void **state)
{
    struct rig *rig = *state;
    const struct rig_camera paths = camera;
    camera.mode = HG_MODE_REALTIME;
    camera.gi = HG_GI_NONE;
    camera.samples = 16;
    for (size_t i = 0; i < sizeof shapes / sizeof shapes[0]; i++) {
        double axes[3][3];
        add_plane(rig, 0, 1);
        add_shape(rig, &shapes[i], axes)->casts_shadow = false;
        const bool exact = shapes[i].kind == HG_LIGHT_RECTANGLE;
        check(rig, &shapes[i], axes, exact ? 0.002 : 0.006, exact ? 0.001 : 0.004);
    }
    camera = paths;
}

// A plate half way between a lamp and the floor, whose edge is at x = 0, from below it: the mean of
// each column, left to right.
enum { WIDE = 64 };
static void profile_of(struct rig *rig, enum hg_render_mode mode, enum hg_view_gi gi,
    uint32_t samples, double out[WIDE])
{
    const struct rig_camera below = {.eye = {0, 1.8, 0},
        .target = {0, 0, 0},
        .vfov_rad = 0.8,
        .width = WIDE,
        .height = 16,
        .samples = samples,
        .mode = mode,
        .max_bounces = 1,
        .gi = gi};
    struct rig_camera narrow = below;
    narrow.vfov_rad = 2 * atan(tan(0.4) * 16 / WIDE); // as wide as a square picture of 0.8 is
    struct hg_refbuf *pixels = rig_render(rig, &narrow);
    const float *rgba = (const float *)(const void *)pixels->data;
    memset(out, 0, WIDE * sizeof *out);
    for (int i = 0; i < WIDE * 16; i++)
        out[i % WIDE] += (double)rgba[4 * i + 1] / 16;
    hg_refbuf_unref(pixels);
}

// Columns between 10 and 90 % of the light, and the one with half of it.
static void edge_of(const double profile[WIDE], double *width, double *middle)
{
    const bool falls = profile[0] > profile[WIDE - 1];
    const double most = fmax(profile[0], profile[WIDE - 1]), shares[3] = {0.1, 0.5, 0.9};
    double at[3] = {0};
    for (int s = 0; s < 3; s++)
        for (int x = 1; x < WIDE; x++) {
            const double a = profile[x - 1] / most - shares[s], b = profile[x] / most - shares[s];
            if (falls ? a >= 0 && b < 0 : a < 0 && b >= 0)
                at[s] = x - 0.5 + a / (a - b);
        }
    *width = fabs(at[2] - at[0]);
    *middle = at[1];
}

// At rest with rays the lamp's light is gathered: the penumbra is that of paths, and the light as
// well.
static void test_gathered(void **state)
{
    struct rig *rig = *state;
    static const float plate[4][3] = {{-9, 2, 9}, {0, 2, 9}, {0, 2, -9}, {-9, 2, -9}};
    const double high[3] = {0, 6, 0}, down[3] = {0, -1, 0};
    double profile[2][WIDE], width[2], middle[2], sum[2] = {0}, off = 0;
    add_plane(rig, 0, 1);
    struct hg_material *black = rig_material(rig);
    black->double_sided = true;
    memset(black->base_color, 0, 3 * sizeof(float));
    rig_quad(rig, black, plate);
    struct hg_light *light = rig_light(rig, HG_LIGHT_POINT, high, down);
    light->intensity = 60;
    light->casts_shadow = true;
    light->radius = 0.4f;
    for (int rays = 0; rays < 2; rays++) {
        profile_of(rig, rays ? HG_MODE_REALTIME : HG_MODE_PATH, HG_GI_RAYS, rays ? 16 : 256,
            profile[rays]);
        edge_of(profile[rays], &width[rays], &middle[rays]);
        for (int x = 0; x < WIDE; x++)
            sum[rays] += profile[rays][x];
    }
    for (int x = 0; x < WIDE; x++)
        off += fabs(profile[1][x] - profile[0][x]);
    print_message("gathered: %.4f, paths %.4f; columns %.2f %% off; 10 to 90 %% in %.2f px, %.2f\n",
        sum[1] / WIDE, sum[0] / WIDE, off / sum[0] * 100, width[1], width[0]);
    assert_true(fabs(sum[1] / sum[0] - 1) < 0.02);
    assert_true(off / sum[0] < 0.03);
    assert_true(fabs(width[1] / width[0] - 1) < 0.1);
}

// Mean difference of squares of two pictures, of each colour, over the mean of the second one.
static void squares_apart(
    const struct rig_camera *c, const struct hg_refbuf *a, const struct hg_refbuf *b, double off[3])
{
    const float *of[2] = {
        (const float *)(const void *)a->data, (const float *)(const void *)b->data};
    for (int colour = 0; colour < 3; colour++) {
        double differs = 0, all = 0;
        for (uint32_t y = 0; y + SQUARE <= c->height; y += SQUARE)
            for (uint32_t x = 0; x + SQUARE <= c->width; x += SQUARE) {
                double sums[2] = {0};
                for (uint32_t k = 0; k < SQUARE * SQUARE; k++)
                    for (int i = 0; i < 2; i++)
                        sums[i] +=
                            (double)of[i][4 * ((y + k / SQUARE) * c->width + x + k % SQUARE) +
                                          (uint32_t)colour];
                differs += fabs(sums[0] - sums[1]);
                all += sums[1];
            }
        off[colour] = differs / all;
    }
}

// Slabs low over a floor, under lamps without a size, red and blue, and a green one that casts no
// shadows: at rest with rays their shadows are those of paths, of each colour.
static void test_gathered_lamps(void **state)
{
    struct rig *rig = *state;
    static const float slabs[][2][3] = {{{-0.5f, 0.02f, -0.3f}, {-0.2f, 0.03f, 0.3f}},
        {{0, 0.05f, -0.3f}, {0.1f, 0.3f, -0.1f}}, {{0.2f, 0.01f, -0.1f}, {0.4f, 0.02f, 0.4f}}};
    static const double at[3][3] = {{-1.5, 2, 0.5}, {1.2, 1.6, -0.7}, {0.3, 3, 1}};
    const double down[3] = {0, -1, 0};
    struct rig_camera above = {.eye = {0, 1.4, 0.6},
        .target = {0, 0, 0},
        .vfov_rad = 0.7,
        .width = 96,
        .height = 72,
        .samples = 64,
        .mode = HG_MODE_PATH,
        .max_bounces = 1};
    add_plane(rig, 0, 1);
    struct hg_material *black = rig_material(rig);
    memset(black->base_color, 0, 3 * sizeof(float));
    black->specular.factor = 0;
    black->specular.is_set = true;
    for (size_t i = 0; i < sizeof slabs / sizeof *slabs; i++)
        for (int face = 0; face < 6; face++)
            rig_face(rig, black, slabs[i], -1, face);
    for (int i = 0; i < 3; i++) {
        struct hg_light *lamp = rig_light(rig, HG_LIGHT_POINT, at[i], down);
        lamp->intensity = 20;
        lamp->casts_shadow = i < 2;
        for (int c = 0; c < 3; c++)
            lamp->color[c] = c == (i == 1 ? 2 : i == 2 ? 1 : 0) ? 1.0f : 0.02f;
    }
    struct hg_refbuf *paths = rig_render(rig, &above);
    above.mode = HG_MODE_REALTIME;
    above.samples = 32;
    double off[2][3];
    for (int rays = 0; rays < 2; rays++) {
        above.gi = rays ? HG_GI_RAYS : HG_GI_NONE;
        struct hg_refbuf *picture = rig_render(rig, &above);
        squares_apart(&above, picture, paths, off[rays]);
        hg_refbuf_unref(picture);
    }
    hg_refbuf_unref(paths);
    for (int c = 0; c < 3; c++)
        print_message("colour %d: %.2f %% off, %.2f %% with shadow maps\n", c, off[1][c] * 100,
            off[0][c] * 100);
    for (int c = 0; c < 3; c++)
        assert_true(off[1][c] < 0.015);
}

// Mean of each column over that of all; where the columns differ.
static double columns_of(struct rig *rig, const struct rig_camera *c, double out[SLAT_COLUMNS])
{
    struct hg_refbuf *pixels = rig_render(rig, c);
    const float *rgba = (const float *)(const void *)pixels->data;
    double sum = 0, variance = 0;
    memset(out, 0, SLAT_COLUMNS * sizeof *out);
    for (uint32_t i = 0; i < c->width * c->height; i++)
        out[i % c->width] += (double)rgba[4 * i + 1];
    hg_refbuf_unref(pixels);
    for (int x = 0; x < SLAT_COLUMNS; x++)
        sum += out[x] / SLAT_COLUMNS;
    for (int x = 0; x < SLAT_COLUMNS; x++) {
        out[x] /= sum;
        variance += (out[x] - 1) * (out[x] - 1) / SLAT_COLUMNS;
    }
    return sqrt(variance);
}

// The shadows of slats, a few pixels wide, from a lamp without a size beside a panel that shines
// more: with few samples as sharp as those of paths. The slats are bars of a texture with holes
// that blends.
static void test_gathered_slats(void **state)
{
    struct rig *rig = *state;
    static const float panel[4][3] = {{-4, 4, -2}, {4, 4, -2}, {4, 4, -5}, {-4, 4, -5}};
    static const float slats[4][3] = {
        {-0.3f, 1, 0.3f}, {0.3f, 1, 0.3f}, {0.3f, 1, -2}, {-0.3f, 1, -2}};
    const double at[3] = {0, 2, 0}, down[3] = {0, -1, 0};
    struct rig_camera above = {.eye = {0, 1.4, 1.2},
        .target = {0, 0, 0},
        .vfov_rad = 0.5,
        .width = SLAT_COLUMNS,
        .height = 64,
        .samples = 64,
        .mode = HG_MODE_PATH,
        .max_bounces = 1};
    double columns[2][SLAT_COLUMNS], contrast[2], off = 0;
    add_plane(rig, 0, 1);
    struct hg_material *black = rig_material(rig), *bright = rig_material(rig);
    memset(black->base_color, 0, 3 * sizeof(float));
    black->alpha_mode = HG_ALPHA_BLEND;
    black->double_sided = true;
    bright->double_sided = true;
    for (int c = 0; c < 3; c++)
        bright->emissive[c] = 8;
    rig_quad(rig, bright, panel);
    black->slots[HG_SLOT_BASE_COLOR].texture = rig_bars(rig);
    rig_quad(rig, black, slats);
    struct hg_light *lamp = rig_light(rig, HG_LIGHT_POINT, at, down);
    lamp->intensity = 8;
    lamp->casts_shadow = true;
    contrast[0] = columns_of(rig, &above, columns[0]);
    above.mode = HG_MODE_REALTIME;
    above.gi = HG_GI_RAYS;
    above.samples = 2;
    contrast[1] = columns_of(rig, &above, columns[1]);
    for (int x = 0; x < SLAT_COLUMNS; x++)
        off += fabs(columns[1][x] - columns[0][x]) / SLAT_COLUMNS;
    print_message("slats: columns differ by %.3f, of paths by %.3f; %.3f apart\n", contrast[1],
        contrast[0], off);
    assert_true(contrast[0] > 0.05);
    assert_true(fabs(contrast[1] / contrast[0] - 1) < 0.1);
    assert_true(off < 0.25 * contrast[0]);
}

// Penumbrae of shadow maps are as wide as those of paths, and as geometry says; without a size
// hard.
static void test_penumbra(void **state)
{
    struct rig *rig = *state;
    static const float plate[4][3] = {{-9, 2, 9}, {0, 2, 9}, {0, 2, -9}, {-9, 2, -9}};
    const double high[3] = {0, 6, 0}, down[3] = {0, -1, 0}, column_m = 2 * 1.8 * tan(0.4) / WIDE;
    for (int i = 0; i < 4; i++) {
        double profile[WIDE], width[3], middle[3];
        add_plane(rig, 0, 1);
        struct hg_material *black = rig_material(rig);
        black->double_sided = true;
        memset(black->base_color, 0, 3 * sizeof(float));
        rig_quad(rig, black, plate);
        const unsigned kind = i == 0   ? HG_LIGHT_DIRECTIONAL
                              : i == 1 ? HG_LIGHT_SPOT
                              : i == 2 ? HG_LIGHT_POINT
                                       : HG_LIGHT_DISC;
        struct hg_light *light = rig_light(rig, kind, high, down);
        light->intensity = kind == HG_LIGHT_DIRECTIONAL ? 3 : 60;
        light->casts_shadow = true;
        light->radius = 0.4f;
        light->angular_diameter_rad = 0.2f;
        profile_of(rig, HG_MODE_PATH, HG_GI_NONE, 256, profile);
        edge_of(profile, &width[0], &middle[0]);
        profile_of(rig, HG_MODE_REALTIME, HG_GI_NONE, 32, profile);
        edge_of(profile, &width[1], &middle[1]);
        light->radius = light->angular_diameter_rad = 0;
        light->kind = kind == HG_LIGHT_DISC ? HG_LIGHT_POINT : light->kind;
        profile_of(rig, HG_MODE_REALTIME, HG_GI_NONE, 32, profile);
        edge_of(profile, &width[2], &middle[2]);
        // Of the disc, 10 and 90 % lie within 0.687 of its radius from the middle.
        const double radius_m = kind == HG_LIGHT_DIRECTIONAL ? 2 * tan(0.1) : 0.4 * 2 / 4;
        print_message("kind %u: 10 to 90 %% in %.3f m, paths %.3f, geometry %.3f, a point %.3f; "
                      "edge %.4f m off\n",
            kind, width[1] * column_m, width[0] * column_m, 2 * 0.687 * radius_m,
            width[2] * column_m, (middle[1] - middle[0]) * column_m);
        assert_true(fabs(width[0] * column_m / (2 * 0.687 * radius_m) - 1) < 0.05);
        assert_true(fabs(width[1] / width[0] - 1) < 0.1);
        assert_true(fabs(middle[1] - middle[0]) * column_m < 0.02);
        assert_true(width[2] < 0.4 * width[1]);
    }
}

// Mean of each block, of a glossy plane.
static void blocks_of(struct rig *rig, double out[SIDE / BLOCK * (SIDE / BLOCK)])
{
    struct hg_refbuf *pixels = rig_render(rig, &camera);
    const float *rgba = (const float *)(const void *)pixels->data;
    for (int b = 0; b < SIDE / BLOCK * (SIDE / BLOCK); b++)
        out[b] = 0;
    for (int i = 0; i < SIDE * SIDE; i++) {
        const int x = i % SIDE, y = i / SIDE;
        out[y / BLOCK * (SIDE / BLOCK) + x / BLOCK] += (double)rgba[4 * i + 1] / (BLOCK * BLOCK);
    }
    hg_refbuf_unref(pixels);
}

// Metals and dielectrics under every shape, against paths: differences of blocks over the mean.
static void test_glossy(void **state)
{
    struct rig *rig = *state;
    const struct rig_camera before = camera;
    static const float roughs[] = {0.2f, 0.4f, 0.6f, 0.8f, 1};
    enum { COUNT = SIDE / BLOCK * (SIDE / BLOCK) };
    for (size_t i = 0; i < sizeof shapes / sizeof shapes[0]; i++) {
        for (size_t r = 0; r < sizeof roughs / sizeof roughs[0]; r++) {
            double blocks[2][COUNT], axes[3][3], mean = 0, square = 0;
            add_plane(rig, 1, roughs[r]);
            add_shape(rig, &shapes[i], axes)->casts_shadow = false;
            for (int real_time = 0; real_time < 2; real_time++) {
                camera.mode = real_time ? HG_MODE_REALTIME : HG_MODE_PATH;
                camera.samples = real_time ? 16 : 64;
                blocks_of(rig, blocks[real_time]);
            }
            for (int b = 0; b < COUNT; b++) {
                mean += blocks[0][b] / COUNT;
                square += pow(blocks[1][b] - blocks[0][b], 2) / COUNT;
            }
            print_message("%s, roughness %.1f: mean %.4f, difference of blocks %.2f %%\n",
                shapes[i].name, (double)roughs[r], mean, sqrt(square) / mean * 100);
            assert_true(sqrt(square) / mean < 0.04);
        }
    }
    camera = before;
}

int main(int argc, char **argv) // argv[1]: only tests of this name
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_shapes),
        cmocka_unit_test(test_far),
        cmocka_unit_test(test_sun),
        cmocka_unit_test(test_seen),
        cmocka_unit_test(test_realtime),
        cmocka_unit_test(test_glossy),
        cmocka_unit_test(test_gathered_slats),
        cmocka_unit_test(test_penumbra),
        cmocka_unit_test(test_gathered),
        cmocka_unit_test(test_gathered_lamps),
    };
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
