// scene_ply.c - the PLY reader: encodings, properties, faces of every kind, points, far models, and
// files that are refused.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdlib.h>

#include "base/bytes.h"
#include "tests/unit/scene_files.h"

#define XYZ(type) "property " type " x\nproperty " type " y\nproperty " type " z\n"
#define FACES(n)  "element face " #n "\nproperty list uchar int vertex_indices\nend_header\n"

static const char square[] =
    "ply\nformat ascii 1.0\ncomment made here\nobj_info nothing\n"
    "element vertex 4\n" XYZ("float") FACES(1) "0 0 0\n1 0 0\n1 2 0\n0 2 0\n4 0 1 2 3\n";

static void write_value(struct hg_writer *w, bool big, const void *value, size_t size)
{
    const uint8_t *bytes = value;
    for (size_t i = 0; i < size; i++)
        hg_write_u8(w, bytes[big ? size - 1 - i : i]);
}

// A square in either byte order, of double coordinates, with 16-bit colours, an element and
// properties that are not read, and lists of all sorts.
static struct hg_writer binary_square(bool big, const char *line_end)
{
    static const char head[] = "ply|format binary_%s_endian 1.0|element camera 1|"
                               "property float view_px|property list uint8 uint16 marks|"
                               "element vertex 4|property double x|property uchar quality|"
                               "property float64 y|property float64 z|property list int8 int8 tags|"
                               "property ushort red|property ushort green|property ushort blue|"
                               "element face 2|property uchar flags|"
                               "property list uint int32 vertex_index|end_header|";
    char text[1024];
    struct hg_writer w = {0};
    snprintf(text, sizeof text, head, big ? "big" : "little");
    for (const char *p = text; *p; p++)
        hg_write_bytes(&w, *p == '|' ? line_end : p, *p == '|' ? strlen(line_end) : 1);
    const float view = 7;
    write_value(&w, big, &view, 4);
    hg_write_u8(&w, 2);
    hg_write_u32(&w, 0x01020304);
    for (int i = 0; i < 4; i++) {
        const double p[3] = {i == 1 || i == 2, i >= 2 ? 2 : 0, 0};
        const uint16_t rgb[3] = {65535, 0, (uint16_t)(i * 13107)};
        write_value(&w, big, &p[0], 8);
        hg_write_u8(&w, 9);
        write_value(&w, big, &p[1], 8);
        write_value(&w, big, &p[2], 8);
        hg_write_u8(&w, (uint8_t)i);
        for (int k = 0; k < i; k++)
            hg_write_u8(&w, 0xff);
        for (int c = 0; c < 3; c++)
            write_value(&w, big, &rgb[c], 2);
    }
    for (int f = 0; f < 2; f++) {
        const uint32_t count = 3, corners[2][3] = {{0, 1, 2}, {0, 2, 3}};
        hg_write_u8(&w, 1);
        write_value(&w, big, &count, 4);
        for (int c = 0; c < 3; c++)
            write_value(&w, big, &corners[f][c], 4);
    }
    return w;
}

static void expect_square(const struct hg_asset *asset)
{
    const struct hg_mesh_part *part = only_part(asset);
    uint32_t negative;
    assert_int_equal(part->topology, HG_TOPOLOGY_TRIANGLES);
    assert_int_equal(part->vertex_count, 4);
    assert_int_equal(part->index_count, 6);
    assert_float_equal(area_z(part, &negative), 2, 0);
    assert_int_equal(negative, 0);
    for (uint32_t v = 0; v < 4; v++)
        expect_vector(part->normals + (size_t)v * 3, (const float[]){0, 0, 1}, 3, 1e-6f);
    assert_true(part->material->double_sided);
}

static void test_ascii(void **state)
{
    (void)state;
    struct hg_asset *asset = load_text("a.ply", square);
    expect_square(asset);
    assert_string_equal(asset->file.format, "ply");
    assert_int_equal(asset->warning_count, 0);
    hg_asset_destroy(asset);
}

static void test_binary(void **state)
{
    (void)state;
    static const char *const ends[] = {"\n", "\r\n", "\r"};
    for (int i = 0; i < 6; i++) {
        struct hg_writer w = binary_square(i % 2, ends[i / 2]);
        struct hg_asset *asset = load_bytes("b.ply", w.data, w.size);
        expect_square(asset);
        const struct hg_mesh_part *part = only_part(asset);
        const uint32_t third = part->indices[2];
        // 26214 of 65535 in sRGB
        expect_vector(
            part->colors + (size_t)third * 4, (const float[]){1, 0, 0.13287f, 1}, 4, 1e-4f);
        hg_asset_destroy(asset);
        hg_writer_finish(&w);
    }
}

static void test_colors(void **state)
{
    (void)state;
    static const char *const types[] = {"uchar", "float", "int", "float"}, *const values[] = {
                                                                               "128 255 0",
                                                                               "0.50196 1 0",
                                                                               "128 255 0",
                                                                               "128 255 0"};
    for (int i = 0; i < 4; i++) {
        char text[512];
        snprintf(text, sizeof text,
            "ply\nformat ascii 1.0\nelement vertex 2\n" XYZ(
                "float") "property %s red\nproperty %s "
                         "green\nproperty %s blue\nend_header\n0 0 0 %s\n1 1 1 %s\n",
            types[i], types[i], types[i], values[i], values[i]);
        struct hg_asset *asset = load_text("c.ply", text);
        const struct hg_mesh_part *part = only_part(asset);
        expect_vector(part->colors + 4, (const float[]){0.21586f, 1, 0, 1}, 4, 1e-4f);
        expect_vector(part->material->base_color, (const float[]){1, 1, 1, 1}, 4, 0);
        hg_asset_destroy(asset);
    }
}

// Vertices without faces are points; those without a place are left out.
static void test_points(void **state)
{
    (void)state;
    struct hg_asset *asset = load_text("p.ply",
        "ply\nformat ascii 1.0\nelement vertex 3\n" XYZ(
            "float") "property float nx\nproperty float ny\nproperty float nz\n"
                     "end_header\n0 0 0 0 3 0\nnan nan nan 0 1 0\n1 2 3 0 0 -1\n");
    const struct hg_mesh_part *part = only_part(asset);
    assert_int_equal(part->topology, HG_TOPOLOGY_POINTS);
    assert_int_equal(part->vertex_count, 2);
    assert_int_equal(part->index_count, 2);
    expect_vector(part->positions + 3, (const float[]){1, 2, 3}, 3, 0);
    expect_vector(part->normals, (const float[]){0, 1, 0, 0, 0, -1}, 6, 0);
    assert_true(has_warning(asset, "1 points without a finite place"));
    hg_asset_destroy(asset);
}

static void test_faces_before_vertices(void **state)
{
    (void)state;
    struct hg_asset *asset = load_text("f.ply",
        "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_indices\n"
        "element vertex 5\n" XYZ("float") "end_header\n4 0 1 2 3\n"
                                          "0 0 0\n1 0 0\n1 2 0\n0 2 0\n900 900 900\n");
    expect_square(asset); // and the vertex that no face names is not there
    assert_float_equal(only_part(asset)->bounds_max[0], 1, 0);
    hg_asset_destroy(asset);
}

// An arrow head whose fan from the first corner would leave the polygon, at any turn of corners.
static void test_concave_polygons(void **state)
{
    (void)state;
    static const double xy[7][2] = {{0, 0}, {4, 0}, {4, 4}, {3, 1}, {2, 3}, {1, 1}, {0, 4}};
    double area = 0;
    for (int i = 0; i < 7; i++)
        area += (xy[i][0] * xy[(i + 1) % 7][1] - xy[(i + 1) % 7][0] * xy[i][1]) / 2;
    for (int turn = 0; turn < 7; turn++) {
        char text[1024] = "ply\nformat ascii 1.0\nelement vertex 7\n" XYZ("float") FACES(1);
        for (int i = 0; i < 7; i++)
            snprintf(
                text + strlen(text), 64, "%g %g 0\n", xy[(i + turn) % 7][0], xy[(i + turn) % 7][1]);
        strcat(text, "7 0 1 2 3 4 5 6\n");
        struct hg_asset *asset = load_text("v.ply", text);
        uint32_t negative;
        assert_int_equal(only_part(asset)->index_count, 15);
        assert_float_equal(area_z(only_part(asset), &negative), area, 1e-6);
        assert_int_equal(negative, 0);
        hg_asset_destroy(asset);
    }
}

static void test_strips_and_edges(void **state)
{
    (void)state;
    struct hg_asset *asset = load_text("s.ply",
        "ply\nformat ascii 1.0\nelement vertex 6\n" XYZ(
            "float") "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
                     "0 0 0\n1 0 0\n0 1 0\n1 1 0\n0 2 0\n1 2 0\n10 0 1 2 3 -1 2 3 4 5 -1\n");
    uint32_t negative;
    assert_int_equal(only_part(asset)->index_count, 12);
    assert_float_equal(area_z(only_part(asset), &negative), 2, 0);
    assert_int_equal(negative, 0);
    hg_asset_destroy(asset);
    asset = load_text("e.ply",
        "ply\nformat ascii 1.0\nelement vertex 3\n" XYZ(
            "float") "element edge 2\nproperty int vertex1\nproperty int vertex2\n"
                     "end_header\n0 0 0\n1 0 0\n0 1 0\n0 1\n2 1\n");
    assert_int_equal(only_part(asset)->topology, HG_TOPOLOGY_LINES);
    assert_int_equal(only_part(asset)->index_count, 4);
    hg_asset_destroy(asset);
}

// Texture coordinates of faces split vertices, and v grows downwards here.
static void test_texture_coordinates(void **state)
{
    (void)state;
    struct hg_asset *asset = load_text("t.ply",
        "ply\nformat ascii 1.0\ncomment TextureFile none.png\nelement vertex 3\n" XYZ(
            "float") "element face 2\nproperty list uchar int vertex_indices\n"
                     "property list uchar float texcoord\nend_header\n0 0 0\n1 0 0\n0 1 0\n"
                     "3 0 1 2 6 0 0 1 0 0 0.25\n3 0 1 2 6 0 0 1 0 0.5 0.5\n");
    const struct hg_mesh_part *part = only_part(asset);
    assert_int_equal(part->vertex_count, 4);
    expect_vector(part->uv[0] + (size_t)part->indices[2] * 2, (const float[]){0, 0.75f}, 2, 0);
    expect_vector(part->uv[0] + (size_t)part->indices[5] * 2, (const float[]){0.5f, 0.5f}, 2, 0);
    assert_non_null(part->material->slots[HG_SLOT_BASE_COLOR].texture);
    assert_true(has_warning(asset, "white is shown instead"));
    hg_asset_destroy(asset);
}

// Millimetres five thousand kilometres away keep their size.
static void test_far_models(void **state)
{
    (void)state;
    char text[1024] = "ply\nformat ascii 1.0\nelement vertex 1000\n" XYZ("double") "end_header\n";
    char *big = malloc(100000);
    strcpy(big, text);
    for (int i = 0; i < 1000; i++)
        sprintf(big + strlen(big), "%.3f %.3f 100\n", 5123456.789 + i * 0.001, 400000 + i * 0.25);
    struct hg_asset *asset = load_text("g.ply", big);
    const struct hg_mesh_part *part = only_part(asset);
    const double *origin = asset->file.origin;
    assert_float_equal(origin[0], 5123500, 100);
    assert_true(origin[0] == floor(origin[0]) && origin[1] == floor(origin[1]));
    for (int i = 0; i < 1000; i++) {
        const double x = (double)part->positions[i * 3] + origin[0];
        if (fabs(x - (5123456.789 + i * 0.001)) > 1e-5)
            fail_msg("point %d: %.6f", i, x);
    }
    hg_asset_destroy(asset);
    free(big);
    asset = load_text("n.ply", square); // what is near is where it was
    assert_true(asset->file.origin[0] == 0 && asset->file.origin[1] == 0);
    hg_asset_destroy(asset);
}

// Two tiles of one survey lie beside each other, whatever their origins.
static void test_far_models_fit_together(void **state)
{
    (void)state;
    struct hg_scene *scene;
    float low[2][3], high[2][3];
    assert_int_equal(hg_scene_create(&scene), HG_OK);
    for (int tile = 0; tile < 2; tile++) {
        char text[512];
        struct files files = {{{"t.ply", text, 0}}};
        struct hg_asset *asset;
        struct hg_error err;
        const double x = 5123000 + tile * 100;
        snprintf(text, sizeof text,
            "ply\nformat ascii 1.0\nelement vertex 2\n" XYZ(
                "double") "end_header\n"
                          "%.3f 4e6 7\n%.3f 4000050 9\n",
            x, x + 100);
        files.list[0].size = strlen(text);
        assert_int_equal(hg_load_asset(&(struct hg_load_params){.path = "t.ply",
                                           .fetch = files_fetch,
                                           .fetch_user = &files,
                                           .asset_number = (uint32_t)tile + 1,
                                           .scene_index = -1},
                             &asset, &err),
            HG_OK);
        assert_int_equal(hg_scene_add_asset(scene, asset, NULL), HG_OK);
        hg_scene_update(scene);
        assert_true(hg_scene_bounds(scene, asset->roots[0], low[tile], high[tile]));
    }
    expect_vector(low[1], (const float[]){high[0][0], low[0][1], low[0][2]}, 3, 1e-3f);
    assert_float_equal(high[1][0] - low[0][0], 200, 1e-3f);
    hg_scene_destroy(scene);
}

static void test_counts_are_checked_before_memory(void **state)
{
    (void)state;
    expect_text_refusal("30.ply",
        "ply\nformat binary_little_endian 1.0\nelement vertex 30000000\n" XYZ(
            "float") "end_header\n0123456789ab",
        "line 3, byte 44", "30000000 elements of at least 12 bytes do not fit in the 12 bytes");
    expect_text_refusal("l.ply",
        "ply\nformat ascii 1.0\nelement vertex 1\n" XYZ(
            "float") "property list int int many\nend_header\n0 0 0 2000000 1\n",
        "line 9, byte 133", "a list of 2000000 values");
}

static void test_refusals(void **state)
{
    (void)state;
    expect_text_refusal("r.ply", "plywood\n", "line 1, byte 0", "does not begin with \"ply\"");
    expect_text_refusal(
        "r.ply", "ply\nelement vertex many\n", "line 2, byte 12", "without a count");
    expect_text_refusal(
        "r.ply", "ply\nelement vertex 1\nproperty long x\n", "line 3, byte 30", "no known type");
    expect_text_refusal("r.ply", "ply\nformat ascii 1.0\nelement vertex 0\nend_header\n",
        "line 1, byte 0", "no element vertex with properties x, y and z");
    expect_text_refusal("r.ply",
        "ply\nformat ascii 1.0\nelement vertex 0\n" XYZ("float") "end_header\n", "", "no geometry");
    expect_text_refusal("r.ply",
        "ply\nformat ascii 1.0\nelement vertex 3\n" XYZ("float")
            FACES(1) "0 0 0 1 0 0 0 1,5 0\n3 0 1 2\n",
        "line 10, byte 168", "a number of a vertex was expected");
    expect_text_refusal("r.ply",
        "ply\nformat ascii 1.0\nelement vertex 3\n" XYZ("float")
            FACES(1) "0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n",
        "line 13, byte 178", "a face names vertex 3 of 3");
}

static void test_every_prefix(void **state)
{
    (void)state;
    // 0 1 2 alone is no face of four; without the last line end the file is whole
    assert_int_equal(load_prefixes("x.ply", square, strlen(square)), 2);
    struct hg_writer w = binary_square(true, "\n");
    assert_int_equal(load_prefixes("x.ply", w.data, w.size), 1);
    hg_writer_finish(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_ascii), cmocka_unit_test(test_binary),
        cmocka_unit_test(test_colors), cmocka_unit_test(test_points),
        cmocka_unit_test(test_faces_before_vertices), cmocka_unit_test(test_concave_polygons),
        cmocka_unit_test(test_strips_and_edges), cmocka_unit_test(test_texture_coordinates),
        cmocka_unit_test(test_far_models), cmocka_unit_test(test_far_models_fit_together),
        cmocka_unit_test(test_counts_are_checked_before_memory), cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_every_prefix)};
    return cmocka_run_group_tests_name("scene_ply", tests, NULL, NULL);
}
