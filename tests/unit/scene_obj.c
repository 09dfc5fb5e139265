// scene_obj.c - the OBJ reader and its material libraries.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdlib.h>

#include "tests/unit/scene_files.h"

static struct hg_asset *load_with(const char *obj, const char *mtl)
{
    struct files files = {{{"a.obj", obj, strlen(obj)}, {"a b.mtl", mtl, strlen(mtl)}}};
    struct hg_asset *asset;
    struct hg_error err;
    const enum hg_status status = files_load(&files, &asset, &err);
    if (status)
        fail_msg("%s: %s", err.where, err.reason);
    return asset;
}

static const struct hg_material *find_material(const struct hg_asset *asset, const char *name)
{
    for (uint32_t i = 0; i < asset->material_count; i++)
        if (strcmp(asset->materials[i]->head.name, name) == 0)
            return asset->materials[i];
    fail_msg("no material %s", name);
    return NULL;
}

// Odd white space, every end of line, comments, lines that go on, and indices from the end.
static void test_white_space(void **state)
{
    (void)state;
    static const char *const ends[] = {"\n", "\r\n", "\r"};
    for (int e = 0; e < 3; e++) {
        static const char lines[] =
            "\t v  0 0\t0 # corner|v 1 0 0|v 1 \\|2 0||  v 0 2 0 1.0|# f 9 9 9|"
            "f  -4 \\|-3/ -2// \\|-1 # all|v 900 0 0";
        char text[512];
        size_t n = 0;
        for (const char *p = lines; *p; p++)
            for (const char *q = *p == '|' ? ends[e] : p; *q; q += *p == '|' ? 1 : strlen(q))
                text[n++] = *q;
        text[n] = 0;
        struct hg_asset *asset = load_text("w.obj", text);
        const struct hg_mesh_part *part = only_part(asset);
        uint32_t negative;
        assert_int_equal(part->vertex_count, 4); // that which no face names is not there
        assert_float_equal(area_z(part, &negative), 2, 0);
        assert_int_equal(negative, 0);
        expect_vector(part->normals, (const float[]){0, 0, 1}, 3, 1e-6f);
        assert_string_equal(asset->file.format, "obj");
        assert_int_equal(asset->warning_count, 0);
        hg_asset_destroy(asset);
    }
}

#define CORNERS "v 0 0 0\nv 1 0 0\nv 1 2 0\nv 0 2 0\n"

static void test_groups_and_materials(void **state)
{
    (void)state;
    struct hg_asset *asset = load_with("mtllib a b.mtl\n" CORNERS "vn 0 1 0\nvt 0 0.25\n"
                                       "o one\nusemtl red\nf 1 2 3\nusemtl blue\nf 1 3 4\n"
                                       "g two\nf 1//1 2//1 3//1\nf 1/1 2/1 3/1\no one\nusemtl red\n"
                                       "f 1 3 4\n",
        "newmtl red\nKd 1 0 0\n");
    assert_int_equal(asset->mesh_count, 2);
    const struct hg_mesh *one = asset->meshes[0], *two = asset->meshes[1];
    assert_string_equal(one->head.name, "one");
    assert_string_equal(two->head.name, "two");
    assert_int_equal(one->part_count, 2); // red and blue
    assert_string_equal(one->parts[0].material->head.name, "red");
    assert_int_equal(one->parts[0].index_count, 6);
    assert_int_equal(two->part_count, 2); // with normals and without
    expect_vector(two->parts[0].normals, (const float[]){0, 1, 0}, 3, 0);
    assert_null(two->parts[0].uv[0]);
    expect_vector(two->parts[1].normals, (const float[]){0, 0, 1}, 3, 1e-6f);
    expect_vector(two->parts[1].uv[0], (const float[]){0, 0.75f}, 2, 0);
    assert_int_equal(asset->material_count, 2);
    expect_vector(find_material(asset, "red")->base_color, (const float[]){1, 0, 0, 1}, 4, 0);
    expect_vector(
        find_material(asset, "blue")->base_color, (const float[]){0.6f, 0.6f, 0.6f}, 3, 0);
    assert_true(find_material(asset, "blue")->double_sided);
    assert_int_equal(asset->root_count, 1);
    hg_asset_destroy(asset);
}

static void test_concave_face(void **state)
{
    (void)state;
    struct hg_asset *asset =
        load_text("c.obj", "v 0 0 0\nv 2 1 0\nv 4 0 0\nv 2 4 0\nf 1 2 3 4\nf 2 3 4 1\nf 4 3 2 1\n");
    uint32_t negative;
    assert_float_equal(area_z(only_part(asset), &negative), 6, 1e-6);
    assert_int_equal(negative, 2); // the last one is seen from behind
    hg_asset_destroy(asset);
}

static void test_lines_and_points(void **state)
{
    (void)state;
    struct hg_asset *asset = load_text("l.obj", CORNERS "l 1 2 3/4\np 1 -1\nf 1 2\n");
    const struct hg_mesh *mesh = asset->meshes[0];
    assert_int_equal(mesh->part_count, 2);
    assert_int_equal(mesh->parts[0].topology, HG_TOPOLOGY_LINES);
    assert_int_equal(mesh->parts[0].index_count, 6);
    assert_int_equal(mesh->parts[1].topology, HG_TOPOLOGY_POINTS);
    assert_int_equal(mesh->parts[1].index_count, 2);
    assert_true(has_warning(asset, "names vt 4 of 0"));
    hg_asset_destroy(asset);
    // vertices alone are a cloud; colours are sRGB, of 1 or of 255
    for (int i = 0; i < 2; i++) {
        asset = load_text("p.obj", i ? "v 0 0 0 128 255 0\nvn 0 0 1\nv 1 1 1 0 0 0\nvn 1 0 0\n"
                                     : "v 0 0 0 0.50196 1 0\nvn 0 0 1\nv 1 1 1 0 0 0\nvn 1 0 0\n");
        const struct hg_mesh_part *part = only_part(asset);
        assert_int_equal(part->topology, HG_TOPOLOGY_POINTS);
        assert_int_equal(part->index_count, 2);
        expect_vector(part->colors, (const float[]){0.21586f, 1, 0, 1, 0, 0, 0, 1}, 8, 1e-4f);
        expect_vector(part->normals, (const float[]){0, 0, 1, 1, 0, 0}, 6, 0);
        expect_vector(part->material->base_color, (const float[]){1, 1, 1, 1}, 4, 0);
        hg_asset_destroy(asset);
    }
}

// s off is flat, s 1 smooth whatever the angle; without it the angle decides.
static void test_smoothing_groups(void **state)
{
    (void)state;
    static const char roof[] = "v -1 0 0\nv 0 %s 0\nv 0 %s 1\nv 1 0 0\n%sf 1 3 2\nf 2 3 4\n";
    static const struct {
        const char *height, *statement;
        bool smooth;
    } cases[] = {{"0.1", "", true}, {"2", "", false}, {"0.1", "s off\n", false},
        {"0.1", "s 0\n", false}, {"2", "s 1\n", true}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[256];
        snprintf(text, sizeof text, roof, cases[i].height, cases[i].height, cases[i].statement);
        struct hg_asset *asset = load_text("s.obj", text);
        assert_int_equal(only_part(asset)->vertex_count, cases[i].smooth ? 4 : 6);
        hg_asset_destroy(asset);
    }
}

static void test_material_keys(void **state)
{
    (void)state;
    struct hg_asset *asset = load_with("mtllib a b.mtl\n" CORNERS "usemtl m\nf 1 2 3\n",
        "newmtl m\n\tKd 0.5 0.25\\\n 0.125\nPr 0.3\nPm 0.9\nNs 98\nKe 2 0 0\nPc 0.5\nPcr 0.1\n"
        "Ps 0.2\naniso 0.4\nanisor 0.25\nd 0.5\n"
        "newmtl phong\nKd 0.8\nNs 98\nTr 0.25\nnewmtl gone\nd 0\n"
        "newmtl leaf\nmap_Kd leaf.png\nmap_d leaf.png\nKd 0 0 0\n"
        "newmtl maps\nmap_Pr rough.png\nmap_Bump -bm 1 wood_Normal.png\n"
        "newmtl heights\nbump wood.png\nmap_Pm m.png\nmap_Pr r.png\n");
    const struct hg_material *m = find_material(asset, "m");
    expect_vector(m->base_color, (const float[]){0.5f, 0.25f, 0.125f, 0.5f}, 4, 0);
    assert_int_equal(m->alpha_mode, HG_ALPHA_BLEND);
    expect_vector((const float[]){m->roughness, m->metallic, m->emissive[0], m->clearcoat.factor,
                      m->clearcoat.roughness, m->sheen.color[1], m->anisotropy.strength,
                      m->anisotropy.rotation_rad},
        (const float[]){0.3f, 0.9f, 1, 0.5f, 0.1f, 0.2f, 0.4f, 1.5707963f}, 8, 1e-6f);
    m = find_material(asset, "phong");
    expect_vector(m->base_color, (const float[]){0.8f, 0.8f, 0.8f, 0.75f}, 4, 0);
    assert_float_equal(m->roughness, powf(2.0f / 100, 0.25f), 1e-6);
    m = find_material(asset, "gone");
    assert_int_equal(m->alpha_mode, HG_ALPHA_OPAQUE);
    assert_float_equal(m->base_color[3], 1, 0);
    assert_true(has_warning(asset, "wholly transparent"));
    m = find_material(asset, "leaf");
    assert_int_equal(m->alpha_mode, HG_ALPHA_MASK);
    assert_float_equal(m->base_color[0], 1, 0);
    m = find_material(asset, "maps");
    assert_non_null(m->slots[HG_SLOT_METALLIC_ROUGHNESS].texture);
    assert_float_equal(m->metallic, 0, 0);
    assert_string_equal(m->slots[HG_SLOT_NORMAL].texture->head.name, "wood_Normal.png");
    m = find_material(asset, "heights");
    assert_null(m->slots[HG_SLOT_NORMAL].texture);
    assert_true(has_warning(asset, "height maps"));
    assert_true(has_warning(asset, "separate metalness and roughness"));
    hg_asset_destroy(asset);
}

static void test_texture_options(void **state)
{
    (void)state;
    struct hg_asset *asset = load_with("mtllib a b.mtl\n" CORNERS
                                       "vt 0 0\nusemtl m\nf 1/1 2/1 3/1\n",
        "newmtl m\nmap_Kd -clamp on -o 0.5 0.25 -s 2 4 1 -blendu off -mm 0 1 my folder\\a b.png\n");
    const struct hg_texture_ref *ref = &find_material(asset, "m")->slots[HG_SLOT_BASE_COLOR];
    assert_string_equal(ref->texture->head.name, "my folder\\a b.png");
    assert_int_equal(ref->texture->wrap_s, HG_WRAP_CLAMP);
    // at v = 0.75 from above, which is 0.25 from below, the map shows 4 * 0.25 + 0.25 from below
    expect_vector(ref->uv_transform, (const float[]){2, 0, 0.5f, 0, 4, 1 - 4 - 0.25f}, 6, 0);
    hg_asset_destroy(asset);
}

static void test_missing_library(void **state)
{
    (void)state;
    struct hg_asset *asset = load_text("m.obj", "mtllib gone.mtl\nusemtl x\n" CORNERS "f 1 2 3\n");
    assert_int_equal(asset->warning_count, 1);
    assert_string_equal(asset->warnings[0].where, "gone.mtl");
    assert_true(has_warning(asset, "the material library cannot be read"));
    hg_asset_destroy(asset);
}

static void test_missing_material(void **state)
{
    (void)state;
    struct hg_asset *asset =
        load_with("mtllib a b.mtl\n" CORNERS "f 1 2 3\nusemtl m\nf 1 2 3\nusemtl M\nf 1 3 4\n",
            "newmtl m\nKd 1 0 0\n");
    assert_int_equal(asset->warning_count, 1);
    assert_string_equal(asset->warnings[0].where, "M");
    assert_true(has_warning(asset, "no material library defines the material"));
    hg_asset_destroy(asset);
}

static void test_far_models(void **state)
{
    (void)state;
    struct hg_asset *asset = load_text("f.obj", "v 5123456.789 100 -400000.25\nv 5123457.789 100 "
                                                "-400000.25\nv 5123456.789 101.001 -400000.25\n"
                                                "f 1 2 3\n");
    const struct hg_mesh_part *part = only_part(asset);
    const double want[9] = {5123456.789, 100, -400000.25, 5123457.789, 100, -400000.25, 5123456.789,
        101.001, -400000.25};
    for (int i = 0; i < 9; i++)
        if (fabs((double)part->positions[i] + asset->file.origin[i % 3] - want[i]) > 1e-6)
            fail_msg("%d: %.7f", i, (double)part->positions[i] + asset->file.origin[i % 3]);
    hg_asset_destroy(asset);
}

static void test_refusals(void **state)
{
    (void)state;
    expect_text_refusal("r.obj", "# nothing\n", "", "the file has no geometry");
    expect_text_refusal("r.obj", "v 1 2\n", "line 1, byte 0", "a vertex needs three numbers");
    expect_text_refusal("r.obj", CORNERS "\nf 1 2 7\n", "line 6, byte 33", "names vertex 7 of 4");
    expect_text_refusal("r.obj", CORNERS "f 1 2 0\n", "line 5, byte 32", "a corner is not");
    expect_text_refusal("r.obj", CORNERS "f 1 2 -5\n", "line 5, byte 32", "a corner is not");
    expect_text_refusal("r.obj", CORNERS "f 1 2 3a\n", "line 5, byte 32", "a corner is not");
    expect_refusal("r.obj",
        "\x7f"
        "ELF\0\0",
        6, HG_E_FORMAT, "byte 4", "not a Wavefront OBJ file");
}

// A star of many corners is cut in no time, and so is one that crosses itself.
static void test_large_polygons(void **state)
{
    (void)state;
    enum { N = 3000 };
    char *text = malloc(N * 80);
    double area = 0;
    size_t n = 0;
    for (int i = 0; i < N; i++) {
        const double r = i % 2 ? 1 : 2, a = 6.283185307179586 * i / N;
        n += (size_t)snprintf(text + n, 64, "v %.9f %.9f 0\n", r * cos(a), r * sin(a));
        area += sin(6.283185307179586 / N); // r * r' * sin / 2, with r r' = 2
    }
    n += (size_t)snprintf(text + n, 8, "f");
    for (int i = 1; i <= N; i++)
        n += (size_t)snprintf(text + n, 8, " %d", i);
    struct hg_asset *asset = load_text("p.obj", text);
    uint32_t negative;
    assert_int_equal(only_part(asset)->index_count, (N - 2) * 3);
    assert_float_equal(area_z(only_part(asset), &negative), area, 1e-3);
    assert_int_equal(negative, 0);
    hg_asset_destroy(asset);
    free(text);
    asset = load_text("x.obj", "v 0 0 0\nv 2 2 0\nv 2 0 0\nv 0 2 0\nv -3 1 0\nf 1 2 3 4 5\n");
    assert_int_equal(only_part(asset)->index_count, 9);
    hg_asset_destroy(asset);
}

static void test_every_prefix(void **state)
{
    (void)state;
    static const char text[] = "mtllib a.mtl\no q\n" CORNERS "vt 0 1\nvn 0 0 1\ns 1\nusemtl m\n"
                               "f 1/1/1 2/1/1 3//1 \\\n4\nl 1 2\np 3\nf -1 -2 -3\n";
    assert_true(load_prefixes("x.obj", text, strlen(text)) > 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_white_space),
        cmocka_unit_test(test_groups_and_materials), cmocka_unit_test(test_concave_face),
        cmocka_unit_test(test_lines_and_points), cmocka_unit_test(test_smoothing_groups),
        cmocka_unit_test(test_material_keys), cmocka_unit_test(test_texture_options),
        cmocka_unit_test(test_missing_library), cmocka_unit_test(test_missing_material),
        cmocka_unit_test(test_far_models), cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_large_polygons), cmocka_unit_test(test_every_prefix)};
    return cmocka_run_group_tests_name("scene_obj", tests, NULL, NULL);
}
