// gpu_specialise.c - SPIR-V with its constants put in: it is valid, nothing that is ruled out is
// left, and it does what the whole does.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "base/file.h"
#include "renderer/gpu/embed.h"
#include "renderer/gpu/gpu.h"
#include "renderer/gpu/optimise.h"
#include "renderer/gpu/specialise.h"
#include "tests/support/check.h"
#include "tests/support/folder.h"

#define CONSTANTS 5

static uint32_t next(uint32_t *seed)
{
    *seed = *seed * 1664525u + 1013904223u;
    return *seed >> 8;
}

static void valid(const char *folder, const char *name, const struct hg_spirv *spirv)
{
    char path[256], command[1024];
    struct hg_error err = {0};
    snprintf(path, sizeof path, "%s/%s.spv", folder, name);
    test_ok(hg_file_write_atomic(path, spirv->words, spirv->size_bytes, &err), &err);
    snprintf(command, sizeof command, "spirv-val --target-env vulkan1.3 --scalar-block-layout '%s'",
        path);
    if (system(command) != 0)
        fail_msg("%s is not valid", name);
}

// Number of instructions; *specs: those of constants that are still open.
static uint32_t count_ops(const struct hg_spirv *spirv, uint32_t *specs)
{
    uint32_t count = 0;
    *specs = 0;
    for (size_t at = 5; at < spirv->size_bytes / 4; at += spirv->words[at] >> 16) {
        const uint32_t op = spirv->words[at] & 0xffff;
        *specs += op >= 48 && op <= 52; // OpSpecConstantTrue to OpSpecConstantOp
        count++;
    }
    return count;
}

// All shaders there are, with no bits, all bits and some bits.
static void test_valid(void **state)
{
    (void)state;
    size_t count;
    const struct hg_shader_binary *shaders = hg_shader_table(&count);
    char folder[TEST_FOLDER_MAX];
    assert_true(test_folder_make(folder, "specialise"));
    uint32_t seed = 7;
    for (size_t s = 0; s < count; s++) {
        for (uint32_t k = 0; k < 4; k++) {
            uint32_t values[CONSTANTS];
            for (uint32_t i = 0; i < CONSTANTS; i++)
                values[i] = k == 0 ? 0 : k == 1 ? UINT32_MAX : next(&seed) | next(&seed) << 16;
            if (k == 2)
                values[0] = 2; // what many take for a kind
            struct hg_spirv out, again;
            uint32_t specs;
            if (!hg_spirv_specialise(
                    shaders[s].words, shaders[s].size_bytes, values, CONSTANTS, &out))
                fail_msg("%s could not be specialised", shaders[s].name);
            valid(folder, shaders[s].name, &out);
            const uint32_t ops = count_ops(&out, &specs);
            assert_int_equal(specs, 0);
            assert_true(ops > 0 && out.size_bytes <= shaders[s].size_bytes);
            assert_true(hg_spirv_specialise(out.words, out.size_bytes, values, CONSTANTS, &again));
            assert_int_equal(again.size_bytes, out.size_bytes);
            assert_memory_equal(again.words, out.words, out.size_bytes);
            hg_spirv_free(&again);
            if (!hg_spirv_optimise(out.words, out.size_bytes, &again))
                fail_msg("%s could not be optimised", shaders[s].name);
            valid(folder, shaders[s].name, &again);
            hg_spirv_free(&again);
            hg_spirv_free(&out);
        }
    }
    assert_true(test_folder_remove(folder));
}

// What tests/support/shaders/test_branches.comp computes.
struct constants {
    uint32_t bits;
    int32_t step;
    uint32_t loud;
};

static uint32_t leaves_early(const struct constants *c, uint32_t i)
{
    if (c->bits & 1)
        return i + 100;
    return i > 20 ? (c->bits & 2 ? 1 : 2) : 3;
}

static uint32_t only_sometimes(const struct constants *c, uint32_t i)
{
    uint32_t sum = 0;
    for (uint32_t k = 0; k < 8; k++) {
        if ((c->bits & 4) && k == 3)
            continue;
        if ((c->bits & 8) || (k > 5 && i % 2 == 0))
            break;
        sum += k + leaves_early(c, k);
    }
    return sum;
}

static uint32_t turns(const struct constants *c, uint32_t i)
{
    if (c->bits & 32)
        return 9;
    do
        i += 5;
    while (i <= 40);
    return i;
}

static uint32_t chooses(const struct constants *c, uint32_t i)
{
    if (i % 4 == 3)
        return 4;
    if (i % 4 == 0)
        return c->bits & 64 ? (c->bits << 3) + (c->bits & 2 ? 7 : 11) : 1;
    return i % 4 == 1 && (c->loud || c->step > 0) ? (uint32_t)(c->step + 50) : 8;
}

static uint32_t expected(const struct constants *c, uint32_t i)
{
    uint32_t result = 5;
    if (!(c->bits & 128) && (c->loud != 0) != ((c->bits & 1) != 0))
        result += only_sometimes(c, i) * 3;
    result = result * 31 + ((c->bits & 16) && !c->loud ? 5 : i * 2);
    result = result * 31 + turns(c, i);
    return result * 31 + chooses(c, i);
}

static void dispatch(struct hg_gpu *gpu, const struct constants *c,
    const struct hg_gpu_buffer *words, uint32_t count, struct hg_error *err)
{
    const struct hg_gpu_pipeline_params pipeline = {.compute = "test_branches.comp",
        .spec = {c->bits, (uint32_t)c->step, c->loud},
        .spec_count = 3};
    const struct {
        uint64_t target;
        uint32_t count, value;
    } push = {words->address, count, 5};
    struct hg_gpu_cmd *cmd;
    struct hg_gpu_bindings bindings = {0};
    uint64_t value;
    test_ok(hg_gpu_begin(gpu, &cmd, err), err);
    test_ok(hg_gpu_cmd_bind(cmd, &bindings, err), err);
    test_ok(hg_gpu_cmd_pipeline(cmd, &pipeline, err), err);
    hg_gpu_cmd_push(cmd, &push, sizeof push);
    vkCmdDispatch(hg_gpu_cmd_handle(cmd), (count + 63) / 64, 1, 1);
    test_ok(hg_gpu_submit(gpu, cmd, &value, err), err);
    test_ok(hg_gpu_wait(gpu, value, err), err);
}

static void check_results(const struct hg_device_overrides *overrides)
{
    enum { COUNT = 64 };
    struct hg_error err = {0};
    struct hg_gpu *gpu;
    struct hg_gpu_buffer words;
    const struct hg_gpu_params params = {.validation = true, .overrides = *overrides};
    test_ok(hg_gpu_create(&params, &gpu, &err), &err);
    test_ok(
        hg_gpu_buffer_create(gpu, HG_GPU_BUFFER_READBACK, COUNT * 4, "words", &words, &err), &err);
    uint32_t seed = 3;
    for (uint32_t k = 0; k < 40; k++) {
        const struct constants c = {.bits = k < 9 ? k == 0 ? 0 : 1u << (k - 1) : next(&seed) & 0xff,
            .step = k % 3 == 0 ? 4 : -4,
            .loud = k % 2};
        dispatch(gpu, &c, &words, COUNT, &err);
        for (uint32_t i = 0; i < COUNT; i++)
            assert_int_equal(((const uint32_t *)words.mapped)[i], expected(&c, i));
    }
    hg_gpu_buffer_destroy(gpu, &words);
    assert_int_equal(hg_gpu_validation_messages(gpu), 0);
    hg_gpu_destroy(gpu);
}

static void test_same_results(void **state)
{
    (void)state;
    check_results(&(struct hg_device_overrides){.no_short_shaders = true});
}

static void test_same_results_optimised(void **state)
{
    (void)state;
    check_results(&(struct hg_device_overrides){.short_shaders = true});
}

// What is ruled out is gone: nothing to tell constants by, no function but the one.
static void test_smaller(void **state)
{
    (void)state;
    const struct hg_shader_binary *shader = hg_shader_find("test_branches.comp");
    assert_non_null(shader);
    struct hg_spirv some, all;
    uint32_t specs;
    const uint32_t few[] = {1u | 128u, 1, 1}, many[] = {0, 1, 1};
    assert_true(hg_spirv_specialise(shader->words, shader->size_bytes, few, 3, &some));
    assert_true(hg_spirv_specialise(shader->words, shader->size_bytes, many, 3, &all));
    assert_true(count_ops(&some, &specs) + 30 < count_ops(&all, &specs));
    hg_spirv_free(&some);
    hg_spirv_free(&all);
}

// Cut, and with words that are something else: refused or taken, never read outside.
static void test_malformed(void **state)
{
    (void)state;
    const struct hg_shader_binary *shader = hg_shader_find("test_branches.comp");
    assert_non_null(shader);
    const uint32_t values[3] = {5, 1, 1};
    struct hg_spirv out;
    uint32_t seed = 11;
    for (size_t cut = 0; cut < shader->size_bytes; cut += 4) {
        uint32_t *words = malloc(cut + 1);
        assert_non_null(words);
        memcpy(words, shader->words, cut);
        (void)hg_spirv_specialise(words, cut, values, 3, &out);
        hg_spirv_free(&out);
        (void)hg_spirv_optimise(words, cut, &out);
        hg_spirv_free(&out);
        free(words);
    }
    for (uint32_t k = 0; k < 20000; k++) {
        uint32_t *words = malloc(shader->size_bytes);
        assert_non_null(words);
        memcpy(words, shader->words, shader->size_bytes);
        for (uint32_t n = 0; n <= k % 3; n++)
            words[next(&seed) % (shader->size_bytes / 4)] =
                k % 2 == 0 ? next(&seed) << 8 | next(&seed) : next(&seed) % 400;
        if (hg_spirv_specialise(words, shader->size_bytes, values, 3, &out)) {
            struct hg_spirv shorter;
            (void)hg_spirv_optimise(out.words, out.size_bytes, &shorter);
            hg_spirv_free(&shorter);
        }
        hg_spirv_free(&out);
        (void)hg_spirv_optimise(words, shader->size_bytes, &out);
        hg_spirv_free(&out);
        free(words);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_valid),
        cmocka_unit_test(test_same_results),
        cmocka_unit_test(test_same_results_optimised),
        cmocka_unit_test(test_smaller),
        cmocka_unit_test(test_malformed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
