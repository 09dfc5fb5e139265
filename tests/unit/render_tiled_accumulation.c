// render_tiled_accumulation.c - pictures do not depend on how much memory textures get, nor on what
// was looked at before; moving pictures say what they miss and settle down to one mip bias.
//
// The scene: 36 lit quads with three textures each, some masked (they cast shadows), some blended.
// What one view of it needs is more than the 225 slots of the least budget, 16 MiB.

#include "base/alloc.h"
#include "base/log.h"
#include "renderer/internal.h"
#include "tests/support/folder.h"
#include "tests/unit/lod_meshes.h"
#include "tests/unit/render_rig.h"

#define ROW     6
#define SIDE    512 // texels
#define LEAST   (16ull << 20)
#define SAMPLES 2
#define VIEW_PX 384

// --- the scene -----------------------------------------------------------------------------------

// Blocks of 16 texels in random colours, alpha 0 or 255; every texture its own.
static struct hg_texture *add_texture(struct hg_scene *scene, uint64_t id, bool srgb)
{
    struct hg_texture *t = rig_add(scene, HG_OBJECT_TEXTURE, id);
    t->image = hg_calloc(1, sizeof *t->image);
    assert_non_null(t->image);
    t->image->refs = 1;
    t->image->label = hg_strdup("blocks");
    t->image->pixels_srgb = srgb;
    assert_int_equal(hg_image_create(SIDE, SIDE, HG_PIXEL_RGBA8, NULL, &t->image->pixels), HG_OK);
    uint32_t *texels = t->image->pixels.pixels;
    for (uint32_t i = 0; i < SIDE * SIDE; i++) {
        uint32_t n = (i % SIDE / 16) * 977u + (i / SIDE / 16) * 3571u + (uint32_t)id * 104729u;
        n = (n ^ n >> 15) * 0x2c1b3c6du;
        n = (n ^ n >> 12) * 0x297a2d39u;
        n += i * 0x9e3779b9u & 0x0f0f0fu; // not flat inside a block
        texels[i] = (n & 0xffffffu) | (n & 0x1000000u ? 0xff000000u : 0x20000000u);
    }
    return t;
}

static void add_quad(struct hg_scene *scene, uint64_t id)
{
    static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    static const float normals[12] = {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1};
    static const float uv[8] = {0.1f, 0.5f, 0.5f, 0.1f, 0.9f, 0.5f, 0.5f, 0.9f}; // turned
    static const float positions[12] = {
        -0.5f, -0.5f, 0, 0.5f, -0.5f, 0, 0.5f, 0.5f, 0, -0.5f, 0.5f, 0};
    struct hg_material *m = rig_add(scene, HG_OBJECT_MATERIAL, id);
    m->alpha_mode = id % 3 == 1 ? HG_ALPHA_MASK : id == 8 ? HG_ALPHA_BLEND : HG_ALPHA_OPAQUE;
    m->alpha_cutoff = 0.5f;
    m->double_sided = true;
    m->slots[HG_SLOT_BASE_COLOR].texture = add_texture(scene, 3 * id, true);
    m->slots[HG_SLOT_NORMAL].texture = add_texture(scene, 3 * id + 1, false);
    m->slots[HG_SLOT_METALLIC_ROUGHNESS].texture = add_texture(scene, 3 * id + 2, false);
    struct hg_mesh *mesh = rig_add(scene, HG_OBJECT_MESH, id);
    struct hg_mesh_part *part = rig_part(mesh, 4, positions, normals, 6, indices);
    part->material = m;
    part->uv[0] = rig_copy(uv, sizeof uv);
    struct hg_node *node = rig_add(scene, HG_OBJECT_NODE, id);
    node->mesh = mesh;
    node->translation[0] = (float)((id - 1) % ROW) - 0.5f * (ROW - 1);
    node->translation[1] = (float)((id - 1) / ROW) - 0.5f * (ROW - 1);
    node->translation[2] = (float)(id % 4) * 0.3f;
}

static bool with_glass;

// A pane in front of all of it that bends light far, differently in each sample.
static void add_glass(struct hg_scene *scene, uint64_t id)
{
    static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    static const float normals[12] = {
        0.3f, 0, 0.9539392f, 0, 0.3f, 0.9539392f, -0.3f, 0, 0.9539392f, 0, -0.3f, 0.9539392f};
    static const float positions[12] = {-2, -2, 2, 2, -2, 2, 2, 2, 2, -2, 2, 2};
    struct hg_material *m = rig_add(scene, HG_OBJECT_MATERIAL, id);
    m->metallic = 0.0f;
    m->roughness = 0.3f;
    m->transmission = 1.0f;
    m->volume.thickness = 1.0f;
    struct hg_mesh *mesh = rig_add(scene, HG_OBJECT_MESH, id);
    rig_part(mesh, 4, positions, normals, 6, indices)->material = m;
    struct hg_node *node = rig_add(scene, HG_OBJECT_NODE, id);
    node->mesh = mesh;
}

static struct hg_scene *make_scene(void)
{
    struct hg_scene *scene;
    assert_int_equal(hg_scene_create(&scene), HG_OK);
    for (uint64_t id = 1; id <= ROW * ROW; id++)
        add_quad(scene, id);
    if (with_glass)
        add_glass(scene, 600);
    rig_sun(scene, 500, -0.3f, 0.9539392f);
    rig_environment(scene, 0.5f, 0, 0);
    hg_scene_publish(scene);
    return scene;
}

// --- views ---------------------------------------------------------------------------------------

static char folder[TEST_FOLDER_MAX]; // page packs, baked once for all renderers

static void open_rig(struct rig *rig, uint64_t budget_bytes)
{
    const struct hg_renderer_params params = {
        .texture_budget_bytes = budget_bytes, .threads = 2, .cache_dir = folder};
    const struct hg_view_params view = {
        .width = VIEW_PX, .height = VIEW_PX, .samples = SAMPLES, .seed = 5};
    *rig = (struct rig){.scene = make_scene()};
    test_ok(hg_renderer_create(&params, &rig->renderer, &rig->err), &rig->err);
    rig_view(rig, &view);
}

static void look(struct rig *rig, float x, float distance)
{
    const struct hg_view_camera camera = {.eye = {x, 0.2f, distance}, .target = {x, 0, 0}};
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
}

static struct hg_frame_info settle(struct rig *rig, uint32_t samples)
{
    struct hg_frame_info info = {0};
    for (int i = 0; i < 4000 && !info.settled; i++) {
        info = rig_step(rig, samples);
        if (info.settled) {
            assert_int_equal(info.missing_pages, 0);
            assert_true(info.mip_bias == 0.0f);
        }
    }
    assert_true(info.settled);
    return info;
}

static struct hg_page_cache_stats cache_stats(const struct rig *rig)
{
    struct hg_page_cache_stats stats;
    hg_page_cache_stats(rig->renderer->context.pages, &stats);
    return stats;
}

// --- tests ---------------------------------------------------------------------------------------

static struct hg_refbuf *unlimited;

// What settles in a budget of a twelfth, in parts, is what settles without one.
static void test_budgets_do_not_show(void **state)
{
    (void)state;
    struct rig rig;
    open_rig(&rig, 0);
    look(&rig, 0, 6.5f);
    settle(&rig, 16);
    unlimited = rig_pixels(&rig, HG_PIXEL_RGBA32F);
    rig_close(&rig);
    for (uint64_t budget = LEAST; budget <= 4 * LEAST; budget *= 4) {
        open_rig(&rig, budget);
        look(&rig, 0, 6.5f);
        settle(&rig, 4);
        struct hg_refbuf *small = rig_pixels(&rig, HG_PIXEL_RGBA32F);
        rig_assert_same(unlimited, small);
        hg_refbuf_unref(small);
        assert_true(cache_stats(&rig).peak_bytes <= budget);
        rig_close(&rig);
    }
}

// Textures of another scene that come into the cache while samples without textures are added up:
// the pixels that are counted from then on have those samples.
static void test_another_scene_comes(void **state)
{
    (void)state;
    const float grey[4] = {0.5f, 0.5f, 0.5f, 1};
    const struct hg_view_params params = {
        .width = VIEW_PX, .height = VIEW_PX, .samples = 16, .seed = 5};
    struct rig rig;
    open_rig(&rig, LEAST); // of which the other scene's textures need twelve times as much
    struct hg_scene *textured = rig.scene;
    struct hg_refbuf *pictures[2];
    hg_view_destroy(rig.view);
    for (int comes = 0; comes < 2; comes++) {
        struct hg_view *other = NULL;
        struct hg_frame_info info = {0};
        struct hg_scene *plain = rig_new_scene();
        rig_quad(plain, 1, 1, 0, grey);
        rig_sun(plain, 500, -0.3f, 0.9539392f);
        rig_environment(plain, 0.5f, 0, 0);
        hg_scene_publish(plain);
        rig.scene = plain;
        rig_view(&rig, &params);
        look(&rig, 0, 6.5f);
        for (int i = 0; i < 100 && info.samples < 4; i++)
            info = rig_step(&rig, 4);
        assert_in_range(info.samples, 4, 15);
        if (comes) {
            assert_true(hg_page_cache_is_complete(rig.renderer->context.pages));
            test_ok(hg_view_create(rig.renderer, textured, &other, &rig.err), &rig.err);
            test_ok(hg_view_set_params(other, &params, &rig.err), &rig.err);
            struct hg_frame_info first;
            test_ok(hg_view_step(other, 1, &first, &rig.err), &rig.err);
            assert_false(hg_page_cache_is_complete(rig.renderer->context.pages));
        }
        settle(&rig, 4);
        pictures[comes] = rig_pixels(&rig, HG_PIXEL_RGBA32F);
        hg_view_destroy(other);
        rig_close_scene(&rig);
    }
    rig_assert_same(pictures[0], pictures[1]);
    hg_refbuf_unref(pictures[0]);
    hg_refbuf_unref(pictures[1]);
    rig.scene = textured;
    rig_close(&rig);
}

// Nor does the budget show through glass, where each pixel may show what lies in another part.
static void test_budgets_behind_glass(void **state)
{
    (void)state;
    struct hg_refbuf *pictures[3];
    with_glass = true;
    for (int i = 0; i < 3; i++) { // without a limit; with the least, watched and final
        struct rig rig;
        open_rig(&rig, i == 0 ? 0 : LEAST);
        hg_view_set_final(rig.view, i == 2);
        look(&rig, 0, 6.5f);
        settle(&rig, 4);
        pictures[i] = rig_pixels(&rig, HG_PIXEL_RGBA32F);
        assert_true(i == 0 || cache_stats(&rig).peak_bytes <= LEAST);
        assert_true(i == 0 || cache_stats(&rig).evicted > 0);
        rig_close(&rig);
    }
    with_glass = false;
    assert_true(rig_difference(pictures[0], unlimited) > 0.01); // the glass is seen
    for (int i = 1; i < 3; i++)
        rig_assert_same(pictures[0], pictures[i]);
    for (int i = 0; i < 3; i++)
        hg_refbuf_unref(pictures[i]);
}

// Looking elsewhere first, in motion, changes nothing; the budget holds all the time.
static void test_history_does_not_show(void **state)
{
    (void)state;
    struct rig rig;
    open_rig(&rig, LEAST);
    for (int i = 0; i < 40; i++) {
        look(&rig, sinf((float)i) * 2.0f, 1.5f + (float)(i % 7));
        rig_step(&rig, 1);
        assert_true(cache_stats(&rig).peak_bytes <= LEAST);
    }
    look(&rig, 0, 6.5f);
    settle(&rig, 2);
    struct hg_refbuf *after = rig_pixels(&rig, HG_PIXEL_RGBA32F);
    rig_assert_same(unlimited, after);
    hg_refbuf_unref(after);
    rig_close(&rig);
}

// A frame that lacks pages says so; one that lacks none is not called missing, and a view that is
// settled asks for nothing more.
static void test_missing_is_told(void **state)
{
    (void)state;
    struct rig rig;
    open_rig(&rig, 0);
    look(&rig, 0, 6.5f);
    (void)rig_step(&rig, 1); // has waited for what it needs
    look(&rig, 0, 1.5f);
    const struct hg_frame_info first = rig_step(&rig, 1);
    assert_true(first.missing_pages > 0);
    assert_false(first.settled);
    settle(&rig, 4);
    const uint64_t requested = cache_stats(&rig).requested;
    for (int i = 0; i < 5; i++)
        assert_true(rig_step(&rig, 4).settled);
    assert_int_equal(cache_stats(&rig).requested, requested);
    look(&rig, 0.001f, 1.5f); // the same pages but for a few at borders
    assert_true(rig_step(&rig, 1).missing_pages < first.missing_pages / 4);
    rig_close(&rig);
}

// Shadows of masks are sharp in motion, too, once the pages of their alpha are there.
static void test_shadows_sharpen_in_motion(void **state)
{
    (void)state;
    struct rig rig;
    bool coarse = true;
    open_rig(&rig, 0);
    for (int i = 0; i < 4000 && coarse; i++) {
        look(&rig, 0.001f * (float)(i % 2), 6.5f);
        rig_step(&rig, 1);
        coarse = rig.view->state.accumulation.shadows.coarse_texels;
    }
    assert_false(coarse);
    rig_close(&rig);
}

// In motion a budget that is too small raises the bias evenly until all fits; then it stays: sixty
// frames in a row, however long the images took to be read.
static void test_bias_settles(void **state)
{
    (void)state;
    struct rig rig;
    struct hg_frame_info info = {0};
    float bias = 0.0f;
    int steady = 0;
    open_rig(&rig, LEAST);
    for (int i = 0; i < 4000 && steady < 60; i++) {
        look(&rig, 0.0001f * (float)(i % 2), 6.5f);
        info = rig_step(&rig, 1);
        const bool same =
            info.mip_bias > 0.0f && fabsf(info.mip_bias - bias) <= 0.25f && info.missing_pages <= 8;
        steady = same ? steady + 1 : 0;
        bias = same ? bias : info.mip_bias;
    }
    print_message("bias %.2f, missing %u\n", (double)info.mip_bias, info.missing_pages);
    assert_int_equal(steady, 60);
    rig_close(&rig);
}

// Not displayed before it is settled: a batch to see what is needed, one with it, and those that
// find more behind holes of masked surfaces; the number of frames does not hang on how images
// arrive.
static void test_final_is_drawn_once(void **state)
{
    (void)state;
    struct rig rig;
    for (uint64_t budget = 0; budget <= LEAST; budget += LEAST) {
        open_rig(&rig, budget);
        hg_view_set_final(rig.view, true);
        look(&rig, 0, 6.5f);
        const struct hg_frame_info info = settle(&rig, SAMPLES);
        if (budget == 0)
            assert_in_range(info.number, 2, 5);
        struct hg_refbuf *final = rig_pixels(&rig, HG_PIXEL_RGBA32F);
        rig_assert_same(unlimited, final);
        hg_refbuf_unref(final);
        rig_close(&rig);
    }
}

// Displayed after all: there is a picture at once, and the same one in the end.
static void test_final_no_longer(void **state)
{
    (void)state;
    struct rig rig;
    open_rig(&rig, 0);
    hg_view_set_final(rig.view, true);
    look(&rig, 0, 6.5f);
    assert_int_equal(rig_step(&rig, 1).samples, 0);
    hg_view_set_final(rig.view, false);
    assert_int_equal(rig_step(&rig, 1).samples, 1);
    settle(&rig, 2);
    struct hg_refbuf *after = rig_pixels(&rig, HG_PIXEL_RGBA32F);
    rig_assert_same(unlimited, after);
    hg_refbuf_unref(after);
    rig_close(&rig);
}

static struct hg_prefetch_place place(double x, double turn, uint64_t ms)
{
    return (struct hg_prefetch_place){.eye = {x, 1, 5},
        .direction = {sin(turn), 0, -cos(turn)},
        .up = {0, 1, 0},
        .distance = 2,
        .ns = 1000000000u + ms * 1000000u};
}

// A steady camera goes on as it did; one that jumps or stands is not guessed at.
static void test_prediction(void **state)
{
    (void)state;
    struct hg_view_camera_state c = {0};
    struct hg_prefetch_place steady[3] = {
        place(1.2, 0.02, 200), place(1.1, 0.01, 100), place(1.0, 0.0, 0)};
    assert_true(hg_prefetch_predict(steady, 300000000, &c));
    assert_float_equal(c.eye[0], 1.5, 1e-6); // 300 ms at 1 m/s
    assert_float_equal(c.eye[1], 1, 1e-6);
    assert_float_equal((c.target[0] - c.eye[0]) / 2, sin(0.05), 1e-4);
    struct hg_prefetch_place slow[3] = {place(3, 0, 1200), place(2, 0, 600), place(1, 0, 0)};
    assert_true(hg_prefetch_predict(slow, 300000000, &c)); // two changes, not 300 ms
    assert_float_equal(c.eye[0], 5, 1e-6);
    struct hg_prefetch_place spin[3] = {
        place(1, 1.8, 200), place(1, 0.9, 100), place(1, 0, 0)}; // never more than it can know
    assert_true(hg_prefetch_predict(spin, 300000000, &c));
    const double turned = atan2(c.target[0] - c.eye[0], -(c.target[2] - c.eye[2]));
    assert_true(turned > 1.8 && turned < 2.7);
    struct hg_prefetch_place jump[3] = {place(9, 0, 200), place(1.1, 0, 100), place(1, 0, 0)};
    assert_false(hg_prefetch_predict(jump, 300000000, &c));
    struct hg_prefetch_place back[3] = {place(1, 0, 200), place(1.1, 0, 100), place(1, 0, 0)};
    assert_false(hg_prefetch_predict(back, 300000000, &c));
    struct hg_prefetch_place late[3] = {place(1.2, 0, 9000), place(1.1, 0, 100), place(1, 0, 0)};
    assert_false(hg_prefetch_predict(late, 300000000, &c));
}

// In steady motion it is looked ahead, at the same pictures in the end and within the budget.
static void test_looking_ahead(void **state)
{
    (void)state;
    struct rig rig;
    open_rig(&rig, LEAST);
    struct hg_view_report report = {0};
    for (int i = 0; i < 20000 && report.prefetched < 3; i++) {
        look(&rig, (float)(i % 100) * 0.05f - 2.5f, 4.0f);
        rig_step(&rig, 1);
        hg_view_get_report(rig.view, &report);
    }
    assert_true(report.prefetched >= 3);
    look(&rig, 0, 6.5f);
    settle(&rig, 2);
    struct hg_refbuf *after = rig_pixels(&rig, HG_PIXEL_RGBA32F);
    rig_assert_same(unlimited, after);
    hg_refbuf_unref(after);
    assert_true(cache_stats(&rig).peak_bytes <= LEAST);
    rig_close(&rig);
}

// A final view looks for its pages in a small picture first: levels of detail are those of the
// whole one all the same, however many samples the first batch has.
static void test_finding_does_not_show(void **state)
{
    (void)state;
    struct hg_refbuf *pictures[3];
    for (int i = 0; i < 3; i++) {
        struct hg_scene *scene;
        assert_int_equal(hg_scene_create(&scene), HG_OK);
        struct hg_mesh_part land = lod_terrain(150);
        struct hg_mesh *mesh = rig_add(scene, HG_OBJECT_MESH, 1);
        struct hg_mesh_part *part = rig_part(
            mesh, land.vertex_count, land.positions, land.normals, land.index_count, land.indices);
        part->uv[0] = rig_copy(land.uv[0], land.vertex_count * 8ull);
        part->material = rig_add(scene, HG_OBJECT_MATERIAL, 2);
        part->material->slots[HG_SLOT_BASE_COLOR].texture = add_texture(scene, 3, true);
        ((struct hg_node *)rig_add(scene, HG_OBJECT_NODE, 4))->mesh = mesh;
        lod_part_finish(&land);
        rig_environment(scene, 0.5f, 0.5f, 0.5f);
        hg_scene_publish(scene);
        const struct hg_renderer_params params = {.threads = 2};
        const struct hg_view_params view = {
            .width = VIEW_PX, .height = VIEW_PX, .samples = 4, .seed = 5, .error_px = 1.0f};
        const struct hg_view_camera camera = {.eye = {75, 60, 190}, .target = {75, 0, 75}};
        struct rig rig = {.scene = scene};
        test_ok(hg_renderer_create(&params, &rig.renderer, &rig.err), &rig.err);
        rig_view(&rig, &view);
        test_ok(hg_view_set_camera(rig.view, &camera, &rig.err), &rig.err);
        hg_view_set_final(rig.view, i > 0);
        rig_settle(&rig, i == 1 ? 1 : 16);
        struct hg_view_report report;
        hg_view_get_report(rig.view, &report);
        assert_true(report.geometry.chunks.resident > 0);
        pictures[i] = rig_pixels(&rig, HG_PIXEL_RGBA32F);
        rig_close(&rig);
    }
    for (int i = 2; i >= 0; i--) {
        rig_assert_same(pictures[0], pictures[i]);
        hg_refbuf_unref(pictures[i]);
    }
}

// A picture that is cut into slices, as small as they get and in between, is that of a view that
// is alone.
static void test_slices_do_not_show(void **state)
{
    enum { WIDTH = 640, HEIGHT = 480 };
    const uint64_t slices[] = {0, 1, 20000000, 1};
    struct hg_refbuf *pictures[4];
    uint64_t steps[4] = {0};
    (void)state;
    for (int i = 0; i < 4; i++) {
        const struct hg_view_params view = {
            .width = WIDTH, .height = HEIGHT, .samples = 4, .seed = 5};
        struct rig rig;
        struct hg_frame_info info = {0};
        open_rig(&rig, i == 3 ? LEAST : 0);
        test_ok(hg_view_set_params(rig.view, &view, &rig.err), &rig.err);
        look(&rig, 0, 6.5f);
        hg_view_set_final(rig.view, true);
        hg_view_set_slice(rig.view, slices[i]);
        for (; !info.settled && steps[i] < 4000; steps[i]++)
            info = rig_step(&rig, 2);
        assert_true(info.settled);
        pictures[i] = rig_pixels(&rig, HG_PIXEL_RGBA32F);
        rig_close(&rig);
    }
    assert_true(steps[1] > steps[0] + 8);
    for (int i = 3; i >= 0; i--) {
        rig_assert_same(pictures[0], pictures[i]);
        hg_refbuf_unref(pictures[i]);
    }
}

static int set_up(void **state)
{
    (void)state;
    return test_folder_make(folder, "accumulation") ? 0 : -1;
}

static int finish(void **state)
{
    (void)state;
    hg_refbuf_unref(unlimited);
    return test_folder_remove(folder) ? 0 : -1;
}

int main(void)
{
    hg_log_set_sink(hg_log_sink_logfmt, (void *)(intptr_t)2);
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_budgets_do_not_show),
        cmocka_unit_test(test_another_scene_comes), cmocka_unit_test(test_budgets_behind_glass),
        cmocka_unit_test(test_history_does_not_show), cmocka_unit_test(test_missing_is_told),
        cmocka_unit_test(test_shadows_sharpen_in_motion), cmocka_unit_test(test_bias_settles),
        cmocka_unit_test(test_finding_does_not_show), cmocka_unit_test(test_slices_do_not_show),
        cmocka_unit_test(test_final_is_drawn_once), cmocka_unit_test(test_final_no_longer),
        cmocka_unit_test(test_prediction), cmocka_unit_test(test_looking_ahead)};
    return cmocka_run_group_tests(tests, set_up, finish);
}
