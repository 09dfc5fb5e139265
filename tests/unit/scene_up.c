// scene_up.c - which axis of a file is taken as up, and that the asset is turned by it.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "renderer/scene/asset.h"
#include "tests/support/folder.h"

static char folder[TEST_FOLDER_MAX];

static int make_folder(void **state)
{
    (void)state;
    return !test_folder_make(folder, "up");
}

static int remove_folder(void **state)
{
    (void)state;
    return !test_folder_remove(folder);
}

// The box of a file, written now, in the scene.
struct shown {
    enum hg_up_axis up;
    char reason[128];
    float min[3], max[3];
};

static struct shown show(const char *name, const char *text, enum hg_up_axis up)
{
    char path[512];
    struct shown out = {0};
    struct hg_asset *asset;
    struct hg_scene *scene;
    struct hg_error err = {0};
    test_text_write(folder, name, text);
    snprintf(path, sizeof path, "%s/%s", folder, name);
    const struct hg_load_params params = {
        .path = path, .asset_number = 1, .scene_index = -1, .up = up};
    if (hg_load_asset(&params, &asset, &err))
        fail_msg("%s: %s: %s", name, err.where, err.reason);
    out.up = asset->file.up;
    snprintf(
        out.reason, sizeof out.reason, "%s", asset->file.up_reason ? asset->file.up_reason : "");
    assert_int_equal(hg_scene_create(&scene), HG_OK);
    assert_int_equal(hg_scene_add_asset(scene, asset, NULL), HG_OK);
    hg_scene_update(scene);
    assert_true(hg_scene_bounds(scene, NULL, out.min, out.max));
    hg_scene_destroy(scene);
    return out;
}

// A pyramid of base 2 a (x) x 2 b (y, at y0) under a top at z = c, as an OBJ behind `header`.
static const char *pyramid(const char *header, float y0, float z0, float height)
{
    static char text[1024];
    snprintf(text, sizeof text,
        "%sv -1 %g %g\nv 1 %g %g\nv 1 %g %g\nv -1 %g %g\nv 0 %g %g\nf 1 2 5\nf 2 3 5\nf 3 4 5\nf 4 "
        "1 5\n",
        header, (double)(y0 - 1), (double)z0, (double)(y0 - 1), (double)z0, (double)(y0 + 1),
        (double)z0, (double)(y0 + 1), (double)z0, (double)y0, (double)(z0 + height));
    return text;
}

static void expect_up(const char *name, const char *text, enum hg_up_axis up, const char *reason)
{
    const struct shown s = show(name, text, HG_UP_AUTO);
    if (s.up != up || !strstr(s.reason, reason))
        fail_msg("%s: axis %d (%s) instead of %d (%s)\n%s", name, s.up, s.reason, up, reason, text);
}

static void test_guesses(void **state)
{
    (void)state;
    static const char stl[] =
        "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n"
        "vertex 0 1 0\nendloop\nendfacet\nendsolid a\n";
    static const char ply[] = "ply\nformat ascii 1.0\n%selement vertex 3\nproperty float x\n"
                              "property float y\nproperty float z\nelement face 1\n"
                              "property list uchar int vertex_indices\nend_header\n"
                              "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
    char text[512];
    expect_up("a.stl", stl, HG_UP_Z, "STL");
    // Ground: stands on z = 0 with the origin inside of the base, or on y = 0, or anywhere else.
    expect_up("a.obj", pyramid("", 0, 0, 3), HG_UP_Z, "stands on");
    expect_up("a.obj", pyramid("", 1, 0, 3), HG_UP_Y, "nothing");     // from y = 0 up
    expect_up("a.obj", pyramid("", 0, -1.5f, 3), HG_UP_Y, "nothing"); // around the origin
    expect_up("a.obj", pyramid("", 0, 0.5f, 3), HG_UP_Y, "nothing");  // above the ground
    expect_up("a.obj", pyramid("", 0, 0, 0.05f), HG_UP_Y, "nothing"); // a plate: on a wall as well
    expect_up("a.obj",
        "v 500000 5000000 300\nv 500100 5000000 310\nv 500000 5000100 305\nf 1 2 3\n", HG_UP_Z,
        "map");
    // Comments go before that; only comments count.
    expect_up("a.obj", pyramid("# Blender v2.93.1 OBJ File: ''\n", 0, 0, 3), HG_UP_Y, "exporter");
    expect_up("a.obj", pyramid("# Created by FreeCAD <http://www.freecad.org>\n", 1, 0, 3), HG_UP_Z,
        "exporter");
    expect_up("a.obj", pyramid("o FreeCAD\n", 1, 0, 3), HG_UP_Y, "nothing");
    snprintf(text, sizeof text, ply, "comment Created by Blender 4.1 - www.blender.org\n");
    expect_up("a.ply", text, HG_UP_Z, "exporter");
    snprintf(text, sizeof text, ply, "comment zipper output\n");
    expect_up("a.ply", text, HG_UP_Y, "exporter");
    snprintf(text, sizeof text, ply, "");
    expect_up("a.ply", text, HG_UP_Y, "nothing");
}

static void test_turns(void **state)
{
    (void)state;
    // The top of the pyramid at +Z; where it is when an axis has become +Y.
    static const struct {
        enum hg_up_axis up;
        int axis;
        float at;
    } turns[] = {{HG_UP_X, 2, 3}, {HG_UP_Y, 2, 3}, {HG_UP_Z, 1, 3}, {HG_UP_MINUS_X, 2, 3},
        {HG_UP_MINUS_Y, 2, 3}, {HG_UP_MINUS_Z, 1, -3}};
    for (size_t i = 0; i < sizeof turns / sizeof *turns; i++) {
        const struct shown s = show("b.obj", pyramid("", 0, 0, 3), turns[i].up);
        assert_int_equal(s.up, turns[i].up);
        assert_string_equal(s.reason, "given");
        const float end = turns[i].at > 0 ? s.max[turns[i].axis] : s.min[turns[i].axis];
        assert_true(fabsf(end - turns[i].at) < 1e-5f);
    }
    // A base beside the origin shows the other axes: x stays where Z turns, and goes up with X.
    struct shown s = show("b.obj", pyramid("", 5, 0, 3), HG_UP_MINUS_Y);
    assert_true(fabsf(s.min[1] + 6) < 1e-5f && fabsf(s.max[1] + 4) < 1e-5f);
    s = show("b.obj", pyramid("", 5, 0, 3), HG_UP_Z); // y = 5 goes to the back
    assert_true(fabsf(s.min[2] + 6) < 1e-5f && fabsf(s.max[2] + 4) < 1e-5f);
    s = show("b.obj", pyramid("", 5, 0, 3), HG_UP_X);
    assert_true(fabsf(s.min[0] + 6) < 1e-5f && fabsf(s.max[1] - 1) < 1e-5f);
    // Not asked for: nothing is turned or said.
    s = show("b.obj", pyramid("", 0, 0, 3), HG_UP_AS_FILE);
    assert_true(s.up == HG_UP_AS_FILE && !s.reason[0] && fabsf(s.max[2] - 3) < 1e-5f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_guesses),
        cmocka_unit_test(test_turns),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
