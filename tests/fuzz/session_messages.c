#include "tests/fuzz/session_messages.h"

#define BYTES_OF(array)                                                                            \
    {                                                                                              \
        (const uint8_t *)(array), sizeof(array)                                                    \
    }

static void add_meshes(session_message_fn *add)
{
    static const float positions[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0};
    static const float uv[] = {0, 0, 1, 0, 0, 1, 1, 1};
    static const uint32_t indices[] = {0, 1, 2, 2, 1, 3};
    struct hgp_mesh_part parts[] = {
        {.mode = HGP_primitive_mode_TRIANGLES,
            .material = 1,
            .positions = BYTES_OF(positions),
            .uv0 = BYTES_OF(uv),
            .indices = BYTES_OF(indices)},
        {.mode = HGP_primitive_mode_LINE_LOOP, .positions = BYTES_OF(positions)},
        {.mode = HGP_primitive_mode_TRIANGLE_STRIP, .positions = BYTES_OF(positions)},
    };
    add(HGP_T_mesh_set, &(struct hgp_mesh_set){.mesh = 1, .parts = {parts, 3}});
    add(HGP_T_mesh_set, &(struct hgp_mesh_set){.mesh = 1, .parts = {parts + 1, 1}});
    add(HGP_T_node_set, &(struct hgp_node_set){.node = 1, .has_mesh = true, .mesh = 1});
    add(HGP_T_node_set, &(struct hgp_node_set){.node = 2,
                            .has_parent = true,
                            .parent = 1,
                            .has_light = true,
                            .light = 1,
                            .has_camera = true,
                            .camera = 1});
    add(HGP_T_node_set, &(struct hgp_node_set){.node = 1, .has_parent = true, .parent = 2});
}

static void add_surfaces(session_message_fn *add)
{
    static const uint8_t pixels[16] = {255, 0, 0, 255, 0, 255, 0, 255};
    static const char png[] = "\x89PNG\r\n\x1a\n not a picture";
    add(HGP_T_texture_set, &(struct hgp_texture_set){
                               .texture = 1, .width = 2, .height = 2, .pixels = BYTES_OF(pixels)});
    add(HGP_T_texture_set,
        &(struct hgp_texture_set){
            .texture = 2, .format = HGP_pixel_format_FILE, .pixels = BYTES_OF(png)});
    add(HGP_T_material_set, &(struct hgp_material_set){.material = 1,
                                .has_base_color_texture = true,
                                .base_color_texture = 1,
                                .has_alpha_mode = true,
                                .alpha_mode = HGP_alpha_mode_BLEND});
    add(HGP_T_light_set, &(struct hgp_light_set){.light = 1,
                             .has_kind = true,
                             .kind = HGP_light_kind_SPOT,
                             .has_intensity = true,
                             .intensity = 100});
    add(HGP_T_camera_set,
        &(struct hgp_camera_set){.camera = 1, .has_vfov_rad = true, .vfov_rad = 1});
    for (int kind = HGP_environment_kind_NONE; kind <= HGP_environment_kind_SKY; kind++)
        add(HGP_T_environment_set, &(struct hgp_environment_set){
                                       .has_kind = true, .kind = (enum hgp_environment_kind)kind});
}

static void add_assets(session_message_fn *add)
{
    add(HGP_T_asset_load,
        &(struct hgp_asset_load){.asset = 1, .path = hgp_str_make("/nowhere/at/all.glb")});
    add(HGP_T_asset_unload, &(struct hgp_asset_unload){.asset = 1});
    add(HGP_T_animation_set, &(struct hgp_animation_set){.asset = 1, .animation = -1});
    add(HGP_T_variant_set, &(struct hgp_variant_set){.asset = 1});
    for (int kind = HGP_object_kind_NODE; kind <= HGP_object_kind_CAMERA; kind++)
        add(HGP_T_object_remove,
            &(struct hgp_object_remove){.kind = (enum hgp_object_kind)kind, .object = 1});
    add(HGP_T_batch_begin, &(struct hgp_batch_begin){0});
    add(HGP_T_batch_end, &(struct hgp_batch_end){0});
    add(HGP_T_scene_close, &(struct hgp_scene_close){0});
    add(HGP_T_scene_open, &(struct hgp_scene_open){.name = hgp_str_make("shared")});
}

static void add_views(session_message_fn *add)
{
    add(HGP_T_view_camera,
        &(struct hgp_view_camera){
            .view = 1, .input_seq = 5, .has_eye = true, .eye = {0, 0, 3}, .has_target = true});
    add(HGP_T_view_camera, &(struct hgp_view_camera){.view = 1, .has_camera = true, .camera = 2});
    add(HGP_T_view_set,
        &(struct hgp_view_set){
            .view = 1, .has_width = true, .width = 16, .has_samples = true, .samples = 2});
    for (int e = HGP_encoding_RAW_RGBA8; e <= HGP_encoding_TILES_JPEG; e++)
        add(HGP_T_frame_request, &(struct hgp_frame_request){.view = 1,
                                     .settled = e % 2,
                                     .has_encoding = true,
                                     .encoding = (enum hgp_encoding)e});
    add(HGP_T_subscribe, &(struct hgp_subscribe){.view = 1, .credit_frames = 3});
    add(HGP_T_subscribe, &(struct hgp_subscribe){.view = 1});
    add(HGP_T_credit, &(struct hgp_credit){.view = 1, .frames = 2});
    add(HGP_T_key_frame, &(struct hgp_key_frame){.view = 1});
    add(HGP_T_key_frame,
        &(struct hgp_key_frame){.view = 1, .has_failed = true, .failed = HGP_encoding_H264});
    add(HGP_T_view_close, &(struct hgp_view_close){.view = 1});
}

static void add_queries(session_message_fn *add)
{
    add(HGP_T_pick, &(struct hgp_pick){.view = 1, .x = 3, .y = 3});
    add(HGP_T_bounds_query, &(struct hgp_bounds_query){0});
    add(HGP_T_bounds_query, &(struct hgp_bounds_query){.node = 1});
    add(HGP_T_view_fit, &(struct hgp_view_fit){.view = 1});
    add(HGP_T_view_fit,
        &(struct hgp_view_fit){.view = 1, .has_node = true, .node = 1, .has_cameras = true});
    add(HGP_T_nodes_query, &(struct hgp_nodes_query){.count = 100});
    add(HGP_T_stats_query, &(struct hgp_stats_query){.view = 1});
    add(HGP_T_sessions_query, &(struct hgp_sessions_query){0});
    add(HGP_T_info_query, &(struct hgp_info_query){0});
    add(HGP_T_ping, &(struct hgp_ping){.nonce = 1});
}

// Who is in a scene, its shared camera, annotations.
static void add_people(session_message_fn *add)
{
    add(HGP_T_scene_open, &(struct hgp_scene_open){.name = hgp_str_make("shared")});
    for (int on = 1; on >= 0; on--)
        add(HGP_T_scene_watch, &(struct hgp_scene_watch){.has_participants = true,
                                   .participants = on,
                                   .has_cursors = true,
                                   .cursors = on,
                                   .has_camera = true,
                                   .camera = on,
                                   .has_annotations = true,
                                   .annotations = on,
                                   .has_edits = true,
                                   .edits = on});
    add(HGP_T_participant_set, &(struct hgp_participant_set){.has_label = true,
                                   .label = hgp_str_make("who is this"),
                                   .has_color = true,
                                   .color = 0x00ff80});
    add(HGP_T_cursor_set, &(struct hgp_cursor_set){.shown = true, .position = {1, 2, 3}});
    add(HGP_T_cursor_set, &(struct hgp_cursor_set){.shown = false});
    add(HGP_T_camera_request, &(struct hgp_camera_request){0});
    add(HGP_T_camera_take, &(struct hgp_camera_take){0});
    add(HGP_T_camera_lock, &(struct hgp_camera_lock){.locked = true});
    add(HGP_T_camera_lock, &(struct hgp_camera_lock){.locked = false});
    add(HGP_T_camera_follow, &(struct hgp_camera_follow){.view = 1, .follow = true});
    add(HGP_T_camera_follow, &(struct hgp_camera_follow){.view = 1, .follow = false});
    add(HGP_T_camera_give, &(struct hgp_camera_give){0});
    add(HGP_T_annotation_set, &(struct hgp_annotation_set){.has_position = true,
                                  .position = {0, 1, 0},
                                  .has_text = true,
                                  .text = hgp_str_make("a note")});
    for (uint64_t i = 1; i <= 2; i++) {
        add(HGP_T_camera_give, &(struct hgp_camera_give){.has_session = true, .session = i});
        add(HGP_T_annotation_set,
            &(struct hgp_annotation_set){.annotation = i, .has_color = true, .color = 0xff});
        add(HGP_T_annotation_remove, &(struct hgp_annotation_remove){.annotation = i});
    }
    add(HGP_T_annotations_query, &(struct hgp_annotations_query){0});
}

static void add_tickets(session_message_fn *add)
{
    add(HGP_T_join_make, &(struct hgp_join_make){0}); // of the open scene, if that has a name
    for (enum hgp_role role = HGP_role_VIEW; role <= HGP_role_EDIT; role++)
        add(HGP_T_join_make, &(struct hgp_join_make){.has_scene = true,
                                 .scene = hgp_str_make("shared"),
                                 .has_role = true,
                                 .role = role,
                                 .has_uses = true,
                                 .uses = 2,
                                 .has_valid_s = true,
                                 .valid_s = 1,
                                 .has_label = true,
                                 .label = hgp_str_make("guest")});
    add(HGP_T_join_query, &(struct hgp_join_query){0});
    for (uint64_t i = 0; i < 3; i++)
        add(HGP_T_join_revoke, &(struct hgp_join_revoke){.ticket = i});
    add(HGP_T_keep, &(struct hgp_keep){0});
}

// A daemon that drains and stays serves administrators; session_stream.h says why no other drain.
static void add_drain(session_message_fn *add)
{
    for (uint32_t i = 0; i < 2; i++)
        add(HGP_T_drain_set, &(struct hgp_drain_set){.deadline_ms = i * 1000,
                                 .reason = hgp_str_make("for a while"),
                                 .has_stay = true,
                                 .stay = true});
    for (int i = 0; i < 3; i++)
        add(HGP_T_drain_set, &(struct hgp_drain_set){.has_cancel = true, .cancel = true});
    add(HGP_T_message_send, &(struct hgp_message_send){.text = hgp_str_make("to all")});
    add(HGP_T_sessions_watch, &(struct hgp_sessions_watch){.interval_ms = 100});
    add(HGP_T_sessions_watch, &(struct hgp_sessions_watch){0});
    add(HGP_T_kick, &(struct hgp_kick){.session = 1});
}

void session_messages(session_message_fn *add)
{
    add_people(add);
    add_tickets(add);
    add_drain(add);
    add_meshes(add);
    add_surfaces(add);
    add_assets(add);
    add_views(add);
    add_queries(add);
}
