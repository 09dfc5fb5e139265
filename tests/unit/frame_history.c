// frame_history.c - what a pass knows of the frame before: camera, jitter, places of nodes; read by
// a shader in the frame after.

#include "renderer/frame/batch/batch.h"
#include "renderer/internal.h"
#include "tests/unit/render_rig.h"

#define SIDE_PX 32

struct result { // as test_history.comp writes it
    float clip[4], place[3];
    uint32_t flags;
};

static struct hg_node *open_rig(struct rig *rig, bool keeps_history)
{
    static const float positions[] = {-1, -1, 0, 1, -1, 0, 1, 1, 0};
    static const float normals[] = {0, 0, 1, 0, 0, 1, 0, 0, 1};
    static const uint32_t indices[] = {0, 1, 2};
    const struct hg_renderer_params params = {.threads = 2};
    const struct hg_view_params view = {.width = SIDE_PX, .height = SIDE_PX, .samples = 1};
    *rig = (struct rig){0};
    test_ok(hg_renderer_create(&params, &rig->renderer, &rig->err), &rig->err);
    rig->renderer->context.overrides.keeps_history = keeps_history;
    assert_int_equal(hg_scene_create(&rig->scene), HG_OK);
    struct hg_mesh *mesh = rig_add(rig->scene, HG_OBJECT_MESH, 1);
    rig_part(mesh, 3, positions, normals, 3, indices);
    struct hg_node *node = rig_add(rig->scene, HG_OBJECT_NODE, 2);
    node->mesh = mesh;
    hg_scene_publish(rig->scene);
    rig_view(rig, &view);
    return node;
}

static void look(struct rig *rig, float x)
{
    const struct hg_view_camera camera = {.eye = {x, 0, 3}, .target = {x, 0, 0}};
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
}

// What a pass of the next frame would see.
static struct result ask(struct rig *rig, const float point[3])
{
    struct hg_view_state *state = &rig->view->state;
    struct hg_gpu *gpu = state->context->gpu;
    struct hg_gpu_buffer back;
    struct hg_gpu_cmd *cmd;
    const struct hg_gpu_pipeline_params pipeline = {.compute = "test_history.comp"};
    test_ok(hg_gpu_buffer_create(
                gpu, HG_GPU_BUFFER_READBACK, sizeof(struct result), "back", &back, &rig->err),
        &rig->err);
    const struct {
        uint64_t target;
        uint32_t instance, reserved;
        float point[3];
    } push = {back.address, 0, 0, {point[0], point[1], point[2]}};
    const struct hg_draw_request request = {
        .settings = &state->settings, .camera = &state->camera, .samples = 1, .max_samples = 1};
    struct hg_draw draw = hg_view_draw(state, &request);
    test_ok(hg_frame_sync(&draw, &rig->err), &rig->err);
    hg_frame_fill(&draw, 0, false, 0);
    test_ok(hg_gpu_begin(gpu, &cmd, &rig->err), &rig->err);
    struct hg_pass pass = hg_frame_pass(&draw, cmd, 0);
    test_ok(hg_gpu_cmd_bind(cmd, &pass.bindings, &rig->err), &rig->err);
    test_ok(hg_gpu_cmd_pipeline(cmd, &pipeline, &rig->err), &rig->err);
    hg_gpu_cmd_push(cmd, &push, sizeof push);
    vkCmdDispatch(hg_gpu_cmd_handle(cmd), 1, 1, 1);
    test_ok(hg_gpu_submit_and_wait(gpu, cmd, &rig->err), &rig->err);
    const struct result result = *(const struct result *)back.mapped;
    hg_gpu_buffer_destroy(gpu, &back);
    return result;
}

static void test_camera_and_pose(void **state)
{
    (void)state;
    struct rig rig;
    const float point[3] = {0, 0, 0};
    struct hg_node *node = open_rig(&rig, true);
    look(&rig, 0.0f);
    assert_int_equal(ask(&rig, point).flags, 0); // nothing was drawn
    rig_settle(&rig, 1);
    look(&rig, 1.0f);
    node->translation[1] = 0.25f;
    hg_scene_touch(rig.scene, &node->head);
    hg_scene_publish(rig.scene);
    const struct result then = ask(&rig, point);
    assert_int_equal(then.flags, HG_HISTORY_CAMERA | HG_HISTORY_POSE);
    // The camera of then looked straight at the point, and the node stood there.
    assert_float_equal(then.clip[0] / then.clip[3], 0.0f, 1e-5f);
    assert_float_equal(then.clip[1] / then.clip[3], 0.0f, 1e-5f);
    assert_float_equal(then.place[1], 0.0f, 1e-6f);
    rig_settle(&rig, 1);
    const struct result now = ask(&rig, point);
    assert_true(now.clip[0] / now.clip[3] < -0.3f); // left of a camera at x = 1
    assert_float_equal(now.place[1], 0.25f, 1e-6f);
    hg_view_forget_history(rig.view);
    assert_int_equal(ask(&rig, point).flags, 0);
    rig_close(&rig);
}

// Not asked for: nothing is kept.
static void test_not_wanted(void **state)
{
    (void)state;
    struct rig rig;
    open_rig(&rig, false);
    look(&rig, 0.0f);
    rig_settle(&rig, 1);
    assert_false(hg_view_has_history(rig.view));
    rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_camera_and_pose), cmocka_unit_test(test_not_wanted)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
