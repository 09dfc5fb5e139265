// light_tables.c - photometric profiles and images of lights over a white plane, in real time and
// path-traced, against closed forms and integrals.
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/internal.h"
#include "renderer/scene/asset.h"
#include "renderer/scene/light_table.h"
#include "tests/analytic/rig.h"

enum { SIDE = 32, BLOCK = 8, STEPS = 64 };

static struct rig_camera camera = {.eye = {1, 4, 2.5},
    .target = {0, 0, 0},
    .vfov_rad = 0.8,
    .width = SIDE,
    .height = SIDE,
    .samples = 64,
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

static void on_plane(double x, double y, double p[3])
{
    double d[3];
    rig_ray(&camera, x, y, d);
    for (int a = 0; a < 3; a++)
        p[a] = camera.eye[a] - d[a] * camera.eye[1] / d[1];
}

// The frame of a light's node: x, up, and against its direction.
static void frame_of(struct rig *rig, const struct hg_light *light, double m[3][3])
{
    const float *q = rig_node_of(rig, light)->rotation;
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    const double axes[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)},
        {2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)},
        {2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)}};
    memcpy(m, axes, sizeof axes);
}

// Radiance of the white plane at a point, in three colours.
typedef void expected_fn(const void *user, const double p[3], double rgb[3]);

// Blocks of a picture within `most` of what is expected, or of the mean where that is more.
static void check(struct rig *rig, const char *name, enum hg_render_mode mode, double most,
    expected_fn *expected, const void *user)
{
    const int across = 2; // points of a pixel
    camera.mode = mode;
    struct hg_refbuf *pixels = rig_render(rig, &camera);
    const float *rgba = (const float *)(const void *)pixels->data;
    double worst = 0, mean = 0, sums[2][SIDE / BLOCK * (SIDE / BLOCK)][3] = {0};
    for (int i = 0; i < SIDE * SIDE; i++) {
        const int b = i / SIDE / BLOCK * (SIDE / BLOCK) + i % SIDE / BLOCK;
        for (int k = 0; k < across * across; k++) {
            double p[3], rgb[3];
            on_plane(
                i % SIDE + (k % across + 0.5) / across, i / SIDE + (k / across + 0.5) / across, p);
            expected(user, p, rgb);
            for (int c = 0; c < 3; c++)
                sums[1][b][c] += rgb[c] / (across * across * BLOCK * BLOCK);
        }
        for (int c = 0; c < 3; c++)
            sums[0][b][c] += (double)rgba[i * 4 + c] / (BLOCK * BLOCK);
    }
    const int blocks = SIDE / BLOCK * (SIDE / BLOCK);
    for (int b = 0; b < blocks; b++)
        mean += (sums[1][b][0] + sums[1][b][1] + sums[1][b][2]) / (3 * blocks);
    for (int b = 0; b < blocks; b++)
        for (int c = 0; c < 3; c++)
            worst = fmax(worst, fabs(sums[0][b][c] - sums[1][b][c]) / fmax(sums[1][b][c], mean));
    hg_refbuf_unref(pixels);
    print_message("%s, %s: worst block %.3f %%\n", name,
        mode == HG_MODE_PATH ? "paths" : "real time", worst * 100);
    assert_true(mean > 0);
    if (worst > most)
        fail_msg("%s: %.3f %% off", name, worst * 100);
}

// --- profiles ------------------------------------------------------------------------------------

struct lamp {
    double at[3], frame[3][3], candela;
    int power;     // of the cosine
    bool lopsided; // twice as bright on the side of its x
};

static double intensity_of(const struct lamp *lamp, const double d[3])
{
    const double length = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    double local[3] = {0};
    for (int a = 0; a < 3; a++)
        for (int k = 0; k < 3; k++)
            local[a] += lamp->frame[a][k] * d[k] / length;
    const double around = hypot(local[0], local[1]);
    const double side = lamp->lopsided && around > 0 ? 0.75 + 0.25 * local[0] / around : 1;
    return lamp->candela * side * pow(fmax(-local[2], 0), lamp->power);
}

static void lit_by_lamp(const void *user, const double p[3], double rgb[3])
{
    const struct lamp *lamp = user;
    const double d[3] = {p[0] - lamp->at[0], p[1] - lamp->at[1], p[2] - lamp->at[2]};
    const double square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    const double e = intensity_of(lamp, d) * -d[1] / (square * sqrt(square));
    for (int c = 0; c < 3; c++)
        rgb[c] = e / M_PI;
}

static void write_ies(const struct lamp *lamp, char *text, size_t capacity)
{
    const int planes = lamp->lopsided ? 37 : 1;
    size_t at = (size_t)snprintf(
        text, capacity, "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 91 %d 1 2 0 0 0\n1 1 100\n", planes);
    for (int v = 0; v <= 90; v++)
        at += (size_t)snprintf(text + at, capacity - at, "%d ", v);
    for (int h = 0; h < planes; h++)
        at += (size_t)snprintf(text + at, capacity - at, "%c%d ", h ? ' ' : '\n', 5 * h);
    for (int h = 0; h < planes; h++)
        for (int v = 0; v <= 90; v++) {
            const double side = lamp->lopsided ? 0.75 + 0.25 * cos(5 * h * M_PI / 180) : 1;
            at += (size_t)snprintf(text + at, capacity - at, "%c%.5f", v ? ' ' : '\n',
                lamp->candela * side * pow(cos(v * M_PI / 180), lamp->power));
        }
    assert_true(at < capacity);
}

static void give_profile(struct hg_light *light, const struct lamp *lamp)
{
    struct hg_error err = {0};
    const size_t capacity = 1 << 17;
    char *text = hg_calloc(1, capacity);
    assert_non_null(text);
    write_ies(lamp, text, capacity);
    if (hg_light_profile_read_ies("lamp.ies", text, strlen(text), &light->profile, &err))
        fail_msg("%s: %s", err.where, err.reason);
    light->absolute = true;
    hg_free(text);
}

// Candela of a file, in both modes; a spot light's cone multiplies it, a sphere far away is as a
// point.
static void test_profiles(void **state)
{
    struct rig *rig = *state;
    static const struct lamp lamps[] = {{.at = {0, 5, 0}, .candela = 80, .power = 1},
        {.at = {0.5, 5, 0}, .candela = 80, .power = 8},
        {.at = {0, 5, -0.5}, .candela = 80, .power = 4, .lopsided = true}};
    static const double directions[][3] = {{0, -1, 0}, {0.2, -1, -0.1}, {0.1, -1, 0.3}};
    for (size_t i = 0; i < sizeof lamps / sizeof *lamps; i++) {
        struct lamp lamp = lamps[i];
        char name[64];
        add_plane(rig, 0, 1);
        struct hg_light *light = rig_light(rig, HG_LIGHT_POINT, lamp.at, directions[i]);
        give_profile(light, &lamp);
        frame_of(rig, light, lamp.frame);
        snprintf(name, sizeof name, "cos^%d%s", lamp.power, lamp.lopsided ? ", lopsided" : "");
        check(rig, name, HG_MODE_REALTIME, 0.005, lit_by_lamp, &lamp);
        check(rig, name, HG_MODE_PATH, 0.005, lit_by_lamp, &lamp);
        if (i > 0)
            continue;
        light->radius = 0.05f;
        check(rig, "cos, a sphere", HG_MODE_REALTIME, 0.005, lit_by_lamp, &lamp);
        check(rig, "cos, a sphere", HG_MODE_PATH, 0.02, lit_by_lamp, &lamp); // noise
    }
}

// --- projected images ----------------------------------------------------------------------------

enum { CELLS = 4, TEXELS = 256 };

// A checker of two colours, which is not symmetric: its first cell is green.
static void color_of(double u, double v, double rgb[3])
{
    const int x = (int)floor(u * CELLS), y = (int)floor(v * CELLS);
    rgb[0] = (x + y) % 2 ? 1 : 0.25;
    rgb[1] = x == 0 && y == 0 ? 1 : 0.5;
    rgb[2] = (x + y) % 2 ? 0.125 : 1;
}

static struct hg_texture *add_texture(struct rig *rig)
{
    struct hg_object *object;
    assert_int_equal(hg_scene_add(rig->scene, HG_OBJECT_TEXTURE, rig->next_id++, &object), HG_OK);
    struct hg_texture *texture = (struct hg_texture *)object;
    texture->image = hg_image_source_create("checker");
    assert_non_null(texture->image);
    struct hg_image *image = &texture->image->pixels;
    assert_int_equal(hg_image_create(TEXELS, TEXELS, HG_PIXEL_RGBA32F, NULL, image), HG_OK);
    float *to = image->pixels;
    for (int i = 0; i < TEXELS * TEXELS; i++) {
        double rgb[3];
        color_of((i % TEXELS + 0.5) / TEXELS, (i / TEXELS + 0.5) / TEXELS, rgb);
        for (int c = 0; c < 3; c++)
            to[4 * i + c] = (float)rgb[c];
        to[4 * i + 3] = 1;
    }
    return texture;
}

struct projector {
    unsigned kind;
    double at[3], frame[3][3], intensity, tangent, width, height;
};

static void lit_by_projector(const void *user, const double p[3], double rgb[3])
{
    const struct projector *s = user;
    double local[3] = {0}, d2 = 0, u, v;
    for (int a = 0; a < 3; a++) {
        for (int k = 0; k < 3; k++)
            local[a] += s->frame[a][k] * (p[k] - s->at[k]);
        d2 += (p[a] - s->at[a]) * (p[a] - s->at[a]);
    }
    double e = s->intensity * (s->at[1] - p[1]) / (d2 * sqrt(d2));
    if (s->kind == HG_LIGHT_DIRECTIONAL) {
        u = 0.5 + local[0] / s->width;
        v = 0.5 - local[1] / s->height;
        e = s->intensity * s->frame[2][1];
    } else if (s->kind == HG_LIGHT_SPOT) {
        u = 0.5 - local[0] / (2 * local[2] * s->tangent);
        v = 0.5 + local[1] / (2 * local[2] * s->tangent);
    } else {
        u = atan2(local[2], local[0]) / (2 * M_PI) + 0.5;
        v = 0.5 - asin(local[1] / sqrt(d2)) / M_PI;
    }
    color_of(u - floor(u), v - floor(v), rgb);
    for (int c = 0; c < 3; c++)
        rgb[c] *= e / M_PI;
}

// Pixels around which nothing but the distance changes, filters included, within 1 % of what is
// expected.
static void check_cells(
    struct rig *rig, const char *name, enum hg_render_mode mode, const struct projector *s)
{
    camera.mode = mode;
    struct hg_refbuf *pixels = rig_render(rig, &camera);
    const float *rgba = (const float *)(const void *)pixels->data;
    double worst = 0;
    int seen = 0;
    for (int i = 0; i < SIDE * SIDE; i++) {
        double p[3], middle[3], rgb[3];
        bool even = true;
        on_plane(i % SIDE + 0.5, i / SIDE + 0.5, p);
        lit_by_projector(s, p, middle);
        for (int k = 0; k < 9; k++) {
            on_plane(i % SIDE + 0.5 + 2 * (k % 3 - 1), i / SIDE + 0.5 + 2 * (k / 3 - 1), p);
            lit_by_projector(s, p, rgb);
            for (int c = 0; c < 3; c++)
                even = even && fabs(rgb[c] / middle[c] - 1) < 0.2;
        }
        seen += even;
        for (int c = 0; c < 3 && even; c++)
            worst = fmax(worst, fabs((double)rgba[4 * i + c] / middle[c] - 1));
    }
    hg_refbuf_unref(pixels);
    print_message("%s, %s: worst of %d pixels %.3f %%\n", name,
        mode == HG_MODE_PATH ? "paths" : "real time", seen, worst * 100);
    assert_true(seen > SIDE * SIDE / 8);
    if (worst > 0.01)
        fail_msg("%s: %.3f %% off", name, worst * 100);
}

// The same checker through spot, directional and point lights, which falls where it should in both
// modes.
static void test_projected(void **state)
{
    struct rig *rig = *state;
    static const char *const names[] = {"directional", "point", "spot"};
    for (unsigned kind = 0; kind < 3; kind++) {
        struct projector s = {
            .kind = kind, .at = {0.3, 5, 0.2}, .intensity = kind ? 60 : 2, .width = 6, .height = 5};
        const double slanted[3] = {0.2, -1, 0.1};
        struct hg_error err = {0};
        add_plane(rig, 0, 1);
        struct hg_light *light = rig_light(rig, kind, s.at, slanted);
        light->intensity = (float)s.intensity;
        light->width = 6;
        light->height = 5;
        light->outer_cone_rad = 0.9f;
        light->inner_cone_rad = 0.8999f; // nearly the whole picture lies within
        s.tangent = tan(0.9);
        frame_of(rig, light, s.frame);
        assert_int_equal(hg_light_set_texture(light, add_texture(rig), &err), HG_OK);
        check_cells(rig, names[kind], HG_MODE_REALTIME, &s);
        check_cells(rig, names[kind], HG_MODE_PATH, &s);
    }
}

// --- surfaces with an image ----------------------------------------------------------------------

struct panel {
    unsigned kind;
    double at[3], frame[3][3], intensity, width, height, radius;
};

static void lit_by_panel(const void *user, const double p[3], double rgb[3])
{
    const struct panel *s = user;
    const bool disc = s->kind == HG_LIGHT_DISC;
    const double w = disc ? 2 * s->radius : s->width, h = disc ? 2 * s->radius : s->height;
    const double radiance = s->intensity / (disc ? M_PI * s->radius * s->radius : w * h);
    memset(rgb, 0, 3 * sizeof *rgb);
    for (int i = 0; i < STEPS * STEPS; i++) {
        const double x = ((i % STEPS + 0.5) / STEPS - 0.5) * w,
                     y = ((i / STEPS + 0.5) / STEPS - 0.5) * h;
        double d[3], d2 = 0, facing = 0, color[3];
        for (int a = 0; a < 3; a++) {
            d[a] = s->at[a] + s->frame[0][a] * x + s->frame[1][a] * y - p[a];
            d2 += d[a] * d[a];
            facing += s->frame[2][a] * d[a];
        }
        if (facing <= 0 || d[1] <= 0 || (disc && x * x + y * y > s->radius * s->radius))
            continue;
        color_of(0.5 - x / w, 0.5 - y / h, color); // as seen from in front of it
        for (int c = 0; c < 3; c++)
            rgb[c] +=
                color[c] * radiance * facing * d[1] / (d2 * d2) * w * h / (STEPS * STEPS * M_PI);
    }
}

static struct hg_light *add_panel(struct rig *rig, struct panel *s, const double direction[3])
{
    struct hg_error err = {0};
    struct hg_light *light = rig_light(rig, s->kind, s->at, direction);
    light->intensity = (float)s->intensity;
    light->width = (float)s->width;
    light->height = (float)s->height;
    light->radius = (float)s->radius;
    frame_of(rig, light, s->frame);
    assert_int_equal(hg_light_set_texture(light, add_texture(rig), &err), HG_OK);
    return light;
}

static struct panel panels[] = {
    {.kind = HG_LIGHT_RECTANGLE, .at = {0.5, 1.5, 0}, .intensity = 20, .width = 3, .height = 2},
    {.kind = HG_LIGHT_DISC, .at = {0, 2, 0.3}, .intensity = 20, .radius = 1.2}};
static const double panel_directions[][3] = {{0.1, -1, 0.2}, {-0.1, -1, 0}};

// Exact in paths; in real time light is that of one blurred place on the surface.
static void test_panels(void **state)
{
    struct rig *rig = *state;
    for (size_t i = 0; i < sizeof panels / sizeof *panels; i++) {
        const char *name = panels[i].kind == HG_LIGHT_DISC ? "disc" : "rectangle";
        add_plane(rig, 0, 1);
        add_panel(rig, &panels[i], panel_directions[i]);
        camera.samples = 256;
        check(rig, name, HG_MODE_PATH, 0.02, lit_by_panel, &panels[i]);
        camera.samples = 16;
        check(rig, name, HG_MODE_REALTIME, 0.06, lit_by_panel, &panels[i]);
        camera.samples = 64;
    }
}

static void block_means(struct rig *rig, enum hg_render_mode mode, double means[16][3])
{
    camera.mode = mode;
    struct hg_refbuf *pixels = rig_render(rig, &camera);
    const float *rgba = (const float *)(const void *)pixels->data;
    memset(means, 0, 16 * sizeof *means);
    for (int i = 0; i < SIDE * SIDE; i++)
        for (int c = 0; c < 3; c++)
            means[i / SIDE / BLOCK * (SIDE / BLOCK) + i % SIDE / BLOCK][c] +=
                (double)rgba[4 * i + c] / (BLOCK * BLOCK);
    hg_refbuf_unref(pixels);
}

// What metals of several roughnesses reflect of them, beside the paths.
static void test_reflected(void **state)
{
    struct rig *rig = *state;
    static const float roughness[] = {0.2f, 0.5f, 1};
    for (size_t i = 0; i < sizeof roughness / sizeof *roughness; i++) {
        double real[16][3], path[16][3], mean = 0, worst = 0, square = 0;
        add_plane(rig, 1, roughness[i]);
        add_panel(rig, &panels[0], panel_directions[0]);
        camera.samples = 256;
        block_means(rig, HG_MODE_PATH, path);
        camera.samples = 16;
        block_means(rig, HG_MODE_REALTIME, real);
        camera.samples = 64;
        for (int b = 0; b < 16; b++)
            for (int c = 0; c < 3; c++)
                mean += path[b][c] / 48;
        for (int b = 0; b < 16; b++)
            for (int c = 0; c < 3; c++) {
                const double off = fabs(real[b][c] - path[b][c]) / fmax(path[b][c], mean);
                worst = fmax(worst, off);
                square += off * off / 48;
            }
        print_message("roughness %.1f: worst block %.2f %%, mean square %.2f %%\n",
            (double)roughness[i], worst * 100, sqrt(square) * 100);
        assert_true(sqrt(square) < 0.06);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_profiles),
        cmocka_unit_test(test_projected), cmocka_unit_test(test_panels),
        cmocka_unit_test(test_reflected)};
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
