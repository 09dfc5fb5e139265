// worker_link.c - sessions, edits, files and what is refused, spoken to a real helio-worker.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <errno.h>
#include <linux/magic.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/vfs.h>
#include <unistd.h>

#include "base/sha256.h"
#include "tests/system/worker_link_rig.h"

// ---- tests --------------------------------------------------------------------------------------

static void test_channels_without_a_session_are_refused(void **state)
{
    struct rig *rig = *state;
    link_expect_error(
        rig, link_ask(rig, 7, HGP_T_batch_begin, &(struct hgp_batch_begin){0}), HG_E_STATE, NULL);
}

static void test_malformed_payload_names_the_field(void **state)
{
    struct rig *rig = *state;
    link_attach(rig, 1, "a");
    // light_set whose `kind` is no light: u64 id, u32 presence bits come first in some order, so
    // the bytes are made by the codec and then broken at the end, where the enum value stands.
    struct hg_writer w = {0};
    struct hgp_light_set m = {.light = FIRST_ID, .has_kind = true, .kind = HGP_light_kind_SPOT};
    assert_int_equal(
        hgp_encode(&w, HGP_VERSION_MAX, (struct hgp_envelope){HGP_T_light_set, 99, 1}, &m, NULL),
        HG_OK);
    w.data[w.size - 1] = 0x7f;
    link_write(rig->fd, w.data, w.size);
    hg_writer_finish(&w);
    link_expect_error(rig, 99, HG_E_INVAL, "kind");
}

static void test_ids_stay_in_the_sessions_range(void **state)
{
    struct rig *rig = *state;
    link_attach(rig, 1, "a");
    struct hgp_light_set inside = {.light = FIRST_ID + ID_COUNT - 1};
    struct hgp_light_set outside = {.light = FIRST_ID + ID_COUNT};
    link_expect(rig, link_ask(rig, 1, HGP_T_light_set, &inside), HGP_T_ok);
    link_expect_error(rig, link_ask(rig, 1, HGP_T_light_set, &outside), HG_E_NOTFOUND, NULL);
}

static void test_sessions_with_one_key_share_the_scene(void **state)
{
    struct rig *rig = *state;
    link_attach(rig, 1, "shared");
    link_attach(rig, 2, "shared");
    link_attach(rig, 3, "other");
    struct hgp_node_set make = {.node = FIRST_ID, .has_name = true, .name = hgp_str_make("lamp")};
    link_expect(rig, link_ask(rig, 1, HGP_T_node_set, &make), HGP_T_ok);
    uint64_t revision = rig->message.ok.revision;
    struct hgp_nodes_query all = {.count = 10};
    link_expect(rig, link_ask(rig, 2, HGP_T_nodes_query, &all), HGP_T_nodes);
    assert_int_equal(rig->message.nodes.revision, revision);
    assert_int_equal(rig->message.nodes.total, 1);
    assert_memory_equal(rig->message.nodes.nodes.items[0].name.data, "lamp", 4);
    link_expect(rig, link_ask(rig, 3, HGP_T_nodes_query, &all), HGP_T_nodes);
    assert_int_equal(rig->message.nodes.total, 0);
}

static void test_a_batch_is_one_revision(void **state)
{
    struct rig *rig = *state;
    link_attach(rig, 1, "a");
    link_expect(rig, link_ask(rig, 1, HGP_T_batch_begin, &(struct hgp_batch_begin){0}), HGP_T_ok);
    uint64_t before = rig->message.ok.revision;
    for (uint64_t i = 0; i < 5; i++)
        link_expect(rig,
            link_ask(rig, 1, HGP_T_node_set, &(struct hgp_node_set){.node = FIRST_ID + i}),
            HGP_T_ok);
    assert_int_equal(rig->message.ok.revision, before);
    link_expect(rig, link_ask(rig, 1, HGP_T_batch_end, &(struct hgp_batch_end){0}), HGP_T_ok);
    assert_int_equal(rig->message.ok.revision, before + 1);
    link_expect_error(
        rig, link_ask(rig, 1, HGP_T_batch_end, &(struct hgp_batch_end){0}), HG_E_STATE, NULL);
}

static void test_refused_edits_change_nothing(void **state)
{
    struct rig *rig = *state;
    link_attach(rig, 1, "a");
    struct hgp_node_set parent = {.node = FIRST_ID},
                        child = {.node = FIRST_ID + 1, .has_parent = true, .parent = FIRST_ID};
    link_expect(rig, link_ask(rig, 1, HGP_T_node_set, &parent), HGP_T_ok);
    link_expect(rig, link_ask(rig, 1, HGP_T_node_set, &child), HGP_T_ok);
    uint64_t revision = rig->message.ok.revision;
    struct hgp_node_set cycle = {.node = FIRST_ID, .has_parent = true, .parent = FIRST_ID + 1};
    struct hgp_node_set no_mesh = {.node = FIRST_ID, .has_mesh = true, .mesh = 5};
    struct hgp_node_set no_turn = {.node = FIRST_ID, .has_rotation = true};
    link_expect_error(rig, link_ask(rig, 1, HGP_T_node_set, &cycle), HG_E_INVAL, "parent");
    link_expect_error(rig, link_ask(rig, 1, HGP_T_node_set, &no_mesh), HG_E_NOTFOUND, "mesh");
    link_expect_error(rig, link_ask(rig, 1, HGP_T_node_set, &no_turn), HG_E_INVAL, "rotation");
    link_expect(rig, link_ask(rig, 1, HGP_T_nodes_query, &(struct hgp_nodes_query){.count = 9}),
        HGP_T_nodes);
    assert_int_equal(rig->message.nodes.revision, revision);
}

static void test_client_meshes_are_checked_and_bounded(void **state)
{
    struct rig *rig = *state;
    link_attach(rig, 1, "a");
    float corners[] = {0, 0, 0, 2, 0, 0, 0, 3, 0};
    uint32_t good[] = {0, 1, 2}, bad[] = {0, 1, 3};
    struct hgp_mesh_part part = {
        .mode = HGP_primitive_mode_TRIANGLES,
        .positions = {(const uint8_t *)corners, sizeof corners},
        .indices = {(const uint8_t *)bad, sizeof bad},
    };
    struct hgp_mesh_set m = {.mesh = FIRST_ID};
    m.parts.items = &part;
    m.parts.count = 1;
    link_expect_error(rig, link_ask(rig, 1, HGP_T_mesh_set, &m), HG_E_INVAL, "indices");
    part.indices.data = (const uint8_t *)good;
    link_expect(rig, link_ask(rig, 1, HGP_T_mesh_set, &m), HGP_T_ok);
    struct hgp_node_set node = {.node = FIRST_ID,
        .has_mesh = true,
        .mesh = FIRST_ID,
        .has_translation = true,
        .translation = {10, 0, 0}};
    link_expect(rig, link_ask(rig, 1, HGP_T_node_set, &node), HGP_T_ok);
    link_expect(
        rig, link_ask(rig, 1, HGP_T_bounds_query, &(struct hgp_bounds_query){0}), HGP_T_bounds);
    assert_false(rig->message.bounds.empty);
    assert_float_equal(rig->message.bounds.min[0], 10, 1e-6);
    assert_float_equal(rig->message.bounds.max[0], 12, 1e-6);
    assert_float_equal(rig->message.bounds.max[1], 3, 1e-6);
}

static void test_files_outside_the_roots_are_not_told_apart(void **state)
{
    struct rig *rig = *state;
    link_attach(rig, 1, "a");
    struct hgp_asset_load there = {.asset = FIRST_ID, .path = hgp_str_make("/etc/passwd")};
    struct hgp_asset_load absent = {
        .asset = FIRST_ID, .path = hgp_str_make("/etc/no-such-file.glb")};
    struct hgp_asset_load above = {.asset = FIRST_ID, .path = hgp_str_make("../../etc/passwd")};
    struct hgp_asset_load missing = {.asset = FIRST_ID, .path = hgp_str_make("missing.glb")};
    link_expect_error(rig, link_ask(rig, 1, HGP_T_asset_load, &there), HG_E_PERM, NULL);
    link_expect_error(rig, link_ask(rig, 1, HGP_T_asset_load, &absent), HG_E_PERM, NULL);
    link_expect_error(rig, link_ask(rig, 1, HGP_T_asset_load, &above), HG_E_PERM, NULL);
    link_expect_error(rig, link_ask(rig, 1, HGP_T_asset_load, &missing), HG_E_NOTFOUND, NULL);
}

// A session whose token names folders reads below these alone; what lies beside them answers as
// what lies outside of the roots does, whether it is there or not.
static void test_sessions_keep_to_their_roots(void **state)
{
    static const char file[] = "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,"
                               "\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{}]}";
    struct rig *rig = *state;
    char own[600], path[700], text[1300];
    snprintf(own, sizeof own, "%s/own", rig->root);
    assert_int_equal(mkdir(own, 0777), 0);
    test_text_write(own, "mine.gltf", file);
    test_text_write(rig->root, "beside.gltf", file);
    snprintf(path, sizeof path, "%s/link.gltf", own);
    assert_int_equal(symlink("../beside.gltf", path), 0);
    snprintf(text, sizeof text, "/no/such/folder:%s", own);
    const struct hgp_session_tenant tenant = {
        .weight = 100, .has_roots = true, .roots = hgp_str_make(text)};
    const struct {
        const char *path;
        enum hg_status status;
    } cases[] = {{"own/mine.gltf", HG_OK}, {"own/absent.gltf", HG_E_NOTFOUND},
        {"beside.gltf", HG_E_PERM}, {"absent.gltf", HG_E_PERM}, {"own/link.gltf", HG_E_PERM},
        {"own/../beside.gltf", HG_E_PERM}, {"own/../../../../etc/passwd", HG_E_PERM}};
    for (uint32_t channel = 1; channel <= 2; channel++)
        link_attach(rig, channel, "a");
    link_ask(rig, 1, HGP_T_session_tenant, &tenant); // has no answer
    for (uint32_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const struct hgp_asset_load m = {
            .asset = FIRST_ID + i, .path = hgp_str_make(cases[i].path)};
        const uint32_t request = link_ask(rig, 1, HGP_T_asset_load, &m);
        if (cases[i].status)
            link_expect_error(rig, request, cases[i].status, NULL);
        else
            link_expect(rig, request, HGP_T_asset_loaded);
    }
    const struct hgp_environment_set sky = {.has_kind = true,
        .kind = HGP_environment_kind_FILE,
        .has_path = true,
        .path = hgp_str_make("beside.hdr")};
    link_expect_error(rig, link_ask(rig, 1, HGP_T_environment_set, &sky), HG_E_PERM, NULL);
    struct hgp_asset_load m = {.asset = FIRST_ID + 1000, .path = hgp_str_make("beside.gltf")};
    link_expect(rig, link_ask(rig, 2, HGP_T_asset_load, &m), HGP_T_asset_loaded);
    // Folders that are not there let nothing in.
    m.asset++;
    link_ask(rig, 2, HGP_T_session_tenant,
        &(struct hgp_session_tenant){
            .weight = 100, .has_roots = true, .roots = hgp_str_make("/no/such/folder")});
    link_expect_error(rig, link_ask(rig, 2, HGP_T_asset_load, &m), HG_E_PERM, NULL);
}

static void expect_variants(struct rig *rig, uint32_t request)
{
    static const char known[] = "no variant 'red'; there is 'Mango Velvet', 'Peacock'";
    link_expect_error(rig, request, HG_E_NOTFOUND, "variant");
    const struct hgp_str reason = rig->message.error.reason;
    assert_int_equal(reason.size, strlen(known));
    assert_memory_equal(reason.data, known, reason.size);
}

static void test_an_unknown_variant_is_told_those_there_are(void **state)
{
    static const char chair[] =
        "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],"
        "\"nodes\":[{}],\"extensionsUsed\":[\"KHR_materials_variants\"],\"extensions\":"
        "{\"KHR_materials_variants\":{\"variants\":[{\"name\":\"Mango Velvet\"},"
        "{\"name\":\"Peacock\"}]}}}";
    struct rig *rig = *state;
    link_attach(rig, 1, "a");
    test_text_write(rig->root, "chair.gltf", chair);
    struct hgp_asset_load load = {.asset = FIRST_ID,
        .path = hgp_str_make("chair.gltf"),
        .has_variant = true,
        .variant = hgp_str_make("red")};
    expect_variants(rig, link_ask(rig, 1, HGP_T_asset_load, &load));
    load.variant = hgp_str_make("Peacock");
    link_expect(rig, link_ask(rig, 1, HGP_T_asset_load, &load), HGP_T_asset_loaded);
    const struct hgp_variant_set set = {.asset = FIRST_ID, .variant = hgp_str_make("red")};
    expect_variants(rig, link_ask(rig, 1, HGP_T_variant_set, &set));
    link_expect(rig, link_ask(rig, 1, HGP_T_view_set, &(struct hgp_view_set){.view = 1}), HGP_T_ok);
    const struct hgp_view_variant look = {
        .view = 1, .asset = FIRST_ID, .has_variant = true, .variant = hgp_str_make("red")};
    expect_variants(rig, link_ask(rig, 1, HGP_T_view_variant, &look));
}

static void expect_named(struct rig *rig, const char *path, const char *named)
{
    const struct hgp_asset_load load = {.asset = FIRST_ID, .path = hgp_str_make(path)};
    link_expect(rig, link_ask(rig, 1, HGP_T_asset_load, &load), HGP_T_error);
    const struct hgp_str what = rig->message.error.what;
    assert_int_equal(what.size, strlen(named));
    assert_memory_equal(what.data, named, what.size);
    const struct hgp_str reason = rig->message.error.reason;
    assert_null(memmem(reason.data, reason.size, rig->root, strlen(rig->root)));
}

// Errors name files as clients know them, not by where they lie.
static void test_errors_do_not_say_where_roots_lie(void **state)
{
    struct rig *rig = *state;
    char path[TEST_FOLDER_MAX + 16];
    link_attach(rig, 1, "a");
    snprintf(path, sizeof path, "%s/sub", rig->root);
    assert_true(mkdir(path, 0700) == 0 || errno == EEXIST);
    test_text_write(rig->root, "sub/part.gltf",
        "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"uri\":\"../sub\","
        "\"byteLength\":4}],\"scenes\":[{}]}");
    expect_named(rig, ".", ".");
    expect_named(rig, "sub", "sub");
    expect_named(rig, "./sub/../sub", "./sub/../sub");
    expect_named(rig, path, path); // it knows that already
    expect_named(rig, "sub/part.gltf", "part.gltf");
}

static void test_messages_behind_a_load_keep_their_order(void **state)
{
    struct rig *rig = *state;
    test_text_write(rig->root, "one.gltf",
        "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],"
        "\"nodes\":[{\"name\":\"from the file\"}]}");
    link_attach(rig, 1, "a");
    // The rename and the query leave before the load has answered, and must see its node.
    uint64_t node = (uint64_t)FIRST_ID << 32;
    uint32_t load = link_ask(rig, 1, HGP_T_asset_load,
        &(struct hgp_asset_load){.asset = FIRST_ID, .path = hgp_str_make("one.gltf")});
    uint32_t rename = link_ask(rig, 1, HGP_T_node_set,
        &(struct hgp_node_set){.node = node, .has_name = true, .name = hgp_str_make("renamed")});
    uint32_t list = link_ask(rig, 1, HGP_T_nodes_query, &(struct hgp_nodes_query){.count = 9});
    link_expect(rig, load, HGP_T_asset_loaded);
    assert_int_equal(rig->message.asset_loaded.nodes, 1);
    link_expect(rig, rename, HGP_T_ok);
    link_expect(rig, list, HGP_T_nodes);
    assert_int_equal(rig->message.nodes.nodes.items[0].name.size, strlen("renamed"));
}

static void test_an_assets_transform_moves_it_and_goes_with_it(void **state)
{
    struct rig *rig = *state;
    test_text_write(rig->root, "one.gltf",
        "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{}]"
        "}");
    link_attach(rig, 1, "a");
    struct hgp_asset_load m = {.asset = FIRST_ID,
        .path = hgp_str_make("one.gltf"),
        .has_transform = true,
        .transform = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 4, 5, 6, 1}};
    for (int round = 0; round < 2; round++) { // twice: nothing of the first may be left
        link_expect(rig, link_ask(rig, 1, HGP_T_asset_load, &m), HGP_T_asset_loaded);
        link_expect(rig, link_ask(rig, 1, HGP_T_nodes_query, &(struct hgp_nodes_query){.count = 9}),
            HGP_T_nodes);
        assert_int_equal(rig->message.nodes.total, 2);
        link_expect(rig,
            link_ask(rig, 1, HGP_T_asset_unload, &(struct hgp_asset_unload){.asset = FIRST_ID}),
            HGP_T_ok);
        link_expect(rig, link_ask(rig, 1, HGP_T_nodes_query, &(struct hgp_nodes_query){.count = 9}),
            HGP_T_nodes);
        assert_int_equal(rig->message.nodes.total, 0);
    }
}

static void test_comparison_of_bytes_that_are_no_image(void **state)
{
    struct rig *rig = *state;
    link_attach(rig, 1, "a");
    struct hgp_compare m = {.metric = HGP_metric_PSNR,
        .a = {(const uint8_t *)"no", 2},
        .b = {(const uint8_t *)"no", 2}};
    link_expect_error(rig, link_ask(rig, 1, HGP_T_compare, &m), HG_E_FORMAT, NULL);
}

static void test_lights_need_the_size_of_their_kind(void **state)
{
    struct rig *rig = *state;
    link_attach(rig, 1, "a");
    // A disc needs a radius, a tube a length as well; what is refused changes nothing.
    struct hgp_light_set disc = {.light = FIRST_ID, .has_kind = true, .kind = HGP_light_kind_DISC};
    link_expect_error(rig, link_ask(rig, 1, HGP_T_light_set, &disc), HG_E_INVAL, "radius");
    disc.has_radius = true;
    disc.radius = 0.25f;
    link_expect(rig, link_ask(rig, 1, HGP_T_light_set, &disc), HGP_T_ok);
    struct hgp_light_set tube = {
        .light = FIRST_ID, .has_kind = true, .kind = HGP_light_kind_TUBE, .has_width = true};
    link_expect_error(rig, link_ask(rig, 1, HGP_T_light_set, &tube), HG_E_INVAL, "width");
    struct hgp_light_set flat = {
        .light = FIRST_ID, .has_kind = true, .kind = HGP_light_kind_RECTANGLE, .has_height = true};
    link_expect_error(rig, link_ask(rig, 1, HGP_T_light_set, &flat), HG_E_INVAL, "height");
    struct hgp_light_set none = {.light = FIRST_ID, .has_radius = true};
    link_expect_error(rig, link_ask(rig, 1, HGP_T_light_set, &none), HG_E_INVAL, "radius");
}

// Profiles are photometric files, textures have to be there; a light does without one that is
// removed.
static void test_lights_with_profile_and_texture(void **state)
{
    struct rig *rig = *state;
    static const char ies[] = "TILT=NONE\n1 -1 1 2 1 1 1 0 0 0\n1 1 20\n0 180\n0\n250 50\n";
    static const uint8_t pixel[4] = {255, 0, 0, 255};
    link_attach(rig, 1, "a");
    struct hgp_light_set light = {.light = FIRST_ID,
        .has_kind = true,
        .kind = HGP_light_kind_SPOT,
        .has_profile = true,
        .profile = {(const uint8_t *)"TILT=NONE\n1 x", 13}};
    link_expect_error(rig, link_ask(rig, 1, HGP_T_light_set, &light), HG_E_FORMAT, "line 2");
    light.profile = (struct hgp_bytes){(const uint8_t *)ies, sizeof ies - 1};
    light.has_texture = true;
    light.texture = FIRST_ID + 1;
    link_expect_error(rig, link_ask(rig, 1, HGP_T_light_set, &light), HG_E_NOTFOUND, "texture");
    struct hgp_object_remove remove = {.kind = HGP_object_kind_LIGHT, .object = FIRST_ID};
    link_expect_error(rig, link_ask(rig, 1, HGP_T_object_remove, &remove), HG_E_NOTFOUND, NULL);
    struct hgp_texture_set texture = {.texture = FIRST_ID + 1,
        .format = HGP_pixel_format_RGBA8_SRGB,
        .width = 1,
        .height = 1,
        .pixels = {pixel, sizeof pixel}};
    link_expect(rig, link_ask(rig, 1, HGP_T_texture_set, &texture), HGP_T_ok);
    light.has_lumens = light.has_profile_absolute = true;
    light.lumens = 800;
    link_expect(rig, link_ask(rig, 1, HGP_T_light_set, &light), HGP_T_ok);
    link_expect(
        rig, link_ask(rig, 1, HGP_T_texture_set, &texture), HGP_T_ok); // its image is made anew
    remove.kind = HGP_object_kind_TEXTURE;
    remove.object = FIRST_ID + 1;
    link_expect(rig, link_ask(rig, 1, HGP_T_object_remove, &remove), HGP_T_ok);
    light.has_texture = false;
    light.profile.size = 0; // none
    link_expect(rig, link_ask(rig, 1, HGP_T_light_set, &light), HGP_T_ok);
}

static void test_refused_edits_make_no_objects(void **state)
{
    struct rig *rig = *state;
    link_attach(rig, 1, "a");
    struct hgp_light_set light = {.light = FIRST_ID,
        .has_inner_cone_rad = true,
        .inner_cone_rad = 0.7f,
        .has_outer_cone_rad = true,
        .outer_cone_rad = 0.5f};
    struct hgp_material_set material = {
        .material = FIRST_ID, .has_base_color_texture = true, .base_color_texture = FIRST_ID + 9};
    struct hgp_object_remove remove = {.kind = HGP_object_kind_LIGHT, .object = FIRST_ID};
    link_expect_error(rig, link_ask(rig, 1, HGP_T_light_set, &light), HG_E_INVAL, "inner_cone_rad");
    link_expect_error(rig, link_ask(rig, 1, HGP_T_object_remove, &remove), HG_E_NOTFOUND, NULL);
    link_expect_error(
        rig, link_ask(rig, 1, HGP_T_material_set, &material), HG_E_NOTFOUND, "texture");
    remove.kind = HGP_object_kind_MATERIAL;
    link_expect_error(rig, link_ask(rig, 1, HGP_T_object_remove, &remove), HG_E_NOTFOUND, NULL);
}

static void test_scene_open_without_a_session_is_answered(void **state)
{
    struct rig *rig = *state;
    link_expect_error(
        rig, link_ask(rig, 5, HGP_T_scene_open, &(struct hgp_scene_open){0}), HG_E_STATE, NULL);
}

// A peer that dies leaves answers unread, which resets the stream: link_stop wants exit code 0.
static void test_a_peer_may_leave_without_reading(void **state)
{
    struct rig *rig = *state;
    link_attach(rig, 1, "a");
    link_ask(rig, 1, HGP_T_nodes_query, &(struct hgp_nodes_query){.count = 9});
    struct pollfd p = {.fd = rig->fd, .events = POLLIN};
    assert_int_equal(poll(&p, 1, ANSWER_TIMEOUT_MS), 1);
}

// Memory of the worker that is not a file's.
static uint64_t own_bytes(const struct rig *rig)
{
    char path[64], line[256];
    unsigned long long kib = 0;
    snprintf(path, sizeof path, "/proc/%d/status", (int)rig->pid);
    FILE *f = fopen(path, "r");
    assert_non_null(f);
    while (fgets(line, sizeof line, f) && sscanf(line, "RssAnon: %llu kB", &kib) != 1)
        ;
    fclose(f);
    assert_true(kib > 0);
    return kib << 10;
}

// One part of a file of so many bytes; 0: it was taken.
static enum hg_status send_part(
    struct rig *rig, uint64_t size, uint64_t offset, const struct hgp_bytes *data)
{
    const struct hgp_image_query part = {
        .data = *data, .has_offset = true, .offset = offset, .has_size = true, .size = size};
    const uint32_t request = link_ask(rig, 1, HGP_T_image_query, &part);
    do
        link_read(rig);
    while (rig->header.request != request);
    return rig->header.type == HGP_T_error ? (enum hg_status)rig->message.error.code : HG_OK;
}

enum { MIB = 1 << 20, PART = 32 * MIB };

static bool is_memory(const char *folder)
{
    struct statfs fs;
    assert_int_equal(statfs(folder, &fs), 0);
    return fs.f_type == TMPFS_MAGIC || fs.f_type == RAMFS_MAGIC;
}

// A file to be verified is on disk as far as it has come, where there is one.
static void test_verified_files_take_no_memory(void **state)
{
    enum { PARTS = 9 }; // above 256 MiB: never in memory
    struct rig *rig = *state;
    const struct hgp_bytes data = {malloc(PART), PART};
    char folder[4200];
    assert_non_null(data.data);
    memset((uint8_t *)(uintptr_t)data.data, 1, PART);
    link_attach(rig, 1, "a");
    const enum hg_status status = send_part(rig, PARTS * PART, 0, &data);
    if (is_memory(link_cache_folder(folder, sizeof folder))) {
        assert_int_equal(status, HG_E_LIMIT);
        free((void *)(uintptr_t)data.data);
        return;
    }
    if (status)
        fail_msg("%s needs 352 MiB: %.*s", folder, (int)rig->message.error.reason.size,
            rig->message.error.reason.data);
    const uint64_t before = own_bytes(rig);
    for (uint64_t i = 1; i < PARTS - 1; i++)
        assert_int_equal(send_part(rig, PARTS * PART, i * PART, &data), HG_OK);
    assert_true(own_bytes(rig) < before + 2 * PART);
    // Whole, and no image.
    assert_int_equal(send_part(rig, PARTS * PART, (PARTS - 1) * PART, &data), HG_E_FORMAT);
    assert_int_equal(send_part(rig, PARTS * PART, PART, &data), HG_E_INVAL);
    assert_int_equal(send_part(rig, (UINT64_C(4) << 30) + 1, 0, &data), HG_E_LIMIT);
    free((void *)(uintptr_t)data.data);
}

// Where there is no disk for it only what messages may have as well.
static void test_verified_files_without_a_disk(void **state)
{
    struct rig *rig = *state;
    const struct hgp_bytes data = {(const uint8_t *)"x", 1};
    link_attach(rig, 1, "a");
    assert_int_equal(send_part(rig, 256 * MIB + 1, 0, &data), HG_E_LIMIT);
    assert_int_equal(send_part(rig, 256 * MIB, 0, &data), HG_OK);
}

static void expect_part_refused(
    struct rig *rig, uint64_t size, const struct hgp_bytes *data, const char *reason)
{
    const struct hgp_str *why = &rig->message.error.reason;
    const struct hgp_bytes first = {data->data, 1};
    assert_int_equal(send_part(rig, 2, 0, &first), HG_OK);
    assert_int_equal(send_part(rig, size, 1, data), HG_E_INVAL);
    assert_non_null(memmem(why->data, why->size, reason, strlen(reason)));
    assert_int_equal(send_part(rig, 2, 1, &first), HG_E_INVAL); // nothing is left of it
}

// Limits are looked at where a file begins: it becomes no larger than it has said there.
static void test_verified_files_stay_as_large_as_they_began(void **state)
{
    struct rig *rig = *state;
    const struct hgp_bytes one = {(const uint8_t *)"x", 1}, two = {(const uint8_t *)"xx", 2};
    link_attach(rig, 1, "a");
    expect_part_refused(rig, UINT64_C(5) << 30, &one, "is 5368709120, and was 2 ");
    expect_part_refused(rig, 2, &two, "2 bytes at offset 1 exceed the file size of 2");
    assert_int_equal(send_part(rig, 2, 0, &one), HG_OK);
    assert_int_equal(send_part(rig, 2, 1, &one), HG_E_FORMAT); // whole, and no image
}

// What came of another file before is neither asked about nor kept.
static void test_a_whole_file_after_a_part(void **state)
{
    // 3 x 1 pixels of grey
    static const uint8_t png[] = {0x89, 0x50, 0x4e, 0x47, 0x0d, 0x0a, 0x1a, 0x0a, 0x00, 0x00, 0x00,
        0x0d, 0x49, 0x48, 0x44, 0x52, 0x00, 0x00, 0x00, 0x03, 0x00, 0x00, 0x00, 0x01, 0x08, 0x00,
        0x00, 0x00, 0x00, 0x3e, 0x8b, 0x4b, 0x68, 0x00, 0x00, 0x00, 0x0c, 0x49, 0x44, 0x41, 0x54,
        0x78, 0xda, 0x63, 0x60, 0x64, 0x62, 0x06, 0x00, 0x00, 0x0e, 0x00, 0x07, 0xe9, 0x92, 0x37,
        0xd4, 0x00, 0x00, 0x00, 0x00, 0x49, 0x45, 0x4e, 0x44, 0xae, 0x42, 0x60, 0x82};
    struct rig *rig = *state;
    const struct hgp_bytes one = {(const uint8_t *)"x", 1};
    const struct hgp_image_query whole = {.data = {png, sizeof png}};
    link_attach(rig, 1, "a");
    assert_int_equal(send_part(rig, 2, 0, &one), HG_OK);
    link_expect(rig, link_ask(rig, 1, HGP_T_image_query, &whole), HGP_T_json);
    const struct hgp_str *told = &rig->message.json.text;
    assert_non_null(memmem(told->data, told->size, "\"width\":3,", 10));
    assert_int_equal(send_part(rig, 2, 1, &one), HG_E_INVAL);
}

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) // they pass any limit
// A few bytes that claim much are refused before memory is taken for them.
static void test_huge_comparisons_are_refused(void **state)
{
    struct rig *rig = *state;
    static const char huge[] = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16384 +X 16384\n";
    const struct hgp_bytes bytes = {(const uint8_t *)huge, sizeof huge - 1};
    link_attach(rig, 1, "huge");
    link_expect_error(rig,
        link_ask(rig, 1, HGP_T_compare,
            &(struct hgp_compare){.metric = HGP_metric_FLIP, .a = bytes, .b = bytes}),
        HG_E_LIMIT, NULL);
    assert_string_equal(rig->limit, "memory-limit");
    assert_int_equal(rig->limited.retry_after_ms, 0);
    static const char small[] = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 1\n\1\1\1\1";
    const struct hgp_bytes one = {(const uint8_t *)small, sizeof small - 1};
    link_expect_error(rig,
        link_ask(rig, 1, HGP_T_compare,
            &(struct hgp_compare){
                .metric = HGP_metric_PSNR, .a = one, .b = one, .has_mask = true, .mask = bytes}),
        HG_E_INVAL, "mask");
}
#endif

static void reason_is(const struct rig *rig, const char *text)
{
    const struct hgp_str *reason = &rig->message.error.reason;
    if (reason->size != strlen(text) || memcmp(reason->data, text, reason->size) != 0)
        fail_msg("%.*s", (int)reason->size, reason->data);
}

// No option sets those of the protocol: the error says how much it may be.
static void test_limits_of_the_protocol_have_values(void **state)
{
    struct rig *rig = *state;
    static const uint8_t film[] = {1, 0, 0, 0, 4, 0, 0, 0}; // 16 GiB and a byte
    const struct hgp_view_set view = {
        .view = 1, .has_width = true, .width = 16, .has_height = true, .height = 16};
    rig->limit[0] = 0;
    link_attach(rig, 1, "a");
    link_expect(rig, link_ask(rig, 1, HGP_T_view_set, &view), HGP_T_ok);
    link_expect_error(rig,
        link_ask(rig, 1, HGP_T_checkpoint_set,
            &(struct hgp_checkpoint_set){.view = 1, .data = {film, sizeof film}}),
        HG_E_LIMIT, "data");
    reason_is(rig, "17179869185 bytes of film, of at most 17179869184");
    link_expect_error(rig,
        link_ask(rig, 1, HGP_T_surface_query,
            &(struct hgp_surface_query){.view = 1, .width = 4096, .height = 1025, .what = 1}),
        HG_E_LIMIT, "width");
    reason_is(rig, "4198400 pixels, of at most 4194304 at once");
    assert_string_equal(rig->limit, "");
}

// What the store has under a hash must have it; the error does not tell where that lies.
static void test_damaged_uploads_are_refused(void **state)
{
    struct rig *rig = *state;
    char folder[4200], path[4400], hex[HG_SHA256_HEX];
    struct hgp_environment_set set = {
        .has_kind = true, .kind = HGP_environment_kind_FILE, .has_hash = true};
    assert_int_equal(hg_sha256("what was sent", 13, set.hash), HG_OK);
    hg_sha256_hex(set.hash, hex);
    snprintf(folder, sizeof folder, "%s/uploads", link_cache_folder(path, sizeof path));
    mkdir(folder, 0700);
    snprintf(path, sizeof path, "%s/%s", folder, hex);
    test_file_write(path, "something else", 14);
    link_attach(rig, 1, "damaged");
    link_expect_error(rig, link_ask(rig, 1, HGP_T_environment_set, &set), HG_E_HASH, NULL);
    const struct hgp_str *what = &rig->message.error.what;
    assert_null(memchr(what->data, '/', what->size));
    assert_int_equal(unlink(path), 0);
    link_expect_error(rig, link_ask(rig, 1, HGP_T_environment_set, &set), HG_E_NOTFOUND, NULL);
    what = &rig->message.error.what;
    assert_null(memchr(what->data, '/', what->size));
}

int main(void)
{
#define SHARED(name) cmocka_unit_test_teardown(name, link_detach)
    const struct CMUnitTest shared[] = {
        SHARED(test_channels_without_a_session_are_refused),
        SHARED(test_malformed_payload_names_the_field),
        SHARED(test_ids_stay_in_the_sessions_range),
        SHARED(test_sessions_with_one_key_share_the_scene),
        SHARED(test_a_batch_is_one_revision),
        SHARED(test_refused_edits_change_nothing),
        SHARED(test_client_meshes_are_checked_and_bounded),
        SHARED(test_files_outside_the_roots_are_not_told_apart),
        SHARED(test_sessions_keep_to_their_roots),
        SHARED(test_an_unknown_variant_is_told_those_there_are),
        SHARED(test_errors_do_not_say_where_roots_lie),
        SHARED(test_messages_behind_a_load_keep_their_order),
        SHARED(test_an_assets_transform_moves_it_and_goes_with_it),
        SHARED(test_comparison_of_bytes_that_are_no_image),
        SHARED(test_limits_of_the_protocol_have_values),
        SHARED(test_lights_need_the_size_of_their_kind),
        SHARED(test_lights_with_profile_and_texture),
        SHARED(test_refused_edits_make_no_objects),
        SHARED(test_scene_open_without_a_session_is_answered),
    };
    // Each with a worker of its own: its end, its memory, its folders.
#define ALONE(name, start) cmocka_unit_test_setup_teardown(name, start, link_stop)
    const struct CMUnitTest alone[] = {
        ALONE(test_a_peer_may_leave_without_reading, link_start),
        ALONE(test_verified_files_without_a_disk, link_start),
        ALONE(test_verified_files_stay_as_large_as_they_began, link_start),
        ALONE(test_a_whole_file_after_a_part, link_start),
        ALONE(test_verified_files_take_no_memory, link_start_with_cache),
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
        ALONE(test_huge_comparisons_are_refused, link_start_with_limit),
#endif
        ALONE(test_damaged_uploads_are_refused, link_start_with_cache),
    };
    const int failed = cmocka_run_group_tests_name("worker_link", shared, link_start, link_stop);
    return failed + cmocka_run_group_tests_name("worker_link, alone", alone, NULL, NULL);
}
