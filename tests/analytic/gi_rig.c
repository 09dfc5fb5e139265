// gi_rig.c - see gi_rig.h.
#include "tests/analytic/gi_rig.h"

#include <math.h>
#include <string.h>

#include "renderer/internal.h"

// --- scenes --------------------------------------------------------------------------------------

struct hg_material *gi_grey(struct rig *rig, float albedo, float emission)
{
    struct hg_material *m = rig_material(rig);
    for (int c = 0; c < 3; c++) {
        m->base_color[c] = albedo;
        m->emissive[c] = emission;
    }
    return m;
}

void gi_room(struct rig *rig, struct hg_material *m, const float box[2][3])
{
    for (int i = 0; i < 6; i++)
        rig_face(rig, m, box, 1, i);
}

void gi_solid(struct rig *rig, struct hg_material *m, const float box[2][3])
{
    for (int i = 0; i < 6; i++)
        rig_face(rig, m, box, -1, i);
}

void gi_sky(struct rig *rig, float radiance)
{
    struct hg_environment *e = &rig->scene->environment;
    e->kind = HG_ENV_COLOR;
    e->intensity = 1;
    e->revision++;
    for (int c = 0; c < 3; c++)
        e->color[c] = radiance;
}

// --- pictures ------------------------------------------------------------------------------------

// A field of probes is of one revision of the scene, so one that is as it was is not published
// again.
static void publish_edits(struct hg_scene *scene)
{
    static const struct hg_scene *newest;
    static uint64_t environment; // its revision that was published
    bool edited = scene != newest || scene->environment.revision != environment;
    for (int kind = 0; kind < HG_OBJECT_KINDS; kind++)
        for (uint32_t i = 0; i < scene->objects[kind].count; i++)
            edited |= scene->objects[kind].items[i]->revision > scene->revision;
    if (edited)
        hg_scene_publish(scene);
    newest = scene;
    environment = scene->environment.revision;
}

struct hg_view *gi_open_view(struct rig *rig, const struct gi_shot *shot)
{
    struct hg_error err = {0};
    struct hg_view *view;
    const struct hg_view_params params = {.width = GI_WIDTH,
        .height = GI_HEIGHT,
        .tonemap = HG_TONEMAP_LINEAR,
        .background = HG_BACKGROUND_NONE,
        .samples = shot->samples,
        .mode = shot->mode,
        .gi = shot->gi,
        .filter = HG_FILTER_BOX};
    struct hg_view_camera camera = {.vfov_rad = 1.2f};
    memcpy(camera.eye, shot->eye, sizeof camera.eye);
    memcpy(camera.target, shot->target, sizeof camera.target);
    publish_edits(rig->scene);
    test_ok(hg_view_create(rig->renderer, rig->scene, &view, &err), &err);
    test_ok(hg_view_set_params(view, &params, &err), &err);
    test_ok(hg_view_set_camera(view, &camera, &err), &err);
    return view;
}

void gi_settle(struct hg_view *view, uint32_t samples)
{
    struct hg_error err = {0};
    struct hg_frame_info info = {0};
    for (int i = 0; i < 4000 && !info.settled; i++)
        test_ok(hg_view_step(view, samples, &info, &err), &err);
    assert_true(info.settled);
}

struct hg_view *gi_keep_field(struct rig *rig, const struct gi_shot *shot)
{
    struct hg_view *view = gi_open_view(rig, shot);
    hg_view_set_final(view, true); // the very first step is one of the settled field
    gi_settle(view, 8);
    return view;
}

struct hg_refbuf *gi_read_floats(struct hg_view *view)
{
    struct hg_error err = {0};
    struct hg_refbuf *pixels;
    test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA32F, &pixels, &err), &err);
    return pixels;
}

void gi_assert_same(struct hg_refbuf *a, struct hg_refbuf *b)
{
    assert_int_equal(a->size, b->size);
    assert_memory_equal(a->data, b->data, a->size);
    hg_refbuf_unref(a);
    hg_refbuf_unref(b);
}

struct hg_refbuf *gi_take(struct rig *rig, const struct gi_shot *shot)
{
    struct hg_view *view = gi_open_view(rig, shot);
    gi_settle(view, 8);
    struct hg_refbuf *pixels = gi_read_floats(view);
    hg_view_destroy(view);
    return pixels;
}

void gi_take_both(struct rig *rig, const struct gi_shot *shot, struct hg_refbuf *out[2])
{
    struct gi_shot rays = *shot;
    rays.gi = HG_GI_RAYS;
    struct hg_view *view = gi_keep_field(rig, shot);
    out[0] = gi_read_floats(view);
    out[1] = gi_take(rig, &rays);
    hg_view_destroy(view);
}

const char *const gi_ways[2] = {"probes", "rays"};

double gi_mean(const struct hg_refbuf *pixels, const int cells[4])
{
    const float *p = (const float *)(const void *)pixels->data;
    double sum = 0, count = 0;
    for (int y = cells[1] * GI_HEIGHT / 8; y < cells[3] * GI_HEIGHT / 8; y++)
        for (int x = cells[0] * GI_WIDTH / 8; x < cells[2] * GI_WIDTH / 8; x++, count++)
            sum += (double)p[(y * GI_WIDTH + x) * 4 + 1];
    return sum / count;
}

double gi_mean_of_bytes(const struct hg_refbuf *pixels, const int cells[4])
{
    double sum = 0, count = 0;
    for (int y = cells[1] * GI_HEIGHT / 8; y < cells[3] * GI_HEIGHT / 8; y++)
        for (int x = cells[0] * GI_WIDTH / 8; x < cells[2] * GI_WIDTH / 8; x++, count++) {
            const double v = pixels->data[(y * GI_WIDTH + x) * 4 + 1] / 255.0;
            sum += v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
        }
    return sum / count;
}

const int gi_all[4] = {0, 0, 8, 8};

void gi_compare(const char *name, const struct hg_refbuf *got, const struct hg_refbuf *path,
    int first, double limits[2])
{
    double worst = 0, sum_a = 0, sum_b = 0;
    for (int y = first; y < 8; y += 2)
        for (int x = 0; x < 8; x += 2) {
            const int cells[4] = {x, y, x + 2, y + 2};
            const double a = gi_mean(got, cells), b = gi_mean(path, cells);
            print_message("%s%.3f/%.3f", x ? " " : "\n  ", a, b);
            worst = fmax(worst, fabs(a - b) / b);
            sum_a += a;
            sum_b += b;
        }
    print_message("\n%s: worst square off by %.3f, all by %.3f\n", name, worst, sum_a / sum_b - 1);
    assert_true(worst <= limits[0]);
    assert_true(fabs(sum_a / sum_b - 1) <= limits[1]);
}
