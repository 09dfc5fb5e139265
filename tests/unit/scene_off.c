// scene_off.c - the OFF reader.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "tests/unit/scene_files.h"

static const char square[] = "OFF # a comment\n# another\n\n5 2 0\n0 0 0\n1 0 0\n\n1 2 0 # here\n"
                             "0 2 0\n9 9 9\n4  0 1 2 3  255 0 0\n2 0 1\n";

static void expect_square(const struct hg_asset *asset)
{
    uint32_t negative;
    const struct hg_mesh_part *part = only_part(asset);
    assert_int_equal(part->vertex_count, 4);
    assert_float_equal(area_z(part, &negative), 2, 0);
    assert_int_equal(negative, 0);
    assert_string_equal(asset->file.format, "off");
    assert_true(part->material->double_sided);
}

static void test_faces(void **state)
{
    (void)state;
    struct hg_asset *asset = load_text("a.off", square);
    expect_square(asset);
    assert_true(has_warning(asset, "colours of faces"));
    hg_asset_destroy(asset);
    asset = load_text("b.off", "OFF4 1 0\n0 0 0\n1 0 0\n1 2 0\n0 2 0\n4 0 1 2 3\n");
    expect_square(asset);
    assert_int_equal(asset->warning_count, 0);
    hg_asset_destroy(asset);
}

static void test_vertex_data(void **state)
{
    (void)state;
    static const char *const colors[] = {"255 128 0", "1 0.50196 0 1", "255 128 0 128"};
    for (int i = 0; i < 3; i++) {
        char text[512];
        snprintf(text, sizeof text,
            "STCNOFF\n3 1 0\n0 0 0 0 0 1 %s 0 0.25\n1 0 0 0 0 1 %s 0 0\n0 1 0 0 0 1 %s 0 0\n"
            "3 0 1 2\n",
            colors[i], colors[i], colors[i]);
        struct hg_asset *asset = load_text("v.off", text);
        const struct hg_mesh_part *part = only_part(asset);
        expect_vector(part->colors, (const float[]){1, 0.21586f, 0, 1}, 4, 1e-4f);
        expect_vector(part->normals, (const float[]){0, 0, 1}, 3, 0);
        expect_vector(part->uv[0], (const float[]){0, 0.75f}, 2, 0);
        hg_asset_destroy(asset);
    }
    struct hg_asset *cloud = load_text("p.off", "OFF\n2 0 0\n0 0 0\n5000000.25 1 1\n");
    assert_int_equal(only_part(cloud)->topology, HG_TOPOLOGY_POINTS);
    hg_asset_destroy(cloud);
}

static void test_refusals(void **state)
{
    (void)state;
    expect_text_refusal("r.off", "offset\n", "line 1, byte 0", "does not begin with \"OFF\"");
    expect_text_refusal("r.off", "OFF\n30000000 1 0\n0 0 0\n", "line 2, byte 4",
        "30000000 vertices do not fit in the 7 bytes");
    expect_text_refusal("r.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n", "line 6, byte 28",
        "no vertex of the file");
    expect_text_refusal("r.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 x\n3 0 1 2\n", "line 5, byte 22",
        "the numbers of a vertex");
    expect_refusal("r.off", "OFF BINARY\n\1\2", 13, HG_E_UNSUPPORTED, "line 1, byte 4", "binary");
}

static void test_every_prefix(void **state)
{
    (void)state;
    assert_int_equal(load_prefixes("x.off", square, strlen(square)), 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_faces),
        cmocka_unit_test(test_vertex_data), cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_every_prefix)};
    return cmocka_run_group_tests_name("scene_off", tests, NULL, NULL);
}
