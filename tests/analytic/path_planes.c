// path_planes.c - planes of path-traced pictures for compositing: light by what the first surface
// did with it, by groups of lights, and shadow catchers, against closed forms and against each
// other.
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/internal.h"
#include "tests/analytic/path_rig.h"

enum { SIDE = 48 };

static const struct hg_view_params defaults = {.width = SIDE,
    .height = SIDE,
    .tonemap = HG_TONEMAP_LINEAR,
    .mode = HG_MODE_PATH,
    .filter = HG_FILTER_BOX,
    .samples = 64,
    .seed = 7};

#define BIT(plane) (1u << HG_PLANE_##plane)

static const uint32_t lobes[6] = {HG_PLANE_DIRECT_DIFFUSE, HG_PLANE_DIRECT_SPECULAR,
    HG_PLANE_DIRECT_TRANSMISSION, HG_PLANE_INDIRECT_DIFFUSE, HG_PLANE_INDIRECT_SPECULAR,
    HG_PLANE_INDIRECT_TRANSMISSION};

static const float *floats(const struct hg_refbuf *b)
{
    return (const float *)(const void *)b->data;
}

static double mean_of(struct hg_view *view, enum hg_plane plane)
{
    struct hg_refbuf *b = path_rig_plane(view, plane);
    const uint32_t channels = hg_plane_channels(plane);
    double sum = 0;
    for (size_t i = 0; i < b->size / 4; i += channels)
        sum += (double)floats(b)[i];
    hg_refbuf_unref(b);
    return sum / ((double)SIDE * SIDE);
}

// A sphere over a plane, a wall behind; lights of all kinds. sized: a sun with a disc and a
// rectangle, which rays meet as well, beside a sun and a point without size in the same groups.
static void room(struct rig *rig, struct hg_material *ball, bool sized)
{
    const float wall[4][3] = {{-2, 0, -1}, {2, 0, -1}, {2, 2, -1}, {-2, 2, -1}};
    const float lamp[4][3] = {
        {-0.4f, 1.5f, -0.4f}, {0.4f, 1.5f, -0.4f}, {0.4f, 1.5f, 0.4f}, {-0.4f, 1.5f, 0.4f}};
    const float center[3] = {0.2f, 0.4f, 0};
    const double down[3] = {0.2, -1, -0.3}, at[3] = {1, 1.5, 1};
    path_rig_environment(rig, 0.2f);
    path_rig_floor(rig, path_rig_lambert(rig, 0.6f), 3);
    rig_quad(rig, rig_material(rig), wall);
    rig_sphere(rig, ball, center, 0.4f, 48);
    struct hg_material *light = path_rig_lambert(rig, 0.0f);
    light->emissive[0] = light->emissive[1] = light->emissive[2] = 4.0f;
    light->double_sided = true;
    rig_quad(rig, light, lamp)->head.name = hg_strdup("Lamp.001");
    struct hg_light *sun = rig_light(rig, HG_LIGHT_DIRECTIONAL, at, down);
    struct hg_light *point = rig_light(rig, HG_LIGHT_POINT, at, down);
    sun->head.name = hg_strdup("Sun");
    point->head.name = hg_strdup("Lamp");
    if (!sized)
        return;
    sun->angular_diameter_rad = 0.2f;
    point->kind = HG_LIGHT_RECTANGLE;
    point->width = point->height = 0.5f;
    rig_light(rig, HG_LIGHT_DIRECTIONAL, at, down)->head.name = hg_strdup("Sun.001");
    rig_light(rig, HG_LIGHT_POINT, at, down)->head.name = hg_strdup("Lamp.002");
}

static struct hg_view *picture(struct rig *rig, const struct hg_view_params *params)
{
    static const float eye[3] = {0.5f, 1.2f, 3.5f}, target[3] = {0, 0.5f, 0};
    struct hg_view *view = path_rig_view(rig, params);
    path_rig_look(view, eye, target, 0.8f);
    path_rig_settle(view);
    return view;
}

static struct hg_material *layered(struct rig *rig)
{
    struct hg_material *m = rig_material(rig);
    m->roughness = 0.4f;
    m->clearcoat.factor = 0.7f;
    m->clearcoat.roughness = 0.2f;
    m->sheen.color[0] = m->sheen.color[1] = m->sheen.color[2] = 0.4f;
    m->sheen.roughness = 0.5f;
    m->transmission = 0.3f;
    return m;
}

// Lobes, emission and groups each add up to the picture, pixel by pixel.
static void test_sums(void **state)
{
    struct rig *rig = *state;
    rig_scene(rig);
    room(rig, layered(rig), false);
    struct hg_view_params params = defaults;
    params.planes = BIT(EMISSION) | BIT(LIGHT_GROUPS);
    for (int i = 0; i < 6; i++)
        params.planes |= 1u << lobes[i];
    struct hg_view *view = picture(rig, &params);
    struct hg_refbuf *color = path_rig_plane(view, HG_PLANE_COLOR), *parts[7], *groups[8];
    struct hg_error err = {0};
    const uint32_t count = hg_view_light_groups(view);
    assert_int_equal(count, 3);
    assert_string_equal(hg_view_light_group_name(view, 0), "environment");
    assert_string_equal(hg_view_light_group_name(view, 1), "Sun");
    assert_string_equal(hg_view_light_group_name(view, 2), "Lamp");
    for (int i = 0; i < 7; i++)
        parts[i] = path_rig_plane(view, i < 6 ? (enum hg_plane)lobes[i] : HG_PLANE_EMISSION);
    for (uint32_t i = 0; i < count; i++)
        test_ok(hg_view_read_light_group(view, i, &groups[i], &err), &err);
    for (int i = 0; i < SIDE * SIDE * 3; i++) {
        const double want = (double)floats(color)[i / 3 * 4 + i % 3];
        double sum = 0, lights = 0;
        for (int k = 0; k < 7; k++)
            sum += (double)floats(parts[k])[i];
        for (uint32_t k = 0; k < count; k++)
            lights += (double)floats(groups[k])[i];
        assert_true(fabs(sum - want) < 2e-6 * fmax(want, 1));
        assert_true(fabs(lights - want) < 2e-6 * fmax(want, 1));
    }
    for (int i = 0; i < 7; i++)
        hg_refbuf_unref(parts[i]);
    for (uint32_t i = 0; i < count; i++)
        hg_refbuf_unref(groups[i]);
    hg_refbuf_unref(color);
    hg_view_destroy(view);
}

// Light that is as good as none; shaders are those of scenes with such lights.
static const float faint = 1e-6f;

// All lights but those of one group are as good as none.
static void leave_group(struct rig *rig, int group)
{
    if (group != 0)
        path_rig_environment(rig, 0.2f * faint);
    const struct hg_object_list *nodes = &rig->scene->objects[HG_OBJECT_NODE];
    for (uint32_t i = 0; i < nodes->count; i++) {
        struct hg_node *node = (struct hg_node *)nodes->items[i];
        const char *name = node->light != NULL ? node->light->head.name : node->head.name;
        const int of = name == NULL || name[0] == '\0' ? -1 : name[0] == 'S' ? 1 : 2;
        if (of < 0 || of == group)
            continue;
        if (node->light != NULL)
            node->light->intensity *= faint;
        else
            for (int c = 0; c < 3; c++)
                node->mesh->parts[0].material->emissive[c] *= faint;
    }
}

// Each group is the picture under its lights alone, whose kernels are the same: they have the plane
// of groups too.
static void test_groups(void **state)
{
    struct rig *rig = *state;
    double mean[3];
    struct hg_view_params params = defaults;
    params.samples = 128;
    params.max_bounces = 2;
    params.planes = BIT(LIGHT_GROUPS);
    rig_scene(rig);
    room(rig, rig_material(rig), true);
    struct hg_view *view = picture(rig, &params);
    for (uint32_t i = 0; i < 3; i++) {
        struct hg_error err = {0};
        struct hg_refbuf *b;
        test_ok(hg_view_read_light_group(view, i, &b, &err), &err);
        mean[i] = 0;
        for (int k = 0; k < SIDE * SIDE; k++)
            mean[i] += (double)floats(b)[k * 3] / (SIDE * SIDE);
        hg_refbuf_unref(b);
    }
    hg_view_destroy(view);
    for (int only = 0; only < 3; only++) {
        rig_scene(rig);
        room(rig, rig_material(rig), true);
        leave_group(rig, only);
        view = picture(rig, &params);
        const double alone = mean_of(view, HG_PLANE_COLOR);
        print_message("group %d: %.5f, alone %.5f\n", only, mean[only], alone);
        assert_true(fabs(mean[only] / alone - 1.0) < 0.01);
        hg_view_destroy(view);
    }
}

// Names that are alike once they are cut to 20 bytes, or once dots are gone, stay apart.
static void test_long_names(void **state)
{
    struct rig *rig = *state;
    static const char *const names[5] = {"A very long name of a key light",
        "A very long name of a rim light.001", "A very long name of a key light.007", "a.b",
        "a\nb"};
    static const char *const wanted[5] = {
        "environment", "A very long name of ", "A very long name o~2", "a_b", "a_b~2"};
    static const double at[3] = {0, 2, 0}, down[3] = {0, -1, 0};
    static const double strength[5] = {0, 1 + 4, 2, 8, 16}; // of groups
    double mean[5] = {0};
    rig_scene(rig);
    path_rig_floor(rig, path_rig_lambert(rig, 0.6f), 3);
    for (int i = 0; i < 5; i++) {
        struct hg_light *light = rig_light(rig, HG_LIGHT_POINT, at, down);
        light->head.name = hg_strdup(names[i]);
        light->intensity = (float)(1 << i);
    }
    struct hg_view_params params = defaults;
    params.planes = BIT(LIGHT_GROUPS);
    params.samples = 64;
    params.max_bounces = 1;
    struct hg_view *view = picture(rig, &params);
    assert_int_equal(hg_view_light_groups(view), 5);
    for (uint32_t i = 0; i < 5; i++) {
        struct hg_error err = {0};
        struct hg_refbuf *b;
        assert_string_equal(hg_view_light_group_name(view, i), wanted[i]);
        test_ok(hg_view_read_light_group(view, i, &b, &err), &err);
        for (int k = 0; k < SIDE * SIDE; k++)
            mean[i] += (double)floats(b)[k * 3];
        hg_refbuf_unref(b);
    }
    for (int i = 0; i < 5; i++) {
        const double share = mean[i] / (mean[1] + mean[2] + mean[3] + mean[4]);
        print_message("%s: %.4f of the light\n", wanted[i], share);
        assert_true(fabs(share - strength[i] / 31) < 0.01);
    }
    hg_view_destroy(view);
}

// What is specular does not depend on the colour of the base, and is all there is of a black one;
// all of Lambert is diffuse, all of a metal specular, all behind a thin pane let through.
static void test_lobes(void **state)
{
    struct rig *rig = *state;
    struct hg_view_params params = defaults;
    double specular[2], black = 0;
    params.max_bounces = 1;
    params.planes = BIT(DIRECT_DIFFUSE) | BIT(DIRECT_SPECULAR);
    for (int i = 0; i < 2; i++) {
        rig_scene(rig);
        const double at[3] = {0, 3, 0}, down[3] = {0, -1, -0.5};
        struct hg_material *m = rig_material(rig);
        m->roughness = 0.5f;
        m->base_color[0] = i == 0 ? 0.8f : 0.0f;
        path_rig_floor(rig, m, 5);
        rig_light(rig, HG_LIGHT_DIRECTIONAL, at, down);
        struct hg_view *view = picture(rig, &params);
        specular[i] = mean_of(view, HG_PLANE_DIRECT_SPECULAR);
        black = mean_of(view, HG_PLANE_COLOR);
        if (i == 1)
            assert_true(mean_of(view, HG_PLANE_DIRECT_DIFFUSE) == 0.0);
        hg_view_destroy(view);
    }
    print_message(
        "specular: %.6f of grey, %.6f of black, %.6f in all\n", specular[0], specular[1], black);
    assert_true(black > 0.001 && fabs(specular[0] / black - 1) < 1e-4);
    assert_true(fabs(specular[1] / black - 1) < 1e-4);
    for (int i = 0; i < 3; i++) {
        const float center[3] = {0, 0.5f, 0};
        rig_scene(rig);
        path_rig_environment(rig, 1.0f);
        struct hg_material *m = i == 0 ? path_rig_lambert(rig, 0.7f) : rig_material(rig);
        m->metallic = i == 1 ? 1.0f : 0.0f;
        m->roughness = i == 1 ? 0.3f : 1.0f;
        m->diffuse_transmission.factor = i == 2 ? 1.0f : 0.0f;
        m->specular.factor = i == 2 ? 0.0f : m->specular.factor;
        m->specular.is_set = m->specular.is_set || i == 2;
        rig_sphere(rig, m, center, 0.5f, 48);
        params.max_bounces = 4;
        params.samples = 16;
        params.planes = 0;
        for (int k = 0; k < 6; k++)
            params.planes |= 1u << lobes[k];
        struct hg_view *view = picture(rig, &params);
        for (int k = 0; k < 3; k++) {
            const double sum =
                mean_of(view, (enum hg_plane)lobes[k]) + mean_of(view, (enum hg_plane)lobes[3 + k]);
            print_message("material %d lobe %d: %.6f\n", i, k, sum);
            assert_true(k == i ? sum > 0.01 : sum < 1e-7);
        }
        hg_view_destroy(view);
    }
}

// --- shadow catchers -----------------------------------------------------------------------------

static void expect_pixel(struct hg_view *view, double r, double alpha, double tolerance)
{
    struct hg_refbuf *color = path_rig_plane(view, HG_PLANE_COLOR);
    struct hg_error err = {0};
    struct hg_refbuf *pixels;
    const int at = (SIDE / 2 * SIDE + SIDE / 2) * 4;
    test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA32F, &pixels, &err), &err);
    const double got = (double)floats(color)[at], got_alpha = (double)floats(color)[at + 3];
    print_message("catcher: %.4f %.4f, %.4f %.4f expected\n", got, got_alpha, r, alpha);
    assert_true(fabs(got - r) < tolerance && fabs(got_alpha - alpha) < tolerance);
    assert_true(fabs((double)floats(pixels)[at + 3] - alpha) < tolerance);
    hg_refbuf_unref(color);
    hg_refbuf_unref(pixels);
}

// Looking down at the middle of a plane of 10 m.
static struct hg_view *above(struct rig *rig, enum hg_background background, uint32_t samples)
{
    static const float eye[3] = {0, 3, 0}, target[3] = {0, 0, 0};
    struct hg_view_params params = defaults;
    params.samples = samples;
    params.background = background;
    params.background_color[0] = 0.5f;
    struct hg_view *view = path_rig_view(rig, &params);
    path_rig_look(view, eye, target, 0.01f);
    path_rig_settle(view);
    return view;
}

static void floor_that_catches(struct rig *rig)
{
    rig_scene(rig);
    path_rig_floor(rig, path_rig_lambert(rig, 0.3f), 5);
    const struct hg_object_list *nodes = &rig->scene->objects[HG_OBJECT_NODE];
    ((struct hg_node *)nodes->items[nodes->count - 1])->catches_shadows = true;
}

// One of two lights of the same strength is in the way of nothing: half of the light is missing.
static void test_catcher(void **state)
{
    struct rig *rig = *state;
    const double at[3] = {0, 5, 0}, left[3] = {1, -1, 0}, right[3] = {-1, -1, 0};
    const float board[4][3] = {{-3, 1, 1}, {-0.5f, 1, 1}, {-0.5f, 1, -1}, {-3, 1, -1}};
    for (int blocked = 0; blocked < 2; blocked++) {
        for (int i = 0; i < 2; i++) {
            floor_that_catches(rig);
            rig_light(rig, HG_LIGHT_DIRECTIONAL, at, left)->casts_shadow = true;
            rig_light(rig, HG_LIGHT_DIRECTIONAL, at, right)->casts_shadow = true;
            if (blocked)
                rig_quad(rig, path_rig_lambert(rig, 0.5f), board);
            struct hg_view *view =
                above(rig, i == 0 ? HG_BACKGROUND_NONE : HG_BACKGROUND_COLOR, 256);
            if (i == 0)
                expect_pixel(view, 0, blocked ? 0.5 : 0, blocked ? 0.05 : 1e-6);
            else
                expect_pixel(view, blocked ? 0.25 : 0.5, 1, blocked ? 0.03 : 1e-5);
            hg_view_destroy(view);
        }
    }
}

// A lamp over the point, of which a board hides one half exactly.
static void test_catcher_lamp(void **state)
{
    struct rig *rig = *state;
    const float lamp[4][3] = {{-1, 4, -1}, {1, 4, -1}, {1, 4, 1}, {-1, 4, 1}};
    const float board[4][3] = {{0, 3.5f, 9}, {9, 3.5f, 9}, {9, 3.5f, -9}, {0, 3.5f, -9}};
    floor_that_catches(rig);
    struct hg_material *light = path_rig_lambert(rig, 0.0f);
    light->emissive[0] = light->emissive[1] = light->emissive[2] = 4.0f;
    rig_quad(rig, light, lamp);
    rig_quad(rig, path_rig_lambert(rig, 0.5f), board);
    struct hg_view *view = above(rig, HG_BACKGROUND_NONE, 512);
    expect_pixel(view, 0, 0.5, 0.03);
    hg_view_destroy(view);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sums),
        cmocka_unit_test(test_groups),
        cmocka_unit_test(test_long_names),
        cmocka_unit_test(test_lobes),
        cmocka_unit_test(test_catcher),
        cmocka_unit_test(test_catcher_lamp),
    };
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
