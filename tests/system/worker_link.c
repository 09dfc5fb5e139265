// worker_link.c - a real helio-worker on a socketpair, spoken to message by message.
// Only the test of a view needs a device; lavapipe will do.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <errno.h>
#include <linux/magic.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/vfs.h>
#include <sys/wait.h>
#include <unistd.h>

#include "protocol/hgp.h"
#include "tests/support/folder.h"

extern char **environ;

enum { ANSWER_TIMEOUT_MS = 60000, FIRST_ID = 1000, ID_COUNT = 100 };

struct rig {
    int fd;
    pid_t pid;
    char root[TEST_FOLDER_MAX], path[4200];
    uint32_t next_request;
    // The newest answer:
    struct hgp_header header;
    uint8_t *payload;
    struct hg_arena arena;
    union hgp_any message;
};

// ---- the rig ------------------------------------------------------------------------------------

static int start_with(void **state, const char *option, const char *value)
{
    struct rig *rig = calloc(1, sizeof *rig);
    int pair[2];
    const char *build = getenv("HELIO_BUILD_DIR");
    assert_non_null(build);
    snprintf(rig->path, sizeof rig->path, "%s/libexec/helio-worker", build);
    assert_true(test_folder_make(rig->root, "worker"));
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair), 0);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, pair[1], 3);
    char *argv[] = {rig->path, "--fd", "3", "--asset-root", rig->root, "--log", "warn",
        (char *)(uintptr_t)option, (char *)(uintptr_t)value, NULL};
    assert_int_equal(posix_spawn(&rig->pid, rig->path, &actions, NULL, argv, environ), 0);
    posix_spawn_file_actions_destroy(&actions);
    close(pair[1]);
    rig->fd = pair[0];
    *state = rig;
    return 0;
}

static int start(void **state)
{
    return start_with(state, NULL, NULL);
}

static char *cache_folder(char *path, size_t size)
{
    snprintf(path, size, "%s/tests", getenv("HELIO_BUILD_DIR"));
    return path;
}

// With a folder for what is large; on a disk, where the build is on one.
static int start_with_cache(void **state)
{
    char folder[4200];
    return start_with(state, "--cache-dir", cache_folder(folder, sizeof folder));
}

static void forget_answer(struct rig *rig)
{
    free(rig->payload);
    rig->payload = NULL;
    hg_arena_finish(&rig->arena);
}

static int stop(void **state)
{
    struct rig *rig = *state;
    int how;
    forget_answer(rig);
    close(rig->fd);
    // Closing the link is the order to end; the worker leaves cleanly.
    assert_int_equal(waitpid(rig->pid, &how, 0), rig->pid);
    assert_true(WIFEXITED(how));
    assert_int_equal(WEXITSTATUS(how), 0);
    assert_true(test_folder_remove(rig->root));
    free(rig);
    return 0;
}

static void write_all(int fd, const void *data, size_t size)
{
    for (size_t done = 0; done < size;) {
        ssize_t n = send(fd, (const uint8_t *)data + done, size - done, MSG_NOSIGNAL);
        assert_true(n > 0 || errno == EINTR);
        done += n > 0 ? (size_t)n : 0;
    }
}

static void read_all(int fd, void *data, size_t size)
{
    for (size_t done = 0; done < size;) {
        struct pollfd p = {.fd = fd, .events = POLLIN};
        assert_int_equal(poll(&p, 1, ANSWER_TIMEOUT_MS), 1);
        ssize_t n = recv(fd, (uint8_t *)data + done, size - done, 0);
        assert_true(n > 0);
        done += (size_t)n;
    }
}

static uint32_t ask(struct rig *rig, uint32_t channel, enum hgp_type type, const void *message)
{
    struct hg_writer w = {0};
    uint32_t request = ++rig->next_request;
    assert_int_equal(hgp_encode(&w, HGP_VERSION_MAX, (struct hgp_envelope){type, request, channel},
                         message, NULL),
        HG_OK);
    write_all(rig->fd, w.data, w.size);
    hg_writer_finish(&w);
    return request;
}

static void read_message(struct rig *rig)
{
    uint8_t bytes[HGP_HEADER_BYTES];
    forget_answer(rig);
    read_all(rig->fd, bytes, sizeof bytes);
    assert_int_equal(hgp_header_decode(bytes, sizeof bytes, 1 << 28, &rig->header), HG_OK);
    rig->payload = malloc(rig->header.length + 1);
    read_all(rig->fd, rig->payload, rig->header.length);
    assert_int_equal(
        hgp_decode(HGP_VERSION_MAX, rig->header.type,
            hg_reader_make(rig->payload, rig->header.length), &rig->arena, &rig->message, NULL),
        HG_OK);
}

// Reads until the final answer of `request`; pulses, progress and notices pass by.
static void expect(struct rig *rig, uint32_t request, enum hgp_type type)
{
    for (;;) {
        read_message(rig);
        if (rig->header.request == request && rig->header.type != HGP_T_progress &&
            rig->header.type != HGP_T_notice)
            break;
    }
    if (rig->header.type != type)
        fail_msg("message 0x%04x instead of 0x%04x: %.*s", rig->header.type, type,
            rig->header.type == HGP_T_error ? (int)rig->message.error.reason.size : 0,
            rig->message.error.reason.data);
}

static void expect_error(struct rig *rig, uint32_t request, enum hg_status code, const char *where)
{
    expect(rig, request, HGP_T_error);
    assert_int_equal(rig->message.error.code, code);
    if (where) {
        assert_int_equal(rig->message.error.where.size, strlen(where));
        assert_memory_equal(rig->message.error.where.data, where, strlen(where));
    }
}

static void attach(struct rig *rig, uint32_t channel, const char *scene)
{
    expect(rig,
        ask(rig, channel, HGP_T_session_attach,
            &(struct hgp_session_attach){.session = channel,
                .role = HGP_role_EDIT,
                .scene = hgp_str_make(scene),
                .first_id = FIRST_ID * channel,
                .id_count = ID_COUNT,
                .max_pixels = 1 << 24}),
        HGP_T_ok);
}

// ---- tests --------------------------------------------------------------------------------------

static void test_channels_without_a_session_are_refused(void **state)
{
    struct rig *rig = *state;
    expect_error(
        rig, ask(rig, 7, HGP_T_batch_begin, &(struct hgp_batch_begin){0}), HG_E_STATE, NULL);
}

static void test_malformed_payload_names_the_field(void **state)
{
    struct rig *rig = *state;
    attach(rig, 1, "a");
    // light_set whose `kind` is no light: u64 id, u32 presence bits come first in some order, so
    // the bytes are made by the codec and then broken at the end, where the enum value stands.
    struct hg_writer w = {0};
    struct hgp_light_set m = {.light = FIRST_ID, .has_kind = true, .kind = HGP_light_kind_SPOT};
    assert_int_equal(
        hgp_encode(&w, HGP_VERSION_MAX, (struct hgp_envelope){HGP_T_light_set, 99, 1}, &m, NULL),
        HG_OK);
    w.data[w.size - 1] = 0x7f;
    write_all(rig->fd, w.data, w.size);
    hg_writer_finish(&w);
    expect_error(rig, 99, HG_E_INVAL, "kind");
}

static void test_ids_stay_in_the_sessions_range(void **state)
{
    struct rig *rig = *state;
    attach(rig, 1, "a");
    struct hgp_light_set inside = {.light = FIRST_ID + ID_COUNT - 1};
    struct hgp_light_set outside = {.light = FIRST_ID + ID_COUNT};
    expect(rig, ask(rig, 1, HGP_T_light_set, &inside), HGP_T_ok);
    expect_error(rig, ask(rig, 1, HGP_T_light_set, &outside), HG_E_NOTFOUND, NULL);
}

static void test_sessions_with_one_key_share_the_scene(void **state)
{
    struct rig *rig = *state;
    attach(rig, 1, "shared");
    attach(rig, 2, "shared");
    attach(rig, 3, "other");
    struct hgp_node_set make = {.node = FIRST_ID, .has_name = true, .name = hgp_str_make("lamp")};
    expect(rig, ask(rig, 1, HGP_T_node_set, &make), HGP_T_ok);
    uint64_t revision = rig->message.ok.revision;
    struct hgp_nodes_query all = {.count = 10};
    expect(rig, ask(rig, 2, HGP_T_nodes_query, &all), HGP_T_nodes);
    assert_int_equal(rig->message.nodes.revision, revision);
    assert_int_equal(rig->message.nodes.total, 1);
    assert_memory_equal(rig->message.nodes.nodes.items[0].name.data, "lamp", 4);
    expect(rig, ask(rig, 3, HGP_T_nodes_query, &all), HGP_T_nodes);
    assert_int_equal(rig->message.nodes.total, 0);
}

static void test_a_batch_is_one_revision(void **state)
{
    struct rig *rig = *state;
    attach(rig, 1, "a");
    expect(rig, ask(rig, 1, HGP_T_batch_begin, &(struct hgp_batch_begin){0}), HGP_T_ok);
    uint64_t before = rig->message.ok.revision;
    for (uint64_t i = 0; i < 5; i++)
        expect(rig, ask(rig, 1, HGP_T_node_set, &(struct hgp_node_set){.node = FIRST_ID + i}),
            HGP_T_ok);
    assert_int_equal(rig->message.ok.revision, before);
    expect(rig, ask(rig, 1, HGP_T_batch_end, &(struct hgp_batch_end){0}), HGP_T_ok);
    assert_int_equal(rig->message.ok.revision, before + 1);
    expect_error(rig, ask(rig, 1, HGP_T_batch_end, &(struct hgp_batch_end){0}), HG_E_STATE, NULL);
}

static void test_refused_edits_change_nothing(void **state)
{
    struct rig *rig = *state;
    attach(rig, 1, "a");
    struct hgp_node_set parent = {.node = FIRST_ID},
                        child = {.node = FIRST_ID + 1, .has_parent = true, .parent = FIRST_ID};
    expect(rig, ask(rig, 1, HGP_T_node_set, &parent), HGP_T_ok);
    expect(rig, ask(rig, 1, HGP_T_node_set, &child), HGP_T_ok);
    uint64_t revision = rig->message.ok.revision;
    struct hgp_node_set cycle = {.node = FIRST_ID, .has_parent = true, .parent = FIRST_ID + 1};
    struct hgp_node_set no_mesh = {.node = FIRST_ID, .has_mesh = true, .mesh = 5};
    struct hgp_node_set no_turn = {.node = FIRST_ID, .has_rotation = true};
    expect_error(rig, ask(rig, 1, HGP_T_node_set, &cycle), HG_E_INVAL, "parent");
    expect_error(rig, ask(rig, 1, HGP_T_node_set, &no_mesh), HG_E_NOTFOUND, "mesh");
    expect_error(rig, ask(rig, 1, HGP_T_node_set, &no_turn), HG_E_INVAL, "rotation");
    expect(rig, ask(rig, 1, HGP_T_nodes_query, &(struct hgp_nodes_query){.count = 9}), HGP_T_nodes);
    assert_int_equal(rig->message.nodes.revision, revision);
}

static void test_client_meshes_are_checked_and_bounded(void **state)
{
    struct rig *rig = *state;
    attach(rig, 1, "a");
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
    expect_error(rig, ask(rig, 1, HGP_T_mesh_set, &m), HG_E_INVAL, "indices");
    part.indices.data = (const uint8_t *)good;
    expect(rig, ask(rig, 1, HGP_T_mesh_set, &m), HGP_T_ok);
    struct hgp_node_set node = {.node = FIRST_ID,
        .has_mesh = true,
        .mesh = FIRST_ID,
        .has_translation = true,
        .translation = {10, 0, 0}};
    expect(rig, ask(rig, 1, HGP_T_node_set, &node), HGP_T_ok);
    expect(rig, ask(rig, 1, HGP_T_bounds_query, &(struct hgp_bounds_query){0}), HGP_T_bounds);
    assert_false(rig->message.bounds.empty);
    assert_float_equal(rig->message.bounds.min[0], 10, 1e-6);
    assert_float_equal(rig->message.bounds.max[0], 12, 1e-6);
    assert_float_equal(rig->message.bounds.max[1], 3, 1e-6);
}

static void test_files_outside_the_roots_are_not_told_apart(void **state)
{
    struct rig *rig = *state;
    attach(rig, 1, "a");
    struct hgp_asset_load there = {.asset = FIRST_ID, .path = hgp_str_make("/etc/passwd")};
    struct hgp_asset_load absent = {
        .asset = FIRST_ID, .path = hgp_str_make("/etc/no-such-file.glb")};
    struct hgp_asset_load above = {.asset = FIRST_ID, .path = hgp_str_make("../../etc/passwd")};
    struct hgp_asset_load missing = {.asset = FIRST_ID, .path = hgp_str_make("missing.glb")};
    expect_error(rig, ask(rig, 1, HGP_T_asset_load, &there), HG_E_PERM, NULL);
    expect_error(rig, ask(rig, 1, HGP_T_asset_load, &absent), HG_E_PERM, NULL);
    expect_error(rig, ask(rig, 1, HGP_T_asset_load, &above), HG_E_PERM, NULL);
    expect_error(rig, ask(rig, 1, HGP_T_asset_load, &missing), HG_E_NOTFOUND, NULL);
}

static void test_messages_behind_a_load_keep_their_order(void **state)
{
    struct rig *rig = *state;
    test_text_write(rig->root, "one.gltf",
        "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],"
        "\"nodes\":[{\"name\":\"from the file\"}]}");
    attach(rig, 1, "a");
    // The rename and the query leave before the load has answered, and must see its node.
    uint64_t node = (uint64_t)FIRST_ID << 32;
    uint32_t load = ask(rig, 1, HGP_T_asset_load,
        &(struct hgp_asset_load){.asset = FIRST_ID, .path = hgp_str_make("one.gltf")});
    uint32_t rename = ask(rig, 1, HGP_T_node_set,
        &(struct hgp_node_set){.node = node, .has_name = true, .name = hgp_str_make("renamed")});
    uint32_t list = ask(rig, 1, HGP_T_nodes_query, &(struct hgp_nodes_query){.count = 9});
    expect(rig, load, HGP_T_asset_loaded);
    assert_int_equal(rig->message.asset_loaded.nodes, 1);
    expect(rig, rename, HGP_T_ok);
    expect(rig, list, HGP_T_nodes);
    assert_int_equal(rig->message.nodes.nodes.items[0].name.size, strlen("renamed"));
}

static void test_an_assets_transform_moves_it_and_goes_with_it(void **state)
{
    struct rig *rig = *state;
    test_text_write(rig->root, "one.gltf",
        "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{}]"
        "}");
    attach(rig, 1, "a");
    struct hgp_asset_load m = {.asset = FIRST_ID,
        .path = hgp_str_make("one.gltf"),
        .has_transform = true,
        .transform = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 4, 5, 6, 1}};
    for (int round = 0; round < 2; round++) { // twice: nothing of the first may be left
        expect(rig, ask(rig, 1, HGP_T_asset_load, &m), HGP_T_asset_loaded);
        expect(rig, ask(rig, 1, HGP_T_nodes_query, &(struct hgp_nodes_query){.count = 9}),
            HGP_T_nodes);
        assert_int_equal(rig->message.nodes.total, 2);
        expect(rig, ask(rig, 1, HGP_T_asset_unload, &(struct hgp_asset_unload){.asset = FIRST_ID}),
            HGP_T_ok);
        expect(rig, ask(rig, 1, HGP_T_nodes_query, &(struct hgp_nodes_query){.count = 9}),
            HGP_T_nodes);
        assert_int_equal(rig->message.nodes.total, 0);
    }
}

static void test_comparison_of_bytes_that_are_no_image(void **state)
{
    struct rig *rig = *state;
    attach(rig, 1, "a");
    struct hgp_compare m = {.metric = HGP_metric_PSNR,
        .a = {(const uint8_t *)"no", 2},
        .b = {(const uint8_t *)"no", 2}};
    expect_error(rig, ask(rig, 1, HGP_T_compare, &m), HG_E_FORMAT, NULL);
}

static void test_refused_edits_make_no_objects(void **state)
{
    struct rig *rig = *state;
    attach(rig, 1, "a");
    struct hgp_light_set light = {.light = FIRST_ID,
        .has_inner_cone_rad = true,
        .inner_cone_rad = 0.7f,
        .has_outer_cone_rad = true,
        .outer_cone_rad = 0.5f};
    struct hgp_material_set material = {
        .material = FIRST_ID, .has_base_color_texture = true, .base_color_texture = FIRST_ID + 9};
    struct hgp_object_remove remove = {.kind = HGP_object_kind_LIGHT, .object = FIRST_ID};
    expect_error(rig, ask(rig, 1, HGP_T_light_set, &light), HG_E_INVAL, "inner_cone_rad");
    expect_error(rig, ask(rig, 1, HGP_T_object_remove, &remove), HG_E_NOTFOUND, NULL);
    expect_error(rig, ask(rig, 1, HGP_T_material_set, &material), HG_E_NOTFOUND, "texture");
    remove.kind = HGP_object_kind_MATERIAL;
    expect_error(rig, ask(rig, 1, HGP_T_object_remove, &remove), HG_E_NOTFOUND, NULL);
}

static void test_scene_open_without_a_session_is_answered(void **state)
{
    struct rig *rig = *state;
    expect_error(rig, ask(rig, 5, HGP_T_scene_open, &(struct hgp_scene_open){0}), HG_E_STATE, NULL);
}

// A peer that dies leaves answers unread, which resets the stream: stop() wants exit code 0.
static void test_a_peer_may_leave_without_reading(void **state)
{
    struct rig *rig = *state;
    attach(rig, 1, "a");
    ask(rig, 1, HGP_T_nodes_query, &(struct hgp_nodes_query){.count = 9});
    struct pollfd p = {.fd = rig->fd, .events = POLLIN};
    assert_int_equal(poll(&p, 1, ANSWER_TIMEOUT_MS), 1);
}

// ---- a view -------------------------------------------------------------------------------------

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
    expect(rig, ask(rig, 1, HGP_T_environment_set, &sky), HGP_T_ok);
    expect(rig, ask(rig, 1, HGP_T_mesh_set, &mesh), HGP_T_ok);
    struct hgp_node_set node = {.node = FIRST_ID, .has_mesh = true, .mesh = FIRST_ID};
    expect(rig, ask(rig, 1, HGP_T_node_set, &node), HGP_T_ok);
    struct hgp_view_set view = {.view = VIEW,
        .has_width = true,
        .width = SIDE,
        .has_height = true,
        .height = SIDE,
        .has_samples = true,
        .samples = SAMPLES,
        .has_background = true,
        .background = HGP_background_NONE,
        .has_max_fps = true,
        .max_fps = 1000};
    struct hgp_view_camera camera = {
        .view = VIEW, .input_seq = 41, .has_eye = true, .eye = {0, 0, 4}, .has_target = true};
    expect(rig, ask(rig, 1, HGP_T_view_set, &view), HGP_T_ok);
    expect(rig, ask(rig, 1, HGP_T_view_camera, &camera), HGP_T_ok);
}

// The next frame that nobody asked for by id; NULL when a later pulse shows that none comes.
static const struct hgp_frame *next_subscribed(struct rig *rig, int pulses)
{
    while (pulses > 0) {
        read_message(rig);
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

static void test_a_subscription_keeps_to_its_credit_and_ends_settled(void **state)
{
    struct rig *rig = *state;
    attach(rig, 1, "a");
    make_scene_and_view(rig);
    expect(rig,
        ask(rig, 1, HGP_T_subscribe, &(struct hgp_subscribe){.view = VIEW, .credit_frames = 1}),
        HGP_T_ok);
    uint64_t revision = rig->message.ok.revision;
    assert_non_null(next_subscribed(rig, 100));
    assert_null(next_subscribed(rig, 2)); // the credit is used up
    ask(rig, 1, HGP_T_credit, &(struct hgp_credit){.view = VIEW, .frames = 20});
    uint32_t count = take_until_settled(rig, revision);
    assert_true(count <= 5); // at most 1, 2, 4, 8 samples
    uint8_t settled_hash[32];
    memcpy(settled_hash, rig->message.frame.hash, sizeof settled_hash);
    assert_null(next_subscribed(rig, 2)); // nothing is left to improve

    // The same picture on request, byte for byte.
    struct hgp_frame_request request = {
        .view = VIEW, .settled = true, .has_encoding = true, .encoding = HGP_encoding_RAW_RGBA8};
    expect(rig, ask(rig, 1, HGP_T_frame_request, &request), HGP_T_frame);
    assert_int_equal(rig->message.frame.data.size, SIDE * SIDE * 4);
    assert_memory_equal(rig->message.frame.hash, settled_hash, sizeof settled_hash);

    // An edit starts a new state, shown at once and brought to its end.
    struct hgp_node_set move = {
        .node = FIRST_ID, .has_translation = true, .translation = {0.5f, 0, 0}};
    expect(rig, ask(rig, 1, HGP_T_node_set, &move), HGP_T_ok);
    take_until_settled(rig, rig->message.ok.revision);
    assert_memory_not_equal(rig->message.frame.hash, settled_hash, sizeof settled_hash);
}

static void test_picks_and_a_view_closed_while_frames_wait(void **state)
{
    struct rig *rig = *state;
    attach(rig, 1, "a");
    make_scene_and_view(rig);
    struct hgp_pick pick = {.view = VIEW, .x = SIDE / 2, .y = SIDE / 2};
    expect(rig, ask(rig, 1, HGP_T_pick, &pick), HGP_T_picked);
    assert_true(rig->message.picked.hit);
    assert_int_equal(rig->message.picked.node, FIRST_ID);
    // Many samples: the frame cannot be ready before the view is closed.
    struct hgp_view_set more = {.view = VIEW, .has_samples = true, .samples = 65536};
    expect(rig, ask(rig, 1, HGP_T_view_set, &more), HGP_T_ok);
    struct hgp_frame_request settled = {.view = VIEW, .settled = true};
    uint32_t frame = ask(rig, 1, HGP_T_frame_request, &settled);
    uint32_t closing = ask(rig, 1, HGP_T_view_close, &(struct hgp_view_close){.view = VIEW});
    expect_error(rig, frame, HG_E_CANCELLED, NULL);
    expect(rig, closing, HGP_T_ok);
    expect_error(rig, ask(rig, 1, HGP_T_pick, &pick), HG_E_NOTFOUND, NULL);
    // And a session that ends with a view at work takes it along.
    make_scene_and_view(rig);
    ask(rig, 1, HGP_T_frame_request, &settled);
    ask(rig, 1, HGP_T_session_detach, &(struct hgp_session_detach){0});
    attach(rig, 1, "b");
    expect_error(rig, ask(rig, 1, HGP_T_pick, &pick), HG_E_NOTFOUND, NULL);
}

// What an open batch has removed is in no picture any more that is picked from, its own or
// another's.
static void test_picks_within_a_batch(void **state)
{
    struct rig *rig = *state;
    attach(rig, 1, "a");
    make_scene_and_view(rig);
    struct hgp_frame_request settled = {.view = VIEW, .settled = true};
    struct hgp_pick pick = {.view = VIEW, .x = SIDE / 2, .y = SIDE / 2};
    expect(rig, ask(rig, 1, HGP_T_frame_request, &settled), HGP_T_frame);
    expect(rig, ask(rig, 1, HGP_T_batch_begin, &(struct hgp_batch_begin){0}), HGP_T_ok);
    struct hgp_object_remove remove = {.kind = HGP_object_kind_NODE, .object = FIRST_ID};
    expect(rig, ask(rig, 1, HGP_T_object_remove, &remove), HGP_T_ok);
    remove.kind = HGP_object_kind_MESH;
    expect(rig, ask(rig, 1, HGP_T_object_remove, &remove), HGP_T_ok);
    expect(rig, ask(rig, 1, HGP_T_pick, &pick), HGP_T_picked);
    assert_false(rig->message.picked.hit);
    expect(rig, ask(rig, 1, HGP_T_batch_end, &(struct hgp_batch_end){0}), HGP_T_ok);
}

// A batch that is left open stops no pictures: they say which revision they show.
static void test_a_batch_left_open(void **state)
{
    struct rig *rig = *state;
    attach(rig, 1, "a");
    make_scene_and_view(rig);
    struct hgp_frame_request settled = {.view = VIEW, .settled = true};
    expect(rig, ask(rig, 1, HGP_T_frame_request, &settled), HGP_T_frame);
    const uint64_t before = rig->message.frame.scene_revision;
    expect(rig, ask(rig, 1, HGP_T_batch_begin, &(struct hgp_batch_begin){0}), HGP_T_ok);
    struct hgp_object_remove remove = {.kind = HGP_object_kind_NODE, .object = FIRST_ID};
    expect(rig, ask(rig, 1, HGP_T_object_remove, &remove), HGP_T_ok);
    expect(rig, ask(rig, 1, HGP_T_frame_request, &settled), HGP_T_frame);
    assert_int_equal(rig->message.frame.scene_revision, before + 1);
    expect(rig, ask(rig, 1, HGP_T_batch_end, &(struct hgp_batch_end){0}), HGP_T_ok);
    assert_int_equal(rig->message.ok.revision, before + 1); // all of it was published
}

// Nobody has a name; with `later` all numbers are by one higher.
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
    expect(rig, ask(rig, 1, HGP_T_job_query, &(struct hgp_job_query){.view = VIEW}), HGP_T_job);
    memcpy(hash, rig->message.job.hash, 32);
}

static void set_node(struct rig *rig, struct hgp_node_set node)
{
    node.node = FIRST_ID;
    expect(rig, ask(rig, 1, HGP_T_node_set, &node), HGP_T_ok);
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
    attach(rig, 1, "a");
    make_scene_and_view(rig);
    expect(rig, ask(rig, 1, HGP_T_view_set, &seed), HGP_T_ok);
    expect(rig, ask(rig, 1, HGP_T_frame_request, &request), HGP_T_frame);
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
    attach(rig, 1, "a");
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
        expect(rig, ask(rig, 1, HGP_T_view_set, &planes), HGP_T_ok);
        for (int i = 0; i < 3; i++) {
            const struct hgp_asset_load load = {.asset = FIRST_ID, .path = hgp_str_make(files[i])};
            expect(rig, ask(rig, 1, HGP_T_asset_load, &load), HGP_T_asset_loaded);
            job_of(rig, jobs[i]);
            const struct hgp_asset_unload gone = {.asset = FIRST_ID};
            expect(rig, ask(rig, 1, HGP_T_asset_unload, &gone), HGP_T_ok);
        }
        assert_int_equal(memcmp(jobs[1], jobs[0], 32) != 0, cases[c].name);
        assert_int_equal(memcmp(jobs[2], jobs[0], 32) != 0, cases[c].name || cases[c].number);
    }
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
    const uint32_t request = ask(rig, 1, HGP_T_image_query, &part);
    do
        read_message(rig);
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
    attach(rig, 1, "a");
    const enum hg_status status = send_part(rig, PARTS * PART, 0, &data);
    if (is_memory(cache_folder(folder, sizeof folder))) {
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
    attach(rig, 1, "a");
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
    attach(rig, 1, "a");
    expect_part_refused(rig, UINT64_C(5) << 30, &one, "is 5368709120, and was 2 ");
    expect_part_refused(rig, 2, &two, "2 bytes at 1 reach beyond the file of 2");
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
    attach(rig, 1, "a");
    assert_int_equal(send_part(rig, 2, 0, &one), HG_OK);
    expect(rig, ask(rig, 1, HGP_T_image_query, &whole), HGP_T_json);
    const struct hgp_str *told = &rig->message.json.text;
    assert_non_null(memmem(told->data, told->size, "\"width\":3,", 10));
    assert_int_equal(send_part(rig, 2, 1, &one), HG_E_INVAL);
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
    attach(rig, 1, "a");
    make_scene_and_view(rig);
    set_node(rig, stay);
    job_of(rig, still);
    set_node(rig, go);
    job_of(rig, told);
    assert_memory_equal(told, still, 32); // nothing looks at other times
    expect(rig, ask(rig, 1, HGP_T_view_set, &blur), HGP_T_ok);
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
    expect_error(rig, ask(rig, 1, HGP_T_node_set, &none), HG_E_INVAL, "next_rotation");
    test_text_write(rig->root, "one.gltf",
        "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],"
        "\"nodes\":[{\"matrix\":[2,0,0,0,0,2,0,0,0,0,2,0,0,0,0,1]}]}");
    expect(rig,
        ask(rig, 1, HGP_T_asset_load,
            &(struct hgp_asset_load){.asset = FIRST_ID, .path = hgp_str_make("one.gltf")}),
        HGP_T_asset_loaded);
    go.node = (uint64_t)FIRST_ID << 32;
    go.has_translation = false; // between a matrix and a place there is no way
    expect_error(rig, ask(rig, 1, HGP_T_node_set, &go), HG_E_STATE, "next");
    go.has_translation = true;
    expect(rig, ask(rig, 1, HGP_T_node_set, &go), HGP_T_ok);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, start, stop)
    const struct CMUnitTest tests[] = {
        TEST(test_channels_without_a_session_are_refused),
        TEST(test_malformed_payload_names_the_field),
        TEST(test_ids_stay_in_the_sessions_range),
        TEST(test_sessions_with_one_key_share_the_scene),
        TEST(test_a_batch_is_one_revision),
        TEST(test_refused_edits_change_nothing),
        TEST(test_client_meshes_are_checked_and_bounded),
        TEST(test_files_outside_the_roots_are_not_told_apart),
        TEST(test_messages_behind_a_load_keep_their_order),
        TEST(test_an_assets_transform_moves_it_and_goes_with_it),
        TEST(test_comparison_of_bytes_that_are_no_image),
        TEST(test_refused_edits_make_no_objects),
        TEST(test_scene_open_without_a_session_is_answered),
        TEST(test_a_peer_may_leave_without_reading),
        TEST(test_a_subscription_keeps_to_its_credit_and_ends_settled),
        TEST(test_picks_and_a_view_closed_while_frames_wait),
        TEST(test_picks_within_a_batch),
        TEST(test_a_batch_left_open),
        TEST(test_next_place_of_nodes),
        TEST(test_files_tell_their_seed),
        TEST(test_jobs_of_names),
        TEST(test_verified_files_without_a_disk),
        TEST(test_verified_files_stay_as_large_as_they_began),
        TEST(test_a_whole_file_after_a_part),
        cmocka_unit_test_setup_teardown(test_verified_files_take_no_memory, start_with_cache, stop),
    };
    return cmocka_run_group_tests_name("worker_link", tests, NULL, NULL);
}
