// The script language: what parses into what, and what is refused where.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/alloc.h"
#include "client/cli/run/script.h"

static const char *variable(void *user, const char *file, const char *name, size_t length)
{
    (void)user;
    if (length == 4 && memcmp(name, "FILE", 4) == 0)
        return file;
    if (length == 3 && memcmp(name, "DIR", 3) == 0)
        return "a b";
    return NULL;
}

// "part.hs" and "loop.hs" are all files that there are.
static enum hg_status include(void *user, const char *path, char **text, struct hg_error *err)
{
    (void)user;
    const char *found = strcmp(path, "part.hs") == 0   ? "wait settled\nload ${FILE}\n"
                        : strcmp(path, "loop.hs") == 0 ? "\ninclude loop.hs\n"
                        : strcmp(path, "bad.hs") == 0  ? "\n\nfly\n"
                                                       : NULL;
    *text = found ? hg_strdup(found) : NULL;
    return *text ? HG_OK : hg_error_set(err, HG_E_NOTFOUND, path, NULL, "no such file");
}

static const struct hg_cli_script_source source = {variable, include, NULL};

static void parse_good(const char *text, struct hg_cli_script *script)
{
    struct hg_error err = {0};
    if (hg_cli_script_parse("t.hs", text, &source, script, &err))
        fail_msg("%s: %s", err.what, err.reason);
}

static void test_good(void **state)
{
    (void)state;
    struct hg_cli_script s;
    parse_good("# a comment\n"
               "\n"
               "connect unix:/run/x\n"
               "load \"${DIR}/x y.glb\" as 3   # more\n"
               "load 'it''s ${DIR}'\n"
               "set size 640x480\r\n"
               "set env sky turbidity 3 rotation 90\n"
               "set background 0.1,0.2,0.3\n"
               "set tonemap pbr-neutral\n"
               "set debug-view lod\n"
               "set error-px 0.5\n"
               "set target-ms 40\n"
               "set node box translation 1 2 3 next-translation 4 5 6 visible no\n"
               "set material 1:4 base_color 1,0,0,1 roughness 0.5\n"
               "camera orbit 0,90,2 target 0 1 0 fov 30\n"
               "camera eye 1 2 3\n"
               "camera node eye\n"
               "camera fit view top fov 90\n"
               "time 1.5 as 2\n"
               "wait settled\n"
               "frame out.png now\n"
               "expect psnr ref.png >= 40\n"
               "expect stat frame.samples == 32\n"
               "expect pick 10 20 node \"a box\"\n"
               "expect pick 10 20 nothing\n"
               "expect hash 00112233445566778899aabbccddeeff00112233445566778899aabbccddeeff",
        &s);
    assert_int_equal(s.count, 24);
    assert_int_equal(s.steps[0].kind, HG_CLI_STEP_CONNECT);
    assert_int_equal(s.steps[0].line, 3);
    assert_string_equal(s.steps[1].path, "a b/x y.glb");
    assert_int_equal(s.steps[1].asset, 3);
    assert_string_equal(s.steps[2].path, "its ${DIR}");
    assert_int_equal(s.steps[3].view.height, 480);
    assert_true(s.steps[4].environment.has_turbidity);
    assert_true(fabs(s.steps[4].environment.rotation_rad - 1.5707963f) < 1e-6);
    assert_int_equal(s.steps[5].view.background, HGP_background_COLOR);
    assert_int_equal(s.steps[6].view.tonemap, HGP_tonemap_PBR_NEUTRAL);
    assert_true(s.steps[7].view.has_debug_view && s.steps[7].view.debug_view == HGP_debug_view_LOD);
    assert_true(s.steps[8].view.has_error_px && s.steps[8].view.error_px == 0.5f);
    assert_true(s.steps[9].view.has_target_ms && s.steps[9].view.target_ms == 40);
    assert_true(s.steps[10].node.has_visible && !s.steps[10].node.visible);
    assert_true(s.steps[10].node.has_next_translation);
    assert_true(s.steps[10].node.next_translation[2] == 6 && !s.steps[10].node.has_next_scale);
    assert_true(s.steps[10].node.translation[2] == 3);
    assert_true(s.steps[11].material.has_roughness && s.steps[11].material.base_color[0] == 1);
    assert_true(fabs(s.steps[12].camera.eye[2] - 2) < 1e-6 && s.steps[12].camera.eye[1] == 1);
    assert_true(s.steps[13].camera.eye[1] == 2);
    assert_int_equal(s.steps[14].kind, HG_CLI_STEP_CAMERA_NODE);
    assert_int_equal(s.steps[15].kind, HG_CLI_STEP_CAMERA_FIT);
    assert_true(s.steps[15].fit.has_elevation_rad && s.steps[15].fit.elevation_rad > 1.57f);
    assert_true(fabs(s.steps[15].fit.vfov_rad - 1.5707963f) < 1e-6);
    assert_int_equal(s.steps[16].asset, 2);
    assert_true(s.steps[17].kind == HG_CLI_STEP_FRAME && !s.steps[17].path);
    assert_true(s.steps[18].now);
    assert_true(s.steps[19].op == HG_CLI_OP_GE && s.steps[19].number == 40);
    assert_string_equal(s.steps[19].text, "expect psnr ref.png >= 40");
    assert_string_equal(s.steps[21].name, "a box");
    assert_null(s.steps[22].name);
    hg_cli_script_finish(&s);
}

static void test_path_keys(void **state)
{
    (void)state;
    struct hg_cli_script s;
    parse_good("set mode path\nset spp 7\nset trace khr\nset noise 0.5\nset time 3\n"
               "set max-bounces 9\nat 2.5\nset filter gaussian\nset filter-radius 2\n"
               "set clamp-indirect 3\ncamera eye 1,2,3 target 0,0,1 lens 0.5 focus 4\n"
               "camera node c lens 0.25\nset node floor catches_shadows yes\n"
               "set env sky sun off turbidity 4\nset env sky sun 0 1 2\n",
        &s);
    assert_int_equal(s.count, 15);
    assert_true(s.steps[13].environment.has_sun && !s.steps[13].environment.sun);
    assert_true(s.steps[13].environment.turbidity == 4);
    assert_true(!s.steps[13].environment.has_sun_direction);
    assert_true(s.steps[14].environment.sun && s.steps[14].environment.sun_direction[2] == 2);
    assert_true(s.steps[0].view.has_mode && s.steps[0].view.mode == HGP_render_mode_PATH);
    assert_true(s.steps[1].view.has_samples && s.steps[1].view.samples == 7);
    assert_true(s.steps[2].view.has_trace && s.steps[2].view.trace == HGP_trace_backend_KHR);
    assert_true(s.steps[3].view.has_noise && s.steps[3].view.noise == 0.5f);
    assert_true(s.steps[4].view.has_time_limit_s && s.steps[4].view.time_limit_s == 3);
    assert_true(s.steps[5].view.has_max_bounces && s.steps[5].view.max_bounces == 9);
    assert_int_equal(s.steps[6].kind, HG_CLI_STEP_TIME);
    assert_true(s.steps[6].number == 2.5);
    assert_true(s.steps[7].view.has_filter && s.steps[7].view.filter == HGP_filter_GAUSSIAN);
    assert_true(s.steps[8].view.has_filter_radius_px && s.steps[8].view.filter_radius_px == 2);
    assert_true(s.steps[9].view.has_clamp_indirect && s.steps[9].view.clamp_indirect == 3);
    assert_true(s.steps[10].camera.lens_radius == 0.5f && s.steps[10].camera.focus_distance == 4);
    assert_int_equal(s.steps[11].kind, HG_CLI_STEP_CAMERA_NODE);
    assert_true(s.steps[11].camera.lens_radius == 0.25f);
    assert_true(s.steps[12].node.has_catches_shadows && s.steps[12].node.catches_shadows);
    hg_cli_script_finish(&s);
}

static void test_backgrounds(void **state)
{
    (void)state;
    struct hg_cli_script s;
    parse_good("set background '#ff8000'\nset background blur\nset background grey\n"
               "set background '#fff'\n",
        &s);
    assert_int_equal(s.steps[0].view.background, HGP_background_DISPLAY);
    assert_true(s.steps[0].view.background_color[0] == 1);
    assert_true(fabs(s.steps[0].view.background_color[1] - 0.2158605f) < 1e-6);
    assert_int_equal(s.steps[1].view.background, HGP_background_BLUR);
    assert_true(!s.steps[1].view.has_background_color);
    assert_true(fabs(s.steps[2].view.background_color[2] - 0.2158605f) < 1e-6);
    assert_true(s.steps[3].view.background_color[2] == 1);
    hg_cli_script_finish(&s);
}

static void test_include(void **state)
{
    (void)state;
    struct hg_cli_script s;
    struct hg_error err = {0};
    parse_good("load a\ninclude part.hs\nload b\n", &s);
    assert_int_equal(s.count, 4);
    assert_string_equal(s.steps[0].file, "t.hs");
    assert_string_equal(s.steps[2].file, "part.hs");
    assert_string_equal(s.steps[2].path, "part.hs"); // variables are those of the line's file
    assert_int_equal(s.steps[2].line, 2);
    assert_int_equal(s.steps[3].line, 3);
    hg_cli_script_finish(&s);
    assert_int_equal(
        hg_cli_script_parse("t.hs", "\ninclude bad.hs\n", &source, &s, &err), HG_E_INVAL);
    assert_string_equal(err.what, "bad.hs:3");
    assert_int_equal(
        hg_cli_script_parse("t.hs", "\ninclude gone.hs\n", &source, &s, &err), HG_E_NOTFOUND);
    assert_string_equal(err.what, "t.hs:2");
    assert_string_equal(err.reason, "gone.hs: no such file");
    assert_int_equal(
        hg_cli_script_parse("t.hs", "include loop.hs\n", &source, &s, &err), HG_E_INVAL);
    assert_non_null(strstr(err.reason, "includes nest deeper than 16"));
}

static void test_values(void **state)
{
    (void)state;
    struct hg_cli_script s;
    parse_good("expect stat a.b == true\nexpect stat a.b != no\nexpect stat c > 1e3\n"
               "expect stat device.name == \"llvm pipe\"\nexpect flip r.png < 0.1 mask m.png\n"
               "scene show\n",
        &s);
    assert_true(s.steps[0].number == 1 && s.steps[1].number == 0 && s.steps[2].number == 1000);
    assert_true(isnan(s.steps[3].number));
    assert_string_equal(s.steps[3].value, "llvm pipe");
    assert_string_equal(s.steps[4].mask, "m.png");
    assert_int_equal(s.steps[5].kind, HG_CLI_STEP_SCENE);
    assert_string_equal(s.steps[5].name, "show");
    hg_cli_script_finish(&s);
}

// A list stands for what the mode has, whichever comes first, until it is taken back or the
// session ends.
static void test_planes(void **state)
{
    (void)state;
    const uint32_t depth = 1u << HGP_plane_DEPTH, noisy = 1u << HGP_plane_NOISY;
    const uint32_t light = 1u << HGP_plane_DIRECT_DIFFUSE;
    struct hg_cli_script s;
    parse_good("set aov depth,crypto-asset\nset aov all\nset mode path\nset denoise still\n"
               "set spp 3\nset aov Direct\nset denoise off\nset aov none\nset spp 4\n"
               "set aov depth\nconnect\nset debug-view lod\n",
        &s);
    const struct hgp_view_set *v[12];
    for (int i = 0; i < 12; i++)
        v[i] = &s.steps[i].view;
    assert_true(v[0]->has_planes && v[0]->planes == (depth | 1u << HGP_plane_CRYPTO_ASSET));
    assert_true((v[1]->planes & depth) && !(v[1]->planes & light));
    assert_true(v[2]->has_planes && (v[2]->planes & depth) && (v[2]->planes & light));
    assert_true(!(v[2]->planes & noisy) && v[3]->planes == (v[2]->planes | noisy));
    assert_true(v[4]->planes == v[3]->planes);
    assert_true((v[5]->planes & light) && (v[5]->planes & noisy) && !(v[5]->planes & depth));
    assert_true(v[6]->planes == (v[5]->planes & ~noisy));
    assert_true(v[7]->has_planes && v[7]->planes == 0 && !v[8]->has_planes);
    assert_true(v[9]->planes == depth && !v[11]->has_planes);
    hg_cli_script_finish(&s);
    struct hg_error err = {0};
    assert_int_equal(
        hg_cli_script_parse("t.hs", "set aov depth\nset debug-view lod\n", &source, &s, &err),
        HG_E_INVAL);
    assert_string_equal(err.what, "t.hs:2");
    assert_non_null(strstr(err.reason, "a debug view has no planes"));
}

static void test_bad(void **state)
{
    (void)state;
    static const struct {
        const char *line, *reason;
    } bad[] = {
        {"fly", "unknown command 'fly'"},
        {"load", "path is missing"},
        {"load a b", "'b' is one word too many"},
        {"load a as 0", "asset"},
        {"load \"a", "quotation mark"},
        {"load ${NOPE}", "'NOPE' is not defined"},
        {"load ${", "without a name"},
        {"load ${}", "without a name"},
        {"set", "what to set is missing"},
        {"set debug-view shiny", "debug-view: 'shiny' is none of off|mip|residency"},
        {"set denoise on", "denoise: 'on' is none of off|still|animation"},
        {"set tonemap pbr-netral", "did you mean 'pbr-neutral'?"},
        {"set error-px 0", "error-px"},
        {"set colour red", "'colour' cannot be set"},
        {"set sise 64x64", "'sise' cannot be set; did you mean size?"},
        {"set expsure 1", "did you mean exposure?"},
        {"set toonmap agx", "did you mean tonemap?"},
        {"expct hash x", "unknown command 'expct'; did you mean expect?"},
        {"set size 640", "not a size"},
        {"set env x.hdr brightness 3", "'brightness'"},
        {"set samples 0", "outside"},
        {"set node x", "is missing"},
        {"set node x next-rotation 0 0 1", "is missing"},
        {"set node x next 1 2 3", "is not"},
        {"set shutter 0.5 -0.5", "closes before it opens"},
        {"set shutter 0 2", "shutter"},
        {"set aov", "planes is missing"},
        {"set aov depth,shine", "aov: 'shine' is none of: albedo"},
        {"set aov depth,direct", "aov: 'direct' needs mode path"},
        {"set node x translation 1 2", "translation: number 3 of 3 is missing"},
        {"set material m metallic 2", "outside"},
        {"set material m alpha_mode glass", "alpha_mode: 'glass' is none of opaque|mask|blend"},
        {"camera", "is missing"},
        {"camera orbit 1 2", "is missing"},
        {"camera orbit 0,90,-1", "negative"},
        {"camera eye 1 2 3 target 1 2 3", "same point"},
        {"camera eye 1 2 3 fov 0", "outside"},
        {"camera fit view aside", "'aside' is none of front"},
        {"camera fit view", "view is missing"},
        {"load a.stl as 2 up W", "'W' is none of auto +X"},
        {"load a.stl up", "axis is missing"},
        {"time -1", "outside"},
        {"frame", "file to write is missing"},
        {"frame out.gif", "out.gif: the name ends in none of .png"},
        {"wait", "'settled' is missing"},
        {"expect", "is missing"},
        {"expect beauty x >= 1", "none of psnr"},
        {"expect psnr ref.png", "is missing"},
        {"expect psnr ref.png => 3", "'=>' is none of"},
        {"expect psnr ref.png >= abc", "not a number"},
        {"expect pick 1 2", "is missing"},
        {"expect hash 12", "hexadecimal"},
        {"expect stat a", "is missing"},
        {"expect stat a > path", "texts are compared with == and !="},
        {"expect max r.png < 1 mask", "mask file is missing"},
        {"include", "file to include is missing"},
        {"include part.hs twice", "one word too many"},
        {"scene \"\"", "is empty"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        char text[256];
        struct hg_cli_script s;
        struct hg_error err = {0};
        snprintf(text, sizeof text, "# first\n%s\nwait settled\n", bad[i].line);
        if (hg_cli_script_parse("dir/t.hs", text, &source, &s, &err) != HG_E_INVAL)
            fail_msg("taken: %s", bad[i].line);
        assert_string_equal(err.what, "dir/t.hs:2");
        if (!strstr(err.reason, bad[i].reason))
            fail_msg("%s: says '%s'", bad[i].line, err.reason);
        assert_null(s.steps);
    }
}

// Every prefix of a valid script parses or is refused, and fails cleanly at every allocation.
static void test_robust(void **state)
{
    (void)state;
    static const char text[] = "load \"x y\" as 2\nset node a translation 1 2 3\n"
                               "camera orbit 1,2,3 target 0,0,0\nexpect ssim r.png > 0.9\n"
                               "include part.hs\nexpect stat a != b\n";
    for (size_t n = 0; n < sizeof text; n++) {
        char part[sizeof text];
        struct hg_cli_script s;
        struct hg_error err;
        snprintf(part, sizeof part, "%.*s", (int)n, text);
        if (hg_cli_script_parse("t", part, &source, &s, &err) == HG_OK)
            hg_cli_script_finish(&s);
    }
    bool failed = true;
    for (uint64_t n = 1; failed; n++) {
        struct hg_cli_script s;
        hg_alloc_fail_at(n);
        failed = hg_cli_script_parse("t", text, &source, &s, NULL) != HG_OK;
        hg_alloc_fail_at(0);
        if (!failed)
            hg_cli_script_finish(&s);
        assert_true(n < 1000);
    }
}

static void test_ops(void **state)
{
    (void)state;
    assert_true(hg_cli_op_holds(HG_CLI_OP_GE, 2, 2) && !hg_cli_op_holds(HG_CLI_OP_GT, 2, 2));
    assert_true(hg_cli_op_holds(HG_CLI_OP_LE, 2, 2) && !hg_cli_op_holds(HG_CLI_OP_LT, 2, 2));
    assert_true(hg_cli_op_holds(HG_CLI_OP_EQ, 2, 2) && !hg_cli_op_holds(HG_CLI_OP_NE, 2, 2));
    assert_false(hg_cli_op_holds(HG_CLI_OP_GE, NAN, 2));
}

// How the view shows the scene, and what is seen at its pixels.
static void test_looks(void **state)
{
    (void)state;
    struct hg_cli_script s;
    parse_good("set clip 0,0,-1 0.5 1 0 0 -2 caps hatch 1,0,0 6\n"
               "set clip none\n"
               "set override \"a box\" hidden no tint 1,0.5,0 0.25 alpha 0.5\n"
               "set override \"a box\" none\n"
               "set override none\n"
               "set view-variant red as 2\n"
               "set layers 5\n"
               "set node box layers 2\n"
               "expect seen 1 2 30 40 node box >= 100\n"
               "expect distance 1 2 3 4 <= 0.5\n",
        &s);
    const struct hgp_view_clip *clip = &s.steps[0].clip;
    assert_int_equal(clip->planes.count, 2);
    assert_float_equal(clip->planes.items[0].normal[2], -1, 0);
    assert_float_equal(clip->planes.items[1].distance, -2, 0);
    assert_int_equal(clip->caps, HGP_cap_style_HATCH);
    assert_float_equal(clip->hatch_px, 6, 0);
    assert_int_equal(s.steps[1].clip.planes.count, 0);
    assert_int_equal(s.steps[2].override.set, 1 | 2 | 8);
    assert_false(s.steps[2].override.hidden);
    assert_float_equal(s.steps[2].override.tint[3], 0.25f, 0);
    assert_int_equal(s.steps[3].override.set, 0);
    assert_non_null(s.steps[3].name);
    assert_null(s.steps[4].name);
    assert_int_equal(s.steps[5].kind, HG_CLI_STEP_VIEW_VARIANT);
    assert_int_equal(s.steps[5].asset, 2);
    assert_int_equal(s.steps[6].view.layers, 5);
    assert_int_equal(s.steps[7].node.layers, 2);
    assert_int_equal(s.steps[8].height, 40);
    assert_float_equal(s.steps[9].number, 0.5, 0);
    hg_cli_script_finish(&s);
}

static void test_looks_that_are_refused(void **state)
{
    static const char *const bad[] = {"set clip", "set clip 0,0,1", "set clip 0,0,nan 1",
        "set clip 0,0,1 1 caps blue", "set clip 0,0,1 1 caps color 2,0,0",
        "set clip 1,0,0 1 1,0,0 1 1,0,0 1 1,0,0 1 1,0,0 1 1,0,0 1 1,0,0 1", "set override",
        "set override box", "set override box hidden maybe", "set override box tint 1,1,1",
        "set override box alpha 2", "set override box shiny yes", "set view-variant",
        "expect seen 1 2 0 4 node box > 1", "expect seen 1 2 3 4 box > 1",
        "expect distance 1 2 3 > 1", "expect distance 1 2 3 4 near 1"};
    (void)state;
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        struct hg_cli_script s;
        struct hg_error err = {0};
        assert_int_equal(hg_cli_script_parse("t.hs", bad[i], &source, &s, &err), HG_E_INVAL);
        assert_string_equal(err.what, "t.hs:1");
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_looks),
        cmocka_unit_test(test_looks_that_are_refused),
        cmocka_unit_test(test_good),
        cmocka_unit_test(test_path_keys),
        cmocka_unit_test(test_backgrounds),
        cmocka_unit_test(test_planes),
        cmocka_unit_test(test_include),
        cmocka_unit_test(test_values),
        cmocka_unit_test(test_bad),
        cmocka_unit_test(test_robust),
        cmocka_unit_test(test_ops),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
