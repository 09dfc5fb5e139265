// loader.c - files that crash, stall or bloat the readers of foreign formats, beside a scene of the
// same worker that goes on: each ends by rule, with an error that names the file and the reason.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/clock.h"
#include "tests/attack/loading.h"
#include "tests/system/worker_link_rig.h"

enum { ATTACKER = 1, NEIGHBOUR = 2, VIEW = 1, SIDE = 16, DEEP = 200000 };

#ifdef __SANITIZE_ADDRESS__ // whose own memory is not to be told from the file's
static const bool memory_is_limited = false;
#else
static const bool memory_is_limited = true;
#endif

// ---- files -------------------------------------------------------------------------------------

static FILE *begin_file(const struct rig *rig, const char *name)
{
    char path[TEST_FOLDER_MAX + 64];
    snprintf(path, sizeof path, "%s/%s", rig->root, name);
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    return file;
}

static void write_collada(const struct rig *rig, const char *name, const char *float_count)
{
    FILE *file = begin_file(rig, name);
    fputs(loading_head, file);
    fprintf(file, loading_geometry, float_count);
    fprintf(file, "%s%s%s", loading_opening, loading_leaf, loading_tail);
    assert_int_equal(fclose(file), 0);
}

// Nodes within nodes: the parser calls itself for each.
static void write_deep(const struct rig *rig, const char *name)
{
    FILE *file = begin_file(rig, name);
    fputs(loading_head, file);
    fprintf(file, loading_geometry, "9");
    fputs(loading_opening, file);
    for (int i = 0; i < DEEP; i++)
        fputs("<node>", file);
    fputs(loading_leaf, file);
    for (int i = 0; i < DEEP; i++)
        fputs("</node>", file);
    fputs(loading_tail, file);
    assert_int_equal(fclose(file), 0);
}

static void write_slow(const struct rig *rig, const char *name)
{
    char path[TEST_FOLDER_MAX + 64];
    snprintf(path, sizeof path, "%s/%s", rig->root, name);
    loading_write_slow(path);
}

// A small glTF file in which all nodes move by the same keys: each becomes arrays of its own, none
// of them large enough to be spilled.
static void write_repeated(const struct rig *rig, const char *name, int nodes)
{
    enum { KEYS = 20000 };
    FILE *file = begin_file(rig, name);
    fprintf(file,
        "{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":%d,\"uri\":\"keys.bin\"}],"
        "\"bufferViews\":[{\"buffer\":0,\"byteLength\":%d}],\"accessors\":[{\"bufferView\":0,"
        "\"componentType\":5126,\"count\":%d,\"type\":\"SCALAR\",\"min\":[0],\"max\":[%d]},"
        "{\"bufferView\":0,\"byteOffset\":%d,\"componentType\":5126,\"count\":%d,\"type\":\"VEC3\"}"
        "],"
        "\"animations\":[{\"samplers\":[{\"input\":0,\"output\":1}],\"channels\":[",
        KEYS * 16, KEYS * 16, KEYS, KEYS - 1, KEYS * 4, KEYS);
    for (int i = 0; i < nodes; i++)
        fprintf(file, "%s{\"sampler\":0,\"target\":{\"node\":%d,\"path\":\"translation\"}}",
            i ? "," : "", i);
    fputs("]}],\"nodes\":[", file);
    for (int i = 0; i < nodes; i++)
        fprintf(file, "%s{\"name\":\"%d\"}", i ? "," : "", i);
    fputs("]}", file);
    assert_int_equal(fclose(file), 0);
    file = begin_file(rig, "keys.bin");
    for (int i = 0; i < KEYS * 4; i++) {
        const float number = (float)i;
        assert_int_equal(fwrite(&number, sizeof number, 1, file), 1);
    }
    assert_int_equal(fclose(file), 0);
}

// ---- processes ---------------------------------------------------------------------------------

static int oom_score_of(pid_t pid)
{
    char path[64];
    int score = 0;
    snprintf(path, sizeof path, "/proc/%d/oom_score_adj", (int)pid);
    FILE *file = fopen(path, "r");
    if (file && fscanf(file, "%d", &score) != 1)
        score = 0;
    if (file)
        fclose(file);
    return score;
}

static int count_files_being_read(const struct rig *rig)
{
    pid_t spawner = 0, loader = 0;
    assert_int_equal(loading_count(rig->pid, &spawner), 1);
    return loading_count(spawner, &loader);
}

static void await_files_being_read(const struct rig *rig, int count)
{
    const uint64_t deadline_ns = hg_clock_now_ns() + 60000000000u;
    while (count_files_being_read(rig) != count) {
        assert_true(hg_clock_now_ns() < deadline_ns);
        usleep(10000);
    }
}

// ---- scenes ------------------------------------------------------------------------------------

static void show(struct rig *rig)
{
    link_expect(rig,
        link_ask(rig, NEIGHBOUR, HGP_T_frame_request, &(struct hgp_frame_request){.view = VIEW}),
        HGP_T_frame);
}

static uint32_t load(struct rig *rig, const char *name)
{
    return link_ask(rig, ATTACKER, HGP_T_asset_load,
        &(struct hgp_asset_load){.asset = FIRST_ID, .path = hgp_str_make(name)});
}

static void refused(struct rig *rig, const char *name, enum hg_status code, const char *reason)
{
    link_expect(rig, load(rig, name), HGP_T_error);
    const struct hgp_error *e = &rig->message.error;
    if (e->code != code || !memmem(e->what.data, e->what.size, name, strlen(name)) ||
        !memmem(e->reason.data, e->reason.size, reason, strlen(reason)))
        fail_msg("%s: %.*s: %.*s (%d)", name, (int)e->what.size, e->what.data, (int)e->reason.size,
            e->reason.data, e->code);
    show(rig);
}

static void begin(struct rig *rig)
{
    link_attach(rig, ATTACKER, "attacked");
    link_attach(rig, NEIGHBOUR, "beside it");
    link_expect(rig,
        link_ask(rig, NEIGHBOUR, HGP_T_view_set,
            &(struct hgp_view_set){.view = VIEW,
                .has_width = true,
                .width = SIDE,
                .has_height = true,
                .height = SIDE,
                .has_samples = true,
                .samples = 1,
                .has_gi = true,
                .gi = HGP_gi_NONE}),
        HGP_T_ok);
    show(rig);
}

static int start(void **state)
{
    static const char *const options[] = {"--loader-cpu", "2", "--loader-memory", "512", NULL};
    return link_start_with(state, options);
}

static int start_impatient(void **state)
{
    static const char *const options[] = {"--loader-timeout", "0.2", NULL};
    return link_start_with(state, options);
}

static int start_with_limit(void **state)
{
    static const char *const options[] = {"--memory-limit", "2048", NULL};
    return memory_is_limited ? link_start_with(state, options) : link_start(state);
}

// ---- tests -------------------------------------------------------------------------------------

static void files_end_by_rule(void **state)
{
    struct rig *rig = *state;
    begin(rig);
    write_collada(rig, "sound.dae", "9");
    write_collada(rig, "bloated.dae", "1500000000");
    write_deep(rig, "deep.dae");
    write_slow(rig, "slow.dae");
    if (memory_is_limited)
        refused(rig, "bloated.dae", HG_E_LIMIT, "512 MiB of memory");
    refused(rig, "deep.dae", HG_E_FORMAT, "crashed");
    refused(rig, "slow.dae", HG_E_LIMIT, "2 s of processor time");
    link_expect(rig, load(rig, "sound.dae"), HGP_T_asset_loaded);
    assert_int_equal(rig->message.asset_loaded.triangles, 1);
    await_files_being_read(rig, 0);
}

static void answers_have_a_time(void **state)
{
    struct rig *rig = *state;
    begin(rig);
    write_slow(rig, "slow.dae");
    refused(rig, "slow.dae", HG_E_LIMIT, "within 0.2 s");
    await_files_being_read(rig, 0);
}

// The neighbour's frames come while the file is read, and the reader ends with its session.
static void readers_end_with_their_session(void **state)
{
    struct rig *rig = *state;
    begin(rig);
    write_slow(rig, "slow.dae");
    load(rig, "slow.dae");
    const uint64_t deadline_ns = hg_clock_now_ns() + 60000000000u;
    pid_t spawner, loader;
    while (!loading_count(rig->pid, &spawner) || !loading_count(spawner, &loader))
        assert_true(hg_clock_now_ns() < deadline_ns);
    // The kernel ends it, and not the worker, where memory is short. The spawner has its score for
    // the moment of the fork.
    while (oom_score_of(loader) != 1000 || oom_score_of(spawner) != oom_score_of(rig->pid))
        assert_true(hg_clock_now_ns() < deadline_ns);
    show(rig);
    link_ask(rig, ATTACKER, HGP_T_session_detach, &(struct hgp_session_detach){0});
    await_files_being_read(rig, 0);
    show(rig);
}

// A picture that claims to be large, and one that says nothing more.
static void images_end_by_rule(void **state)
{
    struct rig *rig = *state;
    static const uint8_t tiff[] = {'I', 'I', '*', 0, 8, 0, 0, 0, 8, 0, // 30000 x 30000, grey
        0, 1, 3, 0, 1, 0, 0, 0, 0x30, 0x75, 0, 0, 1, 1, 3, 0, 1, 0, 0, 0, 0x30, 0x75, 0, 0, 2, 1, 3,
        0, 1, 0, 0, 0, 8, 0, 0, 0, 3, 1, 3, 0, 1, 0, 0, 0, 5, 0, 0, 0, 6, 1, 3, 0, 1, 0, 0, 0, 1, 0,
        0, 0, 0x11, 1, 4, 0, 1, 0, 0, 0, 8, 0, 0, 0, 0x16, 1, 3, 0, 1, 0, 0, 0, 0x30, 0x75, 0, 0,
        0x17, 1, 4, 0, 1, 0, 0, 0, 100, 0, 0, 0, 0, 0, 0, 0};
    static const char *const names[] = {"bomb.tif", "cut.webp"};
    // One strip of 900 MB, of which 100 bytes are there; no end.
    const enum hg_status codes[] = {memory_is_limited ? HG_E_LIMIT : HG_E_FORMAT, HG_E_FORMAT};
    begin(rig);
    FILE *file = begin_file(rig, names[0]);
    assert_int_equal(fwrite(tiff, sizeof tiff, 1, file), 1);
    assert_int_equal(fclose(file), 0);
    test_text_write(rig->root, names[1], "RIFF....WEBPVP8L");
    for (int i = 0; i < 2; i++) {
        const struct hgp_environment_set m = {.has_kind = true,
            .kind = HGP_environment_kind_FILE,
            .has_path = true,
            .path = hgp_str_make(names[i])};
        link_expect_error(rig, link_ask(rig, ATTACKER, HGP_T_environment_set, &m), codes[i], NULL);
        const struct hgp_error *e = &rig->message.error;
        assert_non_null(memmem(e->what.data, e->what.size, names[i], strlen(names[i])));
        assert_true(e->reason.size > 0);
        show(rig);
    }
    await_files_being_read(rig, 0);
}

// Formats that have readers of our own, in the worker: nothing is taken that is not there.
static void own_readers_hold(void **state)
{
    struct rig *rig = *state;
    begin(rig);
    test_text_write(rig->root, "endless.ply", "ply\nformat binary_little_endian");
    test_text_write(rig->root, "claims.ply",
        "ply\nformat ascii 1.0\nelement vertex 30000000\nproperty float x\nproperty float y\n"
        "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 "
        "0\n");
    test_text_write(rig->root, "beyond.ply",
        "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\n"
        "property float y\nproperty float z\nelement face 1\nproperty list uchar int "
        "vertex_indices\n"
        "end_header\n0123456789");
    test_text_write(rig->root, "claims.stl", "solid");
    test_text_write(rig->root, "beyond.obj", "v 0 0 0\nf 1 2 4000000000\n");
    refused(rig, "endless.ply", HG_E_FORMAT, "");
    refused(rig, "claims.ply", HG_E_FORMAT, "");
    refused(rig, "beyond.ply", HG_E_FORMAT, "");
    refused(rig, "claims.stl", HG_E_FORMAT, "");
    refused(rig, "beyond.obj", HG_E_FORMAT, "");
}

static uint32_t load_as(struct rig *rig, uint32_t channel, uint32_t number, const char *name)
{
    return link_ask(rig, channel, HGP_T_asset_load,
        &(struct hgp_asset_load){.asset = FIRST_ID + number, .path = hgp_str_make(name)});
}

static void refused_for_memory(struct rig *rig, uint32_t request)
{
    link_expect_error(rig, request, HG_E_LIMIT, NULL);
    const struct hgp_str *reason = &rig->message.error.reason;
    assert_non_null(memmem(reason->data, reason->size, "memory-limit", 12));
    assert_string_equal(rig->limit, "memory-limit");
}

// A quarter of the worker's 2 GiB for the files of one session, half for all: others can load, too.
static void sessions_share_memory(void **state)
{
    enum { SOME = 900 }; // nodes of some 310 KiB
    struct rig *rig = *state;
    if (!memory_is_limited) {
        skip();
        return;
    }
    begin(rig);
    write_repeated(rig, "some.gltf", SOME);
    write_repeated(rig, "small.gltf", 10);
    link_expect(rig, load_as(rig, ATTACKER, 1, "some.gltf"), HGP_T_asset_loaded);
    refused_for_memory(rig, load_as(rig, ATTACKER, 2, "some.gltf"));
    show(rig);
    link_expect(rig, load_as(rig, NEIGHBOUR, 0, "small.gltf"), HGP_T_asset_loaded);
    show(rig);
    link_expect(rig,
        link_ask(
            rig, ATTACKER, HGP_T_asset_unload, &(struct hgp_asset_unload){.asset = FIRST_ID + 1}),
        HGP_T_ok);
    link_expect(rig, load_as(rig, ATTACKER, 3, "some.gltf"), HGP_T_asset_loaded);
    show(rig);
}

int main(int argc, char **argv)
{
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(files_end_by_rule, start, link_stop),
        cmocka_unit_test_setup_teardown(answers_have_a_time, start_impatient, link_stop),
        cmocka_unit_test_setup_teardown(readers_end_with_their_session, link_start, link_stop),
        cmocka_unit_test_setup_teardown(images_end_by_rule, start, link_stop),
        cmocka_unit_test_setup_teardown(own_readers_hold, link_start, link_stop),
        cmocka_unit_test_setup_teardown(sessions_share_memory, start_with_limit, link_stop),
    };
    return cmocka_run_group_tests_name("attack_loader", tests, NULL, NULL);
}
