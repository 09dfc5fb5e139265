// scene_import_light.c - the same lamp in glTF, FBX and Collada, as exporters write it, is about as
// bright in each.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "renderer/scene/load.h"
#include "tests/support/folder.h"

#define PI 3.14159265358979

static char folder[TEST_FOLDER_MAX];

static int make_folder(void **state)
{
    (void)state;
    return !test_folder_make(folder, "import_light");
}

static int remove_folder(void **state)
{
    (void)state;
    return !test_folder_remove(folder);
}

// A lamp of a file: what its exporter says of it.
struct lamp {
    const char *tool;           // that wrote the file
    const char *kind;           // point, spot, directional
    double color;               // as it stands in the file
    int decay;                  // FBX: 0 none, 1 linear, 2 quadratic, 3 cubic
    double start;               // FBX: where the decay begins, units of the file
    double constant, quadratic; // Collada
};

// Of the light in a file with a cube of 2 m about the origin and a lamp 5 m above its middle.
static double load_intensity(const char *name, const char *text)
{
    char path[128];
    struct hg_asset *asset;
    struct hg_error err = {0};
    snprintf(path, sizeof path, "%s/%s", folder, name);
    test_text_write(folder, name, text);
    const struct hg_load_params params = {.path = path, .asset_number = 1, .scene_index = -1};
    if (hg_load_asset(&params, &asset, &err))
        fail_msg("%s: %s: %s", name, err.where, err.reason);
    assert_int_equal(asset->light_count, 1);
    const struct hg_light *light = asset->lights[0];
    const double intensity = (double)light->intensity;
    assert_float_equal(light->color[0], 1, 1e-6f);
    hg_asset_destroy(asset);
    return intensity;
}

// Blender exports with a unit of 1 m and a scale of 100 on every node.
static double in_fbx(const struct lamp *lamp)
{
    char text[4096];
    const int kind = strcmp(lamp->kind, "point") == 0         ? 0
                     : strcmp(lamp->kind, "directional") == 0 ? 1
                     : strcmp(lamp->kind, "spot") == 0        ? 2
                                                              : 3;
    snprintf(text, sizeof text,
        "; FBX 7.4.0 project file\nFBXHeaderExtension: {\nFBXHeaderVersion: 1003\nFBXVersion: "
        "7400\n"
        "Creator: \"%s\"\n}\nCreator: \"%s\"\n"
        "GlobalSettings: {\nVersion: 1000\nProperties70: {\nP: \"UpAxis\", \"int\", \"Integer\", "
        "\"\",1\nP: \"UnitScaleFactor\", \"double\", \"Number\", \"\",1\n}\n}\nObjects: {\n"
        "NodeAttribute: 101, \"NodeAttribute::Lamp\", \"Light\" {\nProperties70: {\n"
        "P: \"LightType\", \"enum\", \"\", \"\",%d\nP: \"Intensity\", \"Number\", \"\", \"A\",%g\n"
        "P: \"Color\", \"Color\", \"\", \"A\",1,1,1\nP: \"DecayType\", \"enum\", \"\", \"\",%d\n"
        "P: \"DecayStart\", \"double\", \"Number\", \"\",%g\n}\nTypeFlags: \"Light\"\n}\n"
        "Geometry: 103, \"Geometry::Cube\", \"Mesh\" {\nVertices: *24 {\na: "
        "-100,-100,-100,100,-100,-100,100,100,-100,-100,100,-100,"
        "-100,-100,100,100,-100,100,100,100,100,-100,100,100\n}\nPolygonVertexIndex: *8 {\n"
        "a: 0,1,2,-4,4,5,6,-8\n}\n}\n"
        "Model: 201, \"Model::Lamp\", \"Light\" {\nVersion: 232\nProperties70: {\nP: \"Lcl "
        "Translation\", \"Lcl Translation\", \"\", \"A\",0,500,0\n}\n}\n"
        "Model: 203, \"Model::Cube\", \"Mesh\" {\nVersion: 232\n}\n}\n"
        "Connections: {\nC: \"OO\",101,201\nC: \"OO\",103,203\nC: \"OO\",201,0\nC: "
        "\"OO\",203,0\n}\n",
        lamp->tool, lamp->tool, kind, lamp->color * 100, lamp->decay, lamp->start);
    return load_intensity("lamp.fbx", text);
}

static double in_collada(const struct lamp *lamp)
{
    char text[8192], decay[256] = "";
    if (lamp->constant > 0 && strcmp(lamp->kind, "directional") != 0)
        snprintf(decay, sizeof decay,
            "<constant_attenuation>%g</constant_attenuation><linear_attenuation>0"
            "</linear_attenuation><quadratic_attenuation>%g</quadratic_attenuation>",
            lamp->constant, lamp->quadratic);
    snprintf(text, sizeof text,
        "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" "
        "version=\"1.4.1\"><asset><contributor><authoring_tool>%s</authoring_tool></contributor>"
        "<unit name=\"cm\" meter=\"0.01\"/><up_axis>Y_UP</up_axis></asset><library_lights>"
        "<light id=\"l\" name=\"l\"><technique_common><%s><color>%g %g %g</color>%s</%s>"
        "</technique_common></light></library_lights><library_geometries><geometry id=\"g\"><mesh>"
        "<source id=\"p\"><float_array id=\"pa\" count=\"12\">-100 -100 -100 100 -100 100 100 100 "
        "100 -100 100 -100</float_array><technique_common><accessor source=\"#pa\" count=\"4\" "
        "stride=\"3\"><param name=\"X\" type=\"float\"/><param name=\"Y\" type=\"float\"/><param "
        "name=\"Z\" type=\"float\"/></accessor></technique_common></source><vertices "
        "id=\"v\"><input "
        "semantic=\"POSITION\" source=\"#p\"/></vertices><triangles count=\"2\"><input "
        "semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><p>0 1 2 0 2 3</p></triangles></mesh>"
        "</geometry></library_geometries><library_visual_scenes><visual_scene id=\"s\">"
        "<node id=\"a\"><instance_geometry url=\"#g\"/></node><node id=\"b\"><translate>0 500 0"
        "</translate><instance_light url=\"#l\"/></node></visual_scene></library_visual_scenes>"
        "<scene><instance_visual_scene url=\"#s\"/></scene></COLLADA>",
        lamp->tool, lamp->kind, lamp->color, lamp->color, lamp->color, decay, lamp->kind);
    return load_intensity("lamp.dae", text);
}

static double in_gltf(const char *kind, double intensity)
{
    char text[2048];
    snprintf(text, sizeof text,
        "{\"asset\":{\"version\":\"2.0\"},\"extensionsUsed\":[\"KHR_lights_punctual\"],"
        "\"extensions\":{\"KHR_lights_punctual\":{\"lights\":[{\"type\":\"%s\",\"intensity\":%.9g%"
        "s}"
        "]}},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"translation\":[0,5,0],"
        "\"extensions\":{\"KHR_lights_punctual\":{\"light\":0}}}]}",
        kind, intensity, strcmp(kind, "spot") == 0 ? ",\"spot\":{}" : "");
    return load_intensity("lamp.gltf", text);
}

static void assert_near(const char *what, double value, double expected)
{
    if (fabs(value / expected - 1) > 1e-4)
        fail_msg("%s: %g is not %g", what, value, expected);
}

// Blender's startup lamp, 1000 W, and a sun of 3 W/m2. Its glTF exporter writes 683 lm/W, over 4 pi
// for lamps; its FBX exporter a hundred times the energy and an inverse square decay; its Collada
// exporter the energy, up to 2.9 with an attenuation that its renderers do not have.
static void test_blender(void **state)
{
    static const char fbx[] = "Blender (stable FBX IO) - 3.6.5 - 5.4.0", dae[] = "Blender 3.6.5",
                      old[] = "Blender 2.80.75 commit date:2019-07-29";
    (void)state;
    for (int spot = 0; spot < 2; spot++) {
        const char *kind = spot ? "spot" : "point";
        const double cd = in_gltf(kind, 1000 * 683 / (4 * PI));
        assert_near("FBX", in_fbx(&(struct lamp){fbx, kind, 1000, 2, 25, 0, 0}), cd);
        assert_near("Collada", in_collada(&(struct lamp){dae, kind, 1000, 0, 0, 0, 0}), cd);
        assert_near("Collada of 2.80",
            in_collada(&(struct lamp){old, kind, 1000, 0, 0, 1, 1 / (30.0 * 30.0)}), cd);
    }
    const double lux = in_gltf("directional", 3 * 683);
    assert_near("FBX sun", in_fbx(&(struct lamp){fbx, "directional", 3, 2, 25, 0, 0}), lux);
    assert_near("Collada sun", in_collada(&(struct lamp){dae, "directional", 3, 0, 0, 0, 0}), lux);
}

// A white surface that faces a light of colour 1 without attenuation is white: pi lux, here 5 m
// away. Attenuation counts in units of the file, centimetres here.
static void test_conventional(void **state)
{
    static const char maya[] = "FBX SDK/FBX Plugins version 2020.1",
                      before[] = "Blender 2.79 (sub 0)";
    const double white = PI * 25;
    (void)state;
    assert_near("no decay", in_fbx(&(struct lamp){maya, "point", 1, 0, 40, 0, 0}), white);
    assert_near("linear", in_fbx(&(struct lamp){maya, "point", 1, 1, 50, 0, 0}), white / 10);
    assert_near("quadratic", in_fbx(&(struct lamp){maya, "spot", 1, 2, 50, 0, 0}), white / 100);
    assert_near("no start", in_fbx(&(struct lamp){maya, "point", 1e4, 2, 0, 0, 0}), PI);
    assert_near("cubic", in_fbx(&(struct lamp){maya, "point", 1, 3, 50, 0, 0}), white);
    assert_near("sun", in_fbx(&(struct lamp){maya, "directional", 1, 0, 0, 0, 0}), PI);
    assert_near("area", in_fbx(&(struct lamp){maya, "area", 1, 0, 0, 0, 0}), white);
    const struct lamp plain = {"OpenCOLLADA2014 x64", "point", 1, 0, 0, 0, 0};
    assert_near("Collada", in_collada(&plain), white);
    const struct lamp fades = {"OpenCOLLADA2014 x64", "point", 1, 0, 0, 1, 1e-4};
    assert_near("Collada, fading", in_collada(&fades), white / 26);
    const struct lamp old = {before, "point", 1, 0, 0, 1, 1e-4};
    assert_near("Blender without watts", in_collada(&old), white / 26);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_blender),
        cmocka_unit_test(test_conventional),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
