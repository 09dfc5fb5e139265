// gpu_device.c - the device room on whatever device is best: buffers, images, compute, rendering,
// timers, errors, with mapped memory and with the staging path of discrete GPUs.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/alloc.h"
#include "base/file.h"
#include "base/log.h"
#include "renderer/gpu/internal.h"
#include "tests/support/check.h"
#include "tests/support/folder.h"

struct fixture {
    struct hg_gpu *gpu;
    struct hg_error err;
};

static int setup_params(void **state, const struct hg_gpu_params *params)
{
    struct fixture *f = calloc(1, sizeof *f);
    assert_non_null(f);
    test_ok(hg_gpu_create(params, &f->gpu, &f->err), &f->err);
    *state = f;
    return 0;
}

static int setup_mapped(void **state)
{
    const struct hg_gpu_params params = {.validation = true};
    return setup_params(state, &params);
}

static int setup_staging(void **state)
{
    const struct hg_gpu_params params = {.validation = true, .force_staging = true};
    return setup_params(state, &params);
}

static int teardown(void **state)
{
    struct fixture *f = *state;
    const uint32_t messages = hg_gpu_validation_messages(f->gpu);
    hg_gpu_destroy(f->gpu);
    free(f);
    return messages == 0 ? 0 : -1;
}

static void run(struct fixture *f, struct hg_gpu_cmd *cmd)
{
    test_ok(hg_gpu_submit_and_wait(f->gpu, cmd, &f->err), &f->err);
}

static void test_buffer_round_trip(void **state)
{
    struct fixture *f = *state;
    const uint64_t size = 40u << 20; // more than the staging memory
    struct hg_gpu_buffer buffer, back;
    test_ok(hg_gpu_buffer_create(f->gpu, HG_GPU_BUFFER_DEVICE, size, "data", &buffer, &f->err),
        &f->err);
    test_ok(hg_gpu_buffer_create(f->gpu, HG_GPU_BUFFER_READBACK, size, "back", &back, &f->err),
        &f->err);
    assert_true(buffer.mapped != NULL || !hg_gpu_get_caps(f->gpu)->mapped);
    uint32_t *words = malloc(size);
    assert_non_null(words);
    for (uint32_t i = 0; i < size / 4; i++)
        words[i] = i * 2654435761u;
    test_ok(hg_gpu_buffer_upload(f->gpu, &buffer, 0, words, size, &f->err), &f->err);
    struct hg_gpu_cmd *cmd;
    test_ok(hg_gpu_begin(f->gpu, &cmd, &f->err), &f->err);
    const VkBufferCopy copy = {0, 0, size};
    vkCmdCopyBuffer(hg_gpu_cmd_handle(cmd), buffer.handle, back.handle, 1, &copy);
    run(f, cmd);
    assert_memory_equal(back.mapped, words, size);
    assert_int_equal(
        hg_gpu_buffer_upload(f->gpu, &buffer, size - 4, words, 8, &f->err), HG_E_INVAL);
    free(words);
    hg_gpu_buffer_destroy(f->gpu, &buffer);
    hg_gpu_buffer_destroy(f->gpu, &back);
}

static void test_image_round_trip(void **state)
{
    struct fixture *f = *state;
    struct hg_gpu_image image;
    struct hg_gpu_buffer back;
    const struct hg_gpu_image_params params = {.kind = HG_GPU_IMAGE_2D_ARRAY,
        .format = VK_FORMAT_R8G8B8A8_UNORM,
        .width = 64,
        .height = 32,
        .layers = 3,
        .mips = 2,
        .name = "array"};
    uint8_t pixels[16 * 8 * 4];
    for (size_t i = 0; i < sizeof pixels; i++)
        pixels[i] = (uint8_t)(i * 7);
    test_ok(hg_gpu_image_create(f->gpu, &params, &image, &f->err), &f->err);
    test_ok(hg_gpu_buffer_create(f->gpu, HG_GPU_BUFFER_READBACK, 4096, "back", &back, &f->err),
        &f->err);
    const struct hg_gpu_region region = {
        .mip = 1, .layer = 2, .x = 4, .y = 2, .width = 16, .height = 8};
    test_ok(hg_gpu_image_upload(f->gpu, &image, &region, pixels, 0, &f->err), &f->err);
    struct hg_gpu_cmd *cmd;
    test_ok(hg_gpu_begin(f->gpu, &cmd, &f->err), &f->err);
    hg_gpu_image_read(cmd, &image, &region, &back, 256);
    run(f, cmd);
    assert_memory_equal((uint8_t *)back.mapped + 256, pixels, sizeof pixels);
    const struct hg_gpu_region outside = {.mip = 1, .x = 30, .width = 16, .height = 8};
    assert_int_equal(hg_gpu_image_upload(f->gpu, &image, &outside, pixels, 0, &f->err), HG_E_INVAL);
    hg_gpu_image_destroy(f->gpu, &image);
    hg_gpu_buffer_destroy(f->gpu, &back);
}

// Uploads that meet the same place take effect in their order, by barriers and not by luck: the
// synchronization validation of the fixture watches.
static void test_uploads_in_order(void **state)
{
    struct fixture *f = *state;
    enum { ROUNDS = 100, WORDS = 64 };
    struct hg_gpu_buffer buffer, back;
    struct hg_gpu_image image;
    const struct hg_gpu_image_params params = {
        .format = VK_FORMAT_R8G8B8A8_UNORM, .width = 8, .height = 8, .name = "rewritten"};
    const struct hg_gpu_region all = {.width = 8, .height = 8};
    uint32_t words[WORDS], expected[2][WORDS] = {{0}}; // of the buffer, of the image
    test_ok(hg_gpu_image_create(f->gpu, &params, &image, &f->err), &f->err);
    test_ok(hg_gpu_buffer_create(
                f->gpu, HG_GPU_BUFFER_DEVICE, WORDS * 4, "rewritten", &buffer, &f->err),
        &f->err);
    test_ok(
        hg_gpu_buffer_create(f->gpu, HG_GPU_BUFFER_READBACK, 512, "back", &back, &f->err), &f->err);
    for (uint32_t i = 0; i < ROUNDS; i++) {
        const uint32_t first = i * 7 % (WORDS - 15), count = 16;
        const struct hg_gpu_region part = {.x = i % 5, .y = i % 3, .width = 4, .height = 6};
        for (uint32_t k = 0; k < WORDS; k++)
            words[k] = i << 16 | k;
        if (i == 0) { // everything once
            test_ok(hg_gpu_buffer_upload(f->gpu, &buffer, 0, words, WORDS * 4, &f->err), &f->err);
            test_ok(hg_gpu_image_upload(f->gpu, &image, &all, words, 0, &f->err), &f->err);
            memcpy(expected[0], words, sizeof words);
            memcpy(expected[1], words, sizeof words);
        }
        test_ok(
            hg_gpu_buffer_upload(f->gpu, &buffer, first * 4, words, count * 4, &f->err), &f->err);
        memcpy(expected[0] + first, words, count * 4);
        test_ok(hg_gpu_image_upload(f->gpu, &image, &part, words, 0, &f->err), &f->err);
        for (uint32_t y = 0; y < part.height; y++)
            memcpy(&expected[1][(part.y + y) * 8 + part.x], words + y * 4, 16);
    }
    struct hg_gpu_cmd *cmd;
    test_ok(hg_gpu_begin(f->gpu, &cmd, &f->err), &f->err);
    const VkBufferCopy copy = {0, 0, WORDS * 4};
    vkCmdCopyBuffer(hg_gpu_cmd_handle(cmd), buffer.handle, back.handle, 1, &copy);
    hg_gpu_image_read(cmd, &image, &all, &back, 256);
    run(f, cmd);
    assert_memory_equal(back.mapped, expected, sizeof expected);
    hg_gpu_image_destroy(f->gpu, &image);
    hg_gpu_buffer_destroy(f->gpu, &buffer);
    hg_gpu_buffer_destroy(f->gpu, &back);
}

static void test_image_limit(void **state)
{
    struct fixture *f = *state;
    struct hg_gpu_image image;
    const struct hg_gpu_image_params params = {
        .format = VK_FORMAT_R8G8B8A8_UNORM, .width = 1u << 20, .height = 4, .name = "huge"};
    assert_int_equal(hg_gpu_image_create(f->gpu, &params, &image, &f->err), HG_E_LIMIT);
    assert_true(image.handle == VK_NULL_HANDLE);
    assert_non_null(strstr(f->err.reason, "1048576x4"));
}

static void fill(struct fixture *f, uint32_t step, const uint32_t *expected, uint32_t count)
{
    struct hg_gpu_buffer words;
    test_ok(
        hg_gpu_buffer_create(f->gpu, HG_GPU_BUFFER_READBACK, count * 4, "words", &words, &f->err),
        &f->err);
    const struct hg_gpu_pipeline_params pipeline = {
        .compute = "test_fill.comp", .spec = {step}, .spec_count = 1};
    const struct {
        uint64_t target;
        uint32_t count, value;
    } push = {words.address, count, 5};
    struct hg_gpu_cmd *cmd;
    test_ok(hg_gpu_begin(f->gpu, &cmd, &f->err), &f->err);
    struct hg_gpu_bindings bindings = {0};
    test_ok(hg_gpu_cmd_bind(cmd, &bindings, &f->err), &f->err);
    test_ok(hg_gpu_cmd_pipeline(cmd, &pipeline, &f->err), &f->err);
    hg_gpu_cmd_push(cmd, &push, sizeof push);
    hg_gpu_cmd_begin_stage(cmd, "fill");
    vkCmdDispatch(hg_gpu_cmd_handle(cmd), (count + 63) / 64, 1, 1);
    hg_gpu_cmd_end_stage(cmd);
    run(f, cmd);
    assert_memory_equal(words.mapped, expected, count * 4);
    hg_gpu_buffer_destroy(f->gpu, &words);
}

static void test_compute(void **state)
{
    struct fixture *f = *state;
    uint32_t ones[100], threes[100];
    for (uint32_t i = 0; i < 100; i++) {
        ones[i] = 5 + i;
        threes[i] = 5 + 3 * i;
    }
    fill(f, 1, ones, 100);
    fill(f, 3, threes, 100);
    struct hg_gpu_stage_time times[HG_GPU_MAX_STAGES];
    assert_int_equal(hg_gpu_stage_times(f->gpu, times), 1);
    assert_string_equal(times[0].name, "fill");
    assert_true(times[0].ns > 0 && times[0].ns < 10000000000ull);
    assert_int_equal(hg_gpu_pipeline_count(f->gpu), 2);
}

static void test_rendering(void **state)
{
    struct fixture *f = *state;
    struct hg_gpu_image image;
    struct hg_gpu_buffer back;
    const struct hg_gpu_image_params params = {.format = VK_FORMAT_R8G8B8A8_UNORM,
        .width = 8,
        .height = 8,
        .attachment = true,
        .name = "target"};
    test_ok(hg_gpu_image_create(f->gpu, &params, &image, &f->err), &f->err);
    test_ok(
        hg_gpu_buffer_create(f->gpu, HG_GPU_BUFFER_READBACK, 256, "back", &back, &f->err), &f->err);
    const struct hg_gpu_pipeline_params pipeline = {.vertex = "fullscreen.vert",
        .fragment = "test_color.frag",
        .colors = {VK_FORMAT_R8G8B8A8_UNORM},
        .color_count = 1,
        .topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST};
    const struct hg_gpu_rendering rendering = {
        .colors = {{.image = &image, .clear = true}}, .color_count = 1};
    const float color[4] = {1.0f, 0.2f, 0.0f, 0.4f};
    struct hg_gpu_cmd *cmd;
    test_ok(hg_gpu_begin(f->gpu, &cmd, &f->err), &f->err);
    hg_gpu_cmd_begin_rendering(cmd, &rendering);
    test_ok(hg_gpu_cmd_pipeline(cmd, &pipeline, &f->err), &f->err);
    hg_gpu_cmd_push(cmd, color, sizeof color);
    vkCmdDraw(hg_gpu_cmd_handle(cmd), 3, 1, 0, 0);
    hg_gpu_cmd_end_rendering(cmd);
    const struct hg_gpu_region all = {.width = 8, .height = 8};
    hg_gpu_image_read(cmd, &image, &all, &back, 0);
    run(f, cmd);
    const uint8_t expected[4] = {255, 51, 0, 102};
    for (int i = 0; i < 64; i++)
        assert_memory_equal((uint8_t *)back.mapped + 4 * i, expected, 4);
    hg_gpu_image_destroy(f->gpu, &image);
    hg_gpu_buffer_destroy(f->gpu, &back);
}

static void test_memory_returns(void **state)
{
    struct fixture *f = *state;
    struct hg_gpu_memory_stats before, after;
    hg_gpu_memory_stats(f->gpu, &before);
    struct hg_gpu_buffer buffers[300];
    for (uint32_t round = 0; round < 3; round++) {
        for (uint32_t i = 0; i < 300; i++) {
            test_ok(hg_gpu_buffer_create(f->gpu, HG_GPU_BUFFER_DEVICE, 1000 + i * 977, "small",
                        &buffers[i], &f->err),
                &f->err);
            assert_int_equal(buffers[i].address % 256, 0);
        }
        for (uint32_t i = 0; i < 300; i++) // out of order
            hg_gpu_buffer_destroy(f->gpu, &buffers[(i * 7) % 300]);
    }
    hg_gpu_memory_stats(f->gpu, &after);
    assert_int_equal(before.used_bytes, after.used_bytes);
    assert_true(after.reserved_bytes <= before.reserved_bytes + (128u << 20));
}

static void test_device_json(void **state)
{
    struct fixture *f = *state;
    char *text;
    assert_int_equal(hg_gpu_device_json(f->gpu, &text), HG_OK);
    assert_non_null(strstr(text, "\"features\":{"));
    assert_non_null(strstr(text, "\"dynamicRendering\":true"));
    assert_int_equal(strstr(text, "\"staging\":") != NULL, !hg_gpu_get_caps(f->gpu)->mapped);
    hg_free(text);
}

static void test_no_such_device(void **state)
{
    (void)state;
    struct hg_gpu *gpu;
    struct hg_error err = {0};
    const struct hg_gpu_params params = {.device = "no such device"};
    assert_int_equal(hg_gpu_create(&params, &gpu, &err), HG_E_DEVICE);
    assert_null(gpu);
    assert_non_null(strstr(err.reason, "not asked for"));
}

// Every call that can fail does, one after the other: no leak, no crash, a status each time.
static void test_failing_calls(void **state)
{
    (void)state;
    const struct hg_gpu_params params = {0};
    for (uint64_t n = 1;; n++) {
        struct hg_gpu *gpu;
        struct hg_error err = {0};
        hg_gpu_fail_at(n, VK_ERROR_OUT_OF_DEVICE_MEMORY);
        const enum hg_status status = hg_gpu_create(&params, &gpu, &err);
        const uint64_t calls = hg_gpu_call_count();
        hg_gpu_fail_at(0, VK_SUCCESS);
        hg_gpu_destroy(gpu);
        if (status == HG_OK) {
            assert_true(calls < n);
            break;
        }
        assert_int_equal(status, HG_E_NOMEM);
        assert_null(gpu);
        assert_true(err.reason[0] != '\0');
        assert_true(n < 500);
    }
}

static void test_device_lost(void **state)
{
    (void)state;
    const struct hg_gpu_params params = {0};
    struct hg_gpu *gpu;
    struct hg_error err = {0};
    test_ok(hg_gpu_create(&params, &gpu, &err), &err);
    struct hg_gpu_cmd *cmd;
    uint64_t value;
    test_ok(hg_gpu_begin(gpu, &cmd, &err), &err);
    test_ok(hg_gpu_submit(gpu, cmd, &value, &err), &err);
    hg_gpu_fail_at(1, VK_ERROR_DEVICE_LOST);
    assert_int_equal(hg_gpu_wait(gpu, value, &err), HG_E_DEVICE_LOST);
    hg_gpu_fail_at(0, VK_SUCCESS);
    assert_true(hg_gpu_is_lost(gpu));
    assert_int_equal(hg_gpu_begin(gpu, &cmd, &err), HG_E_DEVICE_LOST);
    hg_gpu_destroy(gpu);
    test_ok(hg_gpu_create(&params, &gpu, &err), &err);
    hg_gpu_destroy(gpu);
}

// Shaders from a folder: a good tree works, a broken line is named.
static void test_stuck(void **state)
{
    (void)state;
    const uint64_t limit_ns = HG_GPU_WAIT_NS;
    assert_false(hg_gpu_is_stuck(false, limit_ns - 1, 0));
    assert_true(hg_gpu_is_stuck(false, limit_ns, 0));
    assert_false(hg_gpu_is_stuck(true, limit_ns - 1, 4 * limit_ns));  // many threads
    assert_false(hg_gpu_is_stuck(true, 5 * limit_ns, limit_ns / 10)); // starved
    assert_true(hg_gpu_is_stuck(true, limit_ns, limit_ns / 2));
    assert_true(hg_gpu_is_stuck(true, 10 * limit_ns, 0)); // a deadlock
}

static void test_shader_dir(void **state)
{
    (void)state;
    char folder[TEST_FOLDER_MAX], command[1024];
    assert_true(test_folder_make(folder, "shaders"));
    const char *source = getenv("HELIO_SOURCE_DIR");
    assert_non_null(source);
    snprintf(command, sizeof command,
        "cp -r '%s/shaders/.' %s && cp '%s/tests/support/shaders/test_fill.comp' %s/passes", source,
        folder, source, folder);
    assert_int_equal(system(command), 0);
    const struct hg_gpu_params params = {.shader_dir = folder, .validation = true};
    struct fixture f = {0};
    test_ok(hg_gpu_create(&params, &f.gpu, &f.err), &f.err);
    const uint32_t expected[2] = {5, 7};
    fill(&f, 2, expected, 2);
    assert_int_equal(hg_gpu_validation_messages(f.gpu), 0);
    test_text_write(folder, "lib/broken.glsl", "// one\n// two\nfloat broken = missing_name;\n");
    test_text_write(folder, "passes/broken.comp",
        "#version 460\n#extension GL_GOOGLE_include_directive : require\n"
        "#include \"lib/broken.glsl\"\nlayout(local_size_x = 1) in;\nvoid main() {}\n");
    const struct hg_gpu_pipeline_params pipeline = {.compute = "broken.comp"};
    VkPipeline handle;
    assert_int_equal(hg_gpu_pipeline_get(f.gpu, &pipeline, &handle, &f.err), HG_E_FORMAT);
    assert_string_equal(f.err.what, "lib/broken.glsl");
    assert_string_equal(f.err.where, "line 3");
    assert_non_null(strstr(f.err.reason, "missing_name"));
    const struct hg_gpu_pipeline_params none = {.compute = "none.comp"};
    assert_int_equal(hg_gpu_pipeline_get(f.gpu, &none, &handle, &f.err), HG_E_NOTFOUND);
    hg_gpu_destroy(f.gpu);
    assert_true(test_folder_remove(folder));
}

#define BOTH(test)                                                                                 \
    cmocka_unit_test_setup_teardown(test, setup_mapped, teardown),                                 \
        cmocka_unit_test_setup_teardown(test, setup_staging, teardown)

int main(void)
{
    hg_log_set_sink(hg_log_sink_logfmt, (void *)(intptr_t)STDERR_FILENO);
    const struct CMUnitTest tests[] = {
        BOTH(test_buffer_round_trip),
        BOTH(test_image_round_trip),
        BOTH(test_uploads_in_order),
        BOTH(test_image_limit),
        BOTH(test_compute),
        BOTH(test_rendering),
        BOTH(test_memory_returns),
        BOTH(test_device_json),
        cmocka_unit_test(test_no_such_device),
        cmocka_unit_test(test_failing_calls),
        cmocka_unit_test(test_device_lost),
        cmocka_unit_test(test_stuck),
        cmocka_unit_test(test_shader_dir),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
