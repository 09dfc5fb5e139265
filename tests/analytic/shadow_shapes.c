// shadow_shapes.c - whole frames: shadows on a round receiver, of a caster with holes, along the
// cascades of the sun, and the run of a shadow's edge, against rays in double precision.
// Each frame is compared with the same frame without shadows: the share of light let through.
#include <math.h>
#include <string.h>

#include "renderer/scene/asset.h"
#include "tests/analytic/rig.h"

#define MAX_PIXELS (640 * 240)

enum seen { NOTHING, LIT, DARK };

static float share[MAX_PIXELS];
static enum seen map[MAX_PIXELS];

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void along(const double o[3], const double d[3], double t, double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = o[i] + d[i] * t;
}

// Unit vector from a point to the light; its distance, 1e30 for the sun.
static double towards(
    const struct hg_light *light, const double place[3], const double p[3], double l[3])
{
    for (int i = 0; i < 3; i++)
        l[i] = place[i] - (light->kind == HG_LIGHT_DIRECTIONAL ? 0 : p[i]);
    double r = sqrt(dot(l, l));
    for (int i = 0; i < 3; i++)
        l[i] /= r;
    return light->kind == HG_LIGHT_DIRECTIONAL ? 1e30 : r;
}

// A light at `place` (the sun: in that direction) that looks at the origin.
static struct hg_light *light_from(struct rig *rig, unsigned kind, const double place[3])
{
    const double direction[3] = {-place[0], -place[1], -place[2]};
    struct hg_light *light = rig_light(rig, kind, place, direction);
    light->intensity = kind == HG_LIGHT_DIRECTIONAL ? 3 : 20;
    light->inner_cone_rad = 0.8f;
    light->outer_cone_rad = 0.9f;
    return light;
}

static void render_share(struct rig *rig, struct hg_light *light, const struct rig_camera *camera)
{
    assert_true(camera->width * camera->height <= MAX_PIXELS);
    light->casts_shadow = true;
    hg_scene_touch(rig->scene, &light->head);
    struct hg_refbuf *with = rig_render(rig, camera);
    light->casts_shadow = false;
    hg_scene_touch(rig->scene, &light->head);
    struct hg_refbuf *without = rig_render(rig, camera);
    for (uint32_t i = 0; i < camera->width * camera->height; i++) {
        float a = ((const float *)with->data)[i * 4 + 1];
        float b = ((const float *)without->data)[i * 4 + 1];
        share[i] = b > 1e-4f ? a / b : -1;
    }
    hg_refbuf_unref(with);
    hg_refbuf_unref(without);
}

// Compares pixels whose surroundings of `margin` px are all of their own class.
static void compare(const struct rig_camera *camera, int margin, const char *name)
{
    const int w = (int)camera->width, h = (int)camera->height;
    int lit = 0, dark = 0, acne = 0, detached = 0;
    for (int y = margin; y < h - margin; y++)
        for (int x = margin; x < w - margin; x++) {
            enum seen c = map[y * w + x];
            bool same = c != NOTHING && share[y * w + x] >= 0;
            for (int k = 0; same && k < (2 * margin + 1) * (2 * margin + 1); k++)
                same = map[(y + k / (2 * margin + 1) - margin) * w + x + k % (2 * margin + 1) -
                           margin] == c;
            if (!same)
                continue;
            *(c == LIT ? &lit : &dark) += 1;
            acne += c == LIT && share[y * w + x] < 0.98f;
            detached += c == DARK && share[y * w + x] > 0.02f;
        }
    print_message("%s: %d lit, %d acne; %d dark, %d detached\n", name, lit, acne, dark, detached);
    assert_true(lit > 500 && dark > 200);
    assert_int_equal(acne, 0);
    assert_int_equal(detached, 0);
}

// --- a ball on a ball ----------------------------------------------------------------------------

static bool hit_ball(
    const double o[3], const double d[3], const double center[3], double radius, double *t)
{
    double v[3] = {o[0] - center[0], o[1] - center[1], o[2] - center[2]};
    double b = dot(v, d), disc = b * b - dot(v, v) + radius * radius;
    *t = -b - sqrt(fmax(disc, 0));
    return disc > 0 && *t > 1e-9;
}

static void test_balls(void **state)
{
    static const double places[3][3] = {{1, 1.4, 1.2}, {1.8, 1.6, 1.4}, {1.5, 2.2, 1.2}};
    static const unsigned kinds[3] = {HG_LIGHT_DIRECTIONAL, HG_LIGHT_POINT, HG_LIGHT_SPOT};
    static const char *const names[3] = {"directional, balls", "point, balls", "spot, balls"};
    const struct rig_camera camera = {.eye = {0.9, 1.9, 3.0},
        .target = {0, 0, 0},
        .vfov_rad = 0.75,
        .width = 200,
        .height = 200,
        .samples = 8};
    struct rig *rig = *state;
    for (int k = 0; k < 3; k++) {
        double n = sqrt(dot(places[k], places[k])), small[3], zero[3] = {0, 0, 0};
        const float origin[3] = {0, 0, 0};
        float at[3];
        rig_scene(rig);
        for (int i = 0; i < 3; i++) {
            small[i] = places[k][i] / n * 1.5 + (i == 0 ? 0.1 : -0.05);
            at[i] = (float)small[i];
        }
        rig_sphere(rig, rig_material(rig), origin, 1, 96);
        rig_sphere(rig, rig_material(rig), at, 0.25f, 48);
        struct hg_light *light = light_from(rig, kinds[k], places[k]);
        render_share(rig, light, &camera);
        for (int i = 0; i < 200 * 200; i++) {
            double d[3], p[3], l[3], t, unused;
            rig_ray(&camera, i % 200 + 0.5, i / 200 + 0.5, d);
            map[i] = NOTHING;
            if (hit_ball(camera.eye, d, small, 0.25, &unused) ||
                !hit_ball(camera.eye, d, zero, 1, &t))
                continue;
            along(camera.eye, d, t, p);
            towards(light, places[k], p, l);
            if (dot(p, l) > 0.12) // beside the terminator
                map[i] = hit_ball(p, l, small, 0.25, &unused) ? DARK : LIT;
        }
        compare(&camera, 4, names[k]);
    }
}

// --- a caster with holes -------------------------------------------------------------------------

enum { CELLS = 4, TEXELS = 16 }; // across the caster; across a cell

static void set_holes(struct rig *rig, struct hg_material *material)
{
    struct hg_object *texture;
    struct hg_error err = {0};
    const uint32_t side = CELLS * TEXELS;
    test_ok(hg_scene_add(rig->scene, HG_OBJECT_TEXTURE, rig->next_id++, &texture), &err);
    struct hg_texture *t = (struct hg_texture *)texture;
    t->image = hg_image_source_create("holes");
    assert_non_null(t->image);
    t->mag_nearest = true;
    test_ok(hg_image_create(side, side, HG_PIXEL_RGBA8, NULL, &t->image->pixels), &err);
    t->image->pixels.has_alpha = true;
    for (uint32_t i = 0; i < side * side; i++) {
        uint32_t parity = (i % side / TEXELS + i / side / TEXELS) % 2;
        memset((uint8_t *)t->image->pixels.pixels + i * 4, 255, 4);
        ((uint8_t *)t->image->pixels.pixels)[i * 4 + 3] = parity ? 0 : 255;
    }
    material->alpha_mode = HG_ALPHA_MASK;
    material->double_sided = true;
    material->slots[HG_SLOT_BASE_COLOR].texture = t;
}

// Where a ray crosses the caster, y = 1, -1..1 in x and z: false outside, else whether it is solid.
static bool crosses(const double o[3], const double d[3], double far, bool *solid)
{
    double t = (1 - o[1]) / d[1], x = o[0] + d[0] * t, z = o[2] + d[2] * t;
    if (!(t > 0 && t < far) || fabs(x) >= 1 || fabs(z) >= 1)
        return false;
    int i = (int)((x + 1) / 2 * CELLS), k = (int)((1 - z) / 2 * CELLS); // v runs towards -z
    *solid = (i + k) % 2 == 0;
    return true;
}

static void test_holes(void **state)
{
    static const double places[3][3] = {{0.7, 1, 0.45}, {0.8, 3, 0.5}, {1.2, 3.2, 0.9}};
    static const unsigned kinds[3] = {HG_LIGHT_DIRECTIONAL, HG_LIGHT_POINT, HG_LIGHT_SPOT};
    static const char *const names[3] = {"directional, holes", "point, holes", "spot, holes"};
    static const float floor[4][3] = {{-4, 0, 4}, {4, 0, 4}, {4, 0, -4}, {-4, 0, -4}};
    static const float sheet[4][3] = {{-1, 1, 1}, {1, 1, 1}, {1, 1, -1}, {-1, 1, -1}};
    const struct rig_camera camera = {.eye = {-2.2, 0.9, -1.2}, // below the sheet
        .target = {-0.2, 0, -0.2},
        .vfov_rad = 1.0,
        .width = 240,
        .height = 160,
        .samples = 8};
    struct rig *rig = *state;
    for (int k = 0; k < 3; k++) {
        rig_scene(rig);
        rig_quad(rig, rig_material(rig), floor);
        struct hg_material *material = rig_material(rig);
        set_holes(rig, material);
        rig_quad(rig, material, sheet);
        struct hg_light *light = light_from(rig, kinds[k], places[k]);
        render_share(rig, light, &camera);
        for (int i = 0; i < 240 * 160; i++) {
            double d[3], p[3], l[3];
            bool solid = false;
            rig_ray(&camera, i % 240 + 0.5, i / 240 + 0.5, d);
            map[i] = NOTHING;
            along(camera.eye, d, -camera.eye[1] / d[1], p);
            if (d[1] > -0.1 || fabs(p[0]) > 3.9 || fabs(p[2]) > 3.9)
                continue;
            double far = towards(light, places[k], p, l);
            map[i] = crosses(p, l, far, &solid) && solid ? DARK : LIT;
        }
        compare(&camera, 4, names[k]);
    }
}

// --- the edge of a shadow ------------------------------------------------------------------------

// Seen from so near that a texel of the map is many pixels wide: light rises across the edge
// without a step, never falls, and is half where the edge is to within the penumbra.
struct edge {
    unsigned kind;
    double place[3], vfov_rad;
    const char *name;
};

enum { EDGE_W = 320, EDGE_H = 24 };

// The roof ends at x = 0, one metre up; both lights put its edge at x = 0.6.
static void check_edge(struct rig *rig, const struct edge *e)
{
    static const float floor[4][3] = {{-4, 0, 4}, {4, 0, 4}, {4, 0, -4}, {-4, 0, -4}};
    static const float roof[4][3] = {{-3, 1, 3}, {0, 1, 3}, {0, 1, -3}, {-3, 1, -3}};
    const struct rig_camera camera = {.eye = {0.6, 0.5, 0.3},
        .target = {0.6, 0, 0.3},
        .vfov_rad = e->vfov_rad,
        .width = EDGE_W,
        .height = EDGE_H,
        .samples = 64};
    rig_scene(rig);
    rig_quad(rig, rig_material(rig), floor);
    rig_quad(rig, rig_material(rig), roof);
    struct hg_light *light = light_from(rig, e->kind, e->place);
    light->outer_cone_rad = 1.2f;
    light->inner_cone_rad = 1.1f;
    render_share(rig, light, &camera);
    double mean[EDGE_W], fall = 0, step = 0, half = 0, width = 0;
    for (int x = 0; x < EDGE_W; x++) {
        mean[x] = 0;
        for (int y = 0; y < EDGE_H; y++)
            mean[x] += (double)share[y * EDGE_W + x] / EDGE_H;
        width += mean[x] > 0.05 && mean[x] < 0.95;
        if (x == 0)
            continue;
        fall = fmax(fall, mean[x - 1] - mean[x]);
        step = fmax(step, mean[x] - mean[x - 1]);
        if (mean[x - 1] < 0.5 && mean[x] >= 0.5) // in px, pixel centres at + 0.5
            half = x - 0.5 + (0.5 - mean[x - 1]) / (mean[x] - mean[x - 1]);
    }
    half -= EDGE_W / 2.0;
    print_message("%s: %.4f to %.4f, penumbra %.0f px of %.4f mm, steepest %.4f, falls %.5f, half "
                  "way %.1f px from the edge\n",
        e->name, mean[0], mean[EDGE_W - 1], width, tan(e->vfov_rad / 2) / EDGE_H * 1e3, step, fall,
        half);
    assert_true(mean[0] < 0.005 && mean[EDGE_W - 1] > 0.995);
    assert_true(width > 30);
    assert_true(step < 2.5 * 0.9 / width);
    assert_true(fall < 0.004);
    assert_true(fabs(half) < 0.5 * width);
}

static void test_edge(void **state)
{
    static const struct edge edges[] = {
        {HG_LIGHT_DIRECTIONAL, {-0.6, 1, 0}, 0.0006, "directional, edge"},
        {HG_LIGHT_SPOT, {-1.2, 3, 0}, 0.03, "spot, edge"},
        {HG_LIGHT_POINT, {-1.2, 3, 0}, 0.03, "point, edge"},
    };
    for (size_t i = 0; i < sizeof edges / sizeof *edges; i++)
        check_edge(*state, &edges[i]);
}

// --- cascades ------------------------------------------------------------------------------------

// A beam runs away from the camera, and its shadow with it, through all cascades of the sun. The
// shadow's width in each row of the image is what the rays say, and does not jump.
static void test_cascades(void **state)
{
    static const float floor[4][3] = {{-30, 0, 2}, {30, 0, 2}, {30, 0, -400}, {-30, 0, -400}};
    static const float low[4][3] = {{-1, 2, -400}, {1, 2, -400}, {1, 2, 2}, {-1, 2, 2}};
    static const float high[4][3] = {{-1, 3, 2}, {1, 3, 2}, {1, 3, -400}, {-1, 3, -400}};
    static const double place[3] = {-0.5, 1, 0};
    enum { W = 640, H = 240 };
    const struct rig_camera camera = {.eye = {4, 5, 0},
        .target = {2, 2, -12},
        .vfov_rad = 0.8,
        .width = W,
        .height = H,
        .samples = 32};
    struct rig *rig = *state;
    rig_scene(rig);
    rig_quad(rig, rig_material(rig), floor);
    struct hg_material *material = rig_material(rig);
    material->double_sided = true;
    rig_quad(rig, material, low);
    rig_quad(rig, material, high);
    struct hg_light *light = light_from(rig, HG_LIGHT_DIRECTIONAL, place);
    render_share(rig, light, &camera);
    double worst = 0, jump = 0, before = 0;
    int rows = 0;
    for (int y = 0; y < H; y++) {
        double dark = 0, expected = 0, z = 0;
        bool whole = true;
        for (int x = 0; x < W; x++) {
            double d[3], p[3], q[3];
            rig_ray(&camera, x, y + 0.5, d);
            along(camera.eye, d, -camera.eye[1] / d[1], p);
            z = -p[2];
            whole &= d[1] < 0 && z > 0 && z < 350;
            rig_ray(&camera, x + 1, y + 0.5, d);
            along(camera.eye, d, -camera.eye[1] / d[1], q);
            // The two sheets hide the sun from x in 0..2 and 0.5..2.5.
            double inside = fmin(fmax(q[0], 0), 2.5) - fmin(fmax(p[0], 0), 2.5);
            expected += inside / (q[0] - p[0]);
            if (q[0] > -0.9 && p[0] < 4)
                dark += fmax(1 - (double)share[y * W + x], 0);
        }
        if (!whole)
            continue;
        double error = dark - expected;
        worst = fmax(worst, fabs(error));
        if (rows++)
            jump = fmax(jump, fabs(error - before));
        before = error;
    }
    print_message("cascades: %d rows, width off by %.2f px at most, by %.2f px from row to row\n",
        rows, worst, jump);
    assert_true(rows > 150);
    assert_true(worst < 0.6);
    assert_true(jump < 0.35);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_balls),
        cmocka_unit_test(test_holes),
        cmocka_unit_test(test_edge),
        cmocka_unit_test(test_cascades),
    };
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
