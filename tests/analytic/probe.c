#include "tests/analytic/probe.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "tests/support/check.h"

#define GROUP   32
#define SIDE_PX 512 // of the picture

// A 90 degree camera at the origin that looks along -z, reversed infinite depth, y down in clip.
static void set_camera(struct hg_gpu_camera *c)
{
    static const float identity[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    static const float proj[16] = {1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 0, -1, 0, 0, 0.1f, 0};
    memset(c, 0, sizeof *c);
    memcpy(c->view.m, identity, sizeof identity);
    memcpy(c->inv_view.m, identity, sizeof identity);
    memcpy(c->proj.m, proj, sizeof proj);
    memcpy(c->view_proj.m, proj, sizeof proj);
    c->forward_ws.z = -1;
    c->near = 0.1f;
    c->ray_origin_ws = (struct hg_vec3){-1, 1, -1};
    c->ray_x_ws.x = 2.0f / SIDE_PX;
    c->ray_y_ws.y = -2.0f / SIDE_PX;
    c->pixel_angle = 2.0f / SIDE_PX;
}

void probe_init(struct probe *probe, struct hg_store *store)
{
    struct hg_error err = {0};
    memset(probe, 0, sizeof *probe);
    struct hg_gpu_params params = {.shader_dir = HELIO_ANALYTIC_SHADERS, .validation_try = true};
    test_ok(hg_gpu_create(&params, &probe->gpu, &err), &err);
    probe->jobs = hg_jobs_create(0);
    assert_non_null(probe->jobs);
    test_ok(hg_scene_create(&probe->scene), &err);
    struct hg_lighting_params lighting = {.store = store};
    test_ok(hg_lighting_create(probe->gpu, probe->jobs, &lighting, &probe->lighting, &err), &err);
    set_camera(&probe->camera);
    probe->view = (struct hg_lighting_view){.scene = probe->scene,
        .camera = &probe->camera,
        .width = 512,
        .height = 512,
        .has_bounds = true,
        .bounds_min = {-1, -1, -1},
        .bounds_max = {1, 1, 1}};
    probe->scene->environment.intensity = 1;
    probe_sync(probe);
}

void probe_finish(struct probe *probe)
{
    uint32_t messages = hg_gpu_validation_messages(probe->gpu);
    hg_lighting_destroy(probe->lighting);
    hg_scene_destroy(probe->scene);
    hg_gpu_destroy(probe->gpu);
    hg_jobs_destroy(probe->jobs);
    assert_int_equal(messages, 0);
}

void probe_sync(struct probe *probe)
{
    struct hg_error err = {0};
    hg_scene_update(probe->scene);
    test_ok(hg_lighting_sync(probe->lighting, &probe->view, &err), &err);
    hg_lighting_fill(probe->lighting, 0, &probe->block);
}

struct push {
    uint64_t in, out;
    uint32_t count;
};

static void record(struct probe *probe, const struct probe_dispatch *dispatch,
    struct hg_gpu_cmd *cmd, const struct hg_gpu_buffer *frame, const struct push *push)
{
    struct hg_error err = {0};
    struct hg_gpu_bindings bindings = {.uniforms = {{frame->address, sizeof(struct hg_gpu_frame)}}};
    bindings.images[HG_BIND_ENV_SPECULAR] = hg_lighting_image_specular(probe->lighting);
    bindings.images[HG_BIND_ENV_RADIANCE] = hg_lighting_image_radiance(probe->lighting);
    bindings.images[HG_BIND_SHADOW] = hg_lighting_image_shadow(probe->lighting);
    test_ok(hg_gpu_cmd_bind(cmd, &bindings, &err), &err);
    struct hg_gpu_pipeline_params pipeline = {
        .compute = dispatch->shader, .spec = {dispatch->op}, .spec_count = 1};
    test_ok(hg_gpu_cmd_pipeline(cmd, &pipeline, &err), &err);
    hg_gpu_cmd_push(cmd, push, sizeof *push);
    vkCmdDispatch(hg_gpu_cmd_handle(cmd), (push->count + GROUP - 1) / GROUP, 1, 1);
    hg_gpu_memory_barrier(cmd);
}

void probe_run_shader(struct probe *probe, const struct probe_dispatch *dispatch,
    const struct hg_vec4 *in, uint32_t in_size, struct hg_vec4 *out, uint32_t out_size)
{
    struct hg_error err = {0};
    struct hg_gpu_buffer frame = {0}, input = {0}, output = {0};
    struct hg_gpu_frame *block = hg_calloc(1, sizeof *block);
    assert_non_null(block);
    block->camera = probe->camera;
    block->width = block->height = SIDE_PX;
    block->lighting = probe->block;
    test_ok(hg_gpu_buffer_create(
                probe->gpu, HG_GPU_BUFFER_UPLOAD, sizeof *block, "frame", &frame, &err),
        &err);
    test_ok(hg_gpu_buffer_create(
                probe->gpu, HG_GPU_BUFFER_UPLOAD, in_size * sizeof *in, "in", &input, &err),
        &err);
    test_ok(hg_gpu_buffer_create(
                probe->gpu, HG_GPU_BUFFER_READBACK, out_size * sizeof *out, "out", &output, &err),
        &err);
    memcpy(frame.mapped, block, sizeof *block);
    memcpy(input.mapped, in, in_size * sizeof *in);
    struct push push = {input.address, output.address, dispatch->count};
    struct hg_gpu_cmd *cmd;
    test_ok(hg_gpu_begin(probe->gpu, &cmd, &err), &err);
    record(probe, dispatch, cmd, &frame, &push);
    test_ok(hg_gpu_submit_and_wait(probe->gpu, cmd, &err), &err);
    memcpy(out, output.mapped, out_size * sizeof *out);
    hg_gpu_buffer_destroy(probe->gpu, &frame);
    hg_gpu_buffer_destroy(probe->gpu, &input);
    hg_gpu_buffer_destroy(probe->gpu, &output);
    hg_free(block);
}

void probe_run(struct probe *probe, enum probe_op op, uint32_t count, const struct hg_vec4 *in,
    struct hg_vec4 *out)
{
    const struct probe_dispatch dispatch = {"probe.comp", (uint32_t)op, count};
    probe_run_shader(probe, &dispatch, in, 2 * count, out, count);
}

// SplitMix64, Steele et al. 2014.
static uint64_t random_bits(void)
{
    static uint64_t state;
    uint64_t z = (state += 0x9e3779b97f4a7c15);
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9;
    z = (z ^ z >> 27) * 0x94d049bb133111eb;
    return z ^ z >> 31;
}

double probe_random(void)
{
    return (double)(random_bits() >> 11) * 0x1p-53;
}

float probe_random_float(void)
{
    return (float)(random_bits() >> 40) * 0x1p-24f;
}

void probe_assert_near(
    double value, double expected, double tolerance, const char *text, const char *file, int line)
{
    if (fabs(value - expected) <= tolerance)
        return;
    print_error("%s = %.9g, expected %.9g +- %.3g\n", text, value, expected, tolerance);
    _fail(file, line);
}

int probe_setup(void **state)
{
    static struct probe probe;
    probe_init(&probe, NULL);
    *state = &probe;
    return 0;
}

int probe_teardown(void **state)
{
    probe_finish(*state);
    return 0;
}
