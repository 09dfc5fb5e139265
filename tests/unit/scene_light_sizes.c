// What the glTF loader makes of the size of lights and of the optics of cameras.
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <cmocka.h>

#include <string.h>

#include "renderer/scene/asset.h"
#include "scene_memory.h"

static struct memory_gltf file; // too large for the stack

// Sizes in extras of lights, and of the nodes that have them; what is no size is left out and told.
static void test_light_sizes(void **state)
{
    (void)state;
    struct hg_asset *asset = memory_load_ok(&file,
        "\"extensionsUsed\":[\"KHR_lights_punctual\"],\"extensions\":{\"KHR_lights_punctual\":"
        "{\"lights\":[{\"type\":\"directional\",\"extras\":{\"angularDiameter\":0.01,\"radius\":9}}"
        ","
        "{\"type\":\"point\",\"extras\":{\"radius\":0.125}},"
        "{\"type\":\"spot\",\"extras\":{\"shadow_soft_size\":0.5}},"
        "{\"type\":\"point\",\"extras\":{\"shape\":\"RECTANGLE\",\"size\":2,\"size_y\":0.5}},"
        "{\"type\":\"spot\",\"extras\":{\"shape\":\"DISK\",\"size\":3}},"
        "{\"type\":\"point\",\"extras\":{\"shape\":\"tube\",\"length\":1.5,\"radius\":0.25}},"
        "{\"type\":\"point\",\"extras\":{\"radius\":-1,\"shape\":\"cone\"}},"
        "{\"type\":\"point\",\"extras\":{\"radius\":\"wide\"}},"
        "{\"type\":\"point\",\"extras\":{\"shape\":\"disc\",\"radius\":1e300}},"
        "{\"type\":\"point\",\"extras\":[1,2]}]}},"
        "\"nodes\":[{\"extras\":{\"radius\":0.75},"
        "\"extensions\":{\"KHR_lights_punctual\":{\"light\":9}}}]");
    struct hg_light *const *l = asset->lights;
    assert_int_equal(asset->light_count, 10);
    assert_true(l[0]->angular_diameter_rad == 0.01f && l[0]->radius == 0);
    assert_true(l[1]->kind == HG_LIGHT_POINT && l[1]->radius == 0.125f);
    assert_true(l[2]->kind == HG_LIGHT_SPOT && l[2]->radius == 0.5f);
    assert_true(l[3]->kind == HG_LIGHT_RECTANGLE && l[3]->width == 2 && l[3]->height == 0.5f);
    assert_true(l[4]->kind == HG_LIGHT_DISC && l[4]->radius == 1.5f);
    assert_true(l[5]->kind == HG_LIGHT_TUBE && l[5]->width == 1.5f && l[5]->radius == 0.25f);
    for (int i = 6; i < 9; i++)
        assert_true(l[i]->kind == HG_LIGHT_POINT && l[i]->radius == 0);
    assert_true(l[9]->radius == 0.75f);
    assert_int_equal(asset->warning_count, 5);
    assert_string_equal(
        asset->warnings[0].where, "/extensions/KHR_lights_punctual/lights/6/extras/shape");
    assert_non_null(strstr(asset->warnings[0].reason, "VALUE_NOT_IN_LIST"));
    assert_non_null(strstr(asset->warnings[1].reason, "VALUE_NOT_IN_RANGE"));
    hg_asset_destroy(asset);
}

// Lens and sensor in extras of cameras, and of the nodes that have them.
static void test_camera_optics(void **state)
{
    (void)state;
    static struct memory_gltf other;
    struct hg_asset *asset = memory_load_ok(&other,
        "\"cameras\":[{\"type\":\"perspective\",\"perspective\":{\"yfov\":1,\"znear\":0.1},"
        "\"extras\":{\"fNumber\":2.8,\"iso\":-3,\"focus_distance\":\"near\"}}],"
        "\"nodes\":[{\"camera\":0,\"extras\":{\"shutter_time\":0.02,\"iso\":200,"
        "\"sensor_mm\":24,\"focusDistance\":3}}]");
    const struct hg_camera_optics *o = &asset->cameras[0]->optics;
    assert_true(o->f_number == 2.8f && o->shutter_s == 0.02f && o->iso == 200);
    assert_true(o->sensor_mm == 24 && o->focus_distance == 3);
    assert_int_equal(asset->warning_count, 2);
    assert_string_equal(asset->warnings[0].where, "/cameras/0/extras/iso");
    hg_asset_destroy(asset);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_light_sizes), cmocka_unit_test(test_camera_optics)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
