// render_frame.c - whole frames through the facade: conventions to the pixel, alpha, order of
// blended surfaces, the same bytes from every way to them, faults, validation.
#include <sys/wait.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/log.h"
#include "base/sha256.h"
#include "renderer/gpu/gpu.h"
#include "renderer/internal.h"
#include "renderer/renderer.h"
#include "tests/support/test_data.h"
#include "tests/unit/render_rig.h"

// --- scenes --------------------------------------------------------------------------------------

static struct hg_scene *new_scene(void)
{
    struct hg_scene *scene;
    assert_int_equal(hg_scene_create(&scene), HG_OK);
    return scene;
}

// A quad about the origin of the xy plane, looking along +z, unlit.
static struct hg_node *add_quad(
    struct hg_scene *scene, uint64_t id, float half, float z, const float color[4])
{
    static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    static const float normals[12] = {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1};
    const float positions[12] = {-half, -half, 0, half, -half, 0, half, half, 0, -half, half, 0};
    struct hg_material *material = rig_add(scene, HG_OBJECT_MATERIAL, id);
    memcpy(material->base_color, color, sizeof material->base_color);
    material->unlit = true;
    material->alpha_mode = color[3] < 1 ? HG_ALPHA_BLEND : HG_ALPHA_OPAQUE;
    struct hg_mesh *mesh = rig_add(scene, HG_OBJECT_MESH, id);
    rig_part(mesh, 4, positions, normals, 6, indices)->material = material;
    struct hg_node *node = rig_add(scene, HG_OBJECT_NODE, id);
    node->mesh = mesh;
    node->translation[2] = z;
    return node;
}

#define PANES TEST_MODELS "/panes.glb" // every alpha mode, lights, glass
#define KNOT  TEST_MODELS "/knot/knot.gltf"
#define WORM  TEST_MODELS "/worm.glb"
#define MORPH TEST_MODELS "/morph.glb"

static struct hg_scene *load(const char *path, struct hg_jobs *jobs)
{
    struct hg_error err = {0};
    struct hg_asset *asset;
    const struct hg_load_params params = {
        .path = path, .asset_number = 1, .scene_index = -1, .jobs = jobs};
    test_ok(hg_load_asset(&params, &asset, &err), &err);
    struct hg_scene *scene = new_scene();
    assert_int_equal(hg_scene_add_asset(scene, asset, NULL), HG_OK);
    rig_environment(scene, 0.7f, 0.7f, 0.7f);
    rig_sun(scene, 7, -0.5f, 0.8660254f);
    hg_scene_publish(scene);
    return scene;
}

// --- frames --------------------------------------------------------------------------------------

static void open_rig_with(struct rig *rig, const struct hg_renderer_params *params)
{
    *rig = (struct rig){0};
    test_ok(hg_renderer_create(params, &rig->renderer, &rig->err), &rig->err);
}

static void open_rig(struct rig *rig, bool validation)
{
    open_rig_with(rig, &(struct hg_renderer_params){.validation = validation, .threads = 2});
}

static void look_at_scene(struct rig *rig, float turn)
{
    float min[3], max[3], radius = 0;
    struct hg_view_camera camera = {0};
    hg_scene_update(rig->scene);
    assert_true(hg_scene_bounds(rig->scene, NULL, min, max));
    for (int i = 0; i < 3; i++) {
        camera.target[i] = 0.5f * (min[i] + max[i]);
        radius += (max[i] - min[i]) * (max[i] - min[i]);
    }
    radius = 0.9f * sqrtf(radius);
    camera.eye[0] = camera.target[0] + radius * sinf(turn);
    camera.eye[1] = camera.target[1] + 0.3f * radius;
    camera.eye[2] = camera.target[2] + radius * cosf(turn);
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
}

static void use_scene(struct rig *rig, struct hg_scene *scene, const struct hg_view_params *params)
{
    rig->scene = scene;
    rig_view(rig, params);
}

static void close_scene(struct rig *rig)
{
    hg_view_destroy(rig->view);
    hg_scene_destroy(rig->scene);
    rig->view = NULL;
    rig->scene = NULL;
}

static struct hg_frame_info settle(struct rig *rig, uint32_t samples_per_step)
{
    struct hg_frame_info info;
    for (int i = 0; i < 1000; i++) {
        test_ok(hg_view_step(rig->view, samples_per_step, &info, &rig->err), &rig->err);
        if (info.settled)
            return info;
    }
    fail_msg("the view did not settle");
    return info;
}

static void assert_same(const struct hg_refbuf *a, const struct hg_refbuf *b, int tolerance)
{
    assert_int_equal(a->size, b->size);
    int worst = 0;
    for (size_t i = 0; i < a->size; i++) {
        const int d = abs((int)a->data[i] - (int)b->data[i]);
        worst = d > worst ? d : worst;
    }
    if (worst > tolerance)
        fail_msg("bytes differ by up to %d", worst);
}

// RGBA8 of a settled test scene, in a renderer of its own.
static struct hg_refbuf *render_overridden(
    const char *path, uint32_t step, float turn, struct hg_debug_overrides overrides)
{
    struct rig rig;
    const struct hg_view_params params = {.width = 96, .height = 64, .samples = 5, .seed = 3};
    open_rig_with(&rig, &(struct hg_renderer_params){.threads = 2, .overrides = overrides});
    use_scene(&rig, load(path, hg_renderer_jobs(rig.renderer)), &params);
    look_at_scene(&rig, turn);
    settle(&rig, step);
    struct hg_refbuf *out = rig_pixels(&rig, HG_PIXEL_RGBA8);
    rig_close(&rig);
    return out;
}

static struct hg_refbuf *render(const char *name, uint32_t step, float turn)
{
    return render_overridden(name, step, turn, (struct hg_debug_overrides){0});
}

// --- conventions ---------------------------------------------------------------------------------

// Rays of pixel centres meet a plane where geometry says: perspective and orthographic.
static void test_projection_to_the_pixel(void **state)
{
    (void)state;
    struct rig rig;
    const float white[4] = {1, 1, 1, 1};
    const struct hg_view_params params = {.width = 64, .height = 48, .samples = 1};
    open_rig(&rig, false);
    struct hg_scene *scene = new_scene();
    add_quad(scene, 1, 100, 0, white);
    hg_scene_publish(scene);
    use_scene(&rig, scene, &params);
    for (int orthographic = 0; orthographic < 2; orthographic++) {
        const struct hg_view_camera camera = {.eye = {0.5f, -0.25f, 4},
            .target = {0.5f, -0.25f, 0},
            .orthographic = orthographic,
            .vfov_rad = 1.0f,
            .half_height = 1.5f};
        test_ok(hg_view_set_camera(rig.view, &camera, &rig.err), &rig.err);
        settle(&rig, 1);
        const double half = orthographic ? 1.5 : 4 * tan(0.5);
        for (uint32_t i = 0; i < 12; i++) {
            const uint32_t x = (i * 23) % 64, y = (i * 17) % 48;
            struct hg_pick pick;
            test_ok(hg_view_pick(rig.view, x, y, &pick, &rig.err), &rig.err);
            assert_true(pick.hit);
            assert_int_equal(pick.node, 1);
            const double want_x = 0.5 + half * (64.0 / 48.0) * (2 * (x + 0.5) / 64 - 1);
            const double want_y = -0.25 - half * (2 * (y + 0.5) / 48 - 1);
            assert_true(fabs(pick.position[0] - want_x) < 1e-4);
            assert_true(fabs(pick.position[1] - want_y) < 1e-4);
            assert_true(fabs(pick.position[2]) < 1e-4);
            assert_true(pick.normal[2] > 0.999f);
        }
    }
    rig_close(&rig);
}

// A quad that ends between pixels covers exactly those whose centres lie inside.
static void test_coverage_to_the_pixel(void **state)
{
    (void)state;
    struct rig rig;
    const float white[4] = {1, 1, 1, 1};
    const struct hg_view_params params = {.width = 40,
        .height = 40,
        .samples = 1,
        .tonemap = HG_TONEMAP_LINEAR,
        .background = HG_BACKGROUND_NONE};
    const struct hg_view_camera camera = {
        .eye = {0, 0, 5}, .orthographic = true, .half_height = 20};
    open_rig(&rig, false);
    struct hg_scene *scene = new_scene();
    struct hg_node *node = add_quad(scene, 1, 4.3f, 0, white); // 8.6 px wide
    node->translation[0] = 10;                                 // right
    node->translation[1] = 5;                                  // up
    hg_scene_publish(scene);
    use_scene(&rig, scene, &params);
    test_ok(hg_view_set_camera(rig.view, &camera, &rig.err), &rig.err);
    settle(&rig, 1);
    struct hg_refbuf *image = rig_pixels(&rig, HG_PIXEL_RGBA8);
    for (int y = 0; y < 40; y++) {
        for (int x = 0; x < 40; x++) {
            const double px = x + 0.5 - 20, py = 20 - (y + 0.5);
            const bool inside = fabs(px - 10) < 4.3 && fabs(py - 5) < 4.3;
            const uint8_t *p = image->data + 4 * (y * 40 + x);
            const uint8_t want[2][4] = {{0, 0, 0, 0}, {255, 255, 255, 255}};
            assert_memory_equal(p, want[inside], 4);
        }
    }
    hg_refbuf_unref(image);
    rig_close(&rig);
}

// --- colour and alpha ----------------------------------------------------------------------------

static void read_centre(struct rig *rig, float out[4])
{
    struct hg_refbuf *image = rig_pixels(rig, HG_PIXEL_RGBA32F);
    memcpy(out, image->data + 16 * (16 * 32 + 16), 16);
    hg_refbuf_unref(image);
}

static void test_colour_and_alpha(void **state)
{
    (void)state;
    struct rig rig;
    const float half[4] = {0.25f, 0.5f, 1, 0.5f};
    const struct hg_view_params params = {.width = 32,
        .height = 32,
        .samples = 2,
        .exposure_ev = 1,
        .tonemap = HG_TONEMAP_LINEAR,
        .background = HG_BACKGROUND_NONE};
    open_rig(&rig, true);
    struct hg_scene *scene = new_scene();
    add_quad(scene, 1, 10, 0, half);
    hg_scene_publish(scene);
    use_scene(&rig, scene, &params);
    settle(&rig, 2);
    float got[4];
    read_centre(&rig, got);
    const float want[4] = {0.5f, 1, 2, 0.5f}; // straight alpha, one stop brighter
    for (int i = 0; i < 4; i++)
        assert_true(fabsf(got[i] - want[i]) < 1e-5f);
    struct hg_refbuf *image = rig_pixels(&rig, HG_PIXEL_RGBA8);
    const uint8_t bytes[4] = {188, 255, 255, 128}; // 0.5 encoded is 187.5
    assert_memory_equal(image->data + 4 * (16 * 32 + 16), bytes, 4);
    hg_refbuf_unref(image);
    struct hg_refbuf *deep = rig_pixels(&rig, HG_PIXEL_RGBA16);
    uint16_t words[4];
    memcpy(words, deep->data + 8 * (16 * 32 + 16), 8);
    assert_in_range(words[0], 48190, 48200); // 0.735357 * 65535 = 48192
    hg_refbuf_unref(deep);
    assert_int_equal(hg_renderer_validation_messages(rig.renderer), 0);
    rig_close(&rig);
}

// Layers composite front to back whatever the order of their nodes.
static void test_blend_order(void **state)
{
    (void)state;
    const float colors[4][4] = {
        {1, 0, 0, 0.5f}, {0, 1, 0, 0.25f}, {0, 0, 1, 0.75f}, {0.5f, 0.5f, 0.5f, 1}};
    for (int order = 0; order < 4; order++) {
        struct rig rig;
        const struct hg_view_params params = {.width = 32,
            .height = 32,
            .samples = 1,
            .tonemap = HG_TONEMAP_LINEAR,
            .background = HG_BACKGROUND_NONE};
        open_rig(&rig, false);
        struct hg_scene *scene = new_scene();
        for (int k = 0; k < 4; k++) { // node ids in another order each time
            const int layer = (k * (order == 3 ? 3 : 1) + order) % 4;
            add_quad(scene, (uint64_t)k + 1, 10, -(float)layer, colors[layer]);
        }
        hg_scene_publish(scene);
        use_scene(&rig, scene, &params);
        settle(&rig, 1);
        float got[4], want[3] = {0, 0, 0}, through = 1;
        read_centre(&rig, got);
        for (int layer = 0; layer < 4; layer++) {
            for (int c = 0; c < 3; c++)
                want[c] += through * colors[layer][3] * colors[layer][c];
            through *= 1 - colors[layer][3];
        }
        for (int c = 0; c < 3; c++)
            assert_true(fabsf(got[c] - want[c]) < 1e-5f);
        assert_true(fabsf(got[3] - 1) < 1e-6f);
        rig_close(&rig);
    }
}

// Blends `count` sheets one behind the other and compares with the same in double precision, as far
// as `seen` layers.
static void check_layers(struct rig *rig, uint32_t count, uint32_t seen)
{
    const struct hg_view_params params = {.width = 32,
        .height = 32,
        .samples = 3,
        .tonemap = HG_TONEMAP_LINEAR,
        .background = HG_BACKGROUND_NONE};
    struct hg_scene *scene = new_scene();
    double want[3] = {0, 0, 0}, through = 1;
    for (uint32_t k = 0; k < count; k++) {
        const float color[4] = {
            (float)(k % 3) / 2, (float)(k % 5) / 4, (float)(k % 7) / 6, 0.0625f};
        add_quad(scene, (uint64_t)k + 1, 10 + (float)k, -0.01f * (float)k, color);
        for (int c = 0; c < 3 && k < seen; c++)
            want[c] += through * (double)color[3] * (double)color[c];
        through *= k < seen ? 1 - (double)color[3] : 1;
    }
    hg_scene_publish(scene);
    use_scene(rig, scene, &params);
    const struct hg_frame_info info = settle(rig, 1);
    assert_int_equal(info.samples, 3);
    float got[4];
    read_centre(rig, got);
    for (int c = 0; c < 3; c++) // of straight alpha
        assert_float_equal(got[c] * got[3], want[c], 2e-5f);
    assert_float_equal(got[3], 1 - through, 2e-5f);
}

// As many layers as there are, 64 at most.
static void test_many_layers(void **state)
{
    (void)state;
    static const uint32_t counts[] = {7, 40, 3};
    struct rig rig;
    open_rig(&rig, true);
    check_layers(&rig, 9, 9);
    assert_int_equal(hg_renderer_validation_messages(rig.renderer), 0);
    rig_close(&rig);
    open_rig(&rig, false);
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        check_layers(&rig, counts[i], counts[i]);
        close_scene(&rig);
    }
    check_layers(&rig, 80, 64);
    rig_close(&rig);
}

// --- the same bytes ------------------------------------------------------------------------------

static void test_same_bytes(void **state)
{
    (void)state;
    static const char *const paths[] = {PANES, WORM};
    for (int i = 0; i < 2; i++) {
        struct hg_refbuf *a = render(paths[i], 1, 0.4f);
        struct hg_refbuf *again = render(paths[i], 1, 0.4f);
        struct hg_refbuf *steps = render(paths[i], 16, 0.4f);
        assert_same(a, again, 0);
        assert_same(a, steps, 0);
        hg_refbuf_unref(a);
        hg_refbuf_unref(again);
        hg_refbuf_unref(steps);
    }
}

static void test_culling_changes_nothing(void **state)
{
    (void)state;
    for (int i = 0; i < 3; i++) {
        struct hg_refbuf *on = render(PANES, 4, (float)i * 2.0f);
        struct hg_refbuf *off = render_overridden(
            PANES, 4, (float)i * 2.0f, (struct hg_debug_overrides){.no_culling = true});
        assert_same(on, off, 0);
        hg_refbuf_unref(on);
        hg_refbuf_unref(off);
    }
}

// The paths of GPUs: no mapped memory, tables by address, one pipeline for all features. Other
// machine code may round differently in the last bit of a byte.
static void test_gpu_paths_agree(void **state)
{
    (void)state;
    struct hg_refbuf *plain = render(PANES, 4, 0.4f);
    setenv("HELIO_GPU_FORCE_STAGING", "1", 1);
    struct hg_refbuf *staged = render(PANES, 4, 0.4f);
    unsetenv("HELIO_GPU_FORCE_STAGING");
    struct hg_refbuf *by_address =
        render_overridden(PANES, 4, 0.4f, (struct hg_debug_overrides){.table_addresses = true});
    assert_same(plain, staged, 0);
    assert_same(plain, by_address, 1);
    hg_refbuf_unref(plain);
    hg_refbuf_unref(staged);
    hg_refbuf_unref(by_address);
}

static const char *self;

static void hash_in_child(const char *threads, char hex[65])
{
    char command[1200];
    snprintf(command, sizeof command, "LP_NUM_THREADS=%s '%s' --hash", threads, self);
    FILE *pipe = popen(command, "r");
    assert_non_null(pipe);
    assert_non_null(fgets(hex, 65, pipe));
    assert_int_equal(pclose(pipe), 0);
    assert_int_equal(strlen(hex), 64);
}

// A budget that holds the parts and not a byte more, with the facets of a CPU device.
static void test_budget_changes_nothing(void **state)
{
    (void)state;
    const struct hg_view_params params = {.width = 96, .height = 64, .samples = 5, .seed = 3};
    struct hg_refbuf *pictures[2];
    uint64_t budget = 0;
    for (int i = 0; i < 2; i++) {
        struct rig rig = {0};
        const struct hg_renderer_params limited = {.geometry_budget_bytes = budget, .threads = 2};
        test_ok(hg_renderer_create(&limited, &rig.renderer, &rig.err), &rig.err);
        use_scene(&rig, load(KNOT, hg_renderer_jobs(rig.renderer)), &params);
        look_at_scene(&rig, 0.4f);
        settle(&rig, 5);
        struct hg_view_report report;
        hg_view_get_report(rig.view, &report);
        const struct hg_geometry_stats stats = report.geometry;
        assert_true(stats.peak_bytes <= budget || i == 0);
        assert_true(stats.facet_bytes > 0 || !hg_gpu_get_caps(rig.renderer->context.gpu)->is_cpu);
        budget = stats.used_bytes;
        pictures[i] = rig_pixels(&rig, HG_PIXEL_RGBA32F);
        rig_close(&rig);
    }
    rig_assert_same(pictures[0], pictures[1]);
    hg_refbuf_unref(pictures[0]);
    hg_refbuf_unref(pictures[1]);
}

static void test_thread_count_changes_nothing(void **state)
{
    (void)state;
    char one[65], two[65];
    hash_in_child("1", one);
    hash_in_child("2", two);
    assert_string_equal(one, two);
}

static int print_hash(void)
{
    uint8_t hash[32];
    struct hg_refbuf *image = render(PANES, 2, 0.4f);
    if (hg_sha256(image->data, image->size, hash) != HG_OK)
        return 1;
    for (int i = 0; i < 32; i++)
        printf("%02x", hash[i]);
    hg_refbuf_unref(image);
    return 0;
}

// --- life ----------------------------------------------------------------------------------------

static void test_settles_and_restarts(void **state)
{
    (void)state;
    struct rig rig;
    const float white[4] = {1, 1, 1, 1};
    const struct hg_view_params params = {.width = 32, .height = 32, .samples = 3};
    open_rig(&rig, true);
    struct hg_scene *scene = new_scene();
    struct hg_node *node = add_quad(scene, 1, 1, 0, white);
    hg_scene_publish(scene);
    use_scene(&rig, scene, &params);
    struct hg_refbuf *none;
    assert_int_equal(hg_view_read_pixels(rig.view, HG_PIXEL_RGBA8, &none, &rig.err), HG_E_STATE);
    struct hg_frame_info info = settle(&rig, 1);
    assert_int_equal(info.samples, 3);
    assert_int_equal(info.triangles_drawn, 2);
    const uint64_t number = info.number;
    test_ok(hg_view_step(rig.view, 1, &info, &rig.err), &rig.err);
    assert_true(info.settled && info.number == number); // nothing left to do
    node->translation[0] = 0.5f;
    hg_scene_touch(scene, &node->head);
    hg_scene_publish(scene);
    test_ok(hg_view_step(rig.view, 1, &info, &rig.err), &rig.err);
    assert_true(!info.settled && info.samples == 1 && info.number == number + 1);
    assert_int_equal(info.scene_revision, scene->revision);
    settle(&rig, 8);
    assert_int_equal(hg_renderer_validation_messages(rig.renderer), 0);
    rig_close(&rig);
}

// A sample of a moving picture becomes 8-bit pixels at once; where others are read, too, it is
// accumulated. Both are the same picture, reading renders nothing, and what settles does not depend
// on what was read before.
static void test_pixels_in_motion(void **state)
{
    (void)state;
    struct rig rig;
    const float red[4] = {0.9f, 0.2f, 0.1f, 1}, blue[4] = {0.1f, 0.3f, 0.8f, 0.4f};
    const struct hg_view_params params = {.width = 61, .height = 47, .samples = 3};
    open_rig(&rig, true);
    struct hg_scene *scene = new_scene();
    add_quad(scene, 1, 1, 0, red);
    add_quad(scene, 2, 0.6f, 0.5f, blue);
    hg_scene_publish(scene);
    use_scene(&rig, scene, &params);
    struct hg_refbuf *moving[2], *settled[2], *linear;
    for (int i = 0; i < 2; i++) {
        struct hg_frame_info info;
        const bool all = i == 1;
        hg_view_set_formats(
            rig.view, all ? 1u << HG_PIXEL_RGBA8 | 1u << HG_PIXEL_RGBA32F : 1u << HG_PIXEL_RGBA8);
        look_at_scene(&rig, 0.4f);
        settle(&rig, 8); // layers are known
        look_at_scene(&rig, 0.3f);
        test_ok(hg_view_step(rig.view, 1, &info, &rig.err), &rig.err);
        assert_true(!info.settled && info.samples == 1);
        assert_int_equal(info.phase == HG_VIEW_DIRECT, !all);
        assert_int_equal(hg_view_has_pixels(rig.view, HG_PIXEL_RGBA32F), all);
        moving[i] = rig_pixels(&rig, HG_PIXEL_RGBA8);
        assert_int_equal(hg_view_read_pixels(rig.view, HG_PIXEL_RGBA32F, &linear, &rig.err),
            all ? HG_OK : HG_E_STATE);
        hg_refbuf_unref(linear);
        settle(&rig, 1);
        settled[i] = rig_pixels(&rig, HG_PIXEL_RGBA8);
    }
    assert_same(moving[0], moving[1], 0);
    assert_same(settled[0], settled[1], 0);
    for (int i = 0; i < 2; i++) {
        hg_refbuf_unref(moving[i]);
        hg_refbuf_unref(settled[i]);
    }
    assert_int_equal(hg_renderer_validation_messages(rig.renderer), 0);
    rig_close(&rig);
}

static void test_limits(void **state)
{
    (void)state;
    struct rig rig;
    const float white[4] = {1, 1, 1, 1};
    struct hg_view_params params = {.width = 32, .height = 32, .samples = 1};
    open_rig(&rig, true);
    struct hg_scene *scene = new_scene();
    add_quad(scene, 1, 1, 0, white);
    hg_scene_publish(scene);
    use_scene(&rig, scene, &params);
    params.width = 16385;
    assert_int_equal(hg_view_set_params(rig.view, &params, &rig.err), HG_E_INVAL);
    assert_string_equal(rig.err.where, "width");
    params.width = params.height = 16384; // 4 GiB of sums in one piece
    assert_int_equal(hg_view_set_params(rig.view, &params, &rig.err), HG_E_LIMIT);
    const struct hg_frame_info info = settle(&rig, 1); // the old size still works
    assert_int_equal(info.width, 32);
    const struct hg_view_camera bad = {.eye = {1, 2, 3}, .target = {1, 2, 3}};
    assert_int_equal(hg_view_set_camera(rig.view, &bad, &rig.err), HG_E_INVAL);
    assert_int_equal(hg_view_set_camera_node(rig.view, 99, &(struct hg_view_camera){0}, &rig.err),
        HG_E_NOTFOUND);
    assert_int_equal(hg_renderer_validation_messages(rig.renderer), 0);
    rig_close(&rig);
}

static void check_silent(const char *const *paths, size_t count)
{
    struct rig rig;
    open_rig(&rig, true);
    test_ok(hg_renderer_warm_up(rig.renderer, NULL, NULL, &rig.err), &rig.err);
    for (size_t i = 0; i < count; i++) {
        const struct hg_view_params params = {.width = 48, .height = 32, .samples = 2};
        use_scene(&rig, load(paths[i], hg_renderer_jobs(rig.renderer)), &params);
        look_at_scene(&rig, 0.3f);
        settle(&rig, 1);
        look_at_scene(&rig, 1.3f);
        settle(&rig, 2);
        for (int format = HG_PIXEL_RGBA8; format <= HG_PIXEL_RGBA32F; format++)
            hg_refbuf_unref(rig_pixels(&rig, (enum hg_pixel_format)format));
        struct hg_pick pick;
        test_ok(hg_view_pick(rig.view, 24, 16, &pick, &rig.err), &rig.err);
        close_scene(&rig);
        assert_int_equal(hg_renderer_validation_messages(rig.renderer), 0);
    }
    char *text;
    assert_int_equal(hg_renderer_stats_json(rig.renderer, NULL, &text), HG_OK);
    hg_free(text);
    rig_close(&rig);
}

static void test_validation_is_silent(void **state)
{
    static const char *const paths[] = {PANES, KNOT, WORM, MORPH, "demo:"};
    (void)state;
    check_silent(paths, sizeof paths / sizeof paths[0]);
}

static void test_validation_is_silent_with_samples(void **state)
{
    static const char *const names[] = {
        "khronos/AlphaBlendModeTest/glTF-Binary/AlphaBlendModeTest.glb",
        "khronos/CesiumMan/glTF-Binary/CesiumMan.glb",
        "khronos/LightsPunctualLamp/glTF/LightsPunctualLamp.gltf",
        "khronos/MeshPrimitiveModes/glTF/MeshPrimitiveModes.gltf",
        "khronos/TextureSettingsTest/glTF-Binary/TextureSettingsTest.glb",
        "khronos/MorphPrimitivesTest/glTF-Binary/MorphPrimitivesTest.glb",
        "khronos/SimpleInstancing/glTF-Binary/SimpleInstancing.glb"};
    (void)state;
    for (size_t i = 0; i < sizeof names / sizeof names[0]; i++) {
        const char *path = test_data(names[i]);
        check_silent(&path, 1);
    }
}

static enum hg_status try_view(struct rig *rig, struct hg_scene *scene)
{
    const struct hg_view_params params = {.width = 16, .height = 16, .samples = 1};
    struct hg_frame_info info;
    struct hg_refbuf *image = NULL;
    enum hg_status status = hg_view_create(rig->renderer, scene, &rig->view, &rig->err);
    if (status == HG_OK)
        status = hg_view_set_params(rig->view, &params, &rig->err);
    for (int i = 0; i < 3 && status == HG_OK; i++)
        status = hg_view_step(rig->view, 1, &info, &rig->err);
    if (status == HG_OK)
        status = hg_view_read_pixels(rig->view, HG_PIXEL_RGBA8, &image, &rig->err);
    hg_refbuf_unref(image);
    return status;
}

// Every Vulkan call of a view's life fails once: a status, no leak, and the next view works.
static void test_failing_calls(void **state)
{
    (void)state;
    struct rig rig;
    const float glass[4] = {1, 1, 1, 0.5f};
    open_rig(&rig, true);
    struct hg_scene *scene = new_scene();
    add_quad(scene, 1, 1, 0, glass);
    hg_scene_publish(scene);
    for (uint64_t n = 1; n < 2000; n += n < 60 ? 1 : 7) {
        hg_gpu_fail_at(n, VK_ERROR_OUT_OF_DEVICE_MEMORY);
        const enum hg_status status = try_view(&rig, scene);
        const bool failed = hg_gpu_call_count() >= n;
        hg_gpu_fail_at(0, VK_SUCCESS);
        hg_view_destroy(rig.view);
        rig.view = NULL;
        assert_true(status == HG_OK || status == HG_E_NOMEM || status == HG_E_LIMIT);
        if (!failed)
            break;
        assert_int_not_equal(status, HG_OK);
    }
    assert_int_equal(try_view(&rig, scene), HG_OK);
    assert_int_equal(hg_renderer_validation_messages(rig.renderer), 0);
    rig.scene = scene;
    rig_close(&rig);
}

// --- faults while rays are followed --------------------------------------------------------------

// A lit quad before much background.
static struct hg_scene *lit_scene(void)
{
    const float grey[4] = {0.5f, 0.5f, 0.5f, 1};
    struct hg_scene *scene = new_scene();
    struct hg_node *node = add_quad(scene, 1, 0.5f, 0, grey);
    ((struct hg_material *)(void *)scene->objects[HG_OBJECT_MATERIAL].items[0])->unlit = false;
    (void)node;
    rig_environment(scene, 0.5f, 0.6f, 0.7f);
    rig_sun(scene, 7, -0.5f, 0.8660254f);
    hg_scene_publish(scene);
    return scene;
}

// Steps with the n-th call failing, if there are so many, and then without. *failed: it did.
static void follow(struct rig *rig, const struct hg_view_params *params, uint64_t n, bool *failed,
    struct hg_refbuf *out[2])
{
    const struct hg_view_camera camera = {.eye = {0, 0.5f, 4},
        .moves = true,
        .next_eye = {0.1f, 0.5f, 4},
        .next_target = {0.1f, 0, 0}};
    struct hg_frame_info info = {0};
    enum hg_status status = HG_OK;
    rig_view(rig, params);
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
    hg_gpu_fail_at(n, VK_ERROR_OUT_OF_DEVICE_MEMORY);
    while (status == HG_OK && !info.settled)
        status = hg_view_step(rig->view, 2, &info, &rig->err);
    *failed = n > 0 && hg_gpu_call_count() >= n;
    hg_gpu_fail_at(0, VK_SUCCESS);
    assert_true(status == HG_OK || status == HG_E_NOMEM || status == HG_E_LIMIT);
    settle(rig, 2);
    out[0] = rig_pixels(rig, HG_PIXEL_RGBA32F);
    test_ok(hg_view_read_plane(rig->view, HG_PLANE_MOTION, &out[1], &rig->err), &rig->err);
    hg_view_destroy(rig->view);
    rig->view = NULL;
}

// Every Vulkan call of a view whose rays are followed fails once: then the same view goes on, to
// the picture and the plane that there would have been.
static void test_failing_rays(void **state)
{
    (void)state;
    struct hg_view_params params[] = {{.mode = HG_MODE_PATH, .shutter_close = 0.5f},
        {.mode = HG_MODE_PATH}, {.mode = HG_MODE_REALTIME}};
    struct rig rig;
    open_rig(&rig, true);
    rig.scene = lit_scene();
    for (int i = 0; i < 3; i++) {
        params[i].width = params[i].height = 20;
        params[i].samples = 2;
        params[i].planes = 1u << HG_PLANE_MOTION;
        struct hg_refbuf *whole[2], *got[2];
        bool failed;
        uint64_t n = 1;
        follow(&rig, &params[i], 0, &failed, whole);
        for (failed = true; failed; n += n < 40 ? 1 : 29) {
            follow(&rig, &params[i], n, &failed, got);
            for (int k = 0; k < 2; k++) {
                assert_same(whole[k], got[k], 0);
                hg_refbuf_unref(got[k]);
            }
        }
        print_message("%d: %u calls\n", i, (unsigned)n);
        hg_refbuf_unref(whole[0]);
        hg_refbuf_unref(whole[1]);
    }
    assert_int_equal(hg_renderer_validation_messages(rig.renderer), 0);
    rig_close(&rig);
}

static void test_device_lost(void **state)
{
    (void)state;
    struct rig rig;
    const float white[4] = {1, 1, 1, 1};
    struct hg_frame_info info;
    struct hg_scene *scene = new_scene();
    add_quad(scene, 1, 1, 0, white);
    hg_scene_publish(scene);
    open_rig(&rig, false);
    assert_int_equal(try_view(&rig, scene), HG_OK);
    struct hg_view_camera camera = {.eye = {0, 1, 3}};
    test_ok(hg_view_set_camera(rig.view, &camera, &rig.err), &rig.err);
    hg_gpu_fail_at(1, VK_ERROR_DEVICE_LOST);
    assert_int_equal(hg_view_step(rig.view, 1, &info, &rig.err), HG_E_DEVICE_LOST);
    hg_gpu_fail_at(0, VK_SUCCESS);
    assert_int_equal(hg_view_step(rig.view, 1, &info, &rig.err), HG_E_DEVICE_LOST);
    hg_view_destroy(rig.view);
    hg_renderer_destroy(rig.renderer);
    open_rig(&rig, false); // the scene outlives the renderer
    assert_int_equal(try_view(&rig, scene), HG_OK);
    rig.scene = scene;
    rig_close(&rig);
}

int main(int argc, char **argv)
{
    self = argv[0];
    if (argc > 1 && strcmp(argv[1], "--hash") == 0)
        return print_hash();
    hg_log_set_sink(hg_log_sink_logfmt, (void *)(intptr_t)STDERR_FILENO);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_projection_to_the_pixel),
        cmocka_unit_test(test_coverage_to_the_pixel),
        cmocka_unit_test(test_colour_and_alpha),
        cmocka_unit_test(test_blend_order),
        cmocka_unit_test(test_many_layers),
        cmocka_unit_test(test_same_bytes),
        cmocka_unit_test(test_culling_changes_nothing),
        cmocka_unit_test(test_gpu_paths_agree),
        cmocka_unit_test(test_budget_changes_nothing),
        cmocka_unit_test(test_thread_count_changes_nothing),
        cmocka_unit_test(test_settles_and_restarts),
        cmocka_unit_test(test_pixels_in_motion),
        cmocka_unit_test(test_limits),
        cmocka_unit_test(test_validation_is_silent),
        cmocka_unit_test(test_validation_is_silent_with_samples),
        cmocka_unit_test(test_failing_calls),
        cmocka_unit_test(test_failing_rays),
        cmocka_unit_test(test_device_lost),
    };
    return test_run_group(tests, NULL, NULL);
}
