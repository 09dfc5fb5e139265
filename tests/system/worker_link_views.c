// worker_link_views.c - views of a real helio-worker: subscriptions, picks, jobs and their hashes.
// Needs a device; lavapipe will do.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdio.h>
#include <string.h>

#include "tests/system/worker_link_rig.h"

enum { VIEW = 3, SIDE = 64, SAMPLES = 8 };

static void make_scene_and_view(struct rig *rig)
{
    float corners[] = {-1, -1, 0, 1, -1, 0, 0, 1, 0};
    struct hgp_mesh_part part = {.mode = HGP_primitive_mode_TRIANGLES,
        .positions = {(const uint8_t *)corners, sizeof corners}};
    struct hgp_mesh_set mesh = {.mesh = FIRST_ID};
    mesh.parts.items = &part;
    mesh.parts.count = 1;
    struct hgp_environment_set sky = {.has_kind = true,
        .kind = HGP_environment_kind_COLOR,
        .has_color = true,
        .color = {1, 1, 1}};
    link_expect(rig, link_ask(rig, 1, HGP_T_environment_set, &sky), HGP_T_ok);
    link_expect(rig, link_ask(rig, 1, HGP_T_mesh_set, &mesh), HGP_T_ok);
    struct hgp_node_set node = {.node = FIRST_ID, .has_mesh = true, .mesh = FIRST_ID};
    link_expect(rig, link_ask(rig, 1, HGP_T_node_set, &node), HGP_T_ok);
    struct hgp_view_set view = {.view = VIEW,
        .has_width = true,
        .width = SIDE,
        .has_height = true,
        .height = SIDE,
        .has_samples = true,
        .samples = SAMPLES,
        .has_background = true,
        .background = HGP_background_NONE,
        .has_gi = true,
        .gi = HGP_gi_NONE,
        .has_exposure_mode = true,
        .exposure_mode = HGP_exposure_mode_FIXED,
        .has_max_fps = true,
        .max_fps = 1000};
    struct hgp_view_camera camera = {
        .view = VIEW, .input_seq = 41, .has_eye = true, .eye = {0, 0, 4}, .has_target = true};
    link_expect(rig, link_ask(rig, 1, HGP_T_view_set, &view), HGP_T_ok);
    link_expect(rig, link_ask(rig, 1, HGP_T_view_camera, &camera), HGP_T_ok);
}

// The next frame that no request asked for; NULL when a later pulse shows that none comes.
static const struct hgp_frame *next_subscribed(struct rig *rig, int pulses)
{
    while (pulses > 0) {
        link_read(rig);
        assert_int_not_equal(rig->header.type, HGP_T_error);
        if (rig->header.type == HGP_T_frame && rig->header.request == 0)
            return &rig->message.frame;
        // A pulse while a step is under way proves nothing.
        pulses -= rig->header.type == HGP_T_pulse && rig->message.pulse.busy_ns == 0;
    }
    return NULL;
}

// Takes frames until the settled one; returns how many came.
static uint32_t take_until_settled(struct rig *rig, uint64_t revision)
{
    uint64_t number = 0;
    for (uint32_t count = 1;; count++) {
        const struct hgp_frame *frame = next_subscribed(rig, 100);
        assert_non_null(frame);
        assert_int_equal(frame->scene_revision, revision);
        assert_int_equal(frame->input_seq, 41);
        assert_true(frame->number > number);
        number = frame->number;
        if (frame->settled) {
            assert_int_equal(frame->samples, SAMPLES);
            assert_true(frame->has_hash);
            return count;
        }
    }
}

// Of the view, with so many frames of credit; the answer is rig's message.
static void subscribe(struct rig *rig, uint32_t frames)
{
    const struct hgp_subscribe ask = {.view = VIEW, .credit_frames = frames};
    link_expect(rig, link_ask(rig, 1, HGP_T_subscribe, &ask), HGP_T_ok);
}

static void test_a_subscription_keeps_to_its_credit_and_ends_settled(void **state)
{
    struct rig *rig = *state;
    link_attach(rig, 1, "a");
    make_scene_and_view(rig);
    subscribe(rig, 1);
    uint64_t revision = rig->message.ok.revision;
    assert_non_null(next_subscribed(rig, 100));
    assert_null(next_subscribed(rig, 2)); // the credit is used up
    link_ask(rig, 1, HGP_T_credit, &(struct hgp_credit){.view = VIEW, .frames = 20});
    uint32_t count = take_until_settled(rig, revision);
    assert_true(count <= 5); // at most 1, 2, 4, 8 samples
    uint8_t settled_hash[32];
    memcpy(settled_hash, rig->message.frame.hash, sizeof settled_hash);
    assert_null(next_subscribed(rig, 2)); // nothing is left to improve

    // The same picture on request, byte for byte.
    struct hgp_frame_request request = {
        .view = VIEW, .settled = true, .has_encoding = true, .encoding = HGP_encoding_RAW_RGBA8};
    link_expect(rig, link_ask(rig, 1, HGP_T_frame_request, &request), HGP_T_frame);
    assert_int_equal(rig->message.frame.data.size, SIDE * SIDE * 4);
    assert_memory_equal(rig->message.frame.hash, settled_hash, sizeof settled_hash);

    // An edit starts a new state, shown at once and brought to its end.
    struct hgp_node_set move = {
        .node = FIRST_ID, .has_translation = true, .translation = {0.5f, 0, 0}};
    link_expect(rig, link_ask(rig, 1, HGP_T_node_set, &move), HGP_T_ok);
    take_until_settled(rig, rig->message.ok.revision);
    assert_memory_not_equal(rig->message.frame.hash, settled_hash, sizeof settled_hash);
}

// Whatever a sample takes: more of them would be no picture in motion, and late.
static void test_a_camera_that_moves_gets_pictures_of_one_sample(void **state)
{
    struct rig *rig = *state;
    link_attach(rig, 1, "a");
    make_scene_and_view(rig);
    subscribe(rig, 200);
    take_until_settled(rig, rig->message.ok.revision);
    for (uint32_t i = 1; i <= 5; i++) {
        const struct hgp_view_camera camera = {
            .view = VIEW, .input_seq = 41 + i, .has_eye = true, .eye = {0.01f * (float)i, 0, 4}};
        link_ask(rig, 1, HGP_T_view_camera, &camera);
        const struct hgp_frame *frame;
        do
            assert_non_null(frame = next_subscribed(rig, 100));
        while (frame->input_seq != 41 + i);
        assert_int_equal(frame->samples, 1);
    }
}

static void test_a_camera_has_to_look_somewhere(void **state)
{
    struct rig *rig = *state;
    link_attach(rig, 1, "a");
    make_scene_and_view(rig);
    struct hgp_view_camera camera = {.view = VIEW,
        .has_eye = true,
        .eye = {0, 1, 0},
        .has_target = true,
        .target = {-0.0f, 1, 0}};
    link_expect_error(rig, link_ask(rig, 1, HGP_T_view_camera, &camera), HG_E_INVAL, "target");
    static const char said[] = "-0, 1, 0 is where the eye is";
    assert_memory_equal(rig->message.error.reason.data, said, strlen(said));
    // What is up may be along the line of sight: another direction is taken.
    camera.eye[1] = 4;
    camera.has_up = true;
    camera.up[1] = 1;
    link_expect(rig, link_ask(rig, 1, HGP_T_view_camera, &camera), HGP_T_ok);
}

static void test_picks_and_a_view_closed_while_frames_wait(void **state)
{
    struct rig *rig = *state;
    link_attach(rig, 1, "a");
    make_scene_and_view(rig);
    struct hgp_pick pick = {.view = VIEW, .x = SIDE / 2, .y = SIDE / 2};
    link_expect(rig, link_ask(rig, 1, HGP_T_pick, &pick), HGP_T_picked);
    assert_true(rig->message.picked.hit);
    assert_int_equal(rig->message.picked.node, FIRST_ID);
    // Many samples: the frame cannot be ready before the view is closed.
    struct hgp_view_set more = {.view = VIEW, .has_samples = true, .samples = 65536};
    link_expect(rig, link_ask(rig, 1, HGP_T_view_set, &more), HGP_T_ok);
    struct hgp_frame_request settled = {.view = VIEW, .settled = true};
    uint32_t frame = link_ask(rig, 1, HGP_T_frame_request, &settled);
    uint32_t closing = link_ask(rig, 1, HGP_T_view_close, &(struct hgp_view_close){.view = VIEW});
    link_expect_error(rig, frame, HG_E_CANCELLED, NULL);
    link_expect(rig, closing, HGP_T_ok);
    link_expect_error(rig, link_ask(rig, 1, HGP_T_pick, &pick), HG_E_NOTFOUND, NULL);
    // And a session that ends with a view at work takes it along.
    make_scene_and_view(rig);
    link_ask(rig, 1, HGP_T_frame_request, &settled);
    link_ask(rig, 1, HGP_T_session_detach, &(struct hgp_session_detach){0});
    link_attach(rig, 1, "b");
    link_expect_error(rig, link_ask(rig, 1, HGP_T_pick, &pick), HG_E_NOTFOUND, NULL);
}

// Each request that is cancelled, and no other one, is answered at once; then the view is idle.
static void test_frames_are_cancelled(void **state)
{
    struct rig *rig = *state;
    link_attach(rig, 1, "a");
    make_scene_and_view(rig);
    struct hgp_view_set samples = {.view = VIEW, .has_samples = true, .samples = 65536};
    link_expect(rig, link_ask(rig, 1, HGP_T_view_set, &samples), HGP_T_ok);
    const struct hgp_frame_request settled = {.view = VIEW, .settled = true};
    struct hgp_frame_cancel cancel = {.view = VIEW};
    uint32_t frames[2], cancelling[2];
    for (int i = 0; i < 2; i++)
        frames[i] = link_ask(rig, 1, HGP_T_frame_request, &settled);
    link_expect(rig, link_ask(rig, 1, HGP_T_frame_cancel, &cancel), HGP_T_ok); // of none
    for (int i = 1; i >= 0; i--) {
        cancel.request = frames[i];
        cancelling[i] = link_ask(rig, 1, HGP_T_frame_cancel, &cancel);
        link_expect_error(rig, frames[i], HG_E_CANCELLED, NULL);
        link_expect(rig, cancelling[i], HGP_T_ok);
    }
    link_expect(rig, link_ask(rig, 1, HGP_T_frame_cancel, &cancel), HGP_T_ok); // is over
    cancel.view++;
    link_expect_error(rig, link_ask(rig, 1, HGP_T_frame_cancel, &cancel), HG_E_NOTFOUND, NULL);
    // Two pulses without work: nothing is rendered any more.
    for (int idle = 0; idle < 2;) {
        link_read(rig);
        idle += rig->header.type == HGP_T_pulse && rig->message.pulse.busy_ns == 0;
        assert_int_not_equal(rig->header.type, HGP_T_progress);
    }
    samples.samples = SAMPLES;
    link_expect(rig, link_ask(rig, 1, HGP_T_view_set, &samples), HGP_T_ok);
    link_expect(rig, link_ask(rig, 1, HGP_T_frame_request, &settled), HGP_T_frame);
}

// What an open batch has removed is in no picture any more that is picked from, its own or
// another's.
static void test_picks_within_a_batch(void **state)
{
    struct rig *rig = *state;
    link_attach(rig, 1, "a");
    make_scene_and_view(rig);
    struct hgp_frame_request settled = {.view = VIEW, .settled = true};
    struct hgp_pick pick = {.view = VIEW, .x = SIDE / 2, .y = SIDE / 2};
    link_expect(rig, link_ask(rig, 1, HGP_T_frame_request, &settled), HGP_T_frame);
    link_expect(rig, link_ask(rig, 1, HGP_T_batch_begin, &(struct hgp_batch_begin){0}), HGP_T_ok);
    struct hgp_object_remove remove = {.kind = HGP_object_kind_NODE, .object = FIRST_ID};
    link_expect(rig, link_ask(rig, 1, HGP_T_object_remove, &remove), HGP_T_ok);
    remove.kind = HGP_object_kind_MESH;
    link_expect(rig, link_ask(rig, 1, HGP_T_object_remove, &remove), HGP_T_ok);
    link_expect(rig, link_ask(rig, 1, HGP_T_pick, &pick), HGP_T_picked);
    assert_false(rig->message.picked.hit);
    link_expect(rig, link_ask(rig, 1, HGP_T_batch_end, &(struct hgp_batch_end){0}), HGP_T_ok);
}

// A batch that is left open stops no pictures: they say which revision they show.
static void test_a_batch_left_open(void **state)
{
    struct rig *rig = *state;
    link_attach(rig, 1, "a");
    make_scene_and_view(rig);
    struct hgp_frame_request settled = {.view = VIEW, .settled = true};
    link_expect(rig, link_ask(rig, 1, HGP_T_frame_request, &settled), HGP_T_frame);
    const uint64_t before = rig->message.frame.scene_revision;
    link_expect(rig, link_ask(rig, 1, HGP_T_batch_begin, &(struct hgp_batch_begin){0}), HGP_T_ok);
    struct hgp_object_remove remove = {.kind = HGP_object_kind_NODE, .object = FIRST_ID};
    link_expect(rig, link_ask(rig, 1, HGP_T_object_remove, &remove), HGP_T_ok);
    link_expect(rig, link_ask(rig, 1, HGP_T_frame_request, &settled), HGP_T_frame);
    assert_int_equal(rig->message.frame.scene_revision, before + 1);
    link_expect(rig, link_ask(rig, 1, HGP_T_batch_end, &(struct hgp_batch_end){0}), HGP_T_ok);
    assert_int_equal(rig->message.ok.revision, before + 1); // all of it was published
}

// No session has a name; with `later` all numbers are by one higher.
static void write_triangle(const char *folder, const char *name, bool later)
{
    char text[1024];
    snprintf(text, sizeof text,
        "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[%s]}],"
        "\"nodes\":[%s{\"mesh\":0}],\"materials\":[%s{}],"
        "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"material\":%d}]}],"
        "\"buffers\":[{\"byteLength\":36,\"uri\":\"data:application/octet-stream;base64,"
        "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA\"}],"
        "\"bufferViews\":[{\"buffer\":0,\"byteLength\":36}],\"accessors\":[{\"bufferView\":0,"
        "\"componentType\":5126,\"count\":3,\"type\":\"VEC3\",\"min\":[0,0,0],\"max\":[1,1,0]}]}",
        later ? "0,1" : "0", later ? "{}," : "", later ? "{\"doubleSided\":true}," : "", later);
    test_text_write(folder, name, text);
}

// The hash of what a settled frame is made from.
static void job_of(struct rig *rig, uint8_t hash[32])
{
    link_expect(
        rig, link_ask(rig, 1, HGP_T_job_query, &(struct hgp_job_query){.view = VIEW}), HGP_T_job);
    memcpy(hash, rig->message.job.hash, 32);
}

static void set_node(struct rig *rig, struct hgp_node_set node)
{
    node.node = FIRST_ID;
    link_expect(rig, link_ask(rig, 1, HGP_T_node_set, &node), HGP_T_ok);
}

// Seeds have all 32 bits, and files hold them so.
static void test_files_tell_their_seed(void **state)
{
    static const char told[] = "heliograph:seed\0double\0\x08\0\0"; // and one more zero
    struct rig *rig = *state;
    const struct hgp_view_set seed = {.view = VIEW, .has_seed = true, .seed = 4294967295u};
    const struct hgp_frame_request request = {
        .view = VIEW, .settled = true, .has_encoding = true, .encoding = HGP_encoding_EXR_HALF};
    double value;
    link_attach(rig, 1, "a");
    make_scene_and_view(rig);
    link_expect(rig, link_ask(rig, 1, HGP_T_view_set, &seed), HGP_T_ok);
    link_expect(rig, link_ask(rig, 1, HGP_T_frame_request, &request), HGP_T_frame);
    const struct hgp_bytes file = rig->message.frame.data;
    const uint8_t *at = memmem(file.data, file.size, told, sizeof told);
    assert_true(at && at + sizeof told + sizeof value <= file.data + file.size);
    memcpy(&value, at + sizeof told, sizeof value);
    assert_true(value == 4294967295.0);
}

// Names of files are in mattes of files, numbers of objects in planes and in names of those that
// have none: only there two scenes differ that show the same.
static void test_jobs_of_names(void **state)
{
    static const char *const files[] = {"one.gltf", "other.gltf", "later.gltf"};
    static const struct {
        enum hgp_plane plane;
        bool name, number; // counts
    } cases[] = {{HGP_plane_DEPTH, false, false}, {HGP_plane_CRYPTO_ASSET, true, false},
        {HGP_plane_OBJECT, false, true}, {HGP_plane_CRYPTO_OBJECT, false, true},
        {HGP_plane_MATERIAL, false, true}, {HGP_plane_CRYPTO_MATERIAL, false, true}};
    struct rig *rig = *state;
    link_attach(rig, 1, "a");
    make_scene_and_view(rig);
    for (int i = 0; i < 3; i++)
        write_triangle(rig->root, files[i], i == 2);
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        uint8_t jobs[3][32];
        const struct hgp_view_set planes = {.view = VIEW,
            .has_mode = true,
            .mode = HGP_render_mode_PATH,
            .has_planes = true,
            .planes = 1u << cases[c].plane};
        link_expect(rig, link_ask(rig, 1, HGP_T_view_set, &planes), HGP_T_ok);
        for (int i = 0; i < 3; i++) {
            const struct hgp_asset_load load = {.asset = FIRST_ID, .path = hgp_str_make(files[i])};
            link_expect(rig, link_ask(rig, 1, HGP_T_asset_load, &load), HGP_T_asset_loaded);
            job_of(rig, jobs[i]);
            const struct hgp_asset_unload gone = {.asset = FIRST_ID};
            link_expect(rig, link_ask(rig, 1, HGP_T_asset_unload, &gone), HGP_T_ok);
        }
        assert_int_equal(memcmp(jobs[1], jobs[0], 32) != 0, cases[c].name);
        assert_int_equal(memcmp(jobs[2], jobs[0], 32) != 0, cases[c].name || cases[c].number);
    }
}

// Where a node will be counts where a shutter is open, and until the node is moved without it.
static void test_next_place_of_nodes(void **state)
{
    struct rig *rig = *state;
    uint8_t still[32], told[32], other[32];
    const struct hgp_node_set stay = {.has_translation = true, .translation = {1, 0, 0}};
    struct hgp_node_set go = {.has_next_translation = true, .next_translation = {2, 0, 0}};
    struct hgp_view_set blur = {.view = VIEW,
        .has_mode = true,
        .mode = HGP_render_mode_PATH,
        .has_shutter_close = true,
        .shutter_close = 0.5f};
    link_attach(rig, 1, "a");
    make_scene_and_view(rig);
    set_node(rig, stay);
    job_of(rig, still);
    set_node(rig, go);
    job_of(rig, told);
    assert_memory_equal(told, still, 32); // nothing looks at other times
    link_expect(rig, link_ask(rig, 1, HGP_T_view_set, &blur), HGP_T_ok);
    job_of(rig, told);
    go.has_translation = true; // with a place of its own: the same
    go.translation[0] = 1;
    set_node(rig, go);
    job_of(rig, other);
    assert_memory_equal(other, told, 32);
    set_node(rig, (struct hgp_node_set){.has_next_scale = true, .next_scale = {2, 2, 2}});
    job_of(rig, other); // both
    assert_memory_not_equal(other, told, 32);
    set_node(rig, stay);
    job_of(rig, still);
    assert_memory_not_equal(still, told, 32);
    assert_memory_not_equal(still, other, 32);
    set_node(rig, (struct hgp_node_set){.has_visible = true, .visible = true});
    set_node(rig, go);
    job_of(rig, other); // the scale went with the move
    assert_memory_equal(other, told, 32);
    const struct hgp_node_set none = {.node = FIRST_ID, .has_next_rotation = true};
    link_expect_error(rig, link_ask(rig, 1, HGP_T_node_set, &none), HG_E_INVAL, "next_rotation");
    test_text_write(rig->root, "one.gltf",
        "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],"
        "\"nodes\":[{\"matrix\":[2,0,0,0,0,2,0,0,0,0,2,0,0,0,0,1]}]}");
    link_expect(rig,
        link_ask(rig, 1, HGP_T_asset_load,
            &(struct hgp_asset_load){.asset = FIRST_ID, .path = hgp_str_make("one.gltf")}),
        HGP_T_asset_loaded);
    go.node = (uint64_t)FIRST_ID << 32;
    go.has_translation = false; // between a matrix and a place there is no way
    link_expect_error(rig, link_ask(rig, 1, HGP_T_node_set, &go), HG_E_STATE, "next");
    go.has_translation = true;
    link_expect(rig, link_ask(rig, 1, HGP_T_node_set, &go), HGP_T_ok);
}

// Pictures in motion are made of several where there is global illumination, unless a message
// says otherwise: a view's size in motion is told only of such.
static bool is_on_host(struct rig *rig)
{
    link_expect(
        rig, link_ask(rig, 1, HGP_T_stats_query, &(struct hgp_stats_query){.view = 1}), HGP_T_json);
    const struct hgp_str *text = &rig->message.json.text;
    return memmem(text->data, text->size, "\"type\":\"cpu\"", 12) != NULL;
}

// The worker has 4 GiB, of which views get 3: at 480 bytes 6.7 million pixels, three quarters of
// them for sessions with more than 0.4.
static void test_sessions_share_memory_for_views(void **state)
{
    struct rig *rig = *state;
    const struct hgp_view_set
        large = {.view = 1, .has_width = true, .width = 1500, .has_height = true, .height = 2000},
        small = {.view = 1, .has_width = true, .width = 600, .has_height = true, .height = 600};
    struct hgp_view_set second = large;
    second.view = 2;
    for (uint32_t channel = 1; channel <= 2; channel++)
        link_attach(rig, channel, "a");
    link_expect(rig, link_ask(rig, 1, HGP_T_view_set, &large), HGP_T_ok);
    if (!is_on_host(rig)) {
        print_message("the device has memory of its own\n");
        return;
    }
    link_expect_error(rig, link_ask(rig, 1, HGP_T_view_set, &second), HG_E_LIMIT, "width");
    link_expect_error(rig, link_ask(rig, 2, HGP_T_view_set, &large), HG_E_LIMIT, "width");
    link_expect(rig, link_ask(rig, 2, HGP_T_view_set, &small), HGP_T_ok);
    link_expect_error(rig, link_ask(rig, 2, HGP_T_view_set, &large), HG_E_LIMIT, "width");
    link_expect(rig, link_ask(rig, 1, HGP_T_view_set, &small), HGP_T_ok);
    link_expect(rig, link_ask(rig, 2, HGP_T_view_set, &large), HGP_T_ok);
    const uint32_t refused = link_ask(rig, 1, HGP_T_view_set, &large);
    link_expect_error(rig, refused, HG_E_LIMIT, "width");
    assert_int_equal(rig->limited.request, refused);
    assert_string_equal(rig->limit, "memory-limit");
    link_expect(
        rig, link_ask(rig, 2, HGP_T_view_close, &(struct hgp_view_close){.view = 1}), HGP_T_ok);
    link_expect(rig, link_ask(rig, 1, HGP_T_view_set, &large), HGP_T_ok);
}

static int start_with_4_gib(void **state)
{
    return link_start_with(state, (const char *[]){"--memory-limit", "4096", NULL});
}

static void test_pictures_in_motion(void **state)
{
    static const struct {
        bool has_gi, has_temporal;
        enum hgp_temporal temporal;
        const char *motion;
    } cases[] = {{true, false, 0, "\"motion\":{\"width\":0,"},
        {true, true, HGP_temporal_AUTO, "\"motion\":{\"width\":64,"},
        {false, false, 0, "\"motion\":{\"width\":64,"},
        {false, true, HGP_temporal_NONE, "\"motion\":{\"width\":0,"}};
    struct rig *rig = *state;
    link_attach(rig, 1, "a");
    make_scene_and_view(rig);
    for (uint32_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const uint32_t number = VIEW + 1 + i;
        struct hgp_view_set view = {.view = number,
            .has_width = true,
            .width = SIDE,
            .has_height = true,
            .height = SIDE,
            .has_samples = true,
            .samples = SAMPLES,
            .has_gi = cases[i].has_gi,
            .gi = HGP_gi_NONE,
            .has_temporal = cases[i].has_temporal,
            .temporal = cases[i].temporal};
        const struct hgp_frame_request now = {
            .view = number, .has_encoding = true, .encoding = HGP_encoding_RAW_RGBA8};
        link_expect(rig, link_ask(rig, 1, HGP_T_view_set, &view), HGP_T_ok);
        // Messages later say nothing of it.
        view = (struct hgp_view_set){.view = number, .has_seed = true, .seed = 5};
        link_expect(rig, link_ask(rig, 1, HGP_T_view_set, &view), HGP_T_ok);
        link_expect(rig, link_ask(rig, 1, HGP_T_frame_request, &now), HGP_T_frame);
        link_expect(rig,
            link_ask(rig, 1, HGP_T_stats_query, &(struct hgp_stats_query){.view = number}),
            HGP_T_json);
        assert_non_null(memmem(rig->message.json.text.data, rig->message.json.text.size,
            cases[i].motion, strlen(cases[i].motion)));
    }
}

// Notices about geometry until the settled frame; `text` is the newest one.
static int count_untraced(struct rig *rig, char *text, size_t size)
{
    const uint32_t request = link_ask(
        rig, 1, HGP_T_frame_request, &(struct hgp_frame_request){.view = VIEW, .settled = true});
    for (int notices = 0;;) {
        link_read(rig);
        const struct hgp_notice *n = &rig->message.notice;
        if (rig->header.type == HGP_T_notice && n->what.size == strlen("geometry") &&
            memcmp(n->what.data, "geometry", n->what.size) == 0) {
            snprintf(text, size, "%.*s", (int)n->reason.size, n->reason.data);
            notices++;
        }
        assert_int_not_equal(rig->header.type, HGP_T_error);
        if (rig->header.type == HGP_T_frame && rig->header.request == request)
            return notices;
    }
}

static void test_lines_that_path_mode_leaves_out_are_told(void **state)
{
    struct rig *rig = *state;
    const float corners[] = {-1, -1, 1, 1, -1, 1, 0, 1, 1};
    const struct hgp_mesh_part parts[] = {
        {.mode = HGP_primitive_mode_LINE_LOOP,
            .positions = {(const uint8_t *)corners, sizeof corners}},
        {.mode = HGP_primitive_mode_LINE_STRIP,
            .positions = {(const uint8_t *)corners, sizeof corners}}};
    const struct hgp_mesh_set mesh = {.mesh = FIRST_ID + 1, .parts = {parts, 2}};
    const struct hgp_node_set node = {.node = FIRST_ID + 1, .has_mesh = true, .mesh = FIRST_ID + 1};
    struct hgp_node_override hidden = {.node = FIRST_ID + 1, .set = 1, .hidden = true};
    const struct hgp_view_overrides look = {.view = VIEW, .overrides = {&hidden, 1}};
    struct hgp_view_set path = {.view = VIEW, .has_mode = true, .mode = HGP_render_mode_PATH};
    char text[200] = "";
    link_attach(rig, 1, "a");
    make_scene_and_view(rig);
    link_expect(rig, link_ask(rig, 1, HGP_T_mesh_set, &mesh), HGP_T_ok);
    link_expect(rig, link_ask(rig, 1, HGP_T_node_set, &node), HGP_T_ok);
    assert_int_equal(count_untraced(rig, text, sizeof text), 0);
    link_expect(rig, link_ask(rig, 1, HGP_T_view_set, &path), HGP_T_ok);
    assert_int_equal(count_untraced(rig, text, sizeof text), 1);
    assert_string_equal(text, "path-traced pictures leave out 2 primitives of lines");
    assert_int_equal(count_untraced(rig, text, sizeof text), 0); // it is known
    link_expect(rig, link_ask(rig, 1, HGP_T_view_overrides, &look), HGP_T_ok);
    assert_int_equal(count_untraced(rig, text, sizeof text), 0); // nothing is missing
    hidden.hidden = false;
    link_expect(rig, link_ask(rig, 1, HGP_T_view_overrides, &look), HGP_T_ok);
    assert_int_equal(count_untraced(rig, text, sizeof text), 1);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_teardown(name, link_detach)
    const struct CMUnitTest tests[] = {
        TEST(test_a_subscription_keeps_to_its_credit_and_ends_settled),
        TEST(test_a_camera_that_moves_gets_pictures_of_one_sample),
        TEST(test_a_camera_has_to_look_somewhere),
        TEST(test_picks_and_a_view_closed_while_frames_wait),
        TEST(test_frames_are_cancelled),
        TEST(test_picks_within_a_batch),
        TEST(test_a_batch_left_open),
        TEST(test_next_place_of_nodes),
        TEST(test_files_tell_their_seed),
        TEST(test_jobs_of_names),
        TEST(test_pictures_in_motion),
        TEST(test_lines_that_path_mode_leaves_out_are_told),
        cmocka_unit_test_setup_teardown(
            test_sessions_share_memory_for_views, start_with_4_gib, link_stop),
    };
    return cmocka_run_group_tests_name("worker_link_views", tests, link_start, link_stop);
}
