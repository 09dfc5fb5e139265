// gpu_images.c - storage images, mips as targets, 3D images, images that share memory, bindings of
// passes, and several batches in flight; under validation, with mapped memory and with staging.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "renderer/gpu/io.h"
#include "shaders/shared/pass_io.h"
#include "tests/support/check.h"

struct fixture {
    struct hg_gpu *gpu;
    struct hg_gpu_cmd *cmd;
    struct hg_error err;
};

static int setup(void **state, bool staging)
{
    struct fixture *f = calloc(1, sizeof *f);
    const struct hg_gpu_params params = {.validation = true, .force_staging = staging};
    assert_non_null(f);
    test_ok(hg_gpu_create(&params, &f->gpu, &f->err), &f->err);
    *state = f;
    return 0;
}

static int setup_mapped(void **state)
{
    return setup(state, false);
}

static int setup_staging(void **state)
{
    return setup(state, true);
}

static int teardown(void **state)
{
    struct fixture *f = *state;
    const uint32_t messages = hg_gpu_validation_messages(f->gpu);
    hg_gpu_destroy(f->gpu);
    free(f);
    return messages == 0 ? 0 : -1;
}

static void ok(struct fixture *f, enum hg_status status)
{
    test_ok(status, &f->err);
}

static struct hg_gpu_image make(struct fixture *f, const struct hg_gpu_image_params *params)
{
    struct hg_gpu_image image;
    ok(f, hg_gpu_image_create(f->gpu, params, &image, &f->err));
    return image;
}

static struct hg_gpu_buffer make_readback(struct fixture *f, uint64_t size)
{
    struct hg_gpu_buffer buffer;
    ok(f, hg_gpu_buffer_create(f->gpu, HG_GPU_BUFFER_READBACK, size, "back", &buffer, &f->err));
    return buffer;
}

static const struct hg_gpu_io mip_io = HG_GPU_IO(HG_TEST_MIP_IO);
struct mip_inputs {
    HG_TEST_MIP_IO(HG_GPU_IO_MEMBER)
};

// One mip from the one before it, by a compute shader.
static void reduce(struct fixture *f, struct hg_gpu_image *image, uint32_t mip)
{
    const struct hg_gpu_pipeline_params pipeline = {.compute = "test_mip.comp", .io = &mip_io};
    const struct mip_inputs in = {.finer = {image, mip}, .coarser = {image, mip + 1}};
    ok(f, hg_gpu_cmd_bind_io(f->cmd, &mip_io, &in, sizeof in, &f->err));
    ok(f, hg_gpu_cmd_pipeline(f->cmd, &pipeline, &f->err));
    vkCmdDispatch(hg_gpu_cmd_handle(f->cmd), 2, 2, 1);
}

static void test_storage_mips(void **state)
{
    struct fixture *f = *state;
    enum { SIDE = 32, MIPS = 4 };
    const struct hg_gpu_image_params params = {.format = VK_FORMAT_R32_SFLOAT,
        .width = SIDE,
        .height = SIDE,
        .mips = MIPS,
        .storage = true,
        .name = "chain"};
    struct hg_gpu_image image = make(f, &params);
    struct hg_gpu_buffer back = make_readback(f, 4 * 4 * 4);
    float texels[SIDE * SIDE];
    for (uint32_t i = 0; i < SIDE * SIDE; i++)
        texels[i] = (float)(i % SIDE / 8 + 4 * (i / SIDE / 8)); // 4 x 4 flat squares
    const struct hg_gpu_region top = {.width = SIDE, .height = SIDE};
    const struct hg_gpu_region last = {.mip = MIPS - 1, .width = 4, .height = 4};
    ok(f, hg_gpu_image_upload(f->gpu, &image, &top, texels, 0, &f->err));
    ok(f, hg_gpu_begin(f->gpu, &f->cmd, &f->err));
    for (uint32_t mip = 1; mip < MIPS; mip++)
        reduce(f, &image, mip);
    hg_gpu_image_read(f->cmd, &image, &last, &back, 0);
    ok(f, hg_gpu_submit_and_wait(f->gpu, f->cmd, &f->err));
    for (uint32_t i = 0; i < 16; i++)
        assert_float_equal(((float *)back.mapped)[i], (float)i, 0.0f);
    hg_gpu_image_destroy(f->gpu, &image);
    hg_gpu_buffer_destroy(f->gpu, &back);
}

static const struct hg_gpu_io volume_io = HG_GPU_IO(HG_TEST_VOLUME_IO);
struct volume_inputs {
    HG_TEST_VOLUME_IO(HG_GPU_IO_MEMBER)
};

static void test_volume(void **state)
{
    struct fixture *f = *state;
    enum { SIDE = 4 };
    struct hg_gpu_image_params params = {.kind = HG_GPU_IMAGE_3D,
        .format = VK_FORMAT_R32_SFLOAT,
        .width = SIDE,
        .height = SIDE,
        .depth = SIDE,
        .storage = true,
        .name = "volume"};
    struct hg_gpu_image from = make(f, &params), to = make(f, &params);
    struct hg_gpu_buffer back = make_readback(f, SIDE * SIDE * 4);
    for (uint32_t z = 0; z < SIDE; z++) {
        float slice[SIDE * SIDE];
        for (uint32_t i = 0; i < SIDE * SIDE; i++)
            slice[i] = (float)(10 * z + i % SIDE);
        const struct hg_gpu_region region = {.layer = z, .width = SIDE, .height = SIDE};
        ok(f, hg_gpu_image_upload(f->gpu, &from, &region, slice, 0, &f->err));
    }
    const struct hg_gpu_region outside = {.layer = SIDE, .width = 1, .height = 1};
    assert_int_equal(hg_gpu_image_upload(f->gpu, &from, &outside, &params, 0, &f->err), HG_E_INVAL);
    const struct hg_gpu_pipeline_params pipeline = {
        .compute = "test_volume.comp", .io = &volume_io};
    const struct volume_inputs in = {.volume = {&from, 0}, .volume_out = {&to, 0}};
    const struct hg_gpu_region third = {.layer = 3, .width = SIDE, .height = SIDE};
    ok(f, hg_gpu_begin(f->gpu, &f->cmd, &f->err));
    ok(f, hg_gpu_cmd_bind_io(f->cmd, &volume_io, &in, sizeof in, &f->err));
    ok(f, hg_gpu_cmd_pipeline(f->cmd, &pipeline, &f->err));
    vkCmdDispatch(hg_gpu_cmd_handle(f->cmd), 1, 1, 1);
    hg_gpu_image_read(f->cmd, &to, &third, &back, 0);
    ok(f, hg_gpu_submit_and_wait(f->gpu, f->cmd, &f->err));
    const float expected[SIDE] = {30.5f, 31.5f, 32.5f, 33.0f}; // the last one is clamped
    for (uint32_t i = 0; i < SIDE * SIDE; i++)
        assert_float_equal(((float *)back.mapped)[i], expected[i % SIDE], 1e-2f);
    hg_gpu_image_destroy(f->gpu, &from);
    hg_gpu_image_destroy(f->gpu, &to);
    hg_gpu_buffer_destroy(f->gpu, &back);
}

static void clear(struct fixture *f, struct hg_gpu_image *image, uint32_t mip, float value)
{
    const struct hg_gpu_rendering rendering = {
        .colors = {{.image = image,
            .mip = mip,
            .clear = true,
            .value.color.float32 = {value, value, value, value}}},
        .color_count = 1};
    hg_gpu_cmd_begin_rendering(f->cmd, &rendering);
    hg_gpu_cmd_end_rendering(f->cmd);
}

static void test_mips_as_targets(void **state)
{
    struct fixture *f = *state;
    const struct hg_gpu_image_params params = {.format = VK_FORMAT_R32_SFLOAT,
        .width = 5,
        .height = 2,
        .mips = 3,
        .attachment = true,
        .name = "targets"};
    struct hg_gpu_image image = make(f, &params);
    struct hg_gpu_buffer back = make_readback(f, 1024);
    ok(f, hg_gpu_begin(f->gpu, &f->cmd, &f->err));
    for (uint32_t mip = 0; mip < 3; mip++)
        clear(f, &image, mip, (float)(mip + 1));
    const uint32_t widths[3] = {5, 2, 1}, heights[3] = {2, 1, 1};
    for (uint32_t mip = 0; mip < 3; mip++) {
        const struct hg_gpu_region all = {.mip = mip, .width = widths[mip], .height = heights[mip]};
        hg_gpu_image_read(f->cmd, &image, &all, &back, 256 * mip);
    }
    ok(f, hg_gpu_submit_and_wait(f->gpu, f->cmd, &f->err));
    for (uint32_t mip = 0; mip < 3; mip++)
        for (uint32_t i = 0; i < widths[mip] * heights[mip]; i++)
            assert_float_equal(((float *)back.mapped)[64 * mip + i], (float)(mip + 1), 0.0f);
    hg_gpu_image_destroy(f->gpu, &image);
    hg_gpu_buffer_destroy(f->gpu, &back);
}

static void test_limits(void **state)
{
    struct fixture *f = *state;
    struct hg_gpu_image image;
    const struct hg_gpu_image_params many = {
        .format = VK_FORMAT_R8G8B8A8_UNORM, .width = 4, .height = 4, .mips = 9, .name = "mips"};
    assert_int_equal(hg_gpu_image_create(f->gpu, &many, &image, &f->err), HG_E_LIMIT);
    const struct hg_gpu_image_params deep = {.kind = HG_GPU_IMAGE_3D,
        .format = VK_FORMAT_R8G8B8A8_UNORM,
        .width = 4,
        .height = 4,
        .depth = 1u << 20,
        .name = "slices"};
    assert_int_equal(hg_gpu_image_create(f->gpu, &deep, &image, &f->err), HG_E_LIMIT);
    const struct hg_gpu_image_params odd = {.format = VK_FORMAT_E5B9G9R9_UFLOAT_PACK32,
        .width = 4,
        .height = 4,
        .storage = true,
        .name = "no storage"};
    assert_int_equal(hg_gpu_image_create(f->gpu, &odd, &image, &f->err), HG_E_LIMIT);
}

// Two images in the same memory, one after the other.
static void test_shared_memory(void **state)
{
    struct fixture *f = *state;
    struct hg_gpu_image_params params = {.format = VK_FORMAT_R32_SFLOAT,
        .width = 16,
        .height = 16,
        .attachment = true,
        .name = "one of two"};
    struct hg_gpu_image_need need;
    struct hg_gpu_memory memory;
    struct hg_gpu_memory_stats before, after;
    hg_gpu_image_need(f->gpu, &params, &need);
    assert_true(need.size_bytes >= 16 * 16 * 4 && need.alignment > 0);
    ok(f, hg_gpu_memory_create(f->gpu, &need, &memory, &f->err));
    hg_gpu_memory_stats(f->gpu, &before);
    params.memory = &memory;
    struct hg_gpu_image first = make(f, &params), second = make(f, &params);
    hg_gpu_memory_stats(f->gpu, &after);
    assert_int_equal(before.used_bytes, after.used_bytes);
    struct hg_gpu_buffer back = make_readback(f, 2 * 1024);
    const struct hg_gpu_region all = {.width = 16, .height = 16};
    ok(f, hg_gpu_begin(f->gpu, &f->cmd, &f->err));
    clear(f, &first, 0, 3.0f);
    hg_gpu_image_read(f->cmd, &first, &all, &back, 0);
    hg_gpu_image_use(f->cmd, &second, HG_GPU_USE_NONE);
    clear(f, &second, 0, 4.0f);
    hg_gpu_image_read(f->cmd, &second, &all, &back, 1024);
    ok(f, hg_gpu_submit_and_wait(f->gpu, f->cmd, &f->err));
    for (uint32_t i = 0; i < 256; i++) {
        assert_float_equal(((float *)back.mapped)[i], 3.0f, 0.0f);
        assert_float_equal(((float *)back.mapped)[256 + i], 4.0f, 0.0f);
    }
    hg_gpu_image_destroy(f->gpu, &first);
    hg_gpu_image_destroy(f->gpu, &second);
    hg_gpu_memory_destroy(f->gpu, &memory);
    hg_gpu_buffer_destroy(f->gpu, &back);
}

// What is not bound is a stand-in: no validation message, no crash.
static void test_nothing_bound(void **state)
{
    struct fixture *f = *state;
    const struct hg_gpu_pipeline_params pipeline = {
        .compute = "test_volume.comp", .io = &volume_io};
    const struct volume_inputs in = {0};
    ok(f, hg_gpu_begin(f->gpu, &f->cmd, &f->err));
    ok(f, hg_gpu_cmd_bind_io(f->cmd, &volume_io, &in, sizeof in, &f->err));
    ok(f, hg_gpu_cmd_pipeline(f->cmd, &pipeline, &f->err));
    vkCmdDispatch(hg_gpu_cmd_handle(f->cmd), 1, 1, 1);
    ok(f, hg_gpu_submit_and_wait(f->gpu, f->cmd, &f->err));
}

static void fill(struct fixture *f, const struct hg_gpu_buffer *to, uint32_t value)
{
    const struct hg_gpu_pipeline_params pipeline = {
        .compute = "test_fill.comp", .spec = {1}, .spec_count = 1};
    const struct hg_gpu_bindings bindings = {0};
    const struct {
        uint64_t target;
        uint32_t count, value;
    } push = {to->address, 64, value};
    ok(f, hg_gpu_cmd_bind(f->cmd, &bindings, &f->err));
    ok(f, hg_gpu_cmd_pipeline(f->cmd, &pipeline, &f->err));
    hg_gpu_cmd_push(f->cmd, &push, sizeof push);
    vkCmdDispatch(hg_gpu_cmd_handle(f->cmd), 1, 1, 1);
}

// More batches than can be in flight, each with an upload of its own; none is waited for but by
// hg_gpu_begin, and buffers are destroyed while batches that use them run.
static void test_in_flight(void **state)
{
    struct fixture *f = *state;
    enum { BATCHES = 3 * HG_GPU_MAX_IN_FLIGHT };
    struct hg_gpu_buffer back[BATCHES];
    uint64_t values[BATCHES];
    for (uint32_t i = 0; i < BATCHES; i++) {
        struct hg_gpu_buffer words;
        uint32_t data[64];
        for (uint32_t k = 0; k < 64; k++)
            data[k] = i * 1000 + k;
        back[i] = make_readback(f, 2 * sizeof data);
        ok(f, hg_gpu_buffer_create(
                  f->gpu, HG_GPU_BUFFER_DEVICE, sizeof data, "words", &words, &f->err));
        ok(f, hg_gpu_buffer_upload(f->gpu, &words, 0, data, sizeof data, &f->err));
        ok(f, hg_gpu_begin(f->gpu, &f->cmd, &f->err));
        const VkBufferCopy copy = {0, sizeof data, sizeof data};
        vkCmdCopyBuffer(hg_gpu_cmd_handle(f->cmd), words.handle, back[i].handle, 1, &copy);
        fill(f, &back[i], i);
        ok(f, hg_gpu_submit(f->gpu, f->cmd, &values[i], &f->err));
        assert_true(i == 0 || values[i] == values[i - 1] + 1);
        hg_gpu_buffer_destroy(f->gpu, &words);
    }
    ok(f, hg_gpu_wait(f->gpu, values[BATCHES - 1], &f->err));
    for (uint32_t i = 0; i < BATCHES; i++) {
        const uint32_t *words = back[i].mapped;
        for (uint32_t k = 0; k < 64; k++) {
            assert_int_equal(words[k], i + k);
            assert_int_equal(words[64 + k], i * 1000 + k);
        }
        hg_gpu_buffer_destroy(f->gpu, &back[i]);
    }
}

// Every call fails once: no leak, no crash, and the same works afterwards.
static void test_failing_calls(void **state)
{
    struct fixture *f = *state;
    const struct hg_gpu_image_params params = {.format = VK_FORMAT_R32_SFLOAT,
        .width = 8,
        .height = 8,
        .mips = 3,
        .storage = true,
        .attachment = true,
        .name = "failing"};
    struct hg_gpu_memory_stats before, after;
    hg_gpu_memory_stats(f->gpu, &before);
    for (uint64_t n = 1;; n++) {
        struct hg_gpu_image image;
        hg_gpu_fail_at(n, VK_ERROR_OUT_OF_DEVICE_MEMORY);
        const enum hg_status status = hg_gpu_image_create(f->gpu, &params, &image, &f->err);
        const uint64_t calls = hg_gpu_call_count();
        hg_gpu_fail_at(0, VK_SUCCESS);
        hg_gpu_image_destroy(f->gpu, &image);
        assert_true(status == (calls < n ? HG_OK : HG_E_NOMEM));
        if (status == HG_OK)
            break;
        assert_true(n < 50);
    }
    hg_gpu_memory_stats(f->gpu, &after);
    assert_int_equal(before.used_bytes, after.used_bytes);
    const struct volume_inputs in = {0};
    for (uint64_t n = 1;; n++) {
        ok(f, hg_gpu_begin(f->gpu, &f->cmd, &f->err));
        hg_gpu_fail_at(n, VK_ERROR_OUT_OF_DEVICE_MEMORY);
        const enum hg_status status =
            hg_gpu_cmd_bind_io(f->cmd, &volume_io, &in, sizeof in, &f->err);
        const uint64_t calls = hg_gpu_call_count();
        hg_gpu_fail_at(0, VK_SUCCESS);
        hg_gpu_discard(f->gpu, f->cmd);
        assert_true(status == (calls < n ? HG_OK : HG_E_NOMEM));
        if (status == HG_OK)
            break;
        assert_true(n < 50);
    }
}

#define BOTH(test)                                                                                 \
    cmocka_unit_test_setup_teardown(test, setup_mapped, teardown),                                 \
        cmocka_unit_test_setup_teardown(test, setup_staging, teardown)

int main(void)
{
    const struct CMUnitTest tests[] = {
        BOTH(test_storage_mips),
        BOTH(test_volume),
        BOTH(test_mips_as_targets),
        BOTH(test_shared_memory),
        BOTH(test_in_flight),
        cmocka_unit_test_setup_teardown(test_limits, setup_mapped, teardown),
        cmocka_unit_test_setup_teardown(test_nothing_bound, setup_mapped, teardown),
        cmocka_unit_test_setup_teardown(test_failing_calls, setup_mapped, teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
