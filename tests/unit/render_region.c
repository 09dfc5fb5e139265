// render_region.c - regions of a picture are the same bytes as the whole picture has there: planes,
// both modes, displayed and in the background, in parts that meet inside of tiles and at odd
// pixels.
#include "base/alloc.h"
#include "tests/unit/render_rig.h"

enum { WIDTH = 84, HEIGHT = 52, CUT_X = 37, CUT_Y = 21 };

static const struct {
    uint32_t x, y, width, height;
} parts[] = {{0, 0, CUT_X, CUT_Y}, {CUT_X, 0, WIDTH - CUT_X, CUT_Y},
    {0, CUT_Y, CUT_X, HEIGHT - CUT_Y}, {CUT_X, CUT_Y, WIDTH - CUT_X, HEIGHT - CUT_Y}};

static struct rig rig;

static void set(const struct hg_view_params *params)
{
    test_ok(hg_view_set_params(rig.view, params, &rig.err), &rig.err);
}

static struct hg_view_params part_of(const struct hg_view_params *params, size_t part)
{
    struct hg_view_params p = *params;
    p.region[0] = (float)parts[part].x;
    p.region[1] = (float)parts[part].y;
    p.region[2] = (float)parts[part].width;
    p.region[3] = (float)parts[part].height;
    return p;
}

static struct hg_refbuf *read(int plane)
{
    struct hg_refbuf *out = NULL;
    if (plane < 0)
        return rig_pixels(&rig, HG_PIXEL_RGBA32F);
    test_ok(hg_view_read_plane(rig.view, (enum hg_plane)plane, &out, &rig.err), &rig.err);
    return out;
}

// One row after the other of a part, against the whole picture.
static void assert_part(
    const struct hg_refbuf *whole, const struct hg_refbuf *part, size_t number, size_t bytes)
{
    const size_t width = parts[number].width;
    assert_int_equal(whole->size, WIDTH * HEIGHT * bytes);
    assert_int_equal(part->size, width * parts[number].height * bytes);
    for (size_t y = 0; y < parts[number].height; y++)
        assert_memory_equal(part->data + y * width * bytes,
            whole->data + ((parts[number].y + y) * WIDTH + parts[number].x) * bytes, width * bytes);
}

enum { ALL_PARTS = 0xf, TWO_PARTS = 0x9 }; // bits of parts

// plane -1: the pixels. The parts are those of the whole picture.
static void check(const struct hg_view_params *params, int plane, bool final, uint32_t which)
{
    const size_t bytes = plane < 0 ? 16 : hg_plane_channels((enum hg_plane)plane) * sizeof(float);
    hg_view_set_final(rig.view, true);
    set(params);
    rig_settle(&rig, 16);
    struct hg_refbuf *whole = read(plane);
    for (size_t i = 0; i < sizeof parts / sizeof *parts; i++) {
        const struct hg_view_params p = part_of(params, i);
        if ((which >> i & 1) == 0)
            continue;
        hg_view_set_final(rig.view, final);
        set(&p);
        const struct hg_frame_info info = rig_settle(&rig, final ? 16 : 1);
        assert_int_equal(info.width, parts[i].width);
        assert_int_equal(info.height, parts[i].height);
        struct hg_refbuf *part = read(plane);
        assert_part(whole, part, i, bytes);
        hg_refbuf_unref(part);
    }
    hg_refbuf_unref(whole);
}

static const struct hg_view_params realtime = {
    .width = WIDTH, .height = HEIGHT, .samples = 2, .seed = 2};
static const struct hg_view_params path = {
    .width = WIDTH, .height = HEIGHT, .samples = 2, .seed = 2, .mode = HG_MODE_PATH};

static void open_model(const char *model)
{
    rig_open(&rig, false);
    rig_use_scene(&rig, rig_load(model, hg_renderer_jobs(rig.renderer)), &realtime);
    rig_look_at_scene(&rig, 0.4f);
}

static void close_model(void)
{
    rig_close_scene(&rig);
    rig_close(&rig);
}

static void test_realtime(void **state)
{
    (void)state;
    open_model(PANES); // glass reads what is behind it, outside of the region as well
    check(&realtime, -1, true, ALL_PARTS);
    check(&realtime, -1, false, TWO_PARTS);
    struct hg_view_params p = realtime;
    p.debug_view = HG_DEBUG_CLUSTER;
    check(&p, -1, true, 1);
    p = realtime;
    p.planes = 1u << HG_PLANE_DEPTH;
    check(&p, HG_PLANE_DEPTH, true, TWO_PARTS);
    close_model();
}

// With fewer samples where surfaces are alike all over.
static void test_gathered(void **state)
{
    struct hg_view_params p = realtime;
    (void)state;
    open_model(TEST_MODELS "/bearing.glb");
    p.gi = HG_GI_RAYS;
    p.samples = 12;
    check(&p, -1, false, 1);
    close_model();
}

// What rays told needs no shadow maps: pictures after it that do have them as they should be.
static void test_maps_after_rays(void **state)
{
    struct hg_view_params p = realtime;
    struct hg_refbuf *pixels[2];
    (void)state;
    p.samples = 12;
    for (int fresh = 0; fresh < 2; fresh++) {
        open_model(TEST_MODELS "/bearing.glb");
        hg_view_set_final(rig.view, true);
        p.gi = HG_GI_RAYS;
        set(&p);
        if (!fresh)
            rig_settle(&rig, 16);
        p.gi = HG_GI_NONE;
        set(&p);
        rig_settle(&rig, 16);
        pixels[fresh] = read(-1);
        close_model();
    }
    assert_memory_equal(pixels[0]->data, pixels[1]->data, pixels[0]->size);
    hg_refbuf_unref(pixels[0]);
    hg_refbuf_unref(pixels[1]);
}

static void test_path(void **state)
{
    (void)state;
    struct hg_view_params p = path;
    open_model(PANES);
    p.planes = 1u << HG_PLANE_NORMAL | 1u << HG_PLANE_OBJECT;
    check(&p, -1, true, ALL_PARTS);
    check(&p, HG_PLANE_NORMAL, true, 1);
    check(&p, HG_PLANE_OBJECT, true, 1);
    p = path;
    p.filter = HG_FILTER_GAUSSIAN;
    p.filter_radius_px = 4;
    check(&p, -1, true, TWO_PARTS);
    p = path; // tiles stop by their neighbours and by all of the picture
    p.samples = 24;
    p.noise = 0.5f;
    check(&p, -1, true, 1);
    p = path;
    p.denoise = HG_DENOISE_STILL;
    check(&p, -1, true, 1);
    close_model();
}

static double paths_of(void)
{
    char *text;
    test_ok(hg_renderer_stats_json(rig.renderer, rig.view, &text), &rig.err);
    const char *at = strstr(text, "\"paths\":");
    assert_non_null(at);
    const double paths = strtod(at + strlen("\"paths\":"), NULL);
    hg_free(text);
    return paths;
}

// Paths are traced for the region and its neighbours alone; a film goes on elsewhere, in a view of
// the same region.
static void test_film(void **state)
{
    (void)state;
    struct hg_view_params p = path;
    open_model(KNOT);
    hg_view_set_final(rig.view, true);
    set(&path);
    rig_settle(&rig, 16);
    const double whole = paths_of();
    p.region[0] = 68; // tile 4 of 6; 3 x 2 of 6 x 4 tiles, the last ones cut off by the picture
    p.region[1] = 52 - 4;
    p.region[2] = p.region[3] = 4;
    p.samples = 4;
    set(&p);
    rig_settle(&rig, 16);
    struct hg_refbuf *part = rig_pixels(&rig, HG_PIXEL_RGBA32F), *saved;
    assert_true(paths_of() / 4 < 0.35 * whole / 2);
    test_ok(hg_view_save(rig.view, &saved, &rig.err), &rig.err);
    struct hg_view_params other = p;
    other.region[0]--;
    set(&other);
    assert_int_equal(hg_view_load(rig.view, saved->data, saved->size, &rig.err), HG_E_INVAL);
    set(&p);
    test_ok(hg_view_load(rig.view, saved->data, saved->size, &rig.err), &rig.err);
    rig_settle(&rig, 16);
    struct hg_refbuf *again = rig_pixels(&rig, HG_PIXEL_RGBA32F);
    rig_assert_same(part, again);
    hg_refbuf_unref(again);
    hg_refbuf_unref(part);
    hg_refbuf_unref(saved);
    close_model();
}

static void test_refused(void **state)
{
    (void)state;
    static const float bad[][4] = {{0, 0, 85, 52}, {1, 0, 84, 52}, {0, 1, 84, 52}, {0, 0, 10, 0},
        {5, 0, 0, 0}, {-1, 0, 2, 2}, {0, 0, 16385, 1}, {0, 0.5f, 2, 2}, {NAN, 0, 2, 2}};
    open_model(KNOT);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        struct hg_view_params p = realtime;
        memcpy(p.region, bad[i], sizeof p.region);
        assert_int_equal(hg_view_set_params(rig.view, &p, &rig.err), HG_E_INVAL);
        assert_non_null(strstr(rig.err.where, "region"));
    }
    close_model();
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_realtime),
        cmocka_unit_test(test_gathered), cmocka_unit_test(test_maps_after_rays),
        cmocka_unit_test(test_path), cmocka_unit_test(test_film), cmocka_unit_test(test_refused)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
