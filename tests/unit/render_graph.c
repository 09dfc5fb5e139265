// render_graph.c - the frame graph of a view: docs/internals/frame.md shows the picture that its
// declarations make, and a picture is the same whatever was drawn before it with other passes.

#include "base/alloc.h"
#include "base/file.h"
#include "renderer/internal.h"
#include "tests/unit/render_rig.h"

#define SIDE_PX 96

static void add_quad(struct hg_scene *scene, uint64_t id, float z, float transmission)
{
    static const float positions[] = {-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0};
    static const float normals[] = {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1};
    static const uint32_t indices[] = {0, 1, 2, 0, 2, 3};
    struct hg_material *material = rig_add(scene, HG_OBJECT_MATERIAL, id);
    material->transmission = transmission;
    struct hg_mesh *mesh = rig_add(scene, HG_OBJECT_MESH, id);
    rig_part(mesh, 4, positions, normals, 6, indices)->material = material;
    struct hg_node *node = rig_add(scene, HG_OBJECT_NODE, 100 + id);
    node->mesh = mesh;
    node->translation[2] = z;
}

// A pane of glass before a wall, and a sun: one of each pass that most scenes have.
static void open_rig(struct rig *rig)
{
    const struct hg_renderer_params params = {.threads = 2};
    const struct hg_view_params view = {.width = SIDE_PX, .height = SIDE_PX, .samples = 2};
    const struct hg_view_camera camera = {.eye = {0, 0, 3}, .target = {0, 0, 0}};
    *rig = (struct rig){0};
    test_ok(hg_renderer_create(&params, &rig->renderer, &rig->err), &rig->err);
    assert_int_equal(hg_scene_create(&rig->scene), HG_OK);
    add_quad(rig->scene, 1, 0.0f, 0.0f);
    add_quad(rig->scene, 2, 0.5f, 0.8f);
    rig_sun(rig->scene, 9, -0.3f, 0.95f);
    rig_environment(rig->scene, 0.5f, 0.4f, 0.3f);
    hg_scene_publish(rig->scene);
    rig_view(rig, &view);
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
}

static char *read_document(void)
{
    char path[4096];
    uint8_t *data;
    size_t size;
    struct hg_error err;
    snprintf(path, sizeof path, "%s/docs/internals/frame.md", getenv("HELIO_SOURCE_DIR"));
    test_ok(hg_file_read(path, 1 << 20, &data, &size, &err), &err);
    char *text = calloc(1, size + 1);
    assert_non_null(text);
    memcpy(text, data, size);
    hg_free(data);
    return text;
}

static void test_document(void **state)
{
    (void)state;
    struct rig rig;
    struct hg_writer out = {0};
    open_rig(&rig);
    if (!hg_gpu_get_caps(rig.renderer->gpu)->is_cpu) {
        rig_close(&rig);
        skip(); // the document shows the passes of CPU devices
    }
    rig_step(&rig, 2);
    hg_view_print_graph(rig.view, HG_GRAPH_MERMAID, &out);
    hg_write_u8(&out, 0);
    assert_false(out.failed);
    char *text = read_document();
    if (strstr(text, (const char *)out.data) == NULL) {
        char path[4096];
        snprintf(path, sizeof path, "%s/frame_graph.mmd", getenv("HELIO_BUILD_DIR"));
        test_ok(hg_file_write_atomic(path, out.data, out.size - 1, &rig.err), &rig.err);
        fail_msg("docs/internals/frame.md shows another graph; put %s in place of it", path);
    }
    free(text);
    hg_writer_finish(&out);
    rig_close(&rig);
}

// Passes of other frames (picks, reads, debug views) leave nothing behind in shared memory.
static void test_other_passes(void **state)
{
    (void)state;
    struct rig rig;
    struct hg_pick pick;
    open_rig(&rig);
    rig_settle(&rig, 2);
    struct hg_refbuf *first = rig_pixels(&rig, HG_PIXEL_RGBA32F);
    struct hg_view_params view = {
        .width = SIDE_PX, .height = SIDE_PX, .samples = 2, .debug_view = HG_DEBUG_OVERDRAW};
    test_ok(hg_view_pick(rig.view, 5, 5, &pick, &rig.err), &rig.err);
    test_ok(hg_view_set_params(rig.view, &view, &rig.err), &rig.err);
    rig_settle(&rig, 1);
    hg_refbuf_unref(rig_pixels(&rig, HG_PIXEL_RGBA8));
    view.debug_view = HG_DEBUG_OFF;
    test_ok(hg_view_set_params(rig.view, &view, &rig.err), &rig.err);
    rig_settle(&rig, 1);
    struct hg_refbuf *second = rig_pixels(&rig, HG_PIXEL_RGBA32F);
    rig_assert_same(first, second);
    hg_refbuf_unref(first);
    hg_refbuf_unref(second);
    rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_document), cmocka_unit_test(test_other_passes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
