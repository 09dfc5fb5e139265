// scene_fingerprint.c - equal content gives equal hashes wherever it lies; every change another
// one.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "renderer/scene/fetch.h"
#include "renderer/scene/fingerprint.h"
#include "renderer/scene/load.h"
#include "tests/support/check.h"
#include "tests/support/folder.h"
#include "scene_memory.h"

#define KNOT TEST_MODELS "/knot"

struct made {
    struct hg_scene *scene;
    struct hg_fingerprint *fingerprint;
    uint8_t hash[32];
};

static void hash(struct made *m, uint8_t out[32])
{
    struct hg_error err = {0};
    hg_scene_update(m->scene);
    test_ok(hg_fingerprint_scene(m->fingerprint, m->scene, out, &err), &err);
}

static struct made made_of(struct hg_asset *asset)
{
    struct made m;
    assert_int_equal(hg_scene_create(&m.scene), HG_OK);
    assert_int_equal(hg_scene_add_asset(m.scene, asset, NULL), HG_OK);
    hg_scene_publish(m.scene);
    m.fingerprint = hg_fingerprint_create();
    assert_non_null(m.fingerprint);
    hash(&m, m.hash);
    return m;
}

static struct made load_by(const struct hg_load_params *params)
{
    struct hg_asset *asset;
    struct hg_error err = {0};
    test_ok(hg_load_asset(params, &asset, &err), &err);
    return made_of(asset);
}

static struct made load(const char *path, uint32_t number)
{
    return load_by(
        &(struct hg_load_params){.path = path, .asset_number = number, .scene_index = -1});
}

static void drop(struct made *m)
{
    hg_fingerprint_destroy(m->fingerprint);
    hg_scene_destroy(m->scene);
}

// The scene has changed: so has its hash, and what is remembered gives the same as a fresh look.
static void assert_changed(struct made *m, uint8_t before[32])
{
    uint8_t now[32], fresh[32];
    struct made other = {m->scene, hg_fingerprint_create(), {0}};
    hash(m, now);
    assert_non_null(other.fingerprint);
    hash(&other, fresh);
    hg_fingerprint_destroy(other.fingerprint);
    assert_memory_equal(now, fresh, 32);
    assert_memory_not_equal(now, before, 32);
    memcpy(before, now, 32);
}

static void copy(const char *folder)
{
    char command[2500];
    snprintf(command, sizeof command, "cp '%s/'* '%s'", KNOT, folder);
    assert_int_equal(system(command), 0);
}

static void test_place_does_not_count(void **state)
{
    (void)state;
    struct made a = load(KNOT "/knot.gltf", 1);
    struct made b = load(KNOT "/knot.gltf", 77);
    assert_memory_equal(a.hash, b.hash, 32);
    char folder[TEST_FOLDER_MAX], path[TEST_FOLDER_MAX + 32];
    assert_true(test_folder_make(folder, "fingerprint"));
    copy(folder);
    snprintf(path, sizeof path, "%s/knot.gltf", folder);
    struct made c = load(path, 1);
    assert_memory_equal(a.hash, c.hash, 32);
    drop(&c);
    snprintf(path, sizeof path, "%s/knot.png", folder); // one byte more of its image
    FILE *image = fopen(path, "ab");
    assert_non_null(image);
    fputc(0, image);
    fclose(image);
    snprintf(path, sizeof path, "%s/knot.gltf", folder);
    c = load(path, 1);
    assert_memory_not_equal(a.hash, c.hash, 32);
    drop(&c);
    assert_true(test_folder_remove(folder));
    drop(&a);
    drop(&b);
}

// As of clients that send their files: user is the folder.
static enum hg_status fetch_sent(
    void *user, const char *uri, uint64_t limit_bytes, struct hg_refbuf **out, struct hg_error *err)
{
    char path[2048];
    snprintf(path, sizeof path, "%s/%s", (const char *)user, uri);
    return hg_fetch_read(path, limit_bytes, out, err);
}

// Files beside the scene's and files that were sent, of which the worker has the bytes alone.
static void test_sent_files(void **state)
{
    (void)state;
    char folder[] = KNOT;
    struct made a = load(KNOT "/knot.gltf", 1);
    struct made b = load_by(&(struct hg_load_params){.path = "knot.gltf",
        .asset_number = 1,
        .scene_index = -1,
        .fetch = fetch_sent,
        .fetch_user = folder});
    assert_memory_equal(a.hash, b.hash, 32);
    drop(&a);
    drop(&b);
}

static void test_changes(void **state)
{
    (void)state;
    struct made m = load(TEST_MODELS "/worm.glb", 1);
    struct hg_asset *asset = m.scene->assets[0];
    uint8_t before[32];
    memcpy(before, m.hash, 32);
    assert_int_equal(hg_asset_pose(asset, -1, 0.3), HG_OK);
    hg_scene_publish(m.scene);
    assert_changed(&m, before);
    asset->materials[0]->roughness *= 0.5f;
    hg_scene_touch(m.scene, &asset->materials[0]->head);
    hg_scene_publish(m.scene);
    assert_changed(&m, before);
    asset->meshes[0]->parts[0].positions[0] += 1;
    hg_scene_touch(m.scene, &asset->meshes[0]->head);
    hg_scene_publish(m.scene);
    assert_changed(&m, before);
    m.scene->environment.intensity = 0.5f;
    assert_changed(&m, before);
    for (uint32_t i = 0; i < asset->node_count; i++)
        if (asset->nodes[i]->mesh)
            asset->nodes[i]->visible = false;
    assert_changed(&m, before);
    drop(&m);
}

// Frame keys of films that are half rendered contain the fingerprint: what a material that states
// hardly anything hashes to is stored.
static void test_stored(void **state)
{
    static const uint8_t stored[8] = {0x76, 0x33, 0xb7, 0xe5, 0xf4, 0x31, 0x98, 0x8c};
    static struct memory_gltf file;
    (void)state;
    (void)memory_floats(&file, "VEC3", 3, (const float[]){0, 0, 0, 1, 0, 0, 0, 1, 0}, 36);
    struct made m = made_of(memory_load_ok(&file,
        "\"extensionsUsed\":[\"KHR_materials_volume\"],\"materials\":[{},{\"extensions\":"
        "{\"KHR_materials_volume\":{\"attenuationDistance\":2}}}],\"meshes\":[{\"primitives\":["
        "{\"attributes\":{\"POSITION\":0},\"material\":0},"
        "{\"attributes\":{\"POSITION\":0},\"material\":1}]}],\"nodes\":[{\"mesh\":0}],"
        "\"scenes\":[{\"nodes\":[0]}],\"scene\":0"));
    assert_memory_equal(m.hash, stored, sizeof stored);
    drop(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_stored),
        cmocka_unit_test(test_place_does_not_count),
        cmocka_unit_test(test_sent_files),
        cmocka_unit_test(test_changes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
