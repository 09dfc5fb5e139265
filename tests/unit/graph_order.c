// graph_order.c - which passes run, in which order, what is an error, and when compiling is needed.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/unit/graph_rig.h"

#define SIDE 8

static void expect_order(struct graph_rig *r, const char *const *names, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++)
        assert_string_equal(hg_graph_pass_name(r->graph, i), names[i]);
    assert_null(hg_graph_pass_name(r->graph, count));
}

// Declared backwards: the passes run in the order in which they need each other, and add up.
static void test_order(void **state)
{
    struct graph_rig *r = *state;
    struct hg_gpu_image outside = graph_rig_outside(r, "outside", SIDE);
    hg_graph_begin(r->graph, SIDE, SIDE);
    const uint32_t a = graph_rig_image(r, "a", HG_GRAPH_TRANSIENT);
    const uint32_t b = graph_rig_image(r, "b", HG_GRAPH_TRANSIENT);
    const uint32_t c = graph_rig_image(r, "c", HG_GRAPH_TRANSIENT);
    const uint32_t out = hg_graph_import(r->graph, "out", &outside);
    const struct graph_blend last = {c, b, out}, middle = {a, b, c};
    const struct graph_clear one = {a, 100.0f}, two = {b, 2.0f};
    graph_rig_blend(r, "last", &last);
    graph_rig_blend(r, "middle", &middle);
    graph_rig_clear(r, "clear b", &two);
    graph_rig_clear(r, "clear a", &one);
    hg_graph_want(r->graph, out);
    graph_rig_run(r);
    expect_order(r, (const char *const[]){"clear b", "clear a", "middle", "last"}, 4);
    assert_float_equal(graph_rig_texel(r, &outside), 0.1f * (0.1f * 100.0f + 2.0f) + 2.0f, 1e-5f);
    hg_gpu_image_destroy(r->gpu, &outside);
}

// A read sees the last write declared before it; the next write waits for the read.
static void test_versions(void **state)
{
    struct graph_rig *r = *state;
    struct hg_gpu_image first = graph_rig_outside(r, "first", SIDE);
    struct hg_gpu_image second = graph_rig_outside(r, "second", SIDE);
    hg_graph_begin(r->graph, SIDE, SIDE);
    const uint32_t a = graph_rig_image(r, "a", HG_GRAPH_TRANSIENT);
    const uint32_t o1 = hg_graph_import(r->graph, "o1", &first);
    const uint32_t o2 = hg_graph_import(r->graph, "o2", &second);
    const struct graph_clear ten = {a, 10.0f}, twenty = {a, 20.0f};
    const struct graph_blend read1 = {a, a, o1}, read2 = {a, a, o2};
    graph_rig_clear(r, "ten", &ten);
    graph_rig_blend(r, "read ten", &read1);
    graph_rig_clear(r, "twenty", &twenty);
    graph_rig_blend(r, "read twenty", &read2);
    hg_graph_want(r->graph, o1);
    hg_graph_want(r->graph, o2);
    graph_rig_run(r);
    expect_order(r, (const char *const[]){"ten", "read ten", "twenty", "read twenty"}, 4);
    assert_float_equal(graph_rig_texel(r, &first), 11.0f, 1e-5f);
    assert_float_equal(graph_rig_texel(r, &second), 22.0f, 1e-5f);
    hg_gpu_image_destroy(r->gpu, &first);
    hg_gpu_image_destroy(r->gpu, &second);
}

// What is imported has content of its own: a read declared before the writes of a frame sees that.
static void test_imported_content(void **state)
{
    struct graph_rig *r = *state;
    struct hg_gpu_image from = graph_rig_outside(r, "from", SIDE);
    struct hg_gpu_image early = graph_rig_outside(r, "early", SIDE);
    struct hg_gpu_image late = graph_rig_outside(r, "late", SIDE);
    for (int frame = 0; frame < 2; frame++) {
        hg_graph_begin(r->graph, SIDE, SIDE);
        const uint32_t a = hg_graph_import(r->graph, "a", &from);
        const uint32_t before = hg_graph_import(r->graph, "before", &early);
        const uint32_t after = hg_graph_import(r->graph, "after", &late);
        const struct graph_clear set = {a, frame == 0 ? 10.0f : 20.0f};
        const struct graph_blend read1 = {a, a, before}, read2 = {a, a, after};
        if (frame > 0)
            graph_rig_blend(r, "read before", &read1);
        graph_rig_clear(r, "set", &set);
        graph_rig_blend(r, "read after", &read2);
        hg_graph_want(r->graph, before);
        hg_graph_want(r->graph, after);
        graph_rig_run(r);
    }
    assert_float_equal(graph_rig_texel(r, &early), 11.0f, 1e-5f);
    assert_float_equal(graph_rig_texel(r, &late), 22.0f, 1e-5f);
    hg_gpu_image_destroy(r->gpu, &from);
    hg_gpu_image_destroy(r->gpu, &early);
    hg_gpu_image_destroy(r->gpu, &late);
}

static void test_culling(void **state)
{
    struct graph_rig *r = *state;
    struct hg_gpu_image outside = graph_rig_outside(r, "outside", SIDE);
    struct hg_gpu_image unwanted = graph_rig_outside(r, "unwanted", SIDE);
    hg_graph_begin(r->graph, SIDE, SIDE);
    const uint32_t a = graph_rig_image(r, "a", HG_GRAPH_TRANSIENT);
    const uint32_t b = graph_rig_image(r, "b", HG_GRAPH_TRANSIENT);
    const uint32_t out = hg_graph_import(r->graph, "out", &outside);
    const uint32_t other = hg_graph_import(r->graph, "other", &unwanted);
    const struct graph_clear one = {a, 1.0f}, two = {b, 2.0f}, again = {a, 3.0f};
    const struct graph_blend use_a = {a, a, out}, use_b = {b, a, other};
    graph_rig_clear(r, "overwritten", &one);
    graph_rig_clear(r, "a", &again);
    graph_rig_clear(r, "b", &two);
    graph_rig_blend(r, "wanted", &use_a);
    graph_rig_blend(r, "unwanted", &use_b);
    hg_graph_pass(r->graph, &(struct hg_graph_pass){.name = "kept", .keep = true});
    hg_graph_want(r->graph, out);
    graph_rig_run(r);
    expect_order(r, (const char *const[]){"a", "wanted", "kept"}, 3);
    struct hg_graph_stats stats;
    hg_graph_stats(r->graph, &stats);
    assert_int_equal(stats.passes_left_out, 3);
    assert_int_equal(stats.transient_images, 1);
    assert_float_equal(graph_rig_texel(r, &outside), 3.3f, 1e-5f);
    hg_gpu_image_destroy(r->gpu, &outside);
    hg_gpu_image_destroy(r->gpu, &unwanted);
}

static void expect_refused(struct graph_rig *r, const char *where, const char *reason)
{
    memset(&r->err, 0, sizeof r->err);
    assert_int_equal(hg_graph_compile(r->graph, &r->err), HG_E_INVAL);
    assert_string_equal(r->err.where, where);
    if (strstr(r->err.reason, reason) == NULL)
        fail_msg("'%s' lacks '%s'", r->err.reason, reason);
}

static void test_refused(void **state)
{
    struct graph_rig *r = *state;
    // Each needs what the other makes.
    hg_graph_begin(r->graph, SIDE, SIDE);
    uint32_t a = graph_rig_image(r, "a", HG_GRAPH_TRANSIENT);
    uint32_t b = graph_rig_image(r, "b", HG_GRAPH_TRANSIENT);
    const struct graph_blend ab = {a, a, b}, ba = {b, b, a};
    graph_rig_blend(r, "ab", &ab);
    graph_rig_blend(r, "ba", &ba);
    hg_graph_want(r->graph, a);
    expect_refused(r, "ab", "waits for ba");
    // Nothing writes it.
    hg_graph_begin(r->graph, SIDE, SIDE);
    a = graph_rig_image(r, "a", HG_GRAPH_TRANSIENT);
    b = graph_rig_image(r, "b", HG_GRAPH_TRANSIENT);
    graph_rig_blend(r, "ab", &ab);
    hg_graph_want(r->graph, b);
    expect_refused(r, "ab", "reads a, which no pass writes");
    // It is added to before there is anything.
    hg_graph_begin(r->graph, SIDE, SIDE);
    a = graph_rig_image(r, "a", HG_GRAPH_TRANSIENT);
    hg_graph_pass(r->graph,
        &(struct hg_graph_pass){.name = "adds", .accesses = {{a, HG_GRAPH_COLOR_KEEP, 0}}});
    hg_graph_want(r->graph, a);
    expect_refused(r, "adds", "reads a, which no pass writes");
    hg_graph_begin(r->graph, SIDE, SIDE);
    graph_rig_image(r, "a", HG_GRAPH_TRANSIENT);
    graph_rig_image(r, "a", HG_GRAPH_TRANSIENT);
    expect_refused(r, "a", "twice");
    hg_graph_begin(r->graph, SIDE, SIDE);
    a = graph_rig_image(r, "a", HG_GRAPH_TRANSIENT);
    hg_graph_pass(
        r->graph, &(struct hg_graph_pass){.name = "reads", .accesses = {{a, HG_GRAPH_READ, 0}}});
    expect_refused(r, "reads", "a is no buffer");
    hg_graph_begin(r->graph, SIDE, SIDE);
    a = graph_rig_image(r, "a", HG_GRAPH_TRANSIENT);
    assert_int_equal(hg_graph_previous(r->graph, a), 0);
    expect_refused(r, "a", "no history");
    hg_graph_begin(r->graph, SIDE, SIDE);
    for (uint32_t i = 0; i <= HG_GRAPH_MAX_PASSES; i++)
        hg_graph_pass(r->graph, &(struct hg_graph_pass){.name = "many"});
    expect_refused(r, "many", "more than 256 passes");
    struct hg_gpu_cmd *cmd;
    graph_rig_ok(r, hg_gpu_begin(r->gpu, &cmd, &r->err));
    assert_int_equal(hg_graph_execute(r->graph, cmd, NULL, 0, &r->err), HG_E_STATE);
    hg_gpu_discard(r->gpu, cmd);
}

static void declare_simple(struct graph_rig *r, struct hg_gpu_image *outside, bool more)
{
    static struct graph_clear one, two;
    static struct graph_blend blend;
    hg_graph_begin(r->graph, SIDE, SIDE);
    const uint32_t a = graph_rig_image(r, "a", HG_GRAPH_TRANSIENT);
    const uint32_t b = more ? graph_rig_image(r, "b", HG_GRAPH_TRANSIENT) : a;
    const uint32_t out = hg_graph_import(r->graph, "out", outside);
    one = (struct graph_clear){a, 1.0f};
    two = (struct graph_clear){b, 2.0f};
    blend = (struct graph_blend){a, b, out};
    graph_rig_clear(r, "one", &one);
    if (more)
        graph_rig_clear(r, "two", &two);
    graph_rig_blend(r, "blend", &blend);
    hg_graph_want(r->graph, out);
}

// Equal declarations are compiled once, also when others come in between.
static void test_plans_are_kept(void **state)
{
    struct graph_rig *r = *state;
    struct hg_gpu_image outside = graph_rig_outside(r, "outside", SIDE);
    struct hg_graph_stats stats;
    for (uint32_t i = 0; i < 10; i++) {
        declare_simple(r, &outside, i % 2 == 1);
        graph_rig_run(r);
        assert_float_equal(graph_rig_texel(r, &outside), (i % 2 == 1 ? 2.1f : 1.1f), 1e-5f);
    }
    hg_graph_stats(r->graph, &stats);
    assert_int_equal(stats.compilations, 2);
    hg_gpu_image_destroy(r->gpu, &outside);
}

static enum hg_status count_run(const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    (void)err;
    (void)run;
    ++*(uint32_t *)user;
    return HG_OK;
}

static enum hg_status refuse_run(const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    (void)user;
    return hg_error_set(err, HG_E_LIMIT, "pass", NULL, "run %u", run->repetition);
}

static void test_repetitions_and_errors(void **state)
{
    struct graph_rig *r = *state;
    struct hg_gpu_cmd *cmd;
    uint32_t once = 0, often = 0;
    hg_graph_begin(r->graph, SIDE, SIDE);
    hg_graph_pass(r->graph,
        &(struct hg_graph_pass){
            .name = "once", .record = count_run, .user = &once, .keep = true, .once = true});
    hg_graph_pass(
        r->graph, &(struct hg_graph_pass){
                      .name = "often", .record = count_run, .user = &often, .keep = true});
    graph_rig_ok(r, hg_graph_compile(r->graph, &r->err));
    graph_rig_ok(r, hg_gpu_begin(r->gpu, &cmd, &r->err));
    for (uint32_t i = 0; i < 3; i++)
        graph_rig_ok(r, hg_graph_execute(r->graph, cmd, NULL, i, &r->err));
    graph_rig_ok(r, hg_gpu_submit_and_wait(r->gpu, cmd, &r->err));
    assert_int_equal(once, 1);
    assert_int_equal(often, 3);
    struct hg_gpu_stage_time times[HG_GPU_MAX_STAGES];
    assert_int_equal(hg_gpu_stage_times(r->gpu, times), 2);
    assert_string_equal(times[0].name, "once");
    assert_string_equal(times[1].name, "often");
    hg_graph_begin(r->graph, SIDE, SIDE);
    hg_graph_pass(
        r->graph, &(struct hg_graph_pass){.name = "refuses", .record = refuse_run, .keep = true});
    hg_graph_pass(
        r->graph, &(struct hg_graph_pass){
                      .name = "often", .record = count_run, .user = &often, .keep = true});
    assert_int_equal(graph_rig_try(r), HG_E_LIMIT);
    assert_string_equal(r->err.reason, "run 0");
    assert_int_equal(often, 3);
}

static void expect_printed(struct graph_rig *r, enum hg_graph_format format, const char *part)
{
    struct hg_writer out = {0};
    hg_graph_print(r->graph, format, &out);
    hg_write_u8(&out, 0);
    assert_false(out.failed);
    if (strstr((const char *)out.data, part) == NULL)
        fail_msg("no '%s' in:\n%s", part, (const char *)out.data);
    hg_writer_finish(&out);
}

static void test_print(void **state)
{
    struct graph_rig *r = *state;
    struct hg_gpu_image outside = graph_rig_outside(r, "outside", SIDE);
    declare_simple(r, &outside, true);
    graph_rig_run(r);
    expect_printed(r, HG_GRAPH_TEXT, "8x8 px, 3 of 3 passes");
    expect_printed(r, HG_GRAPH_TEXT, "  2 blend: a sampled, b sampled, out drawn\n");
    expect_printed(r, HG_GRAPH_TEXT, "a: transient, R32F full, passes 0 to 2, bytes 0 to ");
    expect_printed(r, HG_GRAPH_MERMAID, "flowchart TD\n    p0[\"one\"]\n");
    expect_printed(r, HG_GRAPH_MERMAID, "    r0([\"a<br/>transient, R32F full\"])\n");
    expect_printed(r, HG_GRAPH_MERMAID, "    p2 --> r2\n");
    expect_printed(r, HG_GRAPH_DOT, "digraph frame {\n    p0 [shape=box,label=\"one\"]\n");
    expect_printed(r, HG_GRAPH_DOT, "    r1 -> p2\n");
    hg_gpu_image_destroy(r->gpu, &outside);
}

int main(void)
{
#define TEST(test) cmocka_unit_test_setup_teardown(test, graph_rig_setup, graph_rig_teardown)
    const struct CMUnitTest tests[] = {TEST(test_order), TEST(test_versions),
        TEST(test_imported_content), TEST(test_culling), TEST(test_refused),
        TEST(test_plans_are_kept), TEST(test_repetitions_and_errors), TEST(test_print)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
