// path.c - path-traced pictures against closed forms: white furnace, a sphere light over a plane,
// slabs that absorb and reflect; estimators against each other.
#include <math.h>
#include <string.h>

#include "renderer/internal.h"
#include "shaders/shared/path.h"
#include "tests/analytic/path_rig.h"

enum { SIDE = 48 };

static const struct hg_view_params defaults = {.width = SIDE,
    .height = SIDE,
    .tonemap = HG_TONEMAP_LINEAR,
    .mode = HG_MODE_PATH,
    .filter = HG_FILTER_BOX,
    .samples = 64,
    .seed = 7};

// Mean of a channel over the middle of the picture, `share` of its width.
static double middle(struct hg_view *view, double share, int channel)
{
    struct hg_refbuf *color = path_rig_plane(view, HG_PLANE_COLOR);
    const float *at = (const float *)(const void *)color->data;
    const int from = (int)(SIDE * 0.5 * (1.0 - share)), to = SIDE - from;
    double sum = 0;
    for (int y = from; y < to; y++)
        for (int x = from; x < to; x++)
            sum += (double)at[(y * SIDE + x) * 4 + channel];
    hg_refbuf_unref(color);
    return sum / ((to - from) * (to - from));
}

static double render(struct rig *rig, const struct hg_view_params *params, const float eye[3],
    const float target[3], float vfov_rad, double share)
{
    struct hg_view *view = path_rig_view(rig, params);
    path_rig_look(view, eye, target, vfov_rad);
    path_rig_settle(view);
    const double mean = middle(view, share, 0);
    hg_view_destroy(view);
    return mean;
}

static void test_furnace(void **state)
{
    struct rig *rig = *state;
    static const float center[3] = {0, 0, 0}, eye[3] = {0, 0, 3};
    for (int metallic = 0; metallic < 2; metallic++) {
        for (int i = 0; i < 4; i++) {
            const float roughness[4] = {0.0f, 0.25f, 0.6f, 1.0f};
            rig_scene(rig);
            path_rig_environment(rig, 1.0f);
            struct hg_material *m = rig_material(rig);
            m->metallic = (float)metallic;
            m->roughness = roughness[i];
            rig_sphere(rig, m, center, 1.0f, 96);
            const double mean = render(rig, &defaults, eye, center, 0.6f, 0.6);
            print_message(
                "furnace: metallic %d roughness %g: %.4f\n", metallic, (double)roughness[i], mean);
            assert_true(fabs(mean - 1.0) < 0.003);
        }
    }
}

// E = pi L (r / h)^2 below the middle of a sphere: a Lambert plane sends back L (r / h)^2.
static void test_sphere_light(void **state)
{
    struct rig *rig = *state;
    static const float at[3] = {0, 2, 0}, eye[3] = {0, 0.6f, 1.2f}, origin[3] = {0, 0, 0};
    rig_scene(rig);
    path_rig_floor(rig, path_rig_lambert(rig, 1.0f), 5);
    struct hg_material *light = path_rig_lambert(rig, 0.0f);
    light->emissive[0] = light->emissive[1] = light->emissive[2] = 10.0f;
    rig_sphere(rig, light, at, 0.5f, 64);
    struct hg_view_params params = defaults;
    params.samples = 256;
    const double mean = render(rig, &params, eye, origin, 0.02f, 1.0);
    const double expected = 10.0 * 0.25 * 0.25;
    print_message("sphere light: %.5f, %.5f expected\n", mean, expected);
    assert_true(fabs(mean / expected - 1.0) < 0.005);
}

// Two directional lights have a ray of their own beside that to a lamp or the environment: what
// each of the four brings to a Lambert plane adds up.
static void test_sun_apart(void **state)
{
    struct rig *rig = *state;
    static const float eye[3] = {0, 0.6f, 1.2f}, origin[3] = {0, 0, 0};
    static const double high[3] = {0, 2, 0}, down[3] = {0, -1, 0};
    static const double aslant[3] = {0.8660254037844386, -0.5, 0};
    rig_scene(rig);
    path_rig_floor(rig, path_rig_lambert(rig, 0.5f), 5);
    path_rig_environment(rig, 0.7f);
    rig_light(rig, HG_LIGHT_DIRECTIONAL, high, down)->intensity = 2.0f;
    rig_light(rig, HG_LIGHT_DIRECTIONAL, high, aslant)->intensity = 1.0f;
    rig_light(rig, HG_LIGHT_POINT, high, down)->intensity = 3.0f;
    struct hg_view_params params = defaults;
    params.samples = 256;
    const double mean = render(rig, &params, eye, origin, 0.02f, 1.0);
    const double expected = 0.5 * ((2.0 + 0.5 + 3.0 / 4.0) / M_PI + 0.7);
    print_message("suns, lamp and sky: %.5f, %.5f expected\n", mean, expected);
    assert_true(fabs(mean / expected - 1.0) < 0.002);
}

// A surface with one side from behind, where nothing is black: it reflects as from the front, and
// what it emits is not seen there.
static void test_back_face(void **state)
{
    struct rig *rig = *state;
    static const float above[3] = {0, 2, 0}, below[3] = {0, -2, 0}, origin[3] = {0, 0, 0};
    double mean[2];
    for (int i = 0; i < 2; i++) {
        rig_scene(rig);
        path_rig_environment(rig, 1.0f);
        struct hg_material *m = path_rig_lambert(rig, 0.5f);
        m->emissive[0] = m->emissive[1] = m->emissive[2] = 2.0f;
        path_rig_floor(rig, m, 5);
        mean[i] = render(rig, &defaults, i == 0 ? above : below, origin, 0.2f, 1.0);
    }
    print_message("back face: %.5f in front, %.5f behind\n", mean[0], mean[1]);
    assert_true(fabs(mean[0] - 2.5) < 0.02);
    assert_true(fabs(mean[1] - 0.5) < 0.005);
}

// A floor whose normals lean 50 degrees to +x, seen from -x: the mirrored view leads below it. What
// it scatters goes by these normals all the same; a mirror loses nothing.
static void test_leaning_normals(void **state)
{
    struct rig *rig = *state;
    static const float eye[3] = {-1, 1.7320508f, 0}, origin[3] = {0, 0, 0};
    static const float corners[4][3] = {{-5, 0, 5}, {5, 0, 5}, {5, 0, -5}, {-5, 0, -5}};
    static const double high[3] = {0, 2, 0}, light[3] = {-0.9, -0.4358898943540674, 0};
    const float lean[3] = {0.76604444f, 0.64278761f, 0};
    double mean[2];
    for (int mirror = 0; mirror < 2; mirror++) {
        rig_scene(rig);
        struct hg_material *m = mirror != 0 ? rig_material(rig) : path_rig_lambert(rig, 0.5f);
        if (mirror != 0) {
            m->metallic = 1.0f;
            m->roughness = 0.0f;
            path_rig_environment(rig, 1.0f);
        } else {
            rig_light(rig, HG_LIGHT_DIRECTIONAL, high, light)->intensity = 2.0f;
        }
        struct hg_mesh_part *part = &rig_quad(rig, m, corners)->mesh->parts[0];
        for (uint32_t v = 0; v < part->vertex_count; v++)
            memcpy(part->normals + (size_t)v * 3, lean, sizeof lean);
        mean[mirror] = render(rig, &defaults, eye, origin, 0.02f, 1.0);
    }
    const double expected =
        0.5 * 2.0 * (0.9 * (double)lean[0] + 0.4358898943540674 * (double)lean[1]) / M_PI;
    print_message(
        "leaning normals: %.5f, %.5f expected; mirrored %.5f\n", mean[0], expected, mean[1]);
    assert_true(fabs(mean[0] / expected - 1.0) < 0.005);
    assert_true(fabs(mean[1] - 1.0) < 0.01);
}

// Far from the origin: positions in scene space, the node's number, emission below a coat.
static void test_planes(void **state)
{
    struct rig *rig = *state;
    const float far = 100000.0f;
    const float corners[4][3] = {
        {far - 5, 0, 5}, {far + 5, 0, 5}, {far + 5, 0, -5}, {far - 5, 0, -5}};
    const float eye[3] = {far, 2, 0}, target[3] = {far, 0, 0};
    rig_scene(rig);
    struct hg_material *m = path_rig_lambert(rig, 0.0f);
    m->emissive[0] = m->emissive[1] = m->emissive[2] = 2.0f;
    m->clearcoat.factor = 1.0f;
    struct hg_node *node = rig_quad(rig, m, corners);
    struct hg_view_params params = defaults;
    params.planes = 1u << HG_PLANE_POSITION | 1u << HG_PLANE_OBJECT | 1u << HG_PLANE_EMISSION;
    struct hg_view *view = path_rig_view(rig, &params);
    path_rig_look(view, eye, target, 0.02f);
    path_rig_settle(view);
    struct hg_refbuf *position = path_rig_plane(view, HG_PLANE_POSITION);
    struct hg_refbuf *object = path_rig_plane(view, HG_PLANE_OBJECT);
    struct hg_refbuf *emission = path_rig_plane(view, HG_PLANE_EMISSION);
    const float *at = (const float *)(const void *)position->data;
    const float *number = (const float *)(const void *)object->data;
    const float *seen = (const float *)(const void *)emission->data;
    for (int i = 0; i < SIDE * SIDE; i++) {
        assert_true(fabsf(at[i * 3] - far) < 0.1f && fabsf(at[i * 3 + 2]) < 0.1f);
        assert_true(number[i] == (float)((uint32_t)node->head.id + 1));
        assert_true(fabsf(seen[i * 3] - 2.0f * 0.96f) < 0.01f);
    }
    hg_refbuf_unref(position);
    hg_refbuf_unref(object);
    hg_refbuf_unref(emission);
    hg_view_destroy(view);
}

// Rays to lights alone, light that is run into alone, and both weighted: the same mean. One
// deviation of the noise is 0.1 %.
static void test_estimators(void **state)
{
    struct rig *rig = *state;
    static const float eye[3] = {0.5f, 1.2f, 3.5f}, target[3] = {0, 0.5f, 0};
    double mean[3];
    for (uint32_t use = 1; use <= 3; use++) {
        path_rig_room(rig);
        rig->renderer->context.overrides.path_estimators = use;
        struct hg_view_params params = defaults;
        params.samples = use == HG_PATH_USE_SURFACES ? 512 : 128;
        params.max_bounces = 4;
        mean[use - 1] = render(rig, &params, eye, target, 0.8f, 1.0);
    }
    rig->renderer->context.overrides.path_estimators = 0;
    print_message("estimators: %.5f %.5f %.5f\n", mean[0], mean[1], mean[2]);
    assert_true(fabs(mean[0] / mean[2] - 1.0) < 0.004);
    assert_true(fabs(mean[1] / mean[2] - 1.0) < 0.004);
}

static void back_light(struct rig *rig)
{
    const float corners[4][3] = {{-9, -9, -3}, {9, -9, -3}, {9, 9, -3}, {-9, 9, -3}};
    struct hg_material *light = path_rig_lambert(rig, 0.0f);
    light->emissive[0] = light->emissive[1] = light->emissive[2] = 1.0f;
    rig_quad(rig, light, corners);
}

// Light straight through a slab: (1 - R) / (1 + R) with R = ((n - 1) / (n + 1))^2, all orders of
// reflection between its sides; exp(-sigma d) where it absorbs and does not reflect.
static void test_slabs(void **state)
{
    struct rig *rig = *state;
    static const float eye[3] = {0, 0, 4}, origin[3] = {0, 0, 0};
    static const float low[3] = {-2, -2, -0.25f}, high[3] = {2, 2, 0.25f};
    struct hg_view_params params = defaults;
    params.samples = 1024;
    rig_scene(rig);
    back_light(rig);
    struct hg_material *glass = rig_material(rig);
    glass->roughness = 0.0f;
    glass->transmission = glass->volume.thickness = 1.0f;
    path_rig_box(rig, glass, low, high);
    const double through = render(rig, &params, eye, origin, 0.02f, 1.0);
    const double expected = (1 - 0.04) / (1 + 0.04);
    print_message("Fresnel slab: %.5f, %.5f expected\n", through, expected);

    rig_scene(rig);
    back_light(rig);
    struct hg_material *dark = rig_material(rig);
    dark->roughness = 0.0f;
    dark->transmission = dark->volume.thickness = 1.0f;
    dark->ior = 1.0f;
    dark->has_ior = true;
    dark->volume.attenuation_distance = 0.5f;
    dark->volume.attenuation_color[0] = dark->volume.attenuation_color[1] =
        dark->volume.attenuation_color[2] = 0.3f;
    path_rig_box(rig, dark, low, high);
    params.samples = 64;
    const double left = render(rig, &params, eye, origin, 0.02f, 1.0);
    print_message("absorbing slab: %.5f, 0.3 expected\n", left);
    assert_true(fabs(through / expected - 1.0) < 0.005);
    assert_true(fabs(left / 0.3 - 1.0) < 0.005);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_furnace),
        cmocka_unit_test(test_back_face), cmocka_unit_test(test_leaning_normals),
        cmocka_unit_test(test_planes), cmocka_unit_test(test_sphere_light),
        cmocka_unit_test(test_sun_apart), cmocka_unit_test(test_estimators),
        cmocka_unit_test(test_slabs)};
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
