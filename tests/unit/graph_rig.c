// graph_rig.c - see graph_rig.h.
#include "tests/unit/graph_rig.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "shaders/shared/pass_io.h"
#include "tests/support/check.h"

int graph_rig_setup(void **state)
{
    struct graph_rig *r = calloc(1, sizeof *r);
    const struct hg_gpu_params params = {.validation = true};
    assert_non_null(r);
    graph_rig_ok(r, hg_gpu_create(&params, &r->gpu, &r->err));
    graph_rig_ok(r, hg_graph_create(r->gpu, &r->graph, &r->err));
    graph_rig_ok(
        r, hg_gpu_buffer_create(r->gpu, HG_GPU_BUFFER_READBACK, 64, "back", &r->back, &r->err));
    *state = r;
    return 0;
}

int graph_rig_teardown(void **state)
{
    struct graph_rig *r = *state;
    hg_graph_destroy(r->graph);
    hg_gpu_buffer_destroy(r->gpu, &r->back);
    const uint32_t messages = hg_gpu_validation_messages(r->gpu);
    hg_gpu_destroy(r->gpu);
    free(r);
    return messages == 0 ? 0 : -1;
}

void graph_rig_ok(struct graph_rig *r, enum hg_status status)
{
    test_ok(status, &r->err);
}

enum hg_status graph_rig_try(struct graph_rig *r)
{
    struct hg_gpu_cmd *cmd;
    enum hg_status status = hg_graph_compile(r->graph, &r->err);
    if (status == HG_OK)
        status = hg_gpu_begin(r->gpu, &cmd, &r->err);
    if (status != HG_OK)
        return status;
    status = hg_graph_execute(r->graph, cmd, r, 0, &r->err);
    if (status == HG_OK)
        return hg_gpu_submit_and_wait(r->gpu, cmd, &r->err);
    hg_gpu_discard(r->gpu, cmd);
    return status;
}

void graph_rig_run(struct graph_rig *r)
{
    graph_rig_ok(r, graph_rig_try(r));
}

float graph_rig_texel(struct graph_rig *r, struct hg_gpu_image *image)
{
    struct hg_gpu_cmd *cmd;
    const struct hg_gpu_region texel = {.width = 1, .height = 1};
    graph_rig_ok(r, hg_gpu_begin(r->gpu, &cmd, &r->err));
    hg_gpu_image_read(cmd, image, &texel, &r->back, 0);
    graph_rig_ok(r, hg_gpu_submit_and_wait(r->gpu, cmd, &r->err));
    return *(const float *)r->back.mapped;
}

static enum hg_status record_clear(const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    const struct graph_clear *clear = user;
    (void)err;
    const struct hg_gpu_rendering rendering = {
        .colors = {{.image = hg_graph_run_image(run, clear->target),
            .clear = true,
            .value.color.float32 = {clear->value}}},
        .color_count = 1};
    hg_gpu_cmd_begin_rendering(run->cmd, &rendering);
    hg_gpu_cmd_end_rendering(run->cmd);
    return HG_OK;
}

void graph_rig_clear(struct graph_rig *r, const char *name, const struct graph_clear *clear)
{
    hg_graph_pass(r->graph, &(struct hg_graph_pass){.name = name,
                                .record = record_clear,
                                .user = (void *)(uintptr_t)clear,
                                .accesses = {{clear->target, HG_GRAPH_COLOR, 0}}});
}

static const struct hg_gpu_io blend_io = HG_GPU_IO(HG_TEST_BLEND_IO);
struct blend_inputs {
    HG_TEST_BLEND_IO(HG_GPU_IO_MEMBER)
};

static enum hg_status record_blend(const struct hg_graph_run *run, void *user, struct hg_error *err)
{
    const struct graph_blend *blend = user;
    const struct hg_gpu_pipeline_params pipeline = {.vertex = "fullscreen.vert",
        .fragment = "test_blend.frag",
        .colors = {VK_FORMAT_R32_SFLOAT},
        .color_count = 1,
        .topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST,
        .io = &blend_io};
    const struct blend_inputs in = {.first = {hg_graph_run_image(run, blend->first), 0},
        .second = {hg_graph_run_image(run, blend->second), 0}};
    const struct hg_gpu_rendering rendering = {
        .colors = {{.image = hg_graph_run_image(run, blend->target), .discard = true}},
        .color_count = 1};
    enum hg_status status = hg_gpu_cmd_bind_io(run->cmd, &blend_io, &in, sizeof in, err);
    if (status != HG_OK)
        return status;
    hg_gpu_cmd_begin_rendering(run->cmd, &rendering);
    status = hg_gpu_cmd_pipeline(run->cmd, &pipeline, err);
    if (status == HG_OK)
        vkCmdDraw(hg_gpu_cmd_handle(run->cmd), 3, 1, 0, 0);
    hg_gpu_cmd_end_rendering(run->cmd);
    return status;
}

void graph_rig_blend(struct graph_rig *r, const char *name, const struct graph_blend *blend)
{
    hg_graph_pass(r->graph,
        &(struct hg_graph_pass){.name = name,
            .record = record_blend,
            .user = (void *)(uintptr_t)blend,
            .accesses = {{blend->first, HG_GRAPH_SAMPLE, 0}, {blend->second, HG_GRAPH_SAMPLE, 0},
                {blend->target, HG_GRAPH_COLOR, 0}}});
}

uint32_t graph_rig_image(struct graph_rig *r, const char *name, enum hg_graph_life life)
{
    return hg_graph_image(
        r->graph, &(struct hg_graph_image_params){
                      .name = name, .format = VK_FORMAT_R32_SFLOAT, .life = life});
}

struct hg_gpu_image graph_rig_outside(struct graph_rig *r, const char *name, uint32_t side)
{
    struct hg_gpu_image image;
    const struct hg_gpu_image_params params = {.format = VK_FORMAT_R32_SFLOAT,
        .width = side,
        .height = side,
        .attachment = true,
        .name = name};
    graph_rig_ok(r, hg_gpu_image_create(r->gpu, &params, &image, &r->err));
    return image;
}
