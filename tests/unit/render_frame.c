// render_frame.c - whole frames through the facade: conventions to the pixel, alpha, order of
// blended surfaces, the same bytes from every way to them.
#include <sys/wait.h>
#include <unistd.h>

#include "base/alloc.h"
#include "base/log.h"
#include "base/sha256.h"
#include "renderer/gpu/gpu.h"
#include "renderer/internal.h"
#include "renderer/renderer.h"
#include "tests/support/test_data.h"
#include "shaders/shared/blend.h"
#include "tests/unit/render_rig.h"

// --- frames --------------------------------------------------------------------------------------

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

// RGBA8 of a settled test scene.
static struct hg_refbuf *render_in(struct rig *rig, const char *path, uint32_t step, float turn)
{
    const struct hg_view_params params = {.width = 96, .height = 64, .samples = 5, .seed = 3};
    rig_use_scene(rig, rig_load(path, hg_renderer_jobs(rig->renderer)), &params);
    rig_look_at_scene(rig, turn);
    rig_settle(rig, step);
    struct hg_refbuf *out = rig_pixels(rig, HG_PIXEL_RGBA8);
    rig_close_scene(rig);
    return out;
}

static void open_overridden(struct rig *rig, struct hg_debug_overrides overrides)
{
    rig_open_with(rig, &(struct hg_renderer_params){.threads = 2, .overrides = overrides});
}

// In a renderer of its own.
static struct hg_refbuf *render_overridden(
    const char *path, uint32_t step, float turn, struct hg_debug_overrides overrides)
{
    struct rig rig;
    open_overridden(&rig, overrides);
    struct hg_refbuf *out = render_in(&rig, path, step, turn);
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
    rig_open(&rig, false);
    struct hg_scene *scene = rig_new_scene();
    rig_quad(scene, 1, 100, 0, white);
    hg_scene_publish(scene);
    rig_use_scene(&rig, scene, &params);
    for (int orthographic = 0; orthographic < 2; orthographic++) {
        const struct hg_view_camera camera = {.eye = {0.5f, -0.25f, 4},
            .target = {0.5f, -0.25f, 0},
            .orthographic = orthographic,
            .vfov_rad = 1.0f,
            .half_height = 1.5f};
        test_ok(hg_view_set_camera(rig.view, &camera, &rig.err), &rig.err);
        rig_settle(&rig, 1);
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
    rig_open(&rig, false);
    struct hg_scene *scene = rig_new_scene();
    struct hg_node *node = rig_quad(scene, 1, 4.3f, 0, white); // 8.6 px wide
    node->translation[0] = 10;                                 // right
    node->translation[1] = 5;                                  // up
    hg_scene_publish(scene);
    rig_use_scene(&rig, scene, &params);
    test_ok(hg_view_set_camera(rig.view, &camera, &rig.err), &rig.err);
    rig_settle(&rig, 1);
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
    rig_open(&rig, true);
    struct hg_scene *scene = rig_new_scene();
    rig_quad(scene, 1, 10, 0, half);
    hg_scene_publish(scene);
    rig_use_scene(&rig, scene, &params);
    rig_settle(&rig, 2);
    float got[4];
    read_centre(&rig, got);
    const float want[4] = {0.5f, 1, 2, 0.5f}; // straight alpha, one stop brighter
    for (int i = 0; i < 4; i++)
        assert_true(fabsf(got[i] - want[i]) < 1e-5f);
    struct hg_refbuf *image = rig_pixels(&rig, HG_PIXEL_RGBA8);
    const int bytes[4] = {188, 255, 255, 128}; // 0.5 encoded is 187.5, and alpha 127.5
    for (int i = 0; i < 4; i++)
        assert_in_range(
            image->data[4 * (16 * 32 + 16) + i], bytes[i] - (i == 0 || i == 3), bytes[i]);
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
    struct rig rig;
    rig_open(&rig, false);
    for (int order = 0; order < 4; order++) {
        const struct hg_view_params params = {.width = 32,
            .height = 32,
            .samples = 1,
            .tonemap = HG_TONEMAP_LINEAR,
            .background = HG_BACKGROUND_NONE};
        struct hg_scene *scene = rig_new_scene();
        for (int k = 0; k < 4; k++) { // node ids in another order each time
            const int layer = (k * (order == 3 ? 3 : 1) + order) % 4;
            rig_quad(scene, (uint64_t)k + 1, 10, -(float)layer, colors[layer]);
        }
        hg_scene_publish(scene);
        rig_use_scene(&rig, scene, &params);
        rig_settle(&rig, 1);
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
        rig_close_scene(&rig);
    }
    rig_close(&rig);
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
    struct hg_scene *scene = rig_new_scene();
    double want[3] = {0, 0, 0}, through = 1;
    for (uint32_t k = 0; k < count; k++) {
        const float color[4] = {
            (float)(k % 3) / 2, (float)(k % 5) / 4, (float)(k % 7) / 6, 0.0625f};
        rig_quad(scene, (uint64_t)k + 1, 10 + (float)k, -0.01f * (float)k, color);
        for (int c = 0; c < 3 && k < seen; c++)
            want[c] += through * (double)color[3] * (double)color[c];
        through *= k < seen ? 1 - (double)color[3] : 1;
    }
    hg_scene_publish(scene);
    rig_use_scene(rig, scene, &params);
    const struct hg_frame_info info = rig_settle(rig, 1);
    assert_int_equal(info.samples, 3);
    float got[4];
    read_centre(rig, got);
    for (int c = 0; c < 3; c++) // of straight alpha
        assert_float_equal(got[c] * got[3], want[c], 2e-5f);
    assert_float_equal(got[3], 1 - through, 2e-5f);
}

// As many layers as there are, HG_BLEND_MAX_LAYERS at most.
static void test_many_layers(void **state)
{
    (void)state;
    static const uint32_t counts[] = {7, 40, 3};
    struct rig rig;
    rig_open(&rig, true);
    check_layers(&rig, 9, 9);
    assert_int_equal(hg_renderer_validation_messages(rig.renderer), 0);
    rig_close(&rig);
    rig_open(&rig, false);
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        check_layers(&rig, counts[i], counts[i]);
        rig_close_scene(&rig);
    }
    check_layers(&rig, 80, 80);
    rig_close_scene(&rig);
    check_layers(&rig, 300, HG_BLEND_MAX_LAYERS);
    rig_close(&rig);
}

// --- the same bytes ------------------------------------------------------------------------------

// In one renderer, in another one, and with all samples in one step.
static void test_same_bytes(void **state)
{
    (void)state;
    static const char *const paths[] = {PANES, WORM};
    struct rig one, other;
    open_overridden(&one, (struct hg_debug_overrides){0});
    open_overridden(&other, (struct hg_debug_overrides){0});
    for (int i = 0; i < 2; i++) {
        struct hg_refbuf *a = render_in(&one, paths[i], 1, 0.4f);
        struct hg_refbuf *again = render_in(&other, paths[i], 1, 0.4f);
        struct hg_refbuf *steps = render_in(&one, paths[i], 16, 0.4f);
        assert_same(a, again, 0);
        assert_same(a, steps, 0);
        hg_refbuf_unref(a);
        hg_refbuf_unref(again);
        hg_refbuf_unref(steps);
    }
    rig_close(&one);
    rig_close(&other);
}

static void test_culling_changes_nothing(void **state)
{
    (void)state;
    struct rig culling, drawing_all;
    open_overridden(&culling, (struct hg_debug_overrides){0});
    open_overridden(&drawing_all, (struct hg_debug_overrides){.no_culling = true});
    for (int i = 0; i < 3; i++) {
        struct hg_refbuf *on = render_in(&culling, PANES, 4, (float)i * 2.0f);
        struct hg_refbuf *off = render_in(&drawing_all, PANES, 4, (float)i * 2.0f);
        assert_same(on, off, 0);
        hg_refbuf_unref(on);
        hg_refbuf_unref(off);
    }
    rig_close(&culling);
    rig_close(&drawing_all);
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

// Shaders as the driver gets them on CPU devices, and as they were written.
static void test_short_shaders_agree(void **state)
{
    (void)state;
    struct hg_refbuf *shorter = render_overridden(
        PANES, 4, 0.4f, (struct hg_debug_overrides){.short_shaders = HG_OVERRIDE_ON});
    struct hg_refbuf *written = render_overridden(
        PANES, 4, 0.4f, (struct hg_debug_overrides){.short_shaders = HG_OVERRIDE_OFF});
    assert_same(shorter, written, 0);
    hg_refbuf_unref(shorter);
    hg_refbuf_unref(written);
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
        rig_use_scene(&rig, rig_load(KNOT, hg_renderer_jobs(rig.renderer)), &params);
        rig_look_at_scene(&rig, 0.4f);
        rig_settle(&rig, 5);
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
    rig_open(&rig, true);
    struct hg_scene *scene = rig_new_scene();
    struct hg_node *node = rig_quad(scene, 1, 1, 0, white);
    hg_scene_publish(scene);
    rig_use_scene(&rig, scene, &params);
    struct hg_refbuf *none;
    assert_int_equal(hg_view_read_pixels(rig.view, HG_PIXEL_RGBA8, &none, &rig.err), HG_E_STATE);
    struct hg_frame_info info = rig_settle(&rig, 1);
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
    rig_settle(&rig, 8);
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
    const struct hg_view_params params = {
        .width = 61, .height = 47, .samples = 3, .temporal = HG_TEMPORAL_NONE};
    rig_open(&rig, true);
    struct hg_scene *scene = rig_new_scene();
    rig_quad(scene, 1, 1, 0, red);
    rig_quad(scene, 2, 0.6f, 0.5f, blue);
    hg_scene_publish(scene);
    rig_use_scene(&rig, scene, &params);
    struct hg_refbuf *moving[2], *settled[2], *linear;
    for (int i = 0; i < 2; i++) {
        struct hg_frame_info info;
        const bool all = i == 1;
        hg_view_set_formats(
            rig.view, all ? 1u << HG_PIXEL_RGBA8 | 1u << HG_PIXEL_RGBA32F : 1u << HG_PIXEL_RGBA8);
        rig_look_at_scene(&rig, 0.4f);
        rig_settle(&rig, 8); // layers are known
        rig_look_at_scene(&rig, 0.3f);
        test_ok(hg_view_step(rig.view, 1, &info, &rig.err), &rig.err);
        assert_true(!info.settled && info.samples == 1);
        assert_int_equal(info.phase == HG_VIEW_DIRECT, !all);
        assert_int_equal(hg_view_has_pixels(rig.view, HG_PIXEL_RGBA32F), all);
        moving[i] = rig_pixels(&rig, HG_PIXEL_RGBA8);
        assert_int_equal(hg_view_read_pixels(rig.view, HG_PIXEL_RGBA32F, &linear, &rig.err),
            all ? HG_OK : HG_E_STATE);
        hg_refbuf_unref(linear);
        rig_settle(&rig, 1);
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

// Pixels are lent where the device wrote them: they stay what they are while further pictures are
// drawn, and past their view; without readers the same memory is written again.
static void test_pixels_are_lent(void **state)
{
    (void)state;
    struct rig rig;
    const float red[4] = {0.9f, 0.2f, 0.1f, 1};
    const struct hg_view_params params = {.width = 61, .height = 47, .samples = 2};
    rig_open(&rig, true);
    struct hg_scene *scene = rig_new_scene();
    rig_quad(scene, 1, 1, 0, red);
    hg_scene_publish(scene);
    rig_use_scene(&rig, scene, &params);
    struct hg_refbuf *lent[3];
    uint8_t *before = malloc((size_t)61 * 47 * 4);
    assert_non_null(before);
    const uint8_t *first = NULL;
    for (int i = 0; i < 3; i++) {
        struct hg_frame_info info;
        rig_look_at_scene(&rig, 0.1f * (float)i);
        test_ok(hg_view_step(rig.view, 1, &info, &rig.err), &rig.err);
        struct hg_refbuf *again;
        test_ok(hg_view_lend_pixels(rig.view, HG_PIXEL_RGBA8, &lent[i], &rig.err), &rig.err);
        test_ok(hg_view_lend_pixels(rig.view, HG_PIXEL_RGBA8, &again, &rig.err), &rig.err);
        assert_ptr_equal(again->data, lent[i]->data);
        hg_refbuf_unref(again);
        if (i == 0) {
            first = lent[0]->data;
            memcpy(before, first, lent[0]->size);
        }
        if (i == 1) { // the first one has no reader any more
            assert_ptr_not_equal(lent[1]->data, first);
            assert_memory_equal(before, first, lent[0]->size);
            assert_memory_not_equal(before, lent[1]->data, lent[1]->size);
            memcpy(before, lent[1]->data, lent[1]->size);
            hg_refbuf_unref(lent[0]);
        }
    }
    assert_ptr_equal(lent[2]->data, first);
    hg_refbuf_unref(lent[2]);
    rig_close_scene(&rig);
    assert_memory_equal(before, lent[1]->data, lent[1]->size);
    hg_refbuf_unref(lent[1]);
    free(before);
    rig_close(&rig);
}

static void test_limits(void **state)
{
    (void)state;
    struct rig rig;
    const float white[4] = {1, 1, 1, 1};
    struct hg_view_params params = {.width = 32, .height = 32, .samples = 1};
    rig_open(&rig, true);
    struct hg_scene *scene = rig_new_scene();
    rig_quad(scene, 1, 1, 0, white);
    hg_scene_publish(scene);
    rig_use_scene(&rig, scene, &params);
    params.width = 16385;
    assert_int_equal(hg_view_set_params(rig.view, &params, &rig.err), HG_E_INVAL);
    assert_string_equal(rig.err.where, "width");
    params.width = params.height = 16384; // 4 GiB of sums in one piece
    assert_int_equal(hg_view_set_params(rig.view, &params, &rig.err), HG_E_LIMIT);
    const struct hg_frame_info info = rig_settle(&rig, 1); // the old size still works
    assert_int_equal(info.width, 32);
    const struct hg_view_camera bad = {.eye = {1, 2, 3}, .target = {1, 2, 3}};
    assert_int_equal(hg_view_set_camera(rig.view, &bad, &rig.err), HG_E_INVAL);
    assert_int_equal(hg_view_set_camera_node(rig.view, 99, &(struct hg_view_camera){0}, &rig.err),
        HG_E_NOTFOUND);
    assert_int_equal(hg_renderer_validation_messages(rig.renderer), 0);
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
        cmocka_unit_test(test_short_shaders_agree),
        cmocka_unit_test(test_budget_changes_nothing),
        cmocka_unit_test(test_thread_count_changes_nothing),
        cmocka_unit_test(test_settles_and_restarts),
        cmocka_unit_test(test_pixels_in_motion),
        cmocka_unit_test(test_pixels_are_lent),
        cmocka_unit_test(test_limits),
    };
    return test_run_group(tests, NULL, NULL);
}
