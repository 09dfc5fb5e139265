// mirrors.c - planar mirrors in pictures in motion, against path tracing and against reflections
// without them.
#include <math.h>
#include <string.h>

#include "base/alloc.h"
#include "renderer/internal.h"
#include "tests/analytic/gi_rig.h"

enum { WIDTH = 128, HEIGHT = 96, COLUMNS = 8, ROWS = 6, PICTURES = 6 };

// --- scenes --------------------------------------------------------------------------------------

static const float hall_box[2][3] = {{-2, 0, -3}, {2, 3, 3}};

static struct hg_material *mirror(struct rig *rig)
{
    struct hg_material *m = gi_grey(rig, 0.9f, 0);
    m->metallic = 1;
    m->roughness = 0;
    return m;
}

// A wall of patches that shine in colours of their own, 0.4 m wide: behind the eye.
static void patches(struct rig *rig)
{
    for (int y = 0; y < 7; y++)
        for (int x = 0; x < 10; x++) {
            struct hg_material *m = gi_grey(rig, 0, 0);
            const float at[2] = {-2 + 0.4f * (float)x, 0.4f * (float)y};
            const float z = 2.9f, corners[4][3] = {{at[0] + 0.4f, at[1], z}, {at[0], at[1], z},
                                      {at[0], at[1] + 0.4f, z}, {at[0] + 0.4f, at[1] + 0.4f, z}};
            m->emissive[(x + y) % 3] = 0.7f;
            m->emissive[(x + 2 * y) % 3] += 0.2f;
            rig_quad(rig, m, corners);
        }
}

// A room with a pane of mirror, 2.4 m wide and 1.8 m high, turned about +y and +x by some angles.
static void hall(struct rig *rig, float turn, float tilt)
{
    rig_scene(rig);
    gi_room(rig, gi_grey(rig, 0.1f, 0), hall_box);
    patches(rig);
    float corners[4][3];
    for (int i = 0; i < 4; i++) {
        const float x = i == 1 || i == 2 ? 1.2f : -1.2f, y = i >= 2 ? 0.9f : -0.9f;
        const float up = y * cosf(tilt), deep = y * sinf(tilt);
        corners[i][0] = x * cosf(turn) + deep * sinf(turn);
        corners[i][1] = 1.5f + up;
        corners[i][2] = -2 - x * sinf(turn) + deep * cosf(turn);
    }
    rig_quad(rig, mirror(rig), corners);
}

// A dark fence before the patches.
static void fence(struct rig *rig)
{
    static const float corners[4][3] = {
        {2, 0, 2.4f}, {-2, 0, 2.4f}, {-2, 2.8f, 2.4f}, {2, 2.8f, 2.4f}};
    struct hg_material *m = gi_grey(rig, 0.02f, 0);
    m->alpha_mode = HG_ALPHA_MASK;
    m->alpha_cutoff = 0.5f;
    m->double_sided = true;
    m->slots[HG_SLOT_BASE_COLOR].texture = rig_bars(rig);
    rig_quad(rig, m, corners);
}

// --- pictures ------------------------------------------------------------------------------------

static struct hg_view *open_view(struct rig *rig, const struct hg_view_params *with)
{
    static const struct gi_shot shot = {.target = {0, 0, -1}, .samples = 1};
    struct hg_error err = {0};
    struct hg_view *view = gi_open_view(rig, &shot);
    struct hg_view_params params = *with;
    params.width = WIDTH;
    params.height = HEIGHT;
    params.tonemap = HG_TONEMAP_LINEAR;
    params.filter = HG_FILTER_BOX;
    test_ok(hg_view_set_params(view, &params, &err), &err);
    return view;
}

static void look(struct hg_view *view, float off)
{
    struct hg_error err = {0};
    const struct hg_view_camera camera = {
        .eye = {0.6f + off, 1.7f, 1.2f}, .target = {off, 1.4f, -3}, .vfov_rad = 1.1f};
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
    struct hg_view *view = open_view(rig, params);
    look(view, 0);
    gi_settle(view, 16);
    struct hg_refbuf *pixels = read_bytes(view);
    hg_view_destroy(view);
    return pixels;
}

// The last of some pictures of a camera that comes to where the others look from.
static struct hg_refbuf *in_motion(struct rig *rig, enum hg_view_mirrors mirrors,
    enum hg_view_temporal temporal, struct hg_mirror_stats *stats)
{
    const struct hg_view_params params = {.samples = 2,
        .gi = HG_GI_PROBES,
        .reflections = HG_REFLECTIONS_CACHE,
        .mirrors = mirrors,
        .temporal = temporal};
    struct hg_error err = {0};
    struct hg_frame_info info;
    struct hg_view *view = open_view(rig, &params);
    for (int i = 0; i < PICTURES; i++) {
        look(view, 0.05f * (float)(PICTURES - 1 - i));
        test_ok(hg_view_step(view, 1, &info, &err), &err);
    }
    struct hg_refbuf *pixels = read_bytes(view);
    *stats = view->state.motion.mirrors.stats;
    hg_view_destroy(view);
    return pixels;
}

static double linear(uint8_t byte)
{
    const double v = byte / 255.0;
    return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}

struct error {
    double worst, mean; // of means of COLUMNS x ROWS regions, over the brightest one's
    double pixels;      // of what pixels are off by, over the mean
};

static struct error compare(const struct hg_refbuf *got, const struct hg_refbuf *want)
{
    double sums[2][ROWS * COLUMNS * 3] = {0}, all = 0, most = 0;
    struct error e = {0};
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        for (int c = 0; c < 3; c++) {
            const int x = i % WIDTH * COLUMNS / WIDTH, y = i / WIDTH * ROWS / HEIGHT;
            const double a = linear(got->data[4 * i + c]), b = linear(want->data[4 * i + c]);
            sums[0][(y * COLUMNS + x) * 3 + c] += a;
            sums[1][(y * COLUMNS + x) * 3 + c] += b;
            e.pixels += fabs(a - b);
            all += b;
        }
    e.pixels /= all;
    for (int i = 0; i < ROWS * COLUMNS * 3; i++)
        most = fmax(most, sums[1][i]);
    for (int i = 0; i < ROWS * COLUMNS * 3; i++) {
        const double off = fabs(sums[0][i] - sums[1][i]) / most;
        e.worst = fmax(e.worst, off);
        e.mean += off / (ROWS * COLUMNS * 3);
    }
    return e;
}

static void print(const char *name, struct error e)
{
    print_message("%s: regions off by %.4f in the mean, %.3f at worst, pixels by %.3f\n", name,
        e.mean, e.worst, e.pixels);
}

static struct hg_refbuf *path_traced(struct rig *rig)
{
    const struct hg_view_params params = {.mode = HG_MODE_PATH, .samples = 32};
    return settled(rig, &params);
}

static struct error error_of(struct rig *rig, const struct hg_refbuf *truth, const char *name,
    enum hg_view_mirrors mirrors, enum hg_view_temporal temporal)
{
    struct hg_mirror_stats stats;
    struct hg_refbuf *picture = in_motion(rig, mirrors, temporal, &stats);
    const struct error e = compare(picture, truth);
    print(name, e);
    assert_int_equal(stats.planes, mirrors == HG_MIRRORS_AUTO);
    hg_refbuf_unref(picture);
    return e;
}

// --- tests ---------------------------------------------------------------------------------------

// A mirror shows the room as path tracing has it, for a camera that moves, facing it and turned
// away.
static void test_hall(void **state)
{
    struct rig *rig = *state;
    static const float turns[2][2] = {{0, 0}, {0.35f, 0.2f}};
    for (int i = 0; i < 2; i++) {
        hall(rig, turns[i][0], turns[i][1]);
        struct hg_refbuf *truth = path_traced(rig);
        const struct error with = error_of(rig, truth, "mirror", HG_MIRRORS_AUTO, HG_TEMPORAL_NONE);
        const struct error history =
            error_of(rig, truth, "mirror, with history", HG_MIRRORS_AUTO, HG_TEMPORAL_AUTO);
        const struct error without =
            error_of(rig, truth, "without", HG_MIRRORS_NONE, HG_TEMPORAL_NONE);
        assert_true(with.worst < 0.1 && with.worst < without.worst / 2);
        assert_true(with.pixels < 0.35 && with.pixels < without.pixels / 2);
        assert_true(history.pixels < 0.35);
        hg_refbuf_unref(truth);
    }
}

// A floor and a wall that mirror are both planes; memory is what is said, and less than that of the
// picture's own images and buffers.
static void test_two(void **state)
{
    struct rig *rig = *state;
    struct hg_mirror_stats stats;
    rig_scene(rig);
    for (int i = 0; i < 6; i++)
        rig_face(rig, i == 2 || i == 4 ? mirror(rig) : gi_grey(rig, 0.3f, 0.2f), hall_box, 1, i);
    hg_refbuf_unref(in_motion(rig, HG_MIRRORS_AUTO, HG_TEMPORAL_NONE, &stats));
    print_message(
        "%u planes, %u rays, %.1f KiB\n", stats.planes, stats.rays, (double)stats.bytes / 1024);
    assert_int_equal(stats.planes, 2);
    assert_true(stats.rays > WIDTH * HEIGHT / 4 && stats.rays <= 2 * WIDTH * HEIGHT);
    assert_true(stats.bytes > WIDTH * HEIGHT * 16 && stats.bytes < 4 << 20);
}

// Through the holes of an alpha mask a mirror shows what is behind it: half of the wall.
static void test_holes(void **state)
{
    struct rig *rig = *state;
    hall(rig, 0, 0);
    fence(rig);
    struct hg_refbuf *truth = path_traced(rig);
    const struct error e = error_of(rig, truth, "fence", HG_MIRRORS_AUTO, HG_TEMPORAL_NONE);
    assert_true(e.worst < 0.15 && e.pixels < 0.45); // solid: 0.6 and more
    hg_refbuf_unref(truth);
}

// Normal maps, rough surfaces and small ones are no planes, and what is settled does not depend on
// mirrors.
static void test_none_and_rest(void **state)
{
    struct rig *rig = *state;
    struct hg_mirror_stats stats;
    struct hg_refbuf *pictures[2];
    rig_scene(rig);
    struct hg_material *rough = mirror(rig);
    rough->roughness = 0.2f;
    for (int i = 0; i < 6; i++)
        rig_face(rig, i == 2 ? rough : gi_grey(rig, 0.3f, 0.2f), hall_box, 1, i);
    rig_sphere(rig, mirror(rig), (const float[3]){0, 1.4f, -1}, 0.6f, 24);
    hg_refbuf_unref(in_motion(rig, HG_MIRRORS_AUTO, HG_TEMPORAL_NONE, &stats));
    assert_int_equal(stats.planes, 0);
    assert_int_equal(stats.rays, 0);
    hall(rig, 0, 0);
    for (int i = 0; i < 2; i++) {
        const struct hg_view_params params = {.samples = 2,
            .gi = HG_GI_PROBES,
            .reflections = HG_REFLECTIONS_CACHE,
            .mirrors = i ? HG_MIRRORS_NONE : HG_MIRRORS_AUTO};
        pictures[i] = settled(rig, &params);
    }
    gi_assert_same(pictures[0], pictures[1]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_hall),
        cmocka_unit_test(test_two),
        cmocka_unit_test(test_holes),
        cmocka_unit_test(test_none_and_rest),
    };
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
