// sky.c - the sun of the built-in sky in real time and in path mode: its direct light against a
// closed form, its shadow against cast rays, and rotation and intensity of environments.
#include <math.h>
#include <stdio.h>

#include "base/alloc.h"
#include "base/refbuf.h"
#include "renderer/light/env/sky.h"
#include "shaders/shared/light.h"
#include "tests/analytic/rig.h"
#include "tests/support/folder.h"

// A box of 2 x 2 x 2 m that stands on a square of 24 x 24 m.
#define WIDTH  64
#define HEIGHT 36
#define ALBEDO 0.5f
#define EDGE   0.5 // m about edges of shadow and box that are not compared

static const struct rig_camera realtime = {.eye = {5, 7, 9},
    .target = {0, 0.5, 0},
    .vfov_rad = 0.8,
    .width = WIDTH,
    .height = HEIGHT,
    .samples = 4};

static struct rig_camera in_path_mode(struct rig_camera camera, uint32_t samples)
{
    camera.mode = HG_MODE_PATH;
    camera.samples = samples;
    camera.max_bounces = 1;
    return camera;
}

static void box(struct rig *rig, struct hg_material *material)
{
    for (int axis = 0; axis < 3; axis++)
        for (int side = -1; side <= 1; side += 2) {
            float c[4][3];
            for (int k = 0; k < 4; k++) {
                const float a = k == 1 || k == 2 ? 1.0f : -1.0f, b = k >= 2 ? 1.0f : -1.0f;
                c[k][axis] = (float)side;
                c[k][(axis + 1) % 3] = side > 0 ? a : b;
                c[k][(axis + 2) % 3] = side > 0 ? b : a;
                c[k][1] += 1;
            }
            (void)rig_quad(rig, material, c);
        }
}

static void open_scene(struct rig *rig)
{
    static const float ground[4][3] = {{-12, 0, 12}, {12, 0, 12}, {12, 0, -12}, {-12, 0, -12}};
    rig_scene(rig);
    struct hg_material *grey = rig_material(rig);
    for (int c = 0; c < 3; c++)
        grey->base_color[c] = ALBEDO;
    grey->ior = 1; // no reflection
    (void)rig_quad(rig, grey, ground);
    box(rig, grey);
}

static void set_sky(struct rig *rig, double azimuth, double elevation, enum hg_sky_sun sun)
{
    struct hg_environment *env = &rig->scene->environment;
    const double a = azimuth * M_PI / 180, e = elevation * M_PI / 180;
    env->kind = HG_ENV_SKY;
    env->revision++;
    env->sun = sun;
    env->sun_direction[0] = (float)(cos(e) * sin(a));
    env->sun_direction[1] = (float)sin(e);
    env->sun_direction[2] = (float)(cos(e) * cos(a));
}

static double green(const struct hg_refbuf *pixels, uint32_t i)
{
    return (double)((const float *)pixels->data)[i * 4 + 1];
}

// --- what casts shadows where --------------------------------------------------------------------

static bool meets_box(const double from[3], const float to[3], double margin)
{
    double near = 0, far = 1e9;
    for (int a = 0; a < 3; a++) {
        const double d = fabs((double)to[a]) < 1e-9 ? 1e-9 : (double)to[a];
        double t0 = ((a == 1 ? 0 : -1) - margin - from[a]) / d;
        double t1 = ((a == 1 ? 2 : 1) + margin - from[a]) / d;
        near = fmax(near, fmin(t0, t1));
        far = fmin(far, fmax(t0, t1));
    }
    return near < far;
}

enum place { NOT_COMPARED, LIT, SHADOWED };

// Of a pixel by casting rays: ground in the sun, ground in the shadow.
static enum place place_of(const struct rig_camera *camera, uint32_t i, const float sun[3])
{
    double d[3], at[3];
    float dir[3];
    rig_ray(camera, i % WIDTH + 0.5, i / WIDTH + 0.5, d);
    for (int a = 0; a < 3; a++)
        dir[a] = (float)d[a];
    if (d[1] >= 0 || meets_box(camera->eye, dir, EDGE / 2))
        return NOT_COMPARED;
    for (int a = 0; a < 3; a++)
        at[a] = camera->eye[a] - d[a] * camera->eye[1] / d[1];
    if (fmax(fabs(at[0]), fabs(at[2])) > 12 - EDGE)
        return NOT_COMPARED;
    if (!meets_box(at, sun, EDGE / 2))
        return LIT;
    return meets_box(at, sun, -EDGE / 2) ? SHADOWED : NOT_COMPARED;
}

struct means {
    double lit, shadowed, sky; // of the sun alone, and of the sky alone where it is lit
};

static struct means measure(
    struct rig *rig, struct rig_camera camera, double azimuth, double elevation)
{
    struct means m = {0};
    uint32_t lit = 0, shadowed = 0;
    set_sky(rig, azimuth, elevation, HG_SKY_SUN_ON);
    struct hg_refbuf *with = rig_render(rig, &camera);
    set_sky(rig, azimuth, elevation, HG_SKY_SUN_OFF);
    struct hg_refbuf *without = rig_render(rig, &camera);
    for (uint32_t i = 0; i < WIDTH * HEIGHT; i++) {
        const double sun = green(with, i) - green(without, i);
        const enum place place = place_of(&camera, i, rig->scene->environment.sun_direction);
        lit += place == LIT;
        shadowed += place == SHADOWED;
        m.lit += place == LIT ? sun : 0;
        m.sky += place == LIT ? green(without, i) : 0;
        m.shadowed += place == SHADOWED ? sun : 0;
    }
    print_message("%u pixels in the sun, %u in the shadow\n", lit, shadowed);
    assert_true(lit > 200 && shadowed > 20);
    m.lit /= lit;
    m.sky /= lit;
    m.shadowed /= shadowed;
    hg_refbuf_unref(with);
    hg_refbuf_unref(without);
    return m;
}

// In both modes the sun gives what its illuminance says, once, and its shadow is where rays say.
static void test_sun_and_shadow(void **state)
{
    const double azimuth = -120, elevation = 35;
    struct rig *rig = *state;
    float lux[3];
    open_scene(rig);
    const struct means fast = measure(rig, realtime, azimuth, elevation);
    const struct means path = measure(rig, in_path_mode(realtime, 32), azimuth, elevation);
    const struct hg_sky sky = hg_sky_of(&rig->scene->environment, false);
    hg_sky_sun_illuminance(&sky, lux);
    const double expected = (double)(lux[1] * ALBEDO) * sin(elevation * M_PI / 180) / M_PI;
    print_message("%.4f by the sun's illuminance; real time %.4f, in shadow %.4f, sky %.4f; path "
                  "%.4f, %.4f, %.4f\n",
        expected, fast.lit, fast.shadowed, fast.sky, path.lit, path.shadowed, path.sky);
    assert_true(fabs(fast.lit / expected - 1) < 0.02);
    assert_true(fabs(path.lit / expected - 1) < 0.02);
    assert_true(fabs(fast.sky / path.sky - 1) < 0.05); // the box hides some sky from paths
    assert_true(fabs(fast.shadowed) < 0.01 * expected);
    assert_true(fabs(path.shadowed) < 0.03 * expected);
}

// A directional light of the scene stands for the sun, unless the sun is asked for.
static void test_scene_has_sun(void **state)
{
    static const double high[3] = {0, 10, 0}, down[3] = {0, -1, 0};
    static const enum hg_render_mode modes[] = {HG_MODE_REALTIME, HG_MODE_PATH};
    struct rig *rig = *state;
    for (int m = 0; m < 2; m++) {
        struct rig_camera camera = modes[m] == HG_MODE_PATH ? in_path_mode(realtime, 8) : realtime;
        double mean[3] = {0};
        open_scene(rig);
        rig_light(rig, HG_LIGHT_DIRECTIONAL, high, down)->intensity = 0.5f;
        for (int sun = 0; sun < 3; sun++) {
            set_sky(rig, -60, 35, (enum hg_sky_sun)sun);
            struct hg_refbuf *pixels = rig_render(rig, &camera);
            for (uint32_t i = 0; i < WIDTH * HEIGHT; i++)
                mean[sun] += green(pixels, i) / (WIDTH * HEIGHT);
            hg_refbuf_unref(pixels);
        }
        print_message("with a lamp: auto %.4f, on %.4f, off %.4f\n", mean[HG_SKY_SUN_AUTO],
            mean[HG_SKY_SUN_ON], mean[HG_SKY_SUN_OFF]);
        assert_true(fabs(mean[HG_SKY_SUN_AUTO] / mean[HG_SKY_SUN_OFF] - 1) < 0.02);
        assert_true(mean[HG_SKY_SUN_ON] > 1.3 * mean[HG_SKY_SUN_OFF]);
    }
}

// --- rotation and intensity ----------------------------------------------------------------------

// Half of the horizon bright, in an image of 8 x 4 texels.
static void set_image(struct rig *rig)
{
    struct hg_environment *env = &rig->scene->environment;
    struct hg_image image = {0};
    test_ok(hg_image_create(8, 4, HG_PIXEL_RGBA32F, NULL, &image), NULL);
    for (uint32_t i = 0; i < 8 * 4; i++)
        for (int c = 0; c < 4; c++)
            ((float *)image.pixels)[i * 4 + (uint32_t)c] = c == 3 || i % 8 < 3 ? 1.0f : 0.02f;
    env->kind = HG_ENV_IMAGE;
    env->image = image;
    env->revision++;
}

static double difference(const struct hg_refbuf *a, const struct hg_refbuf *b, double factor)
{
    double sum = 0, all = 0;
    for (uint32_t i = 0; i < WIDTH * HEIGHT; i++) {
        sum += fabs(green(a, i) - factor * green(b, i));
        all += fabs(green(a, i));
    }
    assert_true(all > 0);
    return sum / all;
}

static struct hg_refbuf *render(
    struct rig *rig, const struct rig_camera *camera, double degrees, float intensity)
{
    rig->scene->environment.rotation_rad = (float)(degrees * M_PI / 180);
    rig->scene->environment.intensity = intensity;
    rig->scene->environment.revision++;
    return rig_render(rig, camera);
}

// The scene is the same after a quarter turn about +Y, which takes +Z to +X. So the environment
// turned by 90 degrees must look from a camera that went along as it did before, and different from
// where the camera was; three times the intensity is three times the picture.
static void check_environment(
    struct rig *rig, const char *name, struct rig_camera camera, double noise, bool turns)
{
    struct rig_camera moved = camera;
    moved.eye[0] = camera.eye[2];
    moved.eye[2] = -camera.eye[0];
    struct hg_refbuf *plain = render(rig, &camera, 0, 1);
    struct hg_refbuf *along = render(rig, &moved, 90, 1);
    struct hg_refbuf *turned = render(rig, &camera, 90, 1);
    struct hg_refbuf *bright = render(rig, &camera, 0, 3);
    const double same = difference(plain, along, 1), other = difference(plain, turned, 1);
    const double scaled = difference(bright, plain, 3);
    print_message("%s: turned along %.4f, turned alone %.4f, three times as bright %.4f\n", name,
        same, other, scaled);
    assert_true(same < noise && scaled < 1e-3);
    assert_true(turns ? other > 1.5 * same && other > 0.03 : other < noise);
    hg_refbuf_unref(plain);
    hg_refbuf_unref(along);
    hg_refbuf_unref(turned);
    hg_refbuf_unref(bright);
}

static void test_rotation_and_intensity(void **state)
{
    struct rig *rig = *state;
    for (int mode = 0; mode < 2; mode++) {
        const struct rig_camera camera = mode ? in_path_mode(realtime, 32) : realtime;
        const double noise = mode ? 0.12 : 0.01;
        open_scene(rig);
        set_sky(rig, -60, 35, HG_SKY_SUN_AUTO);
        check_environment(rig, mode ? "sky, path" : "sky", camera, noise, true);
        open_scene(rig);
        set_image(rig);
        check_environment(rig, mode ? "image, path" : "image", camera, noise, true);
        open_scene(rig);
        rig->scene->environment.kind = HG_ENV_COLOR;
        for (int c = 0; c < 3; c++)
            rig->scene->environment.color[c] = 0.5f;
        check_environment(rig, mode ? "color, path" : "color", camera, noise, false);
    }
}

// Skies are prefiltered once, and kept in a folder.
static char folder[TEST_FOLDER_MAX];

static int set_up(void **state)
{
    static struct rig rig;
    struct hg_error err = {0};
    if (!test_folder_make(folder, "sky"))
        return -1;
    const struct hg_renderer_params params = {.cache_dir = folder};
    test_ok(hg_renderer_create(&params, &rig.renderer, &err), &err);
    *state = &rig;
    return 0;
}

static int tear_down(void **state)
{
    rig_finish(*state);
    return !test_folder_remove(folder);
}

// --- penumbra ------------------------------------------------------------------------------------

// Where light from the sun's disc passes `share` of its full amount, px along the picture's middle
// row.
static double crossing(const double *light, double full, double share)
{
    for (uint32_t x = 0; x + 1 < WIDTH; x++) {
        const double a = light[x] / full - share, b = light[x + 1] / full - share;
        if ((a <= 0) != (b <= 0))
            return x + 0.5 + a / (a - b);
    }
    return -1;
}

// A roof 12 m above the ground whose edge runs along z, seen from between. The shadow's edge is
// where the disc's middle is behind the roof's; half of the disc more is the penumbra. A disc is
// seen by a tenth and by nine tenths 0.687 of its radius either side of that.
static void test_penumbra(void **state)
{
    static const float ground[4][3] = {{-20, 0, 20}, {20, 0, 20}, {20, 0, -20}, {-20, 0, -20}};
    static const float roof[4][3] = {{-20, 12, -20}, {0, 12, -20}, {0, 12, 20}, {-20, 12, 20}};
    struct rig *rig = *state;
    const double tall = 12, elevation = 75, e = elevation * M_PI / 180, edge = -tall / tan(e);
    const double radius = tall * HG_SUN_RADIUS / pow(sin(e), 2);
    struct rig_camera camera = {.eye = {edge, 6, 0},
        .target = {edge, 0, 0.001},
        .vfov_rad = 0.1,
        .width = WIDTH,
        .height = HEIGHT,
        .samples = 32};
    const double per_px = 2 * 6 * tan(camera.vfov_rad / 2) / HEIGHT;
    rig_scene(rig);
    struct hg_material *grey = rig_material(rig), *black = rig_material(rig);
    grey->ior = black->ior = 1;
    for (int c = 0; c < 3; c++)
        black->base_color[c] = 0; // no light from it to the ground
    (void)rig_quad(rig, grey, ground);
    (void)rig_quad(rig, black, roof);
    for (int soft = 0; soft < 2; soft++) {
        double light[WIDTH], full = 0;
        camera.gi = soft ? HG_GI_RAYS : HG_GI_NONE;
        set_sky(rig, 90, elevation, HG_SKY_SUN_ON);
        struct hg_refbuf *with = rig_render(rig, &camera);
        set_sky(rig, 90, elevation, HG_SKY_SUN_OFF);
        struct hg_refbuf *without = rig_render(rig, &camera);
        for (uint32_t x = 0; x < WIDTH; x++) {
            const uint32_t i = HEIGHT / 2 * WIDTH + x;
            light[x] = green(with, i) - green(without, i);
            full = fmax(full, light[x]);
        }
        const double middle = (crossing(light, full, 0.5) - WIDTH / 2.0) * per_px;
        const double width = fabs(crossing(light, full, 0.9) - crossing(light, full, 0.1)) * per_px;
        print_message("%s: edge %.4f m off, 10 to 90 %% within %.4f m of %.4f\n",
            soft ? "rays" : "none", middle, width, 2 * 0.687 * radius);
        assert_true(fabs(middle) <= 0.02);
        if (soft)
            assert_true(fabs(width / (2 * 0.687 * radius) - 1) <= 0.1);
        else
            assert_true(width <= 0.6 * 2 * 0.687 * radius);
        hg_refbuf_unref(with);
        hg_refbuf_unref(without);
    }
}

// --- rays at rest --------------------------------------------------------------------------------

// Mean difference of squares of 4 x 4 px of two pictures over the mean of the first one. *most: its
// brightest pixel, over the same.
static double apart(const struct hg_refbuf *a, const struct hg_refbuf *b, double *most)
{
    enum { SIDE = 4 };
    double off[WIDTH * HEIGHT / (SIDE * SIDE)] = {0}, sum = 0, all = 0;
    *most = 0;
    for (uint32_t i = 0; i < WIDTH * HEIGHT; i++) {
        off[i / WIDTH / SIDE * (WIDTH / SIDE) + i % WIDTH / SIDE] += green(a, i) - green(b, i);
        all += green(a, i);
        *most = fmax(*most, green(a, i));
    }
    for (size_t k = 0; k < sizeof off / sizeof *off; k++)
        sum += fabs(off[k]);
    *most /= all / (WIDTH * HEIGHT);
    return sum / all;
}

// Thin ledges on a wall and blocks at its foot, in the sun from the side, on a plain that is wide
// beside them: edges, contact and penumbrae are those of paths. From behind the wall lies in its
// own shadow, and has what the ground before it reflects. Paths that run into the sky beside its
// sun bring no bright spots.
static void test_ledges(void **state)
{
    static const float wall[4][3] = {{-3, 0, 0}, {3, 0, 0}, {3, 3, 0}, {-3, 3, 0}};
    static const float ground[4][3] = {{-40, 0, 40}, {40, 0, 40}, {40, 0, -40}, {-40, 0, -40}};
    static const float blocks[][2][3] = {{{-1.2f, 1.0f, 0}, {1.2f, 1.02f, 0.25f}},
        {{-0.8f, 0.5f, 0}, {0.8f, 0.53f, 0.08f}}, {{-0.3f, 0, 0.2f}, {-0.1f, 0.1f, 0.4f}},
        {{0.3f, 0, 0.05f}, {0.36f, 0.25f, 0.1f}}};
    struct rig_camera camera = {.eye = {0.4, 0.8, 2.2},
        .target = {0, 0.5, 0},
        .vfov_rad = 0.7,
        .width = WIDTH,
        .height = HEIGHT,
        .gi = HG_GI_RAYS};
    struct rig *rig = *state;
    rig_scene(rig);
    struct hg_material *grey = rig_material(rig);
    grey->ior = 1;
    for (int c = 0; c < 3; c++)
        grey->base_color[c] = 0.3f;
    (void)rig_quad(rig, grey, ground);
    (void)rig_quad(rig, grey, wall);
    for (size_t i = 0; i < sizeof blocks / sizeof *blocks; i++)
        for (int face = 0; face < 6; face++)
            rig_face(rig, grey, blocks[i], -1, face);
    for (int behind = 0; behind < 2; behind++) {
        set_sky(rig, behind ? 215 : 35, 50, HG_SKY_SUN_ON);
        camera.mode = HG_MODE_REALTIME;
        camera.samples = 32;
        struct hg_refbuf *fast = rig_render(rig, &camera);
        camera.mode = HG_MODE_PATH;
        camera.samples = 192;
        camera.max_bounces = 8;
        struct hg_refbuf *path = rig_render(rig, &camera);
        double most;
        const double off = apart(path, fast, &most);
        print_message("%s: %.2f %% off paths, whose brightest pixel is %.2f times the mean\n",
            behind ? "in the wall's shadow" : "in the sun", off * 100, most);
        assert_true(off <= (behind ? 0.03 : 0.01));
        if (!behind)
            assert_true(most <= 1.6);
        hg_refbuf_unref(fast);
        hg_refbuf_unref(path);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sun_and_shadow),
        cmocka_unit_test(test_scene_has_sun),
        cmocka_unit_test(test_rotation_and_intensity),
        cmocka_unit_test(test_penumbra),
        cmocka_unit_test(test_ledges),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
