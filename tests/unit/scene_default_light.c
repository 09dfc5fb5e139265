// The default light of a scene without an environment, against closed forms.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "renderer/light/env/sky.h"
#include "renderer/scene/default_light.h"

static const double pi = 3.14159265358979323846;
static struct hg_scene *scene;
static uint64_t next_id;

static int set_up(void **state)
{
    (void)state;
    next_id = 1;
    assert_int_equal(hg_scene_create(&scene), HG_OK);
    scene->environment.automatic = true;
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    hg_scene_destroy(scene);
    return 0;
}

static void *add(enum hg_object_kind kind)
{
    struct hg_object *object;
    assert_int_equal(hg_scene_add(scene, kind, next_id++, &object), HG_OK);
    return object;
}

// A mesh whose bounds are a cube of this half side.
static struct hg_node *add_cube(float x, float y, float z, float half)
{
    struct hg_mesh *mesh = add(HG_OBJECT_MESH);
    struct hg_node *node = add(HG_OBJECT_NODE);
    mesh->parts = hg_calloc(1, sizeof *mesh->parts);
    mesh->part_count = 1;
    mesh->parts->index_count = 3;
    for (int i = 0; i < 3; i++) {
        mesh->parts->bounds_min[i] = -half;
        mesh->parts->bounds_max[i] = half;
    }
    node->mesh = mesh;
    memcpy(node->translation, (float[]){x, y, z}, sizeof node->translation);
    return node;
}

static struct hg_node *add_lamp(int kind, float x, float y, float z, float intensity)
{
    struct hg_light *light = add(HG_OBJECT_LIGHT);
    struct hg_node *node = add(HG_OBJECT_NODE);
    light->kind = kind;
    light->intensity = intensity;
    for (int i = 0; i < 3; i++)
        light->color[i] = 1;
    node->light = light;
    memcpy(node->translation, (float[]){x, y, z}, sizeof node->translation);
    return node;
}

static void expect_key(double lux)
{
    hg_scene_update(scene);
    const double key = (double)hg_key_illuminance(scene);
    if (fabs(key - lux) > 1e-5 * lux + 1e-12)
        fail_msg("%.9g lux instead of %.9g", key, lux);
}

static void test_lamps(void **state)
{
    (void)state;
    expect_key(0);
    add_cube(0, 0, 0, 1);
    expect_key(0);
    struct hg_node *lamp = add_lamp(HG_LIGHT_POINT, 0, 7, 0, 1000);
    expect_key(1000.0 / (49 + 1)); // a cube of half side 1: its corners are sqrt 3 away
    lamp->light->color[0] = lamp->light->color[2] = 0;
    expect_key(0.7152 * 1000 / 50);
    add_lamp(HG_LIGHT_DIRECTIONAL, 0, 0, 0, 3);
    expect_key(0.7152 * 1000 / 50 + 3);
    lamp->visible = false;
    expect_key(3);
}

static void test_reach(void **state)
{
    (void)state;
    add_cube(0, 0, 0, 1);
    struct hg_node *lamp = add_lamp(HG_LIGHT_SPOT, 0, 0, 10, 500);
    lamp->light->outer_cone_rad = 0.3f;
    expect_key(500.0 / 101); // it shines along -z
    memcpy(lamp->rotation, (float[]){0, 1, 0, 0}, sizeof lamp->rotation);
    expect_key(0); // away
    memcpy(lamp->rotation, (float[]){0, 0, 0, 1}, sizeof lamp->rotation);
    lamp->light->range = 5;
    expect_key(0);
    lamp->light->range = 9;
    expect_key(500.0 / 101);
}

// The upper quartile, so that neither a mesh beside the lamp nor all that is far away decides.
static void test_quartile(void **state)
{
    (void)state;
    for (int i = 1; i <= 5; i++)
        add_cube((float)i, 0, 0, 0);
    add_lamp(HG_LIGHT_POINT, 0, 0, 0, 100);
    expect_key(100.0 / 4);         // of 100, 25, 11.1, 6.25 and 4 the second
    for (int i = 0; i < 2000; i++) // more than are looked at
        add_cube(0, 10, 0, 0);
    expect_key(1);
}

// Two stops under the key light, where the sky's own scattered light says how bright it is.
static void test_fill(void **state)
{
    (void)state;
    struct hg_environment *env = &scene->environment;
    add_cube(0, 0, 0, 1);
    memcpy(env->sun_direction, (float[]){-0.41318f, 0.76604f, 0.49240f}, sizeof env->sun_direction);
    hg_default_light_update(scene);
    assert_true(env->kind == HG_ENV_SKY && !env->fills && env->sun == HG_SKY_SUN_AUTO);
    assert_true(env->intensity == 1);
    add_lamp(HG_LIGHT_POINT, 0, 7, 0, 54351);
    hg_default_light_update(scene);
    assert_true(env->kind == HG_ENV_SKY && env->fills && env->sun == HG_SKY_SUN_OFF);
    struct hg_sky sky = {.turbidity = env->turbidity};
    struct hg_image image;
    struct hg_jobs *jobs = hg_jobs_create(2);
    memcpy(sky.sun_direction, env->sun_direction, sizeof sky.sun_direction);
    assert_int_equal(hg_sky_render(&sky, jobs, &image), HG_OK);
    double up = 0; // radiance of a white diffuser that faces up
    for (uint32_t y = 0; y < image.height / 2; y++)
        for (uint32_t x = 0; x < image.width; x++) {
            const double angle = pi * (y + 0.5) / image.height;
            const float *c =
                (const float *)(const void *)image.pixels + 4 * ((size_t)y * image.width + x);
            up += (0.2126 * (double)c[0] + 0.7152 * (double)c[1] + 0.0722 * (double)c[2]) *
                  cos(angle) * sin(angle);
        }
    up *= 2 * pi / image.width * pi / image.height / pi;
    hg_image_finish(&image);
    hg_jobs_destroy(jobs);
    const double key = 54351.0 / 50 / pi, fill = (double)env->intensity * up;
    if (fabs(log2(key / fill) - 2) > 0.05)
        fail_msg("the fill is %.3f stops under the key", log2(key / fill));
    env->wanted_intensity = 0.5f;
    hg_default_light_update(scene);
    assert_true(fabs((double)env->intensity * up / fill - 0.5) < 1e-6);
}

// What was chosen stays, and what does not change has no new revision.
static void test_chosen(void **state)
{
    (void)state;
    struct hg_environment *env = &scene->environment;
    add_cube(0, 0, 0, 1);
    add_lamp(HG_LIGHT_POINT, 0, 7, 0, 100);
    env->automatic = false;
    hg_default_light_update(scene);
    assert_int_equal(env->kind, HG_ENV_NONE);
    env->automatic = true;
    hg_scene_publish(scene);
    hg_default_light_update(scene);
    assert_true(env->revision == scene->revision);
    hg_scene_publish(scene);
    hg_default_light_update(scene);
    assert_true(env->revision + 1 == scene->revision);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_lamps, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_reach, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_quartile, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_fill, set_up, tear_down),
        cmocka_unit_test_setup_teardown(test_chosen, set_up, tear_down)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
