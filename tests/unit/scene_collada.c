// scene_collada.c - Collada files as programs write them: UTF-16, white space of all sorts, the
// four meanings of transparency, sides, parts that hold nothing; and what is said of broken ones.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdlib.h>

#include "base/bytes.h"
#include "tests/unit/scene_files.h"

static const char head[] =
    "<?xml version=\"1.0\" encoding=\"%s\"?>\n<!-- a < b -->\n"
    "<COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">"
    "<asset><unit meter=\"1\"/><up_axis>Y_UP</up_axis></asset>";

static const char material[] =
    "<library_effects><effect id=\"e\"><profile_COMMON><technique sid=\"t\"><lambert>"
    "<diffuse><color>1 0.5 0 1</color></diffuse>%s</lambert></technique></profile_COMMON>%s"
    "</effect></library_effects><library_materials><material id=\"m\" name=\"paint\">"
    "<instance_effect url=\"#e\"/></material></library_materials>";

// %1$s: white space, wherever it may be.
static const char geometry[] =
    "<library_geometries><geometry id=\"gr\xc3\xbc\"><mesh><source id=\"p\">"
    "<float_array id=\"pa\" count=\"%1$s12\">%1$s0 0 0%1$s1 0 0 %1$s 1 2%1$s0 0 2 "
    "0%1$s</float_array>"
    "<technique_common><accessor source=\"%1$s#pa\" count=\"4\" stride=\"3\"><param name=\"X\" "
    "type=\"float\"/><param name=\"Y\" type=\"float\"/><param%1$sname=\"Z\" type=\"float\"/>"
    "</accessor></technique_common></source><vertices id=\"v\"><input semantic=\"POSITION\" "
    "source=\"#p\"/></vertices><polylist material=\"s\" count=\"2\"><input semantic=\"VERTEX\" "
    "source=\"#v\" offset=\"0\"/><vcount>%1$s3%1$s3%1$s</vcount><p>%1$s0 1%1$s2 0 2 3%1$s</p>"
    "</polylist></mesh></geometry><geometry id=\"none\"><mesh><source id=\"q\">"
    "<float_array id=\"qa\" count=\"0\"></float_array><technique_common><accessor source=\"#qa\" "
    "count=\"0\" stride=\"3\"><param name=\"X\" type=\"float\"/><param name=\"Y\" type=\"float\"/>"
    "<param name=\"Z\" type=\"float\"/></accessor></technique_common></source>"
    "<vertices id=\"w\"><input semantic=\"POSITION\" source=\"#q\"/></vertices></mesh></geometry>"
    "</library_geometries>";

static const char scene[] =
    "<library_visual_scenes><visual_scene id=\"s\"><node id=\"a\"><matrix>%1$s1 0 0 0%1$s0 1 0 0 0 "
    "0 "
    "1 0 0 0 0 1%1$s</matrix><instance_geometry "
    "url=\"#gr\xc3\xbc\"><bind_material><technique_common>"
    "<instance_material symbol=\"s\" target=\"#m\"/></technique_common></bind_material>"
    "</instance_geometry></node><node id=\"b\"><instance_geometry url=\"#none\"/></node>"
    "</visual_scene></library_visual_scenes><scene><instance_visual_scene url=\"#s\"/></scene>"
    "</COLLADA>";

struct document {
    const char *encoding, *space, *transparency, *extra;
};

static char *make(const struct document *d)
{
    enum { SIZE = 1 << 15 };
    char *text = malloc(SIZE);
    assert_non_null(text);
    int n = snprintf(text, SIZE, head, d->encoding);
    n += snprintf(text + n, SIZE - (size_t)n, material, d->transparency, d->extra);
    n += snprintf(text + n, SIZE - (size_t)n, geometry, d->space);
    snprintf(text + n, SIZE - (size_t)n, scene, d->space);
    return text;
}

static const struct document plain = {"utf-8", " ", "", ""};

static void expect_square(const struct hg_asset *asset)
{
    uint32_t negative;
    const struct hg_mesh_part *part = only_part(asset);
    assert_int_equal(part->index_count, 6);
    assert_float_equal(area_z(part, &negative), 2, 1e-6);
    assert_int_equal(negative, 0);
    expect_vector(part->normals, (const float[]){0, 0, 1}, 3, 1e-6f);
    expect_vector(part->material->base_color, (const float[]){1, 0.5f, 0}, 3, 1e-6f);
}

static void test_white_space(void **state)
{
    (void)state;
    static const char *const spaces[] = {" ", "\n", "\r\n\t\t", " \t\n \n", "\xc2\xa0"};
    for (size_t i = 0; i < sizeof spaces / sizeof *spaces; i++) {
        struct document d = plain;
        d.space = spaces[i];
        char *text = make(&d), *padded = malloc(strlen(text) + 64);
        if (!padded)
            abort();
        sprintf(padded, "\xef\xbb\xbf%s\n%s\n \n", i % 2 ? " \n" : "", text);
        struct hg_asset *asset = load_text("w.dae", padded);
        expect_square(asset);
        hg_asset_destroy(asset);
        free(padded);
        free(text);
    }
}

static void put_unit(struct hg_writer *w, uint32_t unit, bool big)
{
    hg_write_u8(w, (uint8_t)(big ? unit >> 8 : unit));
    hg_write_u8(w, (uint8_t)(big ? unit : unit >> 8));
}

static void test_utf16(void **state)
{
    (void)state;
    for (int kind = 0; kind < 4; kind++) { // either order, with a mark and without
        const bool big = kind & 1, marked = kind & 2;
        struct document d = plain;
        d.encoding = "UTF-16";
        char *text = make(&d);
        struct hg_writer w = {0};
        if (marked)
            put_unit(&w, 0xfeff, big);
        for (const char *p = text; *p; p++) {
            if ((uint8_t)*p == 0xc3) {
                put_unit(&w, 0xc0u | (uint8_t)p[1], big);
                p++;
            } else {
                put_unit(&w, (uint8_t)*p, big);
            }
        }
        struct hg_asset *asset = load_bytes("u.dae", w.data, w.size);
        expect_square(asset);
        assert_non_null(strstr(asset->meshes[0]->head.name, "gr\xc3\xbc"));
        hg_asset_destroy(asset);
        hg_writer_finish(&w);
        free(text);
    }
}

static struct hg_asset *load_document(const struct document *d)
{
    char *text = make(d);
    struct hg_asset *asset = load_text("t.dae", text);
    free(text);
    return asset;
}

// Collada 1.5, page 249 on: opacity by mode, colour and factor. None is meant to be invisible.
static void test_transparency(void **state)
{
    (void)state;
    static const struct {
        const char *mode, *color, *factor;
        float opacity;
        bool warns;
    } cases[] = {{"A_ONE", "1 1 1 0.25", "1", 0.25f, false},
        {"A_ONE", "1 1 1 0.5", "0.5", 0.25f, false}, {"A_ZERO", "1 1 1 0.25", "1", 0.75f, false},
        {"RGB_ONE", "0.5 0.5 0.5 1", "1", 0.5f, false},
        {"RGB_ZERO", "0.25 0.25 0.25 1", "1", 0.75f, false}, {"RGB_ZERO", "0 0 0 1", "1", 1, false},
        {"A_ONE", "1 1 1 1", "0", 1, true}, {"A_ZERO", "1 1 1 1", "1", 1, true},
        {"RGB_ZERO", "1 1 1 1", "1", 1, true}, {"A_ONE", "1 1 1 1", "1", 1, false}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[256];
        snprintf(text, sizeof text,
            "<transparent opaque=\"%s\"><color>%s</color></transparent><transparency><float>%s"
            "</float></transparency>",
            cases[i].mode, cases[i].color, cases[i].factor);
        struct document d = plain;
        d.transparency = text;
        struct hg_asset *asset = load_document(&d);
        const struct hg_material *m = only_part(asset)->material;
        if (fabsf(m->base_color[3] - cases[i].opacity) > 1e-4f)
            fail_msg("%s: %g", text, (double)m->base_color[3]);
        assert_int_equal(m->alpha_mode, cases[i].opacity < 1 ? HG_ALPHA_BLEND : HG_ALPHA_OPAQUE);
        assert_int_equal(has_warning(asset, "wholly transparent"), cases[i].warns);
        hg_asset_destroy(asset);
    }
}

static void test_sides(void **state)
{
    (void)state;
    static const struct {
        const char *extra;
        bool both;
    } cases[] = {{"", true},
        {"<extra><technique "
         "profile=\"GOOGLEEARTH\"><double_sided>1</double_sided></technique></extra>",
            true},
        {"<extra><technique profile=\"GOOGLEEARTH\"><double_sided> 0\n</double_sided></technique>"
         "</extra>",
            false}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct document d = plain;
        d.extra = cases[i].extra;
        struct hg_asset *asset = load_document(&d);
        assert_int_equal(only_part(asset)->material->double_sided, cases[i].both);
        hg_asset_destroy(asset);
    }
}

// ---- cameras -----------------------------------------------------------------------------------

static const char camera_document[] =
    "<COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">"
    "<asset><unit meter=\"0.5\" name=\"half\"/><up_axis>Y_UP</up_axis></asset>"
    "<library_cameras>%s</library_cameras>%s<library_visual_scenes><visual_scene id=\"s\">"
    "<node id=\"mesh\"><instance_geometry url=\"#gr\xc3\xbc\"/></node>%s"
    "</visual_scene></library_visual_scenes><scene><instance_visual_scene url=\"#s\"/></scene>"
    "</COLLADA>";

static struct hg_asset *load_cameras(const char *cameras, const char *nodes)
{
    char text[8192], mesh[4096];
    snprintf(mesh, sizeof mesh, geometry, " ");
    assert_true(
        snprintf(text, sizeof text, camera_document, cameras, mesh, nodes) < (int)sizeof text);
    return load_text("c.dae", text);
}

static const struct hg_camera *camera_of(const struct hg_asset *asset, const char *node)
{
    const struct hg_camera *found = NULL;
    for (uint32_t n = 0; n < asset->node_count; n++)
        if (asset->nodes[n]->camera && strcmp(asset->nodes[n]->head.name, node) == 0)
            found = asset->nodes[n]->camera;
    assert_non_null(found);
    return found;
}

// Collada 1.4.1, <perspective>: xfov, yfov, both, or one with aspect_ratio.
static void test_camera_angles(void **state)
{
    (void)state;
    static const struct {
        const char *optics;
        double vfov_deg, aspect; // tan(30 deg) = 0.57735
    } cases[] = {
        {"<xfov>60</xfov><aspect_ratio>2</aspect_ratio>", 32.204228, 2},
        {"<xfov sid=\"HFOV\"> 60\n</xfov>", 35.983390, 0},
        {"<yfov>30</yfov>", 30, 0},
        {"<yfov sid=\"YFOV\">30</yfov>\n<aspect_ratio>1.5</aspect_ratio>", 30, 1.5},
        {"<xfov>60</xfov><yfov>60.0</yfov>", 60, 1},
        {"<xfov>0.5</xfov><yfov>0.5</yfov>", 0.5, 1},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char camera[512];
        snprintf(camera, sizeof camera,
            "<!-- the file's, not <camera id='c'> --><camera id='c' name=\"a > "
            "b\"><optics><technique_common><perspective>%s"
            "<znear>0.1</znear><zfar>10</zfar></perspective></technique_common></optics><extra>"
            "<technique profile=\"x\"><xfov>99</xfov></technique></extra></camera>",
            cases[i].optics);
        struct hg_asset *asset =
            load_cameras(camera, "<node id=\"n\"><instance_camera url=\"#c\"/></node>");
        const struct hg_camera *c = camera_of(asset, "n");
        if (fabs((double)c->vfov_rad * 180 / M_PI - cases[i].vfov_deg) > 1e-4 ||
            fabs((double)c->aspect - cases[i].aspect) > 1e-5)
            fail_msg(
                "%s: %g, %g", cases[i].optics, (double)c->vfov_rad * 180 / M_PI, (double)c->aspect);
        assert_int_equal(c->kind, HG_CAMERA_PERSPECTIVE);
        assert_false(has_warning(asset, "field of view"));
        hg_asset_destroy(asset);
    }
}

static void test_camera_nodes(void **state)
{
    (void)state;
    struct hg_asset *asset = load_cameras(
        "<camera id=\"wide\"><optics><technique_common><perspective><yfov>70</yfov></perspective>"
        "</technique_common></optics></camera>"
        "<camera id=\"flat\"><optics><technique_common><orthographic><xmag>6</xmag><ymag>3</ymag>"
        "</orthographic></technique_common></optics></camera>"
        "<camera id=\"tele\"><optics><technique_common><perspective><yfov>10</yfov></perspective>"
        "</technique_common></optics></camera>",
        "<node id=\"t\"><instance_camera url=\"#tele\"/><node id=\"f\" name=\"t\"><instance_camera "
        "url=\"#flat\"/></node></node><node name=\"t\" sid=\"w\"><instance_camera url=\"#wide\"/>"
        "</node>");
    assert_int_equal(asset->camera_count, 3);
    assert_float_equal(camera_of(asset, "t")->vfov_rad, 10 * M_PI / 180, 1e-6);
    assert_float_equal(camera_of(asset, "w")->vfov_rad, 70 * M_PI / 180, 1e-6);
    const struct hg_camera *flat = camera_of(asset, "f");
    assert_int_equal(flat->kind, HG_CAMERA_ORTHOGRAPHIC);
    assert_float_equal(flat->half_height, 1.5, 1e-6); // units of half a metre
    assert_float_equal(flat->aspect, 2, 1e-6);
    hg_asset_destroy(asset);
    asset = load_cameras("<camera id=\"c\"><optics><technique_common><perspective><yfov>-1</yfov>"
                         "</perspective></technique_common></optics></camera>",
        "<node id=\"n\"><instance_camera url=\"#c\"/></node>");
    assert_true(has_warning(asset, "field of view"));
    hg_asset_destroy(asset);
}

static void test_messages(void **state)
{
    (void)state;
    static const char *const empty =
        "<COLLADA version=\"1.4.1\"><asset/><library_visual_scenes><visual_scene id=\"s\"><node "
        "id=\"a\"/></visual_scene></library_visual_scenes><scene><instance_visual_scene "
        "url=\"#s\"/>"
        "</scene></COLLADA>";
    char *text = make(&plain);
    expect_text_refusal("e.dae", empty, "", "no geometry");
    expect_text_refusal("e.dae", "<html></html>", "", "not a Collada file");
    text[strlen(text) / 2] = 0;
    expect_text_refusal("e.dae", text, "", "it does not end with </COLLADA>");
    free(text);
    expect_text_refusal("e.fbx", "neither\n", "", "not an FBX file");
    struct files files = {{{"e.fbx",
        "; FBX 6.1.0 project file\nFBXHeaderExtension:  {\n"
        "\tFBXVersion: 6100\n}\n",
        68}}};
    struct hg_asset *asset;
    struct hg_error err;
    assert_int_equal(files_load(&files, &asset, &err), HG_E_UNSUPPORTED);
    assert_non_null(strstr(err.reason, "FBX of version 6.1: 7.1"));
    files = (struct files){{{"e.blend", "BLENDER", 7}}};
    assert_int_equal(files_load(&files, &asset, &err), HG_E_UNSUPPORTED);
    assert_non_null(strstr(err.reason, "glTF 2.0 (.gltf, .glb), OBJ, PLY, STL"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_white_space),
        cmocka_unit_test(test_utf16), cmocka_unit_test(test_transparency),
        cmocka_unit_test(test_sides), cmocka_unit_test(test_messages),
        cmocka_unit_test(test_camera_angles), cmocka_unit_test(test_camera_nodes)};
    return cmocka_run_group_tests_name("scene_collada", tests, NULL, NULL);
}
