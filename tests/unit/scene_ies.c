// Photometric files (IES LM-63): editions, symmetries, types, and what is no such file; lights of
// glTF that have them.
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "renderer/scene/asset.h"
#include "renderer/scene/light_table.h"
#include "scene_memory.h"

static struct memory_gltf file; // too large for the stack

static enum hg_status read_ies(const char *text, struct hg_light_table **out, struct hg_error *err)
{
    return hg_light_profile_read_ies("lamp.ies", text, strlen(text), out, err);
}

static struct hg_light_table *read_ok(const char *text)
{
    struct hg_light_table *table;
    struct hg_error err = {0};
    if (read_ies(text, &table, &err))
        fail_msg("%s: %s: %s", err.what, err.where, err.reason);
    return table;
}

// Candela in a direction, degrees from -z and from +x over +y.
static double candela(const struct hg_light_table *t, double theta, double phi)
{
    const double a = theta * M_PI / 180, b = phi * M_PI / 180;
    const float d[3] = {(float)(sin(a) * cos(b)), (float)(sin(a) * sin(b)), (float)-cos(a)};
    return (double)(t->peak_cd * hg_light_profile_at(t->words, d));
}

static void check(const struct hg_light_table *t, double theta, double phi, double expected)
{
    const double got = candela(t, theta, phi);
    if (fabs(got - expected) > 0.002 * fmax(expected, 1))
        fail_msg("%g, %g: %g cd, %g expected", theta, phi, got, expected);
}

#define HEAD "IESNA:LM-63-2002\r\n[TEST] 1\r\n[MANUFAC] none\r\nTILT=NONE\r\n"

// Editions differ in what stands before TILT=; multiplier and ballast factor scale.
static void test_editions(void **state)
{
    (void)state;
    static const char *const heads[] = {"A LAMP\nTILT=NONE\n", "IESNA91\n[TEST] x\nTILT=NONE\n",
        "IESNA:LM-63-1995\nTILT=NONE\n", HEAD, "IES:LM-63-2019\nTILT=lamp.tlt\n",
        "IESNA91\nTILT=INCLUDE\n1\n2\n0 90\n1 0.9\n"};
    for (size_t i = 0; i < sizeof heads / sizeof *heads; i++) {
        char text[512];
        snprintf(text, sizeof text, "%s1 -1 2.0 3 1 1 2 0,0,0\n0.5 1 20\n0 45 90\n0\n100 50\n0\n",
            heads[i]);
        struct hg_light_table *t = read_ok(text);
        check(t, 0, 0, 100);
        check(t, 22.5, 123, 75);
        check(t, 89, 10, 50.0 / 45);
        check(t, 100, 10, 0);
        assert_true(fabsf(t->peak_cd - 100) < 1e-4f);
        hg_light_table_unref(t);
    }
}

// A quadrant, a half about either plane, a whole turn with or without its last plane.
static void test_symmetries(void **state)
{
    (void)state;
    static const struct {
        const char *angles, *values;
        uint32_t planes;
        double at[8]; // 0, 45, ... degrees
    } cases[] = {
        {"0 90", "10 10 40 40", 2, {10, 25, 40, 25, 10, 25, 40, 25}},
        {"0 90 180", "10 10 40 40 20 20", 3, {10, 25, 40, 30, 20, 30, 40, 25}},
        {"90 180 270", "10 10 40 40 20 20", 3, {40, 25, 10, 25, 40, 30, 20, 30}},
        {"0 90 180 270 360", "10 10 40 40 20 20 80 80 10 10", 5, {10, 25, 40, 30, 20, 50, 80, 45}},
        {"0 90 180 270", "10 10 40 40 20 20 80 80", 4, {10, 25, 40, 30, 20, 50, 80, 45}},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[512];
        snprintf(text, sizeof text, HEAD "1 1000 1 2 %u 1 1 0 0 0\n1 1 20\n0 180\n%s\n%s\n",
            cases[i].planes, cases[i].angles, cases[i].values);
        struct hg_light_table *t = read_ok(text);
        for (int k = 0; k < 8; k++)
            check(t, 60, k * 45, cases[i].at[k]);
        hg_light_table_unref(t);
    }
}

// Floodlights: B is turned about the horizontal axis, A about the vertical one; halves are
// symmetric.
static void test_types(void **state)
{
    (void)state;
    for (int type = 2; type <= 3; type++) {
        char text[512];
        snprintf(text, sizeof text,
            HEAD "1 1000 1 3 3 %d 1 0 0 0\n1 1 20\n-90 0 90\n0 45 90\n90 90 90 45 45 45 0 0 0\n",
            type);
        struct hg_light_table *t = read_ok(text);
        check(t, 0, 0, 90);
        check(t, 60, 0, 90);  // along the vertical plane, which is that of x
        check(t, 30, 90, 60); // and across it, on both sides
        check(t, 30, 270, 60);
        // 30 degrees up and across: the horizontal angle of B is that to the vertical plane.
        const double x = 0.5, y = 0.5, z = sqrt(0.5), degrees = 180 / M_PI;
        const double h = type == 2 ? asin(y) * degrees : atan2(y, z) * degrees;
        check(t, acos(z) * degrees, atan2(y, x) * degrees, 90 - h);
        hg_light_table_unref(t);
    }
}

// Lumens of a distribution whose closed form is known: I cos^n has 2 pi I / (n + 1).
static void test_flux(void **state)
{
    (void)state;
    for (int n = 0; n <= 16; n += 4) {
        char text[4096];
        int at = snprintf(text, sizeof text, HEAD "1 -1 1 91 1 1 1 0 0 0\n1 1 20\n");
        for (int v = 0; v <= 90; v++)
            at += snprintf(text + at, sizeof text - (size_t)at, "%d\n", v);
        at += snprintf(text + at, sizeof text - (size_t)at, "0\n");
        for (int v = 0; v <= 90; v++)
            at += snprintf(
                text + at, sizeof text - (size_t)at, "%.6f\n", 500 * pow(cos(v * M_PI / 180), n));
        struct hg_light_table *t = read_ok(text);
        const double flux = (double)t->peak_cd * (double)t->solid_angle;
        const double expected = 2 * M_PI * 500 / (n + 1);
        print_message("cos^%d: %.3f lm, %.3f expected\n", n, flux, expected);
        // Light that ends at 90 degrees ends within a degree of the table.
        assert_true(fabs(flux / expected - 1) < (n ? 0.001 : 0.01));
        hg_light_table_unref(t);
    }
}

// Every error names the file, the line and what is wrong.
static void test_malformed(void **state)
{
    (void)state;
    static const struct {
        const char *text, *where, *reason;
    } cases[] = {
        {"", "line 1", "no line begins with TILT="},
        {"IESNA91\nTILT NONE\n", "line 3", "no line begins with TILT="},
        {"TILT=NONE\n", "line 2", "number of lamps"},
        {"TILT=NONE\n1 1000 x\n", "line 2", "candela multiplier"},
        {"TILT=NONE\n1 1000 0 2 1 1 1 0 0 0\n1 1 20\n0 90\n0\n1 1\n", "line 3", "above 0"},
        {"TILT=NONE\n1 1000 1 0 1 1 1 0 0 0\n1 1 20\n", "line 2", "vertical angles"},
        {"TILT=NONE\n1 1000 1 2.5 1 1 1 0 0 0\n1 1 20\n", "line 2", "vertical angles"},
        {"TILT=NONE\n1 1000 1 4000000000 1 1 1 0 0 0\n1 1 20\n", "line 2", "vertical angles"},
        {"TILT=NONE\n1 1000 1 4000 1 1 1 0 0 0\n1 1 20\n0 90\n", "line 2", "too short"},
        {"TILT=NONE\n1 1000 1 9 9 1 1 0 0 0\n1 1 20\n0 45 90\n0\n1 1\n", "line 3", "too short"},
        {"TILT=NONE\n1 1000 1 2 1 4 1 0 0 0\n1 1 20\n0 90\n0\n1 1\n", "line 2", "photometric type"},
        {"TILT=NONE\n1 1000 1 2 1 1 1 0 0 0\n1 1 20\n90 0\n0\n1 1\n", "line 4", "ascend"},
        {"TILT=NONE\n1 1000 1 2 1 1 1 0 0 0\n1 1 20\n0 190\n0\n1 1\n", "line 5", "vertical angles"},
        {"TILT=NONE\n1 1000 1 2 2 1 1 0 0 0\n1 1 20\n0 90\n45 90\n1 1 1 1\n", "line 5",
            "horizontal"},
        {"TILT=NONE\n1 1000 1 2 1 1 1 0 0 0\n1 1 20\n0 90\n0\n1\n", "line 7", "candela value"},
        {"TILT=NONE\n1 1000 1 2 1 1 1 0 0 0\n1 1 20\n0 90\n0\n1 -1\n", "line 6", "0 or more"},
        {"TILT=NONE\n1 1000 1 2 1 1 1 0 0 0\n1 1 20\n0 90\n0\n0 0\n", "line 6", "all candela"},
        {"TILT=NONE\n1 1000 1 2 1 1 1 0 0 0\n1 1 20\n0 90\n0\nnan 1\n", "line 6", "candela value"},
        {"TILT=INCLUDE\n1\n99999999\n0 1\n", "line 3", "tilt angles"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        struct hg_light_table *table;
        struct hg_error err = {0};
        assert_int_equal(read_ies(cases[i].text, &table, &err), HG_E_FORMAT);
        assert_null(table);
        assert_string_equal(err.what, "lamp.ies");
        if (strcmp(err.where, cases[i].where) != 0 || !strstr(err.reason, cases[i].reason))
            fail_msg("case %zu: %s: %s", i, err.where, err.reason);
    }
}

// EXT_lights_ies: lights of their own, and shapes of punctual ones; extras name profiles as well.
// What cannot be read is told.
static void test_gltf(void **state)
{
    (void)state;
    static const char ies[] = HEAD "1 -1 1 2 1 1 1 0 0 0\n1 1 20\n0 180\n0\n250 50\n";
    const uint32_t view = memory_view(&file, ies, sizeof ies - 1, 0);
    char json[4096];
    snprintf(json, sizeof json,
        "\"extensionsUsed\":[\"EXT_lights_ies\",\"KHR_lights_punctual\"],"
        "\"extensions\":{\"EXT_lights_ies\":{\"lights\":[{\"bufferView\":%u,\"mimeType\":"
        "\"application/x-ies-lm-63\"},{\"uri\":\"data:application/"
        "octet-stream;base64,VElMVD1OT05FCg==\"}]},"
        "\"KHR_lights_punctual\":{\"lights\":[{\"type\":\"point\",\"intensity\":7},"
        "{\"type\":\"spot\",\"extras\":{\"profile\":0,\"lumens\":100}},"
        "{\"type\":\"spot\",\"extras\":{\"profile\":5,\"texture\":0}}]}},"
        "\"nodes\":[{\"extensions\":{\"EXT_lights_ies\":{\"light\":0,\"multiplier\":2,\"color\":"
        "[1,0.5,3]}}},{\"extensions\":{\"EXT_lights_ies\":{\"light\":0},\"KHR_lights_punctual\":"
        "{\"light\":0}}},{\"extensions\":{\"EXT_lights_ies\":{\"light\":1}}}]",
        view);
    struct hg_asset *asset = memory_load_ok(&file, json);
    struct hg_light *const *l = asset->lights;
    assert_int_equal(asset->light_count, 4);
    assert_non_null(l[0]->profile);
    assert_true(hg_light_peak(l[0]) == 7);
    assert_non_null(l[1]->profile);
    // A cone of 45 degrees that falls off from its axis, by the square of a line in the cosine.
    assert_true(fabs((double)hg_light_peak(l[1]) * 2 * M_PI * (1 - sqrt(0.5)) / 3 - 100) < 0.01);
    assert_null(l[2]->profile);
    assert_true(hg_light_peak(l[3]) == 500 && l[3]->color[1] == 0.5f && l[3]->color[2] == 1);
    assert_ptr_equal(asset->nodes[0]->light, l[3]);
    assert_ptr_equal(asset->nodes[1]->light, l[0]);
    assert_null(asset->nodes[2]->light);
    assert_int_equal(asset->warning_count, 3);
    assert_non_null(strstr(asset->warnings[0].where, "lights/1/uri"));
    assert_non_null(strstr(asset->warnings[0].reason, "line 2"));
    hg_asset_destroy(asset);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_editions),
        cmocka_unit_test(test_symmetries), cmocka_unit_test(test_types),
        cmocka_unit_test(test_flux), cmocka_unit_test(test_malformed), cmocka_unit_test(test_gltf)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
