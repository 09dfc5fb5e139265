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

#include "renderer/scene/load.h"

static char folder[64];

static void path_of(const char *name, char *out, size_t size)
{
    snprintf(out, size, "%s/%s", folder, name);
}

static void write_text(const char *name, const char *text)
{
    char path[128];
    path_of(name, path, sizeof path);
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fputs(text, file);
    assert_int_equal(fclose(file), 0);
}

static int make_files(void **state)
{
    (void)state;
    char source[128], path[128];
    strcpy(folder, "/tmp/helio-import-XXXXXX");
    assert_non_null(mkdtemp(folder));
    write_text("box.mtl", "newmtl red\nKd 0.8 0.1 0.1\nNs 98\n");
    // A box of 2 x 3 x 4 m with its corner at the origin: eight vertices, six quads.
    write_text("box.obj",
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
    char command[128];
    snprintf(command, sizeof command, "rm -rf %s", folder);
    return system(command);
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
        write_text(names[i], "neither this nor that\n");
        assert_int_not_equal(load(names[i], &asset, &err), HG_OK);
        assert_null(asset);
        assert_true(err.reason[0] != 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_obj),
        cmocka_unit_test(test_phong_exponent_becomes_roughness),
        cmocka_unit_test(test_stl),
        cmocka_unit_test(test_ply),
        cmocka_unit_test(test_collada),
        cmocka_unit_test(test_fbx),
        cmocka_unit_test(test_broken_files_are_refused_with_a_reason),
    };
    return cmocka_run_group_tests_name("scene_import", tests, make_files, remove_files);
}
