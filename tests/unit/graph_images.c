// graph_images.c - memory that transient images share, history, sizes, storage mips, buffers, and
// calls that fail; all under validation.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "shaders/shared/pass_io.h"
#include "tests/unit/graph_rig.h"

#define SIDE 64

struct chain { // a -> b -> c -> d -> out, one after the other
    struct graph_clear clear;
    struct graph_blend blends[4];
    uint32_t ids[4];
};

static void declare_chain(
    struct graph_rig *r, struct chain *c, struct hg_gpu_image *outside, uint32_t side)
{
    static const char *const names[4] = {"a", "b", "c", "d"};
    hg_graph_begin(r->graph, side, side);
    for (int i = 0; i < 4; i++)
        c->ids[i] = graph_rig_image(r, names[i], HG_GRAPH_TRANSIENT);
    const uint32_t out = hg_graph_import(r->graph, "out", outside);
    c->clear = (struct graph_clear){c->ids[0], 5.0f};
    graph_rig_clear(r, "clear", &c->clear);
    static const char *const passes[4] = {"ab", "bc", "cd", "d out"};
    for (int i = 0; i < 4; i++) {
        c->blends[i] = (struct graph_blend){c->ids[i], c->ids[i], i < 3 ? c->ids[i + 1] : out};
        graph_rig_blend(r, passes[i], &c->blends[i]);
    }
    hg_graph_want(r->graph, out);
}

static bool share_bytes(const struct hg_graph_place *a, const struct hg_graph_place *b)
{
    return a->offset < b->offset + b->size_bytes && b->offset < a->offset + a->size_bytes;
}

// Images that live at the same time share nothing; a chain of four fits into the room of two.
static void test_sharing(void **state)
{
    struct graph_rig *r = *state;
    struct hg_gpu_image outside = graph_rig_outside(r, "outside", SIDE);
    struct chain c;
    struct hg_graph_place places[4];
    struct hg_graph_stats stats;
    uint32_t shared = 0;
    declare_chain(r, &c, &outside, SIDE);
    graph_rig_run(r);
    assert_float_equal(graph_rig_texel(r, &outside), 5.0f * 1.1f * 1.1f * 1.1f * 1.1f, 1e-4f);
    for (int i = 0; i < 4; i++) {
        assert_true(hg_graph_place(r->graph, c.ids[i], &places[i]));
        assert_true(places[i].size_bytes >= SIDE * SIDE * 4);
    }
    for (int i = 0; i < 4; i++) {
        for (int k = 0; k < i; k++) {
            const bool together =
                places[i].first <= places[k].last && places[k].first <= places[i].last;
            assert_true(!together || !share_bytes(&places[i], &places[k]));
            shared += share_bytes(&places[i], &places[k]);
        }
    }
    assert_int_equal(shared, 2); // a with c, b with d
    hg_graph_stats(r->graph, &stats);
    assert_int_equal(stats.transient_bytes, stats.unshared_bytes / 2);
    hg_gpu_image_destroy(r->gpu, &outside);
}

// Memory comes back when the view gets smaller and when the graph goes.
static void test_memory_returns(void **state)
{
    struct graph_rig *r = *state;
    struct hg_gpu_image outside = graph_rig_outside(r, "outside", SIDE);
    struct chain c;
    struct hg_gpu_memory_stats before, large, small;
    hg_gpu_memory_stats(r->gpu, &before);
    declare_chain(r, &c, &outside, SIDE);
    graph_rig_run(r);
    hg_gpu_memory_stats(r->gpu, &large);
    assert_true(large.used_bytes >= before.used_bytes + 2 * SIDE * SIDE * 4);
    struct hg_gpu_image tiny = graph_rig_outside(r, "tiny", 4);
    declare_chain(r, &c, &tiny, 4);
    graph_rig_run(r);
    hg_gpu_memory_stats(r->gpu, &small);
    assert_true(small.used_bytes < large.used_bytes - SIDE * SIDE * 4);
    hg_gpu_image_destroy(r->gpu, &outside);
    hg_gpu_image_destroy(r->gpu, &tiny);
}

// picture = 0.1 * last frame's + 1, and once also the history of nothing.
static float run_history(
    struct graph_rig *r, struct hg_gpu_image *outside, uint32_t side, bool *has_previous)
{
    struct graph_clear one;
    struct graph_blend blend, copy;
    hg_graph_begin(r->graph, side, side);
    const uint32_t added = graph_rig_image(r, "added", HG_GRAPH_TRANSIENT);
    const uint32_t picture = graph_rig_image(r, "picture", HG_GRAPH_HISTORY);
    const uint32_t before = hg_graph_previous(r->graph, picture);
    const uint32_t nothing = graph_rig_image(r, "nothing", HG_GRAPH_PERSISTENT);
    const uint32_t out = hg_graph_import(r->graph, "out", outside);
    assert_int_equal(hg_graph_previous(r->graph, picture), before);
    one = (struct graph_clear){added, 1.0f};
    blend = (struct graph_blend){before, added, picture};
    copy = (struct graph_blend){nothing, picture, out};
    graph_rig_clear(r, "one", &one);
    graph_rig_blend(r, "blend", &blend);
    graph_rig_blend(r, "copy", &copy);
    hg_graph_want(r->graph, out);
    graph_rig_ok(r, hg_graph_compile(r->graph, &r->err));
    *has_previous = hg_graph_has_content(r->graph, before);
    graph_rig_run(r);
    assert_false(hg_graph_has_content(r->graph, nothing));
    const float result = graph_rig_texel(r, outside);
    hg_graph_advance(r->graph);
    return result;
}

static void test_history(void **state)
{
    struct graph_rig *r = *state;
    struct hg_gpu_image outside = graph_rig_outside(r, "outside", SIDE);
    struct hg_gpu_image other = graph_rig_outside(r, "other", SIDE / 2);
    bool previous;
    assert_float_equal(run_history(r, &outside, SIDE, &previous), 1.0f, 1e-6f);
    assert_false(previous);
    assert_float_equal(run_history(r, &outside, SIDE, &previous), 1.1f, 1e-6f);
    assert_true(previous);
    assert_float_equal(run_history(r, &outside, SIDE, &previous), 1.11f, 1e-6f);
    // Another size and a reset start again.
    assert_float_equal(run_history(r, &other, SIDE / 2, &previous), 1.0f, 1e-6f);
    assert_false(previous);
    assert_float_equal(run_history(r, &other, SIDE / 2, &previous), 1.1f, 1e-6f);
    hg_graph_reset(r->graph);
    assert_float_equal(run_history(r, &other, SIDE / 2, &previous), 1.0f, 1e-6f);
    assert_false(previous);
    hg_gpu_image_destroy(r->gpu, &outside);
    hg_gpu_image_destroy(r->gpu, &other);
}

static const struct hg_gpu_io mip_io = HG_GPU_IO(HG_TEST_MIP_IO);
struct mip_inputs {
    HG_TEST_MIP_IO(HG_GPU_IO_MEMBER)
};
struct reduce {
    uint32_t image, mip;
};

static enum hg_status record_reduce(
    const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    const struct reduce *reduce = user;
    struct hg_gpu_image *image = hg_graph_run_image(run, reduce->image);
    const struct hg_gpu_pipeline_params pipeline = {.compute = "test_mip.comp", .io = &mip_io};
    const struct mip_inputs in = {
        .finer = {image, reduce->mip}, .coarser = {image, reduce->mip + 1}};
    enum hg_status status = hg_gpu_cmd_bind_io(run->cmd, &mip_io, &in, sizeof in, err);
    if (status == HG_OK)
        status = hg_gpu_cmd_pipeline(run->cmd, &pipeline, err);
    if (status == HG_OK)
        vkCmdDispatch(hg_gpu_cmd_handle(run->cmd), 4, 4, 1);
    return status;
}

static enum hg_status record_fill(const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    const uint32_t *image = user;
    (void)err;
    const struct hg_gpu_rendering rendering = {.colors = {{.image = hg_graph_run_image(run, *image),
                                                   .clear = true,
                                                   .value.color.float32 = {7.0f}}},
        .color_count = 1};
    hg_gpu_cmd_begin_rendering(run->cmd, &rendering);
    hg_gpu_cmd_end_rendering(run->cmd);
    return HG_OK;
}

struct mip_copy {
    uint32_t image, buffer, mip;
    const struct hg_gpu_buffer *to;
};

static enum hg_status record_mip_copy(
    const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    const struct mip_copy *copy = user;
    const struct hg_gpu_region texel = {.mip = copy->mip, .width = 1, .height = 1};
    (void)err;
    hg_gpu_image_read(run->cmd, hg_graph_run_image(run, copy->image), &texel, copy->to, 4);
    return HG_OK;
}

// A chain of mips down to one texel at half the view's size, one pass per mip, then a buffer.
static void test_mips_and_buffers(void **state)
{
    struct graph_rig *r = *state;
    enum { MIPS = 6 }; // of 32
    struct reduce steps[MIPS];
    hg_graph_begin(r->graph, SIDE, SIDE);
    uint32_t chain = hg_graph_image(r->graph, &(struct hg_graph_image_params){.name = "chain",
                                                  .format = VK_FORMAT_R32_SFLOAT,
                                                  .size = HG_GRAPH_HALF,
                                                  .mips = HG_GRAPH_ALL_MIPS});
    const uint32_t back = hg_graph_buffer(r->graph, "back");
    hg_graph_pass(r->graph, &(struct hg_graph_pass){.name = "fill",
                                .record = record_fill,
                                .user = &chain,
                                .accesses = {{chain, HG_GRAPH_COLOR, 1}}});
    for (uint32_t mip = 1; mip < MIPS; mip++) {
        steps[mip] = (struct reduce){chain, mip};
        hg_graph_pass(r->graph,
            &(struct hg_graph_pass){.name = "reduce",
                .record = record_reduce,
                .user = &steps[mip],
                .accesses = {{chain, HG_GRAPH_LOAD, mip}, {chain, HG_GRAPH_STORE, mip + 1}}});
    }
    struct mip_copy copy = {chain, back, MIPS - 1, &r->back};
    hg_graph_pass(
        r->graph, &(struct hg_graph_pass){.name = "copy",
                      .record = record_mip_copy,
                      .user = &copy,
                      .accesses = {{chain, HG_GRAPH_COPY_FROM, MIPS}, {back, HG_GRAPH_WRITE, 0}}});
    hg_graph_pass(r->graph,
        &(struct hg_graph_pass){.name = "copy again",
            .record = record_mip_copy,
            .user = &copy,
            .accesses = {{chain, HG_GRAPH_COPY_FROM, MIPS}, {back, HG_GRAPH_READ_WRITE, 0}}});
    hg_graph_want(r->graph, back);
    graph_rig_run(r);
    assert_int_equal(hg_graph_pass_name(r->graph, MIPS + 2) == NULL, 1);
    const struct hg_gpu_image *image = hg_graph_get_image(r->graph, chain);
    assert_int_equal(image->width, SIDE / 2);
    assert_int_equal(image->mips, MIPS);
    assert_float_equal(((const float *)r->back.mapped)[1], 7.0f, 0.0f);
}

static void test_sizes(void **state)
{
    struct graph_rig *r = *state;
    static const char *const names[] = {"full", "half", "quarter", "eighth", "volume"};
    struct graph_clear clears[4];
    uint32_t ids[5];
    hg_graph_begin(r->graph, 17, 9);
    for (int i = 0; i < 4; i++) {
        ids[i] = hg_graph_image(r->graph, &(struct hg_graph_image_params){.name = names[i],
                                              .format = VK_FORMAT_R32_SFLOAT,
                                              .life = HG_GRAPH_PERSISTENT,
                                              .size = (enum hg_graph_size)i});
        clears[i] = (struct graph_clear){ids[i], (float)i};
        graph_rig_clear(r, names[i], &clears[i]);
        hg_graph_want(r->graph, ids[i]);
    }
    ids[4] = hg_graph_image(r->graph, &(struct hg_graph_image_params){.name = names[4],
                                          .format = VK_FORMAT_R32_SFLOAT,
                                          .life = HG_GRAPH_PERSISTENT,
                                          .size = HG_GRAPH_ABSOLUTE,
                                          .width = 4,
                                          .height = 5,
                                          .depth = 6});
    hg_graph_pass(r->graph,
        &(struct hg_graph_pass){.name = "volume", .accesses = {{ids[4], HG_GRAPH_STORE, 0}}});
    hg_graph_want(r->graph, ids[4]);
    graph_rig_run(r);
    static const uint32_t expected[5][3] = {{17, 9, 1}, {9, 5, 1}, {5, 3, 1}, {3, 2, 1}, {4, 5, 6}};
    for (int i = 0; i < 5; i++) {
        struct hg_gpu_image *image = hg_graph_get_image(r->graph, ids[i]);
        assert_int_equal(image->width, expected[i][0]);
        assert_int_equal(image->height, expected[i][1]);
        assert_int_equal(image->depth, expected[i][2]);
        assert_true(hg_graph_has_content(r->graph, ids[i]));
        if (i < 4)
            assert_float_equal(graph_rig_texel(r, image), (float)i, 0.0f);
    }
}

// Every call fails once: a status, and the next try works.
static void test_failing_calls(void **state)
{
    struct graph_rig *r = *state;
    struct hg_gpu_image outside = graph_rig_outside(r, "outside", SIDE);
    struct chain c;
    for (uint64_t n = 1;; n++) {
        declare_chain(r, &c, &outside, SIDE + (uint32_t)n % 2); // nothing is left of the last one
        hg_gpu_fail_at(n, VK_ERROR_OUT_OF_DEVICE_MEMORY);
        const enum hg_status status = graph_rig_try(r);
        const uint64_t calls = hg_gpu_call_count();
        hg_gpu_fail_at(0, VK_SUCCESS);
        assert_true(status == (calls < n ? HG_OK : HG_E_NOMEM));
        if (status == HG_OK)
            break;
        assert_true(n < 200);
    }
    declare_chain(r, &c, &outside, SIDE);
    graph_rig_run(r);
    assert_float_equal(graph_rig_texel(r, &outside), 5.0f * 1.1f * 1.1f * 1.1f * 1.1f, 1e-4f);
    hg_gpu_image_destroy(r->gpu, &outside);
}

int main(void)
{
#define TEST(test) cmocka_unit_test_setup_teardown(test, graph_rig_setup, graph_rig_teardown)
    const struct CMUnitTest tests[] = {TEST(test_sharing), TEST(test_memory_returns),
        TEST(test_history), TEST(test_mips_and_buffers), TEST(test_sizes),
        TEST(test_failing_calls)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
