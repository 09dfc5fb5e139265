// test_journal.c - a scene built from the journal equals the scene that was edited.
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "server/broker/scene/scene_journal.h"
#include "tests/system/fake_scene.h"

enum { IDS = 6, ASSETS = 3 };

static uint64_t random_state;

static uint32_t rnd(uint32_t below)
{
    random_state = random_state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(random_state >> 33) % below;
}

static bool often(void)
{
    return rnd(2) == 0;
}

// A client's object, sometimes one of an asset, sometimes none.
static uint64_t some_id(void)
{
    uint64_t id = rnd(IDS + 1);
    return rnd(4) ? id : ((uint64_t)(1 + rnd(ASSETS)) << 32 | rnd(2));
}

static uint64_t object_id(void)
{
    return rnd(4) ? 1 + rnd(IDS) : ((uint64_t)(1 + rnd(ASSETS)) << 32 | rnd(2));
}

static struct hg_packet *random_node(void)
{
    static const char *const names[] = {"a", "longer name", ""};
    return hg_packet_encode(HGP_T_node_set, &(struct hgp_node_set){
                                                .node = object_id(),
                                                .has_parent = often(),
                                                .parent = some_id(),
                                                .has_translation = often(),
                                                .translation = {(float)rnd(100)},
                                                .has_rotation = often(),
                                                .rotation = {(float)rnd(100)},
                                                .has_visible = often(),
                                                .visible = often(),
                                                .has_mesh = often(),
                                                .mesh = some_id(),
                                                .has_light = rnd(4) == 0,
                                                .light = some_id(),
                                                .has_camera = rnd(4) == 0,
                                                .camera = some_id(),
                                                .has_name = rnd(4) == 0,
                                                .name = hgp_str_make(names[rnd(3)]),
                                            });
}

static struct hg_packet *random_material(void)
{
    bool emissive = often();
    return hg_packet_encode(HGP_T_material_set, &(struct hgp_material_set){
                                                    .material = object_id(),
                                                    .has_metallic = often(),
                                                    .metallic = (float)rnd(2),
                                                    .has_roughness = often(),
                                                    .roughness = (float)rnd(2),
                                                    .has_emissive = emissive,
                                                    .emissive = {(float)rnd(9)},
                                                    .has_emissive_strength = emissive && often(),
                                                    .emissive_strength = (float)rnd(9),
                                                    .has_base_color_texture = often(),
                                                    .base_color_texture = some_id(),
                                                    .has_normal_texture = often(),
                                                    .normal_texture = some_id(),
                                                });
}

static struct hg_packet *random_mesh(void)
{
    uint8_t points[24] = {(uint8_t)rnd(200)};
    struct hgp_mesh_part parts[3] = {0};
    uint32_t count = rnd(4);
    for (uint32_t i = 0; i < count; i++)
        parts[i] = (struct hgp_mesh_part){.material = some_id(), .positions = {points, 24}};
    return hg_packet_encode(
        HGP_T_mesh_set, &(struct hgp_mesh_set){.mesh = 1 + rnd(IDS), .parts = {parts, count}});
}

static struct hg_packet *random_environment(void)
{
    bool hash = often();
    return hg_packet_encode(
        HGP_T_environment_set, &(struct hgp_environment_set){
                                   .has_hash = hash && often(),
                                   .hash = {(uint8_t)rnd(4)},
                                   .has_path = !hash && often(),
                                   .path = hgp_str_make(often() ? "a.hdr" : "b.hdr"),
                                   .has_intensity = often(),
                                   .intensity = (float)rnd(5),
                                   .has_turbidity = often(),
                                   .turbidity = (float)(1 + rnd(9)),
                               });
}

static struct hg_packet *random_asset(void)
{
    uint32_t asset = 1 + rnd(ASSETS);
    switch (rnd(6)) {
    case 0:
        return hg_packet_encode(HGP_T_asset_unload, &(struct hgp_asset_unload){.asset = asset});
    case 1:
    case 2:
        return hg_packet_encode(HGP_T_asset_load, &(struct hgp_asset_load){.asset = asset,
                                                      .path = hgp_str_make("a.glb"),
                                                      .has_parent = often(),
                                                      .parent = some_id()});
    case 3:
        return hg_packet_encode(
            HGP_T_variant_set, &(struct hgp_variant_set){.asset = asset,
                                   .variant = hgp_str_make(often() ? "red" : "blue")});
    default:
        return hg_packet_encode(HGP_T_animation_set,
            &(struct hgp_animation_set){
                .asset = asset, .animation = (int32_t)rnd(4) - 1, .time_s = rnd(10)});
    }
}

static struct hg_packet *random_edit(void)
{
    switch (rnd(12)) {
    case 0:
        return hg_packet_encode(
            HGP_T_object_remove, &(struct hgp_object_remove){
                                     .kind = (enum hgp_object_kind)rnd(6), .object = 1 + rnd(IDS)});
    case 1:
        return random_mesh();
    case 2:
    case 3:
        return random_material();
    case 4:
        return hg_packet_encode(HGP_T_texture_set,
            &(struct hgp_texture_set){.texture = 1 + rnd(IDS), .width = 1 + rnd(9)});
    case 5:
        return hg_packet_encode(HGP_T_light_set,
            &(struct hgp_light_set){
                .light = 1 + rnd(IDS), .has_intensity = often(), .intensity = (float)rnd(9)});
    case 6:
        return hg_packet_encode(HGP_T_camera_set,
            &(struct hgp_camera_set){
                .camera = 1 + rnd(IDS), .has_near = often(), .near = (float)(1 + rnd(9))});
    case 7:
        return random_environment();
    case 8:
    case 9:
        return random_asset();
    default:
        return random_node();
    }
}

static enum hg_status apply_played(void *user, struct hg_packet *packet)
{
    enum hg_status status = fake_scene_apply(user, packet, 1, UINT32_MAX);
    if (status)
        fail_msg("seed state %llu: %s is refused when played: %s", (unsigned long long)random_state,
            hgp_find(packet->header.type)->name, hg_status_text(status));
    hg_packet_unref(packet);
    return status;
}

static void digest(const struct fake_scene *scene, uint8_t hash[32])
{
    struct hg_sha256 *h = hg_sha256_create();
    assert_non_null(h);
    fake_scene_hash(scene, h);
    hg_sha256_end(h, hash);
}

static void compare(const struct fake_scene *scene, struct hg_journal *journal)
{
    struct fake_scene again = {0};
    uint8_t a[32], b[32];
    assert_int_equal(hg_journal_play(journal, apply_played, &again), HG_OK);
    digest(scene, a);
    digest(&again, b);
    if (memcmp(a, b, 32) != 0)
        for (struct fake_object *it = scene->objects; it; it = it->next) {
            struct fake_object *twin = fake_scene_find(&again, it->type, it->id, it->extra);
            if (!twin || twin->packet->header.length != it->packet->header.length ||
                memcmp(twin->packet->payload, it->packet->payload, it->packet->header.length) != 0)
                print_message(
                    "differs: %s %llx\n", hgp_find(it->type)->name, (unsigned long long)it->id);
        }
    assert_memory_equal(a, b, 32);
    fake_scene_finish(&again);
}

static void random_edits(void **state)
{
    (void)state;
    uint64_t accepted = 0, most = 0;
    for (uint64_t seed = 1; seed <= 300; seed++) {
        struct fake_scene scene = {0};
        struct hg_journal *journal = hg_journal_create(NULL);
        assert_non_null(journal);
        random_state = seed * 0x9e3779b97f4a7c15u;
        for (int i = 0; i < 400; i++) {
            struct hg_packet *packet = random_edit();
            assert_non_null(packet);
            if (fake_scene_apply(&scene, packet, 1, UINT32_MAX) == HG_OK) {
                assert_int_equal(hg_journal_accept(journal, packet), HG_OK);
                accepted++;
            }
            hg_packet_unref(packet);
            if (i % 7 == 0)
                compare(&scene, journal);
        }
        compare(&scene, journal);
        struct hg_journal_stats stats = hg_journal_get_stats(journal);
        most = stats.entries > most ? stats.entries : most;
        fake_scene_finish(&scene);
        hg_journal_destroy(journal);
    }
    print_message("%llu edits accepted, longest journal %llu entries\n",
        (unsigned long long)accepted, (unsigned long long)most);
    assert_true(accepted > 30000); // the test tests something
    // Objects times fields: 6 kinds of 6, 3 assets of 2 nodes and materials.
    assert_true(most < 400);
}

static void many_moves_are_one_entry(void **state)
{
    (void)state;
    struct hg_journal *journal = hg_journal_create(NULL);
    for (int i = 0; i < 100000; i++) {
        struct hg_packet *packet = hg_packet_encode(HGP_T_node_set,
            &(struct hgp_node_set){.node = 5, .has_translation = true, .translation = {(float)i}});
        assert_int_equal(hg_journal_accept(journal, packet), HG_OK);
        hg_packet_unref(packet);
    }
    struct hg_journal_stats stats = hg_journal_get_stats(journal);
    assert_int_equal(stats.entries, 2); // the one that made the node, and the newest
    assert_true(stats.bytes < 1000);
    hg_journal_destroy(journal);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(random_edits),
        cmocka_unit_test(many_moves_are_one_entry),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
