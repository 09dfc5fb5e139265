// path_denoise_mirror.c - denoised pictures of what is seen in mirrors and through glass, against
// ones of many samples: a textured room in a flat mirror, in a sphere, through a pane and a ball of
// glass, and in a polished floor that has a texture of its own.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/alloc.h"
#include "tests/analytic/path_rig.h"

// References are two pictures of independent samples: the mean of (x - a) (x - b) over pixels is
// the mean square of x - truth, without the noise of a and b, which many samples alone would make
// small.
enum { WIDTH = 120, HEIGHT = 80, PIXELS = WIDTH * HEIGHT, REFERENCE = 64 };

enum region { FLAT, CHROME, PANE, BALL, FLOOR, REST, REGIONS };

static const char *const names[REGIONS] = {"mirror", "sphere", "pane", "ball", "floor", "rest"};

struct gallery {
    struct rig *rig;
    float id[REGIONS]; // in HG_PLANE_OBJECT
    bool slides;       // a board that moves is there
};

static uint32_t hash(uint32_t x)
{
    x ^= x >> 16;
    x *= 0x7feb352du;
    x ^= x >> 15;
    x *= 0x846ca68bu;
    return x ^ (x >> 16);
}

// Fields of columns x rows in colours of their own, from a corner along u and v.
static struct hg_node *fields(struct rig *rig, struct hg_material *m, const float corners[4][3],
    uint32_t columns, uint32_t rows)
{
    const uint32_t count = columns * rows;
    float *positions = hg_calloc(count * 4, 3 * sizeof(float));
    float *normals = hg_calloc(count * 4, 3 * sizeof(float));
    float *colors = hg_calloc(count * 4, 4 * sizeof(float));
    uint32_t *index = hg_calloc(count * 6, sizeof *index);
    float u[3], v[3], n[3];
    assert_true(positions && normals && colors && index);
    for (int a = 0; a < 3; a++) {
        u[a] = corners[1][a] - corners[0][a];
        v[a] = corners[3][a] - corners[0][a];
    }
    for (int a = 0; a < 3; a++)
        n[a] = u[(a + 1) % 3] * v[(a + 2) % 3] - u[(a + 2) % 3] * v[(a + 1) % 3];
    const float l = sqrtf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (uint32_t i = 0; i < count * 4; i++) {
        const uint32_t field = i / 4, k = i % 4;
        const float s = (float)(field % columns + (k == 1 || k == 2)) / (float)columns;
        const float t = (float)(field / columns + (k >= 2)) / (float)rows;
        for (uint32_t a = 0; a < 3; a++) {
            positions[i * 3 + a] = corners[0][a] + s * u[a] + t * v[a];
            normals[i * 3 + a] = n[a] / l;
            colors[i * 4 + a] = 0.1f + 0.8f * (float)(hash(field * 3 + a) >> 8) / 16777216.0f;
        }
        colors[i * 4 + 3] = 1.0f;
    }
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t quad[6] = {0, 1, 2, 0, 2, 3};
        for (uint32_t k = 0; k < 6; k++)
            index[i * 6 + k] = i * 4 + quad[k];
    }
    const struct rig_vertices vertices = {count * 4, positions, normals};
    struct hg_node *node = rig_mesh(rig, m, &vertices, count * 6, index);
    node->mesh->parts[0].colors = colors;
    hg_free(positions);
    hg_free(normals);
    hg_free(index);
    return node;
}

static float id_of(const struct hg_node *node)
{
    return (float)(node->head.id + 1);
}

static struct hg_material *matte(struct rig *rig, float r, float g, float b)
{
    struct hg_material *m = rig_material(rig);
    m->base_color[0] = r;
    m->base_color[1] = g;
    m->base_color[2] = b;
    m->double_sided = true;
    return m;
}

static struct hg_material *glass(struct rig *rig, float thickness)
{
    struct hg_material *m = rig_material(rig);
    m->roughness = 0.0f;
    m->transmission = 1.0f;
    m->volume.thickness = thickness;
    m->double_sided = true;
    return m;
}

static struct hg_material *chrome(struct rig *rig)
{
    struct hg_material *m = rig_material(rig);
    m->roughness = 0.0f;
    m->metallic = 1.0f;
    m->base_color[0] = m->base_color[1] = m->base_color[2] = 0.9f;
    return m;
}

static void walls(struct gallery *g)
{
    static const float behind[4][3] = {{2, -1.2f, 3}, {-2, -1.2f, 3}, {-2, 1.2f, 3}, {2, 1.2f, 3}};
    static const float far[4][3] = {{-2, -1.2f, -2}, {2, -1.2f, -2}, {2, 1.2f, -2}, {-2, 1.2f, -2}};
    static const float left[4][3] = {
        {-2, -1.2f, 3}, {-2, -1.2f, -2}, {-2, 1.2f, -2}, {-2, 1.2f, 3}};
    static const float right[4][3] = {{2, -1.2f, -2}, {2, -1.2f, 3}, {2, 1.2f, 3}, {2, 1.2f, -2}};
    static const float top[4][3] = {{-2, 1.2f, -2}, {2, 1.2f, -2}, {2, 1.2f, 3}, {-2, 1.2f, 3}};
    static const float floor[4][3] = {
        {-2, -1.2f, 3}, {2, -1.2f, 3}, {2, -1.2f, -2}, {-2, -1.2f, -2}};
    static const float lamp[4][3] = {
        {-1.5f, 1.19f, -1}, {1.5f, 1.19f, -1}, {1.5f, 1.19f, 2}, {-1.5f, 1.19f, 2}};
    struct rig *rig = g->rig;
    fields(rig, matte(rig, 1, 1, 1), behind, 24, 14);
    fields(rig, matte(rig, 1, 1, 1), far, 24, 14);
    rig_quad(rig, matte(rig, 0.6f, 0.2f, 0.2f), left);
    rig_quad(rig, matte(rig, 0.2f, 0.5f, 0.2f), right);
    rig_quad(rig, matte(rig, 0.7f, 0.7f, 0.7f), top);
    struct hg_material *polished = matte(rig, 0.8f, 0.8f, 0.8f);
    polished->roughness = 0.0f;
    g->id[FLOOR] = id_of(fields(rig, polished, floor, 12, 15));
    struct hg_material *light = rig_material(rig);
    light->emissive[0] = light->emissive[1] = light->emissive[2] = 2.0f;
    rig_quad(rig, light, lamp);
}

static void gallery(struct gallery *g, struct rig *rig)
{
    static const float mirror[4][3] = {
        {-1.7f, -0.9f, -1.8f}, {-0.3f, -0.9f, -1.9f}, {-0.3f, 0.9f, -1.9f}, {-1.7f, 0.9f, -1.8f}};
    static const float pane[4][3] = {
        {0.5f, -0.5f, -1}, {1.5f, -0.5f, -1.2f}, {1.5f, 0.9f, -1.2f}, {0.5f, 0.9f, -1}};
    static const float chromed[3] = {0, -0.75f, -0.7f}, ball[3] = {1.1f, -0.8f, -0.6f};
    *g = (struct gallery){.rig = rig, .id = {[REST] = -1.0f}};
    rig_scene(rig);
    rig->scene->environment.kind = HG_ENV_NONE;
    walls(g);
    g->id[FLAT] = id_of(rig_quad(rig, chrome(rig), mirror));
    g->id[CHROME] = id_of(rig_sphere(rig, chrome(rig), chromed, 0.45f, 48));
    g->id[PANE] = id_of(rig_quad(rig, glass(rig, 0.0f), pane));
    g->id[BALL] = id_of(rig_sphere(rig, glass(rig, 0.5f), ball, 0.4f, 48));
}

static const float *floats(const struct hg_refbuf *buf)
{
    return (const float *)(const void *)buf->data;
}

static double shown(float x)
{
    return pow((double)x / (1.0 + (double)x), 1.0 / 2.2);
}

struct picture {
    struct hg_refbuf *pixels, *objects;
};

static void drop(struct picture *p)
{
    hg_refbuf_unref(p->pixels);
    hg_refbuf_unref(p->objects);
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
        .max_bounces = 8,
        .planes = 1u << HG_PLANE_OBJECT,
        .denoise = denoise};
}

static void look(struct hg_view *view, float x)
{
    const struct hg_view_camera camera = {
        .eye = {x, 0.1f, 2.4f}, .target = {x * 0.5f, -0.15f, -1}, .vfov_rad = 0.75f};
    path_rig_set_camera(view, &camera);
}

static struct picture take(struct hg_view *view)
{
    struct hg_error err = {0};
    struct picture out;
    path_rig_settle(view);
    test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA32F, &out.pixels, &err), &err);
    out.objects = path_rig_plane(view, HG_PLANE_OBJECT);
    return out;
}

static struct picture picture(
    struct gallery *g, uint32_t samples, uint32_t seed, enum hg_view_denoise denoise)
{
    const struct hg_view_params params = params_of(samples, seed, denoise);
    struct hg_view *view = path_rig_view(g->rig, &params);
    look(view, 0.1f);
    struct picture out = take(view);
    hg_view_destroy(view);
    return out;
}

static enum region region_of(const struct gallery *g, float id)
{
    int r = 0;
    while (r < REST && g->id[r] != id)
        r++;
    return (enum region)r;
}

// dB by region.
static void psnr(const struct gallery *g, const struct picture *a, const struct picture truth[2],
    double out[REGIONS])
{
    double sum[REGIONS] = {0}, count[REGIONS] = {0};
    for (size_t i = 0; i < PIXELS; i++) {
        const enum region r = region_of(g, floats(truth->objects)[i]);
        for (size_t c = 4 * i; c < 4 * i + 3; c++) {
            const double x = shown(floats(a->pixels)[c]);
            sum[r] +=
                (x - shown(floats(truth[0].pixels)[c])) * (x - shown(floats(truth[1].pixels)[c]));
            count[r] += 1.0;
        }
    }
    for (int r = 0; r < REGIONS; r++) {
        assert_true(count[r] > 200.0);
        out[r] = -10.0 * log10(sum[r] / count[r]);
    }
}

// least: dB of what comes out. Those that are not named are about as they were without features of
// what is seen in them.
static void test_gain(void **state)
{
    static const struct {
        uint32_t samples;
        double least[REGIONS];
    } cases[] = {
        {1, {[FLAT] = 22.5, [CHROME] = 21.8, [PANE] = 25.5}},
        {4, {[FLAT] = 30.5, [CHROME] = 26.7, [PANE] = 30.7, [BALL] = 26.6, [FLOOR] = 30.3}},
        {16, {[FLAT] = 35.0, [CHROME] = 31.6, [PANE] = 36.2, [BALL] = 29.8, [FLOOR] = 34.4}},
    };
    struct gallery g;
    gallery(&g, *state);
    struct picture truth[2] = {
        picture(&g, REFERENCE, 99, HG_DENOISE_OFF), picture(&g, REFERENCE, 98, HG_DENOISE_OFF)};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const uint32_t samples = cases[i].samples;
        struct picture raw = picture(&g, samples, 1, HG_DENOISE_OFF);
        struct picture clean = picture(&g, samples, 1, HG_DENOISE_STILL);
        double before[REGIONS], after[REGIONS];
        psnr(&g, &raw, truth, before);
        psnr(&g, &clean, truth, after);
        for (int r = 0; r < REGIONS; r++) {
            print_message("%2u samples, %-6s: %.2f dB, denoised %.2f dB\n", samples, names[r],
                before[r], after[r]);
            assert_true(after[r] > before[r] && after[r] > cases[i].least[r]);
        }
        drop(&raw);
        drop(&clean);
    }
    drop(&truth[0]);
    drop(&truth[1]);
}

// --- animation -----------------------------------------------------------------------------------

enum { FRAMES = 6, OTHER_SEEDS = 1000, SERIES_REFERENCE = 28 };

#define FRAME_S 0.06

// A textured board behind the camera, which only mirrors show, slides along.
static void slide(struct gallery *g)
{
    static const float board[4][3] = {
        {-1.2f, -0.6f, 2.6f}, {-2, -0.6f, 2.6f}, {-2, 0.5f, 2.6f}, {-1.2f, 0.5f, 2.6f}};
    static const float keys[2][3] = {{0, 0, 0}, {2, 0, 0}};
    struct hg_node *node = fields(g->rig, matte(g->rig, 1, 1, 1), board, 7, 9);
    path_rig_animate(g->rig, node, HG_ANIM_TRANSLATION, 2, keys[0]);
    path_rig_pose(g->rig, 0.0);
    g->slides = true;
}

// The last two frames of a series in which the camera moves, or the board.
struct series {
    struct picture frames[2];
};

static struct series play(
    struct gallery *g, uint32_t samples, uint32_t seed, enum hg_view_denoise denoise)
{
    struct hg_error err = {0};
    struct series out;
    struct hg_view_params params = params_of(samples, 0, denoise);
    params.frame_s = 1.0f;
    params.series_s = (float)FRAME_S;
    struct hg_view *view = path_rig_view(g->rig, &params);
    for (int i = denoise == HG_DENOISE_ANIMATION ? 0 : FRAMES - 2; i < FRAMES; i++) {
        params.seed = seed + (uint32_t)i;
        if (g->slides)
            path_rig_pose(g->rig, 0.2 + i * FRAME_S);
        hg_scene_publish(g->rig->scene);
        test_ok(hg_view_set_params(view, &params, &err), &err);
        look(view, g->slides ? 0.0f : -0.2f + 0.04f * (float)i);
        struct picture p = take(view);
        if (i < FRAMES - 2)
            drop(&p);
        else
            out.frames[i - FRAMES + 2] = p;
    }
    hg_view_destroy(view);
    return out;
}

// Roots of mean squares by region, as estimated with two references, which is 0 where noise makes
// it less; flicker: how differently both frames are off.
struct score {
    double error[REGIONS], flicker[REGIONS];
};

static double off_by(const struct series *s, const struct series *truth, int frame, size_t i)
{
    return shown(floats(s->frames[frame].pixels)[i]) -
           shown(floats(truth->frames[frame].pixels)[i]);
}

static struct score score(
    const struct gallery *g, const struct series *s, const struct series truth[2])
{
    struct score out = {0};
    double count[REGIONS] = {0};
    for (size_t i = 0; i < (size_t)PIXELS * 4; i++) {
        if (i % 4 == 3)
            continue;
        const enum region r = region_of(g, floats(truth->frames[1].objects)[i / 4]);
        const double off[2] = {off_by(s, &truth[0], 1, i), off_by(s, &truth[1], 1, i)};
        const double was[2] = {off_by(s, &truth[0], 0, i), off_by(s, &truth[1], 0, i)};
        out.error[r] += off[0] * off[1];
        out.flicker[r] += (off[0] - was[0]) * (off[1] - was[1]);
        count[r] += 1.0;
    }
    for (int r = 0; r < REGIONS; r++) {
        out.error[r] = sqrt(fmax(out.error[r], 0) / count[r]);
        out.flicker[r] = sqrt(fmax(out.flicker[r], 0) / count[r]);
    }
    return out;
}

static void drop_series(struct series *s)
{
    drop(&s->frames[0]);
    drop(&s->frames[1]);
}

// With history nothing becomes worse, and the mirror better by as much.
static void check_series(struct gallery *g, double error, double flicker)
{
    struct series truth[2] = {play(g, SERIES_REFERENCE, OTHER_SEEDS, HG_DENOISE_OFF),
        play(g, SERIES_REFERENCE, 2 * OTHER_SEEDS, HG_DENOISE_OFF)};
    struct series still = play(g, 4, 0, HG_DENOISE_STILL);
    struct series series = play(g, 4, 0, HG_DENOISE_ANIMATION);
    const struct score a = score(g, &still, truth), b = score(g, &series, truth);
    for (int r = 0; r < REGIONS; r++) {
        print_message("%-6s: error %.4f, %.4f with history; flicker %.4f, %.4f\n", names[r],
            a.error[r], b.error[r], a.flicker[r], b.flicker[r]);
        assert_true(b.error[r] < a.error[r] && b.flicker[r] < 0.85 * a.flicker[r]);
    }
    assert_true(b.error[FLAT] < error * a.error[FLAT]);
    assert_true(b.flicker[FLAT] < flicker * a.flicker[FLAT]);
    drop_series(&truth[0]);
    drop_series(&truth[1]);
    drop_series(&still);
    drop_series(&series);
}

static void test_camera_moves(void **state)
{
    struct gallery g;
    gallery(&g, *state);
    check_series(&g, 0.92, 0.58);
}

static void test_mirrored_moves(void **state)
{
    struct gallery g;
    gallery(&g, *state);
    slide(&g);
    check_series(&g, 0.94, 0.65);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_gain),
        cmocka_unit_test(test_camera_moves),
        cmocka_unit_test(test_mirrored_moves),
    };
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
