// glass.c - what smooth glass shows of a closed room: a ball, a pane and a thin-walled bubble,
// against path tracing, under a sky that is brighter than the room and must not be seen; frosted
// glass; and a ball of paper around a lamp.
#include <math.h>
#include <string.h>

#include "renderer/internal.h"
#include "renderer/frame/light/glass_region.h"
#include "tests/analytic/gi_rig.h"

enum { COLUMNS = 8, ROWS = 6, MOVES = 8 };

static const float hall_box[2][3] = {{-2, 0, -3}, {2, 3, 3}};

static struct hg_material *glass(struct rig *rig, float thickness)
{
    struct hg_material *m = rig_material(rig);
    m->transmission = 1;
    m->roughness = 0;
    m->volume.thickness = thickness;
    m->double_sided = true;
    return m;
}

// Walls of six colours that shine a little.
static void hall(struct rig *rig)
{
    static const float colors[6][3] = {{0.8f, 0.1f, 0.1f}, {0.1f, 0.7f, 0.1f}, {0.5f, 0.5f, 0.1f},
        {0.6f, 0.6f, 0.6f}, {0.1f, 0.1f, 0.8f}, {0.5f, 0.1f, 0.5f}};
    rig_scene(rig);
    gi_sky(rig, 4);
    for (int i = 0; i < 6; i++) {
        struct hg_material *m = rig_material(rig);
        for (int c = 0; c < 3; c++) {
            m->base_color[c] = colors[i][c];
            m->emissive[c] = 0.5f * colors[i][c];
        }
        rig_face(rig, m, hall_box, 1, i);
    }
}

static void ball(struct rig *rig)
{
    hall(rig);
    rig_sphere(rig, glass(rig, 1.8f), (const float[3]){0, 1.4f, -0.4f}, 0.9f, 24);
}

static void pane(struct rig *rig)
{
    hall(rig);
    const float corners[4][3] = {
        {-1.2f, 0.4f, -0.2f}, {1.2f, 0.4f, 0.4f}, {1.2f, 2.4f, 0.4f}, {-1.2f, 2.4f, -0.2f}};
    rig_quad(rig, glass(rig, 0), corners);
}

static void bubble(struct rig *rig)
{
    hall(rig);
    rig_sphere(rig, glass(rig, 0), (const float[3]){0, 1.4f, -0.4f}, 0.9f, 24);
}

// --- pictures ------------------------------------------------------------------------------------

static const struct gi_shot shot = {
    .eye = {0.4f, 1.5f, 2.4f}, .target = {0, 1.4f, -3}, .samples = 4};

static struct hg_refbuf *take(struct rig *rig, enum hg_view_gi gi, enum hg_render_mode mode)
{
    struct gi_shot with = shot;
    with.gi = gi;
    with.mode = mode;
    with.samples = mode == HG_MODE_PATH ? 64 : 4;
    return gi_take(rig, &with);
}

// The last of some pictures of a camera that comes to where the others look from, linear.
static struct hg_refbuf *take_moving(struct rig *rig, enum hg_view_reflections reflections,
    enum hg_view_temporal temporal, struct hg_glass_stats *stats)
{
    const struct hg_view_params params = {.width = GI_WIDTH,
        .height = GI_HEIGHT,
        .tonemap = HG_TONEMAP_LINEAR,
        .background = HG_BACKGROUND_NONE,
        .samples = 2,
        .gi = HG_GI_PROBES,
        .reflections = reflections,
        .temporal = temporal};
    struct hg_error err = {0};
    struct hg_frame_info info;
    struct hg_view *view = gi_open_view(rig, &shot);
    struct hg_refbuf *bytes, *pixels;
    test_ok(hg_view_set_params(view, &params, &err), &err);
    gi_settle(view, 8); // so that it moves in the light of the settled field
    for (int i = MOVES; i >= 0; i--) {
        struct hg_view_camera camera = {.vfov_rad = 1.2f};
        memcpy(camera.eye, shot.eye, sizeof camera.eye);
        memcpy(camera.target, shot.target, sizeof camera.target);
        camera.eye[0] += 0.01f * (float)i;
        test_ok(hg_view_set_camera(view, &camera, &err), &err);
        test_ok(hg_view_step(view, 1, &info, &err), &err);
    }
    test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA8, &bytes, &err), &err);
    hg_glass_stats(view->state.motion.glass.glass, stats);
    pixels = hg_refbuf_create(bytes->size * sizeof(float));
    assert_non_null(pixels);
    for (size_t i = 0; i < bytes->size; i++) {
        const double v = bytes->data[i] / 255.0;
        ((float *)(void *)pixels->data)[i] =
            (float)(v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4));
    }
    hg_refbuf_unref(bytes);
    hg_view_destroy(view);
    return pixels;
}

struct error {
    double worst, mean; // of means of COLUMNS x ROWS regions, over the mean of the picture
    double middle;      // of pixels of the middle of the picture, likewise
};

static struct error compare(
    const char *name, const struct hg_refbuf *got, const struct hg_refbuf *want)
{
    const float *a = (const float *)(const void *)got->data;
    const float *b = (const float *)(const void *)want->data;
    double off[ROWS * COLUMNS * 3] = {0}, all = 0;
    struct error e = {0};
    for (int i = 0; i < GI_WIDTH * GI_HEIGHT; i++)
        for (int c = 0; c < 3; c++) {
            const int x = i % GI_WIDTH * COLUMNS / GI_WIDTH, y = i / GI_WIDTH * ROWS / GI_HEIGHT;
            off[(y * COLUMNS + x) * 3 + c] += (double)(a[4 * i + c] - b[4 * i + c]);
            all += (double)b[4 * i + c];
            if (x >= 2 && x < COLUMNS - 2 && y >= 1 && y < ROWS - 1)
                e.middle += fabs((double)(a[4 * i + c] - b[4 * i + c]));
        }
    e.middle *= ROWS * COLUMNS / (all * (ROWS - 2) * (COLUMNS - 4));
    int worst = 0;
    for (int i = 0; i < ROWS * COLUMNS * 3; i++) {
        worst = fabs(off[i]) > fabs(off[worst]) ? i : worst;
        e.mean += fabs(off[i]) / all;
    }
    e.worst = fabs(off[worst]) * ROWS * COLUMNS * 3 / all;
    print_message(
        "%s: regions off by %.3f in the mean, at worst by %.3f (column %d, row %d, channel "
        "%d: %+.3f), pixels of the middle by %.3f\n",
        name, e.mean, e.worst, worst / 3 % COLUMNS, worst / 3 / COLUMNS, worst % 3,
        off[worst] * ROWS * COLUMNS * 3 / all, e.middle);
    return e;
}

// --- tests ---------------------------------------------------------------------------------------

// At rest paths bring what glass shows, in motion rays of the host: a ball has the room inverted,
// which layers by themselves do not know.
static void test_rooms(void **state)
{
    struct rig *rig = *state;
    static const struct {
        const char *name;
        void (*make)(struct rig *);
        double worst, middle;
    } rooms[] = {
        {"ball", ball, 0.14, 0.09}, {"pane", pane, 0.1, 0.07}, {"bubble", bubble, 0.2, 0.09}};
    for (size_t i = 0; i < sizeof rooms / sizeof *rooms; i++) {
        struct hg_glass_stats stats, none;
        rooms[i].make(rig);
        struct hg_refbuf *truth = take(rig, HG_GI_NONE, HG_MODE_PATH);
        struct gi_shot probes = shot;
        probes.gi = HG_GI_PROBES;
        struct hg_view *keeper = gi_keep_field(rig, &probes);
        struct hg_refbuf *rest = take(rig, HG_GI_RAYS, HG_MODE_REALTIME);
        struct hg_refbuf *moving = take_moving(rig, HG_REFLECTIONS_CACHE, HG_TEMPORAL_NONE, &stats);
        struct hg_refbuf *layers =
            take_moving(rig, HG_REFLECTIONS_ENVIRONMENT, HG_TEMPORAL_NONE, &none);
        hg_view_destroy(keeper);
        print_message("%s: %u texels, %u rays, ends: %u on the screen, %u lit, %u sky\n",
            rooms[i].name, stats.texels, stats.rays, stats.on_screen, stats.lit, stats.sky);
        const struct error settled = compare("at rest", rest, truth);
        const struct error with = compare("in motion", moving, truth);
        const struct error without = compare("layers alone", layers, truth);
        assert_true(settled.worst < rooms[i].worst && settled.middle < rooms[i].middle);
        assert_true(with.worst < 0.17 && with.middle < 0.12);
        assert_true(i > 0 || with.worst < 0.8 * without.worst);
        assert_true(stats.texels > 300 && stats.on_screen > stats.texels / 2 && stats.lit > 0);
        assert_int_equal(stats.sky, 0); // the room is closed
        assert_int_equal(none.texels, 0);
        hg_refbuf_unref(truth);
        hg_refbuf_unref(rest);
        hg_refbuf_unref(moving);
        hg_refbuf_unref(layers);
    }
}

// What neighbours differ by in green, over the mean, near the left edge of the picture.
static double noise_of(const struct hg_refbuf *pixels)
{
    const float *p = (const float *)(const void *)pixels->data;
    double sum = 0, squares = 0, count = 0;
    for (int y = GI_HEIGHT / 2 - 6; y < GI_HEIGHT / 2 + 6; y++)
        for (int x = 3; x < 11; x++, count++) {
            const double own = (double)p[4 * (y * GI_WIDTH + x) + 1];
            const double apart = (double)p[4 * (y * GI_WIDTH + x + 1) + 1] - own;
            sum += own;
            squares += apart * apart;
        }
    return sqrt(squares * count) / sum;
}

static void frosted_pane(struct rig *rig)
{
    hall(rig);
    struct hg_material *m = glass(rig, 0);
    m->roughness = 0.4f;
    const float corners[4][3] = {
        {-1.45f, 0.9f, 0.4f}, {-0.8f, 0.9f, 0.4f}, {-0.8f, 2, 0.4f}, {-1.45f, 2, 0.4f}};
    rig_quad(rig, m, corners);
}

// Nor has it much in motion, where each picture has one sample.
static void test_frosted_moving(void **state)
{
    struct rig *rig = *state;
    struct hg_glass_stats stats;
    frosted_pane(rig);
    struct hg_refbuf *pixels = take_moving(rig, HG_REFLECTIONS_CACHE, HG_TEMPORAL_AUTO, &stats);
    const double noise = noise_of(pixels);
    print_message("frosted, in motion: neighbours differ by %.4f\n", noise);
    assert_true(noise < 0.06); // 0.067 with one facet a picture
    hg_refbuf_unref(pixels);
}

// A frosted pane has hardly any noise; paths go to the pixels that it is seen in alone.
static void test_frosted(void **state)
{
    struct rig *rig = *state;
    frosted_pane(rig);
    struct gi_shot with = shot;
    with.gi = HG_GI_RAYS;
    struct hg_view *view = gi_open_view(rig, &with);
    gi_settle(view, 8);
    struct hg_refbuf *pixels = gi_read_floats(view);
    const struct hg_path_stats *stats = view->state.gi.gather.stats;
    const double noise = noise_of(pixels);
    print_message("frosted: neighbours differ by %.4f\n", noise);
    assert_true(noise < 0.1); // 0.34 as paths bring it
    assert_true(stats[1].paths < stats[0].paths);
    hg_refbuf_unref(pixels);
    hg_view_destroy(view);
}

// Mean of green over the 4 x 4 pixels in the middle.
static double middle_of(const struct hg_refbuf *pixels)
{
    const float *p = (const float *)(const void *)pixels->data;
    double sum = 0;
    for (int i = 0; i < 16; i++)
        sum +=
            (double)p[((GI_HEIGHT / 2 - 2 + i / 4) * GI_WIDTH + GI_WIDTH / 2 - 2 + i % 4) * 4 + 1];
    return sum / 16;
}

static void furnace(struct rig *rig, float radiance)
{
    struct hg_material *walls = gi_grey(rig, 0, radiance);
    walls->specular.factor = 0; // else they mirror a fiftieth of what they send
    walls->specular.is_set = true;
    gi_room(rig, walls, hall_box);
}

// Where all is equally bright clear glass is not seen; absorption dims it by the way that light has
// in it, a diameter in the middle (Beer-Lambert).
static void test_furnace(void **state)
{
    struct rig *rig = *state;
    static const float radiance = 0.5f, radius = 0.9f, absorbed[2] = {0, 0.7f}; // 1 / m
    for (int i = 0; i < 2; i++) {
        struct hg_glass_stats stats;
        rig_scene(rig);
        furnace(rig, radiance);
        struct hg_material *m = glass(rig, 2 * radius);
        m->volume.attenuation_distance = 1;
        for (int c = 0; c < 3; c++)
            m->volume.attenuation_color[c] = expf(-absorbed[i]);
        // Through the middle the view ray passes the ball's centre.
        rig_sphere(rig, m, (const float[3]){0.2f, 1.45f, -0.3f}, radius, 48);
        struct hg_refbuf *pixels = take_moving(rig, HG_REFLECTIONS_CACHE, HG_TEMPORAL_NONE, &stats);
        const double got = middle_of(pixels);
        const double want = radiance * (0.04 + 0.96 * exp((double)(-absorbed[i] * 2 * radius)));
        print_message("absorption %.1f / m: %.4f, expected %.4f\n", (double)absorbed[i], got, want);
        assert_true(fabs(got / want - 1) < (i ? 0.03 : 0.015));
        hg_refbuf_unref(pixels);
    }
}

// Nor is frosted glass, in a settled picture: what leaves it comes from its other side.
static void test_frosted_furnace(void **state)
{
    struct rig *rig = *state;
    static const float radiance = 0.5f, roughness[2] = {0.3f, 0.6f};
    for (int i = 0; i < 2; i++) {
        rig_scene(rig);
        furnace(rig, radiance);
        struct hg_material *m = glass(rig, 1.8f);
        m->roughness = roughness[i];
        rig_sphere(rig, m, (const float[3]){0.2f, 1.45f, -0.3f}, 0.9f, 48);
        struct hg_refbuf *pixels = take(rig, HG_GI_RAYS, HG_MODE_REALTIME);
        const double got = middle_of(pixels);
        print_message(
            "roughness %.1f: %.4f of %.4f\n", (double)roughness[i], got, (double)radiance);
        assert_true(fabs(got / (double)radiance - 1) < 0.04); // 0.3 too dark where paths end in it
        hg_refbuf_unref(pixels);
    }
}

// What light scatters through has the light of its other side, nearer than probes are to each
// other.
static void test_lampshade(void **state)
{
    struct rig *rig = *state;
    static const float lit_by[2][3] = {{0, 1.4f, -0.4f}, {0, 2.7f, -2.4f}}; // within, from outside
    for (int i = 0; i < 2; i++) {
        struct hg_refbuf *pixels[2];
        rig_scene(rig);
        gi_room(rig, gi_grey(rig, 0.5f, 0), hall_box);
        struct hg_material *paper = gi_grey(rig, 0.8f, 0);
        paper->diffuse_transmission.factor = 0.7f;
        paper->double_sided = true;
        rig_sphere(rig, paper, lit_by[0], 0.6f, 24);
        rig_sphere(rig, gi_grey(rig, 0, 50), lit_by[i], 0.1f, 12);
        pixels[0] = take(rig, HG_GI_RAYS, HG_MODE_REALTIME);
        pixels[1] = take(rig, HG_GI_NONE, HG_MODE_PATH);
        const double got = middle_of(pixels[0]), want = middle_of(pixels[1]);
        print_message(
            "a shade lit from %s: %.3f, paths %.3f\n", i ? "behind" : "within", got, want);
        assert_true(fabs(got / want - 1) < 0.1);
        hg_refbuf_unref(pixels[0]);
        hg_refbuf_unref(pixels[1]);
    }
}

// Paths of both kinds at rest are counted apart.
static void test_counters(void **state)
{
    struct rig *rig = *state;
    pane(rig);
    struct gi_shot with = shot;
    with.gi = HG_GI_RAYS;
    with.samples = 2;
    struct hg_view *view = gi_open_view(rig, &with);
    gi_settle(view, 8);
    const struct hg_path_stats *stats = view->state.gi.gather.stats;
    assert_int_equal(stats[0].paths, GI_WIDTH * GI_HEIGHT * 8);
    assert_int_equal(stats[1].paths, GI_WIDTH * GI_HEIGHT * 8);
    assert_true(stats[0].pieces[HG_PATH_PIECE_TRACE].items > stats[0].paths);
    assert_true(
        stats[1].pieces[HG_PATH_PIECE_TRACE].items != stats[0].pieces[HG_PATH_PIECE_TRACE].items);
    hg_view_destroy(view);
}

// Paths go where glass may be seen: nowhere behind the camera, everywhere about a camera within it.
static void test_region(void **state)
{
    struct rig *rig = *state;
    static const float eyes[4][2][3] = {{{0, 1.5f, 2.8f}, {0, 1.4f, -3}},
        {{0, 1.5f, 2.8f}, {-2, 1.4f, 3}}, {{0, 1.5f, 2.8f}, {0, 1.4f, 3}},
        {{0, 1.4f, -0.4f}, {0, 1.4f, -3}}};
    hall(rig);
    rig_sphere(rig, glass(rig, 0.4f), (const float[3]){0, 1.4f, -0.4f}, 0.2f, 24);
    struct hg_view *view = gi_open_view(
        rig, &(struct gi_shot){.target = {0, 1.4f, -3}, .gi = HG_GI_RAYS, .samples = 2});
    for (int i = 0; i < 4; i++) {
        struct hg_error err = {0};
        struct hg_frame_info info;
        struct hg_view_camera camera = {.vfov_rad = 1.1f};
        for (int a = 0; a < 3; a++) {
            camera.eye[a] = (double)eyes[i][0][a];
            camera.target[a] = (double)eyes[i][1][a];
        }
        test_ok(hg_view_set_camera(view, &camera, &err), &err);
        test_ok(hg_view_step(view, 1, &info, &err), &err);
        const struct hg_picture_region r = hg_glass_region(&view->state);
        print_message("glass in %u x %u px\n", r.width, r.height);
        if (i == 0) {
            assert_true(r.x <= GI_WIDTH / 2 - 3 && r.x + r.width >= GI_WIDTH / 2 + 3);
            assert_true(r.y <= GI_HEIGHT / 2 - 3 && r.y + r.height >= GI_HEIGHT / 2 + 3);
            assert_true(r.width * r.height < GI_WIDTH * GI_HEIGHT / 16);
        }
        if (i == 1 || i == 2)
            assert_int_equal(r.width * r.height, 0);
        if (i == 3)
            assert_int_equal(r.width * r.height, GI_WIDTH * GI_HEIGHT);
    }
    hg_view_destroy(view);
}

int main(int argc, char **argv) // argv[1]: only tests of this name
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rooms),
        cmocka_unit_test(test_frosted),
        cmocka_unit_test(test_frosted_moving),
        cmocka_unit_test(test_furnace),
        cmocka_unit_test(test_frosted_furnace),
        cmocka_unit_test(test_lampshade),
        cmocka_unit_test(test_counters),
        cmocka_unit_test(test_region),
    };
    if (argc > 1)
        cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
