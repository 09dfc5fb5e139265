#include "tests/fault/built_scene.h"

#include <string.h>

// Parents younger than their children, a mesh and its material replaced.
static void make_objects(struct peer *p)
{
    uint32_t n = p->first_id;
    float triangle[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    struct hgp_mesh_part part = {.mode = HGP_primitive_mode_TRIANGLES,
        .positions = {(const uint8_t *)triangle, sizeof triangle}};
    struct hgp_mesh_set mesh = {.mesh = n, .parts = {&part, 1}};
    peer_call(p, HGP_T_mesh_set, &mesh, HGP_T_ok);
    peer_call(p, HGP_T_node_set, &(struct hgp_node_set){.node = n, .has_mesh = true, .mesh = n},
        HGP_T_ok);
    peer_call(p, HGP_T_material_set,
        &(struct hgp_material_set){.material = n, .has_roughness = true, .roughness = 0.25f},
        HGP_T_ok);
    part.material = n; // younger than the mesh's first version
    peer_call(p, HGP_T_mesh_set, &mesh, HGP_T_ok);
    peer_call(p, HGP_T_node_set,
        &(struct hgp_node_set){.node = n + 1, .has_name = true, .name = hgp_str_make("parent")},
        HGP_T_ok);
    peer_call(p, HGP_T_node_set,
        &(struct hgp_node_set){.node = n, .has_parent = true, .parent = n + 1}, HGP_T_ok);
    peer_call(p, HGP_T_asset_load,
        &(struct hgp_asset_load){
            .asset = n, .path = hgp_str_make("a"), .has_parent = true, .parent = n + 1},
        HGP_T_asset_loaded);
}

// Poses between moves, objects removed and made again, an environment in two steps.
static void change_objects(struct peer *p)
{
    uint32_t n = p->first_id;
    uint64_t of_asset = (uint64_t)n << 32;
    peer_call(p, HGP_T_node_set,
        &(struct hgp_node_set){.node = of_asset, .has_translation = true, .translation = {1, 2, 3}},
        HGP_T_ok);
    peer_call(p, HGP_T_animation_set,
        &(struct hgp_animation_set){.asset = n, .animation = 0, .time_s = 1}, HGP_T_ok);
    peer_call(p, HGP_T_animation_set,
        &(struct hgp_animation_set){.asset = n, .animation = 0, .time_s = 2.5}, HGP_T_ok);
    for (int i = 0; i < 40; i++)
        peer_call(p, HGP_T_node_set,
            &(struct hgp_node_set){
                .node = n, .has_translation = true, .translation = {(float)i, 0, 0}},
            HGP_T_ok);
    peer_call(p, HGP_T_node_set, &(struct hgp_node_set){.node = n + 2}, HGP_T_ok);
    peer_call(p, HGP_T_node_set,
        &(struct hgp_node_set){.node = n + 3, .has_parent = true, .parent = n + 2}, HGP_T_ok);
    peer_call(p, HGP_T_object_remove,
        &(struct hgp_object_remove){.kind = HGP_object_kind_NODE, .object = n + 2}, HGP_T_ok);
    peer_call(
        p, HGP_T_node_set, &(struct hgp_node_set){.node = n + 2, .has_visible = true}, HGP_T_ok);
    peer_call(p, HGP_T_environment_set,
        &(struct hgp_environment_set){.has_kind = true,
            .kind = HGP_environment_kind_SKY,
            .has_turbidity = true,
            .turbidity = 3},
        HGP_T_ok);
    peer_call(p, HGP_T_environment_set,
        &(struct hgp_environment_set){.has_intensity = true, .intensity = 2}, HGP_T_ok);
}

void built_scene_view(struct peer *p)
{
    peer_call(p, HGP_T_view_set,
        &(struct hgp_view_set){.view = 1,
            .has_width = true,
            .width = 32,
            .has_height = true,
            .height = 32,
            .has_samples = true,
            .samples = 4},
        HGP_T_ok);
    peer_call(p, HGP_T_view_set,
        &(struct hgp_view_set){.view = 1, .has_exposure_ev = true, .exposure_ev = 1}, HGP_T_ok);
    peer_tell(p, HGP_T_view_camera,
        &(struct hgp_view_camera){.view = 1, .input_seq = 1, .has_eye = true, .eye = {0, 0, 5}});
    peer_tell(p, HGP_T_view_camera,
        &(struct hgp_view_camera){
            .view = 1, .input_seq = 2, .has_target = true, .target = {0, 1, 0}});
}

// A scene with every kind of edit, in an order in which compaction by kind would fail: parents
// that are younger than their children, meshes and materials replaced, objects removed and made
// again, poses between moves.
void built_scene_make(struct peer *p)
{
    make_objects(p);
    change_objects(p);
    built_scene_view(p);
}

void built_scene_frame(struct peer *p, struct hgp_frame *out, uint8_t digest[32])
{
    peer_call(p, HGP_T_frame_request, &(struct hgp_frame_request){.view = 1, .settled = true},
        HGP_T_frame);
    *out = p->m.frame;
    memcpy(digest, p->m.frame.data.data, 32);
}
