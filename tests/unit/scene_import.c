// scene_import.c - formats that go through assimp: one quad and one cube, written by assimp's own
// exporters into a temporary folder, come back as the same geometry.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <assimp/cexport.h>
#include <assimp/cimport.h>
#include <assimp/scene.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/utf8.h"
#include "renderer/scene/load.h"
#include "tests/support/folder.h"

#define DEGREE (3.14159265358979 / 180)

static char folder[TEST_FOLDER_MAX];

static void path_of(const char *name, char *out, size_t size)
{
    snprintf(out, size, "%s/%s", folder, name);
}

static int make_files(void **state)
{
    (void)state;
    char source[128], path[128];
    assert_true(test_folder_make(folder, "import"));
    test_text_write(folder, "box.mtl", "newmtl red\nKd 0.8 0.1 0.1\nNs 98\n");
    // A box of 2 x 3 x 4 m with its corner at the origin: eight vertices, six quads.
    test_text_write(folder, "box.obj",
        "mtllib box.mtl\nv 0 0 0\nv 2 0 0\nv 2 3 0\nv 0 3 0\nv 0 0 4\nv 2 0 4\nv 2 3 4\nv 0 3 4\n"
        "usemtl red\nf 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n");
    path_of("box.obj", source, sizeof source);
    const struct aiScene *scene = aiImportFile(source, 0);
    assert_non_null(scene);
    static const char *const formats[][2] = {{"stl", "box.stl"}, {"stlb", "binary.stl"},
        {"ply", "box.ply"}, {"collada", "box.dae"}, {"fbxa", "box.fbx"}};
    for (size_t i = 0; i < sizeof formats / sizeof *formats; i++) {
        path_of(formats[i][1], path, sizeof path);
        assert_int_equal(aiExportScene(scene, formats[i][0], path, 0), aiReturn_SUCCESS);
    }
    aiReleaseImport(scene);
    return 0;
}

static int remove_files(void **state)
{
    (void)state;
    return !test_folder_remove(folder);
}

static enum hg_status load(const char *name, struct hg_asset **asset, struct hg_error *err)
{
    char path[128];
    path_of(name, path, sizeof path);
    return hg_load_asset(
        &(struct hg_load_params){.path = path, .asset_number = 1, .scene_index = -1}, asset, err);
}

static void assert_is_box(const char *name, float unit)
{
    struct hg_asset *asset;
    struct hg_error err = {0};
    struct hg_scene *scene;
    if (load(name, &asset, &err))
        fail_msg("%s: %s: %s", name, err.where, err.reason);
    uint32_t triangles = 0;
    for (uint32_t m = 0; m < asset->mesh_count; m++)
        for (uint32_t p = 0; p < asset->meshes[m]->part_count; p++) {
            const struct hg_mesh_part *part = &asset->meshes[m]->parts[p];
            assert_int_equal(part->topology, HG_TOPOLOGY_TRIANGLES);
            assert_non_null(part->normals);
            triangles += part->index_count / 3;
        }
    assert_int_equal(triangles, 12);
    assert_int_equal(hg_scene_create(&scene), HG_OK);
    assert_int_equal(hg_scene_add_asset(scene, asset, NULL), HG_OK);
    hg_scene_update(scene);
    float min[3], max[3], size[3] = {2, 3, 4};
    assert_true(hg_scene_bounds(scene, NULL, min, max));
    for (int i = 0; i < 3; i++) {
        assert_float_equal(min[i], 0, 1e-4);
        assert_float_equal(max[i], size[i] * unit, 1e-4);
    }
    hg_scene_destroy(scene);
}

static void test_obj(void **state)
{
    (void)state;
    assert_is_box("box.obj", 1);
}

// Names that differ stay different, and are what the rest of the program takes names to be.
static void test_names_are_utf8(void **state)
{
    (void)state;
    struct hg_asset *asset;
    struct hg_error err = {0};
    bool grun = false, gran = false, utf8 = false;
    test_text_write(folder, "latin.mtl", "newmtl gr\xfcn\nnewmtl gr\xe4n\nnewmtl gr\xc3\xbcn2\n");
    test_text_write(folder, "latin.obj",
        "mtllib latin.mtl\nv 0 0 0\nv 2 0 0\nv 2 3 0\no T\xfcr\nusemtl gr\xfcn\nf 1 2 3\n"
        "usemtl gr\xe4n\nf 3 2 1\nusemtl gr\xc3\xbcn2\nf 2 3 1\n");
    assert_int_equal(load("latin.obj", &asset, &err), HG_OK);
    for (uint32_t i = 0; i < asset->material_count; i++) {
        const char *name = asset->materials[i]->head.name;
        grun = grun || strcmp(name, "gr\xc3\xbcn") == 0;
        gran = gran || strcmp(name, "gr\xc3\xa4n") == 0;
        utf8 = utf8 || strcmp(name, "gr\xc3\xbcn2") == 0;
    }
    assert_true(grun && gran && utf8);
    for (uint32_t i = 0; i < asset->node_count; i++) {
        const char *name = asset->nodes[i]->head.name;
        assert_true(hg_utf8_is_valid(name, strlen(name)));
    }
    hg_asset_destroy(asset);
}

static void test_phong_exponent_becomes_roughness(void **state)
{
    (void)state;
    struct hg_asset *asset;
    struct hg_error err = {0};
    assert_int_equal(load("box.obj", &asset, &err), HG_OK);
    const struct hg_material *red = NULL;
    for (uint32_t i = 0; i < asset->material_count; i++)
        if (strcmp(asset->materials[i]->head.name, "red") == 0)
            red = asset->materials[i];
    assert_non_null(red);
    assert_float_equal(red->base_color[0], 0.8, 1e-6);
    assert_float_equal(red->metallic, 0, 0);
    // alpha^2 = 2 / (n + 2) and roughness = sqrt(alpha)
    assert_float_equal(red->roughness, powf(2.0f / 100.0f, 0.25f), 1e-5);
    hg_asset_destroy(asset);
}

static void test_stl(void **state)
{
    (void)state;
    assert_is_box("box.stl", 1);
    assert_is_box("binary.stl", 1);
}

static void test_ply(void **state)
{
    (void)state;
    assert_is_box("box.ply", 1);
}

static void test_collada(void **state)
{
    (void)state;
    assert_is_box("box.dae", 1);
}

static void test_fbx(void **state)
{
    (void)state;
    assert_is_box("box.fbx", 0.01f); // FBX counts in centimetres
}

static void test_broken_files_are_refused_with_a_reason(void **state)
{
    (void)state;
    static const char *const names[] = {"bad.stl", "bad.ply", "bad.dae", "bad.fbx"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        struct hg_asset *asset;
        struct hg_error err = {0};
        test_text_write(folder, names[i], "neither this nor that\n");
        assert_int_not_equal(load(names[i], &asset, &err), HG_OK);
        assert_null(asset);
        assert_true(err.reason[0] != 0);
    }
}

// ---- skins, animations, cameras and lights: a Collada file written here -------------------------

// A ribbon of two squares on two joints, the upper of which turns by 90 degrees about z in two
// seconds; a camera or a light of each kind hangs on nodes of its own.
static const char collada_head[] =
    "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" "
    "version=\"1.4.1\"><asset><unit meter=\"%g\"/><up_axis>%s</up_axis></asset>"
    "<library_cameras>"
    "<camera id=\"c0\"><optics><technique_common><perspective><yfov>40</yfov><aspect_ratio>1.5"
    "</aspect_ratio><znear>0.2</znear><zfar>50</zfar></perspective></technique_common></optics>"
    "</camera>"
    "<camera id=\"c1\"><optics><technique_common><perspective><xfov>60</xfov><aspect_ratio>1.5"
    "</aspect_ratio><znear>0.2</znear><zfar>50</zfar></perspective></technique_common></optics>"
    "</camera>"
    "</library_cameras><library_lights>"
    "<light id=\"l0\"><technique_common><directional><color>3 1.5 0.75</color></directional>"
    "</technique_common></light>"
    "<light id=\"l1\"><technique_common><point><color>8 8 4</color></point></technique_common>"
    "</light>"
    "<light id=\"l2\"><technique_common><spot><color>5 5 5</color><falloff_angle>60"
    "</falloff_angle></spot></technique_common></light></library_lights>";

static const char collada_mesh[] =
    "<library_geometries><geometry id=\"ribbon\"><mesh>"
    "<source id=\"p\"><float_array id=\"pa\" count=\"18\">-0.5 0 0 0.5 0 0 -0.5 1 0 0.5 1 0 -0.5 2 "
    "0 0.5 2 0</float_array><technique_common><accessor source=\"#pa\" count=\"6\" stride=\"3\">"
    "<param name=\"X\" type=\"float\"/><param name=\"Y\" type=\"float\"/><param name=\"Z\" "
    "type=\"float\"/></accessor></technique_common></source>"
    "<vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/></vertices>"
    "<triangles count=\"4\"><input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/>"
    "<p>0 1 3 0 3 2 2 3 5 2 5 4</p></triangles></mesh></geometry></library_geometries>"
    "<library_controllers><controller id=\"skin\"><skin source=\"#ribbon\">"
    "<bind_shape_matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1</bind_shape_matrix>"
    "<source id=\"j\"><Name_array id=\"ja\" count=\"2\">root tip</Name_array><technique_common>"
    "<accessor source=\"#ja\" count=\"2\"><param name=\"JOINT\" type=\"name\"/></accessor>"
    "</technique_common></source>"
    "<source id=\"b\"><float_array id=\"ba\" count=\"32\">1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1 "
    "1 0 0 0 0 1 0 -1 0 0 1 0 0 0 0 1</float_array><technique_common><accessor source=\"#ba\" "
    "count=\"2\" stride=\"16\"><param name=\"TRANSFORM\" type=\"float4x4\"/></accessor>"
    "</technique_common></source>"
    "<source id=\"w\"><float_array id=\"wa\" count=\"2\">1 0.5</float_array><technique_common>"
    "<accessor source=\"#wa\" count=\"2\"><param name=\"WEIGHT\" type=\"float\"/></accessor>"
    "</technique_common></source>"
    "<joints><input semantic=\"JOINT\" source=\"#j\"/><input semantic=\"INV_BIND_MATRIX\" "
    "source=\"#b\"/></joints>"
    "<vertex_weights count=\"6\"><input semantic=\"JOINT\" source=\"#j\" offset=\"0\"/>"
    "<input semantic=\"WEIGHT\" source=\"#w\" offset=\"1\"/><vcount>1 1 2 2 1 1</vcount>"
    "<v>0 0 0 0 0 1 1 1 0 1 1 1 1 0 1 0</v></vertex_weights></skin></controller>"
    "</library_controllers>";

static const char collada_rest[] =
    "<library_animations><animation id=\"a\">"
    "<source id=\"ai\"><float_array id=\"aia\" count=\"2\">0 2</float_array><technique_common>"
    "<accessor source=\"#aia\" count=\"2\"><param name=\"TIME\" type=\"float\"/></accessor>"
    "</technique_common></source>"
    "<source id=\"ao\"><float_array id=\"aoa\" count=\"2\">0 90</float_array><technique_common>"
    "<accessor source=\"#aoa\" count=\"2\"><param name=\"ANGLE\" type=\"float\"/></accessor>"
    "</technique_common></source>"
    "<source id=\"an\"><Name_array id=\"ana\" count=\"2\">LINEAR LINEAR</Name_array>"
    "<technique_common><accessor source=\"#ana\" count=\"2\"><param name=\"INTERPOLATION\" "
    "type=\"name\"/></accessor></technique_common></source>"
    "<sampler id=\"as\"><input semantic=\"INPUT\" source=\"#ai\"/><input semantic=\"OUTPUT\" "
    "source=\"#ao\"/><input semantic=\"INTERPOLATION\" source=\"#an\"/></sampler>"
    "<channel source=\"#as\" target=\"tip/rotateZ.ANGLE\"/></animation></library_animations>"
    "<library_visual_scenes><visual_scene id=\"s\">"
    "<node id=\"root\" sid=\"root\" name=\"root\" type=\"JOINT\"><node id=\"tip\" sid=\"tip\" "
    "name=\"tip\" type=\"JOINT\"><translate sid=\"move\">0 1 0</translate><rotate "
    "sid=\"rotateZ\">0 0 1 0</rotate></node></node>"
    "<node id=\"body\" name=\"body\"><instance_controller url=\"#skin\"><skeleton>#root</skeleton>"
    "</instance_controller></node>"
    "<node id=\"n0\" name=\"n0\"><translate>1 2 3</translate><instance_camera url=\"#c0\"/></node>"
    "<node id=\"n1\" name=\"n1\"><instance_camera url=\"#c1\"/></node>"
    "<node id=\"m0\" name=\"m0\"><rotate>1 0 0 90</rotate><instance_light url=\"#l0\"/></node>"
    "<node id=\"m1\" name=\"m1\"><translate>0 5 0</translate><instance_light url=\"#l1\"/></node>"
    "<node id=\"m2\" name=\"m2\"><rotate>0 1 0 90</rotate><instance_light url=\"#l2\"/></node>"
    "</visual_scene></library_visual_scenes><scene><instance_visual_scene url=\"#s\"/></scene>"
    "</COLLADA>";

static struct hg_scene *load_collada(double meter, const char *up, struct hg_asset **asset)
{
    char head[4096], text[16384];
    struct hg_error err = {0};
    struct hg_scene *scene;
    snprintf(head, sizeof head, collada_head, meter, up);
    snprintf(text, sizeof text, "%s%s%s", head, collada_mesh, collada_rest);
    test_text_write(folder, "ribbon.dae", text);
    if (load("ribbon.dae", asset, &err))
        fail_msg("%s: %s", err.where, err.reason);
    assert_int_equal(hg_scene_create(&scene), HG_OK);
    assert_int_equal(hg_scene_add_asset(scene, *asset, NULL), HG_OK);
    hg_scene_update(scene);
    return scene;
}

static const struct hg_node *skinned_node(const struct hg_asset *asset)
{
    for (uint32_t i = 0; i < asset->node_count; i++)
        if (asset->nodes[i]->skin)
            return asset->nodes[i];
    fail_msg("no node has a skin");
    return NULL;
}

static void transform(const float m[16], const double p[3], double w, double out[3])
{
    for (int r = 0; r < 3; r++)
        out[r] = (double)m[r] * p[0] + (double)m[4 + r] * p[1] + (double)m[8 + r] * p[2] +
                 (double)m[12 + r] * w;
}

// Where the skin puts a vertex: the weighted sum over joints of world * inverse bind * position.
static void skinned(const struct hg_node *node, uint32_t v, double out[3])
{
    const struct hg_mesh_part *part = &node->mesh->parts[0];
    memset(out, 0, 3 * sizeof *out);
    for (uint32_t i = 0; i < 4 * part->joint_sets; i++) {
        const uint32_t k = v * 4 * part->joint_sets + i, j = part->joints[k];
        const double p[3] = {(double)part->positions[v * 3], (double)part->positions[v * 3 + 1],
            (double)part->positions[v * 3 + 2]};
        double bound[3], at[3];
        assert_true(j < node->skin->joint_count);
        transform(node->skin->inverse_bind[j], p, 1, bound);
        transform(node->skin->joints[j]->world, bound, 1, at);
        for (int c = 0; c < 3; c++)
            out[c] += at[c] * (double)part->weights[k];
    }
}

// The ribbon's upper half turned by `angle` about its middle, in the scene's metres and axes.
static void expected_at(const double p[3], double angle, double meter, bool z_up, double out[3])
{
    double c = cos(angle), s = sin(angle), upper = p[1] / 2; // weight of the upper joint
    double x = p[0], y = p[1] - 1;
    double at[3] = {(1 - upper) * p[0] + upper * (c * x - s * y),
        (1 - upper) * p[1] + upper * (s * x + c * y + 1), p[2]};
    out[0] = meter * at[0];
    out[1] = meter * (z_up ? at[2] : at[1]);
    out[2] = meter * (z_up ? -at[1] : at[2]);
}

static void check_ribbon(double meter, bool z_up)
{
    struct hg_asset *asset;
    struct hg_scene *scene = load_collada(meter, z_up ? "Z_UP" : "Y_UP", &asset);
    const struct hg_node *node = skinned_node(asset);
    const struct hg_mesh_part *part = &node->mesh->parts[0];
    assert_int_equal(part->vertex_count, 6);
    assert_int_equal(node->skin->joint_count, 2);
    assert_int_equal(asset->animation_count, 1);
    assert_float_equal(asset->animations[0].duration_s, 2, 1e-6f);
    for (int step = -1; step <= 4; step++) { // -1: as loaded
        if (step >= 0)
            assert_int_equal(hg_asset_pose(asset, 0, step * 0.5), HG_OK);
        hg_scene_update(scene);
        for (uint32_t v = 0; v < 6; v++) {
            const double p[3] = {(double)part->positions[v * 3], (double)part->positions[v * 3 + 1],
                (double)part->positions[v * 3 + 2]};
            double want[3], got[3];
            expected_at(p, step > 0 ? step * 0.25 * 1.5707963267948966 : 0, meter, z_up, want);
            skinned(node, v, got);
            for (int c = 0; c < 3; c++)
                if (fabs(got[c] - want[c]) > 2e-6)
                    fail_msg("metre %g, %s up, step %d, vertex %u (%g %g): %g %g %g, expected %g "
                             "%g %g",
                        meter, z_up ? "z" : "y", step, v, p[0], p[1], got[0], got[1], got[2],
                        want[0], want[1], want[2]);
        }
    }
    hg_scene_destroy(scene);
}

static void test_collada_skin_moves(void **state)
{
    (void)state;
    check_ribbon(1, false);
    check_ribbon(1, true);
    check_ribbon(0.01, false);
    check_ribbon(0.0254, true);
}

// A column of a node's world matrix.
static void expect_axis(const struct hg_node *node, int first, const float want[3])
{
    for (int i = 0; i < 3; i++)
        assert_float_equal(node->world[first + i], want[i], 1e-5f);
}

static const struct hg_node *node_with(const struct hg_asset *asset, const void *thing)
{
    for (uint32_t i = 0; i < asset->node_count; i++)
        if (asset->nodes[i]->camera == thing || asset->nodes[i]->light == thing)
            return asset->nodes[i];
    fail_msg("nothing holds it");
    return NULL;
}

static void test_collada_cameras(void **state)
{
    (void)state;
    struct hg_asset *asset;
    struct hg_scene *scene = load_collada(1, "Y_UP", &asset);
    const double want[2] = {40 * DEGREE, 2 * atan(tan(30 * DEGREE) / 1.5)};
    assert_int_equal(asset->camera_count, 2);
    assert_int_equal(asset->warning_count, 0);
    for (int i = 0; i < 2; i++) {
        const struct hg_camera *c = asset->cameras[i];
        assert_float_equal(c->vfov_rad, want[i], 1e-5f);
        assert_float_equal(c->near, 0.2f, 1e-6f);
        assert_float_equal(c->far, 50, 1e-4f);
        assert_float_equal(c->aspect, 1.5f, 1e-6f);
    }
    expect_axis(node_with(asset, asset->cameras[0]), 12, (const float[]){1, 2, 3});
    expect_axis(node_with(asset, asset->cameras[0]), 8, (const float[]){0, 0, 1});
    hg_scene_destroy(scene);
}

static void test_collada_lights(void **state)
{
    (void)state;
    struct hg_asset *asset;
    struct hg_scene *scene = load_collada(1, "Y_UP", &asset);
    // Pi lux per unit of colour; without attenuation, where the ribbon is: 4 m and 1 m away.
    static const float pi = 3.14159265f, intensity[3] = {3 * pi, 8 * pi * 16, 5 * pi},
                       color[3][3] = {{1, 0.5f, 0.25f}, {1, 1, 0.5f}, {1, 1, 1}};
    static const float travel[3][3] = {{0, 1, 0}, {0, 0, -1}, {-1, 0, 0}};
    static const int kinds[3] = {HG_LIGHT_DIRECTIONAL, HG_LIGHT_POINT, HG_LIGHT_SPOT};
    assert_int_equal(asset->light_count, 3);
    for (int i = 0; i < 3; i++) {
        const struct hg_light *light = asset->lights[i];
        const float *world = node_with(asset, light)->world;
        assert_int_equal(light->kind, kinds[i]);
        assert_float_equal(light->intensity / intensity[i], 1, 1e-5f);
        for (int c = 0; c < 3; c++) {
            assert_float_equal(light->color[c], color[i][c], 1e-6f);
            if (i != 1)
                assert_float_equal(-world[8 + c], travel[i][c], 1e-6f);
        }
    }
    assert_float_equal(node_with(asset, asset->lights[1])->world[13], 5, 1e-6f);
    assert_float_equal(asset->lights[2]->inner_cone_rad, 30 * 3.14159265f / 180, 1e-5f);
    assert_true(asset->lights[2]->outer_cone_rad > asset->lights[2]->inner_cone_rad);
    hg_scene_destroy(scene);
}

// --- cameras and lights of an FBX file written here; centimetres, full angles
// ---------------------

static const char fbx_text[] =
    "; FBX 7.4.0 project file\nFBXHeaderExtension: {\nFBXHeaderVersion: 1003\nFBXVersion: 7400\n}\n"
    "GlobalSettings: {\nVersion: 1000\nProperties70: {\nP: \"UpAxis\", \"int\", \"Integer\", "
    "\"\",1\nP: \"UnitScaleFactor\", \"double\", \"Number\", \"\",1\n}\n}\nObjects: {\n"
    "NodeAttribute: 100, \"NodeAttribute::Cam\", \"Camera\" {\nProperties70: {\n"
    "P: \"FieldOfView\", \"FieldOfView\", \"\", \"A\",50\n"
    "P: \"AspectWidth\", \"double\", \"Number\", \"\",3\n"
    "P: \"AspectHeight\", \"double\", \"Number\", \"\",2\n"
    "P: \"NearPlane\", \"double\", \"Number\", \"\",20\n"
    "P: \"FarPlane\", \"double\", \"Number\", \"\",5000\n}\nTypeFlags: \"Camera\"\n}\n"
    "NodeAttribute: 101, \"NodeAttribute::Lamp\", \"Light\" {\nProperties70: {\n"
    "P: \"LightType\", \"enum\", \"\", \"\",0\nP: \"DecayType\", \"enum\", \"\", \"\",0\nP: "
    "\"Intensity\", \"Number\", \"\", "
    "\"A\",250\nP: \"Color\", \"Color\", \"\", \"A\",1,0.5,0.25\n}\nTypeFlags: "
    "\"Light\"\n}\n"
    "NodeAttribute: 102, \"NodeAttribute::Spot\", \"Light\" {\nProperties70: {\n"
    "P: \"LightType\", \"enum\", \"\", \"\",2\nP: \"DecayType\", \"enum\", \"\", \"\",0\nP: "
    "\"Intensity\", \"Number\", \"\", "
    "\"A\",400\nP: \"InnerAngle\", \"Number\", \"\", \"A\",40\nP: \"OuterAngle\", "
    "\"Number\", \"\", \"A\",60\n}\nTypeFlags: \"Light\"\n}\n"
    "Geometry: 103, \"Geometry::Tri\", \"Mesh\" {\nVertices: *9 {\na: "
    "0,0,0,100,0,0,0,100,0\n}\nPolygonVertexIndex: *3 {\na: 0,1,-3\n}\n}\n"
    "Model: 200, \"Model::Cam\", \"Camera\" {\nVersion: 232\nProperties70: {\nP: \"Lcl "
    "Translation\", \"Lcl Translation\", \"\", \"A\",100,200,300\n}\n}\n"
    "Model: 201, \"Model::Lamp\", \"Light\" {\nVersion: 232\n}\n"
    "Model: 202, \"Model::Spot\", \"Light\" {\nVersion: 232\n}\n"
    "Model: 203, \"Model::Tri\", \"Mesh\" {\nVersion: 232\n}\n}\n"
    "Connections: {\nC: \"OO\",100,200\nC: \"OO\",101,201\nC: \"OO\",102,202\n"
    "C: \"OO\",103,203\nC: \"OO\",200,0\nC: \"OO\",201,0\nC: \"OO\",202,0\n"
    "C: \"OO\",203,0\n}\n";

static void test_fbx_cameras_and_lights(void **state)
{
    (void)state;
    struct hg_asset *asset;
    struct hg_scene *scene;
    struct hg_error err = {0};
    test_text_write(folder, "lit.fbx", fbx_text);
    if (load("lit.fbx", &asset, &err))
        fail_msg("%s: %s", err.where, err.reason);
    assert_int_equal(hg_scene_create(&scene), HG_OK);
    assert_int_equal(hg_scene_add_asset(scene, asset, NULL), HG_OK);
    hg_scene_update(scene);
    assert_int_equal(asset->camera_count, 1);
    assert_int_equal(asset->light_count, 2);
    const struct hg_camera *camera = asset->cameras[0];
    assert_float_equal(camera->vfov_rad, 2 * atan(tan(25 * DEGREE) / 1.5), 1e-5f);
    assert_float_equal(camera->aspect, 1.5f, 1e-6f);
    assert_float_equal(camera->near, 0.2f, 1e-6f);
    assert_float_equal(camera->far, 50, 1e-4f);
    const struct hg_node *node = node_with(asset, camera);
    const float scale = sqrtf(node->world[8] * node->world[8] + node->world[9] * node->world[9] +
                              node->world[10] * node->world[10]);
    expect_axis(node, 12, (const float[]){1, 2, 3});
    expect_axis(node, 8, (const float[]){-scale, 0, 0}); // FBX cameras look along +x
    const struct hg_light *lamp = asset->lights[0], *spot = asset->lights[1];
    assert_int_equal(lamp->kind, HG_LIGHT_POINT);
    // 100 is one: pi lux where the triangle is, sqrt(1/2) m away.
    assert_float_equal(lamp->intensity, 2.5 * 3.14159265 * 0.5, 1e-4f);
    assert_float_equal(lamp->color[1], 0.5f, 1e-6f);
    assert_int_equal(spot->kind, HG_LIGHT_SPOT);
    assert_float_equal(spot->intensity, 4 * 3.14159265 * 0.5, 1e-4f);
    assert_float_equal(spot->inner_cone_rad, 20 * DEGREE, 1e-5f);
    assert_float_equal(spot->outer_cone_rad, 30 * DEGREE, 1e-5f);
    expect_axis(node_with(asset, spot), 8, (const float[]){0, scale, 0}); // and lights along -y
    hg_scene_destroy(scene);
}

// --- blend shapes of an FBX file: one lifts the corner at +y, one moves that at +x

#define SHAPE(id, name, index, to)                                                                 \
    "Geometry: " id "0, \"Geometry::" name                                                         \
    "\", \"Shape\" {\nVersion: 100\nIndexes: *1 {\na: " index "\n}\nVertices: *3 {\na: " to        \
    "\n}\nNormals: *3 {\na: 0,0,0\n}\n}\n"                                                         \
    "Deformer: " id "1, \"SubDeformer::" name "\", \"BlendShapeChannel\" {\nVersion: 100\n"        \
    "DeformPercent: 0\nFullWeights: *1 {\na: 100\n}\n}\n"
#define CURVE(id, count, times, values)                                                            \
    "AnimationCurveNode: " id "2, \"AnimCurveNode::DeformPercent\", \"\" {\nProperties70: {\n"     \
    "P: \"d|DeformPercent\", \"Number\", \"\", \"A\",0\n}\n}\n"                                    \
    "AnimationCurve: " id "3, \"AnimCurve::\", \"\" {\nDefault: 0\nKeyVer: 4008\nKeyTime: *" count \
    " {\na: " times "\n}\nKeyValueFloat: *" count " {\na: " values "\n}\n}\n"
#define CONNECT(id)                                                                                \
    "C: \"OO\"," id "0," id "1\nC: \"OO\"," id "1,111\nC: \"OO\"," id "2,301\n"                    \
    "C: \"OP\"," id "2," id "1, \"DeformPercent\"\nC: \"OP\"," id "3," id                          \
    "2, \"d|DeformPercent\"\n"

static const char shapes_text[] =
    "; FBX 7.4.0 project file\nFBXHeaderExtension: {\nFBXHeaderVersion: 1003\nFBXVersion: 7400\n}\n"
    "GlobalSettings: {\nVersion: 1000\nProperties70: {\nP: \"UpAxis\", \"int\", \"Integer\", "
    "\"\",1\nP: \"TimeMode\", \"enum\", \"\", \"\",6\nP: \"UnitScaleFactor\", \"double\", "
    "\"Number\", \"\",1\n}\n}\nObjects: {\n"
    "Geometry: 103, \"Geometry::Tri\", \"Mesh\" {\nVertices: *9 {\na: "
    "0,0,0,100,0,0,0,100,0\n}\nPolygonVertexIndex: *3 {\na: 0,1,-3\n}\n"
    "LayerElementNormal: 0 {\nVersion: 101\nName: \"\"\nMappingInformationType: "
    "\"ByPolygonVertex\"\nReferenceInformationType: \"Direct\"\nNormals: *9 {\na: "
    "0,0,1,0,0,1,0,0,1\n}\n}\nLayer: 0 {\nVersion: 100\nLayerElement: {\nType: "
    "\"LayerElementNormal\"\nTypedIndex: 0\n}\n}\n}\n"
    "Model: 203, \"Model::Tri\", \"Mesh\" {\nVersion: 232\n}\n"
    "Deformer: 111, \"Deformer::\", \"BlendShape\" {\nVersion: 100\n}\n" // clang-format off
    SHAPE("40", "lift", "2", "0,0,100") SHAPE("41", "wide", "1", "50,0,0")
    "AnimationStack: 300, \"AnimStack::take\", \"\" {\nProperties70: {\nP: \"LocalStart\", \"KTime\", \"Time\", "
    "\"\",0\nP: \"LocalStop\", \"KTime\", \"Time\", \"\",92372316000\n}\n}\n"
    "AnimationLayer: 301, \"AnimLayer::base\", \"\" {\n}\n"
    CURVE("40", "2", "0,92372316000", "0,100") CURVE("41", "1", "46186158000", "40")
    "}\nConnections: {\nC: \"OO\",103,203\nC: \"OO\",203,0\nC: \"OO\",111,103\nC: \"OO\",301,300\n"
    CONNECT("40") CONNECT("41") "}\n"; // clang-format on

static const struct hg_node *morphed_node(const struct hg_asset *asset)
{
    for (uint32_t i = 0; i < asset->node_count; i++)
        if (asset->nodes[i]->weights)
            return asset->nodes[i];
    fail_msg("no node has weights");
    return NULL;
}

static void test_fbx_blend_shapes(void **state)
{
    (void)state;
    struct hg_asset *asset;
    struct hg_error err = {0};
    test_text_write(folder, "shapes.fbx", shapes_text);
    if (load("shapes.fbx", &asset, &err))
        fail_msg("%s: %s", err.where, err.reason);
    const struct hg_node *node = morphed_node(asset);
    const struct hg_mesh_part *part = &node->mesh->parts[0];
    assert_int_equal(node->mesh->target_count, 2);
    assert_true(node->weights[0] == 0 && node->weights[1] == 0);
    const float unit = part->positions[3]; // of the corner at +x, 100 in the file
    static const float moved[2][9] = {{0, 0, 0, 0, 0, 0, 0, 0, 1}, {0, 0, 0, 0.5f, 0, 0, 0, 0, 0}};
    for (int t = 0; t < 2; t++)
        for (int i = 0; i < 9; i++)
            assert_float_equal(part->targets[t].positions[i], unit * moved[t][i], 1e-6f);
    // The file has no normals of the lifted triangle: they are those of its plane.
    const float *normals = part->targets[0].normals;
    for (int v = 0; v < 3; v++) {
        assert_float_equal(normals[v * 3], 0, 1e-5f);
        assert_float_equal(normals[v * 3 + 1], -0.70710678f, 1e-5f);
        assert_float_equal(normals[v * 3 + 2], 0.70710678f - 1, 1e-5f);
    }
    // Keys of one shape do not end the other's.
    assert_int_equal(asset->animation_count, 1);
    for (int step = 0; step <= 4; step++) {
        assert_int_equal(hg_asset_pose(asset, 0, step * 0.5), HG_OK);
        assert_float_equal(node->weights[0], step * 0.25f, 1e-5f);
        assert_float_equal(node->weights[1], 0.4f, 1e-5f);
    }
    hg_asset_destroy(asset);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_obj),
        cmocka_unit_test(test_names_are_utf8),
        cmocka_unit_test(test_phong_exponent_becomes_roughness),
        cmocka_unit_test(test_stl),
        cmocka_unit_test(test_ply),
        cmocka_unit_test(test_collada),
        cmocka_unit_test(test_fbx),
        cmocka_unit_test(test_collada_skin_moves),
        cmocka_unit_test(test_collada_cameras),
        cmocka_unit_test(test_collada_lights),
        cmocka_unit_test(test_fbx_cameras_and_lights),
        cmocka_unit_test(test_fbx_blend_shapes),
        cmocka_unit_test(test_broken_files_are_refused_with_a_reason),
    };
    return cmocka_run_group_tests_name("scene_import", tests, make_files, remove_files);
}
