// scene_stl.c - the STL reader: texts of several solids, binary files in disguise, colours of both
// conventions, and files that are refused.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "base/bytes.h"
#include "tests/unit/scene_files.h"

#define FACET(a, b, c)                                                                             \
    "facet normal 0 0 0\n outer loop\n  vertex " a "\n  vertex " b "\n  vertex " c                 \
    "\n endloop\nendfacet\n"

static const char two_solids[] =
    "solid nothing\nendsolid nothing\n"
    "SOLID  first one\n" FACET("0 0 0", "1 0 0", "1 2 0") FACET("0 0 0", "1 2 0",
        "0 2 0") "endsolid first one\n\nsolid\nendsolid\nsolid solid\n" FACET("0 0 5", "1e0 0 5",
        "0 1 +5.0") "endsolid solid\n";

static void test_solids(void **state)
{
    (void)state;
    struct hg_asset *asset = load_text("a.stl", two_solids);
    uint32_t negative;
    assert_int_equal(asset->mesh_count, 2);
    assert_string_equal(asset->meshes[0]->head.name, "first one");
    assert_string_equal(asset->meshes[1]->head.name, "solid");
    const struct hg_mesh_part *part = asset->meshes[0]->parts;
    assert_int_equal(part->vertex_count, 4); // corners at one place are one vertex
    assert_int_equal(part->index_count, 6);
    assert_float_equal(area_z(part, &negative), 2, 0);
    expect_vector(part->normals, (const float[]){0, 0, 1}, 3, 1e-6f);
    assert_true(part->material->double_sided);
    assert_float_equal(asset->meshes[1]->parts->bounds_max[2], 5, 0);
    assert_int_equal(asset->warning_count, 1);
    assert_true(has_warning(asset, "2 solids have no facets"));
    assert_int_equal(asset->root_count, 1);
    hg_asset_destroy(asset);
}

// `bits`: the attribute of each triangle.
static struct hg_writer make_binary(
    const char *header, uint32_t count, uint32_t written, const uint16_t *bits)
{
    static const float corners[2][9] = {{0, 0, 0, 1, 0, 0, 1, 2, 0}, {0, 0, 0, 1, 2, 0, 0, 2, 0}};
    struct hg_writer w = {0};
    char head[80] = {0};
    memcpy(head, header, strlen(header));
    hg_write_bytes(&w, head, sizeof head);
    hg_write_u32(&w, count);
    for (uint32_t t = 0; t < written; t++) {
        for (int i = 0; i < 3; i++)
            hg_write_f32(&w, 0);
        for (int i = 0; i < 9; i++)
            hg_write_f32(&w, corners[t % 2][i]);
        hg_write_u16(&w, bits ? bits[t % 2] : 0);
    }
    return w;
}

static void test_binary(void **state)
{
    (void)state;
    static const char *const headers[] = {
        "made by a program", "solid in name only", "solid\nfacet of another kind"};
    for (int i = 0; i < 3; i++) {
        struct hg_writer w = make_binary(headers[i], 2, 2, NULL);
        struct hg_asset *asset = load_bytes("b.stl", w.data, w.size);
        uint32_t negative;
        assert_int_equal(only_part(asset)->vertex_count, 4);
        assert_float_equal(area_z(only_part(asset), &negative), 2, 0);
        assert_null(only_part(asset)->colors);
        assert_int_equal(asset->warning_count, 0);
        hg_asset_destroy(asset);
        hg_writer_finish(&w);
    }
    struct hg_writer w = make_binary("solid with a tail", 1, 2, NULL);
    struct hg_asset *asset = load_bytes("b.stl", w.data, w.size);
    assert_int_equal(only_part(asset)->index_count, 3);
    assert_true(has_warning(asset, "50 bytes behind the last triangle"));
    hg_asset_destroy(asset);
    hg_writer_finish(&w);
}

static void expect_color(const struct hg_mesh_part *part, uint32_t corner, const float want[3])
{
    expect_vector(part->colors + (size_t)part->indices[corner] * 4, want, 3, 1e-3f);
}

static void test_colors(void **state)
{
    (void)state;
    // VisCAM: bit 15 says that there is a colour; red is highest.
    const uint16_t viscam[2] = {0x8000 | 31 << 10, 31};
    struct hg_writer w = make_binary("plain", 2, 2, viscam);
    struct hg_asset *asset = load_bytes("c.stl", w.data, w.size);
    assert_int_equal(only_part(asset)->vertex_count, 6); // two colours share no vertex
    expect_color(only_part(asset), 0, (const float[]){1, 0, 0});
    expect_color(only_part(asset), 3, (const float[]){0.6f, 0.6f, 0.6f});
    hg_asset_destroy(asset);
    hg_writer_finish(&w);
    // Magics: it says that there is none but that of the header; red is lowest.
    const uint16_t magics[2] = {31, 0x8000};
    w = make_binary("COLOR=\x80\xff\x01\xff,MATERIAL=", 2, 2, magics);
    asset = load_bytes("c.stl", w.data, w.size);
    expect_color(only_part(asset), 0, (const float[]){1, 0, 0});
    expect_color(only_part(asset), 3, (const float[]){0.21586f, 1, 0.0003f});
    hg_asset_destroy(asset);
    hg_writer_finish(&w);
}

static void test_refusals(void **state)
{
    (void)state;
    struct hg_writer w = make_binary("30 million", 30000000, 1, NULL);
    expect_refusal("r.stl", w.data, w.size, HG_E_FORMAT, "byte 80",
        "30000000 triangles of 50 bytes do not fit in the 50 bytes");
    hg_writer_finish(&w);
    expect_text_refusal("r.stl", "solid a\nendsolid a\n", "", "the file has no geometry");
    expect_text_refusal("r.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0\nvertex",
        "line 5, byte 49", "a vertex needs three numbers");
    expect_text_refusal("r.stl", "solid a\n" FACET("0 0 0", "1 0 0", "0 1 0") "facet\n",
        "line 10, byte 108", "the file ends inside a facet");
    expect_text_refusal("r.stl", "solid a\nfacet normal 0 0 1\nendsolid\n", "line 3, byte 27",
        "\"endfacet\" was expected");
    expect_text_refusal("r.stl", "solid a\n" FACET("0 0 0", "1 0 0", "0 1 0") "endsolid\nsold\n",
        "line 10, byte 111", "\"solid\" was expected");
    expect_text_refusal("r.stl", "neither this nor that\n", "byte 22", "not an STL file");
}

static void test_a_missing_end_is_a_warning(void **state)
{
    (void)state;
    struct hg_asset *asset = load_text("m.stl", "solid a\n" FACET("0 0 0", "1 0 0", "0 1 0"));
    assert_int_equal(only_part(asset)->index_count, 3);
    assert_true(has_warning(asset, "ends without \"endsolid\""));
    hg_asset_destroy(asset);
}

static void test_every_prefix(void **state)
{
    (void)state;
    assert_true(load_prefixes("x.stl", two_solids, strlen(two_solids)) > 0);
    struct hg_writer w = make_binary("solid x", 2, 2, NULL);
    assert_int_equal(load_prefixes("x.stl", w.data, w.size), 1);
    hg_writer_finish(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_solids), cmocka_unit_test(test_binary),
        cmocka_unit_test(test_colors), cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_a_missing_end_is_a_warning), cmocka_unit_test(test_every_prefix)};
    return cmocka_run_group_tests_name("scene_stl", tests, NULL, NULL);
}
