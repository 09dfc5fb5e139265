// path_denoise.c - denoised pictures of the path tracer against ones of many samples: how much
// better they are, that they become the raw picture, what is not touched, edges before a
// background, and flicker of animations.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "renderer/internal.h"
#include "tests/analytic/path_rig.h"

// References are two pictures of independent samples: the mean of (x - a) (x - b) is the mean
// square of x - truth, without the noise of a and b, which many samples alone would make small.
enum { WIDTH = 128, HEIGHT = 96, PIXELS = WIDTH * HEIGHT, REFERENCE = 32 };

static void quad(struct rig *rig, const float color[3], float emissive, const float at[4][3])
{
    struct hg_material *m = rig_material(rig);
    for (int c = 0; c < 3; c++) {
        m->base_color[c] = color[c];
        m->emissive[c] = emissive;
    }
    m->double_sided = emissive <= 0.0f;
    rig_quad(rig, m, at);
}

// A room with a lamp in its ceiling, coloured walls, and two spheres: rough metal and plastic.
static void room(struct rig *rig)
{
    static const float white[3] = {0.7f, 0.7f, 0.7f}, red[3] = {0.6f, 0.1f, 0.1f};
    static const float green[3] = {0.1f, 0.5f, 0.1f}, blue[3] = {0.1f, 0.2f, 0.6f};
    static const float at[2][3] = {{-0.4f, -0.65f, -0.3f}, {0.45f, -0.7f, 0.2f}};
    static const float walls[][4][3] = {
        {{-1, -1, 1}, {1, -1, 1}, {1, -1, -1}, {-1, -1, -1}},
        {{-1, 1, -1}, {1, 1, -1}, {1, 1, 1}, {-1, 1, 1}},
        {{-1, -1, -1}, {1, -1, -1}, {1, 1, -1}, {-1, 1, -1}},
        {{-1, -1, 1}, {-1, -1, -1}, {-1, 1, -1}, {-1, 1, 1}},
        {{1, -1, -1}, {1, -1, 1}, {1, 1, 1}, {1, 1, -1}},
    };
    static const float lamp[4][3] = {
        {-0.3f, 0.99f, -0.3f}, {0.3f, 0.99f, -0.3f}, {0.3f, 0.99f, 0.3f}, {-0.3f, 0.99f, 0.3f}};
    rig_scene(rig);
    rig->scene->environment.kind = HG_ENV_NONE;
    for (int i = 0; i < 5; i++)
        quad(rig, i == 3 ? red : i == 4 ? green : white, 0.0f, walls[i]);
    quad(rig, white, 12.0f, lamp);
    for (int i = 0; i < 2; i++) {
        struct hg_material *m = rig_material(rig);
        m->metallic = i == 0 ? 1.0f : 0.0f;
        m->roughness = i == 0 ? 0.3f : 0.5f;
        for (int c = 0; c < 3; c++)
            m->base_color[c] = i == 0 ? 0.9f : blue[c];
        rig_sphere(rig, m, at[i], 0.3f, 48);
    }
    hg_scene_publish(rig->scene);
}

static struct hg_view *open_room(struct rig *rig, const struct hg_view_params *params)
{
    const struct hg_view_camera camera = {.eye = {0, 0, 3.6f}, .vfov_rad = 0.6f};
    struct hg_view *view = path_rig_view(rig, params);
    path_rig_set_camera(view, &camera);
    return view;
}

static struct hg_view_params params_of(
    uint32_t samples, uint32_t seed, enum hg_view_denoise denoise)
{
    return (struct hg_view_params){.width = WIDTH,
        .height = HEIGHT,
        .mode = HG_MODE_PATH,
        .background = HG_BACKGROUND_NONE,
        .filter = HG_FILTER_BOX,
        .samples = samples,
        .seed = seed,
        .denoise = denoise};
}

static struct hg_refbuf *pixels_of(struct hg_view *view)
{
    struct hg_error err = {0};
    struct hg_refbuf *out;
    test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA32F, &out, &err), &err);
    return out;
}

static struct hg_refbuf *picture(
    struct rig *rig, uint32_t samples, uint32_t seed, enum hg_view_denoise denoise)
{
    const struct hg_view_params params = params_of(samples, seed, denoise);
    struct hg_view *view = open_room(rig, &params);
    path_rig_settle(view);
    struct hg_refbuf *out = pixels_of(view);
    hg_view_destroy(view);
    return out;
}

static const float *floats(const struct hg_refbuf *buf)
{
    return (const float *)(const void *)buf->data;
}

// What a display shows of it, about.
static double shown(float x)
{
    return pow((double)x / (1.0 + (double)x), 1.0 / 2.2);
}

static double psnr(const struct hg_refbuf *a, struct hg_refbuf *const truth[2])
{
    double sum = 0.0;
    for (size_t i = 0; i < PIXELS * 4; i++) {
        const double x = shown(floats(a)[i]);
        sum +=
            i % 4 == 3 ? 0.0 : (x - shown(floats(truth[0])[i])) * (x - shown(floats(truth[1])[i]));
    }
    return -10.0 * log10(sum / (PIXELS * 3));
}

static double mean(const struct hg_refbuf *a)
{
    double sum = 0.0;
    for (size_t i = 0; i < PIXELS * 4; i++)
        sum += i % 4 == 3 ? 0.0 : (double)floats(a)[i];
    return sum / (PIXELS * 3);
}

// --- tests ---------------------------------------------------------------------------------------

static void test_gain(void **state)
{
    struct rig *rig = *state;
    static const struct {
        uint32_t samples;
        double gain_db, energy;
    } cases[] = {{1, 6.6, 0.005}, {4, 8.2, 0.005}, {16, 7.7, 0.005}};
    room(rig);
    struct hg_refbuf *reference[2] = {
        picture(rig, REFERENCE, 99, HG_DENOISE_OFF), picture(rig, REFERENCE, 98, HG_DENOISE_OFF)};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct hg_refbuf *raw = picture(rig, cases[i].samples, 1, HG_DENOISE_OFF);
        struct hg_refbuf *clean = picture(rig, cases[i].samples, 1, HG_DENOISE_STILL);
        const double before = psnr(raw, reference), after = psnr(clean, reference);
        const double energy = mean(clean) / mean(raw) - 1.0;
        print_message("%u samples: %.1f dB, denoised %.1f dB; energy %+.2f %%\n", cases[i].samples,
            before, after, 100.0 * energy);
        assert_true(after - before > cases[i].gain_db);
        assert_true(fabs(energy) < cases[i].energy);
        hg_refbuf_unref(raw);
        hg_refbuf_unref(clean);
    }
    hg_refbuf_unref(reference[0]);
    hg_refbuf_unref(reference[1]);
}

// Planes, alpha, and pixels that see only emitters.
static void test_untouched(void **state)
{
    struct rig *rig = *state;
    struct hg_error err = {0};
    struct hg_refbuf *planes[2][3], *noisy, *pixels[2];
    static const enum hg_plane which[3] = {HG_PLANE_COLOR, HG_PLANE_DEPTH, HG_PLANE_EMISSION};
    room(rig);
    for (int i = 0; i < 2; i++) {
        struct hg_view_params params = params_of(8, 3, i == 0 ? HG_DENOISE_OFF : HG_DENOISE_STILL);
        params.planes = 1u << HG_PLANE_DEPTH | 1u << HG_PLANE_EMISSION;
        struct hg_view *view = open_room(rig, &params);
        path_rig_settle(view);
        for (int k = 0; k < 3; k++)
            test_ok(hg_view_read_plane(view, which[k], &planes[i][k], &err), &err);
        pixels[i] = pixels_of(view);
        if (i == 1)
            test_ok(hg_view_read_plane(view, HG_PLANE_NOISY, &noisy, &err), &err);
        hg_view_destroy(view);
    }
    for (int k = 0; k < 3; k++)
        assert_memory_equal(planes[0][k]->data, planes[1][k]->data, planes[0][k]->size);
    uint32_t shining = 0;
    for (size_t i = 0; i < PIXELS; i++) {
        const float *color = floats(planes[0][0]) + 4 * i, *emission = floats(planes[0][2]) + 3 * i;
        const float *raw = floats(pixels[0]) + 4 * i, *clean = floats(pixels[1]) + 4 * i;
        assert_memory_equal(floats(noisy) + 3 * i, color, 3 * sizeof(float));
        assert_true(raw[3] == clean[3]);
        if (!(emission[0] > 11.99f))
            continue;
        shining++;
        assert_true(fabsf(clean[0] / raw[0] - 1.0f) < 0.05f);
    }
    assert_true(shining > 50);
    for (int i = 0; i < 6; i++)
        hg_refbuf_unref(planes[i / 3][i % 3]);
    hg_refbuf_unref(pixels[0]);
    hg_refbuf_unref(pixels[1]);
    hg_refbuf_unref(noisy);
}

// --- edges before a background -------------------------------------------------------------------

// Bars of one to three pixels, at all angles, in the light of a white surrounding.
static void fan(struct rig *rig)
{
    enum { BARS = 9 };
    rig_scene(rig);
    path_rig_environment(rig, 1.0f);
    for (int i = 0; i < BARS; i++) {
        const float angle = (float)M_PI * ((float)i + 0.3f) / BARS,
                    half = 0.006f + 0.003f * (float)i;
        const float x = cosf(angle), y = sinf(angle), from = 0.25f;
        const float at[4][3] = {{from * x + half * y, from * y - half * x - 0.5f, 0},
            {x + half * y, y - half * x - 0.5f, 0}, {x - half * y, y + half * x - 0.5f, 0},
            {from * x - half * y, from * y + half * x - 0.5f, 0}};
        rig_quad(rig, path_rig_lambert(rig, i % 2 == 0 ? 0.8f : 0.2f), at);
    }
    hg_scene_publish(rig->scene);
}

static struct hg_refbuf *fan_picture(
    struct rig *rig, uint32_t samples, uint32_t seed, enum hg_view_denoise denoise)
{
    struct hg_view_params params = params_of(samples, seed, denoise);
    params.filter = HG_FILTER_BLACKMAN_HARRIS;
    struct hg_view *view = open_room(rig, &params);
    path_rig_settle(view);
    struct hg_refbuf *out = pixels_of(view);
    hg_view_destroy(view);
    return out;
}

// Before black.
static float composed(const struct hg_refbuf *a, size_t i)
{
    return floats(a)[i] * floats(a)[i | 3];
}

// Where a pixel is covered in part: root of the mean squared difference, as shown.
static double edge_error(const struct hg_refbuf *a, const struct hg_refbuf *truth)
{
    double sum = 0.0, count = 0.0;
    for (size_t i = 0; i < PIXELS * 4; i++) {
        const float part = floats(truth)[i | 3];
        if (i % 4 == 3 || part < 0.02f || part > 0.98f)
            continue;
        sum += pow(shown(composed(a, i)) - shown(composed(truth, i)), 2.0);
        count++;
    }
    assert_true(count > 1000);
    return sqrt(sum / count);
}

// What is covered, and how much, is known as well as where nothing is denoised.
static void test_fringes(void **state)
{
    struct rig *rig = *state;
    static const uint32_t samples[] = {1, 4, 8};
    fan(rig);
    struct hg_refbuf *truth = fan_picture(rig, 128, 99, HG_DENOISE_OFF);
    for (size_t i = 0; i < sizeof samples / sizeof *samples; i++) {
        struct hg_refbuf *raw = fan_picture(rig, samples[i], 1, HG_DENOISE_OFF);
        struct hg_refbuf *clean = fan_picture(rig, samples[i], 1, HG_DENOISE_STILL);
        const double before = edge_error(raw, truth), after = edge_error(clean, truth);
        print_message("%u samples: edges off by %.4f, denoised %.4f\n", samples[i], before, after);
        for (size_t k = 3; k < PIXELS * 4; k += 4)
            assert_true(floats(raw)[k] == floats(clean)[k]);
        assert_true(after < 1.02 * before);
        hg_refbuf_unref(raw);
        hg_refbuf_unref(clean);
    }
    hg_refbuf_unref(truth);
}

// --- animations ----------------------------------------------------------------------------------

// Frames of one view, each with another seed. Without a history each stands by itself: the first
// and the last two will do.
static struct hg_refbuf **animation(struct rig *rig, int frames, enum hg_view_denoise denoise)
{
    struct hg_error err = {0};
    struct hg_refbuf **all = calloc((size_t)frames, sizeof *all);
    struct hg_view_params params = params_of(4, 0, denoise);
    params.filter = HG_FILTER_BLACKMAN_HARRIS; // wide: edges are noisy
    struct hg_view *view = open_room(rig, &params);
    assert_non_null(all);
    for (int i = 0; i < frames; i++) {
        if (denoise != HG_DENOISE_ANIMATION && i > 0 && i < frames - 2)
            continue;
        params.seed = (uint32_t)i;
        test_ok(hg_view_set_params(view, &params, &err), &err);
        path_rig_settle(view);
        all[i] = pixels_of(view);
    }
    hg_view_destroy(view);
    return all;
}

// Root of the mean squared difference of the last two, below the lamp and inside of what is seen:
// edges of emitters and of alpha stay as they are.
static double last_change(struct hg_refbuf **frames, int count)
{
    const float *a = floats(frames[count - 2]), *b = floats(frames[count - 1]);
    double sum = 0.0;
    uint32_t values = 0;
    for (size_t i = (size_t)WIDTH * (HEIGHT / 4) * 4; i < PIXELS * 4; i++) {
        if (i % 4 == 3 || a[i | 3] < 1.0f || b[i | 3] < 1.0f)
            continue;
        sum += pow(shown(a[i]) - shown(b[i]), 2.0);
        values++;
    }
    assert_true(values > PIXELS);
    return sqrt(sum / values);
}

static void drop(struct hg_refbuf **frames, int count)
{
    for (int i = 0; i < count; i++)
        hg_refbuf_unref(frames[i]);
    free(frames);
}

static void test_flicker(void **state)
{
    struct rig *rig = *state;
    enum { FRAMES = 8, AGAIN = 4 };
    room(rig);
    struct hg_refbuf **raw = animation(rig, FRAMES, HG_DENOISE_OFF);
    struct hg_refbuf **still = animation(rig, FRAMES, HG_DENOISE_STILL);
    struct hg_refbuf **smooth = animation(rig, FRAMES, HG_DENOISE_ANIMATION);
    struct hg_refbuf **again = animation(rig, AGAIN, HG_DENOISE_ANIMATION);
    const double changes[3] = {
        last_change(raw, FRAMES), last_change(still, FRAMES), last_change(smooth, FRAMES)};
    print_message("from frame to frame: raw %.4f, each by itself %.4f, with history %.4f\n",
        changes[0], changes[1], changes[2]);
    assert_true(changes[1] < 0.4 * changes[0]);
    assert_true(changes[2] < 0.35 * changes[1]);
    for (size_t i = 0; i < PIXELS * 4; i++) // the first one has nothing before it
        assert_true(fabsf(floats(still[0])[i] - floats(smooth[0])[i]) <=
                    1e-5f * floats(still[0])[i] + 1e-7f);
    for (int i = 0; i < AGAIN; i++)
        assert_memory_equal(smooth[i]->data, again[i]->data, smooth[i]->size);
    drop(raw, FRAMES);
    drop(still, FRAMES);
    drop(smooth, FRAMES);
    drop(again, AGAIN);
}

// --- what moves ----------------------------------------------------------------------------------

enum { MOVING = 6, OTHER_SEEDS = 1000, MOVING_REFERENCE = 64 }; // frames

#define FRAME_S 0.1

// A box slides along before the wall, its lit front parallel to it.
static void slide(struct rig *rig)
{
    static const float front[4][3] = {
        {-0.3f, -0.5f, -0.6f}, {0.3f, -0.5f, -0.6f}, {0.3f, 0.4f, -0.6f}, {-0.3f, 0.4f, -0.6f}};
    static const float keys[2][3] = {{-0.5f, 0, 0}, {0.7f, 0, 0}};
    static const float white[3] = {0.7f, 0.65f, 0.5f};
    room(rig);
    quad(rig, white, 0.0f, front);
    const struct hg_object_list *nodes = &rig->scene->objects[HG_OBJECT_NODE];
    path_rig_animate(
        rig, (struct hg_node *)nodes->items[nodes->count - 1], HG_ANIM_TRANSLATION, 2, keys[0]);
}

static struct hg_view_params params_moving(uint32_t samples, enum hg_view_denoise denoise)
{
    struct hg_view_params params = params_of(samples, 0, denoise);
    params.frame_s = 1.0f;
    params.series_s = (float)FRAME_S;
    params.planes = 1u << HG_PLANE_OBJECT;
    return params;
}

// The last two frames, and what each pixel of the last one showed.
struct moving {
    struct hg_refbuf *frames[2], *objects[2];
};

static struct moving play(
    struct rig *rig, uint32_t samples, uint32_t seed, enum hg_view_denoise denoise)
{
    struct hg_error err = {0};
    struct moving out;
    struct hg_view_params params = params_moving(samples, denoise);
    path_rig_pose(rig, 0);
    struct hg_view *view = open_room(rig, &params);
    const int first = denoise == HG_DENOISE_ANIMATION ? 0 : MOVING - 2;
    for (int i = first; i < MOVING; i++) {
        params.seed = seed + (uint32_t)i;
        path_rig_pose(rig, 0.2 + i * FRAME_S);
        hg_scene_publish(rig->scene);
        test_ok(hg_view_set_params(view, &params, &err), &err);
        path_rig_settle(view);
        if (i < MOVING - 2)
            continue;
        out.frames[i - MOVING + 2] = pixels_of(view);
        out.objects[i - MOVING + 2] = path_rig_plane(view, HG_PLANE_OBJECT);
    }
    hg_view_destroy(view);
    return out;
}

static void drop_moving(struct moving *m)
{
    for (int i = 0; i < 2; i++) {
        hg_refbuf_unref(m->frames[i]);
        hg_refbuf_unref(m->objects[i]);
    }
}

// Other things are seen than before, within 2 px.
static bool is_edge(const struct moving *m, size_t at)
{
    const float *a = floats(m->objects[0]), *b = floats(m->objects[1]);
    const int x = (int)(at % WIDTH), y = (int)(at / WIDTH);
    for (int j = y > 2 ? y - 2 : 0; j <= y + 2 && j < HEIGHT; j++) {
        for (int i = x > 2 ? x - 2 : 0; i <= x + 2 && i < WIDTH; i++) {
            if (a[j * WIDTH + i] != b[j * WIDTH + i])
                return true;
        }
    }
    return false;
}

struct score {
    double error, edges, flicker; // roots of mean squares, as shown
};

static double off_by(const struct moving *m, const struct moving *truth, int frame, size_t i)
{
    return shown(floats(m->frames[frame])[i]) - shown(floats(truth->frames[frame])[i]);
}

// flicker: how differently both frames are off.
static struct score score(const struct moving *m, const struct moving truth[2])
{
    struct score out = {0};
    double all = 0.0, edges = 0.0;
    for (size_t i = 0; i < (size_t)PIXELS * 4; i++) {
        if (i % 4 == 3)
            continue;
        const double off[2] = {off_by(m, &truth[0], 1, i), off_by(m, &truth[1], 1, i)};
        const double was[2] = {off_by(m, &truth[0], 0, i), off_by(m, &truth[1], 0, i)};
        const double edge = is_edge(truth, i / 4) ? 1.0 : 0.0;
        out.error += off[0] * off[1];
        out.flicker += (off[0] - was[0]) * (off[1] - was[1]);
        out.edges += edge * off[0] * off[1];
        edges += edge;
        all += 1.0;
    }
    assert_true(edges > 500.0);
    out.error = sqrt(out.error / all);
    out.flicker = sqrt(out.flicker / all);
    out.edges = sqrt(out.edges / edges);
    return out;
}

static void test_moving(void **state)
{
    struct rig *rig = *state;
    slide(rig);
    struct moving truth[2] = {play(rig, MOVING_REFERENCE, OTHER_SEEDS, HG_DENOISE_OFF),
        play(rig, MOVING_REFERENCE, 2 * OTHER_SEEDS, HG_DENOISE_OFF)};
    struct moving still = play(rig, 4, 0, HG_DENOISE_STILL);
    struct moving series = play(rig, 4, 0, HG_DENOISE_ANIMATION);
    const struct score a = score(&still, truth), b = score(&series, truth);
    print_message(
        "moving: error %.4f, %.4f with history; at edges %.4f, %.4f; flicker %.4f, %.4f\n", a.error,
        b.error, a.edges, b.edges, a.flicker, b.flicker);
    assert_true(b.error < 0.92 * a.error);
    assert_true(b.edges < 1.02 * a.edges);
    assert_true(b.flicker < 0.75 * a.flicker);
    drop_moving(&truth[0]);
    drop_moving(&truth[1]);
    drop_moving(&still);
    drop_moving(&series);
}

// While samples come in the view shows something, and the last picture is that of a view that was
// only looked at when it was done.
static void test_preview(void **state)
{
    struct rig *rig = *state;
    struct hg_error err = {0};
    struct hg_frame_info info = {0};
    room(rig);
    const struct hg_view_params params = params_of(12, 5, HG_DENOISE_STILL);
    struct hg_view *view = open_room(rig, &params);
    hg_view_set_final(view, false);
    for (int i = 0; i < 100000 && !info.settled; i++) {
        test_ok(hg_view_step(view, 1, &info, &err), &err);
        struct hg_view_report stepped, read;
        hg_view_get_report(view, &stepped);
        hg_refbuf_unref(pixels_of(view));
        hg_view_get_report(view, &read);
        assert_memory_equal(
            &stepped.path, &read.path, sizeof read.path); // it shows what a step made
        assert_true(info.samples == 0 || read.path.denoise_ns > 0);
    }
    struct hg_refbuf *seen = pixels_of(view), *unseen = picture(rig, 12, 5, HG_DENOISE_STILL);
    assert_memory_equal(seen->data, unseen->data, seen->size);
    hg_refbuf_unref(seen);
    hg_refbuf_unref(unseen);
    hg_view_destroy(view);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_gain),
        cmocka_unit_test(test_untouched),
        cmocka_unit_test(test_fringes),
        cmocka_unit_test(test_flicker),
        cmocka_unit_test(test_moving),
        cmocka_unit_test(test_preview),
    };
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
