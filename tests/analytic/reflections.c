// reflections.c - what surfaces mirror in pictures in motion, against path tracing and itself.
#include <math.h>
#include <string.h>

#include "renderer/internal.h"
#include "tests/analytic/rig.h"

enum { WIDTH = 128, HEIGHT = 96, CELLS = 4, PICTURES = 40 };

// --- scenes --------------------------------------------------------------------------------------

static struct hg_material *paint(struct rig *rig, float r, float g, float b, float emission)
{
    struct hg_material *m = rig_material(rig);
    const float color[3] = {r, g, b};
    for (int c = 0; c < 3; c++) {
        m->base_color[c] = color[c];
        m->emissive[c] = color[c] * emission;
    }
    return m;
}

static struct hg_material *metal(struct rig *rig, float roughness)
{
    struct hg_material *m = paint(rig, 0.9f, 0.9f, 0.9f, 0);
    m->metallic = 1;
    m->roughness = roughness;
    return m;
}

static const float hall_box[2][3] = {{-2, 0, -3}, {2, 3, 3}};

// A room whose floor is metal: walls of three colours, light from the ceiling, a box in the middle.
static void hall(struct rig *rig, float roughness)
{
    const float block[2][3] = {{-0.6f, 0.4f, -2.0f}, {0.4f, 1.2f, -1.2f}};
    rig_scene(rig);
    struct hg_material *walls[6] = {paint(rig, 0.7f, 0.1f, 0.1f, 0),
        paint(rig, 0.1f, 0.6f, 0.1f, 0), metal(rig, roughness), paint(rig, 0.7f, 0.7f, 0.7f, 1),
        paint(rig, 0.6f, 0.6f, 0.2f, 0), paint(rig, 0.5f, 0.5f, 0.5f, 0)};
    for (int i = 0; i < 6; i++)
        rig_face(rig, walls[i], hall_box, 1, i);
    struct hg_material *blue = paint(rig, 0.1f, 0.2f, 0.8f, 0.5f);
    for (int i = 0; i < 6; i++)
        rig_face(rig, blue, block, -1, i);
}

// --- pictures ------------------------------------------------------------------------------------

static struct hg_view *open_view(struct rig *rig, const struct hg_view_params *with)
{
    struct hg_error err = {0};
    struct hg_view *view;
    struct hg_view_params params = *with;
    params.width = WIDTH;
    params.height = HEIGHT;
    params.tonemap = HG_TONEMAP_LINEAR;
    params.background = HG_BACKGROUND_NONE;
    params.filter = HG_FILTER_BOX;
    hg_scene_publish(rig->scene);
    test_ok(hg_view_create(rig->renderer, rig->scene, &view, &err), &err);
    test_ok(hg_view_set_params(view, &params, &err), &err);
    return view;
}

static void look(struct hg_view *view, float off)
{
    struct hg_error err = {0};
    const struct hg_view_camera camera = {
        .eye = {off, 1.5f, 2.6f}, .target = {0, 0.9f, -3}, .vfov_rad = 1.1f};
    test_ok(hg_view_set_camera(view, &camera, &err), &err);
}

static struct hg_refbuf *read_bytes(struct hg_view *view)
{
    struct hg_error err = {0};
    struct hg_refbuf *pixels;
    test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA8, &pixels, &err), &err);
    return pixels;
}

static struct hg_refbuf *settled(struct rig *rig, const struct hg_view_params *params)
{
    struct hg_error err = {0};
    struct hg_frame_info info = {0};
    struct hg_view *view = open_view(rig, params);
    look(view, 0);
    for (int i = 0; i < 4000 && !info.settled; i++)
        test_ok(hg_view_step(view, 16, &info, &err), &err);
    assert_true(info.settled);
    struct hg_refbuf *pixels = read_bytes(view);
    hg_view_destroy(view);
    return pixels;
}

static struct hg_refbuf *path_traced(struct rig *rig)
{
    const struct hg_view_params params = {.mode = HG_MODE_PATH, .samples = 64};
    return settled(rig, &params);
}

// The last of some pictures of a camera that comes to where path_traced looks from.
static struct hg_refbuf *in_motion(
    struct rig *rig, enum hg_view_reflections reflections, struct hg_view **kept)
{
    const struct hg_view_params params = {
        .samples = 2, .gi = HG_GI_PROBES, .reflections = reflections, .mirrors = HG_MIRRORS_NONE};
    struct hg_error err = {0};
    struct hg_frame_info info;
    struct hg_view *view = open_view(rig, &params);
    for (int i = 0; i < PICTURES; i++) {
        look(view, 0.01f * (float)(PICTURES - 1 - i));
        test_ok(hg_view_step(view, 1, &info, &err), &err);
    }
    struct hg_refbuf *pixels = read_bytes(view);
    if (kept)
        *kept = view;
    else
        hg_view_destroy(view);
    return pixels;
}

static double linear(uint8_t byte)
{
    const double v = byte / 255.0;
    return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}

// Mean of a channel over one of CELLS x CELLS regions of the lower half, which shows the floor.
static double region(const struct hg_refbuf *pixels, int x, int y, int c)
{
    double sum = 0, count = 0;
    for (int py = HEIGHT / 2 + y * HEIGHT / 2 / CELLS;
         py < HEIGHT / 2 + (y + 1) * HEIGHT / 2 / CELLS; py++)
        for (int px = x * WIDTH / CELLS; px < (x + 1) * WIDTH / CELLS; px++, count++)
            sum += linear(pixels->data[4 * (py * WIDTH + px) + c]);
    return sum / count;
}

struct error {
    double worst, mean;
};

static struct error compare(const struct hg_refbuf *got, const struct hg_refbuf *want)
{
    struct error e = {0};
    for (int y = 0; y < CELLS; y++)
        for (int x = 0; x < CELLS; x++)
            for (int c = 0; c < 3; c++) {
                const double truth = region(want, x, y, c);
                const double off = fabs(region(got, x, y, c) - truth) / fmax(truth, 0.05);
                e.worst = fmax(e.worst, off);
                e.mean += off / (CELLS * CELLS * 3);
            }
    return e;
}

// Metal floors of three kinds: what they mirror is the room, not the environment.
static void test_hall(void **state)
{
    struct rig *rig = *state;
    static const struct {
        float roughness, worst, mean;
    } floors[] = {{0.05f, 0.35f, 0.09f}, {0.25f, 0.36f, 0.09f}};
    for (size_t i = 0; i < sizeof floors / sizeof *floors; i++) {
        hall(rig, floors[i].roughness);
        struct hg_refbuf *truth = path_traced(rig);
        struct error errors[3];
        for (int k = 0; k < 3; k++) {
            static const enum hg_view_reflections ways[] = {
                HG_REFLECTIONS_ENVIRONMENT, HG_REFLECTIONS_RAYS, HG_REFLECTIONS_CACHE};
            struct hg_refbuf *picture = in_motion(rig, ways[k], NULL);
            errors[k] = compare(picture, truth);
            hg_refbuf_unref(picture);
        }
        print_message(
            "floor of roughness %.2f, regions off at worst and in the mean: environment %.3f "
            "%.3f, rays %.3f %.3f, cache %.3f %.3f\n",
            (double)floors[i].roughness, errors[0].worst, errors[0].mean, errors[1].worst,
            errors[1].mean, errors[2].worst, errors[2].mean);
        assert_true(errors[0].mean > 0.3); // which is what this is for
        for (int k = 1; k < 3; k++) {
            assert_true(errors[k].worst < (double)floors[i].worst);
            assert_true(errors[k].mean < (double)floors[i].mean);
        }
        hg_refbuf_unref(truth);
    }
}

// White metal that mirrors what is the same from everywhere sends it back, without noise: walls of
// albedo 0.5 that emit 0.25 send back 0.5.
static void test_furnace(void **state)
{
    struct rig *rig = *state;
    rig_scene(rig);
    struct hg_material *white = metal(rig, 0.3f);
    for (int c = 0; c < 3; c++)
        white->base_color[c] = 1;
    for (int i = 0; i < 6; i++)
        rig_face(rig, i == 2 ? white : paint(rig, 0.5f, 0.5f, 0.5f, 0.5f), hall_box, 1, i);
    struct hg_refbuf *picture = in_motion(rig, HG_REFLECTIONS_CACHE, NULL);
    double least = 10, most = 0;
    for (int y = 0; y < CELLS; y++)
        for (int x = 0; x < CELLS; x++) {
            least = fmin(least, region(picture, x, y, 1));
            most = fmax(most, region(picture, x, y, 1));
        }
    print_message("furnace: regions of %.3f to %.3f\n", least, most);
    assert_true(least > 0.485 && most < 0.525);
    hg_refbuf_unref(picture);
}

// With the parameter at its least the picture is the one of before there were reflections, and what
// is settled does not depend on it.
static void test_off_and_rest(void **state)
{
    struct rig *rig = *state;
    hall(rig, 0.2f);
    struct hg_refbuf *settled_ones[2];
    for (int i = 0; i < 2; i++) {
        const struct hg_view_params params = {.samples = 4,
            .gi = HG_GI_PROBES,
            .reflections = i == 0 ? HG_REFLECTIONS_ENVIRONMENT : HG_REFLECTIONS_CACHE};
        settled_ones[i] = settled(rig, &params);
    }
    assert_memory_equal(settled_ones[0]->data, settled_ones[1]->data, settled_ones[0]->size);
    struct hg_view *view;
    struct hg_refbuf *picture = in_motion(rig, HG_REFLECTIONS_ENVIRONMENT, &view);
    assert_null(view->state.motion.reflections.reflect);
    hg_refbuf_unref(picture);
    hg_view_destroy(view);
    for (int i = 0; i < 2; i++)
        hg_refbuf_unref(settled_ones[i]);
}

// The mask says where reflections come from: of the walls, which are rough, one texel of sixteen
// sends a ray, of the floor each; they have light from the cache or are shaded, none of them late.
// At a quarter of the quality a quarter of them send.
static void test_mask(void **state)
{
    struct rig *rig = *state;
    static const uint8_t rough[3] = {96, 32, 128}, cached[3] = {128, 224, 96},
                         shaded[3] = {255, 144, 32}, open[3] = {64, 128, 255};
    struct hg_error err = {0};
    struct hg_frame_info info;
    hall(rig, 0.25f);
    const struct hg_view_params params = {.debug_view = HG_DEBUG_REFLECTIONS, .target_ms = 1e5f};
    struct hg_view *view = open_view(rig, &params);
    for (int i = 0; i < PICTURES; i++) {
        look(view, 0.01f * (float)(PICTURES - 1 - i));
        test_ok(hg_view_step(view, 1, &info, &err), &err);
    }
    struct hg_refbuf *pixels = read_bytes(view);
    uint32_t counts[4] = {0};
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        const uint8_t *p = pixels->data + 4 * i;
        counts[0] += memcmp(p, rough, 3) == 0;
        counts[1] += memcmp(p, cached, 3) == 0;
        counts[2] += memcmp(p, shaded, 3) == 0;
        counts[3] += memcmp(p, open, 3) == 0; // samples of lobes that lie below the horizon
    }
    struct hg_reflect_stats stats;
    hg_reflect_stats(view->state.motion.reflections.reflect, &stats);
    print_message("mask: %u px rough, %u cached, %u shaded; %u of %u texels late\n", counts[0],
        counts[1], counts[2], stats.counts[HG_REFLECT_LATE], stats.texels);
    assert_int_equal(counts[0] + counts[1] + counts[2] + counts[3], WIDTH * HEIGHT);
    const double rough_share = counts[0] / (double)(WIDTH * HEIGHT);
    assert_true(rough_share > 0.4 && rough_share < 0.75);
    assert_true(counts[1] > 0 && counts[2] > 0);
    assert_int_equal(stats.counts[HG_REFLECT_LATE], 0);
    assert_int_equal(stats.texels, WIDTH * HEIGHT / 16);
    assert_int_equal(counts[1], 16 * stats.counts[HG_REFLECT_CACHED]);
    const uint32_t rays = stats.texels - stats.counts[HG_REFLECT_ROUGH];
    view->state.motion.quality.now = (struct hg_quality_choice){1, 0.25f, 1, false};
    look(view, 0.01f);
    test_ok(hg_view_step(view, 1, &info, &err), &err);
    hg_reflect_stats(view->state.motion.reflections.reflect, &stats);
    const uint32_t fewer = stats.texels - stats.counts[HG_REFLECT_ROUGH];
    print_message("%u rays, %u at a quarter of the quality\n", rays, fewer);
    assert_true(fewer > rays / 5 && fewer < rays / 3);
    hg_refbuf_unref(pixels);
    hg_view_destroy(view);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_mask),
        cmocka_unit_test(test_hall),
        cmocka_unit_test(test_furnace),
        cmocka_unit_test(test_off_and_rest),
    };
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
