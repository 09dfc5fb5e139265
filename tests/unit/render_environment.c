// render_environment.c - environments from files: light from an image of bounded size, the picture
// behind the scene from pages, whatever the budget.

#include <time.h>

#include "base/alloc.h"
#include "base/file.h"
#include "renderer/internal.h"
#include "renderer/light/env/env_file.h"
#include "renderer/scene/asset.h"
#include "tests/support/folder.h"
#include "tests/unit/render_rig.h"

#define WIDTH   8200u // 65 x 4 pages of mip 0
#define HEIGHT  512u
#define LEAST   (8ull << 20) // 49 slots
#define VIEW_PX 256
#define PANEL   1500u

#define LEAST_OF_BOTH (12ull << 20) // a layer of 4 MiB and one of 8

static char folder[TEST_FOLDER_MAX];
static struct hg_image made; // what the file holds
static char made_path[128];  // the file

// Smooth waves and fine noise: neighbouring pages differ, and so do neighbouring texels.
static void make_image(uint32_t width, uint32_t height, struct hg_image *image)
{
    assert_int_equal(hg_image_create(width, height, HG_PIXEL_RGBA8, NULL, image), HG_OK);
    uint8_t *p = image->pixels;
    for (uint32_t i = 0; i < width * height; i++, p += 4) {
        const uint32_t x = i % width, y = i / width, n = (i * 0x9e3779b9u) >> 27;
        p[0] = (uint8_t)(x / 8 % 200 + n);
        p[1] = (uint8_t)(y / 3 % 200 + n);
        p[2] = (uint8_t)((x / 64 + y / 16) % 5 * 40 + n);
        p[3] = 255;
    }
}

static void write_image(const struct hg_image *image, const char *name, char path[128])
{
    struct hg_writer w = {0};
    struct hg_error err = {0};
    const struct hg_image_encode png = {.file = HG_IMAGE_PNG8, .opaque = true};
    test_ok(hg_image_encode(image, &png, &w, &err), &err);
    snprintf(path, 128, "%s/%s", folder, name);
    test_ok(hg_file_write_atomic(path, w.data, w.size, &err), &err);
    hg_writer_finish(&w);
}

// --- what light is made from ---------------------------------------------------------------------

static void test_small_files_stay_as_they_are(void **state)
{
    (void)state;
    char path[128];
    struct hg_image small;
    struct hg_environment_file file;
    struct hg_error err = {0};
    make_image(60, 31, &small);
    write_image(&small, "small.png", path);
    test_ok(hg_environment_file_read(path, NULL, &file, &err), &err);
    assert_int_equal(file.image.width, 60);
    assert_int_equal(file.image.height, 31);
    for (size_t i = 0; i < 60 * 31 * 4; i++) {
        const float expected = (float)((const uint8_t *)small.pixels)[i] / 255.0f;
        assert_true(fabsf(((const float *)file.image.pixels)[i] - expected) < 1e-6f);
    }
    hg_environment_file_finish(&file);
    hg_image_finish(&small);
}

// 4 x 4 texels each.
static void test_large_files_are_averaged(void **state)
{
    (void)state;
    struct hg_environment_file file;
    struct hg_error err = {0};
    test_ok(hg_environment_file_read(made_path, NULL, &file, &err), &err);
    assert_int_equal(file.image.width, WIDTH / 4);
    assert_int_equal(file.image.height, HEIGHT / 4);
    const uint8_t *from = made.pixels;
    for (uint32_t i = 0; i < WIDTH / 4 * HEIGHT / 4; i++) {
        const size_t x = i % (WIDTH / 4), y = i / (WIDTH / 4);
        for (size_t c = 0; c < 3; c++) {
            float sum = 0;
            for (size_t k = 0; k < 16; k++)
                sum += from[((y * 4 + k / 4) * WIDTH + x * 4 + k % 4) * 4 + c];
            assert_true(
                fabsf(((const float *)file.image.pixels)[i * 4 + c] - sum / (16 * 255)) < 1e-5f);
        }
    }
    hg_environment_file_finish(&file);
}

static double mean(const float *p, size_t texels)
{
    double sum = 0;
    for (size_t i = 0; i < texels; i++)
        sum += (double)p[i * 4 + 1];
    return sum / (double)texels;
}

// Texels that two of the smaller image share are divided between them: no light is lost.
static void test_odd_sizes_keep_the_mean(void **state)
{
    (void)state;
    char path[128];
    struct hg_image odd;
    struct hg_environment_file file;
    struct hg_error err = {0};
    double expected = 0;
    make_image(8195, 33, &odd);
    for (uint32_t i = 0; i < 8195 * 33; i++)
        expected += ((const uint8_t *)odd.pixels)[i * 4 + 1] / 255.0;
    write_image(&odd, "odd.png", path);
    test_ok(hg_environment_file_read(path, NULL, &file, &err), &err);
    assert_int_equal(file.image.width, 2048);
    assert_int_equal(file.image.height, 8);
    assert_true(fabs(mean(file.image.pixels, 2048 * 8) - expected / (8195.0 * 33)) < 1e-5);
    hg_environment_file_finish(&file);
    hg_image_finish(&odd);
}

static void test_reading_stops(void **state)
{
    (void)state;
    struct hg_environment_file file;
    struct hg_error err = {0};
    atomic_bool cancel = true;
    assert_int_equal(hg_environment_file_read(made_path, &cancel, &file, &err), HG_E_CANCELLED);
    assert_null(file.source);
    assert_null(file.image.pixels);
}

// --- what is seen --------------------------------------------------------------------------------

static void open_rig(struct rig *rig, uint64_t budget_bytes, bool pages)
{
    struct hg_environment_file file;
    const struct hg_renderer_params params = {.texture_budget_bytes = budget_bytes, .threads = 2};
    const struct hg_view_params view = {
        .width = VIEW_PX, .height = VIEW_PX, .samples = 2, .tonemap = HG_TONEMAP_LINEAR};
    *rig = (struct rig){0};
    test_ok(hg_environment_file_read(made_path, NULL, &file, &rig->err), &rig->err);
    assert_int_equal(hg_scene_create(&rig->scene), HG_OK);
    struct hg_environment *env = &rig->scene->environment;
    hg_environment_file_use(&file, env);
    hg_image_finish(&env->image); // light is not what this is about
    const uint32_t width = pages ? 64 : WIDTH, height = pages ? 32 : HEIGHT;
    assert_int_equal(hg_image_create(width, height, HG_PIXEL_RGBA32F, NULL, &env->image), HG_OK);
    memset(env->image_hash, 0, sizeof env->image_hash);
    float *to = env->image.pixels;
    for (size_t i = 0; i < (size_t)width * height * 4 && !pages; i++)
        to[i] = (float)((const uint8_t *)made.pixels)[i] / 255.0f;
    if (!pages) {
        hg_image_source_unref(env->background.image);
        env->background.image = NULL;
    }
    hg_scene_publish(rig->scene);
    test_ok(hg_renderer_create(&params, &rig->renderer, &rig->err), &rig->err);
    rig_view(rig, &view);
}

static void look(struct rig *rig, float x, float y, float vfov)
{
    const struct hg_view_camera camera = {.target = {x, y, 1}, .vfov_rad = vfov};
    test_ok(hg_view_set_camera(rig->view, &camera, &rig->err), &rig->err);
}

static struct hg_refbuf *settle(struct rig *rig, uint32_t *most_missing)
{
    struct hg_frame_info info = {0};
    *most_missing = 0;
    for (int i = 0; i < 4000 && !info.settled; i++) {
        info = rig_step(rig, 2);
        *most_missing = info.missing_pages > *most_missing ? info.missing_pages : *most_missing;
    }
    assert_true(info.settled);
    assert_int_equal(info.missing_pages, 0);
    return rig_pixels(rig, HG_PIXEL_RGBA32F);
}

// Across the seam behind -x, magnified: what ordinary sampling of the whole image shows.
static void test_pages_match_an_image(void **state)
{
    (void)state;
    struct rig rig;
    struct hg_refbuf *pictures[2];
    uint32_t missing;
    for (int pages = 0; pages < 2; pages++) {
        open_rig(&rig, 0, pages);
        look(&rig, -4, 0.6f, 0.5f);
        pictures[pages] = settle(&rig, &missing);
        assert_true((missing > 0) == (pages == 1));
        rig_close(&rig);
    }
    const float *a = (const float *)(const void *)pictures[0]->data;
    const float *b = (const float *)(const void *)pictures[1]->data;
    double error = 0, worst = 0;
    for (size_t i = 0; i < VIEW_PX * VIEW_PX * 4; i++) {
        const double d = fabs((double)(a[i] - b[i]));
        error += d;
        worst = d > worst ? d : worst;
    }
    print_message(
        "pages against an image: mean %.2g, worst %.2g\n", error / (VIEW_PX * VIEW_PX * 4), worst);
    assert_true(worst < 0.004);
    for (int i = 0; i < 2; i++)
        hg_refbuf_unref(pictures[i]);
}

// A wide view needs more pages than the least budget holds; what settles is the same.
static void test_budgets_do_not_show(void **state)
{
    (void)state;
    struct rig rig;
    struct hg_refbuf *pictures[2];
    uint32_t missing;
    for (int small = 0; small < 2; small++) {
        open_rig(&rig, small ? LEAST : 0, true);
        look(&rig, 0.5f, 1, 2.2f);
        pictures[small] = settle(&rig, &missing);
        struct hg_page_cache_stats stats;
        hg_page_cache_stats(rig.renderer->context.pages, &stats);
        assert_true(!small || stats.peak_bytes <= LEAST);
        assert_true(!small || stats.evicted > 0);
        assert_true(missing > 0);
        rig_close(&rig);
    }
    rig_assert_same(pictures[0], pictures[1]);
    for (int i = 0; i < 2; i++)
        hg_refbuf_unref(pictures[i]);
}

// A textured quad in front of the environment.
static void add_panel(struct rig *rig)
{
    static const uint32_t indices[6] = {0, 1, 2, 0, 2, 3};
    static const float normals[12] = {0, 0, -1, 0, 0, -1, 0, 0, -1, 0, 0, -1};
    static const float uv[8] = {0, 1, 1, 1, 1, 0, 0, 0};
    static const float positions[12] = {-1, -0.5f, 2, 2, -0.5f, 2, 2, 1.5f, 2, -1, 1.5f, 2};
    struct hg_texture *t = rig_add(rig->scene, HG_OBJECT_TEXTURE, 1);
    t->image = hg_calloc(1, sizeof *t->image);
    assert_non_null(t->image);
    t->image->refs = 1;
    t->image->label = hg_strdup("panel");
    t->image->pixels_srgb = true;
    make_image(PANEL, PANEL, &t->image->pixels);
    struct hg_material *m = rig_add(rig->scene, HG_OBJECT_MATERIAL, 2);
    m->unlit = m->double_sided = true;
    m->slots[HG_SLOT_BASE_COLOR].texture = t;
    struct hg_mesh *mesh = rig_add(rig->scene, HG_OBJECT_MESH, 3);
    struct hg_mesh_part *part = rig_part(mesh, 4, positions, normals, 6, indices);
    part->material = m;
    part->uv[0] = rig_copy(uv, sizeof uv);
    struct hg_node *node = rig_add(rig->scene, HG_OBJECT_NODE, 4);
    node->mesh = mesh;
    hg_scene_publish(rig->scene);
}

// Surfaces and environment together within 16 MiB, and within the least there is: layers of RGBA8
// pages are small then. Nothing of that shows.
static void test_both_kinds_fit_small_budgets(void **state)
{
    (void)state;
    static const uint64_t budgets[] = {0, 16ull << 20, LEAST_OF_BOTH};
    struct hg_refbuf *pictures[3];
    uint32_t missing;
    for (int i = 0; i < 3; i++) {
        struct rig rig;
        open_rig(&rig, budgets[i], true);
        add_panel(&rig);
        look(&rig, 0.2f, 0.3f, 1.2f);
        pictures[i] = settle(&rig, &missing);
        struct hg_page_cache_stats stats;
        hg_page_cache_stats(rig.renderer->context.pages, &stats);
        assert_true(i == 0 || stats.peak_bytes <= budgets[i]);
        assert_true(stats.slots >= 98);
        if (i > 0)
            rig_assert_same(pictures[0], pictures[i]);
        rig_close(&rig);
    }
    for (int i = 0; i < 3; i++)
        hg_refbuf_unref(pictures[i]);
}

static double difference(const struct hg_refbuf *a, const struct hg_refbuf *b)
{
    const float *x = (const float *)(const void *)a->data;
    const float *y = (const float *)(const void *)b->data;
    double sum = 0;
    for (size_t i = 0; i < VIEW_PX * VIEW_PX * 4; i++)
        sum += fabs((double)(x[i] - y[i]));
    return sum / (VIEW_PX * VIEW_PX * 4);
}

// An image that does not fit into memory is seen before its pages are baked: a coarse version,
// which counts as missing. What settles is what a renderer with memory shows.
static void test_large_images_show_a_preview(void **state)
{
    (void)state;
    const uint32_t width = 4096, height = 2048; // decoded more than the host's budget
    char path[128];
    struct hg_image large;
    struct hg_environment_file file;
    struct hg_refbuf *pictures[2], *first = NULL, *early = NULL;
    uint32_t missing, frames = 0;
    const struct timespec pause = {.tv_nsec = 20000000}; // the processor is the baking's
    make_image(width, height, &large);
    write_image(&large, "huge.png", path);
    hg_image_finish(&large);
    for (int with_memory = 0; with_memory < 2; with_memory++) {
        char cache[128];
        snprintf(cache, sizeof cache, "%s/cache%d", folder, with_memory);
        const struct hg_renderer_params params = {.cache_dir = cache,
            .host_budget_bytes = with_memory ? 4ull << 30 : 24ull << 20,
            .threads = 2};
        const struct hg_view_params view = {
            .width = VIEW_PX, .height = VIEW_PX, .samples = 2, .tonemap = HG_TONEMAP_LINEAR};
        struct rig rig = {0};
        test_ok(hg_environment_file_read(path, NULL, &file, &rig.err), &rig.err);
        hg_image_finish(&file.image);
        assert_int_equal(hg_image_create(64, 32, HG_PIXEL_RGBA32F, NULL, &file.image), HG_OK);
        assert_int_equal(hg_scene_create(&rig.scene), HG_OK);
        hg_environment_file_use(&file, &rig.scene->environment);
        hg_scene_publish(rig.scene);
        test_ok(hg_renderer_create(&params, &rig.renderer, &rig.err), &rig.err);
        rig_view(&rig, &view);
        hg_view_set_formats(rig.view, 1u << HG_PIXEL_RGBA32F); // of pictures in motion, too
        struct hg_page_sources_stats stats = {0};
        for (int i = 0; !with_memory && stats.packs_baked == 0; i++) {
            look(&rig, 0.5f + 0.0001f * (float)(i % 2), 0.3f, 1);
            const struct hg_frame_info info = rig_step(&rig, 1);
            struct hg_refbuf *picture = rig_pixels(&rig, HG_PIXEL_RGBA32F);
            hg_page_sources_stats(hg_page_cache_sources(rig.renderer->context.pages), &stats);
            if (stats.packs_baked == 0) {
                assert_true(info.missing_pages > 0);
                hg_refbuf_unref(early);
                early = picture;
                frames++;
            } else {
                hg_refbuf_unref(picture);
            }
            nanosleep(&pause, NULL);
            if (first == NULL && early != NULL)
                first = hg_refbuf_ref(early);
        }
        look(&rig, 0.5f, 0.3f, 1);
        pictures[with_memory] = settle(&rig, &missing);
        rig_close(&rig);
    }
    rig_assert_same(pictures[0], pictures[1]);
    assert_non_null(early);
    const double before = difference(first, pictures[0]), after = difference(early, pictures[0]);
    print_message("%u frames before the pack: difference %.3f, with the preview %.3f\n", frames,
        before, after);
    assert_true(after < 0.5 * before);
    hg_refbuf_unref(first);
    hg_refbuf_unref(early);
    for (int i = 0; i < 2; i++)
        hg_refbuf_unref(pictures[i]);
}

static int setup(void **state)
{
    (void)state;
    make_image(WIDTH, HEIGHT, &made);
    if (!test_folder_make(folder, "environment"))
        return -1;
    write_image(&made, "large.png", made_path);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    hg_image_finish(&made);
    return test_folder_remove(folder) ? 0 : -1;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_small_files_stay_as_they_are),
        cmocka_unit_test(test_large_files_are_averaged),
        cmocka_unit_test(test_odd_sizes_keep_the_mean),
        cmocka_unit_test(test_reading_stops),
        cmocka_unit_test(test_pages_match_an_image),
        cmocka_unit_test(test_budgets_do_not_show),
        cmocka_unit_test(test_both_kinds_fit_small_budgets),
        cmocka_unit_test(test_large_images_show_a_preview),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
