// path_view.c - path-traced views as they are looked at: a preview in motion that settles at rest,
// a thin lens against its circle of confusion, one picture on all backends.
#include <math.h>
#include <string.h>

#include "renderer/pathtrace/path_state.h"
#include "renderer/internal.h"
#include "tests/analytic/path_rig.h"

enum { SIDE = 48 };

static const struct hg_view_params defaults = {.width = SIDE,
    .height = SIDE,
    .tonemap = HG_TONEMAP_LINEAR,
    .mode = HG_MODE_PATH,
    .filter = HG_FILTER_BOX,
    .samples = 32,
    .seed = 7};

static const float room_eye[3] = {0.5f, 1.2f, 3.5f}, room_target[3] = {0, 0.5f, 0};

static struct hg_frame_info step(struct hg_view *view)
{
    struct hg_error err = {0};
    struct hg_frame_info info;
    test_ok(hg_view_step(view, 1, &info, &err), &err);
    return info;
}

static struct hg_refbuf *pixels_of(struct hg_view *view)
{
    struct hg_error err = {0};
    struct hg_refbuf *out;
    test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA32F, &out, &err), &err);
    return out;
}

static double mean_of(const struct hg_refbuf *pixels)
{
    const float *at = (const float *)(const void *)pixels->data;
    double sum = 0;
    for (int i = 0; i < SIDE * SIDE; i++)
        sum += (double)at[i * 4 + 1];
    return sum / (SIDE * SIDE);
}

// Root of the mean square of what differs, over the mean of the first.
static double difference(const struct hg_refbuf *a, const struct hg_refbuf *b)
{
    const float *p = (const float *)(const void *)a->data;
    const float *q = (const float *)(const void *)b->data;
    double sum = 0;
    for (int i = 0; i < SIDE * SIDE; i++) {
        const double d = (double)p[i * 4 + 1] - (double)q[i * 4 + 1];
        sum += d * d;
    }
    return sqrt(sum / (SIDE * SIDE)) / mean_of(a);
}

static struct hg_refbuf *whole(struct rig *rig, const float eye[3])
{
    struct hg_view *view = path_rig_view(rig, &defaults);
    path_rig_look(view, eye, room_target, 0.8f);
    path_rig_settle(view);
    struct hg_refbuf *out = pixels_of(view);
    hg_view_destroy(view);
    return out;
}

// Steps of a view that is displayed: the first is a picture in real time, then samples come
// one by one, each picture nearer to the end; at last it is the one that a farm gets.
static void watch(struct hg_view *view, const struct hg_refbuf *end)
{
    struct hg_frame_info info = step(view);
    assert_int_equal(info.samples, 0);
    assert_false(info.settled);
    struct hg_refbuf *preview = pixels_of(view);
    assert_true(fabs(mean_of(preview) / mean_of(end) - 1.0) < 0.5);
    uint32_t seen = 0, pictures = 0;
    double first = 0, late = 0;
    while (!info.settled) {
        const uint64_t number = info.number;
        info = step(view);
        if (info.number == number || info.samples == seen)
            continue;
        assert_true(info.samples > seen);
        seen = info.samples;
        struct hg_refbuf *now = pixels_of(view);
        late = info.settled ? late : difference(end, now);
        first = pictures++ == 0 ? late : first;
        hg_refbuf_unref(now);
    }
    print_message("a view at rest: %u pictures, off by %.3f at first, by %.4f before the last\n",
        pictures, first, late);
    assert_int_equal(seen, defaults.samples);
    assert_true(pictures > 3 && late > 0 && late < 0.5 * first);
    struct hg_refbuf *last = pixels_of(view);
    assert_int_equal(last->size, end->size);
    assert_memory_equal(last->data, end->data, end->size);
    hg_refbuf_unref(last);
    hg_refbuf_unref(preview);
}

static void test_resting_view(void **state)
{
    struct rig *rig = *state;
    static const float elsewhere[3] = {-0.8f, 0.9f, 3.0f};
    path_rig_room(rig);
    struct hg_view *view = path_rig_view(rig, &defaults);
    hg_view_set_final(view, false);
    for (int i = 0; i < 2; i++) {
        const float *eye = i == 0 ? room_eye : elsewhere;
        struct hg_refbuf *end = whole(rig, eye);
        path_rig_look(view, eye, room_target, 0.8f);
        watch(view, end);
        hg_refbuf_unref(end);
    }
    hg_view_destroy(view);
}

// What the first step after a change shows is of the new state, also when no picture was read of
// the newest samples of the old one; planes come with samples only.
static void test_changes_unread(void **state)
{
    struct rig *rig = *state;
    static const float elsewhere[3] = {-0.8f, 0.9f, 3.0f};
    struct hg_view_params params = defaults;
    struct hg_error err = {0};
    struct hg_refbuf *none, *previews[2];
    path_rig_room(rig);
    params.planes = 1u << HG_PLANE_DEPTH;
    for (int i = 0; i < 2; i++) {
        params.width = SIDE;
        struct hg_view *view = path_rig_view(rig, &params);
        hg_view_set_final(view, false);
        if (i == 0) {
            path_rig_look(view, room_eye, room_target, 0.8f);
            while (step(view).samples < 9) // the noise is known from 8 on
                ;
            none = path_rig_plane(view, HG_PLANE_DEPTH);
            hg_refbuf_unref(none);
        }
        params.width = 2 * SIDE;
        test_ok(hg_view_set_params(view, &params, &err), &err);
        assert_int_equal(hg_view_read_plane(view, HG_PLANE_DEPTH, &none, &err), HG_E_STATE);
        path_rig_look(view, elsewhere, room_target, 0.8f);
        const struct hg_frame_info info = step(view);
        assert_int_equal(info.samples, 0);
        assert_true(info.noise == 0.0f && info.spent_ns == 0);
        previews[i] = pixels_of(view);
        assert_int_equal(hg_view_read_plane(view, HG_PLANE_DEPTH, &none, &err), HG_E_STATE);
        hg_view_destroy(view);
    }
    assert_int_equal(previews[0]->size, previews[1]->size);
    assert_memory_equal(previews[0]->data, previews[1]->data, previews[0]->size);
    hg_refbuf_unref(previews[0]);
    hg_refbuf_unref(previews[1]);
}

// A picture was begun for a request of a settled frame; then another request wants to see how far
// it is, before all pixels have a sample. What the view showed before is not in it.
static void test_looked_at_late(void **state)
{
    struct rig *rig = *state;
    static const float elsewhere[3] = {-0.8f, 0.9f, 3.0f};
    struct hg_error err = {0};
    struct hg_view_params params = defaults;
    path_rig_room(rig);
    struct hg_refbuf *end = whole(rig, elsewhere);
    struct hg_view *watched = path_rig_view(rig, &defaults);
    hg_view_set_final(watched, false);
    path_rig_look(watched, elsewhere, room_target, 0.8f);
    (void)step(watched);
    struct hg_refbuf *preview = pixels_of(watched);
    hg_view_destroy(watched);
    for (int before = 0; before < 3; before++) { // nothing, a path-traced picture, one in real time
        params.samples = before == 0 ? defaults.samples : 8;
        params.mode = before == 2 ? HG_MODE_REALTIME : HG_MODE_PATH;
        struct hg_view *view = path_rig_view(rig, &params);
        path_rig_look(view, room_eye, room_target, 0.8f);
        if (before > 0)
            path_rig_settle(view);
        path_rig_look(view, elsewhere, room_target, 0.8f);
        test_ok(hg_view_set_params(view, &defaults, &err), &err);
        rig->renderer->context.overrides.path_slice_ns = 1; // a piece of a wave
        (void)step(view);
        hg_view_set_final(view, false);
        assert_int_equal(step(view).samples, 0);
        rig->renderer->context.overrides.path_slice_ns = 0;
        struct hg_refbuf *now = pixels_of(view);
        assert_memory_equal(now->data, preview->data, preview->size);
        hg_refbuf_unref(now);
        path_rig_settle(view);
        now = pixels_of(view);
        assert_memory_equal(now->data, end->data, end->size);
        hg_refbuf_unref(now);
        hg_view_destroy(view);
    }
    hg_refbuf_unref(end);
    hg_refbuf_unref(preview);
}

// Exposure and tone curve are applied to what was followed, which is not followed again.
static void test_shown_otherwise(void **state)
{
    struct rig *rig = *state;
    struct hg_error err = {0};
    struct hg_view_params params = defaults;
    struct hg_frame_info info, before;
    struct hg_refbuf *pictures[2];
    path_rig_room(rig);
    params.samples = 64;
    for (int changes = 0; changes < 2; changes++) {
        params.exposure_ev = changes ? 0.0f : 1.5f;
        params.tonemap = changes ? HG_TONEMAP_LINEAR : HG_TONEMAP_AGX;
        struct hg_view *view = path_rig_view(rig, &params);
        path_rig_look(view, room_eye, room_target, 0.8f);
        hg_view_set_final(view, false);
        while ((info = step(view)).samples < 20)
            ;
        before = info;
        params.exposure_ev = 1.5f;
        params.tonemap = HG_TONEMAP_AGX;
        test_ok(hg_view_set_params(view, &params, &err), &err);
        rig->renderer->context.overrides.path_slice_ns = 1; // a piece of a wave: no new sample
        info = step(view);
        rig->renderer->context.overrides.path_slice_ns = 0;
        assert_true(info.samples >= before.samples);
        assert_true(info.number >= before.number + (uint64_t)changes);
        path_rig_settle(view);
        test_ok(hg_view_read_pixels(view, HG_PIXEL_RGBA8, &pictures[changes], &err), &err);
        hg_view_destroy(view);
    }
    assert_memory_equal(pictures[0]->data, pictures[1]->data, pictures[0]->size);
    hg_refbuf_unref(pictures[0]);
    hg_refbuf_unref(pictures[1]);
}

// Share of a disk of radius 1 on one side of a chord at t: t = 1 all of it, -1 nothing.
static double disk_share(double t)
{
    const double c = fmin(fmax(t, -1.0), 1.0);
    return 0.5 + (asin(c) + c * sqrt(1.0 - c * c)) / 3.14159265358979323846;
}

// An edge that shines, behind the plane in focus. A ray from the place u of the lens through the
// place x of that plane, at distance f, meets the edge's plane, at distance d, at u (1 - d / f) +
// x d / f: a pixel sees the share of the lens from which that lies on the bright side.
static void test_lens(void **state)
{
    struct rig *rig = *state;
    const float f = 2.0f, d = 5.0f, radius = 0.3f, vfov_rad = 0.8f;
    const float light[4][3] = {{0, -9, 0}, {9, -9, 0}, {9, 9, 0}, {0, 9, 0}};
    struct hg_error err = {0};
    rig_scene(rig);
    struct hg_material *m = path_rig_lambert(rig, 0.0f);
    m->emissive[0] = m->emissive[1] = m->emissive[2] = 1.0f;
    rig_quad(rig, m, light);
    struct hg_view_params params = defaults;
    params.samples = 256;
    struct hg_view *view = path_rig_view(rig, &params);
    const struct hg_view_camera camera = {.eye = {0, 0, d},
        .up = {0, 1, 0},
        .vfov_rad = vfov_rad,
        .lens_radius = radius,
        .focus_distance = f};
    test_ok(hg_view_set_camera(view, &camera, &err), &err);
    path_rig_settle(view);
    struct hg_refbuf *color = path_rig_plane(view, HG_PLANE_COLOR);
    const float *at = (const float *)(const void *)color->data;
    const double half = (double)f * tan(0.5 * (double)vfov_rad);
    double most = 0;
    int between = 0;
    for (int x = 0; x < SIDE; x++) {
        double seen = 0, expected = 0;
        for (int y = 0; y < SIDE; y++)
            seen += (double)at[(y * SIDE + x) * 4] / SIDE;
        for (int k = 0; k < 16; k++) { // over the width of a pixel
            const double place = half * (2.0 * (x + (k + 0.5) / 16) / SIDE - 1.0);
            const double t = place * (double)d / (double)f / ((double)radius * (double)(d / f - 1));
            expected += disk_share(t) / 16;
        }
        between += expected > 0.02 && expected < 0.98;
        most = fmax(most, fabs(seen - expected));
    }
    print_message("lens: %d columns out of focus, off by %.4f at most\n", between, most);
    assert_true(between > 6);
    assert_true(most < 0.005);
    hg_refbuf_unref(color);
    hg_view_destroy(view);
}

// Height of a filter of radius 1, as its name says.
static double filter_height(enum hg_filter filter, double x)
{
    const double a = 3.14159265358979323846 * x;
    switch (filter) {
    case HG_FILTER_BOX:
        return 1.0;
    case HG_FILTER_TENT:
        return 1.0 - fabs(x);
    case HG_FILTER_GAUSSIAN:
        return exp(-4.5 * x * x) - exp(-4.5);
    default:
        return 0.35875 + 0.48829 * cos(a) + 0.14128 * cos(2 * a) + 0.01168 * cos(3 * a);
    }
}

// Share of a filter that lies beyond t.
static double filter_share(enum hg_filter filter, double radius, double t)
{
    enum { STEPS = 4000 };
    double sum = 0, beyond = 0;
    for (int i = 0; i < STEPS; i++) {
        const double x = (i + 0.5) * 2 / STEPS - 1, h = filter_height(filter, x);
        sum += h;
        beyond += x * radius > t ? h : 0;
    }
    return beyond / sum;
}

// Half of a plane that shines from 0.3 px to the right of the middle on: each column of pixels sees
// the share of its filter beyond the edge. Filters that neighbours share samples of (their nine
// weights are made to add up to one, which changes Blackman-Harris by 0.004), and wider ones.
static void test_filters(void **state)
{
    struct rig *rig = *state;
    static const struct {
        enum hg_filter filter;
        float radius, expected;
    } rows[] = {{HG_FILTER_BLACKMAN_HARRIS, 0, 1.5f}, {HG_FILTER_BOX, 0, 0.5f},
        {HG_FILTER_TENT, 0, 1.0f}, {HG_FILTER_GAUSSIAN, 0, 1.5f}, {HG_FILTER_TENT, 2.5f, 2.5f},
        {HG_FILTER_GAUSSIAN, 5, 5}};
    const float edge_px = 0.3f, edge = edge_px * 2 / SIDE; // the picture is 2 wide
    const float light[4][3] = {{edge, -9, 0}, {9, -9, 0}, {9, 9, 0}, {edge, 9, 0}};
    rig_scene(rig);
    struct hg_material *m = path_rig_lambert(rig, 0.0f);
    m->emissive[0] = m->emissive[1] = m->emissive[2] = 1.0f;
    rig_quad(rig, m, light);
    enum { ROWS = 4 }; // all show the same
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct hg_view_params params = defaults;
        params.height = ROWS;
        params.samples = 1024; // all lie at one place in their pixels: steps
        params.filter = rows[i].filter;
        params.filter_radius_px = rows[i].radius;
        struct hg_view *view = path_rig_view(rig, &params);
        path_rig_set_camera(view, &(struct hg_view_camera){.eye = {0, 0, 5},
                                      .up = {0, 1, 0},
                                      .orthographic = true,
                                      .half_height = (float)ROWS / SIDE});
        path_rig_settle(view);
        struct hg_refbuf *color = path_rig_plane(view, HG_PLANE_COLOR);
        const float *at = (const float *)(const void *)color->data;
        double most = 0;
        for (int x = 0; x < SIDE; x++) {
            double seen = 0;
            for (int y = 0; y < ROWS; y++)
                seen += (double)at[(y * SIDE + x) * 4] / ROWS;
            const double beyond = (double)edge_px - (x + 0.5 - SIDE / 2);
            most = fmax(
                most, fabs(seen - filter_share(rows[i].filter, (double)rows[i].expected, beyond)));
        }
        print_message("filter %d of %.1f px: off by %.4f at most\n", (int)rows[i].filter,
            (double)rows[i].expected, most);
        assert_true(most < 0.005);
        hg_refbuf_unref(color);
        hg_view_destroy(view);
    }
}

// What light brought by way of other surfaces, of the brightest pixel and of all.
static void indirect_of(struct rig *rig, float clamp, double *most, double *sum, double *direct)
{
    struct hg_view_params params = defaults;
    params.samples = 1;
    params.max_bounces = 2;
    params.clamp_indirect = clamp;
    params.planes = 7u << HG_PLANE_INDIRECT_DIFFUSE | 7u << HG_PLANE_DIRECT_DIFFUSE;
    struct hg_view *view = path_rig_view(rig, &params);
    path_rig_look(view, room_eye, room_target, 0.8f);
    path_rig_settle(view);
    struct hg_refbuf *planes[6];
    *most = *sum = *direct = 0;
    for (int k = 0; k < 6; k++)
        planes[k] = path_rig_plane(view,
            (enum hg_plane)((k < 3 ? HG_PLANE_INDIRECT_DIFFUSE : HG_PLANE_DIRECT_DIFFUSE - 3) + k));
    for (int i = 0; i < SIDE * SIDE * 3; i++) {
        double brought = 0;
        for (int k = 0; k < 6; k++) {
            const double v = (double)((const float *)(const void *)planes[k]->data)[i];
            brought += k < 3 ? v : 0;
            *direct += k < 3 ? 0 : v;
        }
        *sum += brought;
        *most = fmax(*most, brought);
    }
    for (int k = 0; k < 6; k++)
        hg_refbuf_unref(planes[k]);
    hg_view_destroy(view);
}

// A sample of two bounces finds at most two lights by way of another surface: the one that it asks
// and the one that it runs into. Off, nothing is cut; what comes straight from lights never is.
static void test_clamp(void **state)
{
    struct rig *rig = *state;
    const float limit = 0.05f;
    double most[2], sum[2], direct[2];
    path_rig_room(rig);
    rig->renderer->context.overrides.path_branches = 1;
    for (int i = 0; i < 2; i++)
        indirect_of(rig, i ? limit : 0.0f, &most[i], &sum[i], &direct[i]);
    rig->renderer->context.overrides.path_branches = 0;
    print_message("indirect light: %.3f at most, %.3f with a limit of %.2f; %.4f of it is left\n",
        most[0], most[1], (double)limit, sum[1] / sum[0]);
    assert_true(most[0] > 6 * (double)limit);
    assert_true(most[1] <= 2.0001 * (double)limit);
    assert_true(sum[1] < 0.9 * sum[0] && sum[1] > 0);
    assert_true(direct[0] == direct[1]);
}

static struct hg_refbuf *room_traced(struct rig *rig, enum hg_view_trace trace)
{
    path_rig_room(rig);
    struct hg_view_params params = defaults;
    params.trace = trace;
    struct hg_view *view = path_rig_view(rig, &params);
    path_rig_look(view, room_eye, room_target, 0.8f);
    path_rig_settle(view);
    struct hg_refbuf *color = path_rig_plane(view, HG_PLANE_COLOR);
    hg_view_destroy(view);
    return color;
}

// A filter of 1.5 px reaches eight neighbours, whose samples count as well; a little more than that
// and each pixel has its own. The pictures are the same, with less than half of the squared error.
static void test_neighbours(void **state)
{
    struct rig *rig = *state;
    struct hg_refbuf *pictures[3];
    path_rig_room(rig);
    for (int i = 0; i < 3; i++) {
        struct hg_view_params params = defaults;
        params.filter = HG_FILTER_BLACKMAN_HARRIS;
        params.filter_radius_px = i == 1 ? 1.5f : 1.501f;
        params.samples = i == 2 ? 256 : 8;
        params.seed = 3 + (uint32_t)i;
        struct hg_view *view = path_rig_view(rig, &params);
        path_rig_look(view, room_eye, room_target, 0.8f);
        path_rig_settle(view);
        pictures[i] = pixels_of(view);
        hg_view_destroy(view);
    }
    const double alone = difference(pictures[2], pictures[0]);
    const double together = difference(pictures[2], pictures[1]);
    print_message("samples alone %.4f, with those of neighbours %.4f\n", alone, together);
    assert_true(together * together < 0.55 * alone * alone);
    assert_true(fabs(mean_of(pictures[1]) / mean_of(pictures[2]) - 1.0) < 0.01);
    for (int i = 0; i < 3; i++)
        hg_refbuf_unref(pictures[i]);
}

// All backends follow the same paths; rounding at edges makes a few others. Ray queries where the
// device has them.
static void compare_backends(struct rig *rig)
{
    struct hg_refbuf *first = room_traced(rig, HG_VIEW_TRACE_EMBREE);
    const float *a = (const float *)(const void *)first->data;
    const bool queries = hg_gpu_get_caps(rig->renderer->context.gpu)->ray_query;
    const int last = queries ? HG_VIEW_TRACE_KHR : HG_VIEW_TRACE_COMPUTE;
    for (int trace = HG_VIEW_TRACE_COMPUTE; trace <= last; trace++) {
        struct hg_refbuf *other = room_traced(rig, (enum hg_view_trace)trace);
        const float *b = (const float *)(const void *)other->data;
        int same = 0;
        for (int i = 0; i < SIDE * SIDE; i++)
            same += fabsf(a[i * 4] - b[i * 4]) <= 1e-3f * (1.0f + a[i * 4]);
        const double means = mean_of(other) / mean_of(first);
        print_message(
            "backend %d: mean %.5f, %d of %d px alike\n", trace, means, same, SIDE * SIDE);
        assert_true(fabs(means - 1.0) < 0.002);
        assert_true(same > SIDE * SIDE * 9 / 10);
        hg_refbuf_unref(other);
    }
    hg_refbuf_unref(first);
}

static void test_backends(void **state)
{
    struct rig *rig = *state;
    compare_backends(rig);
    rig->renderer->context.overrides.path_branches = 4;
    compare_backends(rig);
    rig->renderer->context.overrides.path_branches = 0;
}

static struct hg_refbuf *room_branched(
    struct rig *rig, uint32_t branches, uint32_t samples, uint32_t seed)
{
    struct hg_view_params params = defaults;
    params.samples = samples;
    params.seed = seed;
    rig->renderer->context.overrides.path_branches = branches;
    struct hg_view *view = path_rig_view(rig, &params);
    path_rig_look(view, room_eye, room_target, 0.8f);
    path_rig_settle(view);
    struct hg_refbuf *color = pixels_of(view);
    hg_view_destroy(view);
    rig->renderer->context.overrides.path_branches = 0;
    return color;
}

// Eight paths from what each camera ray meets in place of one: the same picture with less noise; at
// 48x48 px edges hold most of what is left.
static void test_branches(void **state)
{
    struct rig *rig = *state;
    path_rig_room(rig);
    struct hg_refbuf *one = room_branched(rig, 1, 8, 3), *eight = room_branched(rig, 8, 8, 4);
    struct hg_refbuf *many = room_branched(rig, 1, 256, 5);
    const double alone = difference(many, one), together = difference(many, eight);
    print_message("one path %.4f, eight %.4f\n", alone, together);
    assert_true(together * together < 0.45 * alone * alone);
    assert_true(fabs(mean_of(eight) / mean_of(many) - 1.0) < 0.01);
    hg_refbuf_unref(one);
    hg_refbuf_unref(eight);
    hg_refbuf_unref(many);
}

// Of a floor in parallel projection: seen from above, and from below it, where it lies behind the
// eye and is seen all the same.
static uint32_t branches_of_floor(struct rig *rig, double height, double half_height)
{
    struct hg_view_params params = defaults;
    const struct hg_view_camera camera = {.eye = {0, height, 0},
        .target = {0, height - 1, 0},
        .up = {0, 0, 1},
        .orthographic = true,
        .half_height = (float)half_height};
    params.samples = 1;
    struct hg_view *view = path_rig_view(rig, &params);
    path_rig_set_camera(view, &camera);
    path_rig_settle(view);
    const uint32_t bits = path_rig_report(view).path.branch_bits;
    hg_view_destroy(view);
    return bits;
}

static void test_branches_chosen(void **state)
{
    struct rig *rig = *state;
    rig_scene(rig);
    path_rig_environment(rig, 0.5f);
    path_rig_floor(rig, path_rig_lambert(rig, 0.5f), 1.0f);
    for (int below = 0; below < 2; below++) {
        const double height = below ? -0.5 : 2.0;
        assert_int_equal(branches_of_floor(rig, height, 0.9), 0);  // all rays meet it
        assert_int_equal(branches_of_floor(rig, height, 1.42), 1); // half of them: two
        assert_int_equal(branches_of_floor(rig, height, 5.0), 3);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_resting_view),
        cmocka_unit_test(test_changes_unread), cmocka_unit_test(test_looked_at_late),
        cmocka_unit_test(test_shown_otherwise), cmocka_unit_test(test_lens),
        cmocka_unit_test(test_filters), cmocka_unit_test(test_clamp),
        cmocka_unit_test(test_neighbours), cmocka_unit_test(test_backends),
        cmocka_unit_test(test_branches), cmocka_unit_test(test_branches_chosen)};
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
